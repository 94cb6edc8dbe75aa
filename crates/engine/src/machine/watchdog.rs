//! What ends a launch that goes on for too long: the fuel of all its invocations together, the
//! clock, and the first invocation that ran out of fuel, behind which none needs to run.
//!
//! A [`Watchdog`] is shared by the threads of a launch, a [`TaskWatch`] belongs to one of them.
//! Batches ask it once in [`SLICE`] charged instructions, so that the interpreter's loop pays
//! nothing for it.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::machine::trap::TrapCode;
use anyhit_base::interrupt::Interrupt;

/// Instructions that a lane is charged between two looks at the watchdog.
pub const SLICE: u64 = 1 << 16;
/// Back edges, stops and steps of the pipeline that still run once a limit is passed, so that the
/// report can say what the loop does.
const GRACE: u32 = 1 << 10;

/// The fuel of a launch: what all its invocations may execute together, shaders that they call
/// included, counted by lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LaunchFuel {
    /// Instructions of the launch.
    pub instructions: u64,
    /// Instructions for each invocation of the launch, where that is more.
    pub per_invocation: u64,
    /// Instructions of the launch at most, however many invocations it has.
    pub most: u64,
}

impl LaunchFuel {
    /// What `anyhit test` and `anyhit smoke` allow: 2^30 instructions, or 2^21 for each invocation,
    /// and at most 2^38. The largest shader known has 98,390 instructions, 164,798 once it is
    /// inlined.
    pub const DEFAULT: Self = Self { instructions: 1 << 30, per_invocation: 1 << 21, most: 1 << 38 };

    /// So many instructions, however many invocations there are.
    pub fn of(instructions: u64) -> Self {
        Self { instructions, per_invocation: 0, most: u64::MAX }
    }

    /// What so many invocations may execute.
    pub fn of_invocations(self, count: u64) -> u64 {
        self.instructions.max(self.per_invocation.saturating_mul(count)).min(self.most)
    }
}

/// The limits of a whole launch or dispatch. None is set by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct LaunchLimits {
    /// What all invocations may execute together.
    #[doc(hidden)]
    pub fuel: Option<LaunchFuel>,
    /// What is the most, whatever `fuel` says: a test may lower its own limit, not raise it.
    #[doc(hidden)]
    pub max_fuel: Option<LaunchFuel>,
    /// How long the launch may take. What it ends depends on the machine.
    pub timeout: Option<Duration>,
    /// How long the invocations of one batch, or of the workgroups that run together, may take with
    /// all that they call. What it ends depends on the machine.
    pub batch_timeout: Option<Duration>,
}

impl LaunchLimits {
    /// Limits how many instructions all invocations may execute together.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use anyhit::LaunchLimits;
    ///
    /// let limits = LaunchLimits::default().fuel(1 << 30).timeout(Duration::from_secs(60));
    /// assert_eq!(limits.timeout, Some(Duration::from_secs(60)));
    /// ```
    #[must_use]
    pub fn fuel(self, instructions: u64) -> Self {
        Self { fuel: Some(LaunchFuel::of(instructions)), ..self }
    }

    /// Limits how long the launch may take.
    #[must_use]
    pub fn timeout(self, timeout: Duration) -> Self {
        Self { timeout: Some(timeout), ..self }
    }

    /// Limits how long the invocations of one batch may take, with all that they call.
    #[must_use]
    pub fn batch_timeout(self, timeout: Duration) -> Self {
        Self { batch_timeout: Some(timeout), ..self }
    }

    /// What `anyhit test` sets unless told otherwise: [`LaunchFuel::DEFAULT`], 60 seconds for a
    /// launch and 8 for a batch.
    pub const TESTS: Self = Self {
        fuel: Some(LaunchFuel::DEFAULT),
        max_fuel: None,
        timeout: Some(Duration::from_secs(60)),
        batch_timeout: Some(Duration::from_secs(8)),
    };
    /// What `ShaderTest` and
    /// `ComputeTest` set: the times of
    /// [`LaunchLimits::TESTS`].
    pub const UNIT_TESTS: Self = Self { fuel: None, ..Self::TESTS };
    /// What `anyhit smoke` sets, which runs a shader many times: 30 seconds for a launch and 4 for
    /// a batch.
    pub const SMOKE: Self = Self {
        timeout: Some(Duration::from_secs(30)),
        batch_timeout: Some(Duration::from_secs(4)),
        ..Self::TESTS
    };
}

/// Shared by the threads of a launch.
#[derive(Debug)]
pub struct Watchdog {
    limits: LaunchLimits,
    began: Instant,
    /// The lowest number of an invocation that was stopped by a limit.
    stopped_at: AtomicU64,
    /// What the tasks spent, in their order.
    ledger: Mutex<Ledger>,
    /// What all tasks may spend.
    fuel: u64,
    /// What the host may end it with.
    interrupt: Option<Interrupt>,
}

#[derive(Debug, Default)]
struct Ledger {
    /// The first task that has not ended.
    next: u64,
    /// The sum of those before it.
    sum: u64,
    /// Tasks behind it that have ended.
    ended: BTreeMap<u64, u64>,
}

impl Watchdog {
    /// The watchdog of a launch of so many invocations, which begins now.
    pub fn new(limits: LaunchLimits, invocations: u64) -> Arc<Self> {
        let of = |fuel: Option<LaunchFuel>| fuel.map_or(u64::MAX, |fuel| fuel.of_invocations(invocations));
        let fuel = of(limits.fuel).min(of(limits.max_fuel));
        Arc::new(Self {
            limits,
            began: Instant::now(),
            stopped_at: AtomicU64::new(u64::MAX),
            ledger: Mutex::default(),
            fuel,
            interrupt: Interrupt::current(),
        })
    }

    /// The watch of one of its threads.
    pub fn watch(self: &Arc<Self>) -> Arc<TaskWatch> {
        Arc::new(TaskWatch {
            dog: self.clone(),
            fuel: AtomicU64::new(self.fuel),
            spent: AtomicU64::new(0),
            batch_began: AtomicU64::new(0),
            expired: AtomicU8::new(0),
            grace: AtomicU32::new(GRACE),
        })
    }

    /// The limits that it keeps.
    pub fn limits(&self) -> &LaunchLimits {
        &self.limits
    }

    /// What the launch may execute.
    pub fn fuel(&self) -> u64 {
        self.fuel
    }

    /// Whether an invocation of a lower number was stopped: this one no longer affects the result.
    pub fn is_beyond(&self, number: u64) -> bool {
        self.stopped_at.load(Relaxed) < number
    }

    /// Records that a limit stopped the invocation of this number.
    pub fn stop_at(&self, number: u64) {
        self.stopped_at.fetch_min(number, Relaxed);
    }

    /// Records what a task has spent; the first task up to which all together have spent more than
    /// the launch may, once that is known. It does not depend on the order in which tasks end.
    pub fn end_task(&self, task: u64, spent: u64) -> Option<u64> {
        self.limits.fuel?;
        let mut ledger = self.ledger.lock().unwrap_or_else(PoisonError::into_inner);
        ledger.ended.insert(task, spent);
        let mut over = None;
        while let Some(spent) = {
            let next = ledger.next;
            ledger.ended.remove(&next)
        } {
            let before = ledger.sum;
            ledger.sum = before.saturating_add(spent);
            if before <= self.fuel && ledger.sum > self.fuel {
                over = Some(ledger.next);
            }
            ledger.next += 1;
        }
        over
    }
}

/// What the batches of one thread share.
#[derive(Debug)]
pub struct TaskWatch {
    dog: Arc<Watchdog>,
    /// What the task may spend.
    fuel: AtomicU64,
    spent: AtomicU64,
    /// When its batch began, in nanoseconds of the launch.
    batch_began: AtomicU64,
    /// The limit that was passed; see [`LIMITS`].
    expired: AtomicU8,
    /// How many steps it still takes behind the limit.
    grace: AtomicU32,
}

/// What [`TaskWatch::expired`] holds, counted from 1.
const LIMITS: [TrapCode; 3] = [TrapCode::LaunchOutOfFuel, TrapCode::LaunchTimedOut, TrapCode::BatchTimedOut];

impl TaskWatch {
    /// The watchdog of its launch.
    pub fn watchdog(&self) -> &Arc<Watchdog> {
        &self.dog
    }

    /// Begins a task of so many invocations. It may spend what they may, but not more than the
    /// whole launch: so what a task comes to depends on no other.
    pub fn begin_task(&self, invocations: u64) {
        let own = self.dog.limits.fuel.map_or(u64::MAX, |fuel| fuel.of_invocations(invocations));
        self.fuel.store(own.min(self.dog.fuel), Relaxed);
        self.spent.store(0, Relaxed);
        self.expired.store(0, Relaxed);
        self.grace.store(GRACE, Relaxed);
    }

    /// Begins a batch, or workgroups that run together.
    pub fn begin_batch(&self) {
        if self.dog.limits.batch_timeout.is_some() {
            self.batch_began.store(self.now(), Relaxed);
        }
    }

    fn now(&self) -> u64 {
        u64::try_from(self.dog.began.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    /// Charges instructions, counted by lanes.
    pub fn charge(&self, instructions: u64) {
        let spent = self.spent.load(Relaxed).saturating_add(instructions);
        self.spent.store(spent, Relaxed);
        if spent > self.fuel.load(Relaxed) {
            self.expire(TrapCode::LaunchOutOfFuel);
        }
    }

    /// What the task has spent.
    pub fn spent(&self) -> u64 {
        self.spent.load(Relaxed)
    }

    /// Looks at the clock, where a limit of time is set, and asks the host whether to end.
    pub fn look_at_clock(&self) {
        let LaunchLimits { timeout, batch_timeout, .. } = self.dog.limits;
        if self.expired().is_some() {
            return;
        }
        if self.dog.interrupt.as_ref().is_some_and(Interrupt::is_raised) {
            // No report will say what the loop does.
            self.grace.store(0, Relaxed);
            return self.expire(TrapCode::LaunchTimedOut);
        }
        if timeout.is_none() && batch_timeout.is_none() {
            return;
        }
        let now = self.now();
        let passed = |limit: Option<Duration>, since: u64| {
            limit.is_some_and(|limit| u128::from(now.saturating_sub(since)) > limit.as_nanos())
        };
        if passed(timeout, 0) {
            self.expire(TrapCode::LaunchTimedOut);
        } else if passed(batch_timeout, self.batch_began.load(Relaxed)) {
            self.expire(TrapCode::BatchTimedOut);
        }
    }

    fn expire(&self, code: TrapCode) {
        let number = LIMITS.iter().position(|&limit| limit == code).map_or(0, |at| at as u8 + 1);
        let _ = self.expired.compare_exchange(0, number, Relaxed, Relaxed);
    }

    /// The limit that was passed.
    pub fn expired(&self) -> Option<TrapCode> {
        LIMITS.get(usize::from(self.expired.load(Relaxed)).checked_sub(1)?).copied()
    }

    /// The limit of time that was passed.
    pub fn timed_out(&self) -> Option<TrapCode> {
        self.expired().filter(|code| *code != TrapCode::LaunchOutOfFuel)
    }

    /// Takes a step behind the limit; the limit, where none is left.
    pub fn step_behind(&self) -> Option<TrapCode> {
        let code = self.expired()?;
        let left = self.grace.load(Relaxed);
        self.grace.store(left.saturating_sub(1), Relaxed);
        (left == 0).then_some(code)
    }

    /// Whether nothing runs any more.
    pub fn is_over(&self) -> bool {
        self.expired().is_some() && self.grace.load(Relaxed) == 0
    }

    /// Whether an invocation of a lower number was stopped; see [`Watchdog::is_beyond`].
    pub fn is_beyond(&self, number: u64) -> bool {
        self.dog.is_beyond(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fuel_is_what_so_many_invocations_may_spend() {
        let fuel = LaunchFuel { instructions: 100, per_invocation: 8, most: 110 };
        // 8 * 12 = 96, 8 * 13 = 104, 8 * 14 = 112
        let counts = [1, 12, 13, 14, u64::MAX];
        assert_eq!(counts.map(|count| fuel.of_invocations(count)), [100, 100, 104, 110, 110]);
        assert_eq!(LaunchFuel::of(7).of_invocations(u64::MAX), 7);
    }

    #[test]
    fn the_task_that_goes_over_does_not_depend_on_the_order() {
        // 40, 80, 120: the third task goes over 100.
        for order in [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]] {
            let limits = LaunchLimits { fuel: Some(LaunchFuel::of(100)), ..LaunchLimits::default() };
            let dog = Watchdog::new(limits, 4);
            let over: Vec<u64> = order.iter().filter_map(|&task| dog.end_task(task, 40)).collect();
            assert_eq!(over, [2], "{order:?}");
        }
    }

    #[test]
    fn a_task_that_spends_too_much_ends_after_its_grace() {
        let limits = LaunchLimits { fuel: Some(LaunchFuel::of(100)), ..LaunchLimits::default() };
        let watch = Watchdog::new(limits, 4).watch();
        watch.begin_task(1);
        watch.charge(100);
        assert_eq!((watch.expired(), watch.step_behind()), (None, None));
        watch.charge(1);
        assert_eq!(watch.expired(), Some(TrapCode::LaunchOutOfFuel));
        assert!((0..GRACE).all(|_| watch.step_behind().is_none()));
        assert_eq!(watch.step_behind(), Some(TrapCode::LaunchOutOfFuel));
        assert!(watch.is_over());
        watch.begin_task(1);
        assert!(!watch.is_over());
    }

    #[test]
    fn an_interrupt_ends_a_launch_without_limits() {
        let interrupt = Interrupt::new(|| true);
        let watch = interrupt.scope(|| Watchdog::new(LaunchLimits::default(), 1).watch());
        watch.begin_task(1);
        watch.look_at_clock();
        assert_eq!(watch.expired(), None, "the host is not asked yet");
        std::thread::sleep(anyhit_base::interrupt::ASK_INTERVAL);
        watch.look_at_clock();
        assert_eq!(watch.step_behind(), Some(TrapCode::LaunchTimedOut));
    }

    #[test]
    fn a_timeout_of_nothing_is_passed_at_once() {
        let limits = LaunchLimits { timeout: Some(Duration::ZERO), ..LaunchLimits::default() };
        let watch = Watchdog::new(limits, 1).watch();
        watch.begin_task(1);
        std::thread::sleep(Duration::from_millis(1));
        watch.look_at_clock();
        assert_eq!(watch.expired(), Some(TrapCode::LaunchTimedOut));
    }
}
