//! What single rays cost: any-hit invocations and instructions, and which ray needs the most.
//!
//! A ray pays for its own intersection, any-hit, closest-hit and miss shaders and the callable
//! shaders that they call. A ray that one of them traces pays for itself. Instructions are those of
//! the module, as the compiler wrote them, in every block that runs: how this crate lowers them
//! does not count.

use std::cell::RefCell;

use anyhit_engine::machine::{Batch, Observer, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{Event, Pipeline};
use anyhit_engine::program::Program;

/// The most that a ray of a launch needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Costs {
    /// Any-hit invocations; `None` where no ray was traced.
    pub any_hit: Option<Most>,
    /// Instructions; `None` where no ray was traced.
    pub instructions: Option<Most>,
}

/// A count and the first ray that has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Most {
    /// How many.
    pub count: u64,
    /// The invocation of ray generation that the ray comes from; `None` for a given ray.
    pub launch_id: Option<[u32; 3]>,
    /// Which of its rays, in the order in which they are traced, from 0.
    pub ray: u32,
}

impl Costs {
    /// The greater of two; the first where they are equal.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        let more = |one: Option<Most>, other: Option<Most>| match (one, other) {
            (Some(one), Some(other)) if other.count > one.count => Some(other),
            (one, other) => one.or(other),
        };
        Self {
            any_hit: more(self.any_hit, other.any_hit),
            instructions: more(self.instructions, other.instructions),
        }
    }
}

/// Counts while one invocation runs: hand [`Meter::event`] its events and [`Meter::counter`] to the
/// interpreter.
#[derive(Debug)]
pub struct Meter {
    launch_id: Option<[u32; 3]>,
    /// By shader and block: the instructions.
    blocks: Vec<Vec<u64>>,
    state: RefCell<State>,
}

#[derive(Debug, Default)]
struct State {
    /// The rays in progress, outermost first: number, any-hit invocations, instructions.
    open: Vec<(u32, u64, u64)>,
    rays: u32,
    shader: ShaderIndex,
    costs: Costs,
}

impl Meter {
    /// A meter for invocations of a pipeline.
    pub fn new(pipeline: &Pipeline) -> Self {
        let blocks = pipeline.programs.iter().map(|program| instructions(program)).collect();
        Self { launch_id: None, blocks, state: RefCell::default() }
    }

    /// The next invocation begins.
    pub fn begin(&mut self, launch_id: Option<[u32; 3]>) {
        self.launch_id = launch_id;
        let state = self.state.get_mut();
        (state.open, state.rays) = (Vec::new(), 0);
    }

    /// Takes an event of the invocation.
    pub fn event(&self, event: &Event) {
        let mut state = self.state.borrow_mut();
        match event {
            Event::Trace { .. } => {
                let number = state.rays;
                state.rays += 1;
                state.open.push((number, 0, 0));
            }
            Event::Enter { stage: Stage::AnyHit, .. } => {
                if let Some(ray) = state.open.last_mut() {
                    ray.1 += 1;
                }
            }
            Event::Traced { .. } => {
                if let Some((ray, any_hit, instructions)) = state.open.pop() {
                    let most = |count| Some(Most { count, launch_id: self.launch_id, ray });
                    let costs = Costs { any_hit: most(any_hit), instructions: most(instructions) };
                    state.costs = state.costs.or(costs);
                }
            }
            _ => {}
        }
    }

    /// What counts the instructions.
    pub fn counter(&self) -> Counter<'_> {
        Counter(self)
    }

    /// What was counted so far.
    pub fn costs(&self) -> Costs {
        self.state.borrow().costs
    }
}

/// Counts instructions for a [`Meter`].
#[derive(Debug)]
pub struct Counter<'a>(&'a Meter);

impl Observer<1> for Counter<'_> {
    fn resumed(&mut self, shader: ShaderIndex, _: &mut Batch<1>) {
        self.0.state.borrow_mut().shader = shader;
    }

    fn block(&mut self, batch: &Batch<1>) {
        let mut state = self.0.state.borrow_mut();
        let count = self.0.blocks[state.shader.index()][batch.block.index()];
        if let Some(ray) = state.open.last_mut() {
            ray.2 += count;
        }
    }
}

/// The instructions of a program's blocks.
pub(super) fn instructions(program: &Program) -> Vec<u64> {
    let mut counts = vec![0; program.blocks.len()];
    for span in &program.instruction_spans {
        counts[span.block.index()] += u64::from(span.count);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_equal_rays_the_first_counts() {
        let most =
            |count, ray| Costs { any_hit: Some(Most { count, launch_id: None, ray }), instructions: None };
        assert_eq!(most(3, 0).or(most(3, 1)), most(3, 0));
        assert_eq!(most(3, 0).or(most(4, 1)), most(4, 1));
        assert_eq!(Costs::default().or(most(0, 1)), most(0, 1));
    }
}
