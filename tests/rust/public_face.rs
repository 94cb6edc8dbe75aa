//! The public face of the crate: which names it has, that each is used, and what all types promise.

use std::collections::BTreeSet;
use std::fmt::Debug;
use std::fs;
use std::path::Path;

use crate::support::files::{self, root};

/// `tests/public_names.txt` is what rustdoc shows (`.ci/public-names` compares it); the names at
/// the root are what `src/lib.rs` exports.
#[test]
fn the_list_of_names_is_what_the_root_exports() {
    let exported = exported();
    let at_root: Vec<_> = items().into_iter().filter(|(_, name)| !name.contains("::")).collect();
    assert!((60..100).contains(&at_root.len()), "{} names at the root", at_root.len());
    let listed: BTreeSet<String> =
        at_root.into_iter().filter(|(kind, _)| kind != "macro").map(|(_, name)| name).collect();
    assert_eq!(listed, exported, "BLESS=1 .ci/public-names after `cargo doc --no-deps --all-features`");
}

/// A name that neither an example, nor a page, nor a test uses is not needed, or not tried.
#[test]
fn every_name_is_used_in_an_example_or_a_test() {
    let mut text = String::new();
    for folder in ["examples", "docs", "tests"] {
        collect(&root().join(folder), &mut text);
    }
    text += &fs::read_to_string(root().join("README.md")).expect("the README");
    // Examples in the documentation are run, too.
    let mut sources = String::new();
    collect(&root().join("src"), &mut sources);
    collect(&root().join("crates"), &mut sources);
    for line in sources.lines().filter(|line| line.trim_start().starts_with("//")) {
        text += line;
        text.push('\n');
    }
    let words: BTreeSet<&str> =
        text.split(|letter: char| !letter.is_alphanumeric() && letter != '_').collect();
    let unused: Vec<_> = items().into_iter().filter(|(_, name)| !words.contains(last(name))).collect();
    assert!(unused.is_empty(), "{unused:?}");
}

/// Tests run on threads, and print what they hold.
#[test]
fn every_type_is_shown_and_crosses_threads() {
    fn holds<T: Debug + Send + Sync>(names: &mut BTreeSet<&'static str>) {
        let name = std::any::type_name::<T>();
        let name = name.split('<').next().unwrap_or(name);
        names.insert(name.rsplit("::").next().unwrap_or(name));
    }
    let mut held = BTreeSet::new();
    macro_rules! all {
        ($($name:ident)*) => { $(holds::<anyhit::$name>(&mut held);)* };
    }
    all! {
        AddressMode Band BorderColor Buffer CallableCall Case CompareOp CompileOptions CompilerFlags Component
        ComputeOutcome ComputeTest DebugInfoLevel Descriptor DescriptorElement DeviceBuffers DeviceProfile
        Dimension EndCaps EntryPoint Error ErrorKind ExecuteCall Exit ExplainRequest Filter Format
        GeometryData GeometryFlags Hit HitKind HitRecord Image ImageShape Indexing InputLimit InputLimits
        Instance InstanceFlags Language LaunchLimits Launched LoadedScene Module Motion NestedScalars Optimize Pipeline
        PipelineBuilder PipelineFlags Place Precision PrintedLine Program Ray RayFlags RayOperands ReportedHit Sampler ScalarValue
        Sbt SbtRecord Scene SceneOutcome ShaderFrame ShaderOutcome ShaderTest SmokeOptions SmokeReport
        Source Srt Stage Stats StreamedImage StructData Texels TraceCall TraceRay Traced Trap TrapCode
        TrapOperands TypedBytes ValidationClass ValidationFinding Value Warning WarningReports
    }
    let types = items()
        .into_iter()
        .filter(|(kind, name)| matches!(kind.as_str(), "struct" | "enum") && !name.contains("::"));
    let missing: Vec<String> =
        types.map(|(_, name)| name).filter(|name| !held.contains(name.as_str())).collect();
    assert!(missing.is_empty(), "add them to this test: {missing:?}");
}

/// What a method returns is lost where nobody looks at it: a builder's change, a comparison.
#[test]
fn every_method_with_a_value_is_marked_as_must_use() {
    let text = fs::read_to_string(root().join("tests/public_names.txt")).expect("the list of names");
    let methods: BTreeSet<&str> = text
        .lines()
        .filter_map(|line| line.trim().strip_suffix("()"))
        .filter(|name| !name.contains(' '))
        .collect();
    let (mut unmarked, mut seen) = (Vec::new(), 0);
    for path in files::sources() {
        let code = fs::read_to_string(&path).expect("a readable file");
        let (mut of, mut is_marked) = (None, false);
        let mut lines = code.lines();
        while let Some(line) = lines.next() {
            if let Some(rest) = line.strip_prefix("impl ").or_else(|| line.strip_prefix("impl<'_> ")) {
                of = rest.split(['<', ' ']).next().filter(|_| !rest.contains(" for "));
            }
            let start = line.trim_start();
            let name = start.strip_prefix("pub fn ").or_else(|| start.strip_prefix("pub const fn "));
            let name = name.and_then(|rest| rest.split(['(', '<']).next());
            if let (Some(of), Some(name)) = (of, name) {
                let mut signature = line.to_owned();
                while !signature.contains('{') {
                    signature += lines.next().unwrap_or("{");
                }
                let returned = signature.split('{').next().and_then(|text| text.split("-> ").last());
                let silent = returned.is_some_and(|returned| {
                    let returned = returned.trim();
                    signature.contains("-> ")
                        && !returned.starts_with("Result")
                        && !returned.starts_with("&mut")
                });
                let name = format!("{of}::{name}");
                if methods.contains(name.as_str()) {
                    seen += 1;
                    if silent && !is_marked {
                        unmarked.push(name);
                    }
                }
            }
            is_marked = is_marked && start.starts_with(['#', '/']) || start.starts_with("#[must_use");
        }
    }
    assert!(seen > 200, "{seen} methods");
    assert!(unmarked.is_empty(), "write #[must_use] above {unmarked:?}");
}

/// The items of the list, without their members.
fn items() -> Vec<(String, String)> {
    let text = fs::read_to_string(root().join("tests/public_names.txt")).expect("the list of names");
    let items = text.lines().filter(|line| !line.starts_with(' ')).filter_map(|line| line.split_once(' '));
    items.map(|(kind, name)| (kind.to_owned(), name.to_owned())).collect()
}

/// The names in the `pub use` of the crate's root.
fn exported() -> BTreeSet<String> {
    let text = fs::read_to_string(root().join("src/lib.rs")).expect("the root");
    let uses = text.split("\npub use ").skip(1).filter_map(|rest| rest.split(';').next());
    let names = uses.flat_map(|path| {
        let names = path.rsplit_once("::").map_or(path, |(_, name)| name);
        let braced = path.split_once('{').map(|(_, names)| names);
        braced.unwrap_or(names).split([',', '}']).map(str::trim).map(str::to_owned).collect::<Vec<_>>()
    });
    // Macros and modules are listed by themselves.
    names.filter(|name| name.starts_with(char::is_uppercase)).collect()
}

fn last(name: &str) -> &str {
    name.rsplit("::").next().unwrap_or(name)
}

/// The text of all Rust and Markdown files beneath a folder, but for this one.
fn collect(folder: &Path, text: &mut String) {
    for path in ["rs", "md"].iter().flat_map(|extension| files::with_extension(folder, extension)) {
        if !path.ends_with("public_face.rs") {
            *text += &fs::read_to_string(&path).unwrap_or_default();
        }
    }
}
