//! Runs of the methods that shape meshes.

use super::course::{Course, Point, Residual};
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::deform::Hooks;
use proxel::mesh::{Mesh, Polygons, read_mesh};
use proxel::preview::{Camera, Model, Scene, Style, render};
use proxel::report::TraceRow;
use proxel::shape::{ShapeInput, ShapeMethod, ShapeSettings, Shaped, WireSettings, edge_lengths, planarize, wire};
use proxel::split::normalized;
use std::path::PathBuf;

pub(super) const LEVELS: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

/// What is asked of a mesh.
#[derive(Clone)]
pub(super) enum Task {
    Planar(ShapeSettings),
    Wire(WireSettings),
}

/// A mesh and what is asked of it.
pub(super) struct Problem {
    pub name: String,
    pub input: ShapeInput,
    pub task: Task,
}

impl Task {
    /// Method and weights.
    pub fn settings(&mut self) -> &mut ShapeSettings {
        match self {
            Task::Planar(settings) => settings,
            Task::Wire(settings) => &mut settings.shape,
        }
    }

    /// The same by a method with so many columns and iterations.
    pub fn by(&self, method: ShapeMethod, anderson: usize, max_iters: usize) -> Task {
        let mut task = self.clone();
        let settings = task.settings();
        (settings.method, settings.anderson, settings.max_iters) = (method, anderson, max_iters);
        task
    }
}

impl Problem {
    /// Runs a task on its mesh.
    pub fn shape(&self, task: &Task, hooks: &mut Hooks<'_>) -> Result<Shaped, BenchError> {
        match task {
            Task::Planar(settings) => planarize(&self.input, settings, hooks),
            Task::Wire(settings) => wire(&self.input, settings, hooks),
        }
        .map_err(BenchError::from_display)
    }

    /// N_z, and the mean edge in the coordinates of the problem, which are scaled by a power of two.
    fn norms(&self) -> (usize, f64) {
        let mesh = &self.input.mesh;
        let (mean, _) = edge_lengths(&mesh.points, &mesh.faces);
        let numbers = match &self.task {
            Task::Planar(_) => mesh.faces.iter().filter(|f| f.len() > 3).map(|f| 3 * f.len()).sum(),
            Task::Wire(_) => {
                let corners: usize = mesh.faces.iter().map(|f| f.len()).sum();
                3 * proxel::mesh::topology::face_edges(&mesh.faces).len() + 6 * corners
            }
        };
        (numbers, mean / mean.log2().round().exp2())
    }

    /// A run with its combined residuals, normalised without mu.
    pub fn course(&self, context: &mut Context<'_>, name: &str, task: &Task) -> Result<(Course, Shaped), BenchError> {
        let mut task = task.clone();
        task.settings().threads = context.options.threads;
        task.settings().tol = 1e-13; // to the last iteration
        let mu = task.settings().mu;
        let ((numbers, a), mut points, mut rejected, mut first) = (self.norms(), Vec::new(), 0, 0.0);
        let mut on_row = |row: &TraceRow| {
            if row.iteration == 0 {
                first = row.seconds;
                return;
            }
            rejected += usize::from(!row.accepted);
            points.push(Point {
                iteration: row.iteration,
                seconds: row.seconds - first,
                rejected,
                forward: f64::INFINITY,
                combined: normalized(row.merit / mu, numbers, a),
                position: f64::INFINITY,
                violation: 0.0,
            });
        };
        let shaped = self.shape(&task, &mut Hooks { trace: Some(&mut on_row), ..Hooks::default() })?;
        let last = points.last().map_or((0, f64::NAN), |p| (p.iteration, p.combined));
        context.tell(&format!("{}: {name}: {} iterations, residual {:.1e}", self.name, last.0, last.1));
        let course = Course { problem: self.name.clone(), method: name.to_string(), points, x: Vec::new() };
        Ok((course, shaped))
    }

    /// Pictures side by side, coloured by the square roots of values at vertices on one scale.
    pub fn picture(&self, context: &Context<'_>, suffix: &str, of: &[(&Shaped, Vec<f64>)]) -> Result<(), BenchError> {
        let top = of.iter().flat_map(|(_, values)| values).copied().fold(0.0, f64::max);
        let triangles = self.input.mesh.faces.fan_triangles();
        let scene = |(shaped, values): &(&Shaped, Vec<f64>)| {
            let colors: Vec<f64> = values.iter().map(|v| if top > 0.0 { (v / top).sqrt() } else { 0.0 }).collect();
            Scene { models: vec![Model::new(shaped.positions.clone(), triangles.clone()).colored_by(&colors)] }
        };
        let scenes: Vec<Scene> = of.iter().map(scene).collect();
        let image = render(&scenes, &Camera::default(), &Style::default(), 640 * scenes.len(), 640);
        image
            .write_png(&context.options.out.join(context.file(&format!("{suffix}.png"))))
            .map_err(BenchError::from_display)
    }

    /// The largest error of the faces around each vertex: `shaped.faces[k]`.
    pub fn at_vertices(&self, shaped: &Shaped, k: usize) -> Vec<f64> {
        let mesh = &self.input.mesh;
        let mut worst = vec![0.0_f64; mesh.n_verts()];
        for (face, error) in mesh.faces.iter().zip(shaped.faces.get(k).map_or(&[][..], |errors| &errors.after)) {
            face.iter().for_each(|v| worst[*v as usize] = worst[*v as usize].max(*error));
        }
        worst
    }
}

/// The last point of a course that is not later than the end of another.
pub(super) fn at_equal_time(slow: &Course, fast: &Course) -> usize {
    let end = fast.points.last().map_or(0.0, |p| p.seconds);
    slow.points.iter().take_while(|p| p.seconds <= end).last().map_or(1, |p| p.iteration)
}

/// Iterations to each level, theirs after a slash, milliseconds an iteration.
pub(super) fn table(courses: &[Course], theirs: &[(&str, &str, [usize; 3])]) -> Table {
    let levels = LEVELS.iter().map(|level| format!("{level:e}"));
    let mut table = Table::new(
        ["method".to_string()].into_iter().chain(levels).chain(["at the end", "seconds"].map(str::to_string)),
    );
    for course in courses {
        let known = theirs.iter().find(|(problem, method, _)| course.problem == *problem && course.method == *method);
        let cell = |(k, level): (usize, &f64)| {
            let ours = course.reached(Residual::Combined, *level).map_or("-".to_string(), |p| match p.rejected {
                0 => p.iteration.to_string(),
                n => format!("{} (+{n})", p.iteration),
            });
            // 0 stands for a level that theirs did not reach.
            match known.and_then(|(_, _, counts)| counts.get(k.checked_sub(1)?)).filter(|count| **count > 0) {
                Some(count) => format!("{ours} / {count}"),
                None => ours,
            }
        };
        let last = course.points.last();
        let end = last.map_or(String::new(), |p| format!("{:.2e} after {}", p.combined, p.iteration));
        let took = last.map_or(f64::NAN, |p| p.seconds);
        let cells = [course.method.clone()].into_iter().chain(LEVELS.iter().enumerate().map(cell));
        table.row(cells.chain([end, seconds(took)]));
    }
    table
}

/// Meshes from the folder of the data, if they are there and wanted.
pub(super) fn meshes(context: &Context<'_>, files: [&str; 2]) -> Result<Option<[Mesh; 2]>, BenchError> {
    let folder = std::env::var_os("PROXEL_DATA").map(|root| PathBuf::from(root).join("geometry"));
    let Some(folder) = folder.filter(|_| !context.options.quick) else { return Ok(None) };
    let paths = files.map(|file| folder.join(file));
    if !paths.iter().all(|path| path.exists()) {
        return Ok(None);
    }
    let read = |path: &PathBuf| read_mesh(path).map_err(BenchError::from_display);
    Ok(Some([read(&paths[0])?, read(&paths[1])?]))
}

/// A wavy sheet of n x n quads, none of them planar.
pub(super) fn sheet(n: usize) -> Mesh {
    let (mut points, mut faces) = (Vec::new(), Polygons::new());
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (i as f64, j as f64);
            points.push([x + 0.1 * (0.9 * y).sin(), y, 1.5 * (0.35 * x).sin() + (0.4 * y + 0.2 * x).cos()]);
        }
    }
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    for i in 0..n {
        for j in 0..n {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Mesh { name: "sheet".to_string(), points, faces, ..Mesh::default() }
}
