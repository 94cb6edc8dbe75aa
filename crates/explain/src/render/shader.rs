//! Renders shader runs: what they were given, which lines ran, what they did.

use crate::executed_lines::{AssignedValue, ExecutedLine, PrintedText};
use crate::given_block::GivenBlock;
use crate::page::with_plural;
use crate::render::Writer;
use crate::render::words::{annotated, change, label, payload_label, source_suffix, value_rows};
use crate::transcript::{ExitKind, NamedValue, RecordData, RecordMember, ShaderRun};
use anyhit_base::count::grouped;
use anyhit_base::style::Style;
use anyhit_engine::reflect::value::TypedValue;

/// How wide the text of source lines is, so that the values stand in a column.
const LINE_WIDTH: usize = 64;

impl Writer<'_> {
    pub(super) fn shader(&mut self, run: &ShaderRun) {
        let head = self.page.styled(Style::Heading, run.shader.stage);
        self.page.line(format_args!("{head} {}", label(&run.shader)));
        self.nested("  ", |writer| writer.shader_body(run));
    }

    fn shader_body(&mut self, run: &ShaderRun) {
        let builtin = |one: &NamedValue| {
            let name = match one.source_name {
                Some(name) => format!("{name} ({})", one.name),
                None => one.name.to_owned(),
            };
            (name, annotated(one.name, &one.value))
        };
        let mut rows: Vec<(String, String)> = run.builtins.iter().map(builtin).collect();
        rows.extend(run.attributes.iter().flat_map(|value| value_rows("hit attribute", value)));
        rows.extend(run.record.iter().flat_map(record_rows));
        if let Some(block) = &run.push_constants {
            let GivenBlock { given, declared, value } = block;
            rows.extend(value.iter().flat_map(|value| value_rows("push constants", value)));
            rows.extend(size_row("push constants", *given, *declared));
        }
        rows.extend(run.payload_before.iter().flat_map(|value| value_rows(payload_label(run), value)));
        self.page.rows(rows);
        self.lines(&run.lines);
        self.steps(run);
        if let (Some(before), Some(after)) = (&run.payload_before, &run.payload_after) {
            self.payload_change(payload_label(run), before, after);
        }
        let ending = match (run.exit.how, run.shader.stage) {
            (ExitKind::Returned, "AnyHitKHR") => "returned: the candidate is accepted".to_owned(),
            (ExitKind::Returned, _) => "returned".to_owned(),
            (ExitKind::Ignored, _) => "ignored the intersection: the candidate is dropped".to_owned(),
            (ExitKind::Terminated, _) => {
                "terminated the ray: the candidate is accepted, traversal ends".to_owned()
            }
            (ExitKind::Trapped, _) => {
                let message = run.exit.message.unwrap_or_default();
                let text = format!("TRAPPED: {message}{}", source_suffix(run.exit.at.as_ref(), ""));
                self.page.styled(Style::Bad, text)
            }
        };
        self.page.line(ending);
    }

    /// Shows the members of a payload that changed, or says that none did.
    fn payload_change(&mut self, word: &str, before: &TypedValue, after: &TypedValue) {
        let pairs = before.parts().into_iter().zip(after.parts());
        let changed: Vec<(String, String)> = pairs
            .filter(|((_, before), (_, after))| before != after)
            .map(|((path, before), (_, after))| {
                let name = if path.is_empty() { word.to_owned() } else { format!("{word}.{path}") };
                (name, change(before, after))
            })
            .collect();
        if changed.is_empty() {
            let text = self.page.styled(Style::Faint, format_args!("{word} unchanged"));
            self.page.line(text);
        }
        self.page.rows(changed);
    }

    /// The lines that ran, each with the variables that it set.
    fn lines(&mut self, lines: &[ExecutedLine]) {
        if lines.is_empty() {
            return;
        }
        self.page.blank_line();
        self.page.line(self.page.styled(Style::Heading, "executed lines"));
        if let Some(most) = self.options.last_lines {
            let cut = lines.len().saturating_sub(most);
            if cut > 0 {
                let text = format!("  {} before these", with_plural(cut as u64, "line"));
                self.page.line(self.page.styled(Style::Faint, text));
            }
            let shown: Vec<&ExecutedLine> = lines[cut..].iter().collect();
            self.executed_lines(&shown, width(&shown));
            return;
        }
        let valued: Vec<&ExecutedLine> = lines.iter().filter(|line| !line.values.is_empty()).collect();
        let rest = lines.len() - valued.len();
        let width = width(&valued);
        match self.options.all {
            true => self.executed_lines(&lines.iter().collect::<Vec<_>>(), width),
            false => self.executed_lines(&valued, width),
        }
        if rest > 0 && !self.options.all {
            let text = format!("  {} more, which set no variable (--all shows them)", grouped(rest));
            self.page.line(self.page.styled(Style::Faint, text));
        }
    }

    fn executed_lines(&mut self, lines: &[&ExecutedLine], width: usize) {
        let mut file = None;
        for line in lines {
            if file != Some(&line.file) {
                self.page.line(format_args!("  {}", self.page.styled(Style::Faint, &line.file)));
                file = Some(&line.file);
            }
            self.executed_line(line, width);
        }
    }

    /// A line with its values, in a column or below it.
    pub(super) fn executed_line(&mut self, line: &ExecutedLine, width: usize) {
        let text = line.text.as_deref().unwrap_or("(source text unknown)");
        let times = match line.count {
            0 | 1 => String::new(),
            count => format!("  ({} times)", grouped(count)),
        };
        let number = self.page.styled(Style::Name, format_args!("{:>5}", line.line));
        let mut values = line.values.iter().map(|value| assigned(value, line.count));
        let size = text.chars().count();
        let pad = " ".repeat(width.saturating_sub(size));
        let first = match size > width {
            true => None,
            false => values.next(),
        };
        let first = first.unwrap_or_default();
        self.page.line(format_args!("{number}  {text}{pad}  {first}{times}"));
        for value in values {
            self.page.line(format_args!("       {}  {value}", " ".repeat(width)));
        }
    }

    /// The steps of a run and what it printed, in order; rays are summed up where they are many.
    fn steps(&mut self, run: &ShaderRun) {
        let mut printed = run.printed.iter().peekable();
        let tables = self.tables(run);
        for (at, step) in run.steps.iter().enumerate() {
            while let Some(text) = printed.next_if(|text| text.steps_before <= at) {
                self.printed(text);
            }
            match tables.iter().find(|table| table.holds(at)) {
                Some(table) if table.begins(at) => {
                    self.page.blank_line();
                    self.table(table);
                }
                Some(_) => {}
                None => {
                    self.page.blank_line();
                    self.step(step);
                }
            }
        }
        printed.for_each(|text| self.printed(text));
        if !run.steps.is_empty() || !run.printed.is_empty() {
            self.page.blank_line();
        }
    }

    /// A text that the shader printed, with its place.
    pub(super) fn printed(&mut self, printed: &PrintedText) {
        self.page.blank_line();
        let mut place = Vec::new();
        if let (Some(file), Some(line)) = (&printed.file, printed.line) {
            place.push(format!("at {file}:{line}"));
        }
        place.extend((!self.place.is_empty()).then(|| self.place.clone()));
        place.push(format!("depth {}", self.depth));
        let head = self.page.styled(Style::Heading, "printed");
        self.page.line(format_args!("{head} {}", place.join(", ")));
        for line in printed.text.lines() {
            self.page.line(format_args!("  {line}"));
        }
        self.printed += 1;
    }
}

/// The rows of a record: its members with their bytes, and what it has behind them.
fn record_rows(record: &RecordData) -> Vec<(String, String)> {
    let RecordData { given, declared, members, behind } = record;
    let member = |one: &RecordMember| {
        let value = match &one.value {
            Some(value) => value.to_string(),
            None => format!("outside the record, which has {}", with_plural(*given, "byte")),
        };
        (format!("record {}, byte {}", one.member, one.byte), value)
    };
    let mut rows: Vec<(String, String)> = members.iter().map(member).collect();
    if !behind.is_empty() {
        let numbers: Vec<String> = behind.iter().map(|word| f32::from_bits(*word).to_string()).collect();
        let label = format!("record from byte {declared} on");
        rows.push((label, format!("not declared; as floats {}", numbers.join(", "))));
    }
    rows.extend(size_row("record", *given, *declared));
    rows
}

/// Both sizes of a block, where they differ.
fn size_row(name: &str, given: u64, declared: u64) -> Option<(String, String)> {
    let sizes = || (format!("{name} size"), format!("{given} bytes given, {declared} declared"));
    (given != declared).then(sizes)
}

/// How wide the column of the lines' text is.
pub(super) fn width(lines: &[&ExecutedLine]) -> usize {
    let size = |line: &&ExecutedLine| line.text.as_ref().map_or(0, |text| text.chars().count());
    lines.iter().map(size).filter(|&size| size <= LINE_WIDTH).max().unwrap_or(0)
}

/// `segment = float 2`; of several times `i = int 0 ... 7 (8 times)`, the first and the last.
fn assigned(value: &AssignedValue, runs: u64) -> String {
    let AssignedValue { name, count, first, last } = value;
    // That of the line is told anyway.
    let times = if *count == runs { String::new() } else { format!(" ({} times)", grouped(count)) };
    match first == last {
        true => format!("{name} = {first}{times}"),
        false => format!("{name} = {first} ... {}{times}", last.content),
    }
}
