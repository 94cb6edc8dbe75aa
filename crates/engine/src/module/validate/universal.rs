//! Capabilities that the specification requires in its text: sizes of numbers, types in storage
//! classes, pointers, images, atomics, scopes. The grammar does not encode them.

use rspirv::spirv::{Capability as C, StorageClass as S};
use rustc_hash::FxHashSet;
use smallvec::SmallVec;

use crate::module::grammar::{InstructionGrammar, is_id, walk};
use crate::module::span::Span;
use crate::module::ty::{ImageType, Type, TypeId};
use crate::module::validate::declared::{Declared, STORAGE_16_BIT};
use crate::module::validate::missing::{missing_capabilities, subject};
use crate::module::validate::{ValidationClass, ValidationFinding};
use crate::module::words::string;
use crate::module::{Definition, Id, Module, Opcode};

const UNIVERSAL: &str = "SPIR-V 2.16.1, Universal Validation Rules";
const STORAGE_8_BIT: &[C] = &[
    C::StorageBuffer8BitAccess,
    C::UniformAndStorageBuffer8BitAccess,
    C::StoragePushConstant8,
    C::WorkgroupMemoryExplicitLayout8BitAccessKHR,
];
const VARIABLE_POINTERS: &[C] = &[C::VariablePointers, C::VariablePointersStorageBuffer];

/// Extensions whose text requires a minor version of SPIR-V 1.
const EXTENSION_VERSIONS: &[(&str, u8)] = &[
    ("SPV_KHR_vulkan_memory_model", 3),
    ("SPV_KHR_workgroup_memory_explicit_layout", 4),
    ("SPV_EXT_mesh_shader", 4),
    ("SPV_NV_shader_invocation_reorder", 4),
    ("SPV_NV_cluster_acceleration_structure", 4),
    ("SPV_NV_linear_swept_spheres", 4),
];

/// Numbers of 8 and 16 bits that a type contains.
const INT8: u8 = 1;
const INT16: u8 = 2;
const FLOAT16: u8 = 4;

/// Checks instructions one after the other.
pub(super) struct Universal<'m> {
    module: &'m Module,
    declared: &'m Declared<'m>,
    /// By [`TypeId`]: which small numbers a value of the type, or what it points to, contains.
    small: Vec<u8>,
    /// The small numbers that are declared for memory alone: without arithmetic.
    restricted: u8,
    /// What was reported, so that each use is reported once.
    reported: FxHashSet<String>,
    pub(super) findings: Vec<ValidationFinding>,
}

impl<'m> Universal<'m> {
    pub(super) fn new(module: &'m Module, declared: &'m Declared<'m>) -> Self {
        let mut restricted = 0;
        for (bit, capability) in [(INT8, C::Int8), (INT16, C::Int16), (FLOAT16, C::Float16)] {
            if !declared.has(capability as u32) {
                restricted |= bit;
            }
        }
        let small = small_numbers(module);
        Self { module, declared, small, restricted, reported: FxHashSet::default(), findings: Vec::new() }
    }

    pub(super) fn instruction(&mut self, span: Span) {
        let Some(known) = InstructionGrammar::of(span.opcode) else { return };
        match span.opcode {
            Opcode::Extension => self.extension(span),
            Opcode::ExtInstImport => self.import(span),
            Opcode::Capability => self.capability(span),
            Opcode::TypeInt | Opcode::TypeFloat => self.number_type(span),
            Opcode::TypeImage => self.image_type(span),
            Opcode::TypeCooperativeMatrixKHR | Opcode::TypeCooperativeMatrixNV => self.matrix_type(span),
            Opcode::Variable | Opcode::UntypedVariableKHR => self.variable(span),
            Opcode::ImageRead | Opcode::ImageSparseRead => {
                self.image_access(span, self.word(span, 3), C::StorageImageReadWithoutFormat);
            }
            Opcode::ImageWrite => {
                self.image_access(span, self.word(span, 1), C::StorageImageWriteWithoutFormat)
            }
            Opcode::Phi | Opcode::Select => self.pointer_result(span),
            Opcode::PtrAccessChain | Opcode::InBoundsPtrAccessChain => self.pointer_access(span, 3),
            Opcode::UntypedPtrAccessChainKHR | Opcode::UntypedInBoundsPtrAccessChainKHR => {
                self.pointer_access(span, 4);
            }
            Opcode::PtrEqual | Opcode::PtrNotEqual | Opcode::PtrDiff => self.pointer_comparison(span),
            Opcode::FunctionCall => self.call(span),
            Opcode::SpecConstantOp => self.spec_constant_op(span),
            Opcode::ExtInst => self.extended(span),
            Opcode::Dot => self.dot(span),
            _ if known.name.starts_with("Atomic") => self.atomic(span, known.has_type),
            _ => {}
        }
        if self.restricted != 0 {
            self.small_result(span);
        }
    }

    /// Checks a memory scope.
    pub(super) fn scope(&mut self, span: Span, at: usize, scope: u32) {
        const DEVICE: u32 = 1;
        let Some(known) = InstructionGrammar::of(span.opcode) else { return };
        let executes = known.name.starts_with("Group")
            || known.name.starts_with("TypeCooperative")
            || span.opcode == Opcode::ReadClockKHR
            || span.opcode.is_control_barrier() && at == span.start + 1;
        if scope == DEVICE && !executes && self.declared.has(C::VulkanMemoryModel as u32) {
            let what = "the memory scope Device of the Vulkan memory model";
            self.require(span, what, &[C::VulkanMemoryModelDeviceScope], UNIVERSAL);
        }
    }

    fn extension(&mut self, span: Span) {
        let Some((name, _)) = string(&self.module.words[span.start + 1..span.end]) else { return };
        let Some((_, since)) = EXTENSION_VERSIONS.iter().find(|(known, _)| *known == name) else { return };
        if self.declared.version < *since {
            let message = format!("the extension {name} requires SPIR-V 1.{since}");
            let fix = format!("compile for SPIR-V 1.{since}");
            self.report(ValidationClass::Extension, span, (&name, &name), message, fix);
        }
    }

    fn import(&mut self, span: Span) {
        const EXTENSION: &str = "SPV_KHR_non_semantic_info";
        let Some((name, _)) = string(&self.module.words[span.start + 2..span.end]) else { return };
        let is_declared = self.declared.version > 5 || self.declared.has_any_extension(&[EXTENSION]);
        if name.starts_with("NonSemantic.") && !is_declared {
            let message = format!(
                "the instruction set {name} requires SPIR-V 1.6 or the extension {EXTENSION}, which the module \
                 does not declare"
            );
            let fix = format!("declare `OpExtension \"{EXTENSION}\"` or compile for SPIR-V 1.6");
            self.report(ValidationClass::Extension, span, (&name, EXTENSION), message, fix);
        }
    }

    fn capability(&mut self, span: Span) {
        let is_matrix = self.word(span, 1) == C::CooperativeMatrixKHR as u32;
        if is_matrix && self.declared.has(C::Shader as u32) {
            self.require(span, "CooperativeMatrixKHR", &[C::VulkanMemoryModel], "SPV_KHR_cooperative_matrix");
        }
    }

    fn number_type(&mut self, span: Span) {
        let Some(ty) = self.module.type_with_id(Id(self.word(span, 1))) else { return };
        match *self.module.ty(ty) {
            Type::Int { width: 8, .. } => {
                self.require(span, "OpTypeInt of 8 bits", &with(C::Int8, STORAGE_8_BIT), UNIVERSAL)
            }
            Type::Int { width: 16, .. } => {
                self.require_numbers(span, "OpTypeInt of 16 bits", &with_16_bit_storage(&[C::Int16]));
            }
            Type::Int { width: 64, .. } => self.require(span, "OpTypeInt of 64 bits", &[C::Int64], UNIVERSAL),
            Type::Float { width: 16, encoding: None } => {
                let by_extension = ["SPV_AMD_gpu_shader_half_float", "SPV_AMD_gpu_shader_half_float_fetch"];
                if !self.declared.has_any_extension(&by_extension) {
                    let capabilities = with_16_bit_storage(&[C::Float16, C::Float16Buffer]);
                    self.require_numbers(span, "OpTypeFloat of 16 bits", &capabilities);
                }
            }
            Type::Float { width: 64, .. } => {
                self.require(span, "OpTypeFloat of 64 bits", &[C::Float64], UNIVERSAL);
            }
            _ => {}
        }
    }

    fn image_type(&mut self, span: Span) {
        const SUBPASS_DATA: u32 = 6;
        const TILE_IMAGE_DATA: u32 = 4173;
        let Some(ty) = self.module.type_with_id(Id(self.word(span, 1))) else { return };
        let Type::Image(image) = *self.module.ty(ty) else { return };
        if matches!(self.module.ty(image.sampled_type), Type::Int { width: 64, .. }) {
            let what = "OpTypeImage with a sampled type of 64 bits";
            self.require(span, what, &[C::Int64ImageEXT], "SPV_EXT_shader_image_int64");
        }
        let is_attachment = matches!(image.dim, SUBPASS_DATA | TILE_IMAGE_DATA);
        if image.multisampled && image.sampled == 2 && !is_attachment {
            let what = "OpTypeImage of a multisampled storage image";
            self.require(
                span,
                what,
                &[C::StorageImageMultisample],
                "SPIR-V, capability StorageImageMultisample",
            );
        }
    }

    fn matrix_type(&mut self, span: Span) {
        let component = self.module.type_with_id(Id(self.word(span, 2)));
        match component.map(|ty| self.module.ty(ty)) {
            Some(Type::Float { width: 16, encoding: Some(_) }) => {
                let what = "a cooperative matrix of BFloat16KHR";
                self.require(span, what, &[C::BFloat16CooperativeMatrixKHR], "SPV_KHR_bfloat16");
            }
            Some(Type::Float { width: 8, .. }) => {
                let what = "a cooperative matrix of 8-bit floats";
                self.require(span, what, &[C::Float8CooperativeMatrixEXT], "SPV_EXT_float8");
            }
            _ => {}
        }
    }

    fn variable(&mut self, span: Span) {
        let class = self.word(span, 3);
        let pointee = match span.opcode {
            Opcode::UntypedVariableKHR => (span.start + 4 < span.end)
                .then(|| self.module.type_with_id(Id(self.word(span, 4))))
                .flatten(),
            _ => self.module.type_with_id(Id(self.word(span, 1))).and_then(|ty| self.pointee(ty)),
        };
        let Some(pointee) = pointee else { return };
        if let Type::RuntimeArray { .. } = self.module.ty(pointee) {
            let rule = "VUID-StandaloneSpirv-OpTypeRuntimeArray-04680";
            let what = "a variable that is a runtime array of descriptors";
            self.require(span, what, &[C::RuntimeDescriptorArray], rule);
        }
        self.small_variable(span, pointee, class);
    }

    /// A variable of 8- or 16-bit numbers without arithmetic on them needs the capability for its
    /// storage class.
    fn small_variable(&mut self, span: Span, pointee: TypeId, mut class: u32) {
        let restricted = self.small_of(pointee) & self.restricted;
        if restricted == 0 || !self.declared.has(C::Shader as u32) {
            return;
        }
        let mut inner = pointee;
        while let Type::Pointer { storage_class, pointee: Some(pointee), .. } = *self.module.ty(inner) {
            if pointee >= inner {
                break;
            }
            (class, inner) = (storage_class, pointee);
        }
        let inner = match *self.module.ty(inner) {
            Type::Array { element, .. } | Type::RuntimeArray { element, .. } => element,
            _ => inner,
        };
        let is_buffer_block = matches!(self.module.ty(inner), Type::Struct { buffer_block: true, .. });
        let is = |one: S| class == one as u32;
        if restricted & (INT16 | FLOAT16) != 0 {
            let arithmetic = if restricted & INT16 != 0 { C::Int16 } else { C::Float16 };
            let memory: &[C] = if is(S::StorageBuffer) || is(S::PhysicalStorageBuffer) {
                &[C::StorageBuffer16BitAccess]
            } else if is(S::Uniform) && is_buffer_block {
                &[C::UniformAndStorageBuffer16BitAccess, C::StorageBuffer16BitAccess]
            } else if is(S::Uniform) {
                &[C::UniformAndStorageBuffer16BitAccess]
            } else if is(S::PushConstant) {
                &[C::StoragePushConstant16]
            } else if is(S::Input) || is(S::Output) {
                &[C::StorageInputOutput16]
            } else if is(S::Workgroup) {
                &[C::WorkgroupMemoryExplicitLayout16BitAccessKHR]
            } else {
                &[]
            };
            self.require_storage(span, "16-bit", class, arithmetic, memory, "SPV_KHR_16bit_storage");
        }
        if restricted & INT8 != 0 {
            let memory: &[C] = if is(S::StorageBuffer) || is(S::PhysicalStorageBuffer) {
                &[C::StorageBuffer8BitAccess]
            } else if is(S::Uniform) && is_buffer_block {
                &[C::UniformAndStorageBuffer8BitAccess, C::StorageBuffer8BitAccess]
            } else if is(S::Uniform) {
                &[C::UniformAndStorageBuffer8BitAccess]
            } else if is(S::PushConstant) {
                &[C::StoragePushConstant8]
            } else if is(S::Workgroup) {
                &[C::WorkgroupMemoryExplicitLayout8BitAccessKHR]
            } else {
                &[]
            };
            self.require_storage(span, "8-bit", class, C::Int8, memory, "SPV_KHR_8bit_storage");
        }
    }

    fn require_storage(
        &mut self,
        span: Span,
        bits: &str,
        class: u32,
        arithmetic: C,
        memory: &[C],
        rule: &str,
    ) {
        let class = crate::module::names::storage_class_name(class);
        let what = format!("a variable with {bits} numbers in storage class {class}");
        self.require(span, &what, &with(arithmetic, memory), rule);
    }

    fn image_access(&mut self, span: Span, image: u32, without_format: C) {
        const DIM_1D: u32 = 0;
        const CUBE: u32 = 3;
        const RECT: u32 = 4;
        const BUFFER: u32 = 5;
        const SUBPASS_DATA: u32 = 6;
        let Some(ty) = self.module.type_of(Id(image)) else { return };
        let Type::Image(ImageType { dim, arrayed, multisampled, sampled, format, .. }) = *self.module.ty(ty)
        else {
            return;
        };
        let opcode = span.opcode;
        if sampled == 2 {
            let by_dimension = match dim {
                DIM_1D => Some(("1D", C::Image1D)),
                RECT => Some(("Rect", C::ImageRect)),
                BUFFER => Some(("Buffer", C::ImageBuffer)),
                CUBE if arrayed => Some(("Cube with layers", C::ImageCubeArray)),
                _ => None,
            };
            if let Some((dim, capability)) = by_dimension {
                let what = format!("{opcode} of a storage image of Dim {dim}");
                self.require(span, &what, &[capability], "SPIR-V 3.11, Dim");
            }
            if multisampled && arrayed {
                let what = format!("{opcode} of a multisampled storage image with layers");
                self.require(span, &what, &[C::ImageMSArray], "SPIR-V, capability ImageMSArray");
            }
        }
        if format == 0 && dim != SUBPASS_DATA {
            let what = format!("{opcode} of a storage image of Image Format Unknown");
            let rule = format!("SPIR-V, capability {without_format:?}");
            self.require(span, &what, &[without_format], &rule);
        }
    }

    fn is_logical(&self) -> bool {
        self.module.memory_model.0 == 0
    }

    /// The pointee of a pointer type.
    fn pointee(&self, ty: TypeId) -> Option<TypeId> {
        match *self.module.ty(ty) {
            Type::Pointer { pointee, .. } => pointee,
            _ => None,
        }
    }

    /// The storage class of a pointer.
    fn storage_class(&self, pointer: u32) -> Option<u32> {
        match *self.module.ty(self.module.type_of(Id(pointer))?) {
            Type::Pointer { storage_class, .. } => Some(storage_class),
            _ => None,
        }
    }

    fn pointer_result(&mut self, span: Span) {
        let ty = self.module.type_with_id(Id(self.word(span, 1)));
        let is_pointer = ty.is_some_and(|ty| matches!(self.module.ty(ty), Type::Pointer { .. }));
        if is_pointer && self.is_logical() {
            let what = format!("{} of pointers", span.opcode);
            self.require(span, &what, VARIABLE_POINTERS, UNIVERSAL);
        }
    }

    /// A step to another element of an array; the pointer is the word at `base`.
    fn pointer_access(&mut self, span: Span, base: usize) {
        let opcode = span.opcode;
        let steps = matches!(opcode, Opcode::PtrAccessChain | Opcode::UntypedPtrAccessChainKHR);
        if steps && self.is_logical() {
            self.require(span, &opcode.to_string(), VARIABLE_POINTERS, UNIVERSAL);
        }
        let class = self.storage_class(self.word(span, base));
        if steps && class == Some(S::Workgroup as u32) {
            let what = format!("{opcode} in Workgroup");
            self.require(span, &what, &[C::VariablePointers], "VUID-StandaloneSpirv-Base-07651");
        } else if steps && class == Some(S::StorageBuffer as u32) {
            let what = format!("{opcode} in StorageBuffer");
            self.require(span, &what, VARIABLE_POINTERS, "VUID-StandaloneSpirv-Base-07652");
        }
    }

    fn pointer_comparison(&mut self, span: Span) {
        if self.is_logical() {
            let opcode = span.opcode;
            self.require(span, &opcode.to_string(), VARIABLE_POINTERS, UNIVERSAL);
            if self.storage_class(self.word(span, 3)) == Some(S::Workgroup as u32) {
                let what = format!("{opcode} of pointers to Workgroup");
                self.require(span, &what, &[C::VariablePointers], UNIVERSAL);
            }
        }
    }

    fn call(&mut self, span: Span) {
        if !self.is_logical() {
            return;
        }
        for at in span.start + 4..span.end {
            if self.storage_class(self.module.words[at]) == Some(S::StorageBuffer as u32) {
                let what = "OpFunctionCall with a pointer to StorageBuffer";
                self.require(span, what, VARIABLE_POINTERS, UNIVERSAL);
            }
        }
    }

    fn spec_constant_op(&mut self, span: Span) {
        let inner = Opcode::of_operand(self.word(span, 3));
        if !inner.is_known() {
            return;
        }
        let what = format!("OpSpecConstantOp of {inner}");
        let rule = "SPIR-V, OpSpecConstantOp";
        match inner {
            Opcode::QuantizeToF16 => self.require(span, &what, &[C::Shader], rule),
            Opcode::UConvert => {
                let is_allowed = self.declared.version >= 4
                    || self.declared.has_any_extension(&["SPV_AMD_gpu_shader_int16"]);
                if !is_allowed {
                    self.require(span, &what, &[C::Kernel], rule);
                }
            }
            Opcode::ConvertFToS
            | Opcode::ConvertSToF
            | Opcode::ConvertFToU
            | Opcode::ConvertUToF
            | Opcode::ConvertPtrToU
            | Opcode::ConvertUToPtr
            | Opcode::GenericCastToPtr
            | Opcode::PtrCastToGeneric
            | Opcode::Bitcast
            | Opcode::FNegate
            | Opcode::FAdd
            | Opcode::FSub
            | Opcode::FMul
            | Opcode::FDiv
            | Opcode::FRem
            | Opcode::FMod
            | Opcode::AccessChain
            | Opcode::InBoundsAccessChain
            | Opcode::PtrAccessChain
            | Opcode::InBoundsPtrAccessChain => self.require(span, &what, &[C::Kernel], rule),
            _ => {}
        }
    }

    fn extended(&mut self, span: Span) {
        /// `InterpolateAtCentroid`, `InterpolateAtSample`, `InterpolateAtOffset`.
        const INTERPOLATE: std::ops::RangeInclusive<u32> = 76..=78;
        let Some(Definition::InstructionSet(set)) = self.module.definition(Id(self.word(span, 3))) else {
            return;
        };
        let set = &self.module.instruction_sets[set as usize];
        let number = self.word(span, 4);
        if set == "GLSL.std.450" && INTERPOLATE.contains(&number) {
            let what = crate::module::names::ext_inst_name(set, number);
            self.require(span, &what, &[C::InterpolationFunction], "GLSL.std.450");
        }
    }

    fn dot(&mut self, span: Span) {
        let ty = self.module.type_with_id(Id(self.word(span, 1)));
        if matches!(ty.map(|ty| self.module.ty(ty)), Some(Type::Float { width: 16, encoding: Some(_) })) {
            self.require(span, "OpDot of BFloat16KHR", &[C::BFloat16DotProductKHR], "SPV_KHR_bfloat16");
        }
    }

    fn atomic(&mut self, span: Span, has_result: bool) {
        let opcode = span.opcode;
        let pointer = self.word(span, if has_result { 3 } else { 1 });
        let result = has_result.then(|| self.module.type_with_id(Id(self.word(span, 1)))).flatten();
        let stored = || self.module.type_of(Id(self.word(span, 4)));
        let data = self.module.pointee(Id(pointer)).or(result);
        let data = data.or_else(|| (opcode == Opcode::AtomicStore).then(stored).flatten());
        if matches!(data.map(|ty| self.module.ty(ty)), Some(Type::Int { width: 64, .. })) {
            let what = format!("{opcode} of 64 bits");
            self.require(span, &what, &[C::Int64Atomics], "SPIR-V, capability Int64Atomics");
        }
        let adds = opcode == Opcode::AtomicFAddEXT;
        if !adds && opcode != Opcode::AtomicFMinEXT && opcode != Opcode::AtomicFMaxEXT
            || !self.declared.has(C::Shader as u32)
        {
            return;
        }
        let (capability, rule) = match result.map(|ty| self.module.ty(ty)) {
            Some(Type::Vector { .. }) => (C::AtomicFloat16VectorNV, "SPV_NV_shader_atomic_fp16_vector"),
            Some(Type::Float { width: 16, .. }) if adds => {
                (C::AtomicFloat16AddEXT, "SPV_EXT_shader_atomic_float16_add")
            }
            Some(Type::Float { width: 32, .. }) if adds => {
                (C::AtomicFloat32AddEXT, "SPV_EXT_shader_atomic_float_add")
            }
            Some(Type::Float { width: 64, .. }) if adds => {
                (C::AtomicFloat64AddEXT, "SPV_EXT_shader_atomic_float_add")
            }
            Some(Type::Float { width: 16, .. }) => {
                (C::AtomicFloat16MinMaxEXT, "SPV_EXT_shader_atomic_float_min_max")
            }
            Some(Type::Float { width: 32, .. }) => {
                (C::AtomicFloat32MinMaxEXT, "SPV_EXT_shader_atomic_float_min_max")
            }
            Some(Type::Float { width: 64, .. }) => {
                (C::AtomicFloat64MinMaxEXT, "SPV_EXT_shader_atomic_float_min_max")
            }
            _ => return,
        };
        let what = match result.map(|ty| self.module.ty(ty)) {
            Some(Type::Float { width, .. }) => format!("{opcode} of {width} bits"),
            _ => format!("{opcode} of a vector"),
        };
        self.require(span, &what, &[capability], rule);
    }

    /// Values of 8- and 16-bit numbers that are declared for memory alone can be loaded, stored
    /// and converted to another width.
    fn small_result(&mut self, span: Span) {
        if !self.declared.has(C::Shader as u32) {
            return;
        }
        let Some(known) = InstructionGrammar::of(span.opcode) else { return };
        let result = known.has_type.then(|| self.module.type_with_id(Id(self.word(span, 1)))).flatten();
        let result = result.map_or(0, |ty| self.restricted_value(ty));
        let creates = match span.opcode {
            Opcode::Undef
            | Opcode::PoisonKHR
            | Opcode::VectorExtractDynamic
            | Opcode::VectorInsertDynamic
            | Opcode::CompositeConstruct
            | Opcode::CompositeExtract
            | Opcode::CompositeInsert
            | Opcode::Transpose
            | Opcode::VectorShuffle
            | Opcode::CopyLogical
            | Opcode::ConvertFToU
            | Opcode::ConvertFToS
            | Opcode::ConvertSToF
            | Opcode::ConvertUToF
            | Opcode::Bitcast => true,
            Opcode::Load => {
                let ty = self.module.type_with_id(Id(self.word(span, 1))).map(|ty| self.module.ty(ty));
                matches!(ty, Some(Type::Struct { .. } | Type::Array { .. }))
            }
            _ => known.name.starts_with("Constant") || known.name.starts_with("SpecConstant"),
        };
        let mut restricted = if creates { result } else { 0 };
        let allows = matches!(
            span.opcode,
            Opcode::Decorate
                | Opcode::DecorateId
                | Opcode::CopyObject
                | Opcode::Store
                | Opcode::FConvert
                | Opcode::UConvert
                | Opcode::SConvert
                | Opcode::Name
        );
        if !allows {
            restricted |= self.restricted_operands(span);
        }
        if matches!(span.opcode, Opcode::CopyMemory | Opcode::CopyMemorySized)
            && let Some(pointee) = self.module.pointee(Id(self.word(span, 1)))
        {
            restricted |= self.small_of(pointee) & self.restricted;
        }
        for (bit, bits, capability) in [
            (INT8, "8-bit integers", C::Int8),
            (INT16, "16-bit integers", C::Int16),
            (FLOAT16, "16-bit floats", C::Float16),
        ] {
            if restricted & bit != 0 {
                let what = format!("{} of {bits}", span.opcode);
                self.require(span, &what, &[capability], UNIVERSAL);
            }
        }
    }

    /// The restricted numbers in the values that an instruction uses.
    fn restricted_operands(&self, span: Span) -> u8 {
        if !span.opcode.is_known()
            || matches!(span.opcode, Opcode::Constant | Opcode::SpecConstant | Opcode::Switch)
        {
            return 0;
        }
        let mut restricted = 0;
        // Debug information need not follow the grammar.
        let _ = walk(&self.module.words, span, 1, &mut |at, kind| {
            if is_id(kind)
                && let Some(ty) = self.module.type_of(Id(self.module.words[at]))
            {
                restricted |= self.restricted_value(ty);
            }
            Ok(())
        });
        restricted
    }

    /// The restricted numbers in a value of a type; none of a pointer.
    fn restricted_value(&self, ty: TypeId) -> u8 {
        match self.module.ty(ty) {
            Type::Pointer { .. } => 0,
            _ => self.small_of(ty) & self.restricted,
        }
    }

    fn small_of(&self, ty: TypeId) -> u8 {
        self.small.get(ty.0 as usize).copied().unwrap_or(0)
    }

    /// A word of an instruction; 0 where it ends before.
    fn word(&self, span: Span, index: usize) -> u32 {
        let at = span.start + index;
        if at < span.end { self.module.words[at] } else { 0 }
    }

    fn require_numbers(&mut self, span: Span, what: &str, capabilities: &[u32]) {
        if !self.declared.has_any(capabilities) {
            self.report_missing(span, what, capabilities, UNIVERSAL);
        }
    }

    /// Reports a use unless one of several capabilities is declared.
    fn require(&mut self, span: Span, what: &str, capabilities: &[C], rule: &str) {
        let capabilities: SmallVec<[u32; 8]> = capabilities.iter().map(|one| *one as u32).collect();
        if !self.declared.has_any(&capabilities) {
            self.report_missing(span, what, &capabilities, rule);
        }
    }

    fn report_missing(&mut self, span: Span, what: &str, capabilities: &[u32], rule: &str) {
        let (missing, fix) = missing_capabilities(capabilities);
        let message = format!("{what} requires {missing}");
        self.report(ValidationClass::Capability, span, (what, rule), message, fix);
    }

    fn report(
        &mut self,
        class: ValidationClass,
        span: Span,
        (name, rule): (&str, &str),
        message: String,
        fix: String,
    ) {
        if self.reported.insert(message.clone()) {
            let place = (span.start, subject(self.module, span));
            self.findings.push(ValidationFinding::new(class, name, rule, place, message, fix));
        }
    }
}

fn with(first: C, others: &[C]) -> SmallVec<[C; 8]> {
    std::iter::once(first).chain(others.iter().copied()).collect()
}

fn with_16_bit_storage(first: &[C]) -> SmallVec<[u32; 8]> {
    first.iter().map(|one| *one as u32).chain(STORAGE_16_BIT.iter().copied()).collect()
}

/// By type: which small numbers it contains, through pointers that are not declared forward.
fn small_numbers(module: &Module) -> Vec<u8> {
    let mut small: Vec<u8> = Vec::with_capacity(module.types.len());
    for (index, ty) in module.types.iter().enumerate() {
        let of = |part: TypeId| small.get(part.0 as usize).copied().unwrap_or(0);
        let own = match ty {
            Type::Int { width: 8, .. } => INT8,
            Type::Int { width: 16, .. } => INT16,
            Type::Float { width: 16, encoding: None } => FLOAT16,
            Type::Vector { component: part, .. }
            | Type::Matrix { column: part, .. }
            | Type::Array { element: part, .. }
            | Type::RuntimeArray { element: part, .. }
            | Type::SampledImage(part)
            | Type::Pointer { pointee: Some(part), .. } => of(*part),
            Type::Image(image) => of(image.sampled_type),
            Type::Struct { members, .. } => members.iter().fold(0, |all, member| all | of(member.ty)),
            Type::Function { return_type, parameters } => {
                parameters.iter().fold(of(*return_type), |all, part| all | of(*part))
            }
            _ => 0,
        };
        debug_assert_eq!(small.len(), index);
        small.push(own);
    }
    small
}
