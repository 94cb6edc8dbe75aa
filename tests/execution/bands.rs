//! Launches whose image is handed out in bands of rows: the same bits, traps and counts as of the
//! whole image at once, in memory that the image's size does not change.

use std::process::{Command, Stdio};

use anyhit::{Error, ErrorKind, Module, Pipeline, Program, Scene};
use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::pipeline::{Band, BatchWidth, Launch, NotStreamed, RunOptions, Stats, StreamedImage};
use anyhit_scene::{DiskFiles, LoadOptions};
use pretty_assertions::assert_eq;

use crate::support::skipped::{skipped, test_name};

const COUNTS: Format = Format::new(Component::Uint32, 1);

/// A pipeline of one ray generation shader whose picture, of some texels, stands at binding 0; the
/// body finds `id` and `size`.
fn pipeline(texels: &str, body: &str) -> Pipeline {
    let source = format!(
        "enable wgpu_ray_tracing_pipeline;
         @group(0) @binding(0) var picture: texture_storage_2d<{texels}>;
         @group(0) @binding(1) var<storage, read_write> cells: array<atomic<u32>, 4>;
         @ray_generation
         fn main(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {{ {body} }}"
    );
    let module = Module::from_source("bands.wgsl", &source).expect("valid WGSL");
    Pipeline::builder()
        .ray_generation(Program::of(&module, "main").expect("a supported shader"))
        .expect("ray generation")
        .build()
        .expect("a pipeline")
}

fn scene() -> Scene {
    Scene::new([]).expect("a scene").buffer(0, 1, &[0u32; 4])
}

/// The smallest bands that there are.
fn small(format: Format) -> StreamedImage {
    StreamedImage { band_bytes: 1, ..StreamedImage::new(0, 0, format) }
}

/// The bytes of all bands, and what was counted, at a width of batches.
fn in_bands(
    pipeline: &Pipeline,
    size: [u32; 2],
    image: &StreamedImage,
    width: BatchWidth,
) -> (Vec<u8>, Stats) {
    let scene = scene();
    let launch = Launch { pipeline, resources: scene.resources() };
    let bands = launch.bands([size[0], size[1], 1], image).expect("it can be run in bands");
    let (mut bytes, mut next) = (Vec::new(), 0);
    let stats = bands.run(RunOptions::of(width), &mut |band: Band<'_>| {
        assert_eq!((band.rows().start, band.size(), band.format()), (next, size, image.format));
        assert!(!band.rows().is_empty() && band.rows().len() <= bands.max_band_rows() as usize);
        next = band.rows().end;
        for row in band.rows() {
            bytes.extend(band.row_bytes(row)?);
        }
        Ok(())
    });
    assert_eq!(next, size[1], "every row came once");
    (bytes, stats.expect("no trap"))
}

fn whole(pipeline: &Pipeline, [width, height]: [u32; 2], image: &StreamedImage) -> (Vec<u8>, Stats) {
    let image =
        Image::filled(image.format, ImageShape::plane(width, height), &image.texel).expect("an image");
    let launched = pipeline.launch(&scene().image(0, 0, image), [width, height, 1]).expect("no trap");
    (launched.image(0, 0).expect("an image").image().bytes(), launched.stats)
}

#[test]
fn bands_have_the_bits_and_counts_of_the_whole() {
    let formats = [
        ("rgba32float, write", Format::RGBA32F),
        ("rgba8unorm, write", Format::new(Component::Unorm8, 4)),
        ("rgba16float, write", Format::new(Component::Float16, 4)),
    ];
    // Rows of one texel and of one batch; heights that bands divide and that they do not; one row.
    let sizes = [[1, 1], [7, 1], [1, 300], [33, 300], [16, 20], [64, 16], [200, 131], [128, 9]];
    for (texels, format) in formats {
        let body = "let at = vec2f(id.xy) + 0.25;
            textureStore(picture, id.xy, vec4f(sin(at.x * 12.9 + at.y * 78.2), at.x / at.y, fract(at.y * at.x), 1.0));";
        let pipeline = pipeline(texels, body);
        for size in sizes {
            let image = small(format);
            let (wanted, stats) = whole(&pipeline, size, &image);
            assert_eq!(wanted.len() as u32, size[0] * size[1] * format.texel_size());
            assert_eq!(
                in_bands(&pipeline, size, &image, BatchWidth::Of64),
                (wanted.clone(), stats),
                "{texels} {size:?}"
            );
            assert_eq!(in_bands(&pipeline, size, &image, BatchWidth::Of128).0, wanted, "{texels} {size:?}");
            assert_eq!(in_bands(&pipeline, size, &image, BatchWidth::One).0, wanted, "{texels} {size:?}");
        }
    }
}

#[test]
fn bands_begin_where_batches_do() {
    let pipeline = pipeline("r32uint, write", "textureStore(picture, id.xy, vec4u(1u));");
    let scene = scene();
    let launch = Launch { pipeline: &pipeline, resources: scene.resources() };
    let rows = |width, height, band_bytes| {
        let image = StreamedImage { band_bytes, ..StreamedImage::new(0, 0, COUNTS) };
        let bands = launch.bands([width, height, 1], &image).expect("it can be run in bands");
        (bands.max_band_rows(), bands.count())
    };
    // 128 invocations are a whole number of batches and subgroups, and 8 rows are one of tiles.
    assert_eq!(rows(16, 100, 1), (8, 13));
    assert_eq!(rows(8, 100, 1), (16, 7));
    assert_eq!(rows(24, 100, 1), (16, 7));
    assert_eq!(rows(1, 300, 1), (128, 3));
    assert_eq!(rows(33, 300, 1), (128, 3));
    // 17 rows of 64 bytes; of those 16.
    assert_eq!(rows(16, 100, 17 * 64), (16, 7));
    assert_eq!(rows(16, 100, u64::MAX), (100, 1));
    assert_eq!(rows(16, 1, 1), (1, 1));
}

/// The numbers of a picture of `r32uint` in bands.
fn numbers(texels: &str, body: &str, size: [u32; 2], texel: u32) -> Vec<u32> {
    let image = StreamedImage { texel: texel.to_le_bytes().to_vec(), ..small(COUNTS) };
    let pipeline = pipeline(texels, body);
    let (bytes, stats) = in_bands(&pipeline, size, &image, BatchWidth::Of64);
    assert_eq!((bytes.clone(), stats), whole(&pipeline, size, &image), "{body}");
    bytemuck::cast_slice(&bytes).to_vec()
}

#[test]
fn whatever_keeps_to_its_row_can_be_streamed() {
    let size @ [width, height] = [33, 300];
    let all = |number: &dyn Fn(u32, u32) -> u32| -> Vec<u32> {
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| number(x, y)).collect()
    };
    let numbers = |texels: &str, body: &str| numbers(texels, body, size, 41);
    // Upside down: row height - 1 - y shows y.
    let mirrored = "textureStore(picture, vec2u(id.x, size.y - 1u - id.y), vec4u(id.y * 100u + id.x));";
    assert_eq!(numbers("r32uint, write", mirrored), all(&|x, y| (height - 1 - y) * 100 + x));
    let signed = "let last = vec2i(size.xy) - 1; textureStore(picture, vec2i(i32(id.x), last.y - i32(id.y)), vec4u(id.y));";
    assert_eq!(numbers("r32uint, write", signed), all(&|_, y| height - 1 - y));
    // The texel that everyone begins with, read back.
    let twice =
        "let before = textureLoad(picture, id.xy).x; textureStore(picture, id.xy, vec4u(before + id.x));";
    assert_eq!(numbers("r32uint, read_write", twice), all(&|x, _| 41 + x));
    // What nobody stores to stays.
    let some = "if id.x % 2u == 0u { textureStore(picture, id.xy, vec4u(7u)); }";
    assert_eq!(numbers("r32uint, write", some), all(&|x, _| if x % 2 == 0 { 7 } else { 41 }));
    // All of a row in one texel: the last one in launch order stays.
    let first = "textureStore(picture, vec2u(0u, id.y), vec4u(id.x));";
    assert_eq!(numbers("r32uint, write", first), all(&|x, _| if x == 0 { width - 1 } else { 41 }));
    // Atomic instructions: a row's invocations counted in its second texel.
    let counted = "textureAtomicAdd(picture, vec2u(1u, id.y), 1u);";
    assert_eq!(numbers("r32uint, atomic", counted), all(&|x, _| if x == 1 { 41 + width } else { 41 }));
    // The image's size is that of the whole.
    let asked =
        "let all = textureDimensions(picture); textureStore(picture, id.xy, vec4u(all.x * 1000u + all.y));";
    assert_eq!(numbers("r32uint, write", asked), all(&|_, _| width * 1000 + height));
}

/// The picture of a launch is that of one thread, in bands and as a whole.
#[test]
fn a_pixel_that_follows_floats_can_be_streamed() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for place in [
        "vec2i(vec2f(id.xy))",
        "vec2u(vec2f(id.xy) + 0.5)",
        "vec2i(floor(vec2f(id.xy) + vec2f(0.5)))",
        "vec2i(vec2f(f32(id.x), f32(size.y - 1u - id.y)))",
    ] {
        let body = format!("textureStore(picture, {place}, vec4u(id.y * 1000u + id.x + 1u));");
        let streamed = numbers("r32uint, write", &body, [33, 300], 0);
        let mirrored = place.contains("size");
        let row = |y: u32| if mirrored { 299 - y } else { y };
        let wanted: Vec<u32> = (0..300).flat_map(|y| (0..33).map(move |x| row(y) * 1000 + x + 1)).collect();
        assert_eq!(streamed, wanted, "{place}");
        let pipeline = pipeline("r32uint, write", &body);
        let alone = one.install(|| whole(&pipeline, [33, 300], &small(COUNTS)));
        assert_eq!(bytemuck::cast_slice::<u8, u32>(&alone.0), wanted, "{place}");
    }
    // The limits: an f32 holds integers up to 2^24, and 0.5 more than one up to 2^23.
    const LIMIT: u32 = 1 << 24;
    let scene = scene();
    for (place, limit) in [("vec2i(vec2f(id.xy))", LIMIT), ("vec2i(vec2f(id.xy) + 0.5)", LIMIT / 2)] {
        let body = format!("textureStore(picture, {place}, vec4u(1u));");
        let pipeline = pipeline("r32uint, write", &body);
        let launch = Launch { pipeline: &pipeline, resources: scene.resources() };
        assert!(launch.bands([1, limit, 1], &small(COUNTS)).is_ok(), "{place}");
        let why = launch.bands([1, limit + 1, 1], &small(COUNTS)).expect_err("beyond the limit");
        assert!(matches!(why, NotStreamed::CrossesRows { .. }), "{why}");
        assert_eq!(pipeline.shared_memory([1, limit, 1], scene.resources()), None, "{place}");
        assert!(pipeline.shared_memory([1, limit + 1, 1], scene.resources()).is_some(), "{place}");
    }
}

#[test]
fn buffers_are_those_of_one_launch() {
    let body = "textureStore(picture, id.xy, vec4u(atomicAdd(&cells[0], 1u))); atomicMax(&cells[1], id.y * size.x + id.x);";
    let (pipeline, scene, size) = (pipeline("r32uint, write", body), scene(), [24, 40]);
    let (mut rows, mut bands) = (Vec::new(), 0);
    let launched = pipeline.launch_bands(&scene, size, &small(COUNTS), |band| {
        for y in band.rows() {
            for x in 0..24 {
                rows.push(band.at(x, y)?[0] as u32);
            }
        }
        let outside = band.rows().end;
        for error in [band.at(24, 0).err(), band.at(0, outside).err(), band.row_bytes(outside).err()] {
            assert_eq!(error.map(|error| error.kind()), Some(ErrorKind::InvalidArgument));
        }
        bands += 1;
        Ok(())
    });
    // What the atomic instruction returns is used: one invocation after the other.
    assert_eq!((rows, bands), ((0..24 * 40).collect::<Vec<u32>>(), 3));
    let cells: Vec<u32> = launched.expect("no trap").read_buffer(0, 1).expect("a buffer");
    assert_eq!(cells, [24 * 40, 24 * 40 - 1, 0, 0]);
}

/// Why a launch cannot be run in bands.
fn refused(texels: &str, body: &str, size: [u32; 3]) -> NotStreamed {
    let (pipeline, scene) = (pipeline(texels, body), scene());
    let launch = Launch { pipeline: &pipeline, resources: scene.resources() };
    launch.bands(size, &small(COUNTS)).expect_err(body)
}

#[test]
fn what_reaches_other_rows_needs_the_whole() {
    let size = [16, 20, 1];
    for body in [
        "textureStore(picture, id.xy + vec2u(0u, 1u), vec4u(1u));",
        "textureStore(picture, id.yx, vec4u(1u));",
        "textureStore(picture, vec2u(id.x, id.y / 2u), vec4u(1u));",
        "textureStore(picture, vec2u(id.x, atomicLoad(&cells[0])), vec4u(1u));",
        "textureStore(picture, vec2u(id.x, size.x - 1u - id.y), vec4u(1u));",
        "textureStore(picture, vec2u(id.x, size.y - id.y), vec4u(1u));",
        "for (var y = 0u; y < size.y; y++) { textureStore(picture, vec2u(id.x, y), vec4u(y)); }",
        // Each by itself would do.
        "textureStore(picture, id.xy, vec4u(1u)); textureStore(picture, vec2u(id.x, size.y - 1u - id.y), vec4u(2u));",
    ] {
        let why = refused("r32uint, write", body, size);
        assert!(matches!(&why, NotStreamed::CrossesRows { name, .. } if name == "main"), "{body}: {why}");
    }
    let blurred =
        "let below = textureLoad(picture, id.xy + vec2u(0u, 1u)); textureStore(picture, id.xy, below);";
    let why = refused("r32uint, read_write", blurred, size);
    assert!(why.to_string().starts_with("RayGenerationKHR `main` may access"), "{why}");
    let own = "textureStore(picture, id.xy, vec4u(1u));";
    assert_eq!(refused("r32uint, write", own, [16, 20, 3]), NotStreamed::Depth(3));
    // Upside down bands run from the last row up, and here that would show.
    let ordered = "textureStore(picture, vec2u(id.x, size.y - 1u - id.y), vec4u(atomicAdd(&cells[0], 1u)));";
    assert_eq!(refused("r32uint, write", ordered, size), NotStreamed::Order);
    // All rows are one row.
    let one = pipeline("r32uint, write", "textureStore(picture, id.xx * vec2u(1u, 0u), vec4u(id.x));");
    assert_eq!(in_bands(&one, [1, 1], &small(COUNTS), BatchWidth::Of64).0, [0; 4]);

    let error = pipeline("r32uint, write", "textureStore(picture, id.yx, vec4u(1u));").launch_bands(
        &scene(),
        [16, 20],
        &small(COUNTS),
        |_| Ok(()),
    );
    let error = error.expect_err("a transposed picture");
    assert_eq!(error.kind(), ErrorKind::InvalidArgument);
    assert!(error.message().contains("set 0, binding 0 cannot be processed in bands: RayGen"), "{error}");
}

#[test]
fn traps_are_those_of_the_whole() {
    let size = [16, 40];
    for row in ["id.y", "size.y - 1u - id.y"] {
        // From row 13 on every third invocation adds to what is no cell.
        let body = format!(
            "textureStore(picture, vec2u(id.x, {row}), vec4u(1u));
             if id.y > 12u && id.x % 3u == 2u {{ atomicAdd(&cells[id.x + 99u], 1u); }}"
        );
        let pipeline = pipeline("r32uint, write", &body);
        let image = Image::plane(COUNTS, size[0], size[1]).expect("an image");
        let whole = pipeline.launch(&scene().image(0, 0, image), [size[0], size[1], 1]).expect_err("a trap");
        let mut rows = 0;
        let bands = pipeline.launch_bands(&scene(), size, &small(COUNTS), |band| {
            rows += band.rows().len();
            Ok(())
        });
        let bands: Error = bands.expect_err("a trap");
        assert_eq!(bands.render(), whole.render());
        assert!(bands.render().contains("launch id (2, 13, 0)"), "{}", bands.render());
        // The band from row 8 on has the trap; of the mirrored ones the first handed out, rows 0 to
        // 8, has one.
        assert_eq!(rows, if row == "id.y" { 8 } else { 0 });
    }
}

#[test]
fn whoever_takes_bands_may_end_it() {
    let pipeline = pipeline("r32uint, write", "textureStore(picture, id.xy, vec4u(1u));");
    let mut taken = Vec::new();
    let ended = pipeline.launch_bands(&scene(), [16, 80], &small(COUNTS), |band| {
        taken.push(band.rows());
        match taken.len() {
            2 => Err(Error::new(ErrorKind::Io, "the disk is full")),
            _ => Ok(()),
        }
    });
    assert_eq!(ended.expect_err("an error").message(), "the disk is full");
    assert_eq!(taken, [0..8, 8..16]);
}

#[test]
fn both_demo_scenes_can_be_streamed() {
    for file in ["scenes/swept-spheres.toml", "scenes/swept-spheres-slang.toml"] {
        let options = LoadOptions { size: Some([32_768, 32_768]), streams: true, ..LoadOptions::default() };
        let resolved = anyhit_scene::load(file.as_ref(), &DiskFiles, &options).expect("a scene");
        let output = resolved.output().expect("an output");
        let assembled = anyhit_scene::assemble_without(&resolved, output).expect("shaders");
        let image = StreamedImage::new(output.set, output.binding, Format::RGBA32F);
        let launch = assembled.launch();
        let bands = launch.bands(assembled.size, &image).expect("it can be run in bands");
        // 32 MiB in rows of 16 * 32768 bytes.
        assert_eq!((bands.max_band_rows(), bands.count()), (64, 512), "{file}");
    }
}

/// A scene file with a shader that fills a picture of `rgba32f`, in a folder of its own.
struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new(launch: [u32; 2], place: &str) -> Self {
        Self::with_alpha(launch, place, "1.0")
    }

    /// `alpha` finds `cells`, an array of one element.
    fn with_alpha(launch: [u32; 2], place: &str, alpha: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let shader = format!(
            "enable wgpu_ray_tracing_pipeline;
             @group(0) @binding(0) var picture: texture_storage_2d<rgba32float, write>;
             @group(0) @binding(1) var<storage, read> cells: array<f32>;
             @ray_generation
             fn main(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {{
                 textureStore(picture, {place}, vec4f(vec3f(id) / vec3f(size), {alpha}));
             }}"
        );
        let scene = format!(
            "version = 1\nlaunch = {launch:?}\n[shaders]\nmain = 'main.wgsl'\n[pipeline]\nraygen = 'main'\n\
             [resources.picture]\ntype = 'storage_image'\nbinding = 0\nformat = 'rgba32f'\noutput = true\n\
             [resources.cells]\ntype = 'storage_buffer'\nbinding = 1\ndata = {{ f32 = [1] }}\n"
        );
        for (name, text) in [("main.wgsl", shader), ("scene.toml", scene)] {
            std::fs::write(folder.path().join(name), text).expect("a writable folder");
        }
        Self { folder }
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).expect("a folder");
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Exit code, standard output, standard error, and where `/proc` tells it the most memory in
    /// KiB.
    fn anyhit(&self, arguments: &[&str]) -> (Option<i32>, String, String, Option<u64>) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
        // Two threads on every machine: each has stacks and batches of its own.
        command.args(arguments).current_dir(self.folder.path()).env("RAYON_NUM_THREADS", "2");
        let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let mut child = child.expect("the command starts");
        let status = format!("/proc/{}/status", child.id());
        let mut most = None;
        while child.try_wait().expect("a child").is_none() {
            let text = std::fs::read_to_string(&status).unwrap_or_default();
            let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            most = peak.and_then(|peak| peak.trim().trim_end_matches(" kB").parse().ok()).or(most);
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        let output = child.wait_with_output().expect("its output");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        (output.status.code(), text(output.stdout), text(output.stderr), most)
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.folder.path().join(name)).expect("a file")
    }
}

#[test]
fn the_command_streams_what_it_renders() {
    // 2048 * 4200 * 16 bytes are 131 MiB; bands of 32 MiB have 1024 rows.
    let files = Files::new([2048, 4200], "id.xy");
    let (code, out, err, streamed) = files.anyhit(&["render", "scene.toml", "-o", "bands.png", "--stats"]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    let line =
        "streamed                  5 bands of 1024 rows, 32.0 MiB each instead of 131.2 MiB for the image\n";
    assert!(out.contains(line), "{out}");
    // `run` holds its images.
    let (code, out, err, whole) = files.anyhit(&["run", "scene.toml", "--save", "picture=whole.png"]);
    assert_eq!((code, out.as_str(), err.as_str()), (Some(0), "", ""));
    assert!(files.bytes("bands.png") == files.bytes("whole.png"), "the pictures differ");
    assert_eq!(files.names(), ["bands.png", "main.wgsl", "scene.toml", "whole.png"]);
    match (streamed, whole) {
        // Two bands are 64 MiB; what else there is, the program included, has less than 64.
        (Some(streamed), Some(whole)) => {
            assert!(streamed < 128 << 10 && whole > 131 << 10, "{streamed} KiB, {whole} KiB");
        }
        _ => skipped(test_name!(), "the part about memory: /proc tells none here"),
    }
    // Images that take no more than two bands are held.
    let (code, out, ..) =
        files.anyhit(&["render", "scene.toml", "--size", "32x16", "-o", "small.png", "--stats"]);
    assert_eq!(code, Some(0));
    assert!(!out.contains("streamed"), "{out}");
}

#[test]
fn the_command_says_why_it_cannot_stream() {
    let files = Files::new([16_384, 16_384], "id.yx");
    let (code, _, err, _) = files.anyhit(&["render", "scene.toml"]);
    assert_eq!(code, Some(5));
    // 16384 * 16384 * 16 bytes.
    assert!(
        err.contains("[16384, 16384, 1] texels in 1 layers are too large for an image: 4294967296 bytes"),
        "{err}"
    );
    assert!(
        err.contains(
            "the whole image is held in memory: RayGenerationKHR `main` may access texels in rows other"
        ),
        "{err}"
    );
    assert_eq!(files.names(), ["main.wgsl", "scene.toml"]);
    // Whole, it is no trouble where it fits.
    let (code, ..) = files.anyhit(&["render", "scene.toml", "--size", "24x24", "-o", "small.png"]);
    assert_eq!(code, Some(0));
}

#[test]
fn a_picture_that_fails_leaves_the_old_one() {
    let files = Files::with_alpha([2048, 4200], "id.xy", "cells[select(0u, 9u, id.y == 2100u)]");
    std::fs::write(files.folder.path().join("out.png"), "the old one").expect("a writable folder");
    let (code, _, err, _) = files.anyhit(&["render", "scene.toml"]);
    assert_eq!(code, Some(3));
    assert!(err.contains("launch id (0, 2100, 0)"), "{err}");
    assert_eq!(files.bytes("out.png"), b"the old one");
    assert_eq!(files.names(), ["main.wgsl", "out.png", "scene.toml"]);
}
