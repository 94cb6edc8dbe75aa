//! A shader calls another: whether that one declares the payload or the callable data that it is
//! given, and as the same structure.

use crate::cause::OpPlace;
use crate::interface_types::{are_laid_out_otherwise, first_difference, scalars};
use crate::report::CallFault;
use crate::rule::{Rule, contract};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::module::{Id, Module};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::InterfaceRegisters;
use anyhit_engine::pipeline::{describe_with_members, source_file};
use anyhit_engine::program::Program;

/// What shaders hand to those that they call.
struct Passed {
    /// The storage class of what a shader passes.
    outgoing: u32,
    /// The storage class of what a shader is given.
    incoming: u32,
    /// The rule that a called shader declares it.
    undeclared: &'static Rule,
    /// Its name.
    what: &'static str,
    /// What a source in GLSL writes for both storage classes.
    keywords: [&'static str; 2],
}

/// The payload of a ray.
static PAYLOAD: Passed = Passed {
    outgoing: storage::RAY_PAYLOAD,
    incoming: storage::INCOMING_RAY_PAYLOAD,
    undeclared: &contract::PAYLOAD_UNDECLARED,
    what: "payload",
    keywords: ["rayPayloadEXT", "rayPayloadInEXT"],
};

/// The data of a callable shader.
static CALLABLE_DATA: Passed = Passed {
    outgoing: storage::CALLABLE_DATA,
    incoming: storage::INCOMING_CALLABLE_DATA,
    undeclared: &contract::CALLABLE_UNDECLARED,
    what: "callable data",
    keywords: ["callableDataEXT", "callableDataInEXT"],
};

/// A shader is called, before it begins.
pub(crate) fn check<const W: usize>(sanitizer: &mut Sanitizer<'_>, shader: ShaderIndex, batch: &Batch<W>) {
    let Some(called) = sanitizer.plans.get(shader.index()).map(|plan| &*plan.program) else { return };
    let passed = match called.stage {
        Stage::AnyHit | Stage::ClosestHit | Stage::Miss => &PAYLOAD,
        Stage::Callable => &CALLABLE_DATA,
        _ => return,
    };
    let Some((place, caller, given)) = given(sanitizer) else { return };
    sanitizer.passed.note(place.shader, place.op, given.first, shader);
    if sanitizer.matching_calls.contains(&(place, shader)) {
        return;
    }
    let Some(fault) = fault(passed, caller, given, called) else {
        sanitizer.matching_calls.insert((place, shader));
        return;
    };
    let Some(op) = sanitizer.frames.last().map(|frame| frame.op) else { return };
    sanitizer.reporter(batch).broken_call(fault, (op, shader), batch.mask);
}

/// The operation that a shader is called by, its program, and the variable that it passes. (An
/// any-hit shader may be called while an intersection shader reports: what traces the ray passes
/// the payload.) `None` where the host calls.
fn given<'a>(sanitizer: &Sanitizer<'a>) -> Option<(OpPlace, &'a Program, &'a InterfaceRegisters)> {
    let mut calls = sanitizer.frames.iter().rev().map(|frame| {
        let program = &*sanitizer.plans.get(frame.shader.index())?.program;
        Some((OpPlace { shader: frame.shader, op: frame.op }, program))
    });
    let is_intersection = |program: &Program| program.stage == Stage::Intersection;
    let (place, program) = calls.find(|call| call.is_none_or(|(_, program)| !is_intersection(program)))??;
    let first = program.ops.get(place.op.index())?.payload_span()?.first;
    let variable = program.interface.iter().find(|variable| variable.first == first)?;
    Some((place, program, variable))
}

/// What is wrong with a call, if anything.
fn fault(
    passed: &Passed,
    caller: &Program,
    given: &InterfaceRegisters,
    called: &Program,
) -> Option<CallFault> {
    let certain = |rule, message, notes| CallFault { rule, message, notes, is_uncertain: false };
    if scalars(&caller.module, given.ty).is_empty() {
        return None;
    }
    let gives = describe_with_members(&caller.module, given.ty);
    let who = format!("{} `{}`{}", called.stage.name(), called.name, source_file(&called.module));
    let mut declared = of_class(called, passed.incoming).peekable();
    if declared.peek().is_none() && is_in_source(&called.module, passed.keywords[1]) {
        return None;
    }
    if declared.peek().is_none() {
        let message = format!("{who} declares no {}, and is given {gives}", passed.what);
        let [outgoing, incoming] = passed.keywords;
        let other = unpassed(called, passed.outgoing).map(|name| {
            format!(
                "it declares `{name}` as {outgoing}, which is for data that it passes to other \
                 shaders, not as {incoming}"
            )
        });
        // Where nothing shows the source, an optimizer may have dropped an unused declaration.
        let is_uncertain = other.is_none() && !has_source(&called.module);
        let unless = is_uncertain.then(|| {
            "an optimizer may have removed an unused declaration: compile with debug information (-g) to \
             find out"
                .to_owned()
        });
        let notes = other.into_iter().chain(unless).collect();
        return Some(CallFault { rule: passed.undeclared, message, notes, is_uncertain });
    }
    let used = called.entry_point().map_or(&[][..], |entry| &entry.interface);
    let (_, ty) = declared.find(|(variable, _)| used.contains(variable))?;
    let types = [(&*called.module, ty), (&*caller.module, given.ty)];
    let takes = describe_with_members(&called.module, ty);
    if let Some([own, other]) = first_difference(types) {
        let [own, other] = [called.module.describe_type(own), caller.module.describe_type(other)];
        let message = format!("{who} takes {takes}, and is given {gives}");
        let note = format!("the first difference: the called shader has {own}, the caller {other}");
        return Some(certain(&contract::PAYLOAD_STRUCTURE, message, vec![note]));
    }
    are_laid_out_otherwise(types).then(|| {
        let message = format!("{who} lays out {takes} otherwise than the shader that gives it");
        certain(&contract::PAYLOAD_DECORATION, message, Vec::new())
    })
}

/// Whether a module carries its source.
fn has_source(module: &Module) -> bool {
    module.debug_info.files.iter().any(|file| file.text.is_some())
}

/// Whether the source that a module carries uses a word: then an optimizer has dropped the unused
/// variable that was declared by it.
fn is_in_source(module: &Module, word: &str) -> bool {
    let texts = module.debug_info.files.iter().filter_map(|file| file.text.as_deref());
    texts.flat_map(str::lines).any(|line| line.split("//").next().is_some_and(|code| code.contains(word)))
}

/// The variables of a storage class that a module declares, with their types, used or not.
fn of_class(program: &Program, class: u32) -> impl Iterator<Item = (Id, TypeId)> {
    let module = &program.module;
    let variables = module.variables.iter().filter(move |variable| variable.storage_class == class);
    variables.filter_map(|variable| Some((variable.id, module.pointee(variable.id)?)))
}

/// The name of a variable that a shader could pass to others, and never does.
fn unpassed(program: &Program, class: u32) -> Option<&str> {
    let is_passed = |variable: &InterfaceRegisters| {
        program.ops.iter().any(|op| op.payload_span().is_some_and(|span| span.first == variable.first))
    };
    let mut own = program.interface.iter().filter(|variable| variable.storage_class == class);
    let variable = own.find(|variable| !is_passed(variable))?;
    program.module.name(variable.variable)
}
