//! Pins of a refined body: a midpoint is held where both ends are.

use std::collections::{BTreeMap, BTreeSet};

use super::motion::centroid;
use super::{Content, Force, Group, Index, InputError, PinFile};

type V3 = [f64; 3];

impl PinFile {
    /// The pins of the body refined once: its vertices are those of `rest`, then one for each edge
    /// of `edges`, at its middle. Groups become lists of indices; targets of midpoints are the
    /// middles of targets, centres and total forces stay what they were.
    ///
    /// # Errors
    /// As [`resolve`](Self::resolve), for what does not fit `rest`.
    pub fn refined(&self, rest: &[V3], edges: &[[u32; 2]]) -> Result<PinFile, InputError> {
        self.resolve(rest, None)?; // whatever is wrong is told for the coarse body
        let first = rest.len() as u32;
        let content = match &self.content {
            Content::List(list) => {
                let pinned: BTreeSet<u32> = list.iter().map(|p| p.0).collect();
                let all = pinned.iter().copied().chain(between(&pinned, edges).map(|(k, _)| first + k));
                Content::List(all.enumerate().map(|(k, v)| (v, k + 1)).collect())
            }
            Content::Groups(groups) => {
                let mut out = groups.clone();
                for (name, group) in &mut out {
                    *group = self.refined_group(group, name, rest, edges)?;
                }
                Content::Groups(out)
            }
        };
        Ok(PinFile { name: self.name.clone(), content, around: self.around.clone() })
    }

    fn refined_group(&self, group: &Group, name: &str, rest: &[V3], edges: &[[u32; 2]]) -> Result<Group, InputError> {
        let selected = group.select(&self.name, name, rest)?;
        let members: BTreeSet<u32> = selected.iter().copied().collect();
        let center = centroid(rest, &members);
        let mut indices: Vec<u32> = match group.targets {
            Some(_) => selected.clone(),
            None => members.iter().copied().collect(),
        };
        let mut targets = group.targets.clone();
        let place: BTreeMap<u32, usize> = selected.iter().enumerate().map(|(k, &v)| (v, k)).collect();
        for (k, [a, b]) in between(&members, edges) {
            indices.push(rest.len() as u32 + k);
            if let Some(targets) = &mut targets {
                let (a, b) = (targets[place[&a]], targets[place[&b]]);
                targets.push([0, 1, 2].map(|c| 0.5 * (a[c] + b[c])));
            }
        }
        Ok(Group {
            indices: Some(indices.into_iter().map(Index).collect()),
            region: None,
            sphere: None,
            plane: None,
            combine: None,
            targets,
            scale: group.scale.map(|mut s| {
                s.center = s.center.or(Some(center));
                s
            }),
            rotate: group.rotate.map(|mut r| {
                r.center = r.center.or(Some(center));
                r
            }),
            force: group.force.map(|f| match f {
                Force::Each(f) => Force::Total(f.map(|x| x * members.len() as f64)),
                total => total,
            }),
            ..group.clone()
        })
    }
}

/// The edges with both ends among `members`, each with its number.
fn between<'a>(members: &'a BTreeSet<u32>, edges: &'a [[u32; 2]]) -> impl Iterator<Item = (u32, [u32; 2])> + 'a {
    let numbered = edges.iter().enumerate().map(|(k, &e)| (k as u32, e));
    numbered.filter(|(_, e)| e.iter().all(|v| members.contains(v)))
}
