//! Loads a module from bytes.
//!
//! One pass over the words fills the arenas: module scope here and in `declare_type`,
//! `declare_constant` and `decoration`; functions in `functions`. A second pass (`check`,
//! `check_flow`) checks the instructions of the functions against the grammar and the definitions,
//! to which they may refer forward. All work is linear in the number of words.

use std::collections::{HashMap, HashSet};
use std::sync::OnceLock;

use crate::module::check::{self, FunctionUses};
use crate::module::copy_budget::CopyBudget;
use crate::module::debug_info::DebugInfo;
use crate::module::debug_reader::DebugReader;
use crate::module::decoration::{Decorations, PendingDecorations};
use crate::module::grammar::{InstructionGrammar, is_id, walk};
use crate::module::id_map::{IdMap, UnknownResults};
use crate::module::interface::{EntryPoint, Stage};
use crate::module::push_constant_bank::bind_banks;
use crate::module::span::{Span, invalid};
use crate::module::ty::{Type, TypeExtent, TypeId};
use crate::module::words::{Header, Walker, header, string, words_of};
use crate::module::{Definition, GlobalVariable, Id, Module, Opcode, check_flow, included_lines};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits};

/// The storage class of variables inside functions.
pub(super) const FUNCTION_STORAGE: u32 = 7;
/// Different capabilities that a module may declare; SPIR-V and its extensions have some 300.
const MAX_CAPABILITIES: usize = 1 << 12;

/// Reads a module from bytes of either byte order.
///
/// Opcodes and enumerants that are not known here are kept as numbers: only executing them is an
/// error. So are capabilities, memory models and instructions that this crate does not run.
///
/// # Errors
/// * `InvalidModule` where the bytes are no module or break a rule without which they have no
///   meaning: words, grammar, definitions, types of constants, blocks, branches, calls. The place
///   is the offset of the word, counted from the module's first.
/// * `UnsupportedModule` for versions above 1.6, where a few words request too many copies
///   (decoration groups, execution modes), and for what is beyond the default [`InputLimits`].
pub fn load(bytes: &[u8]) -> Result<Module> {
    load_with(bytes, InputLimits::default())
}

/// As [`load()`], within limits of the caller's choice, which the module keeps: lowering it heeds
/// them, too.
///
/// # Errors
/// As [`load()`].
pub fn load_with(bytes: &[u8], limits: InputLimits) -> Result<Module> {
    limits
        .check(InputLimit::ModuleBytes, bytes.len() as u64, ErrorKind::UnsupportedModule)
        .map_err(|error| error.at(Place::Word(0)))?;
    let words = words_of(bytes)?;
    let header = header(&words)?;
    let mut walker = Walker::new(&words, limits);
    let mut loader = Loader::new(&words, header, limits);
    let first_function = loader.module_scope(&mut walker)?;
    loader.functions(&mut walker, first_function)?;
    let (mut module, unknown) = loader.finish()?;
    module.words = words;
    let uses = check::functions(&module, &unknown)?;
    check_flow::functions(&module)?;
    for (function, FunctionUses { calls, variables }) in module.functions.iter_mut().zip(uses) {
        (function.calls, function.variables) = (calls, variables);
    }
    Ok(module)
}

/// How an imported instruction set is treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SetKind {
    /// Its instructions are executed.
    Semantic,
    /// Debug information that is read.
    Debug,
    /// Changes no result and is not read.
    Ignored,
}

impl SetKind {
    fn of(name: &str) -> Self {
        match name {
            "NonSemantic.DebugPrintf" => Self::Semantic,
            "OpenCL.DebugInfo.100" => Self::Debug,
            "DebugInfo" => Self::Ignored,
            _ if name.starts_with("NonSemantic.Shader.DebugInfo.") => Self::Debug,
            _ if name.starts_with("NonSemantic.") => Self::Ignored,
            _ => Self::Semantic,
        }
    }
}

/// An execution mode, before its entry points are known.
struct PendingMode {
    number: u32,
    operands: Vec<u32>,
}

/// A module under construction.
pub(super) struct Loader<'w> {
    pub(super) words: &'w [u32],
    pub(super) module: Module,
    pub(super) debug: DebugReader<'w>,
    /// How large each type is, by [`TypeId`].
    pub(super) extents: Vec<TypeExtent>,
    /// The offsets of the types that must be unique, by opcode and operands.
    pub(super) unique_types: HashMap<Vec<u32>, usize>,
    /// Pointers declared forward and not defined yet, with the offset.
    pub(super) forward: HashMap<Id, usize>,
    pub(super) unknown: UnknownResults,
    pub(super) pending: PendingDecorations,
    set_kinds: Vec<SetKind>,
    /// Results of debug instructions. They are defined last, so that invalid debug information is
    /// no error.
    debug_results: Vec<Id>,
    modes: HashMap<Id, Vec<PendingMode>>,
    /// Targets of execution modes, each with the offset of the word that names it.
    mode_targets: Vec<(Id, usize)>,
    memory_model: Option<(u32, u32)>,
    bound: u32,
    /// Ids that are defined so far.
    ids: u64,
    capabilities: HashSet<u32>,
}

impl<'w> Loader<'w> {
    fn new(words: &'w [u32], header: Header, limits: InputLimits) -> Self {
        let definitions = IdMap::new(words.len().min(header.bound as usize));
        Self {
            words,
            module: Module {
                words: Vec::new(),
                version: header.version,
                generator: header.generator,
                limits,
                memory_model: (0, 0),
                capabilities: Vec::new(),
                extensions: Vec::new(),
                instruction_sets: Vec::new(),
                entry_points: Vec::new(),
                types: Vec::new(),
                type_ids: Vec::new(),
                vector_counts: Vec::new(),
                cooperative_matrices: Vec::new(),
                constants: Vec::new(),
                variables: Vec::new(),
                functions: Vec::new(),
                decorations: Decorations::default(),
                debug_info: DebugInfo::default(),
                scopes: OnceLock::new(),
                faults: OnceLock::new(),
                undeclared: OnceLock::new(),
                result_types: IdMap::like(&definitions),
                definitions,
                warnings: Vec::new(),
            },
            debug: DebugReader::new(words),
            extents: Vec::new(),
            unique_types: HashMap::new(),
            forward: HashMap::new(),
            unknown: HashMap::new(),
            pending: PendingDecorations::default(),
            set_kinds: Vec::new(),
            debug_results: Vec::new(),
            modes: HashMap::new(),
            mode_targets: Vec::new(),
            memory_model: None,
            bound: header.bound,
            ids: 0,
            capabilities: HashSet::new(),
        }
    }

    /// Reads everything before the first `OpFunction`, and returns the span of that.
    fn module_scope(&mut self, walker: &mut Walker<'w>) -> Result<Option<Span>> {
        while let Some(span) = walker.next()? {
            let Some(known) = InstructionGrammar::of(span.opcode) else {
                self.record_unknown(span);
                continue;
            };
            if span.opcode == Opcode::Function {
                return Ok(Some(span));
            }
            self.module_instruction(span, known)?;
        }
        Ok(None)
    }

    fn module_instruction(&mut self, span: Span, known: &InstructionGrammar) -> Result<()> {
        let words = self.words;
        if self.debug_instruction(span)? {
            return Ok(());
        }
        let literal_words = self.literal_words(span);
        let check_defined = |loader: &Self, at: usize| {
            let id = loader.id(at);
            if loader.module.definition(id).is_some() || loader.unknown.contains_key(&id) {
                return Ok(());
            }
            Err(loader.expected(span, at, "a previously defined id"))
        };
        if is_declaration(span.opcode, known) {
            walk(words, span, literal_words, &mut |at, kind| {
                if is_id(kind) { check_defined(self, at) } else { Ok(()) }
            })?;
        } else {
            walk(words, span, literal_words, &mut |_, _| Ok(()))?;
        }
        let first = span.start + 1;
        match span.opcode {
            Opcode::Nop => {}
            Opcode::Capability => self.capability(first)?,
            Opcode::Extension => {
                let name = self.string_at(first);
                self.module.extensions.push(name);
            }
            Opcode::ExtInstImport => {
                let name = self.string_at(first + 1);
                self.define(first, Definition::InstructionSet(self.set_kinds.len() as u32))?;
                self.set_kinds.push(SetKind::of(&name));
                self.module.instruction_sets.push(name);
            }
            Opcode::MemoryModel => {
                if self.memory_model.is_some() {
                    return Err(invalid(
                        span.start,
                        "expected exactly one OpMemoryModel, found a second one",
                    ));
                }
                self.memory_model = Some((words[first], words[first + 1]));
            }
            Opcode::EntryPoint => self.entry_point(span),
            Opcode::ExecutionMode | Opcode::ExecutionModeId => {
                let function = self.id(first);
                self.mode_targets.push((function, first));
                self.modes.entry(function).or_default().push(PendingMode {
                    number: words[first + 1],
                    operands: words[first + 2..span.end].to_vec(),
                });
            }
            Opcode::Decorate | Opcode::DecorateId | Opcode::DecorateString => {
                self.pending.decorate(words, span)
            }
            Opcode::MemberDecorate | Opcode::MemberDecorateString | Opcode::MemberDecorateIdEXT => {
                self.pending.decorate_member(words, span);
            }
            Opcode::DecorationGroup => {
                self.define(first, Definition::Other)?;
                self.pending.group(self.id(first));
            }
            Opcode::GroupDecorate => self.pending.apply_group(words, span),
            Opcode::GroupMemberDecorate => self.pending.apply_group_to_members(words, span),
            Opcode::TypeForwardPointer => self.declare_forward_pointer(span)?,
            Opcode::Variable | Opcode::UntypedVariableKHR => self.global_variable(span)?,
            _ if known.name.starts_with("Type") => self.declare_type(span, known)?,
            _ if known.is_constant => self.declare_constant(span, known)?,
            _ if is_ignored(span.opcode, known) => {
                if known.has_result {
                    self.define(first + usize::from(known.has_type), Definition::Other)?;
                }
            }
            _ => {
                return Err(invalid(
                    span.start,
                    format!("{} is not allowed outside a function", span.opcode),
                ));
            }
        }
        Ok(())
    }

    /// Passes an instruction of debug information (a name, a source, a line) to its reader; returns
    /// whether it is one.
    pub(super) fn debug_instruction(&mut self, span: Span) -> Result<bool> {
        match span.opcode {
            Opcode::Name
            | Opcode::MemberName
            | Opcode::Source
            | Opcode::SourceContinued
            | Opcode::SourceExtension
            | Opcode::ModuleProcessed
            | Opcode::Line
            | Opcode::NoLine => self.debug.core(span),
            Opcode::String => {
                if span.end > span.start + 1 {
                    self.define(span.start + 1, Definition::Other)?;
                }
                self.debug.core(span);
            }
            Opcode::ExtInst | Opcode::ExtInstWithForwardRefsKHR => {
                walk(self.words, span, 1, &mut |_, _| Ok(()))?;
                let kind = self.set_kind(span)?;
                match kind {
                    SetKind::Semantic => return Ok(false),
                    SetKind::Debug => self.debug.extended(span, &self.module),
                    SetKind::Ignored => {}
                }
                self.debug_results.push(self.id(span.start + 2));
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// A capability is kept once: lists of them are searched again and again.
    fn capability(&mut self, at: usize) -> Result<()> {
        let number = self.words[at];
        if !self.capabilities.insert(number) {
            return Ok(());
        }
        if self.capabilities.len() > MAX_CAPABILITIES {
            let message = format!(
                "the module declares more than {MAX_CAPABILITIES} capabilities, more than SPIR-V has"
            );
            return Err(Error::new(ErrorKind::UnsupportedModule, message).at(Place::Word(at)));
        }
        self.module.capabilities.push(number);
        Ok(())
    }

    /// The kind of the set that an `OpExtInst` names.
    fn set_kind(&self, span: Span) -> Result<SetKind> {
        match self.module.definition(self.id(span.start + 3)) {
            Some(Definition::InstructionSet(set)) => Ok(self.set_kinds[set as usize]),
            _ => Err(self.expected(span, span.start + 3, "a previously imported instruction set")),
        }
    }

    /// Records what an instruction of unknown opcode may define: its first or second operand.
    pub(super) fn record_unknown(&mut self, span: Span) {
        for at in span.operands().take(2) {
            self.unknown.entry(self.id(at)).or_insert(span.opcode);
        }
    }

    fn entry_point(&mut self, span: Span) {
        let name_at = span.start + 3;
        let (name, count) = string(&self.words[name_at..span.end])
            .expect("bug in anyhit: an unterminated string passed the grammar");
        self.module.entry_points.push(EntryPoint {
            stage: Stage::of(self.words[span.start + 1]),
            // Scenes name it: format characters stay, as in their keys.
            name: escape::controls(&name).into_owned(),
            function: self.id(span.start + 2),
            interface: self.words[name_at + count..span.end].iter().copied().map(Id).collect(),
            modes: Vec::new(),
            offset: span.start as u32,
        });
    }

    fn global_variable(&mut self, span: Span) -> Result<()> {
        let first = span.start + 1;
        let pointer = self.type_at(span, first)?;
        let storage_class = self.words[first + 2];
        let untyped = span.opcode == Opcode::UntypedVariableKHR;
        let mut pointee = self.variable_type(span, pointer, storage_class, untyped)?;
        if untyped && first + 3 < span.end {
            pointee = Some(self.type_at(span, first + 3)?);
        }
        if storage_class == FUNCTION_STORAGE {
            return Err(invalid(
                first + 2,
                format!("{} of storage class Function is not allowed outside a function", span.opcode),
            ));
        }
        let initializer_at = first + if untyped { 4 } else { 3 };
        let initializer = (initializer_at < span.end).then(|| self.id(initializer_at));
        if let Some(id) = initializer {
            match self.module.definition(id) {
                Some(Definition::Constant(constant)) => {
                    let ty = self.module.constants[constant as usize].ty;
                    if pointee.is_some_and(|pointee| pointee != ty) {
                        return Err(self.expected(span, initializer_at, "a constant of the variable's type"));
                    }
                }
                // The type of a variable is that of pointers to it.
                Some(Definition::Variable(other)) => {
                    let ty = self.module.variables[other as usize].pointer;
                    if pointee.is_some_and(|pointee| pointee != ty) {
                        return Err(self.expected(
                            span,
                            initializer_at,
                            "a variable that is a value of the variable's type",
                        ));
                    }
                }
                None if self.unknown.contains_key(&id) => {}
                _ => {
                    return Err(self.expected(
                        span,
                        initializer_at,
                        "a constant or a variable of module scope",
                    ));
                }
            }
        }
        self.define(first + 1, Definition::Variable(self.module.variables.len() as u32))?;
        self.module.variables.push(GlobalVariable {
            id: self.id(first + 1),
            pointer,
            ty: pointee,
            storage_class,
            initializer,
            offset: span.start as u32,
        });
        Ok(())
    }

    /// Checks a variable's result type against its storage class; returns the pointee type.
    pub(super) fn variable_type(
        &self,
        span: Span,
        pointer: TypeId,
        storage_class: u32,
        untyped: bool,
    ) -> Result<Option<TypeId>> {
        match *self.module.ty(pointer) {
            Type::Pointer { storage_class: declared, pointee, .. } => {
                if declared != storage_class {
                    return Err(self.expected(span, span.start + 3, "the storage class of the result type"));
                }
                if pointee.is_none() && !untyped {
                    return Err(self.expected(span, span.start + 1, "a previously defined pointer type"));
                }
                Ok(pointee)
            }
            Type::Other(_) => Ok(None),
            _ => Err(self.expected(span, span.start + 1, "a pointer type")),
        }
    }

    fn finish(mut self) -> Result<(Module, UnknownResults)> {
        if let Some((id, &at)) = self.forward.iter().min_by_key(|(_, at)| **at) {
            return Err(invalid(
                at,
                format!("OpTypeForwardPointer declares %{}, but no OpTypePointer defines it", id.0),
            ));
        }
        let Some(memory_model) = self.memory_model else {
            return Err(invalid(self.words.len(), "the module has no OpMemoryModel"));
        };
        self.module.memory_model = memory_model;
        for id in std::mem::take(&mut self.debug_results) {
            if self.module.definition(id).is_none() {
                self.module.definitions.insert(id, Definition::Other);
            }
        }
        self.check_entry_points()?;
        self.apply_modes()?;
        self.module.debug_info = self.debug.finish();
        included_lines::repair(&mut self.module.debug_info, &self.module.functions, self.module.generator);
        std::mem::take(&mut self.pending).apply(&mut self.module, &self.unknown, self.words.len())?;
        bind_banks(&mut self.module);
        Ok((self.module, self.unknown))
    }

    /// Checks that each entry point names a function with a body and variables of module scope.
    fn check_entry_points(&self) -> Result<()> {
        /// The execution model of OpenCL, whose entry points take parameters.
        const KERNEL: Stage = Stage::Other(6);
        let mut seen = HashMap::new();
        for entry in &self.module.entry_points {
            let at = entry.offset as usize;
            if seen.insert((entry.stage, entry.name.as_str()), at).is_some() {
                return Err(invalid(
                    at,
                    format!("a second entry point `{}` of {}", entry.name, entry.stage.name()),
                ));
            }
            let Some(Definition::Function(function)) = self.module.definition(entry.function) else {
                return Err(invalid(
                    at + 2,
                    format!("OpEntryPoint: expected the id of a function, found %{}", entry.function.0),
                ));
            };
            let function = &self.module.functions[function as usize];
            let returns = self.module.ty(function.return_type);
            if function.blocks.is_empty() {
                return Err(invalid(at + 2, format!("entry point `{}` has no body", entry.name)));
            }
            if entry.stage != KERNEL && !(function.parameters.is_empty() && *returns == Type::Void) {
                return Err(invalid(
                    at + 2,
                    format!("entry point `{}` must take no parameters and return nothing", entry.name),
                ));
            }
            let end = at + (self.words[at] >> 16) as usize;
            let start = end - entry.interface.len();
            for (index, id) in entry.interface.iter().enumerate() {
                match self.module.definition(*id) {
                    Some(Definition::Variable(_)) => {}
                    None if self.unknown.contains_key(id) => {}
                    _ => {
                        return Err(invalid(
                            start + index,
                            format!(
                                "OpEntryPoint: expected the id of a variable of module scope, found %{}",
                                id.0
                            ),
                        ));
                    }
                }
            }
        }
        Ok(())
    }

    fn apply_modes(&mut self) -> Result<()> {
        let functions: HashMap<Id, ()> =
            self.module.entry_points.iter().map(|entry| (entry.function, ())).collect();
        for &(id, at) in &self.mode_targets {
            if !functions.contains_key(&id) {
                return Err(invalid(
                    at,
                    format!("an execution mode's target must be an entry point, found %{}", id.0),
                ));
            }
        }
        let mut budget = CopyBudget::new(self.words.len());
        for entry in &mut self.module.entry_points {
            for mode in self.modes.get(&entry.function).into_iter().flatten() {
                budget.spend(1 + mode.operands.len(), entry.offset as usize)?;
                entry.modes.push((mode.number, mode.operands.clone()));
            }
        }
        Ok(())
    }

    pub(super) fn id(&self, at: usize) -> Id {
        Id(self.words[at])
    }

    fn string_at(&self, at: usize) -> String {
        string(&self.words[at..]).map(|(text, _)| escape::into_line(text)).unwrap_or_default()
    }

    /// The type whose id is the word at an offset.
    pub(super) fn type_at(&mut self, span: Span, at: usize) -> Result<TypeId> {
        let id = self.id(at);
        match self.module.definition(id) {
            Some(Definition::Type(ty)) => return Ok(ty),
            Some(_) => {}
            None => {
                if let Some(&opcode) = self.unknown.get(&id) {
                    let ty = self.push_type(id, Type::Other(opcode), TypeExtent::LEAF);
                    self.module.definitions.insert(id, Definition::Type(ty));
                    return Ok(ty);
                }
            }
        }
        Err(self.expected(span, at, "the id of a type"))
    }

    pub(super) fn push_type(&mut self, id: Id, ty: Type, extent: TypeExtent) -> TypeId {
        self.module.types.push(ty);
        self.module.type_ids.push(id);
        self.extents.push(extent);
        TypeId(self.module.types.len() as u32 - 1)
    }

    /// Defines the id at a word.
    pub(super) fn define(&mut self, at: usize, definition: Definition) -> Result<()> {
        let id = self.id(at);
        if id.0 == 0 || id.0 >= self.bound {
            return Err(invalid(
                at,
                format!("expected a result id from 1 to {}, found {}", self.bound - 1, id.0),
            ));
        }
        if self.module.definitions.insert(id, definition).is_some() {
            return Err(invalid(at, format!("%{} is defined twice", id.0)));
        }
        self.ids += 1;
        self.within(InputLimit::ModuleIds, self.ids, at)
    }

    /// Holds a number against a limit; the error stands at a word.
    pub(super) fn within(&self, limit: InputLimit, found: u64, at: usize) -> Result<()> {
        self.module
            .limits
            .check(limit, found, ErrorKind::UnsupportedModule)
            .map_err(|error| error.at(Place::Word(at)))
    }

    /// The error for an id that is not what is expected at its word.
    #[cold]
    pub(super) fn expected(&self, span: Span, at: usize, what: &str) -> Error {
        invalid(
            at,
            format!("{}: expected {what}, found {}", span.opcode, self.module.describe_id(self.id(at))),
        )
    }
}

/// Whether the ids that an instruction of module scope names must be defined before it.
fn is_declaration(opcode: Opcode, known: &InstructionGrammar) -> bool {
    opcode != Opcode::TypeForwardPointer
        && (known.name.starts_with("Type")
            || known.is_constant
            || matches!(opcode, Opcode::Variable | Opcode::UntypedVariableKHR))
}

/// Whether an instruction of module scope is valid and ignored by this crate.
fn is_ignored(opcode: Opcode, known: &InstructionGrammar) -> bool {
    opcode == Opcode::SamplerImageAddressingModeNV
        || opcode == Opcode::AsmTargetINTEL
        || opcode == Opcode::AsmINTEL
        || ["Graph", "Alias", "Conditional"].iter().any(|start| known.name.starts_with(start))
}
