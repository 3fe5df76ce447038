//! Pulls that a global step takes row by row, while they are in the cache.

/// Takes the pull of one term in the place of a vector of it: what a global step does with each row by itself is done while the
/// row is in the cache.
pub trait Intake {
    /// A taker for each `len` numbers of the pull on the term's nodes, in their order, the last for what is left. None where it
    /// does not go by such parts.
    fn takers(&mut self, len: usize) -> Option<Vec<Box<dyn Taker + '_>>>;
}

/// Takes a part of a pull.
pub trait Taker: Send {
    /// The `row`-th row of the part; each is given once. `pull` is used up.
    fn take(&mut self, row: usize, pull: &mut [f64]);
}
