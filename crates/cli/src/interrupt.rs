//! Ctrl-C: the best result so far is written; a second one quits at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use crate::refusal::Refusal;

/// Exit status of a cancelled run.
pub const CANCELLED: u8 = 130;

/// The exit status of a run that ended so; a failure is said.
pub fn exit_status(status: &str, reason: &str) -> u8 {
    match status {
        "converged" => 0,
        "stopped" => 3,
        "cancelled" => CANCELLED,
        _ => {
            eprintln!("error: {reason}");
            1
        }
    }
}

const READING: u8 = 0;
const SOLVING: u8 = 1;
const WRITING: u8 = 2;

/// Where a run stands, which decides what Ctrl-C does.
pub struct Interrupt {
    phase: Arc<AtomicU8>,
    cancel: Arc<AtomicBool>,
}

impl Interrupt {
    /// Listens from now on; before the solve Ctrl-C quits, there is nothing to keep.
    pub fn listen() -> Result<Self, Refusal> {
        let phase = Arc::new(AtomicU8::new(READING));
        let cancel = Arc::new(AtomicBool::new(false));
        let (p, c) = (phase.clone(), cancel.clone());
        let handler = move || {
            let first = !c.swap(true, Ordering::SeqCst);
            let quit = match p.load(Ordering::SeqCst) {
                READING => true,
                SOLVING => !first,
                // Files are being written whole; it takes no time.
                _ => false,
            };
            if quit {
                std::process::exit(i32::from(CANCELLED));
            }
        };
        ctrlc::set_handler(handler).map_err(|e| Refusal::new(format!("Ctrl-C cannot be listened to: {e}")))?;
        Ok(Interrupt { phase, cancel })
    }

    /// From now on the first Ctrl-C ends the run in good order. Returns the flag that it sets.
    pub fn solving(&self) -> Arc<AtomicBool> {
        self.phase.store(SOLVING, Ordering::SeqCst);
        self.cancel.clone()
    }

    /// From now on files are written, and Ctrl-C waits.
    pub fn writing(&self) {
        self.phase.store(WRITING, Ordering::SeqCst);
    }
}
