//! Named groups as TOML and JSON describe them.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::InputError;
use super::around::{Around, EqualityRow};

/// A group of vertices and what happens to them. Vertices are chosen by their rest positions;
/// with a `stiffness` they are pulled by springs, with a `force` pushed, else pinned.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// Chooses these vertices, 0-based.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub indices: Option<Vec<Index>>,
    /// Chooses the vertices in an axis-aligned box, its faces included.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub region: Option<Region>,
    /// Chooses the vertices in a ball, its surface included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<Sphere>,
    /// Chooses the vertices on one side of a plane, the plane included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<HalfSpace>,
    /// Whether a vertex must be in all of the above (the default) or in any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub combine: Option<Combine>,
    /// Scales the rest positions around the centre: a factor or one for each axis. Done first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Scaling>,
    /// Rotates around an axis through the centre. Done second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// Moves, in the units of the mesh. Done last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// The target of each vertex of `indices`, instead of scaling, rotation and translation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub targets: Option<Vec<[f64; 3]>>,
    /// k of the spring energy k/2 |x - target|^2 of each vertex, which replaces the exact pin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// A load on the vertices, which replaces the pin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<Force>,
    /// A load on the faces whose corners are all in the group, force over area along the outward normal, which replaces the
    /// pin: positive ones inflate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<f64>,
}

/// The box from `min` to `max`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The smallest corner.
    pub min: [f64; 3],
    /// The largest corner.
    pub max: [f64; 3],
}

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Its centre.
    pub center: [f64; 3],
    /// Its radius.
    pub radius: f64,
}

/// The side of a plane that its normal points to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSpace {
    /// A point of the plane.
    pub point: [f64; 3],
    /// Its normal, of any length.
    pub normal: [f64; 3],
}

/// How several ways to choose vertices go together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Combine {
    /// In all of them.
    #[default]
    All,
    /// In any of them.
    Any,
}

/// A rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Its axis, of any length.
    pub axis: [f64; 3],
    /// Its angle in degrees, by the right-hand rule.
    pub angle: f64,
    /// A point of the axis; the centroid of the group's rest positions if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<[f64; 3]>,
}

/// A scaling; in the file also one factor (`scale = 2`) or three.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "ScalingText")]
pub struct Scaling {
    /// The factor along each axis.
    pub factors: [f64; 3],
    /// The fixed point; the centroid of the group's rest positions if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<[f64; 3]>,
}

/// The ways to write a scaling.
#[derive(Deserialize)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "expected a factor, three factors, or { factors = [x, y, z], center = [x, y, z] }"
)]
enum ScalingText {
    Uniform(f64),
    Axes([f64; 3]),
    Around {
        factors: [f64; 3],
        #[serde(default)]
        center: Option<[f64; 3]>,
    },
}

impl From<ScalingText> for Scaling {
    fn from(text: ScalingText) -> Self {
        match text {
            ScalingText::Uniform(s) => Scaling { factors: [s; 3], center: None },
            ScalingText::Axes(factors) => Scaling { factors, center: None },
            ScalingText::Around { factors, center } => Scaling { factors, center },
        }
    }
}

/// A load on a group.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Force {
    /// This force in all, each vertex its equal share.
    Total([f64; 3]),
    /// This force on each vertex.
    Each([f64; 3]),
}

/// A 0-based vertex index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, schemars::JsonSchema)]
#[serde(transparent)]
pub struct Index(pub u32);

impl<'de> Deserialize<'de> for Index {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct OneIndex;
        impl Visitor<'_> for OneIndex {
            type Value = Index;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a 0-based vertex index")
            }
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Index, E> {
                match u32::try_from(v) {
                    Ok(v) if v < u32::MAX => Ok(Index(v)),
                    _ if v < 0 => Err(E::custom(format!("vertex index {v} is negative"))),
                    _ => Err(E::custom(format!("vertex index {v} is too large for any mesh"))),
                }
            }
            fn visit_u64<E: de::Error>(self, v: u64) -> Result<Index, E> {
                self.visit_i64(i64::try_from(v).unwrap_or(i64::MAX))
            }
        }
        d.deserialize_i64(OneIndex)
    }
}

/// The whole file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default, deserialize_with = "unique_names", skip_serializing_if = "BTreeMap::is_empty")]
    groups: BTreeMap<String, Group>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    equality: Vec<EqualityRow>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    obstacle: Vec<HalfSpace>,
}

/// What a file says.
pub(super) type Said = (BTreeMap<String, Group>, Around);

/// A map of groups that refuses a name given twice (JSON would let the last one win).
fn unique_names<'de, D: Deserializer<'de>>(d: D) -> Result<BTreeMap<String, Group>, D::Error> {
    struct Groups;
    impl<'de> Visitor<'de> for Groups {
        type Value = BTreeMap<String, Group>;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("groups by name")
        }
        fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Self::Value, M::Error> {
            let mut out = BTreeMap::new();
            while let Some((name, group)) = map.next_entry::<String, Group>()? {
                if out.contains_key(&name) {
                    return Err(de::Error::custom(format!("group `{name}` is there twice")));
                }
                out.insert(name, group);
            }
            Ok(out)
        }
    }
    d.deserialize_map(Groups)
}

pub(super) fn parse_toml(name: &str, content: &str) -> Result<Said, InputError> {
    let file: File = toml::from_str(content).map_err(|e| {
        let line = e.span().map(|s| 1 + content[..s.start.min(content.len())].matches('\n').count());
        InputError::from_serde(name, line, e.message())
    })?;
    checked(name, file)
}

pub(super) fn parse_json(name: &str, content: &str) -> Result<Said, InputError> {
    let file: File = serde_json::from_str(content).map_err(|e| {
        let text = e.to_string();
        let message = text.rfind(" at line ").map_or(&text[..], |at| &text[..at]);
        InputError::from_serde(name, Some(e.line()).filter(|&l| l > 0), message)
    })?;
    checked(name, file)
}

pub(super) fn to_toml(name: &str, groups: &BTreeMap<String, Group>, around: &Around) -> Result<String, InputError> {
    toml::to_string(&file(groups, around)).map_err(|e| unwritable(name, &e))
}

pub(super) fn to_json(name: &str, groups: &BTreeMap<String, Group>, around: &Around) -> Result<String, InputError> {
    let text = serde_json::to_string_pretty(&file(groups, around));
    text.map(|t| t + "\n").map_err(|e| unwritable(name, &e))
}

fn file(groups: &BTreeMap<String, Group>, around: &Around) -> File {
    File { groups: groups.clone(), equality: around.equalities.clone(), obstacle: around.obstacles.clone() }
}

fn unwritable(name: &str, e: &dyn fmt::Display) -> InputError {
    InputError::new(name, format!("the groups cannot be written: {e}"), "check the group names")
}

fn checked(name: &str, file: File) -> Result<Said, InputError> {
    let around = Around { equalities: file.equality, obstacles: file.obstacle };
    around.check(name)?;
    if file.groups.is_empty() && around.is_empty() {
        return Err(InputError::new(name, "it has no groups", "add a group such as [groups.hand]"));
    }
    for (group, spec) in &file.groups {
        spec.check().map_err(|(what, remedy)| InputError::new(name, format!("group `{group}`: {what}"), remedy))?;
    }
    Ok((file.groups, around))
}

impl Group {
    /// Whether its targets are not simply the start positions.
    pub fn moves(&self) -> bool {
        self.targets.is_some() || self.translate.is_some() || self.rotate.is_some() || self.scale.is_some()
    }

    /// What can be said without a mesh.
    pub(crate) fn check(&self) -> Result<(), (String, &'static str)> {
        let chosen = self.indices.is_some() || self.region.is_some() || self.sphere.is_some();
        if !chosen && self.plane.is_none() {
            return Err(("it chooses no vertices".into(), "add indices, box, sphere or plane"));
        }
        self.check_numbers()?;
        if let Some(r) = &self.region
            && let Some(c) = (0..3).find(|&c| r.min[c] > r.max[c])
        {
            let axis = ["x", "y", "z"][c];
            return Err((format!("the box has its {axis} from {} to {}", r.min[c], r.max[c]), "swap min and max"));
        }
        if let Some(s) = self.sphere.filter(|s| s.radius < 0.0) {
            return Err((format!("the radius is {}", s.radius), "give a radius of zero or more"));
        }
        let zero = [0.0; 3];
        if self.plane.is_some_and(|p| p.normal == zero) || self.rotate.is_some_and(|r| r.axis == zero) {
            return Err(("a normal or axis is zero".into(), "give it a direction"));
        }
        if let Some(k) = self.stiffness.filter(|&k| k <= 0.0) {
            return Err((format!("the stiffness is {k}"), "give a positive stiffness, or none for exact pins"));
        }
        let loaded = self.force.is_some() || self.pressure.is_some();
        if loaded && (self.moves() || self.stiffness.is_some() || (self.force.is_some() && self.pressure.is_some())) {
            return Err((
                "a force, a pressure and a target exclude each other".into(),
                "put each load in a group of its own",
            ));
        }
        self.check_targets()
    }

    fn check_targets(&self) -> Result<(), (String, &'static str)> {
        let Some(targets) = &self.targets else { return Ok(()) };
        if self.translate.is_some() || self.rotate.is_some() || self.scale.is_some() {
            return Err((
                "targets and a translation, rotation or scaling exclude each other".into(),
                "keep one of them",
            ));
        }
        let only = self.region.is_none() && self.sphere.is_none() && self.plane.is_none();
        match &self.indices {
            Some(indices) if only && indices.len() == targets.len() => Ok(()),
            Some(indices) if only => Err((
                format!("{} targets for {} indices", targets.len(), indices.len()),
                "give one target for each index",
            )),
            _ => Err(("targets need indices, and no box, sphere or plane".into(), "list the indices")),
        }
    }

    /// TOML has `nan` and `inf`, and 1e999 is infinite everywhere.
    fn check_numbers(&self) -> Result<(), (String, &'static str)> {
        let vectors = [
            ("box", self.region.map(|r| r.min)),
            ("box", self.region.map(|r| r.max)),
            ("sphere", self.sphere.map(|s| s.center)),
            ("plane", self.plane.map(|p| p.point)),
            ("plane", self.plane.map(|p| p.normal)),
            ("scale", self.scale.map(|s| s.factors)),
            ("scale", self.scale.and_then(|s| s.center)),
            ("rotate", self.rotate.map(|r| r.axis)),
            ("rotate", self.rotate.and_then(|r| r.center)),
            ("translate", self.translate),
            (
                "force",
                self.force.map(|f| match f {
                    Force::Total(f) | Force::Each(f) => f,
                }),
            ),
        ];
        let scalars = [
            ("sphere", self.sphere.map(|s| s.radius)),
            ("rotate", self.rotate.map(|r| r.angle)),
            ("stiffness", self.stiffness),
            ("pressure", self.pressure),
        ];
        let targets = self.targets.iter().flatten().map(|t| ("targets", *t));
        let vectors = vectors.into_iter().filter_map(|(key, v)| Some((key, v?))).chain(targets);
        let numbers = vectors.flat_map(|(key, v)| v.map(|x| (key, x)));
        let mut numbers = numbers.chain(scalars.into_iter().filter_map(|(key, x)| Some((key, x?))));
        match numbers.find(|(_, x)| !x.is_finite()) {
            None => Ok(()),
            Some((key, x)) => Err((format!("a number of `{key}` is {x}"), "give a finite number")),
        }
    }
}
