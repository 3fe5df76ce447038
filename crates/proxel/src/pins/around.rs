//! What a pins file says beside groups: linear equalities and obstacles.

use std::collections::BTreeMap;

use proxel_split::Equality;
use serde::{Deserialize, Serialize};

use super::select::out_of_range;
use super::{HalfSpace, Index, InputError};

/// `[[equality]]`: sum_i a_i x_i = b over vertices, exactly.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EqualityRow {
    /// The vertices, 0-based.
    pub vertices: Vec<Index>,
    /// a, one number a vertex; all 1 where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coefficients: Option<Vec<f64>>,
    /// b; 0 where there is none.
    #[serde(default)]
    pub value: [f64; 3],
}

/// Everything beside groups.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Around {
    pub equalities: Vec<EqualityRow>,
    pub obstacles: Vec<HalfSpace>,
}

impl Around {
    pub fn is_empty(&self) -> bool {
        self.equalities.is_empty() && self.obstacles.is_empty()
    }

    /// What can be said without a mesh.
    pub fn check(&self, file: &str) -> Result<(), InputError> {
        for (k, row) in self.equalities.iter().enumerate() {
            let refuse =
                |what: &str, remedy: &str| Err(InputError::new(file, format!("equality {k} (0-based) {what}"), remedy));
            if row.vertices.is_empty() {
                return refuse("names no vertices", "add some or remove it");
            }
            let numbers = row.coefficients.iter().flatten().chain(&row.value);
            if let Some(bad) = numbers.clone().find(|a| !a.is_finite()) {
                return refuse(&format!("has the number {bad}"), "give a finite number");
            }
            if let Some(a) = row.coefficients.as_ref().filter(|a| a.len() != row.vertices.len()) {
                let (m, n) = (a.len(), row.vertices.len());
                return refuse(&format!("has {m} coefficients for {n} vertices"), "give one for each vertex");
            }
        }
        for (k, plane) in self.obstacles.iter().enumerate() {
            let finite = plane.point.iter().chain(&plane.normal).all(|x| x.is_finite());
            if !finite || plane.normal.iter().all(|x| *x == 0.0) {
                return Err(InputError::new(
                    file,
                    format!("obstacle {k} (0-based) has the point {:?} and the normal {:?}", plane.point, plane.normal),
                    "give finite numbers and a normal with a direction",
                ));
            }
        }
        Ok(())
    }

    /// The equalities over a body of `n` vertices; a vertex named twice has the sum of its coefficients.
    pub fn rows(&self, file: &str, n: usize) -> Result<Vec<Equality>, InputError> {
        let mut rows = Vec::new();
        for (k, row) in self.equalities.iter().enumerate() {
            let mut sums: BTreeMap<u32, f64> = BTreeMap::new();
            for (i, v) in row.vertices.iter().enumerate() {
                if v.0 as usize >= n {
                    return Err(out_of_range(file, v.0, n, &format!("equality {k} (0-based): ")));
                }
                *sums.entry(v.0).or_default() += row.coefficients.as_ref().map_or(1.0, |a| a[i]);
            }
            if sums.values().all(|a| *a == 0.0) {
                let what = format!("equality {k} (0-based) has coefficients that are or add up to 0");
                return Err(InputError::new(file, what, "give some vertex a coefficient or remove it"));
            }
            rows.push(Equality { nodes: sums.into_iter().collect(), value: row.value });
        }
        Ok(rows)
    }
}
