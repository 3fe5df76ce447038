//! Where a group is between its keys.

use super::file::{Key, KeyframeFile};
use crate::pins::{InputError, RigidMotion};
use std::collections::BTreeMap;

type V3 = [f64; 3];

/// Axes of turns that are this near to parallel are the same.
const PARALLEL: f64 = 1e-12;

/// Keyframes held against the groups of a body.
#[derive(Clone, Debug)]
pub struct Animation {
    times: Vec<f64>,
    tracks: Vec<Track>,
}

#[derive(Clone, Debug)]
struct Track {
    vertices: Vec<u32>,
    home: Vec<V3>,
    centroid: V3,
    keys: Vec<(f64, Place)>, // ascending in time
}

/// Where a group is.
#[derive(Clone, Debug)]
enum Place {
    /// Turned around an axis through a centre by degrees of any size, then shifted.
    Turned { axis: V3, degrees: f64, center: V3, shift: V3 },
    /// Moved.
    Moved(RigidMotion),
    /// Each vertex where it was put.
    Put(Vec<V3>),
}

impl Place {
    fn motion(&self) -> Option<RigidMotion> {
        match self {
            Place::Turned { axis, degrees, center, shift } => {
                Some(RigidMotion::rotation(*axis, *degrees, *center).then(RigidMotion::translation(*shift)))
            }
            Place::Moved(motion) => Some(*motion),
            Place::Put(_) => None,
        }
    }
}

impl KeyframeFile {
    /// Holds the keyframes against groups of vertices; `home` says where a vertex is held or drawn to without them.
    ///
    /// # Errors
    /// A group that is not known or holds nothing, targets of another number than the group has vertices.
    pub fn resolve(
        &self,
        groups: &[(String, Vec<u32>)],
        home: impl Fn(u32) -> Option<V3>,
    ) -> Result<Animation, InputError> {
        let mut tracks: BTreeMap<&str, Track> = BTreeMap::new();
        let (first, _) = self.range();
        for (k, keyframe) in self.content.keyframes.iter().enumerate() {
            for (name, key) in &keyframe.groups {
                let refuse = |what: String, remedy: String| {
                    InputError::new(&self.name, format!("keyframe {k} (0-based), group `{name}`: {what}"), remedy)
                };
                let track = match tracks.entry(name) {
                    std::collections::btree_map::Entry::Occupied(track) => track.into_mut(),
                    std::collections::btree_map::Entry::Vacant(place) => {
                        let Some((_, vertices)) = groups.iter().find(|g| g.0 == *name) else {
                            let known: Vec<String> = groups.iter().map(|g| format!("`{}`", g.0)).collect();
                            let remedy = match known.is_empty() {
                                true => "give pins with groups (--pins)".to_string(),
                                false => format!("the groups of the pins are {}", known.join(", ")),
                            };
                            return Err(refuse("the pins have no group of this name".into(), remedy));
                        };
                        let track = Track::new(vertices, &home).ok_or_else(|| {
                            let what = "it holds no vertex, so it has nowhere to go";
                            refuse(what.into(), "name a group that is pinned or drawn by springs".into())
                        })?;
                        place.insert(track)
                    }
                };
                // A group that comes up later begins at home.
                if track.keys.is_empty() && keyframe.time > first {
                    track.keys.push((first, track.place(&Key::default())));
                }
                if let Some(targets) = key.targets.as_ref().filter(|t| t.len() != track.vertices.len()) {
                    let what = format!("{} targets for {} vertices", targets.len(), track.vertices.len());
                    return Err(refuse(what, "give one for each vertex of the group, by ascending index".into()));
                }
                track.keys.push((keyframe.time, track.place(key)));
            }
        }
        Ok(Animation { times: self.times(), tracks: tracks.into_values().collect() })
    }
}

impl Track {
    fn new(vertices: &[u32], home: &impl Fn(u32) -> Option<V3>) -> Option<Self> {
        let mut held: Vec<(u32, V3)> = vertices.iter().filter_map(|v| Some((*v, home(*v)?))).collect();
        held.sort_unstable_by_key(|h| h.0);
        let first = held.first()?.1;
        let n = held.len() as f64;
        let centroid = [0, 1, 2].map(|d| first[d] + held.iter().map(|h| h.1[d] - first[d]).sum::<f64>() / n);
        let (vertices, home) = held.into_iter().unzip();
        Some(Track { vertices, home, centroid, keys: Vec::new() })
    }

    fn place(&self, key: &Key) -> Place {
        if let Some(targets) = &key.targets {
            return Place::Put(targets.clone());
        }
        if let (Some(_), Ok(motion)) = (&key.matrix, key.rigid()) {
            return Place::Moved(motion);
        }
        let (axis, degrees, center) = key.rotate.map_or(([0.0, 0.0, 1.0], 0.0, None), |r| (r.axis, r.angle, r.center));
        Place::Turned {
            axis: unit(axis),
            degrees,
            center: center.unwrap_or(self.centroid),
            shift: key.translate.unwrap_or_default(),
        }
    }

    /// Where the vertices are at a place.
    fn at(&self, place: &Place) -> Vec<V3> {
        match (place, place.motion()) {
            (Place::Put(targets), _) => targets.clone(),
            (_, Some(motion)) if motion == RigidMotion::identity() => self.home.clone(),
            (_, motion) => {
                let motion = motion.unwrap_or_default();
                self.home.iter().map(|p| motion.apply(*p)).collect()
            }
        }
    }

    fn targets(&self, time: f64) -> Vec<V3> {
        let after = self.keys.partition_point(|k| k.0 <= time);
        let (before, next) = (after.checked_sub(1).and_then(|b| self.keys.get(b)), self.keys.get(after));
        match (before, next) {
            (Some((start, a)), Some((end, b))) => self.between(a, b, (time - start) / (end - start)),
            (Some((_, place)), None) | (None, Some((_, place))) => self.at(place),
            (None, None) => self.home.clone(),
        }
    }

    fn between(&self, a: &Place, b: &Place, s: f64) -> Vec<V3> {
        if s == 0.0 {
            return self.at(a);
        }
        if let Some(place) = turned_between(a, b, s) {
            return self.at(&place);
        }
        if let (Some(a), Some(b)) = (a.motion(), b.motion()) {
            return self.at(&Place::Moved(a.interpolate(&b, s, self.centroid)));
        }
        let pairs = self.at(a).into_iter().zip(self.at(b));
        pairs.map(|(a, b)| [0, 1, 2].map(|d| (1.0 - s) * a[d] + s * b[d])).collect()
    }
}

/// Turns around the same axis keep turning, whole turns included.
fn turned_between(a: &Place, b: &Place, s: f64) -> Option<Place> {
    let (
        Place::Turned { axis, degrees, center, shift },
        Place::Turned { axis: b_axis, degrees: to, center: b_center, shift: b_shift },
    ) = (a, b)
    else {
        return None;
    };
    let along = (0..3).map(|d| axis[d] * b_axis[d]).sum::<f64>();
    // Without a turn of its own a place has any axis.
    let (axis, center, from, to) = match (*degrees == 0.0, *to == 0.0) {
        (true, _) => (*b_axis, *b_center, 0.0, *to),
        (_, true) => (*axis, *center, *degrees, 0.0),
        _ if along.abs() > 1.0 - PARALLEL && center == b_center => (*axis, *center, *degrees, to * along.signum()),
        _ => return None,
    };
    let mix = |a: f64, b: f64| (1.0 - s) * a + s * b;
    let shift = [0, 1, 2].map(|d| mix(shift[d], b_shift[d]));
    Some(Place::Turned { axis, degrees: mix(from, to), center, shift })
}

fn unit(v: V3) -> V3 {
    // Scaled first: an axis of 1e-200 has a direction too.
    let largest = v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let v = v.map(|x| x / largest);
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}

impl Animation {
    /// The times of all frames, ascending.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Where the vertices of all groups that move are at a time. Where two groups share a vertex, the later by name wins.
    pub fn targets(&self, time: f64) -> Vec<(u32, V3)> {
        let mut out = Vec::new();
        for track in &self.tracks {
            out.extend(track.vertices.iter().copied().zip(track.targets(time)));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"
        frames = 5
        [[keyframe]]
        time = 0
        [[keyframe]]
        time = 1
        groups.hand = { rotate = { axis = [0, 0, 2], angle = 360 }, translate = [0, 0, 1] }
        [[keyframe]]
        time = 2
        groups.hand = { matrix = [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 3]] }
        groups.string = { targets = [[0, 0, 8]] }
    "#;

    fn animation() -> Animation {
        let groups = vec![("hand".to_string(), vec![3, 1]), ("string".to_string(), vec![7])];
        let home = |v: u32| match v {
            1 => Some([1.0, 0.0, 0.0]),
            3 => Some([-1.0, 0.0, 0.0]),
            7 => Some([0.0, 0.0, 0.0]),
            _ => None,
        };
        KeyframeFile::from_toml("keys.toml", FILE).unwrap().resolve(&groups, home).unwrap()
    }

    fn at(time: f64, v: u32) -> V3 {
        animation().targets(time).into_iter().find(|t| t.0 == v).unwrap().1
    }

    fn close(a: V3, b: V3) -> bool {
        (0..3).all(|d| (a[d] - b[d]).abs() < 1e-14)
    }

    #[test]
    fn turns_keep_turning_and_matrices_go_the_short_way() {
        assert_eq!(animation().times(), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(at(0.0, 1), [1.0, 0.0, 0.0]);
        assert!(close(at(0.25, 1), [0.0, 1.0, 0.25])); // a quarter of a whole turn
        assert!(close(at(0.5, 3), [1.0, 0.0, 0.5]));
        assert!(close(at(1.0, 1), [1.0, 0.0, 1.0]));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!(close(at(1.5, 1), [half, half, 2.0])); // from a whole turn, which is none, by a quarter
        assert!(close(at(9.0, 1), [0.0, 1.0, 3.0]));
        // The string waits at home for nothing: it goes to its target from the first time on.
        assert!(close(at(1.0, 7), [0.0, 0.0, 4.0]));
    }

    #[test]
    fn frames_per_second_include_the_end() {
        let text = "frames_per_second = 10\n[[keyframe]]\ntime = 0.1\n[[keyframe]]\ntime = 0.4\n";
        let times = KeyframeFile::from_toml("k", text).unwrap().times();
        assert_eq!(times.len(), 4);
        assert!((times[3] - 0.4).abs() < 1e-15);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let groups = [("hand".to_string(), vec![1]), ("wind".to_string(), vec![2])];
        let said = |body: &str| {
            let text = format!("[[keyframe]]\ntime = 0\n{body}");
            let file = KeyframeFile::from_toml("k.toml", &text);
            let end = file.and_then(|f| f.resolve(&groups, |v| (v == 1).then_some([0.0; 3])).map(|_| ()));
            end.unwrap_err().to_string()
        };
        let cases = [
            (
                "[[keyframe]]\ntime = 0",
                "k.toml: keyframe 1 (0-based): time 0 does not come after 0, that of the one before;",
            ),
            (
                "groups.foot = {}",
                "k.toml: keyframe 0 (0-based), group `foot`: the pins have no group of this name; the groups of",
            ),
            ("groups.wind = {}", "group `wind`: it holds no vertex"),
            ("groups.hand = { matrix = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]] }", "are no rotation"),
            ("groups.hand = { matrix = [[1, 0, 0, 0]] }", "`matrix` has 1 rows"),
            ("groups.hand = { targets = [] }", "0 targets for 1 vertices"),
            ("groups.hand = { translate = [0, 0, inf] }", "a number of `translate` is inf"),
            ("groups.hand = { translate = [0, 0, 1], targets = [[0, 0, 0]] }", "exclude each other"),
            ("groups.hand = { rotate = { axis = [0, 0, 0], angle = 3 } }", "the axis of `rotate` is zero"),
            (
                "groups.hand = { rotat = { axis = [0, 0, 0], angle = 3 } }",
                "line 3: unknown key `rotat`; did you mean `rotate`?",
            ),
        ];
        for (body, message) in cases {
            let text = said(body);
            assert!(text.contains(message), "{text}");
            assert_eq!(text.lines().count(), 1);
        }
        let many = "frames_per_second = 1e9\n[[keyframe]]\ntime = 0\n[[keyframe]]\ntime = 1e9\n";
        assert!(KeyframeFile::from_toml("k", many).unwrap_err().to_string().contains("frames"));
        assert!(KeyframeFile::from_toml("k", "").unwrap_err().to_string().contains("it has no keyframes"));
    }
}
