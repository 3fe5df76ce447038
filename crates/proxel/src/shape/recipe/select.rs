//! Parts of a mesh.

use proxel_mesh::topology::{face_edges, polygon_edges};
use proxel_mesh::{Mesh, Polygons};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Vertices: "all", "border", "inner" or the name of a selection; their numbers; or those within a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum VertexSpec {
    /// "all", "border", "inner", or a name.
    Named(String),
    /// Numbers, 0-based.
    Listed(Vec<u32>),
    /// Within a box.
    Within(Region),
}

/// Faces: "all"; their numbers; those with so many corners; or those whose corners are all selected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FaceSpec {
    /// "all", or the name of a selection that has all their corners.
    Named(String),
    /// Numbers, 0-based.
    Listed(Vec<u32>),
    /// Those with so many corners.
    Corners(Corners),
    /// Whose corners are all within a box.
    Within(Region),
}

/// Edges of faces: "all", "border", "inner" or the name of a selection that has both ends; or pairs of vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum EdgeSpec {
    /// "all", "border", "inner", or a name.
    Named(String),
    /// Pairs of vertices, 0-based; they need not be edges of faces.
    Listed(Vec<[u32; 2]>),
}

/// A number of corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Corners {
    /// Corners of a face.
    pub corners: usize,
}

/// A box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Its least and its largest corner, which belong to it.
    #[serde(rename = "box")]
    pub corners: [[f64; 3]; 2],
}

impl Region {
    fn holds(&self, p: [f64; 3]) -> bool {
        let [low, high] = self.corners;
        (0..3).all(|d| low[d] <= p[d] && p[d] <= high[d])
    }
}

/// A mesh whose parts are looked for.
pub(super) struct Selector<'a> {
    mesh: &'a Mesh,
    named: BTreeMap<&'a str, Vec<bool>>,
    border: Vec<[u32; 2]>, // edges of one face
    on_border: Vec<bool>,
}

impl<'a> Selector<'a> {
    /// With the named selections, each of which is a part of the mesh by itself.
    ///
    /// # Errors
    /// The selection, and what is wrong with it.
    pub fn new(mesh: &'a Mesh, select: &'a BTreeMap<String, VertexSpec>) -> Result<Self, (String, String)> {
        let border = border(&mesh.faces);
        let mut on_border = vec![false; mesh.n_verts()];
        border.iter().flatten().for_each(|v| on_border[*v as usize] = true);
        let mut selector = Selector { mesh, named: BTreeMap::new(), border, on_border };
        for (name, spec) in select {
            let place = |what: String| (format!("select.{name}"), what);
            if ["all", "border", "inner"].contains(&name.as_str()) {
                return Err(place("the name has a meaning already; give it another".to_string()));
            }
            if let VertexSpec::Named(other) = spec
                && select.contains_key(other)
            {
                return Err(place(format!("it is another name for `{other}`; use that")));
            }
            let mut chosen = vec![false; mesh.n_verts()];
            selector.vertices(spec).map_err(place)?.iter().for_each(|v| chosen[*v as usize] = true);
            selector.named.insert(name, chosen);
        }
        Ok(selector)
    }

    /// Edges of one face only, each as (smaller, larger).
    pub fn border(&self) -> &[[u32; 2]] {
        &self.border
    }

    fn chosen(&self, name: &str) -> Result<Vec<bool>, String> {
        let n = self.mesh.n_verts();
        let mut used = vec![false; n];
        self.mesh.faces.indices().iter().for_each(|v| used[*v as usize] = true);
        Ok(match name {
            "all" => used,
            "border" => self.on_border.clone(),
            "inner" => (0..n).map(|v| used[v] && !self.on_border[v]).collect(),
            _ => match self.named.get(name) {
                Some(chosen) => chosen.clone(),
                None => {
                    let known: Vec<&str> =
                        ["all", "border", "inner"].into_iter().chain(self.named.keys().copied()).collect();
                    return Err(format!("there is no selection `{name}`; known are {}", known.join(", ")));
                }
            },
        })
    }

    /// Vertices, in the order given, ascending where none is.
    pub fn vertices(&self, spec: &VertexSpec) -> Result<Vec<u32>, String> {
        let n = self.mesh.n_verts() as u32;
        let of = |chosen: Vec<bool>| (0..n).filter(|v| chosen[*v as usize]).collect::<Vec<u32>>();
        match spec {
            VertexSpec::Named(name) => self.chosen(name).map(of),
            VertexSpec::Within(region) => Ok(of(self.mesh.points.iter().map(|p| region.holds(*p)).collect())),
            VertexSpec::Listed(list) => {
                let mut seen = vec![false; n as usize];
                for v in list {
                    match seen.get_mut(*v as usize) {
                        None => return Err(format!("vertex {v} is out of range, the vertices are 0 to {}", n - 1)),
                        Some(seen) if *seen => return Err(format!("vertex {v} is named twice; name it once")),
                        Some(seen) => *seen = true,
                    }
                }
                Ok(list.clone())
            }
        }
    }

    /// Numbers of faces.
    pub fn faces(&self, spec: &FaceSpec) -> Result<Vec<u32>, String> {
        let faces = &self.mesh.faces;
        let those = |holds: &dyn Fn(&[u32]) -> bool| {
            let held = faces.iter().enumerate().filter(|(_, f)| holds(f));
            held.map(|(f, _)| f as u32).collect::<Vec<u32>>()
        };
        match spec {
            FaceSpec::Named(name) => {
                let chosen = self.chosen(name)?;
                Ok(those(&|f| f.iter().all(|v| chosen[*v as usize])))
            }
            FaceSpec::Corners(Corners { corners }) => Ok(those(&|f| f.len() == *corners)),
            FaceSpec::Within(region) => Ok(those(&|f| f.iter().all(|v| region.holds(self.mesh.points[*v as usize])))),
            FaceSpec::Listed(list) => {
                let mut seen = vec![false; faces.len()];
                for f in list {
                    match seen.get_mut(*f as usize) {
                        None => {
                            return Err(format!("face {f} is out of range, the faces are 0 to {}", faces.len() - 1));
                        }
                        Some(seen) if *seen => return Err(format!("face {f} is named twice; name it once")),
                        Some(seen) => *seen = true,
                    }
                }
                Ok(list.clone())
            }
        }
    }

    /// Edges as pairs of vertices.
    pub fn edges(&self, spec: &EdgeSpec) -> Result<Vec<[u32; 2]>, String> {
        match spec {
            EdgeSpec::Named(name) if name == "border" => Ok(self.border.clone()),
            EdgeSpec::Named(name) if name == "inner" => {
                let all = face_edges(&self.mesh.faces);
                Ok(all.into_iter().filter(|e| self.border.binary_search(e).is_err()).collect())
            }
            EdgeSpec::Named(name) => {
                let chosen = self.chosen(name)?;
                let all = face_edges(&self.mesh.faces);
                Ok(all.into_iter().filter(|e| e.iter().all(|v| chosen[*v as usize])).collect())
            }
            EdgeSpec::Listed(list) => {
                let n = self.mesh.n_verts();
                for [a, b] in list {
                    if *a as usize >= n || *b as usize >= n {
                        return Err(format!("edge [{a}, {b}] is out of range, the vertices are 0 to {}", n - 1));
                    }
                    if a == b {
                        return Err(format!("edge [{a}, {b}] has one end only; give two vertices"));
                    }
                }
                let mut sorted: Vec<[u32; 2]> = list.iter().map(|[a, b]| [*a.min(b), *a.max(b)]).collect();
                sorted.sort_unstable();
                match sorted.windows(2).find(|w| w[0] == w[1]) {
                    Some(twice) => Err(format!("edge {:?} is named twice; name it once", twice[0])),
                    None => Ok(list.clone()),
                }
            }
        }
    }
}

/// Edges of one face only, each as (smaller, larger), in their order.
fn border(faces: &Polygons) -> Vec<[u32; 2]> {
    let mut all: Vec<[u32; 2]> = faces.iter().flat_map(polygon_edges).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    all.sort_unstable();
    all.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]).collect()
}
