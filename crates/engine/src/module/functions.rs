//! Reads functions: from words to basic blocks.
//!
//! SPIR-V specification, sections 2.4 "Logical Layout of a Module" (items 10 and 11) and 2.11
//! "Structured Control Flow".

use crate::module::grammar::{InstructionGrammar, walk};
use crate::module::load::{FUNCTION_STORAGE, Loader};
use crate::module::span::{Span, invalid};
use crate::module::ty::{Type, TypeId};
use crate::module::words::Walker;
use crate::module::{BasicBlock, Definition, Function, Id, Instruction, Opcode};
use anyhit_base::error::Result;

impl<'w> Loader<'w> {
    /// Reads the functions; `first` is the first `OpFunction`.
    pub(super) fn functions(&mut self, walker: &mut Walker<'w>, first: Option<Span>) -> Result<()> {
        let mut next = first;
        while let Some(span) = next {
            match span.opcode {
                Opcode::Function => self.function(span, walker)?,
                opcode if !opcode.is_known() => self.record_unknown(span),
                opcode if opcode == Opcode::Nop || self.debug_instruction(span)? => {}
                opcode => {
                    return Err(invalid(span.start, format!("expected OpFunction, found {opcode}")));
                }
            }
            next = walker.next()?;
        }
        Ok(())
    }

    fn function(&mut self, span: Span, walker: &mut Walker<'w>) -> Result<()> {
        walk(self.words, span, 1, &mut |_, _| Ok(()))?;
        let first = span.start + 1;
        let return_type = self.type_at(span, first)?;
        let function_type = self.type_at(span, first + 3)?;
        let parameter_types = match self.module.ty(function_type) {
            Type::Function { return_type: declared, parameters } if *declared == return_type => {
                parameters.clone()
            }
            _ => return Err(self.expected(span, first + 3, "a function type with the same return type")),
        };
        let index = self.module.functions.len() as u32;
        self.define(first + 1, Definition::Function(index))?;
        let id = self.id(first + 1);
        self.module.functions.push(Function {
            id,
            offset: span.start as u32,
            control: self.words[first + 2],
            return_type,
            parameters: Vec::with_capacity(parameter_types.len()),
            blocks: Vec::new(),
            calls: Vec::new(),
            variables: Vec::new(),
        });
        self.debug.enter_function(id);
        let mut builder = FunctionBuilder { index, parameter_types, open_block: None, spare: Vec::new() };
        while let Some(span) = walker.next()? {
            if self.body_instruction(span, &mut builder)? {
                self.debug.leave_function();
                return Ok(());
            }
        }
        Err(invalid(self.words.len(), format!("the module ends before the OpFunctionEnd of %{}", id.0)))
    }

    /// Reads one instruction of a function; returns whether it is the `OpFunctionEnd`.
    fn body_instruction(&mut self, span: Span, builder: &mut FunctionBuilder) -> Result<bool> {
        let Some(known) = InstructionGrammar::of(span.opcode) else {
            self.record_unknown(span);
            self.push_instruction(span, None, builder)?;
            return Ok(false);
        };
        if span.opcode == Opcode::Nop || self.debug_instruction(span)? {
            return Ok(false);
        }
        match span.opcode {
            Opcode::FunctionParameter => self.parameter(span, builder)?,
            Opcode::FunctionEnd => {
                walk(self.words, span, 1, &mut |_, _| Ok(()))?;
                self.close_open_block(span, builder)?;
                self.check_parameter_count(span, builder)?;
                return Ok(true);
            }
            Opcode::Label => {
                walk(self.words, span, 1, &mut |_, _| Ok(()))?;
                self.close_open_block(span, builder)?;
                self.check_parameter_count(span, builder)?;
                let block = self.module.functions[builder.index as usize].blocks.len() as u32;
                self.define(span.start + 1, Definition::Label(builder.index, block))?;
                builder.open_block = Some(BasicBlock {
                    label: self.id(span.start + 1),
                    offset: span.start as u32,
                    instructions: std::mem::take(&mut builder.spare),
                });
            }
            Opcode::Function => {
                return Err(invalid(
                    span.start,
                    "OpFunction precedes the OpFunctionEnd of the previous function",
                ));
            }
            _ if known.module_scope_only => {
                return Err(invalid(span.start, format!("{} is not allowed inside a function", span.opcode)));
            }
            _ => {
                self.push_instruction(span, Some(known), builder)?;
                if known.ends_block {
                    self.close_block(builder);
                    self.debug.leave_block(span.end);
                }
            }
        }
        Ok(false)
    }

    fn parameter(&mut self, span: Span, builder: &FunctionBuilder) -> Result<()> {
        walk(self.words, span, 1, &mut |_, _| Ok(()))?;
        let function = &self.module.functions[builder.index as usize];
        if builder.open_block.is_some() || !function.blocks.is_empty() {
            return Err(invalid(span.start, "OpFunctionParameter follows the first OpLabel"));
        }
        let index = function.parameters.len();
        let Some(&wanted) = builder.parameter_types.get(index) else {
            return Err(invalid(
                span.start,
                format!("OpFunctionParameter: the function's type has {index} parameters only"),
            ));
        };
        let ty = self.type_at(span, span.start + 1)?;
        if ty != wanted {
            let what = format!("{}, as in the function's type", self.module.describe_type(wanted));
            return Err(self.expected(span, span.start + 1, &what));
        }
        self.define(span.start + 2, Definition::Parameter(builder.index, index as u32))?;
        let id = self.id(span.start + 2);
        self.module.functions[builder.index as usize].parameters.push((id, ty));
        Ok(())
    }

    fn check_parameter_count(&self, span: Span, builder: &FunctionBuilder) -> Result<()> {
        let function = &self.module.functions[builder.index as usize];
        if function.parameters.len() == builder.parameter_types.len() {
            return Ok(());
        }
        Err(invalid(
            span.start,
            format!(
                "%{}: expected {} OpFunctionParameter, found {} before {}",
                function.id.0,
                builder.parameter_types.len(),
                function.parameters.len(),
                span.opcode
            ),
        ))
    }

    fn push_instruction(
        &mut self,
        span: Span,
        known: Option<&InstructionGrammar>,
        builder: &mut FunctionBuilder,
    ) -> Result<()> {
        let Some(block) = &mut builder.open_block else {
            let wanted = match self.module.functions[builder.index as usize].blocks.is_empty() {
                true => "OpFunctionParameter, OpLabel or OpFunctionEnd",
                false => "OpLabel or OpFunctionEnd",
            };
            return Err(invalid(span.start, format!("expected {wanted}, found {}", span.opcode)));
        };
        let mut operands = span.operands();
        let mut take = |wanted: bool| wanted.then(|| operands.next()).flatten();
        let type_at = take(known.is_some_and(|known| known.has_type));
        let result_at = take(known.is_some_and(|known| known.has_result));
        if known.is_some_and(|known| span.end - span.start <= known.result_words()) {
            return Err(invalid(span.start, format!("{} ends before its result id", span.opcode)));
        }
        let instruction = Instruction {
            opcode: span.opcode,
            offset: span.start as u32,
            result_type: type_at.map(|at| Id(self.words[at])),
            result: result_at.map(|at| Id(self.words[at])),
            operands: operands.start as u32..operands.end as u32,
        };
        let block_index = self.module.functions[builder.index as usize].blocks.len() as u32;
        let definition = Definition::Result(builder.index, block_index, block.instructions.len() as u32);
        block.instructions.push(instruction);
        let ty = type_at.map(|at| self.type_at(span, at)).transpose()?;
        if let Some(ty) = ty
            && matches!(span.opcode, Opcode::Variable | Opcode::UntypedVariableKHR)
        {
            self.local_variable(span, ty, block_index)?;
        }
        if let Some(at) = result_at {
            self.define(at, definition)?;
            ty.and_then(|ty| self.module.result_types.insert(self.id(at), ty));
        }
        Ok(())
    }

    fn local_variable(&self, span: Span, ty: TypeId, block: u32) -> Result<()> {
        walk(self.words, span, 1, &mut |_, _| Ok(()))?;
        let storage_class = self.words[span.start + 3];
        if storage_class != FUNCTION_STORAGE {
            return Err(invalid(
                span.start + 3,
                format!("{} inside a function must have the storage class Function", span.opcode),
            ));
        }
        if block != 0 {
            return Err(invalid(span.start, format!("{} follows the function's first block", span.opcode)));
        }
        self.variable_type(span, ty, storage_class, span.opcode == Opcode::UntypedVariableKHR)?;
        Ok(())
    }

    /// Ends a block at `OpLabel` or `OpFunctionEnd`. That is valid only if its last instruction has
    /// an unknown opcode, which may be a terminator.
    fn close_open_block(&mut self, span: Span, builder: &mut FunctionBuilder) -> Result<()> {
        let Some(block) = &builder.open_block else { return Ok(()) };
        match block.instructions.last() {
            Some(last) if !last.opcode.is_known() => {
                self.close_block(builder);
                self.debug.leave_block(span.start);
                Ok(())
            }
            _ => Err(invalid(
                span.start,
                format!("block %{} has no terminator before {}", block.label.0, span.opcode),
            )),
        }
    }

    fn close_block(&mut self, builder: &mut FunctionBuilder) {
        if let Some(mut block) = builder.open_block.take() {
            let mut instructions = Vec::with_capacity(block.instructions.len());
            instructions.append(&mut block.instructions);
            builder.spare = std::mem::replace(&mut block.instructions, instructions);
            self.module.functions[builder.index as usize].blocks.push(block);
        }
    }
}

/// The function that is being read.
struct FunctionBuilder {
    /// Its index in the module.
    index: u32,
    /// Types of the parameters, by the function's type.
    parameter_types: Vec<TypeId>,
    /// The block that has no terminator yet.
    open_block: Option<BasicBlock>,
    /// An empty list whose memory the instructions of the next block reuse.
    spare: Vec<Instruction>,
}
