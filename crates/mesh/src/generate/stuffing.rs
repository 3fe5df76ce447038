//! Isosurface stuffing (Labelle and Shewchuk 2007): a body-centred cubic lattice cut by an implicit
//! surface. Lattice vertices close to the surface are moved onto it, the others are cut off; then
//! vertices slide to where the worst tetrahedron around them improves, those of the boundary on the
//! surface.

use std::collections::HashMap;

use super::smoothing::smooth;
use super::{invalid, positive};
use crate::error::Result;
use crate::mesh::Mesh;
use crate::vec3::{V3, lerp, norm, sub};

/// How close to a vertex, as a part of the edge, a cut moves that vertex onto the surface: for the
/// long (axis) and the short (diagonal) edges of the lattice. Values of the paper, Section 3.
const SNAP_LONG: f64 = 0.24999;
const SNAP_SHORT: f64 = 0.41189;

/// More lattice points than this are taken for a mistake.
const MOST_POINTS: f64 = 1e8;

/// Rounds of smoothing after the cut.
const SMOOTHING_ROUNDS: usize = 12;

/// Fills the set where `field` < 0 with tetrahedra: a lattice of cubic cells of edge `cell` over the
/// box from `lo` to `hi`, which must contain the set. The boundary vertices lie on `field` = 0.
/// About 12 tetrahedra for each cell volume. Features thinner than a cell may get lost.
///
/// # Errors
/// A cell size that is not positive, a lattice of over 1e8 points, or an empty set.
pub fn stuff(field: &dyn Fn(V3) -> f64, lo: V3, hi: V3, cell: f64) -> Result<Mesh> {
    positive("the cell size", cell)?;
    let mut dims = [0; 3];
    let mut origin = [0.0; 3];
    let mut total = 2.0;
    for c in 0..3 {
        positive("an edge of the box", hi[c] - lo[c])?;
        // One cell of margin on each side, the lattice centred on the box.
        let n = ((hi[c] - lo[c]) / cell).ceil() + 2.0;
        total *= n + 1.0;
        if total > MOST_POINTS {
            return Err(invalid(format!("a lattice of cells of {cell}"), "give a larger cell"));
        }
        dims[c] = n as usize;
        origin[c] = 0.5 * (lo[c] + hi[c]) - 0.5 * n * cell;
    }
    let mut lattice = Lattice::new(field, dims, origin, cell);
    lattice.find_cuts();
    lattice.snap();
    let (mut points, tets, on_surface) = lattice.cut();
    if tets.is_empty() {
        return Err(invalid("the lattice misses the body".into(), "give a smaller cell or the right box"));
    }
    smooth(field, &mut points, &tets, &on_surface, cell, SMOOTHING_ROUNDS);
    Ok(Mesh::from_tets("stuffed", points, tets))
}

struct Lattice<'a> {
    field: &'a dyn Fn(V3) -> f64,
    dims: [usize; 3],
    points: Vec<V3>,
    values: Vec<f64>, // of the field; negative inside, 0 where snapped
    cuts: HashMap<[u32; 2], V3>,
}

impl<'a> Lattice<'a> {
    fn new(field: &'a dyn Fn(V3) -> f64, dims: [usize; 3], origin: V3, cell: f64) -> Self {
        let [nx, ny, nz] = dims;
        let mut points = Vec::with_capacity(2 * (nx + 1) * (ny + 1) * (nz + 1));
        for (shift, extra) in [(0.0, 1), (0.5, 0)] {
            for k in 0..nz + extra {
                for j in 0..ny + extra {
                    for i in 0..nx + extra {
                        let at = |c: usize, i: usize| origin[c] + (i as f64 + shift) * cell;
                        points.push([at(0, i), at(1, j), at(2, k)]);
                    }
                }
            }
        }
        let values = points.iter().map(|&p| field(p)).collect();
        Lattice { field, dims, points, values, cuts: HashMap::new() }
    }

    fn corner(&self, i: [usize; 3]) -> u32 {
        (i[0] + (self.dims[0] + 1) * (i[1] + (self.dims[1] + 1) * i[2])) as u32
    }

    fn centre(&self, i: [usize; 3]) -> u32 {
        let corners = (self.dims[0] + 1) * (self.dims[1] + 1) * (self.dims[2] + 1);
        (corners + i[0] + self.dims[0] * (i[1] + self.dims[1] * i[2])) as u32
    }

    /// Calls `f` with the four corners of every tetrahedron, positively oriented: two neighbouring
    /// centres and an edge of the square between them.
    fn for_each_tet(&self, mut f: impl FnMut([u32; 4])) {
        let [nx, ny, nz] = self.dims;
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    for axis in 0..3 {
                        let here = [i, j, k];
                        let mut next = here;
                        next[axis] += 1;
                        if next[axis] >= self.dims[axis] {
                            continue;
                        }
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let square = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[a, b]| {
                            let mut c = next;
                            c[u] += a;
                            c[v] += b;
                            self.corner(c)
                        });
                        let (c0, c1) = (self.centre(here), self.centre(next));
                        for e in 0..4 {
                            // Counter-clockwise around the axis that runs from c0 to c1.
                            f([c0, square[e], square[(e + 1) % 4], c1]);
                        }
                    }
                }
            }
        }
    }

    /// Finds where the surface crosses the edges of the lattice.
    fn find_cuts(&mut self) {
        let mut crossing = Vec::new();
        self.for_each_tet(|t| {
            for e in crate::topology::TET_EDGES {
                let (a, b) = (t[e[0]].min(t[e[1]]), t[e[0]].max(t[e[1]]));
                if self.values[a as usize] * self.values[b as usize] < 0.0 {
                    crossing.push([a, b]);
                }
            }
        });
        crossing.sort_unstable();
        crossing.dedup();
        for [a, b] in crossing {
            let (p, q) = (self.points[a as usize], self.points[b as usize]);
            let (fp, fq) = (self.values[a as usize], self.values[b as usize]);
            self.cuts.insert([a, b], root(self.field, p, q, fp, fq));
        }
    }

    /// Moves vertices onto the surface where it cuts one of their edges close by.
    fn snap(&mut self) {
        let n_corners = self.centre([0, 0, 0]);
        let mut edges_of: HashMap<u32, Vec<[u32; 2]>> = HashMap::new();
        let mut all: Vec<[u32; 2]> = self.cuts.keys().copied().collect();
        all.sort_unstable();
        for &e in &all {
            edges_of.entry(e[0]).or_default().push(e);
            edges_of.entry(e[1]).or_default().push(e);
        }
        let mut vertices: Vec<u32> = edges_of.keys().copied().collect();
        vertices.sort_unstable();
        for v in vertices {
            let mut best: Option<(f64, V3)> = None;
            for e in &edges_of[&v] {
                let Some(&cut) = self.cuts.get(e) else { continue };
                let [p, q] = e.map(|w| self.points[w as usize]);
                let long = (e[0] < n_corners) == (e[1] < n_corners);
                let limit = if long { SNAP_LONG } else { SNAP_SHORT };
                let part = norm(sub(cut, self.points[v as usize])) / norm(sub(q, p));
                if part < limit && best.is_none_or(|(b, _)| part / limit < b) {
                    best = Some((part / limit, cut));
                }
            }
            if let Some((_, cut)) = best {
                self.points[v as usize] = cut;
                self.values[v as usize] = 0.0;
                for e in &edges_of[&v] {
                    self.cuts.remove(e);
                }
            }
        }
    }

    /// Keeps what is inside: points, tetrahedra, and whether each point lies on the surface.
    fn cut(&self) -> (Vec<V3>, Vec<[u32; 4]>, Vec<bool>) {
        let mut out = Output::default();
        self.for_each_tet(|t| {
            let of_sign = |s: fn(f64) -> bool| {
                let mut list: Vec<u32> = t.iter().copied().filter(|&v| s(self.values[v as usize])).collect();
                // One order for all: neighbours split the square between them alike.
                list.sort_unstable();
                list
            };
            let (inside, zero) = (of_sign(|f| f < 0.0), of_sign(|f| f == 0.0));
            let outside = of_sign(|f| f > 0.0);
            if inside.is_empty() {
                return;
            }
            let mut keep = |v: u32| out.vertex([v, v], self.points[v as usize], self.values[v as usize] == 0.0);
            let p: Vec<u32> = inside.iter().map(|&v| keep(v)).collect();
            let z: Vec<u32> = zero.iter().map(|&v| keep(v)).collect();
            let mut cut = |i: usize, o: usize| {
                let e = [inside[i].min(outside[o]), inside[i].max(outside[o])];
                out.vertex(e, self.cuts[&e], true)
            };
            match (p.len(), z.len(), outside.len()) {
                (_, _, 0) => {
                    let all: Vec<u32> = p.iter().chain(&z).copied().collect();
                    out.tet([all[0], all[1], all[2], all[3]]);
                }
                (1, _, n) => {
                    let mut all = vec![p[0]];
                    all.extend(&z);
                    all.extend((0..n).map(|o| cut(0, o)));
                    out.tet([all[0], all[1], all[2], all[3]]);
                }
                (2, 1, _) => {
                    let (a, b) = (cut(0, 0), cut(1, 0));
                    out.tet([p[0], p[1], b, z[0]]);
                    out.tet([p[0], b, a, z[0]]);
                }
                (2, _, _) => {
                    let (am, an, bm, bn) = (cut(0, 0), cut(0, 1), cut(1, 0), cut(1, 1));
                    // The square on the surface is nobody else's: its shorter diagonal.
                    let length = |x: u32, y: u32| norm(sub(out.points[x as usize], out.points[y as usize]));
                    if length(am, bn) <= length(an, bm) {
                        out.prism([p[0], am, an], [p[1], bm, bn]);
                    } else {
                        out.prism([p[0], an, am], [p[1], bn, bm]);
                    }
                }
                _ => {
                    let top = [cut(0, 0), cut(1, 0), cut(2, 0)];
                    out.prism([p[0], p[1], p[2]], top);
                }
            }
        });
        (out.points, out.tets, out.on_surface)
    }
}

#[derive(Default)]
struct Output {
    points: Vec<V3>,
    tets: Vec<[u32; 4]>,
    on_surface: Vec<bool>,
    numbers: HashMap<[u32; 2], u32>, // of a lattice vertex (twice the same) or of an edge's cut
}

impl Output {
    fn vertex(&mut self, key: [u32; 2], p: V3, on_surface: bool) -> u32 {
        *self.numbers.entry(key).or_insert_with(|| {
            self.points.push(p);
            self.on_surface.push(on_surface);
            self.points.len() as u32 - 1
        })
    }

    fn tet(&mut self, mut t: [u32; 4]) {
        // Every piece lies inside a positive tetrahedron of the lattice, in some order of corners.
        let x = t.map(|v| self.points[v as usize]);
        if crate::vec3::det4(x[0], x[1], x[2], x[3]) < 0.0 {
            t.swap(2, 3);
        }
        self.tets.push(t);
    }

    /// A prism with the diagonals a-b', a-c' and b-c'.
    fn prism(&mut self, [a, b, c]: [u32; 3], [a1, b1, c1]: [u32; 3]) {
        self.tet([a, b, c, c1]);
        self.tet([a, b, b1, c1]);
        self.tet([a, a1, b1, c1]);
    }
}

/// The zero of the field between two points of opposite sign: regula falsi in the Illinois form,
/// which keeps the bracket.
fn root(field: &dyn Fn(V3) -> f64, p: V3, q: V3, fp: f64, fq: f64) -> V3 {
    let (mut a, mut b, mut fa, mut fb) = (0.0, 1.0, fp, fq);
    for _ in 0..60 {
        let t = (a * fb - b * fa) / (fb - fa);
        let x = lerp(p, q, t);
        let ft = field(x);
        if ft == 0.0 || (b - a).abs() < 1e-12 || ft.abs() < 1e-14 * (fp.abs() + fq.abs()) {
            return x;
        }
        if (ft < 0.0) == (fb < 0.0) {
            fa *= 0.5;
        } else {
            (a, fa) = (b, fb);
        }
        (b, fb) = (t, ft);
    }
    lerp(p, q, b)
}
