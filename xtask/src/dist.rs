//! `cargo xtask dist` and `cargo xtask python`: what is handed out, and the tests of the Python package. They need cargo
//! and python3 only, and keep what else they need in virtual environments below cargo's target folder.

use crate::free_threaded;
use crate::run::{Failure, Step, cargo, program, root, target_dir};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What builds wheels.
const MATURIN: &str = "maturin>=1.9,<2";

/// The environments, below the target folder.
const BUILDING_IN: &str = "maturin-venv";
const TESTING_IN: &str = "python-test-venv";
const FULL_IN: &str = "python-full-venv";

/// What the tests of the package need besides.
const TESTING: [&str; 6] = ["numpy>=1.23", "pytest>=7", "mypy>=1.8", "scipy", "trimesh>=4", "meshio>=5.3"];

/// What only the full tests need besides, as it takes long to fetch and to start.
const FULL: [&str; 5] = ["ray>=2.40", "pyarrow>=14", "pyvista>=0.43", "polyscope>=2.3", "pytetwild>=0.2"];

/// The oldest Python that the package is for.
const OLDEST: (u32, u32) = (3, 10);

/// `cargo xtask dist [--wheel] [--wheel-free-threaded] --out DIR`: the wheels that are named, and where none is named
/// the wheel, the package as source and the command.
pub fn dist(args: &[OsString]) -> Result<(), Failure> {
    let (mut stable, mut free, mut out) = (false, false, None);
    let mut args = args.iter();
    while let Some(arg) = args.next() {
        match arg.to_string_lossy().as_ref() {
            "--wheel" => stable = true,
            "--wheel-free-threaded" => free = true,
            "--out" => out = args.next().map(PathBuf::from),
            other => {
                let known = "[--wheel] [--wheel-free-threaded] --out DIR";
                return Err(Failure::usage(format!("dist has no argument `{other}`; give {known}")));
            }
        }
    }
    let out = folder(out.ok_or_else(|| Failure::usage("dist needs a folder; give --out DIR"))?)?;
    let mut written = Vec::new();
    // First, since it is what may not be there.
    if free {
        written.push(free_threaded::wheel(&out)?);
    }
    if stable || !free {
        written.push(wheel(&out)?);
    }
    if !(stable || free) {
        written.push(sources(&out)?);
        written.push(command(&out)?);
    }
    for path in written {
        let bytes = fs::metadata(&path).map_or(0, |m| m.len());
        println!("{} ({:.1} MB)", path.display(), bytes as f64 / 1e6);
    }
    Ok(())
}

/// `cargo xtask python [ARGS]`: the package as users get it, in an environment of its own, and pytest over it.
pub fn python(args: &[OsString]) -> Result<(), Failure> {
    let folder = target_dir().join("python-tests");
    make(&folder)?;
    let wheel = wheel(&folder)?;
    let full = args.first().is_some_and(|first| first == "--full");
    let venv = if full { Venv::new(FULL_IN, &[&TESTING[..], &FULL[..]].concat())? } else { testing()? };
    venv.run(["-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps"]).args([wheel]).run()?;
    // Not beside the sources, so that what is tested is what was installed.
    let tests = root().join("python").join("tests");
    venv.run(["-m", "pytest"]).args([tests]).args(args).env("PROXEL_GALLERY", pictures()).run()
}

/// Where the tests of the gallery leave its pictures.
pub fn pictures() -> PathBuf {
    target_dir().join("gallery")
}

/// A folder that an argument names, made where it is not there. Chores run in the workspace's root, their callers
/// elsewhere.
pub fn folder(named: PathBuf) -> Result<PathBuf, Failure> {
    let here = std::env::current_dir().map_err(|e| Failure::other(format!("the current folder: {e}")))?;
    let folder = here.join(named);
    make(&folder)?;
    Ok(folder)
}

fn testing() -> Result<Venv, Failure> {
    Venv::new(TESTING_IN, &TESTING)
}

/// The same within all tests: why they were skipped, where this machine has no Python for them or no way to get packages.
/// Who asks for the full tests is to have them: then nothing is skipped.
pub fn python_where_possible(full: bool) -> Result<Option<String>, Failure> {
    if full {
        return python(&["--full".into()]).map(|()| None);
    }
    let ready = Venv::new(BUILDING_IN, &[MATURIN]).and_then(|_| testing());
    match ready {
        Ok(_) => python(&[]).map(|()| None),
        Err(failure) => Ok(Some(failure.reason().to_owned())),
    }
}

/// The release of the command.
pub fn command(out: &Path) -> Result<PathBuf, Failure> {
    cargo(["build", "--release", "--package", "proxel-cli"]).run()?;
    let name = format!("proxel{}", std::env::consts::EXE_SUFFIX);
    copy(&target_dir().join("release").join(&name), &out.join(&name))
}

/// The Python package as source, with all crates that it is built from.
fn sources(out: &Path) -> Result<PathBuf, Failure> {
    let venv = Venv::new(BUILDING_IN, &[MATURIN])?;
    let manifest = root().join("python").join("Cargo.toml");
    venv.run(["-m", "maturin", "sdist", "--manifest-path"]).args([&manifest, Path::new("--out"), out]).run()?;
    let path = out.join(concat!("proxel-", env!("CARGO_PKG_VERSION"), ".tar.gz"));
    if path.exists() { Ok(path) } else { Err(Failure::other(format!("maturin left no {}", path.display()))) }
}

/// Exactly one wheel, for every Python from the oldest on.
pub fn wheel(out: &Path) -> Result<PathBuf, Failure> {
    let interpreter = Venv::new(BUILDING_IN, &[MATURIN])?.python();
    let wheel = wheel_for(&interpreter, out)?;
    match abi(&wheel).as_deref() {
        Some("abi3") => Ok(wheel),
        _ => Err(Failure::other(format!("{} is for one Python only", wheel.display()))),
    }
}

/// The third of the tags of a wheel's name: what binary interface it has.
pub fn abi(wheel: &Path) -> Option<String> {
    Some(wheel.file_stem()?.to_str()?.rsplit('-').nth(1)?.to_owned())
}

/// Exactly one wheel, as this interpreter wants it.
pub fn wheel_for(interpreter: &Path, out: &Path) -> Result<PathBuf, Failure> {
    let venv = Venv::new(BUILDING_IN, &[MATURIN])?;
    let built = target_dir().join("maturin-wheels");
    if built.exists() {
        fs::remove_dir_all(&built).map_err(|e| Failure::other(format!("{} is in the way: {e}", built.display())))?;
    }
    let manifest = root().join("python").join("Cargo.toml");
    venv.run(["-m", "maturin", "build", "--release", "--locked", "--manifest-path"])
        .args([manifest.as_os_str(), "--interpreter".as_ref(), interpreter.as_os_str(), "--out".as_ref()])
        .args([&built])
        .run()?;
    let wheels: Vec<PathBuf> = fs::read_dir(&built)
        .map_err(|e| Failure::other(format!("maturin left no {}: {e}", built.display())))?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "whl"))
        .collect();
    let [wheel] = &wheels[..] else {
        return Err(Failure::other(format!("maturin made {} wheels where one was to be: {wheels:?}", wheels.len())));
    };
    copy(wheel, &out.join(wheel.file_name().unwrap_or_default()))
}

fn copy(from: &Path, to: &Path) -> Result<PathBuf, Failure> {
    fs::copy(from, to).map_err(|e| Failure::other(format!("{} to {}: {e}", from.display(), to.display())))?;
    Ok(to.to_owned())
}

fn make(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|e| Failure::other(format!("{} cannot be made: {e}", folder.display())))
}

/// A virtual environment, kept for the next time.
pub struct Venv(PathBuf);

impl Venv {
    /// With these packages, below the target folder.
    pub fn new(name: &str, packages: &[&str]) -> Result<Self, Failure> {
        Venv::of(python3, name, packages)
    }

    /// The same of a Python that is looked for where there is no such environment yet.
    pub fn of(
        python: impl FnOnce() -> Result<OsString, Failure>,
        name: &str,
        packages: &[&str],
    ) -> Result<Self, Failure> {
        let venv = Venv(target_dir().join(name));
        if !venv.python().exists() {
            let python = python()?;
            // pip is installed by ensurepip, which some distributions keep in a package of its own.
            let has = |module: &str| quiet(Command::new(&python).args(["-c", &format!("import {module}")]));
            if !has("venv") || !has("ensurepip") {
                return Err(Failure::other(format!(
                    "`{}` has no module venv; install it (Debian, Ubuntu: apt install python3-venv)",
                    python.to_string_lossy()
                )));
            }
            program(&python, ["-m", "venv", "--clear"]).args([&venv.0]).run()?;
        }
        venv.run(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(packages).run()?;
        Ok(venv)
    }

    /// Its Python.
    pub fn python(&self) -> PathBuf {
        self.program("python")
    }

    /// A program that it has.
    pub fn program(&self, name: &str) -> PathBuf {
        let folder = if cfg!(windows) { "Scripts" } else { "bin" };
        self.0.join(folder).join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
    }

    /// Its Python with these arguments.
    pub fn run<const N: usize>(&self, args: [&str; N]) -> Step {
        program(self.python().as_os_str(), args)
    }
}

/// Whether a command succeeds, of which nothing is shown.
pub fn quiet(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
}

/// The Python that PYTHON names, or python3, where it is new enough.
fn python3() -> Result<OsString, Failure> {
    let named = std::env::var_os("PYTHON").filter(|v| !v.is_empty());
    let python = named.unwrap_or_else(|| if cfg!(windows) { "python" } else { "python3" }.into());
    let (major, minor) = OLDEST;
    let name = python.to_string_lossy();
    if !quiet(Command::new(&python).arg("--version")) {
        return Err(Failure::other(format!(
            "`{name}` cannot be started; install Python {major}.{minor} or later, or name it by PYTHON"
        )));
    }
    let test = format!("import sys; sys.exit(sys.version_info < ({major}, {minor}))");
    if !quiet(Command::new(&python).args(["-c", &test])) {
        return Err(Failure::other(format!("`{name}` is too old; give Python {major}.{minor} or later by PYTHON")));
    }
    Ok(python)
}
