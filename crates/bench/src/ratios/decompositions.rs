//! The signed decomposition of 3x3 matrices against nalgebra's.

use super::{Row, Samples, Threshold};
use crate::BenchError;
use nalgebra::Matrix3;
use proxel::linalg::simd::LANES;
use proxel::linalg::svd::{Par, svd3_batch};
use std::hint::black_box;

/// Matrices of a batch: their factors stay in the second-level cache, so that arithmetic is measured and not memory.
const COUNT: usize = 2048;

pub(super) fn rows(repeats: usize) -> Result<Vec<Row>, BenchError> {
    // A linear congruential generator (Knuth's MMIX constants): entries uniform in [-1, 1).
    let mut seed = 1u64;
    let mut a = vec![0.0; 9 * COUNT];
    for v in &mut a {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *v = (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
    }
    let matrices: Vec<Matrix3<f64>> =
        (0..COUNT).map(|e| Matrix3::from_fn(|r, c| a[(e / LANES * 9 + 3 * r + c) * LANES + e % LANES])).collect();
    let (mut u, mut s, mut v) = (vec![0.0; 9 * COUNT], vec![0.0; 3 * COUNT], vec![0.0; 9 * COUNT]);
    let (mut ours, mut theirs) = (Samples::default(), Samples::default());
    for _ in 0..5 * repeats {
        ours.time(|| svd3_batch(Par::Seq, &a, &mut u, &mut s, &mut v)).map_err(BenchError::from_display)?;
        black_box((&mut u, &mut s, &mut v));
        theirs.time(|| {
            for m in &matrices {
                black_box(m.svd(true, true));
            }
        });
    }
    let each = |samples: &Samples| {
        format!("{:.0}; {:.0} ns", samples.least() * 1e9 / COUNT as f64, samples.median() * 1e9 / COUNT as f64)
    };
    Ok(vec![Row {
        quantity: format!("nalgebra's 3x3 SVD: {}", each(&theirs)),
        against: "signed 3x3 SVD, one core".to_string(),
        figures: each(&ours),
        ratio: Some(theirs.least() / ours.least()),
        of_medians: Some(theirs.median() / ours.median()),
        threshold: Some(Threshold::AtLeast(6.0)),
    }])
}
