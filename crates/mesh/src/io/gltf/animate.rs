//! An animated mesh: one morph target a frame, blended from each frame to the next.

use super::write::{Document, require_range};
use crate::error::{ErrorKind, MeshError, Result};
use crate::mesh::Mesh;
use serde_json::json;
use std::io::{self, Write};

/// With F frames the weights are F^2 numbers; beyond this many frames they would outweigh the mesh.
pub const MOST_FRAMES: usize = 1000;

/// Frames as they come; the first is the mesh itself, each later one a morph target. At the time of frame k the weight of
/// its target is 1 and all others are 0, and between frames weights are linear in time, hence positions too.
pub(crate) struct Animation {
    document: Document,
    file: String,
    base: Vec<[f32; 3]>,
    targets: Vec<usize>,
    times: Vec<f64>,
}

impl Animation {
    /// With the first frame: `mesh` at its time.
    pub fn new(file: &str, mesh: &Mesh, time: f64) -> Result<Self> {
        require_range(file, &mesh.points)?;
        let document = Document::new(mesh);
        let base = mesh.points.iter().map(|&p| document.local(p)).collect();
        let mut out = Animation { document, file: file.to_owned(), base, targets: Vec::new(), times: Vec::new() };
        out.at(time)?;
        Ok(out)
    }

    fn at(&mut self, time: f64) -> Result<()> {
        let frame = self.times.len();
        let later = self.times.last().is_none_or(|last| (time - self.times[0]) as f32 > (last - self.times[0]) as f32);
        if !(later && time.is_finite()) {
            let what = format!("frame {frame} is at time {time}, not after the one before it");
            return Err(MeshError::new(ErrorKind::InvalidParameter, &self.file, what, "give frames ascending times"));
        }
        if frame == MOST_FRAMES {
            let what = format!("more than {MOST_FRAMES} frames");
            let remedy = "write a series (.pvd, or numbered .obj or .ply files) or every n-th frame";
            return Err(MeshError::new(ErrorKind::Unsupported, &self.file, what, remedy));
        }
        self.times.push(time);
        Ok(())
    }

    /// The next frame.
    pub fn push(&mut self, time: f64, points: &[[f64; 3]]) -> Result<()> {
        require_range(&self.file, points)?;
        self.at(time)?;
        let origin = self.document.origin;
        // Against the base as it is stored, so that its rounding does not add to that of the frame.
        let moved =
            |(p, base): (&[f64; 3], &[f32; 3])| [0, 1, 2].map(|d| (p[d] - origin[d] - f64::from(base[d])) as f32);
        let moved: Vec<[f32; 3]> = points.iter().zip(&self.base).map(moved).collect();
        let target = self.document.points(&moved);
        self.targets.push(target);
        Ok(())
    }

    /// Writes the file.
    pub fn write(mut self, binary: bool, w: &mut dyn Write) -> io::Result<()> {
        let n = self.targets.len();
        if n == 0 {
            return self.document.write(binary, 0, json!({}), w);
        }
        let times: Vec<f32> = self.times.iter().map(|t| (t - self.times[0]) as f32).collect();
        let weights: Vec<f32> =
            (0..=n).flat_map(|frame| (1..=n).map(move |target| if frame == target { 1.0 } else { 0.0 })).collect();
        let (input, output) = (self.document.scalars(&times), self.document.scalars(&weights));
        self.document.morph(&self.targets);
        let animation = json!({
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
            "samplers": [{ "input": input, "output": output, "interpolation": "LINEAR" }]
        });
        self.document.write(binary, n, json!({ "animations": [animation] }), w)
    }
}
