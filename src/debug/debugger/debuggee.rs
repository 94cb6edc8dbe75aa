//! What is debugged: one invocation or ray that runs in steps, whatever the width of its batches.

use std::any::Any;
use std::cell::RefCell;
use std::sync::Arc;

use crate::error::Error;
use crate::machine::hit_object::HitObject;
use crate::machine::ray_query::RayQuery;
use crate::machine::{Batch, Bindings, BlockIndex, Buffer, Lanes, Mask, OpIndex, Reg, ShaderIndex};
use crate::ops::builtin::{Builtin, stage_letter};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::{ActiveShader, Event, LaunchState, Resumed, SteppedDispatch, SteppedLaunch};
use crate::program::Program;

use super::tracker::{Followed, Tracker};

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

/// A kept state of a debuggee.
pub type SavedState = Box<dyn Any>;

/// One invocation or ray that runs in steps.
pub trait Debuggee {
    /// Runs until the tracker pauses it, or to the end.
    fn resume(&mut self, tracker: &mut Tracker<'_>, inbox: &RefCell<Vec<Event>>) -> Resumed;

    /// A copy of its state.
    fn save(&self) -> SavedState;

    /// Puts a state of its own back.
    fn restore(&mut self, saved: &SavedState);

    /// The lane that is followed.
    fn followed(&self) -> Followed;

    /// The shaders that have begun and not ended, the outermost first.
    fn shaders(&self) -> Vec<StoppedShader>;

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

    /// The trap, or the mistake of what answers its calls, that ended it.
    fn trapped(&self) -> Option<&Error>;
}

impl<const W: usize> Debuggee for SteppedLaunch<W>
where
    LaneKernel: Width<W>,
{
    fn resume(&mut self, tracker: &mut Tracker<'_>, inbox: &RefCell<Vec<Event>>) -> Resumed {
        let resumed = Self::resume(self, tracker, &mut |event| inbox.borrow_mut().push(event));
        tracker.take_events();
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
        let mut all: Vec<StoppedShader> = own_shaders(self)
            .map(|(_, active)| {
                let calls = active.batch.frames().iter().map(|frame| frame.return_to).collect();
                StoppedShader { shader: active.shader, op: active.batch.stopped_at(), calls }
            })
            .collect();
        if let (Some(last), Some((_, active))) = (all.last_mut(), own_shaders(self).last()) {
            last.op = next_step(&self.pipeline().programs[active.shader.index()], active.batch);
        }
        all
    }

    fn register(&self, shader: usize, register: Reg) -> u32 {
        let active = own_shaders(self).nth(shader);
        active.map_or(0, |(_, active)| active.batch.registers[register].0[self.lane()])
    }

    fn set_register(&mut self, shader: usize, register: Reg, word: u32) {
        let lane = self.lane();
        let position = own_shaders(self).nth(shader).map(|(position, _)| position);
        if let Some(batch) = position.and_then(|position| self.batch_mut(position)) {
            batch.registers[register].0[lane] = word;
        }
    }

    fn bindings(&self, shader: ShaderIndex) -> &Bindings {
        Self::bindings(self, shader)
    }

    fn builtin(&self, shader: usize, builtin: &'static Builtin) -> Option<Vec<u32>> {
        let (_, active) = own_shaders(self).nth(shader)?;
        let program = &self.pipeline().programs[active.shader.index()];
        builtin_words(program, active.batch, self.lane(), builtin)
    }

    fn ray_query(&self, shader: usize, handle: u32) -> Option<&RayQuery> {
        own_shaders(self).nth(shader)?.1.batch.queries.get(handle)
    }

    fn hit_object(&self, shader: usize, handle: u32) -> Option<&HitObject> {
        own_shaders(self).nth(shader)?.1.batch.hit_objects.get(handle)
    }

    fn shader_record(&self, shader: usize) -> Option<(Arc<Buffer>, u64, u64)> {
        let (_, active) = own_shaders(self).nth(shader)?;
        let record = active.batch.invocations.record(self.lane())?;
        Some((record.data.clone(), record.offset, record.size))
    }

    fn workgroup_memory(&self) -> Option<Arc<Buffer>> {
        None
    }

    fn trapped(&self) -> Option<&Error> {
        Self::trapped(self).map(|trapped| &trapped.error)
    }
}

impl<const W: usize> Debuggee for SteppedDispatch<W>
where
    LaneKernel: Width<W>,
{
    fn resume(&mut self, tracker: &mut Tracker<'_>, inbox: &RefCell<Vec<Event>>) -> Resumed {
        // Events of ray queries are taken where they happen, as other invocations have some, too.
        let resumed = Self::resume(self, tracker, &mut |_| ());
        inbox.borrow_mut().clear();
        resumed
    }

    fn save(&self) -> SavedState {
        Box::new(self.state())
    }

    fn restore(&mut self, saved: &SavedState) {
        let saved = saved.downcast_ref::<crate::pipeline::DispatchState<W>>();
        self.set_state(saved.expect("bug in anyhit: the state of another debuggee"));
    }

    fn followed(&self) -> Followed {
        Followed::Invocation(self.id())
    }

    fn shaders(&self) -> Vec<StoppedShader> {
        let Some(batch) = self.batch().filter(|batch| self.followed().lane(batch).is_some()) else {
            return Vec::new();
        };
        let calls = batch.frames().iter().map(|frame| frame.return_to).collect();
        let op = next_step(&self.compute().program, batch);
        vec![StoppedShader { shader: ShaderIndex(0), op, calls }]
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
            batch.registers[register].0[lane] = word;
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

    fn trapped(&self) -> Option<&Error> {
        Self::trapped(self).map(|trapped| &trapped.error)
    }
}

/// The shaders that the followed lane is in, each with its place among all.
fn own_shaders<const W: usize>(
    launch: &SteppedLaunch<W>,
) -> impl Iterator<Item = (usize, ActiveShader<'_, W>)>
where
    LaneKernel: Width<W>,
{
    let lane = launch.lane();
    launch.shaders().enumerate().filter(move |(_, active)| active.batch.live().contains(lane))
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
