//! Running other programs.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, ExitStatus};

/// Bad usage, as in `proxel`.
const USAGE: u8 = 2;

/// Why a chore ends early, and the exit status to end with.
#[derive(Debug)]
pub struct Failure {
    reason: String,
    code: u8,
}

impl Failure {
    /// Something that the caller of the chore has to change.
    pub fn usage(reason: impl Into<String>) -> Self {
        Failure { reason: reason.into(), code: USAGE }
    }

    /// Something that went wrong.
    pub fn other(reason: impl Into<String>) -> Self {
        Failure { reason: reason.into(), code: 1 }
    }

    /// What it says.
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// Says it and gives the exit status.
    pub fn report(&self) -> ExitCode {
        eprintln!("xtask: {}", self.reason);
        ExitCode::from(self.code)
    }
}

/// A command of a chore, run in the workspace's root.
pub struct Step(Command);

/// cargo with these arguments.
pub fn cargo<const N: usize>(args: [&str; N]) -> Step {
    // Cargo tells the programs that it runs which cargo it is.
    program(&std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()), args)
}

/// Another program with these arguments.
pub fn program<const N: usize>(program: &OsStr, args: [&str; N]) -> Step {
    let mut command = Command::new(program);
    command.args(args).current_dir(root());
    // Set by cargo for xtask itself; what xtask runs has a package of its own.
    command.env_remove("CARGO_MANIFEST_DIR");
    Step(command)
}

/// The command proxel as released, with these arguments.
pub fn proxel<const N: usize>(args: [&str; N]) -> Step {
    cargo(["run", "--release", "--quiet", "--package", "proxel-cli", "--"]).args(args)
}

impl Step {
    /// With more arguments.
    pub fn args(mut self, args: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Self {
        self.0.args(args);
        self
    }

    /// With an environment variable.
    pub fn env(mut self, name: &str, value: impl AsRef<OsStr>) -> Self {
        self.0.env(name, value);
        self
    }

    /// The command line, to show.
    pub fn line(&self) -> String {
        let words = self.0.get_args().map(OsStr::to_string_lossy);
        let program = Path::new(self.0.get_program()).file_stem().unwrap_or_default().to_string_lossy();
        std::iter::once(program).chain(words).collect::<Vec<_>>().join(" ")
    }

    /// Runs it and waits.
    pub fn run(mut self) -> Result<(), Failure> {
        let line = self.line();
        eprintln!("$ {line}");
        let status = self.0.status().map_err(|e| cannot_start(&line, &e))?;
        check(&line, status)
    }

    /// The command, to run otherwise than by [`Step::run`].
    pub fn command(&mut self) -> &mut Command {
        &mut self.0
    }
}

/// Runs the steps up to the first that fails.
pub fn all(steps: impl IntoIterator<Item = Step>) -> Result<(), Failure> {
    steps.into_iter().try_for_each(Step::run)
}

/// That a program cannot be started.
pub fn cannot_start(line: &str, e: &std::io::Error) -> Failure {
    Failure::other(format!("`{line}` cannot be started: {e}"))
}

/// The exit status of a program as a result.
pub fn check(line: &str, status: ExitStatus) -> Result<(), Failure> {
    if status.success() {
        return Ok(());
    }
    // Without a code it was ended by a signal.
    let code = status.code().and_then(|c| u8::try_from(c).ok()).unwrap_or(1);
    Err(Failure { reason: format!("`{line}` failed: {status}"), code })
}

/// The workspace's root.
pub fn root() -> PathBuf {
    let here = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    here.parent().map_or(here.clone(), PathBuf::from)
}

/// Where cargo builds.
pub fn target_dir() -> PathBuf {
    let dir: OsString = std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    root().join(dir)
}
