//! SARIF of findings and failed tests, judged by the schema of SARIF 2.1.0 and by another reader.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhit_cases::many_seeds::ManySeeds;
use anyhit_cases::suite::{Suite, SuiteOptions, suite_sarif};
use anyhit_sanitize::Levels;
use serde_json::Value;
use serde_sarif::sarif::Sarif;

/// The schema that OASIS publishes, from the package of `serde-sarif`.
fn schema() -> jsonschema::Validator {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version=1", "--manifest-path"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml"))
        .output()
        .expect("cargo starts");
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    let package = packages.iter().find(|one| one["name"] == "serde-sarif").expect("the package");
    let manifest = Path::new(package["manifest_path"].as_str().expect("a path"));
    let text = std::fs::read_to_string(manifest.with_file_name("src/schema.json")).expect("the schema");
    let schema: Value = serde_json::from_str(&text).expect("JSON");
    assert!(schema["title"].as_str().is_some_and(|title| title.contains("Version 2.1.0")), "{}", schema["title"]);
    jsonschema::draft7::new(&schema).expect("a schema of draft 7")
}

#[test]
fn logs_have_the_schema_of_sarif() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let folders = ["shaders/sanitize", "shaders/fail", "shaders/many-seeds", "tests/commands/test-command"];
    let folders: Vec<PathBuf> = folders.iter().map(|folder| root.join(folder)).collect();
    let suite = Suite::find(&folders).expect("tests");
    let options = SuiteOptions {
        sanitize: Some(Levels::default()),
        many_seeds: Some(ManySeeds { seeds: 0..2, ..ManySeeds::default() }),
        no_explanation: true,
        pictures: std::env::temp_dir().join("anyhit-judges-sarif"),
        ..SuiteOptions::default()
    };
    let result = suite.run(&options, &mut |_, _| Ok(())).expect("it runs");
    let text = suite_sarif(&result);
    let log: Value = serde_json::from_str(&text).expect("JSON");
    let schema = schema();
    let wrong: Vec<String> =
        schema.iter_errors(&log).map(|error| format!("{}: {error}", error.instance_path())).collect();
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
    // The schema rejects an invalid log.
    let mut broken = log.clone();
    broken["runs"][0]["results"][0]["level"] = "fatal".into();
    assert!(!schema.is_valid(&broken));
    let read: Sarif = serde_json::from_str(&text).expect("another reader");
    let results = read.runs[0].results.as_ref().expect("results");
    println!("{} results of {} tests", results.len(), suite.tests().len());
    assert!(results.len() >= 150, "only {} results", results.len());
    for result in results {
        let at = result.locations.as_ref().and_then(|all| all.first()).expect("a place");
        let uri = at.physical_location.as_ref().and_then(|place| place.artifact_location.as_ref());
        assert!(uri.is_some_and(|artifact| artifact.uri.is_some()), "{result:?}");
        assert!(result.rule_index.is_some() && result.partial_fingerprints.is_some(), "{result:?}");
    }
}
