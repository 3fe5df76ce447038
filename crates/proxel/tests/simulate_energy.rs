//! Total energy of the sample scenes at their own time steps.

use proxel::simulate::{FrameRecord, Hooks, SceneFile, Simulation};
use std::path::PathBuf;

type V3 = [f64; 3];

/// A sample scene with some of its text replaced.
fn scene(text: &str, replaced: &[(&str, &str)]) -> SceneFile {
    let text = replaced.iter().fold(text.to_string(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    SceneFile::parse("s.toml".into(), text.clone(), false, PathBuf::new()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Positions of all vertices and forces of contact on them.
fn now(simulation: &Simulation) -> (Vec<V3>, Vec<V3>) {
    let frame = simulation.frame(FrameRecord::default()).unwrap_or_else(|e| panic!("{e}"));
    let (mut x, mut f) = (Vec::new(), Vec::new());
    for (_, mesh, fields) in &frame.bodies {
        x.extend(&mesh.points);
        let contact = fields.point.iter().find(|field| field.name == "contact_force").expect("forces");
        f.extend(contact.data.as_chunks::<3>().0);
    }
    (x, f)
}

/// Runs some frames. Frames in which energy grew, and whether it grew by no more than the work of contact did.
///
/// A step of implicit Euler takes the force at its end. That of a flat wall does no work on what comes to it, but a vertex
/// that slid around something round was behind the plane that it ends in front of: the force of that plane has done
/// work. Where the elastic energy is convex along the step, the total grows by that work at most.
fn grown(file: &SceneFile, frames: usize) -> Vec<usize> {
    let mut simulation = Simulation::new(file, Some(1)).unwrap_or_else(|e| panic!("{e}"));
    let mut before = simulation.start_record();
    let mut x = now(&simulation).0;
    let (mut largest, mut grown) = (before.kinetic, Vec::new());
    for frame in 1..=frames {
        let record = simulation.advance(&mut Hooks::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(record.status, "converged", "frame {frame}: {}", record.reason);
        let (ended, force) = now(&simulation);
        let work: f64 = force
            .iter()
            .zip(ended.iter().zip(&x))
            .map(|(f, (b, a))| (0..3).map(|d| f[d] * (b[d] - a[d])).sum::<f64>())
            .sum();
        largest = largest.max(record.kinetic);
        let growth = record.energy() - before.energy();
        assert!(growth <= work.max(0.0) + 1e-6 * largest, "frame {frame}: by {growth} J, contact did {work} J");
        if growth > 1e-6 * largest {
            grown.push(frame);
        }
        (before, x) = (record, ended);
    }
    grown
}

#[test]
fn bars_that_swing_between_still_ends_gain_no_energy() {
    for text in
        [include_str!("../../../scenes/aa-figure2-soft.toml"), include_str!("../../../scenes/aa-figure2-rubber.toml")]
    {
        let still: String = text.lines().filter(|l| !l.starts_with("keyframe")).map(|l| format!("{l}\n")).collect();
        let gravity = ("gravity = [0, -9.8, 0]", "gravity = [0, 0, 0]");
        let swings = scene(&still, &[gravity, ("density = 1522", "density = 1522\nvelocity = [0, 3, 0]")]);
        assert!(grown(&swings, 12).is_empty());
        assert!(grown(&scene(&still, &[]), 12).is_empty(), "they fall under their weight");
    }
}

#[test]
fn what_falls_gains_no_energy_but_by_what_contact_does() {
    let pit = scene(include_str!("../../../scenes/aa-figure5-pit.toml"), &[]);
    assert!(grown(&pit, 27).is_empty());
    let cylinders = scene(include_str!("../../../scenes/aa-figure6-cylinders.toml"), &[]);
    let found = grown(&cylinders, 22);
    assert!(found.len() <= 2, "{found:?}");
    let shorter = scene(
        include_str!("../../../scenes/aa-figure6-cylinders.toml"),
        &[("frames = 60", "frames = 60\nsubsteps = 4")],
    );
    assert!(grown(&shorter, 22).is_empty(), "at a quarter of the time step");
}
