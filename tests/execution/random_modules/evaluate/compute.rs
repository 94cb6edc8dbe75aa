//! Arithmetic, conversions and composites.

use rspirv::spirv::{GlslStd450Op as GLOp, Op};

use super::super::arithmetic as exact;
use super::super::reader::Type;
use super::{Cell, Invocation, Machine, Outcome, defined, known, read_type, truth};

impl Machine<'_> {
    pub(super) fn bitcast(&self, one: &Invocation, w: &[u32], out: &mut Vec<Cell>) -> Outcome<()> {
        let (from, to) = (self.width(read_type(self.read, w[3])) as usize, self.width(w[1]) as usize);
        let mut bits = Vec::new();
        for cell in self.value(one, w[3]) {
            let value = known(*cell)?;
            bits.extend((0..from).map(|at| value >> at & 1));
        }
        out.extend(
            bits.chunks(to).map(|part| defined(part.iter().rev().fold(0, |value, bit| value << 1 | bit))),
        );
        Ok(())
    }

    /// Instructions that take numbers and give numbers. Notes subnormal ones, which a driver that
    /// does not keep them may take for zero.
    pub(super) fn arithmetic(&self, one: &Invocation, op: Op, w: &[u32], out: &mut Vec<Cell>) -> Outcome<()> {
        self.compute(one, op, w, out)?;
        let operands = if op == Op::ExtInst { &w[5..] } else { &w[3..] };
        let inputs = operands.iter().map(|&id| (read_type(self.read, id), self.value(one, id)));
        for (ty, cells) in inputs.chain([(w[1], out.as_slice())]) {
            if let Type::Float(width) = *self.scalar(ty) {
                let subnormal = |cell: &Cell| exact::is_subnormal(cell.bits, width);
                self.open.set(self.open.get() || cells.iter().any(subnormal));
            }
        }
        Ok(())
    }

    fn compute(&self, one: &Invocation, op: Op, w: &[u32], out: &mut Vec<Cell>) -> Outcome<()> {
        let (extended, operands) = match op {
            Op::ExtInst => (Some(GLOp::from_u32(w[4]).ok_or("an extended instruction")?), &w[5..]),
            _ => (None, &w[3..]),
        };
        let mut values: [&[Cell]; 4] = [&[]; 4];
        for (at, &operand) in operands.iter().enumerate() {
            values[at] = self.value(one, operand);
        }
        let of = read_type(self.read, operands[0]);
        let (from, width) = (self.scalar(of).clone(), self.width(of));
        let to = self.scalar(w[1]).clone();
        let to_width = self.width(w[1]);
        let number = |operand: usize, at: usize| {
            let cells = values[operand];
            let cell = cells.get(if cells.len() == 1 { 0 } else { at });
            known(*cell.ok_or_else(|| format!("{op:?} is not known here"))?)
        };
        let undefined = || format!("undefined: {op:?} {extended:?}");
        match op {
            Op::Any | Op::All => {
                let mut found = Vec::new();
                for cell in values[0] {
                    found.push(known(*cell)? == 1);
                }
                out.push(truth(if op == Op::Any { found.contains(&true) } else { !found.contains(&false) }));
                return Ok(());
            }
            Op::IAddCarry | Op::ISubBorrow | Op::UMulExtended | Op::SMulExtended => {
                let mut high = Vec::new();
                let width = self.width(of);
                for at in 0..values[0].len() {
                    let (a, b) = (number(0, at)?, number(1, at)?);
                    let (low, more) = match op {
                        Op::IAddCarry => {
                            (a.wrapping_add(b), u64::from((u128::from(a) + u128::from(b)) >> width != 0))
                        }
                        Op::ISubBorrow => (a.wrapping_sub(b), u64::from(a < b)),
                        Op::UMulExtended => {
                            (a.wrapping_mul(b), ((u128::from(a) * u128::from(b)) >> width) as u64)
                        }
                        _ => {
                            let product = exact::signed(a, width) * exact::signed(b, width);
                            (product as u64, (product >> width) as u64)
                        }
                    };
                    out.push(defined(low & exact::mask(width)));
                    high.push(defined(more & exact::mask(width)));
                }
                out.extend(high);
                return Ok(());
            }
            Op::OuterProduct => {
                for at in 0..values[1].len() {
                    for row in 0..values[0].len() {
                        let product =
                            exact::floats(Op::FMul, known(values[0][row])?, known(values[1][at])?, to_width);
                        out.push(defined(product.ok_or_else(undefined)?));
                    }
                }
                return Ok(());
            }
            _ => {}
        }
        for at in 0..self.size(w[1]) {
            let a = number(0, at)?;
            let cell = match (op, extended, &from) {
                (Op::LogicalNot, ..) => truth(a == 0),
                (Op::LogicalAnd, ..) => truth(a == 1 && number(1, at)? == 1),
                (Op::LogicalOr, ..) => truth(a == 1 || number(1, at)? == 1),
                (Op::LogicalEqual, ..) => truth(a == number(1, at)?),
                (Op::LogicalNotEqual, ..) => truth(a != number(1, at)?),
                (Op::IsNan, ..) => truth(exact::float(a, width).is_nan()),
                (Op::IsInf, ..) => truth(exact::float(a, width).is_infinite()),
                (Op::SNegate, ..) => defined(a.wrapping_neg() & exact::mask(width)),
                (Op::Not, ..) => defined(!a & exact::mask(width)),
                (Op::BitCount, ..) => defined((0..width).map(|bit| a >> bit & 1).sum()),
                (Op::BitReverse, ..) => {
                    defined((0..width).map(|bit| (a >> bit & 1) << (width - 1 - bit)).sum())
                }
                (Op::BitFieldInsert, ..) => {
                    let (insert, offset, count) = (number(1, at)?, number(2, at)?, number(3, at)?);
                    if u128::from(offset) + u128::from(count) > width.into() {
                        return Err(undefined());
                    }
                    let field = if count == 0 { 0 } else { exact::mask(count as u32) << offset };
                    defined(a & !field | insert.checked_shl(offset as u32).unwrap_or(0) & field)
                }
                (Op::BitFieldUExtract | Op::BitFieldSExtract, ..) => {
                    let (offset, count) = (number(1, at)?, number(2, at)?);
                    if u128::from(offset) + u128::from(count) > width.into() {
                        return Err(undefined());
                    }
                    defined(match count {
                        0 => 0,
                        _ if op == Op::BitFieldUExtract => a >> offset & exact::mask(count as u32),
                        _ => exact::signed(a >> offset, count as u32) as u64 & exact::mask(width),
                    })
                }
                (Op::UConvert, ..) => defined(a & exact::mask(to_width)),
                (Op::SConvert, ..) => defined(exact::signed(a, width) as u64 & exact::mask(to_width)),
                (Op::ConvertUToF, ..) => defined(exact::integer_to_float(a.into(), to_width)),
                (Op::ConvertSToF, ..) => defined(exact::integer_to_float(exact::signed(a, width), to_width)),
                (Op::ConvertFToU | Op::ConvertFToS, ..) => {
                    let Type::Int(..) = to else { return Err(undefined()) };
                    let found =
                        exact::float_to_integer(exact::float(a, width), to_width, op == Op::ConvertFToS);
                    defined(found.ok_or_else(undefined)?)
                }
                (Op::FConvert, ..) => defined(exact::rounded(exact::float(a, width), to_width)),
                (Op::FNegate, ..) => defined(a ^ 1 << (width - 1)),
                (Op::FmaKHR, ..) => defined(exact::fused(a, number(1, at)?, number(2, at)?, width)),
                (Op::VectorTimesScalar | Op::MatrixTimesScalar, ..) => {
                    defined(exact::floats(Op::FMul, a, number(1, at)?, width).ok_or_else(undefined)?)
                }
                (Op::ExtInst, Some(extended), Type::Float(_)) => {
                    let count = operands.len();
                    let mut all = [a; 3];
                    for (operand, value) in all.iter_mut().enumerate().take(count).skip(1) {
                        *value = number(operand, at)?;
                    }
                    defined(exact::extended_floats(extended, &all, width).ok_or_else(undefined)?)
                }
                (Op::ExtInst, Some(extended), _) => {
                    let count = operands.len();
                    let mut all = [a; 3];
                    for (operand, value) in all.iter_mut().enumerate().take(count).skip(1) {
                        *value = number(operand, at)?;
                    }
                    defined(exact::extended_integers(extended, &all, width).ok_or_else(undefined)?)
                }
                (_, _, Type::Float(_)) => {
                    let b = number(1, at)?;
                    if op == Op::FDiv {
                        // The range in which the precision of `OpFDiv` is given.
                        let most = match width {
                            16 => 2f64.powi(14),
                            32 => 2f64.powi(126),
                            _ => 2f64.powi(1022),
                        };
                        let fixed = (1.0 / most..=most).contains(&exact::float(b, width).abs());
                        self.open.set(self.open.get() || !fixed);
                    }
                    match exact::compares_floats(op, exact::float(a, width), exact::float(b, width)) {
                        Some(holds) => truth(holds),
                        None => defined(exact::floats(op, a, b, width).ok_or_else(undefined)?),
                    }
                }
                _ => {
                    let b = number(1, at)?;
                    match exact::compares(op, a, b, width) {
                        Some(holds) => truth(holds),
                        None => defined(exact::integers(op, a, b, width).ok_or_else(undefined)?),
                    }
                }
            };
            out.push(cell);
        }
        Ok(())
    }
}
