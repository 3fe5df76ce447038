//! What the settings of WRAPD do, one at a time: gamma, kappa, k_rw, window, range of weights.

use super::comparison::{Means, compare};
use super::context::Context;
use super::variants::Variant;
use crate::BenchError;
use crate::plot::{Axis, Line, Panel};
use crate::table::Table;
use proxel::settings::{AdmmSettings, MethodName};
use std::fmt::Write as _;

/// A setting and its values.
struct Sweep {
    name: &'static str,
    symbol: &'static str,
    source: &'static str,
    values: &'static [f64],
    quick: &'static [f64],
    set: fn(&mut AdmmSettings, f64),
    get: fn(&AdmmSettings) -> f64,
}

const SWEEPS: [Sweep; 5] = [
    Sweep {
        name: "gamma",
        symbol: "gamma",
        source: "trigger of reweighting, W(23)",
        values: &[1.1, 1.25, 1.5, 2.0, 3.0, 5.0],
        quick: &[1.1, 5.0],
        set: |s, v| s.reweight_trigger = v,
        get: |s| s.reweight_trigger,
    },
    Sweep {
        name: "kappa",
        symbol: "kappa",
        source: "stop of the inner iteration, W(17)",
        values: &[0.25, 0.5, 1.0, 2.0, 4.0, 8.0],
        quick: &[0.25, 8.0],
        set: |s, v| s.kappa = v,
        get: |s| s.kappa,
    },
    Sweep {
        name: "k_rw",
        symbol: "k_rw",
        source: "first iteration that may reweight, section 6.1",
        values: &[5.0, 10.0, 25.0, 50.0, 100.0, 200.0],
        quick: &[10.0],
        set: |s, v| s.reweight_from = v as usize,
        get: |s| s.reweight_from as f64,
    },
    Sweep {
        name: "window",
        symbol: "l",
        source: "pairs that L-BFGS keeps, section 4.1",
        values: &[1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 20.0],
        quick: &[1.0, 20.0],
        set: |s, v| s.window = v as usize,
        get: |s| s.window as f64,
    },
    Sweep {
        name: "range",
        symbol: "r",
        source: "candidate weights are clamped to [1/r, r] times the base weight, W(22)",
        values: &[1.5, 3.0, 10.0, 30.0, 100.0],
        quick: &[1.5],
        set: |s, v| (s.weight_min, s.weight_max) = (1.0 / v, v),
        get: |s| s.weight_max,
    },
];

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let default = Variant::of(MethodName::Wrapd);
    let mut variants = vec![default.clone()];
    let mut places: Vec<Vec<(f64, usize)>> = Vec::new(); // of each sweep: its values and where their variants are
    for sweep in &SWEEPS {
        let values = if context.options.quick { sweep.quick } else { sweep.values };
        let mut values = values.to_vec();
        let usual = (sweep.get)(&default.settings.admm);
        if !values.contains(&usual) {
            values.push(usual);
        }
        values.sort_by(f64::total_cmp);
        let mut mine = Vec::new();
        for value in values {
            let mut variant = default.clone();
            variant.name = format!("wrapd {}={value}", sweep.name);
            (sweep.set)(&mut variant.settings.admm, value);
            mine.push((value, variants.len()));
            variants.push(variant);
        }
        places.push(mine);
    }
    let runs = compare(context, &variants)?;
    let means: Vec<Means> = runs.iter().map(|runs| Means::of(runs)).collect();
    let base = means[0];
    let _ = writeln!(
        context.text,
        "WRAPD to a position error of 1e-4, geometric means over the models; one setting at a time departs from the defaults, \
         which are marked. A run that does not get there counts with all that it did.\n"
    );
    let mut panels = Vec::new();
    for (sweep, places) in SWEEPS.iter().zip(&places) {
        let _ = writeln!(context.text, "## {}: {}\n", sweep.name, sweep.source);
        let mut table = Table::new([sweep.symbol, "iterations", "inner steps", "seconds", "not reached"]);
        for (value, at) in places {
            let usual = *value == (sweep.get)(&default.settings.admm);
            let label = if usual { format!("**{value}**") } else { value.to_string() };
            table.row([label].into_iter().chain(means[*at].cells()));
        }
        let _ = writeln!(context.text, "{table}");
        panels.push(panel(sweep, places, &means, base));
    }
    context.plot("", "Cost to 1e-4 relative to the defaults", &panels)
}

fn panel(sweep: &Sweep, places: &[(f64, usize)], means: &[Means], base: Means) -> Panel {
    let line = |label: &str, style: usize, of: &dyn Fn(&Means) -> f64| Line {
        label: label.to_string(),
        points: places.iter().map(|(value, at)| (*value, of(&means[*at]))).collect(),
        style,
        marked: true,
    };
    let lines = vec![
        line("iterations", 0, &|m| m.iterations / base.iterations),
        line("inner steps", 2, &|m| m.inner / base.inner),
        line("seconds", 1, &|m| m.seconds / base.seconds),
    ];
    let ys = lines.iter().flat_map(|l| &l.points).map(|p| p.1).chain([0.8, 1.5]);
    Panel {
        title: sweep.source.to_string(),
        x_label: sweep.symbol.to_string(),
        y_label: "relative to the defaults".to_string(),
        x: Axis::log_around(places.iter().map(|(value, _)| *value)),
        y: Axis::log_around(ys),
        lines,
        map: None,
    }
}
