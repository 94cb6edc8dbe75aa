//! CPU time of this process.

use std::time::Duration;

/// The processor time that all threads of this process have taken.
#[cfg(unix)]
pub fn process() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(now.tv_sec as u64, now.tv_nsec as u32)
}

/// Where there is no such clock: wall time.
#[cfg(not(unix))]
pub fn process() -> Duration {
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    START.elapsed()
}
