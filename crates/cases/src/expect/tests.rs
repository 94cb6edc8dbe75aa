//! Tests of expectations: which hold, which fail, and with which messages.

use super::difference::SHOWN;
use super::*;
use anyhit_base::error::{ShaderFrame, Stage, Trap};
use anyhit_engine::accel::{Candidate, Committed, HitKind};
use anyhit_engine::geometry::{Intersection, Surface};
use anyhit_engine::machine::format::{Component, Format};
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::machine::{Buffer, TrapCode};
use anyhit_scene::image::PixelEncoding;
use anyhit_unit_test::value::Value as Found;

fn found(committed: Option<Committed>) -> RayFound {
    RayFound { committed, custom_index: 5, traced: None, payload: Found::nothing() }
}

fn expect(text: &str) -> Expectations {
    let document = Document::parse("scene.toml", text).expect("TOML");
    Expectations::read(&document).expect("expectations")
}

fn observed() -> Observed {
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let outputs = Buffer::new(&words(&[1.0f32, 2.0, 3.0, 4.0].map(f32::to_bits)));
    let format = Format::new(Component::Uint32, 1);
    let picture = Image::new(format, ImageShape::plane(2, 2), &words(&[10, 11, 12, 13])).expect("an image");
    let intersection = Intersection { t: 2.5, attributes: [0.25, 0.0], surface: Surface::Side };
    let candidate = Candidate { instance: 1, geometry: 0, primitive: 7, intersection, opaque: true };
    let hit = Committed { candidate, t: 2.5, hit_kind: HitKind::LINEAR_SWEPT_SPHERE };
    Observed {
        trap: None,
        buffers: vec![ObservedMemory::of_buffer("outputs".into(), Some([0, 1, 0]), outputs)],
        images: vec![ObservedMemory::of_image("picture".into(), [0, 2, 0], picture, PixelEncoding::STORED)],
        rays: vec![(Some("a".into()), Ok(found(Some(hit)))), (Some("b".into()), Ok(found(None)))],
        stats: Some(Stats { rays: 3, ..Stats::default() }),
        printed: "t = 2.5\n".into(),
        costs: None,
        stability: None,
    }
}

fn difference(text: &str) -> String {
    expect(text).check(&observed()).expect_err("this expectation must not hold").render()
}

fn holds(text: &str) {
    expect(text).check(&observed()).expect("this expectation must hold");
}

const BECAUSE: &str = "because = 'arithmetic'\n";

#[test]
fn numbers_are_found_by_offset_and_stride() {
    holds(&format!("[[expect.buffer]]\nname = 'outputs'\nf32 = [1, [2, 3], 'any']\n{BECAUSE}"));
    holds(&format!(
        "[[expect.buffer]]\nname = 'outputs'\noffset = 4\nstride = 8\nf32 = [[2], [4]]\n{BECAUSE}"
    ));
    holds(&format!("[[expect.image]]\nname = 'picture'\nat = [1, 0]\nu32 = [11, 12]\n{BECAUSE}"));
    let text = difference(&format!(
        "[[expect.buffer]]\nname = 'outputs'\nf32 = [1, 2.5]\nabsolute = 0.25\n{BECAUSE}"
    ));
    assert!(text.contains("`outputs` at byte 4: expected 2.5"), "{text}");
    assert!(text.contains("found 2.0") && text.contains("5e-1 away (allowed: 2.5e-1)"), "{text}");
    assert!(text.contains("scene.toml:3:11") && text.contains("because: arithmetic"), "{text}");
    let text =
        difference(&format!("[[expect.image]]\nname = 'picture'\nat = [1, 0]\nu32 = [11, 9]\n{BECAUSE}"));
    assert!(text.contains("`picture` at texel (0, 1) byte 0: expected 9, found 12"), "{text}");
    // The picture has two texels in each of two rows: the next is no texel of this row.
    for at in ["[2, 0]", "[0, 2]"] {
        let text = difference(&format!("[[expect.image]]\nname = 'picture'\nat = {at}\nu32 = 12\n"));
        assert!(
            text.contains("is outside `picture`, which has 2 x 2") && text.contains("scene.toml:3:6"),
            "{text}"
        );
    }
    let text = difference("[[expect.buffer]]\nname = 'outputs'\nat = [0, 0]\nu32 = 12\n");
    assert!(text.contains("`at` selects a texel of an image"), "{text}");
}

#[test]
fn what_is_not_there_is_a_difference() {
    let text =
        difference(&format!("[[expect.buffer]]\nname = 'outputs'\noffset = 12\nf32 = [4, 5]\n{BECAUSE}"));
    assert!(text.contains("byte 16 is past the end of `outputs`, which has 16"), "{text}");
    let text = difference(&format!("[[expect.buffer]]\nname = 'output'\nf32 = 1\n{BECAUSE}"));
    assert!(text.contains("the scene has no buffer `output`"), "{text}");
}

#[test]
fn of_many_differences_some_are_shown_and_all_counted() {
    let text =
        difference(&format!("[[expect.buffer]]\nname = 'outputs'\nu8 = [{}]\n{BECAUSE}", "9, ".repeat(16)));
    assert_eq!(text.matches("expected 9").count(), SHOWN);
    assert!(text.contains("10 more differences in this table"), "{text}");
}

#[test]
fn hits_and_misses_of_rays() {
    let ray = |rest: &str| format!("[[expect.ray]]\n{rest}\n{BECAUSE}");
    holds(&ray("name = 'a'\ninstance = 1\nprimitive = 7\nkind = 0x81\nt = 2.5\nattributes = [0.25]"));
    holds(&ray("name = 'b'\nmiss = true"));
    assert!(difference(&ray("name = 'a'\nprimitive = 8")).contains("primitive: expected 8, found 7"));
    assert!(difference(&ray("name = 'a'\nt = 2.25")).contains("expected 2.25"));
    assert!(
        difference(&ray("name = 'a'\nmiss = true"))
            .contains("expected a miss, but the ray hits instance 1 (custom index 5)")
    );
    assert!(difference(&ray("name = 'b'\nt = 1")).contains("expected a hit, but the ray misses"));
    assert!(difference(&ray("name = 'c'\nt = 1")).contains("the scene has no ray `c`"));
}

#[test]
fn traps_and_counts() {
    let trap = format!("[expect.trap]\ncode = 'out_of_fuel'\nline = 3\nlaunch_id = [1, 0, 0]\n{BECAUSE}");
    assert!(difference(&trap).contains("no trap; expected: the invocation ran out of fuel"));
    let with = |code: TrapCode, line: u32, launch_id: [u32; 3]| {
        let frame = ShaderFrame {
            shader: 0,
            stage: Stage::RayGeneration,
            entry_point: "main".into(),
            file: Some("a.rgen".into()),
            line: Some(line),
            column: None,
            word: None,
        };
        let error = Error::trapped(Trap { launch_id, stack: vec![frame], ..Trap::new(code) });
        let observed = Observed { trap: Some(error), ..observed() };
        expect(&trap).check(&observed).map_err(|error| error.render())
    };
    assert_eq!(with(TrapCode::OutOfFuel, 3, [1, 0, 0]), Ok(()));
    assert!(with(TrapCode::Unreachable, 3, [1, 0, 0]).unwrap_err().contains("different trap"));
    assert!(with(TrapCode::OutOfFuel, 4, [1, 0, 0]).unwrap_err().contains("trapped at a different line"));
    assert!(with(TrapCode::OutOfFuel, 3, [2, 0, 0]).unwrap_err().contains("a different invocation"));
    assert!(difference(&format!("[expect.stats]\nrays = 4\n{BECAUSE}")).contains("expected 4, found 3"));
    let error = Error::trapped(Trap::new(TrapCode::Unreachable));
    let observed = Observed { trap: Some(error), ..observed() };
    assert!(expect("").check(&observed).is_err());
}

#[test]
fn a_known_failure_fails_when_it_passes() {
    let text = |value| {
        format!(
            "[expect]\nknown_failure = 'a gap'\n[[expect.buffer]]\nname = 'outputs'\nf32 = {value}\n{BECAUSE}"
        )
    };
    holds(&text(9));
    assert!(difference(&text(1)).contains("this known failure passes: remove `known_failure`"));
}

#[test]
fn mistakes_of_expectations() {
    let mistake = |text: &str| {
        let document = Document::parse("scene.toml", text).expect("TOML");
        Expectations::read(&document).expect_err("a mistake").render()
    };
    assert!(
        mistake("[[expect.buffer]]\nname = 'a'\nbecause = 'x'\n").contains("expected numbers of one type")
    );
    assert!(
        mistake("[expect.trap]\ncode = 'out_of_fule'\nbecause = 'x'\n")
            .contains("did you mean `out_of_fuel`?")
    );
    assert!(
        mistake("[[expect.buffer]]\nname = 'a'\nf32 = 1\nulp = 1\nabsolute = 1\nbecause = 'x'\n")
            .contains("one of `ulp`, `absolute` and `relative`")
    );
}

/// What `--bless` would write.
fn fixes(text: &str) -> Vec<(String, String)> {
    let differences = expect(text).differences(&observed());
    let fixes = differences.into_iter().filter_map(|difference| difference.fix);
    fixes
        .map(|fix| match fix {
            Fix::Text(span, new) => (text[span.range].to_owned(), new),
            Fix::File(path, _) => (path.display().to_string(), String::new()),
        })
        .collect()
}

#[test]
fn recorded_values_are_renewed_and_derived_ones_are_not() {
    let pair = |old: &str, new: &str| (old.to_owned(), new.to_owned());
    let text = "[[expect.buffer]]\nname = 'outputs'\nf32 = [1, 9e9, 3]\n";
    assert_eq!(fixes(text), [pair("9e9", "2.0")]);
    assert_eq!(fixes(&format!("{text}{BECAUSE}")), []);
    assert_eq!(fixes("[expect.stats]\nrays = 4"), [pair("4", "3")]);
    assert_eq!(fixes("[expect]\nstdout = 'x'"), [pair("'x'", "\"t = 2.5\"")]);
    assert_eq!(
        fixes("[[expect.ray]]\nname = 'a'\nkind = 0x80\nt = 2\nattributes = ['any', 1]"),
        [pair("0x80", "0x81"), pair("2", "2.5"), pair("1", "0.0")]
    );
    assert_eq!(
        fixes("[[expect.ray]]\nname = 'a'\nmiss = true"),
        [pair("miss = true", "instance = 1\ngeometry = 0\nprimitive = 7\nt = 2.5")]
    );
    // What turns a hit into a miss cannot be written in the place of one value.
    assert_eq!(fixes("[[expect.ray]]\nname = 'b'\nt = 1"), []);
}

#[test]
fn printed_text_is_compared_by_lines() {
    holds("[expect]\nstdout = 't = 2.5'");
    let text = difference("[expect.stdout]\ntext = \"a\\nt = 2.5\\n\"\nbecause = 'x'");
    assert!(text.contains("- a\n") && text.contains("because: x"), "{text}");
}

#[test]
fn tables_without_a_reason_are_listed() {
    assert!(
        expect(&format!("[[expect.buffer]]\nname = 'a'\nf32 = 1\n{BECAUSE}")).without_reason().is_empty()
    );
    let all = "[[expect.buffer]]\nname = 'a'\nf32 = 1\n[expect.trap]\ncode = 'unreachable'\n[expect.stats]\nrays = 1";
    assert_eq!(expect(all).without_reason().len(), 3);
}
