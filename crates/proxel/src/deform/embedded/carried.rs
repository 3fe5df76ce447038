//! What a lattice knows of the surface that it carried: strains, stresses, forces at pins.

use super::super::extras;
use super::{Carrier, DeformError, DeformInput, DeformSettings, Deformation};
use crate::deform::Extras;
use proxel_mesh::embed::Embedding;
use proxel_mesh::{Fields, Mesh};
use proxel_split::PointSpring;

/// The lattice that carried a surface, and how it is deformed.
#[derive(Clone, Debug)]
pub struct Carried {
    /// The surface in the lattice at rest.
    pub embedding: Embedding,
    pub(super) input: DeformInput,
    pub(super) settings: DeformSettings,
    pub(super) result: Box<Deformation>,
    pub(super) springs: Vec<u32>, // the vertices that the first of the ties hold
}

impl Carried {
    /// The nodes of the lattice after the deformation.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.result.positions
    }

    /// The deformed lattice with its fields: displacements, stretches, energy density (of what is material), von Mises
    /// stress, and the part of each cell that is material.
    ///
    /// # Errors
    /// As [`super::super::extras`].
    pub fn lattice(&self) -> Result<(Mesh, Fields), DeformError> {
        let mesh = self.embedding.lattice.with_points(self.result.positions.clone())?;
        let mut fields = extras(&self.input, &self.settings, &self.result)?.to_fields(&mesh);
        fields.cell("fill", 1, self.embedding.fill.clone());
        Ok((mesh, fields))
    }

    /// Fields of the surface: a face has those of the tetrahedron with the largest energy density among its corners', a
    /// pinned vertex the force that the body exerts on what holds it.
    pub(in super::super) fn extras(
        &self,
        input: &DeformInput,
        settings: &DeformSettings,
        result: &Deformation,
    ) -> Result<Extras, DeformError> {
        let mesh = &input.rest;
        let lattice = extras(&self.input, &DeformSettings { density: 0.0, ..settings.clone() }, &self.result)?;
        let displacement =
            mesh.points.iter().zip(&result.positions).map(|(a, b)| std::array::from_fn(|d| b[d] - a[d])).collect();
        let (reaction, pinned) = (result.reaction.clone(), vec![0.0; mesh.n_verts()]);
        let mut out = Extras { displacement, reaction, pinned, ..Extras::default() };
        for face in mesh.faces.iter() {
            let tets = face.iter().filter_map(|&v| self.embedding.tet_of[v as usize]);
            let density = |t: &u32| lattice.energy_density[*t as usize];
            let worst = tets.max_by(|a, b| density(a).total_cmp(&density(b)).then(b.cmp(a)));
            let Some(t) = worst.map(|t| t as usize) else { continue };
            out.stretches.push(lattice.stretches[t]);
            out.energy_density.push(lattice.energy_density[t]);
            out.von_mises.push(lattice.von_mises[t]);
        }
        input.fixed.iter().for_each(|(v, _)| out.pinned[*v as usize] = 1.0);
        Ok(out)
    }

    /// The force that the body exerts on what holds each pinned vertex; 0 at others.
    pub(super) fn reactions(&self, input: &DeformInput) -> Vec<[f64; 3]> {
        let mut out = vec![[0.0; 3]; input.rest.n_verts()];
        let x = self.result.positions.as_flattened();
        let mut ties = Vec::new();
        for &(v, target) in &input.fixed {
            let Some((nodes, weights)) = self.embedding.at(v as usize) else { continue };
            ties.push((v, PointSpring { nodes, weights, target, stiffness: 0.0 }));
        }
        let fixed = self.input.fixed.iter().map(|(n, _)| (*n, self.result.reaction[*n as usize]));
        Carrier::shared(&ties, fixed, &mut out);
        // Springs of pins come first among the ties, by vertex in the order of what was pinned.
        for (v, tie) in self.springs.iter().zip(&self.input.ties) {
            let gap = tie.gap(x, 3);
            (0..3).for_each(|d| out[*v as usize][d] += tie.stiffness * gap[d]);
        }
        out
    }
}
