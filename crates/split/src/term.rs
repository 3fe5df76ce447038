//! What the splitting needs to know of a batch of like elements.

use crate::{Curvature, Cycle, Hardening, Intake, LevelBound, Order, Uncoupled};
use proxel_linalg::sparse::SymPattern;

/// What a local step did, summed over the elements of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalReport {
    /// sum g(z) before the step.
    pub value_before: f64,
    /// sum g(z) after the step.
    pub value_after: f64,
    /// 1/2 sum w^2 |c(Dx) + u - z|^2 before the step, u not yet updated.
    pub penalty_before: f64,
    /// The same after the step, u not yet updated.
    pub penalty_after: f64,
    /// 1/2 sum w^2 |c(Dx) - p|^2 with the new p = z - u: the objective of the global step where it begins.
    pub objective: f64,
    /// sum w^2 |z - z_before|^2, the square of the dual residual in local space.
    pub moved2: f64,
    /// sum w^2 |c(Dx) - z|^2 before the step: in the x-z-u order the square of the forward residual A(22).
    pub gap2_before: f64,
    /// The same after the step: in the x-z-u order the square of the primal residual, in the z-x-u order that of the forward
    /// residual A(24).
    pub gap2: f64,
    /// Elements whose prox missed its tolerance.
    pub missed: u64,
}

impl LocalReport {
    /// The combined residual A(11) of the x-z-u iteration, with the penalty in the weights: a square.
    pub fn combined(&self) -> f64 {
        self.gap2 + self.moved2
    }

    /// The change of the augmented Lagrangian by this step, before the dual update: Delta L in W(17).
    pub fn lagrangian_change(&self) -> f64 {
        (self.value_after - self.value_before) + (self.penalty_after - self.penalty_before)
    }
}

impl std::ops::AddAssign for LocalReport {
    fn add_assign(&mut self, o: Self) {
        self.value_before += o.value_before;
        self.value_after += o.value_after;
        self.penalty_before += o.penalty_before;
        self.penalty_after += o.penalty_after;
        self.objective += o.objective;
        self.moved2 += o.moved2;
        self.gap2_before += o.gap2_before;
        self.gap2 += o.gap2;
        self.missed += o.missed;
    }
}

/// The energy of a batch at x without what is infinite outside hard sets, and how far its elements are deformed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyReport {
    /// sum g(c(Dx)).
    pub value: f64,
    /// Elements with a signed measure of zero or below.
    pub inverted: u64,
    /// Least signed stretch.
    pub min_stretch: f64,
    /// Largest stretch.
    pub max_stretch: f64,
    /// How far an element is outside a hard set, at most: for limited stretches the part of the rest size beyond the
    /// limit. 0 where nothing is, or where there are no such sets.
    pub violation: f64,
}

impl Default for EnergyReport {
    fn default() -> Self {
        EnergyReport {
            value: 0.0,
            inverted: 0,
            min_stretch: f64::INFINITY,
            max_stretch: f64::NEG_INFINITY,
            violation: 0.0,
        }
    }
}

impl std::ops::AddAssign for EnergyReport {
    fn add_assign(&mut self, o: Self) {
        self.value += o.value;
        self.inverted += o.inverted;
        self.min_stretch = self.min_stretch.min(o.min_stretch);
        self.max_stretch = self.max_stretch.max(o.max_stretch);
        // A NaN is a violation too.
        self.violation = if o.violation <= self.violation { self.violation } else { o.violation };
    }
}

/// The penalty 1/2 sum w^2 |c(Dx) - p|^2 at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PenaltyReport {
    /// Its value.
    pub value: f64,
    /// sum g(c(Dx)), where the coupling gives it for next to nothing.
    pub energy: Option<EnergyReport>,
}

impl Default for PenaltyReport {
    fn default() -> Self {
        PenaltyReport { value: 0.0, energy: Some(EnergyReport::default()) }
    }
}

impl std::ops::AddAssign for PenaltyReport {
    fn add_assign(&mut self, o: Self) {
        self.value += o.value;
        self.energy = match (self.energy, o.energy) {
            (Some(mut a), Some(b)) => {
                a += b;
                Some(a)
            }
            _ => None,
        };
    }
}

/// How far the constraints are from holding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// sum w^2 |c(Dx) - z|^2, the square of the primal residual.
    pub gap2: f64,
    /// sum w^2 |z|^2, what residuals are measured against.
    pub size2: f64,
}

impl std::ops::AddAssign for Residual {
    fn add_assign(&mut self, o: Self) {
        self.gap2 += o.gap2;
        self.size2 += o.size2;
    }
}

/// How large and how stiff a batch is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scale {
    /// sum V
    pub measure: f64,
    /// sum w^2
    pub weight2: f64,
    /// Half the stiffness at rest times sum V: the energy of strains of about one.
    pub energy: f64,
    /// |H(I)|_F over the stiffness at rest, both of the density over principal stretches; H its Hessian, the stiffness its
    /// largest eigenvalue, which [`Term::add_characteristic_force`] takes.
    pub hessian: f64,
}

/// What the scaled dual is as a function of the local variable, A(21): u = W^-2 grad g(z).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum DualMap {
    /// No function that an extrapolated z could be put into: g is infinite outside a set, or has no derivative. A, appendix
    /// E.1, (C3) and (C4) do not hold.
    #[default]
    None,
    /// A smooth function of z, [`Term::dual`].
    Smooth,
    /// An affine one, and z an affine function of u: g is a strictly convex quadratic. A, appendix E.1 and E.2 both hold.
    Affine,
}

/// A term that can keep v = z + u in the place of p and u, half of the numbers: after a local step of the x-z-u order
/// z = prox(v), so that both follow. Couplings are linear, and the prox cheap: it is taken twice.
pub trait Folded {
    /// [`Term::pull_step`] of the x-z-u order: v <- v + alpha (c(Dx) - z), with z = prox(v) of before; the pull is that of
    /// p = 2 z - v of after.
    fn step(&mut self, relaxation: f64, x: &[f64], v: &mut [f64], pull: &mut [f64], begins: bool) -> LocalReport;

    /// The same with the pull given to an intake; none, and nothing done, where that cannot be.
    fn feed(&mut self, relaxation: f64, x: &[f64], v: &mut [f64], intake: &mut dyn Intake) -> Option<LocalReport> {
        let _ = (relaxation, x, v, intake);
        None
    }

    /// p <- 2 z - v, u <- v - z, z = prox(v).
    fn unfold(&self, v: &[f64], p: &mut [f64], u: &mut [f64]);
}

/// A batch of like elements: one virtual call a batch and step, everything static inside.
///
/// Positions x are flat, `dim` numbers a node. The first `n_free` nodes are unknowns, the others fixed; gradients have
/// `dim` numbers a node, of the free ones or of all, and are added to. The state of a batch is the scaled dual u and
/// p = z - u, what the global step aims at; z = p + u. Local vectors have [`Term::local_len`] entries, laid out as the term
/// likes, such that the Euclidean norm of an element's part is the norm of the splitting (Frobenius).
pub trait Term: Send + Sync {
    /// Number of elements.
    fn n_elems(&self) -> usize;

    /// Whether g is infinite outside a set that has to hold: such a term needs a method that splits it off.
    fn is_hard(&self) -> bool {
        false
    }

    /// Length of this term's part of p and of u.
    fn local_len(&self) -> usize;

    /// Whether its part of the splitting has a dual. One without, such as a soft constraint whose z is the point of a set
    /// nearest to c(Dx), A(29), keeps u = 0 and p = z between local steps; its weights are no part of residuals and merits
    /// (zeros in [`Term::local_weights2`], 0 in [`Term::local_dim`]). It asks for the z-x-u order.
    fn has_dual(&self) -> bool {
        true
    }

    /// out <- c(Dx).
    fn couple(&mut self, x: &[f64], out: &mut [f64]);

    /// z <- prox(c(Dx) + u), W(10b); u <- u + c(Dx) - z, W(10c); p <- z - u. The gradient of the penalty at x with the new
    /// p, where the global step begins, is added to `grad`: everything that it needs is at hand.
    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport;

    /// The local step of a cycle that may be over-relaxed, and in the z-x-u order: there z <- prox(c(Dx) + u), p <- z - u, and
    /// u stays, which follows when x has moved; c(Dx) - p is then the new u. As before, the gradient of the penalty at x
    /// with the new p is added to `grad`.
    ///
    /// The provided method takes [`Term::local_step`] and sets right what is different, with buffers of its own.
    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        if cycle.is_plain() {
            return self.local_step(x, p, u, grad);
        }
        let mut coupled = vec![0.0; p.len()];
        self.couple(x, &mut coupled);
        let dual = u.to_vec();
        for ((u, p), c) in u.iter_mut().zip(p.iter()).zip(&coupled) {
            let z = p + *u;
            *u += (cycle.relaxation - 1.0) * (c - z);
        }
        if cycle.order == Order::Xzu {
            return self.local_step(x, p, u, grad);
        }
        let mut report = self.local_step(x, p, u, &mut vec![0.0; grad.len()]);
        for ((u, p), dual) in u.iter_mut().zip(p.iter_mut()).zip(dual) {
            *p += *u - dual;
            *u = dual;
        }
        report.objective = self.penalty(x, p, grad).value;
        report
    }

    /// As [`Term::cycle_step`], but what is added to `pull`, or is set there if it `begins` with this term, is the gradient of
    /// the penalty at x = 0 with the new p, that is -D^T W^2 p, for linear couplings. Global steps that ask for it
    /// ([`crate::Pull::AtOrigin`]) are exact: of the report, what only inexact ones ask for (`value_before`, `penalty_before`,
    /// `penalty_after`, `objective`) may be left at 0.
    ///
    /// The provided method takes a penalty of its own at x = 0.
    fn pull_step(
        &mut self,
        cycle: &Cycle,
        x: &[f64],
        p: &mut [f64],
        u: &mut [f64],
        pull: &mut [f64],
        begins: bool,
    ) -> LocalReport {
        if begins {
            pull.fill(0.0);
        }
        let report = self.cycle_step(cycle, x, p, u, &mut vec![0.0; pull.len()]);
        self.penalty(&vec![0.0; x.len()], p, pull);
        report
    }

    /// Itself, where it can keep one vector in the place of p and u.
    fn folded(&mut self) -> Option<&mut dyn Folded> {
        None
    }

    /// A whole iteration of the z-x-u order, with the same bits as one of [`Term::cycle_step`], a solve, and the update of the
    /// dual, for a term that knows how to do with fewer passes over memory when nodes are tied to each other by nothing else.
    /// False, and nothing done, where there is no such way.
    fn sweep(&mut self, own: &Uncoupled, x: &mut [f64], p: &mut [f64], u: &mut [f64]) -> bool {
        let _ = (own, x, p, u);
        false
    }

    /// What a local step costs, in nanoseconds of a core: an estimate by which an acceleration is weighed against plain
    /// iterations. That of a prox that decomposes matrices, 7 a number, unless a term knows better.
    fn local_work(&self) -> f64 {
        /// 66 for the nine numbers of a tetrahedron.
        const NUMBER: f64 = 7.3;
        NUMBER * self.local_dim() as f64
    }

    /// Numbers in a local vector that mean something: the dimension of z in A(27).
    fn local_dim(&self) -> usize {
        self.local_len()
    }

    /// Whether c is the identity, so that c(Dx) is linear in x.
    fn is_linear(&self) -> bool {
        true
    }

    /// What u is as a function of z.
    fn dual_map(&self) -> DualMap {
        DualMap::None
    }

    /// u <- W^-2 grad g(z), A(21), where [`Term::dual_map`] says that there is such a function; else u stays.
    fn dual(&mut self, z: &[f64], u: &mut [f64]) {
        let _ = (z, u);
    }

    /// sum g(z), where a term can tell; certificates ask for it.
    fn local_value(&self, z: &[f64]) -> Option<f64> {
        let _ = z;
        None
    }

    /// The least m >= 0 such that forces q over m lie where the conjugate of g is finite, where a term can tell: the largest |q|
    /// over lambda of lambda |z|, 0 where any force may act.
    fn gauge(&self, forces: &[f64]) -> Option<f64> {
        let _ = forces;
        None
    }

    /// sum g*(q) = sup over z of sum <q, z> - g(z), for forces of gauge at most 1, where a term can tell.
    fn conjugate(&self, forces: &[f64]) -> Option<f64> {
        let _ = forces;
        None
    }

    /// Bounds over the set where g is at most `level`, under the present weights; none where there are none.
    fn level_bound(&self, level: f64) -> Option<LevelBound> {
        let _ = level;
        None
    }

    /// 1/2 sum w^2 |c(Dx) - p|^2, its gradient W(12) added to `grad`.
    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport;

    /// sum g(c(Dx)), its gradient added to `grad` where one is wanted.
    fn energy(&mut self, x: &[f64], grad: Option<&mut [f64]>) -> EnergyReport;

    /// How far c(Dx) is from z = p + u.
    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual;

    /// Calls `visit` with the nodes of each element.
    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32]));

    /// Adds sum w^2 D^T D over free nodes, W(5a), to the values of the lower triangle `pattern`.
    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]);

    /// sum_i w^2 |D_i|^2 per node as a bound of the gradient's size: adds stiffness * |V D_i| to `size` for each free node
    /// i, the force that a stress of the size of the rest stiffness would put on it.
    ///
    /// The provided method adds nothing: a set has no stiffness, and weighs nothing against others.
    fn add_characteristic_force(&self, size: &mut [f64]) {
        let _ = size;
    }

    /// How large and how stiff the batch is.
    fn scale(&self) -> Scale;

    /// out <- w^2 of the element that each entry of a local vector belongs to; 0 or next to nothing where to none.
    fn local_weights2(&self, out: &mut [f64]);

    /// Works out candidate weights from the stiffness at z, clamped to `range` times the base weight, W(22), and returns
    /// the largest ratio max(w_cand^2/w^2, w^2/w_cand^2), W(23). The provided methods are those of weights that stay as they
    /// are.
    fn propose_weights(&mut self, range: (f64, f64)) -> f64 {
        let _ = range;
        1.0
    }

    /// Raises the candidate weights, from now on, of the elements that the rule means, up to a limit of the term; false
    /// where all of them are there.
    fn harden(&mut self, rule: &Hardening, x: &[f64], p: &[f64], u: &[f64]) -> bool {
        let _ = (rule, x, p, u);
        false
    }

    /// Takes the candidate weights and scales u by w^2/w_cand^2, so that w^2 u, the force, stays; z stays, p follows.
    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        let _ = (p, u);
    }

    /// Second derivatives, where the term has them: what the methods of Newton's kind need.
    fn curvature(&mut self) -> Option<&mut dyn Curvature> {
        None
    }
}
