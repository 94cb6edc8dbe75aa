//! Subgroup instructions, in which all members of a subgroup take part.

use rspirv::spirv::{GlslStd450Op as GLOp, GroupOperation, Op};

use super::super::arithmetic as exact;
use super::super::reader::{Code, Id, Type};
use super::{Cell, Invocation, Machine, Outcome, defined, known, truth};

impl Machine<'_> {
    /// A subgroup instruction: all members of a subgroup take part.
    pub(super) fn together(&self, code: Code, members: &mut [Invocation]) -> Outcome<()> {
        let w = self.words(code).to_vec();
        let count = members.len();
        let size = self.size(w[1]);
        let width = self.width(w[1]);
        let is_float = matches!(self.scalar(w[1]), Type::Float(_));
        let mut results: Vec<Vec<Cell>> = vec![Vec::new(); count];
        let last = *w.last().expect("an operand");
        let operand = if matches!(code.op, Op::GroupNonUniformElect) { w[1] } else { w[4] };
        let value = |at: usize, id: Id| self.value(&members[at], id).to_vec();
        let scan = |at: usize, operation: GroupOperation| match operation {
            GroupOperation::Reduce => 0..count,
            GroupOperation::InclusiveScan => 0..at + 1,
            _ => 0..at,
        };
        for at in 0..count {
            let from = |source: u64| -> Outcome<Vec<Cell>> {
                // What an invocation that is none has is not defined.
                Ok(if source < count as u64 {
                    value(source as usize, operand)
                } else {
                    vec![Cell::default(); size]
                })
            };
            let own = |id: Id| self.number(&members[at], id);
            results[at] = match code.op {
                Op::GroupNonUniformElect => vec![truth(at == 0)],
                Op::GroupNonUniformAll | Op::GroupNonUniformAny => {
                    let mut all = Vec::new();
                    for one in 0..count {
                        all.push(known(value(one, operand)[0])? == 1);
                    }
                    vec![truth(if code.op == Op::GroupNonUniformAll {
                        !all.contains(&false)
                    } else {
                        all.contains(&true)
                    })]
                }
                Op::GroupNonUniformAllEqual => {
                    let first = value(0, operand);
                    let mut same = true;
                    for one in 0..count {
                        for (a, b) in value(one, operand).iter().zip(&first) {
                            same &= known(*a)? == known(*b)?;
                        }
                    }
                    vec![truth(same)]
                }
                Op::GroupNonUniformBallot => {
                    let mut words = [0u64; 4];
                    for one in 0..count {
                        words[one / 32] |= known(value(one, operand)[0])? << (one % 32);
                    }
                    words.map(defined).to_vec()
                }
                Op::GroupNonUniformBroadcast => from(own(last)?)?,
                Op::GroupNonUniformBroadcastFirst => from(0)?,
                Op::GroupNonUniformShuffle => from(own(last)?)?,
                Op::GroupNonUniformShuffleXor => from(at as u64 ^ own(last)?)?,
                Op::GroupNonUniformShuffleUp => from((at as u64).wrapping_sub(own(last)?))?,
                Op::GroupNonUniformShuffleDown => from(at as u64 + own(last)?)?,
                Op::GroupNonUniformInverseBallot | Op::GroupNonUniformBallotBitExtract => {
                    let bit =
                        if code.op == Op::GroupNonUniformInverseBallot { at as u64 } else { own(last)? };
                    let ballot = value(at, operand);
                    let word = *ballot.get(bit as usize / 32).ok_or("undefined: no such bit")?;
                    vec![truth(known(word)? >> (bit % 32) & 1 == 1)]
                }
                Op::GroupNonUniformBallotBitCount => {
                    let ballot = value(at, last);
                    let mut sum = 0;
                    // Bits of the subgroup's own invocations count.
                    for bit in scan(at, GroupOperation::from_u32(w[4]).ok_or("a group operation")?) {
                        sum += known(ballot[bit / 32])? >> (bit % 32) & 1;
                    }
                    vec![defined(sum)]
                }
                op => {
                    let operation = GroupOperation::from_u32(w[4]).ok_or("a group operation")?;
                    let mut all: Vec<Vec<u64>> = Vec::new();
                    for one in scan(at, operation) {
                        let cells = value(one, w[5]);
                        all.push(cells.into_iter().map(known).collect::<Result<_, _>>()?);
                    }
                    let mut result = Vec::new();
                    for component in 0..size {
                        let mut values = all.iter().map(|cells| cells[component]);
                        let combine = |a: u64, b: u64| -> Option<u64> {
                            match op {
                                Op::GroupNonUniformIAdd => exact::integers(Op::IAdd, a, b, width),
                                Op::GroupNonUniformIMul => exact::integers(Op::IMul, a, b, width),
                                Op::GroupNonUniformBitwiseAnd => Some(a & b),
                                Op::GroupNonUniformBitwiseOr => Some(a | b),
                                Op::GroupNonUniformBitwiseXor => Some(a ^ b),
                                Op::GroupNonUniformLogicalAnd => Some(a & b),
                                Op::GroupNonUniformLogicalOr => Some(a | b),
                                Op::GroupNonUniformLogicalXor => Some(a ^ b),
                                Op::GroupNonUniformUMin => {
                                    exact::extended_integers(GLOp::UMin, &[a, b], width)
                                }
                                Op::GroupNonUniformUMax => {
                                    exact::extended_integers(GLOp::UMax, &[a, b], width)
                                }
                                Op::GroupNonUniformSMin => {
                                    exact::extended_integers(GLOp::SMin, &[a, b], width)
                                }
                                Op::GroupNonUniformSMax => {
                                    exact::extended_integers(GLOp::SMax, &[a, b], width)
                                }
                                _ => None,
                            }
                        };
                        // "The identity I for Operation": of an exclusive scan's first invocation.
                        let identity = match op {
                            Op::GroupNonUniformIMul | Op::GroupNonUniformLogicalAnd => 1,
                            Op::GroupNonUniformBitwiseAnd | Op::GroupNonUniformUMin => exact::mask(width),
                            Op::GroupNonUniformSMin => exact::mask(width) >> 1,
                            Op::GroupNonUniformSMax => 1 << (width - 1),
                            _ => 0,
                        };
                        let start = values.next().unwrap_or(identity);
                        let mut sum = start;
                        for value in values {
                            sum =
                                combine(sum, value).filter(|_| !is_float).ok_or_else(|| format!("{op:?}"))?;
                        }
                        result.push(defined(sum));
                    }
                    result
                }
            };
        }
        for (one, result) in members.iter_mut().zip(&results) {
            self.set(one, w[2], result);
        }
        Ok(())
    }
}
