//! Which shaders and functions ran, called from where.

use std::collections::{BTreeMap, HashMap};

use anyhit_engine::machine::{BlockIndex, OpIndex, ShaderIndex};

/// A tree of calls: shaders that were called by shaders, and functions that were not inlined. Its
/// nodes count how often their blocks ran.
#[derive(Clone, Debug, Default)]
pub struct CallTree {
    calls: Vec<Call>,
    numbers: HashMap<Call, CallIndex>,
    blocks: HashMap<(CallIndex, BlockIndex), u64>,
}

/// A call in a [`CallTree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Call {
    /// The caller and where it calls; `None` for ray generation.
    pub caller: Option<(CallIndex, CallSite)>,
    /// The shader that runs.
    pub shader: ShaderIndex,
}

/// The number of a call in its tree. Callers have lower numbers than what they call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CallIndex(u32);

/// Where a call is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CallSite {
    /// The operation that traces, reports a hit or executes a callable shader.
    Op(OpIndex),
    /// The block in which the shader goes on after it has called one of its own functions.
    ReturnTo(BlockIndex),
}

impl CallTree {
    /// The number of a call.
    pub(super) fn number(&mut self, call: Call) -> CallIndex {
        let next = CallIndex(self.calls.len() as u32);
        let number = *self.numbers.entry(call).or_insert(next);
        if number == next {
            self.calls.push(call);
        }
        number
    }

    /// Counts lanes that enter a block.
    pub(super) fn enter(&mut self, call: CallIndex, block: BlockIndex, lanes: u64) {
        *self.blocks.entry((call, block)).or_default() += lanes;
    }

    /// Adds the calls of another tree, which are numbered behind those that are known.
    pub(super) fn add(&mut self, other: &Self) {
        let mut numbers = Vec::with_capacity(other.calls.len());
        for call in &other.calls {
            let caller = call.caller.map(|(caller, site)| (numbers[caller.0 as usize], site));
            numbers.push(self.number(Call { caller, shader: call.shader }));
        }
        for (&(call, block), &lanes) in &other.blocks {
            self.enter(numbers[call.0 as usize], block, lanes);
        }
    }

    /// A call by its number.
    pub fn call(&self, number: CallIndex) -> Call {
        self.calls[number.0 as usize]
    }

    /// How many lanes entered each block, in the order of calls and blocks.
    pub fn blocks(&self) -> BTreeMap<(CallIndex, BlockIndex), u64> {
        self.blocks.iter().map(|(&key, &lanes)| (key, lanes)).collect()
    }
}
