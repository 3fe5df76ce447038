//! `cargo xtask site`: the documents as pages with a gallery, for which the examples of the Python package are run.

use crate::dist::{Venv, command, folder, wheel};
use crate::run::{Failure, root, target_dir};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The environment, below the target folder, and what builds the pages in it.
const BUILDING_IN: &str = "site-venv";
const MKDOCS: [&str; 3] = ["mkdocs>=1.6,<2", "mkdocs-material>=9.5,<10", "numpy>=1.23"];

/// `cargo xtask site --out DIR`.
pub fn site(args: &[OsString]) -> Result<(), Failure> {
    let out = match args {
        [flag, out] if flag == "--out" => folder(PathBuf::from(out))?,
        _ => return Err(Failure::usage("site needs a folder and nothing else; give --out DIR")),
    };
    build(&out, None)
}

/// Into a folder; with pictures that the tests of the gallery have left, else its examples are run.
pub fn build(out: &Path, pictures: Option<&Path>) -> Result<(), Failure> {
    let venv = Venv::new(BUILDING_IN, &MKDOCS)?;
    let built = folder(target_dir().join("site-parts"))?;
    let program = command(&built)?;
    let script = root().join("docs").join("site").join("build.py");
    let step = venv
        .run([])
        .args([script.as_os_str(), "--out".as_ref(), out.as_os_str(), "--program".as_ref()])
        .args([program]);
    match pictures {
        Some(pictures) => step.args(["--pictures".as_ref(), pictures.as_os_str()]).run(),
        None => {
            let wheel = wheel(&built)?;
            venv.run(["-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps"]).args([wheel]).run()?;
            step.run()
        }
    }
}
