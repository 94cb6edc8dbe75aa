//! The compiled shaders are those of the sources, and nobody has edited them.

use std::path::Path;

use anyhit::compile::fixtures;

#[test]
fn every_source_has_its_fixture_and_every_fixture_its_source() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let problems = fixtures::check(root).unwrap();
    assert!(
        problems.is_empty(),
        "out of step:\n  {}\nRun `cargo run --features glsl -- compile --fixtures` \
         (with slangc on the PATH where a Slang source has changed).",
        problems.join("\n  ")
    );
}
