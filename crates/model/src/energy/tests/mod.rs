//! Tests that run over the list of energies.

mod derivatives;
mod lanes;
mod limited;
mod prox;

use super::*;
use proxel_testkit::SplitMix;

/// A check for every energy in every dimension.
trait Check {
    fn run<const K: usize, E: Energy<K>>(&self, energy: &E, name: &str);
}

/// Rubber of the quasi-static models, a soft and a nearly incompressible solid.
fn materials() -> [Lame; 3] {
    [(1e7, 0.45), (2.0, 0.2), (1e5, 0.499)].map(|(e, nu)| Lame::from_young_poisson(e, nu).unwrap())
}

/// Runs `check` on all energies of the list, in each of their dimensions, for each of the materials.
fn on_all(check: &impl Check) {
    macro_rules! run {
        ($($energy:ident [$($k:tt)*])*) => {
            $($(for lame in materials() {
                let name = format!("{} K = {} nu = {:.3}", <$energy as Energy<$k>>::NAME, $k, lame.poisson());
                check.run::<$k, $energy>(&<$energy as Energy<$k>>::from_lame(&lame), &name);
            })*)*
        };
    }
    for_each_energy!(run);
}

/// Points of the domain: moderate, nearly equal, nearly collapsed and, where psi is defined there, inverted stretches.
fn points<const K: usize, E: Energy<K>>(count: usize) -> Vec<[f64; K]> {
    let mut random = SplitMix::new(7);
    let low = if E::BARRIER { 0.3 } else { -1.5 };
    (0..count)
        .map(|n| {
            let mut s: [f64; K] = random.array(low, 2.5);
            match n % 4 {
                1 => s = std::array::from_fn(|i| s[0] * (1.0 + 1e-5 * i as f64)),
                2 => {
                    s = random.array(0.5, 1.5);
                    s[K - 1] = random.uniform(if E::BARRIER { 0.05 } else { 0.0 }, 0.1); // J in (0, 0.2)
                }
                3 => s = random.array(0.8, 1.2),
                _ => {}
            }
            s
        })
        .collect()
}

#[test]
fn names_lead_to_energies_and_wrong_ones_are_told() {
    struct Rest;
    impl EnergyVisitor<3> for Rest {
        type Output = f64;
        fn visit<E: Energy<3>>(self, energy: E) -> f64 {
            energy.rest_stiffness()
        }
    }
    let lame = Lame::new(2.0, 3.0).unwrap();
    for (name, stiffness) in [
        ("neo-hookean", 13.0),
        ("stable-neo-hookean", 13.0),
        ("stvk", 13.0),
        ("corotated", 3.0 + 4.0 / 3.0),
        ("fixed-corotated", 13.0),
        ("arap", 4.0),
        ("symmetric-dirichlet", 4.0),
        ("symmetric-gradient", 4.0),
    ] {
        let found = visit_3d(name, &lame, Rest).unwrap();
        assert!((found - stiffness).abs() < 1e-12, "{name} {found}");
    }
    let told = visit_3d("spring", &lame, Rest).unwrap_err().to_string();
    assert!(told.contains("'spring'") && told.contains("stvk, corotated"), "{told}");
    assert!(names(1).contains(&"spring"));
}
