//! Whether a module is valid: our word against that of SPIRV-Tools, over every fixture and some
//! 100,000 mutants of them.
//!
//! Where we say that a module breaks a rule, the validator must say so too, or the error cites
//! the rule and `verdicts/only_we_refuse.toml` has it. What we run although the validator rejects
//! it is in `verdicts/only_they_refuse.toml`. What the validator accepts never ends in a bug of
//! ours.
//!
//! `ANYHIT_MUTANTS` is how many mutants of each fixture there are.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use anyhit_judges::list::{self, Entry};
use anyhit_judges::mutate::{Original, Random};
use anyhit_judges::process::ToolProcess;
use anyhit_judges::recorded::{Recorded, digest};
use anyhit_judges::verdict::{Ours, normalised, ours, run};
use anyhit_judges::words;

#[path = "../../tests/support/files.rs"]
mod files;

/// Mutants of each fixture: some 100,000 of all.
const MUTANTS: usize = 410;
/// One mutant of so many is run, of those that both take.
const RUN_EACH: usize = 8;
/// So many mutants of each fixture are recorded for the tests without a validator.
const RECORDED: usize = 16;

/// A line of the record: `v` is valid, `x` is not.
fn line(one: &Recorded) -> String {
    let letters: String = one.accepts.iter().map(|&accepts| if accepts { 'v' } else { 'x' }).collect();
    format!("{:016x} {letters} {}\n", one.digest, one.name)
}

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
    /// By ours (runs, unsupported, invalid) and theirs (accepts, rejects).
    table: [[usize; 2]; 3],
    only_we: BTreeMap<String, Group>,
    only_we_uncited: BTreeMap<String, Group>,
    only_they: BTreeMap<String, Group>,
    gaps: BTreeMap<String, Group>,
    bugs: BTreeMap<String, Group>,
    ran: usize,
    /// Modules that the validator fails on.
    undecided: usize,
    unread: Vec<String>,
    record: BTreeMap<String, String>,
}

impl Tally {
    /// Whether the validator accepts a module; `None` where it could not tell.
    fn judge(&mut self, tools: &mut ToolProcess, name: &str, module: &[u32], run_it: bool) -> Option<bool> {
        let we = ours(module);
        let Some(they) = tools.validate(module) else {
            self.undecided += 1;
            if let Ours::Panicked(text) = we {
                self.bugs.entry(text).or_default().count += 1;
            }
            return None;
        };
        let note = |groups: &mut BTreeMap<String, Group>, key: String, text: String| {
            let group = groups.entry(key).or_default();
            group.count += 1;
            let size = module.len();
            if group.example.as_ref().is_none_or(|(smallest, _)| size < *smallest) {
                group.example = Some((size, format!("{name}\n        {text}")));
            }
        };
        let row = match &we {
            Ours::Runs => 0,
            Ours::Unsupported(_) => 1,
            Ours::Invalid { .. } | Ours::Panicked(_) => 2,
        };
        let accepts = they.is_ok();
        self.table[row][usize::from(!accepts)] += 1;
        match (we, they) {
            (Ours::Panicked(text), _) => note(&mut self.bugs, normalised(&text), text),
            (Ours::Unsupported(text), Ok(())) => note(&mut self.gaps, normalised(&text), text),
            (Ours::Invalid { text, cited: false }, Ok(())) => {
                note(&mut self.only_we_uncited, normalised(&text), text);
            }
            (Ours::Invalid { text, cited: true }, Ok(())) => note(&mut self.only_we, normalised(&text), text),
            (Ours::Runs, Err(text)) => note(&mut self.only_they, normalised(&text), text),
            (Ours::Runs, Ok(())) if run_it => {
                self.ran += 1;
                if let Err(text) = run(module) {
                    note(&mut self.bugs, normalised(&text), text);
                }
            }
            _ => {}
        }
        Some(accepts)
    }

    fn merge(&mut self, other: Self) {
        for (row, more) in self.table.iter_mut().flatten().zip(other.table.into_iter().flatten()) {
            *row += more;
        }
        let pairs = [
            (&mut self.only_we, other.only_we),
            (&mut self.only_we_uncited, other.only_we_uncited),
            (&mut self.only_they, other.only_they),
            (&mut self.gaps, other.gaps),
            (&mut self.bugs, other.bugs),
        ];
        for (groups, more) in pairs {
            for (key, group) in more {
                let own = groups.entry(key).or_default();
                own.count += group.count;
                own.example = match (own.example.take(), group.example) {
                    (Some(one), Some(two)) => Some(if two.0 < one.0 { two } else { one }),
                    (one, two) => one.or(two),
                };
            }
        }
        self.ran += other.ran;
        self.undecided += other.undecided;
        self.unread.extend(other.unread);
        self.record.extend(other.record);
    }
}

/// The groups that no entry of a list means; says which entries meant none.
fn unlisted<'a>(
    groups: &'a BTreeMap<String, Group>,
    list: &[Entry],
    name: &str,
) -> Vec<(&'a String, &'a Group)> {
    let mut used = vec![0; list.len()];
    let mut left = Vec::new();
    for (key, group) in groups {
        match list.iter().position(|entry| entry.means(key)) {
            Some(at) => used[at] += group.count,
            None => left.push((key, group)),
        }
    }
    for (entry, count) in list.iter().zip(used) {
        println!("{name}: {count:6} {}", entry.message);
    }
    left
}

fn told<'a>(title: &str, groups: impl IntoIterator<Item = (&'a String, &'a Group)>) -> String {
    let mut all: Vec<_> = groups.into_iter().collect();
    all.sort_by_key(|(key, group)| (std::cmp::Reverse(group.count), key.as_str()));
    let mut text = String::new();
    for (key, group) in &all {
        let example = group.example.as_ref().map_or("", |(_, example)| example.as_str());
        text += &format!("{:6} {key}\n        {example}\n", group.count);
    }
    format!("{title}: {} groups\n{text}", all.len())
}

#[test]
fn invalid_is_a_verdict() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let fixtures = root.join("spirv-fixtures");
    let mutants: usize =
        std::env::var("ANYHIT_MUTANTS").ok().and_then(|text| text.parse().ok()).unwrap_or(MUTANTS);
    let paths = files::with_extension(&fixtures, "spv");
    let next = AtomicUsize::new(0);
    let all = Mutex::new(Tally::default());
    // Those of ours are counted; one of the judge's own is among the last.
    let panics = Arc::new(Mutex::new(Vec::new()));
    let keeper = panics.clone();
    std::panic::set_hook(Box::new(move |panic| {
        if let Ok(mut all) = keeper.lock() {
            all.push(panic.to_string());
        }
    }));
    let work = || {
        std::thread::scope(|scope| {
            for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
                scope.spawn(|| {
                    let mut tally = Tally::default();
                    let mut tools = ToolProcess::new(Path::new(env!("CARGO_BIN_EXE_spirv_tools")));
                    while let Some(path) = paths.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let name = path.strip_prefix(&fixtures).expect("a fixture").display().to_string();
                        let module = words(&std::fs::read(path).expect("a readable fixture"));
                        tally.judge(&mut tools, &name, &module, true);
                        let Some(original) = Original::new(&module) else {
                            tally.unread.push(name);
                            continue;
                        };
                        let mut first = Vec::new();
                        let mut accepts = Vec::new();
                        for number in 0..mutants {
                            let (mutant, story) = original.mutant(&mut Random::of(&name, number as u64));
                            let told = format!("{name} #{number}: {story}");
                            let accepted = tally.judge(&mut tools, &told, &mutant, number % RUN_EACH == 0);
                            if number < RECORDED {
                                first.push((mutant, story));
                                accepts.push(accepted == Some(true));
                            }
                        }
                        let recorded = Recorded { name: name.clone(), digest: digest(&first), accepts };
                        tally.record.insert(name, line(&recorded));
                    }
                    all.lock().expect("no thread has panicked").merge(tally);
                });
            }
        });
    };
    let worked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    let _ = std::panic::take_hook();
    assert!(worked.is_ok(), "a thread ended: {:?}", panics.lock().expect("nobody holds it"));
    let tally = all.into_inner().expect("no thread has panicked");
    println!("{:12} {:>9} {:>9}", "", "accepted", "rejected");
    for (name, [accepted, rejected]) in ["runs", "unsupported", "invalid"].iter().zip(tally.table) {
        println!("{name:12} {accepted:9} {rejected:9}");
    }
    println!("{} of those that both take were run", tally.ran);
    println!("{} modules that the validator fails on", tally.undecided);
    println!("not mutated: {:?}", tally.unread);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("verdicts");
    let listed = |name: &str| list::read(&std::fs::read_to_string(folder.join(name)).expect("a list"));
    let only_we = unlisted(&tally.only_we, &listed("only_we_refuse.toml"), "only we");
    let only_they = unlisted(&tally.only_they, &listed("only_they_refuse.toml"), "only they");
    println!("{}", told("valid, and not supported", &tally.gaps));
    let report = [
        told("bugs of ours", &tally.bugs),
        told("called invalid by us alone, without a rule", &tally.only_we_uncited),
        told(
            "called invalid by us alone, with a rule that only_we_refuse.toml lacks",
            only_we.iter().copied(),
        ),
        told(
            "run although the validator rejects it, and only_they_refuse.toml lacks it",
            only_they.iter().copied(),
        ),
    ];
    let record: String = tally.record.values().map(String::as_str).collect();
    let path = root.join("tests/modules/verdicts.txt");
    if mutants >= RECORDED && std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, &record).expect("a writable file");
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let clean = tally.bugs.is_empty()
        && tally.only_we_uncited.is_empty()
        && only_we.is_empty()
        && only_they.is_empty();
    assert!(clean, "{}", report.join("\n"));
    assert!(
        mutants < RECORDED || record == written,
        "tests/modules/verdicts.txt is out of date: BLESS=1 writes it"
    );
    let judged: usize = tally.table.iter().flatten().sum();
    assert!(judged > paths.len() * mutants * 9 / 10, "only {judged} modules were judged");
}
