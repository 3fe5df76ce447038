//! One mesh of a batch: from the list's item to a line of results.

use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime};

use proxel::report::Report;

use super::child::{self, Asked, Ended};
use super::hash::hash_file;
use super::list::{Item, text_of};
use super::options::Options;
use super::results::{End, Record};

/// A child that heeds its time limit needs time to read and to write too; one that has not ended after twice the
/// limit and this hangs.
const GRACE: Duration = Duration::from_secs(10);
/// Longest reason.
const REASON: usize = 500;

/// What all meshes have in common.
pub struct Run {
    pub program: PathBuf,
    /// Absolute.
    pub out: PathBuf,
    pub options: Options,
    /// Bytes.
    pub memory: Option<u64>,
    /// Of a child that is not told another number.
    pub threads: usize,
}

/// A mesh that is ready to be run.
pub struct Job<'a> {
    run: &'a Run,
    item: &'a Item,
    options: Options,
    report: PathBuf,
    /// Where the map goes.
    pub target: PathBuf,
    /// What is known beforehand.
    pub record: Record,
}

impl Run {
    /// Reads the mesh for its hash, no more.
    pub fn job<'a>(&'a self, item: &'a Item) -> Job<'a> {
        let options = self.options.overridden_by(&item.options);
        let mut name = Path::new("reports").join(&item.out).into_os_string();
        name.push(".json");
        let record = Record {
            mesh: text_of(&item.name),
            out: text_of(&item.out),
            written: false,
            status: End::Refused,
            exit_code: None,
            signal: None,
            reason: String::new(),
            seconds: 0.0,
            peak_bytes: None,
            energy: None,
            flips: None,
            overlaps: None,
            charts: None,
            report: None,
            // A pipe would wait forever for somebody to write.
            input_sha256: item.mesh.is_file().then(|| hash_file(&item.mesh).ok()).flatten(),
            options_sha256: options.hash(),
            options: options.words().map(|w| text_of(Path::new(w))).collect(),
        };
        Job { run: self, item, options, report: self.out.join(&name), target: self.out.join(&item.out), record }
    }
}

impl Job<'_> {
    /// Runs it.
    pub fn run(self, asked: &Asked) -> Record {
        if self.record.input_sha256.is_none() {
            let why = match std::fs::metadata(&self.item.mesh) {
                Ok(m) if !m.is_file() => "it is no file".to_owned(),
                Ok(_) => "it cannot be read".to_owned(),
                Err(e) => e.to_string(),
            };
            let reason = format!("{} ({}): {why}; check the path", self.item.mesh.display(), self.item.place);
            return Record { reason, ..self.record };
        }
        for file in [&self.target, &self.report] {
            let folder = file.parent().unwrap_or(&self.run.out);
            if let Err(e) = std::fs::create_dir_all(folder) {
                let reason = format!("{}: the folder cannot be made: {e}; move what is in the way", folder.display());
                return Record { status: End::Failed, reason, ..self.record };
            }
        }
        // The report of an earlier run must not pass for that of this one.
        let _ = std::fs::remove_file(&self.report);
        let before = Stamp::of(&self.target);
        let hard = self.options.time_limit.map(|s| Duration::try_from_secs_f64(2.0 * s).unwrap_or_default() + GRACE);
        match child::run(&mut self.command(), hard, asked) {
            Err(e) => {
                let reason = format!("no process can be started: {e}; use fewer --jobs");
                Record { status: End::Failed, reason, ..self.record }
            }
            Ok(end) => {
                let written = Stamp::of(&self.target) != before;
                self.ended(&end, written)
            }
        }
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.run.program);
        command.arg("unwrap").arg(&self.item.mesh).arg("--out").arg(&self.target).arg("--report").arg(&self.report);
        command.arg("--quiet").arg("--threads").arg(self.options.threads.unwrap_or(self.run.threads).to_string());
        if let Some(seconds) = self.options.time_limit {
            command.arg(format!("--time-limit={seconds}"));
        }
        command.args(self.options.words());
        child::prepare(&mut command, self.run.memory);
        command
    }

    fn ended(self, end: &Ended, written: bool) -> Record {
        let text = std::fs::read_to_string(&self.report).ok();
        let report: Option<Report> = text.and_then(|t| serde_json::from_str(&t).ok());
        let (status, why) = verdict(end, self.run.memory);
        let reason = match (&report, why) {
            (_, Some(why)) => why,
            (Some(r), None) => r.reason.clone(),
            (None, None) => last_error(&end.messages),
        };
        let map = report.as_ref().and_then(|r| r.map.as_ref());
        Record {
            written,
            status,
            exit_code: end.code,
            signal: end.signal,
            reason: reason.chars().take(REASON).collect(),
            seconds: end.seconds,
            peak_bytes: report.as_ref().and_then(|r| r.peak_bytes),
            energy: report.as_ref().and_then(|r| r.energy),
            flips: map.map(|m| m.flips),
            overlaps: map.map(|m| m.overlaps),
            charts: map.map(|m| m.charts),
            report: report.is_some().then(|| text_of(self.report.strip_prefix(&self.run.out).unwrap_or(&self.report))),
            ..self.record
        }
    }
}

/// The status, and the reason where the child cannot have said it.
fn verdict(end: &Ended, memory: Option<u64>) -> (End, Option<String>) {
    if end.overdue {
        let why = format!("killed after {:.1} s: it did not heed its time limit", end.seconds);
        return (End::Timeout, Some(why));
    }
    match end.code {
        Some(0) => (End::Converged, None),
        Some(1) => (End::Failed, None),
        Some(2) => (End::Refused, None),
        Some(3) => (End::Stopped, None),
        Some(130) => (End::Cancelled, None),
        _ if end.asked => (End::Cancelled, Some("cancelled".to_owned())),
        code => {
            // What Rust says when an allocation fails, before it aborts; a backtrace may follow, which would hide the remedy.
            if let Some(said) = end.messages.lines().find(|line| line.contains("memory allocation of")) {
                let limit = memory.map_or("raise the machine's memory".to_owned(), |b| {
                    format!("the limit is {b} bytes, raise --memory-limit")
                });
                return (End::Memory, Some(format!("{}; {limit}", said.trim())));
            }
            let said = one_line(&end.messages);
            let how = match (code, end.signal) {
                (Some(code), _) => format!("exit status {code}"),
                (None, Some(9)) => "killed by signal 9, perhaps as the system ran out of memory: use fewer --jobs, or \
                                    --memory-limit"
                    .to_owned(),
                (None, signal) => format!("killed by signal {}", signal.unwrap_or_default()),
            };
            let why = if said.is_empty() { how } else { format!("{how}; {said}") };
            (End::Crashed, Some(why))
        }
    }
}

/// The last line that says `error:`, else all that was said.
fn last_error(messages: &str) -> String {
    let error = messages.lines().rev().find_map(|l| l.strip_prefix("error: "));
    error.map_or_else(|| one_line(messages), str::to_owned)
}

fn one_line(text: &str) -> String {
    text.lines().map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join("; ")
}

/// Tells a file from the one that replaces it.
#[derive(PartialEq, Eq)]
struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
    number: u64,
}

impl Stamp {
    fn of(path: &Path) -> Option<Self> {
        let m = std::fs::metadata(path).ok()?;
        Some(Stamp { bytes: m.len(), modified: m.modified().ok(), number: number(&m) })
    }
}

#[cfg(unix)]
fn number(m: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(m)
}

#[cfg(not(unix))]
fn number(_: &Metadata) -> u64 {
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(code: Option<i32>, signal: Option<i32>, messages: &str) -> Ended {
        Ended { code, signal, seconds: 1.0, messages: messages.into(), overdue: false, asked: false }
    }

    #[test]
    fn ends_are_told_apart() {
        let status = |end: &Ended| verdict(end, Some(1 << 30)).0;
        for (code, end) in
            [(0, End::Converged), (1, End::Failed), (2, End::Refused), (3, End::Stopped), (130, End::Cancelled)]
        {
            assert_eq!(status(&ended(Some(code), None, "")), end);
        }
        let aborted = ended(None, Some(6), "memory allocation of 4096 bytes failed\n");
        assert_eq!(status(&aborted), End::Memory);
        let why = "memory allocation of 4096 bytes failed; the limit is 77 bytes, raise --memory-limit";
        assert_eq!(verdict(&aborted, Some(77)).1.unwrap(), why);
        let traced = "memory allocation of 4096 bytes failed\nstack backtrace:\n   0: std::alloc::rust_oom\n";
        assert_eq!(verdict(&ended(None, Some(6), traced), Some(77)).1.unwrap(), why);
        let panicked = ended(Some(101), None, "\nthread 'main' panicked at x.rs:1:2:\nindex out of bounds\n");
        let (end, why) = verdict(&panicked, None);
        assert_eq!(end, End::Crashed);
        assert_eq!(why.unwrap(), "exit status 101; thread 'main' panicked at x.rs:1:2:; index out of bounds");
        assert_eq!(status(&ended(None, Some(11), "")), End::Crashed);
        assert_eq!(status(&Ended { overdue: true, ..ended(None, Some(9), "") }), End::Timeout);
        assert_eq!(status(&Ended { asked: true, ..ended(None, Some(15), "") }), End::Cancelled);
    }

    #[test]
    fn the_reason_is_the_last_error() {
        assert_eq!(last_error("warning: a\nerror: b; c\n"), "b; c");
        assert_eq!(last_error("odd\n\nwords\n"), "odd; words");
    }
}
