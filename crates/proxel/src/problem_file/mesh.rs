//! A mesh within a problem file.

use crate::pins::InputError;
use proxel_mesh::{Mesh, Polygons};
use serde::{Deserialize, Serialize};

/// A [`Mesh`] as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlainMesh {
    name: String,
    points: Vec<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    tets: Vec<[u32; 4]>,
    /// Corners of each face; none where all have three.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    face_sizes: Vec<u32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    faces: Vec<u32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    edges: Vec<[u32; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    tet_regions: Option<Vec<i32>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    face_regions: Option<Vec<i32>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    edge_regions: Option<Vec<i32>>,
    #[serde(default, skip_serializing_if = "is_zero")]
    index_base: u32,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    planar: bool,
}

fn is_zero(n: &u32) -> bool {
    *n == 0
}

impl PlainMesh {
    pub fn of(mesh: &Mesh) -> Result<Self, InputError> {
        super::finite(&mesh.name, "its points", mesh.points.as_flattened())?;
        let triangles = mesh.faces.iter().all(|face| face.len() == 3);
        Ok(PlainMesh {
            name: mesh.name.clone(),
            points: mesh.points.clone(),
            tets: mesh.tets.clone(),
            face_sizes: if triangles { Vec::new() } else { mesh.faces.iter().map(|f| f.len() as u32).collect() },
            faces: mesh.faces.indices().to_vec(),
            edges: mesh.edges.clone(),
            tet_regions: mesh.tet_regions.clone(),
            face_regions: mesh.face_regions.clone(),
            edge_regions: mesh.edge_regions.clone(),
            index_base: mesh.index_base,
            planar: mesh.planar,
        })
    }

    pub fn into_mesh(self, name: &str) -> Result<Mesh, InputError> {
        let refuse =
            |what: String| InputError::new(name, format!("{}: {what}", self.name), "write it anew with --dump");
        let mut faces = Polygons::new();
        if self.face_sizes.is_empty() {
            let (triangles, rest) = self.faces.as_chunks::<3>();
            if !rest.is_empty() {
                return Err(refuse("its faces are no triangles".to_owned()));
            }
            triangles.iter().for_each(|t| faces.push(t));
        } else {
            let mut rest = &self.faces[..];
            for (k, size) in self.face_sizes.iter().enumerate() {
                let Some((corners, after)) = rest.split_at_checked(*size as usize).filter(|_| *size > 0) else {
                    return Err(refuse(format!(
                        "face {k} (0-based) has {size} corners, of which {} are there",
                        rest.len()
                    )));
                };
                faces.push(corners);
                rest = after;
            }
            if !rest.is_empty() {
                return Err(refuse(format!("{} corners belong to no face", rest.len())));
            }
        }
        let counts = [
            ("tetrahedra", self.tets.len(), self.tet_regions.as_ref().map(Vec::len)),
            ("faces", faces.len(), self.face_regions.as_ref().map(Vec::len)),
            ("edges", self.edges.len(), self.edge_regions.as_ref().map(Vec::len)),
        ];
        for (what, n, regions) in counts {
            if let Some(m) = regions.filter(|m| *m != n) {
                return Err(refuse(format!("it has regions of {m} {what}, and {n} of them")));
            }
        }
        if self.index_base > 1 {
            return Err(refuse(format!("index_base is {}; it is 0 or 1", self.index_base)));
        }
        let mesh = Mesh {
            name: self.name,
            points: self.points,
            tets: self.tets,
            faces,
            edges: self.edges,
            tet_regions: self.tet_regions,
            face_regions: self.face_regions,
            edge_regions: self.edge_regions,
            index_base: self.index_base,
            planar: self.planar,
        };
        let checked = mesh.check_indices().and_then(|()| mesh.check_repeated());
        checked.map_err(|e| InputError::new(name, e.to_string(), "write it anew with --dump"))?;
        Ok(mesh)
    }
}
