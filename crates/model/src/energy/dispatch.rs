//! From the name of an energy to its type.

use super::*;
use crate::for_each_energy;
use std::fmt;

/// A computation that is written for any energy of dimension K and compiled for each.
pub trait EnergyVisitor<const K: usize> {
    /// What the computation returns.
    type Output;
    /// The computation.
    fn visit<E: Energy<K>>(self, energy: E) -> Self::Output;
}

/// No energy of that dimension has that name.
#[derive(Clone, Debug, PartialEq)]
pub struct UnknownEnergy {
    /// The name asked for.
    pub name: String,
    /// The dimension asked for.
    pub dimension: usize,
}

impl fmt::Display for UnknownEnergy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known = names(self.dimension).join(", ");
        write!(f, "no energy of {} stretches is called '{}'; there are {known}", self.dimension, self.name)
    }
}

impl std::error::Error for UnknownEnergy {}

/// `$body` if both numbers are the same.
macro_rules! where_equal {
    (1 1 $body:block) => {
        $body
    };
    (2 2 $body:block) => {
        $body
    };
    (3 3 $body:block) => {
        $body
    };
    ($a:tt $b:tt $body:block) => {};
}

macro_rules! define {
    ($($list:tt)*) => {
        define_visit! { visit_1d 1 $($list)* }
        define_visit! { visit_2d 2 $($list)* }
        define_visit! { visit_3d 3 $($list)* }

        /// The names of the energies over `dimension` stretches, in the order of the list.
        pub fn names(dimension: usize) -> Vec<&'static str> {
            match dimension {
                1 => list_names!(1 $($list)*),
                2 => list_names!(2 $($list)*),
                3 => list_names!(3 $($list)*),
                _ => Vec::new(),
            }
        }
    };
}

macro_rules! define_visit {
    ($function:ident $k:tt $($energy:ident [$($dimension:tt)*])*) => {
        #[doc = concat!("Runs `visitor` on the energy over ", $k, " stretches called `name`, of the material `lame`.")]
        ///
        /// # Errors
        /// [`UnknownEnergy`], whose text lists the names, where there is none.
        pub fn $function<V: EnergyVisitor<$k>>(name: &str, lame: &Lame, visitor: V) -> Result<V::Output, UnknownEnergy> {
            $($(where_equal!($k $dimension {
                if name == <$energy as Energy<$k>>::NAME {
                    return Ok(visitor.visit(<$energy as Energy<$k>>::from_lame(lame)));
                }
            });)*)*
            Err(UnknownEnergy { name: name.to_owned(), dimension: $k })
        }
    };
}

macro_rules! list_names {
    ($k:tt $($energy:ident [$($dimension:tt)*])*) => {{
        let mut names = Vec::new();
        $($(where_equal!($k $dimension { names.push(<$energy as Energy<$k>>::NAME); });)*)*
        names
    }};
}

for_each_energy!(define);
