//! The example project is built into the same target folder as the crate (`.ci/run`): where their
//! profiles of debug builds differ, every dependency is built twice.

use std::path::Path;

/// The table `profile.dev` of a package.
fn dev_profile(package: &str) -> toml::Table {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(package).join("Cargo.toml");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let manifest: toml::Table = text.parse().expect("a manifest in TOML");
    manifest["profile"]["dev"].as_table().expect("a profile").clone()
}

#[test]
fn the_example_project_is_built_as_the_crate_is() {
    let (own, mut example) = (dev_profile(""), dev_profile("examples/shader-crate"));
    // What `build.rs` uses is built as the crate's own tests use it.
    for key in ["opt-level", "debug"] {
        let for_build = example["build-override"].as_table_mut().and_then(|table| table.remove(key));
        assert_eq!(for_build.as_ref(), own.get(key), "{key}");
    }
    // The crate is a dependency there, and no less its own.
    let packages = example["package"].as_table_mut().expect("a table of packages");
    let anyhit = packages.remove("anyhit").expect("settings for the crate");
    for (key, value) in anyhit.as_table().expect("settings") {
        assert_eq!(Some(value), own.get(key), "{key}");
    }
    assert_eq!(own, example);
}
