//! The rules of explicit layouts: where the members of a block may lie, and how far apart its
//! elements and columns.
//!
//! SPIR-V, 2.16.2 forbids overlap and strides of 0; Vulkan, "Offset and Stride Assignment", adds
//! alignments, which depend on features of the device. Lengths of arrays are given by the caller:
//! they may be specialization constants.

use std::collections::{HashMap, HashSet};

use crate::module::decoration::Decoration;
use crate::module::ty::{MatrixLayout, Member, SizeComputation, Type, TypeId};
use crate::module::{Id, Module};

/// Features of a device that allow denser layouts. `VK_KHR_relaxed_block_layout` is part of Vulkan
/// 1.1 and always on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayoutFeatures {
    /// `scalarBlockLayout`, and `workgroupMemoryExplicitLayoutScalarBlockLayout`: every type is
    /// aligned as its scalars are.
    pub scalar_block_layout: bool,
    /// `uniformBufferStandardLayout`: uniform buffers are aligned as storage buffers are.
    pub uniform_buffer_standard_layout: bool,
}

impl LayoutFeatures {
    /// Every feature.
    pub const ALL: Self = Self { scalar_block_layout: true, uniform_buffer_standard_layout: true };
}

/// A layout that breaks a rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayoutFault {
    /// What is wrong, with names of struct and member.
    pub message: String,
    /// Source of the rule.
    pub rule: String,
    /// The fix as an imperative.
    pub fix: String,
}

impl LayoutFault {
    fn new(message: String, rule: &str) -> Self {
        let fix = match rule {
            RUNTIME_ARRAY => "move the runtime array to the end of the block",
            DECORATED => "let the compiler decorate the block, or add the decoration",
            _ => "move the member, enlarge the stride, or shorten the array",
        };
        Self { message, rule: rule.to_owned(), fix: fix.to_owned() }
    }
}

/// What SPIR-V says of every explicit layout.
const OVERLAP: &str = "SPIR-V, 2.16.2: ArrayStride, MatrixStride and Offset are large enough to hold what they \
                       affect, and strides are above 0";
const DECORATED: &str = "SPIR-V, 2.16.2: members have an Offset, arrays an ArrayStride, matrices a MatrixStride and \
                         RowMajor or ColMajor";
const ONCE: &str = "SPIR-V, 2.16.1: a decoration is applied to a target at most once";
pub(super) const RUNTIME_ARRAY: &str = "VUID-StandaloneSpirv-OpTypeRuntimeArray-04680";

/// Storage classes, numbers of the specification.
pub(in crate::module) const UNIFORM: u32 = 2;
pub(super) const WORKGROUP: u32 = 4;
const PUSH_CONSTANT: u32 = 9;
pub(in crate::module) const STORAGE_BUFFER: u32 = 12;
const SHADER_RECORD_BUFFER: u32 = 5343;
pub(super) const PHYSICAL_STORAGE_BUFFER: u32 = 5349;

/// Bytes that a vector must not straddle.
const STRADDLE: u64 = 16;

/// Returns true if Vulkan has rules on the layout of blocks in a storage class.
pub fn has_explicit_layout(storage_class: u32) -> bool {
    matches!(
        storage_class,
        UNIFORM | WORKGROUP | PUSH_CONSTANT | STORAGE_BUFFER | SHADER_RECORD_BUFFER | PHYSICAL_STORAGE_BUFFER
    )
}

/// Alignments of "Alignment Requirements", from the least.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Alignment {
    Scalar,
    Base,
    Extended,
}

/// Searches a type in a storage class for the first part whose layout breaks a rule.
///
/// `is_block` is a block of a buffer, which must be decorated; what is decorated nowhere in another
/// type is left alone. `length` gives the lengths of arrays, `None` where they are not known.
pub fn find_layout_fault(
    module: &Module,
    ty: TypeId,
    storage_class: u32,
    features: LayoutFeatures,
    length: &dyn Fn(Id) -> Option<u64>,
) -> Option<LayoutFault> {
    let is_uniform =
        storage_class == UNIFORM && !matches!(module.ty(ty), Type::Struct { buffer_block: true, .. });
    let alignment = match features {
        _ if features.scalar_block_layout => Alignment::Scalar,
        _ if is_uniform && !features.uniform_buffer_standard_layout => Alignment::Extended,
        _ => Alignment::Base,
    };
    let mut checker = Checker {
        module,
        length,
        sizes: SizeComputation::new(module, length),
        alignment,
        // No rule was found for the records.
        is_required: storage_class != SHADER_RECORD_BUFFER,
        alignments: HashMap::new(),
        visited: HashSet::new(),
    };
    checker.part(Part { ty, matrix: None, owner: None }, 0).err().map(|fault| *fault)
}

/// A part of a type, as a rule looks at it.
#[derive(Clone, Copy)]
struct Part {
    ty: TypeId,
    /// The layout of matrices in it.
    matrix: Option<MatrixLayout>,
    /// The struct around it, and which member it belongs to.
    owner: Option<(TypeId, usize)>,
}

impl Part {
    fn of_member(owner: TypeId, index: usize, member: &Member) -> Self {
        Self { ty: member.ty, matrix: member.matrix, owner: Some((owner, index)) }
    }

    fn element(self, ty: TypeId) -> Self {
        Self { ty, ..self }
    }
}

struct Checker<'a> {
    module: &'a Module,
    length: &'a dyn Fn(Id) -> Option<u64>,
    sizes: SizeComputation<'a>,
    alignment: Alignment,
    /// Whether a missing decoration is a fault.
    is_required: bool,
    /// Alignments of structs.
    alignments: HashMap<(TypeId, Alignment), Option<u64>>,
    /// Structs and arrays that were checked, each with its offset modulo [`STRADDLE`].
    visited: HashSet<(TypeId, Option<MatrixLayout>, u64)>,
}

type Checked = Result<(), Box<LayoutFault>>;

impl Checker<'_> {
    /// Checks a part that begins at an offset in its block.
    fn part(&mut self, part: Part, offset: u64) -> Checked {
        let module = self.module;
        match *module.ty(part.ty) {
            Type::Struct { .. } => self.members(part.ty, offset),
            Type::Array { element, length, stride } => {
                let count = (self.length)(length);
                self.elements(part, element, stride, count, offset)
            }
            Type::RuntimeArray { element, stride } => self.elements(part, element, stride, None, offset),
            Type::Matrix { .. } => self.matrix(part),
            _ => Ok(()),
        }
    }

    fn members(&mut self, ty: TypeId, base: u64) -> Checked {
        let module = self.module;
        let Type::Struct { members, .. } = module.ty(ty) else { return Ok(()) };
        if !self.visited.insert((ty, None, base % STRADDLE)) {
            return Ok(());
        }
        let mut ordered = Vec::with_capacity(members.len());
        for (index, member) in members.iter().enumerate() {
            match member.offset {
                Some(offset) => {
                    if let Some(other) = self.other_offset(ty, index, offset) {
                        let what = format!("has two Offsets, {offset} and {other}");
                        return self.fault(ty, index, &what, ONCE);
                    }
                    ordered.push((u64::from(offset), index));
                }
                None if self.is_required => return self.fault(ty, index, "has no Offset", DECORATED),
                None => {}
            }
        }
        ordered.sort_unstable();
        // The end of what lies before, and the member that ends there.
        let mut before: Option<(u64, usize)> = None;
        for (offset, index) in ordered {
            let member = &members[index];
            let part = Part::of_member(ty, index, member);
            self.check_offset(part, offset)?;
            if let Some((end, other)) = before
                && offset < end
            {
                return Err(self.overlap(ty, (offset, index), (end, other)));
            }
            self.check_straddling(part, base.wrapping_add(offset), offset)?;
            self.part(part, base.wrapping_add(offset))?;
            let end = self.end(part, offset);
            if before.is_none_or(|(last, _)| end >= last) {
                before = Some((end, index));
            }
        }
        Ok(())
    }

    /// The first byte after a member that another one may take.
    fn end(&mut self, part: Part, offset: u64) -> u64 {
        if let Type::RuntimeArray { .. } = self.module.ty(part.ty) {
            return u64::MAX;
        }
        let end = offset.saturating_add(self.extent(part).unwrap_or(0));
        let is_padded = self.alignment == Alignment::Extended
            && matches!(self.module.ty(part.ty), Type::Array { .. } | Type::Struct { .. });
        match self.alignment_of(part, self.alignment) {
            Some(alignment) if is_padded => end.next_multiple_of(alignment),
            _ => end,
        }
    }

    /// The bytes of a member that others keep clear of. As for spirv-val, the last column of a
    /// matrix has the padding of the others; the last row of a row-major matrix has none.
    fn extent(&mut self, part: Part) -> Option<u64> {
        match (self.module.ty(part.ty), part.matrix) {
            (Type::Matrix { count, .. }, Some(MatrixLayout { stride, row_major: false })) => {
                Some(u64::from(*count) * u64::from(stride))
            }
            (&Type::Array { element, length, stride }, _) => {
                let before = (self.length)(length)?.checked_sub(1)?;
                before.checked_mul(u64::from(stride?))?.checked_add(self.extent(part.element(element))?)
            }
            _ => self.sizes.size(part.ty, part.matrix),
        }
    }

    fn check_offset(&mut self, part: Part, offset: u64) -> Checked {
        let is_vector = matches!(self.module.ty(part.ty), Type::Vector { .. });
        // Relaxed block layout aligns vectors as their components are.
        let rule = if is_vector { Alignment::Scalar } else { self.alignment };
        match self.alignment_of(part, rule) {
            Some(alignment) if !offset.is_multiple_of(alignment) => {
                let what = format!("at offset {offset} is not aligned to {alignment} bytes");
                self.owner_fault(part, &what, self.alignment_rule())
            }
            _ => Ok(()),
        }
    }

    fn check_straddling(&mut self, part: Part, first: u64, offset: u64) -> Checked {
        if self.alignment == Alignment::Scalar || !matches!(self.module.ty(part.ty), Type::Vector { .. }) {
            return Ok(());
        }
        let size = self.sizes.size(part.ty, None).unwrap_or(0);
        let straddles = match size {
            0 => false,
            1..=STRADDLE => first / STRADDLE != (first + (size - 1)) / STRADDLE,
            _ => !first.is_multiple_of(STRADDLE),
        };
        match straddles {
            true => {
                let what = format!("at offset {offset} straddles a boundary of {STRADDLE} bytes");
                self.owner_fault(part, &what, self.alignment_rule())
            }
            false => Ok(()),
        }
    }

    fn elements(
        &mut self,
        part: Part,
        element: TypeId,
        stride: Option<u32>,
        count: Option<u64>,
        offset: u64,
    ) -> Checked {
        if !self.visited.insert((part.ty, part.matrix, offset % STRADDLE)) {
            return Ok(());
        }
        let Some(stride) = stride else {
            return match self.is_required {
                true => self.owner_fault(part, "has an array without an ArrayStride", DECORATED),
                false => Ok(()),
            };
        };
        if let Some(other) = self.other_stride(part.ty, stride) {
            let what = format!("has an array with two ArrayStrides, {stride} and {other}");
            return self.owner_fault(part, &what, ONCE);
        }
        let stride = u64::from(stride);
        if stride == 0 {
            return self.owner_fault(part, "has an array with ArrayStride 0", OVERLAP);
        }
        if let Some(alignment) =
            self.alignment_of(part, self.alignment).filter(|&to| !stride.is_multiple_of(to))
        {
            let what = format!("has an array with ArrayStride {stride}, not aligned to {alignment} bytes");
            return self.owner_fault(part, &what, self.alignment_rule());
        }
        let size = self.sizes.size(element, part.matrix).unwrap_or(0);
        if stride < size {
            let what = format!("has an array with ArrayStride {stride}, whose elements have {size} bytes");
            return self.owner_fault(part, &what, OVERLAP);
        }
        // Offsets of elements modulo 16 recur.
        let period = count.map_or(STRADDLE, |count| count.min(STRADDLE));
        let period = if self.alignment == Alignment::Scalar { 1 } else { period };
        (0..period)
            .try_for_each(|index| self.part(part.element(element), offset.wrapping_add(index * stride)))
    }

    /// An `Offset` of a member that contradicts another.
    fn other_offset(&self, ty: TypeId, index: usize, offset: u32) -> Option<u32> {
        const OFFSET: u32 = 35;
        let id = self.module.id_of_type(ty)?;
        other_literal(self.module.decorations.of_member.get(&(id, index as u32))?, OFFSET, offset)
    }

    /// An `ArrayStride` of an array type that contradicts another.
    fn other_stride(&self, array: TypeId, stride: u32) -> Option<u32> {
        const ARRAY_STRIDE: u32 = 6;
        let id = self.module.id_of_type(array)?;
        other_literal(self.module.decorations.of_id.get(&id)?, ARRAY_STRIDE, stride)
    }

    fn matrix(&mut self, part: Part) -> Checked {
        let module = self.module;
        let Type::Matrix { column, count } = *module.ty(part.ty) else { return Ok(()) };
        let Type::Vector { component, count: rows } = *module.ty(column) else { return Ok(()) };
        let Some(layout) = part.matrix else {
            // What a pointer leads to has the layout of a member that is not known here.
            return match part.owner {
                Some(_) if self.is_required => {
                    self.owner_fault(part, "is a matrix without a MatrixStride", DECORATED)
                }
                _ => Ok(()),
            };
        };
        let stride = u64::from(layout.stride);
        if stride == 0 {
            return self.owner_fault(part, "is a matrix with MatrixStride 0", OVERLAP);
        }
        if self.is_required && !self.has_order(part) {
            return self.owner_fault(part, "is a matrix with neither RowMajor nor ColMajor", DECORATED);
        }
        if let Some(alignment) =
            self.alignment_of(part, self.alignment).filter(|&to| !stride.is_multiple_of(to))
        {
            let what = format!("is a matrix with MatrixStride {stride}, not aligned to {alignment} bytes");
            return self.owner_fault(part, &what, self.alignment_rule());
        }
        let across = if layout.row_major { count } else { rows };
        let size = u64::from(across) * self.scalar_size(component).unwrap_or(0);
        if stride < size {
            let vectors = if layout.row_major { "rows" } else { "columns" };
            let what = format!("is a matrix with MatrixStride {stride}, whose {vectors} have {size} bytes");
            return self.owner_fault(part, &what, OVERLAP);
        }
        Ok(())
    }

    /// Whether the order of a matrix's scalars is declared.
    fn has_order(&self, part: Part) -> bool {
        const ROW_MAJOR: u32 = 4;
        const COL_MAJOR: u32 = 5;
        let Some((owner, index)) = part.owner else { return true };
        let Some(id) = self.module.id_of_type(owner) else { return true };
        [ROW_MAJOR, COL_MAJOR]
            .iter()
            .any(|&order| self.module.decorations.find_member(id, index as u32, order).is_some())
    }

    fn scalar_size(&self, ty: TypeId) -> Option<u64> {
        match *self.module.ty(ty) {
            Type::Int { width, .. } | Type::Float { width, .. } => Some(u64::from(width / 8)),
            Type::Pointer { storage_class: PHYSICAL_STORAGE_BUFFER, .. } => Some(8),
            _ => None,
        }
    }

    /// The alignment of a part; `None` for types without a size.
    fn alignment_of(&mut self, part: Part, rule: Alignment) -> Option<u64> {
        let module = self.module;
        let rounded = |alignment: u64| match rule {
            Alignment::Extended => alignment.next_multiple_of(STRADDLE),
            _ => alignment,
        };
        match *module.ty(part.ty) {
            Type::Vector { component, count } => self.vector_alignment(component, count, rule),
            Type::Matrix { column, count } => {
                let Type::Vector { component, count: rows } = *module.ty(column) else { return None };
                let is_row_major = part.matrix.is_some_and(|layout| layout.row_major);
                self.vector_alignment(component, if is_row_major { count } else { rows }, rule).map(rounded)
            }
            Type::Array { element, .. } | Type::RuntimeArray { element, .. } => {
                self.alignment_of(part.element(element), rule).map(rounded)
            }
            Type::Struct { ref members, .. } => {
                if let Some(known) = self.alignments.get(&(part.ty, rule)) {
                    return *known;
                }
                let mut most = Some(1);
                for (index, member) in members.iter().enumerate() {
                    let of_member = self.alignment_of(Part::of_member(part.ty, index, member), rule);
                    most = most.zip(of_member).map(|(most, of_member)| most.max(of_member));
                }
                let alignment = most.map(rounded);
                self.alignments.insert((part.ty, rule), alignment);
                alignment
            }
            // That a pointer may not be here at all is another rule's.
            Type::Pointer { .. } => Some(8),
            _ => self.scalar_size(part.ty),
        }
    }

    fn vector_alignment(&self, component: TypeId, count: u32, rule: Alignment) -> Option<u64> {
        let scalar = self.scalar_size(component)?;
        Some(match (rule, count) {
            (Alignment::Scalar, _) => scalar,
            (_, 3) => scalar * 4,
            _ => scalar * u64::from(count),
        })
    }

    fn alignment_rule(&self) -> &'static str {
        match self.alignment {
            Alignment::Scalar => "Vulkan, Offset and Stride Assignment: scalar alignment",
            Alignment::Base => {
                "Vulkan, Offset and Stride Assignment: base alignment, without the feature scalarBlockLayout"
            }
            Alignment::Extended => {
                "Vulkan, Offset and Stride Assignment: extended alignment, without the features scalarBlockLayout \
                 and uniformBufferStandardLayout"
            }
        }
    }

    #[cold]
    fn overlap(
        &self,
        ty: TypeId,
        (offset, index): (u64, usize),
        (end, other): (u64, usize),
    ) -> Box<LayoutFault> {
        let Type::Struct { members, .. } = self.module.ty(ty) else { unreachable!("a struct has members") };
        let other_name = member_name(self.module, ty, other);
        let is_runtime = matches!(self.module.ty(members[other].ty), Type::RuntimeArray { .. });
        let what = match is_runtime {
            true => {
                format!("at offset {offset} follows {other_name}, a runtime array, which must be last")
            }
            false => format!("at offset {offset} overlaps {other_name}, which ends at offset {end}"),
        };
        let what = match self.specialized_length(members[other].ty) {
            Some(length) => format!("{what}: {length}"),
            None => what,
        };
        self.fault_of(ty, index, &what, if is_runtime { RUNTIME_ARRAY } else { OVERLAP })
    }

    /// A clause about an array whose length is a specialization constant.
    fn specialized_length(&self, ty: TypeId) -> Option<String> {
        let Type::Array { length, .. } = *self.module.ty(ty) else { return None };
        let constant = self.module.constants.iter().find(|one| one.id == length && one.specializable)?;
        let (name, count) = (self.module.name_or_number(length), (self.length)(length)?);
        let id = constant.spec_id.map_or_else(String::new, |id| format!(", constant_id {id}"));
        Some(format!("its length is the specialization constant `{name}`{id}: {count}"))
    }

    fn owner_fault(&self, part: Part, what: &str, rule: &'static str) -> Checked {
        match part.owner {
            Some((ty, index)) => self.fault(ty, index, what, rule),
            None => {
                let message = format!("{} {what}", self.module.describe_type(part.ty));
                Err(Box::new(LayoutFault::new(message, rule)))
            }
        }
    }

    #[cold]
    fn fault(&self, ty: TypeId, index: usize, what: &str, rule: &'static str) -> Checked {
        Err(self.fault_of(ty, index, what, rule))
    }

    fn fault_of(&self, ty: TypeId, index: usize, what: &str, rule: &'static str) -> Box<LayoutFault> {
        let message = format!("{} {what}", member_name(self.module, ty, index));
        Box::new(LayoutFault::new(message, rule))
    }
}

/// The literal of a decoration that contradicts another with its number.
fn other_literal(decorations: &[Decoration], number: u32, literal: u32) -> Option<u32> {
    let literals = decorations.iter().filter(|one| one.number == number);
    literals.filter_map(|one| one.operands.first().copied()).find(|other| *other != literal)
}

/// A member of a struct in messages: `Histogram.count`.
fn member_name(module: &Module, ty: TypeId, index: usize) -> String {
    let Type::Struct { members, .. } = module.ty(ty) else { return String::new() };
    let owner = module.id_of_type(ty).map_or_else(String::new, |id| module.name_or_number(id));
    match members.get(index).map(|member| member.name.as_str()) {
        Some(name) if !name.is_empty() => format!("`{owner}.{name}`"),
        _ => format!("member {index} of `{owner}`"),
    }
}
