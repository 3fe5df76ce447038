//! Batches by name: what a front end builds from a description. All shapes are compiled here, once.

use super::{Coupling, Density, ElementError, Elements, Linear, Polar, Rest, Shape, Simplex};
use crate::energy::{Energy, EnergyVisitor, Lame, UnknownEnergy, visit_1d, visit_2d, visit_3d};
use proxel_split::Term;
use std::sync::Arc;

/// What the elements of a batch are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BatchShape {
    /// Tetrahedra.
    Tetrahedra,
    /// Triangles in space.
    Triangles,
    /// Triangles in the plane.
    PlanarTriangles,
    /// Springs in space.
    Springs,
    /// Springs in the plane.
    PlanarSprings,
}

/// How a batch is split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchWeights {
    /// Squared base weight over measure, see [`Elements::new`].
    pub base: f64,
    /// See [`Elements::with_softening`].
    pub softening: f64,
}

/// The stiffness of an energy at rest, in the three ways that weights are taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// [`Energy::rest_stiffness`]
    pub largest: f64,
    /// [`Energy::slope_stiffness`]
    pub slope: f64,
    /// [`Energy::mean_stiffness`]
    pub mean: f64,
}

/// Triangles with rest shapes of their own, see [`Rest::of_shapes`].
#[derive(Clone, Copy)]
pub struct Flattened<'a> {
    /// Edges from corner 0, as columns, of each triangle.
    pub shapes: &'a [[[f64; 2]; 2]],
    /// Where each is.
    pub centers: &'a [[f64; 3]],
    /// How many nodes there are.
    pub n_nodes: usize,
}

/// What a batch is made of.
pub struct Batch<'a> {
    /// Its elements.
    pub shape: BatchShape,
    /// Rest positions, flat, as many numbers a node as the shape has dimensions.
    pub positions: &'a [f64],
    /// Planar triangles that do not fit each other at rest, in the place of `positions`.
    pub flattened: Option<Flattened<'a>>,
    /// Nodes, flat.
    pub elements: &'a [u32],
    /// The part of each element that is material, see [`Rest::filled`]; everything without it.
    pub fill: Option<&'a [f64]>,
    /// Name of the energy.
    pub energy: &'a str,
    /// Its moduli.
    pub lame: &'a Lame,
    /// Hard limits of the stretches: 0 < low <= 1 <= high.
    pub limits: Option<(f64, f64)>,
    /// Whether the local variable is the stretch of the polar decomposition ([`Polar`]) or F itself ([`Linear`]).
    pub rotation_aware: bool,
    /// See [`Elements::with_singular_values`].
    pub singular_values: bool,
    /// The weights from what the energy is at rest.
    pub weights: &'a dyn Fn(Stiffness) -> BatchWeights,
}

/// Why there is no such batch.
#[derive(Clone, Debug, PartialEq)]
pub enum BatchError {
    /// An element that cannot be used.
    Element(ElementError),
    /// An energy that is not known for the shape.
    Energy(UnknownEnergy),
}

impl std::fmt::Display for BatchError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            BatchError::Element(e) => e.fmt(f),
            BatchError::Energy(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for BatchError {}

impl From<ElementError> for BatchError {
    fn from(e: ElementError) -> Self {
        BatchError::Element(e)
    }
}

impl From<UnknownEnergy> for BatchError {
    fn from(e: UnknownEnergy) -> Self {
        BatchError::Energy(e)
    }
}

/// The term, and whether its solution has no inverted element ([`Density::is_positive`]).
///
/// # Errors
/// An element that cannot be used, an energy that is not known.
pub fn batch(of: &Batch<'_>) -> Result<(Box<dyn Term>, bool), BatchError> {
    match of.shape {
        BatchShape::Tetrahedra => of.build::<3, 3>(visit_3d(of.energy, of.lame, Erase)?),
        BatchShape::Triangles => of.build::<3, 2>(visit_2d(of.energy, of.lame, Erase)?),
        BatchShape::PlanarTriangles => match of.flattened {
            None => of.build::<2, 2>(visit_2d(of.energy, of.lame, Erase)?),
            Some(Flattened { shapes, centers, n_nodes }) => {
                let rest = Rest::<2, 2>::of_shapes(shapes, centers, of.elements, n_nodes)?;
                of.build_on(rest, visit_2d(of.energy, of.lame, Erase)?)
            }
        },
        BatchShape::Springs => of.build::<3, 1>(visit_1d(of.energy, of.lame, Erase)?),
        BatchShape::PlanarSprings => of.build::<2, 1>(visit_1d(of.energy, of.lame, Erase)?),
    }
}

/// Forgets the type of an energy.
struct Erase;

impl<const K: usize> EnergyVisitor<K> for Erase {
    type Output = Arc<dyn Density<K>>;
    fn visit<E: Energy<K>>(self, energy: E) -> Arc<dyn Density<K>> {
        Arc::new(energy)
    }
}

impl Batch<'_> {
    fn build<const D: usize, const K: usize>(
        &self,
        energy: Arc<dyn Density<K>>,
    ) -> Result<(Box<dyn Term>, bool), BatchError>
    where
        Simplex: Shape<D, K>,
        Linear: Coupling<D, K>,
        Polar: Coupling<D, K>,
    {
        self.build_on(Rest::<D, K>::new(self.positions, self.elements)?, energy)
    }

    fn build_on<const D: usize, const K: usize>(
        &self,
        mut rest: Rest<D, K>,
        energy: Arc<dyn Density<K>>,
    ) -> Result<(Box<dyn Term>, bool), BatchError>
    where
        Simplex: Shape<D, K>,
        Linear: Coupling<D, K>,
        Polar: Coupling<D, K>,
    {
        if let Some(fill) = self.fill {
            rest = rest.filled(|e| fill.get(e).copied().unwrap_or(1.0))?;
        }
        let weights = (self.weights)(Stiffness {
            largest: energy.rest_stiffness(),
            slope: energy.slope_stiffness(),
            mean: energy.mean_stiffness(),
        });
        let positive = energy.is_positive();
        let term: Box<dyn Term> = match self.rotation_aware {
            true => Box::new(
                Elements::<D, K, Polar>::of_density(&rest, energy, weights.base)
                    .with_singular_values(self.singular_values)
                    .with_softening(weights.softening)
                    .with_limits(self.limits),
            ),
            false => Box::new(
                Elements::<D, K, Linear>::of_density(&rest, energy, weights.base)
                    .with_softening(weights.softening)
                    .with_limits(self.limits),
            ),
        };
        Ok((term, positive))
    }
}
