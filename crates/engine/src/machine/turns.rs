//! What lanes did in their last turns of a loop, for the report of one that has no end.

use crate::machine::index::OpIndex;
use crate::machine::lanes::{Reg, Registers};

/// The turns of a lane through one back edge, while it was watched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoopTurns {
    /// The terminator that went back.
    pub op: OpIndex,
    /// How often it went back, up to when `last` was taken.
    pub count: u64,
    /// How often it went back in all.
    turns: u64,
    /// The watched registers when it first went back.
    pub first: Box<[u32]>,
    /// The watched registers when it last went back.
    pub last: Box<[u32]>,
}

/// The turns of all lanes of a batch.
#[derive(Clone, Debug, Default)]
pub struct Turns(Vec<Vec<LoopTurns>>);

/// Back edges that are told apart for a lane.
const MOST_EDGES: usize = 64;
/// Turns whose registers are all copied.
const FIRST_TURNS: u64 = 16;

impl Turns {
    /// Forgets them.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Notes that a lane goes back at a terminator. Registers are copied in the first turns, then
    /// ever more rarely, and in the turn that is known to be the last.
    pub fn note<const W: usize>(
        &mut self,
        lane: usize,
        op: OpIndex,
        is_last: bool,
        registers: &Registers<W>,
        watched: &[Reg],
    ) {
        if self.0.len() <= lane {
            self.0.resize_with(lane + 1, Vec::new);
        }
        let values = watched.iter().map(|&reg| registers[reg].0[lane]);
        let edges = &mut self.0[lane];
        let Some(known) = edges.iter_mut().find(|turns| turns.op == op) else {
            if edges.len() < MOST_EDGES {
                let first: Box<[u32]> = values.collect();
                edges.push(LoopTurns { op, count: 1, turns: 1, last: first.clone(), first });
            }
            return;
        };
        known.turns += 1;
        if known.turns <= FIRST_TURNS || known.turns.is_power_of_two() || is_last {
            known.count = known.turns;
            known.last.iter_mut().zip(values).for_each(|(to, value)| *to = value);
        }
    }

    /// Those of a lane, by back edge.
    pub fn of(&self, lane: usize) -> &[LoopTurns] {
        self.0.get(lane).map_or(&[], |turns| turns)
    }
}
