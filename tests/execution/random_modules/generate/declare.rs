//! Types, constants and variables of the module at random.

use rspirv::spirv::{BuiltIn, Decoration, StorageClass};

use super::super::emit::{bound_at, is_builtin};
use super::super::generate::{Generator, Place};
use super::super::module::{ConstantKind, Id, Layout, Ty, Type, Variable};

impl Generator {
    pub(super) fn types(&mut self) {
        assert_eq!(self.module.ty(Type::Void), Ty(0));
        assert_eq!(self.module.int(32, false), Ty(1));
        assert_eq!(self.module.ty(Type::Bool), Ty(2));
        let s32 = self.module.int(32, true);
        let f32 = self.module.ty(Type::Float { width: 32 });
        self.scalars = vec![Ty(1), Ty(1), s32, f32, Ty(2)];
        self.straight = self.random.chance(1, 2);
        // Half of the straight ones have 32 bits only, as most shaders do.
        let narrow = self.straight && self.random.chance(1, 2);
        for width in [8, 16, 64] {
            if !narrow && self.random.chance(1, 2) {
                let pair = [false, true].map(|signed| self.module.int(width, signed));
                self.scalars.extend(pair);
            }
        }
        for width in [16, 64] {
            if !narrow && self.random.chance(1, 3) {
                let float = self.module.ty(Type::Float { width });
                self.scalars.push(float);
            }
        }
        self.wide_bits = self.random.chance(1, 4);
        self.fused = self.random.chance(1, 4);
        for _ in 0..2 + self.random.below(4) {
            let ty = self.draw_type(2);
            self.menu.push(ty);
        }
        // One struct at least: it is what programs pass around.
        let ty = self.draw_struct(1);
        self.menu.push(ty);
    }

    pub(super) fn draw_struct(&mut self, depth: usize) -> Ty {
        let count = 1 + self.random.below(4);
        let members = (0..count)
            .map(|_| if self.random.chance(1, 2) { self.draw_scalar() } else { self.draw_type(depth) })
            .collect();
        self.module.ty(Type::Struct { members, layout: None })
    }

    pub(super) fn draw_scalar(&mut self) -> Ty {
        let scalars = std::mem::take(&mut self.scalars);
        let found = self.random.pick(&scalars);
        self.scalars = scalars;
        found
    }

    pub(super) fn draw_type(&mut self, depth: usize) -> Ty {
        for _ in 0..4 {
            let ty = self.draw_any_type(depth);
            if self.module.cells(ty) <= 24 {
                return ty;
            }
        }
        self.draw_scalar()
    }

    pub(super) fn draw_any_type(&mut self, depth: usize) -> Ty {
        match self.random.below(if depth == 0 { 4 } else { 8 }) {
            0 => self.draw_scalar(),
            1 | 2 => {
                let scalar = self.draw_scalar();
                let count = 2 + self.random.below(3) as u32;
                self.module.vector(scalar, count)
            }
            3 => {
                let floats: Vec<Ty> =
                    self.scalars.iter().copied().filter(|&ty| self.module.is_float(ty)).collect();
                let scalar = self.random.pick(&floats);
                let (rows, columns) = (2 + self.random.below(3) as u32, 2 + self.random.below(3) as u32);
                let column = self.module.vector(scalar, rows);
                self.module.ty(Type::Matrix(column, columns))
            }
            4 | 5 => self.draw_struct(depth - 1),
            _ => {
                let element = self.draw_type(depth - 1);
                let count = 1 + self.random.below(4) as u32;
                self.module.ty(Type::Array { element, count, stride: 0 })
            }
        }
    }

    /// A type for a value or a variable.
    pub(super) fn any_type(&mut self) -> Ty {
        match self.random.below(8) {
            0..4 => self.draw_scalar(),
            4 => {
                let scalar = self.draw_scalar();
                let count = 2 + self.random.below(3) as u32;
                self.module.vector(scalar, count)
            }
            _ => {
                let menu = std::mem::take(&mut self.menu);
                let found = self.random.pick(&menu);
                self.menu = menu;
                found
            }
        }
    }

    pub(super) fn global(
        &mut self,
        class: StorageClass,
        to: Ty,
        initializer: Option<Id>,
        decorations: Vec<Vec<u32>>,
    ) -> Id {
        let ty = self.module.pointer(class, to);
        let id = self.module.id(Some(ty));
        self.module.globals.push(Variable { id, ty, initializer, decorations });
        id
    }

    /// A block with a runtime array.
    pub(super) fn block(&mut self, element: Ty, stride: u32) -> Ty {
        let array = self.module.ty(Type::RuntimeArray { element, stride });
        let layout = Layout { offsets: vec![0], matrices: vec![None], size: 0, block: true };
        self.module.ty(Type::Struct { members: vec![array], layout: Some(layout) })
    }

    /// A struct from the menu's types with a layout, none of them with a bool.
    pub(super) fn laid_struct(&mut self) -> (Ty, u32) {
        let mut members: Vec<Ty> = (0..1 + self.random.below(3)).map(|_| self.any_type()).collect();
        members.retain(|&member| !self.module.has_bool(member) && self.module.cells(member) <= 16);
        members.push(Ty(1));
        let plain = self.module.ty(Type::Struct { members, layout: None });
        let rows = self.random.chance(1, 3);
        let (laid, size, _) = self.module.laid_out(plain, rows);
        self.menu.push(plain);
        self.laid_menu.push(laid);
        (laid, size)
    }

    pub(super) fn globals(&mut self) {
        let aliased = vec![vec![Decoration::Aliased as u32]];
        let words = self.block(Ty(1), 4);
        self.input = self.global(StorageClass::StorageBuffer, words, None, bound_at(0));
        self.output = self.global(StorageClass::StorageBuffer, words, None, bound_at(1));
        self.shared = self.global(StorageClass::StorageBuffer, words, None, bound_at(3));
        let uvec3 = self.module.vector(Ty(1), 3);
        self.gid = self.global(StorageClass::Input, uvec3, None, is_builtin(BuiltIn::GlobalInvocationId));
        self.group_id = self.global(StorageClass::Input, uvec3, None, is_builtin(BuiltIn::WorkgroupId));
        self.lid = self.global(StorageClass::Input, Ty(1), None, is_builtin(BuiltIn::LocalInvocationIndex));
        self.lane_id =
            self.global(StorageClass::Input, Ty(1), None, is_builtin(BuiltIn::SubgroupLocalInvocationId));
        if self.random.chance(1, 2) {
            let (element, stride) = self.laid_struct();
            let block = self.block(element, stride);
            let decorations = [bound_at(2), aliased.clone()].concat();
            let id = self.global(StorageClass::StorageBuffer, block, None, decorations);
            self.own = Some((id, element));
        }
        if self.module.physical {
            self.physical = Some(self.laid_struct());
        }
        for _ in 0..self.random.below(3) {
            let ty = self.any_type();
            let value = if self.random.chance(1, 3) {
                self.module.constant(ty, ConstantKind::Null)
            } else {
                self.constant(ty)
            };
            let id = self.global(StorageClass::Private, ty, Some(value), aliased.clone());
            self.places.push(Place { id, class: StorageClass::Private, to: ty, object: id });
        }
        if self.random.chance(2, 5) {
            for _ in 0..1 + self.random.below(2) {
                let ty = self.any_type();
                let array =
                    self.module.ty(Type::Array { element: ty, count: self.module.local_size, stride: 0 });
                let id = self.global(StorageClass::Workgroup, array, None, aliased.clone());
                self.workgroup.push((id, ty));
            }
        }
    }

    /// A constant, often one at an edge.
    pub(super) fn constant(&mut self, ty: Ty) -> Id {
        let kind = match *self.module.at(ty) {
            Type::Bool => ConstantKind::Bool(self.random.chance(1, 2)),
            Type::Int { width, .. } => {
                let mask = u64::MAX >> (64 - width);
                let edges = [0, 1, 2, 3, 7, mask, mask >> 1, (mask >> 1) + 1];
                let bits =
                    if self.random.chance(3, 4) { self.random.pick(&edges) } else { self.random.next() };
                ConstantKind::Bits(bits & mask)
            }
            Type::Float { width } => {
                let values: &[u64] = match width {
                    16 => &[0, 0x8000, 0x3C00, 0xBC00, 0x4200, 0x3555, 0x7BFF, 0x0001, 0x7C00, 0x5640],
                    32 => &[
                        0,
                        1 << 31,
                        0x3F80_0000,
                        0xBF80_0000,
                        0x4040_0000,
                        0x3EAA_AAAB,
                        0x7F7F_FFFF,
                        1,
                        0x7F80_0000,
                        0x4B80_0001,
                    ],
                    _ => &[
                        0,
                        1 << 63,
                        0x3FF0 << 48,
                        0xBFF0 << 48,
                        0x4008 << 48,
                        0x3FD5_5555_5555_5555,
                        0x7FEF << 48,
                        1,
                        0x7FF0 << 48,
                        0x4340_0000_0000_0001,
                    ],
                };
                ConstantKind::Bits(self.random.pick(values))
            }
            _ if self.random.chance(1, 4) => ConstantKind::Null,
            _ => {
                let parts = self.module.parts(ty);
                ConstantKind::Composite(parts.into_iter().map(|part| self.constant(part)).collect())
            }
        };
        self.module.constant(ty, kind)
    }

    /// An integer, every component of a vector the same.
    pub(super) fn splat(&mut self, ty: Ty, bits: u64) -> Id {
        let (scalar, count) = self.module.scalar_of(ty);
        let bits = bits & u64::MAX >> (64 - self.module.width(ty));
        let one = self.module.constant(scalar, ConstantKind::Bits(bits));
        if count == 1 {
            one
        } else {
            self.module.constant(ty, ConstantKind::Composite(vec![one; count as usize]))
        }
    }

    pub(super) fn word(&mut self, value: u32) -> Id {
        self.splat(Ty(1), value.into())
    }
}
