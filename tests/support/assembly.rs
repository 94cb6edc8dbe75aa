//! SPIR-V as text, in the notation of `spirv-as`, for tests: names for ids, the grammar's names for
//! enumerants.

use std::collections::HashMap;

use anyhit_engine::module::{Opcode, names};
use rspirv::grammar::{ExtInstOp, GLSL_STD_450_INSTRUCTION_TABLE, OperandKind, OperandQuantifier};
use rspirv::spirv;

/// Assembles a module of version 1.6. A line is an instruction or empty; `;` begins a comment.
pub fn assemble(text: &str) -> Vec<u8> {
    let mut assembler = Assembler { ids: HashMap::new(), words: vec![0x0723_0203, 0x0001_0600, 0, 0, 0] };
    for line in text.lines() {
        let line = line.split(';').next().unwrap_or_default();
        let tokens: Vec<&str> = tokens(line);
        if !tokens.is_empty() {
            assembler.line(&tokens).unwrap_or_else(|problem| panic!("{problem} in `{}`", line.trim()));
        }
    }
    assembler.words[3] = assembler.ids.len() as u32 + 1;
    assembler.words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

struct Assembler {
    ids: HashMap<String, u32>,
    words: Vec<u32>,
}

impl Assembler {
    fn line(&mut self, tokens: &[&str]) -> Result<(), String> {
        let (result, rest) = match tokens {
            [result, "=", rest @ ..] => (Some(*result), rest),
            _ => (None, tokens),
        };
        let opcode = Opcode::by_name(rest[0]).ok_or_else(|| format!("unknown {}", rest[0]))?;
        let start = self.words.len();
        self.words.push(0);
        let mut rest = rest[1..].iter();
        for operand in opcode.operands() {
            if operand.kind == OperandKind::IdResult {
                let id = self.id(result.ok_or("a result is missing")?);
                self.words.push(id);
                continue;
            }
            if operand.quantifier == OperandQuantifier::One {
                let token = rest.next().ok_or("an operand is missing")?;
                self.operand(operand.kind, token)?;
            } else {
                // The rest may be of several kinds in turn: what it looks like decides.
                for token in rest.by_ref() {
                    self.operand(operand.kind, token)?;
                }
            }
        }
        for token in rest {
            self.operand(OperandKind::LiteralInteger, token)?;
        }
        let count = (self.words.len() - start) as u32;
        self.words[start] = count << 16 | u32::from(opcode.0);
        Ok(())
    }

    fn operand(&mut self, kind: OperandKind, token: &str) -> Result<(), String> {
        if token.starts_with('%') {
            let id = self.id(token);
            self.words.push(id);
        } else if let Some(text) = token.strip_prefix('"') {
            let mut bytes = text.as_bytes().to_vec();
            bytes.push(0);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            self.words.extend(bytes.chunks(4).map(|part| u32::from_le_bytes(part.try_into().unwrap())));
        } else if let Some(words) = number(token) {
            self.words.extend(words);
        } else {
            let mut bits = 0;
            for name in token.split('|') {
                bits |= enumerant(kind, name).ok_or_else(|| format!("unknown {kind:?} {name}"))?;
            }
            self.words.push(bits);
        }
        Ok(())
    }

    fn id(&mut self, name: &str) -> u32 {
        let next = self.ids.len() as u32 + 1;
        *self.ids.entry(name.to_owned()).or_insert(next)
    }
}

fn tokens(line: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut rest = line.trim();
    while !rest.is_empty() {
        let end = match rest.strip_prefix('"') {
            Some(text) => text.find('"').expect("a closing quote") + 1,
            None => rest.find(char::is_whitespace).unwrap_or(rest.len()),
        };
        found.push(&rest[..end]);
        rest = rest[end..].trim_start_matches('"').trim_start();
    }
    found
}

/// Integers (`7`, `-1`, `0x10`, with `L` behind them 64 bits) and floats (`1.5`, with `d` 64 bits,
/// with `h` 16).
fn number(token: &str) -> Option<Vec<u32>> {
    let wide = |bits: u64| vec![bits as u32, (bits >> 32) as u32];
    let integer = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).ok(),
        None => text.parse::<u64>().ok().or_else(|| text.parse::<i64>().ok().map(|value| value as u64)),
    };
    if let Some(value) = token.strip_suffix('L').and_then(integer) {
        return Some(wide(value));
    }
    if let Some(value) = integer(token) {
        return Some(vec![value as u32]);
    }
    if let Some(value) = token.strip_suffix('d').and_then(|text| text.parse::<f64>().ok()) {
        return Some(wide(value.to_bits()));
    }
    if let Some(value) = token.strip_suffix('h').and_then(|text| text.parse::<f64>().ok()) {
        return Some(vec![half::f16::from_f64(value).to_bits().into()]);
    }
    token.parse::<f32>().ok().map(|value| vec![value.to_bits()])
}

fn enumerant(kind: OperandKind, name: &str) -> Option<u32> {
    macro_rules! kinds {
        ($($kind:ident)*) => {
            match kind {
                $(OperandKind::$kind => name.parse::<spirv::$kind>().ok().map(|value| value as u32),)*
                // `2D` is `Dim2D` in the crate's table.
                OperandKind::Dim => {
                    let known = [name, &format!("Dim{name}")].map(|name| name.parse::<spirv::Dim>().ok());
                    known.into_iter().flatten().next().map(|dim| dim as u32)
                }
                OperandKind::FunctionControl => Some(0),
                OperandKind::MemoryAccess => match name {
                    "None" => Some(0),
                    "Volatile" => Some(1),
                    "Aligned" => Some(2),
                    "Nontemporal" => Some(4),
                    _ => None,
                },
                OperandKind::LiteralExtInstInteger => {
                    let entry = GLSL_STD_450_INSTRUCTION_TABLE.iter().find(|entry| entry.opname == name);
                    entry.map(|entry| match entry.opcode { ExtInstOp::GlslStd450(op) => op as u32, _ => 0 })
                }
                OperandKind::LiteralSpecConstantOpInteger => {
                    Opcode::by_name(name).map(|opcode| opcode.0.into())
                }
                _ if name == "None" => Some(0),
                _ => name.parse::<spirv::BuiltIn>().ok().map(|value| value as u32),
            }
        };
    }
    let known = kinds!(Capability AddressingModel MemoryModel ExecutionModel ExecutionMode StorageClass Decoration BuiltIn ImageFormat GroupOperation PackedVectorFormat SourceLanguage);
    known.or_else(|| added_enumerant(kind, name))
}

/// The number of an enumerant that the crate's table lacks.
fn added_enumerant(kind: OperandKind, name: &str) -> Option<u32> {
    let name_of = match kind {
        OperandKind::Capability => names::capability_name,
        OperandKind::Decoration => names::decoration_name,
        OperandKind::ExecutionMode => names::execution_mode_name,
        _ => return None,
    };
    (0..8192).find(|&number| name_of(number) == name)
}
