//! Whether "invalid" is a verdict: what SPIRV-Tools accepts is called so only with the rule that it
//! breaks. `tests/modules/verdicts.txt` records what SPIRV-Tools says of mutants of every fixture;
//! `judges/` makes it.

use std::path::Path;

use crate::support::mutate::{Original, Random};
use crate::support::recorded::{self, Recorded, digest};
use crate::support::verdict::{Ours, ours};

#[test]
fn what_the_validator_accepts_breaks_no_rule() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("tests/modules/verdicts.txt")).expect("the record");
    let (mut judged, mut changed, mut accepted) = (0, 0, 0);
    let mut wrong = Vec::new();
    for Recorded { name, digest: recorded, accepts } in recorded::read(&text) {
        let Ok(bytes) = std::fs::read(root.join("spirv-fixtures").join(&name)) else {
            changed += 1;
            continue;
        };
        let words: Vec<u32> =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
        let Some(original) = Original::new(&words) else {
            changed += 1;
            continue;
        };
        let mutant = |number: usize| original.mutant(&mut Random::of(&name, number as u64));
        let mutants: Vec<(Vec<u32>, String)> = (0..accepts.len()).map(mutant).collect();
        // A fixture that was compiled again has other mutants: the record knows nothing of them.
        if digest(&mutants) != recorded {
            changed += 1;
            continue;
        }
        for (number, ((words, story), accepts)) in mutants.iter().zip(accepts).enumerate() {
            judged += 1;
            accepted += usize::from(accepts);
            match ours(words) {
                Ours::Invalid { text, cited: false } if accepts => {
                    wrong.push(format!("{name} #{number}: {story}: {text}"));
                }
                Ours::Panicked(text) => wrong.push(format!("{name} #{number}: {story}: {text}")),
                _ => {}
            }
        }
    }
    assert!(wrong.is_empty(), "{} modules:\n{}", wrong.len(), wrong.join("\n"));
    assert!(
        judged > 2000 && accepted > 500,
        "{judged} judged, {accepted} accepted, {changed} fixtures changed"
    );
}
