//! Smooth parts of the objective that are not split.

/// A smooth function of the positions, such as the energy of a pressure. Global steps see it exactly; it has no place in
/// their matrix, so that it should be weak beside what is.
pub trait Potential: std::fmt::Debug + Send + Sync {
    /// Its value; its gradient over the nodes that `grad` covers, the first ones, is added.
    fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64;

    /// Nodes that it names are below this.
    fn n(&self) -> usize;
}
