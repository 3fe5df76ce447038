//! The wheel for a CPython without a global lock, which has a binary interface of its own and takes no abi3 wheel.

use crate::dist::{Venv, abi, quiet, wheel_for};
use crate::run::{Failure, target_dir};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What such a Python is called, those that are preferred first.
const NAMES: [&str; 2] = ["python3.14t", "python3.13t"];

/// What names another.
const NAMED_BY: &str = "PYTHON_FREE_THREADED";

/// What uv is asked for where there is none, and where it puts it, below the target folder.
const BROUGHT: &str = "3.14t";
const BROUGHT_TO: &str = "uv-pythons";

/// The environments, below the target folder.
const UV_IN: &str = "uv-venv";
const TRYING_IN: &str = "free-threaded-venv";

/// What fails where importing the package turns the lock on: CPython warns of that.
const TRIAL: &str = "import sys, proxel; assert not sys._is_gil_enabled(); \
                     print(f'proxel {proxel.__version__}, Python {sys.version.split()[0]} without a global lock')";

/// The wheel, once it has been imported with the lock off.
pub fn wheel(out: &Path) -> Result<PathBuf, Failure> {
    let python = interpreter()?;
    let wheel = wheel_for(Path::new(&python), out)?;
    if !abi(&wheel).is_some_and(|abi| abi.starts_with("cp3") && abi.ends_with('t')) {
        return Err(Failure::other(format!("{} is for no free-threaded Python", wheel.display())));
    }
    let venv = trial(python)?;
    venv.run(["-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps"]).args([&wheel]).run()?;
    venv.run(["-W", "error", "-c", TRIAL]).run()?;
    Ok(wheel)
}

/// An environment of this Python and no other, since the one that is named may change.
fn trial(python: OsString) -> Result<Venv, Failure> {
    let folder = target_dir().join(TRYING_IN);
    if folder.exists() {
        std::fs::remove_dir_all(&folder)
            .map_err(|e| Failure::other(format!("{} is in the way: {e}", folder.display())))?;
    }
    // Not every release of numpy has a wheel for it, and none is to be built here.
    Venv::of(|| Ok(python), TRYING_IN, &["--only-binary", ":all:", "numpy>=2.1"])
}

/// The one that is named, one on the path, or one that uv brings.
fn interpreter() -> Result<OsString, Failure> {
    if let Some(named) = std::env::var_os(NAMED_BY).filter(|v| !v.is_empty()) {
        return match is_free_threaded(&named) {
            true => Ok(named),
            false => Err(Failure::usage(format!(
                "{NAMED_BY} is `{}`, which is no free-threaded Python 3.13 or later; correct or unset it",
                named.to_string_lossy()
            ))),
        };
    }
    let here = NAMES.map(OsString::from).into_iter().find(|name| is_free_threaded(name));
    here.map_or_else(brought, Ok)
}

/// uv comes from PyPI, and the interpreter from where uv gets those, which not every machine reaches.
fn brought() -> Result<OsString, Failure> {
    let folder = target_dir().join(BROUGHT_TO);
    let uv = Venv::new(UV_IN, &["uv"])?;
    let installed = uv.run(["-m", "uv", "python", "install", BROUGHT, "--install-dir"]).args([&folder]).run();
    let found = installed.ok().and_then(|()| python_below(&folder));
    found.ok_or_else(|| {
        Failure::other(format!(
            "there is no free-threaded Python: {} are not on the path, and uv could bring no {BROUGHT}; install one \
             (python.org, a distribution, `uv python install {BROUGHT}`), or name it by {NAMED_BY}",
            NAMES.join(" and ")
        ))
    })
}

/// uv puts each interpreter into a folder that has its version and its platform in the name.
fn python_below(folder: &Path) -> Option<OsString> {
    let below = |root: PathBuf| match cfg!(windows) {
        true => root.join("python.exe"),
        false => root.join("bin").join("python3"),
    };
    let roots = std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    roots.map(|root| below(root).into_os_string()).find(|python| is_free_threaded(python))
}

fn is_free_threaded(python: &OsStr) -> bool {
    let test = "import sys, sysconfig; \
                sys.exit(not (sys.version_info >= (3, 13) and sysconfig.get_config_var('Py_GIL_DISABLED')))";
    quiet(Command::new(python).args(["-c", test]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_tell_their_binary_interface() {
        let abi_of = |name: &str| abi(Path::new(name)).unwrap();
        assert_eq!(abi_of("dist/proxel-0.1.0-cp310-abi3-manylinux_2_34_x86_64.whl"), "abi3");
        assert_eq!(abi_of("proxel-0.1.0-cp314-cp314t-macosx_11_0_arm64.whl"), "cp314t");
        assert_eq!(abi(Path::new("proxel.whl")), None);
    }

    #[test]
    fn other_programs_are_no_free_threaded_python() {
        assert!(!is_free_threaded(OsStr::new("no-such-python")));
        // A program that succeeds whatever it is given would be taken for one; cargo does not.
        assert!(!is_free_threaded(&std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())));
    }
}
