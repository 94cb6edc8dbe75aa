//! Benchmarks of start-up time: a thousand unit tests of one ray each, the parts that one is made
//! of, and the program from its start to its end.
//!
//! `cargo bench --bench startup` prints a table; `docs/testing.md` has figures. Everything runs on
//! one thread. Each row is the median of several runs, beside the fastest: on a busy machine look
//! at that. Without `--bench` (`cargo test --benches`) every row runs once.

#![allow(clippy::print_stdout, reason = "a table is printed")]

#[path = "growth/glb.rs"]
mod glb;

use std::hint::black_box;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhit::{Hit, Instance, LoadedScene, Module, Pipeline, Program, Ray, Scene, ShaderTest};
use anyhit_cases::case::Case;
use anyhit_engine::module::load;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const TESTS: usize = 1000;

fn main() {
    let full = std::env::args().any(|argument| argument == "--bench");
    let table = Table { full };
    table.heading("a thousand tests");
    a_thousand_tests(&table);
    table.heading("parts of a test");
    parts(&table);
    table.heading("the program");
    program(&table);
    table.heading("a large scene");
    million(&table);
}

/// Measures rows and prints them.
struct Table {
    full: bool,
}

impl Table {
    fn heading(&self, text: &str) {
        println!("\n{text:44} {:>12} {:>12}", "median", "fastest");
    }

    /// A row of `runs` runs.
    fn row<T>(&self, name: &str, runs: usize, mut work: impl FnMut() -> T) {
        let mut once = || {
            let begin = Instant::now();
            black_box(work());
            begin.elapsed()
        };
        let mut times: Vec<Duration> = (0..if self.full { runs } else { 1 }).map(|_| once()).collect();
        times.sort();
        println!("  {name:42} {:>12} {:>12}", shown(times[times.len() / 2]), shown(times[0]));
    }
}

fn shown(time: Duration) -> String {
    match time.as_secs_f64() {
        seconds if seconds >= 1.0 => format!("{seconds:.2} s"),
        seconds if seconds >= 1e-3 => format!("{:.2} ms", seconds * 1e3),
        seconds => format!("{:.1} us", seconds * 1e6),
    }
}

fn path(file: &str) -> String {
    format!("{ROOT}/spirv-fixtures/pass/{file}")
}

fn module() -> Arc<Module> {
    Module::open(path("lss/normal-angle/main.rchit.spv")).expect("a fixture")
}

fn hit() -> Hit {
    Hit::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.25])
        .ray(Ray::new([0.25, 0.0, 4.0], [0.0, 0.0, -1.0]))
}

fn ray() -> Ray {
    Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0])
}

fn sphere_pipeline() -> Pipeline {
    let shader = |file: &str| {
        let module = Module::open(path(&format!("sphere/closest-hit/{file}"))).expect("a fixture");
        Program::of(&module, "main").expect("a supported shader")
    };
    let mut builder = Pipeline::builder();
    builder = builder.hit([shader("main.rchit.spv")]).expect("a hit group");
    builder = builder.miss(shader("main.rmiss.spv")).expect("a miss shader");
    builder.build().expect("a pipeline")
}

/// A thousand tests, as `cargo test` of a user runs them.
fn a_thousand_tests(table: &Table) {
    let test = ShaderTest::new(&module(), "main").expect("a supported shader");
    table.row("one shader", 11, || {
        for _ in 0..TESTS {
            let _ = black_box(test.clone().hit(hit()).run().expect("it runs"));
        }
    });
    table.row("one shader, each opens its module", 5, || {
        for _ in 0..TESTS {
            let test = ShaderTest::new(&module(), "main").expect("a supported shader");
            let _ = black_box(test.hit(hit()).run().expect("it runs"));
        }
    });
    let pipeline = sphere_pipeline();
    table.row("one ray, each makes its scene", 11, || {
        for _ in 0..TESTS {
            let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)]).expect("a scene");
            let _ = black_box(pipeline.trace(&scene, ray()).expect("it runs"));
        }
    });
    table.row("one ray, each makes scene and pipeline", 5, || {
        for _ in 0..TESTS {
            let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)]).expect("a scene");
            let _ = black_box(sphere_pipeline().trace(&scene, ray()).expect("it runs"));
        }
    });
}

fn parts(table: &Table) {
    let bytes = std::fs::read(path("lss/normal-angle/main.rchit.spv")).expect("a fixture");
    let module = module();
    let test = ShaderTest::new(&module, "main").expect("a supported shader").hit(hit());
    let pipeline = sphere_pipeline();
    let scene = || Scene::new([Instance::sphere([0.0; 3], 0.5)]).expect("a scene");
    let made = scene();
    table.row("read the file", 101, || {
        std::fs::read(path("lss/normal-angle/main.rchit.spv")).expect("a fixture")
    });
    table.row("load the module", 101, || load(&bytes).expect("a module"));
    table.row("lower the shader", 101, || Program::of(&module, "main").expect("a supported shader"));
    table.row("run the shader", 101, || test.run().expect("it runs"));
    let beside = test.clone().buffer(3, 0, &vec![0u32; 1 << 18]);
    table.row("run it beside an unused buffer of 1 MiB", 101, || beside.run().expect("it runs"));
    table.row("make a scene", 101, scene);
    table.row("trace a ray", 101, || pipeline.trace(&made, ray()).expect("it runs"));
    let file = format!("{ROOT}/shaders/pass/sphere/closest-hit/scene.toml");
    table.row("check a case, at three widths", 51, || {
        let case = Case::of(file.as_ref()).expect("a scene").remove(0);
        case.check().expect("it holds")
    });
}

/// Measures whole processes; `true` shows the part of the operating system.
fn program(table: &Table) {
    let run = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.current_dir(ROOT).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
        assert!(command.status().expect("a program").success());
    };
    let anyhit = env!("CARGO_BIN_EXE_anyhit");
    let scene = "shaders/pass/sphere/closest-hit/scene.toml";
    let leaves = "shaders/pass/testing/leaves";
    if cfg!(unix) {
        table.row("true", 51, || run("true", &[]));
    }
    table.row("anyhit --version", 51, || run(anyhit, &["--version"]));
    table.row("anyhit test, one case, one ray", 51, || run(anyhit, &["test", leaves, "--filter", "through"]));
    table.row("anyhit trace-one-ray, a sphere", 51, || run(anyhit, &["trace-one-ray", scene]));
    table.row("anyhit trace-one-ray, the demo", 51, || run(anyhit, &["trace-one-ray"]));
}

/// The scene of the example renderer with a model of a million triangles in place of its own: from
/// the text to the first pixel, attributes and tables of all geometries included.
fn million(table: &Table) {
    let side = if table.full { 225 } else { 12 };
    let model = std::env::temp_dir().join(format!("anyhit-million-{}.glb", std::process::id()));
    std::fs::write(&model, terrain(side)).expect("a temporary file");
    let path = format!("{ROOT}/examples/renderer/scene.toml");
    let text = std::fs::read_to_string(&path).expect("the example's scene");
    let text = text
        .replace("launch = [480, 270]", "launch = [1, 1]")
        .replace("pixel = [300, 250]", "pixel = [0, 0]")
        .replace("mesh = \"courtyard\"\n", "mesh = \"terrain\"\n")
        .replace("mesh = \"courtyard\", attribute", "mesh = \"terrain\", attribute")
        .replace("name = \"courtyard\"\n", "name = \"courtyard\"\ninstances = false\n");
    let text = format!("{text}\n[[model]]\nfile = '{}'\nname = \"terrain\"\n", model.display());
    let triangles = TILES * 2 * (side - 1) * (side - 1);
    table.row(&format!("{triangles} triangles, one pixel"), 7, || {
        let scene = LoadedScene::from_text(&path, &text).expect("a scene");
        let frame = scene.launch().expect("it runs");
        assert!(frame.stats.rays > 0);
    });
    std::fs::remove_file(&model).expect("the temporary file");
}

const TILES: usize = 10;

/// A glTF file of tiles of a hilly ground, a mesh each, with normals and texture coordinates.
fn terrain(side: usize) -> Vec<u8> {
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut meshes = Vec::new();
    for tile in 0..TILES {
        let at = |i: usize| i as f32 / (side - 1) as f32;
        let vertices = (0..side * side).map(|i| [tile as f32 + at(i / side), at(i % side)]);
        let height = |x: f32, z: f32| 0.3 * (3.0 * x).sin() * (2.0 * z).cos();
        let positions: Vec<f32> = vertices.clone().flat_map(|[x, z]| [x, height(x, z), z]).collect();
        let normals: Vec<f32> = vertices.clone().flat_map(|_| [0.0, 1.0, 0.0]).collect();
        let coordinates: Vec<f32> = vertices.flatten().collect();
        let squares = (0..side - 1).flat_map(|row| (0..side - 1).map(move |column| row * side + column));
        let corners = squares.flat_map(|i| [i, i + side, i + 1, i + 1, i + side, i + side + 1]);
        let indices: Vec<u32> = corners.map(|i| i as u32).collect();
        let mut add = |content: &[u8], component: u32, kind: &str, count: usize, bounds: String| {
            let view =
                format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#, bytes.len(), content.len());
            views.push(view);
            bytes.extend_from_slice(content);
            accessors.push(format!(
                r#"{{"bufferView":{},"componentType":{component},"count":{count},"type":"{kind}"{bounds}}}"#,
                views.len() - 1
            ));
            accessors.len() - 1
        };
        let bounds = format!(r#","min":[{tile},-0.3,0],"max":[{},0.3,1]"#, tile + 1);
        let float = |values| bytemuck::cast_slice::<f32, u8>(values);
        let position = add(float(&positions), 5126, "VEC3", side * side, bounds);
        let normal = add(float(&normals), 5126, "VEC3", side * side, String::new());
        let coordinate = add(float(&coordinates), 5126, "VEC2", side * side, String::new());
        let index = add(bytemuck::cast_slice(&indices), 5125, "SCALAR", indices.len(), String::new());
        meshes.push(format!(
            r#"{{"name":"tile{tile}","primitives":[{{"attributes":{{"POSITION":{position},"NORMAL":{normal},"TEXCOORD_0":{coordinate}}},"indices":{index}}}]}}"#
        ));
    }
    let nodes: Vec<String> = (0..TILES).map(|mesh| format!(r#"{{"mesh":{mesh}}}"#)).collect();
    let all: Vec<String> = (0..TILES).map(|node| node.to_string()).collect();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{}]}}],"nodes":[{}],"meshes":[{}],"accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#,
        all.join(","),
        nodes.join(","),
        meshes.join(","),
        accessors.join(","),
        views.join(","),
        bytes.len()
    );
    glb::glb(&json, &bytes)
}
