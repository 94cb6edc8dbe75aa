//! Device addresses in scenes: `tests/scenes/addresses/nodes.comp` follows a list of nodes from a
//! push constant, writes behind the fifth one and asks a ray query of a structure by its address.

use std::path::Path;

use anyhit::{Error, Result};
use anyhit_engine::pipeline::RunOptions;
use anyhit_scene::{DiskFiles, LoadOptions, assemble, load_text};

const HEAD: &str = "version = 1\nshaders.main = 'tests/scenes/addresses/nodes.spv'\n\
    [geometry.g]\ntype = 'triangles'\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nopaque = true\n\
    [[instance]]\ngeometry = 'g'\n[[dispatch]]\nshader = 'main'\n\
    [resources.out]\ntype = 'storage_buffer'\nbinding = 0\nsize = 24\n";

/// Three nodes in a cycle, of which the second and third share a buffer.
const NODES: &str = "[resources.first]\ntype = 'buffer'\ndata = [{ u32 = [3, 0] }, { address_of = 'rest', offset = 16 }]\n\
    [resources.rest]\ntype = 'buffer'\ndata = [{ u32 = [5, 0] }, { address_of = 'first' }, \
    { u32 = [4, 0] }, { address_of = 'rest' }]\n";

const PUSH: &str = "push_constants = [{ address_of = 'first' }, { address_of = 'main' }]\n";

fn scene(text: &str) -> Result<anyhit_scene::Assembled> {
    let scene = load_text(Path::new("s.toml"), text, &DiskFiles, &LoadOptions::default())?;
    assemble(&scene)
}

fn words(text: &str) -> Result<(Vec<u32>, anyhit_scene::Assembled)> {
    let assembled = scene(text)?;
    assembled.run(&assembled.resources, RunOptions::default())?;
    let bytes = assembled.resources.buffer(0, 0).expect("the output").bytes();
    let words = bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap()));
    Ok((words.collect(), assembled))
}

/// A push constant comes before the first table.
fn text(push: &str, more: &str) -> String {
    HEAD.replacen("version = 1\n", &format!("version = 1\n{push}"), 1) + more
}

fn error(push: &str, more: &str) -> Error {
    scene(&text(push, more)).expect_err(more)
}

#[test]
fn addresses_lead_from_push_constants_through_a_cycle() {
    let (words, assembled) = words(&text(PUSH, NODES)).unwrap();
    // 3 -> 4 -> 5 -> 3 -> 4 -> 5, which is then overwritten; the query hits a triangle (1).
    assert_eq!(words, [3, 4, 5, 3, 4, 1]);
    // Sorted by name: `first`, `rest`; one region of 4 GiB each. `out` needs none.
    let memory = &assembled.resources.memory;
    assert_eq!(memory.named_buffer("first").map(|(base, _)| base), Some(0x1_0000_0000));
    let (base, rest) = memory.named_buffer("rest").unwrap();
    assert_eq!((base, rest.bytes()[0]), (0x2_0000_0000, 77));
    assert_eq!(memory.describe(base + 16).as_deref(), Some("rest + 0x10"));
    assert!(memory.named_buffer("out").is_none());
}

#[test]
fn automatic_addresses_do_not_follow_the_order_of_the_file() {
    let (rest, first) = (NODES.find("[resources.rest]").unwrap(), NODES);
    let turned = format!("{}{}", &first[rest..], &first[..rest]);
    let turned = words(&text(PUSH, &turned)).unwrap();
    assert_eq!(turned.0, [3, 4, 5, 3, 4, 1]);
    let base = turned.1.resources.memory.named_buffer("first").map(|(base, _)| base);
    assert_eq!(base, Some(0x1_0000_0000));
}

#[test]
fn a_given_address_is_kept_and_automatic_ones_avoid_it() {
    let nodes = NODES.replacen("type = 'buffer'", "type = 'buffer'\naddress = 0x1_0000_0040", 1);
    let (words, assembled) = words(&text(PUSH, &nodes)).unwrap();
    assert_eq!(words, [3, 4, 5, 3, 4, 1]);
    let base = |name| assembled.resources.memory.named_buffer(name).map(|(base, _)| base);
    assert_eq!((base("first"), base("rest")), (Some(0x1_0000_0040), Some(0x2_0000_0000)));
}

#[test]
fn a_trap_names_the_nearest_buffer() {
    // 0x100028 is 24 bytes past the end of 16 bytes at 0x100000.
    let push = "push_constants = [{ address_of = 'first' }, { address_of = 'main' }]\n";
    let nodes = "[resources.first]\ntype = 'buffer'\naddress = 0x10_0000\n\
        data = [{ u32 = [3, 0] }, { u64 = 0x100028 }]\n";
    let error = words(&text(push, nodes)).unwrap_err();
    let wanted = "24 bytes past the end of the nearest buffer, `first` at 0x100000, which has 16 bytes";
    assert!(error.render().contains(wanted), "{}", error.render());
}

#[test]
fn mistakes_are_shown_at_their_places() {
    let buffer = |keys: &str| format!("[resources.b]\ntype = 'buffer'\nsize = 32\n{keys}\n");
    let push = |keys: &str| format!("push_constants = [{{ address_of = {keys} }}]\n");
    let image = "[resources.picture]\ntype = 'storage_image'\nbinding = 5\nsize = [1, 1]\n";
    let other = "[resources.c]\ntype = 'buffer'\nsize = 32\naddress = 0x20010\n";
    for (push, more, wanted) in [
        (
            push("'firts'"),
            "[resources.first]\ntype = 'buffer'\nsize = 4\n".to_owned(),
            "did you mean `first`?",
        ),
        (push("'picture'"), image.to_owned(), "`picture` is an image: only buffers and"),
        (push("'b'"), buffer("address = false"), "`b` has no address: it sets `address = false`"),
        (push("'b', offset = 33"), buffer(""), "offset 33 is past the end of `b`, which has 32 bytes"),
        (
            push("'main', offset = 8"),
            String::new(),
            "the `offset` of an acceleration structure's address must be 0",
        ),
        (String::new(), buffer("address = 0x20008"), "not a multiple of 16"),
        (String::new(), buffer("address = 64"), "too close to the null pointer"),
        (String::new(), buffer("address = 0x20000") + other, "`c`, 32 bytes at 0x20010, overlaps `b`"),
        (String::new(), buffer("binding = 3"), "is not bound to a descriptor and has no `binding`"),
        (
            String::new(),
            "[resources.i]\ntype = 'uniform_texel_buffer'\nbinding = 4\ndata = { address_of = 'out' }\n"
                .to_owned(),
            "addresses are allowed only in buffers",
        ),
    ] {
        let found = error(&push, &more).render();
        assert!(found.contains(wanted) && found.contains("s.toml:"), "{wanted}: {found}");
    }
    let overlap = error("", &(buffer("address = 0x20000") + other)).render();
    assert!(overlap.contains("the other buffer"), "{overlap}");
}

#[test]
fn the_command_line_gives_buffers_addresses() {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["run", "tests/scenes/addresses/nodes.spv", "--buffer", "0=24"])
        .args(["--push", "[{ address_of = 'first' }, { u64 = 0 }]"])
        .args(["--buffer", "first@0x2_0000_0040=[{ u32 = [3, 0] }, { address_of = 'first' }]"])
        .args(["--dump", "0", "--dump", "first"])
        .output()
        .expect("the command starts");
    let out = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{out}{}", String::from_utf8_lossy(&output.stderr));
    // A null structure is missed. The buffer has the type of the pointer to it.
    assert!(out.contains("found = [3, 3, 3, 3, 3, 0]"), "{out}");
    assert!(out.contains("`first` at 0x200000040:\n  value = 77\n  pad = 0\n  next = first\n"), "{out}");
}

#[test]
fn a_bound_buffer_has_an_address_on_the_command_line() {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["run", "tests/scenes/addresses/nodes.spv"])
        // Its content is the default, 6 words; the node holds the address beside its own.
        .args(["--buffer", "0@0x3_0000_0000=24", "--dump", "0", "--dump", "first=hex"])
        .args(["--push", "[{ address_of = 'first' }, { u64 = 0 }]"])
        .args(["--buffer", "first@=[{ u32 = [3, 0] }, { address_of = 'first' }, { address_of = 'outputs' }]"])
        .output()
        .expect("the command starts");
    let out = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{out}{}", String::from_utf8_lossy(&output.stderr));
    assert!(out.contains("found = [3, 3, 3, 3, 3, 0]"), "{out}");
    assert!(out.contains("`first` at 0x100000000: 24 bytes"), "{out}");
    assert!(out.contains("00000010  00 00 00 00 03 00 00 00"), "{out}");
}

#[test]
fn push_constants_of_a_dispatch_and_of_a_pass_hold_addresses() {
    // The second dispatch begins at the second node: 4, 5, 3, 4, 5, and the node behind is 77 then.
    let push = "push_constants = [{ address_of = 'rest', offset = 16 }, { u64 = 0 }]\n";
    let head = HEAD.replace("shader = 'main'\n", &format!("shader = 'main'\n{push}"));
    let found = words(&(head + NODES)).unwrap().0;
    assert_eq!(found, [4, 5, 3, 4, 5, 0]);
    // Only the push constants of a pass name `first`, which is bound.
    let case = std::fs::read_to_string("shaders/pass/addresses/nested/scene.toml").unwrap();
    let case =
        case.replacen("push_constants = { value = { sceneInfo = { address_of = \"info\" } } }\n", "", 1);
    let case = case.replace("../../../../", "")
        + "[[pass]]\nraygen = \"all:raygen\"\n\
        push_constants = { address_of = \"info\" }\n";
    let case = case.replacen("type = \"buffer\"", "type = \"storage_buffer\"\nset = 1\nbinding = 0", 1);
    let case = case.replacen("self = { address_of = \"info\" }", "self = 0x1_0000_0000", 1);
    let assembled = scene(&case).unwrap_or_else(|error| panic!("{}", error.render()));
    // `self` is the address itself, so that nothing else names the buffer: the first by name.
    assert_eq!(assembled.resources.memory.named_buffer("info").map(|(base, _)| base), Some(0x1_0000_0000));
    assembled.run(&assembled.resources, RunOptions::default()).unwrap();
    let outputs = assembled.resources.buffer(0, 1).expect("the output").bytes();
    assert_eq!(outputs[20..24], 41_u32.to_le_bytes());
}

/// `tests/scenes/addresses/constant.comp`: a constant is the address of a material, and its upper
/// half and one the length of an array.
const CONSTANT: &str = "version = 1\n[shaders.main]\npath = 'tests/scenes/addresses/constant.spv'\n\
    specialization = { 3 = { address_of = 'materials', offset = 4 } }\n[[dispatch]]\nshader = 'main'\n\
    [resources.materials]\ntype = 'buffer'\ndata = { u32 = [7, 8] }\n\
    [resources.plain]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4\n\
    [resources.out]\ntype = 'storage_buffer'\nbinding = 0\n";

#[test]
fn a_specialization_constant_is_an_address() {
    let assembled = scene(&format!("{CONSTANT}size = 12\n")).unwrap();
    assembled.run(&assembled.resources, RunOptions::default()).unwrap();
    let bytes = |binding| assembled.resources.buffer(0, binding).expect("a buffer").bytes();
    assert_eq!(bytes(1), 8_u32.to_le_bytes());
    // The array has 1 + 1 elements.
    assert_eq!(bytes(0)[8..12], 2_u32.to_le_bytes());
}

#[test]
fn a_length_that_depends_on_an_address_lays_out_no_data() {
    let data = "data = { value = { found = 9, lengths = [1] } }\n";
    let error = scene(&format!("{CONSTANT}{data}")).unwrap_err().render();
    assert!(error.contains("the length of an array depends on a specialization constant"), "{error}");
    // A number is known from the beginning: here the address that `materials` has.
    let given = CONSTANT.replace("{ address_of = 'materials', offset = 4 }", "{ u64 = 0x1_0000_0004 }");
    let data = "data = { value = { found = 9, lengths = [1, 0] } }\n";
    let assembled = scene(&format!("{given}{data}")).unwrap_or_else(|error| panic!("{}", error.render()));
    assembled.run(&assembled.resources, RunOptions::default()).unwrap();
    let bytes = assembled.resources.buffer(0, 0).expect("a buffer").bytes();
    assert_eq!(bytes, [9_u32, 1, 2].map(u32::to_le_bytes).concat());
}

#[test]
fn a_trace_shows_addresses_by_the_names_of_buffers() {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["trace-one-ray", "shaders/pass/addresses/nested/scene.toml", "--pixel", "0,0"])
        .output()
        .expect("the command starts");
    let out = String::from_utf8_lossy(&output.stdout);
    assert!(out.contains("0x0 -> materials + 0x40"), "{out}");
    // What a shader leaves in a buffer that is bound nowhere: t = 2, as bits.
    assert!(out.contains("instances  byte 12  uint 0 -> 1073741824"), "{out}");
}

#[test]
fn rust_gives_buffers_addresses() {
    use anyhit::{Instance, Ray, Scene};
    let scene = || Scene::new([Instance::sphere([0.0; 3], 0.5)]).unwrap();
    let given = scene().buffer_at(0x2_0000_0000, &[3_u32, 4]);
    let (buffer, offset) = given.resources().memory.buffer(0x2_0000_0004).unwrap();
    assert_eq!((buffer.load(offset, 32), offset), (Some(4), 4));
    // What cannot be given is an error of the run.
    let shader = |file| {
        let module = anyhit::Module::open(format!("spirv-fixtures/pass/sphere/closest-hit/{file}"))?;
        anyhit::Program::of(&module, "main")
    };
    let pipeline = anyhit::Pipeline::builder()
        .hit([shader("main.rchit.spv").unwrap()])
        .unwrap()
        .miss(shader("main.rmiss.spv").unwrap())
        .unwrap()
        .build()
        .unwrap();
    let twice = given.buffer_at(0x2_0000_0000, &[5_u32]);
    let error = pipeline.trace(&twice, Ray::new([0.75, 0.0, 4.0], [0.0, 0.0, -1.0])).unwrap_err();
    assert!(error.message().contains("4 bytes at 0x200000000 overlap another buffer"), "{error}");
}
