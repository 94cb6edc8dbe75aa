//! What is debugged: one invocation or ray that runs in steps, whatever the width of its batches.

use std::any::Any;
use std::cell::RefCell;
use std::sync::Arc;

use anyhit_base::error::Error;
use anyhit_engine::machine::hit_object::HitObject;
use anyhit_engine::machine::ray_query::RayQuery;
use anyhit_engine::machine::{Batch, Bindings, BlockIndex, Buffer, Lanes, Mask, OpIndex, Reg, ShaderIndex};
use anyhit_engine::ops::builtin::{Builtin, stage_letter};
use anyhit_engine::ops::lane_kernel::{LaneKernel, Width};
use anyhit_engine::pipeline::{
    ActiveShader, Company, Event, LaunchState, Resumed, SteppedDispatch, SteppedLaunch,
};
use anyhit_engine::program::Program;

use super::tracker::{DebugObservers, Followed};

/// A shader that has begun and not ended, while everything is paused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoppedShader {
    /// The shader.
    pub shader: ShaderIndex,
    /// The operation or terminator that is next; of a shader that waits, the one that it waits in.
    pub op: OpIndex,
    /// Where calls of functions that are not inlined go on, the outermost first.
    pub calls: Vec<BlockIndex>,
}

/// What a lane does while everything is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaneActivity {
    /// It makes the step that is next, together with the followed lane.
    Active,
    /// It has taken another way, and waits for the others at the block where they meet.
    Diverged,
    /// It waits for a shader that runs for others.
    Waiting,
    /// It has ended.
    Ended,
}

/// A lane of the batches that the followed lane is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DebuggedLane {
    /// Its number.
    pub lane: usize,
    /// `LaunchIdKHR`, in compute shaders `GlobalInvocationId`.
    pub launch_id: [u32; 3],
    /// What it does.
    pub activity: LaneActivity,
    /// Whether it is the one that is followed.
    pub is_followed: bool,
}

/// A kept state of a debuggee.
pub type SavedState = Box<dyn Any>;

/// One invocation or ray that runs in steps.
pub trait Debuggee {
    /// Runs until an observer pauses it, or to the end.
    fn resume(&mut self, observers: &mut DebugObservers<'_>, inbox: &RefCell<Vec<Event>>) -> Resumed;

    /// A copy of its state.
    fn save(&self) -> SavedState;

    /// Puts a state of its own back.
    fn restore(&mut self, saved: &SavedState);

    /// The lane that is followed.
    fn followed(&self) -> Followed;

    /// The shaders that have begun and not ended, the outermost first.
    fn shaders(&self) -> Vec<StoppedShader>;

    /// One of these shaders, by its number from the outermost.
    fn shader(&self, number: usize) -> Option<StoppedShader> {
        self.shaders().into_iter().nth(number)
    }

    /// The word in a register of one of these shaders.
    fn register(&self, shader: usize, register: Reg) -> u32;

    /// Sets a register of one of these shaders.
    fn set_register(&mut self, shader: usize, register: Reg, word: u32);

    /// The bindings of a shader of the pipeline.
    fn bindings(&self, shader: ShaderIndex) -> &Bindings;

    /// The words of a builtin in one of these shaders; `None` where its stage has none.
    fn builtin(&self, shader: usize, builtin: &'static Builtin) -> Option<Vec<u32>>;

    /// The ray query with a handle in one of these shaders; `None` where it is not initialised.
    fn ray_query(&self, shader: usize, handle: u32) -> Option<&RayQuery>;

    /// The hit object with a handle in one of these shaders.
    fn hit_object(&self, shader: usize, handle: u32) -> Option<&HitObject>;

    /// The data of the shader record of one of these shaders: buffer, begin and size.
    fn shader_record(&self, shader: usize) -> Option<(Arc<Buffer>, u64, u64)>;

    /// The memory of its workgroup.
    fn workgroup_memory(&self) -> Option<Arc<Buffer>>;

    /// The lanes of its batches, the followed one included; none where it runs alone.
    fn lanes(&self) -> Vec<DebuggedLane> {
        Vec::new()
    }

    /// As [`Debuggee::shaders`], of another of these lanes.
    fn shaders_of(&self, lane: usize) -> Vec<StoppedShader> {
        let _ = lane;
        Vec::new()
    }

    /// As [`Debuggee::register`], of another lane, in one of its shaders.
    fn register_of(&self, lane: usize, shader: usize, register: Reg) -> u32 {
        let _ = (lane, shader, register);
        0
    }

    /// As [`Debuggee::builtin`], of another lane.
    fn builtin_of(&self, lane: usize, shader: usize, builtin: &'static Builtin) -> Option<Vec<u32>> {
        let _ = (lane, shader, builtin);
        None
    }

    /// As [`Debuggee::shader_record`], of another lane.
    fn shader_record_of(&self, lane: usize, shader: usize) -> Option<(Arc<Buffer>, u64, u64)> {
        let _ = (lane, shader);
        None
    }

    /// The trap, or the mistake of what answers its calls, that ended it.
    fn trapped(&self) -> Option<&Error>;
}

/// A batch width that the debugger supports. The functions are compiled once per width, like those
/// of the pipeline and of the sanitizer.
pub(super) trait DebuggedWidth<const W: usize>: Width<W> {
    /// Runs an invocation of a launch, or a ray.
    fn resume_launch(
        launch: &mut SteppedLaunch<W>,
        observers: &mut DebugObservers<'_>,
        on_event: &mut dyn FnMut(Event),
    ) -> Resumed;

    /// Runs an invocation of a dispatch.
    fn resume_dispatch(dispatch: &mut SteppedDispatch<W>, observers: &mut DebugObservers<'_>) -> Resumed;
}

macro_rules! debugged_widths {
    ($($lanes:literal),*) => {$(
        impl DebuggedWidth<$lanes> for LaneKernel {
            fn resume_launch(
                launch: &mut SteppedLaunch<$lanes>,
                observers: &mut DebugObservers<'_>,
                on_event: &mut dyn FnMut(Event),
            ) -> Resumed {
                observers.observe(&mut |observer| launch.resume(observer, on_event))
            }

            fn resume_dispatch(
                dispatch: &mut SteppedDispatch<$lanes>,
                observers: &mut DebugObservers<'_>,
            ) -> Resumed {
                observers.observe(&mut |observer| dispatch.resume(observer, &mut |_| ()))
            }
        }
    )*};
}
debugged_widths!(1, 64, 128);

impl<const W: usize> Debuggee for SteppedLaunch<W>
where
    LaneKernel: DebuggedWidth<W>,
{
    fn resume(&mut self, observers: &mut DebugObservers<'_>, inbox: &RefCell<Vec<Event>>) -> Resumed {
        let resumed = LaneKernel::resume_launch(self, observers, &mut |event| inbox.borrow_mut().push(event));
        observers.tracker.take_events();
        resumed
    }

    fn save(&self) -> SavedState {
        Box::new(self.state().clone())
    }

    fn restore(&mut self, saved: &SavedState) {
        let saved = saved.downcast_ref::<LaunchState<W>>();
        self.set_state(saved.expect("bug in anyhit: the state of another debuggee").clone());
    }

    fn followed(&self) -> Followed {
        Followed::Lane(self.lane())
    }

    fn shaders(&self) -> Vec<StoppedShader> {
        self.shaders_of(self.lane())
    }

    fn shader(&self, number: usize) -> Option<StoppedShader> {
        stopped_shader(self, self.lane(), number)
    }

    fn register(&self, shader: usize, register: Reg) -> u32 {
        self.register_of(self.lane(), shader, register)
    }

    fn set_register(&mut self, shader: usize, register: Reg, word: u32) {
        let lane = self.lane();
        if let Some(batch) = self.batch_mut(shader).filter(|batch| batch.live().contains(lane)) {
            set_word(batch, register, lane, word);
        }
    }

    fn bindings(&self, shader: ShaderIndex) -> &Bindings {
        Self::bindings(self, shader)
    }

    fn builtin(&self, shader: usize, builtin: &'static Builtin) -> Option<Vec<u32>> {
        self.builtin_of(self.lane(), shader, builtin)
    }

    fn ray_query(&self, shader: usize, handle: u32) -> Option<&RayQuery> {
        shader_with(self, self.lane(), shader)?.batch.queries.get(handle)
    }

    fn hit_object(&self, shader: usize, handle: u32) -> Option<&HitObject> {
        shader_with(self, self.lane(), shader)?.batch.hit_objects.get(handle)
    }

    fn shader_record(&self, shader: usize) -> Option<(Arc<Buffer>, u64, u64)> {
        self.shader_record_of(self.lane(), shader)
    }

    fn workgroup_memory(&self) -> Option<Arc<Buffer>> {
        None
    }

    fn lanes(&self) -> Vec<DebuggedLane> {
        let Some(outermost) = Self::shaders(self).next().filter(|_| W > 1) else { return Vec::new() };
        let running = self.shader_count() - 1;
        let lane = |lane: usize| {
            let activity = match shader_with(self, lane, running) {
                Some(active) => lane_activity(active.batch, lane),
                None if shader_with(self, lane, 0).is_some() => LaneActivity::Waiting,
                None => LaneActivity::Ended,
            };
            let launch_id = outermost.batch.invocations.launch_id(lane);
            DebuggedLane { lane, launch_id, activity, is_followed: lane == self.lane() }
        };
        (0..self.lane_count()).map(lane).collect()
    }

    fn shaders_of(&self, lane: usize) -> Vec<StoppedShader> {
        (0..).map_while(|number| stopped_shader(self, lane, number)).collect()
    }

    fn register_of(&self, lane: usize, shader: usize, register: Reg) -> u32 {
        let active = shader_with(self, lane, shader);
        active.map_or(0, |active| active.batch.registers[register].0[lane])
    }

    fn builtin_of(&self, lane: usize, shader: usize, builtin: &'static Builtin) -> Option<Vec<u32>> {
        let active = shader_with(self, lane, shader)?;
        let program = &self.pipeline().programs[active.shader.index()];
        builtin_words(program, active.batch, lane, builtin)
    }

    fn shader_record_of(&self, lane: usize, shader: usize) -> Option<(Arc<Buffer>, u64, u64)> {
        let active = shader_with(self, lane, shader)?;
        let record = active.batch.invocations.record(lane)?;
        Some((record.data.clone(), record.offset, record.size))
    }

    fn trapped(&self) -> Option<&Error> {
        Self::trapped(self).map(|trapped| &trapped.error)
    }
}

impl<const W: usize> Debuggee for SteppedDispatch<W>
where
    LaneKernel: DebuggedWidth<W>,
{
    fn resume(&mut self, observers: &mut DebugObservers<'_>, inbox: &RefCell<Vec<Event>>) -> Resumed {
        // Events of ray queries are taken where they happen, as other invocations have some, too.
        let resumed = LaneKernel::resume_dispatch(self, observers);
        inbox.borrow_mut().clear();
        resumed
    }

    fn save(&self) -> SavedState {
        Box::new(self.state())
    }

    fn restore(&mut self, saved: &SavedState) {
        let saved = saved.downcast_ref::<anyhit_engine::pipeline::DispatchState<W>>();
        self.set_state(saved.expect("bug in anyhit: the state of another debuggee"));
    }

    fn followed(&self) -> Followed {
        Followed::Invocation(self.id())
    }

    fn shaders(&self) -> Vec<StoppedShader> {
        let lane = self.batch().and_then(|batch| self.followed().lane(batch));
        lane.map_or_else(Vec::new, |lane| self.shaders_of(lane))
    }

    fn register(&self, _: usize, register: Reg) -> u32 {
        let lane = |batch: &Batch<W>| self.followed().lane(batch);
        let found = self.batch().and_then(|batch| Some((batch, lane(batch)?)));
        found.map_or(0, |(batch, lane)| batch.registers[register].0[lane])
    }

    fn set_register(&mut self, _: usize, register: Reg, word: u32) {
        let followed = self.followed();
        if let Some(batch) = self.batch_mut()
            && let Some(lane) = followed.lane(batch)
        {
            set_word(batch, register, lane, word);
        }
    }

    fn bindings(&self, _: ShaderIndex) -> &Bindings {
        Self::bindings(self)
    }

    fn builtin(&self, _: usize, builtin: &'static Builtin) -> Option<Vec<u32>> {
        let batch = self.batch()?;
        builtin_words(&self.compute().program, batch, self.followed().lane(batch)?, builtin)
    }

    fn ray_query(&self, _: usize, handle: u32) -> Option<&RayQuery> {
        self.batch()?.queries.get(handle)
    }

    fn hit_object(&self, _: usize, handle: u32) -> Option<&HitObject> {
        self.batch()?.hit_objects.get(handle)
    }

    fn shader_record(&self, _: usize) -> Option<(Arc<Buffer>, u64, u64)> {
        None
    }

    fn workgroup_memory(&self) -> Option<Arc<Buffer>> {
        Some(self.workgroup().memory.clone())
    }

    fn lanes(&self) -> Vec<DebuggedLane> {
        let shares = W > 1 && self.company() != Company::Alone;
        let Some(batch) = self.batch().filter(|_| shares) else { return Vec::new() };
        let lane = |lane: usize| {
            let launch_id = batch.invocations.launch_id(lane);
            let activity = lane_activity(batch, lane);
            DebuggedLane { lane, launch_id, activity, is_followed: launch_id == self.id() }
        };
        batch.live().lanes().map(lane).collect()
    }

    fn shaders_of(&self, lane: usize) -> Vec<StoppedShader> {
        let Some(batch) = self.batch().filter(|batch| batch.live().contains(lane)) else {
            return Vec::new();
        };
        let (op, calls) = lane_position(&self.compute().program, batch, lane, true);
        vec![StoppedShader { shader: ShaderIndex(0), op, calls }]
    }

    fn register_of(&self, lane: usize, _: usize, register: Reg) -> u32 {
        self.batch().map_or(0, |batch| batch.registers[register].0[lane])
    }

    fn builtin_of(&self, lane: usize, _: usize, builtin: &'static Builtin) -> Option<Vec<u32>> {
        builtin_words(&self.compute().program, self.batch()?, lane, builtin)
    }

    fn trapped(&self) -> Option<&Error> {
        Self::trapped(self).map(|trapped| &trapped.error)
    }
}

/// Sets a register of a lane, which is defined then.
fn set_word<const W: usize>(batch: &mut Batch<W>, register: Reg, lane: usize, word: u32) {
    batch.registers[register].0[lane] = word;
    if let Some(shadow) = &mut batch.registers.shadow {
        shadow.define_lanes(register, Mask::lane(lane));
    }
}

/// The shader with a number, if a lane is in it: a lane is in all shaders that wait for its own.
fn shader_with<const W: usize>(
    launch: &SteppedLaunch<W>,
    lane: usize,
    number: usize,
) -> Option<ActiveShader<'_, W>>
where
    LaneKernel: Width<W>,
{
    launch.shader(number).filter(|active| active.batch.live().contains(lane))
}

/// Where a lane is in the shader with a number.
fn stopped_shader<const W: usize>(
    launch: &SteppedLaunch<W>,
    lane: usize,
    number: usize,
) -> Option<StoppedShader>
where
    LaneKernel: Width<W>,
{
    let active = shader_with(launch, lane, number)?;
    let program = &launch.pipeline().programs[active.shader.index()];
    let runs = number + 1 == launch.shader_count();
    let (op, calls) = lane_position(program, active.batch, lane, runs);
    Some(StoppedShader { shader: active.shader, op, calls })
}

/// The words of a builtin in a lane of a shader; `None` where its stage has none.
pub fn builtin_words<const W: usize>(
    program: &Program,
    batch: &Batch<W>,
    lane: usize,
    builtin: &'static Builtin,
) -> Option<Vec<u32>> {
    builtin.stages.contains(stage_letter(program.stage)).then(|| {
        let mut registers = vec![Lanes([0; W]); builtin.shape.words() as usize];
        builtin.read.read(&batch.invocations, Mask::lane(lane), &mut registers);
        registers.iter().map(|register| register.0[lane]).collect()
    })
}

/// The operation of a paused batch that runs next, or the terminator of its block.
pub fn next_step<const W: usize>(program: &Program, batch: &Batch<W>) -> OpIndex {
    match batch.op == program.blocks[batch.block.index()].end {
        true => program.terminator_index(batch.block),
        false => batch.op,
    }
}

/// Where a lane of a paused batch is: the operation or terminator that is next, or that it waits
/// in; and where its calls of functions go on, the outermost first. `runs` tells whether the batch
/// is the one that runs.
fn lane_position<const W: usize>(
    program: &Program,
    batch: &Batch<W>,
    lane: usize,
    runs: bool,
) -> (OpIndex, Vec<BlockIndex>) {
    let frames = batch.frames().iter().filter(|frame| frame.mask.contains(lane));
    let mut calls: Vec<BlockIndex> = frames.map(|frame| frame.return_to).collect();
    let begin = |block: BlockIndex| {
        let is_empty = program.blocks[block.index()].first == program.blocks[block.index()].end;
        if is_empty { program.terminator_index(block) } else { program.blocks[block.index()].first }
    };
    let op = match (batch.mask.contains(lane), batch.waits_at(lane)) {
        (true, _) if runs => next_step(program, batch),
        (true, _) => batch.stopped_at(),
        (false, Some(block)) => begin(block),
        // It has returned from a function, and waits until all have.
        (false, None) => calls.pop().map_or_else(|| batch.stopped_at(), begin),
    };
    (op, calls)
}

/// What a lane does in the batch that runs.
fn lane_activity<const W: usize>(batch: &Batch<W>, lane: usize) -> LaneActivity {
    match (batch.mask.contains(lane), batch.live().contains(lane)) {
        (true, _) => LaneActivity::Active,
        (false, true) => LaneActivity::Diverged,
        (false, false) => LaneActivity::Ended,
    }
}
