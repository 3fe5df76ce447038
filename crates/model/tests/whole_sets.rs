//! Sets of one's own are the built-in ones, where they are the same.

use proxel_linalg::sparse::SymPattern;
use proxel_model::constraint::{Batch, Cells, Hold, MeanCentred, Planar, Projection, Set, V3, Whole};
use proxel_split::{Cycle, Order, Term};
use proxel_testkit::SplitMix as Random;
use std::sync::Arc;

struct Planes;
impl Projection for Planes {
    fn project(&self, rows: &mut [V3]) {
        rows.chunks_exact_mut(4).for_each(|v| Planar.project(0, v));
    }
}

/// Two quads that share an edge; all but the last node free.
const NODES: [u32; 8] = [0, 1, 2, 3, 3, 2, 4, 5];

#[test]
fn it_is_the_batch_of_the_same_sets() {
    let mut random = Random::new(4);
    for hold in [Hold::Hard(3.0), Hold::Soft(0.7)] {
        let cells = Cells::<MeanCentred, _>::new(NODES.to_vec(), 4, Planar).unwrap();
        let mut batch = Batch::new(Arc::new(cells), hold);
        let mut whole = Whole::<MeanCentred>::new(NODES.to_vec(), 4, Arc::new(Planes), hold, 1.0).unwrap();
        assert_eq!((whole.local_len(), whole.local_dim()), (batch.local_len(), batch.local_dim()));
        let numbers =
            |random: &mut Random, n: usize| -> Vec<f64> { (0..n).map(|_| random.uniform(-1.0, 1.0)).collect() };
        for order in [Order::Xzu, Order::Zxu] {
            for relaxation in [1.0, 1.6] {
                let x = numbers(&mut random, 18);
                let (p, u) = (numbers(&mut random, 24), numbers(&mut random, 24));
                let run = |term: &mut dyn Term| {
                    let (mut p, mut u, mut grad) = (p.clone(), u.clone(), vec![0.1; 15]);
                    let report = term.cycle_step(&Cycle { order, relaxation }, &x, &mut p, &mut u, &mut grad);
                    let residual = term.residual(&x, &p, &u);
                    let mut slope = vec![0.2; 15];
                    let energy = term.energy(&x, Some(&mut slope));
                    let mut penalty = vec![0.3; 15];
                    let value = term.penalty(&x, &p, &mut penalty).value;
                    let mut out = [p, u, grad, slope, penalty].concat();
                    out.extend([report.penalty_before, report.penalty_after, report.objective, report.moved2]);
                    out.extend([report.gap2, report.gap2_before, residual.gap2, residual.size2, energy.value, value]);
                    // The violation of a plane is a height, that of a set of one's own the way of all corners.
                    assert!((energy.violation == 0.0) == (hold == Hold::Soft(0.7)));
                    out
                };
                for (i, (a, b)) in run(&mut whole).iter().zip(run(&mut batch)).enumerate() {
                    assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{hold:?} {order:?} {i}: {a} {b}");
                }
            }
        }
        let pattern = SymPattern::from_cliques(5, &[vec![0u32, 1, 2, 3], vec![3, 2, 4]]).unwrap();
        let normal = |term: &dyn Term| {
            let mut values = vec![0.0; pattern.nnz()];
            term.add_normal(&pattern, &mut values);
            values
        };
        assert_eq!(normal(&whole), normal(&batch));
    }
}

#[test]
fn elements_that_are_none_are_refused() {
    assert!(Whole::<MeanCentred>::new(vec![0, 1, 2], 4, Arc::new(Planes), Hold::Hard(1.0), 1.0).is_err());
    let split = Hold::Split { weight: 1.0, mu: 1.0 };
    assert!(Whole::<MeanCentred>::new(NODES.to_vec(), 4, Arc::new(Planes), split, 1.0).is_err());
}
