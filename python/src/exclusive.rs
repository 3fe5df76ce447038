//! What a class that changes wraps: one call at a time has it.

use crate::error::BusyError;
use pyo3::PyResult;
use std::sync::{Mutex, MutexGuard, TryLockError};

/// A value that calls have exclusively, and what its class is called.
///
/// PyO3 would borrow a class that is not frozen likewise, and refuse with "Already borrowed", which names neither the
/// object nor what to do.
pub struct Exclusive<T> {
    class: &'static str,
    value: Mutex<T>,
}

impl<T> Exclusive<T> {
    /// Of a class of Python with this name.
    pub fn new(class: &'static str, value: T) -> Self {
        Exclusive { class, value: Mutex::new(value) }
    }

    /// The value, until the guard is dropped.
    ///
    /// # Errors
    /// BusyError where another call has it: in another thread, or below which this one is a callback. It never waits:
    /// a callback would wait for itself.
    pub fn take(&self) -> PyResult<MutexGuard<'_, T>> {
        match self.value.try_lock() {
            Ok(value) => Ok(value),
            // A panic is reported by the call that met it; what it left is as good as after any error.
            Err(TryLockError::Poisoned(value)) => Ok(value.into_inner()),
            Err(TryLockError::WouldBlock) => Err(BusyError::new_err(format!(
                "this {} is at work in another call; wait until that call has returned (in the background: \
                 Job.result), do not call the object from its own callback, or make one for each thread",
                self.class
            ))),
        }
    }
}
