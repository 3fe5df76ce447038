//! Ends of the range, lanes side by side, and batches.

use crate::cases::{Random, matrix};
use crate::{Lanes, Of, at_level, check_conventions, decompose, errors, everywhere};
use proxel_linalg::simd::Level;
use proxel_linalg::svd::{BatchSizeError, Par, Svd, eig3_sym_batch, svd3_batch};

fn bits<const R: usize, const C: usize>(d: &Svd<f64, R, C>) -> Vec<u64> {
    d.u.iter().flatten().chain(&d.s).chain(d.v.iter().flatten()).map(|x| x.to_bits()).collect()
}

fn poisoned<const R: usize, const C: usize>()
where
    Of: Lanes<R, C>,
{
    for level in everywhere() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for at in 0..R * C {
                let mut a: [[f64; C]; R] = matrix(&mut Random(at as u64));
                a[at / C][at % C] = bad;
                let d = decompose(level, &[a])[0];
                let all = d.u.iter().flatten().chain(&d.s).chain(d.v.iter().flatten());
                assert!(all.into_iter().all(|x| x.is_nan()), "{level:?}: {a:?} gives {d:?}");
            }
        }
    }
}

#[test]
fn not_a_number_and_infinity_give_not_a_number() {
    poisoned::<3, 3>();
    poisoned::<3, 2>();
    poisoned::<2, 2>();
    poisoned::<3, 1>();
    poisoned::<2, 1>();
}

fn extremes<const R: usize, const C: usize>()
where
    Of: Lanes<R, C>,
{
    let mut random = Random(3);
    for level in everywhere() {
        for size in [f64::MAX / 4.0, 1e300, 1e-300, f64::MIN_POSITIVE, 5e-324, 3e-318] {
            for _ in 0..1000 {
                let a: [[f64; C]; R] = random.matrix().map(|row: [f64; C]| row.map(|x| x * size));
                let d = decompose(level, &[a])[0];
                check_conventions(&a, &d);
                let [residual, u, v] = errors(&a, &d);
                // A subnormal stretch is rounded to its last bit.
                let limit = 1e-14 + 5e-324 / d.s[0].max(5e-324);
                assert!(residual <= limit && u < 1e-14 && v < 1e-14, "{level:?}: {residual:e} of {a:?}: {d:?}");
            }
        }
        let d = decompose(level, &[[[0.0; C]; R]])[0];
        check_conventions(&[[0.0; C]; R], &d);
        assert!(d.s == [0.0; C] && errors(&[[0.0; C]; R], &d).iter().all(|e| *e < 1e-15), "{level:?}: {d:?}");
    }
}

#[test]
fn largest_smallest_and_zero_matrices() {
    extremes::<3, 3>();
    extremes::<3, 2>();
    extremes::<2, 2>();
    extremes::<3, 1>();
    extremes::<2, 1>();
}

fn lanes_are_independent<const R: usize, const C: usize>()
where
    Of: Lanes<R, C>,
{
    for level in Level::available() {
        let mut random = Random(11);
        for _ in 0..2000 {
            let a: [[f64; C]; R] = matrix(&mut random);
            let alone = bits(&at_level(level, &[a])[0]);
            let lane = random.below(8) as usize;
            let mut block: [[[f64; C]; R]; 8] = std::array::from_fn(|_| matrix(&mut random));
            block[(lane + 1) % 8] = [[f64::NAN; C]; R];
            block[(lane + 2) % 8] = [[f64::INFINITY; C]; R];
            block[(lane + 3) % 8] = [[0.0; C]; R];
            block[lane] = a;
            assert_eq!(bits(&at_level(level, &block)[lane]), alone, "{level:?}, lane {lane}: {a:?}");
        }
    }
}

#[test]
fn a_lane_does_not_depend_on_its_neighbours() {
    lanes_are_independent::<3, 3>();
    lanes_are_independent::<3, 2>();
    lanes_are_independent::<2, 2>();
    lanes_are_independent::<3, 1>();
    lanes_are_independent::<2, 1>();
}

#[test]
fn batches_are_the_same_bits_on_any_number_of_threads() {
    let mut random = Random(5);
    let blocks = 700;
    let matrices: Vec<[[f64; 3]; 3]> = (0..8 * blocks).map(|_| matrix(&mut random)).collect();
    let mut a = vec![0.0; 72 * blocks];
    for (m, matrix) in matrices.iter().enumerate() {
        for k in 0..9 {
            a[m / 8 * 72 + k * 8 + m % 8] = matrix[k / 3][k % 3];
        }
    }
    let batch = |par| {
        let (mut u, mut s, mut v) = (vec![0.0; 72 * blocks], vec![0.0; 24 * blocks], vec![0.0; 72 * blocks]);
        svd3_batch(par, &a, &mut u, &mut s, &mut v).unwrap();
        (u, s, v)
    };
    let one = batch(Par::Seq);
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| batch(Par::Rayon)), one, "{threads} threads");
    }
    for (m, d) in at_level(Level::best(), &matrices).iter().enumerate() {
        let at = |values: &[f64], components: usize, k: usize| values[(m / 8 * components + k) * 8 + m % 8];
        for k in 0..9 {
            assert_eq!(at(&one.0, 9, k), d.u[k / 3][k % 3]);
            assert_eq!(at(&one.2, 9, k), d.v[k / 3][k % 3]);
        }
        assert_eq!([0, 1, 2].map(|k| at(&one.1, 3, k)), d.s);
    }
}

#[test]
fn batches_of_wrong_size_are_refused() {
    let mut out = vec![7.0; 72];
    let error = eig3_sym_batch(Par::Seq, &[1.0; 47], &mut out, &mut [0.0; 24]).unwrap_err();
    assert_eq!(error, BatchSizeError { slice: "a", length: 47, expected: 48 });
    let error = eig3_sym_batch(Par::Rayon, &[1.0; 48], &mut out, &mut [0.0; 16]).unwrap_err();
    assert_eq!(error, BatchSizeError { slice: "lambda", length: 16, expected: 24 });
    assert!(error.to_string().contains("`lambda` has 16 numbers") && out == vec![7.0; 72]);
    for par in [Par::Seq, Par::Rayon] {
        assert_eq!(svd3_batch(par, &[], &mut [], &mut [], &mut []), Ok(()));
    }
}
