//! Hard sets to first order.

use super::{Cells, Reduction, Set, V3};

/// What a row asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// c = 0
    Zero,
    /// c <= 0
    NotAbove,
}

/// A function c of a local vector at a point: its value and its gradient by rows.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// c
    pub value: f64,
    /// What is asked of it.
    pub relation: Relation,
    /// dc/dv, a vector for each of the first rows.
    pub gradient: &'a [V3],
}

/// Functions c_r of x with sparse gradients, r by r: c_r(x + d) = value + sum_i gradient_i . d_i over the nodes i of r.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    starts: Vec<usize>, // of each row, and the end; empty for no rows
    nodes: Vec<u32>,
    gradients: Vec<V3>,
    values: Vec<f64>,
    relations: Vec<Relation>,
}

impl Rows {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Forgets all rows, and keeps their room.
    pub fn clear(&mut self) {
        self.starts.clear();
        self.nodes.clear();
        self.gradients.clear();
        self.values.clear();
        self.relations.clear();
    }

    /// Adds a row.
    pub fn push(&mut self, nodes: &[u32], gradient: &[V3], value: f64, relation: Relation) {
        if self.starts.is_empty() {
            self.starts.push(0);
        }
        self.nodes.extend_from_slice(nodes);
        self.gradients.extend_from_slice(&gradient[..nodes.len()]);
        self.starts.push(self.nodes.len());
        self.values.push(value);
        self.relations.push(relation);
    }

    /// Nodes and gradients of row `r`.
    pub fn row(&self, r: usize) -> (&[u32], &[V3]) {
        let range = self.starts[r]..self.starts[r + 1];
        (&self.nodes[range.clone()], &self.gradients[range])
    }

    /// The values c_r.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// What is asked of each row.
    pub fn relations(&self) -> &[Relation] {
        &self.relations
    }

    /// The change of row `r` along d: sum_i gradient_i . d_i.
    pub fn along(&self, r: usize, d: &[f64]) -> f64 {
        let (nodes, gradients) = self.row(r);
        let of = |(n, g): (&u32, &V3)| (0..3).map(|c| g[c] * d[*n as usize * 3 + c]).sum::<f64>();
        nodes.iter().zip(gradients).map(of).sum()
    }

    /// out += s grad c_r
    pub fn add_gradient(&self, r: usize, s: f64, out: &mut [f64]) {
        let (nodes, gradients) = self.row(r);
        for (n, g) in nodes.iter().zip(gradients) {
            for c in 0..3 {
                out[*n as usize * 3 + c] += s * g[c];
            }
        }
    }
}

/// Cells of any kind that have rows: one virtual call for all of them.
pub trait RowsOf: Send + Sync {
    /// See [`Cells::add_rows`].
    fn add_rows(&self, x: &[V3], near: f64, out: &mut Rows);

    /// See [`Cells::violation`].
    fn violation(&self, x: &[V3]) -> f64;

    /// See [`Cells::violations`].
    fn violations(&self, x: &[V3]) -> Vec<f64>;

    /// The nodes of an element.
    fn nodes(&self, e: usize) -> &[u32];
}

impl<R: Reduction, S: Set> RowsOf for Cells<R, S> {
    fn add_rows(&self, x: &[V3], near: f64, out: &mut Rows) {
        Cells::add_rows(self, x, near, out);
    }

    fn violation(&self, x: &[V3]) -> f64 {
        Cells::violation(self, x)
    }

    fn violations(&self, x: &[V3]) -> Vec<f64> {
        Cells::violations(self, x)
    }

    fn nodes(&self, e: usize) -> &[u32] {
        self.element(e)
    }
}
