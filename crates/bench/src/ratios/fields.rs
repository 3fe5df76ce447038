//! An iteration of the nearest integrable field (A, Figure 12) against the time of reading and writing its arrays once.

use super::{Row, Samples, Threshold};
use crate::BenchError;
use crate::parts::pool;
use proxel::geodesic::gradient_problem;
use proxel::mesh::topology::boundary_surface;
use proxel::mesh::{Mesh, generate};
use proxel::settings::{GeodesicSettings, GradientForm};
use proxel::split::{Admm, AdmmSettings, Cycle, Direct, Method, Order};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::PathBuf;

/// Iterations before the first that is timed, and as many for each time.
const AT_A_TIME: usize = 20;
/// Numbers that a task handles.
const CHUNK: usize = 8192;

/// The bunny of A's figure with its source, or a ball's skin; and the same with every triangle in sixteen, too large for caches.
fn surfaces() -> Result<[(Mesh, u32); 2], BenchError> {
    let (mesh, source) = surface()?;
    let mut fine = mesh.clone();
    for _ in 0..2 {
        fine = quartered(&fine);
    }
    fine.name = format!("{}, in sixteenths", mesh.name);
    Ok([(mesh, source), (fine, source)])
}

/// Every triangle in four; vertices keep their numbers.
fn quartered(mesh: &Mesh) -> Mesh {
    let mut points = mesh.points.clone();
    let mut middles = HashMap::new();
    let mut triangles = Vec::new();
    for [a, b, c] in mesh.faces.fan_triangles() {
        let mut middle = |v: u32, w: u32| {
            *middles.entry((v.min(w), v.max(w))).or_insert_with(|| {
                let (v, w) = (mesh.points[v as usize], mesh.points[w as usize]);
                points.push([0, 1, 2].map(|d| 0.5 * (v[d] + w[d])));
                points.len() as u32 - 1
            })
        };
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    Mesh::from_triangles(&mesh.name, points, &triangles)
}

fn surface() -> Result<(Mesh, u32), BenchError> {
    let path = std::env::var_os("PROXEL_DATA").map(|root| PathBuf::from(root).join("geodesic/bunny_nf42k.obj"));
    if let Some(path) = path.filter(|path| path.is_file()) {
        return Ok((super::read(&path)?, 9689));
    }
    let ball = generate::ball(1.0, 0.03).map_err(BenchError::from_display)?;
    let skin = Mesh::from_triangles("ball", ball.points.clone(), &boundary_surface(&ball.tets));
    let source = skin.faces.get(0)[0];
    Ok((skin, source))
}

/// What an iteration reads, and what it writes too.
struct Arrays {
    written: Vec<Vec<f64>>,
    read: Vec<Vec<f64>>,
}

impl Arrays {
    /// For `nodes` with `dim` numbers each and copies of them in `slots`: x, that of before, p, u, the images of the copies;
    /// targets, stiffness and diagonal of the nodes, weight, direction or share, and the index (half a number) of each slot.
    fn new(dim: usize, nodes: usize, slots: usize) -> Self {
        let of = |lengths: &[usize]| lengths.iter().map(|n| vec![0.5; *n]).collect();
        let written = of(&[dim * nodes, dim * nodes, dim * slots, dim * slots, slots]);
        Arrays { written, read: of(&[dim * nodes, nodes, nodes, slots, dim * slots, slots, slots / 2]) }
    }

    fn bytes(&self) -> usize {
        let numbers = |arrays: &[Vec<f64>]| arrays.iter().map(Vec::len).sum::<usize>();
        8 * (2 * numbers(&self.written) + numbers(&self.read))
    }

    /// Everything once.
    fn pass(&mut self) -> f64 {
        for array in &mut self.written {
            array.par_chunks_mut(CHUNK).for_each(|part| part.iter_mut().for_each(|v| *v = 1.0 - *v));
        }
        let eights = |part: &[f64]| {
            let (eights, rest) = part.as_chunks::<8>();
            let mut sums = [0.0; 8];
            eights.iter().for_each(|v| (0..8).for_each(|k| sums[k] += v[k]));
            sums.iter().chain(rest).sum::<f64>()
        };
        self.read.iter().map(|array| array.par_chunks(CHUNK).map(eights).sum::<f64>()).sum()
    }
}

pub(super) fn rows(repeats: usize) -> Result<Vec<Row>, BenchError> {
    let mut rows = Vec::new();
    for (mesh, source) in surfaces()? {
        for (threads, form) in [(1, GradientForm::Faces), (2, GradientForm::Faces), (2, GradientForm::Edges)] {
            rows.push(row((&mesh, source), threads, form, repeats)?);
        }
    }
    Ok(rows)
}

fn row((mesh, source): (&Mesh, u32), threads: usize, form: GradientForm, repeats: usize) -> Result<Row, BenchError> {
    let settings = GeodesicSettings { form, ..GeodesicSettings::default() };
    let problem = gradient_problem(mesh, &[source], &settings).map_err(BenchError::from_display)?;
    let (dim, nodes) = (problem.dim, problem.n_free);
    let mut arrays = Arrays::new(dim, nodes, problem.terms.iter().map(|t| t.n_elems()).sum());
    let parts = AdmmSettings { name: "admm".into(), global: Box::new(Direct), reweighting: None, renewed_at: None };
    let admm = Admm::new(problem, parts).map_err(BenchError::from_display)?;
    let mut admm = admm.with_cycle(Cycle { order: Order::Zxu, ..Cycle::PLAIN }).map_err(BenchError::from_display)?;
    let (mut iteration, mut traffic) = (Samples::default(), Samples::default());
    pool(threads)?.install(|| {
        for round in 0..=repeats {
            let mut one = Samples::default();
            let end = one.time(|| (0..AT_A_TIME).try_for_each(|_| admm.step().map(|_| ())));
            end.map_err(BenchError::from_display)?;
            let mut other = Samples::default();
            let sum = other.time(|| (0..AT_A_TIME).map(|_| arrays.pass()).sum::<f64>());
            if !sum.is_finite() {
                return Err(BenchError("a sum of halves has no finite end".to_string()));
            }
            if round > 0 {
                iteration.append(one);
                traffic.append(other);
            }
        }
        Ok(())
    })?;
    let each = |seconds: f64| 1e3 * seconds / AT_A_TIME as f64;
    let figures = |s: &Samples| format!("{:.3}; {:.3} ms", each(s.least()), each(s.median()));
    Ok(Row {
        quantity: format!(
            "fields: an iteration of ADMM, {}: {}, {nodes} unknowns of {dim}, threads: {threads}",
            form.as_str(),
            mesh.name
        ),
        against: format!("its arrays, {:.1} MB: {}", arrays.bytes() as f64 / 1e6, figures(&traffic)),
        figures: figures(&iteration),
        ratio: Some(iteration.least() / traffic.least()),
        of_medians: Some(iteration.median() / traffic.median()),
        threshold: Some(Threshold::AtMost(1.5)),
    })
}
