//! The compilers at work. Where one is missing, its tests say so: those of GLSL are listed as
//! ignored without the feature `glsl`, those of Slang write a line each without `slangc`.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhit::ErrorKind;
use anyhit::compile::{DebugInfo, Language, Optimize, Options, Source, Stage, compile, tool};
use anyhit::error::Place;

const GLSL_MISS: &str = "#version 460\n#extension GL_EXT_ray_tracing : require\n\
    layout(location = 0) rayPayloadInEXT vec4 payload;\nvoid main() { payload = vec4(1.0); }\n";

const SLANG_MISS: &str = "struct Payload { float3 colour; };\n\
    [shader(\"miss\")] void sky(inout Payload payload) { payload.colour = float3(1, 2, 3); }\n";

const OP_LINE: u16 = 8;
const OP_EXT_INST: u16 = 12;

/// The opcodes of a module in order, from its words alone.
fn opcodes(spirv: &[u8]) -> Vec<u16> {
    let words: Vec<u32> = spirv.chunks(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
    let (mut at, mut found) = (5, Vec::new());
    while at < words.len() {
        found.push(words[at] as u16);
        at += (words[at] >> 16) as usize;
    }
    found
}

/// Magic number and version: the latter as 0 | major | minor | 0 (SPIR-V 2.3), little endian.
const SPIRV_1_6: [u8; 8] = [3, 2, 0x23, 7, 0, 6, 1, 0];

/// A folder of its own for one test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("anyhit-compile-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.0.join(name), text).unwrap();
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The first place of the report about a source that does not compile: file and text meant.
fn place_of_mistake(source: &Source) -> (String, String) {
    let error = compile(source, &Options::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidSource, "{error:?}");
    match error.places().next() {
        Some((Place::Text { file, text, span }, _)) => (file.clone(), text[span.clone()].to_owned()),
        other => panic!("{other:?} in {error:?}"),
    }
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_becomes_spirv_1_6() {
    let source = Source::from_text("a.rmiss", GLSL_MISS).unwrap();
    let spirv = compile(&source, &Options::default()).unwrap();
    assert_eq!(spirv[..8], SPIRV_1_6);
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_debug_info_adds_lines_or_nonsemantic_instructions() {
    let source = Source::from_text("a.rmiss", GLSL_MISS).unwrap();
    let with = |debug| {
        let spirv = compile(&source, &Options { debug, ..Options::default() }).unwrap();
        let found = opcodes(&spirv);
        (found.contains(&OP_LINE), found.contains(&OP_EXT_INST))
    };
    assert_eq!(with(DebugInfo::Names), (false, false));
    assert_eq!(with(DebugInfo::Lines), (true, false));
    assert!(with(DebugInfo::Full).1);
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_debug_info_carries_the_text_as_written() {
    let text = format!("{GLSL_MISS}// as written\n");
    let source = Source::from_text("a.rmiss", text).unwrap();
    let spirv = compile(&source, &Options { debug: DebugInfo::Full, ..Options::default() }).unwrap();
    let copies = spirv.windows(13).filter(|bytes| bytes == b"// as written").count();
    assert_eq!(copies, 1);
    assert_eq!(spirv.windows(9).filter(|bytes| bytes == b"#version ").count(), 1);
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn a_mistake_in_glsl_is_shown_in_the_text() {
    let source = Source::from_text("a.rmiss", GLSL_MISS.replace("vec4(1.0)", "blue")).unwrap();
    let report = compile(&source, &Options::default()).unwrap_err().render();
    assert!(report.contains("'blue': undeclared identifier"), "{report}");
    assert!(report.contains("a.rmiss:4:"), "{report}");
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn a_mistake_in_an_include_is_shown_there() {
    let folder = Folder::new("include");
    folder.write("sky.glsl", "vec3 sky() {\n    return blue;\n}\n");
    folder.write(
        "a.rmiss",
        "#version 460\n#extension GL_EXT_ray_tracing : require\n\
         #extension GL_GOOGLE_include_directive : require\n#include \"sky.glsl\"\nvoid main() {}\n",
    );
    let (file, text) = place_of_mistake(&Source::read_in(&folder.0, "a.rmiss").unwrap());
    assert_eq!(file, "sky.glsl");
    // glslang's column is that of its preprocessed text, which keeps lines but not indentation.
    assert!(!text.contains('\n') && "    return blue;".contains(&text), "{text:?}");
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn a_missing_include_is_an_error() {
    let text = GLSL_MISS
        .replace("layout", "#extension GL_GOOGLE_include_directive : require\n#include \"x.glsl\"\nlayout");
    let error = compile(&Source::from_text("a.rmiss", text).unwrap(), &Options::default()).unwrap_err();
    assert!(error.render().contains("x.glsl"), "{error:?}");
}

#[test]
#[cfg_attr(feature = "glsl", ignore = "is about a build without the feature `glsl`")]
fn a_build_without_glslang_says_how_to_get_it() {
    let source = Source::from_text("a.rgen", "").unwrap();
    let error = compile(&source, &Options::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::UnsupportedTool);
    assert!(error.render().contains("--features glsl"), "{error:?}");
    assert!(tool(Language::Glsl(Stage::Miss)).is_err());
}

/// Whether `slangc` is there. Where it is not, a line past the test harness's capture says so.
fn slangc_installed(test: &str) -> bool {
    let found = tool(Language::Slang);
    if let Err(error) = &found {
        let _ = writeln!(std::io::stderr(), "SKIPPED {test}: {}", error.message());
    }
    found.is_ok()
}

#[test]
fn slang_keeps_the_names_of_entry_points() {
    if !slangc_installed("slang_keeps_the_names_of_entry_points") {
        return;
    }
    let source = Source::from_text("a.slang", SLANG_MISS).unwrap();
    for optimize in [Optimize::Default, Optimize::Off] {
        let spirv = compile(&source, &Options { optimize, ..Options::default() }).unwrap();
        assert_eq!(spirv[..4], SPIRV_1_6[..4]);
        assert!(spirv.windows(4).any(|bytes| bytes == b"sky\0"));
    }
}

#[test]
fn slang_debug_info_adds_nonsemantic_instructions() {
    if !slangc_installed("slang_debug_info_adds_nonsemantic_instructions") {
        return;
    }
    let source = Source::from_text("a.slang", SLANG_MISS).unwrap();
    let with = |debug| {
        let spirv = compile(&source, &Options { debug, ..Options::default() }).unwrap();
        opcodes(&spirv).contains(&OP_EXT_INST)
    };
    assert!(!with(DebugInfo::Names));
    assert!(with(DebugInfo::Full));
}

#[test]
fn a_mistake_in_slang_is_shown_in_the_text() {
    if !slangc_installed("a_mistake_in_slang_is_shown_in_the_text") {
        return;
    }
    let text = SLANG_MISS.replace("float3(1, 2, 3)", "blue");
    let place = place_of_mistake(&Source::from_text("a.slang", text).unwrap());
    assert_eq!(place, ("a.slang".into(), "blue".into()));
}

#[test]
fn a_mistake_in_an_include_of_slang_is_shown_there() {
    if !slangc_installed("a_mistake_in_an_include_of_slang_is_shown_there") {
        return;
    }
    let folder = Folder::new("slang-include");
    folder.write("sky.slangh", "float3 colour_of_sky() { return blue; }\n");
    folder.write("a.slang", &format!("#include \"sky.slangh\"\n{SLANG_MISS}"));
    let (file, text) = place_of_mistake(&Source::read_in(&folder.0, "a.slang").unwrap());
    assert_eq!((Path::new(&file), text.as_str()), (Path::new("sky.slangh"), "blue"));
}
