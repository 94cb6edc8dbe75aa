//! Tests of scenes with mistakes: each class with the message that its author gets.

use std::path::Path;

use crate::file::SceneFile;
use crate::files::EmbeddedFiles;
use crate::read::Diagnostics;
use crate::{LoadOptions, load};
use anyhit_base::error::{Error, ErrorKind};
use anyhit_engine::math::random::Random;

/// Reads the text as `s/a.toml` beside a few good and bad files.
fn mistake(text: &str) -> Error {
    let files = [
        ("s/a.toml", text.as_bytes()),
        ("s/m.spv", &[3, 2, 35, 7]),
        ("s/bad.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 7\n"),
        ("s/bad.png", b"\x89PNG\r\n\x1a\nrest"),
        ("s/loop.toml", b"version = 1\ninclude = 'loop.toml'\n"),
        ("s/old.toml", b"version = 0\n"),
        ("s/wrong.toml", b"version = 1\n\n[geometry.g]\ntype = 'grass'\ncout = 2\n"),
    ];
    match load(Path::new("s/a.toml"), &EmbeddedFiles(&files), &LoadOptions::default()) {
        Err(error) => error,
        Ok(_) => panic!("no mistake in:\n{text}"),
    }
}

/// Checks that the text after `version = 1` has one mistake, reported with a place and words.
#[track_caller]
fn one_mistake(text: &str, place: &str, wanted: &[&str]) {
    let error = mistake(&format!("version = 1\n{text}"));
    let report = error.render();
    assert!(error.others().is_empty(), "more than one mistake:\n{report}");
    for words in wanted.iter().chain(&[place]) {
        assert!(report.contains(words), "no `{words}` in:\n{report}");
    }
}

#[test]
fn a_whole_report_as_it_is_printed() {
    let error = mistake("version = 1\n\n[geometry.field]\ntype = \"grass\"\nhieght = [0.2, 0.5]\n");
    let wanted = "\
error: unknown key `hieght`
  ┌─ s/a.toml:5:1
  │
5 │ hieght = [0.2, 0.5]
  │ ^^^^^^ did you mean `height`?
  │
  = valid keys: area, cluster_id, count, height, lean, no_duplicate_any_hit, opacity_micromap, opaque, radius, seed, taper, type

";
    pretty_assertions::assert_eq!(error.render(), wanted);
}

#[test]
fn the_version_comes_first() {
    for (text, wanted) in [
        ("", "must begin with its format version: `version = 1`"),
        ("launch = 'x'\n", "must begin with its format version"),
        ("version = 2\nnew_key = 1\n", "supports version 1"),
        ("version = 2\n", "help: update anyhit"),
        ("version = 0\n", "help: write `version = 1`"),
        ("version = '1'\n", "expected an integer"),
    ] {
        let error = mistake(text);
        assert!(error.render().contains(wanted), "{error:?}");
        assert!(error.render().contains("s/a.toml:1:"), "{error:?}");
        assert!(error.others().is_empty(), "{error:?}");
    }
    let newer = mistake("version = 2\n");
    assert_eq!(newer.kind(), ErrorKind::UnsupportedFile);
    assert!(!newer.render().contains("a limitation of anyhit"), "{newer:?}");
    assert_eq!(mistake("version = 0\n").kind(), ErrorKind::InvalidScene);
}

#[test]
fn every_mistake_is_reported_in_one_run() {
    let error = mistake(
        "version = 1\nlauch = [4, 4]\n[geometry.a]\ntype = 'spheres'\npositions = [[0, 0, 0]]\nradii = 'x'\n\
         [[instance]]\ngeometry = 'b'\nmask = 256\n[pipeline]\nmiss = ['sky']\n[resources.i]\ntype = 'sampled_image'\n\
         binding = 0\nfile = 'gone.png'\n",
    );
    let messages: Vec<&str> =
        std::iter::once(error.message()).chain(error.others().iter().map(Error::message)).collect();
    let wanted = [
        "expected a number, found a string",
        "out of range: u8 ranges from 0 to 255",
        "unknown key `lauch`",
        "no geometry is named `b`",
        "no shader is named `sky`",
        "s/gone.png: no such embedded file",
    ];
    pretty_assertions::assert_eq!(messages, wanted);
}

#[test]
fn a_key_below_the_wrong_table() {
    one_mistake(
        "[pipeline]\nlaunch = [4, 4]\n",
        "s/a.toml:3:1",
        &["unknown key `launch`", "`launch` belongs at the top of the file, before the first table"],
    );
    one_mistake(
        "max_recursion_depth = 3\n",
        "s/a.toml:2:1",
        &["`max_recursion_depth` belongs in `[pipeline]`"],
    );
}

/// What follows a bracket that is not closed is read as if it stood in it.
#[test]
fn a_missing_bracket_is_one_mistake() {
    let rest: String = (0..400).map(|at| format!("[geometry.g{at}]\ntype = 'plane'\n")).collect();
    one_mistake(
        &format!("launch = [4, 4\n[geometry.floor]\ntype = 'plane'\n{rest}"),
        "s/a.toml:3:1",
        &["not TOML: ", "2 │ launch = [4, 4", "this has no closing `]`"],
    );
    one_mistake(&format!("[geometry.floor\ntype = 'plane'\n{rest}"), "s/a.toml:2", &["not TOML: "]);
    one_mistake(&format!("title = \"open\n{rest}"), "s/a.toml:2", &["not TOML: "]);
    // A table that is there twice closes its brackets.
    for header in ["[shaders]", "[[instance]]\ngeometry = 'a'\n[geometry.grass]"] {
        let error = mistake(&format!("{header}\n{header}\n"));
        let text = error.render();
        assert!(text.contains("not TOML: duplicate key"), "{text}");
        assert!(!text.contains("this has no closing"), "{text}");
    }
    for twice in ["title = { a = 1, a = 2 }\n", "[geometry.a b]\n"] {
        let text = mistake(twice).render();
        assert!(text.contains("not TOML: ") && !text.contains("this has no closing"), "{text}");
    }
    // Mistakes that have nothing to do with each other are all told.
    let error = mistake("version = 1\nx = = 1\ny = 2\nz = = 3\n");
    let text = error.render();
    assert!(text.contains("a.toml:2:"), "{text}");
    assert!(text.contains("a.toml:4:"), "{text}");
}

#[test]
fn names_that_nothing_has() {
    one_mistake(
        "[geometry.grass]\ntype = 'plane'\n[[instance]]\ngeometry = 'gras'\n",
        "s/a.toml:5:12",
        &["no geometry is named `gras`", "did you mean `grass`?", "available: grass"],
    );
    one_mistake(
        "[shaders]\nall = 'm.spv'\n[pipeline]\nhit = [{ any_hit = 'al:ah' }]\n",
        "s/a.toml:5:20",
        &["no shader is named `al`", "did you mean `all`?"],
    );
    one_mistake(
        "[resources.s]\ntype = 'sampler'\nbinding = 0\nsampler = 'soft'\n",
        "s/a.toml:5:11",
        &["no sampler is named `soft`"],
    );
    one_mistake(
        "[resources.t]\ntype = 'acceleration_structure'\nbinding = 0\ntlas = 'far'\n",
        "s/a.toml:5:8",
        &["no instance is in the acceleration structure `far`"],
    );
}

#[test]
fn files_that_are_missing_or_broken() {
    one_mistake(
        "[shaders]\nall = 'n.spv'\n[pipeline]\nraygen = 'all'\n",
        "s/a.toml:3:7",
        &["looked for at s/n.spv", "no such embedded file"],
    );
    one_mistake(
        "[geometry.g]\ntype = 'obj'\nfile = 'bad.obj'\n",
        "s/a.toml:4:8",
        &["the file has no triangles", "in s/bad.obj", "not read: line 3: "],
    );
    one_mistake(
        "[resources.i]\ntype = 'sampled_image'\nbinding = 1\nfile = 'bad.png'\n",
        "s/a.toml:5:8",
        &["in s/bad.png"],
    );
    one_mistake(
        "[resources.i]\ntype = 'storage_buffer'\nbinding = 1\nelement = 4294967295\nsize = 4\n",
        "s/a.toml:5:11",
        &["at most 1048576 elements"],
    );
    // Keys that were not read because of another mistake are not unknown.
    one_mistake(
        "[resources.i]\ntype = 'combined_image_sampler'\nbinding = 1\nsize = [0, 3]\nsampler = { filter = 'linear' }\n",
        "s/a.toml:5:8",
        &["each from 1 to 32768"],
    );
    one_mistake("include = 'gone.toml'\n", "s/a.toml:2:11", &["no such embedded file"]);
    one_mistake("include = 'old.toml'\n", "s/old.toml:1:11", &["unknown version 0 of the scene format"]);
    one_mistake("include = 'loop.toml'\n", "s/loop.toml:2:11", &["cyclic include"]);
    one_mistake("include = 'wrong.toml'\n", "s/wrong.toml:5:1", &["did you mean `count`?"]);
}

#[test]
fn geometry_that_does_not_fit_together() {
    let spheres = "[geometry.g]\ntype = 'spheres'\npositions = [[0, 0, 0], [1, 0, 0]]\n";
    one_mistake(&format!("{spheres}radii = [1, 2, 3]\n"), "s/a.toml:5:9", &["3 radii for 2 positions"]);
    one_mistake(
        &format!("{spheres}radii = 1\nindices = [0, 2]\n"),
        "s/a.toml:6:11",
        &["index 2 is out of range: there are 2"],
    );
    one_mistake(spheres, "s/a.toml:2:1", &["`radii` is missing"]);
    // An error of a structure about a geometry is reported once, at the geometry.
    let two = "[[instance]]\ngeometry = 'g'\n[[instance]]\ngeometry = 'g'\ntranslate = [1, 0, 0]\n";
    one_mistake(
        &format!("{spheres}radii = [1, -1]\n{two}"),
        "s/a.toml:2:1",
        &["primitive 1 has the negative radius -1"],
    );
    let lss = "[geometry.g]\ntype = 'lss'\npositions = [[0, 0, 0], [1, 0, 0]]\nradii = 1\n";
    one_mistake(&format!("{lss}mode = 'successive'\n"), "s/a.toml:2:1", &["requires `indices`", "10427"]);
    one_mistake(
        &format!("{lss}mode = 'successive'\nindices = [1]\n"),
        "s/a.toml:7:11",
        &["index 1 is out of range: there are 1"],
    );
    one_mistake(&format!("{lss}indices = [0, 1, 0]\n"), "s/a.toml:6:11", &["two indices per segment"]);
    one_mistake(&format!("{lss}caps = 'chain'\n"), "s/a.toml:6:8", &["did you mean `chained`?"]);
    let triangles = "[geometry.g]\ntype = 'triangles'\nvertices = [[0, 0, 0], [1, 0, 0]]\n";
    one_mistake(triangles, "s/a.toml:4:12", &["2 corners are not a multiple of three"]);
    one_mistake("[geometry.g]\ntype = 'cube'\n", "s/a.toml:3:8", &["unknown type of geometry `cube`"]);
    one_mistake("[geometry.g]\nopaque = true\n", "s/a.toml:2:1", &["needs its `type`"]);
    one_mistake(
        "[geometry.g]\ntype = 'grass'\ncount = 4_000_000_000\n",
        "s/a.toml:4:9",
        &["4000000000 primitives of one scene exceed the limit `scene-primitives` of 67108864"],
    );
    one_mistake(
        "[geometry.g]\ntype = 'chains'\ncount = 20_000_000\n",
        "s/a.toml:4:9",
        &["80000000 primitives"],
    );
    one_mistake(
        "[geometry.g]\ntype = 'plane'\ndivisions = [65536, 65536]\n",
        "s/a.toml:4:13",
        &["8589934592 primitives"],
    );
    // Of chains there are 20 where the count is not given.
    one_mistake(
        "[geometry.g]\ntype = 'chains'\nsegments = 4_000_000_000\n",
        "s/a.toml:2:1",
        &["80000000000 primitives", "`scene-primitives`"],
    );
    one_mistake(
        "[geometry.g]\ntype = 'grass'\nheight = [0.5, 0.2]\n",
        "s/a.toml:4:10",
        &["not a range from a lower to a higher number"],
    );
}

#[test]
fn buffers_of_a_build() {
    let spheres = "[geometry.g]\ntype = 'spheres'\nvertex_data = { f16 = [0, 0, 0, 1, 1, 1] }\n";
    let radii = "radius_data = { f32 = 1 }\n";
    let half = "vertex_format = 'r16g16b16_sfloat'\n";
    one_mistake(&format!("{spheres}{half}"), "s/a.toml:2:1", &["`radius_data` is missing"]);
    one_mistake(
        &format!("{spheres}{half}{radii}"),
        "s/a.toml:2:1",
        &["radius 1 ends at byte 8, past the end of its buffer of 4 bytes"],
    );
    one_mistake(
        &format!("{spheres}{radii}vertex_format = 'r32g32b32'\n"),
        "s/a.toml:6:17",
        &["did you mean `r32g32b32_sfloat`?"],
    );
    one_mistake(
        &format!("{spheres}{half}{radii}vertex_stride = 7\n"),
        "s/a.toml:2:1",
        &["vertexStride-10431"],
    );
    one_mistake(
        &format!("{spheres}{half}{radii}index_data = {{ u8 = [0, 1] }}\nindex_type = 'uint8'\n"),
        "s/a.toml:2:1",
        &["indexData-10437"],
    );
    one_mistake(
        &format!("{spheres}{half}radius_data = {{ f32 = [1, 1] }}\npositions = [[0, 0, 0]]\n"),
        "s/a.toml:7:1",
        &["unknown key `positions`"],
    );
    let swept =
        "[geometry.g]\ntype = 'lss'\nmode = 'successive'\nvertex_data = { f32 = [0, 0, 0, 1, 1, 1] }\n";
    one_mistake(&format!("{swept}{radii}"), "s/a.toml:2:1", &["indexingMode-10427"]);
}

#[test]
fn instances() {
    let ground = "[geometry.g]\ntype = 'plane'\n[[instance]]\ngeometry = 'g'\n";
    one_mistake(
        &format!("{ground}[[instance]]\ngeometry = 'g'\nscale = [1, 0, 1]\n"),
        "s/a.toml:6:1",
        &["singular"],
    );
    one_mistake(&format!("{ground}sbt_offset = 16777216\n"), "s/a.toml:6:14", &["24 bits"]);
    one_mistake(&format!("{ground}custom_index = -1\n"), "s/a.toml:6:16", &["out of range"]);
    one_mistake(
        &format!("{ground}transform = [1, 0, 0]\n"),
        "s/a.toml:6:13",
        &["expected 12 elements, found 3"],
    );
    one_mistake(
        &format!("{ground}scale = 2\ntransform = [[1,0,0,0],[0,1,0,0],[0,0,1,0]]\n"),
        "s/a.toml:7:13",
        &["`transform` excludes"],
    );
    one_mistake(
        &format!("{ground}rotate = {{ axis = [0, 0, 0], degrees = 3 }}\n"),
        "s/a.toml:6:19",
        &["not zero"],
    );
    one_mistake(
        &format!("{ground}flags = ['force_opaqe']\n"),
        "s/a.toml:6:10",
        &["did you mean `force_opaque`?"],
    );
}

#[test]
fn buffers_images_and_sizes() {
    let buffer = "[resources.b]\ntype = 'storage_buffer'\nbinding = 0\n";
    one_mistake(buffer, "s/a.toml:2:1", &["a buffer needs `data`, or a `size`"]);
    one_mistake(
        &format!("{buffer}size = 3\ndata = {{ u32 = 1 }}\n"),
        "s/a.toml:5:8",
        &["4 bytes, more than the `size` of 3"],
    );
    one_mistake(
        &format!("{buffer}size = 9_000_000_000\n"),
        "s/a.toml:5:8",
        &["9000000000 bytes of a buffer exceed the limit `buffer-bytes` of 1073741824"],
    );
    one_mistake(
        "[resources.b]\ntype = 'storage_bufer'\nbinding = 0\n",
        "s/a.toml:3:8",
        &["did you mean `storage_buffer`?"],
    );
    one_mistake("[resources.b]\ntype = 'storage_image'\n", "s/a.toml:2:1", &["`binding` is missing"]);
    let image = "[resources.i]\ntype = 'storage_image'\nbinding = 0\n";
    one_mistake(&format!("{image}format = 'rgba32'\n"), "s/a.toml:5:10", &["did you mean `rgba32f`?"]);
    one_mistake(&format!("{image}size = [40000, 2]\n"), "s/a.toml:5:8", &["each from 1 to 32768"]);
    one_mistake(&format!("{image}size = [32768, 32768]\n"), "s/a.toml:2:1", &["too large for an image"]);
    one_mistake(
        &format!("{image}dimension = 'cube'\nlayers = 5\n"),
        "s/a.toml:2:1",
        &["a cube needs six square layers"],
    );
    one_mistake(
        &format!("{image}[resources.j]\ntype = 'storage_image'\nbinding = 0\n"),
        "s/a.toml:5:12",
        &["two resources at set 0, binding 0", "the other one"],
    );
    one_mistake("launch = [65536, 65536]\n", "s/a.toml:2:10", &["found 4294967296"]);
    one_mistake("launch = [0]\n", "s/a.toml:2:10", &["0 invocations"]);
    one_mistake(
        "launch = [4, 4]\n[[ray]]\npixel = [4, 0]\n",
        "s/a.toml:4:9",
        &["outside the launch of 4 x 4"],
    );
    one_mistake("[pipeline]\nsubgroup_size = 3\n", "s/a.toml:3:17", &["1, 2, 4, ... or 128"]);
}

#[test]
fn a_text_that_is_no_toml() {
    let error = mistake("version = 1\n[geometry\n");
    assert!(error.render().contains("s/a.toml:2:"), "{error:?}");
    let files = [("a.toml", &b"version = 1 # \xff"[..])];
    let error = load(Path::new("a.toml"), &EmbeddedFiles(&files), &LoadOptions::default()).unwrap_err();
    assert_eq!(error.message(), "not UTF-8 at byte 14");
}

/// Damaged texts give errors or other scenes, never a panic.
#[test]
fn noise_does_not_panic() {
    let texts = [
        include_str!("../../../scenes/swept-spheres-geometry.toml"),
        include_str!("../../../scenes/swept-spheres-slang.toml"),
        include_str!("../../../docs/scene.md").split("```toml\n").nth(1).unwrap(),
    ];
    const SPECIAL: &[u8] = b"[]{}=\"',.0-9aex#\n";
    let mut random = Random::new(1);
    let mut refused = 0;
    for round in 0..3000 {
        let mut bytes = texts[round % texts.len()].as_bytes().to_vec();
        for _ in 0..=random.bits() % 4 {
            let at = random.bits() as usize % bytes.len();
            match random.bits() % 3 {
                0 => bytes[at] = SPECIAL[random.bits() as usize % SPECIAL.len()],
                1 => drop(bytes.remove(at)),
                _ => bytes.truncate(at.max(8)),
            }
        }
        let text = String::from_utf8_lossy(&bytes);
        let report = Diagnostics::default();
        let parsed = SceneFile::parse("a.toml", &*text, &report);
        let error = parsed.err().or_else(|| report.finish().err());
        if let Some(error) = error {
            refused += 1;
            assert!(!error.render().is_empty());
        }
    }
    assert!(refused > 1500, "{refused}");
}

/// Values of another type than the key expects.
#[test]
fn values_of_the_wrong_kind() {
    for (text, wanted) in [
        ("geometry = 3", "expected a table, found an integer"),
        ("geometry = { g = 3 }", "expected a table, found an integer"),
        ("instance = { geometry = 'g' }", "expected an array, found a table"),
        ("pipeline = []", "expected a table, found an array"),
        ("pipeline = { hit = 'a' }", "expected an array, found a string"),
        ("launch = 1979-05-27", "found a date"),
        ("include = 3", "expected a string, found an integer"),
        ("shaders = { a = {} }", "needs the `path`"),
        (
            "shaders = { a = { path = 'a', specialization = { 0 = [] } } }",
            "expected a number, a Boolean or a string",
        ),
        ("shaders = { a = { path = 'a', specialization = { 0 = { f32 = [1, 2, 3] } } } }", "one scalar"),
        (
            "samplers = { a = { address_mode = ['repeat', 'repeat', 'repeat', 'repeat'] } }",
            "one for each of u, v, w",
        ),
        ("ray = [{}]", "`origin` is missing"),
    ] {
        let error = mistake(&format!("version = 1\n{text}\n"));
        assert!(error.render().contains(wanted), "{text}: {error:?}");
        assert!(error.render().contains("s/a.toml:2:"), "{text}: {error:?}");
    }
}
