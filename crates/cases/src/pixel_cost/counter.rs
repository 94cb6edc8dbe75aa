//! The observers that count.

use std::cell::RefCell;
use std::sync::{Mutex, PoisonError};

use crate::cost::instructions;
use crate::pixel_cost::call_tree::{Call, CallIndex, CallSite, CallTree};
use crate::pixel_cost::{LaunchCost, PixelCost};
use anyhit_base::error::Result;
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::accel::TestCounts;
use anyhit_engine::machine::{Batch, Observer, RayQueryStep, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{Event, Launch, Pipeline, PipelineObserver};

/// The lanes of the widest batch that is observed. Batches are of consecutive launch indices and
/// begin at multiples of it.
const LANES: usize = 64;

/// Counts what invocations of a launch cost that follow each other.
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
    /// By lane: its shaders that run or wait, the outermost first.
    stacks: Vec<Vec<CallFrame>>,
    /// The invocation that events are of, by its number in launch order.
    invocation: usize,
    shader: ShaderIndex,
    /// Whether batches had one lane only.
    one_by_one: bool,
}

/// A shader that runs or waits in a lane.
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
    let is_seen = *subgroup_size == 1 || !one_by_one;
    let subgroup_size = Some(*subgroup_size).filter(|&size| is_seen && size as usize <= LANES);
    Ok(LaunchCost { size, pixels, subgroup_size, calls })
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
            Event::RayQuery(event) => match event.step {
                RayQueryStep::Node(_) => pixel.nodes += 1,
                RayQueryStep::Primitive(..) => pixel.primitives += 1,
                _ => {}
            },
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
    fn resumed(&mut self, shader: ShaderIndex, _: &mut Batch<W>) {
        let mut state = self.0.state.borrow_mut();
        state.shader = shader;
        state.one_by_one |= W == 1;
    }

    fn stopped(&mut self, _: ShaderIndex, batch: &Batch<W>) {
        let mut state = self.0.state.borrow_mut();
        for lane in batch.mask.lanes() {
            let number = batch.invocations.number(lane) as usize;
            if let Some(frame) = state.stacks[number % LANES].last_mut() {
                frame.site = Some(CallSite::Op(batch.stopped_at()));
            }
        }
    }

    fn block(&mut self, batch: &Batch<W>) {
        let state = &mut *self.0.state.borrow_mut();
        let shader = state.shader;
        let count = self.0.instructions[shader.index()][batch.block.index()];
        let mut lanes = batch.mask.lanes().map(|lane| batch.invocations.number(lane) as usize).peekable();
        // Neighbours mostly have the same caller: they are counted together.
        let mut same: Option<(CallIndex, u64)> = None;
        while let Some(&first) = lanes.peek() {
            let subgroup = first as u64 / u64::from(self.0.subgroup_size);
            let begin = subgroup * u64::from(self.0.subgroup_size);
            let end =
                (begin + u64::from(self.0.subgroup_size)).min((state.first + state.pixels.len()) as u64);
            let mut running = 0;
            while let Some(number) = lanes.next_if(|&number| (number as u64) < end) {
                running += 1;
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
            if running < end - begin {
                let mut rest = batch.mask.lanes().map(|lane| batch.invocations.number(lane));
                while let Some(number) = rest.find(|number| (begin..end).contains(number)) {
                    state.pixel(number as usize).divergent += count;
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
