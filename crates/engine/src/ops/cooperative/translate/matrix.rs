//! Translates the instructions of cooperative matrices to operations.

use rspirv::spirv::{
    CooperativeMatrixLayout as Layout, CooperativeMatrixOperands as Operands, CooperativeMatrixUse as Use,
    Scope,
};
use smallvec::SmallVec;

use crate::machine::Reg;
use crate::math::float_format::FloatFormat;
use crate::module::interface::Stage;
use crate::module::ty::{Type, TypeId};
use crate::module::{Instruction, Opcode};
use crate::ops::arithmetic::{IAdd, IMul, UDiv};
use crate::ops::builtin;
use crate::ops::cooperative::CooperativeOp;
use crate::ops::cooperative::component::MatrixComponent;
use crate::ops::cooperative::matrix::{
    MatrixAccess, MatrixOp, MatrixProduct, MatrixRegisters, MatrixTranspose, register_count,
};
use crate::ops::cooperative::vector::MatrixStride;
use crate::ops::integer_operand::ReadAs;
use crate::ops::memory::Chunk;
use crate::ops::op::Op;
use crate::ops::pointer::{Pointer, PointerBase, alignment, storage};
use crate::ops::translate::{InputRegisters, Translator};
use crate::ops::untyped_pointer::is_untyped;
use crate::ops::value_registers::{Words, registers_from};
use anyhit_base::error::{Error, Result};

/// The specification of cooperative matrices.
const EXTENSION: &str = "SPV_KHR_cooperative_matrix";
/// The specification of conversions between uses.
const MATRIX2: &str = "SPV_NV_cooperative_matrix2";
/// The most rows and columns.
const MAX_SIDE: u64 = 256;

/// A cooperative matrix type.
#[derive(Clone, Copy)]
struct MatrixType {
    component: TypeId,
    rows: u32,
    columns: u32,
    usage: Use,
}

/// Translates the instructions of cooperative matrices; `false` for any other.
pub(super) fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    match instruction.opcode {
        Opcode::CooperativeMatrixLoadKHR => load(translator, instruction)?,
        Opcode::CooperativeMatrixStoreKHR => store(translator, instruction)?,
        Opcode::CooperativeMatrixMulAddKHR => multiply(translator, instruction)?,
        Opcode::CooperativeMatrixLengthKHR => length(translator, instruction)?,
        Opcode::CooperativeMatrixConvertNV => convert_use(translator, instruction)?,
        Opcode::CooperativeMatrixTransposeNV => transpose(translator, instruction)?,
        Opcode::MatrixTimesScalar => return times_scalar(translator, instruction),
        _ => return Ok(false),
    }
    Ok(true)
}

/// The parts of a cooperative matrix type.
fn matrix_type(translator: &mut Translator<'_>, opcode: Opcode, ty: TypeId) -> Result<MatrixType> {
    let Some(matrix) = translator.module.cooperative_matrix(ty).copied() else {
        let name = translator.module.describe_type(ty);
        let message = format!("{opcode}: a cooperative matrix is required, not {name}");
        return Err(translator.invalid(message).note(EXTENSION));
    };
    if translator.stage != Stage::Compute {
        return Err(translator.unsupported(format!("{opcode} outside of compute shaders is not supported")));
    }
    let scope = translator.constant_integer(matrix.scope)?;
    if scope != Scope::Subgroup as u64 {
        let name = u32::try_from(scope).ok().and_then(Scope::from_u32);
        let name = name.map_or_else(|| scope.to_string(), |name| format!("{name:?}"));
        return Err(translator.unsupported(format!(
            "a cooperative matrix of scope {name} is not supported: of scope Subgroup it is"
        )));
    }
    let [rows, columns] = [matrix.rows, matrix.columns].map(|id| translator.constant_integer(id));
    let (rows, columns) = (rows?, columns?);
    if !(1..=MAX_SIDE).contains(&rows) || !(1..=MAX_SIDE).contains(&columns) {
        return Err(translator.unsupported(format!(
            "a cooperative matrix of {rows} rows and {columns} columns is not supported: up to {MAX_SIDE} are"
        )));
    }
    let usage = translator.constant_integer(matrix.usage)?;
    let usage = u32::try_from(usage).ok().and_then(Use::from_u32).ok_or_else(|| {
        translator.invalid(format!("{usage} is not a use of cooperative matrices")).note(EXTENSION)
    })?;
    let Type::Vector { component, .. } = *translator.module.ty(ty) else {
        return Err(translator
            .invalid(format!("{opcode}: a cooperative matrix is required"))
            .note(EXTENSION));
    };
    Ok(MatrixType { component, rows: rows as u32, columns: columns as u32, usage })
}

/// The component type of a matrix that is loaded, stored or multiplied.
fn component(
    translator: &Translator<'_>,
    opcode: Opcode,
    ty: TypeId,
    signed: bool,
) -> Result<MatrixComponent> {
    MatrixComponent::of(translator.module.ty(ty), signed).ok_or_else(|| {
        let name = translator.module.describe_type(ty);
        translator.unsupported(format!("{opcode} of a cooperative matrix of {name} is not supported"))
    })
}

fn load(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let ty = translator.result_type(instruction)?;
    let matrix = matrix_type(translator, instruction.opcode, ty)?;
    let mut access = access(translator, instruction, matrix, false)?;
    let count = register_count(matrix.rows, matrix.columns);
    access.matrix.first = translator.fresh(count)?;
    let first = access.matrix.first;
    emit(translator, MatrixOp::Access(access));
    translator.define_result(instruction, registers_from(first, count));
    Ok(())
}

fn store(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let object = translator.id(instruction, 1)?;
    let ty = translator.type_of(object)?;
    let matrix = matrix_type(translator, instruction.opcode, ty)?;
    let mut access = access(translator, instruction, matrix, true)?;
    let words = translator.words(object)?;
    access.matrix.first = translator.consecutive(&words)?;
    emit(translator, MatrixOp::Access(access));
    Ok(())
}

fn emit(translator: &mut Translator<'_>, op: MatrixOp) {
    translator.emit(Op::Cooperative(Box::new(CooperativeOp::Matrix(op))));
}

/// The access of a load or store, without its registers.
fn access(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    matrix: MatrixType,
    stores: bool,
) -> Result<MatrixAccess> {
    let opcode = instruction.opcode;
    let behind = if stores { 2 } else { 1 };
    let id = translator.id(instruction, 0)?;
    let pointer = translator.pointer(id)?;
    let is_data = matches!(
        translator.module.ty(pointer.pointee),
        Type::Int { .. } | Type::Float { .. } | Type::Vector { .. }
    );
    let (true, false, &PointerBase::Buffer(buffer)) = (is_data, is_untyped(translator, id)?, &pointer.base)
    else {
        let message =
            format!("{opcode}: a pointer to a scalar or vector of an array in a buffer is required");
        return Err(translator.invalid(message).note(EXTENSION));
    };
    if !matches!(
        pointer.storage_class,
        storage::STORAGE_BUFFER | storage::PHYSICAL_STORAGE_BUFFER | storage::WORKGROUP
    ) {
        let class = crate::module::names::storage_class_name(pointer.storage_class);
        let message = format!("{opcode}: a pointer to {class}");
        return Err(translator.invalid(message).note("VUID-RuntimeSpirv-OpCooperativeMatrixLoadKHR-08973"));
    }
    let component = component(translator, opcode, matrix.component, false)?;
    let (pitch, element) = pitch(translator, opcode, &pointer, component)?;
    let layout = translator.id(instruction, behind).and_then(|id| translator.constant_integer(id))?;
    let is_column_major = match u32::try_from(layout).ok().and_then(Layout::from_u32) {
        Some(Layout::RowMajorKHR) => false,
        Some(Layout::ColumnMajorKHR) => true,
        Some(other) => {
            return Err(translator.unsupported(format!("{opcode}: the layout {other:?} is not supported")));
        }
        None => {
            let message = format!("{opcode}: {layout} is not a layout of cooperative matrices");
            return Err(translator.invalid(message).note(EXTENSION));
        }
    };
    let stride = stride(translator, instruction, behind + 1, element)?;
    let aligned = alignment(translator, instruction, behind + 2)?;
    let memory = Chunk {
        buffer,
        offset: pointer.offset,
        index: pointer.index,
        width: 8,
        count: 1,
        alignment: aligned.max(component.width() / 8),
    };
    let MatrixType { rows, columns, .. } = matrix;
    let matrix = MatrixRegisters { first: Reg(0), rows, columns, component };
    let mut access = MatrixAccess { matrix, stores, memory, pitch, is_column_major, stride };
    let least = if let MatrixStride::Known(stride) = stride { stride } else { 0 };
    let bytes = u32::try_from(access.extent(least)).ok();
    let fits = bytes.filter(|&bytes| pointer.offset.checked_add(bytes).is_some());
    access.memory.count = fits.ok_or_else(|| beyond_4_gib(translator))?;
    Ok(access)
}

fn beyond_4_gib(translator: &Translator<'_>) -> Error {
    translator.unsupported("an offset beyond 4 GiB is not supported")
}

/// The bytes from a component in memory to the next, and of the type that is pointed to.
fn pitch(
    translator: &Translator<'_>,
    opcode: Opcode,
    pointer: &Pointer,
    component: MatrixComponent,
) -> Result<(u32, u32)> {
    let width = translator.scalar_width(pointer.pointee)?;
    let count = translator.component_count(pointer.pointee);
    if !pointer.is_packed(translator) || width >= 32 {
        return Ok((component.width() / 8, count * (width / 8)));
    }
    // Workgroup memory without a layout has a word for each scalar.
    match component.width() == width {
        true => Ok((4, count * 4)),
        false => {
            let name = translator.module.describe_type(pointer.pointee);
            Err(translator.unsupported(format!(
                "{opcode} of components of another width in workgroup memory of {name} is not supported"
            )))
        }
    }
}

/// The operand `Stride`, which counts elements of the type that is pointed to, in bytes.
fn stride(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    at: usize,
    element: u32,
) -> Result<MatrixStride> {
    let opcode = instruction.opcode;
    let Ok(id) = translator.id(instruction, at) else {
        let message = format!("{opcode}: the layout of the matrix requires Stride");
        return Err(translator.invalid(message).note(EXTENSION));
    };
    let elements = translator.integer(id, ReadAs::Unsigned)?;
    if let Some(elements) = translator.constant_word(elements) {
        let bytes = elements.checked_mul(element).ok_or_else(|| beyond_4_gib(translator))?;
        return Ok(MatrixStride::Known(bytes));
    }
    let element = translator.constant(element)?;
    Ok(MatrixStride::Computed(translator.emit_family(&IMul, 32, &[elements, element])?))
}

/// `OpCooperativeMatrixMulAddKHR`
fn multiply(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let result = translator.result_type(instruction)?;
    let ids = [0, 1, 2].map(|at| translator.id(instruction, at));
    let [left, right, addend] = ids;
    let ids = [left?, right?, addend?];
    let mut types: SmallVec<[MatrixType; 4]> = SmallVec::new();
    types.push(matrix_type(translator, opcode, result)?);
    for id in ids {
        let ty = translator.type_of(id)?;
        types.push(matrix_type(translator, opcode, ty)?);
    }
    let uses = [Use::MatrixAccumulatorKHR, Use::MatrixAKHR, Use::MatrixBKHR, Use::MatrixAccumulatorKHR];
    for (name, (found, expected)) in ["the result", "A", "B", "C"].into_iter().zip(types.iter().zip(uses)) {
        if found.usage != expected {
            let message =
                format!("{opcode}: {name} is declared for the use {:?} instead of {expected:?}", found.usage);
            return Err(translator.invalid(message).note(EXTENSION));
        }
    }
    let [own, a, b, c] = types[..] else { return Ok(()) };
    if [own.rows, own.columns, a.columns] != [a.rows, b.columns, b.rows]
        || [c.rows, c.columns] != [own.rows, own.columns]
    {
        let shape = |ty: MatrixType| format!("{}x{}", ty.rows, ty.columns);
        let message =
            format!("{opcode}: {} times {} plus {} is not {}", shape(a), shape(b), shape(c), shape(own));
        return Err(translator.invalid(message).note(EXTENSION));
    }
    let flags = Operands::from_bits_retain(translator.operands(instruction).get(3).copied().unwrap_or(0));
    let signs = [
        Operands::MATRIX_RESULT_SIGNED_COMPONENTS_KHR,
        Operands::MATRIX_A_SIGNED_COMPONENTS_KHR,
        Operands::MATRIX_B_SIGNED_COMPONENTS_KHR,
        Operands::MATRIX_C_SIGNED_COMPONENTS_KHR,
    ];
    let mut matrices: SmallVec<[MatrixRegisters; 4]> = SmallVec::new();
    for (ty, sign) in types.iter().zip(signs) {
        let component = component(translator, opcode, ty.component, flags.contains(sign))?;
        matrices.push(MatrixRegisters { first: Reg(0), rows: ty.rows, columns: ty.columns, component });
    }
    let is_float = matrices[0].component.is_float();
    if matrices.iter().any(|matrix| matrix.component.is_float() != is_float) {
        let names: Vec<String> = matrices.iter().map(|matrix| matrix.component.to_string()).collect();
        let message = format!("{opcode} of both floats and integers ({}) is not supported", names.join(", "));
        return Err(translator.unsupported(message));
    }
    if let MatrixComponent::Float(FloatFormat::E4M3 | FloatFormat::E5M2) = matrices[0].component {
        let message = format!("{opcode} with a result of {} is not supported", matrices[0].component);
        return Err(translator.unsupported(message));
    }
    for (matrix, id) in matrices[1..].iter_mut().zip(ids) {
        let words = translator.words(id)?;
        matrix.first = translator.consecutive(&words)?;
    }
    let count = matrices[0].count();
    let first = translator.fresh(count)?;
    let saturates = flags.contains(Operands::SATURATING_ACCUMULATION_KHR);
    let [result, left, right, addend] = matrices[..] else { return Ok(()) };
    let result = MatrixRegisters { first, ..result };
    emit(translator, MatrixOp::Product(MatrixProduct { result, left, right, addend, saturates }));
    translator.define_result(instruction, registers_from(first, count));
    Ok(())
}

/// `OpCooperativeMatrixConvertNV`: components are spread the same way whatever the use.
fn convert_use(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let (result, operand) = unary(translator, instruction)?;
    if [result.rows, result.columns] != [operand.rows, operand.columns]
        || !matches!(result.usage, Use::MatrixAKHR | Use::MatrixBKHR)
    {
        let message = format!("{opcode} converts an accumulator to a matrix A or B of its shape");
        return Err(translator.invalid(message).note(MATRIX2));
    }
    let words = translator.operand(instruction, 0)?;
    translator.define_result(instruction, words);
    Ok(())
}

/// `OpCooperativeMatrixTransposeNV`
fn transpose(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let (result, operand) = unary(translator, instruction)?;
    if [result.rows, result.columns] != [operand.columns, operand.rows] || result.usage != Use::MatrixBKHR {
        let message = format!("{opcode} converts an accumulator to a matrix B of the transposed shape");
        return Err(translator.invalid(message).note(MATRIX2));
    }
    let component = component(translator, opcode, operand.component, false)?;
    let words = translator.operand(instruction, 0)?;
    let first = translator.consecutive(&words)?;
    let MatrixType { rows, columns, .. } = operand;
    let operand = MatrixRegisters { first, rows, columns, component };
    let count = register_count(rows, columns);
    let first = translator.fresh(count)?;
    let result = MatrixRegisters { first, rows: columns, columns: rows, component };
    emit(translator, MatrixOp::Transpose(MatrixTranspose { result, operand }));
    translator.define_result(instruction, registers_from(first, count));
    Ok(())
}

/// The types of the result and of the operand, an accumulator with the same components.
fn unary(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<(MatrixType, MatrixType)> {
    let opcode = instruction.opcode;
    let ty = translator.result_type(instruction)?;
    let result = matrix_type(translator, opcode, ty)?;
    let ty = translator.id(instruction, 0).and_then(|id| translator.type_of(id))?;
    let operand = matrix_type(translator, opcode, ty)?;
    if result.component != operand.component || operand.usage != Use::MatrixAccumulatorKHR {
        let message =
            format!("{opcode}: the operand must be an accumulator with the components of the result");
        return Err(translator.invalid(message).note(MATRIX2));
    }
    Ok((result, operand))
}

/// `OpCooperativeMatrixLengthKHR`: the components of a matrix, divided by the size of the subgroup
/// and rounded up.
fn length(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let id = translator.id(instruction, 0)?;
    let ty = translator.type_id(id)?;
    let matrix = matrix_type(translator, instruction.opcode, ty)?;
    let size = subgroup_size(translator)?;
    let more = translator.constant(matrix.rows * matrix.columns - 1)?;
    let sum = translator.emit_family(&IAdd, 32, &[size, more])?;
    let length = translator.emit_family(&UDiv, 32, &[sum, size])?;
    translator.define_result(instruction, SmallVec::from_slice(&[length]));
    Ok(())
}

/// The register of `SubgroupSize`.
fn subgroup_size(translator: &mut Translator<'_>) -> Result<Reg> {
    const SUBGROUP_SIZE: u32 = 36;
    if let Some(input) = translator.inputs.iter().find(|input| input.builtin.number == SUBGROUP_SIZE) {
        return Ok(input.first);
    }
    let builtin = builtin::find(SUBGROUP_SIZE)
        .ok_or_else(|| translator.unsupported("the builtin SubgroupSize is not supported"))?;
    let first = translator.fresh(1)?;
    translator.inputs.push(InputRegisters { builtin, first, count: 1 });
    Ok(first)
}

/// `OpMatrixTimesScalar` of integers, which only cooperative matrices have.
fn times_scalar(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let ty = translator.result_type(instruction)?;
    let is_matrix = translator.module.cooperative_matrix(ty).is_some();
    if !is_matrix || translator.float_format(ty).is_some() {
        return Ok(false);
    }
    let (matrix, scalar) = (translator.id(instruction, 0)?, translator.id(instruction, 1)?);
    let (components, width) = translator.components_of_width(matrix)?;
    let factor = translator.components(scalar)?[0];
    let mut products = Words::new();
    for component in components {
        products.push(translator.emit_family(&IMul, width, &[component, factor])?);
    }
    let words = translator.expand_components(&products, width);
    translator.define_result(instruction, words);
    Ok(true)
}
