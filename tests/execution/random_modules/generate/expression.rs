//! Values at random: of every type, by every instruction whose result the specification fixes.

use rspirv::spirv::{Decoration, GlslStd450Op as GLOp, Op, StorageClass};

use super::super::generate::{Generator, Place};
use super::super::module::{ConstantKind, GLSL, Id, Operand, Ty, Type};

const INT_BINARY: [Op; 6] = [Op::IAdd, Op::ISub, Op::IMul, Op::BitwiseAnd, Op::BitwiseOr, Op::BitwiseXor];
const SHIFTS: [Op; 3] = [Op::ShiftLeftLogical, Op::ShiftRightLogical, Op::ShiftRightArithmetic];
const INT_COMPARISONS: [Op; 10] = [
    Op::IEqual,
    Op::INotEqual,
    Op::ULessThan,
    Op::ULessThanEqual,
    Op::UGreaterThan,
    Op::UGreaterThanEqual,
    Op::SLessThan,
    Op::SLessThanEqual,
    Op::SGreaterThan,
    Op::SGreaterThanEqual,
];
const FLOAT_COMPARISONS: [Op; 12] = [
    Op::FOrdEqual,
    Op::FUnordEqual,
    Op::FOrdNotEqual,
    Op::FUnordNotEqual,
    Op::FOrdLessThan,
    Op::FUnordLessThan,
    Op::FOrdGreaterThan,
    Op::FUnordGreaterThan,
    Op::FOrdLessThanEqual,
    Op::FUnordLessThanEqual,
    Op::FOrdGreaterThanEqual,
    Op::FUnordGreaterThanEqual,
];

impl Generator {
    /// A value of a type: one in scope, a constant or a new one.
    pub(super) fn value(&mut self, ty: Ty, depth: usize) -> Id {
        let roll = self.random.below(12);
        if roll < 6 || depth == 0 {
            // The newest ones three times in four.
            let found: Vec<Id> =
                self.pool.iter().filter(|known| known.0 == ty).map(|known| known.1).collect();
            if !found.is_empty() {
                let newest = found.len().saturating_sub(4);
                let from = if self.random.chance(3, 4) { &found[newest..] } else { &found[..] };
                return self.random.pick(from);
            }
        }
        if depth == 0 || roll == 6 {
            return match self.load_of(ty) {
                Some(value) if self.random.chance(1, 2) => value,
                _ => self.constant(ty),
            };
        }
        self.make(ty, depth - 1)
    }

    /// A new value of a type.
    pub(super) fn make(&mut self, ty: Ty, depth: usize) -> Id {
        let roll = self.random.below(16);
        if roll < 3
            && let Some(value) = self.load_of(ty)
        {
            return value;
        }
        if roll == 3
            && let Some(value) = self.part_of(ty)
        {
            return value;
        }
        if roll == 4 {
            self.count("select");
            let condition = self.value(Ty(2), depth);
            let (yes, no) = (self.value(ty, depth), self.value(ty, depth));
            return self.inst(Op::Select, ty, &[condition, yes, no]);
        }
        if roll == 5
            && let Some(value) = self.call_of(ty)
        {
            return value;
        }
        let (scalar, count) = self.module.scalar_of(ty);
        if count > 1 && roll < 11 {
            return self.make_vector(ty, scalar, count, depth);
        }
        match *self.module.at(scalar) {
            Type::Bool => self.make_bool(ty, count, depth),
            Type::Int { width, signed } => self.make_int(ty, width, signed, count, depth),
            Type::Float { width } => self.make_float(ty, width, count, depth),
            Type::Matrix(..) => self.make_matrix(ty, depth),
            _ => self.make_composite(ty, depth),
        }
    }

    /// The value of a part of a place.
    pub(super) fn load_of(&mut self, ty: Ty) -> Option<Id> {
        let (place, path) = self.place_of(ty, &|_| true)?;
        let pointer = self.chain(place, &path);
        Some(self.load(pointer, place.class, ty))
    }

    /// A place that has a part of a type, and the way there.
    pub(super) fn place_of(&mut self, ty: Ty, wanted: &dyn Fn(&Place) -> bool) -> Option<(Place, Vec<u32>)> {
        let module = &self.module;
        let mut found = Vec::new();
        for place in self.places.iter().filter(|place| wanted(place)) {
            found.extend(module.paths(place.to, &|part| part == ty).into_iter().map(|path| (*place, path)));
        }
        if found.is_empty() {
            return None;
        }
        let at = self.random.below(found.len());
        Some(found.swap_remove(at))
    }

    /// A part of a composite in scope.
    fn part_of(&mut self, ty: Ty) -> Option<Id> {
        let module = &self.module;
        let mut found = Vec::new();
        for &(composite, id) in self.pool.iter().rev().filter(|known| module.is_composite(known.0)).take(12) {
            let paths = module.paths(composite, &|part| part == ty);
            found.extend(paths.into_iter().filter(|path| !path.is_empty()).map(|path| (composite, id, path)));
        }
        if found.is_empty() {
            return None;
        }
        let at = self.random.below(found.len());
        let (composite, id, mut path) = found.swap_remove(at);
        // Any element does.
        let mut inside = composite;
        for index in &mut path {
            let count = self.module.parts(inside).len();
            if !matches!(self.module.at(inside), Type::Struct { .. }) {
                *index = self.random.below(count) as u32;
            }
            inside = self.module.part(inside, *index);
        }
        Some(self.extract(composite, id, &path))
    }

    pub(super) fn extract(&mut self, _: Ty, value: Id, path: &[u32]) -> Id {
        if path.is_empty() {
            return value;
        }
        self.count("composite extract");
        let ty = self.module.type_of[value as usize].expect("a value's type");
        let part = self.module.at_path(ty, path);
        let mut operands = vec![Operand::Id(value)];
        operands.extend(path.iter().map(|&index| Operand::Literal(index)));
        let id = self.hidden(Op::CompositeExtract, part, &operands);
        self.know(part, id);
        id
    }

    /// A pointer to a part of a place; indices into all but structs are computed, one time in two.
    pub(super) fn chain(&mut self, place: Place, path: &[u32]) -> Id {
        if path.is_empty() {
            return place.id;
        }
        let mut ty = place.to;
        let mut indices = vec![place.id];
        for &index in path {
            let count = match self.module.at(ty) {
                Type::Struct { .. } => 0,
                _ => self.module.parts(ty).len() as u32,
            };
            let index = match count {
                0 => self.word(index),
                _ if self.random.chance(1, 2) => self.index(count),
                _ => {
                    let index = self.random.below(count as usize) as u64;
                    let ty = self.index_type();
                    self.splat(ty, index)
                }
            };
            indices.push(index);
            ty = self.module.part(ty, path[indices.len() - 2]);
        }
        let pointer = self.module.pointer(place.class, ty);
        let op = if self.random.chance(1, 4) { Op::InBoundsAccessChain } else { Op::AccessChain };
        self.inst(op, pointer, &indices)
    }

    fn index_type(&mut self) -> Ty {
        let ints: Vec<Ty> = self.scalars.iter().copied().filter(|&ty| self.module.is_int(ty)).collect();
        self.random.pick(&ints)
    }

    /// A computed index of any width below a count.
    pub(super) fn index(&mut self, count: u32) -> Id {
        self.count("computed index");
        let ty = self.index_type();
        let width = self.module.width(ty);
        let unsigned = self.module.int(width, false);
        let value = self.value(unsigned, 0);
        let count = self.splat(unsigned, count.into());
        let index = self.inst(Op::UMod, unsigned, &[value, count]);
        if unsigned == ty { index } else { self.inst(Op::Bitcast, ty, &[index]) }
    }

    pub(super) fn load(&mut self, pointer: Id, class: StorageClass, ty: Ty) -> Id {
        self.count("load");
        let mut operands = vec![Operand::Id(pointer)];
        operands.extend(self.aligned(class, ty));
        let id = self.hidden(Op::Load, ty, &operands);
        self.know(ty, id);
        id
    }

    fn extended(&mut self, op: GLOp, ty: Ty, operands: &[Id]) -> Id {
        let id = self.hidden_extended(op, ty, operands);
        self.know(ty, id);
        id
    }

    fn hidden_extended(&mut self, op: GLOp, ty: Ty, operands: &[Id]) -> Id {
        let mut all = vec![Operand::Id(GLSL), Operand::Literal(op as u32)];
        all.extend(operands.iter().map(|&id| Operand::Id(id)));
        self.hidden(Op::ExtInst, ty, &all)
    }

    /// A type of as many components.
    pub(super) fn like(&mut self, scalar: Ty, count: u32) -> Ty {
        self.module.vector(scalar, count)
    }

    fn any_int(&mut self, count: u32) -> Ty {
        let scalar = self.index_type();
        self.like(scalar, count)
    }

    fn any_float(&mut self, count: u32) -> Ty {
        let floats: Vec<Ty> = self.scalars.iter().copied().filter(|&ty| self.module.is_float(ty)).collect();
        let scalar = self.random.pick(&floats);
        self.like(scalar, count)
    }

    fn make_bool(&mut self, ty: Ty, count: u32, depth: usize) -> Id {
        match self.random.below(8) {
            0..3 => {
                let of = self.any_int(count);
                let (a, b) = (self.value(of, depth), self.value(of, depth));
                let op = self.random.pick(&INT_COMPARISONS);
                self.inst(op, ty, &[a, b])
            }
            3 | 4 => {
                let of = self.any_float(count);
                let (a, b) = (self.value(of, depth), self.value(of, depth));
                let op = self.random.pick(&FLOAT_COMPARISONS);
                self.inst(op, ty, &[a, b])
            }
            5 => {
                let (a, b) = (self.value(ty, depth), self.value(ty, depth));
                let op =
                    self.random.pick(&[Op::LogicalAnd, Op::LogicalOr, Op::LogicalEqual, Op::LogicalNotEqual]);
                self.inst(op, ty, &[a, b])
            }
            6 if count == 1 => {
                let of = self.like(Ty(2), 2 + depth as u32 % 3);
                let a = self.value(of, depth);
                let op = self.random.pick(&[Op::Any, Op::All]);
                self.inst(op, ty, &[a])
            }
            6 => {
                let of = self.any_float(count);
                let a = self.value(of, depth);
                let op = self.random.pick(&[Op::IsNan, Op::IsInf]);
                self.inst(op, ty, &[a])
            }
            _ => {
                let a = self.value(ty, depth);
                self.inst(Op::LogicalNot, ty, &[a])
            }
        }
    }

    /// A type itself or, one time in four, that with the other signedness.
    fn either_sign(&mut self, ty: Ty) -> Ty {
        if self.random.chance(3, 4) {
            return ty;
        }
        let (scalar, count) = self.module.scalar_of(ty);
        let Type::Int { width, signed } = *self.module.at(scalar) else { return ty };
        let other = self.module.int(width, !signed);
        self.like(other, count)
    }

    fn make_int(&mut self, ty: Ty, width: u32, signed: bool, count: u32, depth: usize) -> Id {
        let scalar = self.module.int(width, false);
        let unsigned = self.like(scalar, count);
        match self.random.below(18) {
            0..4 => {
                let (a, b) = (self.either_sign(ty), self.either_sign(ty));
                let (a, b) = (self.value(a, depth), self.value(b, depth));
                let op = self.random.pick(&INT_BINARY);
                self.inst(op, ty, &[a, b])
            }
            4 => {
                let a = self.value(ty, depth);
                let by = self.any_int(count);
                let amount = self.value(by, depth);
                let most = self.splat(by, u64::from(width) - 1);
                let amount = self.inst(Op::BitwiseAnd, by, &[amount, most]);
                let op = self.random.pick(&SHIFTS);
                self.count("shift");
                self.inst(op, ty, &[a, amount])
            }
            5 if !signed => {
                let (a, b) = (self.value(ty, depth), self.value(ty, depth));
                let one = self.splat(ty, 1);
                let b = self.inst(Op::BitwiseOr, ty, &[b, one]);
                let op = self.random.pick(&[Op::UDiv, Op::UMod]);
                self.count("division");
                self.inst(op, ty, &[a, b])
            }
            5 | 6 => {
                let (mut a, b) = (self.value(ty, depth), self.value(ty, depth));
                let (one, most) = (self.splat(ty, 1), self.splat(ty, u64::MAX >> (65 - width)));
                let b = self.inst(Op::BitwiseOr, ty, &[b, one]);
                let mut b = self.inst(Op::BitwiseAnd, ty, &[b, most]);
                if self.random.chance(1, 2) {
                    // The least number is not divided by -1.
                    b = self.inst(Op::SNegate, ty, &[b]);
                    a = self.inst(Op::ShiftRightArithmetic, ty, &[a, one]);
                }
                let op = self.random.pick(&[Op::SDiv, Op::SRem, Op::SMod]);
                self.count("division");
                self.inst(op, ty, &[a, b])
            }
            7 => {
                let from = self.either_sign(ty);
                let a = self.value(from, depth);
                let op = self.random.pick(&[Op::Not, Op::SNegate]);
                self.inst(op, ty, &[a])
            }
            8 => {
                let (a, b, c) = (self.value(ty, depth), self.value(ty, depth), self.value(ty, 0));
                match self.random.below(6) {
                    0 => self.extended(GLOp::SAbs, ty, &[a]),
                    1 => self.extended(GLOp::SMin, ty, &[a, b]),
                    2 => self.extended(GLOp::SMax, ty, &[a, b]),
                    3 => self.extended(GLOp::UMin, ty, &[a, b]),
                    4 => self.extended(GLOp::UMax, ty, &[a, b]),
                    _ => {
                        let (low, high) =
                            (self.extended(GLOp::SMin, ty, &[b, c]), self.extended(GLOp::SMax, ty, &[b, c]));
                        self.extended(GLOp::SClamp, ty, &[a, low, high])
                    }
                }
            }
            9 | 10 => {
                let from = self.any_int(count);
                if self.module.width(from) == width {
                    let a = self.value(ty, depth);
                    return self.inst(Op::CopyObject, ty, &[a]);
                }
                self.count("conversion");
                let a = self.value(from, depth);
                let op = if signed || self.random.chance(1, 2) { Op::SConvert } else { Op::UConvert };
                self.inst(op, ty, &[a])
            }
            11 => {
                self.count("conversion");
                self.float_to_int(ty, width, signed, count, depth)
            }
            12 => self.bits_of(ty, width, count, depth),
            13 | 14 if width == 32 || self.wide_bits => self.bit_instruction(ty, width, depth),
            15 if count == 1 && self.random.chance(1, 2) => {
                let scalars = 2 + self.random.below(3) as u32;
                let of = self.like(ty, scalars);
                let vector = self.value(of, depth);
                let index = self.index(scalars);
                self.count("dynamic extract");
                self.inst(Op::VectorExtractDynamic, ty, &[vector, index])
            }
            15 if unsigned == ty && width >= 32 => {
                let pair = self.module.ty(Type::Struct { members: vec![ty, ty], layout: None });
                let (a, b) = (self.value(ty, depth), self.value(ty, depth));
                let op =
                    self.random.pick(&[Op::IAddCarry, Op::ISubBorrow, Op::UMulExtended, Op::SMulExtended]);
                let both = self.inst(op, pair, &[a, b]);
                let part = self.random.below(2) as u32;
                self.count("extended arithmetic");
                self.extract(pair, both, &[part])
            }
            _ => {
                let op = self.random.pick(&INT_BINARY);
                let (a, b) = (self.value(ty, depth), self.value(ty, depth));
                self.inst(op, ty, &[a, b])
            }
        }
    }

    /// A float within an integer's range, cut off.
    fn float_to_int(&mut self, ty: Ty, width: u32, signed: bool, count: u32, depth: usize) -> Id {
        let from = self.any_float(count);
        let float_width = self.module.width(from);
        let digits = match float_width {
            16 => 11,
            32 => 24,
            _ => 53,
        };
        let value = self.value(from, depth);
        // The greatest float below 2^bits that is an integer, or the greatest f16.
        let bits = width - u32::from(signed);
        let most = if digits < bits {
            2f64.powi(bits as i32) - 2f64.powi((bits - digits) as i32)
        } else {
            2f64.powi(bits as i32) - 1.0
        };
        let least = if signed { -(2f64.powi(bits as i32)) } else { 0.0 };
        let (least, most) =
            if float_width == 16 { (least.max(-65_504.0), most.min(65_504.0)) } else { (least, most) };
        let (least, most) = (self.float_splat(from, least), self.float_splat(from, most));
        // A NaN becomes the least. Whose sign a zero has does not matter.
        let above = self.hidden_extended(GLOp::NMax, from, &[value, least]);
        let inside = self.hidden_extended(GLOp::NMin, from, &[above, most]);
        self.inst(if signed { Op::ConvertFToS } else { Op::ConvertFToU }, ty, &[inside])
    }

    fn float_splat(&mut self, ty: Ty, value: f64) -> Id {
        let (scalar, count) = self.module.scalar_of(ty);
        let bits = super::super::arithmetic::rounded(value, self.module.width(ty));
        let one = self.module.constant(scalar, ConstantKind::Bits(bits));
        if count == 1 {
            one
        } else {
            self.module.constant(ty, ConstantKind::Composite(vec![one; count as usize]))
        }
    }

    /// The bits of something as wide.
    fn bits_of(&mut self, ty: Ty, width: u32, count: u32, depth: usize) -> Id {
        self.count("bitcast");
        let floats: Vec<Ty> = self
            .scalars
            .iter()
            .copied()
            .filter(|&it| self.module.is_float(it) && self.module.width(it) == width)
            .collect();
        if !floats.is_empty() && self.random.chance(1, 2) {
            let from = self.like(floats[0], count);
            let value = self.value(from, depth);
            let canonical = self.canonical(from, value);
            return self.inst(Op::Bitcast, ty, &[canonical]);
        }
        let (scalar, _) = self.module.scalar_of(ty);
        let narrow: Vec<Ty> = self
            .scalars
            .iter()
            .copied()
            .filter(|&it| {
                self.module.is_int(it) && self.module.width(it) < width && width / self.module.width(it) <= 4
            })
            .collect();
        if count == 1 && !narrow.is_empty() && self.random.chance(1, 2) {
            let part = self.random.pick(&narrow);
            let of = self.like(part, width / self.module.width(part));
            let value = self.value(of, depth);
            return self.inst(Op::Bitcast, ty, &[value]);
        }
        let Type::Int { signed, .. } = *self.module.at(scalar) else { unreachable!("an integer") };
        let other = self.module.int(width, !signed);
        let other = self.like(other, count);
        let value = self.value(other, depth);
        self.inst(Op::Bitcast, ty, &[value])
    }

    /// A float with one pattern for all NaNs.
    pub(super) fn canonical(&mut self, ty: Ty, value: Id) -> Id {
        let (_, count) = self.module.scalar_of(ty);
        let truth = self.like(Ty(2), count);
        let is_nan = self.inst(Op::IsNan, truth, &[value]);
        let nan = self.float_splat(ty, f64::NAN);
        self.inst(Op::Select, ty, &[is_nan, nan, value])
    }

    fn bit_instruction(&mut self, ty: Ty, width: u32, depth: usize) -> Id {
        self.count("bit instruction");
        let a = self.value(ty, depth);
        let offsets = self.index_type();
        match self.random.below(8) {
            0 => self.inst(Op::BitReverse, ty, &[a]),
            // Of 32 bits is the result, whatever is counted.
            1 if width == 32 => {
                let (_, count) = self.module.scalar_of(ty);
                let from = if self.wide_bits { self.any_int(count) } else { ty };
                let a = self.value(from, depth);
                self.inst(Op::BitCount, ty, &[a])
            }
            2 if width == 32 => {
                let op = self.random.pick(&[GLOp::FindILsb, GLOp::FindSMsb, GLOp::FindUMsb]);
                self.extended(op, ty, &[a])
            }
            roll => {
                let offset = self.value(offsets, depth);
                let last = self.splat(offsets, u64::from(width) - 1);
                let offset = self.inst(Op::BitwiseAnd, offsets, &[offset, last]);
                // At most up to the highest bit.
                let counts = self.index_type();
                let unsigned_width = self.module.width(counts);
                let counts = self.module.int(unsigned_width, false);
                let count = self.value(counts, depth);
                let most = self.splat(counts, u64::from(width) + 1);
                let count = self.inst(Op::UMod, counts, &[count, most]);
                let same = self.unsigned_of(offsets, offset, unsigned_width);
                let all = self.splat(counts, width.into());
                let room = self.inst(Op::ISub, counts, &[all, same]);
                let count = self.extended(GLOp::UMin, counts, &[count, room]);
                match roll % 3 {
                    0 => self.inst(Op::BitFieldUExtract, ty, &[a, offset, count]),
                    1 => self.inst(Op::BitFieldSExtract, ty, &[a, offset, count]),
                    _ => {
                        let insert = self.value(ty, depth);
                        self.inst(Op::BitFieldInsert, ty, &[a, insert, offset, count])
                    }
                }
            }
        }
    }

    /// An integer as an unsigned one of a width.
    pub(super) fn unsigned_of(&mut self, ty: Ty, value: Id, width: u32) -> Id {
        let to = self.module.int(width, false);
        if to == ty {
            value
        } else if self.module.width(ty) == width {
            self.inst(Op::Bitcast, to, &[value])
        } else {
            self.inst(Op::UConvert, to, &[value])
        }
    }

    pub(super) fn rounding(&mut self, op: Op, ty: Ty, operands: &[Id]) -> Id {
        let id = self.inst(op, ty, operands);
        self.module.decorations.push(vec![id, Decoration::NoContraction as u32]);
        id
    }

    fn make_float(&mut self, ty: Ty, width: u32, count: u32, depth: usize) -> Id {
        match self.random.below(14) {
            0..5 => {
                let (a, b) = (self.value(ty, depth), self.value(ty, depth));
                let op = self.random.pick(&[Op::FAdd, Op::FSub, Op::FMul, Op::FDiv]);
                self.count("float arithmetic");
                self.rounding(op, ty, &[a, b])
            }
            5 => {
                let a = self.value(ty, depth);
                let op = self.random.pick(&[
                    GLOp::FAbs,
                    GLOp::Floor,
                    GLOp::Ceil,
                    GLOp::Trunc,
                    GLOp::RoundEven,
                    GLOp::Sqrt,
                ]);
                self.extended(op, ty, &[a])
            }
            6 => {
                let a = self.value(ty, depth);
                self.rounding(Op::FNegate, ty, &[a])
            }
            7 => {
                let (a, b) = (self.value(ty, depth), self.value(ty, depth));
                let op = self.random.pick(&[GLOp::NMin, GLOp::NMax]);
                // Of two zeros either may come out.
                let either = self.hidden_extended(op, ty, &[a, b]);
                let zero = self.float_splat(ty, 0.0);
                self.count("float minimum");
                self.rounding(Op::FAdd, ty, &[either, zero])
            }
            8 if self.fused => {
                let (a, b, c) = (self.value(ty, depth), self.value(ty, depth), self.value(ty, depth));
                self.rounding(Op::FmaKHR, ty, &[a, b, c])
            }
            8 | 9 => {
                let from = self.any_float(count);
                if self.module.width(from) == width {
                    let from = self.any_int(count);
                    let a = self.value(from, depth);
                    return self.inst(Op::ConvertUToF, ty, &[a]);
                }
                self.count("conversion");
                let a = self.value(from, depth);
                self.inst(Op::FConvert, ty, &[a])
            }
            10 | 11 => {
                let from = self.any_int(count);
                let a = self.value(from, depth);
                let op = self.random.pick(&[Op::ConvertUToF, Op::ConvertSToF]);
                self.count("conversion");
                self.inst(op, ty, &[a])
            }
            12 if self.scalars.iter().any(|&it| self.module.is_int(it) && self.module.width(it) == width) => {
                let scalar = self.module.int(width, false);
                let from = self.like(scalar, count);
                let a = self.value(from, depth);
                self.inst(Op::Bitcast, ty, &[a])
            }
            12 | 13 if count > 1 => {
                let (scalar, _) = self.module.scalar_of(ty);
                let (a, b) = (self.value(ty, depth), self.value(scalar, depth));
                self.rounding(Op::VectorTimesScalar, ty, &[a, b])
            }
            _ => {
                let (a, b) = (self.value(ty, depth), self.value(ty, depth));
                self.rounding(Op::FMul, ty, &[a, b])
            }
        }
    }

    /// Any scalar as a word.
    pub(super) fn as_word(&mut self, ty: Ty, value: Id) -> Id {
        match *self.module.at(ty) {
            Type::Bool => {
                let (one, zero) = (self.word(1), self.word(0));
                self.inst(Op::Select, Ty(1), &[value, one, zero])
            }
            Type::Float { width } => {
                let canonical = self.canonical(ty, value);
                let bits = self.module.int(width, false);
                let cast = self.inst(Op::Bitcast, bits, &[canonical]);
                self.as_word(bits, cast)
            }
            Type::Int { width: 64, signed: true } => {
                let unsigned = self.module.int(64, false);
                let cast = self.inst(Op::Bitcast, unsigned, &[value]);
                self.as_word(unsigned, cast)
            }
            Type::Int { width: 64, .. } => {
                let by = self.splat(ty, 32);
                let high = self.inst(Op::ShiftRightLogical, ty, &[value, by]);
                let (low, high) =
                    (self.inst(Op::UConvert, Ty(1), &[value]), self.inst(Op::UConvert, Ty(1), &[high]));
                self.inst(Op::BitwiseXor, Ty(1), &[low, high])
            }
            Type::Int { width: 32, signed: true } => self.inst(Op::Bitcast, Ty(1), &[value]),
            Type::Int { width: 32, .. } => value,
            _ => self.inst(Op::UConvert, Ty(1), &[value]),
        }
    }
}
