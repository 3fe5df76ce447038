//! Fields that go out with the result: stretches, energy density, stress, reaction forces.

use super::elements::Cells;
use super::{DeformError, DeformInput, Deformation, planar};
use crate::settings::DeformSettings;
use proxel_mesh::{Fields, Mesh};
use proxel_model::elements::{Rest, Shape, Simplex};
use proxel_model::energy::{Energy, EnergyVisitor, visit_1d, visit_2d, visit_3d};

/// Per element and per vertex, in the order of the mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extras {
    /// Principal stretches, three an element, descending; the last carries the sign of the volume. Unused ones are 1.
    pub stretches: Vec<[f64; 3]>,
    /// Energy over rest measure.
    pub energy_density: Vec<f64>,
    /// Von Mises stress of the Cauchy stress (of the tension, for springs); NaN where an element has no volume.
    pub von_mises: Vec<f64>,
    /// At fixed vertices, the force that the body exerts on what holds it; 0 elsewhere.
    pub reaction: Vec<[f64; 3]>,
    /// Displacement from rest.
    pub displacement: Vec<[f64; 3]>,
    /// 1 at fixed vertices.
    pub pinned: Vec<f64>,
}

impl Extras {
    /// As arrays for [`proxel_mesh::write_mesh`]. Cell arrays are left out where elements are not what the file holds
    /// (springs on the edges of a mesh of tetrahedra).
    pub fn to_fields(&self, mesh: &Mesh) -> Fields {
        let mut fields = Fields::none();
        let flat = |v: &[[f64; 3]]| v.as_flattened().to_vec();
        fields.point("displacement", 3, flat(&self.displacement));
        fields.point("reaction_force", 3, flat(&self.reaction));
        fields.point("pinned", 1, self.pinned.clone());
        let held = if !mesh.tets.is_empty() {
            mesh.tets.len()
        } else if !mesh.faces.is_empty() {
            mesh.faces.len()
        } else {
            mesh.edges.len()
        };
        if held == self.energy_density.len() {
            fields.cell("stretches", 3, flat(&self.stretches));
            fields.cell("energy_density", 1, self.energy_density.clone());
            fields.cell("von_mises_stress", 1, self.von_mises.clone());
        }
        fields
    }
}

impl Extras {
    /// Stretches, energies and stresses of the elements `cells` of a mesh, from flat positions at rest and now.
    pub(crate) fn fill(
        &mut self,
        mesh: &Mesh,
        cells: &Cells,
        settings: &DeformSettings,
        (rest, x): (&[f64], &[f64]),
        dim: usize,
    ) -> Result<(), DeformError> {
        self.stretches = vec![[1.0; 3]; cells.len()];
        self.energy_density = vec![0.0; cells.len()];
        self.von_mises = vec![0.0; cells.len()];
        for (material, chosen) in cells.by_material(mesh, settings) {
            let lame = material.lame().map_err(|e| DeformError(e.to_string()))?;
            let size = cells.size();
            let corners: Vec<u32> =
                chosen.iter().flat_map(|e| &cells.corners()[e * size..(e + 1) * size]).copied().collect();
            let batch = Batch { name: &material.energy, rest, x, corners: &corners, chosen: &chosen };
            match (cells, dim) {
                (Cells::Tets(_), _) => visit_3d(batch.name, &lame, batch.fill::<3, 3>(self)?).map_err(unknown)?,
                (Cells::Triangles(_), 3) => visit_2d(batch.name, &lame, batch.fill::<3, 2>(self)?).map_err(unknown)?,
                (Cells::Triangles(_), _) => visit_2d(batch.name, &lame, batch.fill::<2, 2>(self)?).map_err(unknown)?,
                (Cells::Springs(_), 3) => visit_1d(batch.name, &lame, batch.fill::<3, 1>(self)?).map_err(unknown)?,
                (Cells::Springs(_), _) => visit_1d(batch.name, &lame, batch.fill::<2, 1>(self)?).map_err(unknown)?,
            }
        }
        Ok(())
    }
}

/// Works out the fields of a result.
///
/// # Errors
/// As [`super::deform`].
pub fn extras(input: &DeformInput, settings: &DeformSettings, result: &Deformation) -> Result<Extras, DeformError> {
    if let Some(carried) = &result.carried {
        return carried.extras(input, settings, result);
    }
    let mesh = &input.rest;
    let n = mesh.n_verts();
    let mut kinds = Cells::all(mesh, result.repaired_tets.as_deref().unwrap_or(&mesh.tets), settings);
    let dim = if settings.planar { 2 } else { 3 };
    if settings.planar {
        planar::orient(&mesh.name, mesh, settings, &mut kinds)?;
    }
    let Some(cells) = kinds.first() else { return Ok(Extras::default()) };
    let center =
        mesh.bounding_box().map_or([0.0; 3], |(low, high)| std::array::from_fn(|d| low[d] / 2.0 + high[d] / 2.0));
    let centred = |p: &[[f64; 3]]| -> Vec<f64> { p.iter().flat_map(|p| (0..dim).map(|d| p[d] - center[d])).collect() };
    let (rest, x) = (centred(&mesh.points), centred(&result.positions));
    let mut out = Extras {
        stretches: Vec::new(),
        energy_density: Vec::new(),
        von_mises: Vec::new(),
        reaction: result.reaction.clone(),
        displacement: mesh
            .points
            .iter()
            .zip(&result.positions)
            .map(|(a, b)| std::array::from_fn(|d| b[d] - a[d]))
            .collect(),
        pinned: vec![0.0; n],
    };
    for (v, _) in &input.fixed {
        out.pinned[*v as usize] = 1.0;
    }
    out.fill(mesh, cells, settings, (&rest, &x), dim)?;
    Ok(out)
}

fn unknown(e: proxel_model::energy::UnknownEnergy) -> DeformError {
    DeformError(e.to_string())
}

/// Elements of one material.
struct Batch<'a> {
    name: &'a str,
    rest: &'a [f64],
    x: &'a [f64],
    corners: &'a [u32],
    chosen: &'a [usize],
}

impl<'a> Batch<'a> {
    fn fill<'o, const D: usize, const K: usize>(&self, out: &'o mut Extras) -> Result<Fill<'o, D, K>, DeformError>
    where
        'a: 'o,
    {
        let rest = Rest::<D, K>::new(self.rest, self.corners).map_err(|e| DeformError(e.to_string()))?;
        Ok(Fill { rest, x: self.x, chosen: self.chosen, out })
    }
}

/// Fills the fields of a batch once the energy's type is known.
struct Fill<'a, const D: usize, const K: usize> {
    rest: Rest<D, K>,
    x: &'a [f64],
    chosen: &'a [usize],
    out: &'a mut Extras,
}

impl<const D: usize, const K: usize> EnergyVisitor<K> for Fill<'_, D, K>
where
    Simplex: Shape<D, K>,
{
    type Output = ();
    fn visit<E: Energy<K>>(self, energy: E) {
        for (e, nodes) in self.rest.elements().chunks_exact(K + 1).enumerate() {
            let at = |k: usize, d: usize| self.x[nodes[k] as usize * D + d];
            let inverse = self.rest.inverse(e);
            let f: [[f64; K]; D] = std::array::from_fn(|d| {
                std::array::from_fn(|c| (0..K).map(|k| (at(k + 1, d) - at(0, d)) * inverse[k][c]).sum())
            });
            let svd = <Simplex as Shape<D, K>>::svd(f);
            let place = self.chosen[e];
            self.out.stretches[place][..K].copy_from_slice(&svd.s);
            self.out.energy_density[place] = energy.value(svd.s);
            self.out.von_mises[place] = von_mises(&svd.s, &energy.gradient(svd.s));
        }
    }
}

/// From principal Cauchy stresses sigma_i = psi_i s_i / J.
fn von_mises<const K: usize>(s: &[f64; K], gradient: &[f64; K]) -> f64 {
    let j: f64 = s.iter().product();
    if K == 1 {
        return gradient[0].abs();
    }
    if j == 0.0 {
        return f64::NAN;
    }
    let mut sigma = [0.0; 3];
    for i in 0..K {
        sigma[i] = gradient[i] * s[i] / j.abs();
    }
    let [a, b, c] = sigma;
    (((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2)) / 2.0).sqrt()
}
