//! Descriptors of scenes: views of buffers and images, descriptors that nothing binds, and arrays.

use std::path::Path;

use anyhit::{Error, Result};
use anyhit_engine::machine::{Binding, Buffer, Descriptor};
use anyhit_engine::pipeline::RunOptions;
use anyhit_scene::{Assembled, DiskFiles, LoadOptions, assemble, load_text};

fn scene(text: &str) -> Result<Assembled> {
    let scene =
        load_text(Path::new("s.toml"), &format!("version = 1\n{text}"), &DiskFiles, &LoadOptions::default())?;
    assemble(&scene)
}

fn error(text: &str) -> Error {
    scene(text).expect_err(text)
}

/// Checks that a scene has one mistake, at a place and in words.
#[track_caller]
fn one_mistake(text: &str, place: &str, wanted: &[&str]) {
    let error = error(text);
    let report = error.render();
    assert!(error.others().is_empty(), "more than one mistake:\n{report}");
    for words in wanted.iter().chain(&[place]) {
        assert!(report.contains(words), "no `{words}` in:\n{report}");
    }
}

const ARENA: &str = "[resources.arena]\ntype = 'buffer'\nsize = 64\n";

/// A view of the arena with further keys.
fn view(keys: &str) -> String {
    format!("{ARENA}[resources.lights]\ntype = 'storage_buffer'\nbinding = 3\nbuffer = 'arena'\n{keys}\n")
}

fn buffer(assembled: &Assembled, set: u32, binding: u32) -> &Buffer {
    match &assembled.resources.descriptors[&Binding { set, binding }][0] {
        Descriptor::Buffer(buffer) => buffer,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_range_goes_from_its_offset_to_its_end_or_that_of_the_buffer() {
    for (keys, start, size) in
        [("", 0, 64), ("offset = 16", 16, 48), ("offset = 60\nrange = 4", 60, 4), ("range = 7", 0, 7)]
    {
        let assembled = scene(&view(keys)).unwrap();
        let buffer = buffer(&assembled, 0, 3);
        assert_eq!((buffer.offset(), buffer.size()), (start, size), "{keys}");
        assert_eq!(buffer.view_of().map(|name| &**name), Some("arena"));
    }
    // What it is a view of may be bound itself, come later in the file, and have a greater binding.
    let text = "[resources.a]\ntype = 'uniform_buffer'\nbinding = 0\nbuffer = 'b'\noffset = 4\n\
                [resources.b]\ntype = 'storage_buffer'\nbinding = 1\ndata = { u32 = [1, 2, 3] }\n";
    let assembled = scene(text).unwrap();
    buffer(&assembled, 0, 0).store(4, 32, 9).unwrap();
    assert_eq!(buffer(&assembled, 0, 1).bytes(), [1, 0, 0, 0, 2, 0, 0, 0, 9, 0, 0, 0]);
}

#[test]
fn ranges_that_are_none() {
    let rule = |number: &str| format!("VUID-VkDescriptorBufferInfo-{number}");
    let mistakes = [
        (
            "offset = 64",
            "s.toml:9:10",
            "offset 64 is past the end of `arena`, which has 64 bytes",
            rule("offset-00340"),
        ),
        (
            "offset = 6",
            "s.toml:9:10",
            "6 is not a multiple of 4 bytes",
            "minStorageBufferOffsetAlignment".into(),
        ),
        ("range = 0", "s.toml:9:9", "the range is empty", rule("range-00341")),
        (
            "offset = 48\nrange = 17",
            "s.toml:10:9",
            "17 bytes at offset 48 extend past the end of `arena`, which has 64 bytes",
            rule("range-00342"),
        ),
        ("data = { u32 = 1 }", "s.toml:9:8", "a view has no `data`", String::new()),
        (
            "dynamic_offset = 4",
            "s.toml:9:18",
            "only a `storage_buffer_dynamic` has a `dynamic_offset`",
            String::new(),
        ),
        ("image = 'arena'", "s.toml:9:1", "unknown key `image`", String::new()),
    ];
    for (keys, place, message, note) in mistakes {
        one_mistake(&view(keys), place, &[message, &note]);
    }
    one_mistake(
        &view("").replace("buffer = 'arena'", "buffer = 'aren'"),
        "s.toml:8:10",
        &["no resource is named `aren`", "did you mean `arena`?"],
    );
    let of_view = view("") + "[resources.more]\ntype = 'storage_buffer'\nbinding = 4\nbuffer = 'lights'\n";
    one_mistake(&of_view, "s.toml:13:10", &["`lights` is itself a view of `arena`", "name `arena` instead"]);
    one_mistake(
        "[resources.a]\ntype = 'storage_buffer'\nbinding = 0\nsize = 8\noffset = 4\n",
        "s.toml:6:10",
        &["`offset` applies to a range of another resource", "buffer = \"NAME\""],
    );
    let twice = view("") + "[resources.again]\ntype = 'storage_buffer'\nbinding = 3\nsize = 4\n";
    one_mistake(&twice, "s.toml", &["two resources at set 0, binding 3"]);
}

#[test]
fn dynamic_offsets_are_added() {
    let dynamic = |keys: &str| view(keys).replace("'storage_buffer'", "'storage_buffer_dynamic'");
    let assembled = scene(&dynamic("offset = 8\nrange = 16\ndynamic_offset = 32")).unwrap();
    assert_eq!((buffer(&assembled, 0, 3).offset(), buffer(&assembled, 0, 3).size()), (40, 16));
    // Without it nothing is added.
    let assembled = scene(&dynamic("offset = 8")).unwrap();
    assert_eq!((buffer(&assembled, 0, 3).offset(), buffer(&assembled, 0, 3).size()), (8, 56));
    one_mistake(
        &dynamic("offset = 8\nrange = 16\ndynamic_offset = 44"),
        "s.toml:11:18",
        &[
            "16 bytes at offset 8 + 44 = 52 extend past the end of `arena`, which has 64 bytes",
            "VUID-vkCmdBindDescriptorSets-pDescriptorSets-01979",
        ],
    );
    one_mistake(
        &dynamic("offset = 8\ndynamic_offset = 4"),
        "s.toml:10:18",
        &[
            "a nonzero `dynamic_offset` requires a `range`",
            "VUID-vkCmdBindDescriptorSets-pDescriptorSets-06715",
        ],
    );
    one_mistake(
        "[resources.a]\ntype = 'uniform_buffer_dynamic'\nbinding = 0\nsize = 8\n",
        "s.toml:2:1",
        &["a dynamic descriptor refers to a range of another buffer"],
    );
}

#[test]
fn the_address_of_a_view_lies_in_its_buffer() {
    let text = "push_constants = { address_of = 'lights', offset = 4 }\n".to_owned()
        + &view("offset = 16\nrange = 8");
    let assembled = scene(&text).unwrap();
    let (base, _) = assembled.resources.memory.named_buffer("arena").unwrap();
    let pushed = assembled.resources.push_constants.as_ref().unwrap().bytes();
    assert_eq!(u64::from_le_bytes(pushed.try_into().unwrap()), base + 20);
    one_mistake(
        &text.replace("offset = 4", "offset = 12"),
        "s.toml:2",
        &["offset 12 is past the end of `lights`, which has 8 bytes"],
    );
    // A bound buffer gets an address as one of its views needs it.
    let bound = text.replace("type = 'buffer'", "type = 'storage_buffer'\nbinding = 0");
    assert!(scene(&bound).unwrap().resources.memory.named_buffer("arena").is_some());
}

#[test]
fn one_image_has_one_format() {
    let image = "[resources.hdr]\ntype = 'storage_image'\nbinding = 0\nformat = 'rgba16f'\n";
    let view =
        |kind: &str, keys: &str| format!("{image}[resources.view]\ntype = '{kind}'\nbinding = 1\n{keys}\n");
    let assembled = scene(&view("sampled_image", "image = 'hdr'")).unwrap();
    let [one, other] = [0, 1].map(|binding| assembled.resources.image(0, binding).expect("an image"));
    assert!(std::sync::Arc::ptr_eq(one, other));
    assert!(scene(&view("storage_image", "image = 'hdr'\nformat = 'rgba16f'")).is_ok());
    one_mistake(
        &view("storage_image", "image = 'hdr'\nformat = 'r32ui'"),
        "s.toml:10:10",
        &["the view's format differs from the format `rgba16f` of `hdr`"],
    );
    one_mistake(
        &view("storage_buffer", "buffer = 'hdr'"),
        "s.toml:9:10",
        &["`hdr` is an image, but this is a view of a buffer"],
    );
    one_mistake(
        &view("storage_image", "image = 'hdr'\nsize = [4, 4]"),
        "s.toml:10:8",
        &["a view has no `size`"],
    );
    let texels = "[resources.ids]\ntype = 'uniform_texel_buffer'\nbinding = 0\nformat = 'r32ui'\nsize = 4\n";
    let again = |name: &str| {
        format!("{texels}[resources.again]\ntype = 'storage_texel_buffer'\nbinding = 1\nbuffer = '{name}'\n")
    };
    assert!(scene(&again("ids")).is_ok());
    one_mistake(
        &(again("arena") + ARENA),
        "s.toml:10:10",
        &["`arena` is a buffer, but this is a view of another texel buffer"],
    );
}

#[test]
fn elements_of_an_array_are_listed() {
    let array = |elements: &str| {
        format!("[resources.a]\ntype = 'storage_buffer'\nbinding = 3\nelement = 1\nelements = {elements}\n")
    };
    let elements =
        "[{ size = 4 }, { data = { u32 = [7, 8] } }, { null = true }, { buffer = 'arena', offset = 60 }]";
    let assembled = scene(&(array(elements) + ARENA)).unwrap();
    let found = &assembled.resources.descriptors[&Binding { set: 0, binding: 3 }];
    let sizes = found.iter().map(|one| match one {
        Descriptor::Buffer(buffer) => Some((buffer.size(), buffer.is_null())),
        Descriptor::Unbound => None,
        other => panic!("{other:?}"),
    });
    let wanted = [None, Some((4, false)), Some((8, false)), Some((0, true)), Some((4, false))];
    assert_eq!(sizes.collect::<Vec<_>>(), wanted);
    one_mistake(&array("[]"), "s.toml:6:12", &["an array of descriptors must have at least one element"]);
    one_mistake(
        &array("{ size = 4 }"),
        "s.toml:6:12",
        &["expected an array of tables, one for each element"],
    );
    one_mistake(
        &array("[{ size = 4 }, { size = 4, offset = 8 }]"),
        "s.toml:6",
        &["`offset` applies to a range of another resource"],
    );
    one_mistake(&(array("[{ size = 4 }]") + "size = 4\n"), "s.toml:7:1", &["unknown key `size`"]);
    let again = "[resources.b]\ntype = 'storage_buffer'\nbinding = 3\nelement = 2\nsize = 4\n";
    one_mistake(
        &(array("[{ size = 4 }, { size = 4 }]") + again),
        "s.toml:7:12",
        &["two resources at set 0, binding 3"],
    );
    one_mistake(
        "[resources.b]\ntype = 'storage_buffer'\nbinding = 3\nelement = 1048575\nelements = [{ size = 4 }, { size = 4 }]\n",
        "s.toml:2:12",
        &["an array of descriptors must have at most 1048576 elements"],
    );
}

const STAND_INS: &str = "shaders.main = 'spirv-fixtures/pass/resources/unbound/main.comp.spv'\n\
    [[dispatch]]\nshader = 'main'\n[resources.results]\ntype = 'storage_buffer'\nbinding = 1\nsize = 128\n";

#[test]
fn what_nothing_is_bound_to_is_told_when_it_is_read_and_when_it_is_accessed() {
    let assembled = scene(STAND_INS).unwrap();
    let [note] = &assembled.notes[..] else { panic!("{:?}", assembled.notes) };
    for words in [
        "s.toml: the scene binds nothing to `structure` (set 0, binding 0, acceleration_structure); ",
        "(set 0, binding 2, storage_buffer); ",
        "`textures` (set 0, binding 6, combined_image_sampler)",
        "an access traps unless [pipeline] sets `unbound = \"zeros\"`",
    ] {
        assert!(note.contains(words), "no `{words}` in {note}");
    }
    assert!(!note.contains("unused"), "no entry point uses it: {note}");
    let error = assembled.run(&assembled.resources, RunOptions::default()).unwrap_err().render();
    for words in [
        "no descriptor of this kind is bound here",
        "bound: set 0, binding 1 (`Outputs`, a buffer, the scene's `results`)",
        "not bound: `structure` (set 0, binding 0, acceleration_structure); ",
        "`textures` (set 0, binding 6, combined_image_sampler)",
    ] {
        assert!(error.contains(words), "no `{words}` in {error}");
    }
    // With zeros there is nothing to tell.
    let zeros = STAND_INS.replacen("[[dispatch]]", "[pipeline]\nunbound = 'zeros'\n[[dispatch]]", 1);
    let assembled = scene(&zeros).unwrap();
    assert_eq!(assembled.notes, [""; 0]);
    assembled.run(&assembled.resources, RunOptions::default()).unwrap();
    one_mistake(
        &zeros.replace("zeros", "ones"),
        "s.toml:4:11",
        &["unknown policy for unbound descriptors", "one of: trap, zeros"],
    );
}
