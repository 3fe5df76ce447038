//! The problem of a chart, and the method that solves it.

use super::UnwrapError;
use super::chart::ChartInput;
use super::flat::Flat;
use super::order::Order;
use super::start::Start;
use crate::settings::{UnwrapMethod, UnwrapSettings};
use proxel_model::elements::{Batch, BatchShape, BatchWeights, ElementError, Elements, Flattened, Polar, Rest, batch};
use proxel_model::energy::{Energy, Lame, RelaxedSymmetricDirichlet, SymmetricDirichlet};
use proxel_split::{
    Admm, AdmmSettings, Auto, Dial, Direct, GlobalStep, Lbfgs, Method, Newton, Parts, Problem, Quadratic, QuasiNewton,
    Relax, SystemError, Term,
};
use std::sync::Arc;

/// Weights, moduli: symmetric Dirichlet with the stiffness 8 at rest, s^2 + s^-2 - 2 for each stretch, is that of mu = 4.
pub(super) const MODULUS: f64 = 4.0;

/// The objective as users see it: the normalised symmetric Dirichlet energy; another energy as it is.
pub(super) fn shown(settings: &UnwrapSettings, value: f64) -> f64 {
    if is_symmetric_dirichlet(settings) { 1.0 + value / MODULUS } else { value }
}

/// The normalised symmetric Dirichlet energy of the local variable, from sum g(z); infinite where g is another energy.
pub(super) fn local_energy(settings: &UnwrapSettings, value: f64) -> f64 {
    if is_symmetric_dirichlet(settings) { shown(settings, value) } else { f64::INFINITY }
}

fn is_symmetric_dirichlet(settings: &UnwrapSettings) -> bool {
    settings.energy == <SymmetricDirichlet as Energy<2>>::NAME
}

/// The problem of a chart.
pub(super) fn problem(
    chart: &Flat<'_>,
    order: &Order,
    start: &Start,
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
) -> Result<Problem, UnwrapError> {
    let (term, barrier) = term(chart, order, chart.points.len(), input, settings)?;
    Ok(Problem {
        dim: 2,
        n_free: order.n_free,
        x0: order.solver(&start.uv),
        terms: vec![term],
        quadratic: Quadratic::default(),
        barrier,
    })
}

/// The triangles of the chart as elements, and whether their energy is infinite at flips.
pub(super) fn term(
    chart: &Flat<'_>,
    order: &Order,
    n_nodes: usize,
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
) -> Result<(Box<dyn Term>, bool), UnwrapError> {
    let lame = Lame::new(MODULUS, 0.0).map_err(|e| UnwrapError(e.to_string()))?;
    let scale = settings.admm.weight_scale;
    batch(&Batch {
        shape: BatchShape::PlanarTriangles,
        positions: &[],
        flattened: Some(Flattened { shapes: &chart.shapes, centers: &centers(chart), n_nodes }),
        elements: &order.elements(chart),
        fill: chart.counted(input.weights.as_deref()).as_deref(),
        energy: &settings.energy,
        lame: &lame,
        limits: None,
        rotation_aware: settings.method.is_rotation_aware(),
        singular_values: settings.admm.singular_values,
        weights: &|stiffness| BatchWeights { base: scale * stiffness.largest, softening: 1.0 },
    })
    .map_err(|e| UnwrapError(e.to_string()))
}

/// The middles of the triangles in space.
fn centers(chart: &Flat<'_>) -> Vec<[f64; 3]> {
    let center = |t: &[u32; 3]| [0, 1, 2].map(|d| t.map(|v| chart.points[v as usize][d] / 3.0).iter().sum());
    chart.triangles.iter().map(center).collect()
}

/// What [`Untangle`](proxel_split::Untangle) minimises: the same triangles with an energy that is finite where they are
/// turned over.
pub(super) struct Relaxed {
    shapes: Arc<[[[f64; 2]; 2]]>,
    centers: Vec<[f64; 3]>,
    elements: Vec<u32>,
    weights: Option<Vec<f64>>,
    x0: Vec<f64>,
    n_free: usize,
}

impl Relaxed {
    /// None where the energy has no relaxed form, or needs none.
    pub fn new(chart: &Flat<'_>, order: &Order, input: &ChartInput<'_>, settings: &UnwrapSettings) -> Option<Self> {
        is_symmetric_dirichlet(settings).then(|| Relaxed {
            shapes: chart.shapes.clone(),
            centers: centers(chart),
            elements: order.elements(chart),
            weights: chart.counted(input.weights.as_deref()),
            x0: vec![0.0; 2 * chart.points.len()],
            n_free: order.n_free,
        })
    }
}

impl Relax for Relaxed {
    fn relaxed(&self) -> Result<(Problem, Dial), SystemError> {
        let refuse = |e: ElementError| SystemError::Factor(e.to_string());
        let n = self.x0.len() / 2;
        let mut rest = Rest::<2, 2>::of_shapes(&self.shapes, &self.centers, &self.elements, n).map_err(refuse)?;
        if let Some(weights) = &self.weights {
            rest = rest.filled(|t| weights[t]).map_err(refuse)?;
        }
        let dial = Dial::new(1.0);
        let energy = RelaxedSymmetricDirichlet { scale: 0.5 * MODULUS, epsilon: dial.clone() };
        let problem = Problem {
            dim: 2,
            n_free: self.n_free,
            x0: self.x0.clone(),
            terms: vec![Box::new(Elements::<2, 2, Polar>::new(&rest, energy, 2.0 * MODULUS))],
            quadratic: Quadratic::default(),
            barrier: false,
        };
        Ok((problem, dial))
    }
}

/// Puts the method together: parts, no special cases.
pub(super) fn method(
    problem: Problem,
    relaxed: impl FnOnce() -> Option<Relaxed>,
    is_near: bool,
    settings: &UnwrapSettings,
) -> Result<Box<dyn Method>, SystemError> {
    use UnwrapMethod::{Akvf, Auto as AutoName, Bcqn, Cm, Newton as NewtonName, ProjectedNewton, Slim, WrapdCm};
    let name = settings.method;
    Ok(match name {
        Cm | Slim | Akvf | ProjectedNewton | NewtonName => Box::new(Newton::new(problem, settings.newton())?),
        Bcqn => Box::new(QuasiNewton::new(problem, settings.bcqn.to_method(name.as_str(), true))?),
        _ => {
            let global: Box<dyn GlobalStep> = match name.is_rotation_aware() {
                true => Box::new(Lbfgs::new(settings.admm.lbfgs())),
                false => Box::new(Direct),
            };
            let admm = Admm::new(
                problem,
                AdmmSettings {
                    name: name.as_str().to_string(),
                    global,
                    reweighting: name.is_reweighted().then(|| settings.admm.reweighting()),
                    renewed_at: settings.admm.renewed_at,
                },
            )?;
            match name {
                AutoName | WrapdCm => {
                    let text = name.as_str().to_string();
                    let auto = if is_near {
                        let (problem, normal, x, admm) = admm.into_parts();
                        Auto::resume(text, Parts { problem, normal, x, admm, hessian: None }, settings.auto(), 0)?
                    } else {
                        Auto::new(text, admm, settings.auto())
                    };
                    Box::new(match relaxed() {
                        Some(relaxed) => auto.with_relaxation(Box::new(relaxed)),
                        None => auto,
                    })
                }
                _ => Box::new(admm),
            }
        }
    })
}
