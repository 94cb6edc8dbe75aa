//! One invocation of a launch, or one ray from the host, that runs in steps: it stops where an
//! observer pauses it, goes on from there, and its state is a value that can be kept and put back.

use std::ops::Range;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::{Batch, Bindings, Observer, Resources, ShaderIndex};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::host_ray::RayOperands;
use crate::pipeline::launch::Launch;
use crate::pipeline::observer::{Event, PipelineObserver};
use crate::pipeline::order::InvocationOrder;
use crate::pipeline::stack::{ShaderCallFrame, Stack, bindings};
use crate::pipeline::stats::Stats;
use crate::pipeline::trapped::host_ray_trap;
use crate::pipeline::{Pipeline, SbtRecord, Trapped};
use anyhit_base::error::Result;

/// How a resumed run came back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resumed {
    /// The observer paused it: the operation that it paused at runs next.
    Paused,
    /// Everything has run.
    Ended,
}

/// What runs in steps.
#[derive(Clone, Debug)]
enum Subject {
    /// Invocations of the ray generation shader: one, or a subgroup.
    Invocations { record: SbtRecord, size: [u32; 3], positions: Range<u64>, launch_id: [u32; 3] },
    /// A ray from the host.
    Ray { tlas: Arc<Tlas>, operands: RayOperands },
}

/// One invocation of a launch, with its subgroup where shaders have subgroup instructions, or one
/// ray from the host. It runs without the limits of a whole launch, under the fuel of invocations.
#[derive(Clone, Debug)]
pub struct SteppedLaunch<const W: usize> {
    pipeline: Arc<Pipeline>,
    bindings: Vec<Bindings>,
    subject: Subject,
    state: LaunchState<W>,
}

/// Everything about a [`SteppedLaunch`] that changes while it runs, but for the memory that its
/// resources share.
#[derive(Clone, Debug, Default)]
pub struct LaunchState<const W: usize> {
    begun: bool,
    frames: Vec<ShaderCallFrame<W>>,
    stats: Stats,
    stack_size: u64,
    trapped: Option<Trapped>,
}

/// A shader that has begun and not ended.
#[derive(Clone, Copy, Debug)]
pub struct ActiveShader<'a, const W: usize> {
    /// The shader.
    pub shader: ShaderIndex,
    /// Its lanes.
    pub batch: &'a Batch<W>,
}

impl<const W: usize> SteppedLaunch<W>
where
    LaneKernel: Width<W>,
{
    /// The invocation of a launch index, which has not begun.
    ///
    /// # Errors
    /// `InvalidArgument` for an index outside the launch or a launch that is too large,
    /// `InvalidScene` where the pipeline has no ray generation shader.
    pub fn of_invocation(
        pipeline: Arc<Pipeline>,
        resources: &Resources,
        launch_id: [u32; 3],
        size: [u32; 3],
    ) -> Result<Self> {
        let launch = Launch { pipeline: &pipeline, resources };
        let record = launch.ray_generation()?.clone();
        launch.check_invocation(launch_id, size)?;
        let at = InvocationOrder::by_index(size).linear_index(launch_id);
        let positions = if W == 1 { at..at + 1 } else { launch.subgroup_of(launch_id, size) };
        let subject = Subject::Invocations { record, size, positions, launch_id };
        Ok(Self::new(pipeline, resources, subject))
    }

    /// A ray from the host, which has not begun.
    ///
    /// # Errors
    /// `InvalidArgument` for a ray that breaks a rule.
    pub fn of_ray(
        pipeline: Arc<Pipeline>,
        resources: &Resources,
        tlas: &Arc<Tlas>,
        operands: RayOperands,
    ) -> Result<Self> {
        Launch { pipeline: &pipeline, resources }.check_ray(&operands)?;
        let subject = Subject::Ray { tlas: tlas.clone(), operands };
        Ok(Self::new(pipeline, resources, subject))
    }

    fn new(pipeline: Arc<Pipeline>, resources: &Resources, subject: Subject) -> Self {
        let bindings = bindings(&pipeline, resources);
        Self { pipeline, bindings, subject, state: LaunchState::default() }
    }

    /// The lane of the invocation or ray.
    pub fn lane(&self) -> usize {
        match &self.subject {
            Subject::Invocations { size, positions, launch_id, .. } => {
                (InvocationOrder::by_index(*size).linear_index(*launch_id) - positions.start) as usize
            }
            Subject::Ray { .. } => 0,
        }
    }

    /// How many invocations run together.
    pub fn lane_count(&self) -> usize {
        match &self.subject {
            Subject::Invocations { positions, .. } => (positions.end - positions.start) as usize,
            Subject::Ray { .. } => 1,
        }
    }

    fn run_on(&mut self, observer: &mut dyn Observer<W>, on_event: &mut dyn FnMut(Event)) -> Resumed {
        let launch_id = match &self.subject {
            Subject::Invocations { launch_id, .. } if W > 1 => Some(*launch_id),
            _ => None,
        };
        let mut events = EventsOf { launch_id, is_selected: true, on_event };
        let mut stack = Stack::<W>::new(&self.pipeline, &self.bindings, Some(&mut events), Some(observer));
        let LaunchState { begun, frames, stats, stack_size, trapped } = std::mem::take(&mut self.state);
        (stack.frames, stack.stats, stack.stack_size, stack.trapped) = (frames, stats, stack_size, trapped);
        let traced = match &self.subject {
            _ if begun => stack.run(),
            Subject::Invocations { record, size, positions, .. } => {
                stack.launch_batch(record, &InvocationOrder::by_index(*size), positions.clone());
                None
            }
            Subject::Ray { tlas, operands } => stack.trace(tlas, operands.clone()),
        };
        let of_ray = || traced.and_then(|trace| host_ray_trap(&self.pipeline, &trace));
        let trapped = stack.trapped.or_else(of_ray);
        let (frames, stats, stack_size) = (stack.frames, stack.stats, stack.stack_size);
        self.state = LaunchState { begun: true, frames, stats, stack_size, trapped };
        match self.state.frames.is_empty() {
            true => Resumed::Ended,
            false => Resumed::Paused,
        }
    }

    /// The pipeline.
    pub fn pipeline(&self) -> &Arc<Pipeline> {
        &self.pipeline
    }

    /// The bindings of a shader.
    pub fn bindings(&self, shader: ShaderIndex) -> &Bindings {
        &self.bindings[shader.index()]
    }

    /// The trap of the lowest launch index, once there is one.
    pub fn trapped(&self) -> Option<&Trapped> {
        self.state.trapped.as_ref()
    }

    /// The state, to be put back later.
    pub fn state(&self) -> &LaunchState<W> {
        &self.state
    }

    /// Puts a state back.
    pub fn set_state(&mut self, state: LaunchState<W>) {
        self.state = state;
    }

    /// The shaders that have begun and not ended, the outermost first; the last one runs, the
    /// others wait for it.
    pub fn shaders(&self) -> impl Iterator<Item = ActiveShader<'_, W>> {
        self.state.frames.iter().filter_map(|frame| match frame {
            ShaderCallFrame::Shader(running) => {
                Some(ActiveShader { shader: running.shader, batch: &running.batch })
            }
            _ => None,
        })
    }

    /// Number of [`SteppedLaunch::shaders`].
    pub fn shader_count(&self) -> usize {
        let numbers = self.state.frames.iter().rev().find_map(|frame| match frame {
            ShaderCallFrame::Shader(running) => Some(running.number),
            _ => None,
        });
        numbers.map_or(0, |last| last + 1)
    }

    /// Returns one of [`SteppedLaunch::shaders`], by its number from the outermost.
    pub fn shader(&self, number: usize) -> Option<ActiveShader<'_, W>> {
        match self.state.frames.get(self.frame_of(number)?)? {
            ShaderCallFrame::Shader(running) => {
                Some(ActiveShader { shader: running.shader, batch: &running.batch })
            }
            _ => None,
        }
    }

    /// The lanes of one of [`SteppedLaunch::shaders`], by its number from the outermost.
    pub fn batch_mut(&mut self, number: usize) -> Option<&mut Batch<W>> {
        let frame = self.frame_of(number)?;
        match self.state.frames.get_mut(frame)? {
            ShaderCallFrame::Shader(running) => Some(&mut running.batch),
            _ => None,
        }
    }

    /// Finds the frame of a shader by bisection: at most two frames are between two shaders.
    fn frame_of(&self, number: usize) -> Option<usize> {
        let frames = &self.state.frames;
        let (mut first, mut end) = (0, frames.len());
        while first < end {
            let middle = first + (end - first) / 2;
            let below = (first..=middle).rev().find_map(|at| match &frames[at] {
                ShaderCallFrame::Shader(running) => Some((at, running.number)),
                _ => None,
            });
            match below {
                Some((at, found)) if found == number => return Some(at),
                Some((at, found)) if found > number => end = at,
                _ => first = middle + 1,
            }
        }
        None
    }
}

/// Functions for each number of lanes: a generic one would be compiled with the whole pipeline once
/// more in each crate that calls it.
macro_rules! resume {
    ($($lanes:literal),*) => {$(
        impl SteppedLaunch<$lanes> {
            /// Runs from where it stands until the observer pauses it or everything has run. Events
            /// are those of the one invocation or ray.
            pub fn resume(
                &mut self,
                observer: &mut dyn Observer<$lanes>,
                on_event: &mut dyn FnMut(Event),
            ) -> Resumed {
                self.run_on(observer, on_event)
            }
        }
    )*};
}
resume!(1, 64, 128);

/// Passes on the events of one invocation, traversals of rays and ray queries included.
struct EventsOf<'a> {
    /// The invocation's launch index; `None` where only one runs.
    launch_id: Option<[u32; 3]>,
    is_selected: bool,
    on_event: &'a mut dyn FnMut(Event),
}

impl PipelineObserver for EventsOf<'_> {
    fn observes_query_traversal(&self) -> bool {
        true
    }

    fn invocation(&mut self, launch_id: [u32; 3]) {
        self.is_selected = self.launch_id.is_none_or(|wanted| wanted == launch_id);
    }

    fn event(&mut self, event: Event) {
        if self.is_selected {
            (self.on_event)(event);
        }
    }
}
