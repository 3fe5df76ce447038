//! Gradients through [`deform`](super::deform), by the implicit function theorem.

use super::elements::Cells;
use super::{Body, DeformError, DeformInput, Deformation, planar, pool, sheet};
use crate::settings::{DeformSettings, Material, MethodName};
use proxel_model::elements::{SensitivityError, Step};
use proxel_split::{Problem, Status, Tangent, TangentError, vector};
use std::collections::BTreeMap;

/// The derivatives of a function L of the positions X of a [`Deformation`] in what the run was given.
///
/// At X the forces g on the free vertices vanish. With H = dg/dX over them and H w = dL/dX there,
///
/// ```text
/// dL/d(target of a fixed vertex) = dL/dX - (dg/dX)^T w there,    dL/dq = -(dg/dq)^T w of everything else
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Adjoint {
    /// dL/d(target) of each entry of [`DeformInput::fixed`].
    pub fixed: Vec<[f64; 3]>,
    /// dL/d(target) of each entry of [`DeformInput::soft`].
    pub soft: Vec<[f64; 3]>,
    /// dL/d(force) on each vertex, w: whether there is one or not.
    pub forces: Vec<[f64; 3]>,
    /// dL/d(rest position) of each vertex, targets and forces being what they are.
    pub rest: Vec<[f64; 3]>,
    /// dL/d(moduli) of [`DeformSettings::material`].
    pub material: Moduli,
    /// The same of each of [`DeformSettings::materials`].
    pub materials: BTreeMap<i32, Moduli>,
    /// |H^-1 g|: how far X is from the minimum, to first order. Gradients are those at X.
    pub distance: f64,
}

/// Derivatives in the moduli of a material, 0 where no element has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moduli {
    /// In Young's modulus at constant Poisson's ratio; none where the material is not given by it.
    pub young: Option<f64>,
    /// In Poisson's ratio at constant Young's modulus; likewise.
    pub poisson: Option<f64>,
    /// In mu at constant lambda.
    pub mu: f64,
    /// In lambda at constant mu.
    pub lambda: f64,
}

impl Moduli {
    /// From those in mu and lambda, by the chain rule: mu = E / (2 (1 + nu)), lambda = E nu / ((1 + nu) (1 - 2 nu)).
    fn of(material: &Material, mu: f64, lambda: f64) -> Self {
        let Material { young: e, poisson: nu, .. } = *material;
        let by_young = 1.0 / (2.0 * (1.0 + nu));
        let by_poisson = -e / (2.0 * (1.0 + nu) * (1.0 + nu));
        let (young, poisson) = match (material.mu, material.lambda) {
            (Some(_), _) => (None, None),
            (None, Some(_)) => (Some(mu * by_young), Some(mu * by_poisson)),
            (None, None) => {
                let (a, b) = (1.0 + nu, 1.0 - 2.0 * nu);
                let slope = e * (1.0 + 2.0 * nu * nu) / (a * a * b * b);
                (Some(mu * by_young + lambda * nu / (a * b)), Some(mu * by_poisson + lambda * slope))
            }
        };
        Moduli { young, poisson, mu, lambda }
    }
}

/// The derivatives of a function of the positions of `result`, which [`deform`](super::deform) has made of `input` and
/// `settings`. `slope` is dL/dX of each vertex.
///
/// Costs a factor of the true Hessian in f64, two solves and two passes over the elements. The same bits on any number
/// of threads.
///
/// # Errors
/// A run that has not converged; what has no derivative here: hard sets (obstacles, limits of stretches), equalities,
/// surfaces in a lattice, energies of one's own; an X at which the Hessian is not positive definite, such as a saddle,
/// or nearly singular, as that of a body that can turn; an element at which its energy has no second derivative.
pub fn adjoint(
    input: &DeformInput,
    settings: &DeformSettings,
    result: &Deformation,
    slope: &[[f64; 3]],
) -> Result<Adjoint, DeformError> {
    check(input, settings, result, slope)?;
    pool(settings)?.install(|| adjoint_here(input, settings, result, slope))
}

/// Refuses what has no derivative.
fn check(
    input: &DeformInput,
    settings: &DeformSettings,
    result: &Deformation,
    slope: &[[f64; 3]],
) -> Result<(), DeformError> {
    let n = input.rest.n_verts();
    if slope.len() != n || result.positions.len() != n {
        return Err(DeformError(format!("dL/dX has {} rows for {n} vertices; give one for each", slope.len())));
    }
    if let Some(v) = slope.iter().position(|s| s.iter().any(|s| !s.is_finite())) {
        return Err(DeformError(format!("dL/dX of vertex {v} (0-based) is {:?}; give finite numbers", slope[v])));
    }
    if result.status != Status::Converged {
        return Err(DeformError(format!(
            "the run has the status \"{}\" ({}), so that it is at no minimum, whose gradients these would be; let it \
             converge: more iterations (--max-iters), more time, or another method",
            result.status.as_str(),
            result.report.reason
        )));
    }
    let (what, remedy) = match () {
        () if result.carried.is_some() || input.skin.is_some() || input.fill.is_some() => {
            ("a surface that a lattice carries", "give its tetrahedra, or deform it as a sheet (--surface shell)")
        }
        () if input.energy.is_some() => ("an energy of one's own, which has no second derivatives", "use a material"),
        () if !input.obstacles.is_empty() => ("obstacles", "leave them out, or hold vertices by springs"),
        () if settings.strain_limit.is_some() => ("hard limits of stretches", "leave out strain_limit"),
        () if !input.equalities.is_empty() => ("equalities between vertices", "tie vertices by springs"),
        () => return Ok(()),
    };
    Err(DeformError(format!("there are no gradients through {what}; {remedy}")))
}

fn adjoint_here(
    input: &DeformInput,
    settings: &DeformSettings,
    result: &Deformation,
    slope: &[[f64; 3]],
) -> Result<Adjoint, DeformError> {
    // The same problem, at X: a start that is there already.
    let here = DeformInput { start: Some(result.positions.clone()), ..input.clone() };
    let newton = DeformSettings { method: MethodName::Newton, ..settings.clone() };
    let mut body = Body::new(&here, &newton)?;
    let mut problem = body.take_problem();
    let dim = problem.dim;
    let x = body.centred(&result.positions);
    let mut w = vec![0.0; x.len()];
    let mut distance = 0.0;
    let free = problem.n_free * dim;
    if free > 0 {
        let refuse = |e: TangentError| explain(&body, e);
        let mut tangent = Tangent::new(&mut problem, &x, Vec::new(), settings.newton.memory).map_err(refuse)?;
        let b = body.flat(slope);
        w[..free].copy_from_slice(&tangent.solve(&b[..free]).map_err(refuse)?);
        let mut g = vec![0.0; free];
        problem.energy(&x, Some(&mut g));
        distance = vector::norm(&tangent.solve(&g).map_err(refuse)?);
    }
    let mut at_nodes = body.vectors(&answer_of_quadratic(&problem, &x, &w));
    let w = body.vectors(&w);
    let mesh = &input.rest;
    let mut kinds = Cells::all(mesh, body.tets(mesh), settings);
    if settings.planar {
        planar::orient(body.name(), mesh, settings, &mut kinds)?;
    }
    let none = |material: &Material| Moduli::of(material, 0.0, 0.0);
    let mut out = Adjoint {
        distance,
        material: none(&settings.material),
        materials: settings.materials.iter().map(|(region, material)| (*region, none(material))).collect(),
        ..Adjoint::default()
    };
    let mut rest = vec![[0.0; 3]; mesh.n_verts()];
    let flat = |of: &[[f64; 3]], center: [f64; 3]| -> Vec<f64> {
        of.iter().flat_map(|p| (0..dim).map(move |d| p[d] - center[d])).collect()
    };
    let (positions, moved, step) =
        (flat(&mesh.points, body.center()), flat(&result.positions, body.center()), flat(&w, [0.0; 3]));
    for (rank, cells) in kinds.iter().enumerate() {
        for (material, chosen) in cells.by_material(mesh, settings) {
            let corners: Vec<u32> = chosen
                .iter()
                .flat_map(|e| &cells.corners()[e * cells.size()..(e + 1) * cells.size()])
                .copied()
                .collect();
            let density = material.density.unwrap_or(if rank == 0 { settings.density } else { 0.0 });
            let weights =
                (density > 0.0 && settings.weighs()).then(|| weights(&corners, cells.size(), density, settings, &w));
            let lame = material.lame().map_err(|e| DeformError(e.to_string()))?;
            let found = Step {
                shape: cells.shape(settings.planar),
                positions: &positions,
                shapes: None,
                elements: &corners,
                fill: None,
                per_measure: weights.as_deref(),
                energy: &material.energy,
                lame: &lame,
                x: &moved,
                w: &step,
            }
            .sensitivity()
            .map_err(|e| name(body.name(), cells, &chosen, e))?;
            for (to, from, sign) in [(&mut at_nodes, &found.x, 1.0), (&mut rest, &found.rest, -1.0)] {
                for (to, from) in to.iter_mut().zip(from.chunks_exact(dim)) {
                    to.iter_mut().zip(from).for_each(|(to, from)| *to += sign * from);
                }
            }
            let moduli = Moduli::of(material, -found.mu, -found.lambda);
            match settings.materials.iter().find(|(_, m)| std::ptr::eq(*m, material)) {
                Some((region, _)) => out.materials.entry(*region).or_default().add(moduli),
                None => out.material.add(moduli),
            }
        }
    }
    let bent = sheet::rest_sensitivity(settings, &kinds, &positions, &moved, &step);
    rest.as_flattened_mut().iter_mut().zip(&bent).for_each(|(to, from)| *to -= from);
    // A vertex that is named twice is where it was named last.
    let mut last = BTreeMap::new();
    input.fixed.iter().enumerate().for_each(|(i, (v, _))| {
        last.insert(*v, i);
    });
    out.fixed = vec![[0.0; 3]; input.fixed.len()];
    for (v, i) in last {
        let v = v as usize;
        out.fixed[i] = std::array::from_fn(|d| if d < dim { slope[v][d] - at_nodes[v][d] } else { 0.0 });
    }
    out.soft = input.soft.iter().map(|(v, _, k)| w[*v as usize].map(|w| k * w)).collect();
    out.forces = w;
    out.rest = rest;
    Ok(out)
}

impl Moduli {
    fn add(&mut self, other: Moduli) {
        let sum = |a: Option<f64>, b: Option<f64>| b.map(|b| a.unwrap_or(0.0) + b);
        *self = Moduli {
            young: sum(self.young, other.young),
            poisson: sum(self.poisson, other.poisson),
            mu: self.mu + other.mu,
            lambda: self.lambda + other.lambda,
        };
    }
}

/// What the weight of each element gains along w, over its measure, with the sign that it has in E: -density gravity .
/// w, the mean of its corners.
fn weights(corners: &[u32], size: usize, density: f64, settings: &DeformSettings, w: &[[f64; 3]]) -> Vec<f64> {
    let share = density / size as f64;
    let gain = |v: &u32| (0..3).map(|d| settings.gravity[d] * w[*v as usize][d]).sum::<f64>();
    corners.chunks_exact(size).map(|e| -share * e.iter().map(gain).sum::<f64>()).collect()
}

/// The derivative along w of the forces of what is not split, over all nodes: springs at points, bending, pressure.
/// Their energies are polynomials of at most the third degree, so that a central difference is the derivative.
fn answer_of_quadratic(problem: &Problem, x: &[f64], w: &[f64]) -> Vec<f64> {
    let quadratic = &problem.quadratic;
    let mut out = vec![0.0; x.len()];
    let farthest = w.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let is_constant = quadratic.points.is_empty() && quadratic.form.is_empty() && quadratic.potentials.is_empty();
    if is_constant || farthest == 0.0 {
        return out;
    }
    // Of the size of the body: nothing cancels that need not.
    let t = vector::extent(x, problem.dim) / farthest;
    for sign in [1.0, -1.0] {
        let mut near = x.to_vec();
        vector::add_scaled(&mut near, sign * t, w);
        let mut g = vec![0.0; x.len()];
        quadratic.value_and_gradient(&near, problem.dim, Some(&mut g));
        vector::add_scaled(&mut out, sign / (2.0 * t), &g);
    }
    out
}

/// In the user's words.
fn explain(body: &Body, e: TangentError) -> DeformError {
    match e {
        TangentError::System(e) => DeformError(body.explain(&e)),
        TangentError::Indefinite => DeformError(format!(
            "{}: {e}; X has no one answer to small changes there: pin at least three vertices of each part that do not lie \
             on a line, or begin elsewhere, so that the run ends in a minimum",
            body.name()
        )),
        TangentError::Inexact(_) => DeformError(format!(
            "{}: {e}; pin at least three vertices of each part that do not lie on a line, or more where the body is about \
             to buckle",
            body.name()
        )),
    }
}

fn name(name: &str, cells: &Cells, chosen: &[usize], e: SensitivityError) -> DeformError {
    match e {
        SensitivityError::Kink(e) => DeformError(format!(
            "{name}: {} {} (0-based) is where its energy has no second derivative, so that there is no gradient; \
             choose another material, or targets that do not turn it over",
            cells.noun(),
            chosen.get(e).copied().unwrap_or(e)
        )),
        other => DeformError(format!("{name}: {other}")),
    }
}
