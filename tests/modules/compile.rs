//! The compilers at work. Where one is missing, its tests say so: those of GLSL are listed as
//! ignored without the feature `glsl`, those of Slang are skipped by name without `slangc`.

use std::path::{Path, PathBuf};

use anyhit::ErrorKind;
use anyhit_base::error::Place;
use anyhit_compile::{CompileOptions, DebugInfoLevel, Language, Optimize, Source};

use crate::support::skipped::{self, test_name};

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
    let error = source.compile(&CompileOptions::default()).unwrap_err();
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
    let spirv = source.compile(&CompileOptions::default()).unwrap();
    assert_eq!(spirv[..8], SPIRV_1_6);
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_debug_info_adds_lines_or_nonsemantic_instructions() {
    let source = Source::from_text("a.rmiss", GLSL_MISS).unwrap();
    let with = |debug| {
        let spirv = source.compile(&CompileOptions::default().debug(debug)).unwrap();
        let found = opcodes(&spirv);
        (found.contains(&OP_LINE), found.contains(&OP_EXT_INST))
    };
    assert_eq!(with(DebugInfoLevel::Names), (false, false));
    assert_eq!(with(DebugInfoLevel::Lines), (true, false));
    assert!(with(DebugInfoLevel::Full).1);
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_debug_info_carries_the_text_as_written() {
    let text = format!("{GLSL_MISS}// as written\n");
    let source = Source::from_text("a.rmiss", text).unwrap();
    let spirv = source.compile(&CompileOptions::default().debug(DebugInfoLevel::Full)).unwrap();
    let copies = spirv.windows(13).filter(|bytes| bytes == b"// as written").count();
    assert_eq!(copies, 1);
    assert_eq!(spirv.windows(9).filter(|bytes| bytes == b"#version ").count(), 1);
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn a_mistake_in_glsl_is_shown_in_the_text() {
    let source = Source::from_text("a.rmiss", GLSL_MISS.replace("vec4(1.0)", "blue")).unwrap();
    let report = source.compile(&CompileOptions::default()).unwrap_err().render();
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
    let error = Source::from_text("a.rmiss", text).unwrap().compile(&CompileOptions::default()).unwrap_err();
    assert!(error.render().contains("x.glsl"), "{error:?}");
}

/// Compiled by the tool that the environment names, whether or not glslang is built in. The
/// variable belongs to a process, so the test asks one of its own.
#[test]
fn a_named_glslang_is_used_and_must_exist() {
    let folder = Folder::new("named");
    folder.write("a.rmiss", GLSL_MISS);
    let run = |tool: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
        command.args(["compile", "a.rmiss"]).current_dir(&folder.0).env("GLSLANG", tool);
        command.output().unwrap()
    };
    let output = run("no-such-glslang");
    assert_eq!(output.status.code(), Some(4));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("GLSLANG names no program: `no-such-glslang`"), "{said}");
    if !skipped::has_programs(test_name!(), &["glslangValidator"]) {
        return;
    }
    assert_eq!(run("glslangValidator").status.code(), Some(0));
    assert_eq!(std::fs::read(folder.0.join("a.rmiss.spv")).unwrap()[..8], SPIRV_1_6);
    folder.write("a.rmiss", &GLSL_MISS.replace("vec4(1.0)", "blue"));
    let said = String::from_utf8_lossy(&run("glslangValidator").stderr).into_owned();
    assert!(said.contains("'blue': undeclared identifier") && said.contains("a.rmiss:4:"), "{said}");
    let unknown = GLSL_MISS.replace("GL_EXT_ray_tracing :", "GL_NV_no_such_extension :");
    folder.write("a.rmiss", &unknown);
    let said = String::from_utf8_lossy(&run("glslangValidator").stderr).into_owned();
    assert!(said.contains("extension not supported: GL_NV_no_such_extension"), "{said}");
    assert!(said.contains("install a newer glslang, or build anyhit with its own"), "{said}");
}

/// Whether an installed glslang serves; where there is none, a line says so.
#[cfg(not(feature = "glsl"))]
#[test]
fn a_build_without_glslang_calls_an_installed_one_or_says_how_to_get_it() {
    let source = Source::from_text("a.rmiss", GLSL_MISS).unwrap();
    if anyhit_compile::tool(Language::Glsl(anyhit::Stage::Miss)).is_ok() {
        assert_eq!(source.compile(&CompileOptions::default()).unwrap()[..8], SPIRV_1_6);
        let text = GLSL_MISS.replace("vec4(1.0)", "blue");
        let report = Source::from_text("a.rmiss", text)
            .unwrap()
            .compile(&CompileOptions::default())
            .unwrap_err()
            .render();
        assert!(report.contains("'blue': undeclared identifier"), "{report}");
        assert!(report.contains("a.rmiss:4:"), "{report}");
    } else {
        skipped::skipped(test_name!(), "no glslang is installed: only its absence is tested");
        let error = source.compile(&CompileOptions::default()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnsupportedTool);
        assert!(error.render().contains("--features glsl"), "{error:?}");
    }
}

#[test]
fn slang_keeps_the_names_of_entry_points() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    let source = Source::from_text("a.slang", SLANG_MISS).unwrap();
    for optimize in [Optimize::Default, Optimize::Off] {
        let spirv = source.compile(&CompileOptions::default().optimize(optimize)).unwrap();
        assert_eq!(spirv[..4], SPIRV_1_6[..4]);
        assert!(spirv.windows(4).any(|bytes| bytes == b"sky\0"));
    }
}

#[test]
fn hlsl_compiles_with_the_names_of_entry_points() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    let text = "struct Payload { float3 at; float t; };\n\
        struct Attributes { float2 barycentrics; };\n\
        [shader(\"closesthit\")]\n\
        void triangle_hit(inout Payload payload, in Attributes attributes) {\n\
            payload.at = float3(attributes.barycentrics, PrimitiveIndex());\n\
            payload.t = RayTCurrent();\n\
        }\n";
    let module = anyhit::Module::from_source("a.hlsl", text).unwrap();
    // The point (1/4, 1/2, 0) of the triangle, from 2 above: its barycentrics are its coordinates.
    let hit = anyhit::Hit::triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        .ray(anyhit::Ray::new([0.25, 0.5, 2.0], [0.0, 0.0, -1.0]));
    let outcome = anyhit::ShaderTest::new(&module, "triangle_hit").unwrap().hit(hit).run().unwrap();
    assert_eq!(outcome.payload["at"].vec3(), [0.25, 0.5, 0.0]);
    assert_eq!(outcome.payload["t"].f32(), 2.0);
    let error = anyhit::Module::from_source("a.hlsl", &text.replace("RayTCurrent()", "blue")).unwrap_err();
    assert!(error.render().contains("a.hlsl:6:"), "{error:?}");
}

#[test]
fn slang_debug_info_adds_nonsemantic_instructions() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    let source = Source::from_text("a.slang", SLANG_MISS).unwrap();
    let with = |debug| {
        let spirv = source.compile(&CompileOptions::default().debug(debug)).unwrap();
        opcodes(&spirv).contains(&OP_EXT_INST)
    };
    assert!(!with(DebugInfoLevel::Names));
    assert!(with(DebugInfoLevel::Full));
}

#[test]
fn a_mistake_in_slang_is_shown_in_the_text() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    let text = SLANG_MISS.replace("float3(1, 2, 3)", "blue");
    let place = place_of_mistake(&Source::from_text("a.slang", text).unwrap());
    assert_eq!(place, ("a.slang".into(), "blue".into()));
}

#[test]
fn a_mistake_in_an_include_of_slang_is_shown_there() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    let folder = Folder::new("slang-include");
    folder.write("sky.slangh", "float3 colour_of_sky() { return blue; }\n");
    folder.write("a.slang", &format!("#include \"sky.slangh\"\n{SLANG_MISS}"));
    let (file, text) = place_of_mistake(&Source::read_in(&folder.0, "a.slang").unwrap());
    assert_eq!((Path::new(&file), text.as_str()), (Path::new("sky.slangh"), "blue"));
}

/// A source in a folder of its own, whose header stands in another: without that folder a mistake,
/// with it none, and a mistake of the header is shown there.
fn includes_from(folder: &Folder, source: &str, header: &str, header_text: &str) {
    std::fs::create_dir_all(folder.0.join("common")).unwrap();
    folder.write(&format!("common/{header}"), header_text);
    let read = || Source::read_in(&folder.0, source).unwrap();
    let options = CompileOptions::default();
    assert_eq!(read().compile(&options).unwrap_err().kind(), ErrorKind::InvalidSource);
    let with = || read().include_folders(["nowhere", "common"]);
    with().compile(&options).unwrap();
    assert_ne!(with().content_hash(), read().content_hash(), "the header is part of what is compiled");
    folder.write(&format!("common/{header}"), &header_text.replace("1.0", "blue"));
    let (file, _) = place_of_mistake(&with());
    assert_eq!(Path::new(&file), Path::new("common").join(header));
    // The command line compiles it to the same words.
    folder.write(&format!("common/{header}"), header_text);
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(["compile", source, "-I", "common", "-o", "out.spv"]).current_dir(&folder.0);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // And in a case, relative to its file.
    folder.write(
        "scene.toml",
        &format!(
            "version = 1\n[shaders.sky]\nsource = \"{source}\"\nentry = \"{}\"\ninclude_folders = [\"common\"]\n\
             [pipeline]\nmiss = \"sky\"\n[[ray]]\norigin = [0, 0, 0]\ndirection = [0, 0, 1]\n\
             expect = {{ miss = true, payload = {{ colour = [1, 1, 1] }} }}\n",
            if source.ends_with(".slang") { "sky" } else { "main" }
        ),
    );
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
    let output = command.arg("test").arg(&folder.0).env("ANYHIT_CACHE", "off").output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{out}{err}");
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_includes_from_other_folders() {
    let folder = Folder::new("glsl-folders");
    folder.write(
        "a.rmiss",
        "#version 460\n#extension GL_EXT_ray_tracing : require\n\
         #extension GL_GOOGLE_include_directive : require\n#include <sky.glsl>\n\
         struct Payload { vec3 colour; };\nlayout(location = 0) rayPayloadInEXT Payload payload;\n\
         void main() { payload.colour = colour_of_sky(); }\n",
    );
    includes_from(&folder, "a.rmiss", "sky.glsl", "vec3 colour_of_sky() { return vec3(1.0); }\n");
}

#[test]
fn slang_includes_from_other_folders() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    let folder = Folder::new("slang-folders");
    let text = SLANG_MISS.replace("float3(1, 2, 3)", "colour_of_sky()");
    folder.write("a.slang", &format!("#include \"sky.slangh\"\n{text}"));
    includes_from(&folder, "a.slang", "sky.slangh", "float3 colour_of_sky() { return float3(1.0); }\n");
}

/// A `slangc` that writes its arguments down, says what the file `warnings` holds, and gives a
/// module, whatever its source says.
#[cfg(unix)]
fn stand_in_for_slangc(folder: &Folder) -> std::path::PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let module =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/compute/prefix-sum/main.comp.spv");
    let script = format!(
        "#!/bin/sh\nprintf '%s\\n' \"$@\" >> '{0}/arguments'\ncat '{0}/warnings' >&2\nwhile [ $# -gt 0 ]; do [ \"$1\" = -o ] && cp '{1}' \"$2\"; shift; done\n",
        folder.0.display(),
        module.display()
    );
    folder.write("slangc", &script);
    folder.write("warnings", "");
    let path = folder.0.join("slangc");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// The compiler flags of a scene's Slang source, and what `anyhit run` says: code, errors,
/// arguments.
#[cfg(unix)]
fn run_with_flags(name: &str, shader: &str) -> (Option<i32>, String, Vec<String>) {
    let folder = Folder::new(name);
    let slangc = stand_in_for_slangc(&folder);
    folder.write("a.slang", "// the stand-in does not read it");
    folder.write(
        "scene.toml",
        &format!(
            "version = 1\n{shader}[[dispatch]]\nshader = 'a'\n\
             [resources.a]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4096\n\
             [resources.b]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4096\n\
             [resources.c]\ntype = 'storage_buffer'\nbinding = 2\nsize = 4096\n"
        ),
    );
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(["run", "scene.toml"]).current_dir(&folder.0);
    let output = command.env("SLANGC", slangc).env("ANYHIT_CACHE", "off").output().unwrap();
    let arguments = std::fs::read_to_string(folder.0.join("arguments")).unwrap_or_default();
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), err, arguments.lines().map(str::to_owned).collect())
}

#[test]
#[cfg(unix)]
fn flags_of_a_scene_reach_slangc() {
    let (code, err, arguments) = run_with_flags(
        "flags",
        "[shaders.a]\nsource = 'a.slang'\n\
         compiler_flags = ['-force-glsl-scalar-layout', '-DSPHERES=3', '-O0', '-Icommon', '-capability', 'spvRayQueryKHR']\n",
    );
    assert_eq!(code, Some(0), "{err}");
    let has = |wanted: &[&str]| arguments.windows(wanted.len()).any(|some| some == wanted);
    for wanted in [
        &["-I", "common"][..],
        &["-DSPHERES=3", "-force-glsl-scalar-layout", "-capability", "spvRayQueryKHR"],
        &["-O0"],
    ] {
        assert!(has(wanted), "{wanted:?} in {arguments:?}");
    }
}

#[test]
#[cfg(unix)]
fn a_flag_that_writes_files_is_refused_where_it_stands() {
    let shader = "[shaders.a]\nsource = 'a.slang'\ncompiler_flags = ['-O0', '-o', 'a.txt']\n";
    let (code, err, arguments) = run_with_flags("refused-flags", shader);
    assert_eq!((code, arguments.len()), (Some(2), 0));
    assert!(
        err.contains("the flag `-o` is not passed on to slangc") && err.contains("scene.toml:4:26"),
        "{err}"
    );
    assert!(err.contains("the flags of a Slang source are: -D NAME[=VALUE], -I FOLDER"), "{err}");
    let shader = "[shaders.a]\npath = 'a.spv'\ncompiler_flags = '-O0'\n";
    let (code, err, _) = run_with_flags("module-flags", shader);
    assert_eq!(code, Some(2));
    assert!(err.contains("`compiler_flags` apply only to a `source`: a module is already compiled"), "{err}");
}

const BUFFERS: &str = "[[dispatch]]\nshader = 'a'\n\
    [resources.a]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4096\n\
    [resources.b]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4096\n\
    [resources.c]\ntype = 'storage_buffer'\nbinding = 2\nsize = 4096\n";

/// Runs `anyhit` in a folder with its stand-in for slangc and a cache: code, output, errors.
#[cfg(unix)]
fn anyhit_in(folder: &Folder, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).current_dir(&folder.0).env("SLANGC", folder.0.join("slangc"));
    let output = command.env("ANYHIT_CACHE", folder.0.join("cache")).output().unwrap();
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// The command says them, a scene notes them, and so does a module out of the cache.
#[test]
#[cfg(unix)]
fn warnings_of_a_compiler_are_shown_each_time() {
    let folder = Folder::new("warnings");
    stand_in_for_slangc(&folder);
    folder.write(
        "warnings",
        "warning[E31000]: unknown attribute\n  --> a.slang:2:3\n   |\n2 | [x]\n   |  ^ 'x'\n---'\n",
    );
    folder.write("a.slang", "// the stand-in does not read it");
    folder.write("scene.toml", &format!("version = 1\n[shaders]\na = 'a.slang'\n{BUFFERS}"));
    let warning = "a.slang:2:3: [E31000] unknown attribute: 'x'\n";
    let (code, out, err) = anyhit_in(&folder, &["compile", "a.slang"]);
    assert_eq!((code, out.as_str(), err), (Some(0), "", format!("warning: {warning}")));
    for _ in 0..2 {
        let (code, _, err) = anyhit_in(&folder, &["run", "scene.toml"]);
        assert_eq!(code, Some(0), "{err}");
        assert_eq!(err.matches(&format!("note: compiler warning: {warning}")).count(), 1, "{err}");
        let (code, out, err) = anyhit_in(&folder, &["inspect", "--json", "a.slang"]);
        assert_eq!((code, err), (Some(0), format!("warning: {warning}")));
        assert!(out.starts_with('{') && out.ends_with("}\n"), "{out}");
    }
    // `compile` itself, then once with lines for the scene, and once with all for `inspect`.
    let arguments = std::fs::read_to_string(folder.0.join("arguments")).unwrap();
    assert_eq!(arguments.lines().filter(|argument| *argument == "-target").count(), 3);
}

/// What scene and command line say of a source goes before its extension.
#[test]
#[cfg(unix)]
fn language_stage_and_entry_point_reach_slangc() {
    let folder = Folder::new("said");
    stand_in_for_slangc(&folder);
    folder.write("a.rgen", "// the stand-in does not read it");
    let shader = "[shaders.a]\nsource = 'a.rgen'\nlanguage = 'hlsl'\nstage = 'compute'\n";
    folder.write("scene.toml", &format!("version = 1\n{shader}{BUFFERS}"));
    let arguments = || std::fs::read_to_string(folder.0.join("arguments")).unwrap();
    let (code, _, err) = anyhit_in(&folder, &["run", "scene.toml"]);
    assert_eq!(code, Some(0), "{err}");
    assert!(
        arguments().starts_with("-lang\nhlsl\na.rgen\n-entry\nmain\n-stage\ncompute\n-o\n"),
        "{}",
        arguments()
    );
    folder.write("arguments", "");
    folder.write("b.slang", "");
    let line = [
        "compile",
        "b.slang",
        "--entry",
        "trace",
        "--stage",
        "closest_hit",
        "-DX=1",
        "--flag",
        "-fvk-t-shift 9 0",
    ];
    let (code, _, err) = anyhit_in(&folder, &line);
    assert_eq!(code, Some(0), "{err}");
    assert!(arguments().starts_with("b.slang\n-entry\ntrace\n-stage\nclosesthit\n-o\n"), "{}", arguments());
    assert!(arguments().contains("\n-DX=1\n-fvk-t-shift\n9\n0\n"), "{}", arguments());
    // What cannot be meant is told where it stands.
    for (shader, place, message) in [
        ("path = 'a.spv'\nstage = 'miss'", "scene.toml:4:9", "`stage` applies only to a `source`"),
        ("source = 'a.wgsl'\nstage = 'miss'", "scene.toml:4:9", "declares the stages of its entry points"),
        ("source = 'a.txt'\nlanguage = 'glsl'", "scene.toml:4:12", "set `stage`"),
        ("source = 'a.rgen'\nlanguage = 'hlsll'", "scene.toml:4:12", "did you mean `hlsl`?"),
        ("source = 'a.rgen'\nstage = 'anyhit'", "scene.toml:4:9", "did you mean `any_hit`?"),
        (
            "source = 'b.slang'\nstage = 'miss'\nentry = '-o'",
            "scene.toml:",
            "`-o` is not the name of an entry point",
        ),
    ] {
        folder.write("scene.toml", &format!("version = 1\n[shaders.a]\n{shader}\n{BUFFERS}"));
        let (code, _, err) = anyhit_in(&folder, &["run", "scene.toml"]);
        assert!(code == Some(2) && err.contains(place) && err.contains(message), "{shader}: {err}");
        assert_eq!(err.matches("error: ").count(), 1, "{shader}: {err}");
    }
}

/// What the first scene says of a source is what the command line said.
#[test]
#[cfg(unix)]
fn a_first_scene_keeps_how_its_sources_are_compiled() {
    let folder = Folder::new("init-flags");
    stand_in_for_slangc(&folder);
    folder.write("a.slang", "// the stand-in does not read it");
    std::fs::create_dir_all(folder.0.join("inc")).unwrap();
    let line =
        ["scene", "--init", "a.slang", "-I", "inc", "-DX=1", "--flag=-fvk-t-shift 10 0", "-o", "s.toml"];
    let (code, _, err) = anyhit_in(&folder, &line);
    assert_eq!(code, Some(0), "{err}");
    let text = std::fs::read_to_string(folder.0.join("s.toml")).unwrap();
    let entry = "compute = { source = \"a.slang\", include_folders = [\"inc\"], \
         compiler_flags = [\"-DX=1\", \"-fvk-t-shift\", \"10\", \"0\"] }";
    assert!(text.contains(entry), "{text}");
    folder.write("arguments", "");
    let (code, _, err) = anyhit_in(&folder, &["smoke", "a.slang", "-Iinc", "-DX=2"]);
    assert_eq!(code, Some(0), "{err}");
    let arguments = std::fs::read_to_string(folder.0.join("arguments")).unwrap();
    assert!(arguments.contains("\n-I\ninc\n-DX=2\n"), "{arguments}");
}

/// A plain `.glsl` is of the stage that is said.
#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_of_a_stage_that_only_the_scene_says() {
    let folder = Folder::new("glsl-stage");
    let text = "#version 460\nlayout(set = 0, binding = 0) buffer Out { uint values[]; };\nvoid main() { values[0] = 7; }\n";
    folder.write("a.glsl", text);
    folder.write(
        "scene.toml",
        "version = 1\n[shaders.a]\nsource = 'a.glsl'\nstage = 'compute'\n[[dispatch]]\nshader = 'a'\n\
         [resources.out]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4\n[[expect.buffer]]\nname = 'out'\nu32 = [7]\n",
    );
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
    let output = command.arg("test").arg(&folder.0).env("ANYHIT_CACHE", "off").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    let source = Source::from_text_as(Language::Glsl(anyhit::Stage::Compute), "a.glsl", text);
    assert_eq!(source.compile(&CompileOptions::default()).unwrap()[..8], SPIRV_1_6);
    let error = Source::from_text("a.glsl", text).unwrap_err().render();
    assert!(error.contains("for a plain .glsl file, set `stage`"), "{error}");
}

/// One source, compiled twice with other definitions: each dispatch runs its own.
#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn glsl_is_compiled_once_for_each_list_of_flags() {
    let folder = Folder::new("glsl-flags");
    folder.write(
        "a.comp",
        "#version 460\nlayout(set = 0, binding = 0) buffer Out { uint values[]; };\n\
         void main() { values[AT] = VALUE; }\n",
    );
    let shader = |name: &str, at: u32, value: u32| {
        format!(
            "[shaders.{name}]\nsource = 'a.comp'\ncompiler_flags = ['-D', 'AT={at}', '-DVALUE={value}u']\n"
        )
    };
    let expect = "[[expect.buffer]]\nname = 'out'\nu32 = [7, 9]\n";
    folder.write(
        "scene.toml",
        &format!(
            "version = 1\n{}{}[[dispatch]]\nshader = 'a'\n[[dispatch]]\nshader = 'b'\n\
             [resources.out]\ntype = 'storage_buffer'\nbinding = 0\nsize = 8\n{expect}",
            shader("a", 0, 7),
            shader("b", 1, 9)
        ),
    );
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
    let output = command.arg("test").arg(&folder.0).env("ANYHIT_CACHE", "off").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}

/// What `anyhit compile` says with a script in place of a compiler, and its exit code.
#[cfg(unix)]
fn with_script(name: &str, variable: &str, tool: &str, script: &str) -> (Option<i32>, String) {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new(name);
    folder.write("a.rmiss", GLSL_MISS);
    folder.write("a.slang", SLANG_MISS);
    folder.write(tool, &format!("#!/bin/sh\n{script}\n"));
    let path = folder.0.join(tool);
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    let source = if variable == "SLANGC" { "a.slang" } else { "a.rmiss" };
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(["compile", source]).current_dir(&folder.0).env(variable, &path);
    // Nothing of it is kept.
    command.env("XDG_CACHE_HOME", folder.0.join("cache"));
    let output = command.output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The tools that the environment names: a compiler that crashes has not judged the source.
#[cfg(unix)]
#[test]
fn a_compiler_that_crashes_or_writes_nothing_is_told_as_such() {
    for (variable, tool) in [("SLANGC", "slangc"), ("GLSLANG", "glslangValidator"), ("GLSLANG", "glslc")] {
        let run = |name: &str, script: &str| with_script(&format!("{name}-{tool}"), variable, tool, script);
        let (code, said) = run("killed", "echo 'half a message' >&2; kill -SEGV $$");
        assert_eq!(code, Some(4), "{said}");
        assert!(
            said.contains(&format!("the compiler `{tool}` was terminated by signal 11 (SIGSEGV)")),
            "{said}"
        );
        assert!(said.contains("its output: half a message"), "{said}");
        let (code, said) = run("aborted", "kill -ABRT $$");
        assert_eq!(code, Some(4), "{said}");
        assert!(said.contains("signal 6 (SIGABRT)"), "{said}");
        let (code, said) = run("silent", "exit 3");
        assert_eq!(code, Some(4), "{said}");
        assert!(said.contains("exited with code 3 and printed nothing"), "{said}");
        let (code, said) = run("nothing", "echo 'all is well'; exit 0");
        assert_eq!(code, Some(4), "{said}");
        assert!(said.contains("reported no error but wrote no module"), "{said}");
        assert!(said.contains("its output: all is well") && !said.contains("out.spv"), "{said}");
        // What it prints to standard output alone is its message.
        let (code, said) = run("stdout", "echo 'the licence has expired'; exit 1");
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains("the licence has expired"), "{said}");
    }
}

#[test]
fn notes_of_slangc_say_where_a_feature_is_used() {
    if !skipped::has_slangc(test_name!()) {
        return;
    }
    let text = "RWStructuredBuffer<float> o;\nvoid ignore() { IgnoreHit(); }\n\
        [shader(\"compute\")][numthreads(1, 1, 1)] void main() { ignore(); o[0] = 1; }\n";
    let source = Source::from_text("a.slang", text).unwrap();
    let report = source.compile(&CompileOptions::default()).unwrap_err().render();
    assert!(report.contains("a.slang:2:17: see using of 'IgnoreHit'"), "{report}");
}

/// naga's writer of SPIR-V does not know external textures: left to it, it panics.
#[cfg(feature = "wgsl")]
#[test]
fn what_naga_cannot_write_is_told_with_its_line() {
    let text = "@group(0) @binding(0) var<storage, read_write> out: f32;\n\
        @group(0) @binding(1) var video: texture_external;\n\
        @compute @workgroup_size(1) fn main() { out = f32(textureDimensions(video).x); }\n";
    let source = Source::from_text("a.wgsl", text).unwrap();
    let error = source.compile(&CompileOptions::default()).unwrap_err();
    let report = error.render();
    assert_eq!(error.kind(), ErrorKind::InvalidSource, "{report}");
    assert!(
        !report.contains("panicked") && !report.contains(".cargo") && !report.contains("/src/"),
        "{report}"
    );
    assert!(report.contains("a.wgsl:2:") && report.contains("TEXTURE_EXTERNAL"), "{report}");
}
