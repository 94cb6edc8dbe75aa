//! Translates the instructions of cooperative vectors and matrices to operations.

mod matrix;

use rspirv::spirv::{ComponentType as T, CooperativeMatrixOperands, CooperativeVectorMatrixLayout as Layout};

use crate::machine::Reg;
use crate::math::float_format::FloatFormat;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Instruction, Opcode};
use crate::ops::arithmetic;
use crate::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use crate::ops::conversion::{self, Conversion};
use crate::ops::cooperative::component::MatrixComponent;
use crate::ops::cooperative::vector::{ComponentRegisters, MatrixStride, VectorProduct};
use crate::ops::cooperative::{CooperativeOp, OPCODES};
use crate::ops::integer_operand::ReadAs;
use crate::ops::memory::{Chunk, Length, MemoryOp};
use crate::ops::op::Op;
use crate::ops::pointer::{Pointer, PointerBase, alignment, storage};
use crate::ops::translate::Translator;
use crate::ops::untyped_pointer::is_untyped;
use crate::ops::value_registers::{Words, registers_from};
use anyhit_base::error::Result;

/// The most rows and columns of a matrix that is multiplied: a product needs memory for all of
/// its components.
const MAX_COMPONENTS: u32 = 1024;
/// The specification of cooperative vectors.
const EXTENSION: &str = "SPV_NV_cooperative_vector";

/// Translates the instructions of cooperative vectors and matrices; `false` for any other.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    if matrix::translate(translator, instruction)? {
        return Ok(true);
    }
    if !OPCODES.contains(&instruction.opcode) {
        return Ok(false);
    }
    match instruction.opcode {
        Opcode::CooperativeVectorLoadNV => load(translator, instruction)?,
        Opcode::CooperativeVectorStoreNV => store(translator, instruction)?,
        Opcode::CooperativeVectorMatrixMulNV => product(translator, instruction, false)?,
        Opcode::CooperativeVectorMatrixMulAddNV => product(translator, instruction, true)?,
        Opcode::CooperativeVectorOuterProductAccumulateNV => accumulate_outer(translator, instruction)?,
        _ => accumulate_sum(translator, instruction)?,
    }
    Ok(true)
}

/// The component type and the number of components of a cooperative vector.
fn vector(translator: &Translator<'_>, opcode: Opcode, ty: TypeId) -> Result<(TypeId, u32)> {
    match *translator.module.ty(ty) {
        Type::Vector { component, count } if translator.module.is_cooperative_vector(ty) => {
            Ok((component, count))
        }
        _ => {
            let name = translator.module.describe_type(ty);
            let message = format!("{opcode}: a cooperative vector is required, not {name}");
            Err(translator.invalid(message).note(EXTENSION))
        }
    }
}

/// A pointer to an array in a buffer, at so many bytes as an operand says.
fn array_pointer(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    at: usize,
    allows_workgroup: bool,
) -> Result<Pointer> {
    let opcode = instruction.opcode;
    let (id, offset) = (translator.id(instruction, at)?, translator.id(instruction, at + 1)?);
    let mut pointer = translator.pointer(id)?;
    let class_allowed = match pointer.storage_class {
        storage::STORAGE_BUFFER | storage::PHYSICAL_STORAGE_BUFFER => true,
        storage::WORKGROUP => allows_workgroup,
        _ => false,
    };
    if !class_allowed {
        let class = crate::module::names::storage_class_name(pointer.storage_class);
        return Err(translator.invalid(format!("{opcode}: a pointer to {class}")).note(EXTENSION));
    }
    let is_array =
        matches!(translator.module.ty(pointer.pointee), Type::Array { .. } | Type::RuntimeArray { .. });
    if !is_array || is_untyped(translator, id)? || !matches!(pointer.base, PointerBase::Buffer(_)) {
        let message = format!("{opcode}: operand {at} must be a pointer to an array of scalars or vectors");
        return Err(translator.invalid(message).note(EXTENSION));
    }
    let scale =
        if pointer.is_packed(translator) { packed_scale(translator, instruction, &pointer)? } else { 1 };
    let offset_type = translator.type_of(offset)?;
    if !matches!(translator.module.ty(offset_type), Type::Int { width: 32, .. }) {
        let name = translator.module.describe_type(offset_type);
        return Err(translator.invalid(format!("{opcode}: an offset of type {name}")).note(EXTENSION));
    }
    let offset = translator.integer(offset, ReadAs::Unsigned)?;
    shift(translator, &mut pointer, offset, scale)?;
    Ok(pointer)
}

/// The scalar type of the array that a pointer points to.
fn scalar_of(translator: &Translator<'_>, pointer: &Pointer) -> TypeId {
    let mut ty = pointer.pointee;
    while let Type::Array { element, .. }
    | Type::RuntimeArray { element, .. }
    | Type::Vector { component: element, .. } = *translator.module.ty(ty)
    {
        ty = element;
    }
    ty
}

/// How many bytes of workgroup memory without a layout stand for one byte of an array there: its
/// scalars of 8 and 16 bits occupy whole words.
fn packed_scale(translator: &Translator<'_>, instruction: &Instruction, pointer: &Pointer) -> Result<u32> {
    let ty = scalar_of(translator, pointer);
    let own = translator.scalar_width(ty)?;
    if own >= 32 {
        return Ok(1);
    }
    // The vector that is accessed: the result, or the last operand that is one.
    let ids = translator.module.operand_ids(instruction);
    let types = ids.into_iter().filter_map(|id| translator.module.type_of(id));
    let result = instruction.result_type.and_then(|id| translator.module.type_with_id(id));
    let vector = types.chain(result).filter(|&ty| translator.module.is_cooperative_vector(ty)).last();
    match vector.map(|ty| translator.scalar_width(ty)).transpose()? {
        Some(width) if width == own => Ok(32 / own),
        _ => {
            let (opcode, name) = (instruction.opcode, translator.module.describe_type(ty));
            let message = format!(
                "{opcode} of components of another width in workgroup memory of {name} is not supported"
            );
            Err(translator.unsupported(message))
        }
    }
}

/// Moves a pointer by a number of bytes in a register, times a scale.
fn shift(translator: &mut Translator<'_>, pointer: &mut Pointer, bytes: Reg, scale: u32) -> Result<()> {
    let known = translator.constant_word(bytes).and_then(|bytes| bytes.checked_mul(scale));
    match known.and_then(|bytes| pointer.offset.checked_add(bytes)) {
        Some(offset) => pointer.offset = offset,
        None => {
            let to = translator.fresh(1)?;
            let (base, length) = (pointer.index, Length::Unknown);
            translator.emit(Op::Memory(MemoryOp::Index { to, base, index: bytes, stride: scale, length }));
            pointer.index = Some(to);
        }
    }
    Ok(())
}

/// Consecutive scalars behind a pointer into a buffer.
fn chunk(
    translator: &Translator<'_>,
    pointer: &Pointer,
    width: u32,
    count: u32,
    aligned: u32,
) -> Result<Chunk> {
    let PointerBase::Buffer(buffer) = pointer.base else {
        return Err(translator.invalid("the pointer does not point into a buffer"));
    };
    let (width, count) = match width {
        64 => (32, count.checked_mul(2)),
        _ if pointer.is_packed(translator) && scalar_is_narrow(translator, pointer) => (32, Some(count)),
        _ => (width, Some(count)),
    };
    let bytes = count.and_then(|count| count.checked_mul(width / 8));
    let fits = bytes.is_some_and(|bytes| pointer.offset.checked_add(bytes).is_some());
    let count = count
        .filter(|_| fits)
        .ok_or_else(|| translator.unsupported("an offset beyond 4 GiB is not supported"))?;
    Ok(Chunk { buffer, offset: pointer.offset, index: pointer.index, width, count, alignment: aligned })
}

/// Whether a pointer points to an array of scalars below 32 bits.
fn scalar_is_narrow(translator: &Translator<'_>, pointer: &Pointer) -> bool {
    translator.scalar_width(scalar_of(translator, pointer)).is_ok_and(|width| width < 32)
}

fn load(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let ty = translator.result_type(instruction)?;
    let (component, count) = vector(translator, instruction.opcode, ty)?;
    let words = translator.word_count(ty)?;
    let pointer = array_pointer(translator, instruction, 0, true)?;
    let aligned = alignment(translator, instruction, 2)?;
    let chunk = chunk(translator, &pointer, translator.scalar_width(component)?, count, aligned)?;
    let to = translator.fresh(words)?;
    translator.emit(Op::Memory(MemoryOp::BufferLoad { to, chunk }));
    translator.define_result(instruction, registers_from(to, words));
    Ok(())
}

fn store(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let object = translator.id(instruction, 2)?;
    let ty = translator.type_of(object)?;
    let (component, count) = vector(translator, instruction.opcode, ty)?;
    let pointer = array_pointer(translator, instruction, 0, true)?;
    let aligned = alignment(translator, instruction, 3)?;
    let chunk = chunk(translator, &pointer, translator.scalar_width(component)?, count, aligned)?;
    let words = translator.words(object)?;
    let from = translator.consecutive(&words)?;
    translator.emit(Op::Memory(MemoryOp::BufferStore { from, chunk }));
    Ok(())
}

/// A component type of the specification's table, and whether it is packed into words.
fn interpretation(translator: &mut Translator<'_>, id: Id) -> Result<(MatrixComponent, bool)> {
    let number = translator.constant_integer(id)?;
    let known = u32::try_from(number).ok().and_then(T::from_u32);
    let int = |width, signed| MatrixComponent::Int { width, signed };
    Ok(match known {
        Some(T::Float16NV) => (MatrixComponent::Float(FloatFormat::Binary16), false),
        Some(T::Float32NV) => (MatrixComponent::Float(FloatFormat::Binary32), false),
        Some(T::FloatE4M3NV) => (MatrixComponent::Float(FloatFormat::E4M3), false),
        Some(T::FloatE5M2NV) => (MatrixComponent::Float(FloatFormat::E5M2), false),
        Some(T::SignedInt8NV) => (int(8, true), false),
        Some(T::SignedInt16NV) => (int(16, true), false),
        Some(T::SignedInt32NV) => (int(32, true), false),
        Some(T::UnsignedInt8NV) => (int(8, false), false),
        Some(T::UnsignedInt16NV) => (int(16, false), false),
        Some(T::UnsignedInt32NV) => (int(32, false), false),
        Some(T::SignedInt8PackedNV) => (int(8, true), true),
        Some(T::UnsignedInt8PackedNV) => (int(8, false), true),
        Some(other) => {
            return Err(translator.unsupported(format!("the component type {other:?} is not supported")));
        }
        None => {
            let message = format!("{number} is not a component type");
            return Err(translator.invalid(message).note(EXTENSION));
        }
    })
}

/// An interpretation of a matrix or bias, which is never packed.
fn memory_interpretation(translator: &mut Translator<'_>, id: Id) -> Result<MatrixComponent> {
    match interpretation(translator, id)? {
        (component, false) => Ok(component),
        (_, true) => {
            Err(translator.invalid("a packed component type describes registers, not memory").note(EXTENSION))
        }
    }
}

/// A dimension of a product.
fn dimension(translator: &mut Translator<'_>, id: Id, name: &str) -> Result<u32> {
    match translator.constant_integer(id)? {
        0 => Err(translator.invalid(format!("a product of a matrix whose {name} is 0")).note(EXTENSION)),
        count if count <= MAX_COMPONENTS.into() => Ok(count as u32),
        count => Err(translator.unsupported(format!(
            "a product of a matrix whose {name} is {count} is not supported: up to {MAX_COMPONENTS} are"
        ))),
    }
}

/// `OpCooperativeVectorMatrixMulNV`, and with a bias `OpCooperativeVectorMatrixMulAddNV`.
fn product(translator: &mut Translator<'_>, instruction: &Instruction, has_bias: bool) -> Result<()> {
    let opcode = instruction.opcode;
    let invalid = |translator: &Translator<'_>, what: String| {
        Err(translator.invalid(format!("{opcode}: {what}")).note(EXTENSION))
    };
    let behind = if has_bias { 8 } else { 5 };
    let operands = translator.operands(instruction);
    let flags = operands.get(behind + 5).copied().unwrap_or(0);
    let flags = CooperativeMatrixOperands::from_bits_retain(flags);
    let has = |flag| flags.contains(flag);

    let ty = translator.result_type(instruction)?;
    let (result_type, result_count) = vector(translator, opcode, ty)?;
    let is_signed = has(CooperativeMatrixOperands::MATRIX_RESULT_SIGNED_COMPONENTS_KHR);
    let result = MatrixComponent::of(translator.module.ty(result_type), is_signed);
    let result = match result {
        Some(MatrixComponent::Float(FloatFormat::Binary16 | FloatFormat::Binary32))
        | Some(MatrixComponent::Int { width: 32, .. }) => result.unwrap_or(MatrixComponent::I32),
        _ => {
            let name = translator.module.describe_type(result_type);
            return invalid(translator, format!("a result of {name}, not of float16_t, float, int or uint"));
        }
    };

    let input = translator.id(instruction, 0)?;
    let input_type = translator.type_of(input)?;
    let (input_component, input_count) = vector(translator, opcode, input_type)?;
    let is_signed = has(CooperativeMatrixOperands::MATRIX_B_SIGNED_COMPONENTS_KHR);
    let own = MatrixComponent::of(translator.module.ty(input_component), is_signed);
    let own = own.ok_or_else(|| {
        let name = translator.module.describe_type(input_component);
        translator.unsupported(format!("{opcode} of a vector of {name} is not supported"))
    })?;
    let id = translator.id(instruction, 1)?;
    let (read_as, is_packed) = interpretation(translator, id)?;
    let rows = translator.id(instruction, behind).and_then(|id| dimension(translator, id, "M"))?;
    let columns = translator.id(instruction, behind + 1).and_then(|id| dimension(translator, id, "K"))?;
    if result_count != rows {
        return invalid(translator, format!("a result of {result_count} components, but M is {rows}"));
    }
    let is_word = matches!(translator.module.ty(input_component), Type::Int { width: 32, signed: false });
    match is_packed {
        true if !is_word => {
            return invalid(translator, "packed components in a vector that is not of uint".into());
        }
        true if columns.div_ceil(4) > input_count => {
            let message = format!("{input_count} words do not hold K = {columns} packed components");
            return invalid(translator, message);
        }
        false if input_count != columns => {
            return invalid(translator, format!("a vector of {input_count} components, but K is {columns}"));
        }
        _ => {}
    }

    let id = translator.id(instruction, 4)?;
    let matrix_component = memory_interpretation(translator, id)?;
    let bias_component = match has_bias {
        true => {
            let id = translator.id(instruction, 7)?;
            Some(memory_interpretation(translator, id)?)
        }
        false => None,
    };
    let parts = [read_as, matrix_component].into_iter().chain(bias_component);
    if parts.clone().any(|part| part.is_float() != result.is_float()) {
        let mut names: Vec<String> = parts.map(|part| part.to_string()).collect();
        names.push(result.to_string());
        let message = format!("{opcode} of both floats and integers ({}) is not supported", names.join(", "));
        return Err(translator.unsupported(message));
    }

    let (is_column_major, stride) =
        layout(translator, instruction, behind + 2, (rows, columns), matrix_component)?;
    let pointer = array_pointer(translator, instruction, 2, false)?;
    let mut product = VectorProduct {
        to: Reg(0),
        result,
        rows,
        columns,
        input: ComponentRegisters { first: Reg(0), count: input_count, component: own },
        is_packed,
        interpretation: read_as,
        matrix: chunk(translator, &pointer, 8, 1, matrix_component.width() / 8)?,
        matrix_component,
        is_column_major,
        stride,
        bias: None,
    };
    if is_packed {
        product.input.component = read_as;
    }
    let least = if let MatrixStride::Known(stride) = stride { stride } else { 0 };
    let extent = u32::try_from(product.extent(least)).ok();
    let fits = extent.filter(|&bytes| product.matrix.offset.checked_add(bytes).is_some());
    product.matrix.count =
        fits.ok_or_else(|| translator.unsupported("an offset beyond 4 GiB is not supported"))?;
    if let Some(component) = bias_component {
        let pointer = array_pointer(translator, instruction, 5, false)?;
        let chunk = chunk(translator, &pointer, component.width(), rows, component.width() / 8)?;
        let first = translator.fresh(rows)?;
        translator.emit(Op::Memory(MemoryOp::BufferLoad { to: first, chunk }));
        product.bias = Some(ComponentRegisters { first, count: rows, component });
    }
    let words = translator.words(input)?;
    product.input.first = translator.consecutive(&words)?;
    product.to = translator.fresh(rows)?;
    let to = product.to;
    translator.emit(Op::Cooperative(Box::new(CooperativeOp::VectorProduct(product))));
    translator.define_result(instruction, registers_from(to, rows));
    Ok(())
}

/// The order of a matrix in memory: the operands `MemoryLayout`, `Transpose` and `MatrixStride`
/// from a position on. Returns whether its columns lie together, and the bytes between them or
/// between rows.
///
/// Optimal layouts are rows without gaps: of the matrix that is stored, which has a row for each
/// column of the product's matrix if it is transposed.
fn layout(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    at: usize,
    (rows, columns): (u32, u32),
    component: MatrixComponent,
) -> Result<(bool, MatrixStride)> {
    let opcode = instruction.opcode;
    let (id, transpose) = (translator.id(instruction, at)?, translator.id(instruction, at + 1)?);
    let transposed = match translator.words(transpose)?[..] {
        [word] => translator.constant_word(word),
        _ => None,
    };
    let transposed = transposed.ok_or_else(|| {
        translator.invalid(format!("{opcode}: Transpose must be a constant bool")).note(EXTENSION)
    })? != 0;
    let is_column_major = match matrix_layout(translator, opcode, id)? {
        Layout::RowMajorNV => false,
        Layout::ColumnMajorNV => true,
        _ => {
            let line = if transposed { rows } else { columns };
            return Ok((transposed, MatrixStride::Known(line * (component.width() / 8))));
        }
    };
    if transposed {
        let message =
            format!("{opcode}: a matrix in the layouts RowMajorNV and ColumnMajorNV is not transposed");
        return Err(translator.invalid(message).note(EXTENSION));
    }
    Ok((is_column_major, stride(translator, instruction, at + 2)?))
}

fn matrix_layout(translator: &mut Translator<'_>, opcode: Opcode, id: Id) -> Result<Layout> {
    let number = translator.constant_integer(id)?;
    u32::try_from(number).ok().and_then(Layout::from_u32).ok_or_else(|| {
        let message = format!("{opcode}: {number} is not a layout of matrices");
        translator.invalid(message).note(EXTENSION)
    })
}

/// The operand `MatrixStride`.
fn stride(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<MatrixStride> {
    let opcode = instruction.opcode;
    let Ok(id) = translator.id(instruction, at) else {
        let message = format!("{opcode}: the layout of the matrix requires MatrixStride");
        return Err(translator.invalid(message).note(EXTENSION));
    };
    let stride = translator.integer(id, ReadAs::Unsigned)?;
    Ok(translator.constant_word(stride).map_or(MatrixStride::Computed(stride), MatrixStride::Known))
}

/// A float or integer that is added to memory.
fn accumulated(
    translator: &Translator<'_>,
    opcode: Opcode,
    component: MatrixComponent,
) -> Result<AtomicKind> {
    match component {
        MatrixComponent::Float(FloatFormat::Binary16 | FloatFormat::Binary32) => Ok(AtomicKind::FAdd),
        MatrixComponent::Int { width: 32, .. } => Ok(AtomicKind::Add),
        _ => Err(translator.unsupported(format!("{opcode} into memory of {component} is not supported"))),
    }
}

/// Adds a register to memory.
fn emit_sum(
    translator: &mut Translator<'_>,
    pointer: &Pointer,
    kind: AtomicKind,
    width: u32,
    value: Reg,
) -> Result<()> {
    let chunk = chunk(translator, pointer, width, 1, 1)?;
    let comparator = translator.wide_constant(0)?;
    let to = translator.fresh(1)?;
    let alignment = if pointer.is_packed(translator) { 4 } else { width / 8 };
    let target = AtomicTarget::Buffer(Chunk { width, ..chunk });
    translator.emit(Op::Atomic(Box::new(AtomicOp {
        kind,
        width,
        component: (0, 1),
        alignment,
        target,
        to,
        value,
        comparator,
    })));
    Ok(())
}

/// `OpCooperativeVectorReduceSumAccumulateNV`: an atomic addition for each component.
fn accumulate_sum(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let id = translator.id(instruction, 2)?;
    let ty = translator.type_of(id)?;
    let (component, count) = vector(translator, opcode, ty)?;
    let name = translator.module.describe_type(component);
    let component = MatrixComponent::of(translator.module.ty(component), true);
    let component = component
        .ok_or_else(|| translator.unsupported(format!("{opcode} into memory of {name} is not supported")))?;
    let kind = accumulated(translator, opcode, component)?;
    let pointer = array_pointer(translator, instruction, 0, true)?;
    let bytes = chunk(translator, &pointer, component.width(), count, 1)?.width / 8;
    for (at, value) in (0..).zip(translator.words(id)?) {
        let mut part = pointer.clone();
        part.offset += at * bytes;
        emit_sum(translator, &part, kind, component.width(), value)?;
    }
    Ok(())
}

/// `OpCooperativeVectorOuterProductAccumulateNV`: a product and an atomic addition for each
/// element of the matrix, row by row.
fn accumulate_outer(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let [a, b, layout, read_as] = [2, 3, 4, 5].map(|at| translator.id(instruction, at));
    let (a, b, layout, read_as) = (a?, b?, layout?, read_as?);
    let types = [translator.type_of(a)?, translator.type_of(b)?];
    let (left, rows) = vector(translator, opcode, types[0])?;
    let (right, columns) = vector(translator, opcode, types[1])?;
    if left != right {
        let [left, right] = [left, right].map(|ty| translator.module.describe_type(ty));
        let message = format!("{opcode}: vectors of {left} and of {right}");
        return Err(translator.invalid(message).note(EXTENSION));
    }
    let component = memory_interpretation(translator, read_as)?;
    let kind = accumulated(translator, opcode, component)?;
    let own = MatrixComponent::of(translator.module.ty(left), true);
    let own = own.filter(|own| own.is_float() == component.is_float() && matches!(own.width(), 16 | 32));
    let own = own.filter(|own| {
        !matches!(own, MatrixComponent::Float(FloatFormat::BFloat16) | MatrixComponent::Int { width: 16, .. })
    });
    let own = own.ok_or_else(|| {
        let name = translator.module.describe_type(left);
        translator.unsupported(format!("{opcode} of {name} into memory of {component} is not supported"))
    })?;
    let line = columns.checked_mul(component.width() / 8);
    let line = line.ok_or_else(|| translator.unsupported("an offset beyond 4 GiB is not supported"))?;
    let (is_column_major, stride) = match matrix_layout(translator, opcode, layout)? {
        Layout::RowMajorNV => (false, stride(translator, instruction, 6)?),
        Layout::ColumnMajorNV => (true, stride(translator, instruction, 6)?),
        _ => (false, MatrixStride::Known(line)),
    };
    let pointer = array_pointer(translator, instruction, 0, true)?;
    let bytes = chunk(translator, &pointer, component.width(), 1, 1)?.width / 8;
    let scale = bytes / (component.width() / 8);
    let lefts = wide_floats(translator, a, own)?;
    let rights = wide_floats(translator, b, own)?;
    let multiply = if component.is_float() { &arithmetic::FMul } else { &arithmetic::IMul };
    let stride = match stride {
        MatrixStride::Known(stride) => translator.constant(stride)?,
        MatrixStride::Computed(register) => register,
    };
    let (lines, length) = if is_column_major { (columns, rows) } else { (rows, columns) };
    // The offset of each line is computed once.
    let mut starts = Vec::new();
    for at in 0..lines {
        let at = translator.constant(at)?;
        let offset = translator.emit_family(&arithmetic::IMul, 32, &[stride, at])?;
        let mut start = pointer.clone();
        shift(translator, &mut start, offset, scale)?;
        starts.push(start);
    }
    for line in 0..lines {
        for at in 0..length {
            let (row, column) = if is_column_major { (at, line) } else { (line, at) };
            let factors = [lefts[row as usize], rights[column as usize]];
            let mut value = translator.emit_family(multiply, 32, &factors)?;
            if component.width() == 16
                && let Some(kernel) = conversion::kernel(Conversion::F, 32, 16)
            {
                value = translator.emit_kernel(kernel, &[value])?;
            }
            let mut part = starts[line as usize].clone();
            let offset = at.checked_mul(bytes).and_then(|bytes| part.offset.checked_add(bytes));
            part.offset =
                offset.ok_or_else(|| translator.unsupported("an offset beyond 4 GiB is not supported"))?;
            emit_sum(translator, &part, kind, component.width(), value)?;
        }
    }
    Ok(())
}

/// The components of a vector, f16 as f32.
fn wide_floats(translator: &mut Translator<'_>, id: Id, own: MatrixComponent) -> Result<Words> {
    let components = translator.words(id)?;
    match conversion::kernel(Conversion::F, 16, 32).filter(|_| own.width() == 16) {
        Some(kernel) => {
            components.iter().map(|&component| translator.emit_kernel(kernel, &[component])).collect()
        }
        None => Ok(components),
    }
}
