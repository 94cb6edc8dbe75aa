//! Arrays that the shaders of a pipeline index by different ids of a hit, most likely by the wrong
//! one somewhere.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::rule::{Level, contract};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::hit_ids::{HitId, HitIds};
use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{Function, Id, Module};
use anyhit_engine::program::Program;

/// An array of a resource: set, binding, and the constant indices that lead to it.
type ArrayKey = (u32, u32, Vec<u32>);

/// A place where a shader indexes an array by an id of a hit, and nothing else.
struct Indexing {
    id: HitId,
    shader: ShaderIndex,
    /// The access chain, in words from the start of the module.
    offset: u32,
    /// The array as the source names it.
    path: String,
}

/// Reports arrays that are indexed by one id of a hit here and by another there.
pub fn check_hit_indices(programs: &[Arc<Program>], levels: &Levels) -> Findings {
    let mut findings = Findings::default();
    let rule = &contract::ID_AS_INDEX;
    let level = levels.of(rule);
    if level == Level::Allow {
        return findings;
    }
    let mut first: FxHashMap<ArrayKey, Indexing> = FxHashMap::default();
    for (shader, program) in (0..).map(ShaderIndex).zip(programs) {
        for (key, indexing) in indexings(program, shader) {
            let Some(known) = first.get(&key) else {
                first.insert(key, indexing);
                continue;
            };
            if known.id == indexing.id {
                continue;
            }
            let other = &programs[known.shader.index()];
            let (id, other_id, path) = (indexing.id.name(), known.id.name(), &indexing.path);
            let message = format!("`{path}` is indexed by {id} here, and by {other_id} elsewhere");
            let error = at(Error::new(ErrorKind::Finding, message), program, indexing.offset);
            let (stage, name) = (other.stage.name(), &other.name);
            let line = line(other, known.offset);
            let error = error.note(format!("by {other_id} in the {stage} shader `{name}`{line}"));
            let error = error.note(format!("in {} `{}`", program.stage.name(), program.name));
            let places = [(shader, indexing.offset), (known.shader, known.offset)];
            let key = FindingKey { rule: rule.id, places };
            let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
            findings.add(key, 1, Some(finding));
        }
    }
    findings
}

/// Where a program indexes arrays of resources by ids of a hit.
fn indexings(program: &Program, shader: ShaderIndex) -> Vec<(ArrayKey, Indexing)> {
    let module = &*program.module;
    let mut entries = module.entry_points.iter();
    let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name);
    let functions = entry.map(|entry| module.call_tree(entry.function)).unwrap_or_default();
    let ids = HitIds::new(module);
    let mut found = Vec::new();
    let functions = functions.into_iter().map(|function| &module.functions[function as usize]);
    for instruction in functions.flat_map(Function::instructions) {
        let chain = module.access_chain(instruction).filter(|chain| chain.element.is_none());
        let Some(chain) = chain else { continue };
        let Some((set, binding)) = binding(module, chain.base) else { continue };
        let Some(mut ty) = module.chain_type(chain) else { continue };
        let mut constants = Vec::new();
        let mut path = module.name(chain.base).unwrap_or_default().to_owned();
        for &index in chain.indices {
            let constant = module.scalar_value(Id(index)).map(|value| value as u32);
            let is_array = matches!(module.ty(ty), Type::Array { .. } | Type::RuntimeArray { .. });
            if let Some(id) = ids.same(Id(index)).filter(|_| is_array) {
                let (offset, path) = (instruction.offset, path.clone());
                found.push(((set, binding, constants.clone()), Indexing { id, shader, offset, path }));
            }
            // Elements of one array are alike.
            constants.push(constant.unwrap_or(u32::MAX));
            let next = match *module.ty(ty) {
                Type::Struct { ref members, .. } => {
                    let at = constant.unwrap_or(0);
                    let names = &module.debug_info.member_names;
                    let name = module.id_of_type(ty).and_then(|id| names.get(&(id, at)));
                    if let Some(name) = name.filter(|name| !name.is_empty()) {
                        path += if path.is_empty() { "" } else { "." };
                        path += name;
                    }
                    members.get(at as usize).map(|member| member.ty)
                }
                Type::Array { element: part, .. } | Type::RuntimeArray { element: part, .. } => {
                    path += "[]";
                    Some(part)
                }
                _ => None,
            };
            let Some(next) = next else { break };
            ty = next;
        }
    }
    found
}

/// The set and binding of a resource variable.
fn binding(module: &Module, variable: Id) -> Option<(u32, u32)> {
    let of = |decoration| module.decorations.literal(variable, decoration);
    of(number::DESCRIPTOR_SET).zip(of(number::BINDING))
}

/// Adds the place of an instruction to an error.
fn at(error: Error, program: &Program, offset: u32) -> Error {
    let line = program.place_at(offset).or_else(|| program.place_near(offset));
    line.into_iter().fold(error, Error::at).at(Place::Word(offset as usize))
}

/// ` at FILE:LINE` of an instruction, or nothing.
fn line(program: &Program, offset: u32) -> String {
    let place = program.module.debug_info.line_at(offset);
    let file =
        place.and_then(|line| Some((program.module.debug_info.files.get(line.file as usize)?, line.line)));
    file.map_or_else(String::new, |(file, line)| format!(" at {}:{line}", file.name))
}
