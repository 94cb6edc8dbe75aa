//! Instructions that are sums of products: `OpDot`, the matrix products, and what
//! `GLSL.std.450` defines by a formula over whole vectors. Each follows its formula operation by
//! operation, left to right, each rounded.

use rspirv::spirv::{Capability, GlslStd450Op};
use smallvec::SmallVec;

use crate::machine::Reg;
use crate::math::float_format::FloatFormat;
use crate::module::ty::Type;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::arithmetic::{FAdd, FMul, FNegate, FSub};
use crate::ops::conversion::encoded;
use crate::ops::glsl::{InverseSqrt, Sqrt};
use crate::ops::observed;
use crate::ops::relational_logical::{FOrdLessThan, select::SelectWord};
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::Dot,
    Opcode::VectorTimesScalar,
    Opcode::MatrixTimesScalar,
    Opcode::VectorTimesMatrix,
    Opcode::MatrixTimesVector,
    Opcode::MatrixTimesMatrix,
    Opcode::OuterProduct,
];

/// `GLSL.std.450` instructions translated here.
pub const GLSL: &[GlslStd450Op] = &[
    GlslStd450Op::Determinant,
    GlslStd450Op::MatrixInverse,
    GlslStd450Op::Length,
    GlslStd450Op::Distance,
    GlslStd450Op::Cross,
    GlslStd450Op::Normalize,
    GlslStd450Op::FaceForward,
    GlslStd450Op::Reflect,
    GlslStd450Op::Refract,
];

/// Float arithmetic at one width.
struct FloatEmitter<'a, 'm> {
    translator: &'a mut Translator<'m>,
    width: u32,
}

impl FloatEmitter<'_, '_> {
    fn add(&mut self, a: Reg, b: Reg) -> Result<Reg> {
        self.translator.emit_family(&FAdd, self.width, &[a, b])
    }
    fn sub(&mut self, a: Reg, b: Reg) -> Result<Reg> {
        self.translator.emit_family(&FSub, self.width, &[a, b])
    }
    fn mul(&mut self, a: Reg, b: Reg) -> Result<Reg> {
        self.translator.emit_family(&FMul, self.width, &[a, b])
    }
    fn dot(&mut self, a: &[Reg], b: &[Reg]) -> Result<Reg> {
        let mut sum = self.mul(a[0], b[0])?;
        for (&a, &b) in a.iter().zip(b).skip(1) {
            let product = self.mul(a, b)?;
            sum = self.add(sum, product)?;
        }
        Ok(sum)
    }
    /// Shows a sanitizer the square of the length of a vector that should have length 1.
    fn observe_length(&mut self, vector: &[Reg]) -> Result<()> {
        if !self.translator.optimizes && self.width == 32 {
            let square = self.dot(vector, vector)?;
            self.translator.emit_family(&observed::SquaredLength, self.width, &[square])?;
        }
        Ok(())
    }
    /// A float constant of this width.
    fn constant(&mut self, value: f64) -> Result<Reg> {
        match self.width {
            16 => self.translator.constant(crate::math::float::f64_to_f16(value).to_bits().into()),
            32 => self.translator.constant((value as f32).to_bits()),
            _ => self.translator.wide_constant(value.to_bits()),
        }
    }
    /// Selects one of two scalars.
    fn select(&mut self, condition: Reg, a: Reg, b: Reg) -> Result<Reg> {
        let kernel = &SelectWord.kernels[0];
        let low = self.translator.emit_kernel(kernel, &[condition, a, b])?;
        if self.width < 64 {
            return Ok(low);
        }
        let high = self.translator.emit_kernel(kernel, &[condition, a.plus(1), b.plus(1)])?;
        self.translator.pair(low, high)
    }
    /// The determinant by expansion along the first column.
    fn determinant(&mut self, columns: &[Words]) -> Result<Reg> {
        match columns.len() {
            1 => Ok(columns[0][0]),
            2 => {
                let a = self.mul(columns[0][0], columns[1][1])?;
                let b = self.mul(columns[1][0], columns[0][1])?;
                self.sub(a, b)
            }
            size => {
                let mut sum: Option<Reg> = None;
                for row in 0..size {
                    let minor = self.minor(columns, 0, row)?;
                    let term = self.mul(columns[0][row], minor)?;
                    sum = Some(match sum {
                        None => term,
                        Some(sum) if row % 2 == 1 => self.sub(sum, term)?,
                        Some(sum) => self.add(sum, term)?,
                    });
                }
                sum.ok_or_else(|| self.translator.invalid("the matrix of a determinant is empty"))
            }
        }
    }
    fn minor(&mut self, columns: &[Words], column: usize, row: usize) -> Result<Reg> {
        let rest: Vec<Words> = columns
            .iter()
            .enumerate()
            .filter(|&(at, _)| at != column)
            .map(|(_, column)| {
                column.iter().enumerate().filter(|&(at, _)| at != row).map(|(_, &reg)| reg).collect()
            })
            .collect();
        self.determinant(&rest)
    }
}

/// Translates core instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    let (a, b) = (translator.id(instruction, 0)?, translator.id(instruction, 1)?);
    let is_matrix = |translator: &Translator<'_>, id| {
        translator
            .module
            .type_of(id)
            .is_some_and(|ty| matches!(translator.module.ty(ty), Type::Matrix { .. }))
    };
    let width = match is_matrix(translator, a) {
        true => scalar_width_of_matrix(translator, a)?,
        false => translator.type_of(a).and_then(|ty| translator.scalar_width(ty))?,
    };
    let components = |translator: &mut Translator<'_>, id: Id| match is_matrix(translator, id) {
        true => columns(translator, id).map(|columns| columns.concat().into()),
        false => translator.components(id),
    };
    let left: Words = components(translator, a)?;
    let right: Words = components(translator, b)?;
    let columns_of_a = if is_matrix(translator, a) { columns(translator, a)? } else { Vec::new() };
    let columns_of_b = if is_matrix(translator, b) { columns(translator, b)? } else { Vec::new() };
    if translator.type_of(a).is_ok_and(|ty| translator.float_format(ty) == Some(FloatFormat::BFloat16)) {
        return dot_of_bfloat16(translator, instruction, &left, &right);
    }
    let mut scalars = FloatEmitter { translator, width };
    let mut result = Words::new();
    let agree = match opcode {
        Opcode::Dot => left.len() == right.len(),
        Opcode::MatrixTimesVector => columns_of_a.len() == right.len(),
        Opcode::VectorTimesMatrix => columns_of_b.first().is_some_and(|column| column.len() == left.len()),
        Opcode::MatrixTimesMatrix => {
            columns_of_b.first().is_some_and(|column| column.len() == columns_of_a.len())
        }
        _ => true,
    };
    // Columns and rows of a result that is a matrix.
    let shape = match opcode {
        Opcode::OuterProduct => Some((right.len(), left.len())),
        Opcode::MatrixTimesMatrix => {
            Some((columns_of_b.len(), columns_of_a.first().map_or(0, SmallVec::len)))
        }
        _ => None,
    };
    let agree = agree && have_one_scalar_type(scalars.translator, instruction)?;
    if let Some((columns, rows)) = shape {
        check_shape(scalars.translator, instruction, columns, rows)?;
    }
    if !agree || left.is_empty() || right.is_empty() {
        return Err(scalars.translator.invalid("the operands of a product do not match"));
    }
    match opcode {
        Opcode::Dot => result.push(scalars.dot(&left, &right)?),
        Opcode::VectorTimesScalar | Opcode::MatrixTimesScalar => {
            for &component in &left {
                result.push(scalars.mul(component, right[0])?);
            }
        }
        Opcode::OuterProduct => {
            for &b in &right {
                for &a in &left {
                    result.push(scalars.mul(a, b)?);
                }
            }
        }
        Opcode::VectorTimesMatrix => {
            for column in &columns_of_b {
                result.push(scalars.dot(&left, column)?);
            }
        }
        _ => {
            let vectors = if opcode == Opcode::MatrixTimesVector { vec![right] } else { columns_of_b };
            for vector in vectors {
                for row in 0..columns_of_a[0].len() {
                    let matrix_row: Words = columns_of_a.iter().map(|column| column[row]).collect();
                    result.push(scalars.dot(&matrix_row, &vector)?);
                }
            }
        }
    }
    let words = translator.expand_components(&result, width);
    translator.define_result(instruction, words);
    Ok(true)
}

/// `OpDot` of bfloat16, in f32 and rounded to bfloat16 at the end: "the accuracy ... is the same as
/// operations on IEEE754 binary32 floating-point values, with the result rounded ...; it is
/// implementation-defined whether intermediate values are rounded" (`SPV_KHR_bfloat16`, "FP
/// Encoding").
fn dot_of_bfloat16(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    left: &[Reg],
    right: &[Reg],
) -> Result<bool> {
    const DOT_PRODUCT: u32 = Capability::BFloat16DotProductKHR as u32;
    if !translator.module.capabilities.contains(&DOT_PRODUCT) {
        let message = "OpDot of bfloat16_t requires the capability BFloat16DotProductKHR \
                       (SPV_KHR_bfloat16, Arithmetic Instructions)";
        return Err(translator.invalid(message));
    }
    let second = translator.type_of(translator.id(instruction, 1)?)?;
    let same = [second, translator.result_type(instruction)?]
        .iter()
        .all(|&ty| translator.float_format(ty) == Some(FloatFormat::BFloat16));
    if !same || left.len() != right.len() {
        return Err(translator.invalid("the operands of a product do not match"));
    }
    let mut wide = [Words::new(), Words::new()];
    for (wide, narrow) in wide.iter_mut().zip([left, right]) {
        for &component in narrow {
            wide.push(encoded::widen(translator, FloatFormat::BFloat16, component)?.0);
        }
    }
    let sum = FloatEmitter { translator, width: 32 }.dot(&wide[0], &wide[1])?;
    let result = translator.emit_family(&encoded::ToBFloat16, 32, &[sum])?;
    translator.define_result(instruction, SmallVec::from_slice(&[result]));
    Ok(true)
}

/// Checks the shape of an instruction's result against that of the computed matrix.
///
/// # Errors
/// `InvalidModule` where the result is no matrix of so many columns and rows.
pub fn check_shape(
    translator: &Translator<'_>,
    instruction: &Instruction,
    columns: usize,
    rows: usize,
) -> Result<()> {
    let ty = translator.result_type(instruction)?;
    if let Type::Matrix { column, count } = *translator.module.ty(ty)
        && count as usize == columns
        && translator.component_count(column) as usize == rows
    {
        return Ok(());
    }
    let (name, opcode) = (translator.module.describe_type(ty), instruction.opcode);
    Err(translator.invalid(format!("{opcode} computes {columns} columns of {rows}, not {name}")))
}

/// Whether the result and all operands have scalars of one type, a float.
pub fn have_one_scalar_type(translator: &Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let scalar = |mut ty| {
        while let Type::Vector { component: part, .. } | Type::Matrix { column: part, .. } =
            *translator.module.ty(ty)
        {
            ty = part;
        }
        ty
    };
    let result = scalar(translator.result_type(instruction)?);
    for &id in translator.operands(instruction) {
        if scalar(translator.type_of(Id(id))?) != result {
            return Ok(false);
        }
    }
    Ok(matches!(translator.module.ty(result), Type::Float { .. }))
}

/// Translates a `GLSL.std.450` instruction; its operands begin after set and number.
pub fn translate_glsl(
    translator: &mut Translator<'_>,
    number: GlslStd450Op,
    instruction: &Instruction,
) -> Result<bool> {
    if !GLSL.contains(&number) {
        return Ok(false);
    }
    let first = translator.id(instruction, 2)?;
    if matches!(number, GlslStd450Op::Determinant | GlslStd450Op::MatrixInverse) {
        let width = scalar_width_of_matrix(translator, first)?;
        let columns = columns(translator, first)?;
        if columns.iter().any(|column| column.len() != columns.len()) {
            return Err(translator.invalid("the matrix must be square"));
        }
        let mut scalars = FloatEmitter { translator, width };
        let determinant = scalars.determinant(&columns)?;
        let mut result = Words::new();
        if number == GlslStd450Op::Determinant {
            result.push(determinant);
        } else {
            // The adjugate over the determinant: element (row i, column j) is the cofactor (j, i).
            let one = scalars.constant(1.0)?;
            let scale =
                scalars.translator.emit_family(&crate::ops::arithmetic::FDiv, width, &[one, determinant])?;
            for column in 0..columns.len() {
                for row in 0..columns.len() {
                    let minor = match columns.len() {
                        1 => one,
                        _ => scalars.minor(&columns, row, column)?,
                    };
                    let cofactor = match (row + column) % 2 {
                        0 => minor,
                        _ => scalars.translator.emit_family(&FNegate, width, &[minor])?,
                    };
                    result.push(scalars.mul(cofactor, scale)?);
                }
            }
        }
        let words = translator.expand_components(&result, width);
        translator.define_result(instruction, words);
        return Ok(true);
    }
    let width = translator.type_of(first).and_then(|ty| translator.scalar_width(ty))?;
    let mut operands: SmallVec<[Words; 3]> = SmallVec::new();
    for &id in &translator.operands(instruction)[2..] {
        operands.push(translator.components(Id(id))?);
    }
    let size = operands[0].len();
    let mut s = FloatEmitter { translator, width };
    let expected = match number {
        GlslStd450Op::Length | GlslStd450Op::Normalize => 1,
        GlslStd450Op::FaceForward | GlslStd450Op::Refract => 3,
        _ => 2,
    };
    let vectors = if number == GlslStd450Op::Refract { 2 } else { expected };
    if operands.len() < expected || size == 0 || operands[..vectors].iter().any(|v| v.len() != size) {
        return Err(s.translator.invalid("the operands do not match"));
    }
    let a = operands[0].clone();
    let b = operands.get(1).cloned().unwrap_or_default();
    let c = operands.get(2).cloned().unwrap_or_default();
    let mut result = Words::new();
    match number {
        GlslStd450Op::Length | GlslStd450Op::Distance => {
            let mut v = a;
            if number == GlslStd450Op::Distance {
                for at in 0..size {
                    v[at] = s.sub(v[at], b[at])?;
                }
            }
            // The length of a scalar is its magnitude, which the square root of its square is not.
            if size == 1 {
                result.push(s.translator.emit_family(&crate::ops::glsl::FAbs, width, &[v[0]])?);
            } else {
                let dot = s.dot(&v, &v)?;
                result.push(s.translator.emit_family(&Sqrt, width, &[dot])?);
            }
        }
        GlslStd450Op::Normalize => {
            let dot = s.dot(&a, &a)?;
            let scale = s.translator.emit_family(&InverseSqrt, width, &[dot])?;
            for &component in &a {
                result.push(s.mul(component, scale)?);
            }
        }
        GlslStd450Op::Cross => {
            if size != 3 {
                return Err(s.translator.invalid("a cross product requires vectors of three components"));
            }
            for at in 0..3 {
                let (next, last) = ((at + 1) % 3, (at + 2) % 3);
                let left = s.mul(a[next], b[last])?;
                let right = s.mul(b[next], a[last])?;
                result.push(s.sub(left, right)?);
            }
        }
        GlslStd450Op::FaceForward => {
            let dot = s.dot(&c, &b)?;
            let zero = s.constant(0.0)?;
            let facing = s.translator.emit_family(&FOrdLessThan, width, &[dot, zero])?;
            for &component in &a {
                let flipped = s.translator.emit_family(&FNegate, width, &[component])?;
                result.push(s.select(facing, component, flipped)?);
            }
        }
        GlslStd450Op::Reflect => {
            s.observe_length(&b)?;
            let dot = s.dot(&b, &a)?;
            let two = s.constant(2.0)?;
            let scale = s.mul(two, dot)?;
            for at in 0..size {
                let product = s.mul(scale, b[at])?;
                result.push(s.sub(a[at], product)?);
            }
        }
        _ => {
            s.observe_length(&a)?;
            s.observe_length(&b)?;
            // k = 1 - eta * eta * (1 - dot(N, I)^2); k < 0 gives 0, else
            // eta * I - (eta * dot(N, I) + sqrt(k)) * N
            let eta = eta(&mut s, instruction, c[0])?;
            let one = s.constant(1.0)?;
            let zero = s.constant(0.0)?;
            let dot = s.dot(&b, &a)?;
            let square = s.mul(dot, dot)?;
            let rest = s.sub(one, square)?;
            let squared_eta = s.mul(eta, eta)?;
            let product = s.mul(squared_eta, rest)?;
            let k = s.sub(one, product)?;
            let total_reflection = s.translator.emit_family(&FOrdLessThan, width, &[k, zero])?;
            let root = s.translator.emit_family(&Sqrt, width, &[k])?;
            let along = s.mul(eta, dot)?;
            let scale = s.add(along, root)?;
            for at in 0..size {
                let incident = s.mul(eta, a[at])?;
                let normal = s.mul(scale, b[at])?;
                let difference = s.sub(incident, normal)?;
                result.push(s.select(total_reflection, zero, difference)?);
            }
        }
    }
    let words = translator.expand_components(&result, width);
    translator.define_result(instruction, words);
    Ok(true)
}

/// The ratio of `Refract`, which may be of another width than the vectors.
fn eta(s: &mut FloatEmitter<'_, '_>, instruction: &Instruction, reg: Reg) -> Result<Reg> {
    use crate::ops::conversion::{Conversion, kernel};
    let id = s.translator.id(instruction, 4)?;
    let from = s.translator.type_of(id).and_then(|ty| s.translator.scalar_width(ty))?;
    match kernel(Conversion::F, from, s.width) {
        Some(kernel) => s.translator.emit_kernel(kernel, &[reg]),
        None => Ok(reg),
    }
}

/// The first register of each component of each column of a matrix.
pub fn columns(translator: &mut Translator<'_>, matrix: crate::module::Id) -> Result<Vec<Words>> {
    let ty = translator.type_of(matrix)?;
    let Type::Matrix { column, count } = *translator.module.ty(ty) else {
        return Err(translator.invalid("the operand must be a matrix"));
    };
    let each = translator.scalar_width(column)?.div_ceil(32) as usize;
    let words = translator.words(matrix)?;
    let components: Words = words.chunks(each).map(|chunk| chunk[0]).collect();
    Ok(components.chunks((components.len() / count.max(1) as usize).max(1)).map(Words::from_slice).collect())
}

/// Bits of a matrix's scalars.
pub fn scalar_width_of_matrix(translator: &Translator<'_>, matrix: crate::module::Id) -> Result<u32> {
    match *translator.module.ty(translator.type_of(matrix)?) {
        Type::Matrix { column, .. } => translator.scalar_width(column),
        _ => Err(translator.invalid("the operand must be a matrix")),
    }
}
