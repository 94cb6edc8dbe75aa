//! Parses the operands of an instruction word by word with rspirv's grammar tables.
//!
//! An enumerant that the tables do not know may have parameters of its own, so the operands after
//! it cannot be parsed: the rest of such an instruction is kept unread.

use std::fmt;
use std::ops::Range;
use std::sync::LazyLock;

use rspirv::grammar::reflect::is_block_terminator;
use rspirv::grammar::{INSTRUCTION_TABLE, LogicalOperand, OperandKind, OperandQuantifier};
use rspirv::{dr, spirv};

use crate::module::opcode::{self, Opcode};
use crate::module::opcode_table::OpcodeTable;
use crate::module::span::{Span, ends_string, invalid};
use anyhit_base::error::Result;

/// The grammar of the instructions of one opcode.
#[derive(Clone, Copy)]
pub(crate) struct InstructionGrammar {
    /// The name without its `Op`.
    pub(crate) name: &'static str,
    /// Whether its first operand is a result type.
    pub(crate) has_type: bool,
    /// Whether it has a result id (after the result type, if there is one).
    pub(crate) has_result: bool,
    /// True for constants and undefined values.
    pub(crate) is_constant: bool,
    /// Whether it is allowed only outside functions.
    pub(crate) module_scope_only: bool,
    /// Whether it ends its block.
    pub(crate) ends_block: bool,
    /// Its operands, result type and result id included.
    operands: &'static [LogicalOperand],
    fixed: FixedOperands,
}

impl Opcode {
    /// Operands, result type and result id included; empty for an unknown opcode.
    pub fn operands(self) -> &'static [LogicalOperand] {
        InstructionGrammar::of(self).map_or(&[], |known| known.operands)
    }

    /// Returns true for block terminators.
    pub fn ends_block(self) -> bool {
        InstructionGrammar::of(self).is_some_and(|known| known.ends_block)
    }

    /// Returns true if the tables contain the opcode.
    pub fn is_known(self) -> bool {
        InstructionGrammar::of(self).is_some()
    }
}

impl fmt::Display for Opcode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match InstructionGrammar::of(*self) {
            Some(known) => write!(f, "Op{}", known.name),
            None => write!(f, "opcode {}", self.0),
        }
    }
}

impl fmt::Debug for Opcode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// The operands of an opcode, after its result, whose number of words is fixed: each takes one word
/// and has no parameters, and a repeated one may take two. Most instructions have only such
/// operands, so [`walk`] need not examine their words.
#[derive(Clone, Copy)]
struct FixedOperands {
    /// The number of leading operands that occur once.
    required: usize,
    /// Whether an instruction may end after these.
    rest_is_optional: bool,
    /// The operand that may follow them any number of times, up to the end: its kind, and how many
    /// words of that kind make one.
    repeated: Option<(OperandKind, usize)>,
}

impl FixedOperands {
    fn of(operands: &[LogicalOperand]) -> Self {
        let once = |operand: &&LogicalOperand| {
            operand.quantifier == OperandQuantifier::One && is_single_word(operand.kind)
        };
        let required = operands.iter().take_while(once).count();
        let rest = &operands[required..];
        let rest_is_optional = rest.iter().all(|operand| operand.quantifier != OperandQuantifier::One);
        let repeated = match rest {
            [LogicalOperand { kind, quantifier: OperandQuantifier::ZeroOrMore }] => match kind {
                OperandKind::PairIdRefIdRef => Some((OperandKind::IdRef, 2)),
                kind if is_single_word(*kind) => Some((*kind, 1)),
                _ => None,
            },
            _ => None,
        };
        Self { required, rest_is_optional, repeated }
    }

    /// Whether so many words hold such operands only, without a remainder.
    fn match_count(&self, words: usize) -> bool {
        match words.checked_sub(self.required) {
            None => false,
            Some(0) => self.rest_is_optional,
            Some(rest) => self.repeated.is_some_and(|(_, words_each)| rest % words_each == 0),
        }
    }
}

/// Whether operands of a kind are one word and have no parameters.
fn is_single_word(kind: OperandKind) -> bool {
    use OperandKind as K;
    !matches!(
        kind,
        K::PairIdRefIdRef
            | K::PairIdRefLiteralInteger
            | K::PairLiteralIntegerIdRef
            | K::LiteralContextDependentNumber
            | K::LiteralString
            | K::LiteralSpecConstantOpInteger
            | K::Decoration
            | K::ExecutionMode
            | K::ImageOperands
            | K::LoopControl
            | K::MemoryAccess
            | K::TensorAddressingOperands
            | K::TensorOperands
    )
}

impl InstructionGrammar {
    /// Grammar of an opcode; `None` if the tables do not know it.
    #[inline]
    pub(crate) fn of(opcode: Opcode) -> Option<&'static Self> {
        // The look-up of rspirv is a linear search through 800 entries.
        static TABLE: LazyLock<OpcodeTable<InstructionGrammar>> = LazyLock::new(|| {
            let known =
                INSTRUCTION_TABLE.iter().map(|entry| (entry.opcode.into(), entry.opname, entry.operands));
            let added =
                opcode::ADDED.iter().map(|&(number, name, operands)| (Opcode(number), name, operands));
            let all = known.chain(added);
            all.map(|(op, name, operands)| (op.0, InstructionGrammar::new(op, name, operands))).collect()
        });
        TABLE.get(usize::from(opcode.0))
    }

    fn new(op: Opcode, name: &'static str, operands: &'static [LogicalOperand]) -> Self {
        let kind = |index: usize| operands.get(index).map(|operand| operand.kind);
        let has_type = kind(0) == Some(OperandKind::IdResultType);
        let has_result = kind(usize::from(has_type)) == Some(OperandKind::IdResult);
        Self {
            name,
            has_type,
            has_result,
            is_constant: is_constant(op, name),
            module_scope_only: is_module_scope_only(op, name),
            ends_block: ends_block(op),
            operands,
            fixed: FixedOperands::of(&operands[usize::from(has_type) + usize::from(has_result)..]),
        }
    }

    /// The number of words of result type and result id.
    pub(crate) fn result_words(&self) -> usize {
        usize::from(self.has_type) + usize::from(self.has_result)
    }
}

/// An optional id at the end that newer revisions of the specification allow and the tables lack.
const OPTIONAL_ID: LogicalOperand =
    LogicalOperand { kind: OperandKind::IdRef, quantifier: OperandQuantifier::ZeroOrOne };

/// Whether an opcode defines a constant or an undefined value; its name is without `Op`.
fn is_constant(op: Opcode, name: &str) -> bool {
    op.is_undefined() || name.starts_with("Constant") || name.starts_with("SpecConstant")
}

fn is_module_scope_only(op: Opcode, name: &str) -> bool {
    matches!(
        op,
        Opcode::Capability
            | Opcode::Extension
            | Opcode::ExtInstImport
            | Opcode::MemoryModel
            | Opcode::EntryPoint
            | Opcode::ExecutionMode
            | Opcode::ExecutionModeId
            | Opcode::Decorate
            | Opcode::DecorateId
            | Opcode::DecorateString
            | Opcode::MemberDecorate
            | Opcode::MemberDecorateString
            | Opcode::MemberDecorateIdEXT
            | Opcode::DecorationGroup
            | Opcode::GroupDecorate
            | Opcode::GroupMemberDecorate
    ) || name.starts_with("Type")
        || (is_constant(op, name) && !op.is_undefined())
}

/// Whether words of this kind are ids.
pub(crate) fn is_id(kind: OperandKind) -> bool {
    matches!(kind, OperandKind::IdRef | OperandKind::IdScope | OperandKind::IdMemorySemantics)
}

/// Checks an instruction's operands (result type and result id included) against the grammar.
///
/// `literal_words` is the number of words of a literal whose width depends on a type: the value of
/// `OpConstant`, the cases of `OpSwitch`. Unknown opcodes pass.
///
/// # Errors
/// `InvalidModule` where operands are missing or left over, and what `visit` returns; it is given
/// the offset of each operand's first word and the operand's kind, without result type and id.
#[inline]
pub(crate) fn walk(
    words: &[u32],
    span: Span,
    literal_words: usize,
    visit: &mut impl FnMut(usize, OperandKind) -> Result<()>,
) -> Result<()> {
    let Some(known) = InstructionGrammar::of(span.opcode) else { return Ok(()) };
    let first = span.start + 1 + known.result_words();
    if known.fixed.match_count(span.end.wrapping_sub(first)) && first <= span.end {
        let FixedOperands { required, repeated, .. } = known.fixed;
        let operands = &known.operands[known.result_words()..][..required];
        for (at, operand) in (first..).zip(operands) {
            visit(at, operand.kind)?;
        }
        return match repeated {
            Some((kind, _)) => (first + required..span.end).try_for_each(|at| visit(at, kind)),
            None => Ok(()),
        };
    }
    let mut cursor = Cursor { words, span, at: span.start + 1, literal_words, visit };
    for _ in 0..known.result_words() {
        cursor.next_word("its result")?;
    }
    cursor.operands(&known.operands[known.result_words()..])?;
    if span.opcode == Opcode::HitObjectRecordFromQueryEXT {
        cursor.operands(&[OPTIONAL_ID])?;
    }
    if cursor.at < span.end {
        return Err(invalid(
            cursor.at,
            format!(
                "{} has {} words here, but its word count is {}",
                span.opcode,
                cursor.at - span.start,
                span.end - span.start
            ),
        ));
    }
    Ok(())
}

/// The offsets of an instruction's operands that are ids, without result type and result id.
///
/// `operands` is their range, after result type and result id. The instruction must have passed
/// [`walk`] before: operands after a violation of the grammar are left out.
pub(crate) fn id_operands(
    words: &[u32],
    opcode: Opcode,
    operands: Range<usize>,
    literal_words: usize,
    visit: &mut dyn FnMut(usize),
) {
    let Some(known) = InstructionGrammar::of(opcode) else { return };
    let start = operands.start.saturating_sub(1 + known.result_words());
    let span = Span { opcode, start, end: operands.end };
    let parsed = walk(words, span, literal_words, &mut |at, kind| {
        if is_id(kind) {
            visit(at);
        }
        Ok(())
    });
    debug_assert!(parsed.is_ok(), "bug in anyhit: an instruction of a loaded module breaks the grammar");
}

struct Cursor<'a> {
    words: &'a [u32],
    span: Span,
    at: usize,
    literal_words: usize,
    visit: &'a mut dyn FnMut(usize, OperandKind) -> Result<()>,
}

impl Cursor<'_> {
    /// Reads operands in their order.
    fn operands(&mut self, operands: &[LogicalOperand]) -> Result<()> {
        for operand in operands {
            match operand.quantifier {
                OperandQuantifier::One => self.operand(operand.kind)?,
                OperandQuantifier::ZeroOrOne if self.at == self.span.end => {}
                OperandQuantifier::ZeroOrOne => self.operand(operand.kind)?,
                OperandQuantifier::ZeroOrMore => {
                    while self.at < self.span.end {
                        self.operand(operand.kind)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Reads one operand and the parameters of its enumerant.
    fn operand(&mut self, kind: OperandKind) -> Result<()> {
        use OperandKind as K;
        match kind {
            K::PairIdRefIdRef => {
                self.visit_word(K::IdRef)?;
                self.visit_word(K::IdRef)?;
                Ok(())
            }
            K::PairIdRefLiteralInteger => {
                self.visit_word(K::IdRef)?;
                self.visit_word(K::LiteralInteger)?;
                Ok(())
            }
            K::PairLiteralIntegerIdRef => {
                self.operand(K::LiteralContextDependentNumber)?;
                self.visit_word(K::IdRef)?;
                Ok(())
            }
            K::LiteralContextDependentNumber => {
                self.visit_word(kind)?;
                for _ in 1..self.literal_words {
                    self.next_word("the high word of a 64-bit number")?;
                }
                Ok(())
            }
            K::LiteralString => {
                let start = self.at;
                self.visit_word(kind)?;
                let mut last = self.words[start];
                while !ends_string(last) {
                    last = self.words[self.next_word("the closing zero byte of a string")?];
                }
                Ok(())
            }
            K::LiteralSpecConstantOpInteger => {
                let at = self.visit_word(kind)?;
                let opcode = Opcode::of_operand(self.words[at]);
                match InstructionGrammar::of(opcode) {
                    // Rejected here, because it would recurse without end.
                    Some(_) if opcode == Opcode::SpecConstantOp => {
                        Err(invalid(at, "OpSpecConstantOp cannot compute an OpSpecConstantOp"))
                    }
                    Some(inner) => self.operands(&inner.operands[inner.result_words()..]),
                    None => self.skip_rest(),
                }
            }
            _ => {
                let at = self.visit_word(kind)?;
                match parameters(kind, self.words[at]) {
                    Some(parameters) => self.operands(&parameters),
                    None => self.skip_rest(),
                }
            }
        }
    }

    /// Reads one word and passes it to `visit`; returns its offset.
    fn visit_word(&mut self, kind: OperandKind) -> Result<usize> {
        let at = self.next_operand_word(kind)?;
        (self.visit)(at, kind)?;
        Ok(at)
    }

    fn next_operand_word(&mut self, kind: OperandKind) -> Result<usize> {
        if self.at < self.span.end {
            self.at += 1;
            return Ok(self.at - 1);
        }
        self.next_word(&format!("an operand ({kind:?})"))
    }

    /// The offset of the next word; `what` tells in the error what is expected there.
    fn next_word(&mut self, what: &str) -> Result<usize> {
        if self.at == self.span.end {
            return Err(invalid(
                self.span.start,
                format!(
                    "{} ends after {} words where {what} is expected",
                    self.span.opcode,
                    self.span.end - self.span.start
                ),
            ));
        }
        self.at += 1;
        Ok(self.at - 1)
    }

    fn skip_rest(&mut self) -> Result<()> {
        self.at = self.span.end;
        Ok(())
    }
}

/// The parameters of an enumerant; `None` if the enumerant is not known.
fn parameters(kind: OperandKind, word: u32) -> Option<Vec<LogicalOperand>> {
    /// The parameters of a mask's bits, in the order of the bits from the lowest.
    fn of_mask(word: u32, of_bit: impl Fn(u32) -> Option<dr::Operand>) -> Option<Vec<LogicalOperand>> {
        let mut all = Vec::new();
        for bit in (0..u32::BITS).map(|index| 1 << index).filter(|bit| word & bit != 0) {
            all.extend(of_bit(bit)?.additional_operands());
        }
        Some(all)
    }
    match kind {
        OperandKind::Decoration => spirv::Decoration::from_u32(word)
            .map(|value| dr::Operand::Decoration(value).additional_operands()),
        OperandKind::ExecutionMode => spirv::ExecutionMode::from_u32(word)
            .map(|value| dr::Operand::ExecutionMode(value).additional_operands()),
        OperandKind::ImageOperands => {
            of_mask(word, |bit| spirv::ImageOperands::from_bits(bit).map(dr::Operand::ImageOperands))
        }
        OperandKind::LoopControl => {
            of_mask(word, |bit| spirv::LoopControl::from_bits(bit).map(dr::Operand::LoopControl))
        }
        OperandKind::MemoryAccess => {
            of_mask(word, |bit| spirv::MemoryAccess::from_bits(bit).map(dr::Operand::MemoryAccess))
        }
        OperandKind::TensorAddressingOperands => of_mask(word, |bit| {
            spirv::TensorAddressingOperands::from_bits(bit).map(dr::Operand::TensorAddressingOperands)
        }),
        OperandKind::TensorOperands => {
            of_mask(word, |bit| spirv::TensorOperands::from_bits(bit).map(dr::Operand::TensorOperands))
        }
        _ => Some(Vec::new()),
    }
}

/// Returns true for block terminators.
fn ends_block(op: Opcode) -> bool {
    let known = spirv::Op::from_u32(op.0.into());
    op == Opcode::AbortKHR || known.is_some_and(is_block_terminator)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The kinds that a walk visits for one instruction's words, or its error's text.
    fn kinds(words: &[u32], literal_words: usize) -> std::result::Result<Vec<OperandKind>, String> {
        let mut seen = Vec::new();
        let span = Span { opcode: Opcode::of_word(words[0]), start: 0, end: words.len() };
        walk(words, span, literal_words, &mut |_, kind| {
            seen.push(kind);
            Ok(())
        })
        .map_err(|error| error.message().to_owned())?;
        Ok(seen)
    }

    #[test]
    fn parameters_of_a_mask_stand_in_the_order_of_its_bits() {
        // OpImageSampleExplicitLod with Lod | Grad is not sensible, but shows the counts: 1 + 2
        // ids.
        let all = kinds(&[88, 1, 2, 3, 4, 0x2 | 0x4, 5, 6, 7], 1).unwrap();
        assert_eq!(all.iter().filter(|kind| is_id(**kind)).count(), 5);
        // OpLoad, Aligned (a literal) | MakePointerVisible (an id): bits 1 and 4.
        let all = kinds(&[61, 1, 2, 3, 0x2 | 0x10, 16, 9], 1).unwrap();
        assert_eq!(all[2..], [OperandKind::LiteralInteger, OperandKind::IdScope]);
    }

    #[test]
    fn the_optional_operand_that_the_tables_lack_is_known() {
        let words = [u32::from(Opcode::HitObjectRecordFromQueryEXT.0), 1, 2, 3, 4, 5];
        assert_eq!(kinds(&words, 1).unwrap().len(), 5);
        assert_eq!(kinds(&words[..5], 1).unwrap().len(), 4);
    }

    #[test]
    fn missing_and_surplus_words_are_reported() {
        assert_eq!(
            kinds(&[128, 1, 2, 3], 1).unwrap_err(),
            "OpIAdd ends after 4 words where an operand (IdRef) is expected"
        );
        assert_eq!(
            kinds(&[128, 1, 2, 3, 4, 5], 1).unwrap_err(),
            "OpIAdd has 5 words here, but its word count is 6"
        );
        assert_eq!(kinds(&[128], 1).unwrap_err(), "OpIAdd ends after 1 words where its result is expected");
        assert_eq!(
            kinds(&[7, 1, u32::from_le_bytes(*b"abcd")], 1).unwrap_err(),
            "OpString ends after 3 words where the closing zero byte of a string is expected"
        );
    }

    #[test]
    fn unknown_enumerants_hide_the_rest_of_their_instruction() {
        // OpDecorate %1 with a decoration that does not exist.
        assert_eq!(kinds(&[71, 1, 0xffff, 3, 4, 5], 1).unwrap().len(), 2);
        // A memory operand bit that does not exist.
        assert_eq!(kinds(&[61, 1, 2, 3, 1 << 30, 7, 7, 7], 1).unwrap().len(), 2);
    }

    #[test]
    fn wide_switch_cases_take_two_words_each() {
        assert_eq!(kinds(&[251, 1, 2, 7, 0, 3, 8, 0, 4], 2).unwrap().len(), 6);
        assert_eq!(
            kinds(&[251, 1, 2, 7, 0, 3, 8, 0], 2).unwrap_err(),
            "OpSwitch ends after 8 words where an operand (IdRef) is expected"
        );
    }
}
