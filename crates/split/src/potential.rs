//! Smooth parts of the objective that are not split.

/// A smooth function of the positions, such as the energy of a pressure. Global steps see it exactly; it has no place in
/// their matrix, so that it should be weak beside what is.
pub trait Potential: std::fmt::Debug + Send + Sync {
    /// Its value; its gradient over the nodes that `grad` covers, the first ones, is added.
    fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64;

    /// Nodes that it names are below this.
    fn n(&self) -> usize;

    /// Whether [`Self::for_each_block`] gives its second derivatives. They may only tie nodes that share an element.
    fn has_hessian(&self) -> bool {
        false
    }

    /// Whether what [`Self::for_each_block`] gives is positive semidefinite everywhere, so that a Hessian that is to be so
    /// can have it too.
    fn is_convex(&self) -> bool {
        false
    }

    /// Parts of its second derivatives at x: the derivative of the gradient at node i by the position of node j, for i >= j,
    /// rows for i. A pair may come more than once; parts add up. Wherever x is, the same pairs come in the same order.
    fn for_each_block(&self, x: &[f64], give: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        let _ = (x, give);
    }
}
