//! Lowers calls: inlined if that is profitable, else real calls.

use crate::module::{Definition, Function, Id, Instruction};
use crate::ops::memory;
use crate::ops::op::Op;
use crate::ops::translate::{IdValue, Origin};
use crate::ops::value_registers::Words;
use crate::program::lower::{
    CalledFunction, INLINE_DEPTH, INLINE_SIZE, INLINE_TOTAL, Inlining, Lowering, ReturnTarget,
};
use crate::program::{Scope, Terminator};
use anyhit_base::error::Result;

impl Lowering<'_> {
    pub(super) fn call(&mut self, instruction: &Instruction) -> Result<()> {
        let callee = self.translator.id(instruction, 0)?;
        let Some(Definition::Function(index)) = self.module.definition(callee) else {
            return Err(self.translator.invalid(format!("%{} is not a function", callee.0)));
        };
        let module = self.module;
        let function = &module.functions[index as usize];
        let arguments: Vec<Id> = module.operands(instruction)[1..].iter().map(|&id| Id(id)).collect();
        if arguments.len() != function.parameters.len() {
            return Err(self.translator.invalid(format!(
                "{} takes {} arguments, not {}",
                module.describe_id(callee),
                function.parameters.len(),
                arguments.len()
            )));
        }
        let cost = self.inline_costs[index as usize];
        let small = cost.instructions <= INLINE_SIZE && self.instructions < INLINE_TOTAL;
        let profitable = self.depth < INLINE_DEPTH && (small || cost.calls <= 1);
        if profitable && self.inlining == Inlining::WhereProfitable {
            self.inline(instruction, function, &arguments)
        } else {
            self.real_call(instruction, function, &arguments)
        }
    }

    fn inline(&mut self, instruction: &Instruction, function: &Function, arguments: &[Id]) -> Result<()> {
        self.add_call_step();
        let locals = self.translator.local_count();
        let outer = self.translator.origin;
        self.scopes.push(Scope { parent: outer.scope, call: instruction.offset, function: function.id });
        self.translator.origin.scope = self.scopes.len() as u32 - 1;
        for (&argument, &(parameter, _)) in arguments.iter().zip(&function.parameters) {
            let value = self.translator.value(argument)?;
            self.translator.define(parameter, value);
        }
        let result = self.result_registers(function)?;
        let label = self.label();
        self.depth += 1;
        self.body(function, &ReturnTarget::Inlined { label, result: result.clone() })?;
        self.depth -= 1;
        self.translator.truncate_locals(locals);
        self.translator.origin = outer;
        self.begin(label);
        self.translator.define_result(instruction, result);
        Ok(())
    }

    /// Registers for the value that a function returns.
    fn result_registers(&mut self, function: &Function) -> Result<Words> {
        let count = self.translator.word_count(function.return_type)?;
        self.translator.fresh_words(count)
    }

    fn real_call(&mut self, instruction: &Instruction, function: &Function, arguments: &[Id]) -> Result<()> {
        let called = match self.called_functions.get(&function.id) {
            Some(called) => called.clone(),
            None => {
                let mut parameters = Vec::new();
                for &(_, ty) in &function.parameters {
                    let count = self.translator.word_count(ty)?;
                    parameters.push(self.translator.fresh_words(count)?);
                }
                let result = self.result_registers(function)?;
                let called = CalledFunction { label: self.label(), parameters, result };
                self.called_functions.insert(function.id, called.clone());
                self.queue.push_back(function.id);
                called
            }
        };
        for (&argument, parameter) in arguments.iter().zip(&called.parameters) {
            let words = self.translator.words_unchecked(argument)?;
            for (&to, from) in parameter.iter().zip(words) {
                self.translator.emit(Op::Memory(memory::MemoryOp::Move { to, from }));
            }
        }
        self.translator.set_clock()?;
        let return_to = self.label();
        self.end(Terminator::Call { function: called.label, return_to });
        self.begin(return_to);
        let result = self.translator.fresh_words(called.result.len() as u32)?;
        for (&to, &from) in result.iter().zip(&called.result) {
            self.translator.emit(Op::Memory(memory::MemoryOp::Move { to, from }));
        }
        self.translator.define_result(instruction, result);
        Ok(())
    }

    /// Lowers a function that is not inlined.
    pub(super) fn lower_called_function(&mut self, id: Id) -> Result<()> {
        let called = self.called_functions[&id].clone();
        let Some(Definition::Function(index)) = self.module.definition(id) else {
            return Err(self.translator.invalid(format!("%{} is not a function", id.0)));
        };
        let module = self.module;
        let function = &module.functions[index as usize];
        self.scopes.push(Scope { parent: 0, call: 0, function: id });
        self.translator.origin = Origin { offset: 0, scope: self.scopes.len() as u32 - 1 };
        self.translator.truncate_locals(0);
        for (&(id, _), words) in function.parameters.iter().zip(called.parameters) {
            self.translator.define(id, IdValue::Words(words));
        }
        self.begin(called.label);
        self.functions.push(self.open_block());
        self.body(function, &ReturnTarget::Called { result: called.result })
    }
}
