//! Interruption of a thread's work by its host: Ctrl-C in an interpreter that embeds anyhit.

use std::cell::RefCell;
use std::fmt;
use std::panic::RefUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

/// The time between two questions to the host.
pub const ASK_INTERVAL: Duration = Duration::from_millis(20);

thread_local! {
    static CURRENT: RefCell<Option<Interrupt>> = const { RefCell::new(None) };
}

/// A request of the host to end a run. The thread that made it asks the host from time to time;
/// other threads that work on the same run see the answer. Launches, dispatches and rays end as if
/// their time was up; the host discards their results.
#[derive(Clone)]
pub struct Interrupt(Arc<Shared>);

struct Shared {
    owner: ThreadId,
    is_raised: AtomicBool,
    began: Instant,
    /// When the host was last asked, in nanoseconds since `began`.
    asked: AtomicU64,
    ask: Box<dyn Fn() -> bool + Send + Sync>,
}

/// A panic of `ask` leaves nothing half changed.
impl RefUnwindSafe for Shared {}

impl Interrupt {
    /// Returns an interrupt that asks the host on this thread whether to end.
    pub fn new(ask: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self(Arc::new(Shared {
            owner: thread::current().id(),
            is_raised: AtomicBool::new(false),
            began: Instant::now(),
            asked: AtomicU64::new(0),
            ask: Box::new(ask),
        }))
    }

    /// Returns the interrupt of what this thread runs.
    pub fn current() -> Option<Self> {
        CURRENT.with_borrow(Clone::clone)
    }

    /// Runs a function on this thread, which the interrupt may end.
    pub fn scope<R>(&self, run: impl FnOnce() -> R) -> R {
        let _restored = Restored(CURRENT.replace(Some(self.clone())));
        run()
    }

    /// Returns true if the run ends; asks the host at most once in [`ASK_INTERVAL`].
    pub fn is_raised(&self) -> bool {
        let Shared { owner, is_raised, began, asked, ask } = &*self.0;
        if is_raised.load(Relaxed) {
            return true;
        }
        if thread::current().id() != *owner {
            return false;
        }
        let now = u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX);
        if u128::from(now.saturating_sub(asked.load(Relaxed))) < ASK_INTERVAL.as_nanos() {
            return false;
        }
        asked.store(now, Relaxed);
        let answer = ask();
        is_raised.fetch_or(answer, Relaxed);
        answer
    }
}

impl fmt::Debug for Interrupt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Interrupt").field(&self.0.is_raised).finish()
    }
}

/// The interrupt of the scope around, which is current again where this is dropped.
struct Restored(Option<Interrupt>);

impl Drop for Restored {
    fn drop(&mut self) {
        CURRENT.set(self.0.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scopes_nest() {
        let is_current = |wanted: Option<&Interrupt>| match (Interrupt::current(), wanted) {
            (Some(found), Some(wanted)) => Arc::ptr_eq(&found.0, &wanted.0),
            (found, wanted) => found.is_none() && wanted.is_none(),
        };
        let (outer, inner) = (Interrupt::new(|| false), Interrupt::new(|| false));
        outer.scope(|| {
            inner.scope(|| assert!(is_current(Some(&inner))));
            assert!(is_current(Some(&outer)));
        });
        assert!(is_current(None));
    }

    #[test]
    fn the_host_is_asked_on_its_thread_and_not_too_often() {
        let asked = Arc::new(AtomicU64::new(0));
        let count = asked.clone();
        let interrupt = Interrupt::new(move || count.fetch_add(1, Relaxed) == 1);
        assert!(!interrupt.is_raised(), "it is too early to ask");
        thread::sleep(ASK_INTERVAL);
        let elsewhere = interrupt.clone();
        assert!(!thread::spawn(move || elsewhere.is_raised()).join().unwrap());
        assert_eq!(asked.load(Relaxed), 0);
        assert!(!interrupt.is_raised() && !interrupt.is_raised());
        assert_eq!(asked.load(Relaxed), 1);
        thread::sleep(ASK_INTERVAL);
        // The second answer ends it, and stays.
        assert!(interrupt.is_raised() && interrupt.is_raised());
        assert_eq!(asked.load(Relaxed), 2);
        assert!(thread::spawn(move || interrupt.is_raised()).join().unwrap());
    }
}
