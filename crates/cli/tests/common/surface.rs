//! Surfaces made in memory, written as OBJ and read back by a reader of the tests' own.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt::Write;

/// A surface; indices are 0-based, negative ones are written as they are.
#[derive(Clone, Default)]
pub struct Surface {
    pub points: Vec<[f64; 3]>,
    pub faces: Vec<Vec<i64>>,
}

impl Surface {
    /// The heightfield z = 0.6 sin 2.5x cos 2y over [-1, 1]^2 with n x n cells of two triangles.
    pub fn patch(n: usize) -> Self {
        let at = |i: usize| 2.0 * i as f64 / n as f64 - 1.0;
        let point = |(x, y): (f64, f64)| [x, y, 0.6 * (2.5 * x).sin() * (2.0 * y).cos()];
        let points = (0..=n).flat_map(|i| (0..=n).map(move |j| point((at(i), at(j))))).collect();
        let mut faces = Vec::new();
        for [a, b, c, d] in cells(n, n) {
            faces.extend([vec![a, b, d], vec![d, b, c]]);
        }
        Surface { points, faces }
    }

    /// The same of quadrilaterals.
    pub fn quads(n: usize) -> Self {
        Surface { faces: cells(n, n).map(|c| c.to_vec()).collect(), ..Surface::patch(n) }
    }

    /// A sphere of n rings and n meridians, closed.
    pub fn sphere(n: usize) -> Self {
        let mut points = vec![[0.0, 0.0, 1.0]];
        for i in 1..n {
            for j in 0..n {
                let (t, p) = (PI * i as f64 / n as f64, 2.0 * PI * j as f64 / n as f64);
                points.push([t.sin() * p.cos(), t.sin() * p.sin(), t.cos()]);
            }
        }
        points.push([0.0, 0.0, -1.0]);
        let last = points.len() as i64 - 1;
        let at = |i: usize, j: usize| (1 + (i - 1) * n + j % n) as i64;
        let mut faces = Vec::new();
        for j in 0..n {
            faces.extend([vec![0, at(1, j), at(1, j + 1)], vec![last, at(n - 1, j + 1), at(n - 1, j)]]);
            for i in 1..n - 1 {
                faces.push(vec![at(i, j), at(i + 1, j), at(i, j + 1)]);
                faces.push(vec![at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]);
            }
        }
        Surface { points, faces }
    }

    /// A band of n x 2 cells with half a turn: it has one side and one border.
    pub fn moebius(n: usize) -> Self {
        let point = |i: usize, j: usize| {
            let (t, w) = (2.0 * PI * i as f64 / n as f64, 0.3 * (j as f64 - 1.0));
            let r = 1.0 + w * (t / 2.0).cos();
            [r * t.cos(), r * t.sin(), w * (t / 2.0).sin()]
        };
        let points = (0..n).flat_map(|i| (0..3).map(move |j| point(i, j))).collect();
        // Behind the last column comes the first, upside down.
        let at = |i: usize, j: usize| if i < n { (3 * i + j) as i64 } else { (2 - j) as i64 };
        let mut faces = Vec::new();
        for i in 0..n {
            for j in 0..2 {
                faces.push(vec![at(i, j), at(i + 1, j), at(i, j + 1)]);
                faces.push(vec![at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]);
            }
        }
        Surface { points, faces }
    }

    /// The same surface elsewhere and in another size.
    pub fn moved(&self, scale: f64, offset: [f64; 3]) -> Self {
        let place = |p: &[f64; 3]| [0, 1, 2].map(|k| scale * p[k] + offset[k]);
        Surface { points: self.points.iter().map(place).collect(), faces: self.faces.clone() }
    }

    /// This one and another beside it.
    pub fn with(mut self, other: &Surface) -> Self {
        let n = self.points.len() as i64;
        self.points.extend(&other.points);
        self.faces.extend(other.faces.iter().map(|f| f.iter().map(|v| v + n).collect()));
        self
    }

    pub fn obj(&self) -> String {
        let mut text = String::new();
        let number = |v: f64| if v.is_nan() { "nan".to_owned() } else { format!("{v:e}") };
        for p in &self.points {
            writeln!(text, "v {} {} {}", number(p[0]), number(p[1]), number(p[2])).unwrap();
        }
        for f in &self.faces {
            let word = |v: &i64| if *v < 0 { v.to_string() } else { (v + 1).to_string() };
            writeln!(text, "f {}", f.iter().map(word).collect::<Vec<_>>().join(" ")).unwrap();
        }
        text
    }
}

/// The cells of a grid of (n + 1) x (m + 1) points, y fastest: their corners, counter-clockwise seen from above.
fn cells(n: usize, m: usize) -> impl Iterator<Item = [i64; 4]> {
    let corner = move |i: usize, j: usize| (i * (m + 1) + j) as i64;
    (0..n).flat_map(move |i| {
        (0..m).map(move |j| [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)])
    })
}

/// What an OBJ file with texture coordinates says.
#[derive(Debug, PartialEq)]
pub struct Mapped {
    pub points: Vec<[f64; 3]>,
    pub uv: Vec<[f64; 2]>,
    /// (vertex, texture coordinate) of each corner.
    pub faces: Vec<Vec<(usize, usize)>>,
}

impl Mapped {
    pub fn parse(obj: &str) -> Self {
        let mut out = Mapped { points: vec![], uv: vec![], faces: vec![] };
        for line in obj.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            let number = |k: usize| words[k].parse::<f64>().unwrap();
            match words.first() {
                Some(&"v") => out.points.push([1, 2, 3].map(number)),
                Some(&"vt") => out.uv.push([1, 2].map(number)),
                Some(&"f") => {
                    let corner = |w: &&str| {
                        let parts: Vec<&str> = w.split('/').collect();
                        (parts[0].parse::<usize>().unwrap() - 1, parts[1].parse::<usize>().unwrap() - 1)
                    };
                    out.faces.push(words[1..].iter().map(corner).collect());
                }
                _ => {}
            }
        }
        out
    }

    /// The places of each vertex in the map.
    pub fn places(&self) -> BTreeMap<usize, Vec<[f64; 2]>> {
        let mut out: BTreeMap<usize, Vec<[f64; 2]>> = BTreeMap::new();
        for (v, t) in self.faces.iter().flatten() {
            let places = out.entry(*v).or_default();
            if !places.contains(&self.uv[*t]) {
                places.push(self.uv[*t]);
            }
        }
        out
    }

    /// Largest extent of the map.
    pub fn size(&self) -> f64 {
        let extent = |k: usize| {
            let (low, high) = self.uv.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
            high - low
        };
        extent(0).max(extent(1))
    }

    /// Of each triangle: area on the surface, and the energy (s1^2 + s2^2 + s1^-2 + s2^-2) / 4 of its map; infinite
    /// where it is turned over or has no area.
    pub fn energies(&self) -> Vec<(f64, f64)> {
        let sum = |(area, [stretch, inverse]): (f64, [f64; 2])| (area, stretch + inverse);
        self.faces.iter().map(|f| sum(self.parts(f))).collect()
    }

    /// Of a triangle: area on the surface, (s1^2 + s2^2) / 4 and (s1^-2 + s2^-2) / 4, by |F|^2 = s1^2 + s2^2 and
    /// det F = s1 s2.
    fn parts(&self, face: &[(usize, usize)]) -> (f64, [f64; 2]) {
        let [p, q, r] = [0, 1, 2].map(|k| self.points[face[k].0]);
        let [a, b, c] = [0, 1, 2].map(|k| self.uv[face[k].1]);
        let (d, e) = ([0, 1, 2].map(|k| q[k] - p[k]), [0, 1, 2].map(|k| r[k] - p[k]));
        let dot = |x: [f64; 3], y: [f64; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
        let length = dot(d, d).sqrt();
        let (x, y) = (dot(d, e) / length, (dot(e, e) - dot(d, e).powi(2) / dot(d, d)).sqrt());
        let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        // F maps (length, 0) to u and (x, y) to v.
        let f0 = [u[0] / length, u[1] / length];
        let f1 = [(v[0] - x * f0[0]) / y, (v[1] - x * f0[1]) / y];
        let square = f0[0] * f0[0] + f0[1] * f0[1] + f1[0] * f1[0] + f1[1] * f1[1];
        let det = f0[0] * f1[1] - f0[1] * f1[0];
        let inverse = if det > 0.0 { 0.25 * square / (det * det) } else { f64::INFINITY };
        (0.5 * length * y, [0.25 * square, inverse])
    }

    /// The mean of the energies by area, in the scale where it is least: E(s) = a s^2 + b s^-2 there is 2 sqrt(a b).
    pub fn energy(&self) -> f64 {
        let mut sums = [0.0; 3];
        for (area, [stretch, inverse]) in self.faces.iter().map(|f| self.parts(f)) {
            sums = [sums[0] + area, sums[1] + area * stretch, sums[2] + area * inverse];
        }
        2.0 * (sums[1] * sums[2]).sqrt() / sums[0]
    }
}
