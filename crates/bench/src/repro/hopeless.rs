//! Starts that no one would give: from each, a method either reaches a stationary point without inverted elements, or says
//! why not.

use super::context::Context;
use crate::BenchError;
use crate::data::Model;
use crate::table::{Table, seconds};
use proxel::deform::{DeformInput, Hooks, deform};
use proxel::mesh::topology;
use proxel::settings::{DeformSettings, MethodName};
use proxel::split::Status;
use std::fmt::Write as _;

/// A way to spoil a start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spoilt {
    /// All free vertices at one point of the bounding box, given by its parts of the box's sides.
    Point([f64; 3]),
    /// Each free vertex anywhere in the bounding box; by seed.
    Random(u64),
    /// Free vertices mirrored about the middle of the box, along an axis.
    Mirrored(usize),
    /// Every second free vertex, beginning with the first or second, reflected through the centroid of its neighbours.
    Reflected(usize),
}

impl Spoilt {
    /// All that are tried, twelve a model.
    pub fn all() -> Vec<Spoilt> {
        let points = [[0.5; 3], [0.0; 3], [0.9, 0.2, 0.4]].map(Spoilt::Point);
        let random = [1, 2, 3, 4].map(Spoilt::Random);
        let mirrored = [0, 1, 2].map(Spoilt::Mirrored);
        let reflected = [0, 1].map(Spoilt::Reflected);
        points.into_iter().chain(random).chain(mirrored).chain(reflected).collect()
    }

    fn name(self) -> String {
        match self {
            Spoilt::Point(p) => format!("one point, {p:?} of the box"),
            Spoilt::Random(seed) => format!("random in the box, seed {seed}"),
            Spoilt::Mirrored(axis) => format!("mirrored along {}", ["x", "y", "z"][axis % 3]),
            Spoilt::Reflected(first) => format!("every second vertex reflected, from {first}"),
        }
    }

    /// The spoilt start of a model. The box is that of the mesh at rest.
    pub fn start(self, input: &DeformInput) -> Vec<[f64; 3]> {
        let mesh = &input.rest;
        let mut x = input.start.clone().unwrap_or_else(|| mesh.points.clone());
        for (v, p) in &input.fixed {
            x[*v as usize] = *p;
        }
        let (low, high) = mesh.bounding_box().unwrap_or(([0.0; 3], [1.0; 3]));
        let at = |part: [f64; 3]| -> [f64; 3] { std::array::from_fn(|d| low[d] + part[d] * (high[d] - low[d])) };
        let mut is_free = vec![true; x.len()];
        for (v, _) in &input.fixed {
            is_free[*v as usize] = false;
        }
        let mut state = 0u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        if let Spoilt::Random(seed) = self {
            (0..seed * 1000).for_each(|_| {
                uniform();
            });
        }
        let before = x.clone();
        let mut ring: Vec<([f64; 3], f64)> = Vec::new(); // sum and number of neighbours
        if let Spoilt::Reflected(_) = self {
            ring = vec![([0.0; 3], 0.0); x.len()];
            for [a, b] in topology::tet_edges(&mesh.tets) {
                for (v, w) in [(a as usize, b as usize), (b as usize, a as usize)] {
                    for d in 0..3 {
                        ring[v].0[d] += before[w][d];
                    }
                    ring[v].1 += 1.0;
                }
            }
        }
        let mut seen = 0;
        for v in (0..x.len()).filter(|v| is_free[*v]) {
            match self {
                Spoilt::Point(part) => x[v] = at(part),
                Spoilt::Random(_) => x[v] = at([uniform(), uniform(), uniform()]),
                Spoilt::Mirrored(axis) => x[v][axis % 3] = low[axis % 3] + high[axis % 3] - before[v][axis % 3],
                Spoilt::Reflected(first) => {
                    if seen % 2 == first % 2 && ring[v].1 > 0.0 {
                        x[v] = std::array::from_fn(|d| 2.0 * ring[v].0[d] / ring[v].1 - before[v][d]);
                    }
                    seen += 1;
                }
            }
        }
        x
    }
}

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let mut tries = Spoilt::all();
    if context.options.quick {
        tries.retain(|s| {
            matches!(s, Spoilt::Point([0.5, ..]) | Spoilt::Random(1) | Spoilt::Mirrored(1) | Spoilt::Reflected(0))
        });
    }
    let (mut good, mut all) = (0, 0);
    for name in context.models.clone() {
        let (model, least) = context.load(&name)?;
        let mut table = Table::new(["start", "end", "iterations", "seconds", "inverted", "E / E* - 1", "reason"]);
        for spoilt in &tries {
            let end = attempt(context, &model, *spoilt)?;
            let report = &end.report;
            let is_good = end.status == Status::Converged && report.inverted == Some(0);
            all += 1;
            good += usize::from(is_good);
            let above = report.energy.map_or("-".to_string(), |e| format!("{:.1e}", e / least - 1.0));
            context.tell(&format!(
                "{name}: {}: {} after {} iterations, {} s",
                spoilt.name(),
                report.status,
                report.iterations,
                seconds(report.seconds.solve)
            ));
            table.row([
                spoilt.name(),
                report.status.clone(),
                report.iterations.to_string(),
                seconds(report.seconds.solve),
                report.inverted.map_or("-".to_string(), |n| n.to_string()),
                above,
                if is_good { String::new() } else { report.reason.clone() },
            ]);
        }
        let _ = writeln!(context.text, "## {name}\n\n{table}");
    }
    let _ = writeln!(
        context.text,
        "{good} of {all} runs of `{}` end at a stationary point (gradient ratio 1e-9) without inverted elements. Other minima \
         than the reference are as good an end: a body that was turned inside out may stay knotted.",
        MethodName::Auto.as_str()
    );
    Ok(())
}

fn attempt(context: &Context<'_>, model: &Model, spoilt: Spoilt) -> Result<proxel::deform::Deformation, BenchError> {
    let start = Some(spoilt.start(&model.input));
    let input = DeformInput { start, reference: None, ..model.input.clone() };
    let settings = DeformSettings {
        method: MethodName::Auto,
        max_iters: context.max_iters(),
        threads: context.options.threads,
        ..DeformSettings::default()
    };
    deform(&input, &settings, &mut Hooks::default()).map_err(BenchError::from_display)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::twisted_beam;

    #[test]
    fn starts_are_spoilt_and_pins_are_not() {
        let input = twisted_beam([4, 2, 2]).expect("a beam").input;
        let good = input.start.clone().expect("a start");
        for spoilt in Spoilt::all() {
            let start = spoilt.start(&input);
            assert_eq!(start, spoilt.start(&input));
            let moved = start.iter().zip(&good).filter(|(a, b)| a != b).count();
            let free = good.len() - input.fixed.len();
            assert!(moved <= free && moved * 3 >= free, "{spoilt:?}: {moved} of {free}");
            assert!(input.fixed.iter().all(|(v, p)| start[*v as usize] == *p), "{spoilt:?}");
        }
        assert_ne!(Spoilt::Random(1).start(&input), Spoilt::Random(2).start(&input));
    }
}
