//! What a ray from the host leaves in its payload: the host reads it, so it counts as output.

use crate::report::specials::SpecialSink;
use crate::report::{CallFrame, Reporter, Sink};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, OpIndex, Registers, ShaderIndex};
use anyhit_engine::ops::access::Access;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::RayOutcome;
use anyhit_engine::program::Program;

impl Sanitizer<'_> {
    /// Reports each word of the payload that is undefined at the end of a ray from the host, or of
    /// a NaN or an infinity that an instruction made.
    pub fn check_payload(&mut self, outcome: &RayOutcome) {
        let batch = Batch::<1>::new(Registers::new(0));
        for (word, shadow) in (0..).zip(&outcome.shadow) {
            if shadow.cause == NO_CAUSE {
                continue;
            }
            let (shader, op) = self.last_write(word);
            let frames = [CallFrame { shader, op, call: 0 }];
            let mut reporter = Reporter { frames: &frames, ..self.reporter(&batch) };
            if shadow.is_undefined {
                reporter.undefined_for(shadow.cause, op, Mask::lane(0), Sink::Payload);
            } else {
                reporter.special_for(shadow.cause, op, Mask::lane(0), SpecialSink::Payload);
            }
        }
    }

    /// The operation that writes a word of the payload, of the last shader that has run and has
    /// one: the last of them in its code.
    fn last_write(&self, word: u32) -> (ShaderIndex, OpIndex) {
        let ended = self.ended.iter().rev();
        let mut writes = ended.clone().filter_map(|&shader| {
            let program = &self.plans.get(shader.index())?.program;
            Some((shader, last_write(program, word)?))
        });
        let any = ended.clone().next().copied().unwrap_or(ShaderIndex(0));
        writes.next().unwrap_or((any, OpIndex(0)))
    }
}

/// The last operation of a program that writes a word of the payload that it is given.
fn last_write(program: &Program, word: u32) -> Option<OpIndex> {
    let mut variables = program.interface.iter();
    let payload = variables.find(|variable| variable.storage_class == storage::INCOMING_RAY_PAYLOAD)?;
    let register = payload.first.plus(word);
    let at = program.ops.iter().rposition(|op| {
        let mut writes = false;
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                writes |= (first.0..first.0 + count).contains(&register.0);
            }
        });
        writes
    })?;
    Some(OpIndex::new(at))
}
