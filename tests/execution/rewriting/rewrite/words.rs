//! A SPIR-V module as instructions that know which of their words are ids: read, changed, written.
//!
//! Lines and debug scopes are no instructions here but belong to each instruction as its [`Place`],
//! so that whatever moves or is inserted keeps its `file:line`.

use std::collections::HashMap;
use std::sync::Arc;

use anyhit_engine::module::Opcode as Op;
use rspirv::dr;
use rspirv::grammar::{LogicalOperand, OperandKind, OperandQuantifier};
use rspirv::spirv;

/// One instruction. An id of 0 is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inst {
    /// The opcode.
    pub op: Op,
    /// The result type.
    pub ty: u32,
    /// The result id.
    pub id: u32,
    /// The words behind result type and result id.
    pub rest: Vec<u32>,
    /// Which of `rest` are ids.
    pub ids: Vec<u16>,
    /// The source line and the debug scope that hold here.
    pub place: Place,
}

/// What `OpLine`, `DebugLine` and `DebugScope` said last before an instruction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    line: Option<Arc<(Op, Vec<u32>)>>,
    scope: Option<Arc<(u32, Vec<u32>)>>,
}

/// A label and what follows it, up to and with the terminator.
#[derive(Clone, Debug)]
pub struct Block {
    /// `OpLabel`
    pub label: Inst,
    /// Phis first (or variables, in the first block), a terminator last.
    pub body: Vec<Inst>,
}

/// A function.
#[derive(Clone, Debug)]
pub struct Function {
    /// `OpFunction`
    pub head: Inst,
    /// Its `OpFunctionParameter`s.
    pub params: Vec<Inst>,
    /// Empty where it is only declared.
    pub blocks: Vec<Block>,
    end: Inst,
}

/// A module.
#[derive(Clone, Debug)]
pub struct Module {
    header: [u32; 5],
    /// Everything before the first type: capabilities, entry points, names, decorations.
    pub head: Vec<Inst>,
    /// Types, constants, global variables.
    pub globals: Vec<Inst>,
    /// The functions.
    pub functions: Vec<Function>,
    /// The next id that nothing uses.
    pub next_id: u32,
    /// The first id that the module did not use when it was read.
    pub first_id: u32,
    /// One more than the highest id in use.
    pub highest_id: u32,
}

impl Inst {
    /// An instruction; which words are ids is looked up. A switch has cases of 32 bits.
    pub fn new(op: Op, ty: u32, id: u32, rest: &[u32], place: &Place) -> Self {
        let mut inst = Self { op, ty, id, rest: rest.to_vec(), ids: Vec::new(), place: place.clone() };
        inst.ids = id_positions(op, rest, 1).unwrap_or_else(|| panic!("{op:?} {rest:?} breaks the grammar"));
        inst
    }

    /// The ids among the operands, without the result type.
    pub fn operands(&self) -> impl Iterator<Item = u32> + '_ {
        self.ids.iter().map(|at| self.rest[usize::from(*at)])
    }

    /// Changes ids among the operands.
    pub fn map_operands(&mut self, mut map: impl FnMut(u32) -> u32) {
        for at in &self.ids {
            let word = &mut self.rest[usize::from(*at)];
            *word = map(*word);
        }
    }

    /// Whether it ends its block.
    pub fn is_terminator(&self) -> bool {
        self.op.ends_block()
    }

    /// Whether it declares a merge.
    pub fn is_merge(&self) -> bool {
        matches!(self.op, Op::SelectionMerge | Op::LoopMerge)
    }
}

impl Block {
    /// The label's id.
    pub fn id(&self) -> u32 {
        self.label.id
    }

    /// Where instructions may begin to be inserted: behind phis and variables.
    pub fn start(&self) -> usize {
        let fixed = |inst: &Inst| matches!(inst.op, Op::Phi | Op::Variable | Op::ExtInst);
        let declares = |inst: &Inst| matches!(inst.op, Op::Phi | Op::Variable);
        // Debug instructions may stand between variables.
        let run = self.body.iter().take_while(|inst| fixed(inst)).count();
        self.body[..run].iter().rposition(declares).map_or(0, |last| last + 1)
    }

    /// Where its last instructions begin: the merge, where there is one, and the terminator.
    pub fn tail(&self) -> usize {
        let last = self.body.len() - 1;
        if last > 0 && self.body[last - 1].is_merge() { last - 1 } else { last }
    }

    /// The merge instruction.
    pub fn merge(&self) -> Option<&Inst> {
        self.body[self.tail()..].first().filter(|inst| inst.is_merge())
    }

    /// The terminator.
    pub fn terminator(&self) -> &Inst {
        self.body.last().expect("a block has a terminator")
    }

    /// The labels that the terminator names.
    pub fn successors(&self) -> Vec<u32> {
        let last = self.terminator();
        match last.op {
            Op::Branch => vec![last.rest[0]],
            Op::BranchConditional => last.rest[1..3].to_vec(),
            Op::Switch => last.ids[1..].iter().map(|at| last.rest[usize::from(*at)]).collect(),
            _ => Vec::new(),
        }
    }

    /// Changes labels that the terminator names.
    pub fn map_successors(&mut self, mut map: impl FnMut(u32) -> u32) {
        let last = self.body.last_mut().expect("a block has a terminator");
        let skip = usize::from(matches!(last.op, Op::BranchConditional | Op::Switch));
        if matches!(last.op, Op::Branch | Op::BranchConditional | Op::Switch) {
            for at in &last.ids[skip..] {
                let word = &mut last.rest[usize::from(*at)];
                *word = map(*word);
            }
        }
    }

    /// The leading phis.
    pub fn phis_mut(&mut self) -> impl Iterator<Item = &mut Inst> {
        self.body.iter_mut().filter(|inst| inst.op == Op::Phi)
    }
}

impl Function {
    /// A function of the given parts.
    pub fn new(head: Inst, params: Vec<Inst>, blocks: Vec<Block>) -> Self {
        let end = Inst::new(Op::FunctionEnd, 0, 0, &[], &Place::default());
        Self { head, params, blocks, end }
    }

    /// All instructions within blocks.
    pub fn insts(&self) -> impl Iterator<Item = &Inst> {
        self.blocks.iter().flat_map(|block| &block.body)
    }

    /// The words of an instruction, to change them.
    pub fn insts_mut(&mut self) -> impl Iterator<Item = &mut Inst> {
        self.blocks.iter_mut().flat_map(|block| &mut block.body)
    }
}

impl Module {
    /// Reads a module.
    ///
    /// # Errors
    /// What cannot be read, most likely an opcode that the grammar tables do not know.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        if !bytes.len().is_multiple_of(4) || bytes.len() < 20 {
            return Err("no module".into());
        }
        let words: Vec<u32> =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().expect("four"))).collect();
        if words[0] != spirv::MAGIC_NUMBER {
            return Err("no module in this byte order".into());
        }
        let header = [words[0], words[1], words[2], words[3], words[4]];
        let mut module = Self {
            header,
            head: Vec::new(),
            globals: Vec::new(),
            functions: Vec::new(),
            next_id: header[3],
            first_id: header[3],
            highest_id: header[3],
        };
        Reader::default().read(&words[5..], &mut module)?;
        Ok(module)
    }

    /// Writes it.
    pub fn bytes(&self) -> Vec<u8> {
        let mut writer = Writer { words: self.header.to_vec(), next: self.highest_id, ..Writer::default() };
        let debug = self.debug_set();
        writer.debug = debug;
        writer.void = self.globals.iter().find(|inst| inst.op == Op::TypeVoid).map_or(0, |inst| inst.id);
        for inst in self.head.iter().chain(&self.globals) {
            writer.inst(inst);
        }
        for function in &self.functions {
            writer.inst(&function.head);
            function.params.iter().for_each(|inst| writer.inst(inst));
            for block in &function.blocks {
                writer.inst(&block.label);
                block.body.iter().for_each(|inst| writer.inst(inst));
            }
            writer.inst(&function.end);
        }
        writer.words[3] = writer.next;
        writer.words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    /// The version, as the header has it.
    pub fn version(&self) -> u32 {
        self.header[1]
    }

    /// The id of the debug instructions' import.
    pub fn debug_set(&self) -> u32 {
        self.imported("NonSemantic.Shader.DebugInfo.100").unwrap_or(0)
    }

    /// The id of an import of extended instructions.
    pub fn imported(&self, name: &str) -> Option<u32> {
        let found = |inst: &&Inst| inst.op == Op::ExtInstImport && text(&inst.rest) == name;
        self.head.iter().find(found).map(|inst| inst.id)
    }

    /// All instructions, to change them.
    pub fn all_mut(&mut self) -> impl Iterator<Item = &mut Inst> {
        let functions = self.functions.iter_mut().flat_map(|function| {
            let blocks = function.blocks.iter_mut();
            let blocks = blocks.flat_map(|block| std::iter::once(&mut block.label).chain(&mut block.body));
            std::iter::once(&mut function.head).chain(&mut function.params).chain(blocks)
        });
        self.head.iter_mut().chain(&mut self.globals).chain(functions)
    }

    /// Changes every id, those of places too.
    pub fn map_ids(&mut self, map: impl Fn(u32) -> u32) {
        let one = |id: u32| if id == 0 { 0 } else { map(id) };
        for inst in self.all_mut() {
            inst.ty = one(inst.ty);
            inst.id = one(inst.id);
            inst.map_operands(one);
            if let Some(line) = &inst.place.line {
                let (op, mut words) = (**line).clone();
                // The file of an `OpLine`; all operands of a `DebugLine` are ids.
                let count = if op == Op::Line { 1 } else { words.len() };
                words[..count].iter_mut().for_each(|word| *word = one(*word));
                inst.place.line = Some(Arc::new((op, words)));
            }
            if let Some(scope) = &inst.place.scope {
                let (number, words) = &**scope;
                let words = words.iter().map(|word| one(*word)).collect();
                inst.place.scope = Some(Arc::new((*number, words)));
            }
        }
    }
}

/// A literal string's text.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    String::from_utf8_lossy(bytes.split(|byte| *byte == 0).next().unwrap_or_default()).into_owned()
}

/// `NonSemantic.Shader.DebugInfo.100`, by their numbers.
const DEBUG_SCOPE: u32 = 23;
const DEBUG_NO_SCOPE: u32 = 24;
const DEBUG_LINE: u32 = 103;
const DEBUG_NO_LINE: u32 = 104;

#[derive(Default)]
struct Reader {
    place: Place,
    /// Bits of integer types, types of values: what a switch needs to be told apart.
    widths: HashMap<u32, u32>,
    types: HashMap<u32, u32>,
}

impl Reader {
    fn read(&mut self, words: &[u32], module: &mut Module) -> Result<(), String> {
        let mut at = 0;
        while at < words.len() {
            let (count, number) = ((words[at] >> 16) as usize, words[at] & 0xFFFF);
            if count == 0 || at + count > words.len() {
                return Err("an instruction of no length".into());
            }
            let inst = self.inst(number, &words[at + 1..at + count])?;
            at += count;
            if !self.is_place(&inst, module.debug_set()) {
                let ends = inst.is_terminator();
                push(module, inst)?;
                if ends {
                    self.place = Place::default();
                }
            }
        }
        Ok(())
    }

    fn inst(&mut self, number: u32, words: &[u32]) -> Result<Inst, String> {
        let op = Op(number as u16);
        if !op.is_known() {
            return Err(format!("{op} is not in the tables"));
        }
        let has = |at: usize, kind| op.operands().get(at).is_some_and(|operand| operand.kind == kind);
        let has_type = has(0, OperandKind::IdResultType);
        let has_result = has(usize::from(has_type), OperandKind::IdResult);
        let results = usize::from(has_type) + usize::from(has_result);
        if words.len() < results {
            return Err(format!("{op} without its result"));
        }
        let ty = if has_type { words[0] } else { 0 };
        let id = if has_result { words[results - 1] } else { 0 };
        let rest = &words[results..];
        let wide = op == Op::Switch && {
            let ty = rest.first().and_then(|selector| self.types.get(selector));
            ty.and_then(|ty| self.widths.get(ty)).is_some_and(|width| *width > 32)
        };
        let ids = id_positions(op, rest, if wide { 2 } else { 1 })
            .ok_or_else(|| format!("{op} has operands that the tables do not know"))?;
        if op == Op::TypeInt {
            self.widths.insert(id, rest[0]);
        }
        self.types.insert(id, ty);
        Ok(Inst { op, ty, id, rest: rest.to_vec(), ids, place: self.place.clone() })
    }

    /// Whether an instruction only says where the next ones stand.
    fn is_place(&mut self, inst: &Inst, debug: u32) -> bool {
        let debug = (inst.op == Op::ExtInst && inst.rest[0] == debug).then(|| inst.rest[1]);
        match (inst.op, debug) {
            (Op::Line, _) => self.place.line = Some(Arc::new((Op::Line, inst.rest.clone()))),
            (Op::NoLine, _) | (_, Some(DEBUG_NO_LINE)) => self.place.line = None,
            (_, Some(DEBUG_LINE)) => {
                self.place.line = Some(Arc::new((Op::ExtInst, inst.rest[2..].to_vec())));
            }
            (_, Some(DEBUG_SCOPE)) => {
                self.place.scope = Some(Arc::new((DEBUG_SCOPE, inst.rest[2..].to_vec())));
            }
            (_, Some(DEBUG_NO_SCOPE)) => self.place.scope = None,
            _ => return false,
        }
        true
    }
}

/// Puts an instruction where it belongs.
fn push(module: &mut Module, inst: Inst) -> Result<(), String> {
    let Some(function) = module.functions.last_mut() else {
        if inst.op == Op::Function {
            module.functions.push(Function::new(inst, Vec::new(), Vec::new()));
        } else if module.globals.is_empty() && !inst.op.to_string().starts_with("OpType") {
            module.head.push(inst);
        } else {
            module.globals.push(inst);
        }
        return Ok(());
    };
    match inst.op {
        Op::Function => module.functions.push(Function::new(inst, Vec::new(), Vec::new())),
        Op::FunctionParameter => function.params.push(inst),
        Op::FunctionEnd => function.end = inst,
        Op::Label => function.blocks.push(Block { label: inst, body: Vec::new() }),
        _ => function.blocks.last_mut().ok_or("an instruction outside a block")?.body.push(inst),
    }
    Ok(())
}

#[derive(Default)]
struct Writer {
    words: Vec<u32>,
    place: Place,
    next: u32,
    debug: u32,
    void: u32,
}

impl Writer {
    fn inst(&mut self, inst: &Inst) {
        if inst.place.line != self.place.line && !matches!(inst.op, Op::FunctionEnd) {
            let debug =
                |line: &Option<Arc<(Op, Vec<u32>)>>| line.as_ref().is_some_and(|line| line.0 == Op::ExtInst);
            let early = matches!(inst.op, Op::Phi | Op::Variable | Op::Label | Op::FunctionParameter);
            match &inst.place.line {
                Some(line) if line.0 == Op::Line => self.raw(Op::Line, 0, 0, &line.1),
                // A debug line must not stand before a phi; it comes before the next that is none.
                _ if early && (debug(&inst.place.line) || debug(&self.place.line)) => {
                    return self.plain(inst);
                }
                Some(line) => self.extended(DEBUG_LINE, &line.1),
                None if debug(&self.place.line) => self.extended(DEBUG_NO_LINE, &[]),
                None => self.raw(Op::NoLine, 0, 0, &[]),
            }
            self.place.line = inst.place.line.clone();
        }
        let early = matches!(inst.op, Op::Phi | Op::Variable | Op::Label | Op::FunctionEnd);
        if inst.place.scope != self.place.scope && !early {
            match &inst.place.scope {
                Some(scope) => self.extended(scope.0, &scope.1),
                None => self.extended(DEBUG_NO_SCOPE, &[]),
            }
            self.place.scope = inst.place.scope.clone();
        }
        self.plain(inst);
    }

    fn plain(&mut self, inst: &Inst) {
        self.raw(inst.op, inst.ty, inst.id, &inst.rest);
        if inst.is_terminator() {
            self.place = Place::default();
        }
    }

    fn extended(&mut self, number: u32, operands: &[u32]) {
        self.next += 1;
        let operands = [&[self.debug, number], operands].concat();
        self.raw(Op::ExtInst, self.void, self.next - 1, &operands);
    }

    fn raw(&mut self, op: Op, ty: u32, id: u32, rest: &[u32]) {
        let results = [ty, id].into_iter().filter(|id| *id != 0);
        let count = 1 + results.clone().count() + rest.len();
        self.words.push((count as u32) << 16 | u32::from(op.0));
        self.words.extend(results);
        self.words.extend(rest);
    }
}

/// Which words behind the result are ids; `None` where the tables do not tell.
fn id_positions(op: Op, rest: &[u32], case_words: usize) -> Option<Vec<u16>> {
    let mut walk = Walk { rest, at: 0, ids: Vec::new() };
    if op == Op::Switch {
        walk.ids.extend([0, 1]);
        walk.ids.extend((2..rest.len()).skip(case_words).step_by(case_words + 1).map(|at| at as u16));
        return Some(walk.ids);
    }
    let operands = op.operands().iter();
    let behind = |operand: &&LogicalOperand| {
        !matches!(operand.kind, OperandKind::IdResultType | OperandKind::IdResult)
    };
    let operands: Vec<_> = operands.filter(behind).cloned().collect();
    if walk.operands(&operands).is_none() {
        // What an enumerant that the tables do not know brings along is ids here, literals there.
        let all_ids = matches!(op, Op::ExecutionModeId | Op::DecorateId);
        let literals = matches!(op, Op::ExecutionMode | Op::Decorate | Op::MemberDecorate);
        if all_ids {
            walk.ids.extend((2..rest.len()).map(|at| at as u16));
        }
        return (all_ids || literals).then_some(walk.ids);
    }
    if op == Op::HitObjectRecordFromQueryEXT && walk.at < rest.len() {
        // An optional operand of newer revisions.
        walk.operand(OperandKind::IdRef)?;
    }
    (walk.at == rest.len()).then_some(walk.ids)
}

struct Walk<'a> {
    rest: &'a [u32],
    at: usize,
    ids: Vec<u16>,
}

impl Walk<'_> {
    fn operands(&mut self, operands: &[LogicalOperand]) -> Option<()> {
        for operand in operands {
            match operand.quantifier {
                OperandQuantifier::One => self.operand(operand.kind)?,
                OperandQuantifier::ZeroOrOne if self.at == self.rest.len() => {}
                OperandQuantifier::ZeroOrOne => self.operand(operand.kind)?,
                OperandQuantifier::ZeroOrMore => {
                    while self.at < self.rest.len() {
                        self.operand(operand.kind)?;
                    }
                }
            }
        }
        Some(())
    }

    fn operand(&mut self, kind: OperandKind) -> Option<()> {
        use OperandKind as K;
        let word = *self.rest.get(self.at)?;
        let bits = |all: u32, of_bit: &dyn Fn(u32) -> Option<dr::Operand>| {
            let bits = (0..u32::BITS).map(|bit| 1 << bit).filter(|bit| all & bit != 0);
            let each = bits.map(|bit| Some(of_bit(bit)?.additional_operands()));
            Some(each.collect::<Option<Vec<_>>>()?.concat())
        };
        let more = match kind {
            K::IdRef | K::IdScope | K::IdMemorySemantics => {
                self.ids.push(self.at as u16);
                Vec::new()
            }
            K::PairIdRefIdRef => return self.pair(K::IdRef, K::IdRef),
            K::PairIdRefLiteralInteger => return self.pair(K::IdRef, K::LiteralInteger),
            K::PairLiteralIntegerIdRef => return self.pair(K::LiteralInteger, K::IdRef),
            K::LiteralContextDependentNumber => {
                self.at = self.rest.len();
                return Some(());
            }
            K::LiteralString => {
                while !self.rest.get(self.at)?.to_le_bytes().contains(&0) {
                    self.at += 1;
                }
                Vec::new()
            }
            K::LiteralSpecConstantOpInteger => {
                let operands = Op::of_operand(word).operands().iter();
                let behind =
                    |operand: &&LogicalOperand| !matches!(operand.kind, K::IdResultType | K::IdResult);
                operands.filter(behind).cloned().collect()
            }
            K::Decoration => {
                dr::Operand::Decoration(spirv::Decoration::from_u32(word)?).additional_operands()
            }
            K::ExecutionMode => {
                dr::Operand::ExecutionMode(spirv::ExecutionMode::from_u32(word)?).additional_operands()
            }
            K::ImageOperands => {
                bits(word, &|bit| spirv::ImageOperands::from_bits(bit).map(dr::Operand::ImageOperands))?
            }
            K::LoopControl => {
                bits(word, &|bit| spirv::LoopControl::from_bits(bit).map(dr::Operand::LoopControl))?
            }
            K::MemoryAccess => {
                bits(word, &|bit| spirv::MemoryAccess::from_bits(bit).map(dr::Operand::MemoryAccess))?
            }
            K::TensorAddressingOperands | K::TensorOperands => return None,
            _ => Vec::new(),
        };
        self.at += 1;
        self.operands(&more)
    }

    fn pair(&mut self, one: OperandKind, other: OperandKind) -> Option<()> {
        self.operand(one)?;
        self.operand(other)
    }
}
