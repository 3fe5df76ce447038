//! Iterations measured with the authors' implementation, and with additions to it where they compare with methods that it
//! does not have.

use super::course::Residual;

type Row = (&'static str, &'static str, [Option<usize>; 5]);

const fn row(problem: &'static str, method: &'static str, i: [usize; 5]) -> Row {
    // 0 stands for a level that was not reached.
    let mut to = [None; 5];
    let mut k = 0;
    while k < 5 {
        to[k] = if i[k] == 0 { None } else { Some(i[k]) };
        k += 1;
    }
    (problem, method, to)
}

/// To 1e-2, .., 1e-6 of the forward residual.
const FORWARD: [Row; 13] = [
    row("soft-rubber", "admm", [24, 45, 66, 88, 110]),
    row("soft-rubber", "aa-admm-3 m=1", [16, 24, 31, 38, 46]),
    row("soft-rubber", "aa-admm-3 m=3", [14, 21, 26, 33, 40]),
    row("soft-rubber", "aa-admm-3 m=6", [13, 19, 24, 31, 37]),
    row("soft-rubber", "aa-admm-3 m=10", [13, 18, 23, 28, 35]),
    row("soft-rubber", "aa-admm-1 m=6", [14, 19, 24, 30, 37]),
    row("soft-rubber frame 12", "admm", [23, 34, 49, 68, 87]),
    row("soft-rubber frame 12", "aa-admm-3 m=6", [13, 18, 23, 29, 34]),
    row("rubber", "admm", [735, 0, 0, 0, 0]),
    row("rubber", "aa-admm-3 m=3", [109, 174, 253, 367, 0]),
    row("rubber", "aa-admm-3 m=6", [79, 143, 199, 262, 0]),
    row("rubber", "aa-admm-3 m=10", [73, 135, 195, 256, 381]),
    row("rubber", "aa-admm-1 m=6", [99, 184, 309, 0, 0]),
];

/// Of the combined residual.
const COMBINED: [Row; 6] = [
    row("soft-rubber", "admm", [24, 44, 65, 87, 110]),
    row("soft-rubber", "over-relaxation 1.5", [18, 32, 46, 60, 75]),
    row("soft-rubber", "over-relaxation 1.6", [17, 30, 43, 56, 70]),
    row("soft-rubber", "over-relaxation 1.7", [17, 28, 41, 53, 67]),
    row("soft-rubber", "over-relaxation 1.8", [18, 28, 39, 50, 64]),
    row("soft-rubber", "fast-admm", [91, 99, 143, 151, 181]),
];

/// To the first five levels, if it was measured.
pub fn of(problem: &str, method: &str, residual: Residual) -> Option<&'static [Option<usize>; 5]> {
    let rows: &[Row] = match residual {
        Residual::Forward => &FORWARD,
        Residual::Combined => &COMBINED,
        Residual::Position => return None,
    };
    rows.iter().find(|(p, m, _)| *p == problem && *m == method).map(|(_, _, to)| to)
}
