//! Surfaces of bodies: a lattice of tetrahedra around the surface is deformed, and carries it.

mod carried;
mod hold;
mod lattice;

pub use carried::Carried;

use super::check::{check_size, check_vectors};
use super::{DeformError, DeformInput, Deformation, Hooks, deform_here, group_sums};
use crate::report::LatticeReport;
use crate::settings::{DeformSettings, SurfaceModel};
use proxel_mesh::Mesh;
use proxel_mesh::embed::{Embedding, NEARLY_CLOSED, embed, mesh_closedness};
use std::time::Instant;

/// A pinned vertex of the surface that comes within this part of the bounding box's diagonal of where it is to be is put
/// there exactly: stiff springs yield less. What is farther away the lattice cannot reach.
const HELD: f64 = 1e-4;

/// A surface in its lattice: turns what holds and loads the surface into what holds and loads the lattice, and positions
/// of the lattice into those of the surface.
///
/// Where pins move rigidly, as those of a handle do, the nodes of their tetrahedra are fixed and move with them. A vertex
/// of the surface is a fixed combination of four nodes, so any other pin becomes a stiff spring from that combination to
/// its target ([`DeformInput::ties`]), a load is shared out among the nodes, and so is the weight of each tetrahedron.
/// Energy and mass of a tetrahedron are those of the part of its cell that is inside the surface.
pub struct Carrier {
    name: String,
    embedding: Embedding,
    diagonal: f64,   // of the bounding box
    is_turned: bool, // normals point inward
    warnings: Vec<String>,
}

/// What a surface is taken for.
pub(crate) enum Carrying {
    /// The skin of a body.
    Body(Box<Carrier>),
    /// Elements, as they are; and what the user should know about it.
    No {
        /// That a surface was taken for a sheet without being asked.
        warning: Option<String>,
    },
}

impl Carrier {
    /// Embeds the faces of `mesh`, as a body.
    ///
    /// # Errors
    /// A mesh that cannot be embedded, such as a surface with no inside.
    pub fn new(mesh: &Mesh, settings: &DeformSettings) -> Result<Self, DeformError> {
        mesh.check_indices()?;
        mesh.check_repeated()?;
        let name = if mesh.name.is_empty() { "surface".to_string() } else { mesh.name.clone() };
        check_size(&name, mesh)?;
        let mut embedding = embed(mesh, settings.resolution)?;
        embedding.lattice.name = format!("{name} (lattice)");
        let mut warnings = Vec::new();
        if let Some(join) = embedding.joins.first() {
            let place = join.place.map(|x| format!("{x:.3}")).join(", ");
            warnings.push(format!(
                "{name}: {} cells join parts of the surface that face each other, such as faces {} and {} (0-based) near \
                 [{place}]; a higher --resolution parts them",
                embedding.joins.len(),
                join.a,
                join.b
            ));
        }
        let mut loose = (0..mesh.n_verts()).filter(|&v| embedding.tet_of[v].is_none());
        if let Some(first) = loose.next() {
            let count = loose.count() + 1;
            warnings.push(format!(
                "{name}: {count} vertices belong to no face, the first is {first} (0-based); they stay in place"
            ));
        }
        let diagonal = mesh.bounding_box().map_or(0.0, |(low, high)| distance(low, high));
        let is_turned = mesh_closedness(mesh) < 0.0;
        Ok(Carrier { name, embedding, diagonal, is_turned, warnings })
    }

    /// Decides by the settings and by whether the surface is nearly closed.
    pub(crate) fn of(input: &DeformInput, settings: &DeformSettings) -> Result<Carrying, DeformError> {
        let mesh = &input.rest;
        let elements = !mesh.tets.is_empty() || mesh.faces.is_empty();
        let embeds = match settings.surface {
            SurfaceModel::Shell => false,
            SurfaceModel::Embed if elements => {
                return Err(DeformError(format!(
                    "{}: only faces can be embedded, and it has {}; leave --embed and --resolution out",
                    mesh.name,
                    if mesh.tets.is_empty() { "none" } else { "tetrahedra" }
                )));
            }
            SurfaceModel::Embed => true,
            SurfaceModel::Auto if elements || mesh.planar || settings.material.energy == "spring" => false,
            // What only a sheet has says that it is one.
            SurfaceModel::Auto
                if settings.bending > 0.0 || settings.strain_limit.is_some() || settings.planar || settings.mixed =>
            {
                false
            }
            SurfaceModel::Auto => {
                mesh.check_indices()?;
                check_size(&mesh.name, mesh)?;
                let closedness = mesh_closedness(mesh).abs();
                if closedness < NEARLY_CLOSED {
                    let warning = format!(
                        "{}: taken for a thin sheet, since it is not nearly closed (winding number {closedness:.2} on \
                         average, a closed surface has 0.50); --shell says so, --embed makes a body of it",
                        mesh.name
                    );
                    return Ok(Carrying::No { warning: Some(warning) });
                }
                true
            }
        };
        if !embeds {
            return Ok(Carrying::No { warning: None });
        }
        let cannot = [
            (!settings.materials.is_empty(), "has one material; leave --materials out"),
            (settings.bending > 0.0, "does not bend as a sheet; leave --bending out"),
            (settings.material.energy == "spring", "is no net of springs; give another --material"),
            (settings.planar || settings.mixed, "is neither planar nor mixed; leave --planar and --mixed out"),
        ];
        if let Some((_, why)) = cannot.iter().find(|(given, _)| *given) {
            return Err(DeformError(format!(
                "{}: a surface that is deformed as a body {why}, or use --shell",
                mesh.name
            )));
        }
        Ok(Carrying::Body(Box::new(Carrier::new(mesh, settings)?)))
    }

    /// What the surface is called in messages.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// What the user should know.
    pub(crate) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The surface in its lattice.
    pub fn embedding(&self) -> &Embedding {
        &self.embedding
    }

    /// Deforms the lattice, and the surface with it.
    pub(super) fn deform(
        self,
        input: &DeformInput,
        settings: &DeformSettings,
        hooks: &mut Hooks<'_>,
        threads: usize,
        began: Instant,
    ) -> Result<Deformation, DeformError> {
        check_vectors(&self.name, input.rest.n_verts(), input)?;
        let (lattice_input, lattice_settings) = self.lattice_problem(input, settings)?;
        let inner = deform_here(&lattice_input, &lattice_settings, hooks, threads, began)?;
        let mut positions = self.positions(&inner.positions, &input.rest.points, &input.fixed);
        let start = self.positions(&inner.start, &input.rest.points, &input.fixed);
        let mut report = inner.report.clone();
        report.settings = serde_json::to_value(settings).unwrap_or_default();
        report.warnings.splice(0..0, self.warnings.iter().cloned());
        let pin_error = self.hold(&mut positions, &input.fixed, &mut report.warnings);
        report.position_error = input.reference.as_ref().map(|r| error_ratio(&positions, &start, r, &input.fixed));
        report.lattice = Some(LatticeReport {
            resolution: settings.resolution,
            cell: self.embedding.cell,
            nodes: self.embedding.lattice.n_verts(),
            tetrahedra: self.embedding.lattice.tets.len(),
            closedness: self.embedding.closedness,
            joined_cells: self.embedding.joins.len(),
            pin_error,
        });
        let status = inner.status;
        let springs = self.held(&input.rest.points, &input.fixed).springs.iter().map(|s| s.0).collect();
        let carried = Carried {
            springs,
            embedding: self.embedding,
            input: lattice_input,
            settings: lattice_settings,
            result: Box::new(inner),
        };
        let reaction = carried.reactions(input);
        let mut held = vec![false; positions.len()];
        input.fixed.iter().for_each(|(v, _)| held[*v as usize] = true);
        report.reactions.extend(group_sums(&input.groups, &|v| held[v as usize], &reaction));
        let carried = Some(Box::new(carried));
        Ok(Deformation { positions, start, status, report, repaired_tets: None, reaction, carried })
    }

    /// The surface when the lattice is at these positions. Vertices that no face uses stay at rest, or where they are
    /// pinned.
    pub fn positions(&self, lattice: &[[f64; 3]], rest: &[[f64; 3]], fixed: &[(u32, [f64; 3])]) -> Vec<[f64; 3]> {
        let mut out = self.embedding.carry(lattice, rest);
        for &(v, target) in fixed.iter().filter(|(v, _)| self.embedding.at(*v as usize).is_none()) {
            out[v as usize] = target;
        }
        out
    }

    /// Puts pinned vertices exactly where they are to be, if they are all but there, and returns the largest distance over
    /// the diagonal before that. What the lattice cannot reach stays where the lattice has it, and is told.
    pub(super) fn hold(
        &self,
        positions: &mut [[f64; 3]],
        fixed: &[(u32, [f64; 3])],
        warnings: &mut Vec<String>,
    ) -> f64 {
        let (mut worst, mut missed) = ((0.0, 0), 0);
        for &(v, target) in fixed {
            let gap = distance(positions[v as usize], target);
            if gap <= HELD * self.diagonal {
                positions[v as usize] = target;
            } else {
                missed += 1;
            }
            if gap > worst.0 {
                worst = (gap, v);
            }
        }
        let worst_part = if self.diagonal > 0.0 { worst.0 / self.diagonal } else { 0.0 };
        if missed > 0 {
            warnings.push(format!(
                "{}: {missed} of {} pinned vertices are not where they are to be, farthest vertex {} (0-based), by {:.3e} or \
                 {worst_part:.1e} of the bounding box's diagonal: the lattice is too coarse to follow them; raise \
                 --resolution or pin fewer vertices",
                self.name,
                fixed.len(),
                worst.1,
                worst.0
            ));
        }
        worst_part
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
}

/// |x - X*| / |x0 - X*| over vertices that are not pinned.
fn error_ratio(x: &[[f64; 3]], x0: &[[f64; 3]], reference: &[[f64; 3]], fixed: &[(u32, [f64; 3])]) -> f64 {
    let mut free = vec![true; x.len()];
    fixed.iter().for_each(|f| free[f.0 as usize] = false);
    let norm = |x: &[[f64; 3]]| {
        let squares = (0..x.len()).filter(|&v| free[v]).map(|v| distance(x[v], reference[v]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    norm(x) / norm(x0).max(f64::MIN_POSITIVE)
}
