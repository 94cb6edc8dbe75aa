//! Vectors, matrices, structs and arrays at random.

use rspirv::spirv::Op;

use super::super::generate::Generator;
use super::super::module::{ConstantKind, Id, Operand, Ty, Type};

impl Generator {
    pub(super) fn make_vector(&mut self, ty: Ty, scalar: Ty, count: u32, depth: usize) -> Id {
        match self.random.below(6) {
            0 => {
                self.count("vector shuffle");
                let (m, n) = (2 + self.random.below(3) as u32, 2 + self.random.below(3) as u32);
                let (of_a, of_b) = (self.like(scalar, m), self.like(scalar, n));
                let (a, b) = (self.value(of_a, depth), self.value(of_b, depth));
                let mut operands = vec![Operand::Id(a), Operand::Id(b)];
                operands
                    .extend((0..count).map(|_| Operand::Literal(self.random.below((m + n) as usize) as u32)));
                let id = self.hidden(Op::VectorShuffle, ty, &operands);
                self.know(ty, id);
                id
            }
            1 => {
                self.count("dynamic insert");
                let (a, b) = (self.value(ty, depth), self.value(scalar, depth));
                let index = self.index(count);
                self.inst(Op::VectorInsertDynamic, ty, &[a, b, index])
            }
            2 => self.insert(ty, depth),
            3 => {
                let truth = self.like(Ty(2), count);
                let condition = self.value(truth, depth);
                let (yes, no) = (self.value(ty, depth), self.value(ty, depth));
                self.inst(Op::Select, ty, &[condition, yes, no])
            }
            4 if count > 2 => {
                // Vectors are constructed of scalars and of shorter vectors.
                let of = self.like(scalar, 2);
                let front = self.value(of, depth);
                let mut parts = vec![front];
                for _ in 2..count {
                    let part = self.value(scalar, depth);
                    parts.push(part);
                }
                if self.random.chance(1, 2) {
                    parts.reverse();
                }
                self.inst(Op::CompositeConstruct, ty, &parts)
            }
            _ => self.construct(ty, depth),
        }
    }

    pub(super) fn construct(&mut self, ty: Ty, depth: usize) -> Id {
        self.count("composite construct");
        let parts: Vec<Id> = self.module.parts(ty).into_iter().map(|part| self.value(part, depth)).collect();
        self.inst(Op::CompositeConstruct, ty, &parts)
    }

    /// A composite with another part.
    pub(super) fn insert(&mut self, ty: Ty, depth: usize) -> Id {
        self.count("composite insert");
        let mut path = Vec::new();
        let mut part = ty;
        while path.is_empty() || self.module.is_composite(part) && self.random.chance(1, 2) {
            let index = self.random.below(self.module.parts(part).len()) as u32;
            path.push(index);
            part = self.module.part(part, index);
        }
        let (value, whole) = (self.value(part, depth), self.value(ty, depth));
        let mut operands = vec![Operand::Id(value), Operand::Id(whole)];
        operands.extend(path.into_iter().map(Operand::Literal));
        let id = self.hidden(Op::CompositeInsert, ty, &operands);
        self.know(ty, id);
        id
    }

    pub(super) fn make_matrix(&mut self, ty: Ty, depth: usize) -> Id {
        let Type::Matrix(column, columns) = *self.module.at(ty) else { unreachable!("a matrix") };
        let (scalar, rows) = self.module.scalar_of(column);
        self.count("matrix");
        match self.random.below(5) {
            0 => {
                let turned = self.like(scalar, columns);
                let turned = self.module.ty(Type::Matrix(turned, rows));
                let value = self.value(turned, depth);
                self.inst(Op::Transpose, ty, &[value])
            }
            1 => {
                let (a, b) = (self.value(ty, depth), self.value(scalar, depth));
                self.rounding(Op::MatrixTimesScalar, ty, &[a, b])
            }
            2 => {
                let along = self.like(scalar, columns);
                let (a, b) = (self.value(column, depth), self.value(along, depth));
                self.rounding(Op::OuterProduct, ty, &[a, b])
            }
            3 => self.insert(ty, depth),
            _ => self.construct(ty, depth),
        }
    }

    pub(super) fn make_composite(&mut self, ty: Ty, depth: usize) -> Id {
        match self.random.below(6) {
            0 | 1 => self.insert(ty, depth),
            2 => {
                // Begun with nothing, every part is inserted before anything looks.
                self.count("undefined, then filled");
                let mut whole = self.module.constant(ty, ConstantKind::Undef);
                for (at, part) in self.module.parts(ty).into_iter().enumerate() {
                    let value = self.value(part, depth);
                    let operands = [Operand::Id(value), Operand::Id(whole), Operand::Literal(at as u32)];
                    whole = self.hidden(Op::CompositeInsert, ty, &operands);
                }
                self.know(ty, whole);
                whole
            }
            3 => {
                let value = self.value(ty, depth);
                self.count("copy object");
                self.inst(Op::CopyObject, ty, &[value])
            }
            4 => match self.twin_of(ty) {
                Some(value) => {
                    self.count("copy logical");
                    self.inst(Op::CopyLogical, ty, &[value])
                }
                None => self.construct(ty, depth),
            },
            _ => self.construct(ty, depth),
        }
    }

    /// A value of a type that is the same but for its layout.
    pub(super) fn twin_of(&mut self, ty: Ty) -> Option<Id> {
        if self.module.has_bool(ty) {
            return None;
        }
        let plain = self.plain(ty);
        let mut twins = Vec::new();
        if plain != ty {
            twins.push(plain);
        } else {
            twins.extend([false, true].map(|rows| self.module.laid_out(ty, rows).0));
        }
        twins.retain(|&twin| twin != ty);
        let twin = self.random.pick(&twins);
        let found: Vec<Id> = self.pool.iter().filter(|known| known.0 == twin).map(|known| known.1).collect();
        if found.is_empty() { self.load_of(twin) } else { Some(self.random.pick(&found)) }
    }

    /// A type without its layout.
    pub(super) fn plain(&mut self, ty: Ty) -> Ty {
        match self.module.at(ty).clone() {
            Type::Array { element, count, .. } => {
                let element = self.plain(element);
                self.module.ty(Type::Array { element, count, stride: 0 })
            }
            Type::Struct { members, .. } => {
                let members = members.into_iter().map(|member| self.plain(member)).collect();
                self.module.ty(Type::Struct { members, layout: None })
            }
            _ => ty,
        }
    }
}
