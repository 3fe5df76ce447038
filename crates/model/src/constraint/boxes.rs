//! Nearest of many items through a tree of boxes, with a start where it was before.

use super::{V3, dot, norm, sub};

/// What a tree holds.
pub(super) trait Item: Copy + Send + Sync {
    /// Its least box: low and high corner.
    fn bounds(&self) -> (V3, V3);

    /// Its point nearest to x, which may be off by rounding.
    fn nearest(&self, x: V3) -> V3;
}

/// Children of a node.
const WIDTH: usize = 4;
/// Items of a leaf, at most.
const LEAF: usize = 4;
/// Entries of the stack: a binary tree over u32 items that is halved each time has 32 levels, a node of [`WIDTH`] takes two of
/// them and leaves at most three children behind.
const STACK: usize = 64;
/// A child that is none.
const NONE: u32 = u32::MAX;
/// Part of a squared distance by which one in f32 may be above the exact one: a few roundings of 2^-24.
const SLACK: f32 = 1e-6;

/// Boxes of the children, coordinate by coordinate, in f32 and rounded outward.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    child: [u32; WIDTH], // a node, or the first item of a leaf
    count: [u32; WIDTH], // items of the leaf; 0 for a node
}

/// A tree over items in flat arrays. Boxes are kept in coordinates that are centred and scaled to about 1; items are as given.
///
/// All that the tree decides is which items are looked at. An item has its squared distance from the query as computed in
/// f64, of several with the same the first one counts, and no box is passed over that could have one which is as near: the
/// nearest point of an item is clamped to its bounds, rounding is monotone, and so no computed distance is less than that
/// of the box. Hence the result is that of looking at all items, bit for bit, wherever the search starts.
#[derive(Clone, Debug)]
pub(super) struct Boxes<T> {
    nodes: Vec<Node>,
    items: Vec<T>,   // in the order of leaves
    order: Vec<u32>, // numbers as given
    centre: V3,
    scale: f64,
    extent: f64, // largest coordinate of a box
    name: u64,   // made of all boxes, so that a hint is known to be of this tree
}

/// Where a query has ended, for the next one of the same point when that has moved a little. It saves time and changes no
/// result; one of another tree is as good as none.
#[derive(Clone, Copy, Debug)]
pub struct Hint {
    item: u32,  // position in the tree
    at: V3,     // the query
    clear: f64, // no other item was nearer to it than this
    tree: u64,
}

impl Default for Hint {
    fn default() -> Self {
        Hint { item: NONE, at: [f64::NAN; 3], clear: 0.0, tree: 0 }
    }
}

fn squared(a: V3, b: V3) -> f64 {
    let d = sub(a, b);
    dot(d, d)
}

/// The best item so far.
#[derive(Clone, Copy)]
struct Best {
    squared: f64,
    number: u32, // as given
    item: u32,   // position in the tree
    point: V3,
    second: f64, // the least squared distance among those that were not the best
}

impl Best {
    const NONE: Best =
        Best { squared: f64::INFINITY, number: NONE, item: NONE, point: [f64::NAN; 3], second: f64::INFINITY };
}

impl<T: Item> Boxes<T> {
    /// Of items, at most u32::MAX - 1 of them; those with numbers that are not finite are never found.
    pub fn new(given: &[T]) -> Self {
        let bounds: Vec<(V3, V3)> = given.iter().map(Item::bounds).collect();
        let finite = |(low, high): &(V3, V3)| low.iter().chain(high).all(|c| c.is_finite());
        let mut order: Vec<u32> = (0..given.len() as u32).filter(|i| finite(&bounds[*i as usize])).collect();
        let all =
            order.iter().fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |all, i| join(all, bounds[*i as usize]));
        let centre = if order.is_empty() { [0.0; 3] } else { [0, 1, 2].map(|d| 0.5 * all.0[d] + 0.5 * all.1[d]) };
        let size = (0..3).fold(0.0_f64, |m, d| m.max(0.5 * all.1[d] - 0.5 * all.0[d]));
        // Powers of two change no digit.
        let scale = if size > 0.0 { (-size.log2().round()).clamp(-500.0, 500.0).exp2() } else { 1.0 };
        let extent = order.iter().flat_map(|i| bounds[*i as usize].0.into_iter().chain(bounds[*i as usize].1));
        let extent = extent.fold(0.0_f64, |m, c| m.max(c.abs()));
        let mut tree = Boxes {
            nodes: Vec::new(),
            items: Vec::new(),
            order: Vec::new(),
            centre,
            scale,
            extent,
            name: name(&bounds),
        };
        tree.build(&bounds, &mut order);
        tree.items = order.iter().map(|i| given[*i as usize]).collect();
        tree.order = order;
        tree
    }

    /// Halves ranges of items along the longest side of their centres' box, two levels at a time.
    fn build(&mut self, bounds: &[(V3, V3)], order: &mut [u32]) {
        let mut left: Vec<(usize, std::ops::Range<usize>)> = Vec::new(); // node, items
        if !order.is_empty() {
            self.nodes.push(Node::EMPTY);
            left.push((0, 0..order.len()));
        }
        while let Some((node, range)) = left.pop() {
            let middle = halve(bounds, order, range.clone());
            let quarters = [range.start..middle, middle..range.end].map(|half| {
                let cut = halve(bounds, order, half.clone());
                [half.start..cut, cut..half.end]
            });
            for (k, part) in quarters.into_iter().flatten().enumerate().filter(|(_, part)| !part.is_empty()) {
                let all = order[part.clone()].iter().map(|i| bounds[*i as usize]);
                let (low, high) = all.reduce(join).unwrap_or_default();
                for d in 0..3 {
                    let own = |c: f64| (c - self.centre[d]) * self.scale;
                    self.nodes[node].low[d][k] = (own(low[d]) as f32).next_down();
                    self.nodes[node].high[d][k] = (own(high[d]) as f32).next_up();
                }
                let child = if part.len() <= LEAF { part.start } else { self.nodes.len() };
                self.nodes[node].child[k] = child as u32;
                if part.len() <= LEAF {
                    self.nodes[node].count[k] = part.len() as u32;
                } else {
                    self.nodes.push(Node::EMPTY);
                    left.push((child, part));
                }
            }
        }
    }

    /// The point of all items that is nearest to x; x itself where there is none, or x is not finite.
    pub fn nearest(&self, x: V3) -> V3 {
        let mut best = Best::NONE;
        self.search(x, 0.0, &mut best);
        if best.item == NONE { x } else { best.point }
    }

    /// The same, from where a query near by has ended.
    ///
    /// The item of before bounds the distance, which prunes the tree. Where nothing else was nearer to that query than
    /// `clear`, and x is m away from it, nothing else is nearer to x than clear - m: if the item is, the tree is not asked.
    pub fn nearest_from(&self, x: V3, hint: &mut Hint) -> V3 {
        let mut best = Best::NONE;
        let mut moved = f64::INFINITY;
        if hint.tree == self.name && (hint.item as usize) < self.items.len() {
            self.look_at(hint.item, x, &mut best);
            moved = norm(sub(x, hint.at));
            // Roundings of coordinates and distances, with room to spare.
            let rounding = 64.0 * f64::EPSILON * (self.extent + norm(x));
            if best.squared.sqrt() + moved + rounding < hint.clear {
                return best.point;
            }
        }
        // Boxes as far as the next few moves may reach are looked into, so that those need not ask again.
        let reach = if moved.is_finite() { REACH * moved } else { 0.0 };
        self.search(x, reach, &mut best);
        if best.item == NONE {
            return x;
        }
        *hint = Hint { item: best.item, at: x, clear: best.second.sqrt(), tree: self.name };
        best.point
    }

    fn look_at(&self, item: u32, x: V3, best: &mut Best) {
        let shape = &self.items[item as usize];
        let ((low, high), point) = (shape.bounds(), shape.nearest(x));
        let point = [0, 1, 2].map(|d| point[d].max(low[d]).min(high[d]));
        let (squared, number) = (squared(x, point), self.order[item as usize]);
        if item == best.item {
            return;
        }
        if squared < best.squared || (squared == best.squared && number < best.number) {
            *best = Best { squared, number, item, point, second: best.squared.min(best.second) };
        } else {
            best.second = best.second.min(squared);
        }
    }

    /// Looks at all items that may be as near as the best, and at those of boxes that are farther by no more than `reach`.
    fn search(&self, x: V3, reach: f64, best: &mut Best) {
        if self.nodes.is_empty() || !x.iter().all(|c| c.is_finite()) {
            return;
        }
        let own = [0, 1, 2].map(|d| (x[d] - self.centre[d]) * self.scale);
        let below = own.map(|c| (c as f32).next_down());
        let above = own.map(|c| (c as f32).next_up());
        // Scaled, rounded up, and no less than what underflows.
        let bound = |best: &Best| {
            // Beyond the second nearest nothing is to be learnt.
            let (nearest, second) = (best.squared.sqrt(), best.second.sqrt());
            let within = nearest.max((nearest + reach).min(second)) * self.scale;
            ((within * within) as f32).next_up() * (1.0 + SLACK) + f32::MIN_POSITIVE
        };
        // The distance that a box in f32 stands for, rounded down, in units of items.
        let unit = 1.0 / (self.scale * self.scale);
        let squared = |box2: f32| f64::from((box2 - f32::MIN_POSITIVE).max(0.0) * (1.0 - 2.0 * SLACK)) * unit;
        let (mut stack, mut height) = ([(0_u32, 0.0_f32); STACK], 1);
        let mut limit = bound(best);
        let mut passed = f32::INFINITY; // the nearest box that was passed over
        while height > 0 {
            height -= 1;
            let (at, box2) = stack[height];
            if box2 > limit {
                passed = passed.min(box2);
                continue;
            }
            let node = &self.nodes[at as usize];
            let box2 = node.squared_distances(below, above);
            let mut near = [(0.0_f32, 0_usize); WIDTH];
            let mut found = 0;
            for k in 0..WIDTH {
                if node.child[k] == NONE {
                    continue;
                }
                if box2[k] > limit {
                    passed = passed.min(box2[k]);
                    continue;
                }
                // Farthest first, since the last one is taken first.
                let place = (0..found).find(|j| near[*j].0 < box2[k]).unwrap_or(found);
                near.copy_within(place..found, place + 1);
                near[place] = (box2[k], k);
                found += 1;
            }
            for (box2, k) in &near[..found] {
                if node.count[*k] == 0 && height < STACK {
                    stack[height] = (node.child[*k], *box2);
                    height += 1;
                }
            }
            for (box2, k) in near[..found].iter().rev().filter(|n| node.count[n.1] > 0) {
                if *box2 > limit {
                    passed = passed.min(*box2);
                    continue;
                }
                for item in node.child[*k]..node.child[*k] + node.count[*k] {
                    self.look_at(item, x, best);
                }
                limit = bound(best);
            }
        }
        best.second = best.second.min(squared(passed));
    }
}

/// A number of boxes (Fowler, Noll and Vo's hash, word by word), never 0.
fn name(bounds: &[(V3, V3)]) -> u64 {
    let words = bounds.iter().flat_map(|(low, high)| low.iter().chain(high)).map(|c| c.to_bits());
    words.fold(0xcbf2_9ce4_8422_2325, |h: u64, word| (h ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29)) | 1
}

/// Boxes are looked into where they are farther than the nearest item by up to this many moves of the query.
const REACH: f64 = 4.0;

impl Node {
    const EMPTY: Node = Node {
        low: [[f32::INFINITY; WIDTH]; 3],
        high: [[f32::NEG_INFINITY; WIDTH]; 3],
        child: [NONE; WIDTH],
        count: [0; WIDTH],
    };

    /// Of the boxes of all children from a query that lies between two points.
    fn squared_distances(&self, below: [f32; 3], above: [f32; 3]) -> [f32; WIDTH] {
        let mut sum = [0.0_f32; WIDTH];
        for d in 0..3 {
            for (k, sum) in sum.iter_mut().enumerate() {
                let (under, over) = (self.low[d][k] - above[d], below[d] - self.high[d][k]);
                let gap = if under > over { under } else { over };
                let gap = if gap > 0.0 { gap } else { 0.0 };
                *sum += gap * gap;
            }
        }
        sum
    }
}

fn join(a: (V3, V3), b: (V3, V3)) -> (V3, V3) {
    ([0, 1, 2].map(|d| a.0[d].min(b.0[d])), [0, 1, 2].map(|d| a.1[d].max(b.1[d])))
}

/// Sorts a range of items to two halves along the longest side of the box of their centres; where the second begins.
fn halve(bounds: &[(V3, V3)], order: &mut [u32], range: std::ops::Range<usize>) -> usize {
    if range.len() <= LEAF {
        return range.end;
    }
    let centre = |i: u32, d: usize| 0.5 * bounds[i as usize].0[d] + 0.5 * bounds[i as usize].1[d];
    let items = &mut order[range.clone()];
    let side = |d: usize| {
        let (low, high) = items.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), i| {
            let c = centre(*i, d);
            (low.min(c), high.max(c))
        });
        high - low
    };
    let sides = [side(0), side(1), side(2)];
    let axis = (0..3).fold(0, |m, d| if sides[d] > sides[m] { d } else { m });
    let half = range.len().div_ceil(2);
    items.select_nth_unstable_by(half, |i, j| centre(*i, axis).total_cmp(&centre(*j, axis)).then(i.cmp(j)));
    range.start + half
}

#[cfg(test)]
impl<T: Item> Boxes<T> {
    /// Slow twin: all items, in the order given.
    pub fn nearest_of_all(&self, x: V3) -> V3 {
        let mut positions: Vec<u32> = (0..self.items.len() as u32).collect();
        positions.sort_by_key(|p| self.order[*p as usize]);
        let mut best = (f64::INFINITY, x);
        for p in positions {
            let mut one = Best::NONE;
            self.look_at(p, x, &mut one);
            if one.squared < best.0 {
                best = (one.squared, one.point);
            }
        }
        best.1
    }
}
