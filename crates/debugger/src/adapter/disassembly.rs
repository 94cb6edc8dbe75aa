//! Instructions of modules: the listing that stands for a source, and `disassemble`.

use emmy_dap_types::requests::DisassembleArguments;
use emmy_dap_types::responses::DisassembleResponse;
use emmy_dap_types::types::DisassembledInstruction;

use anyhit_engine::module::Module;
use anyhit_engine::module::disassembly::{instruction_offsets, instruction_text, instruction_words};

use super::Adapter;
use super::protocol::{Answer, Refusal, Request, body};

/// The most instructions that are disassembled at a time.
const MOST_INSTRUCTIONS: i64 = 20_000;

/// A module's instructions, a line each.
#[derive(Debug)]
pub(super) struct Listing {
    pub(super) text: String,
    /// By line: where its instruction begins, in words.
    offsets: Vec<u32>,
}

impl Listing {
    pub(super) fn new(module: &Module) -> Self {
        let offsets = instruction_offsets(module);
        let lines = offsets.iter().map(|&offset| instruction_text(module, offset) + "\n");
        Self { text: lines.collect(), offsets }
    }

    /// The line of the instruction at a word offset, or of the last before it.
    pub(super) fn line_of(&self, offset: u32) -> u32 {
        self.offsets.partition_point(|&one| one <= offset).max(1) as u32
    }

    /// Where the instruction of a line begins; behind all of them where there is no such line.
    pub(super) fn offset_at(&self, line: u32) -> u32 {
        self.offsets.get(line.saturating_sub(1) as usize).copied().unwrap_or(u32::MAX)
    }
}

/// The address of a shader's instruction: the shader in the high word, its byte in the module in
/// the low one.
pub(super) fn reference(shader: usize, offset: u32) -> String {
    format!("{:#018x}", ((shader as u64 + 1) << 32) | (u64::from(offset) * 4))
}

/// The shader and the word offset of an address.
pub(super) fn shader_and_offset(reference: &str, bytes: i64) -> Result<(usize, u32), Refusal> {
    let digits = reference.trim().strip_prefix("0x");
    let address = digits.and_then(|digits| u64::from_str_radix(digits, 16).ok());
    let address = address.and_then(|address| address.checked_add_signed(bytes));
    let parts = address.and_then(|address| {
        let shader = (address >> 32).checked_sub(1)?;
        Some((usize::try_from(shader).ok()?, address as u32 / 4))
    });
    parts.ok_or_else(|| Refusal::new(format!("`{reference}` is not the address of an instruction")))
}

impl Adapter {
    pub(super) fn disassemble(&mut self, request: &Request) -> Answer {
        let arguments: DisassembleArguments = request.arguments()?;
        let (shader, offset) = shader_and_offset(&arguments.memory_reference, arguments.offset.unwrap_or(0))?;
        let client = self.client;
        let launched = self.launched()?;
        let Some(sites) = launched.console.debugger.sources().shaders().get(shader) else {
            return Err(Refusal::new(format!("shader {shader} does not exist")));
        };
        let module = &sites.program.module;
        let offsets = instruction_offsets(module);
        let here = offsets.partition_point(|&one| one < offset) as i64;
        let first = here.saturating_add(arguments.instruction_offset.unwrap_or(0));
        let count = arguments.instruction_count.clamp(0, MOST_INSTRUCTIONS);
        // As many are returned as are asked for: those before the first and behind the last are no
        // instructions.
        let instruction = |at: i64| {
            let found = usize::try_from(at).ok().and_then(|at| offsets.get(at).copied());
            let Some(offset) = found else {
                let behind = (at - offsets.len() as i64).saturating_add(module.words.len() as i64);
                // Before the first is before the module, too.
                let outside = if at < 0 { at } else { behind };
                let address = ((shader as i64 + 1) << 32).wrapping_add(outside.wrapping_mul(4));
                return DisassembledInstruction {
                    address: format!("{address:#018x}"),
                    instruction: "(outside the module)".into(),
                    ..DisassembledInstruction::default()
                };
            };
            let words = instruction_words(module, offset);
            let words = &module.words[offset as usize..][..words as usize];
            let bytes: Vec<String> = words.iter().map(|word| format!("{word:08x}")).collect();
            let position = sites.position(offset);
            DisassembledInstruction {
                address: reference(shader, offset),
                instruction_bytes: Some(bytes.join(" ")),
                instruction: instruction_text(module, offset),
                location: position.map(|position| launched.sources.source(position.file)),
                line: position.map(|position| client.line(launched.sources.shown_line(position))),
                ..DisassembledInstruction::default()
            }
        };
        let instructions = (0..count).map(|at| instruction(first.saturating_add(at))).collect();
        body(DisassembleResponse { instructions })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_names_a_shader_and_a_word() {
        assert_eq!(reference(2, 10), "0x0000000300000028");
        assert_eq!(shader_and_offset("0x0000000300000028", 4).unwrap(), (2, 11));
        for wrong in ["", "12", "0x", "0x28", "0xfffffffffffffffff", "memory-1"] {
            assert!(shader_and_offset(wrong, 0).is_err(), "{wrong}");
        }
        assert!(shader_and_offset("0x0000000100000000", i64::MIN).is_err());
    }
}
