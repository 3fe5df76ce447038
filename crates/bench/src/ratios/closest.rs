//! Nearest points of a reference surface: from where they were, and from the top, against parry's tree.

use super::{Row, Samples, Threshold};
use crate::BenchError;
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::TriMesh;
use proxel::mesh::generate;
use proxel::mesh::topology::boundary_surface;
use proxel::model::constraint::{Closest, Hint, Surface, V3};
use proxel_testkit::random::SplitMix;
use std::hint::black_box;
use std::path::PathBuf;

/// Points: the vertices of the wire mesh of Figure 9 of Zhang et al. 2019.
const POINTS: usize = 230_400;
/// Steps of the points between two queries, over the distance between neighbours: of the first iterations, and of later ones.
const STEPS: [f64; 2] = [0.1, 0.003];
/// Distances from the surface over the same.
const OFF: f64 = 0.05;

struct Reference {
    name: String,
    points: Vec<V3>,
    triangles: Vec<[u32; 3]>,
}

/// The reference of the wire mesh; the skin of a ball where there is none.
fn reference() -> Result<Reference, BenchError> {
    let file = std::env::var_os("PROXEL_DATA").map(|root| PathBuf::from(root).join("geometry/MaleTorso_target.obj"));
    if let Some(file) = file.filter(|file| file.is_file()) {
        let mesh = super::read(&file)?;
        return Ok(Reference { name: mesh.name.clone(), triangles: mesh.faces.fan_triangles(), points: mesh.points });
    }
    let ball = generate::ball(1.0, 0.03).map_err(BenchError::from_display)?;
    Ok(Reference { name: "ball".to_string(), triangles: boundary_surface(&ball.tets), points: ball.points })
}

impl Reference {
    /// Points near to it, those of a triangle next to each other, and the distance between neighbours.
    fn queries(&self, random: &mut SplitMix) -> (Vec<V3>, f64) {
        let corners = |t: &[u32; 3]| t.map(|v| self.points[v as usize]);
        let sub = |a: V3, b: V3| [0, 1, 2].map(|d| a[d] - b[d]);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = corners(t);
            let (u, v) = (sub(b, a), sub(c, a));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            0.5 * n.iter().map(|c| c * c).sum::<f64>().sqrt()
        };
        let spacing = (self.triangles.iter().map(area).sum::<f64>() / POINTS as f64).sqrt();
        let point = |i: usize| {
            let [a, b, c] = corners(&self.triangles[i * self.triangles.len() / POINTS]);
            let (s, t) = (random.uniform(0.0, 1.0), random.uniform(0.0, 1.0));
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            let off: V3 = random.array(-OFF * spacing, OFF * spacing);
            [0, 1, 2].map(|d| a[d] + s * (b[d] - a[d]) + t * (c[d] - a[d]) + off[d])
        };
        ((0..POINTS).map(point).collect(), spacing)
    }
}

pub(super) fn rows(repeats: usize) -> Result<Vec<Row>, BenchError> {
    let reference = reference()?;
    let surface = Surface::new(&reference.points, &reference.triangles).map_err(BenchError::from_display)?;
    let own = |p: &V3| Vector::new(p[0], p[1], p[2]);
    let theirs = TriMesh::new(reference.points.iter().map(own).collect(), reference.triangles.clone())
        .map_err(BenchError::from_display)?;
    let mut random = SplitMix::new(1);
    let (mut points, spacing) = reference.queries(&mut random);
    let mut hints = vec![Hint::default(); POINTS];
    let mut last = vec![0_u32; POINTS];
    let mut rows = Vec::new();
    for step in STEPS {
        let [mut cold, mut warm, mut parry, mut bounded] = [(); 4].map(|()| Samples::default());
        // The first one only fills the hints.
        for repeat in 0..=repeats.div_ceil(3) {
            let mut ours = Samples::default();
            let found: Vec<V3> =
                ours.time(|| points.iter().zip(&mut hints).map(|(x, hint)| surface.closest_from(*x, hint)).collect());
            let mut unaided = Samples::default();
            let again: Vec<V3> = unaided.time(|| points.iter().map(|x| surface.closest(*x)).collect());
            if found != again {
                return Err(BenchError("nearest points depend on where the search starts".to_string()));
            }
            let mut other = Samples::default();
            other.time(|| {
                for x in &points {
                    black_box(theirs.project_local_point_and_get_location(own(x), false));
                }
            });
            let mut limited = Samples::default();
            limited.time(|| {
                for (x, last) in points.iter().zip(&mut last) {
                    // The triangle of before bounds the distance.
                    let near = theirs.triangle(*last).project_local_point_and_get_location(own(x), false).0.point;
                    let bound = (near - own(x)).length() * (1.0 + 1e-12) + f64::MIN_POSITIVE;
                    if let Some((point, (triangle, _))) =
                        theirs.project_local_point_and_get_location_with_max_dist(own(x), false, bound)
                    {
                        *last = triangle;
                        black_box(point);
                    }
                }
            });
            if repeat > 0 {
                warm.append(ours);
                cold.append(unaided);
                parry.append(other);
                bounded.append(limited);
            }
            for x in &mut points {
                let way: V3 = random.array(-step * spacing, step * spacing);
                (0..3).for_each(|d| x[d] += way[d]);
            }
        }
        let name = format!("{POINTS} points near {} ({} triangles)", reference.name, reference.triangles.len());
        let mut row = |what: &str, samples: &Samples, threshold| {
            rows.push(Row {
                quantity: format!("nearest points, {what}: {name}, steps {step} of their distance"),
                against: format!("parry, from the top: {}", parry.milliseconds()),
                figures: samples.milliseconds(),
                ratio: Some(samples.least() / parry.least()),
                of_medians: Some(samples.median() / parry.median()),
                threshold,
            });
        };
        row("from where they were", &warm, Some(Threshold::AtMost(1.0)));
        row("from the top", &cold, None);
        row("parry, bounded by the triangle of before", &bounded, None);
    }
    Ok(rows)
}
