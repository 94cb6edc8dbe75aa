//! Rules about the shaders of a pipeline that are known before anything runs: what its groups
//! declare together.

use crate::error::{Error, ErrorKind, Place};
use crate::machine::ShaderIndex;
use crate::module::interface::{InterfaceVariable, Stage};
use crate::module::ty::{MatrixLayout, Type, TypeId};
use crate::module::{Id, Module};
use crate::ops::pointer::storage;
use crate::pipeline::{Group, HitGroup, Pipeline};
use crate::program::Program;
use crate::sanitize::finding::{Finding, FindingKey, Findings};
use crate::sanitize::levels::Levels;
use crate::sanitize::rule::{Level, Rule, contract};

/// Checks what the shaders of a pipeline declare together.
pub fn check_pipeline(pipeline: &Pipeline, levels: &Levels) -> Findings {
    let mut contract = Contract { pipeline, levels, findings: Findings::default() };
    contract.payloads();
    contract.layouts();
    for group in &pipeline.groups {
        if let Group::Hit(group) = group {
            contract.attributes(group);
        }
    }
    contract.findings
}

/// A pipeline that is checked.
struct Contract<'a> {
    pipeline: &'a Pipeline,
    levels: &'a Levels,
    findings: Findings,
}

impl<'a> Contract<'a> {
    fn program(&self, shader: ShaderIndex) -> &'a Program {
        &self.pipeline.programs[shader.index()]
    }

    fn programs(&self) -> impl Iterator<Item = (ShaderIndex, &'a Program)> + use<'a> {
        (0..).map(ShaderIndex).zip(self.pipeline.programs.iter().map(|program| &**program))
    }

    /// Hit, miss and callable shaders that declare no payload or data although one is passed.
    fn payloads(&mut self) {
        let pairs: [(&[Stage], [u32; 2], &Rule, &str); 2] = [
            (
                &[Stage::AnyHit, Stage::ClosestHit, Stage::Miss],
                [storage::RAY_PAYLOAD, storage::INCOMING_RAY_PAYLOAD],
                &contract::PAYLOAD_UNDECLARED,
                "payload",
            ),
            (
                &[Stage::Callable],
                [storage::CALLABLE_DATA, storage::INCOMING_CALLABLE_DATA],
                &contract::CALLABLE_UNDECLARED,
                "callable data",
            ),
        ];
        for (stages, [outgoing, incoming], rule, what) in pairs {
            let passes = |program: &Program| {
                variables(program).into_iter().find(|variable| {
                    variable.storage_class == outgoing
                        && variable.ty.is_some_and(|ty| !scalars(&program.module, ty).is_empty())
                })
            };
            let Some((caller, passed)) =
                self.programs().find_map(|(_, program)| Some((program, passes(program)?)))
            else {
                continue;
            };
            for (shader, program) in self.programs() {
                let declares = program.module.variables.iter().any(|one| one.storage_class == incoming);
                if declares || !stages.contains(&program.stage) {
                    continue;
                }
                let ty = passed.ty.map(|ty| caller.module.describe_type(ty)).unwrap_or_default();
                let (stage, name) = (program.stage.name(), &program.name);
                let message = format!("the {stage} shader `{name}` declares no {what}");
                let note = format!("the {} shader `{}` passes {ty}", caller.stage.name(), caller.name);
                self.add(rule, shader, None, message, vec![note]);
            }
        }
    }

    /// Shaders whose payload or callable data has the scalars that callers pass, and another layout
    /// by decorations.
    fn layouts(&mut self) {
        for [outgoing, incoming] in [
            [storage::RAY_PAYLOAD, storage::INCOMING_RAY_PAYLOAD],
            [storage::CALLABLE_DATA, storage::INCOMING_CALLABLE_DATA],
        ] {
            let of_class = |program: &'a Program, class: u32| {
                let variables = variables(program).into_iter();
                let own = variables.filter(move |variable| variable.storage_class == class);
                own.filter_map(move |variable| Some((program, variable.id, variable.ty?)))
            };
            let passed: Vec<_> =
                self.programs().flat_map(|(_, program)| of_class(program, outgoing)).collect();
            let taken: Vec<_> = self
                .programs()
                .flat_map(|(shader, program)| of_class(program, incoming).map(move |one| (shader, one)))
                .collect();
            for (shader, (called, variable, ty)) in taken {
                let same_scalars = |(caller, _, other): &&(&Program, Id, TypeId)| {
                    scalars(&caller.module, *other) == scalars(&called.module, ty)
                };
                let mut similar = passed.iter().filter(same_scalars).peekable();
                let Some(&&(caller, ..)) = similar.peek() else { continue };
                let own = layout(&called.module, ty);
                if similar.any(|(caller, _, other)| {
                    let theirs = layout(&caller.module, *other);
                    own.is_empty() || theirs.is_empty() || own == theirs
                }) {
                    continue;
                }
                let (stage, name) = (called.stage.name(), &called.name);
                let ty = called.module.describe_type(ty);
                let message =
                    format!("the {stage} shader `{name}` lays {ty} out otherwise than those that pass it");
                let note = format!("one is the {} shader `{}`", caller.stage.name(), caller.name);
                self.add(&contract::PAYLOAD_DECORATION, shader, Some(variable), message, vec![note]);
            }
        }
    }

    /// What the shaders of a hit group declare as hit attributes.
    fn attributes(&mut self, group: &HitGroup) {
        let reported = match group.intersection {
            None => None,
            Some(intersection) => match attribute(self.program(intersection)) {
                Some((_, ty)) => Some((&self.program(intersection).module, ty)),
                None => return,
            },
        };
        for shader in [group.any_hit, group.closest_hit].into_iter().flatten() {
            let Some((variable, ty)) = attribute(self.program(shader)) else { continue };
            let module = &self.program(shader).module;
            let declared = format!("`{}` is {}", variable.name, module.describe_type(ty));
            let own = scalars(module, ty);
            let (rule, message) = match reported {
                None if own.len() > 2 => {
                    let message = format!("{declared}, and the attributes of a triangle are two floats");
                    (&contract::ATTR_TRIANGLE_TYPE, message)
                }
                Some((module, ty)) if own != scalars(module, ty) => {
                    let ty = module.describe_type(ty);
                    let message = format!("{declared}, and the intersection shader reports {ty}");
                    (&contract::ATTR_GROUP_TYPE, message)
                }
                _ => continue,
            };
            self.add(rule, shader, Some(variable.id), message, Vec::new());
        }
    }

    fn add(
        &mut self,
        rule: &'static Rule,
        shader: ShaderIndex,
        variable: Option<Id>,
        message: String,
        notes: Vec<String>,
    ) {
        let level = self.levels.of(rule);
        if level == Level::Allow {
            return;
        }
        let module = &self.program(shader).module;
        let error = Error::new(ErrorKind::Finding, message);
        let error = match module.debug_info.files.first().filter(|file| !file.name.is_empty()) {
            Some(file) => error.at(Place::File(file.name.clone().into())),
            None => error.note(format!("it is shader {shader} of the pipeline, from 0")),
        };
        let error = notes.into_iter().fold(error, Error::note);
        let key =
            FindingKey { rule: rule.id, places: [(shader, variable.map_or(0, |id| id.0)), (shader, 0)] };
        let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
        self.findings.add(key, 1, Some(finding));
    }
}

/// The variables that a program's entry point uses.
fn variables(program: &Program) -> Vec<InterfaceVariable> {
    let mut entries = program.module.entry_points.iter();
    let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name);
    entry.map_or_else(Vec::new, |entry| program.module.interface_of(entry))
}

/// The hit attributes that a program uses, and their type.
fn attribute(program: &Program) -> Option<(InterfaceVariable, TypeId)> {
    let mut variables = variables(program).into_iter();
    let variable = variables.find(|variable| variable.storage_class == storage::HIT_ATTRIBUTE)?;
    let ty = variable.ty?;
    Some((variable, ty))
}

/// The scalars of a type, in order; two types are the same to a group if theirs are.
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
    use rspirv::spirv::Op;

    use super::*;
    use crate::module::assemble::Assembler;

    /// The layout of a struct of two uints, the second of which is at an offset.
    fn layout_of(offset: Option<u32>) -> Vec<Layout> {
        const OFFSET: u32 = 35;
        let mut a = Assembler::new();
        if let Some(offset) = offset {
            a.op(Op::MemberDecorate, &[50, 0, OFFSET, 0]);
            a.op(Op::MemberDecorate, &[50, 1, OFFSET, offset]);
        }
        a.types();
        a.op(Op::TypeStruct, &[50, 5, 5]);
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
}
