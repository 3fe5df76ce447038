//! Methods as the reproductions name and draw them.

use proxel::settings::{DeformSettings, MethodName};

/// A method with its settings, and its name in tables.
#[derive(Clone, Debug)]
pub struct Variant {
    /// Its name.
    pub name: String,
    /// Its settings.
    pub settings: DeformSettings,
}

impl Variant {
    /// A method with default settings.
    pub fn of(method: MethodName) -> Self {
        Variant { name: method.as_str().to_string(), settings: DeformSettings { method, ..DeformSettings::default() } }
    }

    /// A method with its squared weights multiplied by `beta`.
    pub fn scaled(method: MethodName, beta: f64) -> Self {
        let mut variant = Variant::of(method);
        if beta != 1.0 {
            variant.name = format!("{} beta={beta}", variant.name);
            variant.settings.admm.weight_scale = beta;
        }
        variant
    }
}

/// All methods; ADMM with static weights, unaccelerated, under each multiplier.
pub fn all(multipliers: &[f64]) -> Vec<Variant> {
    let order = [
        MethodName::Auto,
        MethodName::Wrapd,
        MethodName::RAdmm,
        MethodName::WAdmm,
        MethodName::AdmmPd,
        MethodName::Bcqn,
        MethodName::Lbfgs,
        MethodName::Aadr,
        MethodName::AaAdmm,
        MethodName::Newton,
        MethodName::NewtonCg,
        MethodName::ProjectedNewton,
    ];
    order
        .into_iter()
        .flat_map(|method| match method {
            MethodName::RAdmm | MethodName::AdmmPd => {
                multipliers.iter().map(|beta| Variant::scaled(method, *beta)).collect()
            }
            _ => vec![Variant::of(method)],
        })
        .collect()
}
