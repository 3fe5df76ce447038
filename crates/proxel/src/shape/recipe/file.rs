//! Recipes in files.

use super::super::ShapeError;
use super::Recipe;
use super::check::check;
use crate::pins::InputError;
use std::path::{Path, PathBuf};

/// A recipe and where it comes from.
#[derive(Clone, Debug)]
pub struct RecipeFile {
    /// What it says.
    pub recipe: Recipe,
    name: String,
    folder: PathBuf,
}

impl RecipeFile {
    /// Reads a TOML or JSON file, by its extension.
    ///
    /// # Errors
    /// A file that cannot be read, and what [`RecipeFile::parse`] refuses.
    pub fn read(path: &Path) -> Result<Self, ShapeError> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| ShapeError(InputError::io(path, &e).to_string()))?;
        let Ok(text) = String::from_utf8(bytes) else {
            return Err(ShapeError(format!("{name}: it is no text; give a .toml or .json file")));
        };
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let json = match extension.as_deref() {
            Some("toml") => false,
            Some("json") => true,
            _ => {
                return Err(ShapeError(format!(
                    "{name}: recipes are TOML or JSON; give a file that ends in one of them"
                )));
            }
        };
        Self::parse(name, &text, json, path.parent().map(Path::to_owned).unwrap_or_default())
    }

    /// Parses a recipe; `name` stands in messages for the file, files that it names are seen from `folder`.
    ///
    /// # Errors
    /// A syntax error, an unknown key, with the nearest known one, or a value that makes no sense.
    pub fn parse(name: String, text: &str, json: bool, folder: PathBuf) -> Result<Self, ShapeError> {
        let recipe: Result<Recipe, InputError> = match json {
            false => toml::from_str(text).map_err(|e| {
                let line = e.span().map(|s| 1 + text[..s.start.min(text.len())].matches('\n').count());
                InputError::from_serde(&name, line, e.message())
            }),
            true => serde_json::from_str(text).map_err(|e| {
                let said = e.to_string();
                let message = said.rfind(" at line ").map_or(&said[..], |at| &said[..at]);
                InputError::from_serde(&name, Some(e.line()).filter(|&l| l > 0), message)
            }),
        };
        let recipe = recipe.map_err(|e| ShapeError(e.to_string()))?;
        check(&recipe).map_err(|(place, what)| ShapeError(format!("{name}: {place}: {what}")))?;
        Ok(RecipeFile { recipe, name, folder })
    }

    /// The path of a file that the recipe names.
    pub fn path(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }

    /// The file, as the caller named it.
    pub fn name(&self) -> &str {
        &self.name
    }
}
