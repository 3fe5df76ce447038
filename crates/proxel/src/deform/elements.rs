//! From the description of materials to batches of elements.

use super::DeformError;
use crate::settings::{BaseWeight, Candidate, DeformSettings, LocalFrame, Material};
use proxel_mesh::{Mesh, topology};
use proxel_model::elements::{Coupling, Elements, Linear, Polar, Rest, Shape, Simplex};
use proxel_model::energy::{Energy, EnergyVisitor, visit_1d, visit_2d, visit_3d};
use proxel_split::Term;
use std::collections::BTreeMap;

/// Elements of one dimension, in the order of the mesh.
pub(super) enum Cells {
    /// Tetrahedra.
    Tets(Vec<[u32; 4]>),
    /// Triangles in space.
    Triangles(Vec<[u32; 3]>),
    /// Springs.
    Springs(Vec<[u32; 2]>),
}

impl Cells {
    /// What the mesh's elements are under a material: edges of whatever there is for springs; else tetrahedra where there
    /// are any, else triangles (polygons as fans), else edges.
    pub fn of(mesh: &Mesh, tets: &[[u32; 4]], springs: bool) -> Self {
        if springs || (tets.is_empty() && mesh.faces.is_empty()) {
            let edges = match (tets.is_empty(), mesh.faces.is_empty()) {
                (false, _) => topology::tet_edges(tets),
                (true, false) => topology::face_edges(&mesh.faces),
                (true, true) => mesh.edges.clone(),
            };
            return Cells::Springs(edges);
        }
        if tets.is_empty() { Cells::Triangles(mesh.faces.fan_triangles()) } else { Cells::Tets(tets.to_vec()) }
    }

    /// All corners, flat.
    pub fn corners(&self) -> &[u32] {
        match self {
            Cells::Tets(c) => c.as_flattened(),
            Cells::Triangles(c) => c.as_flattened(),
            Cells::Springs(c) => c.as_flattened(),
        }
    }

    /// The same elements over renumbered vertices.
    pub fn renumbered(&self, number: &[u32]) -> Cells {
        let new = |v: u32| number[v as usize];
        match self {
            Cells::Tets(c) => Cells::Tets(c.iter().map(|e| e.map(new)).collect()),
            Cells::Triangles(c) => Cells::Triangles(c.iter().map(|e| e.map(new)).collect()),
            Cells::Springs(c) => Cells::Springs(c.iter().map(|e| e.map(new)).collect()),
        }
    }

    /// Corners an element.
    pub fn size(&self) -> usize {
        match self {
            Cells::Tets(_) => 4,
            Cells::Triangles(_) => 3,
            Cells::Springs(_) => 2,
        }
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.corners().len() / self.size()
    }

    /// What one is called.
    pub fn noun(&self) -> &'static str {
        match self {
            Cells::Tets(_) => "tetrahedron",
            Cells::Triangles(_) => "triangle",
            Cells::Springs(_) => "edge",
        }
    }

    /// The indices of the elements of each material: of each region that has one of its own, and of all others.
    pub fn by_material<'a>(&self, mesh: &Mesh, settings: &'a DeformSettings) -> Vec<(&'a Material, Vec<usize>)> {
        let regions = match self {
            Cells::Tets(_) => mesh.tet_regions.as_ref(),
            Cells::Triangles(_) if mesh.faces.as_triangles().is_some() => mesh.face_regions.as_ref(),
            _ => None,
        };
        let mut groups: BTreeMap<Option<i32>, Vec<usize>> = BTreeMap::new();
        for e in 0..self.len() {
            let region = regions.map(|r| r[e]).filter(|r| settings.materials.contains_key(r));
            groups.entry(region).or_default().push(e);
        }
        groups
            .into_iter()
            .map(|(region, elements)| {
                (region.and_then(|r| settings.materials.get(&r)).unwrap_or(&settings.material), elements)
            })
            .collect()
    }
}

/// Builds a term once the energy's type is known.
struct Build<'a, const D: usize, const K: usize> {
    rest: &'a Rest<D, K>,
    settings: &'a DeformSettings,
}

/// A batch, and whether its energy is infinite, or its prox forbidden, where an element is inverted.
pub(super) struct Built {
    pub term: Box<dyn Term>,
    pub barrier: bool,
}

impl<const D: usize, const K: usize> EnergyVisitor<K> for Build<'_, D, K>
where
    Simplex: Shape<D, K>,
    Linear: Coupling<D, K>,
    Polar: Coupling<D, K>,
{
    type Output = Built;
    fn visit<E: Energy<K>>(self, energy: E) -> Built {
        let admm = &self.settings.admm;
        let dynamic = self.settings.method.is_reweighted();
        let stiffness = match admm.base_weight {
            BaseWeight::RestHessian => energy.rest_stiffness(),
            BaseWeight::Auto if !dynamic => energy.rest_stiffness(),
            BaseWeight::Slope | BaseWeight::Auto => energy.slope_stiffness(),
        };
        let base = stiffness * admm.weight_scale;
        let softening = match admm.candidate {
            Candidate::Hessian => 1.0,
            Candidate::Relative => base / energy.rest_stiffness(),
        };
        let barrier = E::PROX_POSITIVE;
        let signed = admm.local_frame == LocalFrame::SingularValues;
        let term: Box<dyn Term> = match self.settings.method.is_rotation_aware() {
            true => Box::new(
                Elements::<D, K, Polar>::new(self.rest, energy, base)
                    .with_singular_values(signed)
                    .with_softening(softening),
            ),
            false => Box::new(Elements::<D, K, Linear>::new(self.rest, energy, base).with_softening(softening)),
        };
        Built { term, barrier }
    }
}

/// The elements `chosen` of `cells` as a batch over flat positions `x` at rest; `number` renumbers vertices, `fill` is the
/// part of every element that is material.
pub(super) fn build(
    cells: &Cells,
    chosen: &[usize],
    fill: Option<&[f64]>,
    number: &[u32],
    x: &[f64],
    material: &Material,
    settings: &DeformSettings,
    name: &str,
) -> Result<Built, DeformError> {
    let lame = material.lame().map_err(|e| DeformError(e.to_string()))?;
    let size = cells.size();
    let corners = cells.corners();
    let elements: Vec<u32> =
        chosen.iter().flat_map(|e| &corners[e * size..(e + 1) * size]).map(|v| number[*v as usize]).collect();
    let refuse = |e: proxel_model::elements::ElementError| {
        let proxel_model::elements::ElementError::Measure { element, measure } = e else {
            return DeformError(e.to_string());
        };
        let (noun, index) = (cells.noun(), chosen[element]);
        DeformError(format!(
            "{name}: {noun} {index} (0-based) has size {measure:e} at rest; move its vertices apart or remove it"
        ))
    };
    let unknown = |e: proxel_model::energy::UnknownEnergy| DeformError(format!("{e} (--material)"));
    let energy = material.energy.as_str();
    let part = |e: usize| fill.map_or(1.0, |f| f[chosen[e]]);
    match cells {
        Cells::Tets(_) => {
            let rest = Rest::<3, 3>::new(x, &elements).and_then(|r| r.filled(part)).map_err(refuse)?;
            visit_3d(energy, &lame, Build { rest: &rest, settings }).map_err(unknown)
        }
        Cells::Triangles(_) => {
            let rest = Rest::<3, 2>::new(x, &elements).map_err(refuse)?;
            visit_2d(energy, &lame, Build { rest: &rest, settings }).map_err(unknown)
        }
        Cells::Springs(_) => {
            let rest = Rest::<3, 1>::new(x, &elements).map_err(refuse)?;
            visit_1d(energy, &lame, Build { rest: &rest, settings }).map_err(unknown)
        }
    }
}

/// The size of every element of the rest mesh, for masses.
pub(super) fn measures(cells: &Cells, x: &[f64]) -> Vec<f64> {
    let at = |v: u32| -> [f64; 3] { std::array::from_fn(|d| x[v as usize * 3 + d]) };
    let minus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| a[d] - b[d]) };
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
    match cells {
        Cells::Tets(c) => c
            .iter()
            .map(|t| {
                let [a, b, c, d] = t.map(at);
                dot(minus(b, a), cross(minus(c, a), minus(d, a))) / 6.0
            })
            .collect(),
        Cells::Triangles(c) => c
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(at);
                let n = cross(minus(b, a), minus(c, a));
                dot(n, n).sqrt() / 2.0
            })
            .collect(),
        Cells::Springs(c) => c
            .iter()
            .map(|e| {
                let d = minus(at(e[1]), at(e[0]));
                dot(d, d).sqrt()
            })
            .collect(),
    }
}
