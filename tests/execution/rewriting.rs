//! Metamorphic tests: every case of `shaders/` with its modules rewritten at random.
//!
//! [`rewrite`] has the changes; none may be seen in any buffer, image, payload, printed line or
//! trap, at 1, 64 and 128 lanes. `ANYHIT_REWRITES=100 cargo test --test main rewriting::` draws so
//! many rewritings of each case, `ANYHIT_SEED` says where to begin. What differs is made short,
//! printed, and saved in `target/tmp/rewriting`. With `ANYHIT_REWRITES_TO=FOLDER` every rewritten
//! module is saved.
#![allow(clippy::print_stdout, reason = "what was done is told")]

mod rewrite;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhit::Error;
use anyhit_base::error::Place;
use anyhit_cases::case::{Case, Loaded};
use anyhit_cases::expect::Observed;
use anyhit_cases::run::{RayMeasurements, run, run_ray};
use anyhit_engine::module::Opcode as Op;
use anyhit_engine::pipeline::BatchWidth;
use anyhit_scene::resolved::ShaderCode;
use rayon::prelude::*;

use crate::support::files::{self, root};
use rewrite::{Family, Module, Step, plan, rewritten};

/// Steps that are drawn for each module; `ANYHIT_STEPS` draws more or fewer.
const STEPS: usize = 24;

/// Cases that see what rewriting changes, with what that is.
const EXCEPTIONS: [(&str, &str); 1] = [(
    "shaders/fail/control-flow/endless-loop",
    "how many instructions a turn has decides where the fuel runs out, and so at which line",
)];

fn number(variable: &str, default: u64) -> u64 {
    let text = std::env::var(variable).ok();
    text.map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{variable} is a number")))
}

fn cases() -> Vec<Case> {
    let mut cases = Case::discover(&root().join("shaders/pass")).expect("the cases");
    cases.extend(Case::discover(&root().join("shaders/fail")).expect("the cases"));
    let all = cases.len();
    cases.retain(|case| !EXCEPTIONS.iter().any(|(name, _)| case.name(root()) == *name));
    assert_eq!(cases.len(), all - EXCEPTIONS.len(), "an exception that is no case");
    // The demo, at a size that a debug build draws at once.
    for scene in ["swept-spheres.toml", "swept-spheres-slang.toml"] {
        let demo = Case::of(&root().join("scenes").join(scene)).expect("a scene");
        cases.extend(demo.into_iter().map(|case| Case { size: Some([8, 6]), ..case }));
    }
    cases
}

#[test]
fn cases_are_met_with_rewritten_modules() {
    let (first, count) = (number("ANYHIT_SEED", 1), number("ANYHIT_REWRITES", 2));
    let counts: Mutex<BTreeMap<Family, usize>> = Mutex::default();
    let cases = cases();
    let judged = |case: &Case| {
        let name = case.name(root());
        let mut wrong = Vec::new();
        let subject = Subject::of(case);
        for seed in first..first + count {
            let plans = subject.plans(seed);
            match subject.differs(&plans) {
                Ok(done) => {
                    let mut counts = counts.lock().expect("no panics");
                    done.iter().for_each(|step| *counts.entry(step.family).or_default() += 1);
                }
                Err(difference) => wrong.push(subject.report(&name, seed, plans, &difference)),
            }
        }
        wrong
    };
    let wrong: Vec<String> = cases.par_iter().flat_map_iter(judged).collect();
    let counts = counts.into_inner().expect("no panics");
    println!("{} cases, {count} rewritings of each: {counts:?}", cases.len());
    assert!(cases.len() > 100, "{} cases", cases.len());
    assert!(wrong.is_empty(), "{} rewritings differ:\n{}", wrong.len(), wrong.join("\n"));
}

/// A case, with what it leaves behind as it stands.
struct Subject {
    loaded: Loaded,
    expected: Vec<String>,
}

impl Subject {
    fn of(case: &Case) -> Self {
        let loaded = case.load().unwrap_or_else(|error| panic!("{}", error.render()));
        let observed = run(&loaded.scene, &loaded.assembled, BatchWidth::default());
        let expected = seen(&loaded, &observed);
        Self { loaded, expected }
    }

    /// Steps for each module; a source is no module and has none.
    fn plans(&self, seed: u64) -> Vec<Vec<Step>> {
        let steps = number("ANYHIT_STEPS", STEPS as u64) as usize;
        let seeds = (0..self.loaded.scene.shaders.len() as u64).map(|at| seed << 16 | at);
        seeds.map(|seed| plan(seed, steps)).collect()
    }

    fn rewrite(&self, plans: &[Vec<Step>]) -> Result<(Loaded, Vec<Step>), String> {
        let mut loaded = self.loaded.clone();
        // Those that data was compared with are the modules from before.
        loaded.scene.loaded.clear();
        let mut all = Vec::new();
        for (shader, steps) in loaded.scene.shaders.iter_mut().zip(plans) {
            if let ShaderCode::SpirV(code) = &mut shader.code {
                let (bytes, done) = rewritten(code, steps)?;
                *code = bytes;
                all.extend(done);
            }
        }
        Ok((loaded, all))
    }

    /// The steps that were done, where nothing differs; else what does.
    fn differs(&self, plans: &[Vec<Step>]) -> Result<Vec<Step>, String> {
        let tried = catch_unwind(AssertUnwindSafe(|| {
            let (mut loaded, done) = self.rewrite(plans)?;
            save_all(&loaded);
            let told = |error: Error| error.render();
            loaded.assembled = anyhit_scene::assemble(&loaded.scene).map_err(told)?;
            let observed = loaded.widths().map_err(told)?;
            loaded.check_launch(&observed).map_err(told)?;
            let found = seen(&loaded, &observed);
            if let Some((one, other)) = self.expected.iter().zip(&found).find(|(one, other)| one != other) {
                return Err(format!("expected {}\nfound    {}", shortened(one), shortened(other)));
            }
            let differences = loaded.expectations.differences(&observed);
            match differences.first() {
                Some(difference) => Err(difference.error.render()),
                None => Ok(done),
            }
        }));
        tried.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            Err(format!("panic: {}", text.unwrap_or_default()))
        })
    }

    /// The fewest steps that still differ, told and saved.
    fn report(&self, name: &str, seed: u64, mut plans: Vec<Vec<Step>>, difference: &str) -> String {
        let mut difference = difference.to_owned();
        for module in 0..plans.len() {
            let mut size = plans[module].len().max(1);
            while size > 0 {
                let mut at = 0;
                while at < plans[module].len() {
                    let mut fewer = plans.clone();
                    fewer[module].drain(at..(at + size).min(plans[module].len()));
                    match self.differs(&fewer) {
                        Err(other) => (plans, difference) = (fewer, other),
                        Ok(_) => at += size,
                    }
                }
                size /= 2;
            }
        }
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rewriting").join(name.replace('/', "_"));
        let steps: Vec<String> = plans.iter().flatten().map(|step| format!("{:?}", step.family)).collect();
        if let Ok((loaded, _)) = self.rewrite(&plans) {
            for (shader, steps) in
                loaded.scene.shaders.iter().zip(&plans).filter(|(_, steps)| !steps.is_empty())
            {
                let _ = steps;
                save(&folder, &shader.path, &shader.code);
            }
        }
        let folder = folder.display();
        format!("{name}, seed {seed}, {}: {difference}\nsaved in {folder}\n", steps.join(" "))
    }
}

fn shortened(text: &str) -> String {
    let end = text.char_indices().nth(600).map_or(text.len(), |(at, _)| at);
    text[..end].to_owned()
}

/// Everything that a run leaves behind, in words: memory, rays, printed lines, the trap and its
/// place.
fn seen(loaded: &Loaded, observed: &Observed) -> Vec<String> {
    let memory = observed.buffers.iter().chain(&observed.images);
    let mut all: Vec<String> = memory
        .map(|bytes| format!("{} {:?}: {:?}", bytes.name, bytes.binding, words(bytes.bytes())))
        .collect();
    all.insert(0, observed.trap.as_ref().map_or_else(|| "no trap".into(), trap));
    let rays = (0..loaded.scene.rays.len())
        .map(|at| run_ray(&loaded.scene, &loaded.assembled, at, &mut RayMeasurements::default()));
    let rays: Vec<Observed> = rays.collect();
    for (name, found) in observed.rays.iter().chain(rays.iter().flat_map(|ray| &ray.rays)) {
        all.push(match found {
            Ok(found) => format!("ray {name:?}: {found:?}"),
            Err(error) => format!("ray {name:?}: {}", trap(error)),
        });
    }
    all.push(observed.printed.clone());
    all
}

/// Bytes as numbers of 32 bits.
fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks(4).map(|word| word.iter().rev().fold(0, |all, byte| all << 8 | u32::from(*byte))).collect()
}

/// A trap's message, the invocation, and the source line.
fn trap(error: &Error) -> String {
    let line = error.places().find_map(|(place, _)| match place {
        Place::Line { file, line, column } => Some(format!("{file}:{line}:{column}")),
        Place::Text { file, text, span } => {
            Some(format!("{file}:{}", text[..span.start].matches('\n').count() + 1))
        }
        _ => None,
    });
    let who = error.notes().iter().find(|note| note.contains(" id ("));
    format!("{} at {line:?}, {who:?}", error.message())
}

fn save_all(loaded: &Loaded) {
    if let Some(folder) = std::env::var_os("ANYHIT_REWRITES_TO") {
        for shader in &loaded.scene.shaders {
            save(Path::new(&folder), &shader.path, &shader.code);
        }
    }
}

fn save(folder: &Path, path: &Path, code: &ShaderCode) {
    if let ShaderCode::SpirV(code) = code {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let path = path.strip_prefix(root().join("spirv-fixtures")).unwrap_or(&path);
        std::fs::create_dir_all(folder).expect("a folder that can be made");
        std::fs::write(folder.join(path.display().to_string().replace('/', "_")), code).expect("a file");
    }
}

/// A module that does something else is told from one that does the same.
#[test]
fn what_is_not_the_same_is_told() {
    let cases = cases();
    let case = cases.iter().find(|case| case.name(root()).ends_with("pass/arithmetic/basics"));
    let mut subject = Subject::of(case.expect("the case of arithmetic"));
    let none = vec![Vec::new(); subject.loaded.scene.shaders.len()];
    subject.differs(&none).expect("the module as it stands");
    let mut changed = 0;
    for shader in &mut subject.loaded.scene.shaders {
        if let ShaderCode::SpirV(code) = &mut shader.code {
            let mut module = Module::parse(code).expect("a module");
            for inst in module.all_mut().filter(|inst| inst.op == Op::FAdd) {
                inst.op = Op::FSub;
                changed += 1;
            }
            *code = module.bytes();
        }
    }
    assert!(changed > 0, "no sums in this case");
    let difference = subject.differs(&none).expect_err("sums are differences now");
    assert!(difference.contains("expected"), "{difference}");
}

fn fixtures() -> Vec<PathBuf> {
    files::with_extension(&root().join("spirv-fixtures"), "spv")
}

/// Reading and writing alone change nothing but where lines are repeated.
#[test]
fn modules_are_read_and_written() {
    for path in fixtures() {
        let bytes = std::fs::read(&path).expect("a fixture");
        let module = Module::parse(&bytes).unwrap_or_else(|problem| panic!("{}: {problem}", path.display()));
        let again = Module::parse(&module.bytes()).expect("what was written");
        assert_eq!(module.head, again.head, "{}", path.display());
        assert_eq!(module.globals, again.globals, "{}", path.display());
        let insts = |module: &Module| -> Vec<_> {
            module.functions.iter().flat_map(|function| function.insts().cloned()).collect()
        };
        assert_eq!(insts(&module), insts(&again), "{}", path.display());
    }
}

/// So often at least each kind of change finds a place in all fixtures, at four plans for each.
const LEAST: usize = 100;

#[test]
fn every_kind_of_change_is_made() {
    let paths = fixtures();
    let counted = paths.par_iter().map(|path| {
        let bytes = std::fs::read(path).expect("a fixture");
        let mut counts: BTreeMap<Family, usize> = BTreeMap::new();
        for seed in 0..4 {
            let (_, done) = rewritten(&bytes, &plan(seed, STEPS)).expect("a module");
            done.iter().for_each(|step| *counts.entry(step.family).or_default() += 1);
        }
        counts
    });
    let counts = counted.reduce(BTreeMap::new, |mut sum, one| {
        one.into_iter().for_each(|(family, count)| *sum.entry(family).or_default() += count);
        sum
    });
    println!("{counts:?}");
    let rare: Vec<_> =
        Family::ALL.iter().filter(|family| counts.get(family).is_none_or(|count| *count < LEAST)).collect();
    assert!(rare.is_empty(), "{rare:?} of {counts:?}");
}
