//! All pairs of things in the plane whose boxes meet: a tree over blocks of things that are near each other.

use rayon::prelude::*;

/// Lowest and highest corner.
pub(crate) type Box2 = [[f64; 2]; 2];

/// Things in a block.
const BLOCK: usize = 8;
/// Children of a node.
const WIDTH: usize = 4;
/// Blocks that one task asks for.
const TASK: usize = 64;
/// Tasks between two looks at what has been done.
const WAVE: usize = 128;
/// A task stops after this many tests (of pairs, and of blocks against blocks), and all stop after [`MOST_TESTS`]:
/// only where very many things lie over each other are there more, and then it is known that they do.
const MOST_TASK_TESTS: u64 = 4_000_000;
/// See [`MOST_TASK_TESTS`].
const MOST_TESTS: u64 = 300_000_000;

/// What was found, by kinds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Found<const K: usize> {
    pub counts: [u64; K],
    pub examples: Vec<[u32; 2]>,
    /// Whether every pair was tested.
    pub complete: bool,
}

/// The things in the order of a space-filling curve, and boxes of more and more of them.
struct Tree<'a> {
    order: Vec<u32>,
    boxes: &'a [Box2],
    levels: Vec<Vec<Box2>>, // level 0: blocks of things; each node of level k + 1 has WIDTH of level k
}

/// Calls `test` once for every pair of things whose boxes have a point in common (with `open` an inner point), and
/// counts what it answers. The order does not depend on the number of threads.
pub(crate) fn find_pairs<const K: usize>(
    boxes: &[Box2],
    open: bool,
    most_examples: usize,
    test: impl Fn(u32, u32) -> Option<usize> + Sync,
) -> Found<K> {
    let tree = Tree::new(boxes);
    let tasks = tree.order.len().div_ceil(BLOCK * TASK);
    let mut found = Found { counts: [0; K], examples: Vec::new(), complete: true };
    let mut tests = 0;
    for wave in 0..tasks.div_ceil(WAVE) {
        if tests > MOST_TESTS {
            found.complete = false;
            break;
        }
        let parts: Vec<(Found<K>, u64)> = (wave * WAVE..((wave + 1) * WAVE).min(tasks))
            .into_par_iter()
            .map(|task| tree.task(task, open, most_examples, &test))
            .collect();
        for (part, n) in parts {
            tests += n;
            (0..K).for_each(|k| found.counts[k] += part.counts[k]);
            let room = most_examples - found.examples.len();
            found.examples.extend(part.examples.into_iter().take(room));
            found.complete &= part.complete;
        }
    }
    found.examples.sort_unstable();
    found
}

impl<'a> Tree<'a> {
    fn new(boxes: &'a [Box2]) -> Self {
        let all = boxes.iter().copied().reduce(union).unwrap_or_default();
        let size = (0..2).map(|d| all[1][d] - all[0][d]).fold(0.0, f64::max);
        let cell = |b: &Box2, d: usize| {
            let x = 0.5 * (b[0][d] - all[0][d]) + 0.5 * (b[1][d] - all[0][d]);
            if size > 0.0 { (x / size * f64::from(u32::MAX)) as u64 } else { 0 }
        };
        let mut keys: Vec<(u64, u32)> = boxes
            .par_iter()
            .enumerate()
            .map(|(i, b)| (spread(cell(b, 0)) | spread(cell(b, 1)) << 1, i as u32))
            .collect();
        keys.par_sort_unstable();
        let order: Vec<u32> = keys.into_iter().map(|k| k.1).collect();
        let merged = |b: &[Box2]| b.iter().copied().reduce(union).unwrap_or_default();
        let of_block = |b: &[u32]| b.iter().map(|&i| boxes[i as usize]).reduce(union).unwrap_or_default();
        let mut levels: Vec<Vec<Box2>> = vec![order.chunks(BLOCK).map(of_block).collect()];
        while let Some(last) = levels.last().filter(|l| l.len() > 1) {
            let next = last.chunks(WIDTH).map(merged).collect();
            levels.push(next);
        }
        Tree { order, boxes, levels }
    }

    /// The pairs of the blocks of one task with all blocks that are not before them.
    fn task<const K: usize>(
        &self,
        task: usize,
        open: bool,
        most_examples: usize,
        test: &impl Fn(u32, u32) -> Option<usize>,
    ) -> (Found<K>, u64) {
        let mut found = Found { counts: [0; K], examples: Vec::new(), complete: true };
        let mut tests = 0;
        let mut stack = Vec::new();
        let blocks = self.levels[0].len();
        let items = |block: usize| &self.order[block * BLOCK..((block + 1) * BLOCK).min(self.order.len())];
        for block in task * TASK..((task + 1) * TASK).min(blocks) {
            let around = self.levels[0][block];
            stack.push((self.levels.len() - 1, 0usize));
            while let Some((level, node)) = stack.pop() {
                // The last block below a node; nodes before this block have been asked by their own blocks.
                let last = (node + 1).saturating_mul(WIDTH.saturating_pow(level as u32)) - 1;
                if last < block || !meet(&around, &self.levels[level][node], false) {
                    continue;
                }
                if level > 0 {
                    let children = node * WIDTH..((node + 1) * WIDTH).min(self.levels[level - 1].len());
                    stack.extend(children.rev().map(|child| (level - 1, child)));
                    continue;
                }
                if tests > MOST_TASK_TESTS {
                    found.complete = false;
                    return (found, tests);
                }
                tests += 1;
                for (k, &i) in items(block).iter().enumerate() {
                    let own = &self.boxes[i as usize];
                    let from = if node == block { k + 1 } else { 0 };
                    for &j in &items(node)[from..] {
                        if !meet(own, &self.boxes[j as usize], open) {
                            continue;
                        }
                        tests += 1;
                        if let Some(kind) = test(i, j) {
                            found.counts[kind] += 1;
                            if found.examples.len() < most_examples {
                                found.examples.push([i.min(j), i.max(j)]);
                            }
                        }
                    }
                }
            }
        }
        (found, tests)
    }
}

fn union(a: Box2, b: Box2) -> Box2 {
    [[a[0][0].min(b[0][0]), a[0][1].min(b[0][1])], [a[1][0].max(b[1][0]), a[1][1].max(b[1][1])]]
}

fn meet(a: &Box2, b: &Box2, open: bool) -> bool {
    if open {
        a[0][0] < b[1][0] && b[0][0] < a[1][0] && a[0][1] < b[1][1] && b[0][1] < a[1][1]
    } else {
        a[0][0] <= b[1][0] && b[0][0] <= a[1][0] && a[0][1] <= b[1][1] && b[0][1] <= a[1][1]
    }
}

/// The lower 32 bits at the even places (Morton 1966).
fn spread(x: u64) -> u64 {
    let x = (x | x << 16) & 0x0000_ffff_0000_ffff;
    let x = (x | x << 8) & 0x00ff_00ff_00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333_3333_3333;
    (x | x << 1) & 0x5555_5555_5555_5555
}
