//! Checks the instructions of the functions against the grammar and the definitions.

use crate::module::check_encoding::EncodedTypes;
use crate::module::grammar::{is_id, walk};
use crate::module::id_map::UnknownResults;
use crate::module::span::{Span, invalid, span_of};
use crate::module::{BasicBlock, Definition, Id, Instruction, Module, Opcode, check_access, check_encoding};
use anyhit_base::error::{Error, Place, Result};
use anyhit_base::sorted::sort;

/// Checks every instruction of every function, then that the call graph of no entry point has a
/// cycle; returns what each function uses.
///
/// # Errors
/// `InvalidModule` where operands are missing or left over, an id is not defined, or in
/// another function or further down, a label is found where a value is expected or the reverse, a
/// call does not match its function, an index is out of its composite's bounds, or calls form a
/// cycle.
pub(super) fn functions(module: &Module, unknown: &UnknownResults) -> Result<Vec<FunctionUses>> {
    let mut calls = vec![Vec::new(); module.functions.len()];
    let mut used_variables = vec![Vec::new(); module.functions.len()];
    let encoded = EncodedTypes::of(module);
    check_encoding::constants(module, &encoded)?;
    for (index, function) in module.functions.iter().enumerate() {
        let checker = Checker { module, unknown, function: index as u32 };
        for (block_index, block) in function.blocks.iter().enumerate() {
            for (position, instruction) in block.instructions.iter().enumerate() {
                checker.check_instruction(
                    instruction,
                    block_index as u32,
                    position as u32,
                    &mut used_variables[index],
                )?;
                check_access::instruction(module, instruction)?;
                check_encoding::instruction(module, &encoded, instruction)?;
                checker.check_return(instruction)?;
                if instruction.opcode == Opcode::FunctionCall {
                    let (callee, at) = checker.check_call(instruction)?;
                    calls[index].extend(callee.map(|callee| (callee, at)));
                }
            }
            checker.check_order(block)?;
        }
    }
    check_recursion(module, &calls)?;
    let uses = |(calls, mut variables): (Vec<(u32, usize)>, Vec<u32>)| {
        sort(&mut variables);
        variables.dedup();
        FunctionUses { calls: calls.into_iter().map(|(callee, _)| callee).collect(), variables }
    };
    Ok(calls.into_iter().zip(used_variables).map(uses).collect())
}

/// The functions and variables that a function uses: see [`Function`](crate::module::Function).
pub(super) struct FunctionUses {
    pub(super) calls: Vec<u32>,
    pub(super) variables: Vec<u32>,
}

struct Checker<'m> {
    module: &'m Module,
    unknown: &'m UnknownResults,
    function: u32,
}

impl Checker<'_> {
    /// Checks the ids of an instruction. `block` is the index of its block and `position` its own
    /// index in that; `used_variables` collects the module-scope variables that it uses.
    fn check_instruction(
        &self,
        instruction: &Instruction,
        block: u32,
        position: u32,
        used_variables: &mut Vec<u32>,
    ) -> Result<()> {
        let mut record = |definition: Definition| {
            if let Definition::Variable(index) = definition {
                used_variables.push(index);
            }
        };
        if !instruction.opcode.is_known() {
            // Any word of an unknown instruction may be an id.
            let words = self.module.operands(instruction).iter();
            words.filter_map(|&word| self.module.definition(Id(word))).for_each(record);
            return Ok(());
        }
        let span = span_of(instruction);
        let literal_words = self.module.switch_literal_words(instruction);
        let first = instruction.operands.start as usize;
        let mut extended_set = None;
        if matches!(instruction.opcode, Opcode::ExtInst | Opcode::ExtInstWithForwardRefsKHR) {
            extended_set = Some(first);
        }
        let mut index = 0;
        walk(&self.module.words, span, literal_words, &mut |at, kind| {
            let operand = index;
            index += 1;
            if !is_id(kind) {
                return Ok(());
            }
            let id = Id(self.module.words[at]);
            let Some(definition) = self.module.definition(id) else {
                if self.unknown.contains_key(&id) {
                    return Ok(());
                }
                return Err(invalid(at, format!("{} names %{}, but nothing defines it", span.opcode, id.0)));
            };
            record(definition);
            if Some(at) == extended_set {
                return match definition {
                    Definition::InstructionSet(_) => Ok(()),
                    _ => Err(self.expected(span, at, "an imported instruction set")),
                };
            }
            match (names_label(instruction.opcode, operand), definition) {
                (true, Definition::Label(function, _)) if function == self.function => Ok(()),
                (true, _) => Err(self.expected(span, at, "a label of the same function")),
                (false, Definition::Label(..)) => Err(self.expected(span, at, "a value")),
                (false, Definition::Parameter(function, _) | Definition::Result(function, ..))
                    if function != self.function =>
                {
                    Err(self.expected(span, at, "a value of the same function"))
                }
                // Blocks come after those that dominate them, so definitions come before uses.
                (false, Definition::Result(_, other_block, other_position))
                    if (other_block, other_position) >= (block, position)
                        && instruction.opcode != Opcode::Phi =>
                {
                    Err(self.expected(span, at, "a previously defined value"))
                }
                _ => Ok(()),
            }
        })
    }

    /// Checks a returned value against the function's return type.
    fn check_return(&self, instruction: &Instruction) -> Result<()> {
        if instruction.opcode != Opcode::ReturnValue {
            return Ok(());
        }
        let declared = self.module.functions[self.function as usize].return_type;
        match self.module.type_of(Id(self.module.operands(instruction)[0])) {
            Some(found) if found != declared => {
                let at = instruction.operands.start as usize;
                let what = format!("a value of the function's type, {}", self.module.describe_type(declared));
                Err(self.expected(span_of(instruction), at, &what))
            }
            _ => Ok(()),
        }
    }

    /// Checks a call's arguments against the function; returns the function's index and the offset
    /// of the word with its id.
    fn check_call(&self, instruction: &Instruction) -> Result<(Option<u32>, usize)> {
        let span = span_of(instruction);
        let at = instruction.operands.start as usize;
        let operands = self.module.operands(instruction);
        let (callee, arguments) = (Id(operands[0]), &operands[1..]);
        let index = match self.module.definition(callee) {
            Some(Definition::Function(index)) => index,
            // An unknown instruction may define it.
            None => return Ok((None, at)),
            _ => return Err(self.expected(span, at, "a function")),
        };
        let function = &self.module.functions[index as usize];
        let return_type = instruction.result_type.and_then(|id| self.module.type_with_id(id));
        if return_type != Some(function.return_type) {
            let what = format!(
                "the type that the function returns ({})",
                self.module.describe_type(function.return_type)
            );
            return Err(self.expected(span, span.start + 1, &what));
        }
        if arguments.len() != function.parameters.len() {
            return Err(invalid(
                span.start,
                format!(
                    "OpFunctionCall: %{} takes {} arguments, found {}",
                    callee.0,
                    function.parameters.len(),
                    arguments.len()
                ),
            ));
        }
        for (index, (argument, (_, wanted))) in arguments.iter().zip(&function.parameters).enumerate() {
            if self.module.type_of(Id(*argument)).is_some_and(|ty| ty != *wanted) {
                let what = format!("an argument of type {}", self.module.describe_type(*wanted));
                return Err(self.expected(span, at + 1 + index, &what));
            }
        }
        Ok((Some(index), at))
    }

    /// Checks that `OpPhi`s begin a block, and that a merge instruction precedes its terminator.
    fn check_order(&self, block: &BasicBlock) -> Result<()> {
        let mut phis_over = false;
        let last = block.instructions.len().saturating_sub(1);
        for (index, instruction) in block.instructions.iter().enumerate() {
            let is = |op: Opcode| instruction.opcode == op;
            if is(Opcode::Phi) && phis_over {
                return Err(invalid(
                    instruction.offset as usize,
                    format!("OpPhi follows another instruction of block %{}", block.label.0),
                ));
            }
            phis_over |= !is(Opcode::Phi);
            if (is(Opcode::SelectionMerge) || is(Opcode::LoopMerge)) && index + 1 != last {
                return Err(invalid(
                    instruction.offset as usize,
                    format!(
                        "{} must immediately precede the terminator of block %{}",
                        instruction.opcode, block.label.0
                    ),
                ));
            }
        }
        Ok(())
    }

    #[cold]
    fn expected(&self, span: Span, at: usize, what: &str) -> Error {
        invalid(
            at,
            format!(
                "{}: expected {what}, found {}",
                span.opcode,
                self.module.describe_id(Id(self.module.words[at]))
            ),
        )
    }
}

/// Whether the operand of this index (after result type and result id) names a label.
fn names_label(op: Opcode, index: usize) -> bool {
    match op {
        Opcode::Branch | Opcode::SelectionMerge => index == 0,
        Opcode::LoopMerge => index < 2,
        Opcode::BranchConditional => index == 1 || index == 2,
        // The operands are a selector, a default label, then pairs of literal and label.
        Opcode::Switch => index % 2 == 1,
        // The operands are pairs of value and parent.
        Opcode::Phi => index % 2 == 1,
        _ => false,
    }
}

/// Rejects recursion that an entry point reaches ("the static function-call graph for an
/// entry point must not contain cycles", section 2.16.1), and calls of entry points.
fn check_recursion(module: &Module, calls: &[Vec<(u32, usize)>]) -> Result<()> {
    #[derive(Clone, Copy, PartialEq)]
    enum VisitState {
        Unvisited,
        /// On the path from the entry point.
        OnPath,
        Done,
    }
    let index_of = |id: Id| match module.definition(id) {
        Some(Definition::Function(index)) => index,
        _ => panic!("bug in anyhit: an entry point is not a function"),
    };
    let mut is_entry = vec![false; calls.len()];
    for entry in &module.entry_points {
        is_entry[index_of(entry.function) as usize] = true;
    }
    for &(callee, at) in calls.iter().flatten() {
        if is_entry[callee as usize] {
            return Err(invalid(
                at,
                format!(
                    "OpFunctionCall calls %{}, which is an entry point",
                    module.functions[callee as usize].id.0
                ),
            ));
        }
    }
    let mut states = vec![VisitState::Unvisited; calls.len()];
    for entry in &module.entry_points {
        let root = index_of(entry.function);
        if states[root as usize] != VisitState::Unvisited {
            continue;
        }
        states[root as usize] = VisitState::OnPath;
        let mut path = vec![(root, 0)];
        while let Some((function, next)) = path.last_mut() {
            let Some(&(callee, at)) = calls[*function as usize].get(*next) else {
                states[*function as usize] = VisitState::Done;
                path.pop();
                continue;
            };
            *next += 1;
            match states[callee as usize] {
                VisitState::Unvisited => {
                    states[callee as usize] = VisitState::OnPath;
                    path.push((callee, 0));
                }
                VisitState::OnPath => {
                    let name = module.describe_id(module.functions[callee as usize].id);
                    return Err(invalid(at, format!("OpFunctionCall closes a cycle of calls at {name}"))
                        .at_with(
                            Place::Word(module.functions[callee as usize].offset as usize),
                            "the function called again",
                        )
                        .note("SPIR-V forbids recursion: the calls of an entry point must not form a cycle (2.16.1)"));
                }
                VisitState::Done => {}
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn switch_and_phi_name_labels_at_odd_operands() {
        // OpSwitch %selector %default 0 %a: the grammar shows the literal as one operand.
        assert!(!names_label(Opcode::Switch, 0) && names_label(Opcode::Switch, 1));
        assert!(!names_label(Opcode::Switch, 2) && names_label(Opcode::Switch, 3));
        assert!(!names_label(Opcode::Phi, 0) && names_label(Opcode::Phi, 1));
        assert!(names_label(Opcode::LoopMerge, 1) && !names_label(Opcode::LoopMerge, 2));
    }
}
