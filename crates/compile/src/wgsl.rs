//! Compiles WGSL with naga.

use naga::back::pipeline_constants::{PipelineConstantError, process_overrides};
use naga::back::spv;
use naga::valid::{Capabilities, ModuleInfo, ValidationError, ValidationFlags, Validator};
use naga::{Arena, Block, Function, Module, Span, UniqueArena};

use super::{CompileOptions, Compiled, DebugInfoLevel, Source, bytes};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::contained;

/// naga has no constant for its version; a test compares this with `Cargo.lock`.
pub(super) const NAGA_VERSION: &str = "30.0.1";

/// Compiles to SPIR-V 1.6, or the version that naga raises it to.
pub(super) fn compile(source: &Source, options: &CompileOptions) -> Result<Compiled> {
    contained("naga", ErrorKind::InvalidSource, || translate(source, options)).map_err(|error| {
        // A panic of naga's knows no place.
        let known = error.places().next().is_some() || error.message().starts_with(source.name());
        if known { error } else { error.at(Place::File(source.name().into())) }
    })
}

fn translate(source: &Source, options: &CompileOptions) -> Result<Compiled> {
    let text = source.text();
    let mut front = naga::front::wgsl::Frontend::new_with_options(naga::front::wgsl::Options {
        parse_doc_comments: false,
        capabilities: Capabilities::all(),
    });
    let module = front.parse(text).map_err(|error| {
        let labels = error.labels().map(|(span, label)| (span, label.to_owned()));
        invalid(source, error.message().to_owned(), labels)
    })?;
    // What its writer of SPIR-V does not support, naga panics at; other features it only refuses.
    let unsupported = Capabilities::TEXTURE_EXTERNAL;
    let capabilities = Capabilities::all().difference(unsupported);
    let info = Validator::new(ValidationFlags::all(), capabilities).validate(&module).map_err(|error| {
        let mut message = error.as_inner().to_string();
        let mut cause = std::error::Error::source(error.as_inner());
        while let Some(inner) = cause {
            message = format!("{message}: {inner}");
            cause = inner.source();
        }
        let spans: Vec<_> = error.spans().cloned().collect();
        let of_type = if spans.is_empty() { place_of_type(&module, error.as_inner()) } else { None };
        invalid(source, message, spans.into_iter().chain(of_type.map(|span| (span, String::new()))))
    })?;

    // SPIR-V has the overrides' defaults: naga writes no specialization constants.
    let constants = naga::back::PipelineConstants::default();
    let (module, info) =
        process_overrides(&module, &info, None, &constants).map_err(|error| match error {
            PipelineConstantError::MissingValue(name) => {
                let is_named = |one: &naga::Override| {
                    one.name.as_deref() == Some(&name) || one.id.is_some_and(|id| id.to_string() == name)
                };
                let found = module.overrides.iter().find(|(_, one)| is_named(one));
                let span = found.map(|(handle, _)| (module.overrides.get_span(handle), String::new()));
                let message =
                    format!("the override `{name}` has no default value, and overrides cannot be set");
                invalid(source, message, span.into_iter())
            }
            error => invalid(source, error.to_string(), std::iter::empty()),
        })?;
    let (module, info) = (module.as_ref(), info.as_ref());

    let mut flags = spv::WriterFlags::empty();
    let debug_info = (options.debug != DebugInfoLevel::Names).then(|| spv::DebugInfo {
        source_code: text,
        file_name: source.name(),
        language: spv::SourceLanguage::WGSL,
    });
    // Names help every report; naga ties them to this flag.
    flags.insert(spv::WriterFlags::DEBUG);
    let settings = spv::Options {
        lang_version: (1, 6),
        flags,
        debug_info,
        // No checks are inserted, as browsers do: these would hide mistakes of the shader.
        force_loop_bounding: false,
        ray_query_initialization_tracking: false,
        trace_ray_argument_validation: false,
        ..spv::Options::default()
    };
    let words = contained("naga", ErrorKind::InvalidSource, || write(source, module, info, &settings));
    let words = words.map_err(|error| {
        let is_panic = |module: &naga::Module| {
            let is_written = |module| {
                contained("naga", ErrorKind::InvalidSource, || {
                    // An error other than a panic is a result, too.
                    let _ = spv::write_vec(module, info, &settings, None);
                    Ok(())
                })
            };
            is_written(module).is_err()
        };
        match panic_place(module, &is_panic).filter(|_| is_panic(module)) {
            Some(span) => labelled(source, error, [(span, String::new())].into_iter()),
            None => error,
        }
    })?;
    Ok(Compiled { spirv: bytes(&words), warnings: Vec::new() })
}

/// The place of a variable whose type is invalid: types without a name have none.
fn place_of_type(module: &naga::Module, error: &ValidationError) -> Option<naga::Span> {
    let ValidationError::Type { handle, .. } = error else { return None };
    let variables = &module.global_variables;
    let (variable, _) = variables.iter().find(|(_, variable)| variable.ty == *handle)?;
    Some(variables.get_span(variable))
}

fn write(
    source: &Source,
    module: &naga::Module,
    info: &ModuleInfo,
    settings: &spv::Options<'_>,
) -> Result<Vec<u32>> {
    spv::write_vec(module, info, settings, None)
        .map_err(|error| Error::new(ErrorKind::InvalidSource, format!("{}: {error}", source.name())))
}

fn invalid(source: &Source, message: String, labels: impl Iterator<Item = (naga::Span, String)>) -> Error {
    labelled(source, Error::new(ErrorKind::InvalidSource, message), labels)
}

fn labelled(source: &Source, mut error: Error, labels: impl Iterator<Item = (naga::Span, String)>) -> Error {
    for (span, label) in labels {
        if let Some(span) = span.to_range() {
            let place = Place::Text { file: source.name().to_owned(), text: source.text().clone(), span };
            error = error.at_with(place, label);
        }
    }
    error
}

/// The place of the part without which nothing panics; `None` where that is not in the source.
fn panic_place(module: &Module, panics: &dyn Fn(&Module) -> bool) -> Option<Span> {
    let mut declarations = module.clone();
    for function in functions(&mut declarations) {
        function.body = Block::new();
    }
    if !panics(&declarations) {
        return in_functions(module, panics);
    }
    // Without functions, as few types and variables as panic.
    declarations.functions.clear();
    declarations.entry_points.clear();
    let span = last_of(declarations.global_variables.len(), &|count| {
        let mut fewer = declarations.clone();
        fewer.global_variables = Arena::default();
        for (handle, variable) in declarations.global_variables.iter().take(count) {
            fewer.global_variables.append(variable.clone(), declarations.global_variables.get_span(handle));
        }
        panics(&fewer)
    });
    if let Some(at) = span {
        let (handle, _) = declarations.global_variables.iter().nth(at)?;
        return defined(declarations.global_variables.get_span(handle));
    }
    declarations.global_variables = Arena::default();
    let at = last_of(declarations.types.len(), &|count| {
        let mut fewer = declarations.clone();
        fewer.types = UniqueArena::default();
        for (handle, ty) in declarations.types.iter().take(count) {
            fewer.types.insert(ty.clone(), declarations.types.get_span(handle));
        }
        panics(&fewer)
    })?;
    let (handle, _) = declarations.types.iter().nth(at)?;
    // Types without a name have no place; a variable of one has.
    let of_variable = module.global_variables.iter().find(|(_, variable)| variable.ty == handle);
    defined(module.types.get_span(handle))
        .or_else(|| defined(module.global_variables.get_span(of_variable?.0)))
}

/// The statement that panics, in the first function whose body does.
fn in_functions(module: &Module, panics: &dyn Fn(&Module) -> bool) -> Option<Span> {
    let mut rest = module.clone();
    let count = functions(&mut rest).count();
    for number in 0..count {
        let mut one = module.clone();
        for (other, function) in functions(&mut one).enumerate() {
            if other != number {
                function.body = Block::new();
            }
        }
        if !panics(&one) {
            continue;
        }
        let whole = functions(&mut one).nth(number)?.body.clone();
        let at = last_of(whole.len(), &|count| {
            let mut fewer = one.clone();
            if let Some(function) = functions(&mut fewer).nth(number) {
                function.body.cull(count..);
            }
            panics(&fewer)
        })?;
        return whole.span_iter().nth(at).and_then(|(_, span)| defined(*span));
    }
    None
}

fn functions(module: &mut Module) -> impl Iterator<Item = &mut Function> {
    let Module { functions, entry_points, .. } = module;
    let entries = entry_points.iter_mut().map(|entry| &mut entry.function);
    functions.iter_mut().map(|(_, function)| function).chain(entries)
}

/// The last element of the shortest beginning of a list that panics; `None` where none is needed,
/// or where all of them do not.
fn last_of(count: usize, panics: &dyn Fn(usize) -> bool) -> Option<usize> {
    if panics(0) {
        return None;
    }
    (1..=count).find(|&count| panics(count)).map(|count| count - 1)
}

fn defined(span: Span) -> Option<Span> {
    (span != Span::UNDEFINED).then_some(span)
}

#[cfg(test)]
mod tests {
    use pretty_assertions::assert_eq;

    use super::*;

    fn report(text: &str) -> String {
        let source = Source::from_text("a.wgsl", text).unwrap();
        let error = source.compile(&CompileOptions::default()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidSource);
        error.render()
    }

    /// WGSL, "override Declarations": without a value from the pipeline an override has that of its
    /// initializer.
    #[test]
    fn overrides_have_their_defaults() {
        let text = "override n: u32 = 4u; override twice: u32 = n * 2u; var<workgroup> w: array<u32, 8>;\n\
                    @group(0) @binding(0) var<storage, read_write> o: array<u32>;\n\
                    @compute @workgroup_size(n) fn main() { o[0] = twice; }";
        let source = Source::from_text("over.wgsl", text).unwrap();
        let module =
            anyhit_engine::module::load(&compile(&source, &CompileOptions::default()).unwrap().spirv)
                .unwrap();
        let program =
            anyhit_engine::program::lower(&std::sync::Arc::new(module.clone()), &module.entry_points[0])
                .unwrap();
        assert_eq!(program.workgroup.map(|layout| layout.size), Some([4, 1, 1]));
        let source = Source::from_text("over.wgsl", text.replace(" = 4u", "")).unwrap();
        let Err(error) = compile(&source, &CompileOptions::default()) else { panic!("a value") };
        let error = error.render();
        assert!(
            error.contains("the override `n` has no default value") && error.contains("over.wgsl:1:"),
            "{error}"
        );
    }

    #[test]
    fn the_recorded_version_is_that_of_the_lock_file() {
        let lock = concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.lock");
        let lock = std::fs::read_to_string(lock).unwrap().replace("\r\n", "\n");
        let wanted = format!("name = \"naga\"\nversion = \"{NAGA_VERSION}\"\n");
        assert!(lock.contains(&wanted), "Cargo.lock has no {wanted}");
    }

    #[test]
    fn a_syntax_error_shows_line_and_caret() {
        let report = report("fn f() -> f32 {\n    return 1.0 +;\n}\n");
        assert!(report.contains("a.wgsl:2:17"), "{report}");
        assert!(report.contains("2 │     return 1.0 +;\n  │                 ^"), "{report}");
    }

    #[test]
    fn an_unknown_name_shows_its_span() {
        let report = report("fn f() -> f32 {\n    return blue;\n}\n");
        assert!(report.contains("a.wgsl:2:12"), "{report}");
        assert!(report.contains("^^^^"), "{report}");
    }

    #[test]
    fn a_validation_error_shows_its_span() {
        let report = report("@group(0) @binding(0) var<storage> x: array<f32>;\nfn f() { x[0] = 1.0; }\n");
        assert!(report.contains("a.wgsl:2:"), "{report}");
    }

    #[test]
    fn ray_tracing_stages_compile() {
        let text = "enable wgpu_ray_tracing_pipeline;\n\
            struct Payload { colour: vec3f }\n\
            var<incoming_ray_payload> payload: Payload;\n\
            @miss @incoming_payload(payload) fn sky() { payload.colour = vec3f(0.5); }\n";
        let source = Source::from_text("a.wgsl", text).unwrap();
        let spirv = source.compile(&CompileOptions::default()).unwrap();
        assert_eq!(spirv[..4], [3, 2, 0x23, 7]);
    }

    const PARTS: &str = "@group(0) @binding(0) var<storage, read_write> out: array<f32>;\n\
        fn first() { out[0] = 1.0; }\n\
        @compute @workgroup_size(1) fn main() {\n    out[1] = 2.0;\n    workgroupBarrier();\n    first();\n}\n";

    fn line_of(panics: &dyn Fn(&Module) -> bool) -> Option<u32> {
        let module = naga::front::wgsl::parse_str(PARTS).unwrap();
        panic_place(&module, panics).map(|span| span.location(PARTS).line_number)
    }

    fn bodies(module: &Module) -> Vec<Block> {
        functions(&mut module.clone()).map(|function| function.body.clone()).collect()
    }

    #[test]
    fn a_statement_is_found_in_its_function() {
        let is_barrier =
            |statement: &naga::Statement| matches!(statement, naga::Statement::ControlBarrier(_));
        assert_eq!(line_of(&|module| bodies(module).iter().any(|body| body.iter().any(is_barrier))), Some(5));
        let is_store = |statement: &naga::Statement| matches!(statement, naga::Statement::Store { .. });
        assert_eq!(line_of(&|module| bodies(module)[0].iter().any(is_store)), Some(2));
    }

    #[test]
    fn a_variable_is_found_and_a_module_without_a_cause_is_not() {
        assert_eq!(line_of(&|module| !module.global_variables.is_empty()), Some(1));
        assert_eq!(line_of(&|_| true), None);
        assert_eq!(line_of(&|_| false), None);
    }
}
