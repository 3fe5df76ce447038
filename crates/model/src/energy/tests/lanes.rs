use super::*;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Level, dispatch_at};

type Lanes<const K: usize> = [[f64; LANES]; K];

/// All functions of an energy on eight lanes.
struct Evaluate<'a, E, const K: usize> {
    energy: &'a E,
    v: Lanes<K>,
    k: [f64; LANES],
    warm: Lanes<K>,
}

impl<E, const K: usize> Copy for Evaluate<'_, E, K> {}

impl<E, const K: usize> Clone for Evaluate<'_, E, K> {
    fn clone(&self) -> Self {
        *self
    }
}

struct Evaluated<const K: usize> {
    prox: Lanes<K>,
    converged: u8,
    /// value, gradient, Hessian, divided differences, stiffness at `warm`, one after the other
    rest: Vec<[f64; LANES]>,
}

fn load<I: Isa, const K: usize>(from: &Lanes<K>) -> [F8<I>; K] {
    std::array::from_fn(|i| F8::load(&from[i]))
}

impl<E: Energy<K>, const K: usize> Kernel for Evaluate<'_, E, K> {
    type Output = Evaluated<K>;
    #[inline(always)]
    fn run<I: Isa>(self) -> Evaluated<K> {
        let warm = load::<I, K>(&self.warm);
        let p = self.energy.prox(load::<I, K>(&self.v), F8::load(&self.k), warm);
        let d = self.energy.divided_differences(warm);
        let mut rest = vec![self.energy.value(warm).to_array(), self.energy.effective_stiffness(warm).to_array()];
        rest.extend(self.energy.gradient(warm).map(|x| x.to_array()));
        rest.extend(self.energy.hessian(warm).as_flattened().iter().map(|x| x.to_array()));
        rest.extend(d.minus.as_flattened().iter().chain(d.plus.as_flattened()).map(|x| x.to_array()));
        Evaluated { prox: p.s.map(|x| x.to_array()), converged: p.converged.bits(), rest }
    }
}

fn lane<const K: usize>(from: &Lanes<K>, l: usize) -> [f64; K] {
    std::array::from_fn(|i| from[i][l])
}

fn problem<'a, E: Energy<K>, const K: usize>(energy: &'a E, random: &mut SplitMix, wide: bool) -> Evaluate<'a, E, K> {
    let slope = energy.slope_stiffness();
    let (low, high) = if wide { (-2.0, 4.0) } else { (0.3, 1.7) };
    let v = std::array::from_fn(|_| random.array(low, high));
    let warm = std::array::from_fn(|_| random.array(0.5, 1.5));
    Evaluate { energy, v, k: random.array(0.5 * slope, 5.0 * slope), warm }
}

#[test]
fn lanes_agree_with_single_numbers_at_every_level() {
    struct Agree;
    impl Check for Agree {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let mut random = SplitMix::new(5);
            for level in Level::available() {
                for _ in 0..50 {
                    let problem = problem(energy, &mut random, false);
                    let found = dispatch_at(level, problem);
                    assert_eq!(found.converged, 0xff, "{name} {level:?}");
                    for l in 0..LANES {
                        let (v, warm) = (lane(&problem.v, l), lane(&problem.warm, l));
                        let single = energy.prox(v, problem.k[l], warm);
                        let here = lane(&found.prox, l);
                        for i in 0..K {
                            assert!(
                                (here[i] - single.s[i]).abs() < 1e-10,
                                "{name} {level:?} {v:?} {here:?} {:?}",
                                single.s
                            );
                        }
                        let d = energy.divided_differences(warm);
                        let mut expected = vec![energy.value(warm), energy.effective_stiffness(warm)];
                        expected.extend(energy.gradient(warm));
                        expected.extend(energy.hessian(warm).as_flattened());
                        expected.extend(d.minus.as_flattened().iter().chain(d.plus.as_flattened()));
                        assert_eq!(expected.len(), found.rest.len());
                        let scale = expected.iter().fold(energy.rest_stiffness(), |m, x| m.max(x.abs()));
                        for (n, (expected, found)) in expected.iter().zip(&found.rest).enumerate() {
                            let tolerance = if n == 1 { 1e-7 } else { 1e-13 };
                            assert!((found[l] - expected).abs() < tolerance * scale, "{name} {level:?} {n}");
                        }
                    }
                }
            }
        }
    }
    on_all(&Agree);
}

#[test]
fn a_lane_does_not_depend_on_the_others() {
    struct Alone;
    impl Check for Alone {
        fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str) {
            let mut random = SplitMix::new(6);
            for level in Level::available() {
                for n in 0..50 {
                    let (a, b) = (problem(energy, &mut random, true), problem(energy, &mut random, true));
                    // Lane l of a moves to another lane among strangers, one of them hopeless.
                    let (from, to) = (n % LANES, (3 * n + 1) % LANES);
                    let mut mixed = b;
                    for i in 0..K {
                        mixed.v[i][(to + 1) % LANES] = f64::NAN;
                        mixed.v[i][to] = a.v[i][from];
                        mixed.warm[i][to] = a.warm[i][from];
                    }
                    mixed.k[to] = a.k[from];
                    let (here, there) = (dispatch_at(level, a), dispatch_at(level, mixed));
                    for i in 0..K {
                        let (x, y) = (here.prox[i][from], there.prox[i][to]);
                        assert_eq!(x.to_bits(), y.to_bits(), "{name} {level:?} {x} {y}");
                    }
                    assert_eq!(here.converged >> from & 1, there.converged >> to & 1, "{name} {level:?}");
                    assert_eq!(there.converged >> ((to + 1) % LANES) & 1, 0, "{name}: NaN cannot converge");
                }
            }
        }
    }
    on_all(&Alone);
}
