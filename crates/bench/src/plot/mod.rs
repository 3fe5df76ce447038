//! Line plots as SVG: panels side by side, a legend below, colours that the colour-blind can tell apart.

mod axis;

pub use axis::Axis;

use crate::BenchError;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;

/// A curve.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its name in the legend.
    pub label: String,
    /// Its points; those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
    /// Its colour and stroke: curves of the same style have the same label in every panel.
    pub style: usize,
    /// Whether its points are marked.
    pub marked: bool,
}

/// One diagram.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What it shows.
    pub title: String,
    /// Name of the horizontal axis.
    pub x_label: String,
    /// Name of the vertical axis.
    pub y_label: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Its curves.
    pub lines: Vec<Line>,
    /// Values on the cells of a square grid over the axes, drawn as a map below the curves.
    pub map: Option<Map>,
}

/// Values on the cells of a grid, drawn dark where they are low.
#[derive(Clone, Debug)]
pub struct Map {
    /// Cells a side.
    pub cells: usize,
    /// Row by row, lowest y first; 0 is drawn darkest, 1 and above lightest.
    pub values: Vec<f64>,
}

/// Okabe and Ito's colours, told apart with every kind of colour vision; yellow is left out on white.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
];

/// The backend draws on whole units: this many of them make a pixel, so that curves are smooth.
const UNITS: u32 = 4;
const PANEL: (u32, u32) = (520 * UNITS, 400 * UNITS);
const TITLE: u32 = 34 * UNITS;
const LEGEND_LINE: u32 = 24 * UNITS;
const FONT: &str = "sans-serif";

/// Units of pixels.
const fn units(pixels: i32) -> i32 {
    pixels * UNITS as i32
}

/// A font of a size in pixels.
fn font(pixels: u32) -> (&'static str, u32) {
    (FONT, pixels * UNITS)
}

/// Draws panels side by side, at most three a row, with one legend for all.
///
/// # Errors
/// A path that cannot be written.
pub fn write(path: &Path, title: &str, panels: &[Panel]) -> Result<(), BenchError> {
    let mut svg = String::new();
    draw(&mut svg, title, panels)
        .map_err(|e| BenchError(format!("{}: the plot cannot be drawn: {e}", path.display())))?;
    crate::table::write(path, &shown_in_pixels(&svg))
}

/// The drawing in units, shown in pixels: the view box stays, width and height shrink.
fn shown_in_pixels(svg: &str) -> String {
    let Some((head, body)) = svg.split_once("viewBox") else { return svg.to_string() };
    let sizes: Vec<u32> = head.split('"').filter_map(|word| word.parse().ok()).collect();
    match sizes[..] {
        [width, height] => format!("<svg width=\"{}\" height=\"{}\" viewBox{body}", width / UNITS, height / UNITS),
        _ => svg.to_string(),
    }
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

fn draw(svg: &mut String, title: &str, panels: &[Panel]) -> Drawn {
    let columns = panels.len().clamp(1, 3) as u32;
    let rows = (panels.len() as u32).div_ceil(columns).max(1);
    let legend = legend(panels);
    let a_line = names_a_line(&legend, columns);
    let legend_height = LEGEND_LINE * legend.len().div_ceil(a_line) as u32 + 8 * UNITS;
    let size = (columns * PANEL.0, TITLE + rows * PANEL.1 + legend_height);
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let (head, rest) = root.split_vertically(TITLE);
    let centred = font(20).into_font().color(&BLACK).pos(Pos::new(HPos::Center, VPos::Center));
    head.draw(&Text::new(title.to_string(), (size.0 as i32 / 2, TITLE as i32 / 2), centred))?;
    let (body, foot) = rest.split_vertically(rows * PANEL.1);
    for (area, panel) in body.split_evenly((rows as usize, columns as usize)).iter().zip(panels) {
        draw_panel(area, panel)?;
    }
    for (k, line) in legend.iter().enumerate() {
        let x = (k % a_line) as i32 * (size.0 as i32 / a_line as i32) + units(40);
        let y = (k / a_line) as i32 * LEGEND_LINE as i32 + units(12);
        for (from, to) in dashes(&[(x, y), (x + units(32), y)], line.style) {
            foot.draw(&PathElement::new([from, to], stroke(line.style)))?;
        }
        let text = font(14).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
        foot.draw(&Text::new(line.label.clone(), (x + units(40), y), text))?;
    }
    root.present()?;
    Ok(())
}

/// One line of each style, in the order in which they appear.
fn legend(panels: &[Panel]) -> Vec<&Line> {
    let mut lines: Vec<&Line> = Vec::new();
    for line in panels.iter().flat_map(|p| &p.lines) {
        if !line.label.is_empty() && lines.iter().all(|l| l.style != line.style) {
            lines.push(line);
        }
    }
    lines
}

/// How many names fit side by side, at the usual seven or eight pixels a letter.
fn names_a_line(legend: &[&Line], columns: u32) -> usize {
    let longest = legend.iter().map(|line| line.label.chars().count()).max().unwrap_or(0) as u32;
    (columns * PANEL.0 / ((90 + 8 * longest) * UNITS)).max(1) as usize
}

fn stroke(style: usize) -> ShapeStyle {
    COLORS[style % COLORS.len()].stroke_width(2 * UNITS)
}

fn draw_panel<DB: DrawingBackend>(area: &DrawingArea<DB, plotters::coord::Shift>, panel: &Panel) -> Drawn
where
    DB::ErrorType: 'static,
{
    // A map is to be as wide as it is high.
    let right = if panel.map.is_some() { 120 } else { 20 };
    let mut chart = ChartBuilder::on(area)
        .margin(units(10))
        .margin_right(units(right))
        .caption(&panel.title, font(16))
        .x_label_area_size(units(44))
        .y_label_area_size(units(66))
        .build_cartesian_2d(panel.x, panel.y)?;
    if let Some(map) = &panel.map {
        let (xs, ys) =
            (plotters::coord::ranged1d::Ranged::range(&panel.x), plotters::coord::ranged1d::Ranged::range(&panel.y));
        let at = |range: &std::ops::Range<f64>, k: usize| {
            range.start + (range.end - range.start) * k as f64 / map.cells as f64
        };
        chart.draw_series(map.values.iter().enumerate().map(|(k, v)| {
            let (i, j) = (k % map.cells, k / map.cells);
            // A cell reaches under the next ones, which are drawn over it: no seams.
            let next = |k: usize| (k + 2).min(map.cells);
            let corners = [(at(&xs, i), at(&ys, j)), (at(&xs, next(i)), at(&ys, next(j)))];
            Rectangle::new(corners, shade(*v).filled())
        }))?;
    }
    chart
        .configure_mesh()
        .x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .axis_desc_style(font(15))
        .label_style(font(13))
        .set_all_tick_mark_size(units(5))
        .axis_style(BLACK.stroke_width(UNITS))
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(if panel.map.is_some() { 0.0 } else { 0.15 }).stroke_width(UNITS))
        .draw()?;
    for line in &panel.lines {
        let finite: Vec<(f64, f64)> =
            line.points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
        // Dashes are cut where the curve is drawn, in pixels, so that they are as long everywhere.
        let pixels: Vec<(i32, i32)> = thin(&finite, panel).iter().map(|p| chart.backend_coord(p)).collect();
        let inside = chart.plotting_area().get_pixel_range();
        let plain = area.strip_coord_spec();
        let (left, top) = plain.get_base_pixel();
        let local = |(x, y): (i32, i32)| (x - left, y - top);
        for (from, to) in dashes(&pixels, line.style) {
            if let Some((from, to)) = clip(from, to, &inside) {
                plain.draw(&PathElement::new([local(from), local(to)], stroke(line.style)))?;
            }
        }
        if line.marked {
            let color = COLORS[line.style % COLORS.len()];
            for p in pixels.iter().filter(|(x, y)| inside.0.contains(x) && inside.1.contains(y)) {
                plain.draw(&Circle::new(local(*p), units(4), color.filled()))?;
            }
        }
    }
    Ok(())
}

/// From dark blue to white.
fn shade(v: f64) -> RGBColor {
    let t = v.clamp(0.0, 1.0).sqrt();
    let mix = |dark: f64| (dark + (255.0 - dark) * t).round() as u8;
    RGBColor(mix(8.0), mix(48.0), mix(107.0))
}

/// Leaves out points that would fall on the pixel of the one before.
fn thin(points: &[(f64, f64)], panel: &Panel) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for (k, (x, y)) in points.iter().copied().enumerate() {
        let far = kept.last().is_none_or(|(a, b)| {
            (panel.x.place(x) - panel.x.place(*a)).abs() > 2e-3 || (panel.y.place(y) - panel.y.place(*b)).abs() > 2e-3
        });
        if far || k + 1 == points.len() {
            kept.push((x, y));
        }
    }
    kept
}

/// Lengths of strokes and gaps of a style: solid, then dashed, then dotted, as the colours come round.
fn pattern(style: usize) -> &'static [f64] {
    match style / COLORS.len() % 3 {
        0 => &[],
        1 => &[9.0 * UNITS as f64, 5.0 * UNITS as f64],
        _ => &[2.0 * UNITS as f64, 4.0 * UNITS as f64],
    }
}

type Pixel = (i32, i32);

/// The strokes of a curve.
fn dashes(points: &[Pixel], style: usize) -> Vec<(Pixel, Pixel)> {
    let pattern = pattern(style);
    if pattern.is_empty() {
        return points.windows(2).map(|w| (w[0], w[1])).collect();
    }
    let mut strokes = Vec::new();
    let (mut part, mut left) = (0, pattern[0]);
    for w in points.windows(2) {
        let (a, b) = ((f64::from(w[0].0), f64::from(w[0].1)), (f64::from(w[1].0), f64::from(w[1].1)));
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        let at =
            |t: f64| ((a.0 + (b.0 - a.0) * t / length).round() as i32, (a.1 + (b.1 - a.1) * t / length).round() as i32);
        let mut from = 0.0;
        while from < length {
            let to = (from + left).min(length);
            if part % 2 == 0 {
                strokes.push((at(from), at(to)));
            }
            left -= to - from;
            from = to;
            if left <= 1e-9 {
                part = (part + 1) % pattern.len();
                left = pattern[part];
            }
        }
    }
    strokes
}

/// The part of a stroke inside the diagram (Liang and Barsky 1984).
fn clip(from: Pixel, to: Pixel, inside: &(std::ops::Range<i32>, std::ops::Range<i32>)) -> Option<(Pixel, Pixel)> {
    let (x, y) = (f64::from(from.0), f64::from(from.1));
    let (dx, dy) = (f64::from(to.0) - x, f64::from(to.1) - y);
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    let sides = [
        (-dx, x - f64::from(inside.0.start)),
        (dx, f64::from(inside.0.end) - x),
        (-dy, y - f64::from(inside.1.start)),
        (dy, f64::from(inside.1.end) - y),
    ];
    for (p, q) in sides {
        if p == 0.0 {
            if q < 0.0 {
                return None;
            }
        } else if p < 0.0 {
            first = first.max(q / p);
        } else {
            last = last.min(q / p);
        }
    }
    let at = |t: f64| ((x + t * dx).round() as i32, (y + t * dy).round() as i32);
    (first <= last).then(|| (at(first), at(last)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strokes_are_cut_at_the_border() {
        let inside = (0..10, 0..10);
        assert_eq!(clip((-5, 5), (15, 5), &inside), Some(((0, 5), (10, 5))));
        assert_eq!(clip((2, 3), (4, 5), &inside), Some(((2, 3), (4, 5))));
        assert_eq!(clip((-5, 20), (15, 20), &inside), None);
    }

    #[test]
    fn dashes_cover_nine_fourteenths() {
        let strokes = dashes(&[(0, 0), (units(100), 0), (units(140), 0)], COLORS.len());
        let drawn: i32 = strokes.iter().map(|(a, b)| b.0 - a.0).sum();
        assert_eq!(drawn, units(90));
    }

    #[test]
    fn a_plot_has_its_texts() {
        let line = Line { label: "curve".into(), points: vec![(1.0, 1.0), (10.0, 1e-3)], style: 0, marked: true };
        let panel = Panel {
            title: "panel".into(),
            x_label: "seconds".into(),
            y_label: "error".into(),
            x: Axis::log(1.0, 10.0),
            y: Axis::log(1e-3, 1.0),
            lines: vec![line],
            map: None,
        };
        let mut svg = String::new();
        draw(&mut svg, "all", &[panel]).expect("drawn into a string");
        let svg = shown_in_pixels(&svg);
        assert!(svg.starts_with("<svg width=\"520\" height=\"466\" viewBox=\"0 0 2080 1864\""), "{}", &svg[..90]);
        for text in ["curve", "panel", "seconds", "error", "all", "<circle"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
