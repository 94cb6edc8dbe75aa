//! Whether `Module::validate` finds what SPIRV-Tools rejects, and nothing else: over every fixture
//! and some 100,000 mutants of them, half of which differ in what they declare.
//!
//! A module is compared where SPIRV-Tools accepts it, or rejects it for a class of rules that
//! `Module::validate` has. What only one of the two finds is in `verdicts/only_we_find.toml` and
//! `verdicts/only_they_find.toml`, with the sentence of the specification that decides. Modules
//! with a name that this version of SPIRV-Tools does not know are left out: it rejects them for
//! that.
//!
//! `ANYHIT_MUTANTS` is how many mutants of each fixture there are.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhit_engine::module;
use anyhit_judges::list::{self, Entry};
use anyhit_judges::mutate::{Original, Random};
use anyhit_judges::process::ToolProcess;
use anyhit_judges::validation::{Complaint, class_of, tools_version};
use anyhit_judges::verdict::normalised;
use anyhit_judges::{bytes, words};

#[path = "../../tests/support/files.rs"]
mod files;

/// Mutants of each fixture: some 100,000 of all.
const MUTANTS: usize = 110;

/// Messages that fall into one group.
#[derive(Default)]
struct Group {
    count: usize,
    /// The smallest module, its name and the whole message.
    example: Option<(usize, String)>,
}

/// What has been found.
#[derive(Default)]
struct Tally {
    accepted: usize,
    /// Modules that both reject, by class.
    agreed: BTreeMap<Complaint, usize>,
    /// Modules that SPIRV-Tools rejects for another rule, or fails on.
    other: usize,
    /// Modules that are refused before they are validated.
    unloaded: usize,
    /// The time of loading and of validating, all modules together.
    took: [Duration; 2],
    only_we: BTreeMap<String, Group>,
    only_they: BTreeMap<String, Group>,
}

impl Tally {
    fn judge(&mut self, tools: &mut ToolProcess, name: &str, words: &[u32]) {
        let bytes = bytes(words);
        let begin = Instant::now();
        let Ok(module) = module::load(&bytes) else {
            self.unloaded += 1;
            return;
        };
        let loaded = Instant::now();
        let findings = module.validate();
        self.took[0] += loaded - begin;
        self.took[1] += loaded.elapsed();
        let note = |groups: &mut BTreeMap<String, Group>, key: String, text: &str| {
            let group = groups.entry(key).or_default();
            group.count += 1;
            if group.example.as_ref().is_none_or(|(smallest, _)| words.len() < *smallest) {
                group.example = Some((words.len(), format!("{name}\n        {text}")));
            }
        };
        match tools.validate(words) {
            Some(Ok(())) => {
                self.accepted += 1;
                for finding in &findings {
                    note(&mut self.only_we, finding.message.clone(), &finding.to_string());
                }
            }
            Some(Err(message)) => {
                let Some(class) = class_of(&message) else {
                    self.other += 1;
                    return;
                };
                let ours = |one: &anyhit::ValidationFinding| match class {
                    Complaint::Declaration => !one.class.is_fault(),
                    Complaint::Layout => one.class.is_fault(),
                };
                match findings.iter().any(ours) {
                    true => *self.agreed.entry(class).or_default() += 1,
                    false => note(&mut self.only_they, normalised(&message), &message),
                }
            }
            None => self.other += 1,
        }
    }

    fn merge(&mut self, other: Self) {
        self.accepted += other.accepted;
        self.other += other.other;
        self.unloaded += other.unloaded;
        for (took, more) in self.took.iter_mut().zip(other.took) {
            *took += more;
        }
        for (class, count) in other.agreed {
            *self.agreed.entry(class).or_default() += count;
        }
        for (groups, more) in [(&mut self.only_we, other.only_we), (&mut self.only_they, other.only_they)] {
            for (key, group) in more {
                let own = groups.entry(key).or_default();
                own.count += group.count;
                own.example = match (own.example.take(), group.example) {
                    (Some(one), Some(two)) => Some(if two.0 < one.0 { two } else { one }),
                    (one, two) => one.or(two),
                };
            }
        }
    }
}

/// The groups that no entry of a list means, as text.
fn unlisted(title: &str, groups: &BTreeMap<String, Group>, list: &[Entry]) -> String {
    let mut used = vec![0; list.len()];
    let mut left: Vec<(&String, &Group)> = Vec::new();
    for (key, group) in groups {
        match list.iter().position(|entry| entry.means(key)) {
            Some(at) => used[at] += group.count,
            None => left.push((key, group)),
        }
    }
    for (entry, count) in list.iter().zip(used) {
        println!("{title}, listed: {count:6} {}", entry.message);
    }
    left.sort_by_key(|(key, group)| (std::cmp::Reverse(group.count), key.as_str()));
    left.iter()
        .map(|(key, group)| {
            let example = group.example.as_ref().map_or("", |(_, example)| example.as_str());
            format!("{title}: {:6} {key}\n        {example}\n", group.count)
        })
        .collect()
}

#[test]
fn validation_finds_what_the_validator_rejects() {
    println!("judge: {}", tools_version());
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let fixtures = root.join("spirv-fixtures");
    let mutants: usize =
        std::env::var("ANYHIT_MUTANTS").ok().and_then(|text| text.parse().ok()).unwrap_or(MUTANTS);
    let paths = files::with_extension(&fixtures, "spv");
    let next = AtomicUsize::new(0);
    let all = Mutex::new(Tally::default());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                let mut tally = Tally::default();
                let mut tools = ToolProcess::new(Path::new(env!("CARGO_BIN_EXE_spirv_tools")));
                while let Some(path) = paths.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let name = path.strip_prefix(&fixtures).expect("a fixture").display().to_string();
                    let module = words(&std::fs::read(path).expect("a readable fixture"));
                    tally.judge(&mut tools, &name, &module);
                    let Some(original) = Original::new(&module) else { continue };
                    for number in 0..mutants as u64 {
                        let random = &mut Random::of(&name, number);
                        let (mutant, story) = match number % 2 {
                            0 => original.declaration_mutant(random),
                            _ => original.mutant(random),
                        };
                        tally.judge(&mut tools, &format!("{name} #{number}: {story}"), &mutant);
                    }
                }
                all.lock().expect("no thread has panicked").merge(tally);
            });
        }
    });
    let tally = all.into_inner().expect("no thread has panicked");
    println!("accepted: {}, rejected by both: {:?}", tally.accepted, tally.agreed);
    println!("rejected for other rules: {}, refused when loaded: {}", tally.other, tally.unloaded);
    let [load, validate] = tally.took;
    println!("loading took {load:.1?}, validating {validate:.1?}");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("verdicts");
    let listed = |name: &str| list::read(&std::fs::read_to_string(folder.join(name)).expect("a list"));
    let only_we = unlisted("only we find", &tally.only_we, &listed("only_we_find.toml"));
    let only_they = unlisted("only they find", &tally.only_they, &listed("only_they_find.toml"));
    assert!(only_we.is_empty() && only_they.is_empty(), "\n{only_we}{only_they}");
    let compared = tally.accepted + tally.agreed.values().sum::<usize>();
    assert!(compared > paths.len() * mutants / 4, "only {compared} modules were compared");
}
