//! Quasi-Newton methods on the energy itself, preconditioned by the normal matrix.
//!
//! | method | pairs | direction and step |
//! |---|---|---|
//! | L-BFGS (Liu, Bouaziz and Kavan 2017) | (s, y) | as they are |
//! | BCQN (Zhu, Bridson and Kaufman 2018) | y blended with A s, [`Blend`] | filtered and limited, [`InversionGuard`] |

use crate::{
    Backtracking, Blend, EnergyReport, Evaluation, InversionGuard, Landing, Method, NormalMatrix, Pairs, Problem, Ray,
    StepReport, SystemError, vector,
};

/// Part of the longest step without an inverted element at which a line search starts at the latest, as in the authors' code.
const FEASIBLE: f64 = 0.5;

/// How a [`QuasiNewton`] is put together.
#[derive(Clone, Debug, PartialEq)]
pub struct QuasiNewtonSettings {
    /// Its name, as users give it.
    pub name: String,
    /// Pairs kept.
    pub window: usize,
    /// The line search; the first step tried is 1, or less where the guard says so.
    pub line_search: Backtracking,
    /// Whether pairs are blended with the Sobolev metric, [`Blend`].
    pub blended: bool,
    /// Whether elements are kept from inverting once none is, [`InversionGuard`].
    pub guarded: bool,
}

/// L-BFGS whose first Hessian is A, W(5a). One iteration is one step; its inner steps are the evaluations of the energy
/// and its gradient.
///
/// The energy never rises but for rounding. Where the guard is on, a point without inverted elements is never left for
/// one that has some.
pub struct QuasiNewton {
    settings: QuasiNewtonSettings,
    problem: Problem,
    normal: NormalMatrix,
    pairs: Pairs,
    blend: Option<Blend>,
    guard: Option<InversionGuard>,
    x: Vec<f64>,
    trial: Vec<f64>,
    g: Vec<f64>, // gradient at x
    g_trial: Vec<f64>,
    q: Vec<f64>, // H g; the direction is -q
    energy: EnergyReport,
    iteration: usize,
}

impl QuasiNewton {
    /// At the start of the problem, with an empty history.
    ///
    /// # Errors
    /// A problem that does not fit together (as [`SystemError::Factor`]) or a singular system.
    pub fn new(mut problem: Problem, settings: QuasiNewtonSettings) -> Result<Self, SystemError> {
        problem.check().map_err(|e| SystemError::Factor(e.to_string()))?;
        let normal = NormalMatrix::new(&problem)?;
        let blend = if settings.blended { Some(Blend::new(&problem, &normal)?) } else { None };
        let guard = settings.guarded.then(|| InversionGuard::new(&problem));
        let x = problem.x0.clone();
        let n = problem.n_free * problem.dim;
        let mut g = vec![0.0; n];
        let energy = problem.energy(&x, Some(&mut g));
        Ok(QuasiNewton {
            pairs: Pairs::new(settings.window),
            settings,
            problem,
            normal,
            blend,
            guard,
            trial: x.clone(),
            x,
            g,
            g_trial: vec![0.0; n],
            q: vec![0.0; n],
            energy,
            iteration: 0,
        })
    }

    /// q <- H g and its slope g . q; from A alone where the history has lost its way.
    fn direction(&mut self) -> Result<f64, SystemError> {
        let mut slope = self.pairs.direction(&self.g, &mut self.q, &mut self.normal)?;
        let descends = slope > 0.0 && slope.is_finite();
        if !descends && !self.pairs.is_empty() {
            self.pairs.clear();
            slope = self.pairs.direction(&self.g, &mut self.q, &mut self.normal)?;
        }
        let Some(guard) = self.guard.as_mut().filter(|guard| guard.is_armed()) else { return Ok(slope) };
        self.g_trial.copy_from_slice(&self.q);
        if guard.filter(&self.x, &mut self.q) {
            let filtered = vector::dot(&self.g, &self.q);
            if filtered > 0.0 && filtered.is_finite() {
                return Ok(filtered);
            }
            self.q.copy_from_slice(&self.g_trial); // the filter has turned it uphill
        }
        Ok(slope)
    }

    /// The first step along -q that descends.
    fn search(&mut self, slope: f64) -> Option<Landing> {
        if !(slope > 0.0 && slope.is_finite()) {
            return None;
        }
        let armed = self.guard.as_ref().filter(|guard| guard.is_armed());
        let first = armed.map_or(1.0, |guard| (FEASIBLE * guard.limit(&self.x, &self.q, 1.0 / FEASIBLE)).min(1.0));
        let ray = Ray { x: &self.x, q: &self.q, value: self.energy.value, slope };
        let free = armed.is_none();
        self.settings.line_search.search(&mut self.problem, ray, first, free, &mut self.trial, &mut self.g_trial)
    }

    /// Takes the step that was found.
    fn take(&mut self, landing: &Landing) -> Result<(), SystemError> {
        let (g, g_trial, q, normal) = (&self.g, &self.g_trial, &self.q, &self.normal);
        let mut blended = Ok(0.0);
        let blend = &mut self.blend;
        self.pairs.remember(g.len(), |s, y| {
            vector::subtract(y, g_trial, g);
            for (s, q) in s.iter_mut().zip(q) {
                *s = -landing.t * q;
            }
            if let Some(blend) = blend {
                blended = blend.apply(normal, s, y);
            }
        });
        blended?;
        std::mem::swap(&mut self.x, &mut self.trial);
        std::mem::swap(&mut self.g, &mut self.g_trial);
        self.energy = landing.energy;
        Ok(())
    }

    fn stalled(&self) -> SystemError {
        let norm = vector::norm(&self.g);
        SystemError::Stalled(if !self.energy.value.is_finite() || !norm.is_finite() {
            format!(
                "the energy or its gradient is not finite where {} starts; start without inverted elements, or use a splitting method",
                self.settings.name
            )
        } else {
            format!(
                "{}: no step along the descent direction lowers the energy, though the gradient is {norm:e}: what is left is rounding, or the energy has a kink here",
                self.settings.name
            )
        })
    }
}

impl Method for QuasiNewton {
    fn name(&self) -> &str {
        &self.settings.name
    }

    fn step(&mut self) -> Result<StepReport, SystemError> {
        if let Some(guard) = self.guard.as_mut().filter(|_| self.energy.inverted == 0) {
            guard.arm(&self.x);
        }
        if !self.energy.value.is_finite() || !vector::norm(&self.g).is_finite() {
            return Err(self.stalled());
        }
        let slope = self.direction()?;
        let mut landing = self.search(slope);
        if landing.is_none() && !self.pairs.is_empty() {
            self.pairs.clear();
            let slope = self.direction()?;
            landing = self.search(slope);
        }
        let Some(landing) = landing else { return Err(self.stalled()) };
        self.take(&landing)?;
        self.iteration += 1;
        Ok(StepReport {
            iteration: self.iteration,
            inner: landing.trials,
            accepted: true,
            energy_z: f64::INFINITY,
            ..StepReport::default()
        })
    }

    fn x(&self) -> &[f64] {
        &self.x
    }

    fn problem(&self) -> &Problem {
        &self.problem
    }

    fn energy(&mut self) -> EnergyReport {
        self.energy
    }

    fn evaluate(&mut self) -> Evaluation {
        Evaluation { energy: self.energy, gradient_norm: vector::norm(&self.g) }
    }

    fn is_evaluated(&self) -> bool {
        true
    }

    fn begin(&mut self, x: &[f64], _: bool, change: &mut dyn FnMut(&mut Problem)) -> Result<(), SystemError> {
        if x.len() != self.x.len() {
            let (got, want) = (x.len(), self.x.len());
            return Err(SystemError::Stalled(format!("a start of {got} numbers for a problem of {want}")));
        }
        change(&mut self.problem);
        self.problem.check().map_err(|e| SystemError::Factor(e.to_string()))?;
        self.x.copy_from_slice(x);
        self.trial.copy_from_slice(x);
        self.pairs.clear();
        self.guard = self.settings.guarded.then(|| InversionGuard::new(&self.problem));
        self.energy = self.problem.energy(&self.x, Some(&mut self.g));
        self.iteration = 0;
        Ok(())
    }

    fn refactor(&mut self) -> Result<(), SystemError> {
        self.pairs.clear();
        self.normal.refactor(&self.problem)?;
        if let Some(blend) = &mut self.blend {
            *blend = Blend::new(&self.problem, &self.normal)?;
        }
        Ok(())
    }

    fn factor_bytes(&self) -> u64 {
        self.normal.factor_bytes()
    }

    fn into_problem(self: Box<Self>) -> Problem {
        self.problem
    }
}
