//! Prints a program as text.

use std::fmt;

use crate::program::Program;

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "; {} `{}`: {} registers, {} constants",
            self.stage.name(),
            self.name,
            self.register_count,
            self.constants.len()
        )?;
        for input in &self.inputs {
            writeln!(f, "; r{}..{} = {}", input.first.0, input.first.0 + input.count, input.builtin.name)?;
        }
        for (at, block) in self.blocks.iter().enumerate() {
            writeln!(f, "b{at}:")?;
            for op in &self.ops[block.ops()] {
                writeln!(f, "    {op:?}")?;
            }
            writeln!(f, "    {:?}", block.terminator.clone().map(|block| block.0))?;
        }
        Ok(())
    }
}
