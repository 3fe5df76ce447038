//! What was measured of steps of the flag and the horse with the authors' implementation.

/// A run of it: forward residuals, normalised as A(27), after some iterations.
pub(super) struct Measured {
    pub problem: &'static str,
    pub method: &'static str,
    /// (iteration, residual)
    pub points: &'static [(usize, f64)],
    /// Proposals refused in the whole run, where that is known.
    pub rejected: Option<usize>,
    /// The largest strain violation at the end, where that is known.
    pub violation: Option<f64>,
}

const fn run(problem: &'static str, method: &'static str, points: &'static [(usize, f64)]) -> Measured {
    Measured { problem, method, points, rejected: None, violation: None }
}

const fn flag(
    problem: &'static str,
    method: &'static str,
    points: &'static [(usize, f64)],
    violation: f64,
) -> Measured {
    Measured { violation: Some(violation), ..run(problem, method, points) }
}

const fn horse(
    problem: &'static str,
    method: &'static str,
    points: &'static [(usize, f64)],
    rejected: usize,
) -> Measured {
    Measured { rejected: Some(rejected), ..run(problem, method, points) }
}

const ADMM: &str = "admm";
const AA: &str = "aa-admm-4 m=6";

/// States of the flag were advanced by 60 iterations a frame; of the long runs of the horse by 13.
const ALL: [Measured; 14] = [
    flag("flag", ADMM, &[(302, 1e-2)], 0.18),
    flag("flag", AA, &[(69, 1e-2)], 0.041),
    flag("flag frame 15", ADMM, &[(300, 1.2e-2)], 0.20),
    flag("flag frame 15", AA, &[(86, 1e-2)], 0.051),
    flag("flag frame 30", ADMM, &[(300, 6.3e-2)], 0.65),
    flag("flag frame 30", AA, &[(300, 3.9e-2)], 0.28),
    run("pit", ADMM, &[(1, 68.8), (200, 21.5)]),
    horse("pit", AA, &[(1, 68.8), (200, 20.1)], 51),
    horse("pit frame 34", AA, &[(1, 205.0), (1500, 0.267)], 376),
    run("cylinders", ADMM, &[(1, 47.0), (200, 7.3)]),
    horse("cylinders", AA, &[(1, 47.0), (200, 8.9)], 38),
    horse("cylinders frame 22", AA, &[(1, 71.5), (1500, 0.132)], 429),
    run("cylinders frame 30", ADMM, &[(1, 17.6), (200, 0.93)]),
    horse("cylinders frame 30", AA, &[(1, 17.6), (200, 0.0505)], 23),
];

/// Of a problem.
pub(super) fn of(problem: &str) -> Vec<&'static Measured> {
    ALL.iter().filter(|m| m.problem == problem).collect()
}
