//! UV maps of surfaces.

pub mod pack;
