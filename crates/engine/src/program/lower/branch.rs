//! Lowers terminators: branches, and the moves of phis on their edges.

use smallvec::SmallVec;

use crate::machine::{Exit, Reg};
use crate::module::{Id, Instruction, Module, Opcode};
use crate::ops::debug_printf;
use crate::ops::memory;
use crate::ops::op::Op;
use crate::ops::operand_types;
use crate::program::Terminator;
use crate::program::control_flow::block_of;
use crate::program::lower::{Label, Lowering, ReturnTarget, Site};
use anyhit_base::error::Result;

impl Lowering<'_> {
    pub(super) fn terminator(&mut self, instruction: &Instruction, site: &Site<'_>) -> Result<()> {
        self.translator.set_clock()?;
        match instruction.opcode {
            Opcode::Branch => {
                let target = self.translator.id(instruction, 0)?;
                self.edge_moves(site, target)?;
                let label = self.target(site, target)?;
                self.end(Terminator::Branch(label));
            }
            Opcode::BranchConditional => {
                operand_types::check(&self.translator, instruction)?;
                let condition = self.translator.operand(instruction, 0)?[0];
                let targets = [self.translator.id(instruction, 1)?, self.translator.id(instruction, 2)?];
                if let Some(known) =
                    self.translator.constant_word(condition).filter(|_| self.translator.optimizes)
                {
                    let target = targets[usize::from(known == 0)];
                    self.edge_moves(site, target)?;
                    let label = self.target(site, target)?;
                    self.end(Terminator::Branch(label));
                    return Ok(());
                }
                let mut edges = Vec::new();
                let [then, other] =
                    [self.edge(site, targets[0], &mut edges)?, self.edge(site, targets[1], &mut edges)?];
                self.end(Terminator::BranchConditional { condition, then, other });
                self.split_edges(site, edges)?;
            }
            Opcode::Switch => {
                operand_types::check(&self.translator, instruction)?;
                let selector = self.translator.operand(instruction, 0)?;
                let words = self.module.switch_literal_words(instruction);
                let operands = self.module.operands(instruction);
                let mut edges = Vec::new();
                let default = self.edge(site, Id(operands[1]), &mut edges)?;
                let mut cases = Vec::new();
                for case in operands[2..].chunks_exact(words + 1) {
                    let value = u64::from(case[0]) | if words == 2 { u64::from(case[1]) << 32 } else { 0 };
                    cases.push((value, self.edge(site, Id(case[words]), &mut edges)?));
                }
                // Narrow selectors are zero-extended in their register; their literals may be
                // sign-extended.
                let ty = self.translator.type_of(Id(operands[0]))?;
                let width = self.translator.scalar_width(ty)?;
                if width < 32 {
                    cases.iter_mut().for_each(|(value, _)| *value &= (1 << width) - 1);
                }
                let (selector, wide, cases) = (selector[0], words == 2, cases.into());
                self.end(Terminator::Switch { selector, wide, cases, default });
                self.split_edges(site, edges)?;
            }
            Opcode::Return => self.leave(site),
            Opcode::ReturnValue => {
                let value = self.translator.id(instruction, 0)?;
                let words = self.translator.words_unchecked(value)?;
                if let ReturnTarget::Inlined { result, .. } | ReturnTarget::Called { result } =
                    site.return_target
                {
                    for (&to, from) in result.iter().zip(words) {
                        self.translator.emit(Op::Memory(memory::MemoryOp::MoveMasked { to, from }));
                    }
                }
                self.leave(site);
            }
            Opcode::Unreachable => self.end(Terminator::Unreachable),
            Opcode::AbortKHR => {
                debug_printf::abort(&mut self.translator, instruction)?;
                self.end(Terminator::Unreachable);
            }
            Opcode::IgnoreIntersectionKHR => self.end(Terminator::Exit(Exit::Ignored)),
            Opcode::TerminateRayKHR => self.end(Terminator::Exit(Exit::Terminated)),
            opcode @ (Opcode::Kill | Opcode::TerminateInvocation) => {
                let rule = format!("SPIR-V, 3.3.17, {opcode}: allowed only in the execution model Fragment");
                let message = format!("{opcode} in {}", self.translator.stage.name());
                return Err(self.translator.invalid(message).note(rule));
            }
            opcode => return Err(self.translator.unsupported(format!("{opcode} is not supported"))),
        }
        Ok(())
    }

    fn leave(&mut self, site: &Site<'_>) {
        let terminator = match site.return_target {
            ReturnTarget::Entry => Terminator::Exit(Exit::Returned),
            ReturnTarget::Inlined { label, .. } => Terminator::Branch(*label),
            ReturnTarget::Called { .. } => Terminator::Return,
        };
        self.end(terminator);
    }

    fn target(&self, site: &Site<'_>, target: Id) -> Result<Label> {
        let label = block_of(self.module, site.function, target).and_then(|block| site.labels[block]);
        label.ok_or_else(|| {
            self.translator.invalid(format!("a branch to %{}, which is not a block", target.0))
        })
    }

    /// The label that an edge of a conditional branch goes to. If the target has phis, the edge is
    /// split: it goes to a new block for their moves, which is added to `edges`.
    fn edge(&mut self, site: &Site<'_>, target: Id, edges: &mut Vec<(Label, Id)>) -> Result<Label> {
        if phis(self.module, site, target).next().is_none() {
            return self.target(site, target);
        }
        if let Some(&(label, _)) = edges.iter().find(|&&(_, id)| id == target) {
            return Ok(label);
        }
        let label = self.label();
        edges.push((label, target));
        Ok(label)
    }

    /// Makes the blocks of split edges.
    fn split_edges(&mut self, site: &Site<'_>, edges: Vec<(Label, Id)>) -> Result<()> {
        for (label, target) in edges {
            self.begin(label);
            self.edge_moves(site, target)?;
            let target = self.target(site, target)?;
            self.end(Terminator::Branch(target));
            self.translator.check_operations()?;
        }
        Ok(())
    }

    /// Moves the values that the target's phis have for this block (a parallel copy).
    fn edge_moves(&mut self, site: &Site<'_>, target: Id) -> Result<()> {
        let mut moves: SmallVec<[(Reg, Reg); 8]> = SmallVec::new();
        for phi in phis(self.module, site, target) {
            let pairs = self.module.operands(phi).chunks_exact(2);
            let from = pairs.clone().find(|pair| Id(pair[1]) == site.block).map(|pair| Id(pair[0]));
            let (Some(from), Some(id)) = (from, phi.result) else {
                self.translator.origin.offset = phi.offset;
                return Err(self
                    .translator
                    .invalid(format!("OpPhi has no value for block %{}", site.block.0)));
            };
            let to = self.translator.words(id)?;
            let from = self.translator.words_unchecked(from)?;
            if to != from {
                moves.extend(to.into_iter().zip(from));
            }
        }
        // All phis read before any is written, so a source that is also a target is saved first.
        if moves.len() > 1 {
            let mut targets: SmallVec<[Reg; 8]> = moves.iter().map(|&(to, _)| to).collect();
            targets.sort_unstable();
            for (_, from) in moves.iter_mut().filter(|(_, from)| targets.binary_search(from).is_ok()) {
                let saved = self.translator.fresh(1)?;
                self.translator.emit(Op::Memory(memory::MemoryOp::Move { to: saved, from: *from }));
                *from = saved;
            }
        }
        for (to, from) in moves {
            self.translator.emit(Op::Memory(memory::MemoryOp::MoveMasked { to, from }));
        }
        Ok(())
    }
}

fn phis<'a>(module: &Module, site: &Site<'a>, target: Id) -> impl Iterator<Item = &'a Instruction> + use<'a> {
    let block = block_of(module, site.function, target).filter(|&block| site.labels[block].is_some());
    let instructions = block.map_or(&[][..], |block| &site.function.blocks[block].instructions);
    instructions.iter().take_while(|instruction| instruction.opcode == Opcode::Phi)
}
