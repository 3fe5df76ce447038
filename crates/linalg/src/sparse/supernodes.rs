//! Supernodes: columns of L with nested structure, and their relaxed amalgamation.

use super::etree::{NONE, children};

/// Supernodes as a forest. Columns are those of the postordered matrix.
pub(super) struct Supernodes {
    /// Columns of each supernode, in elimination order.
    pub columns: Vec<Vec<u32>>,
    /// Rows below the diagonal block.
    pub below: Vec<u32>,
    /// Parent supernode, or [`NONE`]; always a later one.
    pub parent: Vec<u32>,
}

/// A child is merged into its parent if the merged supernode has at most `.0` columns and the share of stored
/// zeros stays below `.1`: the rule of CHOLMOD and faer, a little stricter for narrow supernodes, which here may
/// merge with any child and not only with the last one.
const RELAX: [(usize, f64); 4] = [(4, 1.0), (16, 0.5), (48, 0.1), (usize::MAX, 0.05)];

fn may_merge(columns: usize, zeros: f64, size: f64) -> bool {
    let share = zeros / size;
    RELAX.iter().any(|&(most, limit)| columns <= most && share < limit)
}

/// Entries of a trapezoid of w columns over r rows.
pub(super) fn trapezoid(w: usize, r: usize) -> f64 {
    w as f64 * (w as f64 + 1.0) / 2.0 + w as f64 * r as f64
}

impl Supernodes {
    /// Fundamental supernodes of a postordered matrix, then merged with their children where that costs few zeros.
    pub fn find(parent: &[u32], counts: &[u32]) -> Self {
        let n = parent.len();
        let mut of = vec![0u32; n];
        let mut first = Vec::new();
        for j in 0..n {
            let joins = j > 0 && parent[j - 1] == j as u32 && counts[j - 1] == counts[j] + 1;
            if !joins {
                first.push(j);
            }
            of[j] = first.len() as u32 - 1;
        }
        let ns = first.len();
        first.push(n);
        let mut width: Vec<usize> = (0..ns).map(|s| first[s + 1] - first[s]).collect();
        let below: Vec<usize> = (0..ns).map(|s| counts[first[s]] as usize - width[s]).collect();
        let up: Vec<u32> = (0..ns)
            .map(|s| match parent[first[s + 1] - 1] {
                NONE => NONE,
                p => of[p as usize],
            })
            .collect();

        let (child_ptr, child_list) = children(&up);
        let mut entries: Vec<f64> = (0..ns).map(|s| trapezoid(width[s], below[s])).collect();
        let mut merged_into = vec![NONE; ns];
        let mut absorbed: Vec<Vec<u32>> = vec![Vec::new(); ns];
        let mut candidates: Vec<u32> = Vec::new();
        for s in 0..ns {
            candidates.clear();
            candidates.extend_from_slice(&child_list[child_ptr[s]..child_ptr[s + 1]]);
            // Those first that add the fewest zeros: w_c (w_s + r_s - r_c).
            candidates.sort_by_key(|&c| (width[c as usize] * (width[s] + below[s] - below[c as usize]), c));
            for &c in &candidates {
                let c = c as usize;
                let columns = width[s] + width[c];
                let (size, filled) = (trapezoid(columns, below[s]), entries[s] + entries[c]);
                if may_merge(columns, size - filled, size) {
                    width[s] = columns;
                    entries[s] = filled;
                    merged_into[c] = s as u32;
                    absorbed[s].push(c as u32);
                }
            }
        }

        let mut number = vec![NONE; ns];
        let mut kept = 0u32;
        for s in 0..ns {
            if merged_into[s] == NONE {
                number[s] = kept;
                kept += 1;
            }
        }
        for s in (0..ns).rev() {
            if merged_into[s] != NONE {
                number[s] = number[merged_into[s] as usize];
            }
        }
        let mut result = Self { columns: Vec::new(), below: Vec::new(), parent: Vec::new() };
        for s in (0..ns).filter(|&s| merged_into[s] == NONE) {
            // Absorbed columns come before those that absorbed them.
            let mut columns = Vec::with_capacity(width[s]);
            let mut stack = vec![s as u32];
            while let Some(v) = stack.pop() {
                let v = v as usize;
                columns.extend((first[v] as u32..first[v + 1] as u32).rev());
                stack.extend_from_slice(&absorbed[v]);
            }
            columns.reverse();
            result.columns.push(columns);
            result.below.push(below[s] as u32);
            result.parent.push(if up[s] == NONE { NONE } else { number[up[s] as usize] });
        }
        result
    }
}
