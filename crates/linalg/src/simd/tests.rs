use super::*;

/// Applies every operation to lanes and gives the results lane by lane.
struct Operations<'a>(&'a [f64; 8], &'a [f64; 8]);

impl Kernel for Operations<'_> {
    type Output = Vec<[f64; 8]>;
    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<[f64; 8]> {
        let (a, b) = (F8::<I>::load(self.0), F8::<I>::load(self.1));
        let pick = |m| F8::<I>::select(m, F8::one(), F8::zero());
        let (e, m) = a.abs().exponent_and_mantissa();
        [
            a + b,
            a - b,
            a * b,
            a / b,
            -a,
            a.abs().sqrt(),
            a.min(b),
            a.max(b),
            a.copysign(b),
            a * 2.0,
            e,
            m,
            e.exp2_int(),
            pick(a.lt(b)),
            pick(a.le(b)),
            pick(!(a.lt(b) | b.lt(a))),
            pick(a.lt(b) & b.lt(F8::one())),
            F8::of(a.to_array()),
            F8::gather(self.1, &[7, 0, 6, 1, 5, 2, 4, 3], 1, 0),
        ]
        .map(F8::to_array)
        .to_vec()
    }
}

#[test]
fn every_level_agrees_with_scalar_arithmetic() {
    let a = [1.5, -2.25, 1e-300, -7e200, 3.0, 0.125, -1.0, 1023.75];
    let b = [2.5, -2.25, -1e300, 7e-200, -3.5, 8.0, 1.0, -0.001];
    let own_b = b;
    let scalar: Vec<Vec<f64>> = (0..8)
        .map(|l| {
            let (a, b) = (a[l], b[l]);
            let (e, m) = Real::exponent_and_mantissa(a.abs());
            let pick = |m: bool| f64::from(u8::from(m));
            vec![
                a + b,
                a - b,
                a * b,
                a / b,
                -a,
                a.abs().sqrt(),
                a.min(b),
                a.max(b),
                a.copysign(b),
                a * 2.0,
                e,
                m,
                e.exp2(),
                pick(a < b),
                pick(a <= b),
                pick(a == b),
                pick(a < b && b < 1.0),
                a,
                own_b[[7, 0, 6, 1, 5, 2, 4, 3][l]],
            ]
        })
        .collect();
    for level in Level::available() {
        let lanes = dispatch_at(level, Operations(&a, &b));
        for (k, row) in lanes.iter().enumerate() {
            for l in 0..8 {
                assert_eq!(row[l].to_bits(), scalar[l][k].to_bits(), "{level:?}, operation {k}, lane {l}");
            }
        }
    }
}

struct Pairs<'a>(&'a [f64; 16]);

impl Kernel for Pairs<'_> {
    type Output = ([[f64; 8]; 2], [f64; 16]);
    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let [first, second] = F8::<I>::pairs(self.0);
        let mut again = [0.0; 16];
        F8::put_pairs([first, second], &mut again);
        ([first.to_array(), second.to_array()], again)
    }
}

#[test]
fn pairs_are_parted_and_joined() {
    let all: [f64; 16] = std::array::from_fn(|i| i as f64);
    for level in Level::available() {
        let (parted, again) = dispatch_at(level, Pairs(&all));
        assert_eq!(parted, [0, 1].map(|d| std::array::from_fn(|l| (2 * l + d) as f64)), "{level:?}");
        assert_eq!(again, all, "{level:?}");
    }
}

struct Ln<'a>(&'a [f64; 8]);

impl Kernel for Ln<'_> {
    type Output = [f64; 8];
    #[inline(always)]
    fn run<I: Isa>(self) -> [f64; 8] {
        F8::<I>::load(self.0).ln().to_array()
    }
}

#[test]
fn ln_is_within_an_ulp_and_right_at_the_ends() {
    let mut seed = 1u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    for level in Level::available() {
        for round in 0..20_000 {
            let x: [f64; 8] = std::array::from_fn(|_| match round % 3 {
                0 => 0.5 + random(),
                1 => (random() * 1400.0 - 700.0).exp(),
                _ => 5e-324 + random() * 1e-310,
            });
            let y = dispatch_at(level, Ln(&x));
            for l in 0..8 {
                let want = x[l].ln();
                assert!(
                    (y[l] - want).abs() <= want.abs() * 2.3e-16 + 1e-320,
                    "{level:?}: ln {:e} = {:e}, not {want:e}",
                    x[l],
                    y[l]
                );
            }
        }
        let ends =
            dispatch_at(level, Ln(&[0.0, -1.0, f64::INFINITY, f64::NAN, 1.0, -0.0, f64::NEG_INFINITY, f64::MAX]));
        assert_eq!(ends[0], f64::NEG_INFINITY);
        assert!(ends[1].is_nan() && ends[3].is_nan() && ends[6].is_nan());
        assert_eq!(ends[2], f64::INFINITY);
        assert_eq!(ends[4], 0.0);
        assert_eq!(ends[5], f64::NEG_INFINITY);
        assert_eq!(ends[7], f64::MAX.ln());
    }
}

struct Sums<'a>(&'a [f64; 8]);

impl Kernel for Sums<'_> {
    type Output = (f64, f64, f64, bool, bool, u32);
    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let a = F8::<I>::load(self.0);
        let m = a.lt(F8::splat(3.5));
        (a.sum(), a.max_lane(), a.min_lane(), m.any(), m.all(), m.count())
    }
}

#[test]
fn reductions_and_masks() {
    for level in Level::available() {
        let r = dispatch_at(level, Sums(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]));
        assert_eq!(r, (36.0, 8.0, 1.0, true, false, 3));
    }
}

struct Reciprocals<'a>(&'a [f64; 8]);

impl Kernel for Reciprocals<'_> {
    type Output = ([f64; 8], [f64; 8]);
    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let a = F8::<I>::load(self.0);
        (a.fast_recip().to_array(), a.abs().rsqrt().to_array())
    }
}

#[test]
fn reciprocals_are_within_two_units_in_the_last_place() {
    let mut seed = 5u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    for level in Level::available() {
        for round in 0..100_000 {
            let a: [f64; 8] = std::array::from_fn(|l| {
                let magnitude = if round % 2 == 0 { 0.5 + 2.0 * random() } else { (random() * 1380.0 - 690.0).exp() };
                if l % 2 == 0 { magnitude } else { -magnitude }
            });
            let (recip, rsqrt) = dispatch_at(level, Reciprocals(&a));
            for l in 0..8 {
                let want = [1.0 / a[l], 1.0 / a[l].abs().sqrt()];
                for (got, want) in [recip[l], rsqrt[l]].into_iter().zip(want) {
                    let ulps = (got.to_bits() as i64 - want.to_bits() as i64).abs();
                    assert!(ulps <= 2, "{level:?}, {:e}: {got:e}, not {want:e}", a[l]);
                }
            }
        }
        let (recip, rsqrt) = dispatch_at(level, Reciprocals(&[f64::NAN; 8]));
        assert!(recip.iter().chain(&rsqrt).all(|v| v.is_nan()), "{level:?}");
    }
}

struct Gather<'a>(&'a [f64], [u32; LANES], usize, usize);

impl Kernel for Gather<'_> {
    type Output = [f64; LANES];
    fn run<I: Isa>(self) -> Self::Output {
        F8::<I>::gather(self.0, &self.1, self.2, self.3).to_array()
    }
}

#[test]
fn gathers_stay_inside() {
    let from: Vec<f64> = (0..25).map(f64::from).collect();
    let index = [7, 0, 6, 1, 5, 2, 4, 3];
    for level in Level::available() {
        assert_eq!(dispatch_at(level, Gather(&from, index, 3, 1)), index.map(|i| f64::from(3 * i + 1)));
        for (index, stride, offset) in
            [([0, 1, 2, 3, 4, 5, 6, 8], 3, 1), ([0; 8], 1, 25), ([u32::MAX; 8], usize::MAX, 1)]
        {
            let outside = std::panic::catch_unwind(|| dispatch_at(level, Gather(&from, index, stride, offset)));
            assert!(outside.is_err(), "{level:?} {index:?}");
        }
    }
}
