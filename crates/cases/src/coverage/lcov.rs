//! The tracefile format of lcov (`man geninfo`, "TRACEFILE FORMAT").

use std::fmt::Write;

use crate::coverage::{Coverage, FileCoverage};
use anyhit_base::escape;

impl Coverage {
    /// The lines, branches and functions as an lcov tracefile.
    pub fn lcov(&self) -> String {
        let mut text = String::new();
        for (name, file) in &self.files {
            // Writing to a string does not fail.
            let _ = record(&mut text, name, file);
        }
        text
    }
}

fn record(out: &mut String, name: &str, file: &FileCoverage) -> std::fmt::Result {
    writeln!(out, "TN:\nSF:{}", escape::line(name))?;
    for (line, function) in file.functions.keys() {
        writeln!(out, "FN:{line},{}", escape::line(function))?;
    }
    for ((_, function), count) in &file.functions {
        writeln!(out, "FNDA:{count},{}", escape::line(function))?;
    }
    let found = file.functions.values().filter(|count| **count > 0).count();
    writeln!(out, "FNF:{}\nFNH:{found}", file.functions.len())?;
    for (edge, taken) in &file.branches {
        let taken = taken.map_or("-".into(), |taken| taken.to_string());
        writeln!(out, "BRDA:{},{},{},{taken}", edge.line, edge.branch, edge.way)?;
    }
    let [[run, lines], [taken, ways]] = file.totals();
    writeln!(out, "BRF:{ways}\nBRH:{taken}")?;
    for (line, count) in &file.lines {
        writeln!(out, "DA:{line},{count}")?;
    }
    writeln!(out, "LF:{lines}\nLH:{run}\nend_of_record")
}
