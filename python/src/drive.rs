//! A run in a thread of its own, while Python's thread listens: to Ctrl-C, and to what the run has to tell.

use crate::error::SolveError;
use crate::outcome::trace;
use proxel::deform::Hooks;
use proxel::report::TraceRow;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::any::Any;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

/// How often signals are looked at.
const POLL: Duration = Duration::from_millis(40);

/// What ends a run from another thread: `cancel()`, and the best result so far is what there is.
#[pyclass(frozen, module = "proxel")]
#[derive(Default)]
pub struct Cancel {
    flag: Arc<AtomicBool>,
}

#[pymethods]
impl Cancel {
    #[new]
    fn new() -> Self {
        Cancel::default()
    }

    /// Asks the run to end.
    fn cancel(&self) {
        self.flag.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked to.
    #[getter]
    fn cancelled(&self) -> bool {
        self.flag.load(Ordering::Relaxed)
    }
}

/// Where a run stands: what a callback is given.
#[pyclass(frozen, get_all, module = "proxel")]
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// The frame under way; 0 where there are no frames.
    pub frame: usize,
    /// Iterations done.
    pub iteration: usize,
    /// Wall time since the start.
    pub seconds: f64,
    /// Objective; NaN where it is not known.
    pub energy: f64,
    /// Elements with a measure of zero or below.
    pub inverted: u64,
}

#[pymethods]
impl Progress {
    fn __repr__(&self) -> String {
        let Progress { frame, iteration, energy, inverted, .. } = self;
        format!("Progress(frame={frame}, iteration={iteration}, energy={energy:e}, inverted={inverted})")
    }
}

impl From<&proxel::deform::Progress> for Progress {
    fn from(p: &proxel::deform::Progress) -> Self {
        Progress { iteration: p.iteration, seconds: p.seconds, energy: p.energy, inverted: p.inverted, frame: 0 }
    }
}

impl From<&TraceRow> for Progress {
    fn from(r: &TraceRow) -> Self {
        Progress { iteration: r.iteration, seconds: r.seconds, energy: r.energy, inverted: r.inverted, frame: 0 }
    }
}

/// What a caller may say to a run.
#[derive(Default)]
pub struct Listener<'py> {
    /// Called with a [`Progress`] after every iteration; what is true ends the run.
    pub callback: Option<Bound<'py, PyAny>>,
    /// Ends the run from elsewhere.
    pub cancel: Option<Py<Cancel>>,
}

/// The run's end of the line.
pub struct Link {
    /// What ends the run.
    pub cancel: Arc<AtomicBool>,
    is_heard: bool,
    events: Sender<Progress>, // hung up when the run is over
    heard: Mutex<Receiver<()>>,
}

impl Link {
    /// Whether anybody wants to hear of iterations.
    pub fn is_heard(&self) -> bool {
        self.is_heard
    }

    /// Tells where the run stands, and waits until the callback has returned.
    pub fn tell(&self, progress: Progress) {
        if !self.is_heard || self.events.send(progress).is_err() {
            return;
        }
        if let Ok(heard) = self.heard.lock() {
            // An error: nobody listens any more, and the run has been asked to end.
            let _ = heard.recv();
        }
    }
}

/// Runs `work` without Python's lock; the callback is called in the thread of the caller.
///
/// # Errors
/// What the callback raises and KeyboardInterrupt, both after the run has ended; a panic, as SolveError.
pub fn drive<T: Send>(py: Python<'_>, listener: &Listener<'_>, work: impl FnOnce(&Link) -> T + Send) -> PyResult<T> {
    let cancel = listener.cancel.as_ref().map_or_else(Default::default, |c| c.get().flag.clone());
    let (events, inbox) = channel::<Progress>();
    let (reply, heard) = channel::<()>();
    let is_heard = listener.callback.is_some();
    let link = Link { cancel: cancel.clone(), is_heard, events, heard: Mutex::new(heard) };
    let inbox = Mutex::new(inbox);
    thread::scope(|scope| {
        let run = scope.spawn(move || work(&link));
        let failure = listen(py, listener, &cancel, &inbox, &reply);
        match (failure, run.join()) {
            (Some(e), _) => Err(e),
            (None, Ok(result)) => Ok(result),
            (None, Err(panic)) => {
                Err(SolveError::new_err(format!("internal error, please report it: {}", said(&*panic))))
            }
        }
    })
}

/// What a run was solved to, and the columns of its trace where that is wanted.
type Traced<'py, T> = (T, Option<Bound<'py, PyDict>>);

/// [`drive`] of what takes the hooks of the facade.
///
/// # Errors
/// As those of [`drive`].
pub fn hooked<'py, T: Send>(
    py: Python<'py>,
    listener: &Listener<'_>,
    traced: bool,
    solve: impl FnOnce(&mut Hooks<'_>) -> T + Send,
) -> PyResult<Traced<'py, T>> {
    let mut lines: Vec<TraceRow> = Vec::new();
    let solved = drive(py, listener, |link| {
        let mut on_progress = |p: &proxel::deform::Progress| link.tell(p.into());
        let mut on_row = |row: &TraceRow| lines.push(*row);
        let mut hooks = Hooks { cancel: link.cancel.clone(), ..Hooks::default() };
        if link.is_heard() {
            hooks.progress = Some(&mut on_progress);
        }
        if traced {
            hooks.trace = Some(&mut on_row);
        }
        solve(&mut hooks)
    })?;
    Ok((solved, traced.then(|| trace(py, &lines)).transpose()?))
}

/// Until the run is over: the first error that the callback or a signal raises, which ends the run.
fn listen(
    py: Python<'_>,
    listener: &Listener<'_>,
    cancel: &AtomicBool,
    inbox: &Mutex<Receiver<Progress>>,
    reply: &Sender<()>,
) -> Option<PyErr> {
    let mut failure: Option<PyErr> = None;
    loop {
        let event = py.detach(|| match inbox.lock() {
            Ok(inbox) => inbox.recv_timeout(POLL),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        let wish = match event {
            Ok(progress) if failure.is_none() => ask(py, listener, progress),
            Ok(_) | Err(RecvTimeoutError::Timeout) => Ok(false),
            Err(RecvTimeoutError::Disconnected) => return failure,
        };
        match wish.and_then(|ends| py.check_signals().map(|()| ends)) {
            Ok(false) => {}
            Ok(true) => cancel.store(true, Ordering::Relaxed),
            Err(e) => {
                failure.get_or_insert(e);
                cancel.store(true, Ordering::Relaxed);
            }
        }
        if event.is_ok() {
            // Only now, so that the run sees that it is to end. An error: it does not wait any more.
            let _ = reply.send(());
        }
    }
}

/// Whether the callback wants the run to end.
fn ask(py: Python<'_>, listener: &Listener<'_>, progress: Progress) -> PyResult<bool> {
    let Some(callback) = &listener.callback else { return Ok(false) };
    callback.call1((Py::new(py, progress)?,))?.is_truthy()
}

fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic without a message")
}

/// `work` on threads that end with it. Those of rayon's global pool would not be there in a process that was forked.
///
/// # Errors
/// Threads that cannot be started, and what `work` refuses.
pub fn pooled<T: Send>(threads: Option<usize>, work: impl FnOnce() -> Result<T, String> + Send) -> Result<T, String> {
    let threads = threads.unwrap_or_else(|| thread::available_parallelism().map_or(1, |n| n.get()));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| format!("{threads} threads cannot be started: {e}"))?.install(work)
}
