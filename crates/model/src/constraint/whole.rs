//! Sets of one's own, which are asked for the nearest points of all elements at once.

use super::gather::{Gather, add_normal};
use super::{CellsError, Hold, Reduction, V3, dot, sub};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, EnergyReport, LocalReport, Order, PenaltyReport, Residual, Scale, Term, Weight};
use std::marker::PhantomData;
use std::sync::Arc;

/// A set for each of a batch of like elements.
///
/// What [`super::Set`] is for one element this is for all of them, for languages in which a call costs more than an
/// element.
pub trait Projection: Send + Sync {
    /// `rows`, all rows of the first element, then those of the second, .., become the nearest points of their sets.
    fn project(&self, rows: &mut [V3]);
}

/// A [`Term`] over elements whose sets are a [`Projection`]: what [`super::Batch`] is for sets that are known one by
/// one. Local vectors are rows of three, element by element. All sums are in the order of elements.
pub struct Whole<R> {
    nodes: Vec<u32>, // corners of all elements
    corners: usize,
    rows: usize,
    sets: Arc<dyn Projection>,
    hard: bool,
    unit: f64,      // what distances are violations against
    weight: Weight, // mu, or that of a soft set
    gather: Gather,
    coupled: Vec<V3>, // scratch: Dx
    nearest: Vec<V3>, // the nearest points to `at`
    at: Vec<V3>,      // Dx that they are nearest to: a pass at the same x does not ask again
    forces: Vec<V3>,  // scratch: a corner each
    reduction: PhantomData<R>,
}

impl<R: Reduction> Whole<R> {
    /// Of elements with `corners` corners each, which `nodes` lists one after another. Distances from hard sets count
    /// over `unit`.
    ///
    /// # Errors
    /// A number of corners that the reduction is not for, a list that is not of whole elements, or one too long to be
    /// numbered; a soft set that is to be split off.
    pub fn new(
        nodes: Vec<u32>,
        corners: usize,
        sets: Arc<dyn Projection>,
        hold: Hold,
        unit: f64,
    ) -> Result<Self, CellsError> {
        let rows = R::rows(corners).filter(|_| nodes.len().is_multiple_of(corners.max(1)));
        let Some(rows) = rows.filter(|_| nodes.len() < u32::MAX as usize) else {
            return Err(CellsError(format!("{} nodes are no elements of {corners} corners for this set", nodes.len())));
        };
        let (hard, weight) = match hold {
            Hold::Hard(mu) => (true, mu),
            Hold::Soft(weight) => (false, weight),
            Hold::Split { .. } => {
                return Err(CellsError("a set of one's own is hard or soft, not split off".to_string()));
            }
        };
        let n = nodes.len() / corners * rows;
        Ok(Whole {
            corners,
            rows,
            sets,
            hard,
            unit,
            weight: Weight::new(weight),
            gather: Gather::new(&nodes),
            coupled: vec![[0.0; 3]; n],
            nearest: vec![[0.0; 3]; n],
            at: vec![[f64::NAN; 3]; n],
            forces: vec![[0.0; 3]; nodes.len()],
            nodes,
            reduction: PhantomData,
        })
    }

    fn reduce(&mut self, x: &[f64]) {
        let x = x.as_chunks::<3>().0;
        for (nodes, v) in self.nodes.chunks_exact(self.corners).zip(self.coupled.chunks_exact_mut(self.rows)) {
            R::reduce(x, nodes, v);
        }
    }

    /// The points nearest to Dx, where that has changed.
    fn follow(&mut self, x: &[f64]) {
        self.reduce(x);
        if self.at != self.coupled {
            self.at.copy_from_slice(&self.coupled);
            self.nearest.copy_from_slice(&self.coupled);
            self.sets.project(&mut self.nearest);
        }
    }

    /// 1/2 w^2 |Dx - p|^2 of Dx as reduced last; its gradient w^2 D^T (Dx - p) is added to `grad`.
    fn aim(&mut self, p: &[V3], grad: Option<&mut [f64]>) -> f64 {
        let (rows, w2) = (self.rows, self.weight.squared);
        let mut value = 0.0;
        let elements = self.coupled.chunks_exact(rows).zip(p.chunks_exact(rows));
        for (f, (c, p)) in self.forces.chunks_exact_mut(self.corners).zip(elements) {
            for ((f, c), p) in f.iter_mut().zip(c).zip(p) {
                let gap = sub(*c, *p);
                value += 0.5 * w2 * dot(gap, gap);
                *f = gap.map(|g| w2 * g);
            }
            f[rows..].fill([0.0; 3]);
            R::spread(f);
        }
        if let Some(grad) = grad {
            self.gather.add(&self.forces, grad.as_chunks_mut::<3>().0);
        }
        value
    }

    fn aim_at_nearest(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> f64 {
        self.follow(x);
        let nearest = std::mem::take(&mut self.nearest);
        let value = self.aim(&nearest, grad);
        self.nearest = nearest;
        value
    }
}

impl<R: Reduction> Term for Whole<R> {
    fn n_elems(&self) -> usize {
        self.nodes.len() / self.corners
    }

    fn is_hard(&self) -> bool {
        self.hard
    }

    fn local_len(&self) -> usize {
        3 * self.coupled.len()
    }

    fn local_dim(&self) -> usize {
        if self.hard { self.local_len() } else { 0 }
    }

    fn has_dual(&self) -> bool {
        self.hard
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        self.reduce(x);
        out.copy_from_slice(self.coupled.as_flattened());
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        if !self.hard {
            let objective = self.aim_at_nearest(x, Some(grad));
            p.copy_from_slice(self.nearest.as_flattened());
            u.fill(0.0);
            return LocalReport { value_after: objective, objective, ..LocalReport::default() };
        }
        self.reduce(x);
        let w2 = self.weight.squared;
        let mut report = LocalReport::default();
        let mut z = std::mem::take(&mut self.nearest);
        let coupled = self.coupled.as_flattened();
        for (i, z) in z.as_flattened_mut().iter_mut().enumerate() {
            let (c, before) = (coupled[i], p[i] + u[i]);
            report.penalty_before += 0.5 * w2 * (c - p[i]).powi(2);
            report.gap2_before += w2 * (c - before).powi(2);
            *z = c + u[i] + (cycle.relaxation - 1.0) * (c - before);
            // While z is sought p holds the z of before, and u holds v where it is to become v - z.
            p[i] = before;
            if cycle.order == Order::Xzu {
                u[i] = *z;
            }
        }
        self.sets.project(&mut z);
        for (i, z) in z.as_flattened().iter().enumerate() {
            let c = coupled[i];
            let v = if cycle.order == Order::Xzu { u[i] } else { c + u[i] };
            report.moved2 += w2 * (z - p[i]).powi(2);
            report.gap2 += w2 * (c - z).powi(2);
            report.penalty_after += 0.5 * w2 * (v - z).powi(2);
            if cycle.order == Order::Xzu {
                u[i] = v - z;
            }
            p[i] = z - u[i];
        }
        // It was scratch.
        self.nearest = z;
        self.at.fill([f64::NAN; 3]);
        report.objective = self.aim(p.as_chunks::<3>().0, Some(grad));
        report
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        self.reduce(x);
        PenaltyReport { value: self.aim(p.as_chunks::<3>().0, Some(grad)), energy: None }
    }

    /// Soft: sum w/2 dist^2, with its gradient. Hard: 0, and the largest distance over the unit.
    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport {
        if !self.hard {
            return EnergyReport { value: self.aim_at_nearest(x, grad), ..EnergyReport::default() };
        }
        self.follow(x);
        let gaps = self.at.iter().zip(&self.nearest).map(|(c, z)| {
            let gap = sub(*c, *z);
            dot(gap, gap)
        });
        // A NaN stays.
        let worst = gaps.fold(0.0_f64, |m, g| if g <= m { m } else { g }).sqrt() / self.unit;
        let violation = if worst.is_nan() { f64::INFINITY } else { worst };
        EnergyReport { violation, ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let mut residual = Residual::default();
        if !self.hard {
            return residual;
        }
        self.reduce(x);
        for (c, (p, u)) in self.coupled.as_flattened().iter().zip(p.iter().zip(u)) {
            let z = p + u;
            residual.gap2 += self.weight.squared * (c - z).powi(2);
            residual.size2 += self.weight.squared * z * z;
        }
        residual
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        self.nodes.chunks_exact(self.corners).for_each(visit);
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        add_normal::<R>(&self.nodes, self.corners, self.weight.squared, pattern, values);
    }

    fn scale(&self) -> Scale {
        Scale { weight2: self.weight.squared * self.n_elems() as f64, ..Scale::default() }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        out.fill(if self.hard { self.weight.squared } else { 0.0 });
    }

    /// As that of [`super::Batch`].
    fn propose_weights(&mut self, range: (f64, f64)) -> f64 {
        if self.hard { self.weight.propose(range) } else { 1.0 }
    }

    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        if self.hard {
            self.weight.take(p, u);
        }
    }
}
