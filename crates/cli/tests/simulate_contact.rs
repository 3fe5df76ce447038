//! Contact of `proxel simulate` with obstacles that have ridges and hollows.

mod common;

use common::Folder;
use serde_json::Value;

/// A cube on its corner above rows of ridges; `more` is appended to the obstacle.
fn ridges(frames: usize, more: &str) -> String {
    let row = |i: usize| -> Vec<String> {
        (0..13)
            .map(|j| f64::from(u8::from(j % 2 == 0)) * 0.15 + f64::from(u8::from(i % 2 == 1)) * 0.045)
            .map(|h| h.to_string())
            .collect()
    };
    let heights: Vec<String> = (0..13).map(|i| format!("[{}]", row(i).join(", "))).collect();
    format!(
        "[time]\ndt = 0.02\nframes = {frames}\n[[body]]\nname = \"cube\"\n\
         generate = {{ bar = {{ cells = [3, 3, 3], size = [1, 1, 1] }} }}\n\
         material = {{ energy = \"neo-hookean\", young = 1e5, poisson = 0.4 }}\ndensity = 1000\n\
         rotate = {{ axis = [1, 0, -1], angle = 54.7 }}\ntranslate = [0, 1.2, 0]\n\
         [[obstacle]]\nname = \"ridges\"\n\
         shape = {{ height-field = {{ origin = [-1.5, 0, -1.5], spacing = [0.25, 0.25], depth = 1, \
         heights = [{}] }} }}\n{more}\n",
        heights.join(", ")
    )
}

/// Runs a scene; the frames of its report.
fn frames(folder: &Folder, scene: &str) -> Vec<Value> {
    folder.put("s.toml", scene);
    let run = folder.run("simulate s.toml --out d --quiet");
    assert!(matches!(run.status, Some(0 | 3)), "{}", run.err);
    let report: Value = serde_json::from_str(&folder.read("d/report.json")).unwrap();
    report["frames"].as_array().unwrap()[1..].to_vec()
}

fn number(frame: &Value, key: &str) -> f64 {
    frame[key].as_f64().unwrap_or(f64::INFINITY)
}

/// All frames have converged, no vertex is inside by more than 1e-6 of the size, and forces are balanced where nothing
/// touches.
fn check(frames: &[Value], size: f64) {
    for frame in frames {
        assert_eq!(frame["status"], "converged", "{frame}");
        assert!(number(frame, "max_penetration") <= 1e-6 * size, "{frame}");
        assert!(number(frame, "gradient_off_contact") <= number(frame, "gradient_bound"), "{frame}");
    }
}

#[test]
fn a_cube_on_its_corner_settles_among_ridges() {
    let folder = Folder::new("simulate-ridges");
    let frames = frames(&folder, &ridges(50, ""));
    assert_eq!(frames.len(), 50);
    check(&frames, 3f64.sqrt());
    let most = frames.iter().map(|f| f["contacts"].as_u64().unwrap()).max().unwrap();
    assert!(most >= 3, "{most} vertices touch");
}

#[test]
fn ridges_that_move_push_it_along() {
    let folder = Folder::new("simulate-moving-ridges");
    let frames = frames(&folder, &ridges(30, "velocity = [0.3, 0.2, 0]"));
    check(&frames, 3f64.sqrt());
    let along = frames[29]["momentum"][0].as_f64().unwrap();
    assert!(along > 0.0, "it is pushed along: {along}");
}
