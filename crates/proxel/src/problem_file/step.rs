//! What a frame of a simulation begins with.

use super::mesh::PlainMesh;
use super::{ProblemFile, finite};
use crate::pins::InputError;
use crate::simulate::{PlainState, SceneFile, State};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A scene, the files that it names, and a [`State`] as they are written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Step {
    /// The scene completed, as TOML, which has all numbers.
    scene: String,
    /// The meshes by the names that the scene has for them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    meshes: BTreeMap<String, PlainMesh>,
    state: PlainState,
}

impl Step {
    pub fn of(scene: &SceneFile, state: &State) -> Result<Self, InputError> {
        let state = state.plain();
        finite("the state", "its positions and velocities", state.numbers())?;
        let meshes = scene.meshes().map(|(name, mesh)| Ok((name.clone(), PlainMesh::of(mesh)?)));
        Ok(Step { scene: scene.as_toml()?, meshes: meshes.collect::<Result<_, InputError>>()?, state })
    }

    pub fn into_problem(self, name: &str) -> Result<ProblemFile, InputError> {
        let mut scene = SceneFile::parse(format!("{name}: scene"), self.scene, false, PathBuf::new())?;
        for (file, mesh) in self.meshes {
            scene.embed(file, mesh.into_mesh(name)?);
        }
        if let Some(file) = scene.missing() {
            let text = format!("the scene names `{file}`, which is not in it");
            return Err(InputError::new(name, text, "write it anew with --dump"));
        }
        let Some(state) = State::of_plain(self.state) else {
            return Err(InputError::new(
                name,
                "the numbers of its state do not fit each other",
                "write it anew with --dump",
            ));
        };
        Ok(ProblemFile::Simulate { scene: Box::new(scene), state })
    }
}
