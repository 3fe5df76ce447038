//! Where what is scripted is at a time.

use super::scene::{MotionKey, PinSpec};
use crate::keyframes::{Animation, Key, KeyframeFile};
use crate::pins::InputError;
use proxel_model::solid::Placement;

type V3 = [f64; 3];

/// The name of the one group of an animation of its own.
const GROUP: &str = "vertices";

/// Vertices that are held, and where they go.
#[derive(Clone, Debug)]
pub(super) struct Track {
    /// The vertices and where they are at home, which is where they start.
    pub home: Vec<(u32, V3)>,
    course: Course,
}

#[derive(Clone, Debug)]
enum Course {
    Still,
    Straight(V3),
    Keys(Animation),
}

impl Track {
    /// `file` stands in messages for the scene.
    pub fn new(file: &str, pin: &PinSpec, home: Vec<(u32, V3)>) -> Result<Self, InputError> {
        let course = match (pin.velocity, pin.keyframes.is_empty()) {
            (Some(v), _) => Course::Straight(v),
            (None, true) => Course::Still,
            (None, false) => Course::Keys(animation(file, pin.keyframes.iter().map(|k| k.key()), &home)?),
        };
        Ok(Track { home, course })
    }

    /// Where each vertex is at a time.
    pub fn at(&self, time: f64) -> Vec<(u32, V3)> {
        match &self.course {
            Course::Still => self.home.clone(),
            Course::Straight(v) => self.home.iter().map(|(i, p)| (*i, [0, 1, 2].map(|d| p[d] + time * v[d]))).collect(),
            Course::Keys(animation) => animation.targets(time),
        }
    }
}

fn animation(file: &str, keys: impl Iterator<Item = (f64, Key)>, home: &[(u32, V3)]) -> Result<Animation, InputError> {
    let sorted: std::collections::BTreeMap<u32, V3> = home.iter().copied().collect();
    let keys = KeyframeFile::of_group(file, GROUP, keys)?;
    let vertices = home.iter().map(|h| h.0).collect();
    keys.resolve(&[(GROUP.to_owned(), vertices)], |v| sorted.get(&v).copied())
}

/// A rigid motion in time, from where a solid is at home.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    home: Placement,
    course: Course,
}

impl Motion {
    /// Of a solid whose own origin is at `home.shift`.
    pub fn new(file: &str, velocity: Option<V3>, keys: &[MotionKey], home: Placement) -> Result<Self, InputError> {
        let course = match (velocity, keys.is_empty()) {
            (Some(v), _) => Course::Straight(v),
            (None, true) => Course::Still,
            (None, false) => {
                let keys = keys.iter().map(|k| {
                    let key = Key { rotate: k.rotate, translate: k.translate, matrix: None, targets: None };
                    (k.time, key)
                });
                Course::Keys(animation(file, keys, &probes(home.shift))?)
            }
        };
        Ok(Motion { home, course })
    }

    /// Whether it ever moves.
    pub fn is_still(&self) -> bool {
        matches!(self.course, Course::Still)
    }

    /// Where the solid is at a time.
    pub fn at(&self, time: f64) -> Placement {
        let Placement { rotation, shift } = self.home;
        match &self.course {
            Course::Still => self.home,
            Course::Straight(v) => Placement { rotation, shift: [0, 1, 2].map(|d| shift[d] + time * v[d]) },
            Course::Keys(animation) => {
                let places = animation.targets(time);
                let Ok(p) = <[(u32, V3); 6]>::try_from(places) else { return self.home };
                // Columns of the turn are half the differences of opposite probes.
                let turn: [V3; 3] =
                    [0, 1, 2].map(|r| [0, 1, 2].map(|c: usize| (p[2 * c].1[r] - p[2 * c + 1].1[r]) / 2.0));
                let center = [0, 1, 2].map(|d| (p[0].1[d] + p[1].1[d]) / 2.0);
                let rotation = turn
                    .map(|row| [0, 1, 2].map(|c: usize| (0..3).map(|k: usize| row[k] * rotation[k][c]).sum::<f64>()));
                Placement { rotation, shift: center }
            }
        }
    }
}

/// Six points around a centre, which is their centroid: p + e_c and p - e_c.
fn probes(p: V3) -> Vec<(u32, V3)> {
    let step = |c: usize, s: f64| [0, 1, 2].map(|d| p[d] + if d == c { s } else { 0.0 });
    (0..3).flat_map(|c| [(2 * c as u32, step(c, 1.0)), (2 * c as u32 + 1, step(c, -1.0))]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pins::Rotation;

    #[test]
    fn solids_turn_around_their_centre_and_go_straight() {
        let home = Placement::at([1.0, 2.0, 3.0]);
        let rotate = Some(Rotation { axis: [0.0, 0.0, 1.0], angle: 90.0, center: None });
        let keys = [
            MotionKey { time: 0.0, rotate: None, translate: None },
            MotionKey { time: 2.0, rotate, translate: Some([0.0, 0.0, 4.0]) },
        ];
        let motion = Motion::new("s", None, &keys, home).unwrap();
        assert!(!motion.is_still());
        let end = motion.at(5.0);
        let moved = end.apply([1.0, 0.0, 0.0]);
        for (a, b) in moved.iter().zip([1.0, 3.0, 7.0]) {
            assert!((a - b).abs() < 1e-14, "{moved:?}");
        }
        let half = motion.at(1.0);
        let s = std::f64::consts::FRAC_1_SQRT_2;
        assert!((half.rotation[0][0] - s).abs() < 1e-14 && (half.shift[2] - 5.0).abs() < 1e-14);
        let straight = Motion::new("s", Some([0.0, -1.0, 0.0]), &[], home).unwrap();
        assert_eq!(straight.at(2.0).shift, [1.0, 0.0, 3.0]);
        assert_eq!(Motion::new("s", None, &[], home).unwrap().at(9.0), home);
    }
}
