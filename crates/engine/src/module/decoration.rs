//! Decorations of ids and of struct members.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use rspirv::spirv;

use crate::module::copy_budget::CopyBudget;
use crate::module::id_map::UnknownResults;
use crate::module::span::{Span, invalid};
use crate::module::ty::{MatrixLayout, Type};
use crate::module::{Definition, Id, Module};
use anyhit_base::error::Result;

/// Numbers of decorations that are asked for by name (SPIR-V 3.20, "Decoration").
pub mod number {
    /// `Block`
    pub const BLOCK: u32 = 2;
    /// `BuiltIn`
    pub const BUILT_IN: u32 = 11;
    /// `Restrict`
    pub const RESTRICT: u32 = 19;
    /// `Aliased`
    pub const ALIASED: u32 = 20;
    /// `Volatile`
    pub const VOLATILE: u32 = 21;
    /// `Coherent`
    pub const COHERENT: u32 = 23;
    /// `NonWritable`
    pub const NON_WRITABLE: u32 = 24;
    /// `NonReadable`
    pub const NON_READABLE: u32 = 25;
    /// `Location`
    pub const LOCATION: u32 = 30;
    /// `Component`
    pub const COMPONENT: u32 = 31;
    /// `Binding`
    pub const BINDING: u32 = 33;
    /// `DescriptorSet`
    pub const DESCRIPTOR_SET: u32 = 34;
    /// `MemberOffsetNV`
    pub const MEMBER_OFFSET: u32 = 5358;
    /// `BankNV`
    pub const BANK: u32 = 5397;
    /// `ArrayStrideIdEXT`
    pub const ARRAY_STRIDE_ID: u32 = 5124;
    /// `OffsetIdEXT`
    pub const OFFSET_ID: u32 = 5125;
    /// `FPFastMathMode`
    pub const FP_FAST_MATH_MODE: u32 = 40;
    /// `NoContraction`
    pub const NO_CONTRACTION: u32 = 42;
    /// `NonUniform`
    pub const NON_UNIFORM: u32 = 5300;
    /// The builtin `WorkgroupSize`, an operand of `BuiltIn`.
    pub const WORKGROUP_SIZE: u32 = 25;
}

/// A decoration with its literal operands, numbers as in the specification.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoration {
    /// The decoration's number.
    pub number: u32,
    /// The words after it.
    pub operands: Vec<u32>,
}

impl Decoration {
    fn is_workgroup_size(&self) -> bool {
        self.number == number::BUILT_IN && self.operands.first() == Some(&number::WORKGROUP_SIZE)
    }
}

/// All decorations of a module; groups are already applied to their targets.
#[derive(Clone, Debug, Default)]
pub struct Decorations {
    /// Decorations of ids.
    pub of_id: HashMap<Id, Vec<Decoration>>,
    /// Decorations of struct members, by the struct's id and the member's index.
    pub of_member: HashMap<(Id, u32), Vec<Decoration>>,
    /// Ids decorated with `BuiltIn WorkgroupSize`: at most one in a valid module.
    pub workgroup_sizes: Vec<Id>,
}

impl Decorations {
    /// The decoration with this number on an id.
    pub fn find(&self, id: Id, number: u32) -> Option<&Decoration> {
        find(self.of_id.get(&id)?, number)
    }

    /// The first literal of a decoration on an id.
    pub fn literal(&self, id: Id, number: u32) -> Option<u32> {
        self.find(id, number)?.operands.first().copied()
    }

    /// The decoration with this number on a member of a struct.
    pub fn find_member(&self, id: Id, member: u32, number: u32) -> Option<&Decoration> {
        find(self.of_member.get(&(id, member))?, number)
    }
}

fn find(decorations: &[Decoration], number: u32) -> Option<&Decoration> {
    decorations.iter().find(|decoration| decoration.number == number)
}

/// Decorations in the module's order, before their targets are known.
#[derive(Default)]
pub(super) struct PendingDecorations {
    groups: HashSet<Id>,
    entries: Vec<PendingDecoration>,
    /// The decorations of each group.
    of_group: HashMap<Id, Vec<Decoration>>,
}

/// A decoration, or a group of them, and what it is applied to.
struct PendingDecoration {
    target: Target,
    /// The offset of the word with the target's id.
    at: usize,
    source: DecorationSource,
}

#[derive(Clone, Copy)]
enum Target {
    Id(Id),
    Member(Id, u32),
}

enum DecorationSource {
    Decoration(Decoration),
    Group(Id),
}

impl PendingDecorations {
    /// Records `OpDecorate`, `OpDecorateId` or `OpDecorateString`.
    pub(super) fn decorate(&mut self, words: &[u32], span: Span) {
        let at = span.start + 1;
        self.push(Target::Id(Id(words[at])), at, words, at + 1..span.end);
    }

    /// Records `OpMemberDecorate`, `OpMemberDecorateIdEXT` or `OpMemberDecorateString`.
    pub(super) fn decorate_member(&mut self, words: &[u32], span: Span) {
        let at = span.start + 1;
        self.push(Target::Member(Id(words[at]), words[at + 1]), at, words, at + 2..span.end);
    }

    fn push(&mut self, target: Target, at: usize, words: &[u32], range: Range<usize>) {
        let decoration =
            Decoration { number: words[range.start], operands: words[range.start + 1..range.end].to_vec() };
        self.entries.push(PendingDecoration { target, at, source: DecorationSource::Decoration(decoration) });
    }

    /// Records `OpDecorationGroup`.
    pub(super) fn group(&mut self, id: Id) {
        self.groups.insert(id);
    }

    /// Records `OpGroupDecorate`.
    pub(super) fn apply_group(&mut self, words: &[u32], span: Span) {
        let group = Id(words[span.start + 1]);
        let first = span.start + 2;
        for (index, &target) in words[first..span.end].iter().enumerate() {
            let target = Target::Id(Id(target));
            self.entries.push(PendingDecoration {
                target,
                at: first + index,
                source: DecorationSource::Group(group),
            });
        }
    }

    /// Records `OpGroupMemberDecorate`.
    pub(super) fn apply_group_to_members(&mut self, words: &[u32], span: Span) {
        let group = Id(words[span.start + 1]);
        for at in (span.start + 2..span.end).step_by(2) {
            let target = Target::Member(Id(words[at]), words[at + 1]);
            self.entries.push(PendingDecoration { target, at, source: DecorationSource::Group(group) });
        }
    }

    /// Applies all decorations to their targets, and folds memory layout into the types.
    pub(super) fn apply(mut self, module: &mut Module, unknown: &UnknownResults, words: usize) -> Result<()> {
        let mut budget = CopyBudget::new(words);
        for PendingDecoration { target, at, source } in std::mem::take(&mut self.entries) {
            let decorations = match source {
                DecorationSource::Decoration(decoration) => match target {
                    Target::Id(id) if self.groups.contains(&id) => {
                        self.of_group.entry(id).or_default().push(decoration);
                        continue;
                    }
                    _ => vec![decoration],
                },
                // All decorations of a group precede it (specification, OpDecorationGroup).
                DecorationSource::Group(group) if self.groups.contains(&group) => {
                    let decorations = self.of_group.get(&group).map_or(&[][..], Vec::as_slice);
                    let words: usize = decorations.iter().map(|one| 1 + one.operands.len()).sum();
                    budget.spend(words, at)?;
                    decorations.to_vec()
                }
                DecorationSource::Group(group) => {
                    return Err(invalid(
                        at,
                        format!("expected the id of an OpDecorationGroup, found %{}", group.0),
                    ));
                }
            };
            if !check_target(module, unknown, target, at)? {
                continue;
            }
            match target {
                Target::Id(id) => {
                    if decorations.iter().any(Decoration::is_workgroup_size) {
                        module.decorations.workgroup_sizes.push(id);
                    }
                    module.decorations.of_id.entry(id).or_default().extend(decorations);
                }
                Target::Member(id, member) => {
                    module.decorations.of_member.entry((id, member)).or_default().extend(decorations);
                }
            }
        }
        fold_into_types(module);
        Ok(())
    }
}

/// Whether a target exists; `false` where an unknown instruction may define it.
fn check_target(module: &Module, unknown: &UnknownResults, target: Target, at: usize) -> Result<bool> {
    let (Target::Id(id) | Target::Member(id, _)) = target;
    let Some(definition) = module.definition(id) else {
        if unknown.contains_key(&id) {
            return Ok(false);
        }
        return Err(invalid(at, format!("%{} is decorated, but nothing defines it", id.0)));
    };
    let Target::Member(_, member) = target else { return Ok(true) };
    match definition {
        Definition::Type(ty) => match module.ty(ty) {
            Type::Struct { members, .. } if (member as usize) < members.len() => Ok(true),
            Type::Struct { members, .. } => Err(invalid(
                at + 1,
                format!("member {member} of %{} is decorated, which has {} members", id.0, members.len()),
            )),
            Type::Other(_) => Ok(false),
            _ => Err(invalid(at, format!("a member of %{} is decorated, but the id is not a struct", id.0))),
        },
        _ => Err(invalid(at, format!("a member of %{} is decorated, but the id is not a struct", id.0))),
    }
}

/// Folds decorations into types, members and constants.
fn fold_into_types(module: &mut Module) {
    let number = |decoration: spirv::Decoration| decoration as u32;
    let literal = |all: &[Decoration], decoration: spirv::Decoration| {
        find(all, number(decoration)).and_then(|one| one.operands.first().copied())
    };
    for (id, all) in &module.decorations.of_id {
        match module.definitions.find(*id) {
            Some(Definition::Type(ty)) => match &mut module.types[ty.0 as usize] {
                Type::Array { stride, .. }
                | Type::RuntimeArray { stride, .. }
                | Type::Pointer { stride, .. } => *stride = literal(all, spirv::Decoration::ArrayStride),
                Type::Struct { block, buffer_block, .. } => {
                    *buffer_block = find(all, number(spirv::Decoration::BufferBlock)).is_some();
                    *block = *buffer_block || find(all, number(spirv::Decoration::Block)).is_some();
                }
                _ => {}
            },
            Some(Definition::Constant(constant)) => {
                module.constants[constant as usize].spec_id = literal(all, spirv::Decoration::SpecId);
            }
            _ => {}
        }
    }
    for ((id, index), all) in &module.decorations.of_member {
        let Some(Definition::Type(ty)) = module.definitions.find(*id) else { continue };
        let Type::Struct { members, .. } = &mut module.types[ty.0 as usize] else { continue };
        let member = &mut members[*index as usize];
        member.offset = literal(all, spirv::Decoration::Offset);
        member.builtin = literal(all, spirv::Decoration::BuiltIn);
        member.matrix = literal(all, spirv::Decoration::MatrixStride).map(|stride| MatrixLayout {
            stride,
            row_major: find(all, number(spirv::Decoration::RowMajor)).is_some(),
        });
    }
    for ((id, index), name) in &module.debug_info.member_names {
        let Some(Definition::Type(ty)) = module.definitions.find(*id) else { continue };
        let Type::Struct { members, .. } = &mut module.types[ty.0 as usize] else { continue };
        if let Some(member) = members.get_mut(*index as usize) {
            member.name.clone_from(name);
        }
    }
}
