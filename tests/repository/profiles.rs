//! The example project is built into the same target folder as the crates (`.ci/run`): where their
//! profiles of debug builds differ, every dependency is built twice. What is a dependency has the
//! levels that the workspace gives it, and the crates of the workspace are named one by one.

use std::path::Path;

use crate::support::files::root;

/// The table `profile.dev` of a package.
fn dev_profile(package: &str) -> toml::Table {
    let path = root().join(package).join("Cargo.toml");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let manifest: toml::Table = text.parse().expect("a manifest in TOML");
    manifest["profile"]["dev"].as_table().expect("a profile").clone()
}

/// Names of the packages of this workspace.
fn own_packages() -> Vec<String> {
    let folders = std::fs::read_dir(root().join("crates")).expect("the folder of crates");
    let name = |folder: &Path| format!("anyhit-{}", folder.file_name().expect("a name").to_string_lossy());
    let mut names: Vec<String> = folders.map(|entry| name(&entry.expect("an entry").path())).collect();
    assert!(names.len() >= 10, "{names:?}");
    names.push("anyhit".to_owned());
    names
}

#[test]
fn the_example_project_is_built_as_the_crates_are() {
    let (own, example) = (dev_profile(""), dev_profile("examples/shader-crate"));
    for key in ["build-override", "codegen-units", "lto"] {
        assert_eq!(own[key], example[key], "{key}");
    }
    let packages = |profile: &toml::Table| profile["package"].as_table().expect("packages").clone();
    let (own_levels, mut example_levels) = (packages(&own), packages(&example));
    for name in own_packages() {
        let level = example_levels.remove(&name).unwrap_or_else(|| panic!("{name} has no level"));
        assert_eq!(level["opt-level"], own["opt-level"], "{name}");
    }
    // The project's own lines are named, which is its own affair.
    let all = example_levels["*"].as_table_mut().expect("settings for dependencies");
    assert_eq!(all.remove("debug"), Some(own["debug"].clone()));
    assert_eq!(own_levels, example_levels);
}

/// Where these crates are dependencies, a level for all dependencies would be theirs, too.
#[test]
fn other_projects_optimise_every_crate() {
    for (project, profile) in [("python", "release"), ("judges", "dev")] {
        let text = std::fs::read_to_string(root().join(project).join("Cargo.toml")).expect("a manifest");
        let manifest: toml::Table = text.parse().expect("a manifest in TOML");
        let levels = manifest["profile"][profile]["package"].as_table().expect("packages");
        for name in own_packages() {
            assert!(levels.contains_key(&name), "{project}: {name} has no level");
        }
    }
}

#[test]
fn profiles_are_few() {
    let text = std::fs::read_to_string(root().join("Cargo.toml")).expect("the manifest");
    let tables = text.lines().filter(|line| line.starts_with("[profile")).count();
    assert!(tables <= 20, "{tables} tables");
}
