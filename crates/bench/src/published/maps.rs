//! Figures published for maps: Tables 2 and 3 of the WRAPD paper.

/// What a method of the paper needs for the early and the late phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phases {
    /// eta and N_c: iterations until the energy is within 1 % of the least, and to a relative error of 1e-6.
    pub iterations: [u32; 2],
    /// tau and t_c, on the ten-core i9-10900K of the paper.
    pub seconds: [f64; 2],
}

/// The columns of [`PublishedMap::phases`], as our methods are called.
pub const PAPER_METHODS: [&str; 6] = ["wrapd", "wrapd+cm", "cm", "slim", "akvf", "bcqn"];

/// A row of Table 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedMap {
    /// Name of the mesh, without the ending of its file.
    pub model: &'static str,
    /// Figure that shows it.
    pub figure: &'static str,
    /// Of each of [`PAPER_METHODS`].
    pub phases: [Phases; 6],
    /// The least energy, as the authors' codes have it.
    pub energy: f64,
}

/// The row of a mesh, where there is one.
pub fn of(model: &str) -> Option<&'static PublishedMap> {
    TABLE_2.iter().find(|row| row.model == model)
}

const fn phases(n: [u32; 12], t: [f64; 12]) -> [Phases; 6] {
    let mut all = [Phases { iterations: [0; 2], seconds: [0.0; 2] }; 6];
    let mut i = 0;
    while i < 6 {
        all[i] = Phases { iterations: [n[2 * i], n[2 * i + 1]], seconds: [t[2 * i], t[2 * i + 1]] };
        i += 1;
    }
    all
}

/// Table 2, the rows whose meshes are known.
pub const TABLE_2: [PublishedMap; 4] = [
    PublishedMap {
        model: "dino",
        figure: "11(d)",
        phases: phases(
            [5, 208, 5, 19, 9, 15, 22, 818, 35, 82, 48, 237],
            [0.08, 1.91, 0.08, 0.37, 0.21, 0.35, 0.48, 16.1, 1.05, 2.68, 2.44, 19.7],
        ),
        energy: 1.021_865_9,
    },
    PublishedMap {
        model: "dog",
        figure: "11(e)",
        phases: phases(
            [8, 77, 4, 17, 11, 20, 15, 2048, 11, 610, 76, 1154],
            [0.2, 1.47, 0.16, 0.72, 0.44, 0.82, 0.52, 72.1, 0.62, 51.1, 6.75, 191.0],
        ),
        energy: 1.039_460_5,
    },
    PublishedMap {
        model: "hilbert",
        figure: "11(g)",
        phases: phases(
            [23, 314, 6, 89, 17, 74, 46, 235_726, 9, 4387, 56, 751],
            [0.17, 3.77, 0.05, 0.9, 0.13, 0.69, 0.33, 1455.0, 0.13, 57.1, 2.48, 21.6],
        ),
        energy: 1.0,
    },
    PublishedMap {
        model: "horse",
        figure: "11(h)",
        phases: phases(
            [6, 60, 3, 21, 12, 31, 12, 897, 9, 36, 36, 229],
            [0.08, 0.66, 0.05, 0.42, 0.21, 0.56, 0.18, 13.6, 0.24, 0.99, 1.58, 14.4],
        ),
        energy: 1.022_320_952_1,
    },
];

/// Table 3, Lucy at seven resolutions: thousands of triangles, then eta and tau of WRAPD, WRAPD+CM and CM.
pub const TABLE_3: [(u32, [(u32, f64); 3]); 7] = [
    (100, [(11, 0.39), (6, 0.26), (13, 0.62)]),
    (206, [(9, 0.68), (5, 0.54), (16, 2.22)]),
    (405, [(9, 1.44), (5, 1.23), (16, 5.45)]),
    (800, [(9, 3.04), (9, 3.01), (18, 14.4)]),
    (1616, [(9, 7.15), (6, 7.88), (25, 57.0)]),
    (3224, [(9, 16.6), (6, 21.2), (23, 117.0)]),
    (6376, [(9, 41.3), (6, 60.5), (29, 445.0)]),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_early_phase_comes_first() {
        for row in &TABLE_2 {
            for p in &row.phases {
                assert!(p.iterations[0] < p.iterations[1] && p.seconds[0] < p.seconds[1], "{}: {p:?}", row.model);
            }
        }
        assert_eq!(of("horse").map(|row| row.phases[1].iterations), Some([3, 21]));
    }
}
