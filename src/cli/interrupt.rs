//! Signals that end the program: what it has not finished writing is removed before.

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

/// Waits for signals in a thread of its own.
#[cfg(unix)]
fn watch() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    let ignored = ignored();
    let signals = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    let Ok(mut signals) = Signals::new(signals) else { return };
    let wait = move || {
        for signal in signals.forever() {
            anyhit_base::atomic_file::abandon_all();
            // Ends the program as the signal would have.
            let _ = emulate_default_handler(signal);
        }
    };
    // Without the thread the signals would be lost, so `Signals` is dropped with it.
    let _ = std::thread::Builder::new().name("signals".into()).stack_size(1 << 18).spawn(wait);
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
