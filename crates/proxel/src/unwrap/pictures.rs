//! The pictures of a map: in the plane, on the surface, as colours of vertices.

use crate::preview::{Camera, Image, UvPicture, draw_checkerboard, draw_uv_map, heat_map, stretches};
use proxel_mesh::uv::UvMap;
use proxel_mesh::{Fields, Mesh, MeshError};

/// Size of a picture.
const SIZE: [usize; 2] = [1024, 1024];
const SIDE_BY_SIDE: [usize; 2] = [1440, 720];

/// The triangles that are mapped, with what pictures need of them.
pub struct MapPictures<'a> {
    mesh: &'a Mesh,
    triangles: Vec<[u32; 3]>,
    uv: Vec<[[f64; 2]; 3]>,
    stretch: Vec<f64>,
    packed: bool,
}

impl<'a> MapPictures<'a> {
    /// Of the faces as fans around their first corners; `packed` says that the page is the unit square.
    pub fn new(mesh: &'a Mesh, map: &UvMap, packed: bool) -> Self {
        let (mut triangles, mut uv) = (Vec::new(), Vec::new());
        for (f, face) in mesh.faces.iter().enumerate() {
            let first = mesh.faces.offsets()[f] as usize;
            for k in 2..face.len() {
                let corners = [0, k - 1, k];
                let places = corners.map(|c| map.at(first + c));
                if let [Some(a), Some(b), Some(c)] = places {
                    triangles.push(corners.map(|c| face[c]));
                    uv.push([a, b, c]);
                }
            }
        }
        let stretch = stretches(&mesh.points, &triangles, &uv);
        MapPictures { mesh, triangles, uv, stretch, packed }
    }

    /// The map, coloured by distortion, with its seams.
    pub fn map(&self) -> Image {
        let picture =
            UvPicture { triangles: &self.triangles, uv: &self.uv, stretch: &self.stretch, unit_square: self.packed };
        draw_uv_map(&picture, SIZE[0], SIZE[1])
    }

    /// A checkerboard on the surface, from the front and from behind.
    pub fn surface(&self) -> Image {
        let [width, height] = SIDE_BY_SIDE;
        draw_checkerboard(&self.mesh.points, &self.triangles, &self.uv, &Camera::default(), width, height)
    }

    /// Distortion as colours of vertices.
    ///
    /// # Errors
    /// As [`heat_map`].
    pub fn heat(&self) -> Result<Fields, MeshError> {
        heat_map(&self.mesh.points, &self.triangles, &self.stretch)
    }
}
