//! Validates modules, one after the other, in a process of its own: an assertion of SPIRV-Tools that does not hold
//! ends it. `verdict::Validator` talks to it.

use std::io::{self, Read, Write};

use anyhit_judges::verdict::theirs;

fn main() -> io::Result<()> {
    let (mut input, mut output) = (io::stdin().lock(), io::stdout().lock());
    let mut length = [0; 4];
    // Until nobody asks any more.
    while input.read_exact(&mut length).is_ok() {
        let mut bytes = vec![0; u32::from_le_bytes(length) as usize];
        input.read_exact(&mut bytes)?;
        let complaint = theirs(&anyhit_judges::words(&bytes)).err().unwrap_or_default();
        output.write_all(&(complaint.len() as u32).to_le_bytes())?;
        output.write_all(complaint.as_bytes())?;
        output.flush()?;
    }
    Ok(())
}
