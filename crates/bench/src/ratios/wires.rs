//! An iteration of a wire mesh against its parts: projections, nearest points, and the solve.

use super::{Row, Samples, Threshold};
use crate::BenchError;
use crate::parts::pool;
use proxel::mesh::topology::face_edges;
use proxel::mesh::{Mesh, Polygons};
use proxel::model::constraint::{
    AngleRange, Batch, Cells, EdgeDifference, Hold, Length, Near, Surface, TipDifferences, Vertex,
};
use proxel::shape::subdivide;
use proxel::split::{Admm, AdmmSettings, Cycle, Direct, Method, NormalMatrix, Order, Problem, Quadratic, Term, vector};
use std::f64::consts::FRAC_PI_4;
use std::path::PathBuf;
use std::sync::Arc;

/// mu of Zhang et al. 2019.
const PENALTY: f64 = 1000.0;
/// The z-x-u iteration.
const CYCLE: Cycle = Cycle { order: Order::Zxu, relaxation: 1.0 };
/// Iterations before the first that is timed.
const BEFORE: usize = 3;

/// The wire mesh of Zhang et al. 2019 and its reference; a wavy sheet, and itself, where there is none.
fn meshes() -> Result<(Mesh, Mesh), BenchError> {
    let folder = std::env::var_os("PROXEL_DATA").map(|root| PathBuf::from(root).join("geometry"));
    if let Some(folder) = folder.filter(|folder| folder.join("MaleTorso.obj").is_file()) {
        let [coarse, reference] = ["MaleTorso.obj", "MaleTorso_target.obj"].map(|name| super::read(&folder.join(name)));
        return Ok((subdivide(&coarse?).map_err(BenchError::from_display)?, reference?));
    }
    let n = 200_u32;
    let mut sheet = Mesh { name: "sheet".to_string(), faces: Polygons::new(), ..Mesh::default() };
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (f64::from(i), f64::from(j));
            sheet.points.push([x, y, 3.0 * (0.1 * x).sin() * (0.07 * y).cos()]);
        }
    }
    for i in 0..n {
        for j in 0..n {
            let at = |i: u32, j: u32| i * (n + 1) + j;
            sheet.faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Ok((sheet.clone(), sheet))
}

/// Angles, edges and closeness, in this order.
fn problem(mesh: &Mesh, reference: &Mesh) -> Result<Problem, BenchError> {
    let points = &mesh.points;
    let edges = face_edges(&mesh.faces);
    let length = |[a, b]: &[u32; 2]| {
        let (a, b) = (points[*a as usize], points[*b as usize]);
        (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
    };
    let mean = edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64;
    let tips = mesh.faces.iter().flat_map(|face| {
        let k = face.len();
        (0..k).flat_map(move |i| [face[i], face[(i + 1) % k], face[(i + k - 1) % k]])
    });
    let range = AngleRange::new(FRAC_PI_4, 3.0 * FRAC_PI_4);
    let angles = Cells::<TipDifferences, _>::new(tips.collect(), 3, range);
    let edges = Cells::<EdgeDifference, _>::new(edges.into_flattened(), 2, Length::equal(mean));
    let surface = Surface::new(&reference.points, &reference.faces.fan_triangles());
    let near = Near::Shared(Arc::new(surface.map_err(BenchError::from_display)?));
    let near = Cells::<Vertex, _>::new((0..points.len() as u32).collect(), 1, near);
    let terms: [Box<dyn Term>; 3] = [
        Box::new(Batch::new(Arc::new(angles.map_err(BenchError::from_display)?), Hold::Hard(PENALTY))),
        Box::new(Batch::new(Arc::new(edges.map_err(BenchError::from_display)?), Hold::Hard(PENALTY))),
        Box::new(Batch::new(Arc::new(near.map_err(BenchError::from_display)?), Hold::Soft(1.0))),
    ];
    let (n_free, x0) = (points.len(), points.as_flattened().to_vec());
    let quadratic = Quadratic::default();
    Ok(Problem { dim: 3, n_free, x0, terms: terms.into(), quadratic, barrier: false })
}

fn iteration(problem: Problem) -> Result<Admm, BenchError> {
    let (name, global) = ("admm".to_string(), Box::new(Direct));
    let settings = AdmmSettings { name, global, reweighting: None, renewed_at: None };
    let admm = Admm::new(problem, settings).map_err(BenchError::from_display)?;
    admm.with_cycle(CYCLE).map_err(BenchError::from_display)
}

pub(super) fn rows(repeats: usize) -> Result<Vec<Row>, BenchError> {
    let (mesh, reference) = meshes()?;
    let corners: usize = mesh.faces.iter().map(|face| face.len()).sum();
    let pool = pool(2)?;
    let mut rows = Vec::new();
    let (whole, parts) = pool.install(|| take(&mesh, &reference, repeats))?;
    let name = format!("{}: {} vertices, {corners} angles, 2 threads", mesh.name, mesh.n_verts());
    let names = ["projections of angles", "projections of edges", "nearest points", "the solve"];
    for (what, samples) in names.iter().zip(&parts) {
        rows.push(Row {
            quantity: format!("wires: {what}: {name}"),
            against: String::new(),
            figures: samples.milliseconds(),
            ratio: None,
            of_medians: None,
            threshold: None,
        });
    }
    let (least, median): (f64, f64) = (parts.iter().map(Samples::least).sum(), parts.iter().map(Samples::median).sum());
    rows.push(Row {
        quantity: format!("wires: an iteration of ADMM: {name}"),
        against: format!("its parts: {:.2}; {:.2} ms", 1e3 * least, 1e3 * median),
        figures: whole.milliseconds(),
        ratio: Some(whole.least() / least),
        of_medians: Some(whole.median() / median),
        threshold: Some(Threshold::AtMost(1.5)),
    });
    Ok(rows)
}

/// Times of iterations, and of the parts at the same x, p and u: each term, and the solve.
fn take(mesh: &Mesh, reference: &Mesh, repeats: usize) -> Result<(Samples, [Samples; 4]), BenchError> {
    let mut method = iteration(problem(mesh, reference)?)?;
    let mut alone = problem(mesh, reference)?;
    let mut normal = NormalMatrix::new(&alone).map_err(BenchError::from_display)?;
    let (mut whole, mut parts) = (Samples::default(), <[Samples; 4]>::default());
    let mut b = vec![0.0; 3 * mesh.n_verts()];
    for round in 0..BEFORE + repeats {
        let (mut one, mut those) = (Samples::default(), <[Samples; 4]>::default());
        let (x, u) = (method.x().to_vec(), method.u().to_vec());
        let p = method.p().to_vec();
        for (t, term) in alone.terms.iter_mut().enumerate() {
            let (mut p, mut u) = (p[t].clone(), u[t].clone());
            b.fill(0.0);
            those[t].time(|| term.cycle_step(&CYCLE, &x, &mut p, &mut u, &mut b));
        }
        those[3].time(|| normal.solve(&mut b)).map_err(BenchError::from_display)?;
        if !vector::is_finite(&b) {
            return Err(BenchError("a part of an iteration has no finite end".to_string()));
        }
        one.time(|| method.step()).map_err(BenchError::from_display)?;
        if round >= BEFORE {
            whole.append(one);
            parts.iter_mut().zip(those).for_each(|(all, new)| all.append(new));
        }
    }
    Ok((whole, parts))
}
