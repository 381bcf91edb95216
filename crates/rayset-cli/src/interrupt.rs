//! Ctrl-C: stops a render between two bundles, and never in the middle of a file.

use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};

/// The exit status of an interrupted run: 128 and the number of the signal, as shells have it.
pub(crate) const STATUS: u8 = 130;

/// Whether there is something that must not be cut off: then the signal is only noted.
static BUSY: AtomicBool = AtomicBool::new(false);
static NOTED: AtomicBool = AtomicBool::new(false);

/// From now on a signal ends the process unless it is [`busy`](set_busy).
pub(crate) fn listen() -> Result<(), Box<dyn Error>> {
    ctrlc::set_handler(|| {
        NOTED.store(true, Ordering::SeqCst);
        if !BUSY.load(Ordering::SeqCst) {
            eprintln!("interrupted: nothing was written");
            std::process::exit(i32::from(STATUS));
        }
    })?;
    Ok(())
}

/// Says that from now on a signal is only noted: whoever is busy asks for it.
pub(crate) fn set_busy() {
    BUSY.store(true, Ordering::SeqCst);
}

/// Whether there was a signal.
pub(crate) fn is_noted() -> bool {
    NOTED.load(Ordering::SeqCst)
}
