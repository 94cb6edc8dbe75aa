//! Metamorphic rewriting: modules changed at random so that they do the same.
//!
//! A [`Step`] is one small change, the inverse of something an optimizer does: a value takes a
//! detour through a variable, an expression becomes a function, a block a loop of one turn. Steps
//! are drawn from a seed by [`plan`] and applied by [`apply`]. What they change must not be seen:
//! every buffer, image, payload and trap stays, bit for bit, and every `file:line`.
//!
//! A step picks its place by a hash of what is there, not by counting: so it picks the same place
//! when steps before it are left out, which lets a failing list of steps be made short.

mod build;
mod calls;
mod flow;
mod graph;
mod memory;
mod operations;
mod outline;
mod places;
mod values;
pub mod words;

use build::Rng;
pub use words::Module;

/// A kind of change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// A value stored in a new variable and loaded.
    ThroughVariable,
    /// A value stored in a struct or an array and loaded.
    ThroughAggregate,
    /// A composite made again from its parts.
    FromParts,
    /// `OpSelect` between a value and itself.
    Selected,
    /// Two operations that cancel.
    ThereAndBack,
    /// `c && c`, `!!c`.
    DoubledCondition,
    /// `OpCopyObject`.
    Copied,
    /// An operation on vectors component by component.
    Scalarised,
    /// Operands of a commutative operation exchanged, a comparison turned around.
    Commuted,
    /// A phi as a variable.
    PhiAsVariable,
    /// A load made twice.
    RepeatedLoad,
    /// A load, or store, of a composite part by part.
    PartwiseAccess,
    /// A store made twice, or something else stored first.
    RepeatedStore,
    /// A variable that is written and never read.
    DeadVariable,
    /// Load and store as `OpCopyMemory`, or the other way round.
    CopiedMemory,
    /// An expression as a function that returns it.
    OutlinedByValue,
    /// An expression as a function that writes it through a pointer.
    OutlinedByPointer,
    /// A stretch of a block as a function.
    OutlinedStretch,
    /// A call made first on copies of its variables.
    CallOnCopy,
    /// A call replaced by the body of a function of one block.
    Inlined,
    /// A block cut in two.
    SplitBlock,
    /// A stretch of a block in a loop of one turn.
    LoopOnce,
    /// A selection in a loop of one turn.
    LoopOnceAroundSelection,
    /// A stretch of a block under a condition that is true.
    UnderCondition,
    /// `if (c) { if (c) { … } }`
    DoubledSelection,
    /// A conditional branch as a switch.
    SwitchForBranch,
    /// A conditional branch on the opposite.
    NegatedBranch,
    /// Functions in another order.
    PermutedFunctions,
    /// Other numbers for all ids.
    RenumberedIds,
}

impl Family {
    /// All of them.
    pub const ALL: &[Self] = &[
        Self::ThroughVariable,
        Self::ThroughAggregate,
        Self::FromParts,
        Self::Selected,
        Self::ThereAndBack,
        Self::DoubledCondition,
        Self::Copied,
        Self::Scalarised,
        Self::Commuted,
        Self::PhiAsVariable,
        Self::RepeatedLoad,
        Self::PartwiseAccess,
        Self::RepeatedStore,
        Self::DeadVariable,
        Self::CopiedMemory,
        Self::OutlinedByValue,
        Self::OutlinedByPointer,
        Self::OutlinedStretch,
        Self::CallOnCopy,
        Self::Inlined,
        Self::SplitBlock,
        Self::LoopOnce,
        Self::LoopOnceAroundSelection,
        Self::UnderCondition,
        Self::DoubledSelection,
        Self::SwitchForBranch,
        Self::NegatedBranch,
        Self::PermutedFunctions,
        Self::RenumberedIds,
    ];
}

/// One change: its kind, and the key that all its choices are drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The kind.
    pub family: Family,
    /// The key.
    pub key: u64,
    /// Its own range of new ids, so that they do not depend on the steps before.
    slot: u32,
}

/// How many new ids a step may use.
const IDS_OF_A_STEP: u32 = 2000;

/// Draws steps from a seed; the last may put functions and ids into another order.
pub fn plan(seed: u64, count: usize) -> Vec<Step> {
    let mut rng = Rng(seed);
    let last = [Family::PermutedFunctions, Family::RenumberedIds];
    let most = Family::ALL.len() - last.len();
    let mut steps: Vec<Step> = (0..count)
        .map(|slot| Step { family: Family::ALL[rng.below(most)], key: rng.draw(), slot: slot as u32 })
        .collect();
    for (at, family) in last.into_iter().enumerate() {
        if rng.one_in(2) {
            steps.push(Step { family, key: rng.draw(), slot: (count + at) as u32 });
        }
    }
    steps
}

/// Applies a step; `false` where the module has no place for it, and then nothing is changed.
pub fn apply(module: &mut Module, step: &Step) -> bool {
    let before = module.clone();
    let first = module.first_id + step.slot * IDS_OF_A_STEP;
    module.next_id = first;
    let mut rng = Rng(step.key);
    let done = match step.family {
        Family::ThroughVariable => places::remake(module, &mut rng, values::through_variable),
        Family::ThroughAggregate => places::remake(module, &mut rng, values::through_aggregate),
        Family::FromParts => places::remake(module, &mut rng, values::from_parts),
        Family::Selected => places::remake(module, &mut rng, values::selected),
        Family::ThereAndBack => places::remake(module, &mut rng, values::there_and_back),
        Family::DoubledCondition => places::remake(module, &mut rng, values::doubled_condition),
        Family::Copied => places::remake(module, &mut rng, values::copied),
        Family::Scalarised => operations::scalarised(module, &mut rng),
        Family::Commuted => operations::commuted(module, &mut rng),
        Family::PhiAsVariable => memory::phi_as_variable(module, &mut rng),
        Family::RepeatedLoad => memory::repeated_load(module, &mut rng),
        Family::PartwiseAccess => memory::partwise(module, &mut rng),
        Family::RepeatedStore => memory::repeated_store(module, &mut rng),
        Family::DeadVariable => memory::dead_variable(module, &mut rng),
        Family::CopiedMemory => memory::copied_memory(module, &mut rng),
        Family::OutlinedByValue => outline::by_value(module, &mut rng),
        Family::OutlinedByPointer => outline::by_pointer(module, &mut rng),
        Family::OutlinedStretch => outline::stretch(module, &mut rng),
        Family::CallOnCopy => calls::on_copy(module, &mut rng),
        Family::Inlined => calls::inlined(module, &mut rng),
        Family::SplitBlock => flow::split_block(module, &mut rng),
        Family::LoopOnce => flow::loop_once(module, &mut rng),
        Family::LoopOnceAroundSelection => flow::loop_around_selection(module, &mut rng),
        Family::UnderCondition => flow::under_condition(module, &mut rng),
        Family::DoubledSelection => flow::doubled_selection(module, &mut rng),
        Family::SwitchForBranch => flow::switch_for_branch(module, &mut rng),
        Family::NegatedBranch => flow::negated_branch(module, &mut rng),
        Family::PermutedFunctions => {
            let many = module.functions.len() > 1;
            for at in (1..module.functions.len()).rev() {
                module.functions.swap(at, rng.below(at + 1));
            }
            many.then_some(())
        }
        Family::RenumberedIds => {
            places::renumber(module, &mut rng);
            Some(())
        }
    }
    .is_some()
        && (step.family == Family::RenumberedIds || module.next_id <= first + IDS_OF_A_STEP);
    if done {
        module.highest_id = module.highest_id.max(module.next_id);
    } else {
        *module = before;
    }
    done
}

/// A module with steps applied, and which of them found a place.
///
/// # Errors
/// Where the module cannot be read.
pub fn rewritten(bytes: &[u8], steps: &[Step]) -> Result<(Vec<u8>, Vec<Step>), String> {
    let mut module = Module::parse(bytes)?;
    let done = steps.iter().filter(|step| apply(&mut module, step)).copied().collect();
    places::compact(&mut module);
    Ok((module.bytes(), done))
}
