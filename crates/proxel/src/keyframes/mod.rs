//! Handles in motion: where groups of pins are at given times, read from a small file.
//!
//! ```toml
//! frames_per_second = 24                        # or frames = 49, evenly from the first time to the last
//!
//! [[keyframe]]                                  # groups that it does not name are where the pins have them
//! time = 0
//!
//! [[keyframe]]
//! time = 1.5
//! [keyframe.groups.hand]
//! rotate = { axis = [0, 0, 1], angle = 90 }     # degrees, around the centroid of the group
//! translate = [0, 0.5, 0]
//!
//! [[keyframe]]
//! time = 2
//! [keyframe.groups.hand]
//! matrix = [[1, 0, 0, 0.2], [0, 1, 0, 0], [0, 0, 1, 0]]
//! [keyframe.groups.string]
//! targets = [[0, 3, 0], [0, 3, 0.1]]
//! ```
//!
//! Motions apply to where the pins have the vertices; an empty table, `hand = {}`, brings a group back there. Between two
//! keyframes that name a group it moves from one to the other: rotations turn about one axis at constant speed, the group's
//! centroid and targets go straight. Before the first and after the last that name it, it rests.
//!
//! [`KeyframeFile::read`] parses and checks what can be checked alone, [`KeyframeFile::resolve`] holds it against the groups
//! of a body, [`Animation::targets`] says where vertices are at a time.

mod file;
mod track;

pub use file::{Key, Keyframe, KeyframeFile};
pub use track::Animation;
