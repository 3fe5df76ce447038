//! Elimination tree, postorder and column counts.

/// No parent: a root.
pub(super) const NONE: u32 = u32::MAX;

/// The lower triangle of a permuted matrix by columns, with the slot of each entry in the original pattern.
pub(super) struct Lower {
    pub ptr: Vec<usize>,
    pub rows: Vec<u32>,
    pub slots: Vec<usize>,
}

impl Lower {
    /// P A P^T for `perm[new] = old`; columns in arbitrary row order, diagonal included.
    pub fn permuted(pattern: &super::SymPattern, inverse: &[u32]) -> Self {
        let n = pattern.n();
        let mut ptr = vec![0usize; n + 1];
        for j in 0..n {
            for &i in pattern.column(j) {
                ptr[inverse[i as usize].min(inverse[j]) as usize + 1] += 1;
            }
        }
        for j in 0..n {
            ptr[j + 1] += ptr[j];
        }
        let mut next = ptr.clone();
        let (mut rows, mut slots) = (vec![0u32; ptr[n]], vec![0usize; ptr[n]]);
        let mut slot = 0;
        for j in 0..n {
            for &i in pattern.column(j) {
                let (a, b) = (inverse[i as usize], inverse[j]);
                let at = &mut next[a.min(b) as usize];
                rows[*at] = a.max(b);
                slots[*at] = slot;
                *at += 1;
                slot += 1;
            }
        }
        Self { ptr, rows, slots }
    }

    pub fn column(&self, j: usize) -> &[u32] {
        &self.rows[self.ptr[j]..self.ptr[j + 1]]
    }

    /// Row lists: for each row, its columns left of the diagonal, ascending.
    fn rows_left(&self) -> (Vec<usize>, Vec<u32>) {
        let n = self.ptr.len() - 1;
        let mut ptr = vec![0usize; n + 1];
        for j in 0..n {
            for &i in self.column(j) {
                if i as usize != j {
                    ptr[i as usize + 1] += 1;
                }
            }
        }
        for j in 0..n {
            ptr[j + 1] += ptr[j];
        }
        let mut next = ptr.clone();
        let mut columns = vec![0u32; ptr[n]];
        for j in 0..n {
            for &i in self.column(j) {
                if i as usize != j {
                    columns[next[i as usize]] = j as u32;
                    next[i as usize] += 1;
                }
            }
        }
        (ptr, columns)
    }
}

/// Parents in the elimination tree (Liu 1986, path compression by virtual ancestors).
pub(super) fn elimination_tree(lower: &Lower) -> Vec<u32> {
    let n = lower.ptr.len() - 1;
    let (ptr, columns) = lower.rows_left();
    let mut parent = vec![NONE; n];
    let mut ancestor = vec![NONE; n];
    for i in 0..n {
        for &k in &columns[ptr[i]..ptr[i + 1]] {
            let mut j = k;
            while j != NONE && j as usize != i {
                let up = ancestor[j as usize];
                ancestor[j as usize] = i as u32;
                if up == NONE {
                    parent[j as usize] = i as u32;
                }
                j = up;
            }
        }
    }
    parent
}

/// Children lists of a forest: `list[ptr[p]..ptr[p + 1]]` ascending; `list[ptr[n]..]` are the roots.
pub(super) fn children(parent: &[u32]) -> (Vec<usize>, Vec<u32>) {
    let n = parent.len();
    let slot = |p: u32| if p == NONE { n } else { p as usize };
    let mut ptr = vec![0usize; n + 2];
    for &p in parent {
        ptr[slot(p) + 1] += 1;
    }
    for p in 0..=n {
        ptr[p + 1] += ptr[p];
    }
    let mut next = ptr.clone();
    let mut list = vec![0u32; n];
    for (v, &p) in parent.iter().enumerate() {
        let p = slot(p);
        list[next[p]] = v as u32;
        next[p] += 1;
    }
    (ptr, list)
}

/// Postorder of a forest: `order[k]` is the k-th node, children in the order of their lists.
pub(super) fn postorder(ptr: &[usize], list: &[u32]) -> Vec<u32> {
    let n = list.len();
    let mut order = Vec::with_capacity(n);
    let mut next: Vec<usize> = ptr[..n].to_vec();
    let mut stack: Vec<u32> = Vec::new();
    for &root in &list[ptr[n]..] {
        stack.push(root);
        while let Some(&v) = stack.last() {
            let v = v as usize;
            if next[v] < ptr[v + 1] {
                stack.push(list[next[v]]);
                next[v] += 1;
            } else {
                order.push(v as u32);
                stack.pop();
            }
        }
    }
    order
}

/// Number of entries of each column of L, diagonal included (Gilbert, Ng and Peyton 1994), for a postordered matrix.
pub(super) fn column_counts(lower: &Lower, parent: &[u32]) -> Vec<u32> {
    let n = parent.len();
    let mut first = vec![NONE; n]; // first descendant in postorder
    let mut delta = vec![0i64; n];
    for k in 0..n {
        delta[k] = i64::from(first[k] == NONE);
        let mut j = k as u32;
        while j != NONE && first[j as usize] == NONE {
            first[j as usize] = k as u32;
            j = parent[j as usize];
        }
    }
    let mut max_first = vec![NONE; n];
    let mut previous_leaf = vec![NONE; n];
    let mut ancestor: Vec<u32> = (0..n as u32).collect();
    for j in 0..n {
        if parent[j] != NONE {
            delta[parent[j] as usize] -= 1;
        }
        for &i in lower.column(j) {
            let i = i as usize;
            // Is j a leaf of the row subtree of i, and if so which is the join with the leaf before?
            if i <= j || (max_first[i] != NONE && first[j] <= max_first[i]) {
                continue;
            }
            max_first[i] = first[j];
            let previous = previous_leaf[i];
            previous_leaf[i] = j as u32;
            delta[j] += 1;
            if previous != NONE {
                let mut q = previous;
                while q != ancestor[q as usize] {
                    q = ancestor[q as usize];
                }
                let mut s = previous;
                while s != q {
                    let up = ancestor[s as usize];
                    ancestor[s as usize] = q;
                    s = up;
                }
                delta[q as usize] -= 1;
            }
        }
        if parent[j] != NONE {
            ancestor[j] = parent[j];
        }
    }
    for j in 0..n {
        if parent[j] != NONE {
            let d = delta[j];
            delta[parent[j] as usize] += d;
        }
    }
    delta.into_iter().map(|d| d as u32).collect()
}
