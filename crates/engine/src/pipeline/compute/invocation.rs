//! One invocation of a dispatch, observed.

use std::cell::{Cell, RefCell};
use std::sync::Arc;

use crate::machine::{Batch, Buffer, Exit, Observer, Resources, ShaderIndex, Watchdog};
use crate::math::array;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::compute::Compute;
use crate::pipeline::observer::Event;
use crate::pipeline::workgroup::Observers;
use crate::program::Program;
use anyhit_base::error::{Error, ErrorKind, Result};

/// What one invocation of a dispatch did.
#[derive(Clone, Debug)]
pub struct ObservedInvocation {
    /// Its events, from its `Enter` to its `Leave`: those of ray queries, their traversals
    /// included.
    pub events: Vec<Event>,
    /// The trap that ended its workgroup, if one did.
    pub trap: Option<Error>,
}

/// A boundary of the parts in which an invocation runs: from its begin, or from a barrier, up to
/// its end or to the next barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunPart {
    /// A part begins.
    Begins,
    /// A part is over.
    Ends,
}

impl Compute {
    /// Runs the workgroup of one invocation, on one thread, and returns the events of this
    /// invocation: the others run because barriers and workgroup memory need them. `on_part` is
    /// called where the invocation begins to run, or goes on behind a barrier, and where it stops.
    /// Shaders with subgroup instructions run in whole subgroups.
    ///
    /// # Errors
    /// `InvalidArgument` for an invocation outside the dispatch.
    pub fn run_invocation(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        id: [u32; 3],
        on_part: &mut dyn FnMut(RunPart),
    ) -> Result<ObservedInvocation> {
        self.check_invocation(groups, id)?;
        Ok(match self.program.uses_subgroups.then_some(self.subgroup_size) {
            None | Some(1) => self.observe_invocation::<1>(resources, groups, id, on_part),
            Some(..=64) => self.observe_invocation::<64>(resources, groups, id, on_part),
            Some(_) => self.observe_invocation::<128>(resources, groups, id, on_part),
        })
    }

    /// Checks that a dispatch has an invocation.
    pub(super) fn check_invocation(&self, groups: [u32; 3], id: [u32; 3]) -> Result<()> {
        self.check_size(groups)?;
        let size: [u32; 3] = array::from_fn(|axis| groups[axis] * self.layout.size[axis]);
        if id.iter().zip(size).any(|(&at, side)| at >= side) {
            let triple = |[x, y, z]: [u32; 3], by: &str| format!("{x}{by}{y}{by}{z}");
            let message = format!(
                "invocation {} is outside the dispatch of {} workgroups of {}",
                triple(id, ","),
                triple(groups, " x "),
                triple(self.layout.size, " x ")
            );
            let error = Error::new(ErrorKind::InvalidArgument, message);
            return Err(match size.contains(&0) {
                true => error.note("the dispatch has no invocations"),
                false => error.note(format!(
                    "its invocations range from 0,0,0 to {}",
                    triple(array::map(size, |side| side - 1), ",")
                )),
            });
        }
        Ok(())
    }

    /// The number of the workgroup that an invocation is in.
    pub(super) fn group_of(&self, groups: [u32; 3], id: [u32; 3]) -> u64 {
        let [x, y, z] = array::from_fn(|axis| u64::from(id[axis] / self.layout.size[axis]));
        let [width, height, _] = array::map(groups, u64::from);
        (z * height + y) * width + x
    }

    fn observe_invocation<const W: usize>(
        &self,
        resources: &Resources,
        groups: [u32; 3],
        id: [u32; 3],
        on_part: &mut dyn FnMut(RunPart),
    ) -> ObservedInvocation
    where
        LaneKernel: Width<W>,
    {
        let bindings = resources.bindings(self.program.bindings());
        let watch = &Watchdog::new(self.launch_limits, self.group_size()).watch();
        watch.begin_task(self.group_size());
        let (events, lane) = (RefCell::new(Vec::new()), Cell::new(None));
        let mut one = OneInvocation {
            program: &self.program,
            push_constants: bindings.push_constants.clone(),
            id,
            lane: &lane,
            events: &events,
            on_part,
            exit: Exit::Returned,
        };
        let mut on_event = |event: Event| {
            if matches!(&event, Event::RayQuery(query) if lane.get() == Some(query.lane)) {
                events.borrow_mut().push(event);
            }
        };
        let trapped = {
            let observer: &mut dyn Observer<W> = &mut one;
            let mut observers = Observers::new(observer, &mut on_event).with_traversal(true);
            let group = &mut std::iter::once(self.group(self.group_of(groups, id), groups));
            self.runner::<W>(&bindings, watch).run(group, &mut observers).1
        };
        let exit = one.exit;
        let mut events = events.into_inner();
        events.push(Event::Leave {
            shader: ShaderIndex(0),
            stage: self.program.stage,
            exit,
            payload: Vec::new(),
        });
        ObservedInvocation { events, trap: trapped.map(|trapped| trapped.error) }
    }
}

/// Follows one invocation through the batches of its workgroup.
struct OneInvocation<'a> {
    program: &'a Program,
    push_constants: Option<Arc<Buffer>>,
    id: [u32; 3],
    /// The invocation's lane, while the batch that it is in runs it.
    lane: &'a Cell<Option<u32>>,
    events: &'a RefCell<Vec<Event>>,
    on_part: &'a mut dyn FnMut(RunPart),
    exit: Exit,
}

impl<const W: usize> Observer<W> for OneInvocation<'_> {
    fn resumed(&mut self, _: ShaderIndex, batch: &mut Batch<W>) {
        let mut lanes = batch.mask.lanes();
        let lane = lanes.find(|&lane| batch.invocations.launch_id(lane) == self.id);
        self.lane.set(lane.map(|lane| lane as u32));
        let Some(lane) = lane else { return };
        let mut events = self.events.borrow_mut();
        if events.is_empty() {
            let inputs = self.program.inputs.iter();
            let words = |first, count| batch.registers.lane_words(first, count, lane).collect();
            events.push(Event::Enter {
                shader: ShaderIndex(0),
                stage: self.program.stage,
                builtins: inputs.map(|input| (input.builtin, words(input.first, input.count))).collect(),
                payload: Vec::new(),
                attributes: Vec::new(),
                push_constants: self.push_constants.clone(),
            });
        }
        (self.on_part)(RunPart::Begins);
    }

    fn stopped(&mut self, _: ShaderIndex, batch: &Batch<W>) {
        let Some(lane) = self.lane.get() else { return };
        self.exit = batch.exits[lane as usize];
        (self.on_part)(RunPart::Ends);
    }
}
