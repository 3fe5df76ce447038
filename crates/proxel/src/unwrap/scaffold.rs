//! The empty space around a map, triangulated: what keeps borders from crossing.

use super::chart::ChartInput;
use super::flat::{Flat, flips};
use super::order::Order;
use super::problem;
use crate::settings::UnwrapSettings;
use proxel_model::elements::{Batch, BatchShape, BatchWeights, Flattened, batch};
use proxel_model::energy::{Energy, Lame, SymmetricDirichlet};
use proxel_split::{Problem, Quadratic, SystemError};
use spade::handles::FixedVertexHandle;
use spade::{
    AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation, mitigate_underflow,
};

/// The box stands off the map by this part of the map's longer side.
const MARGIN: f64 = 0.5;

/// Edges along a side of the box.
const SIDE: usize = 8;

/// Angles below this are refined where borders leave room, in degrees.
const ANGLE: f64 = 22.0;

/// Triangles smaller than this part of an equilateral one over the mean border edge are not refined.
const SMALL: f64 = 0.1;

/// New vertices for each vertex of the border, at most.
const GROWTH: usize = 10;

/// The triangulated space between a map and a box around it, holes of the map included. Its triangles are
/// counter-clockwise, and with the map's they cover the box once: as long as none of them all is flipped and the box
/// stays, the map is bijective (Jiang, Schaefer and Panozzo 2017, section 3).
pub(super) struct Scaffold {
    /// Vertices besides the map's: `n_free` in the empty space, then those of the box.
    pub points: Vec<[f64; 2]>,
    /// How many of them are not on the box.
    pub n_free: usize,
    /// A number below that of the map's vertices is one of these; vertices of the scaffold come after them.
    pub triangles: Vec<[u32; 3]>,
}

impl Scaffold {
    /// Around a map whose borders `loops` have the map to the left; none where they cross or touch.
    pub fn around(uv: &[[f64; 2]], loops: &[Vec<u32>]) -> Option<Self> {
        let border: Vec<u32> = loops.concat();
        let mut points: Vec<Point2<f64>> = border.iter().map(|v| point(uv[*v as usize])).collect();
        let mut edges = Vec::with_capacity(border.len() + 4 * SIDE);
        ring(loops.iter().map(|l| l.len()), &mut edges);
        let outline = edges.len();
        points.extend(frame(uv)?);
        ring([4 * SIDE].into_iter(), &mut edges);
        for edge in &mut edges[outline..] {
            *edge = edge.map(|v| v + border.len());
        }
        let area = SMALL * 0.25 * 3f64.sqrt() * mean_edge(uv, loops).powi(2);
        let n_fixed = points.len();
        let mut crossed = false;
        let mut space: ConstrainedDelaunayTriangulation<Point2<f64>> =
            ConstrainedDelaunayTriangulation::try_bulk_load_cdt(points, edges.clone(), |_| crossed = true).ok()?;
        if crossed || space.num_vertices() != n_fixed || space.num_constraints() != edges.len() {
            return None;
        }
        space.refine(
            RefinementParameters::new()
                .exclude_outer_faces(true)
                .keep_constraint_edges()
                .with_angle_limit(AngleLimit::from_deg(ANGLE))
                .with_min_required_area(area)
                .with_max_additional_vertices(GROWTH * n_fixed),
        );
        Self::collect(&space, &border, uv.len(), &edges)
    }

    /// The faces that can be reached from the outer side of a border or from the box.
    fn collect(
        space: &ConstrainedDelaunayTriangulation<Point2<f64>>,
        border: &[u32],
        n: usize,
        edges: &[[usize; 2]],
    ) -> Option<Self> {
        let n_fixed = border.len() + 4 * SIDE;
        let n_free = space.num_vertices() - n_fixed;
        let number = |v: usize| match v {
            v if v < border.len() => border[v],
            v if v < n_fixed => (n + n_free + v - border.len()) as u32,
            v => (n + v - n_fixed) as u32,
        };
        let place = |v: usize| {
            let p = space.vertex(FixedVertexHandle::from_index(v)).position();
            [p.x, p.y]
        };
        let points = (n_fixed..space.num_vertices()).chain(border.len()..n_fixed).map(place).collect();
        let mut seen = vec![false; space.num_all_faces()];
        let mut open = Vec::new();
        for [a, b] in edges {
            let [a, b] = [*a, *b].map(FixedVertexHandle::from_index);
            // The box runs around the empty space, borders around the map.
            let inside = if a.index() < border.len() { (b, a) } else { (a, b) };
            open.push(space.get_edge_from_neighbors(inside.0, inside.1)?.face());
        }
        let mut triangles = Vec::new();
        while let Some(face) = open.pop() {
            let face = face.as_inner()?;
            if std::mem::replace(&mut seen[face.fix().index()], true) {
                continue;
            }
            triangles.push(face.vertices().map(|v| number(v.index())));
            for edge in face.adjacent_edges().into_iter().filter(|e| !e.is_constraint_edge()) {
                open.push(edge.rev().face());
            }
        }
        Some(Scaffold { points, n_free, triangles })
    }

    /// The place of a vertex of map or scaffold among the nodes of the solver: free ones of the map, free ones of the
    /// scaffold, fixed ones of the map, the box.
    fn node(&self, order: &Order, v: u32) -> u32 {
        let n = order.number.len();
        match v as usize {
            v if v < n => order.number[v],
            v if v < n + self.n_free => (order.between + v - n) as u32,
            _ => v,
        }
    }

    /// Whether a triangle has no positive area where the solver is at x, by exact arithmetic.
    pub fn is_flipped(&self, order: &Order, x: &[f64], uv: &[[f64; 2]]) -> bool {
        let place = |v: u32| {
            let at = 2 * self.node(order, v) as usize;
            [x[at], x[at + 1]]
        };
        let all: Vec<[f64; 2]> = (0..(uv.len() + self.points.len()) as u32).map(place).collect();
        flips(&self.triangles, &all) > 0
    }
}

/// The chart and its scaffold: to the energy of the chart comes the symmetric Dirichlet energy of the scaffold's triangles, each
/// with its present shape at rest and with the same weight, all together `weight` times the chart's (Jiang et al. 2017, eq. 3).
///
/// # Errors
/// A triangle of the scaffold that has no area in floating-point arithmetic.
pub(super) fn augmented(
    chart: &Flat<'_>,
    order: &Order,
    scaffold: &Scaffold,
    uv: &[[f64; 2]],
    input: &ChartInput<'_>,
    settings: &UnwrapSettings,
    weight: f64,
) -> Result<Problem, SystemError> {
    let n = uv.len();
    let total = n + scaffold.points.len();
    let (own, barrier) =
        problem::term(chart, order, total, input, settings).map_err(|e| SystemError::Factor(e.to_string()))?;
    let elements: Vec<u32> = scaffold.triangles.iter().flatten().map(|v| scaffold.node(order, *v)).collect();
    let mut x0 = order.solver(uv);
    x0.resize(2 * total, 0.0);
    for (v, p) in (n as u32..).zip(&scaffold.points) {
        x0[2 * scaffold.node(order, v) as usize..][..2].copy_from_slice(p);
    }
    let at = |v: u32| [x0[2 * v as usize], x0[2 * v as usize + 1]];
    let each = weight * own.scale().measure / scaffold.triangles.len() as f64;
    let (mut shapes, mut centers, mut fill) = (Vec::new(), Vec::new(), Vec::new());
    for t in elements.chunks_exact(3) {
        let [p, q, r] = [at(t[0]), at(t[1]), at(t[2])];
        let shape = [[q[0] - p[0], r[0] - p[0]], [q[1] - p[1], r[1] - p[1]]];
        let area = 0.5 * (shape[0][0] * shape[1][1] - shape[0][1] * shape[1][0]);
        shapes.push(shape);
        centers.push([(p[0] + q[0] + r[0]) / 3.0, (p[1] + q[1] + r[1]) / 3.0, 0.0]);
        fill.push(each / area);
    }
    let lame = Lame::new(problem::MODULUS, 0.0).map_err(|e| SystemError::Factor(e.to_string()))?;
    let (around, _) = batch(&Batch {
        shape: BatchShape::PlanarTriangles,
        positions: &[],
        flattened: Some(Flattened { shapes: &shapes, centers: &centers, n_nodes: total }),
        elements: &elements,
        fill: Some(&fill),
        energy: <SymmetricDirichlet as Energy<2>>::NAME,
        lame: &lame,
        limits: None,
        rotation_aware: true,
        singular_values: true,
        weights: &|stiffness| BatchWeights { base: stiffness.largest, softening: 1.0 },
    })
    .map_err(|e| SystemError::Factor(format!("the scaffold: {e}")))?;
    Ok(Problem {
        dim: 2,
        n_free: order.n_free + scaffold.n_free,
        x0,
        terms: vec![own, around],
        quadratic: Quadratic::default(),
        barrier,
    })
}

fn point(p: [f64; 2]) -> Point2<f64> {
    mitigate_underflow(Point2::new(p[0], p[1]))
}

/// Edges around loops of so many vertices each, numbered one after another.
fn ring(lengths: impl Iterator<Item = usize>, edges: &mut Vec<[usize; 2]>) {
    let mut first = 0;
    for n in lengths {
        edges.extend((0..n).map(|k| [first + k, first + (k + 1) % n]));
        first += n;
    }
}

/// A box around points, counter-clockwise.
fn frame(uv: &[[f64; 2]]) -> Option<Vec<Point2<f64>>> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in uv {
        for d in 0..2 {
            (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
        }
    }
    let margin = MARGIN * (high[0] - low[0]).max(high[1] - low[1]);
    let sound = margin > 0.0 && margin.is_finite();
    let (low, high) = (low.map(|v| v - margin), high.map(|v| v + margin));
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    let on = |k: usize| {
        let (a, b, t) = (corners[k / SIDE], corners[(k / SIDE + 1) % 4], (k % SIDE) as f64 / SIDE as f64);
        point([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])])
    };
    sound.then(|| (0..4 * SIDE).map(on).collect())
}

fn mean_edge(uv: &[[f64; 2]], loops: &[Vec<u32>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for l in loops {
        for (a, b) in l.iter().zip(l.iter().cycle().skip(1)) {
            let (a, b) = (uv[*a as usize], uv[*b as usize]);
            sum += (a[0] - b[0]).hypot(a[1] - b[1]);
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[[f64; 2]], t: &[u32; 3]) -> f64 {
        let [p, q, r] = t.map(|v| points[v as usize]);
        0.5 * ((q[0] - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (q[1] - p[1]))
    }

    fn circle(n: usize, radius: f64, turn: f64) -> Vec<[f64; 2]> {
        let angle = |k: usize| turn * 2.0 * std::f64::consts::PI * k as f64 / n as f64;
        (0..n).map(|k| [radius * angle(k).cos(), radius * angle(k).sin()]).collect()
    }

    #[test]
    fn map_and_scaffold_cover_the_box_once() {
        // A ring of inner radius 1 and outer radius 2: polygons of 24 and of 40 corners, the hole clockwise.
        let uv = [circle(40, 2.0, 1.0), circle(24, 1.0, -1.0)].concat();
        let loops = [(0..40).collect::<Vec<u32>>(), (40..64).collect()];
        let scaffold = Scaffold::around(&uv, &loops).expect("a simple border");
        let points = [&uv[..], &scaffold.points].concat();
        assert_eq!(flips(&scaffold.triangles, &points), 0);
        let polygon = |n: f64, r: f64| 0.5 * n * r * r * (2.0 * std::f64::consts::PI / n).sin();
        let ring = polygon(40.0, 2.0) - polygon(24.0, 1.0);
        // The longer side of the map is 4, so that the box has sides of 8.
        let covered: f64 = scaffold.triangles.iter().map(|t| area(&points, t)).sum();
        assert!((covered - (64.0 - ring)).abs() < 1e-9, "{covered}");
        let hole: f64 = scaffold
            .triangles
            .iter()
            .filter(|t| t.iter().all(|v| points[*v as usize][0].hypot(points[*v as usize][1]) < 1.5))
            .map(|t| area(&points, t))
            .sum();
        assert!((hole - polygon(24.0, 1.0)).abs() < 1e-9, "{hole}");
        // Free vertices come before those of the box, and lie within it.
        assert_eq!(scaffold.points.len() - scaffold.n_free, 4 * SIDE);
        let largest = |p: &[f64; 2]| p[0].abs().max(p[1].abs());
        assert!(scaffold.n_free > 0 && scaffold.points[..scaffold.n_free].iter().all(|p| largest(p) < 4.0));
        assert!(scaffold.points[scaffold.n_free..].iter().all(|p| (largest(p) - 4.0).abs() < 1e-12));
    }

    #[test]
    fn borders_that_cross_or_touch_have_none() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let loops = [vec![0, 1, 2, 3]];
        assert!(Scaffold::around(&square, &loops).is_some());
        let crossed = [square[0], square[2], square[1], square[3]];
        assert!(Scaffold::around(&crossed, &loops).is_none());
        let doubled = [square[0], square[1], square[2], square[1]];
        assert!(Scaffold::around(&doubled, &loops).is_none());
        // A corner on an edge.
        let touching = [square[0], square[1], square[2], [0.5, 0.0], square[3]];
        assert!(Scaffold::around(&touching, &[vec![0, 1, 2, 3, 4]]).is_none());
    }

    #[test]
    fn the_gradient_of_a_new_scaffold_is_zero() {
        // One triangle at rest in a box: nothing pulls.
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2, 0.9, 0.0]];
        let (triangles, loops) = ([[0, 1, 2]], [vec![0, 1, 2]]);
        let chart = Flat::new(&points, &triangles, &loops).expect("an area");
        let uv: Vec<[f64; 2]> = points.iter().map(|p| [p[0] * chart.scale, p[1] * chart.scale]).collect();
        let owned = proxel_mesh::charts::Chart {
            triangles: triangles.to_vec(),
            faces: vec![0],
            vertices: vec![0, 1, 2],
            loops: loops.to_vec(),
        };
        let input = ChartInput {
            chart: &owned,
            points: points.to_vec(),
            start: None,
            pins: Vec::new(),
            weights: None,
            metric: None,
        };
        let scaffold = Scaffold::around(&uv, &loops).expect("a simple border");
        let order = Order::new(&chart, &[0]).with_between(scaffold.n_free);
        let settings = UnwrapSettings::default();
        let mut problem = augmented(&chart, &order, &scaffold, &uv, &input, &settings, 0.25).expect("a problem");
        let x = problem.x0.clone();
        let mut gradient = vec![0.0; 2 * problem.n_free];
        let report = problem.energy(&x, Some(&mut gradient));
        assert_eq!((report.inverted, problem.n_free), (0, 2 + scaffold.n_free));
        assert!(report.value.abs() < 1e-12 && gradient.iter().all(|g| g.abs() < 1e-12), "{report:?}");
        // Fill times area over all of its triangles: the weight times the chart's area, 1.
        assert!((problem.terms[1].scale().measure - 0.25).abs() < 1e-12);
        assert!(!scaffold.is_flipped(&order, &x, &uv));
        let mut turned = x.clone();
        turned[2 * order.number[1] as usize] -= 3.0 * chart.scale;
        assert!(scaffold.is_flipped(&order, &turned, &uv));
    }
}
