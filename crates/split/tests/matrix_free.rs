//! A global step that has the operator and f itself, and asks for the pull of p alone, is the direct one.

mod common;

use common::{FREE, SMOOTH, admm, problem};
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Direct, GlobalReport, GlobalStep, Method, NormalMatrix,
    Objective, Order, Precision, Problem, Pull, SystemError,
};

/// x = A^-1 (D^T W^2 p - grad f(0)), with a matrix of its own in place of that of the iteration.
#[derive(Default)]
struct Own {
    matrix: Option<NormalMatrix>,
    at_origin: Vec<f64>, // grad f(0)
}

impl GlobalStep for Own {
    fn run(
        &mut self,
        objective: &mut Objective<'_>,
        normal: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        assert_eq!(normal.matrix().0.n(), 0, "nobody has asked for this matrix");
        grad.iter_mut().zip(&self.at_origin).for_each(|(g, f)| *g = -(*g + f));
        self.matrix.as_mut().expect("weighed before the first step").solve(grad)?;
        x[..grad.len()].copy_from_slice(grad);
        let f = objective.problem.quadratic.value_and_gradient(x, 1, None);
        Ok(GlobalReport { inner: 1, quadratic: Some(f), ..GlobalReport::default() })
    }

    fn precision(&self) -> Option<Precision> {
        None
    }

    fn pull(&self) -> Pull {
        Pull::AtOrigin
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn reset(&mut self) {}

    fn weigh(&mut self, problem: &Problem) -> Result<(), SystemError> {
        self.matrix = Some(NormalMatrix::new(problem)?);
        self.at_origin = vec![0.0; FREE];
        problem.quadratic.value_and_gradient(&[0.0; FREE + 1], 1, Some(&mut self.at_origin));
        Ok(())
    }
}

fn own() -> Admm {
    let global = Box::new(Own::default());
    let settings = AdmmSettings { name: "test".to_string(), global, reweighting: None, renewed_at: None };
    Admm::new(problem(SMOOTH, true), settings).expect("a chain with inertia")
}

/// The same points, energies and merits but for rounding.
fn assert_alike(mut a: Box<dyn Method>, mut b: Box<dyn Method>, name: &str) {
    for step in 0..12 {
        let (of_a, of_b) = (a.step().expect("a step"), b.step().expect("a step"));
        for (a, b) in a.x().iter().zip(b.x()) {
            assert!((a - b).abs() <= 1e-9, "{name}, step {step}: {a} and {b}");
        }
        let (a, b) = (a.energy().value, b.energy().value);
        assert!((a - b).abs() <= 1e-9 * b.abs(), "{name}, step {step}: energies {a} and {b}");
        assert_eq!(of_a.trial.rejected, of_b.trial.rejected, "{name}, step {step}");
    }
}

#[test]
fn it_takes_the_steps_of_the_direct_one() {
    for (order, relaxation) in [(Order::Xzu, 1.0), (Order::Xzu, 1.6), (Order::Zxu, 1.0)] {
        let cycle = Cycle { order, relaxation };
        let of = |admm: Admm| Box::new(admm.with_cycle(cycle).expect("a cycle"));
        assert_alike(of(own()), of(admm(problem(SMOOTH, true))), &format!("{order:?}, {relaxation}"));
    }
}

#[test]
fn accelerations_see_an_exact_step() {
    assert!(own().is_exact());
    for algorithm in [Algorithm::One, Algorithm::Two, Algorithm::Three, Algorithm::Four, Algorithm::DouglasRachford] {
        let of = |admm| Acceleration::anderson(algorithm, 3).of(admm).expect("a method");
        assert_alike(of(own()), of(admm(problem(SMOOTH, true))), &format!("{algorithm:?}"));
    }
}

#[test]
fn a_direct_step_without_its_matrix_is_an_error() {
    let (mut of, mut x) = (problem(SMOOTH, true), vec![0.0; FREE + 1]);
    let mut objective = Objective { problem: &mut of, p: &[], value: 0.0, local_change: 0.0, fed: None };
    let mut none = NormalMatrix::none().expect("nothing to factor");
    assert!(Direct.run(&mut objective, &mut none, &mut x, &mut vec![1.0; FREE]).is_err());
}
