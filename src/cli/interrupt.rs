//! Signals that end the program: what it has not finished writing is removed before, and so is the
//! bar that shows progress.

/// Has a write beyond the limit of a file's size (`ulimit -f`) fail, which is told as a full disk
/// is; and has temporary files removed when a signal ends the program, from the first of them on.
#[cfg(unix)]
pub(super) fn prepare() {
    // The signal would end the program. A handler that does nothing leaves the error of the write.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
    anyhit_base::atomic_file::before_first(watch);
}

/// There is no way to do so here without unsafe code: what is left is swept later.
#[cfg(not(unix))]
pub(super) fn prepare() {}

/// As [`prepare`], there is no way.
#[cfg(not(unix))]
pub(super) fn before_end(_: fn()) {}

/// Removes the progress bar, if one is shown.
#[cfg(unix)]
static CLEAR: std::sync::OnceLock<fn()> = std::sync::OnceLock::new();

/// Has a function that removes a bar of progress called before a signal ends the program.
#[cfg(unix)]
pub(super) fn before_end(clear: fn()) {
    let _ = CLEAR.set(clear);
    watch();
}

/// Waits for signals in a thread of its own, from the first call on.
#[cfg(unix)]
fn watch() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(wait_for_signals);
}

#[cfg(unix)]
fn wait_for_signals() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    let ignored = ignored();
    let signals = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    let Ok(mut signals) = Signals::new(signals) else { return };
    let wait = move || {
        for signal in signals.forever() {
            anyhit_base::atomic_file::abandon_all();
            clear_progress();
            // Ends the program as the signal would have.
            let _ = emulate_default_handler(signal);
        }
    };
    // Without the thread the signals would be lost, so `Signals` is dropped with it.
    let _ = std::thread::Builder::new().name("signals".into()).stack_size(1 << 18).spawn(wait);
}

/// Removes the bar of progress, unless whoever draws it waits for a reader that has stopped.
#[cfg(unix)]
fn clear_progress() {
    const PATIENCE: std::time::Duration = std::time::Duration::from_secs(2);
    let Some(&clear) = CLEAR.get() else { return };
    let (done, cleared) = std::sync::mpsc::channel();
    let remove = move || {
        clear();
        let _ = done.send(());
    };
    if std::thread::Builder::new().stack_size(1 << 18).spawn(remove).is_ok() {
        let _ = cleared.recv_timeout(PATIENCE);
    }
}

/// The signals that the caller has this program ignore, bit 0 for signal 1: `nohup` ignores SIGHUP,
/// and a shell without job control SIGINT for what runs in the background. Only Linux tells;
/// elsewhere SIGHUP, for which it matters most, is taken for ignored.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(1)
}
