//! Prints a program as text.

use std::fmt;

use crate::program::Program;

/// Stage, name, and how large it is; `Display` prints the operations.
impl fmt::Debug for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Program")
            .field("stage", &self.stage)
            .field("name", &self.name)
            .field("operations", &self.ops.len())
            .field("blocks", &self.blocks.len())
            .field("registers", &self.register_count)
            .finish_non_exhaustive()
    }
}

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
