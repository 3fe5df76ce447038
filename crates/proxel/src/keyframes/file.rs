//! Keyframes as TOML and JSON describe them.

use crate::pins::{InputError, RigidMotion, Rotation};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Frames a second where a file does not say.
const FRAMES_PER_SECOND: f64 = 24.0;
/// Frames that no file asks for in earnest.
pub(super) const MOST_FRAMES: usize = 100_000;

/// A keyframes file as it was written: not yet held against any groups.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyframeFile {
    pub(super) name: String,
    pub(super) content: Content,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Content {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_per_second: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<usize>,
    #[serde(default, rename = "keyframe")]
    pub keyframes: Vec<Keyframe>,
}

/// Where some groups are at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// In seconds.
    pub time: f64,
    /// Groups by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, Key>,
}

/// Where a group is: `rotate`, then `translate`; or `matrix`; or `targets`; with none of them, at home.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// A turn around an axis through `center`, or the centroid of the group.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// A shift, after the turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// x -> R x + t as rows [R | t], and perhaps a last row [0, 0, 0, 1]; R must be a rotation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<Vec<[f64; 4]>>,
    /// Where each vertex is, in the order of the group's vertices, ascending.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub targets: Option<Vec<[f64; 3]>>,
}

impl KeyframeFile {
    /// Reads a `.toml` or `.json` file.
    ///
    /// # Errors
    /// A file that cannot be read or has another extension, and as [`Self::from_toml`].
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| InputError::io(path, &e))?;
        let Ok(text) = String::from_utf8(bytes) else {
            return Err(InputError::new(name, "it is no text", "give a .toml or .json file"));
        };
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("toml") => Self::from_toml(name, &text),
            Some("json") => Self::from_json(name, &text),
            _ => Err(InputError::new(name, "keyframes are TOML or JSON", "give a file that ends in .toml or .json")),
        }
    }

    /// Parses TOML; `name` stands in messages for the file.
    ///
    /// # Errors
    /// A syntax error, an unknown key, times that do not ascend, a matrix that is no rigid motion.
    pub fn from_toml(name: impl Into<String>, text: &str) -> Result<Self, InputError> {
        let name = name.into();
        let content: Content = toml::from_str(text).map_err(|e| {
            let line = e.span().map(|s| 1 + text[..s.start.min(text.len())].matches('\n').count());
            InputError::from_serde(&name, line, e.message())
        })?;
        Self::checked(name, content)
    }

    /// Parses JSON: `{"frames": 3, "keyframe": [{"time": 0}, {"time": 1, "groups": {"hand": {"translate": [0, 1, 0]}}}]}`.
    ///
    /// # Errors
    /// As [`Self::from_toml`].
    pub fn from_json(name: impl Into<String>, text: &str) -> Result<Self, InputError> {
        let name = name.into();
        let content: Content = serde_json::from_str(text).map_err(|e| {
            let said = e.to_string();
            let message = said.rfind(" at line ").map_or(&said[..], |at| &said[..at]);
            InputError::from_serde(&name, Some(e.line()).filter(|&l| l > 0), message)
        })?;
        Self::checked(name, content)
    }

    /// The keys of one group; `name` stands in messages for the file.
    ///
    /// # Errors
    /// As [`Self::from_toml`].
    pub(crate) fn of_group(
        name: impl Into<String>,
        group: &str,
        keys: impl IntoIterator<Item = (f64, Key)>,
    ) -> Result<Self, InputError> {
        let keyframe = |(time, key)| Keyframe { time, groups: BTreeMap::from([(group.to_owned(), key)]) };
        let keyframes = keys.into_iter().map(keyframe).collect();
        Self::checked(name.into(), Content { frames_per_second: None, frames: Some(1), keyframes })
    }

    fn checked(name: String, content: Content) -> Result<Self, InputError> {
        let refuse = |what: String, remedy: &str| Err(InputError::new(name.clone(), what, remedy));
        if content.keyframes.is_empty() {
            return refuse("it has no keyframes".into(), "add a section [[keyframe]] with a time");
        }
        if let Some(fps) = content.frames_per_second.filter(|f| !(*f > 0.0 && f.is_finite())) {
            return refuse(format!("frames_per_second is {fps}"), "give a positive number");
        }
        match (content.frames, content.frames_per_second) {
            (Some(0), _) => return refuse("frames is 0".into(), "give at least 1"),
            (Some(_), Some(_)) => {
                return refuse("it has both frames and frames_per_second".into(), "keep one of them");
            }
            _ => {}
        }
        for (k, keyframe) in content.keyframes.iter().enumerate() {
            let time = keyframe.time;
            if !time.is_finite() {
                return refuse(format!("keyframe {k} (0-based): time is {time}"), "give a finite number of seconds");
            }
            if let Some(before) = k.checked_sub(1).map(|b| content.keyframes[b].time).filter(|b| *b >= time) {
                return refuse(
                    format!("keyframe {k} (0-based): time {time} does not come after {before}, that of the one before"),
                    "put keyframes in the order of their times",
                );
            }
            for (group, key) in &keyframe.groups {
                if let Err((what, remedy)) = key.check() {
                    return refuse(format!("keyframe {k} (0-based), group `{group}`: {what}"), remedy);
                }
            }
        }
        let file = KeyframeFile { name, content };
        let frames = file.frame_count();
        if frames > MOST_FRAMES as f64 {
            let what = format!("it asks for {frames} frames");
            return Err(InputError::new(file.name, what, "lower frames_per_second, or give frames"));
        }
        Ok(file)
    }

    /// First and last time.
    pub(super) fn range(&self) -> (f64, f64) {
        let time = |k: Option<&Keyframe>| k.map_or(0.0, |k| k.time);
        (time(self.content.keyframes.first()), time(self.content.keyframes.last()))
    }

    /// A whole number, but perhaps more than fits one.
    fn frame_count(&self) -> f64 {
        let (first, last) = self.range();
        let fps = self.content.frames_per_second.unwrap_or(FRAMES_PER_SECOND);
        // A last frame that rounding would put behind the end is meant to be there.
        self.content.frames.map_or_else(|| ((last - first) * fps + 1e-9).floor() + 1.0, |n| n as f64)
    }

    /// The times of all frames.
    pub fn times(&self) -> Vec<f64> {
        let (first, last) = self.range();
        let count = self.frame_count() as usize; // checked to be small
        let fps = self.content.frames_per_second.unwrap_or(FRAMES_PER_SECOND);
        let at = |k: usize| match self.content.frames {
            Some(1) => first,
            Some(n) => first + (last - first) * (k as f64 / (n - 1) as f64),
            None => first + k as f64 / fps,
        };
        (0..count).map(at).collect()
    }
}

impl Key {
    /// What can be said without a body.
    fn check(&self) -> Result<(), (String, &'static str)> {
        let motion = self.rotate.is_some() || self.translate.is_some();
        let ways = usize::from(motion) + usize::from(self.matrix.is_some()) + usize::from(self.targets.is_some());
        if ways > 1 {
            return Err(("rotate and translate, matrix, and targets exclude each other".into(), "keep one of them"));
        }
        let rotate =
            self.rotate.iter().flat_map(|r| r.axis.into_iter().chain([r.angle]).chain(r.center.into_iter().flatten()));
        let rotate = rotate.map(|v| ("rotate", v));
        let translate = self.translate.into_iter().flatten().map(|v| ("translate", v));
        let matrix = self.matrix.iter().flatten().flatten().map(|v| ("matrix", *v));
        let targets = self.targets.iter().flatten().flatten().map(|v| ("targets", *v));
        if let Some((key, v)) = rotate.chain(translate).chain(matrix).chain(targets).find(|(_, v)| !v.is_finite()) {
            return Err((format!("a number of `{key}` is {v}"), "give a finite number"));
        }
        if self.rotate.is_some_and(|r| r.axis == [0.0; 3]) {
            return Err(("the axis of `rotate` is zero".into(), "give it a direction"));
        }
        if self.matrix.is_some() {
            self.rigid()?;
        }
        Ok(())
    }

    /// The motion of `matrix`.
    pub(super) fn rigid(&self) -> Result<RigidMotion, (String, &'static str)> {
        let rows = self.matrix.as_deref().unwrap_or_default();
        let (three, last) = match rows {
            [a, b, c] => ([*a, *b, *c], None),
            [a, b, c, d] => ([*a, *b, *c], Some(*d)),
            _ => return Err((format!("`matrix` has {} rows", rows.len()), "give three rows [R | t]")),
        };
        if let Some(last) = last.filter(|l| *l != [0.0, 0.0, 0.0, 1.0]) {
            return Err((format!("the last row of `matrix` is {last:?}"), "give [0, 0, 0, 1], or leave it out"));
        }
        let motion = RigidMotion::from_rows(three.map(|r| [r[0], r[1], r[2]]), three.map(|r| r[3]));
        motion.ok_or_else(|| {
            let what = "the first three columns of `matrix` are no rotation: handles move rigidly";
            (what.into(), "give rows that are orthonormal to five digits and no reflection, or give targets")
        })
    }
}
