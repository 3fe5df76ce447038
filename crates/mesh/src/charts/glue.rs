//! Which sides of faces are glued to each other, and which way round each face is.

use super::edges::Edges;
use super::geometry::{Metric, cosine};
use super::half_edges::{HalfEdges, NONE};
use super::select::Role;
use crate::mesh::{Mesh, Polygons};

/// Glued sides of listed faces; a side has the number of the corner where it starts.
pub(super) struct Gluing<'a> {
    pub faces: &'a Polygons,
    pub face: Vec<u32>, // of each corner
    pub mate: Vec<u32>, // of each side, NONE where it is open
}

/// How the faces lie: glued faces of the same `reversed` are listed in the same direction.
pub(super) struct Orientation {
    pub reversed: Vec<bool>,
    pub component: Vec<u32>, // NONE for faces that are not taken
    pub conflicts: Vec<u32>, // sides whose mates cannot be brought into the same direction
}

impl<'a> Gluing<'a> {
    /// Glues the two sides of each edge of two taken faces that is no seam, and the best pairs at edges of more.
    /// Returns it with the edges of three faces and more.
    pub fn new(
        mesh: &'a Mesh,
        roles: &[Role],
        edges: &Edges,
        seams: &[[u32; 2]],
        metric: &Metric<'_>,
    ) -> (Self, Vec<[u32; 2]>) {
        let faces = &mesh.faces;
        let mut face = Vec::with_capacity(faces.indices().len());
        faces.iter().enumerate().for_each(|(f, p)| face.extend(std::iter::repeat_n(f as u32, p.len())));
        let mut gluing = Gluing { faces, face, mate: vec![NONE; faces.indices().len()] };
        let mut branching = Vec::new();
        let mut next_seam = seams.iter().peekable();
        let mut sides = Vec::new();
        for (edge, group) in edges.iter() {
            gluing.taken_sides(group, roles, &mut sides);
            while next_seam.next_if(|s| **s < edge).is_some() {}
            let seam = next_seam.peek() == Some(&&edge);
            match sides[..] {
                [a, b] if !seam => gluing.glue(a, b),
                [_, _, _, ..] => branching.push((edge, seam)),
                _ => {}
            }
        }
        if branching.iter().any(|b| !b.1) {
            let simple = gluing.orient(roles);
            for &(edge, _) in branching.iter().filter(|b| !b.1) {
                sides.clear();
                sides.extend(edges.sides(edge[0], edge[1]).filter(|&c| gluing.is_taken(roles, c)));
                gluing.glue_best(&sides, &simple, metric);
            }
        }
        (gluing, branching.into_iter().map(|b| b.0).collect())
    }

    fn is_taken(&self, roles: &[Role], corner: u32) -> bool {
        roles[self.face[corner as usize] as usize] == Role::Taken
    }

    fn taken_sides(&self, group: &[u64], roles: &[Role], out: &mut Vec<u32>) {
        out.clear();
        out.extend(group.iter().map(|&i| i as u32).filter(|&c| self.is_taken(roles, c)));
    }

    fn glue(&mut self, a: u32, b: u32) {
        self.mate[a as usize] = b;
        self.mate[b as usize] = a;
    }

    /// Pairs of sides in the order of how well the surface goes on: in one direction, within a part that holds
    /// together elsewhere too, and flat.
    fn glue_best(&mut self, sides: &[u32], simple: &Orientation, metric: &Metric<'_>) {
        // The pairs of very many faces at one edge would be too many: what is over stays open.
        const MOST: usize = 64;
        let sides = &sides[..sides.len().min(MOST)];
        let side = |&c: &u32| {
            let f = self.face[c as usize] as usize;
            let listed = if simple.reversed[f] { -1.0 } else { 1.0 };
            (self.faces.indices()[c as usize], listed, simple.component[f], metric.normal(self.faces.get(f)))
        };
        let all: Vec<_> = sides.iter().map(side).collect();
        let mut pairs = Vec::new();
        for i in 0..all.len() {
            for j in 0..i {
                let (a, b) = (&all[i], &all[j]);
                let opposite = if a.0 == b.0 { -1.0 } else { 1.0 };
                let together = a.2 == b.2;
                // Parts that hang together nowhere else can both be turned around.
                let consistent = if together { opposite * a.1 * b.1 > 0.0 } else { opposite > 0.0 };
                let flat = opposite * cosine(a.3, b.3);
                pairs.push((consistent, together, flat, sides[j], sides[i]));
            }
        }
        let better = |p: &(bool, bool, f64, u32, u32), q: &(bool, bool, f64, u32, u32)| {
            (q.0, q.1).cmp(&(p.0, p.1)).then(q.2.total_cmp(&p.2)).then((p.3, p.4).cmp(&(q.3, q.4)))
        };
        pairs.sort_unstable_by(better);
        for (.., a, b) in pairs {
            if self.mate[a as usize] == NONE && self.mate[b as usize] == NONE {
                self.glue(a, b);
            }
        }
    }

    /// Carries directions from the first face of each part over glued sides, breadth first, so that conflicts lie
    /// where the fronts meet. Then the direction of most faces of a part wins.
    pub fn orient(&self, roles: &[Role]) -> Orientation {
        let n = self.faces.len();
        let mut out = Orientation { reversed: vec![false; n], component: vec![NONE; n], conflicts: Vec::new() };
        let mut queue: Vec<u32> = Vec::new();
        let mut count = 0;
        for first in 0..n {
            if roles[first] != Role::Taken || out.component[first] != NONE {
                continue;
            }
            out.component[first] = count;
            queue.clear();
            queue.push(first as u32);
            let mut head = 0;
            while let Some(&f) = queue.get(head) {
                head += 1;
                let f = f as usize;
                for c in self.corners(f) {
                    let m = self.mate[c];
                    if m == NONE {
                        continue;
                    }
                    let g = self.face[m as usize] as usize;
                    let along = self.faces.indices()[c] == self.faces.indices()[m as usize];
                    let wanted = out.reversed[f] ^ along;
                    if out.component[g] == NONE {
                        out.component[g] = count;
                        out.reversed[g] = wanted;
                        queue.push(g as u32);
                    } else if out.reversed[g] != wanted && (c as u32) < m {
                        out.conflicts.push(c as u32);
                    }
                }
            }
            let against = queue.iter().filter(|&&f| out.reversed[f as usize]).count();
            if 2 * against > queue.len() {
                queue.iter().for_each(|&f| out.reversed[f as usize] ^= true);
            }
            count += 1;
        }
        out
    }

    fn corners(&self, face: usize) -> std::ops::Range<usize> {
        self.faces.offsets()[face] as usize..self.faces.offsets()[face + 1] as usize
    }

    /// Opens a side and its mate.
    pub fn unglue(&mut self, corner: u32) {
        let m = std::mem::replace(&mut self.mate[corner as usize], NONE);
        if m != NONE {
            self.mate[m as usize] = NONE;
        }
    }

    /// Opens all sides of a face.
    pub fn isolate(&mut self, face: u32) {
        self.corners(face as usize).for_each(|c| self.unglue(c as u32));
    }
}

/// The taken faces, each in the direction of its part and beginning with its first listed corner.
pub(super) struct Oriented {
    pub half_edges: HalfEdges,
    pub corner: Vec<u32>, // the mesh corner at the start of each half-edge
    pub face: Vec<u32>,   // the mesh face of each cell
}

impl Oriented {
    /// Brings the taken faces of a gluing without conflicts into the directions found.
    pub fn new(gluing: &Gluing<'_>, roles: &[Role], orientation: &Orientation) -> Self {
        let mut h = HalfEdges { offsets: vec![0], ..HalfEdges::default() };
        let (mut corner, mut face) = (Vec::new(), Vec::new());
        let mut half_edge_of = vec![NONE; gluing.mate.len()]; // of each listed side
        let mut side_of = Vec::new(); // the listed side of each half-edge
        for f in 0..gluing.faces.len() {
            if roles[f] != Role::Taken {
                continue;
            }
            let at = gluing.corners(f);
            let (start, n) = (at.start, at.len());
            for i in 0..n {
                // Reversed: corners 0, n - 1, .., 1; the side from corner i to i - 1 is the listed one of i - 1.
                let (c, s) = match orientation.reversed[f] {
                    false => (start + i, start + i),
                    true => (start + (n - i) % n, start + n - 1 - i),
                };
                half_edge_of[s] = corner.len() as u32;
                side_of.push(s as u32);
                corner.push(c as u32);
                h.vertex.push(gluing.faces.indices()[c]);
                h.cell.push(face.len() as u32);
            }
            h.offsets.push(corner.len() as u32);
            face.push(f as u32);
        }
        h.mate = side_of
            .iter()
            .map(|&s| match gluing.mate[s as usize] {
                NONE => NONE,
                m => half_edge_of[m as usize],
            })
            .collect();
        Oriented { half_edges: h, corner, face }
    }
}
