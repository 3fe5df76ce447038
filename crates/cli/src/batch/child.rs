//! One mesh in a process of its own, under limits of time and memory.

use std::io::Read;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use crate::refusal::Refusal;

/// By this variable a child learns that it is one, and its limit in bytes (0: none).
const VARIABLE: &str = "PROXEL_CHILD_MEMORY";
/// What is kept of a child's messages.
const KEPT: usize = 8 << 10;
/// Between two looks at a child.
const LOOK: Duration = Duration::from_millis(20);

/// How often the user has asked for the end: once for a good one, twice for a quick one.
#[derive(Default)]
pub struct Asked(AtomicU8);

impl Asked {
    /// Once more.
    pub fn again(&self) {
        // Never wraps: more than twice is no more than twice.
        let _ = self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| Some(n.saturating_add(1)));
    }

    /// No more children are to be started, and those that run are to come to an end.
    pub fn to_end(&self) -> bool {
        self.0.load(Ordering::SeqCst) > 0
    }

    fn to_kill(&self) -> bool {
        self.0.load(Ordering::SeqCst) > 1
    }
}

/// How a process ended.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub signal: Option<i32>,
    pub seconds: f64,
    /// The beginning of what it wrote to stderr.
    pub messages: String,
    /// Killed by the time limit.
    pub overdue: bool,
    /// It was asked to end.
    pub asked: bool,
}

/// Gives a command its surroundings as a child: no terminal, and a process group of its own, so that the Ctrl-C of a
/// terminal comes to it through its parent and once only.
pub fn prepare(command: &mut Command, memory: Option<u64>) {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.env(VARIABLE, memory.unwrap_or(0).to_string());
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
}

/// Runs a prepared command to its end; it is killed after `limit`.
pub fn run(command: &mut Command, limit: Option<Duration>, asked: &Asked) -> std::io::Result<Ended> {
    let began = Instant::now();
    let mut child = command.spawn()?;
    let pipe = child.stderr.take();
    std::thread::scope(|scope| {
        let reader = scope.spawn(|| pipe.map(beginning).unwrap_or_default());
        let watched = watch(&mut child, began, limit, asked);
        // Whatever happened, no child is left behind, and the reader comes to the end of the pipe.
        let _ = child.kill();
        let last = child.wait();
        let messages = reader.join().unwrap_or_default();
        let (overdue, was_asked) = watched?;
        let status = last?;
        Ok(Ended {
            code: status.code(),
            signal: signal(status),
            seconds: began.elapsed().as_secs_f64(),
            messages,
            overdue,
            asked: was_asked,
        })
    })
}

/// Waits for the end. Returns whether the time was over, and whether the child was asked to end.
fn watch(child: &mut Child, began: Instant, limit: Option<Duration>, asked: &Asked) -> std::io::Result<(bool, bool)> {
    let mut told = false;
    let mut pause = Duration::from_millis(1);
    loop {
        if child.try_wait()?.is_some() {
            return Ok((false, told));
        }
        if limit.is_some_and(|l| began.elapsed() > l) {
            return Ok((true, told));
        }
        if asked.to_kill() {
            return Ok((false, true));
        }
        if asked.to_end() && !told {
            told = true;
            ask(child)?;
        }
        std::thread::sleep(pause);
        pause = LOOK.min(2 * pause);
    }
}

/// Asks a child to end in good order, with the best result so far.
#[cfg(unix)]
fn ask(child: &mut Child) -> std::io::Result<()> {
    use nix::sys::signal::{Signal, kill};
    let Ok(id) = i32::try_from(child.id()) else { return child.kill() };
    // The child has not been waited for, so the number is still its own.
    Ok(kill(nix::unistd::Pid::from_raw(id), Signal::SIGTERM)?)
}

/// There is no gentler way here.
#[cfg(not(unix))]
fn ask(child: &mut Child) -> std::io::Result<()> {
    child.kill()
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

#[cfg(not(unix))]
fn signal(_: ExitStatus) -> Option<i32> {
    None
}

/// Reads to the end, so that the writer never waits, and keeps the beginning.
fn beginning(mut pipe: impl Read) -> String {
    let mut kept = Vec::new();
    let mut buffer = [0; 1024];
    while let Ok(n @ 1..) = pipe.read(&mut buffer) {
        let room = n.min(KEPT.saturating_sub(kept.len()));
        kept.extend_from_slice(&buffer[..room]);
    }
    String::from_utf8_lossy(&kept).into_owned()
}

/// Whether memory can be limited on this system.
pub const LIMITS_MEMORY: bool = cfg!(unix);

/// In a child of a batch: takes on its limits. Elsewhere nothing.
pub fn limit_this_process() -> Result<(), Refusal> {
    let Some(value) = std::env::var_os(VARIABLE) else { return Ok(()) };
    let bytes = value.to_str().and_then(|v| v.parse().ok());
    let bytes: u64 = bytes.ok_or_else(|| Refusal::new(format!("{VARIABLE} is no number of bytes; do not set it")))?;
    limit(bytes).map_err(|e| Refusal::new(format!("memory cannot be limited to {bytes} bytes: {e}; leave it out")))
}

#[cfg(unix)]
fn limit(bytes: u64) -> std::io::Result<()> {
    use nix::sys::resource::{Resource, setrlimit};
    // A parent that is killed takes its children with it: nobody would collect their results.
    #[cfg(target_os = "linux")]
    nix::sys::prctl::set_pdeathsig(nix::sys::signal::Signal::SIGTERM)?;
    // Thousands of meshes must not leave thousands of core files.
    setrlimit(Resource::RLIMIT_CORE, 0, 0)?;
    if bytes > 0 {
        // On Linux data are all private memory that can be written, which is what is used; the address space also
        // has what allocators reserve for each thread. Elsewhere data are less than what is allocated.
        #[cfg(target_os = "linux")]
        let resource = Resource::RLIMIT_DATA;
        #[cfg(not(target_os = "linux"))]
        let resource = Resource::RLIMIT_AS;
        setrlimit(resource, bytes, bytes)?;
    }
    Ok(())
}

#[cfg(not(unix))]
fn limit(bytes: u64) -> std::io::Result<()> {
    if bytes == 0 { Ok(()) } else { Err(std::io::ErrorKind::Unsupported.into()) }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str, limit: Option<f64>, asked: &Asked) -> Ended {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        prepare(&mut command, None);
        run(&mut command, limit.map(Duration::from_secs_f64), asked).unwrap()
    }

    #[test]
    fn exit_status_and_messages() {
        let end = shell("echo error: no >&2; exit 2", None, &Asked::default());
        assert_eq!((end.code, end.signal, end.overdue, end.asked), (Some(2), None, false, false));
        assert_eq!(end.messages, "error: no\n");
    }

    #[test]
    fn who_hangs_is_killed() {
        // Deaf to SIGTERM, as a process is that hangs.
        let end = shell("trap '' TERM; while :; do sleep 0.05; done", Some(0.2), &Asked::default());
        assert_eq!((end.code, end.signal, end.overdue), (None, Some(9), true));
    }

    #[test]
    fn who_writes_much_is_not_kept_waiting() {
        let script =
            "i=0; while [ $i -lt 5000 ]; do echo 0123456789012345678901234567890123456789 >&2; i=$((i+1)); done";
        let end = shell(script, Some(60.0), &Asked::default());
        assert_eq!((end.code, end.messages.len()), (Some(0), KEPT));
    }

    #[test]
    fn once_asked_a_child_may_end_well_and_twice_it_is_killed() {
        let asked = Asked::default();
        asked.again();
        let end = shell("trap 'exit 130' TERM; while :; do sleep 0.05; done", None, &asked);
        assert!(end.asked);
        // Asked before it could listen, it ends by the signal.
        assert!(end.code == Some(130) || end.signal == Some(15), "{end:?}");
        asked.again();
        let end = shell("trap '' TERM; while :; do sleep 0.05; done", None, &asked);
        assert_eq!((end.signal, end.asked), (Some(9), true));
    }

    #[test]
    fn a_crash_is_seen() {
        let end = shell("kill -ABRT $$", None, &Asked::default());
        assert_eq!((end.code, end.signal, end.overdue), (None, Some(6), false));
    }
}
