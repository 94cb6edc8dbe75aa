//! The observers that count.

use std::cell::RefCell;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use crate::cost::instructions;
use crate::pixel_cost::call_tree::{Call, CallIndex, CallSite, CallTree};
use crate::pixel_cost::{InvocationPlane, LaunchCost, PixelCost};
use anyhit_base::error::Result;
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::accel::TestCounts;
use anyhit_engine::machine::{Batch, Observer, RayQueryEvent, RayQueryStep, Resources, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{Compute, Event, Launch, Pipeline, PipelineObserver};

/// The lanes of the widest batch that is observed. Batches are of consecutive launch indices and
/// begin at multiples of it.
const LANES: usize = 64;

/// Counts what invocations of a launch cost that follow each other, or those of a dispatch.
struct Counter<'a> {
    size: [u32; 3],
    /// By shader and block: the instructions.
    instructions: &'a [Vec<u64>],
    subgroup_size: u32,
    state: RefCell<State>,
}

#[derive(Default)]
struct State {
    /// The number of the first invocation.
    first: usize,
    pixels: Vec<PixelCost>,
    calls: CallTree,
    /// Running and waiting shaders of each lane, the outermost first. All lanes of a dispatch have
    /// the same shader, which calls no other.
    stacks: Vec<Vec<CallFrame>>,
    /// Invocation of each lane of the running batch, by its number in launch order.
    by_lane: Vec<usize>,
    /// The invocation that events are of, by its number in launch order.
    invocation: usize,
    shader: ShaderIndex,
    /// Whether batches had one lane only.
    one_by_one: bool,
}

/// A shader that runs or waits in a lane.
#[derive(Clone)]
struct CallFrame {
    call: CallIndex,
    /// Where it waits.
    site: Option<CallSite>,
}

/// Runs a launch, and counts what its invocations cost: on all threads, each task by itself.
///
/// # Errors
/// As [`Launch::run_observed_on_threads`].
pub(super) fn count(launch: &Launch<'_>, size: [u32; 3]) -> Result<LaunchCost> {
    let Pipeline { programs, subgroup_size, .. } = launch.pipeline;
    let instructions: Vec<_> = programs.iter().map(|program| instructions(program)).collect();
    let counted: Mutex<Vec<State>> = Mutex::default();
    launch.run_observed_on_threads(size, &|range, run| {
        let mut state = State { first: range.start as usize, ..State::default() };
        state.pixels.resize((range.end - range.start) as usize, PixelCost::default());
        state.stacks.resize_with(LANES, Vec::new);
        let counter = Counter {
            size,
            instructions: &instructions,
            subgroup_size: *subgroup_size,
            state: RefCell::new(state),
        };
        run(&mut Events(&counter), &mut Blocks(&counter));
        counted.lock().unwrap_or_else(PoisonError::into_inner).push(counter.state.into_inner());
    })?;
    let mut counted = counted.into_inner().unwrap_or_else(PoisonError::into_inner);
    sort_by_key(&mut counted, |state| state.first);
    let count = size.iter().map(|&side| side as usize).product();
    let (mut pixels, mut calls) = (Vec::with_capacity(count), CallTree::default());
    let mut one_by_one = false;
    for state in counted {
        one_by_one |= state.one_by_one;
        pixels.extend(state.pixels);
        calls.add(&state.calls);
    }
    // Of a launch that is not observed nothing is counted.
    pixels.resize(count, PixelCost::default());
    let subgroup_size = observed_subgroups(*subgroup_size, one_by_one);
    let plane = InvocationPlane::of_launch(size);
    Ok(LaunchCost { plane, pixels, subgroup_size, calls })
}

/// Runs a dispatch, and counts what its invocations cost, on one thread.
///
/// # Errors
/// As [`Compute::run_observed`].
pub(super) fn count_dispatch(
    compute: &Compute,
    resources: &Resources,
    groups: [u32; 3],
    size: [u32; 3],
) -> Result<LaunchCost> {
    let count = size.iter().map(|&side| side as usize).product();
    let mut state = State { pixels: vec![PixelCost::default(); count], ..State::default() };
    let call = state.calls.number(Call { caller: None, shader: ShaderIndex(0) });
    state.stacks.resize(LANES, vec![CallFrame { call, site: None }]);
    let counter = Counter {
        size,
        instructions: &[instructions(&compute.program)],
        subgroup_size: compute.subgroup_size,
        state: RefCell::new(state),
    };
    let mut on_event = |event: Event| {
        let state = &mut *counter.state.borrow_mut();
        if let Event::RayQuery(query) = event {
            let invocation = state.by_lane[query.lane as usize];
            state.pixels[invocation].count_query(&query);
        }
    };
    let mut blocks = Blocks(&counter);
    compute.run_observed_with_traversal(resources, groups, &mut on_event, &mut blocks)?;
    let State { pixels, calls, one_by_one, .. } = counter.state.into_inner();
    let subgroup_size = observed_subgroups(compute.subgroup_size, one_by_one);
    let plane = InvocationPlane::of_dispatch(size, compute.workgroup_size());
    Ok(LaunchCost { plane, pixels, subgroup_size, calls })
}

/// The subgroup size, where the divergence of subgroups was observed.
fn observed_subgroups(subgroup_size: u32, one_by_one: bool) -> Option<u32> {
    let is_seen = subgroup_size == 1 || !one_by_one;
    Some(subgroup_size).filter(|&size| is_seen && size as usize <= LANES)
}

impl PixelCost {
    /// Counts a step of a ray query.
    fn count_query(&mut self, event: &RayQueryEvent) {
        match event.step {
            RayQueryStep::Node(_) => self.nodes += 1,
            RayQueryStep::Primitive(..) => self.primitives += 1,
            _ => {}
        }
    }
}

impl Counter<'_> {
    /// The number of a lane's invocation in launch order: x of the launch index, or of the global
    /// invocation ID, is fastest.
    fn number<const W: usize>(&self, batch: &Batch<W>, lane: usize) -> usize {
        let [x, y, z] = batch.invocations.launch_id(lane).map(|axis| axis as usize);
        let [width, height, _] = self.size.map(|side| side as usize);
        (z * height + y) * width + x
    }

    /// The numbers ([`Invocations::number`](anyhit_engine::machine::Invocations::number)) of the
    /// invocations in the subgroup of a lane, of a launch whose invocations up to `end` are
    /// counted.
    fn subgroup<const W: usize>(&self, batch: &Batch<W>, lane: usize, end: u64) -> Range<u64> {
        let size = u64::from(self.subgroup_size);
        // The numbers of a dispatch are in the order of its workgroups, which have subgroups of
        // their own.
        let number = batch.invocations.number(lane);
        let (begin, end) = match batch.invocations.workgroup(lane) {
            Some(workgroup) => {
                let begin = workgroup.index() * u64::from(workgroup.invocations());
                (begin, begin + u64::from(workgroup.invocations()))
            }
            None => (0, end),
        };
        let first = begin + (number - begin) / size * size;
        first..(first + size).min(end)
    }
}

impl State {
    /// The pixel of an invocation.
    fn pixel(&mut self, number: usize) -> &mut PixelCost {
        &mut self.pixels[number - self.first]
    }
}

/// Receives the events of the launch.
struct Events<'a>(&'a Counter<'a>);

impl PipelineObserver for Events<'_> {
    fn observes_query_traversal(&self) -> bool {
        true
    }

    fn counts_tests(&self) -> bool {
        true
    }

    fn observes_values(&self) -> bool {
        false
    }

    fn invocation(&mut self, launch_id: [u32; 3]) {
        let [x, y, z] = launch_id.map(|axis| axis as usize);
        let [width, height, _] = self.0.size.map(|side| side as usize);
        self.0.state.borrow_mut().invocation = (z * height + y) * width + x;
    }

    fn tests(&mut self, counts: TestCounts) {
        let state = &mut *self.0.state.borrow_mut();
        let pixel = &mut state.pixels[state.invocation - state.first];
        pixel.nodes += counts.nodes;
        pixel.primitives += counts.primitives;
    }

    fn event(&mut self, event: Event) {
        let state = &mut *self.0.state.borrow_mut();
        let pixel = &mut state.pixels[state.invocation - state.first];
        let stack = &mut state.stacks[state.invocation % LANES];
        match event {
            Event::RayQuery(event) => pixel.count_query(&event),
            Event::Enter { shader, stage, .. } => {
                pixel.any_hit += u64::from(stage == Stage::AnyHit);
                let caller = stack.last().and_then(|frame| Some((frame.call, frame.site?)));
                let call = state.calls.number(Call { caller, shader });
                stack.push(CallFrame { call, site: None });
            }
            Event::Leave { .. } => {
                stack.pop();
            }
            _ => {}
        }
    }
}

/// Observes the blocks that run.
struct Blocks<'a>(&'a Counter<'a>);

impl<const W: usize> Observer<W> for Blocks<'_> {
    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        let mut state = self.0.state.borrow_mut();
        state.shader = shader;
        state.one_by_one |= W == 1;
        state.by_lane.clear();
        state.by_lane.extend((0..W).map(|lane| self.0.number(batch, lane)));
    }

    fn stopped(&mut self, _: ShaderIndex, batch: &Batch<W>) {
        let mut state = self.0.state.borrow_mut();
        for lane in batch.mask.lanes() {
            let number = state.by_lane[lane];
            if let Some(frame) = state.stacks[number % LANES].last_mut() {
                frame.site = Some(CallSite::Op(batch.stopped_at()));
            }
        }
    }

    fn block(&mut self, batch: &Batch<W>) {
        let state = &mut *self.0.state.borrow_mut();
        let shader = state.shader;
        let count = self.0.instructions[shader.index()][batch.block.index()];
        let end = (state.first + state.pixels.len()) as u64;
        let mut lanes = batch.mask.lanes().peekable();
        // Neighbours mostly have the same caller: they are counted together.
        let mut same: Option<(CallIndex, u64)> = None;
        while let Some(&first) = lanes.peek() {
            let members = self.0.subgroup(batch, first, end);
            let is_member = |lane: &usize| members.contains(&batch.invocations.number(*lane));
            let mut running = 0;
            while let Some(lane) = lanes.next_if(is_member) {
                running += 1;
                let number = state.by_lane[lane];
                state.pixel(number).instructions += count;
                let Some(frame) = state.stacks[number % LANES].last() else { continue };
                same = Some(match same {
                    Some((call, lanes)) if call == frame.call => (call, lanes + 1),
                    other => {
                        enter(&mut state.calls, other, shader, batch);
                        (frame.call, 1)
                    }
                });
            }
            if running < members.end - members.start {
                for lane in batch.mask.lanes().filter(is_member) {
                    let number = state.by_lane[lane];
                    state.pixel(number).divergent += count;
                }
            }
        }
        enter(&mut state.calls, same, shader, batch);
    }
}

/// Counts lanes of one caller that enter a batch's block, in the function that they are in.
fn enter<const W: usize>(
    calls: &mut CallTree,
    lanes: Option<(CallIndex, u64)>,
    shader: ShaderIndex,
    batch: &Batch<W>,
) {
    let Some((call, lanes)) = lanes else { return };
    let function = batch.frames().iter().fold(call, |call, frame| {
        calls.number(Call { caller: Some((call, CallSite::ReturnTo(frame.return_to))), shader })
    });
    calls.enter(function, batch.block, lanes);
}
