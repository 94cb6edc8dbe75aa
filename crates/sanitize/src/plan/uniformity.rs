//! What must be the same in all lanes of a subgroup where an operation accesses memory: the
//! resource of an access whose operand is not decorated `NonUniform`, and indices into push
//! constants.

use std::cell::OnceCell;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::plan::instruction::InstructionWords;
use anyhit_engine::machine::Reg;
use anyhit_engine::machine::object::ObjectRef;
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Definition, Id, Module, Opcode};
use anyhit_engine::ops::memory::{BufferRef, Chunk};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::shared_access::{SharedPart, SharedUse};
use anyhit_engine::program::Program;

/// `UniformBufferArrayNonUniformIndexing`
const UNIFORM_BUFFER_INDEXING: u32 = 5306;
/// `SampledImageArrayNonUniformIndexing`
const SAMPLED_IMAGE_INDEXING: u32 = 5307;
/// `StorageBufferArrayNonUniformIndexing`
const STORAGE_BUFFER_INDEXING: u32 = 5308;
/// `StorageImageArrayNonUniformIndexing`
const STORAGE_IMAGE_INDEXING: u32 = 5309;
/// `UniformTexelBufferArrayNonUniformIndexing`
const UNIFORM_TEXEL_BUFFER_INDEXING: u32 = 5311;
/// `StorageTexelBufferArrayNonUniformIndexing`
const STORAGE_TEXEL_BUFFER_INDEXING: u32 = 5312;

/// What must be the same in all lanes of a subgroup where an operation accesses memory.
#[derive(Clone, Debug, PartialEq)]
pub enum Uniformity {
    /// Which resources they are, as the operands that stand for them are not decorated.
    Resources {
        /// What the operation does with them.
        does: &'static str,
        /// The operands.
        operands: Box<[ResourceOperand]>,
    },
    /// The byte offset into the push constants.
    PushConstants(Reg),
    /// Which hit object of an array.
    HitObjects(Reg),
}

/// An operand that stands for a resource, and must be the same as it is not decorated
/// `NonUniform`, or as its module lacks a capability.
#[derive(Clone, Debug, PartialEq)]
pub struct ResourceOperand {
    /// The operand.
    pub id: Id,
    /// Why it must be the same.
    pub reason: UniformReason,
    /// Whether it is made of data of the shader record.
    pub from_record: bool,
    /// The first register that says which resource it is.
    pub register: Reg,
    /// One register for a handle, two for an acceleration structure.
    pub words: u32,
}

/// Why an operand that stands for a resource must be the same in all lanes of a subgroup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UniformReason {
    /// Nothing that it is made of is decorated `NonUniform`.
    Undecorated,
    /// This id is decorated, of which the operand is made, and not the operand.
    Misplaced(Id),
    /// The operand is decorated, and the module does not declare this capability.
    Capability(u32),
}

/// Finds out what must be uniform at the operations of a program.
#[derive(Debug)]
pub(super) struct UniformityPlan<'a> {
    program: &'a Program,
    constants: &'a FxHashMap<Reg, u32>,
    uses: OnceCell<Uses>,
}

impl<'a> UniformityPlan<'a> {
    /// Of a program and the values of its constant registers.
    pub(super) fn new(program: &'a Program, constants: &'a FxHashMap<Reg, u32>) -> Self {
        Self { program, constants, uses: OnceCell::new() }
    }

    /// What must be uniform at an operation; `None` where nothing need be, or constants see to it.
    pub(super) fn of(&self, op: &Op, instruction: InstructionWords<'a>) -> Option<Uniformity> {
        if let Some((_, &Chunk { buffer: BufferRef::PushConstants, index: Some(index), .. })) =
            op.buffer_load()
        {
            let pointer = access_operand(&self.program.module, op, instruction)?;
            return self.indexes_arrays_alone(pointer).then_some(Uniformity::PushConstants(index));
        }
        if let Some(index) = hit_object_index(op) {
            let pointer = hit_object_operand(&self.program.module, instruction)?;
            let is_element = self.definition(pointer).is_some_and(|made| made.opcode.selects_part());
            let must = is_element && self.source(pointer, |id| self.is_non_uniform(id)).is_none();
            if must {
                return Some(Uniformity::HitObjects(index));
            }
        }
        let (does, registers) = resource_registers(op)?;
        if registers.iter().flatten().all(|(register, _)| self.constants.contains_key(register)) {
            return None;
        }
        let access = access_operand(&self.program.module, op, instruction)?;
        let mut operands: Vec<ResourceOperand> = Vec::new();
        for (half, (register, words)) in registers.into_iter().flatten().enumerate() {
            let id = if words == 1 { self.half_of_sampled_image(access, half) } else { access };
            let is_new = operands.iter().all(|operand| operand.register != register);
            if is_new
                && !self.constants.contains_key(&register)
                && let Some(reason) = self.reason(access, id)
            {
                let from_record = !matches!(reason, UniformReason::Capability(_))
                    && self.source(id, |id| self.is_shader_record(id)).is_some();
                operands.push(ResourceOperand { id, reason, from_record, register, words });
            }
        }
        (!operands.is_empty()).then(|| Uniformity::Resources { does, operands: operands.into() })
    }

    /// The image or sampler that `OpSampledImage` makes an operand of; any other operand itself.
    fn half_of_sampled_image(&self, operand: Id, half: usize) -> Id {
        let definition = self.definition(operand);
        let made = definition.filter(|made| made.opcode == Opcode::SampledImage);
        made.and_then(|made| made.words.get(3 + half)).map_or(operand, |&id| Id(id))
    }

    /// Why an operand must be uniform; `access` is it, or the sampled image that it is half of.
    fn reason(&self, access: Id, operand: Id) -> Option<UniformReason> {
        if [access, operand].iter().any(|&id| self.is_non_uniform(id)) {
            let capability = self.indexing_capability(operand)?;
            let lacks = !self.program.module.capabilities.contains(&capability);
            return lacks.then_some(UniformReason::Capability(capability));
        }
        let decorated = self.source(operand, |id| self.is_non_uniform(id));
        Some(decorated.map_or(UniformReason::Undecorated, UniformReason::Misplaced))
    }

    /// The capability without which descriptors of an operand's kind are indexed uniformly; `None`
    /// for kinds that have none.
    fn indexing_capability(&self, operand: Id) -> Option<u32> {
        /// `DimBuffer`
        const BUFFER: u32 = 5;
        /// `ImageType::sampled` of storage images
        const STORAGE: u32 = 2;
        let module = &self.program.module;
        let mut ty = module.type_of(operand)?;
        if let Some(texel) = self.definition(operand)
            && texel.opcode == Opcode::ImageTexelPointer
        {
            ty = module.pointee(Id(*texel.words.get(3)?))?;
        }
        match module.ty(ty) {
            Type::Image(image) => Some(match (image.dim, image.sampled) {
                (BUFFER, STORAGE) => STORAGE_TEXEL_BUFFER_INDEXING,
                (BUFFER, _) => UNIFORM_TEXEL_BUFFER_INDEXING,
                (_, STORAGE) => STORAGE_IMAGE_INDEXING,
                _ => SAMPLED_IMAGE_INDEXING,
            }),
            Type::Sampler | Type::SampledImage(_) => Some(SAMPLED_IMAGE_INDEXING),
            Type::Pointer { storage_class: storage::STORAGE_BUFFER, .. } => Some(STORAGE_BUFFER_INDEXING),
            Type::Pointer { storage_class: storage::UNIFORM, .. } => {
                let is_buffer_block =
                    module.pointee(self.root(operand)).is_some_and(|ty| is_buffer_block(module, ty));
                Some(if is_buffer_block { STORAGE_BUFFER_INDEXING } else { UNIFORM_BUFFER_INDEXING })
            }
            _ => None,
        }
    }

    /// The variable that a pointer is made from by access chains.
    fn root(&self, pointer: Id) -> Id {
        let mut at = pointer;
        while let Some(chain) = self.definition(at).and_then(InstructionWords::access_chain)
            && chain.element.is_none()
        {
            at = chain.base;
        }
        at
    }

    fn is_non_uniform(&self, id: Id) -> bool {
        self.program.module.decorations.find(id, number::NON_UNIFORM).is_some()
    }

    fn uses(&self) -> &Uses {
        self.uses.get_or_init(|| Uses::of(&self.program.module))
    }

    fn definition(&self, id: Id) -> Option<InstructionWords<'a>> {
        let offset = self.uses().definitions.get(&id)?;
        Some(InstructionWords::at(&self.program.module, *offset))
    }

    /// Whether an id is the variable of the shader record.
    fn is_shader_record(&self, id: Id) -> bool {
        let module = &self.program.module;
        let is_variable = matches!(module.definition(id), Some(Definition::Variable(_)));
        let ty = module.type_of(id).filter(|_| is_variable).map(|ty| module.ty(ty));
        matches!(ty, Some(&Type::Pointer { storage_class: storage::SHADER_RECORD_BUFFER, .. }))
    }

    /// An id of some kind that another is made of: an index, a pointer, the argument of a call.
    fn source(&self, id: Id, is_sought: impl Fn(Id) -> bool) -> Option<Id> {
        let mut seen = FxHashSet::default();
        let mut open = vec![id];
        while let Some(id) = open.pop() {
            if is_sought(id) {
                return Some(id);
            }
            if seen.insert(id) {
                self.add_sources(id, &mut open);
            }
        }
        None
    }

    fn add_sources(&self, id: Id, sources: &mut Vec<Id>) {
        let module = &self.program.module;
        // What variables hold, if they have no access chains.
        sources.extend(self.uses().stored.get(&id).into_iter().flatten());
        if let Some(Definition::Parameter(function, index)) = module.definition(id) {
            let calls = self.uses().calls.get(&module.functions[function as usize].id);
            for &call in calls.into_iter().flatten() {
                let argument = InstructionWords::at(module, call).words.get(4 + index as usize).copied();
                sources.extend(argument.map(Id));
            }
        }
        let Some(instruction) = self.definition(id) else { return };
        if let Some(chain) = instruction.access_chain() {
            sources.push(chain.base);
            sources.extend(chain.element);
            sources.extend(chain.indices.iter().map(|&id| Id(id)));
            return;
        }
        use Opcode as O;
        let operands = instruction.words.get(3..).unwrap_or_default();
        let ids = match instruction.opcode {
            O::Load | O::Image | O::CompositeExtract | O::ImageTexelPointer => {
                operands.get(..1).unwrap_or_default()
            }
            O::SampledImage
            | O::CopyObject
            | O::FreezeKHR
            | O::Bitcast
            | O::UConvert
            | O::SConvert
            | O::IAdd
            | O::ISub
            | O::IMul
            | O::UDiv
            | O::UMod
            | O::BitwiseAnd
            | O::BitwiseOr
            | O::ShiftLeftLogical
            | O::ShiftRightLogical
            | O::Select
            | O::Phi => operands,
            _ => &[],
        };
        sources.extend(ids.iter().map(|&id| Id(id)));
    }

    /// Whether all indices of a pointer that are not constant are those of arrays, and there is
    /// one.
    fn indexes_arrays_alone(&self, pointer: Id) -> bool {
        let mut arrays = false;
        let mut at = pointer;
        while let Some(made) = self.definition(at) {
            let Some(chain) = made.access_chain().filter(|chain| chain.element.is_none()) else {
                return false;
            };
            let module = &self.program.module;
            let Some(mut ty) = module.chain_type(chain) else { return false };
            for &index in chain.indices {
                let constant = module.constant_scalar(Id(index));
                let is_array = matches!(module.ty(ty), Type::Array { .. } | Type::RuntimeArray { .. });
                if constant.is_none() && !is_array {
                    return false;
                }
                arrays |= constant.is_none();
                let Some(part) = module.part(ty, constant) else { return false };
                ty = part;
            }
            at = chain.base;
        }
        arrays
    }
}

/// How the ids of a module are made of each other.
#[derive(Debug, Default)]
struct Uses {
    /// The offset of the instruction that an id is the result of.
    definitions: FxHashMap<Id, u32>,
    /// By pointer: what is stored through it.
    stored: FxHashMap<Id, Vec<Id>>,
    /// By function: the offsets of its calls.
    calls: FxHashMap<Id, Vec<u32>>,
}

impl Uses {
    fn of(module: &Module) -> Self {
        /// Words of a module's header.
        const HEADER: u32 = 5;
        let mut uses = Self::default();
        let mut offset = HEADER;
        while (offset as usize) < module.words.len() {
            let instruction = InstructionWords::at(module, offset);
            match (instruction.opcode, instruction.words) {
                (Opcode::Store, &[_, pointer, object, ..]) => {
                    uses.stored.entry(Id(pointer)).or_default().push(Id(object));
                }
                (Opcode::FunctionCall, &[_, _, _, function, ..]) => {
                    uses.calls.entry(Id(function)).or_default().push(offset);
                }
                _ => {}
            }
            // Variables are no more than what is stored to them.
            if let Some(result) = instruction.result(module)
                && instruction.opcode != Opcode::Variable
            {
                uses.definitions.insert(result, offset);
            }
            offset += (instruction.words.len() as u32).max(1);
        }
        uses
    }
}

/// Whether a type is a `BufferBlock`, or an array of them.
fn is_buffer_block(module: &Module, ty: TypeId) -> bool {
    match *module.ty(ty) {
        Type::Struct { buffer_block, .. } => buffer_block,
        Type::Array { element, .. } | Type::RuntimeArray { element, .. } => is_buffer_block(module, element),
        _ => false,
    }
}

/// The register of the index that chooses the hit object of an operation from an array.
fn hit_object_index(op: &Op) -> Option<Reg> {
    match op.hit_object()? {
        ObjectRef::Computed { index, .. } => Some(index),
        ObjectRef::Register(_) => None,
    }
}

/// The operand of an instruction that points to a hit object.
fn hit_object_operand(module: &Module, instruction: InstructionWords<'_>) -> Option<Id> {
    let points_to_one = |id: &Id| {
        module.pointee(*id).is_some_and(|pointee| matches!(module.ty(pointee), Type::HitObject { .. }))
    };
    instruction.words.get(1..)?.iter().map(|&word| Id(word)).find(points_to_one)
}

/// What an operation does with a resource, and the registers that say which it is.
#[allow(clippy::type_complexity, reason = "one register or two, as there are images with samplers")]
fn resource_registers(op: &Op) -> Option<(&'static str, [Option<(Reg, u32)>; 2])> {
    if let Some(structure) = op.traced_structure() {
        return Some(("trace rays in", [Some((structure, 2)), None]));
    }
    let mut found = None;
    op.shared_accesses(&mut |used, part| {
        let does = match used {
            SharedUse::Load => "read",
            SharedUse::Store => "write",
            SharedUse::Update(_) => "update",
        };
        found = match part {
            SharedPart::Bytes(chunk) => computed(chunk).map(|handle| (does, [Some((handle, 1)), None])),
            SharedPart::Texel(texel) => Some((does, [Some((texel.image, 1)), None])),
            SharedPart::Texels { image, sampler } => {
                sampler.map(|sampler| ("sample", [Some((image, 1)), Some((sampler, 1))]))
            }
        };
    });
    found
}

/// The register of a buffer's handle, where a shader computes it.
fn computed(chunk: &Chunk) -> Option<Reg> {
    match chunk.buffer {
        BufferRef::Computed(handle) => Some(handle),
        _ => None,
    }
}

/// The operand of an instruction that stands for the resource.
fn access_operand(module: &Module, op: &Op, instruction: InstructionWords<'_>) -> Option<Id> {
    use Opcode as O;
    let words = instruction.words;
    if op.traced_structure().is_some() {
        let is_structure = |id: &Id| {
            module.type_of(*id).is_some_and(|ty| matches!(module.ty(ty), Type::AccelerationStructure))
        };
        return words.get(1..)?.iter().map(|&word| Id(word)).find(is_structure);
    }
    let at = match instruction.opcode {
        O::Store | O::AtomicStore | O::ImageWrite => 1,
        O::CopyMemory | O::CopyMemorySized if op.buffer_store().is_some() => 1,
        O::CopyMemory | O::CopyMemorySized => 2,
        // `Frexp` and the like write through a pointer, too.
        O::ExtInst => return None,
        _ => 3,
    };
    words.get(at).map(|&word| Id(word))
}
