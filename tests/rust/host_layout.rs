//! Structs of the host beside blocks of shaders: what differs is found, where it differs.
//!
//! The compilers judge the layouts that are read from source: rustc those of this file's own
//! structs, and a C++ compiler those of random structs.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhit::{ErrorKind, HostLayout, Module, StructData, host_layout};
use anyhit_base::input::InputLimits;
use anyhit_unit_test::host_struct::source::HostSource;

use crate::support::mutate::Random;
use crate::support::skipped::skipped;

/// By WGSL's rules: `count` at 0, `sun` at 16 (a vec3f is aligned to 16), `tint` at 32, `lights` at
/// 48 with a stride of 32, `scale` at 112.
const SHADER: &str = "
    struct Sun { direction: vec3f, power: f32 }
    struct Light { position: vec3f, kind: u32, power: f32 }
    struct Params { count: u32, sun: Sun, tint: vec4f, lights: array<Light, 2>, scale: f32 }
    struct Cell { at: vec2f, hits: u32 }
    struct Cells { total: u32, cells: array<Cell> }
    @group(0) @binding(0) var<uniform> params: Params;
    @group(0) @binding(1) var<storage, read_write> grid: Cells;
    @compute @workgroup_size(1)
    fn main() {
        grid.total = params.count;
        grid.cells[0].hits = u32(params.sun.power * params.tint.x * params.lights[1].power * params.scale);
    }
";

/// Structs with the bytes of the shader's.
const RUST: &str = "
    #[repr(C)] pub struct Sun { pub direction: [f32; 3], pub power: f32 }
    #[repr(C)] pub struct Light { position: Vec3, kind: Kind, power: f32, _pad: [u8; 12] }
    #[repr(u32)] pub enum Kind { Point = 0, Spot }
    const LIGHTS: usize = 1 << 1;
    #[repr(C)] struct Params {
        count: u32, _pad0: [u32; 3], sun: Sun, tint: [f32; 4], lights: [Light; LIGHTS], scale: f32,
    }
    #[repr(C)] struct Cell { at: [f32; 2], hits: u32, padding: u32 }
    #[repr(C)] struct Cells { total: u32, _pad: u32, cells: [Cell; 0] }
";

const C: &str = r#"
    #pragma once
    #include <glm/glm.hpp>
    #define LIGHTS 2
    #ifdef __cplusplus
    namespace shared { using vec3 = glm::vec3; typedef uint32_t uint;
    #else
    #error not reached
    #endif
    enum class Kind : uint32_t { Point = 0, Spot };
    struct Sun { vec3 direction = {0, 1, 0}; float power{1.0f}; Sun() : power{2}, direction{} {} };
    struct alignas(16) Light { glm::vec3 position; Kind kind; float power; };
    template <class T> struct Unused { T value; };
    class Params {
    public:
        static constexpr int N = LIGHTS * 2 - 2;
        uint count; alignas(16) Sun sun; /* at 16 */
        float tint[4];
        Light lights[N];
        float scale;
        float power() const { return sun.power; }
        Params& operator=(const Params&) = default;
    };
    typedef struct Cell { float at[2]; unsigned hits, padding; } Cell;
    struct Cells { uint total, pad; Cell cells[]; };
    }
"#;

fn file(name: &str, text: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("host-layout");
    std::fs::create_dir_all(&folder).expect("a writable folder");
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a writable file");
    path
}

fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the command starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// Runs `inspect --layout` for a struct; exit code and both streams.
fn against(shader: &str, name: &str, host: &Path, more: &[&str]) -> (Option<i32>, String, String) {
    let mut arguments = vec!["inspect", shader, "--layout"];
    if !name.is_empty() {
        arguments.push(name);
    }
    arguments.extend(["--against", host.to_str().expect("UTF-8")]);
    arguments.extend(more);
    run(&arguments)
}

fn shader(name: &str) -> String {
    file(name, SHADER).to_str().expect("UTF-8").to_owned()
}

#[test]
fn equal_structs_are_equal() {
    let shader = shader("equal.wgsl");
    for (name, text) in [("equal.rs", RUST), ("equal.h", C)] {
        let host = file(name, text);
        for (name, bytes) in [("Params", 116), ("Sun", 16), ("Light", 20)] {
            let (code, out, err) = against(&shader, name, &host, &[]);
            assert_eq!((code, err.as_str()), (Some(0), ""), "{name}");
            assert!(out.contains(&format!("have the same layout: {bytes} bytes")), "{out}");
        }
        let (code, out, err) = against(&shader, "Cells", &host, &[]);
        assert_eq!((code, err.as_str()), (Some(0), ""));
        assert!(out.contains("8 bytes, and 16 for each element of the last array"), "{out}");
        // Without a name all that both declare.
        let (code, out, err) = against(&shader, "", &host, &[]);
        assert_eq!((code, err.as_str()), (Some(0), ""));
        assert_eq!(out.lines().count(), 5, "{out}");
    }
}

/// What is changed in a host's text, and what the error then says.
#[test]
fn the_first_difference_is_named() {
    let shader = shader("first.wgsl");
    let cases: &[(&str, &str, &str, &str, &str)] = &[
        // Without padding `sun` begins at 4.
        (
            "rs",
            "_pad0: [u32; 3],",
            "",
            "Params",
            "`sun.direction` begins at byte 16 in the shader, at byte 4 in",
        ),
        (
            "h",
            "alignas(16) Sun",
            "Sun",
            "Params",
            "`sun.direction` begins at byte 16 in the shader, at byte 4 in",
        ),
        // Members of one type in another order.
        (
            "rs",
            "pub direction: [f32; 3], pub power: f32",
            "pub power: f32, pub direction: [f32; 3]",
            "Sun",
            "`direction` begins at byte 0 in the shader, at byte 4 in",
        ),
        // An element of 20 bytes, where the shader's are 32 apart.
        ("rs", ", _pad: [u8; 12]", "", "Light", "elements of `Light` are 32 bytes apart in the shader"),
        (
            "rs",
            ", _pad: [u8; 12]",
            "",
            "Params",
            "`lights[1].position` begins at byte 80 in the shader, at byte 68 in",
        ),
        (
            "rs",
            "LIGHTS: usize = 1 << 1",
            "LIGHTS: usize = 1",
            "Params",
            "`scale` begins at byte 112 in the shader, at byte 80 in",
        ),
        ("h", "LIGHTS 2", "LIGHTS 3", "Params", "`scale` begins at byte 112 in the shader, at byte 176 in"),
        // Another kind of number.
        ("rs", "tint: [f32; 4]", "tint: [u32; 4]", "Params", "`tint` has a float of 32 bits in the shader"),
        (
            "h",
            "float tint[4]",
            "glm::dvec2 tint",
            "Params",
            "`tint` has a float of 32 bits in the shader (vec4), `tint` has a float of 64 bits",
        ),
        ("h", "Kind : uint32_t", "Kind : uint8_t", "Light", "`kind` has an integer of 32 bits in the shader"),
        // Members that only one side has.
        ("rs", "pub power: f32 }", "}", "Sun", "the shader has `float power` at byte 12, past the end of"),
        (
            "rs",
            "pub power: f32 }",
            "pub power: f32, pub size: f32 }",
            "Sun",
            "has `size` (f32) at byte 16, after the shader's last member",
        ),
        ("rs", "scale: f32", "_pad: f32", "Params", "the shader has `float scale` at byte 112, where"),
        (
            "rs",
            "[f32; 2], hits",
            "[f32; 3], hits",
            "Cell",
            "`at` is `vec2` (8 bytes) in the shader and `[f32; 3]` (12 bytes)",
        ),
        (
            "h",
            "unsigned hits, padding",
            "unsigned hits",
            "Cells",
            "the elements of the last array are 16 bytes apart in the shader, 12 in the host",
        ),
    ];
    for (index, (language, from, to, name, expected)) in cases.iter().enumerate() {
        let text = if *language == "rs" { RUST } else { C };
        assert!(text.contains(from), "{from}");
        let host = file(&format!("first-{index}.{language}"), &text.replacen(from, to, 1));
        let (code, out, err) = against(&shader, name, &host, &[]);
        assert_eq!((code, out.as_str()), (Some(1), ""), "{from}: {err}");
        assert!(err.starts_with("error: `"), "{err}");
        assert!(err.contains(expected), "{expected}\n{err}");
        assert!(err.contains("help: ") && err.contains(">"), "{err}");
        let (code, out, _) = against(&shader, name, &host, &["--json"]);
        let json: serde_json::Value = serde_json::from_str(&out).expect("JSON");
        assert_eq!(code, Some(1));
        assert!(json[0]["difference"]["message"].as_str().expect("a text").contains(expected), "{json}");
    }
}

#[test]
fn renamed_members_are_a_note() {
    let shader = shader("renamed.wgsl");
    let host =
        file("renamed.rs", &RUST.replace("tint: [f32", "m_colour: [f32").replace("count: u32", "Count: u32"));
    let (code, out, err) = against(&shader, "Params", &host, &[]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    assert!(out.ends_with("note: `tint` of the shader is `m_colour` in the host\n"), "{out}");
    assert_eq!(out.lines().count(), 2, "{out}");
}

/// What has no layout is an error with its place, and only where a struct is asked for that has it.
#[test]
fn what_has_no_layout_is_an_error() {
    let shader = shader("unknown.wgsl");
    let cases: &[(&str, &str, &str)] = &[
        ("rs", "struct Sun { direction: [f32; 3], power: f32 }", "`Sun` has no `#[repr(C)]`"),
        ("rs", "#[repr(C)] struct Sun { direction: Vector, power: f32 }", "the type `Vector` is not known"),
        (
            "rs",
            "#[repr(C)] struct Sun<T> { direction: T, power: f32 }",
            "the generic type `Sun` is not known",
        ),
        ("rs", "#[repr(C)] struct Sun { direction: [f32; N] }", "the value of this length is not known"),
        ("rs", "#[repr(C)] struct Sun { next: Sun }", "contain themselves"),
        ("rs", "struct Sun {", "invalid Rust"),
        ("rs", "fn main() {}", "declares no struct"),
        ("h", "struct Sun { float3 direction; float power; };", "the type `float3` is not known"),
        ("h", "struct Sun { virtual void run(); float power; };", "virtual functions"),
        ("h", "struct Sun { unsigned a : 24, b : 8; };", "bit-field `a`"),
        ("h", "struct Sun { long power; };", "the size of `long` differs between Windows"),
        ("h", "struct Sun { float direction[N]; };", "the value of this length is not known"),
        ("h", "struct Sun { struct Other other; };", "`Other` is declared without its members"),
        ("h", "struct Base { double a; char b; }; struct Sun : Base { char c; };", "ends in padding"),
        ("h", "#if 1 +\n#endif", "this condition cannot be evaluated"),
        ("h", "int main();", "declares no struct"),
    ];
    for (index, (language, text, expected)) in cases.iter().enumerate() {
        let host = file(&format!("unknown-{index}.{language}"), text);
        let (code, out, err) = against(&shader, "Sun", &host, &[]);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{text}\n{err}");
        assert!(err.contains(expected), "{text}\n{err}");
    }
    let host = file("unknown.rs", RUST);
    let (code, _, err) = against(&shader, "Sun", &host, &["--host-struct", "Snu"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("declares no struct `Snu`") && err.contains("did you mean `Sun`?"), "{err}");
    let (code, _, err) = against(&shader, "Sun", &host, &["--host-struct", "Cell"]);
    assert_eq!(code, Some(1), "{err}");
    let (code, _, err) = run(&["inspect", &shader, "--against", "x.rs"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("--layout"), "{err}");
}

#[repr(C)]
struct Sun {
    direction: [f32; 3],
    power: f32,
}
host_layout!(Sun { direction, power });

#[repr(C, align(16))]
struct Aligned {
    flag: bool,
    at: glam::Vec3A,
    turn: glam::Mat3,
    wide: f64,
    small: [u16; 3],
    address: u64,
}
host_layout!(Aligned { flag, at, turn, wide, small, address });

#[repr(C, packed(2))]
struct Packed {
    byte: u8,
    word: u32,
    wide: f64,
}
host_layout!(Packed { byte, word, wide });

/// A vector of a library that does not know the trait.
#[repr(C)]
#[derive(Clone, Copy)]
struct Foreign {
    x: f32,
    y: f32,
    z: f32,
}

#[repr(C)]
struct Nested {
    first: [Sun; 2],
    foreign: Foreign,
    last: Packed,
}
host_layout!(Nested { first, foreign: [f32; 3], last });

/// rustc's offsets are those that are read from the text of this file.
#[test]
fn source_and_compiler_agree_on_rust_structs() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rust/host_layout.rs");
    let source = HostSource::read(&path, &InputLimits::default()).expect("this file");
    fn fields<T: HostLayout>(source: &HostSource, name: &str) {
        let (read, compiled) = (source.layout(name).expect("a layout"), T::host_type());
        assert!(!read.scalars().is_empty());
        assert_eq!(read.scalars(), compiled.scalars(), "{name}");
        assert_eq!((read.size(), read.align()), (size_of::<T>(), align_of::<T>()), "{name}");
    }
    fields::<Sun>(&source, "Sun");
    fields::<Aligned>(&source, "Aligned");
    fields::<Packed>(&source, "Packed");
    fields::<Nested>(&source, "Nested");
}

/// In Rust the structs themselves are compared.
#[test]
fn a_test_compares_its_own_structs() {
    let module = Module::from_source("a.wgsl", SHADER).expect("a module");
    let sun = StructData::of(&module, "Sun").expect("a struct");
    sun.check_host_layout::<Sun>().expect("the same layout");
    let error = sun.check_host_layout::<Packed>().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Expectation);
    assert!(error.render().contains("> "), "{error:?}");
    let other = StructData::of(&module, "Light").expect("a struct").check_host_layout::<Sun>();
    assert!(
        other
            .unwrap_err()
            .message()
            .contains("`kind` has an integer of 32 bits in the shader (uint), `power` has a float")
    );
}

/// Random structs, as a C++ compiler lays them out.
#[test]
fn source_and_compiler_agree_on_c_structs() {
    const STRUCTS: usize = 200;
    let compilers = ["c++", "g++", "clang++"];
    let runs = |name: &&&str| {
        Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success())
    };
    let Some(compiler) = compilers.iter().find(runs) else {
        return skipped("host_struct::source_and_compiler_agree_on_c_structs", "there is no C++ compiler");
    };
    let (mut text, mut prints) = (
        "#include <array>\n#include <cstddef>\n#include <cstdint>\nusing std::size_t;\n".to_owned(),
        String::new(),
    );
    let mut random = Random(7);
    let mut members: Vec<Vec<String>> = Vec::new();
    for index in 0..STRUCTS {
        let packs = random.below(8) == 0;
        if packs {
            let _ = writeln!(text, "#pragma pack(push, {})", 1 << random.below(4));
        }
        let align =
            if random.below(6) == 0 { format!("alignas({}) ", 4 << random.below(4)) } else { String::new() };
        let keyword = if random.below(10) == 0 { "union" } else { "struct" };
        let _ = writeln!(text, "{keyword} {align}S{index} {{");
        let count = 1 + random.below(6);
        for member in 0..count {
            let scalars = [
                "float",
                "double",
                "int",
                "unsigned char",
                "uint16_t",
                "int64_t",
                "bool",
                "unsigned long long",
                "void*",
                "short",
                "size_t",
                "std::array<float, 3>",
            ];
            let of = match index {
                0 => None,
                _ if random.below(4) == 0 => Some(format!("S{}", random.below(index))),
                _ => None,
            };
            let ty = of.unwrap_or_else(|| scalars[random.below(scalars.len())].to_owned());
            let align = if random.below(8) == 0 && !packs { "alignas(16) " } else { "" };
            let lengths = ["", "", "", "[3]", "[2][2]", "[1 + 2 * 2]"][random.below(6)];
            let _ = writeln!(text, "    {align}{ty} m{member}{lengths};");
            let _ = writeln!(
                prints,
                "    printf(\"%zu %zu\\n\", offsetof(S{index}, m{member}), sizeof(((S{index}*)0)->m{member}));"
            );
        }
        let _ = writeln!(text, "}};");
        if packs {
            text += "#pragma pack(pop)\n";
        }
        let _ = writeln!(prints, "    printf(\"%zu %zu\\n\", sizeof(S{index}), alignof(S{index}));");
        members.push((0..count).map(|member| format!("m{member}")).collect());
    }
    let header = file("random.h", &text);
    let main =
        format!("#include \"random.h\"\n#include <cstddef>\n#include <cstdio>\nint main() {{\n{prints}}}\n");
    let main = file("random.cpp", &main);
    let program = main.with_extension("out");
    let status = Command::new(compiler).args(["-std=c++17", "-w", "-o"]).args([&program, &main]).status();
    assert!(status.expect("a compiler").success());
    let output = Command::new(&program).output().expect("a program").stdout;
    let printed = String::from_utf8(output).expect("UTF-8");
    let mut expected = printed.lines();
    let source = HostSource::read(&header, &InputLimits::default()).expect("a header");
    for (index, names) in members.iter().enumerate() {
        let ty = source.layout(&format!("S{index}")).expect("a layout");
        for name in names {
            let (offset, size) = ty.field(name).expect("a field");
            assert_eq!(Some(format!("{offset} {size}").as_str()), expected.next(), "S{index}.{name}");
        }
        assert_eq!(Some(format!("{} {}", ty.size(), ty.align()).as_str()), expected.next(), "S{index}");
    }
    assert_eq!(expected.next(), None);
}

/// Any text is read or is an error.
#[test]
fn damaged_sources_end() {
    let mut random = Random(11);
    for turn in 0..400 {
        for (extension, text) in [("rs", RUST), ("h", C)] {
            let mut words: Vec<&str> = text.split_inclusive([' ', '\n', '(', ')', '{', '}', ';']).collect();
            for _ in 0..1 + random.below(4) {
                let at = random.below(words.len());
                match random.below(3) {
                    0 => drop(words.remove(at)),
                    1 => words.insert(at, words[random.below(words.len())]),
                    _ => {
                        words[at] = ["{", "}", "(", "[", "<", "sizeof", "alignas(", "#if ", "1 << 70", "::"]
                            [random.below(10)]
                    }
                }
            }
            let path = file(&format!("damaged.{extension}"), &words.concat());
            let Ok(source) = HostSource::read(&path, &InputLimits::default()) else { continue };
            for name in source.structs().to_vec() {
                let _ = source.layout(&name).map(|ty| (ty.size(), turn));
            }
        }
    }
}
