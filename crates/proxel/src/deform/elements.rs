//! From the description of materials to batches of elements.

use super::DeformError;
use crate::settings::{BaseWeight, Candidate, DeformSettings, LocalFrame, Material};
use proxel_mesh::{Mesh, topology};
use proxel_model::elements::{Batch, BatchError, BatchShape, BatchWeights, ElementError, Stiffness, batch};
use proxel_split::Term;
use std::collections::BTreeMap;

/// Elements of one dimension, in the order of the mesh.
pub(crate) enum Cells {
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

    /// All elements of the mesh, those of the highest dimension first: one kind, unless the settings say that the mesh is
    /// mixed.
    pub fn all(mesh: &Mesh, tets: &[[u32; 4]], settings: &DeformSettings) -> Vec<Cells> {
        if !settings.mixed || settings.material.energy == "spring" {
            return vec![Cells::of(mesh, tets, settings.material.energy == "spring")];
        }
        let kinds = [
            Cells::Tets(tets.to_vec()),
            Cells::Triangles(mesh.faces.fan_triangles()),
            Cells::Springs(mesh.edges.clone()),
        ];
        kinds.into_iter().filter(|cells| cells.len() > 0).collect()
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

    /// As batches know it.
    pub fn shape(&self, planar: bool) -> BatchShape {
        match (self, planar) {
            (Cells::Tets(_), _) => BatchShape::Tetrahedra,
            (Cells::Triangles(_), false) => BatchShape::Triangles,
            (Cells::Triangles(_), true) => BatchShape::PlanarTriangles,
            (Cells::Springs(_), false) => BatchShape::Springs,
            (Cells::Springs(_), true) => BatchShape::PlanarSprings,
        }
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
            Cells::Springs(c) if *c == mesh.edges => mesh.edge_regions.as_ref(),
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

/// A batch, and whether its energy is infinite, or its prox forbidden, where an element is inverted.
pub(crate) struct Built {
    pub term: Box<dyn Term>,
    pub barrier: bool,
}

/// Where the slope fit exceeds the geometric mean of the stiffness this many times, the material is so stiff against changes
/// of volume that a weight that suits them suits no change of shape (docs/weights.md).
const NEARLY_INCOMPRESSIBLE: f64 = 1.5;

/// The elements `chosen` of `cells` as a batch over flat positions `x` at rest, three numbers a node or, in the plane, two;
/// `number` renumbers vertices, `fill` is the part of every element that is material.
pub(crate) fn build(
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
    let refuse = |e: BatchError| match e {
        BatchError::Element(ElementError::Measure { element, measure }) => {
            let (noun, index) = (cells.noun(), chosen[element]);
            DeformError(format!(
                "{name}: {noun} {index} (0-based) has size {measure:e} at rest; move its vertices apart or remove it"
            ))
        }
        BatchError::Element(e) => DeformError(e.to_string()),
        BatchError::Energy(e) => DeformError(format!("{e} (--material)")),
    };
    // It is that of tetrahedra, not of springs along their edges.
    let fill = fill.filter(|_| matches!(cells, Cells::Tets(_)));
    let fill: Option<Vec<f64>> = fill.map(|fill| chosen.iter().map(|e| fill[*e]).collect());
    let admm = &settings.admm;
    let method = settings.method;
    let fixed = method.is_splitting() && !method.is_reweighted();
    let weights = |Stiffness { largest, slope, mean }| {
        let stiffness: f64 = match admm.base_weight {
            BaseWeight::RestHessian => largest,
            BaseWeight::Slope => slope,
            BaseWeight::GeometricMean => mean,
            BaseWeight::BulkModulus => lame.bulk(),
            BaseWeight::Auto if fixed => largest,
            BaseWeight::Auto if method.is_splitting() && !method.is_rotation_aware() => 0.5 * slope,
            BaseWeight::Auto if method.is_splitting() && slope > NEARLY_INCOMPRESSIBLE * mean => mean,
            BaseWeight::Auto => slope,
        };
        let base = stiffness * admm.weight_scale;
        let softening = match admm.candidate {
            Candidate::Hessian => 1.0,
            Candidate::Relative => base / largest,
        };
        BatchWeights { base, softening }
    };
    let (term, barrier) = batch(&Batch {
        shape: cells.shape(settings.planar),
        positions: x,
        flattened: None,
        elements: &elements,
        fill: fill.as_deref(),
        energy: &material.energy,
        lame: &lame,
        limits: settings.strain_limit.map(|[low, high]| (low, high)),
        rotation_aware: settings.method.is_rotation_aware(),
        singular_values: admm.local_frame == LocalFrame::SingularValues,
        weights: &weights,
    })
    .map_err(refuse)?;
    Ok(Built { term, barrier })
}

/// The size of every element over flat rest positions with `dim` numbers a node, for masses.
pub(crate) fn measures(cells: &Cells, x: &[f64], dim: usize) -> Vec<f64> {
    let at = |v: u32| -> [f64; 3] { std::array::from_fn(|d| if d < dim { x[v as usize * dim + d] } else { 0.0 }) };
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

/// The mass of every element over its corners in equal parts, times gravity, is added to `forces`. `renumbered` are `kinds`,
/// as [`Cells::all`] gives them, over the flat rest positions `x` with `dim` numbers a node.
pub(crate) fn add_weights(
    renumbered: &[Cells],
    kinds: &[Cells],
    mesh: &Mesh,
    settings: &DeformSettings,
    x: &[f64],
    dim: usize,
    forces: &mut [[f64; 3]],
) {
    for (rank, (cells, original)) in renumbered.iter().zip(kinds).enumerate() {
        let sizes = measures(cells, x, dim);
        for (material, chosen) in original.by_material(mesh, settings) {
            let density = material.density.unwrap_or(if rank == 0 { settings.density } else { 0.0 });
            if density == 0.0 {
                continue;
            }
            let share = density / cells.size() as f64;
            for e in chosen {
                for v in &cells.corners()[e * cells.size()..(e + 1) * cells.size()] {
                    for d in 0..3 {
                        forces[*v as usize][d] += share * sizes[e] * settings.gravity[d];
                    }
                }
            }
        }
    }
}
