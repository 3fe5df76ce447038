//! How forces answer to what they depend on, against differences of the forces that the kernels of batches compute.

use proxel_model::elements::{Batch, BatchShape, BatchWeights, Flattened, Step, batch};
use proxel_model::energy::{Lame, names};
use proxel_split::vector::dot;
use proxel_testkit::check_gradient;
use proxel_testkit::random::SplitMix as Random;

/// Two elements that share a face, numbers a node, and corners an element.
fn cases() -> Vec<(BatchShape, usize, usize, usize, Vec<u32>)> {
    vec![
        (BatchShape::Tetrahedra, 3, 3, 5, vec![0, 1, 2, 3, 1, 2, 3, 4]),
        (BatchShape::Triangles, 3, 2, 4, vec![0, 1, 2, 2, 1, 3]),
        (BatchShape::PlanarTriangles, 2, 2, 4, vec![0, 1, 2, 2, 1, 3]),
        (BatchShape::Springs, 3, 1, 3, vec![0, 1, 1, 2]),
        (BatchShape::PlanarSprings, 2, 1, 3, vec![0, 1, 1, 2]),
    ]
}

/// Corners of a cube and its middle, so that all elements above have a positive measure.
const PLACES: [[f64; 3]; 5] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.1, 1.1, 0.0], [0.0, 0.2, 0.9], [1.0, 0.9, 1.1]];
const FLAT: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.1, 1.1, 0.0], [1.2, 0.9, 0.0]];

fn places(shape: BatchShape, dim: usize, n: usize) -> Vec<f64> {
    let of: &[[f64; 3]] = if shape == BatchShape::PlanarTriangles { &FLAT } else { &PLACES };
    of[..n].iter().flat_map(|p| &p[..dim]).copied().collect()
}

const FILL: [f64; 2] = [0.7, 1.3];
const PER_MEASURE: [f64; 2] = [0.4, -1.1];

/// w . grad E, from the batch.
fn power(of: &Step<'_>, centers: &[[f64; 3]]) -> f64 {
    let flattened = of.shapes.map(|shapes| Flattened { shapes, centers, n_nodes: of.x.len() / 2 });
    let (mut term, _) = batch(&Batch {
        shape: of.shape,
        positions: of.positions,
        flattened,
        elements: of.elements,
        fill: of.fill,
        energy: of.energy,
        lame: of.lame,
        limits: None,
        rotation_aware: false,
        singular_values: false,
        weights: &|s| BatchWeights { base: s.largest, softening: 1.0 },
    })
    .unwrap();
    let mut grad = vec![0.0; of.x.len()];
    term.energy(of.x, Some(&mut grad));
    dot(&grad, of.w)
}

#[test]
fn it_is_the_derivative_of_the_forces_along_the_step() {
    let mut random = Random::new(5);
    let lame = Lame::new(2.0, 3.0).unwrap();
    for (shape, dim, k, n, elements) in cases() {
        for name in names(k) {
            let rest = places(shape, dim, n);
            let x: Vec<f64> = rest.iter().map(|v| 1.15 * v + random.uniform(-0.1, 0.1)).collect();
            let w: Vec<f64> = rest.iter().map(|_| random.uniform(-1.0, 1.0)).collect();
            let step = Step {
                shape,
                positions: &rest,
                shapes: None,
                elements: &elements,
                fill: Some(&FILL),
                per_measure: None,
                energy: name,
                lame: &lame,
                x: &x,
                w: &w,
            };
            let found = step.sensitivity().unwrap();
            let told = |what: &str, e: &dyn std::fmt::Display| -> ! { panic!("{shape:?} {name}: {what}: {e}") };
            check_gradient(|x| power(&Step { x, ..step }, &[]), &found.x, &x, 1e-3, 1e-7)
                .unwrap_or_else(|e| told("x", &e));
            check_gradient(|rest| power(&Step { positions: rest, ..step }, &[]), &found.rest, &rest, 1e-3, 1e-7)
                .unwrap_or_else(|e| told("rest", &e));
            let moduli = |m: &[f64]| power(&Step { lame: &Lame::new(m[0], m[1]).unwrap(), ..step }, &[]);
            check_gradient(moduli, &[found.mu, found.lambda], &[2.0, 3.0], 1e-3, 1e-8)
                .unwrap_or_else(|e| told("moduli", &e));
        }
    }
}

#[test]
fn what_moves_with_the_measure_counts() {
    for (shape, dim, k, n, elements) in cases() {
        let (rest, lame) = (places(shape, dim, n), Lame::new(2.0, 3.0).unwrap());
        // No power without a step: what is left is sum c V.
        let w = vec![0.0; rest.len()];
        let step = Step {
            shape,
            positions: &rest,
            shapes: None,
            elements: &elements,
            fill: None,
            per_measure: Some(&PER_MEASURE),
            energy: names(k)[0],
            lame: &lame,
            x: &rest,
            w: &w,
        };
        let found = step.sensitivity().unwrap();
        let at = |x: &[f64], v: u32| -> [f64; 3] {
            std::array::from_fn(|d| if d < dim { x[v as usize * dim + d] } else { 0.0 })
        };
        let measure = |x: &[f64], e: &[u32]| -> f64 {
            let edge = |i: usize| {
                let (a, b) = (at(x, e[0]), at(x, e[i]));
                [b[0] - a[0], b[1] - a[1], b[2] - a[2]]
            };
            let cross = |a: [f64; 3], b: [f64; 3]| {
                [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
            };
            let norm = |a: [f64; 3]| dot(&a, &a).sqrt();
            match k {
                1 => norm(edge(1)),
                2 => norm(cross(edge(1), edge(2))) / 2.0,
                _ => dot(&edge(1), &cross(edge(2), edge(3))) / 6.0,
            }
        };
        let sum = |x: &[f64]| elements.chunks(k + 1).zip(PER_MEASURE).map(|(e, c)| c * measure(x, e)).sum();
        check_gradient(sum, &found.rest, &rest, 1e-3, 1e-8).unwrap_or_else(|e| panic!("{shape:?}: {e}"));
        assert!(found.x.iter().all(|v| *v == 0.0));
    }
}

#[test]
fn triangles_may_have_rest_shapes_of_their_own() {
    let shapes = [[[1.0, 0.3], [0.0, 0.8]], [[0.7, -0.2], [0.1, 1.1]]];
    let (lame, elements) = (Lame::new(4.0, 0.0).unwrap(), [0, 1, 2, 2, 1, 3]);
    let x = places(BatchShape::PlanarTriangles, 2, 4);
    let w: Vec<f64> = (0..8).map(|i| f64::from(i * i % 7) - 3.0).collect();
    let step = Step {
        shape: BatchShape::PlanarTriangles,
        positions: &[],
        shapes: Some(&shapes),
        elements: &elements,
        fill: Some(&FILL),
        per_measure: None,
        energy: "symmetric-dirichlet",
        lame: &lame,
        x: &x,
        w: &w,
    };
    let found = step.sensitivity().unwrap();
    let phi = |flat: &[f64]| {
        let shape = |e: usize| [[flat[4 * e], flat[4 * e + 1]], [flat[4 * e + 2], flat[4 * e + 3]]];
        power(&Step { shapes: Some(&[shape(0), shape(1)]), ..step }, &[[0.0; 3]; 2])
    };
    let flat = shapes.as_flattened().as_flattened();
    let gradient = found.shapes.as_flattened().as_flattened();
    check_gradient(phi, gradient, flat, 1e-3, 1e-7).unwrap();
    assert!(found.rest.is_empty());
}
