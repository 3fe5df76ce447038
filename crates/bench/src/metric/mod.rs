//! A splitting whose weights are not scalars, to measure what they are worth (docs/weights.md).
//!
//! The penalty of an element is V/2 |sym(F) + U - Z|_M^2 with the isotropic metric
//!
//! ```text
//! |A|_M^2 = d |dev A|^2 + v |vol A|^2 = d |A|^2 + (v - d)/3 (tr A)^2,    vol A = (tr A / 3) I,  dev A = A - vol A
//! ```
//!
//! of two [`Moduli`] d and v; d = v = w^2 / V is the splitting of the paper. For isotropic materials the Hessian of the
//! density at rest, over symmetric matrices, is such a metric: d = 2 mu and v = 2 mu + 3 lambda.
//!
//! Plain arithmetic, one element after another: for counting iterations, not for speed.

mod beam;
mod elements;
mod moduli;
#[cfg(test)]
mod tests;
mod traced;
mod trial;
mod vector_form;

pub use beam::Motion;
pub use elements::{Candidates, MetricElements};
pub use moduli::Moduli;
pub use trial::{Attempt, Count, Counts, Global, Trial};
pub use vector_form::{VectorForm, VectorModel, VectorSettings};
