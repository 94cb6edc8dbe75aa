//! Every case of `shaders/` with each of its modules optimised by SPIRV-Tools: inlined, unrolled,
//! its variables made phis. All of them must meet the same expectations, at 1, 8 and 64 lanes.

use std::collections::BTreeMap;
use std::path::Path;

use anyhit_cases::case::{Case, Loaded};
use anyhit_cases::expect::{Difference, Observed};
use anyhit_cases::run::{RayMeasurements, run_ray};
use anyhit_judges::{Recipe, bytes, optimise, words};
use anyhit_scene::resolved::ShaderCode;

/// Modules that were optimised, and cases that were then met, with each recipe when this was
/// written; there are more now or the judge has lost some.
const LEAST_MODULES: usize = 280;
const LEAST_CASES: usize = 153;

#[test]
fn cases_are_met_with_optimised_modules() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let mut cases = Case::discover(&root.join("shaders/pass")).expect("the cases");
    cases.extend(Case::discover(&root.join("shaders/fail")).expect("the cases"));
    // Its trap names a line, which optimised code has lost.
    cases.retain(|case| !case.name(root).ends_with("control-flow/endless-loop"));
    let mut wrong = Vec::new();
    // Not for size: that drops members of payloads that other modules read.
    for recipe in [Recipe::Performance] {
        let mut modules = 0;
        let mut changed = 0;
        let mut met = 0;
        let mut skipped: BTreeMap<String, usize> = BTreeMap::new();
        for case in &cases {
            let name = case.name(root);
            let mut loaded = case.load().unwrap_or_else(|error| panic!("{}", error.render()));
            let mut judged = 0;
            for module in &mut loaded.scene.shaders {
                let ShaderCode::SpirV(code) = &mut module.code else {
                    *skipped.entry("a source, not a module".into()).or_default() += 1;
                    continue;
                };
                match optimise(&words(code), recipe) {
                    Ok(better) => {
                        judged += 1;
                        changed += usize::from(bytes(&better) != *code);
                        *code = bytes(&better);
                    }
                    Err(complaint) => {
                        let path = module.path.strip_prefix(root).unwrap_or(&module.path);
                        println!("{recipe:?}: skipped {}: {complaint}", path.display());
                        *skipped.entry(complaint).or_default() += 1;
                    }
                }
            }
            if judged == 0 {
                continue;
            }
            modules += judged;
            match check(loaded) {
                Ok(()) => met += 1,
                Err(problem) => wrong.push(format!("{recipe:?}: {name}: {problem}")),
            }
        }
        println!("{recipe:?}: {modules} modules optimised ({changed} changed), {met} cases met");
        for (complaint, count) in &skipped {
            println!("{recipe:?}: skipped {count}: {complaint}");
        }
        assert!(modules >= LEAST_MODULES && met + wrong.len() >= LEAST_CASES, "fewer than there were");
    }
    assert!(wrong.is_empty(), "{} cases:\n{}", wrong.len(), wrong.join("\n"));
}

/// As `Case::check` does, with the modules as they stand in the scene.
fn check(mut loaded: Loaded) -> Result<(), String> {
    let told = |error: anyhit::Error| error.render();
    loaded.assembled = anyhit_scene::assemble(&loaded.scene).map_err(told)?;
    let observed: Observed = loaded.widths().map_err(told)?;
    let mut differences = loaded.expectations.differences(&observed);
    for (at, expect) in loaded.rays.iter().enumerate() {
        let Some(expect) = expect else { continue };
        let found = run_ray(&loaded.scene, &loaded.assembled, at, &mut RayMeasurements::default());
        differences.extend(expect.differences(&found));
    }
    if differences.is_empty() { Ok(()) } else { Err(told(Difference::as_error(differences))) }
}

/// The cases themselves hold without the optimizer, so that a failure above is the optimizer's
/// doing or ours, not the case's: `tests/cases.rs` says so. Here only that there are any.
#[test]
fn there_are_cases() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let cases: Vec<Case> = Case::discover(&root.join("shaders")).expect("the cases");
    assert!(cases.len() > 100, "{}", cases.len());
}
