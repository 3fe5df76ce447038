//! Charts of shapes with every defect, held against a check that knows nothing of half-edges.

mod bad_inputs;
mod relief;
mod shapes;
mod soups;
mod splits;
mod topology;
mod tubes;
mod twin;

use super::*;

/// Charts of a mesh that must have some, each checked by the twin, with what every result must keep.
fn charted(mesh: &Mesh) -> Charts {
    with_seams(mesh, &[])
}

fn with_seams(mesh: &Mesh, seams: &[[u32; 2]]) -> Charts {
    let options = ChartOptions { seams: seams.to_vec(), ..ChartOptions::default() };
    let out = charts(mesh, &options).unwrap();
    twin::check_all(mesh, &out);
    out
}

/// The numbers of loops of the charts.
fn loops(charts: &Charts) -> Vec<usize> {
    charts.charts.iter().map(|c| c.loops.len()).collect()
}
