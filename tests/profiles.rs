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
    let (mut own, mut example) = (dev_profile(""), dev_profile("examples/shader-crate"));
    // The project's own lines are named, which is its own affair.
    let packages = example["package"].as_table_mut().expect("a table of packages");
    let dependencies = packages.remove("*").expect("settings for dependencies");
    let dependencies = dependencies.as_table().expect("settings");
    assert_eq!(dependencies.iter().collect::<Vec<_>>(), [(&"debug".to_owned(), &own["debug"])]);
    own.remove("debug");
    example.remove("debug");
    assert_eq!(own, example);
}
