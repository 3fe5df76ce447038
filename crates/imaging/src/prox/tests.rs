//! Data terms against minimisation by brute force.

use super::{Huber, Observed, Pointwise, Poisson, Squares};
use crate::Grid;

const F: [f64; 6] = [0.3, 0.0, 1.7, 0.02, 0.5, 0.8];
const LAMBDA: [f64; 6] = [2.0, 5.0, 0.4, 30.0, 0.0, 1.0];
const V: [f64; 6] = [0.9, -0.6, 1.6, -2.0, -0.7, 0.75];

/// Name, function and the least value of its numbers that count.
type Case = (&'static str, Box<dyn Pointwise>, f64);

/// Of these data, each number a pixel.
fn all(f: &[f64], lambda: &[f64]) -> [Case; 4] {
    let of = |values: &[f64]| Observed::new(Grid::new(f.len(), 1), values.to_vec());
    let huber = |delta| Huber { observed: of(f), lambda: of(lambda), most: 30.0, delta };
    let any = f64::NEG_INFINITY;
    [
        ("squares", Box::new(Squares { observed: of(f), lambda: of(lambda), most: 30.0 }), any),
        ("huber", Box::new(huber(0.1)), any),
        ("huber, wide", Box::new(huber(9.0)), any),
        ("poisson", Box::new(Poisson { observed: of(f), lambda: of(lambda), most: 30.0 }), 0.0),
    ]
}

/// The least point of a convex function of one number, by thirds.
fn least(low: f64, high: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (mut a, mut b) = (low, high);
    for _ in 0..300 {
        let (l, r) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
        if of(l) <= of(r) { b = r } else { a = l }
    }
    0.5 * (a + b)
}

#[test]
fn proxes_are_the_least_points_that_brute_force_finds() {
    for (case, (name, of, low)) in all(&F, &LAMBDA).into_iter().enumerate() {
        for weight2 in [0.3, 4.0, 250.0] {
            let mut z = V;
            let value = of.prox(0..V.len(), &mut z, weight2);
            assert!((value - of.value(0..V.len(), &z)).abs() < 1e-12 * (1.0 + value), "{name}: {value}");
            for (k, v) in V.into_iter().enumerate() {
                // Nothing is asked of a number without weight, not even its sign.
                let low = if LAMBDA[k] > 0.0 { low.max(-10.0) } else { -10.0 };
                let (_, alone, _) = &all(&[F[k]], &[LAMBDA[k]])[case];
                let best = least(low, 10.0, |z| alone.value(0..1, &[z]) + 0.5 * weight2 * (z - v) * (z - v));
                assert!((z[k] - best).abs() < 2e-7, "{name}, number {k}, weight {weight2}: {} and {best}", z[k]);
            }
        }
    }
}

#[test]
fn gradients_are_those_of_finite_differences() {
    for (name, of, low) in all(&F, &LAMBDA) {
        let z: [f64; 6] = [0.35, 0.4, 1.1, 0.07, 0.9, 0.9];
        assert!(z.iter().all(|z| *z > low));
        let mut slopes = z;
        of.gradient(0..z.len(), &mut slopes);
        for k in 0..z.len() {
            let step = |h: f64| {
                let mut at = z;
                at[k] += h;
                of.value(0..z.len(), &at)
            };
            let slope = (step(1e-5) - step(-1e-5)) / 2e-5;
            assert!((slope - slopes[k]).abs() < 1e-5 * (1.0 + slope.abs()), "{name}, {k}: {slope} and {}", slopes[k]);
        }
    }
}

#[test]
fn values_are_those_of_their_definitions() {
    let z = [0.35f64, 0.4, 1.1, 0.07, -0.9, 0.9];
    let sum = |of: &dyn Fn(f64, f64) -> f64| (0..6).map(|k| LAMBDA[k] * of(z[k], F[k])).sum::<f64>();
    let log = |f: f64, z: f64| if f > 0.0 { f * (f / z).ln() } else { 0.0 };
    let huber = |r: f64| if r.abs() <= 0.1 { r * r } else { 0.2 * r.abs() - 0.01 };
    let [squares, narrow, _, poisson] = all(&F, &LAMBDA);
    for ((name, of, _), want) in [
        (squares, sum(&|z, f| (z - f) * (z - f))),
        (narrow, sum(&|z, f| huber(z - f))),
        // The fifth has no weight: log of a negative number is not taken.
        (poisson, sum(&|z, f| if z > 0.0 { z - f + log(f, z) } else { 0.0 })),
    ] {
        let value = of.value(0..6, &z);
        assert!((value - want).abs() < 1e-12 * want, "{name}: {value} and {want}");
    }
    let (_, poisson, _) = &all(&F, &LAMBDA)[3];
    assert_eq!(poisson.value(0..6, &[-0.1; 6]), f64::INFINITY);
    assert_eq!(poisson.violation(0..6, &[0.1, -0.25, 0.1, 0.1, -3.0, 0.1]), 0.25);
    assert!(poisson.is_hard());
}
