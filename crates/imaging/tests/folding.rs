//! Iterations on v = z + u alone.

use proxel_imaging::restore::{Edges, Iteration, Model, Regulariser};
use proxel_imaging::{Image, Norm, Psf};
use proxel_split::Method;

/// Squares under a blur, of so many channels; the border and the norm.
fn models() -> Vec<Model> {
    let value = |c: usize, i: usize, j: usize| {
        let square = if (8..21).contains(&i) && (5 + c..19).contains(&j) { 0.4 } else { 0.0 };
        0.2 + square + 0.02 * (((37 * i + j) * 7919 + c * 31) as f64).sin()
    };
    let sized = |w: usize, h: usize, channels: usize| {
        let plane = |c: usize| (0..w * h).map(|k| value(c, k / w, k % w)).collect();
        Image::new(w, h, (0..channels).map(plane).collect()).expect("an image")
    };
    let image = |channels: usize| sized(37, 30, channels);
    let blur = Psf::new(3, 3, vec![1.0, 2.0, 1.0, 2.0, 5.0, 2.0, 1.0, 2.0, 1.0], None).expect("a kernel");
    let mut all: Vec<Model> = [Edges::Periodic, Edges::Neumann, Edges::Unknown]
        .into_iter()
        .flat_map(|edges| [1, 3].map(|channels| Model::new(&image(channels), blur.clone(), edges, 40.0)))
        .collect();
    for (edges, channels, norm) in [(Edges::Periodic, 1, Norm::Channels), (Edges::Unknown, 2, Norm::Channels)] {
        let mut cosines = Model::new(&image(channels), blur.clone(), edges, 40.0);
        (cosines.regulariser, cosines.norm) = (Regulariser::Frame, norm);
        all.push(cosines);
    }
    // Several tasks, the last of which ends within a tile of rows of its spectrum.
    for (edges, channels) in [(Edges::Periodic, 1), (Edges::Periodic, 2), (Edges::Unknown, 1)] {
        let mut large = Model::new(&sized(150, 141, channels), blur.clone(), edges, 40.0);
        large.norm = Norm::Channels;
        all.push(large);
    }
    // Colours together: their terms keep p and u.
    let mut together = Model::new(&image(3), blur, Edges::Periodic, 40.0);
    together.norm = Norm::Vectorial;
    all.push(together);
    all
}

fn method(model: &Model, iteration: Iteration) -> Box<dyn Method> {
    model.build(None).expect("a problem").method("x", iteration).expect("a method")
}

const STEPS: usize = 25;

/// Algorithm 1 without a history is plain ADMM; it sets p and u itself, so that nothing is folded there.
#[test]
fn the_iteration_is_that_on_p_and_u() {
    for model in models() {
        let mut folded = method(&model, Iteration::Admm { relaxation: 1.0 });
        let mut both = method(&model, Iteration::Anderson { window: 0, both: true, relaxation: 1.0 });
        for k in 0..STEPS {
            let (a, b) = (folded.step().expect("a step"), both.step().expect("a step"));
            for (a, b) in [(a.local.gap2, b.local.gap2), (a.local.moved2, b.local.moved2)] {
                assert!((a - b).abs() <= 1e-9 * b, "iteration {k}: {a} and {b}");
            }
            let off = folded.x().iter().zip(both.x()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-11, "iteration {k}: {off}");
        }
        let (a, b) = (folded.residuals(), both.residuals());
        assert!((a.primal - b.primal).abs() < 1e-9 * b.primal, "{} and {}", a.primal, b.primal);
    }
}

#[test]
fn who_asks_changes_no_bit() {
    for model in models() {
        let mut alone = method(&model, Iteration::Admm { relaxation: 1.8 });
        let mut asked = method(&model, Iteration::Admm { relaxation: 1.8 });
        for k in 0..STEPS {
            alone.step().expect("a step");
            asked.step().expect("a step");
            asked.residuals();
            asked.forces().expect("forces");
            let splitting = asked.splitting().expect("a splitting");
            let forces: f64 = splitting.u.iter().flatten().map(|u| u.abs()).sum();
            assert!(k == 0 || forces > 0.0, "iteration {k}");
        }
        assert_eq!(alone.x(), asked.x());
        let (a, b) = (alone.splitting().expect("a splitting"), asked.splitting().expect("a splitting"));
        assert_eq!((a.p, a.u), (b.p, b.u));
    }
}
