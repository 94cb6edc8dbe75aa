//! A module's words, read for the evaluator.

use std::collections::HashMap;

use rspirv::spirv::{BuiltIn, Decoration, Op, StorageClass};

pub type Id = u32;

#[derive(Clone, Debug, PartialEq)]
pub enum Type {
    Void,
    Bool,
    Int(u32, bool),
    Float(u32),
    Vector(Id, u32),
    Matrix(Id, u32),
    Array(Id, u32, u32),
    Runtime(Id, u32),
    Struct(Vec<Id>),
    Pointer(StorageClass, Id),
    Function,
}

/// A scalar: its bits, unless it is undefined.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Cell {
    pub bits: u64,
    pub defined: bool,
}

/// An instruction: its words.
#[derive(Clone, Copy, Debug)]
pub struct Code {
    pub op: Op,
    pub start: u32,
    pub count: u32,
}

#[derive(Clone, Copy, Debug)]
pub struct Variable {
    pub class: StorageClass,
    pub pointee: Id,
    pub initializer: Option<Id>,
    /// The first cell in its memory.
    pub cells: u32,
    pub binding: Option<u32>,
    pub builtin: Option<BuiltIn>,
}

/// Where matrices lie: their stride, and whether by rows.
pub type MatrixLayout = Option<(u32, bool)>;

#[derive(Debug, Default)]
pub struct Read {
    pub words: Vec<u32>,
    pub code: Vec<Code>,
    pub types: Vec<Type>,
    /// How many cells a value of a type has.
    pub cells: Vec<u32>,
    /// By id: the type, and the first cell of the value; constants count by themselves.
    pub type_of: Vec<Id>,
    pub slot: Vec<u32>,
    pub is_constant: Vec<bool>,
    pub constants: Vec<Cell>,
    pub value_cells: u32,
    pub labels: Vec<u32>,
    /// Of functions: the first instruction behind `OpFunction`.
    pub functions: HashMap<Id, u32>,
    pub variables: HashMap<Id, Variable>,
    pub function_variables: HashMap<Id, Vec<Id>>,
    /// Cells of an invocation's own memory, and of a workgroup's.
    pub own_cells: u32,
    pub workgroup_cells: u32,
    pub offsets: HashMap<(Id, u32), u32>,
    pub matrices: HashMap<(Id, u32), (u32, bool)>,
    /// By id of a pointer: how the matrix that it points to or into lies.
    pub pointer_layout: HashMap<Id, MatrixLayout>,
    pub entry: Id,
    pub local_size: u32,
}

/// Reads a module with one entry point.
pub fn read(words: &[u32]) -> Read {
    let bound = words[3] as usize;
    let mut read = Read {
        words: words.to_vec(),
        type_of: vec![0; bound],
        types: vec![Type::Void; bound],
        cells: vec![0; bound],
        slot: vec![0; bound],
        is_constant: vec![false; bound],
        labels: vec![0; bound],
        ..Read::default()
    };
    let mut strides = HashMap::new();
    let mut bindings = HashMap::new();
    let mut builtins = HashMap::new();
    let mut function = None;
    let mut at = 5;
    while at < words.len() {
        let count = (words[at] >> 16) as usize;
        let op = Op::from_u32(words[at] & 0xFFFF).expect("an opcode");
        let w = &words[at..at + count];
        match op {
            Op::EntryPoint => read.entry = w[2],
            Op::ExecutionMode if w[2] == 17 => read.local_size = w[3] * w[4] * w[5],
            Op::Decorate => match Decoration::from_u32(w[2]) {
                Some(Decoration::ArrayStride) => drop(strides.insert(w[1], w[3])),
                Some(Decoration::Binding) => drop(bindings.insert(w[1], w[3])),
                Some(Decoration::BuiltIn) => drop(builtins.insert(w[1], w[3])),
                _ => {}
            },
            Op::MemberDecorate => match Decoration::from_u32(w[3]) {
                Some(Decoration::Offset) => drop(read.offsets.insert((w[1], w[2]), w[4])),
                Some(Decoration::MatrixStride) => read.matrices.entry((w[1], w[2])).or_default().0 = w[4],
                Some(Decoration::RowMajor) => read.matrices.entry((w[1], w[2])).or_default().1 = true,
                _ => {}
            },
            Op::TypeVoid => read.declare(w[1], Type::Void, 0),
            Op::TypeBool => read.declare(w[1], Type::Bool, 1),
            Op::TypeInt => read.declare(w[1], Type::Int(w[2], w[3] == 1), 1),
            Op::TypeFloat => read.declare(w[1], Type::Float(w[2]), 1),
            Op::TypeVector => read.declare(w[1], Type::Vector(w[2], w[3]), w[3]),
            Op::TypeMatrix => read.declare(w[1], Type::Matrix(w[2], w[3]), w[3] * read.cells[w[2] as usize]),
            Op::TypeArray => {
                let count = read.constants[read.slot[w[3] as usize] as usize].bits as u32;
                let stride = strides.get(&w[1]).copied().unwrap_or_default();
                read.declare(w[1], Type::Array(w[2], count, stride), count * read.cells[w[2] as usize]);
            }
            Op::TypeRuntimeArray => read.declare(w[1], Type::Runtime(w[2], strides[&w[1]]), 0),
            Op::TypeStruct => {
                let cells = w[2..].iter().map(|member| read.cells[*member as usize]).sum();
                read.declare(w[1], Type::Struct(w[2..].to_vec()), cells);
            }
            Op::TypePointer => {
                read.declare(w[1], Type::Pointer(StorageClass::from_u32(w[2]).expect("a class"), w[3]), 1);
            }
            Op::TypeFunction => read.declare(w[1], Type::Function, 0),
            Op::ConstantTrue | Op::ConstantFalse => read.constant(w, &[u64::from(op == Op::ConstantTrue)]),
            Op::Constant => {
                let bits = u64::from(w[3]) | u64::from(w.get(4).copied().unwrap_or(0)) << 32;
                let width = match read.types[w[1] as usize] {
                    Type::Int(width, _) | Type::Float(width) => width,
                    _ => unreachable!("a constant's type"),
                };
                read.constant(w, &[bits & super::arithmetic::mask(width)]);
            }
            Op::ConstantNull => {
                let zeros = vec![0; read.cells[w[1] as usize] as usize];
                read.constant(w, &zeros);
            }
            Op::ConstantComposite => {
                let parts = w[3..].iter().flat_map(|&part| read.constant_cells(part)).collect::<Vec<_>>();
                read.constant_of(w, &parts);
            }
            Op::Undef if function.is_none() => {
                let unknown = vec![Cell::default(); read.cells[w[1] as usize] as usize];
                read.constant_of(w, &unknown);
            }
            Op::Variable => {
                let Type::Pointer(class, pointee) = read.types[w[1] as usize] else {
                    unreachable!("a pointer")
                };
                let memory = match class {
                    StorageClass::Function | StorageClass::Private => Some(&mut read.own_cells),
                    StorageClass::Workgroup => Some(&mut read.workgroup_cells),
                    _ => None,
                };
                let size = read.cells[pointee as usize];
                let cells = memory.map_or(0, |memory| {
                    *memory += size;
                    *memory - size
                });
                let builtin = builtins.get(&w[2]).and_then(|&builtin| BuiltIn::from_u32(builtin));
                let binding = bindings.get(&w[2]).copied();
                let initializer = w.get(4).copied();
                read.variables
                    .insert(w[2], Variable { class, pointee, initializer, cells, binding, builtin });
                let pointer = [Cell { bits: u64::from(w[2]) << 32, defined: true }];
                read.constant_of(w, &pointer);
                if let Some(function) = function {
                    read.function_variables.entry(function).or_default().push(w[2]);
                }
            }
            Op::Function => {
                function = Some(w[2]);
                read.functions.insert(w[2], read.code.len() as u32);
                read.type_of[w[2] as usize] = w[1];
            }
            Op::Label => read.labels[w[1] as usize] = read.code.len() as u32,
            _ => {}
        }
        if function.is_some() && !matches!(op, Op::Function | Op::Variable | Op::FunctionEnd) {
            read.code.push(Code { op, start: at as u32, count: count as u32 });
            if has_result(op) {
                read.type_of[w[2] as usize] = w[1];
                read.slot[w[2] as usize] = read.value_cells;
                read.value_cells += read.cells[w[1] as usize];
            }
            if matches!(op, Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject) {
                let layout = read.layout_behind(w);
                read.pointer_layout.insert(w[2], layout);
            }
        }
        at += count;
    }
    read
}

/// Whether an instruction in a function has a type and a result.
pub fn has_result(op: Op) -> bool {
    !matches!(
        op,
        Op::Label
            | Op::Branch
            | Op::BranchConditional
            | Op::Switch
            | Op::Return
            | Op::ReturnValue
            | Op::Unreachable
            | Op::Store
            | Op::CopyMemory
            | Op::AtomicStore
            | Op::ControlBarrier
            | Op::MemoryBarrier
            | Op::SelectionMerge
            | Op::LoopMerge
            | Op::Line
            | Op::NoLine
            | Op::Nop
    )
}

impl Read {
    fn declare(&mut self, id: Id, ty: Type, cells: u32) {
        self.types[id as usize] = ty;
        self.cells[id as usize] = cells;
    }

    fn constant(&mut self, w: &[u32], bits: &[u64]) {
        let cells: Vec<Cell> = bits.iter().map(|&bits| Cell { bits, defined: true }).collect();
        self.constant_of(w, &cells);
    }

    fn constant_of(&mut self, w: &[u32], cells: &[Cell]) {
        let id = w[2] as usize;
        self.type_of[id] = w[1];
        self.is_constant[id] = true;
        self.slot[id] = self.constants.len() as u32;
        self.constants.extend(cells);
    }

    pub fn constant_cells(&self, id: Id) -> Vec<Cell> {
        let start = self.slot[id as usize] as usize;
        self.constants[start..start + self.cells[self.type_of[id as usize] as usize] as usize].to_vec()
    }

    /// How the matrix lies that an access chain leads to or into.
    fn layout_behind(&self, w: &[u32]) -> MatrixLayout {
        let mut layout = self.pointer_layout.get(&w[3]).copied().flatten();
        let Some(Type::Pointer(_, mut ty)) = Some(self.types[self.type_of[w[3] as usize] as usize].clone())
        else {
            return None;
        };
        for &index in &w[4..] {
            ty = match &self.types[ty as usize] {
                Type::Struct(members) => {
                    let member = self.constants[self.slot[index as usize] as usize].bits as u32;
                    layout = self.matrices.get(&(ty, member)).copied();
                    members[member as usize]
                }
                Type::Vector(of, _) | Type::Matrix(of, _) | Type::Array(of, _, _) | Type::Runtime(of, _) => {
                    *of
                }
                _ => unreachable!("an index into a scalar"),
            };
        }
        layout
    }
}
