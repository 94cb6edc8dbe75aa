//! Rules about the shaders of a pipeline that are known before anything runs: what its groups
//! declare together.

use crate::finding::{Finding, FindingKey, Findings};
use crate::interface_types::{first_difference, scalars};
use crate::levels::Levels;
use crate::module_checks::code::EntryCode;
use crate::report::at_word;
use crate::rule::{Level, Rule, contract};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::module::Id;
use anyhit_engine::module::interface::InterfaceVariable;
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{Group, HitGroup, Pipeline, describe_with_members};
use anyhit_engine::program::Program;

/// Checks what the shaders of a pipeline declare together.
pub fn check_pipeline(pipeline: &Pipeline, levels: &Levels) -> Findings {
    let mut contract = Contract { pipeline, levels, findings: Findings::default() };
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

    /// What the shaders of a hit group declare as hit attributes.
    fn attributes(&mut self, group: &HitGroup) {
        let reported = match group.intersection {
            None => None,
            Some(intersection) => match attribute(self.program(intersection)) {
                Some((_, ty)) => Some((&*self.program(intersection).module, ty)),
                None => return,
            },
        };
        for shader in [group.any_hit, group.closest_hit].into_iter().flatten() {
            let Some((variable, ty)) = attribute(self.program(shader)) else { continue };
            let module = &*self.program(shader).module;
            let declared = format!("`{}` is {}", variable.name, describe_with_members(module, ty));
            let (rule, message) = match reported {
                None if scalars(module, ty).len() > 2 => {
                    let message = format!("{declared}, and the attributes of a triangle are two floats");
                    (&contract::ATTR_TRIANGLE_TYPE, message)
                }
                Some(reported) if first_difference([(module, ty), reported]).is_some() => {
                    let (module, ty) = reported;
                    let ty = describe_with_members(module, ty);
                    let message = format!("{declared}, and the intersection shader reports {ty}");
                    (&contract::ATTR_GROUP_TYPE, message)
                }
                _ => continue,
            };
            self.add(rule, shader, variable.id, message);
        }
    }

    /// Adds what is told of a variable of a shader.
    fn add(&mut self, rule: &'static Rule, shader: ShaderIndex, variable: Id, message: String) {
        let level = self.levels.of(rule);
        if level == Level::Allow {
            return;
        }
        let program = self.program(shader);
        let error = Error::new(ErrorKind::Finding, message);
        let mut files = program.module.debug_info.files.iter();
        let error = match (first_read(program, variable), files.next().filter(|file| !file.name.is_empty())) {
            (Some(offset), _) => at_word(program, offset, error),
            (None, Some(file)) => error.at(Place::File(file.name.clone().into())),
            (None, None) => error.note(format!("shader {shader} of the pipeline, counted from 0")),
        };
        let error = error.note(format!("in {} `{}`", program.stage.name(), program.name));
        let key = FindingKey { rule: rule.id, places: [(shader, variable.0), (shader, 0)] };
        let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
        self.findings.add(key, 1, Some(finding));
    }
}

/// The word of the first instruction of a program that reads a variable.
fn first_read(program: &Program, variable: Id) -> Option<u32> {
    let code = EntryCode::new(&program.module, program.entry_point()?);
    let mut reads = code.accesses().filter(|access| access.reads);
    reads.find(|access| code.reached(access).any(|reached| reached == variable)).map(|access| access.offset)
}

/// The hit attributes that a program uses, and their type.
fn attribute(program: &Program) -> Option<(InterfaceVariable, TypeId)> {
    let mut variables = program.module.interface_of(program.entry_point()?).into_iter();
    let variable = variables.find(|variable| variable.storage_class == storage::HIT_ATTRIBUTE)?;
    let ty = variable.ty?;
    Some((variable, ty))
}
