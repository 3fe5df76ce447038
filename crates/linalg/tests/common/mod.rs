//! Matrices for tests.
#![allow(dead_code)]

use proxel_linalg::sparse::SymPattern;

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in -1..1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

/// A symmetric matrix: pattern and values of the lower triangle.
pub struct Matrix {
    pub pattern: SymPattern,
    pub values: Vec<f64>,
}

impl Matrix {
    pub fn n(&self) -> usize {
        self.pattern.n()
    }

    /// Random entries, diagonally dominant.
    pub fn random(pattern: SymPattern, random: &mut Random) -> Self {
        let mut m = Self { values: vec![0.0; pattern.nnz()], pattern };
        m.redraw(random);
        m
    }

    pub fn redraw(&mut self, random: &mut Random) {
        let n = self.n();
        let mut diagonal = vec![0.1; n];
        for j in 0..n {
            for slot in self.pattern.col_ptr()[j] + 1..self.pattern.col_ptr()[j + 1] {
                let v = random.unit() - 0.5;
                self.values[slot] = v;
                diagonal[j] += v.abs();
                diagonal[self.pattern.row_idx()[slot] as usize] += v.abs();
            }
        }
        for j in 0..n {
            self.values[self.pattern.diagonal_slot(j)] = diagonal[j];
        }
    }

    /// From a dense symmetric matrix, zeros off the diagonal left out.
    pub fn from_dense(n: usize, a: &[f64]) -> Self {
        let (mut ptr, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for j in 0..n {
            for i in j..n {
                if i == j || a[i * n + j] != 0.0 {
                    rows.push(i as u32);
                    values.push(a[i * n + j]);
                }
            }
            ptr.push(rows.len());
        }
        Self { pattern: SymPattern::from_lower_csc(n, ptr, rows).unwrap(), values }
    }

    pub fn dense(&self) -> Vec<f64> {
        let n = self.n();
        let mut a = vec![0.0; n * n];
        for j in 0..n {
            for slot in self.pattern.col_ptr()[j]..self.pattern.col_ptr()[j + 1] {
                let i = self.pattern.row_idx()[slot] as usize;
                a[i * n + j] = self.values[slot];
                a[j * n + i] = self.values[slot];
            }
        }
        a
    }

    /// The slow twin: textbook dense Cholesky.
    pub fn dense_solve(&self, b: &[f64], nrhs: usize) -> Vec<f64> {
        let n = self.n();
        let mut l = self.dense();
        for j in 0..n {
            for k in 0..j {
                for i in j..n {
                    l[i * n + j] -= l[i * n + k] * l[j * n + k];
                }
            }
            let pivot = l[j * n + j].sqrt();
            for i in j..n {
                l[i * n + j] /= pivot;
            }
        }
        let mut x = b.to_vec();
        for c in 0..nrhs {
            for i in 0..n {
                for k in 0..i {
                    x[i * nrhs + c] -= l[i * n + k] * x[k * nrhs + c];
                }
                x[i * nrhs + c] /= l[i * n + i];
            }
            for i in (0..n).rev() {
                for k in i + 1..n {
                    x[i * nrhs + c] -= l[k * n + i] * x[k * nrhs + c];
                }
                x[i * nrhs + c] /= l[i * n + i];
            }
        }
        x
    }

    /// Entries of L by boolean elimination in the order `perm[new] = old`.
    pub fn filled_entries(&self, perm: &[u32]) -> usize {
        let n = self.n();
        let a = self.dense();
        let mut filled: Vec<bool> =
            (0..n * n).map(|k| a[perm[k / n] as usize * n + perm[k % n] as usize] != 0.0).collect();
        let mut count = 0;
        for k in 0..n {
            let below: Vec<usize> = (k + 1..n).filter(|&i| filled[i * n + k]).collect();
            count += 1 + below.len();
            for &i in &below {
                for &j in &below {
                    filled[i * n + j] = true;
                }
            }
        }
        count
    }
}

/// A 3D grid with all 26 neighbours' half (7-point and one diagonal), random weights.
pub fn grid(a: usize, b: usize, c: usize, random: &mut Random) -> Matrix {
    let id = |i: usize, j: usize, k: usize| ((i * b + j) * c + k) as u32;
    let mut edges = Vec::new();
    for i in 0..a {
        for j in 0..b {
            for k in 0..c {
                for (p, q, r) in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 1)] {
                    if i + p < a && j + q < b && k + r < c {
                        edges.push([id(i, j, k), id(i + p, j + q, k + r)]);
                    }
                }
            }
        }
    }
    Matrix::random(SymPattern::from_edges(a * b * c, &edges).unwrap(), random)
}

/// Named matrices of all shapes, small enough for the dense twin.
pub fn shapes(random: &mut Random) -> Vec<(String, Matrix)> {
    let mut list = Vec::new();
    let mut add = |name: &str, n: usize, edges: Vec<[u32; 2]>, random: &mut Random| {
        let pattern = SymPattern::from_edges(n, &edges).unwrap();
        list.push((format!("{name} {n}"), Matrix::random(pattern, random)));
    };
    for n in [0, 1, 2, 5, 40] {
        add("diagonal", n, vec![], random);
    }
    for n in [3, 8, 9, 16, 17, 31, 33, 100, 150] {
        let all = (0..n as u32).flat_map(|i| (0..i).map(move |j| [i, j])).collect();
        add("dense", n, all, random);
        add("arrow down", n, (1..n as u32).map(|i| [0, i]).collect(), random);
        add("arrow up", n, (0..n as u32 - 1).map(|i| [n as u32 - 1, i]).collect(), random);
        add("chain", n, (1..n as u32).map(|i| [i - 1, i]).collect(), random);
        let (mut few, mut many) = (Vec::new(), Vec::new());
        for _ in 0..n {
            few.push([random.below(n) as u32, random.below(n) as u32]);
        }
        for _ in 0..4 * n {
            many.push([random.below(n) as u32, random.below(n) as u32]);
        }
        add("random forest-like", n, few, random);
        add("random", n, many, random);
    }
    // Several components, isolated vertices among them.
    let mut parts = Vec::new();
    for p in 0..5u32 {
        for i in 1..20 {
            parts.push([p * 30 + i, p * 30 + random.below(i as usize) as u32]);
            parts.push([p * 30 + i, p * 30 + random.below(20) as u32]);
        }
    }
    add("components", 160, parts, random);
    list.push(("grid".into(), grid(6, 5, 7, random)));
    list
}
