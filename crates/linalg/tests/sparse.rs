//! The sparse factor and solve against dense Cholesky, over shapes, precisions, thread counts and bad input.

use proxel_linalg::simd::Level;
use proxel_linalg::sparse::{
    BlockMatrix, Cholesky, MixedCholesky, MixedScratch, Ordering, Purpose, Scalar, SolveScratch, SparseError,
    SymPattern, Symbolic,
};
use std::sync::Arc;

mod common;
use common::*;

fn factor<T: Scalar>(m: &Matrix, ordering: Ordering) -> Result<Cholesky<T>, SparseError> {
    let symbolic = Arc::new(Symbolic::analyze(&m.pattern, ordering)?);
    let mut factor = Cholesky::new(symbolic);
    factor.refactor(&m.values)?;
    Ok(factor)
}

fn orderings() -> [Ordering; 4] {
    [Ordering::Amf, Ordering::Amd, Ordering::NestedDissection, Ordering::Natural]
}

/// |b - A x| / |b| over all right-hand sides.
fn residual(m: &Matrix, x: &[f64], b: &[f64], nrhs: usize) -> f64 {
    let mut ax = vec![0.0; b.len()];
    m.pattern.multiply(&m.values, x, nrhs, &mut ax).unwrap();
    let unit = b.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| (x / unit) * (x / unit)).sum::<f64>().sqrt();
    norm(&mut b.iter().zip(&ax).map(|(b, a)| b - a)) / norm(&mut b.iter().copied()).max(f64::MIN_POSITIVE)
}

#[test]
fn agrees_with_dense_cholesky() {
    let mut random = Random(7);
    for (name, m) in shapes(&mut random) {
        for ordering in orderings() {
            let factor = factor::<f64>(&m, ordering.clone()).unwrap();
            for nrhs in [1, 2, 3, 4, 5, 9] {
                let b: Vec<f64> = (0..m.n() * nrhs).map(|_| random.unit()).collect();
                let mut x = b.clone();
                factor.solve_in_place(&mut x, nrhs, &mut SolveScratch::new()).unwrap();
                let expected = m.dense_solve(&b, nrhs);
                let scale = expected.iter().fold(1e-300_f64, |s, v| s.max(v.abs()));
                for (x, e) in x.iter().zip(&expected) {
                    assert!((x - e).abs() <= 1e-11 * scale, "{name} {ordering:?} nrhs {nrhs}: {x} is not {e}");
                }
            }
        }
    }
}

#[test]
fn residual_is_small_on_grids() {
    let m = grid(17, 13, 11, &mut Random(3));
    let mut scratch = SolveScratch::new();
    for ordering in orderings() {
        for (factor64, factor32) in
            [(factor::<f64>(&m, ordering.clone()).unwrap(), factor::<f32>(&m, ordering.clone()).unwrap())]
        {
            for nrhs in 1..=4 {
                let b: Vec<f64> = (0..m.n() * nrhs).map(|k| ((k * 37) % 101) as f64 - 50.0).collect();
                let mut x = b.clone();
                factor64.solve_in_place(&mut x, nrhs, &mut scratch).unwrap();
                let r = residual(&m, &x, &b, nrhs);
                assert!(r < 1e-13, "{ordering:?}: {r:e}");
                let mut x = b.clone();
                factor32.solve_in_place(&mut x, nrhs, &mut scratch).unwrap();
                let r = residual(&m, &x, &b, nrhs);
                assert!(r < 1e-4, "{ordering:?} in f32: {r:e}");
            }
        }
    }
}

#[test]
fn refactors_with_new_numbers() {
    let mut random = Random(11);
    let mut m = grid(9, 8, 7, &mut random);
    let symbolic = Arc::new(Symbolic::analyze(&m.pattern, Ordering::Auto).unwrap());
    let mut factor = Cholesky::<f64>::new(symbolic);
    for round in 0..3 {
        m.redraw(&mut random);
        factor.refactor(&m.values).unwrap();
        if round == 1 {
            factor.release_workspace();
        }
        let b: Vec<f64> = (0..m.n() * 3).map(|_| random.unit()).collect();
        let mut x = b.clone();
        factor.solve_in_place(&mut x, 3, &mut SolveScratch::new()).unwrap();
        assert!(residual(&m, &x, &b, 3) < 1e-13);
    }
}

#[test]
fn a_factor_for_few_solves_finds_the_same_solutions() {
    for (m, ordering) in [
        (grid(17, 13, 11, &mut Random(6)), Ordering::Auto),
        (grid(40, 40, 1, &mut Random(7)), Ordering::NestedDissection),
        (grid(3, 2, 2, &mut Random(8)), Ordering::Natural),
    ] {
        let symbolic = Arc::new(Symbolic::analyze(&m.pattern, ordering).unwrap());
        for nrhs in 1..=4 {
            let b: Vec<f64> = (0..m.n() * nrhs).map(|k| (k as f64 * 0.41).cos()).collect();
            let mut scratch = SolveScratch::new();
            let mut many = Cholesky::<f64>::new(symbolic.clone());
            let mut few = Cholesky::<f64>::for_purpose(symbolic.clone(), Purpose::FewSolves);
            let mut rough = Cholesky::<f32>::for_purpose(symbolic.clone(), Purpose::FewSolves);
            let mut want = b.clone();
            many.refactor(&m.values).unwrap();
            many.solve_in_place(&mut want, nrhs, &mut scratch).unwrap();
            let size = want.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            let mut got = b.clone();
            few.refactor(&m.values).unwrap();
            few.solve_in_place(&mut got, nrhs, &mut scratch).unwrap();
            let far = |got: &[f64]| got.iter().zip(&want).fold(0.0f64, |most, (a, b)| most.max((a - b).abs())) / size;
            assert!(far(&got) < 1e-12, "{nrhs} right-hand sides: {}", far(&got));
            let mut got = b.clone();
            rough.refactor(&m.values).unwrap();
            rough.solve_in_place(&mut got, nrhs, &mut scratch).unwrap();
            assert!(far(&got) < 1e-3 && far(&got) > 0.0, "{nrhs} right-hand sides, f32: {}", far(&got));
        }
    }
}

#[test]
fn same_bits_on_any_number_of_threads() {
    let m = grid(31, 29, 23, &mut Random(5));
    let b: Vec<f64> = (0..m.n() * 3).map(|k| (k as f64 * 0.37).sin()).collect();
    let solve = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut bits = Vec::new();
            for nrhs in [1, 3] {
                let mut x = b[..m.n() * nrhs].to_vec();
                let f = factor::<f64>(&m, Ordering::Auto).unwrap();
                f.solve_in_place(&mut x, nrhs, &mut SolveScratch::new()).unwrap();
                bits.extend(x.iter().map(|v| v.to_bits()));
                let mut x = b[..m.n() * nrhs].to_vec();
                let f = factor::<f32>(&m, Ordering::Auto).unwrap();
                f.solve_in_place(&mut x, nrhs, &mut SolveScratch::new()).unwrap();
                bits.extend(x.iter().map(|v| v.to_bits()));
                let mut x = b[..m.n() * nrhs].to_vec();
                let symbolic = Arc::new(Symbolic::analyze(&m.pattern, Ordering::Auto).unwrap());
                let mut f = Cholesky::<f32>::for_purpose(symbolic, Purpose::FewSolves);
                f.refactor(&m.values).unwrap();
                f.solve_in_place(&mut x, nrhs, &mut SolveScratch::new()).unwrap();
                bits.extend(x.iter().map(|v| v.to_bits()));
            }
            bits
        })
    };
    let one = solve(1);
    assert_eq!(one.len(), m.n() * 12);
    for threads in [2, 3] {
        assert!(one == solve(threads), "{threads} threads differ from one");
    }
}

#[test]
fn names_the_column_that_is_not_positive() {
    let mut random = Random(1);
    for ordering in orderings() {
        for bad in [0usize, 100, 719] {
            let mut m = grid(10, 9, 8, &mut random);
            let slot = m.pattern.diagonal_slot(bad);
            m.values[slot] = -1.0;
            match factor::<f64>(&m, ordering.clone()).map(|_| ()) {
                // With one negative diagonal entry every other Schur complement pivot before it stays positive.
                Err(SparseError::NotPositiveDefinite { column, pivot }) => {
                    assert!(column == bad && pivot <= -1.0, "{ordering:?}: column {column}, pivot {pivot}, not {bad}");
                }
                other => panic!("{ordering:?}: {other:?}"),
            }
        }
    }
    // Natural order of a dense matrix: the first leading minor that is not positive.
    let m = Matrix::from_dense(3, &[1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(
        factor::<f64>(&m, Ordering::Natural).map(|_| ()),
        Err(SparseError::NotPositiveDefinite { column: 1, pivot: -3.0 })
    );
}

#[test]
fn refuses_singular_and_non_finite() {
    // A graph Laplacian without a pin: its last pivot is rounding error.
    let n = 50;
    let edges: Vec<[u32; 2]> = (1..n as u32).map(|i| [i - 1, i]).collect();
    let pattern = SymPattern::from_edges(n, &edges).unwrap();
    let mut values = vec![0.0; pattern.nnz()];
    for (k, e) in edges.iter().enumerate() {
        let w = 1.0 + 0.1 * k as f64;
        for v in e {
            values[pattern.diagonal_slot(*v as usize)] += w;
        }
        values[pattern.slot(e[0] as usize, e[1] as usize).unwrap()] -= w;
    }
    let m = Matrix { pattern, values };
    for ordering in orderings() {
        let result = factor::<f64>(&m, ordering).map(|_| ());
        assert!(matches!(result, Err(SparseError::NotPositiveDefinite { .. })), "{result:?}");
    }
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut m = grid(5, 5, 5, &mut Random(2));
        let slot = m.pattern.slot(7, 6).unwrap();
        m.values[slot] = value;
        let result = factor::<f64>(&m, Ordering::Auto).map(|_| ());
        match result {
            Err(SparseError::NonFinite { row, column, .. }) => assert_eq!((row.max(column), row.min(column)), (7, 6)),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn wrong_lengths_and_missing_numbers_are_errors() {
    let m = grid(4, 4, 4, &mut Random(2));
    let mut f = factor::<f64>(&m, Ordering::Auto).unwrap();
    let mut scratch = SolveScratch::new();
    let short = f.solve_in_place(&mut [0.0; 63], 1, &mut scratch);
    assert_eq!(short, Err(SparseError::Length { what: "rhs", found: 63, expected: 64 }));
    assert_eq!(
        f.refactor(&m.values[1..]),
        Err(SparseError::Length { what: "values", found: m.values.len() - 1, expected: m.values.len() })
    );
    // A failed refactorisation leaves no numbers to solve with.
    assert_eq!(f.solve_in_place(&mut [0.0; 64], 1, &mut scratch), Err(SparseError::NotFactored));
    assert_eq!(f.solve_in_place(&mut [], 0, &mut scratch), Err(SparseError::NotFactored));
    let given = |perm: Vec<u32>| Symbolic::analyze(&m.pattern, Ordering::Given(perm)).map(|_| ());
    assert_eq!(given(vec![0; 63]), Err(SparseError::Length { what: "the given order", found: 63, expected: 64 }));
    assert_eq!(given(vec![0; 64]), Err(SparseError::NotPermutation { position: 1, value: 0 }));
    assert_eq!(given((1..65).collect()), Err(SparseError::NotPermutation { position: 63, value: 64 }));
    given((0..64).rev().collect()).unwrap();
}

#[test]
fn scales_from_tiny_to_huge() {
    // D A D with D from 1e-75 to 1e75: the diagonal runs from 1e-150 to 1e150.
    let mut m = grid(6, 6, 6, &mut Random(9));
    let n = m.n();
    let d = |i: usize| 10f64.powf(150.0 * i as f64 / (n - 1) as f64 - 75.0);
    for j in 0..n {
        for s in m.pattern.col_ptr()[j]..m.pattern.col_ptr()[j + 1] {
            m.values[s] *= d(m.pattern.row_idx()[s] as usize) * d(j);
        }
    }
    // x = D^-1 y with smooth y; b = A x is computed with little cancellation, so compare x itself.
    let x: Vec<f64> = (0..n).map(|i| (1.0 + (i % 7) as f64) / d(i)).collect();
    let mut b = vec![0.0; n];
    m.pattern.multiply(&m.values, &x, 1, &mut b).unwrap();
    let mut got = b.clone();
    factor::<f64>(&m, Ordering::Auto).unwrap().solve_in_place(&mut got, 1, &mut SolveScratch::new()).unwrap();
    for (g, x) in got.iter().zip(&x) {
        assert!((g / x - 1.0).abs() < 1e-11, "{g:e} is not {x:e}");
    }
    let f32_factor = factor::<f32>(&m, Ordering::Auto).unwrap();
    let mut got = b.clone();
    f32_factor.solve_in_place(&mut got, 1, &mut SolveScratch::new()).unwrap();
    for (g, x) in got.iter().zip(&x) {
        assert!((g / x - 1.0).abs() < 1e-3, "f32: {g:e} is not {x:e}");
    }
}

#[test]
fn analysis_counts_what_dense_elimination_fills() {
    for (name, m) in shapes(&mut Random(21)) {
        for ordering in orderings() {
            let symbolic = Symbolic::analyze(&m.pattern, ordering).unwrap();
            let filled = m.filled_entries(symbolic.permutation().forward());
            assert!(symbolic.factor_nnz() >= filled, "{name}: {} < {filled}", symbolic.factor_nnz());
            // Relaxed supernodes add zeros, most of them in small supernodes.
            assert!(symbolic.factor_nnz() <= 2 * filled + 8 * m.n(), "{name}: {} > {filled}", symbolic.factor_nnz());
        }
    }
}

#[test]
fn renumbering_by_the_order_keeps_the_fill() {
    let m = grid(12, 11, 10, &mut Random(4));
    let symbolic = Symbolic::analyze(&m.pattern, Ordering::Auto).unwrap();
    let inverse = symbolic.permutation().inverse();
    let edges: Vec<[u32; 2]> =
        (0..m.n()).flat_map(|j| m.pattern.column(j).iter().map(move |&i| [inverse[i as usize], inverse[j]])).collect();
    let renumbered = SymPattern::from_edges(m.n(), &edges).unwrap();
    let again = Symbolic::analyze(&renumbered, Ordering::Natural).unwrap();
    let (a, b) = (symbolic.factor_nnz() as f64, again.factor_nnz() as f64);
    assert!((a / b - 1.0).abs() < 0.02, "{a} became {b}");
}

#[test]
fn single_precision_is_corrected_to_double() {
    let mut random = Random(13);
    let m = grid(14, 13, 12, &mut random);
    let symbolic = Arc::new(Symbolic::analyze(&m.pattern, Ordering::Auto).unwrap());
    let mut mixed = MixedCholesky::new(&m.pattern, symbolic).unwrap();
    let mut scratch = MixedScratch::new();
    assert_eq!(mixed.solve_in_place(&mut vec![0.0; m.n()], 1, 1e-13, &mut scratch), Err(SparseError::NotFactored));
    mixed.refactor(&m.values).unwrap();
    for nrhs in [1, 3, 5] {
        // Right-hand sides of very different size, one of them zero.
        let b: Vec<f64> =
            (0..m.n() * nrhs).map(|k| random.unit() * [1.0, 1e-170, 1e180, 0.0, 1e-3][k % nrhs]).collect();
        let mut x = b.clone();
        let end = mixed.solve_in_place(&mut x, nrhs, 1e-13, &mut scratch).unwrap();
        assert!(end.residual <= 1e-13 && end.steps <= 8, "{end:?}");
        for c in 0..nrhs {
            let column = |v: &[f64]| v.iter().skip(c).step_by(nrhs).copied().collect::<Vec<f64>>();
            let r = residual(&m, &column(&x), &column(&b), 1);
            assert!(r <= 1.1e-13, "column {c} of {nrhs}: {r:e}");
        }
    }
    let impossible = mixed.solve_in_place(&mut vec![1.0; m.n()], 1, 1e-30, &mut scratch);
    assert!(
        matches!(impossible, Err(SparseError::NotConverged { residual, .. }) if residual < 1e-13),
        "{impossible:?}"
    );
}

#[test]
fn analysis_predicts_bytes() {
    let m = grid(9, 9, 9, &mut Random(8));
    let symbolic = Arc::new(Symbolic::analyze(&m.pattern, Ordering::Auto).unwrap());
    assert_eq!(symbolic.factor_bytes::<f64>(), Cholesky::<f64>::new(symbolic.clone()).bytes());
    assert_eq!(symbolic.factor_bytes::<f32>(), Cholesky::<f32>::new(symbolic.clone()).bytes());
    assert!(symbolic.factor_bytes::<f64>().0 >= 8 * symbolic.factor_nnz());
}

#[test]
fn patterns_are_checked() {
    let csc = |n, ptr: &[usize], rows: &[u32]| SymPattern::from_lower_csc(n, ptr.to_vec(), rows.to_vec()).map(|_| ());
    assert_eq!(csc(2, &[0, 2, 3], &[0, 1, 1]), Ok(()));
    assert_eq!(csc(0, &[0], &[]), Ok(()));
    assert_eq!(csc(2, &[0, 2], &[0, 1]), Err(SparseError::Length { what: "col_ptr", found: 2, expected: 3 }));
    assert_eq!(csc(2, &[1, 2, 3], &[0, 1, 1]), Err(SparseError::ColumnPointers { column: 0 }));
    assert_eq!(csc(2, &[0, 2, 1], &[0, 1, 1]), Err(SparseError::ColumnPointers { column: 1 }));
    assert_eq!(csc(2, &[0, 9, 3], &[0, 1, 1]), Err(SparseError::ColumnPointers { column: 0 }));
    assert_eq!(csc(2, &[0, 2, 3], &[0, 1, 1, 1]), Err(SparseError::Length { what: "row_idx", found: 4, expected: 3 }));
    assert_eq!(csc(2, &[0, 1, 1], &[0]), Err(SparseError::MissingDiagonal { column: 1 }));
    assert_eq!(csc(2, &[0, 1, 2], &[1, 1]), Err(SparseError::MissingDiagonal { column: 0 }));
    assert_eq!(csc(2, &[0, 1, 2], &[0, 0]), Err(SparseError::Row { column: 1, row: 0 }));
    assert_eq!(csc(2, &[0, 3, 4], &[0, 1, 1, 1]), Err(SparseError::Row { column: 0, row: 1 }));
    assert_eq!(csc(2, &[0, 2, 3], &[0, 2, 1]), Err(SparseError::Row { column: 0, row: 2 }));
    assert_eq!(
        SymPattern::from_cliques(3, &[[0u32, 1, 2], [1, 2, 3]]).map(|_| ()),
        Err(SparseError::Vertex { element: 1, vertex: 3, n: 3 })
    );
}

#[test]
fn slots_name_the_entries() {
    let m = grid(5, 4, 3, &mut Random(6));
    for j in 0..m.n() {
        for slot in m.pattern.col_ptr()[j]..m.pattern.col_ptr()[j + 1] {
            let i = m.pattern.row_idx()[slot] as usize;
            assert_eq!((m.pattern.slot(i, j), m.pattern.slot(j, i)), (Some(slot), Some(slot)));
        }
    }
    assert_eq!((m.pattern.slot(0, 59), m.pattern.slot(60, 60), m.pattern.slot(0, 7)), (None, None, None));
}

#[test]
fn every_instruction_set_agrees() {
    fn check<T: Scalar>(limit: f64) {
        let mut random = Random(17);
        for m in [grid(13, 12, 11, &mut random), shapes(&mut random).pop().unwrap().1] {
            let symbolic = Arc::new(Symbolic::analyze(&m.pattern, Ordering::Auto).unwrap());
            for level in Level::available() {
                let mut factor = Cholesky::<T>::with_level(symbolic.clone(), level);
                factor.refactor(&m.values).unwrap();
                for nrhs in 1..=4 {
                    let b: Vec<f64> = (0..m.n() * nrhs).map(|_| random.unit()).collect();
                    let mut x = b.clone();
                    factor.solve_in_place(&mut x, nrhs, &mut SolveScratch::new()).unwrap();
                    let r = residual(&m, &x, &b, nrhs);
                    assert!(r < limit, "{level:?}: {r:e}");
                }
            }
        }
    }
    check::<f64>(1e-13);
    check::<f32>(1e-4);
}

#[test]
fn coordinates_of_a_vertex_are_ordered_together() {
    // Three unknowns a vertex: the same order as for one unknown a vertex, so L has about nine times the entries.
    let m = grid(9, 8, 7, &mut Random(2));
    let edges: Vec<[u32; 6]> = (0..m.n() as u32)
        .flat_map(|j| {
            m.pattern
                .column(j as usize)
                .iter()
                .map(move |&i| [0, 1, 2, 3, 4, 5].map(|k| 3 * [i, j][k / 3] + k as u32 % 3))
        })
        .collect();
    let tripled = SymPattern::from_cliques(3 * m.n(), &edges).unwrap();
    for ordering in [Ordering::Auto, Ordering::Amf, Ordering::Amd, Ordering::NestedDissection] {
        let one = Symbolic::analyze(&m.pattern, ordering.clone()).unwrap().factor_nnz() as f64;
        let three = Symbolic::analyze(&tripled, ordering.clone()).unwrap().factor_nnz() as f64;
        assert!(three < 9.0 * one, "{ordering:?}: {one} became {three}");
    }
}

/// A positive definite matrix of 3 x 3 blocks over a pattern, and the same as a matrix of numbers.
fn blocks_and_numbers(pattern: &SymPattern) -> (BlockMatrix, SymPattern, Vec<f64>) {
    let n = pattern.n();
    let mut matrix = BlockMatrix::new(pattern, 3).expect("small");
    let mut state = 17u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    for j in 0..n {
        for slot in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
            let block = &mut matrix.values_mut()[slot * 9..slot * 9 + 9];
            for r in 0..3 {
                for c in 0..3 {
                    block[r * 3 + c] = random();
                }
            }
            if pattern.row_idx()[slot] as usize == j {
                for r in 0..3 {
                    for c in 0..r {
                        block[c * 3 + r] = block[r * 3 + c];
                    }
                    block[r * 3 + r] += 40.0;
                }
            }
        }
    }
    let cliques: Vec<Vec<u32>> = (0..n)
        .flat_map(|j| pattern.column(j).iter().map(move |i| (*i, j as u32)))
        .map(|(i, j)| (0..3).flat_map(|r| [3 * i + r, 3 * j + r]).collect())
        .collect();
    let numbers = SymPattern::from_cliques(3 * n, &cliques).expect("in range");
    let mut values = vec![0.0; numbers.nnz()];
    for j in 0..n {
        for slot in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
            let i = pattern.row_idx()[slot] as usize;
            for r in 0..3 {
                for c in 0..3 {
                    let at = numbers.slot(3 * i + r, 3 * j + c).expect("a block is whole");
                    values[at] = matrix.values()[slot * 9 + r * 3 + c];
                }
            }
        }
    }
    (matrix, numbers, values)
}

/// A grid of 9 x 8 vertices, neighbours coupled.
fn grid_pattern() -> SymPattern {
    let edges: Vec<[u32; 2]> = (0..72u32)
        .flat_map(|v| [(v % 9 < 8).then_some([v, v + 1]), (v + 9 < 72).then_some([v, v + 9])])
        .flatten()
        .collect();
    SymPattern::from_edges(72, &edges).expect("a grid")
}

#[test]
fn blocks_multiply_and_factor_as_their_numbers_do() {
    let pattern = grid_pattern();
    let (mut matrix, numbers, values) = blocks_and_numbers(&pattern);
    let x: Vec<f64> = (0..216).map(|i| ((i * i) as f64 * 0.37).sin()).collect();
    let (mut y, mut want) = (vec![0.0; 216], vec![0.0; 216]);
    matrix.multiply(&x, &mut y).expect("lengths fit");
    numbers.multiply(&values, &x, 1, &mut want).expect("lengths fit");
    assert!(y.iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-12));
    for ordering in [Ordering::Auto, Ordering::Natural, Ordering::NestedDissection] {
        let vertices = Symbolic::analyze(&pattern, ordering).expect("a grid");
        let symbolic = Arc::new(vertices.expanded(3).expect("small"));
        assert_eq!((symbolic.n(), symbolic.nnz()), (216, pattern.nnz() * 9));
        assert!(vertices.expanded(0).is_err() && symbolic.expanded(3).is_err());
        let mut factor = Cholesky::<f64>::new(symbolic.clone());
        factor.refactor(matrix.values()).expect("positive definite");
        let mut solved = y.clone();
        factor.solve_in_place(&mut solved, 1, &mut SolveScratch::new()).expect("factored");
        assert!(solved.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-12));
        let mut single = Cholesky::<f32>::new(symbolic);
        single.refactor_if_definite(matrix.values()).expect("positive definite");
        solved.copy_from_slice(&y);
        single.solve_in_place(&mut solved, 1, &mut SolveScratch::new()).expect("factored");
        assert!(solved.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-4));
        // A negative eigenvalue is found, and a NaN is named.
        let diagonal = pattern.diagonal_slot(30) * 9;
        for (at, value) in [(diagonal + 4, -3.0), (diagonal + 8, f64::NAN)] {
            let kept = std::mem::replace(&mut matrix.values_mut()[at], value);
            let error = single.refactor_if_definite(matrix.values()).expect_err("no such factor");
            match value.is_nan() {
                true => assert!(matches!(error, SparseError::NonFinite { row: 92, column: 92, .. }), "{error}"),
                false => assert!(matches!(error, SparseError::NotPositiveDefinite { .. }), "{error}"),
            }
            matrix.values_mut()[at] = kept;
        }
    }
}
