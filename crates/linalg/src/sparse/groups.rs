//! Groups of supernodes: the tasks of a parallel factorisation and solve.
//!
//! The assembly tree is cut by weights alone, never by the number of threads: subtrees below a threshold are leaf
//! groups; above them chains of heavy supernodes are groups of their own, joined where the tree branches. A group
//! runs in one task once its children have; so any number of threads does the same arithmetic.

use super::etree::{NONE, children, postorder};
use super::supernodes::Supernodes;

/// A leaf group holds at most this share of the total weight.
const LEAF_SHARE: f64 = 1.0 / 24.0;
/// Subtrees lighter than this share of a leaf group's limit stay with their parent.
const TINY_SHARE: f64 = 1.0 / 8.0;

/// An order of the supernodes in which every group is a range, children before parents.
pub(super) struct Grouping {
    /// `order[k]` is the supernode that comes k-th.
    pub order: Vec<u32>,
    /// Group of each supernode, by its place in `order`; groups are numbered in that order.
    pub group: Vec<u32>,
}

/// Weight of a supernode in a solve: values read, rows gathered and a fixed cost.
fn weight(w: usize, r: usize) -> f64 {
    let m = (w + r) as f64;
    w as f64 * m + 8.0 * m + 64.0
}

pub(super) fn group(supernodes: &Supernodes) -> Grouping {
    let ns = supernodes.parent.len();
    let parent = &supernodes.parent;
    let mut subtree: Vec<f64> =
        (0..ns).map(|s| weight(supernodes.columns[s].len(), supernodes.below[s] as usize)).collect();
    let mut total = 0.0;
    for s in 0..ns {
        match parent[s] {
            NONE => total += subtree[s],
            p => subtree[p as usize] += subtree[s],
        }
    }
    let leaf = total * LEAF_SHARE;
    let tiny = leaf * TINY_SHARE;

    let (ptr, mut list) = children(parent);
    for s in 0..=ns {
        let end = if s < ns { ptr[s + 1] } else { list.len() };
        // Heavy children first: they are other groups, or the start of this one; the rest stays next to the parent.
        list[ptr[s]..end].sort_by(|&a, &b| subtree[b as usize].total_cmp(&subtree[a as usize]).then(a.cmp(&b)));
    }
    let order = postorder(&ptr[..ns + 1], &list);

    // `label[s]`: some name of the group of s, first those that are cut off, then downwards.
    let heavy = |s: u32| subtree[s as usize] > leaf;
    let starts = |s: u32| subtree[s as usize] >= tiny;
    let mut label = vec![NONE; ns];
    let mut fresh = 0u32;
    for &s in &order {
        if !heavy(s) {
            continue; // light subtrees take the label of their root, below
        }
        let own = &list[ptr[s as usize]..ptr[s as usize + 1]];
        let mut big = own.iter().copied().filter(|&c| starts(c));
        let (one, two) = (big.next(), big.next());
        for &c in own.iter().filter(|&&c| starts(c)) {
            if label[c as usize] == NONE {
                label[c as usize] = fresh;
                fresh += 1;
            }
        }
        label[s as usize] = match (one, two) {
            (Some(only), None) => label[only as usize],
            _ => {
                fresh += 1;
                fresh - 1
            }
        };
    }
    // Roots: light ones that are worth a task get one; the tiny ones share one, or join a single big one.
    let roots = &list[ptr[ns]..];
    for &s in roots.iter().filter(|&&s| starts(s)) {
        if label[s as usize] == NONE {
            label[s as usize] = fresh;
            fresh += 1;
        }
    }
    let mut big = roots.iter().filter(|&&s| starts(s));
    let shared = match (big.next(), big.next()) {
        (Some(&only), None) => label[only as usize],
        _ => fresh,
    };
    for &s in roots {
        if label[s as usize] == NONE {
            label[s as usize] = shared;
        }
    }
    for &s in order.iter().rev() {
        if label[s as usize] == NONE {
            label[s as usize] = label[parent[s as usize] as usize];
        }
    }

    let mut group = Vec::with_capacity(ns);
    let mut number = 0u32;
    for (k, &s) in order.iter().enumerate() {
        if k > 0 && label[s as usize] != label[order[k - 1] as usize] {
            number += 1;
        }
        group.push(number);
    }
    Grouping { order, group }
}
