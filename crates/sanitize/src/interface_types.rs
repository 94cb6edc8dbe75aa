//! The types of variables that shaders hand to each other: payloads, callable data and hit
//! attributes.

use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{MatrixLayout, Type, TypeId};

/// A type, with its module.
pub(super) type ModuleType<'a> = (&'a Module, TypeId);

/// The scalars of a type, in order.
pub(super) fn scalars(module: &Module, ty: TypeId) -> Vec<Type> {
    let mut all = Vec::new();
    add_scalars(module, ty, &mut all);
    all
}

fn add_scalars(module: &Module, ty: TypeId, all: &mut Vec<Type>) {
    /// More scalars are no attributes.
    const MOST: usize = 4096;
    match module.ty(ty) {
        &Type::Vector { component: part, count } | &Type::Matrix { column: part, count } => {
            (0..count).for_each(|_| add_scalars(module, part, all));
        }
        &Type::Array { element, length, .. } => {
            let count = module.scalar_value(length).unwrap_or(0);
            for _ in 0..count {
                let before = all.len();
                add_scalars(module, element, all);
                // Empty elements add nothing, however many there are.
                if all.len() == before || all.len() >= MOST {
                    break;
                }
            }
        }
        Type::Struct { members, .. } => {
            members.iter().for_each(|member| add_scalars(module, member.ty, all));
        }
        scalar => all.push(scalar.clone()),
    }
}

/// The first parts, outermost first, in which two types are not one structure; `None` where they
/// are one. Names do not count, nor do structs of one member that a type is wrapped in: some
/// compilers wrap every payload.
pub(super) fn first_difference(types: [ModuleType<'_>; 2]) -> Option<[TypeId; 2]> {
    let [(one_module, one), (other_module, other)] = types.map(unwrapped);
    difference([one_module, other_module], [one, other])
}

/// A type without the structs of one member that it is wrapped in.
fn unwrapped((module, mut ty): ModuleType<'_>) -> ModuleType<'_> {
    while let Type::Struct { members, .. } = module.ty(ty)
        && let [member] = &members[..]
    {
        ty = member.ty;
    }
    (module, ty)
}

/// As [`first_difference`], without a look at what the types are wrapped in.
fn difference(modules: [&Module; 2], types: [TypeId; 2]) -> Option<[TypeId; 2]> {
    let [one, other] = [modules[0].ty(types[0]), modules[1].ty(types[1])];
    let is_same = match (one, other) {
        (&Type::Vector { component: one, count }, &Type::Vector { component: other, count: other_count })
        | (&Type::Matrix { column: one, count }, &Type::Matrix { column: other, count: other_count })
            if count == other_count =>
        {
            return difference(modules, [one, other]);
        }
        (
            &Type::Array { element: one, length, .. },
            &Type::Array { element: other, length: other_length, .. },
        ) if modules[0].scalar_value(length) == modules[1].scalar_value(other_length) => {
            return difference(modules, [one, other]);
        }
        (Type::Struct { members: one, .. }, Type::Struct { members: other, .. })
            if one.len() == other.len() =>
        {
            let mut members = one.iter().zip(other);
            return members.find_map(|(one, other)| difference(modules, [one.ty, other.ty]));
        }
        // What a pointer leads to is no part of what is passed.
        (Type::Pointer { storage_class: one, .. }, Type::Pointer { storage_class: other, .. }) => {
            one == other
        }
        _ => one == other,
    };
    (!is_same).then_some(types)
}

/// Whether two types are laid out by decorations, and not alike.
pub(super) fn are_laid_out_otherwise(types: [ModuleType<'_>; 2]) -> bool {
    let [one, other] = types.map(unwrapped).map(|(module, ty)| layout(module, ty));
    !one.is_empty() && !other.is_empty() && one != other
}

/// The decorations that lay a type out, in the order of its parts; empty where there are none.
fn layout(module: &Module, ty: TypeId) -> Vec<Layout> {
    match module.ty(ty) {
        Type::Struct { members, .. } => members
            .iter()
            .flat_map(|member| {
                let own = member.offset.map(Layout::Offset).into_iter();
                let matrix = member.matrix.map(Layout::Matrix).into_iter();
                own.chain(matrix).chain(layout(module, member.ty))
            })
            .collect(),
        &Type::Array { element, stride, .. } => {
            stride.map(Layout::ArrayStride).into_iter().chain(layout(module, element)).collect()
        }
        _ => Vec::new(),
    }
}

/// A decoration that lays out a part of a type.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Layout {
    /// `Offset`
    Offset(u32),
    /// `MatrixStride` and `RowMajor`
    Matrix(MatrixLayout),
    /// `ArrayStride`
    ArrayStride(u32),
}

#[cfg(test)]
mod tests {
    use anyhit_engine::module::Opcode;

    use super::*;
    use anyhit_engine::module::Id;
    use anyhit_engine::module::assemble::Assembler;

    /// The layout of a struct of two uints, the second of which is at an offset.
    fn layout_of(offset: Option<u32>) -> Vec<Layout> {
        const OFFSET: u32 = 35;
        let mut a = Assembler::new();
        if let Some(offset) = offset {
            a.op(Opcode::MemberDecorate, &[50, 0, OFFSET, 0]);
            a.op(Opcode::MemberDecorate, &[50, 1, OFFSET, offset]);
        }
        a.types();
        a.op(Opcode::TypeStruct, &[50, 5, 5]);
        let module = a.loaded();
        let ty = module.type_with_id(Id(50)).expect("the struct");
        assert_eq!(scalars(&module, ty).len(), 2);
        layout(&module, ty)
    }

    #[test]
    fn layouts_differ_where_members_lie_elsewhere() {
        assert_eq!(layout_of(None), []);
        assert_eq!(layout_of(Some(4)), [Layout::Offset(0), Layout::Offset(4)]);
        assert_ne!(layout_of(Some(4)), layout_of(Some(16)));
    }

    #[test]
    fn a_structure_is_the_order_and_grouping_of_its_scalars() {
        let [vec3, float, floats] = [7, 6, 60];
        let mut a = Assembler::new();
        a.types();
        a.op(Opcode::TypeArray, &[floats, float, 8]);
        a.op(Opcode::TypeStruct, &[50, vec3, float, vec3]);
        a.op(Opcode::TypeStruct, &[51, vec3, vec3, float]);
        a.op(Opcode::TypeStruct, &[52, vec3, float, floats]);
        a.op(Opcode::TypeStruct, &[53, 50]);
        a.op(Opcode::TypeStruct, &[54, 50, float]);
        let module = a.loaded();
        let ty = |id: u32| module.type_with_id(Id(id)).expect("a type");
        let differ = |one: u32, other: u32| first_difference([(&module, ty(one)), (&module, ty(other))]);
        for other in [51, 52] {
            assert_eq!(scalars(&module, ty(50)), scalars(&module, ty(other)));
        }
        assert_eq!(differ(50, 50), None);
        assert_eq!(differ(50, 51), Some([ty(float), ty(vec3)]));
        assert_eq!(differ(50, 52), Some([ty(vec3), ty(floats)]));
        // What wraps a whole type does not count, other members do.
        assert_eq!(differ(50, 53), None);
        assert_eq!(differ(53, 50), None);
        assert_eq!(differ(50, 54), Some([ty(50), ty(54)]));
    }
}
