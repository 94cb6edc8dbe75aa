//! How each kind of file is changed.

use std::collections::BTreeSet;

use rspirv::grammar::INSTRUCTION_TABLE;

use super::seeds::Seed;
use super::{binary, text};
use crate::support::mutate::{Original, Random};

/// Makes a mutant of a seed; the second seed gives it parts.
pub type Mutate = fn(&Seed, &Seed, &mut Random) -> Vec<u8>;

/// A module with changed instructions, operands and types; one in four with changed words.
pub fn module(seed: &Seed, other: &Seed, random: &mut Random) -> Vec<u8> {
    let words: Vec<u32> =
        seed.1.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().expect("four bytes"))).collect();
    let original = if random.below(4) == 0 { None } else { Original::new(&words) };
    let words = match original {
        Some(original) => original.mutant(random).0,
        None => change_words(words, random),
    };
    let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    if random.below(50) == 0 {
        binary::change(&mut bytes, &other.1, random);
    }
    bytes
}

/// Changes a few words behind the header: to another word of the module, a small number, by a bit.
fn change_words(mut words: Vec<u32>, random: &mut Random) -> Vec<u32> {
    let Some(behind) = words.len().checked_sub(5).filter(|&count| count > 0) else { return words };
    for _ in 0..1 + random.below(3) {
        let at = 5 + random.below(behind);
        words[at] = match random.below(5) {
            0 => words[5 + random.below(behind)],
            1 => random.below(300) as u32,
            2 => words[at] ^ 1 << random.below(32),
            3 => u32::MAX - random.below(2) as u32,
            _ => words[at].wrapping_add(1),
        };
    }
    words
}

/// A file of bytes.
pub fn bytes(seed: &Seed, other: &Seed, random: &mut Random) -> Vec<u8> {
    binary::mutant(&seed.1, &other.1, random)
}

/// A text.
pub fn text(seed: &Seed, other: &Seed, random: &mut Random) -> Vec<u8> {
    let (text, other) = (String::from_utf8_lossy(&seed.1), String::from_utf8_lossy(&other.1));
    text::mutant(&text, &other, random).into_bytes()
}

/// A scene, whose first line is its path and stays.
pub fn scene(seed: &Seed, other: &Seed, random: &mut Random) -> Vec<u8> {
    let text = String::from_utf8_lossy(&seed.1);
    let (path, rest) = text.split_once('\n').unwrap_or((&text, ""));
    let changed = text::mutant(rest, &String::from_utf8_lossy(&other.1), random);
    format!("{path}\n{changed}").into_bytes()
}

/// A glTF file as JSON, a GLB file in its chunks.
pub fn gltf(seed: &Seed, other: &Seed, random: &mut Random) -> Vec<u8> {
    if seed.1.starts_with(b"glTF") { bytes(seed, other, random) } else { text(seed, seed, random) }
}

/// What is worth inserting into such files: the first words of SPIR-V's instructions, or the words
/// of texts.
pub fn words(seeds: &[Seed]) -> BTreeSet<Vec<u8>> {
    const MAGIC: [u8; 4] = 0x0723_0203_u32.to_le_bytes();
    let mut words = BTreeSet::new();
    for (_, bytes) in seeds {
        if bytes.starts_with(&MAGIC) {
            continue;
        }
        if let Ok(text) = std::str::from_utf8(bytes) {
            let all = text.split(|one: char| !(one.is_alphanumeric() || one == '_'));
            words.extend(all.filter(|word| word.len() > 2).map(|word| word.as_bytes().to_vec()));
        }
    }
    if seeds.iter().any(|(_, bytes)| bytes.starts_with(&MAGIC)) {
        words.extend(INSTRUCTION_TABLE.iter().map(|instruction| {
            let length = 1 + instruction.operands.len() as u32;
            (length << 16 | instruction.opcode as u32).to_le_bytes().to_vec()
        }));
    }
    words
}
