//! The problem of the lattice: springs for pins, shared loads, a start.

use super::super::start;
use super::{Carrier, DeformError, DeformInput, DeformSettings};
use crate::deform::Skin;
use crate::deform::elements::Cells;
use proxel_mesh::Mesh;
use proxel_split::{Equality, PointSpring};
use std::collections::BTreeMap;

/// Stiffness of all pins in a tetrahedron together, in units of what squeezes its cell: modulus times side. A force that
/// strains a cell by half moves its pins by 5e-5 of a cell. Stiffer springs would drown the gradient in the rounding of
/// positions.
const PIN: f64 = 1e4;
/// The same for the springs that make the lattice follow a start of the surface. Only the start hangs on it.
const START: f64 = 1e2;

impl Carrier {
    /// The lattice as a body: what [`super::super::Body`] and every method take. Weight is among its loads, so the
    /// settings that come with it have no density.
    ///
    /// # Errors
    /// Moduli that describe no material.
    pub fn lattice_problem(
        &self,
        input: &DeformInput,
        settings: &DeformSettings,
    ) -> Result<(DeformInput, DeformSettings), DeformError> {
        let modulus = settings.material.modulus().map_err(|e| DeformError(e.to_string()))?;
        let unit = modulus * self.embedding.cell;
        let held = self.held(&input.rest.points, &input.fixed);
        let mut ties = self.stiff(held.springs.iter().map(|&(v, t)| (v as usize, t)), PIN * unit);
        for &(v, target, k) in &input.soft {
            ties.extend(self.tie(v as usize, target, k));
        }
        let start = match &input.start {
            None => None,
            Some(points) => {
                let mut start = self.start(points, &ties, modulus)?;
                held.nodes.iter().for_each(|(n, place)| start[*n as usize] = *place);
                Some(start)
            }
        };
        let lattice = DeformInput {
            // Messages name vertices of the surface.
            rest: Mesh { name: self.name.clone(), ..self.embedding.lattice.clone() },
            start,
            fixed: held.nodes,
            ties,
            loads: self.loads(input, settings),
            fill: Some(self.embedding.fill.clone()),
            pressures: input.pressures.clone(),
            equalities: self.equalities(input),
            obstacles: input.obstacles.clone(),
            skin: Some(self.skin(&input.rest)),
            ..DeformInput::default()
        };
        Ok((lattice, DeformSettings { density: 0.0, ..settings.clone() }))
    }

    /// The surface, outside out.
    pub(crate) fn skin(&self, surface: &Mesh) -> Skin {
        let mut triangles = surface.faces.fan_triangles();
        if self.is_turned {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        Skin::new((0..surface.n_verts()).map(|v| self.embedding.at(v)).collect(), &triangles)
    }

    /// Rows over the nodes. A pinned vertex counts as where it is held, whether the lattice brings it there or
    /// [`super::HELD`] allows for what it lacks, and a vertex of no face as where it rests.
    fn equalities(&self, input: &DeformInput) -> Vec<Equality> {
        let pinned: BTreeMap<u32, [f64; 3]> = input.fixed.iter().copied().collect();
        let of_row = |row: &Equality| {
            let mut nodes: BTreeMap<u32, f64> = BTreeMap::new();
            let mut value = row.value;
            for &(v, a) in &row.nodes {
                let held = pinned.get(&v).or_else(|| input.rest.points.get(v as usize));
                match (pinned.contains_key(&v), self.embedding.at(v as usize), held) {
                    (false, Some((carrying, weights)), _) => {
                        carrying.iter().zip(weights).for_each(|(n, w)| *nodes.entry(*n).or_default() += a * w);
                    }
                    (_, _, Some(place)) => (0..3).for_each(|d| value[d] -= a * place[d]),
                    // Out of range: a row that is refused.
                    (_, _, None) => value = [f64::NAN; 3],
                }
            }
            // What is left of a row over pins alone is whether they meet it.
            if nodes.is_empty() && !row.nodes.is_empty() {
                nodes.insert(0, 0.0);
            }
            Equality { nodes: nodes.into_iter().collect(), value }
        };
        input.equalities.iter().map(of_row).collect()
    }

    fn tie(&self, v: usize, target: [f64; 3], stiffness: f64) -> Option<PointSpring> {
        let (nodes, weights) = self.embedding.at(v)?;
        Some(PointSpring { nodes, weights, target, stiffness })
    }

    /// Springs to these targets; those of one tetrahedron share its stiffness `k`.
    fn stiff(&self, targets: impl Iterator<Item = (usize, [f64; 3])> + Clone, k: f64) -> Vec<PointSpring> {
        let tet = |v: usize| self.embedding.tet_of.get(v).copied().flatten();
        let mut count: BTreeMap<u32, usize> = BTreeMap::new();
        targets.clone().filter_map(|(v, _)| tet(v)).for_each(|t| *count.entry(t).or_default() += 1);
        targets.filter_map(|(v, target)| self.tie(v, target, k / *count.get(&tet(v)?)? as f64)).collect()
    }

    /// The lattice where it carries the surface to `points`, as nearly as it can and smoothly.
    pub(crate) fn start(
        &self,
        points: &[[f64; 3]],
        pins: &[PointSpring],
        modulus: f64,
    ) -> Result<Vec<[f64; 3]>, DeformError> {
        let mesh = &self.embedding.lattice;
        let origin = mesh.points.first().copied().unwrap_or_default();
        let mut ties = self.stiff(points.iter().copied().enumerate(), START * self.embedding.cell);
        ties.extend(pins.iter().map(|p| PointSpring { stiffness: p.stiffness / modulus, ..*p }));
        ties.iter_mut().for_each(|t| t.target = std::array::from_fn(|d| t.target[d] - origin[d]));
        let flat: Vec<f64> = mesh.points.iter().flat_map(|p| (0..3).map(|d| p[d] - origin[d])).collect();
        let same: Vec<u32> = (0..mesh.n_verts() as u32).collect();
        let cells = [Cells::Tets(mesh.tets.clone())];
        let x = start::smooth(&cells, &same, &flat, flat.clone(), mesh.n_verts(), 3, ties)?;
        Ok(x.chunks_exact(3).map(|p| std::array::from_fn(|d| p[d] + origin[d])).collect())
    }

    /// Loads of the surface and weights of the tetrahedra, on the nodes.
    fn loads(&self, input: &DeformInput, settings: &DeformSettings) -> Vec<(u32, [f64; 3])> {
        let e = &self.embedding;
        let mut on = vec![[0.0; 3]; e.lattice.n_verts()];
        let mut add = |node: u32, part: f64, force: [f64; 3]| {
            (0..3).for_each(|d| on[node as usize][d] += part * force[d]);
        };
        for &(v, force) in &input.loads {
            if let Some((nodes, weights)) = e.at(v as usize) {
                (0..4).for_each(|k| add(nodes[k], weights[k], force));
            }
        }
        let tet = e.cell.powi(3) / 6.0;
        for (nodes, fill) in e.lattice.tets.iter().zip(&e.fill) {
            let mass = settings.density * fill * tet;
            nodes.iter().for_each(|&node| add(node, mass / 4.0, settings.gravity));
        }
        let numbered = on.into_iter().enumerate().map(|(v, force)| (v as u32, force));
        numbered.filter(|(_, force)| *force != [0.0; 3]).collect()
    }
}
