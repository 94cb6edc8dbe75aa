//! Lowers an entry point to a [`Program`].
//!
//! Functions are inlined where they are small or called once, so that pointers to a caller's
//! variables point to known registers; large ones called from several places become real calls.
//! Blocks are laid out in structured order, in which lanes reconverge (see
//! [`Batch`](crate::machine::Batch)). Phis become moves on the edges.

mod branch;
mod call;
mod reference;
mod steps;

use std::collections::VecDeque;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::machine::{BlockIndex, Exit, OpIndex, Reg};
use crate::module::constant::ConstantValue;
use crate::module::interface::{EntryPoint, InterfaceVariable, Stage};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Function, Id, Instruction, Module, Opcode};
use crate::ops::float_controls::FloatControls;
use crate::ops::op::Op;
use crate::ops::pointer::{Pointer, PointerBase, storage};
use crate::ops::translate::{IdValue, Origin, Translator};
use crate::ops::value_registers::Words;
use crate::ops::{
    constant, interface_check, layout_check, load_store, memory, object, ray_query, translate_checked,
};
use crate::program::call_graph::{InlineCost, inline_costs};
use crate::program::control_flow::{escaping_values, structured_order};
use crate::program::copy_propagation::{live_stores, propagate_copies};
use crate::program::dce::eliminate_dead_code;
use crate::program::payload::Payloads;
use crate::program::race_analysis::accesses;
use crate::program::regalloc::{allocate_registers, superblocks};
use crate::program::verify::{Verifier, Version};
use crate::program::workgroup::{DerivativeGroup, WorkgroupLayout};
use crate::program::{
    Block, Eliminated, InstructionSpan, LoopVariable, OptimizedCode, Program, Scope, Terminator,
};
use anyhit_base::error::{Error, ErrorKind, Place, Result};

/// `OpacityMicromapIdKHR`
const OPACITY_MICROMAP_ID: u32 = 6031;
/// Functions of at most this many instructions, callees included, are inlined at every call.
const INLINE_SIZE: u64 = 2_000;
/// Beyond this many instructions only functions that are called once are inlined.
const INLINE_TOTAL: usize = 400_000;
/// Calls are inlined up to this depth.
const INLINE_DEPTH: usize = 48;

/// Which calls are inlined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inlining {
    /// Calls of functions that are small or called once.
    #[default]
    WhereProfitable,
    /// No calls. Results do not change.
    Never,
}

/// How much a program is optimized.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Optimization {
    /// Every pass runs.
    #[default]
    Full,
    /// No pass runs: no value is forwarded from a store to a load, no expression is folded, nothing
    /// is eliminated, no registers are shared, no superinstruction is formed. Results do not
    /// change. This is the reference that the optimizer is checked against.
    None,
    /// As [`Optimization::None`]; operations of specialization constants are executed, too, where
    /// an instruction uses the constant, and everything may trap. This is what the sanitizer
    /// observes.
    Sanitized,
}

/// How an entry point is lowered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LowerOptions {
    /// Which calls are inlined.
    pub inlining: Inlining,
    /// Which passes run.
    pub optimization: Optimization,
    /// Whether each pass is checked ([`crate::program::verify`]), which takes longer than all of
    /// them; the default in debug builds. Panics if a pass breaks the program.
    pub verify: bool,
}

impl Default for LowerOptions {
    fn default() -> Self {
        Self {
            inlining: Inlining::default(),
            optimization: Optimization::default(),
            verify: cfg!(debug_assertions),
        }
    }
}

/// Lowers an entry point of a module.
///
/// # Errors
/// `InvalidModule` or `UnsupportedModule` about the first instruction that cannot be lowered.
pub fn lower(module: &Arc<Module>, entry: &EntryPoint) -> Result<Program> {
    lower_with(module, entry, LowerOptions::default())
}

/// Lowers an entry point of a module with options.
///
/// # Errors
/// As [`lower`].
pub fn lower_with(module: &Arc<Module>, entry: &EntryPoint, options: LowerOptions) -> Result<Program> {
    match options.optimization {
        Optimization::Full => {
            let (mut program, addressed) = translate(module, entry, options)?;
            optimize(&mut program, &addressed, options.verify);
            Ok(program)
        }
        Optimization::None | Optimization::Sanitized => {
            let optimized = LowerOptions { optimization: Optimization::Full, ..options };
            lower_reference(&lower_with(module, entry, optimized)?, entry, options.optimization)
        }
    }
}

/// Lowers the entry point of an optimised program again, without any optimisation.
///
/// # Errors
/// As [`lower`].
pub(super) fn lower_reference(
    optimized: &Program,
    entry: &EntryPoint,
    optimization: Optimization,
) -> Result<Program> {
    let options = LowerOptions { inlining: optimized.inlining, optimization, ..LowerOptions::default() };
    let (mut program, _) = translate(&optimized.module, entry, options)?;
    reference::complete(&mut program, optimized);
    if optimization == Optimization::Sanitized {
        program.silent.fill(false);
    }
    Ok(program)
}

/// Translates an entry point; returns the unoptimized program, and the registers that computed
/// register numbers can address.
pub(super) fn translate(
    module: &Arc<Module>,
    entry: &EntryPoint,
    LowerOptions { inlining, optimization, .. }: LowerOptions,
) -> Result<(Program, Vec<(Reg, u32)>)> {
    if let Stage::Other(_) = entry.stage {
        let message = format!(
            "entry point `{}`: {} is neither a ray-tracing stage nor compute",
            entry.name,
            entry.stage.name()
        );
        return Err(Error::new(ErrorKind::UnsupportedModule, message).at(Place::Word(entry.offset as usize)));
    }
    let Some(Definition::Function(function)) = module.definition(entry.function) else {
        let message = format!("the function of entry point `{}` does not exist", entry.name);
        return Err(Error::new(ErrorKind::InvalidModule, message).at(Place::Word(entry.offset as usize)));
    };
    module.check_faults()?;
    layout_check::check(module)?;
    let mut lowering = Lowering {
        translator: Translator::new(module, entry.stage),
        module,
        block_of_label: Vec::new(),
        blocks: Vec::new(),
        instruction_spans: Vec::new(),
        terminators: Vec::new(),
        first: OpIndex(0),
        instructions: 0,
        scopes: vec![Scope { parent: 0, call: 0, function: entry.function }],
        depth: 0,
        inlining,
        inline_costs: inline_costs(module, function),
        called_functions: FxHashMap::default(),
        queue: VecDeque::new(),
        functions: vec![BlockIndex(0)],
        loop_variables: Vec::new(),
        watched: Vec::new(),
        without_step: None,
        executes_constants: optimization == Optimization::Sanitized && has_constant_operations(module),
    };
    lowering.translator.float_controls = FloatControls::of(entry);
    lowering.translator.optimizes = optimization == Optimization::Full;
    lowering.reserve_memory(function);
    let variables = module.interface_of(entry);
    interface_check::check(&mut lowering.translator, entry, &variables)?;
    lowering.translator.micromap_mode = entry.modes.iter().find_map(|(mode, operands)| match operands[..] {
        [id] if *mode == OPACITY_MICROMAP_ID => Some(Id(id)),
        _ => None,
    });
    lowering.translator.derivatives = entry.stage == Stage::Compute && DerivativeGroup::of(entry).is_some();
    let start = lowering.label();
    lowering.begin(start);
    lowering.initialize_globals(&variables)?;
    lowering.body(&module.functions[function as usize], &ReturnTarget::Entry)?;
    while let Some(function) = lowering.queue.pop_front() {
        lowering.lower_called_function(function)?;
    }
    let workgroup = match entry.stage {
        Stage::Compute => {
            refuse_pipeline_instructions(&lowering)?;
            Some(WorkgroupLayout::of(&mut lowering.translator, entry)?)
        }
        _ => None,
    };
    Ok(lowering.finish(module, entry, workgroup))
}

/// Runs the passes: eliminates dead code, analyses what is left, and makes the operations that run
/// without an observer.
fn optimize(program: &mut Program, addressed: &[(Reg, u32)], verify: bool) {
    let (operations, builtins) = (program.ops.len(), program.inputs.len());
    let pass = |program: &mut Program, name: &str, pass: &dyn Fn(&mut Program)| {
        let verifier = if verify { Verifier::new(program, addressed, None) } else { None };
        pass(program);
        if let Some(verifier) = verifier {
            expect_equivalent(program, name, verifier.compare(&Version::of(program), &|reg| reg));
        }
    };
    pass(program, "dead-code elimination", &|program| eliminate_dead_code(program, addressed, None));
    // Frees the memory of eliminated operations and unused capacity.
    program.ops.shrink_to_fit();
    program.origins.shrink_to_fit();
    program.blocks.shrink_to_fit();
    program.instruction_spans.shrink_to_fit();
    pass(program, "copy propagation", &|program| propagate_copies(program, addressed));
    pass(program, "dead-store elimination", &|program| {
        let stores = live_stores(program, addressed);
        eliminate_dead_code(program, addressed, stores.as_deref());
    });
    program.accesses = accesses(program);
    program.eliminated = Eliminated {
        operations: (operations - program.ops.len()) as u32,
        builtins: (builtins - program.inputs.len()) as u32,
    };
    program.payloads = Payloads::of(program, addressed);
    let superblocks = verify.then(|| superblocks(program));
    let verifier = superblocks.and_then(|superblocks| Verifier::new(program, addressed, Some(&superblocks)));
    let renamed = allocate_registers(program, addressed);
    if let Some(verifier) = verifier {
        let after = Version { ops: program.optimized.ops.clone(), ..Version::of(program) };
        let renamed = |reg: Reg| renamed.get(reg.0 as usize).copied().unwrap_or(reg);
        expect_equivalent(program, "register allocation", verifier.compare(&after, &renamed));
        if let Some(supercode) = &program.optimized.supercode {
            expect_equivalent(
                program,
                "superinstructions",
                verifier.compare_supercode(&after, &renamed, supercode),
            );
        }
    }
}

/// Panics where a pass has changed what a program does.
fn expect_equivalent(program: &Program, pass: &str, compared: std::result::Result<(), String>) {
    if let Err(problem) = compared {
        panic!("bug in anyhit: the pass `{pass}` changes what `{}` does: {problem}", program.name);
    }
}

/// Rejects instructions that only a ray-tracing pipeline can execute.
fn refuse_pipeline_instructions(lowering: &Lowering<'_>) -> Result<()> {
    let translator = &lowering.translator;
    let stop = translator.ops.iter().position(Op::calls_pipeline);
    let exits = lowering
        .blocks
        .iter()
        .any(|block| matches!(block.terminator, Terminator::Exit(Exit::Ignored | Exit::Terminated)));
    if stop.is_none() && !exits {
        return Ok(());
    }
    let error = translator.invalid("a GLCompute entry point executes a ray-tracing instruction");
    let location = stop.map(|at| Place::Word(translator.origins[at].offset as usize));
    Err(location
        .map_or(error.clone(), |location| error.at(location))
        .note("SPV_KHR_ray_tracing, execution models"))
}

/// A place that terminators branch to, made before its block is.
#[derive(Clone, Copy)]
struct Label(u32);

/// What a return does, in the function that is being lowered.
enum ReturnTarget {
    /// Ends the invocation.
    Entry,
    /// Continues in the caller; the value is left in registers.
    Inlined { label: Label, result: Words },
    /// Returns from a real call; the value is left in registers.
    Called { result: Words },
}

/// A function that is not inlined: its first block, and the registers through which callers pass
/// arguments and get the result.
#[derive(Clone)]
struct CalledFunction {
    label: Label,
    parameters: Vec<Words>,
    result: Words,
}

/// A lowering in progress. Its terminators name labels, which `finish` resolves to blocks.
struct Lowering<'m> {
    translator: Translator<'m>,
    module: &'m Module,
    /// By label: its block.
    block_of_label: Vec<BlockIndex>,
    blocks: Vec<Block<Label>>,
    instruction_spans: Vec<InstructionSpan>,
    /// By block: the instruction that its terminator comes from.
    terminators: Vec<Origin>,
    /// The first operation of the open block.
    first: OpIndex,
    /// How many instructions have been lowered.
    instructions: usize,
    scopes: Vec<Scope>,
    /// The depth of inlined calls.
    depth: usize,
    inlining: Inlining,
    /// By function index.
    inline_costs: Vec<InlineCost>,
    called_functions: FxHashMap<Id, CalledFunction>,
    /// Called functions that are not lowered yet.
    queue: VecDeque<Id>,
    /// The first block of each function that is lowered by itself.
    functions: Vec<BlockIndex>,
    loop_variables: Vec<LoopVariable>,
    watched: Vec<Reg>,
    /// The first instruction of a line none of whose instructions has become an operation so far,
    /// in a program that is not optimised.
    without_step: Option<Origin>,
    /// Whether operations of constants are executed where an instruction uses the constant.
    executes_constants: bool,
}

impl<'m> Lowering<'m> {
    /// Makes a new label.
    fn label(&mut self) -> Label {
        self.block_of_label.push(BlockIndex(u32::MAX));
        Label(self.block_of_label.len() as u32 - 1)
    }

    /// Reserves memory for about one operation per instruction and one block per four instructions,
    /// because growing copies everything.
    fn reserve_memory(&mut self, entry: u32) {
        let operations = self.inline_costs[entry as usize].instructions.min(INLINE_TOTAL as u64) as usize;
        self.translator.ops.reserve_exact(operations);
        self.translator.origins.reserve_exact(operations);
        self.blocks.reserve_exact(operations / 4);
        self.instruction_spans.reserve_exact(operations / 4);
    }

    /// Opens a block under a label.
    fn begin(&mut self, label: Label) {
        self.block_of_label[label.0 as usize] = self.open_block();
        self.first = OpIndex::new(self.translator.ops.len());
        self.translator.invalidate_known_values();
        self.translator.executed_constants.clear();
    }

    /// The open block.
    fn open_block(&self) -> BlockIndex {
        BlockIndex::new(self.blocks.len())
    }

    /// Closes the open block.
    fn end(&mut self, terminator: Terminator<Label>) {
        let end = OpIndex::new(self.translator.ops.len());
        self.blocks.push(Block { first: self.first, end, terminator, instructions: 0 });
        self.terminators.push(self.translator.origin);
    }

    /// Initialises variables of module scope that have an initialiser.
    fn initialize_globals(&mut self, reachable: &[InterfaceVariable]) -> Result<()> {
        let reachable: FxHashSet<Id> = reachable.iter().map(|variable| variable.id).collect();
        for index in 0..self.module.variables.len() {
            let variable = &self.module.variables[index];
            let Some(initializer) = variable.initializer.filter(|_| reachable.contains(&variable.id)) else {
                continue;
            };
            let pointer = self.translator.pointer(variable.id)?;
            object::check_copyable(&self.translator, pointer.pointee)?;
            let words = self.translator.words(initializer)?;
            if pointer.storage_class == storage::WORKGROUP {
                // Workgroup memory begins as zeros.
                if words.iter().all(|&word| self.translator.constant_word(word) == Some(0)) {
                    continue;
                }
                let message = "a variable in workgroup memory has an initializer other than null";
                return Err(self.translator.invalid(message).note("VUID-StandaloneSpirv-OpVariable-04734"));
            }
            if self.executes_constants {
                constant::execute(&mut self.translator, initializer)?;
            }
            load_store::store(&mut self.translator, &pointer, &words)?;
        }
        Ok(())
    }

    /// Executes the operations of the constants that an instruction uses, and of those that the
    /// phis of the only successor of its block take.
    fn execute_constants(&mut self, instruction: &Instruction, site: &Site<'_>) -> Result<()> {
        if instruction.opcode == Opcode::Phi {
            return Ok(());
        }
        let module = self.module;
        for id in module.operand_ids(instruction) {
            constant::execute(&mut self.translator, id)?;
        }
        if instruction.opcode != Opcode::Branch {
            return Ok(());
        }
        let target = module.operands(instruction).first().copied();
        let target = site.function.blocks.iter().find(|block| Some(block.label.0) == target);
        let phis = target.into_iter().flat_map(|block| &block.instructions);
        for phi in phis.take_while(|instruction| instruction.opcode == Opcode::Phi) {
            for incoming in module.operands(phi).chunks_exact(2).filter(|pair| pair[1] == site.block.0) {
                constant::execute(&mut self.translator, Id(incoming[0]))?;
            }
        }
        Ok(())
    }

    /// Lowers the blocks of a function into the open block and those after it.
    fn body(&mut self, function: &Function, return_target: &ReturnTarget) -> Result<()> {
        let module = self.module;
        let order = structured_order(module, function);
        if order.is_empty() {
            return Err(self.translator.unsupported(format!(
                "{} has no body: linked functions are not supported",
                module.describe_id(function.id)
            )));
        }
        let escaping = escaping_values(module, function, &order);
        let mut labels = vec![None; function.blocks.len()];
        order.iter().for_each(|&block| labels[block] = Some(self.label()));
        for &block in &order {
            // Gives phis their registers, which the edges to their block write.
            let instructions = function.blocks[block].instructions.iter();
            for phi in instructions.take_while(|instruction| instruction.opcode == Opcode::Phi) {
                self.translator.origin.offset = phi.offset;
                let ty = self.translator.result_type(phi)?;
                let count = self.translator.word_count(ty)?;
                let words = self.translator.fresh_words(count)?;
                if let Some(id) = phi.result {
                    self.watch(id, ty, words.iter().copied());
                }
                self.translator.define_result(phi, words);
            }
        }
        for (position, &block) in order.iter().enumerate() {
            let label = labels[block].expect("bug in anyhit: a block without a label");
            let block = &function.blocks[block];
            if position == 0 {
                // The function's first block continues the open block.
                self.block_of_label[label.0 as usize] = self.open_block();
            } else {
                self.begin(label);
            }
            for instruction in &block.instructions {
                self.open_step(instruction);
                self.translator.origin.offset = instruction.offset;
                let before = self.translator.ops.len();
                let site = Site { function, block: block.label, labels: &labels, return_target };
                self.instruction(instruction, &site)?;
                // Phis need no copy: edges write their registers for the running lanes only.
                let kept = instruction.result.filter(|id| escaping.contains(id));
                if let Some(id) = kept.filter(|_| instruction.opcode != Opcode::Phi) {
                    self.copy_masked(id)?;
                }
                self.close_step(instruction, before);
            }
        }
        Ok(())
    }

    /// Copies a value that outlives its loop to registers that only the running lanes write.
    fn copy_masked(&mut self, id: Id) -> Result<()> {
        match self.translator.value(id)? {
            IdValue::Words(words) => {
                let kept = self.copy_words_masked(&words)?;
                self.translator.define(id, IdValue::Words(kept));
            }
            IdValue::Pointer(pointer) => {
                let mut kept = pointer.clone();
                if let Some(index) = pointer.index {
                    kept.index = Some(self.copy_words_masked(&[index])?[0]);
                }
                match pointer.base {
                    PointerBase::Buffer(memory::BufferRef::Computed(handle)) => {
                        let handle = self.copy_words_masked(&[handle])?[0];
                        kept.base = PointerBase::Buffer(memory::BufferRef::Computed(handle));
                    }
                    PointerBase::Buffer(memory::BufferRef::Address(base)) => {
                        let base = self.copy_words_masked(&[base, base.plus(1)])?[0];
                        kept.base = PointerBase::Buffer(memory::BufferRef::Address(base));
                    }
                    _ => {}
                }
                self.translator.define(id, IdValue::Pointer(kept));
            }
        }
        Ok(())
    }

    fn copy_words_masked(&mut self, words: &[Reg]) -> Result<Words> {
        if words.iter().all(|&reg| self.translator.constant_word(reg).is_some()) {
            return Ok(words.into());
        }
        let kept = self.translator.fresh_words(words.len() as u32)?;
        for (&to, &from) in kept.iter().zip(words) {
            self.translator.emit(Op::Memory(memory::MemoryOp::MoveMasked { to, from }));
        }
        Ok(kept)
    }

    fn instruction(&mut self, instruction: &Instruction, site: &Site<'_>) -> Result<()> {
        self.translator.tick();
        self.record_instruction(instruction);
        if self.executes_constants {
            self.execute_constants(instruction, site)?;
        }
        match instruction.opcode {
            Opcode::Phi | Opcode::LoopMerge | Opcode::SelectionMerge => Ok(()),
            Opcode::Variable => self.variable(instruction),
            Opcode::FunctionCall => self.call(instruction),
            Opcode::IgnoreIntersectionNV => self.exit(Exit::Ignored),
            Opcode::TerminateRayNV => self.exit(Exit::Terminated),
            opcode if opcode.ends_block() => self.terminator(instruction, site),
            _ => translate_checked(&mut self.translator, instruction),
        }?;
        self.translator.check_operations()
    }

    /// Adds an instruction to the instruction spans of the open block.
    fn record_instruction(&mut self, instruction: &Instruction) {
        self.instructions += 1;
        let (block, scope) = (self.open_block(), self.translator.origin.scope);
        let offset = instruction.offset;
        match self.instruction_spans.last_mut() {
            Some(open) if (open.block, open.scope) == (block, scope) && open.last < offset => {
                open.last = offset;
                open.count += 1;
            }
            _ => self.instruction_spans.push(InstructionSpan {
                block,
                scope,
                first: offset,
                last: offset,
                count: 1,
            }),
        }
    }

    /// Ends the invocation in the middle of a block; what follows is never reached.
    fn exit(&mut self, exit: Exit) -> Result<()> {
        self.translator.set_clock()?;
        self.end(Terminator::Exit(exit));
        let label = self.label();
        self.begin(label);
        Ok(())
    }

    fn variable(&mut self, instruction: &Instruction) -> Result<()> {
        let ty = self.translator.result_type(instruction)?;
        let Type::Pointer { storage_class, pointee: Some(pointee), .. } = *self.module.ty(ty) else {
            return Err(self.translator.invalid("OpVariable has no pointer type"));
        };
        let count = self.translator.word_count(pointee)?;
        let first = self.translator.fresh(count)?;
        self.translator.variables.push((first, count));
        if let Some(id) = instruction.result {
            self.watch(id, pointee, (0..count).map(|word| first.plus(word)));
        }
        let base = PointerBase::Registers { first, count, constant: false };
        let pointer = Pointer::new(base, pointee, storage_class);
        // Each call of the function begins with a new query.
        if self.translator.origin.scope != 0 && is_query(self.module, pointee) {
            self.translator.emit(Op::RayQuery(ray_query::RayQueryOp::Uninitialize { first, count }));
        }
        if self.module.operands(instruction).len() > 1 {
            let initializer = self.translator.id(instruction, 1)?;
            let definition = self.module.definition(initializer);
            if self.translator.type_of(initializer)? != pointee
                || !matches!(definition, Some(Definition::Constant(_) | Definition::Variable(_)))
            {
                let message = "the initializer of a variable must be a constant or a variable of module \
                    scope, of the variable's type";
                return Err(self.translator.invalid(message).note("SPIR-V 3.3.8, \"OpVariable\""));
            }
            let words = self.translator.words(initializer)?;
            load_store::store(&mut self.translator, &pointer, &words)?;
        } else if !self.translator.optimizes {
            self.translator.emit(Op::Memory(memory::MemoryOp::Undefine { first, count }));
        }
        if let Some(id) = instruction.result {
            self.translator.define(id, IdValue::Pointer(pointer.into()));
        }
        Ok(())
    }

    /// Keeps the registers of a scalar or vector for the report of endless loops.
    fn watch(&mut self, id: Id, ty: TypeId, registers: impl ExactSizeIterator<Item = Reg>) {
        const MOST: usize = 4096;
        let count = registers.len();
        if LoopVariable::is_told(self.module, ty) && self.watched.len() + count <= MOST {
            let scope = self.translator.origin.scope;
            self.loop_variables.push(LoopVariable { id, ty, scope, first: self.watched.len(), count });
            self.watched.extend(registers);
        }
    }

    /// Returns the lowered program, and the registers that computed register numbers can address.
    fn finish(
        mut self,
        module: &Arc<Module>,
        entry: &EntryPoint,
        workgroup: Option<WorkgroupLayout>,
    ) -> (Program, Vec<(Reg, u32)>) {
        let block_of = |label: Label| self.block_of_label[label.0 as usize];
        let resolve = |Block { first, end, terminator, instructions }| {
            let terminator = Terminator::map(terminator, block_of);
            Block { first, end, terminator, instructions }
        };
        let mut blocks: Vec<Block> = self.blocks.into_iter().map(resolve).collect();
        let mut counts = vec![0u32; blocks.len()];
        for span in &self.instruction_spans {
            counts[span.block.index()] += span.count;
        }
        let mut instructions = 0u32;
        for (block, count) in blocks.iter_mut().zip(counts) {
            instructions = instructions.saturating_add(count);
            block.instructions = instructions;
        }
        let ends = self.functions[1..].iter().copied().chain([BlockIndex::new(blocks.len())]);
        let until = |block: BlockIndex| block.previous().map_or(0, |last| blocks[last.index()].instructions);
        let functions =
            self.functions.iter().zip(ends).map(|(&first, end)| (first, until(end) - until(first))).collect();
        let constants = self.translator.constant_registers().collect();
        let register_count = self.translator.register_count();
        let id_values = self.translator.take_id_values();
        let program = Program {
            module: module.clone(),
            stage: entry.stage,
            name: entry.name.clone(),
            inlining: self.inlining,
            ops: self.translator.ops,
            silent: Vec::new(),
            optimized: OptimizedCode::default(),
            origins: [self.translator.origins, self.terminators].concat(),
            scopes: self.scopes,
            blocks,
            instruction_spans: self.instruction_spans,
            functions,
            loop_variables: self.loop_variables,
            watched: self.watched.into(),
            register_count,
            constants,
            undefined_constants: self.translator.undefined_constants,
            constant_operations: self.translator.constant_operations,
            slots: self.translator.slots,
            inputs: self.translator.inputs,
            interface: self.translator.interface,
            variables: self.translator.variables,
            order_dependent: false,
            accesses: Vec::new(),
            uses_subgroups: false,
            workgroup,
            workgroup_variables: self.translator.workgroup_variables,
            addresses_records: false,
            eliminated: Eliminated::default(),
            payloads: Payloads::default(),
            id_values,
        };
        (program, self.translator.addressed)
    }
}

/// Whether a module has constants that are results of operations.
fn has_constant_operations(module: &Module) -> bool {
    module.constants.iter().any(|constant| matches!(constant.value, ConstantValue::Operation { .. }))
}

/// Whether a type is a ray query or an array of them.
fn is_query(module: &Module, mut ty: TypeId) -> bool {
    while let Type::Array { element, .. } = *module.ty(ty) {
        ty = element;
    }
    matches!(module.ty(ty), Type::RayQuery)
}

/// The function, block and labels that a terminator is lowered with.
struct Site<'a> {
    function: &'a Function,
    block: Id,
    /// By block index in the function: its label, if the block is reachable.
    labels: &'a [Option<Label>],
    return_target: &'a ReturnTarget,
}
