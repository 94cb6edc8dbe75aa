//! Reads the lexical scopes of debug information from the words of a loaded module. What is invalid
//! leaves gaps only.

use std::collections::{HashMap, HashSet};

use rspirv::spirv::NonsemanticShaderDebuginfo100Op as DebugOp;

use crate::module::debug_scopes::{
    DebugScopes, InlinedCall, LexicalScope, LocationForm, ScopePosition, SourceType, SourceVariable,
    VariableLocation,
};
use crate::module::{Definition, Id, Module, Opcode};

/// `Deref`, of `DebugOperation`.
const DEREF: u32 = 0;

/// The words before the first instruction.
const HEADER: usize = 5;

impl Module {
    /// Its lexical scopes and local variables, read on the first call.
    #[doc(hidden)]
    pub fn debug_scopes(&self) -> &DebugScopes {
        self.scopes.get_or_init(|| read(self))
    }
}

/// Reads all scopes of a module.
fn read(module: &Module) -> DebugScopes {
    let is_debug = |name: &String| name == OPEN_CL || name.starts_with("NonSemantic.Shader.DebugInfo.");
    if !module.instruction_sets.iter().any(is_debug) {
        return DebugScopes::default();
    }
    let mut reader = ScopeReader::new(module);
    let words = &module.words[..];
    let mut offset = HEADER;
    while let Some(&first) = words.get(offset) {
        let count = (first >> 16) as usize;
        let Some(operands) = words.get(offset + 1..offset + count).filter(|_| count > 0) else { break };
        match Opcode::of_word(first) {
            Opcode::ExtInst | Opcode::ExtInstWithForwardRefsKHR => {
                reader.instruction(offset as u32, operands);
            }
            // A scope holds to the end of its block.
            Opcode::Label | Opcode::FunctionEnd => reader.position = None,
            _ => {}
        }
        offset += count;
    }
    reader.scopes
}

/// The set whose lines, columns and indices are literals instead of constants.
const OPEN_CL: &str = "OpenCL.DebugInfo.100";

struct ScopeReader<'m> {
    module: &'m Module,
    scopes: DebugScopes,
    /// By the id of a `DebugFunction` or `DebugLexicalBlock`: its index.
    scope_indices: HashMap<Id, u32>,
    variable_indices: HashMap<Id, u32>,
    call_indices: HashMap<Id, u32>,
    /// By the id of a `DebugSource`: the index of its file.
    sources: HashMap<Id, u32>,
    /// The types of the source.
    types: HashMap<Id, SourceType>,
    /// `DebugOperation` that dereferences.
    derefs: HashSet<Id>,
    /// What each `DebugExpression` with operations makes of a location.
    expressions: HashMap<Id, LocationForm>,
    /// The scope of the instruction that is read.
    position: Option<ScopePosition>,
    /// Whether the instruction that is read has literals.
    literals: bool,
}

impl<'m> ScopeReader<'m> {
    fn new(module: &'m Module) -> Self {
        Self {
            module,
            scopes: DebugScopes::default(),
            scope_indices: HashMap::new(),
            variable_indices: HashMap::new(),
            call_indices: HashMap::new(),
            sources: HashMap::new(),
            types: HashMap::new(),
            derefs: HashSet::new(),
            expressions: HashMap::new(),
            position: None,
            literals: false,
        }
    }

    /// Reads an extended instruction, of whichever set.
    fn instruction(&mut self, offset: u32, words: &[u32]) {
        let &[_, result, set, number, ref operands @ ..] = words else { return };
        let Some(Definition::InstructionSet(set)) = self.module.definition(Id(set)) else { return };
        let set = &self.module.instruction_sets[set as usize];
        self.literals = set == OPEN_CL;
        if !self.literals && !set.starts_with("NonSemantic.Shader.DebugInfo.") {
            return;
        }
        if let Some(op) = DebugOp::from_u32(number) {
            self.debug_instruction(offset, Id(result), op, operands);
        }
    }

    fn debug_instruction(&mut self, offset: u32, result: Id, op: DebugOp, operands: &[u32]) {
        match (op, operands) {
            (DebugOp::DebugSource, [file, ..]) => {
                let files = &self.module.debug_info.files;
                let name = self.module.debug_info.name(Id(*file));
                let index = name.and_then(|name| files.iter().position(|known| *known.name == *name));
                index.and_then(|index| self.sources.insert(result, index as u32));
            }
            (DebugOp::DebugFunction, [name, _, source, line, ..]) => {
                let name = self.module.debug_info.name(Id(*name));
                let (file, line) = (self.sources.get(&Id(*source)).copied(), self.line(*line));
                self.add_scope(
                    result,
                    LexicalScope { function: Some(name.unwrap_or_default()), parent: None, file, line },
                );
            }
            (DebugOp::DebugLexicalBlock, [source, line, _, parent, ..]) => {
                let parent = self.scope_indices.get(&Id(*parent)).copied();
                let (file, line) = (self.sources.get(&Id(*source)).copied(), self.line(*line));
                self.add_scope(result, LexicalScope { function: None, parent, file, line });
            }
            // Another scope of the same block, for another file.
            (DebugOp::DebugLexicalBlockDiscriminator, [_, _, parent, ..]) => {
                if let Some(&scope) = self.scope_indices.get(&Id(*parent)) {
                    self.scope_indices.insert(result, scope);
                }
            }
            (DebugOp::DebugFunctionDefinition, [function, definition, ..]) => {
                if let Some(&scope) = self.scope_indices.get(&Id(*function)) {
                    self.scopes.functions.insert(Id(*definition), scope);
                }
            }
            (DebugOp::DebugScope, [scope, inlined @ ..]) => {
                let inlined = inlined.first().and_then(|id| self.call_indices.get(&Id(*id))).copied();
                let scope = self.scope_indices.get(&Id(*scope)).copied();
                self.set_position(offset, scope.map(|scope| ScopePosition { scope, inlined }));
            }
            (DebugOp::DebugNoScope, _) => self.set_position(offset, None),
            (DebugOp::DebugInlinedAt, [line, scope, inlined @ ..]) => {
                let Some(&scope) = self.scope_indices.get(&Id(*scope)) else { return };
                let inlined = inlined.first().and_then(|id| self.call_indices.get(&Id(*id))).copied();
                let line = self.number(*line).unwrap_or(0);
                self.call_indices.insert(result, self.scopes.inlined_calls.len() as u32);
                self.scopes.inlined_calls.push(InlinedCall { line, scope, inlined });
            }
            (DebugOp::DebugLocalVariable, [name, ty, _, line, _, scope, _flags, argument @ ..]) => {
                let name = self.module.debug_info.name(Id(*name));
                let (Some(name), Some(&scope)) = (name, self.scope_indices.get(&Id(*scope))) else { return };
                let argument = argument.first().and_then(|&id| self.number(id)).unwrap_or(0);
                let ty = self.types.get(&Id(*ty)).cloned().unwrap_or_default();
                let line = self.line(*line);
                let variable = SourceVariable { name, ty, line, scope, argument };
                self.variable_indices.insert(result, self.scopes.variables.len() as u32);
                self.scopes.variables.push(variable);
            }
            (DebugOp::DebugGlobalVariable, [_, _, _, line, _, _, _, variable, ..]) => {
                if let Some(line) = self.line(*line) {
                    self.scopes.global_lines.insert(Id(*variable), line);
                }
            }
            (DebugOp::DebugTypeComposite, [name, _, _, _, _, _, _, _, _, members @ ..]) => {
                let name = self.module.debug_info.name(Id(*name));
                self.types.insert(result, SourceType { name, parts: members.len() as u32 });
            }
            (
                DebugOp::DebugTypeVector | DebugOp::DebugTypeMatrix | DebugOp::DebugTypeArray,
                [_, count, ..],
            ) => {
                let parts = self.number(*count).unwrap_or(0);
                self.types.insert(result, SourceType { name: None, parts });
            }
            (DebugOp::DebugOperation, [operation, ..]) if self.number(*operation) == Some(DEREF) => {
                self.derefs.insert(result);
            }
            (DebugOp::DebugExpression, operations) => match operations {
                [] => {}
                [one] if self.derefs.contains(&Id(*one)) => {
                    self.expressions.insert(result, LocationForm::Pointer);
                }
                _ => {
                    self.expressions.insert(result, LocationForm::Calculated);
                }
            },
            (DebugOp::DebugDeclare, [variable, value, expression, path @ ..]) => {
                let form = match self.expressions.get(&Id(*expression)) {
                    None => LocationForm::Declared,
                    Some(_) => LocationForm::Calculated,
                };
                self.add_location(offset, Id(*variable), Id(*value), form, path);
            }
            (DebugOp::DebugValue, [variable, value, expression, path @ ..]) => {
                let form = self.expressions.get(&Id(*expression)).copied().unwrap_or(LocationForm::Direct);
                self.add_location(offset, Id(*variable), Id(*value), form, path);
            }
            _ => {}
        }
    }

    fn add_scope(&mut self, id: Id, scope: LexicalScope) {
        self.scope_indices.insert(id, self.scopes.scopes.len() as u32);
        self.scopes.scopes.push(scope);
    }

    fn set_position(&mut self, offset: u32, position: Option<ScopePosition>) {
        self.position = position;
        self.scopes.scope_changes.push((offset, position));
        // OpenCL.DebugInfo.100 opens a function with a scope and no definition.
        if let (Some(ScopePosition { scope, inlined: None }), true) = (position, self.literals)
            && let Some(function) = self.module.function_at(offset)
            && let Some(outermost) = self.scopes.chain(scope).last()
        {
            self.scopes.functions.entry(function.id).or_insert(outermost);
        }
    }

    fn add_location(&mut self, offset: u32, variable: Id, value: Id, form: LocationForm, path: &[u32]) {
        let Some(&variable) = self.variable_indices.get(&variable) else { return };
        let Some(path) = path.iter().map(|&index| self.number(index)).collect() else { return };
        let inlined = self.position.and_then(|position| position.inlined);
        self.scopes.locations.push(VariableLocation { offset, variable, inlined, value, form, path });
    }

    /// A number, which is a literal or a constant.
    fn number(&self, word: u32) -> Option<u32> {
        match self.literals {
            true => Some(word),
            false => self.module.scalar_value(Id(word)).and_then(|bits| u32::try_from(bits).ok()),
        }
    }

    /// A line; compilers write 0 where they know none.
    fn line(&self, word: u32) -> Option<u32> {
        self.number(word).filter(|&line| line > 0)
    }
}
