//! Linear maps from the corners of an element to the rows that its set is of.

use super::{V3, sub};

/// A linear map D from k corners to rows, the same in each coordinate.
pub trait Reduction: Send + Sync + 'static {
    /// Rows for `corners` corners: none where D is not for so many.
    fn rows(corners: usize) -> Option<usize>;

    /// v <- D x of the corners at `nodes`.
    fn reduce(x: &[V3], nodes: &[u32], v: &mut [V3]);

    /// f, one for each corner with rows in the first entries, becomes D^T f.
    fn spread(f: &mut [V3]);

    /// (D^T D)_ij among `corners` corners.
    fn normal(i: usize, j: usize, corners: usize) -> f64;
}

/// x_i - mean of all: Bouaziz et al. 2012.
#[derive(Clone, Copy, Debug)]
pub struct MeanCentred;

impl Reduction for MeanCentred {
    fn rows(corners: usize) -> Option<usize> {
        (corners > 0).then_some(corners)
    }

    fn reduce(x: &[V3], nodes: &[u32], v: &mut [V3]) {
        // Differences first, which an origin far away does not touch.
        let first = nodes.first().map_or([0.0; 3], |n| x[*n as usize]);
        for (v, n) in v.iter_mut().zip(nodes) {
            *v = sub(x[*n as usize], first);
        }
        Self::spread(v);
    }

    fn spread(f: &mut [V3]) {
        let n = f.len().max(1) as f64;
        let sum = f.iter().fold([0.0; 3], |s, f| [s[0] + f[0], s[1] + f[1], s[2] + f[2]]);
        f.iter_mut().for_each(|f| *f = sub(*f, sum.map(|s| s / n)));
    }

    fn normal(i: usize, j: usize, corners: usize) -> f64 {
        f64::from(u8::from(i == j)) - 1.0 / corners as f64
    }
}

/// x_1 - x_0.
#[derive(Clone, Copy, Debug)]
pub struct EdgeDifference;

impl Reduction for EdgeDifference {
    fn rows(corners: usize) -> Option<usize> {
        (corners == 2).then_some(1)
    }

    fn reduce(x: &[V3], nodes: &[u32], v: &mut [V3]) {
        if let ([a, b], [v]) = (nodes, v) {
            *v = sub(x[*b as usize], x[*a as usize]);
        }
    }

    fn spread(f: &mut [V3]) {
        if let [a, b] = f {
            *b = *a;
            *a = b.map(|c| -c);
        }
    }

    fn normal(i: usize, j: usize, _: usize) -> f64 {
        if i == j { 1.0 } else { -1.0 }
    }
}

/// x_1 - x_0 and x_2 - x_0: the sides of an angle at the tip x_0.
#[derive(Clone, Copy, Debug)]
pub struct TipDifferences;

impl Reduction for TipDifferences {
    fn rows(corners: usize) -> Option<usize> {
        (corners == 3).then_some(2)
    }

    fn reduce(x: &[V3], nodes: &[u32], v: &mut [V3]) {
        if let ([tip, a, b], [va, vb]) = (nodes, v) {
            let tip = x[*tip as usize];
            (*va, *vb) = (sub(x[*a as usize], tip), sub(x[*b as usize], tip));
        }
    }

    fn spread(f: &mut [V3]) {
        if let [tip, a, b] = f {
            (*a, *b) = (*tip, *a);
            *tip = [0, 1, 2].map(|d| -(a[d] + b[d]));
        }
    }

    fn normal(i: usize, j: usize, _: usize) -> f64 {
        match (i, j) {
            (0, 0) => 2.0,
            (i, j) if i == j => 1.0,
            (0, _) | (_, 0) => -1.0,
            _ => 0.0,
        }
    }
}

/// The vertex itself.
#[derive(Clone, Copy, Debug)]
pub struct Vertex;

impl Reduction for Vertex {
    fn rows(corners: usize) -> Option<usize> {
        (corners == 1).then_some(1)
    }

    fn reduce(x: &[V3], nodes: &[u32], v: &mut [V3]) {
        if let ([n], [v]) = (nodes, v) {
            *v = x[*n as usize];
        }
    }

    fn spread(_: &mut [V3]) {}

    fn normal(_: usize, _: usize, _: usize) -> f64 {
        1.0
    }
}

/// x_i - x_0 for all i > 0: what leads from a vertex to its neighbours.
#[derive(Clone, Copy, Debug)]
pub struct Spokes;

impl Reduction for Spokes {
    fn rows(corners: usize) -> Option<usize> {
        (corners > 1).then_some(corners.saturating_sub(1))
    }

    fn reduce(x: &[V3], nodes: &[u32], v: &mut [V3]) {
        if let [hub, others @ ..] = nodes {
            v.iter_mut().zip(others).for_each(|(v, n)| *v = sub(x[*n as usize], x[*hub as usize]));
        }
    }

    fn spread(f: &mut [V3]) {
        let mut sum = [0.0; 3];
        for i in (1..f.len()).rev() {
            f[i] = f[i - 1];
            sum = sub(sum, f[i]);
        }
        if let Some(hub) = f.first_mut() {
            *hub = sum;
        }
    }

    fn normal(i: usize, j: usize, corners: usize) -> f64 {
        match (i, j) {
            (0, 0) => corners as f64 - 1.0,
            (0, _) | (_, 0) => -1.0,
            (i, j) => f64::from(u8::from(i == j)),
        }
    }
}

/// The vertices themselves, any number of them: for sets that lie somewhere.
#[derive(Clone, Copy, Debug)]
pub struct Vertices;

impl Reduction for Vertices {
    fn rows(corners: usize) -> Option<usize> {
        (corners > 0).then_some(corners)
    }

    fn reduce(x: &[V3], nodes: &[u32], v: &mut [V3]) {
        v.iter_mut().zip(nodes).for_each(|(v, n)| *v = x[*n as usize]);
    }

    fn spread(_: &mut [V3]) {}

    fn normal(i: usize, j: usize, _: usize) -> f64 {
        f64::from(u8::from(i == j))
    }
}
