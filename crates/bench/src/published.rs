//! Figures published for, or measured with, other programs, to stand beside ours.

pub mod maps;

/// Iterations and seconds to a normalised position error of 1e-4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// N_c
    pub iterations: u32,
    /// t_c, on the ten-core i9-10900K of the paper.
    pub seconds: f64,
}

/// A row of Table 1 of the WRAPD paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperRow {
    /// Figure that shows the model.
    pub figure: &'static str,
    /// WRAPD, ADMM-PD, BCQN, L-BFGS, AADR.
    pub costs: [Cost; 5],
}

/// The names of the columns of [`PaperRow::costs`].
pub const PAPER_METHODS: [&str; 5] = ["WRAPD", "ADMM-PD", "BCQN", "L-BFGS", "AADR"];

/// What the authors' code does on a model, WRAPD with its own settings (MKL PARDISO, f64). Milliseconds are those of one
/// thread of a loaded machine: good for ratios only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CodeRow {
    /// Iterations to position errors of 1e-1, 1e-2, 1e-3, 1e-4.
    pub iterations: [u32; 4],
    /// Milliseconds an iteration in the local and in the global step.
    pub local_global_ms: [f64; 2],
    /// Mean L-BFGS steps a global step.
    pub inner: f64,
    /// Iterations that reweighted.
    pub reweighted: &'static str,
}

/// Everything known of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Name of its folder.
    pub model: &'static str,
    /// The paper's row.
    pub paper: PaperRow,
    /// The authors' code.
    pub code: CodeRow,
}

/// The figures of `model`, where there are any.
pub fn of(model: &str) -> Option<&'static Published> {
    PUBLISHED.iter().find(|p| p.model == model)
}

const fn paper(figure: &'static str, n: [u32; 5], t: [f64; 5]) -> PaperRow {
    let mut costs = [Cost { iterations: 0, seconds: 0.0 }; 5];
    let mut i = 0;
    while i < 5 {
        costs[i] = Cost { iterations: n[i], seconds: t[i] };
        i += 1;
    }
    PaperRow { figure, costs }
}

const fn code(iterations: [u32; 4], local_global_ms: [f64; 2], inner: f64, reweighted: &'static str) -> CodeRow {
    CodeRow { iterations, local_global_ms, inner, reweighted }
}

/// All models, in the order of the paper's figures.
pub const PUBLISHED: [Published; 9] = [
    Published {
        model: "stretch",
        paper: paper("6(a)", [305, 217, 498, 123, 83], [2.3, 1.1, 30.2, 7.1, 1.4]),
        code: code([32, 89, 188, 307], [61.0, 24.0], 1.01, "50 51 61 62"),
    },
    Published {
        model: "shear",
        paper: paper("6(b)", [158, 548, 166, 50, 94], [1.3, 2.6, 10.7, 2.0, 1.6]),
        code: code([23, 54, 104, 159], [64.0, 43.0], 1.75, "50 51 57"),
    },
    Published {
        model: "untwist",
        paper: paper("6(c)", [134, 9757, 282, 249, 249], [1.3, 42.2, 34.2, 4.9, 5.0]),
        code: code([41, 65, 100, 134], [56.0, 83.0], 2.97, "50"),
    },
    Published {
        model: "dancer",
        paper: paper("7(a)", [163, 60883, 29578, 417, 590], [4.1, 559.0, 12301.0, 16.3, 23.3]),
        code: code([17, 50, 122, 163], [159.0, 149.0], 1.99, "50"),
    },
    Published {
        model: "dino",
        paper: paper("7(c)", [429, 122_831, 6981, 336, 860], [11.4, 1270.0, 3107.0, 15.4, 34.3]),
        code: code([93, 159, 289, 430], [176.0, 151.0], 1.87, "50 53 56 73"),
    },
    Published {
        model: "homer",
        paper: paper("7(d)", [91, 3900, 1010, 175, 228], [2.3, 47.4, 446.0, 8.7, 10.2]),
        code: code([20, 34, 49, 92], [165.0, 173.0], 1.96, "50"),
    },
    Published {
        model: "cat",
        paper: paper("7(e)", [224, 168_722, 10735, 650, 1255], [10.5, 3078.0, 8459.0, 77.9, 86.7]),
        code: code([109, 145, 195, 257], [305.0, 264.0], 1.8, "50 51 53 57 64 86"),
    },
    Published {
        model: "dinoskel",
        paper: paper("7(f)", [239, 123_683, 6770, 471, 1196], [9.7, 2107.0, 5372.0, 52.2, 84.9]),
        code: code([91, 129, 173, 232], [298.0, 262.0], 1.76, "50 51 53 57 65"),
    },
    Published {
        model: "centaur",
        paper: paper("1", [239, 196_604, 16167, 904, 1786], [12.5, 3693.0, 13520.0, 120.0, 138.0]),
        code: code([85, 131, 194, 251], [318.0, 317.0], 2.0, "50 51 55"),
    },
];

/// Wall seconds of whole solves to 1e-4 with the authors' code, two threads, on a quiet two-core machine; reading and
/// first factorisations included.
pub const CODE_WALL_SECONDS: [(&str, f64); 2] = [("homer", 28.1), ("centaur", 129.0)];

/// Seconds of numpy's `linalg.svd` of 102,389 random 3x3 matrices on the same machine.
pub const NUMPY_SVD_SECONDS: f64 = 0.542;
