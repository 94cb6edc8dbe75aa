//! Calls: inlined where that pays, else real ones.

use crate::error::Result;
use crate::module::{Definition, Function, Id, Instruction};
use crate::ops::memory;
use crate::ops::op::Op;
use crate::ops::translate::{IdValue, Origin, Words};
use crate::program::lower::{INLINE_DEPTH, INLINE_SIZE, INLINE_TOTAL, Inlining, Lowering, Return, Standing};
use crate::program::{Scope, Terminator};

impl Lowering<'_> {
    pub(super) fn call(&mut self, instruction: &Instruction) -> Result<()> {
        let callee = self.translator.id(instruction, 0)?;
        let Some(Definition::Function(index)) = self.module.definition(callee) else {
            return Err(self.translator.invalid(format!("%{} is no function", callee.0)));
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
        let size = self.sizes[index as usize];
        let small = size.instructions <= INLINE_SIZE && self.instructions < INLINE_TOTAL;
        let pays = self.depth < INLINE_DEPTH && (small || size.calls <= 1);
        if pays && self.inlining == Inlining::WherePaying {
            self.inline(instruction, function, &arguments)
        } else {
            self.real_call(instruction, function, &arguments)
        }
    }

    fn inline(&mut self, instruction: &Instruction, function: &Function, arguments: &[Id]) -> Result<()> {
        let locals = self.translator.locals();
        for (&argument, &(parameter, _)) in arguments.iter().zip(&function.parameters) {
            let value = self.translator.value(argument)?;
            self.translator.define(parameter, value);
        }
        let result = self.result_registers(function)?;
        let label = self.label();
        let outer = self.translator.origin;
        self.scopes.push(Scope { parent: outer.scope, call: instruction.offset, function: function.id });
        self.translator.origin.scope = self.scopes.len() as u32 - 1;
        self.depth += 1;
        self.body(function, &Return::Inlined { label, result: result.clone() })?;
        self.depth -= 1;
        self.translator.leave(locals);
        self.translator.origin = outer;
        self.begin(label);
        self.translator.result(instruction, result);
        Ok(())
    }

    fn result_registers(&mut self, function: &Function) -> Result<Words> {
        let count = self.translator.word_count(function.return_type)?;
        self.translator.fresh_words(count)
    }

    fn real_call(&mut self, instruction: &Instruction, function: &Function, arguments: &[Id]) -> Result<()> {
        let standing = match self.standing.get(&function.id) {
            Some(standing) => standing.clone(),
            None => {
                let mut parameters = Vec::new();
                for &(_, ty) in &function.parameters {
                    let count = self.translator.word_count(ty)?;
                    parameters.push(self.translator.fresh_words(count)?);
                }
                let result = self.result_registers(function)?;
                let standing = Standing { label: self.label(), parameters, result };
                self.standing.insert(function.id, standing.clone());
                self.queue.push_back(function.id);
                standing
            }
        };
        for (&argument, parameter) in arguments.iter().zip(&standing.parameters) {
            let words = self.translator.carried(argument)?;
            for (&to, from) in parameter.iter().zip(words) {
                self.translator.emit(Op::Memory(memory::MemoryOp::Move { to, from }));
            }
        }
        self.translator.set_clock()?;
        let return_to = self.label();
        self.end(Terminator::Call { function: standing.label, return_to });
        self.begin(return_to);
        let result = self.translator.fresh_words(standing.result.len() as u32)?;
        for (&to, &from) in result.iter().zip(&standing.result) {
            self.translator.emit(Op::Memory(memory::MemoryOp::Move { to, from }));
        }
        self.translator.result(instruction, result);
        Ok(())
    }

    /// Lowers a function that is really called.
    pub(super) fn stand_alone(&mut self, id: Id) -> Result<()> {
        let standing = self.standing[&id].clone();
        let Some(Definition::Function(index)) = self.module.definition(id) else {
            return Err(self.translator.invalid(format!("%{} is no function", id.0)));
        };
        let module = self.module;
        let function = &module.functions[index as usize];
        self.scopes.push(Scope { parent: 0, call: 0, function: id });
        self.translator.origin = Origin { offset: 0, scope: self.scopes.len() as u32 - 1 };
        self.translator.leave(0);
        for (&(id, _), words) in function.parameters.iter().zip(standing.parameters) {
            self.translator.define(id, IdValue::Words(words));
        }
        self.begin(standing.label);
        self.functions.push(self.blocks.len() as u32);
        self.body(function, &Return::StandingAlone { result: standing.result })
    }
}
