//! Instructions as text: SPIR-V's assembly with numbers for ids, and behind it the names of those
//! ids that have one.

use std::fmt::Write;

use rspirv::grammar::OperandKind;

use crate::module::grammar::{InstructionGrammar, is_id, walk};
use crate::module::span::{Span, ends_string};
use crate::module::ty::Type;
use crate::module::words::HEADER_WORDS;
use crate::module::{Id, Module, Opcode};

/// The most words of a number or string that are written.
const MOST_LITERAL_WORDS: usize = 64;

/// The word offsets of all instructions of a module, in their order.
pub fn instruction_offsets(module: &Module) -> Vec<u32> {
    let mut offsets = Vec::new();
    let mut at = HEADER_WORDS;
    while let Some(span) = span_at(module, at) {
        offsets.push(at as u32);
        at = span.end;
    }
    offsets
}

/// How many words the instruction at a word offset has; 0 where none is.
pub fn instruction_words(module: &Module, offset: u32) -> u32 {
    span_at(module, offset as usize).map_or(0, |span| (span.end - span.start) as u32)
}

/// The instruction at a word offset: `%12 = OpFAdd %6 %10 %11 ; %10 t`. Empty where none is.
pub fn instruction_text(module: &Module, offset: u32) -> String {
    let Some(span) = span_at(module, offset as usize) else { return String::new() };
    let words = &module.words;
    let known = InstructionGrammar::of(span.opcode);
    let (mut text, mut ids) = (String::new(), Vec::new());
    let mut add = |text: &mut String, id: u32| {
        ids.push(id);
        let _ = write!(text, "%{id}");
    };
    let (has_type, has_result) = known.map_or((false, false), |known| (known.has_type, known.has_result));
    let result = span.start + 1 + usize::from(has_type);
    if has_result && result < span.end {
        add(&mut text, words[result]);
        text.push_str(" = ");
    }
    text.push_str(&span.opcode.to_string());
    if has_type && span.start + 1 < span.end {
        text.push(' ');
        add(&mut text, words[span.start + 1]);
    }
    let literal_words = literal_words(module, span);
    // A loaded module has passed this before: what a violation leaves out is not there.
    let _ = walk(words, span, literal_words, &mut |at, kind| {
        text.push(' ');
        match kind {
            kind if is_id(kind) => add(&mut text, words[at]),
            OperandKind::LiteralString => text.push_str(&format!("{:?}", string_at(words, at))),
            OperandKind::LiteralContextDependentNumber => {
                let number = words[at..].iter().take(literal_words.min(MOST_LITERAL_WORDS)).rev();
                text += "0x";
                text += &number.map(|word| format!("{word:08x}")).collect::<String>();
            }
            _ => text += &words[at].to_string(),
        }
        Ok(())
    });
    let mut seen = Vec::new();
    for id in ids {
        if let Some(name) = module.name(Id(id)).filter(|_| !seen.contains(&id)) {
            let _ = write!(text, "{}%{id} {name}", if seen.is_empty() { " ; " } else { ", " });
            seen.push(id);
        }
    }
    text
}

fn span_at(module: &Module, at: usize) -> Option<Span> {
    let first = *module.words.get(at)?;
    let end = at + (first >> 16) as usize;
    (end > at && end <= module.words.len()).then_some(Span { opcode: Opcode::of_word(first), start: at, end })
}

/// How many words a number takes whose width depends on a type.
fn literal_words(module: &Module, span: Span) -> usize {
    let is = |op: Opcode| span.opcode == op;
    if is(Opcode::Constant) || is(Opcode::SpecConstant) {
        return (span.end - span.start).saturating_sub(3).max(1);
    }
    let selector = module.words.get(span.start + 1).filter(|_| is(Opcode::Switch));
    let ty = selector.and_then(|&selector| module.type_of(Id(selector)));
    match ty.map(|ty| module.ty(ty)) {
        Some(Type::Int { width: 64, .. }) => 2,
        _ => 1,
    }
}

/// The string at a word, as far as it is valid, and not more than is read at once.
fn string_at(words: &[u32], at: usize) -> String {
    let mut bytes = Vec::new();
    for &word in words[at..].iter().take(MOST_LITERAL_WORDS) {
        bytes.extend(word.to_le_bytes());
        if ends_string(word) {
            break;
        }
    }
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fragment of a module by hand: `OpTypeFloat`, `OpName`, `OpString`.
    #[test]
    fn instructions_have_numbers_and_names() {
        let words = vec![
            0x0723_0203,
            0x0001_0600,
            0,
            9,
            0,
            // OpCapability Shader
            2 << 16 | 17,
            1,
            // OpMemoryModel Logical GLSL450
            3 << 16 | 14,
            0,
            1,
            // OpName %2 "real"
            4 << 16 | 5,
            2,
            u32::from_le_bytes(*b"real"),
            0,
            // %2 = OpTypeFloat 32
            3 << 16 | 22,
            2,
            32,
            // %3 = OpConstant %2 1.0
            4 << 16 | 43,
            2,
            3,
            0x3F80_0000,
        ];
        let bytes: Vec<u8> = words.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        let module = crate::module::load(&bytes).unwrap();
        let offsets = instruction_offsets(&module);
        assert_eq!(offsets, [5, 7, 10, 14, 17]);
        let all: Vec<String> = offsets.iter().map(|&at| instruction_text(&module, at)).collect();
        assert_eq!(all[2], "OpName %2 \"real\" ; %2 real");
        assert_eq!(all[3], "%2 = OpTypeFloat 32 ; %2 real");
        assert_eq!(all[4], "%3 = OpConstant %2 0x3f800000 ; %2 real");
        assert_eq!(instruction_words(&module, 17), 4);
        assert_eq!(instruction_text(&module, 1000), "");
    }
}
