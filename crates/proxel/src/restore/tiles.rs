//! An image in parts, one after another, so that memory goes by a part.

use super::watch::Part;
use super::{Hooks, Input, RestoreError, finite, run_model};
use crate::settings::RestoreSettings;
use proxel_imaging::Image;
use proxel_imaging::restore::{Edges, Gap, Model, Regulariser};
use proxel_split::Status;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Pixels of what was seen, besides the reach of the blur, that a part knows of on each side beyond what is taken of it. What it
/// does not know of beyond is felt less the further away it is: docs/deblur.md has how much.
const OVERLAP: usize = 64;

/// Half of the pixels over which one part goes over into the next.
const BLEND: usize = 8;

/// What solving for a whole image may take without being asked: 4 GiB.
const MEMORY: f64 = 4.0 * 1024.0 * 1024.0 * 1024.0;

/// What all parts together gave.
pub(super) struct Tiled {
    pub(super) image: Image,
    pub(super) status: Status,
    pub(super) reason: String,
    /// Of all parts.
    pub(super) iterations: usize,
    /// That of the part whose relative gap is the largest; none where there is no bound for one of them.
    pub(super) gap: Option<Gap>,
    /// The largest of a part: primal and dual.
    pub(super) residuals: [Option<f64>; 2],
    /// Proposals of an accelerator that were taken, and those that were not.
    pub(super) proposals: [usize; 2],
    /// The most of a part.
    pub(super) field: [usize; 2],
    pub(super) parts: usize,
}

impl Tiled {
    /// The worst end of a part is that of all; of such ends the first gives the reason.
    fn ends(&mut self, status: Status, reason: String) {
        let rank = |status: Status| match status {
            Status::Converged => 0,
            Status::Stopped => 1,
            Status::Cancelled => 2,
            Status::Failed => 3,
        };
        if rank(status) > rank(self.status) {
            (self.status, self.reason) = (status, reason);
        }
    }
}

/// What lies beyond the border of the image, for a part that reaches it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Beyond {
    /// Nothing that counts.
    Nothing,
    /// The image again.
    Image,
}

impl Beyond {
    fn of(model: &Model) -> Self {
        // A part of an image whose border mirrors has such borders too: where it was cut that is felt no further than an
        // unknown one. A mirror image in its place would not do, since differences to the next pixel become those to the one
        // before.
        if model.edges == Edges::Periodic { Beyond::Image } else { Beyond::Nothing }
    }

    /// The pixel of n that stands at `at`, which may lie beyond.
    fn pixel(self, at: isize, n: usize) -> usize {
        let n = n.max(1) as isize;
        let at = match self {
            Beyond::Nothing => at.clamp(0, n - 1),
            Beyond::Image => at.rem_euclid(n),
        };
        at as usize
    }
}

/// Where a part begins and ends in one direction, and what is taken of it.
#[derive(Clone, Copy, Debug)]
struct Span {
    first: isize, // of the pixels that it knows of; outside of the image where something is beyond
    end: isize,
    taken: [usize; 2],      // pixels of the image between which its weight is not 0
    rise: Option<[f64; 2]>, // from weight 0 to weight 1, in pixels; none at the border of the image
    fall: Option<[f64; 2]>, // from weight 1 to weight 0
}

impl Span {
    fn len(&self) -> usize {
        self.end.abs_diff(self.first)
    }

    /// Weights of all spans sum up to 1 at each pixel.
    fn weight(&self, at: f64) -> f64 {
        let ramp = |[a, b]: [f64; 2]| ((at - a) / (b - a)).clamp(0.0, 1.0);
        self.rise.map_or(1.0, ramp) - self.fall.map_or(0.0, ramp)
    }
}

/// Parts of at most `side` pixels of n, each of which knows of `margin` pixels beyond what is taken of it.
fn spans(n: usize, side: usize, margin: usize, beyond: Beyond) -> Vec<Span> {
    let outside = if beyond == Beyond::Nothing { 0 } else { margin };
    let count = if n + 2 * outside <= side {
        1
    } else if outside == 0 && n <= 2 * side.saturating_sub(margin) {
        2 // each knows of more on one side only
    } else {
        n.div_ceil(side.saturating_sub(2 * margin).max(1))
    };
    let cut = |k: usize| k * n / count;
    // Cuts are spread evenly; about each, one goes over into the next.
    let blend = |at: usize| [at.saturating_sub(BLEND) as f64, (at + BLEND).min(n) as f64];
    let span = |k: usize| {
        let (from, to) = (cut(k), cut(k + 1));
        let least = if beyond == Beyond::Nothing { 0 } else { -(margin as isize) };
        let most = (n + outside) as isize;
        let (rise, fall) = ((k > 0).then(|| blend(from)), (k + 1 < count).then(|| blend(to)));
        Span {
            first: (from as isize - margin as isize).max(least),
            end: ((to + margin) as isize).min(most),
            taken: [rise.map_or(0, |[a, _]| a as usize), fall.map_or(n, |[_, b]| b as usize)],
            rise,
            fall,
        }
    };
    (0..count).map(span).collect()
}

/// Pixels of what was seen that a part knows of beyond what is taken of it.
fn margin(model: &Model) -> usize {
    OVERLAP + BLEND + model.psf.width.max(model.psf.height).div_ceil(model.scale)
}

/// Bytes that solving takes for a pixel of a field and channel, by what it keeps: see docs/deblur.md.
fn bytes(model: &Model) -> f64 {
    let held = model.edges != Edges::Unknown && model.mask.is_none() && model.scale == 1;
    match model.regulariser {
        Regulariser::Tgv { .. } => 600.0,
        Regulariser::Frame => 1300.0,
        Regulariser::Tv if held => 290.0,
        Regulariser::Tv => 400.0,
    }
}

/// The side of parts that an image is to be solved in: as asked, or for [`MEMORY`]; none for the whole.
pub(super) fn side(model: &Model, asked: Option<usize>) -> Option<usize> {
    let (longest, scale) = (model.width.max(model.height), model.scale as f64);
    if let Some(side) = asked {
        return (longest > side).then_some(side);
    }
    let pixel = bytes(model) * scale * scale * model.channels.len() as f64;
    if pixel * model.width as f64 * model.height as f64 <= MEMORY {
        return None;
    }
    Some(((MEMORY / pixel).sqrt() as usize).max(4 * margin(model)))
}

/// The image put together of parts of at most `side` pixels a side, each restored by itself with an unknown border, under the
/// lambda, noise and penalties of the whole. They overlap by what is said at [`margin`]. What time did not suffice for
/// is what was seen.
///
/// # Errors
/// Parts that are too small for their overlap, parts without a measured pixel.
pub(super) fn restore(
    input: &Input<'_>,
    mut model: Model,
    settings: &RestoreSettings,
    side: usize,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Tiled, RestoreError> {
    let margin = margin(&model);
    let least = 4 * margin;
    if side < least {
        return Err(RestoreError(format!(
            "--tile is {side}; with this blur parts overlap so far that it has to be {least} at least"
        )));
    }
    let beyond = Beyond::of(&model);
    let (width, height, scale) = (model.width, model.height, model.scale);
    let (rows, columns) = (spans(height, side, margin, beyond), spans(width, side, margin, beyond));
    let (w, h, channels) = (width * scale, height * scale, model.channels.len());
    // Pixels stay in the input alone.
    model.channels = Vec::new();
    let mask = model.mask.take();
    if beyond != Beyond::Nothing {
        let blurs = model.psf.weights.len() > 1 || model.regulariser != Regulariser::Tv;
        model.edges = if blurs { Edges::Unknown } else { Edges::Neumann };
    }
    let mut tiled = Tiled {
        image: Image::new(w, h, vec![vec![0.0; w * h]; channels])?,
        status: Status::Converged,
        reason: String::new(),
        iterations: 0,
        gap: None,
        residuals: [None, None],
        proposals: [0, 0],
        field: [0, 0],
        parts: rows.len() * columns.len(),
    };
    let (mut done, mut unreached, mut all_bound) = (0, 0, true);
    let pairs = rows.iter().flat_map(|row| columns.iter().map(move |column| (row, column)));
    for (part, (row, column)) in pairs.enumerate() {
        let cut = |plane: &Vec<f64>| -> Vec<f64> {
            let of_row = |i: isize| {
                let from = beyond.pixel(i, height) * width;
                (column.first..column.end).map(move |j| plane[from + beyond.pixel(j, width)])
            };
            (row.first..row.end).flat_map(of_row).collect()
        };
        let piece = Model {
            width: column.len(),
            height: row.len(),
            channels: input.image.channels.iter().map(cut).collect(),
            mask: mask.as_ref().map(cut),
            ..model.clone()
        };
        if piece.mask.as_ref().is_some_and(|mask| !mask.iter().any(|m| *m > 0.0)) {
            let (i, j) = (row.taken[0], column.taken[0]);
            let text = format!("no pixel was measured in the part from row {i}, column {j} on; give a larger --tile");
            return Err(RestoreError(text));
        }
        if let Some((status, reason)) = ended(settings, hooks, began) {
            add(&mut tiled.image, [row, column], scale, &repeated(&piece));
            tiled.ends(status, reason);
            unreached += 1;
            continue;
        }
        let run = run_model(&piece, settings, hooks, began, Part { index: part, truth: None })?;
        add(&mut tiled.image, [row, column], scale, &run.planes);
        let outcome = run.outcome;
        if outcome.status == Status::Converged {
            done += 1;
        } else {
            tiled.ends(outcome.status, format!("part {part}: {}", outcome.reason));
        }
        tiled.iterations += outcome.iterations;
        tiled.proposals = [tiled.proposals[0] + outcome.accepted, tiled.proposals[1] + outcome.rejected];
        tiled.field = [tiled.field[0].max(run.field[0]), tiled.field[1].max(run.field[1])];
        for (most, of) in tiled.residuals.iter_mut().zip([run.residuals.primal, run.residuals.dual]) {
            *most = finite(of).map_or(*most, |v| Some(most.map_or(v, |m: f64| m.max(v))));
        }
        all_bound &= run.gap.is_some();
        tiled.gap = match (tiled.gap, run.gap) {
            (Some(most), Some(gap)) if gap.relative() <= most.relative() => Some(most),
            (most, gap) => gap.or(most),
        };
    }
    tiled.gap = tiled.gap.filter(|_| all_bound && unreached == 0);
    tiled.reason = match (tiled.status, tiled.gap) {
        (Status::Converged, Some(gap)) => {
            format!("all {done} parts converged; the largest gap of one is {:.2e} of its objective", gap.relative())
        }
        (Status::Converged, None) => format!("all {done} parts converged"),
        _ => {
            let seen = if unreached == 0 { String::new() } else { format!(", {unreached} are as they were seen") };
            format!("{done} of {} parts converged{seen}; {}", tiled.parts, tiled.reason)
        }
    };
    Ok(tiled)
}

/// Whether the user has asked for the end, or time is up.
fn ended(settings: &RestoreSettings, hooks: &Hooks<'_>, began: Instant) -> Option<(Status, String)> {
    if hooks.cancel.load(Ordering::Relaxed) {
        return Some((Status::Cancelled, "cancelled by the user".to_string()));
    }
    let limit = settings.time_limit.filter(|limit| began.elapsed().as_secs_f64() >= *limit)?;
    Some((Status::Stopped, format!("{limit} seconds are over (--time-limit)")))
}

/// What was seen, each pixel `scale` times in each direction.
fn repeated(piece: &Model) -> Vec<Vec<f64>> {
    let (w, h, s) = (piece.width, piece.height, piece.scale);
    let of = |plane: &Vec<f64>| (0..w * h * s * s).map(|k| plane[k / (w * s) / s * w + k % (w * s) / s]).collect();
    piece.channels.iter().map(of).collect()
}

/// A part by its weights.
fn add(image: &mut Image, [row, column]: [&Span; 2], scale: usize, planes: &[Vec<f64>]) {
    let (part, width) = (column.len() * scale, image.width);
    // Of the middle of a pixel, in pixels of what was seen.
    let at = |k: usize| (k as f64 + 0.5) / scale as f64;
    let place = |k: usize, span: &Span| (k as isize - span.first * scale as isize) as usize;
    let taken = |span: &Span| span.taken[0] * scale..span.taken[1] * scale;
    let weights: Vec<f64> = taken(column).map(|j| column.weight(at(j))).collect();
    for (to, from) in image.channels.iter_mut().zip(planes) {
        for i in taken(row) {
            let down = row.weight(at(i));
            let from = &from[place(i, row) * part + place(taken(column).start, column)..][..weights.len()];
            let to = &mut to[i * width + taken(column).start..][..weights.len()];
            to.iter_mut().zip(from).zip(&weights).for_each(|((to, v), w)| *to += down * w * v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_small_enough_and_weights_sum_up_to_one() {
        for beyond in [Beyond::Nothing, Beyond::Image] {
            for (n, side, margin) in
                [(400, 240, 60), (2000, 256, 64), (1513, 512, 57), (241, 240, 60), (1, 240, 60), (200, 240, 60)]
            {
                let spans = spans(n, side, margin, beyond);
                let whole = spans.len() == 1;
                for s in &spans {
                    assert!(s.len() <= side && s.len() > 0, "{n}: {spans:?}");
                    // What is taken lies inside, away from where nothing is known.
                    let inside = |first: bool| beyond == Beyond::Nothing && first;
                    let before = s.taken[0] as isize - s.first;
                    let after = s.end - s.taken[1] as isize;
                    assert!(inside(s.rise.is_none()) && before == 0 || before >= (margin - BLEND) as isize, "{s:?}");
                    assert!(inside(s.fall.is_none()) && after == 0 || after >= (margin - BLEND) as isize, "{s:?}");
                }
                assert!(whole == (n + if beyond == Beyond::Nothing { 0 } else { 2 * margin } <= side));
                for k in 0..4 * n {
                    let at = (k as f64 + 0.5) / 4.0;
                    let taken = |s: &&Span| s.taken[0] as f64 <= at && at <= s.taken[1] as f64;
                    let sum: f64 = spans.iter().filter(taken).map(|s| s.weight(at)).sum();
                    assert!((sum - 1.0).abs() < 1e-12, "{n}, {at}: {sum} of {spans:?}");
                    assert!(spans.iter().all(|s| (0.0..=1.0).contains(&s.weight(at))));
                    assert!(spans.iter().filter(|s| !taken(s)).all(|s| s.weight(at) == 0.0));
                }
            }
        }
    }

    #[test]
    fn what_is_beyond_is_the_image_again() {
        let row: Vec<usize> = (-5..8).map(|at| Beyond::Image.pixel(at, 3)).collect();
        assert_eq!(row, [1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]);
    }

    #[test]
    fn only_large_images_are_cut_unless_asked() {
        let image = |w: usize, h: usize| Image::new(w, h, vec![vec![0.5; w * h]]).unwrap();
        let model = |w, h| Model::new(&image(w, h), proxel_imaging::Psf::identity(), Edges::Unknown, 1.0);
        assert_eq!(side(&model(600, 400), None), None);
        assert_eq!((side(&model(600, 400), Some(600)), side(&model(600, 400), Some(599))), (None, Some(599)));
        // 400 bytes a pixel: 10.7 million pixels are 4 GiB.
        assert_eq!(side(&model(3500, 3000), None), None);
        let found = side(&model(3500, 3100), None).unwrap();
        assert!(found < 3500 && (found * found) as f64 * 400.0 <= MEMORY);
    }
}
