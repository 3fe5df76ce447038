//! The folder of a simulation: frames as they come, so that a crash loses at most the one under way.
//!
//! ```text
//! scene.toml      settings completed          frames.csv    a row a frame
//! report.json     the report so far           frames.pvd    for ParaView, with BODY_0000.vtu, ..
//! frames.jsonl    all that is known of each   state.bin     what the next frame begins with; written last
//! ```
//!
//! What a frame costs does not depend on how many came before: lists are added to, and the report, which has all frames in
//! it, is written anew whenever their number has grown by a part of itself.

use super::growing::Growing;
use super::{Frame, FrameRecord, Scene, SceneFile, SimulateError, State};
use crate::preview::{Image, animate_pngs};
use crate::report::Report;
use proxel_mesh::topology::surface;
use proxel_mesh::{Fields, MOST_GLTF_FRAMES, Mesh, Polygons, atomic_write, read_points, write_mesh, write_series};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Where frames go.
pub struct Folder {
    path: PathBuf,
    scene: Scene,
    records: Vec<FrameRecord>,
    lists: Option<Lists>, // once there is a frame
}

/// What grows by something a frame.
struct Lists {
    table: Growing,   // frames.csv
    series: Growing,  // frames.pvd
    records: Growing, // frames.jsonl
}

/// The report of the frames so far is written with each frame until there are so many, then whenever their number has grown
/// by that part.
const REPORTED: usize = 32;

/// report.json: a report, and what is known of the frames.
#[derive(Serialize)]
struct WholeReport<'a> {
    #[serde(flatten)]
    report: Report,
    /// Frames whose kinetic, elastic and potential energy together is above that of the frame before, where nothing drives
    /// the scene.
    energy_growth: Vec<usize>,
    /// |sum m v - its value at the start| over sqrt(2 M K), the largest momentum that the kinetic energy so far could have
    /// been, where nothing acts from outside, gravity included.
    momentum_drift: Option<f64>,
    /// |sum m x cross v - its value at the start| over the largest angular momentum so far, likewise.
    angular_momentum_drift: Option<f64>,
    frames: &'a [FrameRecord],
}

/// What may change the energy and the momenta of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ledger {
    /// Nothing but gravity acts from outside: no wind, no damping, no pins, no obstacles.
    pub free: bool,
    /// Energy comes from outside: from wind, from pins and obstacles that move.
    pub driven: bool,
    /// All there is of mass, kg.
    pub mass: f64,
}

/// A growth of the energy by less than this part of its largest so far is rounding and the tolerance of steps.
const GROWTH: f64 = 1e-9;

impl Folder {
    /// Makes the folder, or takes one that is there, and begins anew in it: what an earlier simulation has left goes.
    ///
    /// # Errors
    /// A folder that cannot be made or written to.
    pub fn create(path: &Path, file: &SceneFile) -> Result<Self, SimulateError> {
        let folder = Folder::at(path, file)?;
        let io = |e: std::io::Error, what: &Path| {
            SimulateError::new(format!("{}: {e}; name another folder", what.display()))
        };
        std::fs::create_dir_all(path).map_err(|e| io(e, path))?;
        // The state first: without it nothing goes on from what is half removed.
        let own = ["state.bin", "frames.csv", "frames.pvd", "frames.jsonl", "report.json", "scene.glb", "preview.png"];
        for name in own {
            let old = path.join(name);
            if old.is_file() {
                std::fs::remove_file(&old).map_err(|e| io(e, &old))?;
            }
        }
        for old in folder.old_frames() {
            std::fs::remove_file(&old).map_err(|e| io(e, &old))?;
        }
        for (wanted, name) in folder.folders() {
            if wanted {
                std::fs::create_dir_all(path.join(name)).map_err(|e| io(e, &path.join(name)))?;
            }
        }
        let text = file.completed()?;
        atomic_write(&path.join("scene.toml"), |w| w.write_all(text.as_bytes()))?;
        Ok(folder)
    }

    /// Goes on in a folder; the state after its last complete frame.
    ///
    /// # Errors
    /// No simulation there, one of another scene, or one that broke off before frame 0 was written.
    pub fn reopen(path: &Path, file: &SceneFile) -> Result<(Self, State), SimulateError> {
        let mut folder = Folder::at(path, file)?;
        let bad = |what: String| SimulateError::new(format!("{}: {what}", path.display()));
        let read = |name: &str| std::fs::read(path.join(name)).ok();
        let old = read("scene.toml")
            .and_then(|bytes| String::from_utf8(bytes).ok())
            .ok_or_else(|| bad("there is no simulation to go on with; leave --resume out".into()))?;
        let new = file.completed()?;
        if let Some(line) = first_difference(&old, &new) {
            return Err(bad(format!(
                "the simulation there is of another scene: scene.toml differs in line {line}; leave --resume out, or name \
                 another folder"
            )));
        }
        let state = read("state.bin")
            .and_then(|bytes| State::from_bytes(&bytes))
            .ok_or_else(|| bad("no frame there is complete; leave --resume out".into()))?;
        let lines = read("frames.jsonl").and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default();
        let records = lines.lines().take(state.frame() + 1).map_while(|line| serde_json::from_str(line).ok());
        folder.records = records.collect();
        let complete = folder.records.iter().enumerate().all(|(k, record)| record.frame == k);
        if folder.records.len() != state.frame() + 1 || !complete {
            return Err(bad("frames.jsonl has lost frames; leave --resume out".into()));
        }
        // Without what was begun after that frame.
        folder.lists = Some(folder.lists()?);
        Ok((folder, state))
    }

    fn at(path: &Path, file: &SceneFile) -> Result<Self, SimulateError> {
        let scene = file.scene().clone();
        if scene.output.glb && scene.time.frames + 1 > MOST_GLTF_FRAMES {
            let what = format!(
                "{} frames and the start are more than the {MOST_GLTF_FRAMES} of a glTF file",
                scene.time.frames
            );
            return Err(file.refuse("output.glb", &what, "leave it out, or simulate fewer frames").into());
        }
        if path.exists() && !path.is_dir() {
            return Err(SimulateError::new(format!("{}: it is a file; name a folder (--out)", path.display())));
        }
        Ok(Folder { path: path.to_owned(), scene, records: Vec::new(), lists: None })
    }

    fn folders(&self) -> [(bool, &'static str); 3] {
        let output = &self.scene.output;
        [(output.obj, "obj"), (output.ply, "ply"), (output.preview, "preview")]
    }

    /// Numbered files that a simulation of these bodies has left.
    fn old_frames(&self) -> Vec<PathBuf> {
        let mut out = Vec::new();
        for (folder, extension) in [("", "vtu"), ("obj", "obj"), ("ply", "ply"), ("preview", "png")] {
            let Ok(entries) = std::fs::read_dir(self.path.join(folder)) else { continue };
            for entry in entries.flatten() {
                let name = entry.file_name().to_string_lossy().into_owned();
                let Some(stem) = name.strip_suffix(&format!(".{extension}")) else { continue };
                let of_body =
                    |body: &str| stem.strip_prefix(body).and_then(|s| s.strip_prefix('_')).is_some_and(is_number);
                let ours =
                    self.scene.bodies.iter().any(|b| of_body(&b.name)) || (folder == "preview" && is_number(stem));
                if ours {
                    out.push(entry.path());
                }
            }
        }
        out.sort();
        out
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is known of the frames so far.
    pub fn records(&self) -> &[FrameRecord] {
        &self.records
    }

    /// Writes a frame and then the state after it.
    ///
    /// # Errors
    /// A full disk, a folder that has gone; what was complete before stays so.
    pub fn write(
        &mut self,
        frame: &Frame,
        preview: Option<&Image>,
        state: &State,
        report: &Report,
        ledger: Ledger,
    ) -> Result<(), SimulateError> {
        let k = frame.record.frame;
        for (name, mesh, fields) in &frame.bodies {
            write_mesh(&self.path.join(format!("{name}_{k:04}.vtu")), mesh, fields)?;
            if self.scene.output.obj {
                write_mesh(&self.path.join(format!("obj/{name}_{k:04}.obj")), mesh, &Fields::none())?;
            }
            if self.scene.output.ply {
                let velocity = fields.point.iter().filter(|f| f.name == "velocity").cloned().collect();
                let fields = Fields { point: velocity, ..Fields::none() };
                write_mesh(&self.path.join(format!("ply/{name}_{k:04}.ply")), mesh, &fields)?;
            }
        }
        if let Some(image) = preview {
            image.write_png(&self.path.join(format!("preview/{k:04}.png")))?;
        }
        let pieces = (row(&frame.record), self.data_sets(&frame.record), line(&frame.record)?);
        self.records.push(frame.record.clone());
        match &mut self.lists {
            Some(lists) => {
                let added = lists.table.add(&pieces.0).and_then(|()| lists.series.add(&pieces.1));
                added.and_then(|()| lists.records.add(&pieces.2)).map_err(SimulateError::new)?;
            }
            None => self.lists = Some(self.lists()?),
        }
        let n = self.records.len();
        if n.is_multiple_of((n / REPORTED).max(1)) {
            self.write_report(report, ledger)?;
        }
        let bytes = state.to_bytes();
        Ok(atomic_write(&self.path.join("state.bin"), |w| w.write_all(&bytes))?)
    }

    /// The lists with all frames so far.
    fn lists(&self) -> Result<Lists, SimulateError> {
        let at = |name: &str| self.path.join(name);
        let all = || self.records.iter();
        let lines = all().map(line).collect::<Result<Vec<String>, _>>()?;
        let header = format!("{}\n", FrameRecord::HEADER);
        let head = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
                    <Collection>\n";
        Ok(Lists {
            table: Growing::create(&at("frames.csv"), &header, all().map(row), "")?,
            series: Growing::create(
                &at("frames.pvd"),
                head,
                all().map(|record| self.data_sets(record)),
                "</Collection>\n</VTKFile>\n",
            )?,
            records: Growing::create(&at("frames.jsonl"), "", lines.into_iter(), "")?,
        })
    }

    /// The lines of a frame in ParaView's list of times.
    fn data_sets(&self, record: &FrameRecord) -> String {
        let (time, k) = (record.time, record.frame);
        let bodies = self.scene.bodies.iter().enumerate().map(|(part, body)| {
            let name = &body.name;
            format!("<DataSet timestep=\"{time}\" part=\"{part}\" name=\"{name}\" file=\"{name}_{k:04}.vtu\"/>\n")
        });
        bodies.collect()
    }

    /// Writes report.json; returns its text.
    ///
    /// # Errors
    /// A full disk, a folder that has gone.
    pub fn write_report(&self, report: &Report, ledger: Ledger) -> Result<String, SimulateError> {
        let (momentum_drift, angular_momentum_drift) = self.drifts(ledger);
        let whole = WholeReport {
            report: report.clone(),
            energy_growth: self.growth(ledger),
            momentum_drift,
            angular_momentum_drift,
            frames: &self.records,
        };
        let text = serde_json::to_string_pretty(&whole)
            .map_err(|e| SimulateError::new(format!("the report cannot be written: {e}")))?
            + "\n";
        atomic_write(&self.path.join("report.json"), |w| w.write_all(text.as_bytes()))?;
        Ok(text)
    }

    fn growth(&self, ledger: Ledger) -> Vec<usize> {
        if ledger.driven {
            return Vec::new();
        }
        // The zero of potential energy means nothing: changes are measured against the energies that change.
        let size = |r: &FrameRecord| {
            let fall = self.records.first().map_or(0.0, |first| (r.potential - first.potential).abs());
            r.kinetic.abs() + r.elastic.abs() + fall
        };
        let largest = self.records.iter().map(size).fold(0.0, f64::max);
        let pairs = self.records.windows(2);
        pairs.filter(|w| w[1].energy() - w[0].energy() > GROWTH * largest).map(|w| w[1].frame).collect()
    }

    /// How far momenta are from those of the start, where nothing changes them.
    fn drifts(&self, ledger: Ledger) -> (Option<f64>, Option<f64>) {
        let Some(first) = self.records.first().filter(|_| ledger.free && self.scene.forces.gravity == [0.0; 3]) else {
            return (None, None);
        };
        let norm = |a: [f64; 3]| a.iter().map(|v| v * v).sum::<f64>().sqrt();
        let minus = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|d| a[d] - b[d]);
        // A body that turns on the spot has no momentum that a drift could be compared with.
        let could_be = |r: &FrameRecord| (2.0 * ledger.mass * r.kinetic).sqrt();
        let over = |of: fn(&FrameRecord) -> [f64; 3], size: &dyn Fn(&FrameRecord) -> f64| {
            let largest = self.records.iter().map(size).fold(0.0, f64::max);
            let drift = self.records.iter().map(|r| norm(minus(of(r), of(first)))).fold(0.0, f64::max);
            if largest > 0.0 { drift / largest } else { 0.0 }
        };
        let spin = |r: &FrameRecord| norm(r.angular_momentum);
        (Some(over(|r| r.momentum, &could_be)), Some(over(|r| r.angular_momentum, &spin)))
    }

    /// What is made of all frames: scene.glb and preview.png, where they are wanted.
    ///
    /// # Errors
    /// Frames that have gone, a full disk.
    pub fn finish(&self) -> Result<Vec<PathBuf>, SimulateError> {
        let mut written = Vec::new();
        if self.scene.output.glb {
            written.push(self.write_glb()?);
        }
        if self.scene.output.preview {
            let path = self.path.join("preview.png");
            let frames: Vec<PathBuf> =
                self.records.iter().map(|r| self.path.join(format!("preview/{:04}.png", r.frame))).collect();
            animate_pngs(&path, &frames, self.scene.time.dt)?;
            written.push(path);
        }
        Ok(written)
    }

    fn write_glb(&self) -> Result<PathBuf, SimulateError> {
        let path = self.path.join("scene.glb");
        let vtu = |name: &str, k: usize| self.path.join(format!("{name}_{k:04}.vtu"));
        let mut all = Mesh { name: "scene".into(), ..Mesh::default() };
        for body in &self.scene.bodies {
            let mesh = proxel_mesh::read_mesh(&vtu(&body.name, 0))?;
            let first = all.points.len() as u32;
            let mut faces = std::mem::take(&mut all.faces);
            append(&mut faces, &surface(&mesh), first);
            all.edges.extend(mesh.edges.iter().map(|e| e.map(|v| v + first)));
            all.faces = faces;
            all.points.extend(mesh.points);
        }
        let frames = self.records.iter().map(|record| {
            let mut points = Vec::with_capacity(all.points.len());
            for body in &self.scene.bodies {
                points.extend(read_points(&vtu(&body.name, record.frame))?);
            }
            Ok(proxel_mesh::Frame { time: record.time, points, fields: Fields::none() })
        });
        write_series(&path, &all, frames)?;
        Ok(path)
    }
}

/// The line of a frame in frames.csv.
fn row(record: &FrameRecord) -> String {
    record.to_csv() + "\n"
}

/// The line of a frame in frames.jsonl.
fn line(record: &FrameRecord) -> Result<String, SimulateError> {
    let text = serde_json::to_string(record);
    Ok(text.map_err(|e| SimulateError::new(format!("a frame cannot be written: {e}")))? + "\n")
}

fn append(faces: &mut Polygons, more: &Polygons, first: u32) {
    for polygon in more.iter() {
        let corners: Vec<u32> = polygon.iter().map(|v| v + first).collect();
        faces.push(&corners);
    }
}

fn is_number(text: &str) -> bool {
    text.len() >= 4 && text.bytes().all(|b| b.is_ascii_digit())
}

/// The 1-based number of the first line in which two texts differ.
fn first_difference(a: &str, b: &str) -> Option<usize> {
    if a == b {
        return None;
    }
    let same = a.lines().zip(b.lines()).take_while(|(a, b)| a == b).count();
    Some(same + 1)
}
