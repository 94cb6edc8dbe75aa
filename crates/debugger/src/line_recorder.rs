//! Follows an invocation line by line, and notes which lines its shaders ran and what they set.

use std::collections::HashMap;
use std::sync::Arc;

use crate::debugger::{
    Debugger, KeptStack, SourcePosition, StackFrame, Stepping, StopReason, Variable, VariableKind,
};
use crate::session::{ExplainRequest, Session};
use crate::summary;
use anyhit_base::error::Result;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::reflect::value::TypedValue;
use anyhit_explain::executed_lines::ExecutedLine;
use anyhit_explain::transcript::{ShaderLabel, Step, Transcript};
use anyhit_explain::walk;

/// How many lines are followed.
const MAX_STOPS: usize = 20_000;
/// Variables with more words than these are not told.
const MAX_WORDS: usize = 256;

/// What a line begins with that is the head of a loop.
const LOOPS: [&str; 2] = ["for", "while"];

/// Reads the text of a source by the name that a compiler gave it.
pub type SourceTexts<'a> = dyn FnMut(&str) -> Option<String> + 'a;

/// The shader runs whose lines are noted, by their numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FollowedRuns {
    /// Those with these numbers.
    Only(Vec<u64>),
    /// All of them.
    All,
}

impl FollowedRuns {
    /// The closest-hit or miss shader of a ray that the outermost shader traces, counted from 0.
    pub fn of_sample(transcript: &Transcript, sample: usize) -> Self {
        let run = walk::shader_of_sample(&transcript.root, sample);
        Self::Only(run.into_iter().map(|run| run.run).collect())
    }

    fn contain(&self, run: u64) -> bool {
        match self {
            Self::Only(runs) => runs.contains(&run),
            Self::All => true,
        }
    }

    /// Whether one of them is among runs in ascending order.
    fn are_in(&self, ascending: &[u64]) -> bool {
        match self {
            Self::Only(runs) => runs.iter().any(|run| ascending.binary_search(run).is_ok()),
            Self::All => !ascending.is_empty(),
        }
    }
}

impl Session {
    /// Runs what [`Session::run`] runs and returns its transcript with the lines of the runs that
    /// `follow` chooses in it.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn run_with_lines(
        &self,
        request: &ExplainRequest,
        follow: &dyn Fn(&Transcript) -> FollowedRuns,
        read: &mut SourceTexts<'_>,
    ) -> Result<(Transcript, Option<anyhit_base::error::Error>)> {
        let (mut transcript, trap) = Debugger::keeping_memory(self, || self.run(request))?;
        let runs = follow(&transcript);
        self.add_lines(request, &mut transcript, runs, read)?;
        Ok((transcript, trap))
    }

    /// Adds the lines of shader runs to the transcript of a request. What the session's resources
    /// hold stays as it is.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn add_lines(
        &self,
        request: &ExplainRequest,
        transcript: &mut Transcript,
        runs: FollowedRuns,
        read: &mut SourceTexts<'_>,
    ) -> Result<()> {
        Debugger::keeping_memory(self, || add_lines(self, request, transcript, runs, read))
    }
}

/// Adds the lines of shader runs to the transcript of a request, and where texts were printed.
fn add_lines(
    session: &Session,
    request: &ExplainRequest,
    transcript: &mut Transcript,
    runs: FollowedRuns,
    read: &mut SourceTexts<'_>,
) -> Result<()> {
    walk::for_each_source_line(&mut transcript.root, &mut |line| {
        if line.text.is_none()
            && let Some(text) = read(&line.file)
        {
            line.text =
                text.lines().nth(line.line.saturating_sub(1) as usize).map(|text| text.trim().to_owned());
        }
    });
    let all = walk::runs(&transcript.root);
    let texts: usize = all.iter().map(|run| run.printed.len()).sum();
    if runs == FollowedRuns::Only(Vec::new()) && texts == 0 {
        return Ok(());
    }
    // It runs again what has run, and no other shader.
    let has_run = |shader: &ShaderLabel| all.iter().any(|run| run.shader == *shader);
    let mut debugger = Debugger::of_shaders(session, request, &has_run)?;
    debugger.supply_texts(read);
    transcript.lines_cut = add_lines_of(debugger, &mut transcript.root, runs);
    summary::complete(transcript);
    Ok(())
}

/// Adds the lines of shader runs to what the debugger, which has not begun, runs again. Returns
/// whether not all lines were followed.
pub fn add_lines_of(mut debugger: Debugger, root: &mut Step, runs: FollowedRuns) -> bool {
    let texts = walk::runs(root).iter().map(|run| run.printed.len()).sum();
    let mut recorder = Recorder::new(runs, texts);
    let mut stop = debugger.begin();
    let mut is_cut = false;
    while matches!(stop, StopReason::Entry | StopReason::Step) && !recorder.is_done() {
        if recorder.stops == MAX_STOPS {
            is_cut = true;
            break;
        }
        recorder.stop(&mut debugger);
        stop = debugger.step(Stepping::Into);
    }
    recorder.look_at_output(&debugger);
    recorder.finish(root);
    is_cut
}

/// A variable as it was at the last stop.
#[derive(Clone, Debug)]
struct Seen {
    name: String,
    /// Tells variables with one name apart.
    declared_line: Option<u32>,
    is_declared: bool,
    words: Option<Vec<u32>>,
    value: Option<TypedValue>,
}

/// A function that has been called and not returned.
#[derive(Debug)]
struct OpenFrame {
    run: u64,
    function: Arc<str>,
    scope: u32,
    /// Where it first stopped.
    entry: Option<SourcePosition>,
    /// The line that it is at, by its number in its run.
    line: Option<usize>,
    locals: Vec<Seen>,
}

/// What is known of one shader run.
#[derive(Debug, Default)]
struct RunRecord {
    lines: Vec<ExecutedLine>,
    numbers: HashMap<(Arc<str>, SourcePosition), usize>,
    globals: Vec<Seen>,
    /// The lines of its open functions at the last stop, the innermost first.
    open: Vec<usize>,
    /// The name of the payload or callable data that it was given.
    incoming: Option<String>,
}

#[derive(Debug)]
struct Recorder {
    wanted: FollowedRuns,
    /// How many texts are printed in all.
    texts: usize,
    stops: usize,
    stack: KeptStack,
    /// How many of the outermost frames of the stack `frames` has.
    matched: usize,
    runs: SortedMap<u64, RunRecord>,
    /// From the outermost.
    frames: Vec<OpenFrame>,
    /// By text: the line that printed it.
    printed: Vec<Option<(String, u32)>>,
    last_line: Option<(String, u32)>,
    /// Whether a run that is wanted has not ended.
    is_inside: bool,
}

impl Recorder {
    fn new(wanted: FollowedRuns, texts: usize) -> Self {
        Self {
            wanted,
            texts,
            stops: 0,
            stack: KeptStack::default(),
            matched: 0,
            runs: SortedMap::new(),
            frames: Vec::new(),
            printed: Vec::new(),
            last_line: None,
            is_inside: false,
        }
    }

    /// Whether everything that is wanted has ended.
    fn is_done(&self) -> bool {
        let FollowedRuns::Only(runs) = &self.wanted else { return false };
        !self.is_inside
            && runs.iter().all(|run| self.runs.contains_key(run))
            && self.printed.len() >= self.texts
    }

    /// Notes which line printed what is new.
    fn look_at_output(&mut self, debugger: &Debugger) {
        self.printed.resize(debugger.output().count(), self.last_line.clone());
    }

    /// A line is about to run.
    fn stop(&mut self, debugger: &mut Debugger) {
        self.stops += 1;
        self.look_at_output(debugger);
        let kept = self.stack.read(debugger);
        self.matched = self.matched.min(kept);
        let Some(top) = self.stack.frames.last().cloned() else { return };
        let Some(position) = top.position else { return };
        let sources = debugger.sources().clone();
        self.last_line = (!sources.is_disassembly(position))
            .then(|| (sources.files()[position.file as usize].name.clone(), position.line));
        self.is_inside = self.wanted.are_in(&self.stack.runs);
        let run = self.stack.runs.last().copied().unwrap_or_default();
        self.match_frames();
        if !self.wanted.contain(run) || self.last_line.is_none() {
            return;
        }
        self.look_at_globals(debugger, &top, run);
        let locals = read_all(debugger, &top, Debugger::locals, &|_| true);
        let is_called = self.stack.runs.iter().rev().nth(1) == Some(&run);
        let record = self.runs.entry(run).or_default();
        let Some(frame) = self.frames.last_mut() else { return };
        // A function that stops where it began has been called anew.
        let is_new = frame.entry.is_none() || is_called && frame.entry == Some(position);
        if let Some(line) = frame.line.filter(|_| !is_new) {
            let line = &mut record.lines[line];
            for variable in &locals {
                let before = frame.locals.iter().find(|one| one.is_same(variable));
                if let Some(value) = variable.value.clone().filter(|_| was_set(line, before, variable)) {
                    line.assign(&variable.name, value);
                }
            }
        }
        let number = *record.numbers.entry((frame.function.clone(), position)).or_insert_with(|| {
            record.lines.push(ExecutedLine {
                file: sources.files()[position.file as usize].name.clone(),
                line: position.line,
                text: sources.text(position).map(str::to_owned),
                function: frame.function.to_string(),
                count: 0,
                values: Vec::new(),
            });
            record.lines.len() - 1
        });
        // The head of a loop begins twice in a turn: its end and its condition.
        let is_loop =
            sources.text(position).is_some_and(|text| LOOPS.iter().any(|way| begins_with(text, way)));
        record.lines[number].count += u64::from(frame.line != Some(number) || !is_loop);
        frame.entry = frame.entry.or(Some(position));
        frame.line = Some(number);
        frame.locals = locals;
        let own = self.frames.iter().rev().take_while(|frame| frame.run == run);
        record.open = own.filter_map(|frame| frame.line).collect();
    }

    /// Drops the functions that have returned, and adds those that were called.
    fn match_frames(&mut self) {
        let (stack, runs) = (&self.stack.frames[self.matched..], &self.stack.runs[self.matched..]);
        let is_same = |open: &OpenFrame, frame: &StackFrame, run: u64| {
            open.run == run
                && open.function == frame.source.function
                && open.scope == frame.source.origin.scope
        };
        let pairs = self.frames[self.matched..].iter().zip(stack.iter().zip(runs));
        let kept = pairs.take_while(|(open, (frame, run))| is_same(open, frame, **run)).count();
        self.frames.truncate(self.matched + kept);
        for (frame, &run) in stack.iter().zip(runs).skip(kept) {
            self.frames.push(OpenFrame {
                run,
                function: frame.source.function.clone(),
                scope: frame.source.origin.scope,
                entry: None,
                line: None,
                locals: Vec::new(),
            });
        }
        self.matched = self.frames.len();
    }

    /// Notes what changed in payloads and the module's own variables since the last stop of a run.
    fn look_at_globals(&mut self, debugger: &mut Debugger, top: &StackFrame, run: u64) {
        let is_followed = |variable: &Variable| {
            matches!(
                variable.kind,
                VariableKind::Payload
                    | VariableKind::CallableData
                    | VariableKind::HitAttribute
                    | VariableKind::Global
            )
        };
        let now = read_all(debugger, top, Debugger::globals, &is_followed);
        let record = self
            .runs
            .entry(run)
            .or_insert_with(|| RunRecord { incoming: incoming_name(debugger, top), ..RunRecord::default() });
        for variable in &now {
            let before = record.globals.iter().find(|one| one.is_same(variable));
            if let (Some(value), true) =
                (variable.value.clone(), before.is_some_and(|before| before.words != variable.words))
            {
                record.assign_global(&variable.name, value);
            }
        }
        record.globals = now;
    }

    /// Writes what was noted into a transcript's steps.
    fn finish(mut self, root: &mut Step) {
        // Other invocations of a workgroup print, too; then it is not known which text is whose.
        let is_certain = self.printed.len() == self.texts;
        walk::for_each_run(root, &mut |run| {
            for text in run.printed.iter_mut().filter(|_| is_certain) {
                (text.file, text.line) = self.printed[text.number].clone().unzip();
            }
            let Some(mut record) = self.runs.remove(&run.run) else { return };
            if let (Some(after), Some(name)) = (&run.payload_after, record.incoming.take()) {
                let before = record.globals.iter().find(|one| one.name == name);
                let before = before.and_then(|one| one.value.as_ref());
                if before.is_some_and(|before| before.content != after.content) {
                    record.assign_global(&name, after.clone());
                }
            }
            run.lines = record.lines;
        });
    }
}

impl RunRecord {
    /// Notes that a variable of the module was set: by the innermost open function whose line names
    /// it, else by the innermost.
    fn assign_global(&mut self, name: &str, value: TypedValue) {
        let names = |line: &&usize| self.lines[**line].text.as_ref().is_some_and(|text| has_word(text, name));
        if let Some(&line) = self.open.iter().find(names).or(self.open.first()) {
            self.lines[line].assign(name, value);
        }
    }
}

impl Seen {
    /// Whether it is the same variable.
    fn is_same(&self, other: &Self) -> bool {
        self.name == other.name && self.declared_line == other.declared_line
    }
}

/// The values of variables of a frame.
fn read_all(
    debugger: &mut Debugger,
    frame: &StackFrame,
    variables: fn(&mut Debugger, &StackFrame) -> Vec<Variable>,
    is_followed: &dyn Fn(&Variable) -> bool,
) -> Vec<Seen> {
    let all = variables(debugger, frame);
    debugger.with_lane(frame, |lane| {
        let seen = |variable: Variable| {
            let words = variable.place.words(lane).ok().filter(|words| words.len() <= MAX_WORDS);
            let value = words.as_ref().and_then(|_| variable.place.value(lane).ok());
            Seen {
                name: variable.name,
                declared_line: variable.declared_line,
                is_declared: variable.is_declared,
                words,
                value,
            }
        };
        all.into_iter().filter(is_followed).map(seen).collect()
    })
}

/// The name of the payload or callable data that the shader of a frame was given.
fn incoming_name(debugger: &Debugger, frame: &StackFrame) -> Option<String> {
    let module = &debugger.sources().shader(frame.shader).program.module;
    let classes = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA];
    let variable = module.variables.iter().find(|one| classes.contains(&one.storage_class))?;
    module.name(variable.id).map(str::to_owned)
}

/// Whether a line set a variable: its value or its being declared changed, or the line's only
/// statement assigns to it.
fn was_set(line: &ExecutedLine, before: Option<&Seen>, now: &Seen) -> bool {
    let Some(before) = before else { return now.is_declared && now.declared_line == Some(line.line) };
    if !now.is_declared {
        return false;
    }
    let assigns = || line.text.as_ref().is_some_and(|text| is_assignment(text, &now.name));
    // Where its declaration is passed by a jump, no line has set it.
    let is_named = || line.text.as_ref().is_none_or(|text| has_word(text, &now.name));
    before.words != now.words || !before.is_declared && is_named() || assigns()
}

/// Whether the text of a line is an assignment to a variable, whatever else runs: `x = 0;`.
fn is_assignment(text: &str, name: &str) -> bool {
    const WAYS: [&str; 6] = ["if", "else", "for", "while", "case", "?"];
    let target = text.trim_start().strip_prefix(name).map(str::trim_start);
    let is_simple = target.is_some_and(|rest| {
        let rest = rest.strip_prefix(['+', '-', '*', '/', '|', '&', '^']).unwrap_or(rest);
        rest.starts_with('=') && !rest.starts_with("==")
    });
    is_simple && !WAYS.iter().any(|way| has_word(text, way))
}

/// Whether a text begins with a whole word.
fn begins_with(text: &str, word: &str) -> bool {
    let rest = text.trim_start().strip_prefix(word);
    rest.is_some_and(|rest| !rest.starts_with(|letter: char| letter.is_alphanumeric() || letter == '_'))
}

/// Whether a text has a name in it as a whole word.
fn has_word(text: &str, word: &str) -> bool {
    let is_part = |letter: Option<char>| letter.is_some_and(|one| one.is_alphanumeric() || one == '_');
    text.match_indices(word).any(|(at, _)| {
        !is_part(text[..at].chars().next_back()) && !is_part(text[at + word.len()..].chars().next())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_assignment_is_told_from_a_conditional_one() {
        assert!(is_assignment("x = 0;", "x"));
        assert!(is_assignment("  sum += x;", "sum"));
        assert!(!is_assignment("sum += x;", "x"));
        assert!(!is_assignment("x == 0;", "x"));
        assert!(!is_assignment("x = a ? b : c;", "y"));
        assert!(!is_assignment("if (a) x = 0;", "x"));
        assert!(!is_assignment("xy = 0;", "x"));
    }

    #[test]
    fn a_word_is_whole() {
        assert!(has_word("prd.x = 1;", "prd"));
        assert!(!has_word("prd2.x = 1;", "prd"));
        assert!(has_word("a(n)", "n"));
        assert!(!has_word("min", "n"));
    }
}
