//! The empty space around a map, triangulated: what keeps borders from crossing.

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
            let p = space.vertex(spade::handles::FixedVertexHandle::from_index(v)).position();
            [p.x, p.y]
        };
        let points = (n_fixed..space.num_vertices()).chain(border.len()..n_fixed).map(place).collect();
        let mut seen = vec![false; space.num_all_faces()];
        let mut open = Vec::new();
        for [a, b] in edges {
            let [a, b] = [*a, *b].map(spade::handles::FixedVertexHandle::from_index);
            // The box runs around the empty space, borders around the map.
            let inside = if a.index() < border.len() { (b, a) } else { (a, b) };
            open.push(space.get_edge_from_neighbors(inside.0, inside.1)?.face());
        }
        let mut triangles = Vec::new();
        while let Some(face) = open.pop() {
            let Some(face) = face.as_inner() else { return None };
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
