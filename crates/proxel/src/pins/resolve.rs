//! A pins file held against a body.

use std::collections::{BTreeMap, BTreeSet};

use proxel_split::Equality;

use super::motion::{Motion, centroid};
use super::select::out_of_range;
use super::{Content, Force, Group, HalfSpace, InputError, PinFile};

type V3 = [f64; 3];

/// What holds a body, by vertex. All lists are ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Handles {
    /// Pinned vertices, each once, and where they are. Where the file moves nothing this is the
    /// start position, bit for bit.
    pub fixed: Vec<(u32, V3)>,
    /// Springs: vertex, target and k of k/2 |x - target|^2. A vertex of two groups has two.
    pub soft: Vec<(u32, V3, f64)>,
    /// Point loads, each vertex once.
    pub loads: Vec<(u32, V3)>,
    /// Pressures: the vertices whose faces they act on, force over area along the outward normal.
    pub pressures: Vec<(Vec<u32>, f64)>,
    /// Rows sum a_i x_i = b over vertices.
    pub equalities: Vec<Equality>,
    /// Planes that every vertex stays on the side of, to which the normal points.
    pub obstacles: Vec<HalfSpace>,
    /// The groups and their vertices; `pins` for those of a list.
    pub groups: Vec<(String, Vec<u32>)>,
    /// Whether the file says where vertices go, so that a start of its own is not needed.
    pub moved: bool,
    /// What was odd, but has one meaning: an index given twice, loads on pins.
    pub warnings: Vec<String>,
}

impl PinFile {
    /// Finds the vertices and their targets on a body with these rest positions, which start at
    /// `start` (the rest positions without one). Scaling, rotation and translation apply to rest
    /// positions.
    ///
    /// # Errors
    /// An index out of range, a group that chooses nothing, two groups that hold the same vertex, a
    /// target that is not finite.
    pub fn resolve(&self, rest: &[V3], start: Option<&[V3]>) -> Result<Handles, InputError> {
        let start = start.unwrap_or(rest);
        if start.len() != rest.len() {
            let what = format!("the start has {} vertices, the rest shape {}", start.len(), rest.len());
            return Err(InputError::new(&self.name, what, "give both the same vertices"));
        }
        let mut handles = match &self.content {
            Content::List(list) => self.resolve_list(list, start),
            Content::Groups(groups) => self.resolve_groups(groups, rest, start),
        }?;
        handles.equalities = self.around.rows(&self.name, rest.len())?;
        handles.obstacles.clone_from(&self.around.obstacles);
        Ok(handles)
    }

    fn resolve_list(&self, list: &[(u32, usize)], start: &[V3]) -> Result<Handles, InputError> {
        let mut vertices = BTreeSet::new();
        let mut twice: Option<(u32, usize)> = None;
        let mut repeats = 0;
        for &(v, line) in list {
            if v as usize >= start.len() {
                return Err(out_of_range(&self.name, v, start.len(), "").at_line(line));
            }
            if !vertices.insert(v) {
                repeats += 1;
                twice = twice.or(Some((v, line)));
            }
        }
        let fixed = vertices.iter().map(|&v| (v, start[v as usize])).collect();
        let warnings = twice.map(|(v, line)| self.duplicates(repeats, &format!("vertex {v} in line {line}")));
        let groups = vec![("pins".to_owned(), vertices.into_iter().collect())];
        Ok(Handles { fixed, groups, warnings: warnings.into_iter().collect(), ..Handles::default() })
    }

    fn duplicates(&self, n: usize, first: &str) -> String {
        let pins = if n == 1 { "1 duplicate pin".to_owned() } else { format!("{n} duplicate pins") };
        format!("{}: {pins} ignored, first {first}", self.name)
    }

    fn resolve_groups(
        &self,
        groups: &BTreeMap<String, Group>,
        rest: &[V3],
        start: &[V3],
    ) -> Result<Handles, InputError> {
        let mut out = Handles::default();
        let mut fixed: BTreeMap<u32, (V3, &str)> = BTreeMap::new();
        let mut loads: BTreeMap<u32, V3> = BTreeMap::new();
        let mut pulled: BTreeMap<u32, &str> = BTreeMap::new();
        let (mut repeats, mut twice) = (0, None);
        for (name, group) in groups {
            let selected = group.select(&self.name, name, rest)?;
            let members: BTreeSet<u32> = selected.iter().copied().collect();
            out.groups.push((name.clone(), members.iter().copied().collect()));
            if let Some(force) = group.force {
                self.add_loads(&mut loads, name, force, &members)?;
                continue;
            }
            if let Some(pressure) = group.pressure {
                out.pressures.push((members.iter().copied().collect(), pressure));
                continue;
            }
            out.moved |= group.moves();
            let motion = group.moves().then(|| Motion::of(group, centroid(rest, &members)));
            let mut targets: BTreeMap<u32, V3> = BTreeMap::new();
            for (k, &v) in selected.iter().enumerate() {
                let target = match (&group.targets, &motion) {
                    (Some(targets), _) => targets[k],
                    (None, Some(motion)) => motion.apply(rest[v as usize]),
                    (None, None) => start[v as usize],
                };
                if target.iter().any(|x| !x.is_finite()) {
                    let what = format!("group `{name}`: the target of vertex {v} is not finite");
                    return Err(InputError::new(&self.name, what, "give smaller factors or translations"));
                }
                if let Some(t) = targets.insert(v, target) {
                    if t != target {
                        return Err(self.contradiction(v, (name, t), (name, target)));
                    }
                    repeats += 1;
                    twice = twice.or(Some((v, name)));
                }
            }
            for (v, target) in targets {
                if let Some(stiffness) = group.stiffness {
                    pulled.entry(v).or_insert(name);
                    out.soft.push((v, target, stiffness));
                } else if let Some((t, other)) = fixed.insert(v, (target, name))
                    && t != target
                {
                    return Err(self.contradiction(v, (other, t), (name, target)));
                }
            }
        }
        if let Some((v, name)) = twice {
            out.warnings.push(self.duplicates(repeats, &format!("vertex {v} in group `{name}`")));
        }
        if let Some((v, soft, hard)) = pulled.iter().find_map(|(v, soft)| Some((v, soft, fixed.get(v)?.1))) {
            let what = format!("groups `{hard}` and `{soft}` overlap: the one holds vertex {v}, the other pulls at it");
            return Err(InputError::new(&self.name, what, "take the vertex out of one of them"));
        }
        let idle = loads.keys().filter(|v| fixed.contains_key(v)).count();
        if idle > 0 {
            out.warnings.push(format!("{}: {idle} loads on pinned vertices have no effect", self.name));
        }
        loads.retain(|v, _| !fixed.contains_key(v));
        out.soft.sort_by_key(|s| s.0); // stable: two springs of a vertex stay in the order of groups
        out.fixed = fixed.into_iter().map(|(v, (t, _))| (v, t)).collect();
        out.loads = loads.into_iter().collect();
        Ok(out)
    }

    fn add_loads(
        &self,
        loads: &mut BTreeMap<u32, V3>,
        name: &str,
        force: Force,
        members: &BTreeSet<u32>,
    ) -> Result<(), InputError> {
        let each = match force {
            Force::Each(f) => f,
            Force::Total(f) => f.map(|x| x / members.len() as f64),
        };
        for &v in members {
            let sum = loads.entry(v).or_default();
            for c in 0..3 {
                sum[c] += each[c];
            }
            if sum.iter().any(|x| !x.is_finite()) {
                let what = format!("group `{name}`: the load on vertex {v} is not finite");
                return Err(InputError::new(&self.name, what, "give smaller forces"));
            }
        }
        Ok(())
    }

    fn contradiction(&self, v: u32, (a, to): (&str, V3), (b, other): (&str, V3)) -> InputError {
        let what = if a == b {
            format!("group `{a}`: vertex {v} has two targets, {to:?} and {other:?}")
        } else {
            format!("groups `{a}` and `{b}` send vertex {v} to different places, {to:?} and {other:?}")
        };
        InputError::new(&self.name, what, "take the vertex out of one of them, or give it a stiffness")
    }
}
