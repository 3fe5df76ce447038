//! What `deform` begins with.

use super::mesh::PlainMesh;
use super::{ProblemFile, finite};
use crate::deform::DeformInput;
use crate::pins::{HalfSpace, InputError};
use crate::settings::DeformSettings;
use proxel_split::Equality;
use serde::{Deserialize, Serialize};

type V3 = [f64; 3];

/// A row of equalities.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    nodes: Vec<(u32, f64)>,
    value: V3,
}

/// [`DeformInput`] and [`DeformSettings`] as they are written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Pose {
    /// All but the strain limit, whose upper end may be infinite, which JSON has not.
    settings: DeformSettings,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    strain_limit: Option<(f64, Option<f64>)>,
    rest: PlainMesh,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    start: Option<Vec<V3>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    fixed: Vec<(u32, V3)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    soft: Vec<(u32, V3, f64)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    loads: Vec<(u32, V3)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pressures: Vec<(Vec<u32>, f64)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    equalities: Vec<Row>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    obstacles: Vec<HalfSpace>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    groups: Vec<(String, Vec<u32>)>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reference: Option<Vec<V3>>,
}

impl Pose {
    pub fn of(input: &DeformInput, settings: &DeformSettings) -> Result<Self, InputError> {
        let name = &input.rest.name;
        if input.energy.is_some() {
            let what = "an energy of one's own is no data";
            return Err(InputError::new(name, what, "keep a problem with a material"));
        }
        let check = |what: &str, numbers: &mut dyn Iterator<Item = &f64>| finite(name, what, numbers);
        let flat = |points: &Option<Vec<V3>>| points.iter().flatten().flatten().copied().collect::<Vec<f64>>();
        check("the start", &mut flat(&input.start).iter())?;
        check("the reference", &mut flat(&input.reference).iter())?;
        check("targets", &mut input.fixed.iter().flat_map(|f| &f.1))?;
        check("soft springs", &mut input.soft.iter().flat_map(|s| s.1.iter().chain([&s.2])))?;
        check("loads", &mut input.loads.iter().flat_map(|f| &f.1))?;
        check("pressures", &mut input.pressures.iter().map(|p| &p.1))?;
        check("obstacles", &mut input.obstacles.iter().flat_map(|o| o.point.iter().chain(&o.normal)))?;
        for row in &input.equalities {
            check("equalities", &mut row.nodes.iter().map(|n| &n.1).chain(&row.value))?;
        }
        settings.check().map_err(|e| InputError::new(name, e, "correct it"))?;
        let limit = settings.strain_limit.map(|[low, high]| (low, Some(high).filter(|high| high.is_finite())));
        Ok(Pose {
            settings: DeformSettings { strain_limit: None, ..settings.clone() },
            strain_limit: limit,
            rest: PlainMesh::of(&input.rest)?,
            start: input.start.clone(),
            fixed: input.fixed.clone(),
            soft: input.soft.clone(),
            loads: input.loads.clone(),
            pressures: input.pressures.clone(),
            equalities: input.equalities.iter().map(|e| Row { nodes: e.nodes.clone(), value: e.value }).collect(),
            obstacles: input.obstacles.clone(),
            groups: input.groups.clone(),
            reference: input.reference.clone(),
        })
    }

    pub fn into_problem(self, name: &str) -> Result<ProblemFile, InputError> {
        let mut settings = self.settings;
        let limit = self.strain_limit.map(|(low, high)| [low, high.unwrap_or(f64::INFINITY)]);
        settings.strain_limit = limit.or(settings.strain_limit);
        settings.check().map_err(|e| InputError::new(name, e, "correct it"))?;
        let rest = self.rest.into_mesh(name)?;
        let n = rest.n_verts();
        for (what, points) in [("start", &self.start), ("reference", &self.reference)] {
            if let Some(m) = points.as_ref().map(Vec::len).filter(|m| *m != n) {
                let text = format!("{what} has {m} vertices, the mesh has {n}");
                return Err(InputError::new(name, text, "write it anew with --dump"));
            }
        }
        let nodes = self.fixed.iter().map(|f| f.0).chain(self.soft.iter().map(|s| s.0));
        let nodes = nodes.chain(self.loads.iter().map(|l| l.0));
        let nodes = nodes.chain(self.pressures.iter().flat_map(|p| p.0.iter().copied()));
        let nodes = nodes.chain(self.equalities.iter().flat_map(|e| e.nodes.iter().map(|n| n.0)));
        let mut nodes = nodes.chain(self.groups.iter().flat_map(|g| g.1.iter().copied()));
        if let Some(v) = nodes.find(|v| *v as usize >= n) {
            let text = format!("vertex {v} (0-based) is named, the mesh has {n}");
            return Err(InputError::new(name, text, "write it anew with --dump"));
        }
        let input = DeformInput {
            rest,
            start: self.start,
            fixed: self.fixed,
            soft: self.soft,
            loads: self.loads,
            pressures: self.pressures,
            equalities: self.equalities.into_iter().map(|r| Equality { nodes: r.nodes, value: r.value }).collect(),
            obstacles: self.obstacles,
            groups: self.groups,
            reference: self.reference,
            ..DeformInput::default()
        };
        Ok(ProblemFile::Deform { input: Box::new(input), settings: Box::new(settings) })
    }
}
