//! Completion of the word before the caret: commands, places, names and members.

use anyhit_base::sorted::sort;

use super::Console;
use super::command::{self, Action};
use super::places;

impl Console {
    /// Returns where the last word of a line begins, and the words that it may become.
    pub fn complete(&mut self, line: &str) -> (usize, Vec<String>) {
        let start = line.rfind(char::is_whitespace).map_or(0, |at| at + 1);
        let (before, word) = line.split_at(start);
        let mut before = before.split_whitespace();
        let Some(first) = before.next() else {
            return (start, command::complete(word).map(str::to_owned).collect());
        };
        let action = command::find(first).ok().map(|command| command.action);
        let takes_place = matches!(action, Some(Action::Break | Action::Log | Action::Until));
        if !takes_place || before.next().is_some() {
            return self.complete_names(line);
        }
        (start, self.complete_place(word))
    }

    /// Completes a place: a function, a stage, a source file, and behind its colon a line that has
    /// code.
    fn complete_place(&self, word: &str) -> Vec<String> {
        let sources = self.debugger.sources();
        if let Some((file, digits)) = word.rsplit_once(':') {
            let mut lines: Vec<u32> = sources.lines_of(file).map(|(_, place)| place.line).collect();
            sort(&mut lines);
            lines.dedup();
            let lines = lines.into_iter().map(|line| line.to_string());
            return lines
                .filter(|line| line.starts_with(digits))
                .map(|line| format!("{file}:{line}"))
                .collect();
        }
        let names = sources.files().iter().map(|file| &*file.name);
        // The last part of a name means the file, too.
        let short = |name: &str| name.rsplit(['/', '\\']).next().unwrap_or(name).to_owned();
        let is_short = !word.contains(['/', '\\']);
        let files = names.map(|name| (if is_short { short(name) } else { name.to_owned() }) + ":");
        let stages = places::stage_names().map(str::to_owned);
        fitting(sources.function_names().into_iter().chain(stages).chain(files), word)
    }

    /// As [`Console::complete`], where a line may be an expression, too.
    pub fn complete_expression(&mut self, line: &str) -> (usize, Vec<String>) {
        let (start, mut words) = self.complete(line);
        if line[..start].trim().is_empty() {
            let (name_start, names) = self.complete_names(line);
            if name_start != start {
                return (name_start, names);
            }
            words.extend(names);
        }
        (start, words)
    }

    /// Completes a word of an expression: behind a dot the members of what is before it, else the
    /// names that are visible in the frame.
    fn complete_names(&mut self, line: &str) -> (usize, Vec<String>) {
        let start = word_start(line);
        let (before, word) = line.split_at(start);
        let Ok(frame) = self.selected() else { return (start, Vec::new()) };
        let names = match before.strip_suffix('.').or_else(|| before.strip_suffix("->")) {
            Some(whole) => self.debugger.member_names(&frame, &whole[operand_start(whole)..]),
            None => self.debugger.visible_names(&frame),
        };
        (start, fitting(names.into_iter(), word))
    }
}

/// The names that begin with a word, sorted, each once.
fn fitting(names: impl Iterator<Item = String>, word: &str) -> Vec<String> {
    let mut fitting: Vec<String> = names.filter(|name| name.starts_with(word)).collect();
    sort(&mut fitting);
    fitting.dedup();
    fitting
}

/// The byte at which the last word of a text begins, of letters, digits and `_`.
fn word_start(text: &str) -> usize {
    text.trim_end_matches(|c: char| c.is_alphanumeric() || c == '_').len()
}

/// The byte at which the last operand of a text begins: a name, a call or something in
/// parentheses, with the members and elements behind it.
fn operand_start(text: &str) -> usize {
    let (mut depth, mut start) = (0_usize, text.len());
    for (at, c) in text.char_indices().rev() {
        match c {
            ')' | ']' => depth += 1,
            '(' | '[' if depth == 0 => break,
            '(' | '[' => depth -= 1,
            _ if depth > 0 || c.is_alphanumeric() || matches!(c, '_' | '%' | '.') => {}
            '>' if text[..at].ends_with('-') => {}
            '-' if text[at..].starts_with("->") => {}
            _ => break,
        }
        start = at;
    }
    start
}

#[cfg(test)]
mod tests {
    use super::operand_start;

    #[test]
    fn an_operand_has_what_is_behind_it() {
        let cases = [
            ("payload", "payload"),
            ("a + payload.colour", "payload.colour"),
            ("x*corners[i + (1 - j)]", "corners[i + (1 - j)]"),
            ("-vec3(a, b)", "vec3(a, b)"),
            ("f((a", "a"),
            ("p->next", "p->next"),
            ("a>b", "b"),
            ("a - %12", "%12"),
            ("\u{20ac}\u{e9}", "\u{e9}"),
            ("a[", ""),
        ];
        for (text, operand) in cases {
            assert_eq!(&text[operand_start(text)..], operand, "{text}");
        }
    }
}
