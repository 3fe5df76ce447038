//! Reading and writing scenes.

use super::locate::{line_in_json, line_in_toml};
use super::{Scene, check};
use crate::pins::InputError;
use proxel_mesh::{Mesh, MeshError, read_mesh, read_points};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A scene as it was read, with what messages need.
#[derive(Clone, Debug)]
pub struct SceneFile {
    name: String,
    text: String,
    json: bool,
    folder: PathBuf,
    scene: Scene,
    meshes: BTreeMap<String, Mesh>, // in the place of the files that the scene names
}

impl SceneFile {
    /// Reads and checks a `.toml` or `.json` file; what needs its meshes is checked later.
    ///
    /// # Errors
    /// A file that cannot be read, and as [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| InputError::io(path, &e))?;
        let Ok(text) = String::from_utf8(bytes) else {
            return Err(InputError::new(name, "it is no text", "give a .toml or .json file"));
        };
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let json = match extension.as_deref() {
            Some("toml") => false,
            Some("json") => true,
            _ => {
                return Err(InputError::new(
                    name,
                    "scenes are TOML or JSON",
                    "give a file that ends in .toml or .json",
                ));
            }
        };
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        Self::parse(name, text, json, folder)
    }

    /// Parses a scene; `name` stands in messages for the file, files that it names are seen from `folder`.
    ///
    /// # Errors
    /// A syntax error, an unknown key, with the nearest known one, or a value that makes no sense; with its line.
    pub fn parse(name: String, text: String, json: bool, folder: PathBuf) -> Result<Self, InputError> {
        let scene: Result<Scene, InputError> = match json {
            false => toml::from_str(&text).map_err(|e| {
                let line = e.span().map(|s| 1 + text[..s.start.min(text.len())].matches('\n').count());
                InputError::from_serde(&name, line, e.message())
            }),
            true => serde_json::from_str(&text).map_err(|e| {
                let said = e.to_string();
                let message = said.rfind(" at line ").map_or(&said[..], |at| &said[..at]);
                InputError::from_serde(&name, Some(e.line()).filter(|&l| l > 0), message)
            }),
        };
        let mut file = SceneFile { name, text, json, folder, scene: scene?, meshes: BTreeMap::new() };
        file.scene.name_all();
        check::check(&file.scene).map_err(|(place, what, remedy)| file.refuse(&place, &what, remedy))?;
        Ok(file)
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Changes settings from outside, such as those of a command line.
    ///
    /// # Errors
    /// A scene that makes no sense any more.
    pub fn change(&mut self, change: impl FnOnce(&mut Scene)) -> Result<(), InputError> {
        change(&mut self.scene);
        check::check(&self.scene).map_err(|(place, what, remedy)| self.refuse(&place, &what, remedy))
    }

    /// The scene with everything filled in, as TOML. Files are named by their full paths, so that it can be run from
    /// anywhere.
    ///
    /// # Errors
    /// A scene that TOML cannot hold.
    pub fn completed(&self) -> Result<String, InputError> {
        let mut scene = self.scene.clone();
        let whole = |file: &mut String| {
            let path = self.path(file);
            *file = path.canonicalize().unwrap_or(path).display().to_string();
        };
        for body in &mut scene.bodies {
            body.mesh.iter_mut().chain(&mut body.start).for_each(whole);
        }
        for obstacle in &mut scene.obstacles {
            if let super::ShapeSpec::Mesh { file, .. } = &mut obstacle.shape {
                whole(file);
            }
        }
        self.to_toml(&scene)
    }

    fn to_toml(&self, scene: &Scene) -> Result<String, InputError> {
        toml::to_string(scene)
            .map_err(|e| InputError::new(&self.name, format!("it cannot be written: {e}"), "check its numbers"))
    }

    /// The scene with everything filled in, as TOML; files are named as they are in it.
    ///
    /// # Errors
    /// A scene that TOML cannot hold.
    pub(crate) fn as_toml(&self) -> Result<String, InputError> {
        self.to_toml(&self.scene)
    }

    /// The files that the scene names, each with its place and whether its positions alone are wanted.
    fn named(&self) -> Vec<(String, &str, bool)> {
        let mut out = Vec::new();
        for (k, body) in self.scene.bodies.iter().enumerate() {
            out.extend(body.mesh.iter().map(|file| (format!("body[{k}].mesh"), file.as_str(), false)));
            out.extend(body.start.iter().map(|file| (format!("body[{k}].start"), file.as_str(), true)));
        }
        for (k, obstacle) in self.scene.obstacles.iter().enumerate() {
            if let super::ShapeSpec::Mesh { file, .. } = &obstacle.shape {
                out.push((format!("obstacle[{k}].shape.mesh"), file.as_str(), false));
            }
        }
        out
    }

    /// Reads all files that the scene names now, and no file later.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn embedded(mut self) -> Result<Self, InputError> {
        // Whole meshes first: what is a start elsewhere then has its positions.
        for points_only in [false, true] {
            let wanted: Vec<(String, String)> = self
                .named()
                .into_iter()
                .filter(|(_, file, points)| *points == points_only && !self.meshes.contains_key(*file))
                .map(|(place, file, _)| (place, file.to_owned()))
                .collect();
            for (place, file) in wanted {
                let refuse = |e: MeshError| self.refuse(&place, &e.to_string(), "correct it");
                let mesh = match points_only {
                    false => self.mesh(&file).map_err(refuse)?,
                    true => Mesh { name: file.clone(), points: self.points(&file).map_err(refuse)?, ..Mesh::default() },
                };
                self.meshes.insert(file, mesh);
            }
        }
        Ok(self)
    }

    /// Puts a mesh in the place of a file.
    pub(crate) fn embed(&mut self, file: String, mesh: Mesh) {
        self.meshes.insert(file, mesh);
    }

    /// The meshes in the place of files.
    pub(crate) fn meshes(&self) -> impl Iterator<Item = (&String, &Mesh)> {
        self.meshes.iter()
    }

    /// A file that the scene names and that would have to be read.
    pub(crate) fn missing(&self) -> Option<&str> {
        self.named().into_iter().map(|(_, file, _)| file).find(|file| !self.meshes.contains_key(*file))
    }

    /// The mesh of a file that the scene names.
    pub(in crate::simulate) fn mesh(&self, file: &str) -> Result<Mesh, MeshError> {
        match self.meshes.get(file) {
            Some(mesh) => Ok(mesh.clone()),
            None => read_mesh(&self.path(file)),
        }
    }

    /// The positions of a file that the scene names.
    pub(in crate::simulate) fn points(&self, file: &str) -> Result<Vec<[f64; 3]>, MeshError> {
        match self.meshes.get(file) {
            Some(mesh) => Ok(mesh.points.clone()),
            None => read_points(&self.path(file)),
        }
    }

    /// Where a file that the scene names is.
    fn path(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }

    /// An error about the item at a place such as `body[0].density`.
    pub(in crate::simulate) fn refuse(&self, place: &str, what: &str, remedy: impl Into<String>) -> InputError {
        let error = InputError::new(&self.name, format!("{place}: {what}"), remedy);
        let line = if self.json { line_in_json(&self.text, place) } else { line_in_toml(&self.text, place) };
        match line {
            Some(line) => error.at_line(line),
            None => error,
        }
    }
}

impl Scene {
    /// Names what has no name: body0, obstacle1, pin2.
    fn name_all(&mut self) {
        let fill = |name: &mut String, kind: &str, k: usize| {
            if name.is_empty() {
                *name = format!("{kind}{k}");
            }
        };
        for (k, body) in self.bodies.iter_mut().enumerate() {
            fill(&mut body.name, "body", k);
            body.pins.iter_mut().enumerate().for_each(|(k, pin)| fill(&mut pin.name, "pin", k));
        }
        self.obstacles.iter_mut().enumerate().for_each(|(k, obstacle)| fill(&mut obstacle.name, "obstacle", k));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINIMAL: &str = "
[time]
dt = 0.1

[[body]]
generate = { bar = { cells = [1, 1, 1], size = [1, 1, 1] } }

[[obstacle]]
shape = { sphere = { center = [0, -2, 0], radius = 1 } }
";

    fn toml(text: &str) -> Result<SceneFile, InputError> {
        SceneFile::parse("s.toml".into(), text.into(), false, PathBuf::new())
    }

    #[test]
    fn defaults_are_filled_in_and_survive_a_round_trip() {
        let file = toml(MINIMAL).unwrap();
        let scene = file.scene();
        assert_eq!((scene.time.frames, scene.bodies[0].name.as_str(), scene.obstacles[0].friction), (60, "body0", 0.0));
        let text = file.completed().unwrap();
        for key in ["substeps = 1", "implicit-euler", "gravity", "tol = ", "density = 1000"] {
            assert!(text.contains(key), "{key} in {text}");
        }
        let again = toml(&text).unwrap();
        assert_eq!(again.scene(), scene);
        assert_eq!(again.completed().unwrap(), text);
        let json = serde_json::to_string_pretty(scene).unwrap();
        let from_json = SceneFile::parse("s.json".into(), json, true, PathBuf::new()).unwrap();
        assert_eq!(from_json.scene(), scene);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let cases = [
            (MINIMAL.replace("dt = 0.1", "dt = -1"), "s.toml: line 3: time.dt: it is -1; give a positive"),
            (MINIMAL.replace("dt = 0.1", "dtt = 1"), "s.toml: line 3: unknown key `dtt`; did you mean `dt`?"),
            (MINIMAL.replace("dt = 0.1", "dt = nan"), "line 3: time.dt: it is NaN"),
            (MINIMAL.replace("[[body]]", "[[body]]\ndensity = -2"), "line 6: body[0].density: it is -2"),
            (MINIMAL.replace("[[body]]", "[[body]]\nvelocity = [0, nan, 0]"), "line 6: body[0].velocity: it has a NaN"),
            (MINIMAL.replace("radius = 1", "radius = 0"), "line 9: obstacle[0].shape.sphere.radius: it is 0"),
            (MINIMAL.replace("[[body]]", "[[body]]\nvelocity = [0, -inf, 0]"), "body[0].velocity: it has an -inf"),
            (MINIMAL.replace("sphere", "spere"), "line 9: unknown name `spere`; did you mean `sphere`?"),
            (MINIMAL.replace("radius = 1", "radios = 1"), "unknown key `radios`; did you mean `radius`?"),
            ("[time]\nframes = 2\n".into(), "s.toml: body: there is none"),
            (MINIMAL.replace("generate", "mesh = \"a.obj\"\ngenerate"), "body[0].generate: it has a mesh too"),
            (MINIMAL.replace("[time]", "[solver]\nmethod = \"foo\"\n[time]"), "line 3: unknown method `foo`"),
        ];
        for (text, message) in cases {
            let said = toml(&text).map(|_| ()).unwrap_err().to_string();
            assert!(said.contains(message), "{said}\n  should have said\n{message}");
            assert_eq!(said.lines().count(), 1);
        }
        let json = "{\"time\": {\"dt\": 0.1},\n \"body\": [\n  {\"name\": \"a\",\n   \"density\": -1,\n   \"generate\": {\"ball\": {\"radius\": 1, \"cell\": 0.3}}}]}";
        let said = SceneFile::parse("s.json".into(), json.into(), true, PathBuf::new()).unwrap_err().to_string();
        assert!(said.starts_with("s.json: line 4: body[0].density: it is -1"), "{said}");
    }

    #[test]
    fn the_schema_knows_the_keys() {
        let schema = super::super::schema();
        let text = schema.to_string();
        for key in ["half-space", "angular_velocity", "substeps", "strain_limit", "keyframe", "friction"] {
            assert!(text.contains(key), "{key}");
        }
    }
}
