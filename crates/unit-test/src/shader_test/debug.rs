//! Debugs the shader under test.

use std::cell::RefCell;
use std::sync::Arc;

use crate::memory;
use crate::shader_test::{RunningTest, ShaderTest};
use anyhit_base::error::{Error, Result};
use anyhit_debugger::console::transcript;
use anyhit_debugger::debugger::Debugger;
use anyhit_debugger::debugger::debuggee::{Debuggee, SavedState, StoppedShader, builtin_words, next_step};
use anyhit_debugger::debugger::tracker::{DebugObservers, Followed};
use anyhit_engine::interp;
use anyhit_engine::machine::hit_object::HitObject;
use anyhit_engine::machine::ray_query::RayQuery;
use anyhit_engine::machine::stop::Stop;
use anyhit_engine::machine::{Bindings, Buffer, Observer, Reg, ShaderIndex};
use anyhit_engine::ops::builtin::Builtin;
use anyhit_engine::pipeline::{Event, Pipeline, Resumed};

impl ShaderTest {
    /// Runs the shader in the debugger of `anyhit trace-one-ray --interactive`, and returns the
    /// transcript of commands, one a line. `docs/debugging.md` describes them.
    ///
    /// What answers the shader's traces and calls is asked again where the debugger goes back.
    ///
    /// ```
    /// use anyhit::{Hit, Module, Ray, ShaderTest};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
    /// let test = ShaderTest::new(&module, "main")?
    ///     .hit(Hit::sphere([0.0, 0.0, 0.0], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0])));
    /// let transcript = test.debug("print gl_HitTEXT")?;
    /// assert!(transcript.ends_with("(anyhit) print gl_HitTEXT\ngl_HitTEXT = float 3.5\n"));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `InvalidArgument` for the first command that fails, with its line; else the mistakes of
    /// [`ShaderTest::run`] in what the test gives. A trap is part of the transcript.
    pub fn debug(&self, commands: &str) -> Result<String> {
        transcript(self.debugger()?, commands)
    }

    /// The debugger before the first line of the shader.
    ///
    /// # Errors
    /// The mistakes of [`ShaderTest::run`] in what the test gives.
    #[doc(hidden)]
    pub fn debugger(&self) -> Result<Debugger> {
        let test = Self { program: Arc::new(self.program.unoptimized()?), ..self.clone() };
        let resources = memory::copied(&test.given_resources()?);
        let bindings = resources.bindings(test.program.bindings());
        let (state, pipeline) =
            (State::Begins(Box::new(test.begin(None)?)), Arc::new(Pipeline::of_shader(&test.program)));
        let debuggee = SteppedTest { test, bindings, state };
        Ok(Debugger::with(Box::new(debuggee), pipeline, &resources))
    }
}

/// How far the invocation has run.
#[derive(Clone, Debug)]
enum State {
    Begins(Box<RunningTest>),
    Runs(Box<RunningTest>),
    /// With its trap, or the mistake of an answer.
    Ended(Option<Error>),
}

/// A shader under test that runs in steps.
struct SteppedTest {
    test: ShaderTest,
    bindings: Bindings,
    state: State,
}

impl SteppedTest {
    fn running(&self) -> Option<&RunningTest> {
        match &self.state {
            State::Begins(running) | State::Runs(running) => Some(running),
            State::Ended(_) => None,
        }
    }

    /// Runs to the next pause, or to the end, which may be an error.
    fn run(&self, running: &mut RunningTest, observer: &mut dyn Observer<1>) -> Result<Resumed> {
        loop {
            let stop = interp::run_lane(
                &mut running.batch,
                &self.test.program,
                &self.bindings,
                Some(&mut *observer),
            );
            match stop {
                Stop::Paused => return Ok(Resumed::Paused),
                Stop::Done => {
                    return self.test.trap(&running.batch).map_or(Ok(Resumed::Ended), Err);
                }
                stop => self.test.serve(running, stop)?,
            }
        }
    }
}

impl Debuggee for SteppedTest {
    fn resume(&mut self, observers: &mut DebugObservers<'_>, inbox: &RefCell<Vec<Event>>) -> Resumed {
        let mut running = match std::mem::replace(&mut self.state, State::Ended(None)) {
            State::Begins(running) => {
                inbox.borrow_mut().extend(running.events.iter().cloned());
                running
            }
            State::Runs(running) => running,
            ended @ State::Ended(_) => {
                self.state = ended;
                return Resumed::Ended;
            }
        };
        let run = observers.observe(&mut |observer| self.run(&mut running, observer));
        let (state, resumed) = match run {
            Ok(Resumed::Paused) => (State::Runs(running), Resumed::Paused),
            Ok(Resumed::Ended) => (State::Ended(None), Resumed::Ended),
            Err(error) => (State::Ended(Some(error)), Resumed::Ended),
        };
        self.state = state;
        observers.tracker.take_events();
        resumed
    }

    fn save(&self) -> SavedState {
        Box::new(self.state.clone())
    }

    fn restore(&mut self, saved: &SavedState) {
        let saved = saved.downcast_ref::<State>();
        self.state = saved.expect("bug in anyhit: the state belongs to another debuggee").clone();
    }

    fn followed(&self) -> Followed {
        Followed::Lane(0)
    }

    fn shaders(&self) -> Vec<StoppedShader> {
        let shader = self.running().map(|running| StoppedShader {
            shader: ShaderIndex(0),
            op: next_step(&self.test.program, &running.batch),
            calls: running.batch.frames().iter().map(|frame| frame.return_to).collect(),
        });
        shader.into_iter().collect()
    }

    fn register(&self, _: usize, register: Reg) -> u32 {
        self.running().map_or(0, |running| running.batch.registers[register].0[0])
    }

    fn set_register(&mut self, _: usize, register: Reg, word: u32) {
        if let State::Begins(running) | State::Runs(running) = &mut self.state {
            running.batch.registers[register].0[0] = word;
        }
    }

    fn bindings(&self, _: ShaderIndex) -> &Bindings {
        &self.bindings
    }

    fn builtin(&self, _: usize, builtin: &'static Builtin) -> Option<Vec<u32>> {
        // What the test sets by name is not what follows from the hit.
        let set = self.test.builtins.iter().find(|(known, _)| known.number == builtin.number);
        match set {
            Some((_, words)) => Some(words.clone()),
            None => builtin_words(&self.test.program, &self.running()?.batch, 0, builtin),
        }
    }

    fn ray_query(&self, _: usize, handle: u32) -> Option<&RayQuery> {
        self.running()?.batch.queries.get(handle)
    }

    fn hit_object(&self, _: usize, handle: u32) -> Option<&HitObject> {
        self.running()?.batch.hit_objects.get(handle)
    }

    fn shader_record(&self, _: usize) -> Option<(Arc<Buffer>, u64, u64)> {
        let record = self.running()?.batch.invocations.record(0)?;
        Some((record.data.clone(), record.offset, record.size))
    }

    fn workgroup_memory(&self) -> Option<Arc<Buffer>> {
        None
    }

    fn trapped(&self) -> Option<&Error> {
        match &self.state {
            State::Ended(error) => error.as_ref(),
            _ => None,
        }
    }
}
