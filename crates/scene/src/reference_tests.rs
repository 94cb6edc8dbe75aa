//! Checks `docs/scene.md` against the code: its examples are scenes, and every key and name is
//! documented.

use crate::file::SceneFile;
use crate::read::{Diagnostics, Named};
use anyhit_base::error::Error;

const REFERENCE: &str = include_str!("../../../docs/scene.md");

/// The mistakes of a text, its syntax included.
fn mistakes(text: &str) -> Result<(), Error> {
    let report = Diagnostics::default();
    SceneFile::parse("docs/scene.md", text, &report)?;
    report.finish()
}

#[test]
fn every_example_is_a_scene() {
    let mut count = 0;
    for block in REFERENCE.split("```toml\n").skip(1) {
        let (text, _) = block.split_once("```").expect("a fence that is not closed");
        let text =
            if text.starts_with("version") { text.to_string() } else { format!("version = 1\n{text}") };
        mistakes(&text).unwrap_or_else(|error| panic!("{text}\n{error:?}"));
        count += 1;
    }
    assert!(count >= 10, "{count} examples");
}

/// The error for an unknown key lists all keys of its table, which must be documented.
#[test]
fn every_key_is_described() {
    let mut tables = vec![
        "zzz = 1".to_string(),
        "[[instance]]\nzzz = 1".into(),
        "[[instance]]\nrotate = { zzz = 1 }".into(),
        "[[instance]]\nmotion = { zzz = 1 }".into(),
        "[[instance]]\nsrt = [{ zzz = 1 }, { }]".into(),
        "[[model]]\nzzz = 1".into(),
        "[[model]]\nfile = 'a.obj'\n[model.meshes.a]\nzzz = 1".into(),
        "[shaders.s]\nzzz = 1".into(),
        "[pipeline]\nzzz = 1".into(),
        "[pipeline]\nhit = [{ zzz = 1 }]".into(),
        "[pipeline]\nmiss = [{ zzz = 1 }]".into(),
        "[samplers.s]\nzzz = 1".into(),
        "push_constants = { zzz = 1 }".into(),
        "push_constants = { camera = { zzz = 1 } }".into(),
        "push_constants = { camera = { file = 'a.gltf', zzz = 1 } }".into(),
        "push_constants = { mesh = 'a', attribute = 'normal', zzz = 1 }".into(),
        "push_constants = { mesh = 'a', table = 'instances', zzz = 1 }".into(),
        "[[ray]]\nzzz = 1".into(),
        "[resources.r]\ntype = 'uniform_buffer_dynamic'\nbuffer = 'a'\nzzz = 1".into(),
        "[resources.r]\ntype = 'combined_image_sampler'\nimage = 'a'\nzzz = 1".into(),
        "[resources.r]\ntype = 'sampled_image'\nbinding = 0\nfile = { mesh = 'a', zzz = 1 }".into(),
        "[[ray]]\npixel = [0, 0]\nzzz = 1".into(),
    ];
    tables.extend(
        names::<crate::geometry::Kind>().map(|name| format!("[geometry.g]\ntype = '{name}'\nzzz = 1")),
    );
    tables.extend(
        names::<crate::descriptor_kind::DescriptorKind>()
            .map(|name| format!("[resources.r]\ntype = '{name}'\nzzz = 1")),
    );
    for text in tables {
        let error = mistakes(&format!("version = 1\n{text}")).unwrap_err();
        let all = [&error].into_iter().chain(error.others());
        let unknown = all.into_iter().find(|error| error.message() == "unknown key `zzz`");
        let notes = unknown.unwrap_or_else(|| panic!("{text}: {error:?}")).notes();
        let keys = notes[0].strip_prefix("valid keys: ").expect("a note that lists the keys");
        for key in keys.split(", ") {
            assert!(is_described(key), "`{key}`, a key of {text}");
        }
    }
}

#[test]
fn every_name_is_described() {
    use crate::descriptor_kind::DescriptorKind;
    use crate::resources::*;
    use anyhit_engine::accel::{EndCaps, Indexing};
    use anyhit_engine::machine::image::Dimension;
    use anyhit_engine::machine::sampler::{AddressMode, BorderColor, CompareOp, Filter, ReductionMode};
    let all = names::<crate::geometry::Kind>()
        .chain(names::<crate::instance_entry::InstanceFlag>())
        .chain(names::<crate::file::RayFlag>())
        .chain(names::<anyhit_engine::machine::format::Format>())
        .chain(names::<EndCaps>())
        .chain(names::<Indexing>())
        .chain(names::<DescriptorKind>())
        .chain(names::<crate::file::MissingDescriptors>())
        .chain(names::<Dimension>())
        .chain(names::<Filter>())
        .chain(names::<AddressMode>())
        .chain(names::<BorderColor>())
        .chain(names::<CompareOp>())
        .chain(names::<ReductionMode>())
        .chain(names::<Output>());
    for name in all {
        assert!(is_described(name), "`{name}`");
    }
}

fn names<T: Named>() -> impl Iterator<Item = &'static str> {
    T::NAMES.iter().map(|(name, _)| *name)
}

/// Whether the reference contains the word as a whole word.
fn is_described(word: &str) -> bool {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    REFERENCE.match_indices(word).any(|(at, _)| {
        let before = REFERENCE[..at].chars().next_back();
        let after = REFERENCE[at + word.len()..].chars().next();
        !before.is_some_and(part) && !after.is_some_and(part)
    })
}
