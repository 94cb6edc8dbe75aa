//! Compiles WGSL with naga.

use naga::back::spv;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

use super::{CompileOptions, Compiled, DebugInfoLevel, Source, bytes};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::input::contained;

mod panic_place;

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
        invalid(source, message, error.spans().cloned())
    })?;

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
    let words = contained("naga", ErrorKind::InvalidSource, || write(source, &module, &info, &settings));
    let words = words.map_err(|error| {
        let is_panic = |module: &naga::Module| {
            let is_written = |module| {
                contained("naga", ErrorKind::InvalidSource, || {
                    // An error other than a panic is a result, too.
                    let _ = spv::write_vec(module, &info, &settings, None);
                    Ok(())
                })
            };
            is_written(module).is_err()
        };
        match panic_place::find(&module, &is_panic).filter(|_| is_panic(&module)) {
            Some(span) => labelled(source, error, [(span, String::new())].into_iter()),
            None => error,
        }
    })?;
    Ok(Compiled { spirv: bytes(&words), warnings: Vec::new() })
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

    #[test]
    fn the_recorded_version_is_that_of_the_lock_file() {
        let lock = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.lock");
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
}
