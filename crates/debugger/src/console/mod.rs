//! The debugger's commands as text: what a terminal, or a script, types and is answered. Nothing
//! here reads or writes a file or a terminal.

mod command;
mod completion;
mod embedded;
mod listing;
mod places;
mod script;
pub mod traversal_events;

use std::fmt::Write as _;

use crate::debugger::{
    Breakpoint, BreakpointId, BreakpointPlace, Debugger, LastWrite, StackFrame, Stepping, StopReason,
    Variable, VariableKind, VariablePlace,
};

use command::{Action, help};
pub use command::{COMMANDS, Command};
pub use embedded::CommandEffect;
use listing::Listing;
pub use script::{PROMPT, run_script, transcript};

/// A debugger that understands commands.
#[derive(Debug)]
pub struct Console {
    /// The debugger; an editor steps it, too.
    pub(crate) debugger: Debugger,
    /// The frame that commands are about, counted from the innermost.
    frame: usize,
    /// What is shown at every stop.
    displays: Vec<String>,
    /// What is watched, by the number of its breakpoint: the expression and its place.
    watched: Vec<(u32, String, VariablePlace)>,
    /// How much of the output has been shown.
    shown_output: usize,
    /// Which of the traversal's events at this time was shown last.
    shown_event: Option<usize>,
    /// The last command that an empty line repeats.
    last: Option<String>,
    listing: Listing,
    /// Whether an editor shows what shaders print.
    is_embedded: bool,
    /// What commands did beside their answers.
    effect: CommandEffect,
}

/// What a command is answered.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reply {
    /// The answer; lines end with a newline.
    pub text: String,
    /// Whether the session is over.
    pub quits: bool,
    /// Whether the command was understood and could be done.
    pub failed: bool,
}

impl Console {
    /// Begins a session at the first line. With colours, listings have some.
    pub fn new(mut debugger: Debugger, colours: bool) -> (Self, Reply) {
        let stop = debugger.begin();
        let mut console = Self::unbegun(debugger, Listing::new(colours));
        let text = console.stopped(&stop);
        (console, Reply { text, ..Reply::default() })
    }

    fn unbegun(debugger: Debugger, listing: Listing) -> Self {
        Self {
            debugger,
            frame: 0,
            displays: Vec::new(),
            watched: Vec::new(),
            shown_output: 0,
            shown_event: None,
            last: None,
            listing,
            is_embedded: false,
            effect: CommandEffect::default(),
        }
    }

    /// The debugger.
    pub fn debugger(&mut self) -> &mut Debugger {
        &mut self.debugger
    }

    /// Executes a line. An empty one repeats the last step.
    pub fn execute(&mut self, line: &str) -> Reply {
        let line = line.trim();
        let line = match (line.is_empty(), self.last.clone()) {
            (true, None) => return Reply::default(),
            (true, Some(last)) => last,
            (false, _) => line.to_owned(),
        };
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
        // `b27`, `p/x` and the like are not spelled so.
        let found = match command::find(word) {
            Ok(found) => found,
            Err(why) => return Reply { text: format!("{why}\n"), failed: true, quits: false },
        };
        if found.arguments.is_empty() && !rest.trim().is_empty() {
            let text = format!("`{}` takes no argument: `{}`\n", found.names[0], rest.trim());
            return Reply { text, failed: true, quits: false };
        }
        self.last = found.repeats.then(|| line.clone());
        if found.action == Action::Quit {
            return Reply { quits: true, ..Reply::default() };
        }
        match self.act(found.action, rest.trim()) {
            Ok(text) => Reply { text, ..Reply::default() },
            Err(why) => Reply { text: format!("{why}\n"), failed: true, quits: false },
        }
    }

    fn act(&mut self, action: Action, rest: &str) -> Result<String, String> {
        match action {
            Action::Step(Stepping::Out) => Ok(self.finish()),
            Action::Step(step) => self.steps(rest, |debugger| debugger.step(step)),
            Action::StepBack(step) => self.steps(rest, |debugger| debugger.step_back(step)),
            Action::Continue => self.steps(rest, Debugger::resume),
            Action::ContinueBack => self.steps(rest, Debugger::resume_back),
            Action::Nan => self.steps("", Debugger::resume_to_nan),
            Action::Begin => {
                self.debugger.go_to_first_line();
                Ok(self.stopped(&StopReason::Entry))
            }
            Action::Goto => {
                let time = rest
                    .parse()
                    .map_err(|_| format!("`{rest}` is not a step number; `where` prints the current one"))?;
                self.debugger.seek(time);
                let is_there = self.debugger.time() == time;
                Ok(self.stopped(if is_there { &StopReason::Step } else { &StopReason::End }))
            }
            Action::Until => {
                let place = places::parse(rest, self.current_file().as_deref())?;
                self.until(place)
            }
            Action::Traversal => Ok(self.traversal(false)),
            Action::TraversalBack => Ok(self.traversal(true)),
            Action::LastWrite => {
                let frame = self.selected()?;
                let place = self.debugger.place(&frame, rest)?;
                self.last_write(&frame, &place, rest)
            }
            Action::Break => self.add_breakpoint(rest),
            Action::Log => self.add_log_point(rest),
            Action::Watch => self.add_watch(rest),
            Action::Delete => self.delete(rest),
            Action::Enable => self.enable(rest, true),
            Action::Disable => self.enable(rest, false),
            Action::Breakpoints => Ok(self.list_breakpoints()),
            Action::Print => {
                let frame = self.selected()?;
                let value = self.debugger.evaluate(&frame, rest)?;
                Ok(format!("{rest} = {value}\n"))
            }
            Action::Set => self.set(rest),
            Action::Display => {
                let frame = self.selected()?;
                let value = self.debugger.evaluate(&frame, rest)?;
                self.displays.push(rest.to_owned());
                Ok(format!("{rest} = {value}\n"))
            }
            Action::Undisplay => {
                let count = self.displays.len();
                self.displays.retain(|shown| !rest.is_empty() && shown != rest);
                Ok(format!("{} removed\n", count - self.displays.len()))
            }
            Action::Locals => self.locals(),
            Action::Globals => self.globals(rest),
            Action::Temporaries => {
                let frame = self.selected()?;
                let all = self.debugger.temporaries(&frame);
                Ok(self.variables(&frame, &all))
            }
            Action::Backtrace => Ok(self.backtrace()),
            Action::Frame => self.select(rest),
            Action::Up => self.select_by(rest, true),
            Action::Down => self.select_by(rest, false),
            Action::List => self.list(rest),
            Action::Sources => Ok(self.sources()),
            Action::Instructions => self.instructions(),
            Action::Output => {
                let all: Vec<&str> = self.debugger.output().collect();
                Ok(all.iter().fold(String::new(), |text, line| text + line + "\n"))
            }
            Action::Help => help(rest),
            Action::Quit => Ok(String::new()),
        }
    }

    /// Goes back to who wrote a value last.
    fn last_write(
        &mut self,
        frame: &StackFrame,
        place: &VariablePlace,
        name: &str,
    ) -> Result<String, String> {
        let text = match self.debugger.back_to_last_write(frame, place)? {
            LastWrite::Step(write) => {
                format!("the next step writes {name} = {}\n", place.value_of(&write.after))
            }
            LastWrite::SetByHand => format!("{name} was set by you at step {}\n", self.debugger.time()),
            LastWrite::Nobody => format!("no earlier step writes {name}\n"),
        };
        Ok(text + &self.stopped(&StopReason::Step))
    }

    /// Steps to the caller, and tells what the function that it leaves has returned.
    fn finish(&mut self) -> String {
        let left = self.debugger.stack();
        let stop = self.debugger.step(Stepping::Out);
        let returned = match (&stop, left.first()) {
            (StopReason::Step, Some(frame)) => {
                let value = self.debugger.returned(&left);
                value.map(|value| format!("{} returned {value}\n", frame.source.function))
            }
            _ => None,
        };
        returned.unwrap_or_default() + &self.stopped(&stop)
    }

    /// Steps, several times if a number is given, up to a stop that no step asked for.
    fn steps(
        &mut self,
        count: &str,
        mut step: impl FnMut(&mut Debugger) -> StopReason,
    ) -> Result<String, String> {
        let count: u64 = match count {
            "" => 1,
            text => text.parse().map_err(|_| format!("`{text}` is not a count"))?,
        };
        let mut stop = StopReason::Step;
        for _ in 0..count {
            stop = step(&mut self.debugger);
            if !matches!(stop, StopReason::Step) {
                break;
            }
        }
        Ok(self.stopped(&stop))
    }

    /// Runs on to a place.
    fn until(&mut self, place: BreakpointPlace) -> Result<String, String> {
        let before = self.debugger.breakpoints().to_vec();
        // It is gone before another breakpoint could have its number.
        let id = BreakpointId(u32::MAX);
        let mut with = before.clone();
        with.push(Breakpoint::new(id, place));
        let set = self.debugger.set_breakpoints(with).last().cloned();
        let nowhere = set.as_ref().filter(|set| !set.is_somewhere()).map(|set| set.place.clone());
        if let Some(place) = nowhere {
            self.debugger.set_breakpoints(before);
            return Err(places::nowhere(&place, self.debugger.sources()));
        }
        let stop = self.debugger.resume();
        let mut left = self.debugger.breakpoints().to_vec();
        left.retain(|one| one.id != id);
        self.debugger.set_breakpoints(left);
        match stop {
            StopReason::Breakpoints(ids) if ids.contains(&id) => Ok(self.stopped(&StopReason::Step)),
            StopReason::End => Ok("the place was not reached\n".to_owned() + &self.stopped(&StopReason::End)),
            other => Ok(self.stopped(&other)),
        }
    }

    /// The frame that commands are about.
    fn selected(&self) -> Result<StackFrame, String> {
        let frame = self.debugger.stack().into_iter().nth(self.frame);
        frame
            .ok_or_else(|| "the run has ended (`rnext` steps back, `begin` returns to the first line)".into())
    }

    fn current_file(&self) -> Option<String> {
        let position = self.selected().ok()?.position?;
        Some(self.debugger.sources().files()[position.file as usize].name.clone())
    }

    /// Tells a stop: why, where, the line, what is displayed.
    fn stopped(&mut self, stop: &StopReason) -> String {
        self.frame = 0;
        self.shown_event = None;
        self.effect.stop = Some(stop.clone());
        let mut text = if self.is_embedded { String::new() } else { self.new_output() };
        text += &self.reason(stop);
        let Ok(frame) = self.selected() else { return text };
        text += &self.place_line(&frame);
        for expression in self.displays.clone() {
            let value = match self.debugger.evaluate(&frame, &expression) {
                Ok(value) => value.to_string(),
                Err(why) => format!("<{why}>"),
            };
            let _ = writeln!(text, "  {expression} = {value}");
        }
        text
    }

    /// What shaders have printed since the last stop.
    fn new_output(&mut self) -> String {
        let all: Vec<String> = self.debugger.output().map(str::to_owned).collect();
        let new = all.get(self.shown_output..).unwrap_or_default();
        let text = new.iter().fold(String::new(), |text, line| text + "printed: " + line + "\n");
        self.shown_output = all.len();
        text
    }

    fn reason(&mut self, stop: &StopReason) -> String {
        match stop {
            StopReason::Entry | StopReason::Step => String::new(),
            StopReason::Breakpoints(ids) => {
                let ids: Vec<String> = ids.iter().map(|id| id.0.to_string()).collect();
                let word = if ids.len() == 1 { "breakpoint" } else { "breakpoints" };
                format!("{word} {}\n", ids.join(", "))
            }
            StopReason::Traversal(id) => {
                let mut text = id.map_or_else(String::new, |id| format!("breakpoint {}\n", id.0));
                text += &traversal_events::list(self.debugger.events(), self.debugger.matched_event());
                text
            }
            StopReason::Wrote(write) => {
                let watch = self.debugger.watches().get(write.watch).and_then(|watch| watch.breakpoint);
                let known = watch.and_then(|id| self.watched.iter().find(|(number, ..)| *number == id.0));
                let Some((number, name, place)) = known else {
                    return "the watched value was written\n".into();
                };
                let [before, after] = [&write.before, &write.after].map(|words| place.value_of(words));
                match before == after {
                    true => format!("breakpoint {number}: {name} was written: {after}, as before\n"),
                    false => format!("breakpoint {number}: {name} was written: {before} -> {after}\n"),
                }
            }
            StopReason::Nan => "the previous step produced the first NaN\n".into(),
            StopReason::Findings(findings) => findings.iter().fold(String::new(), |text, finding| {
                format!("{text}{}: {}\n", finding.rule.id, finding.error.message())
            }),
            StopReason::Trap(error) => format!("trapped: {}\n", error.message()),
            StopReason::Interrupted => "interrupted\n".into(),
            StopReason::Beginning => "the start of the run\n".into(),
            StopReason::End => "the end of the run\n".into(),
        }
    }

    fn place_line(&self, frame: &StackFrame) -> String {
        self.listing.stop(self.debugger.sources(), frame)
    }

    fn backtrace(&self) -> String {
        let mut text = String::new();
        for (number, frame) in self.debugger.stack().iter().enumerate() {
            let mark = if number == self.frame { '>' } else { ' ' };
            let _ = writeln!(text, "{mark}{number} {}", self.listing.frame(self.debugger.sources(), frame));
        }
        let _ = writeln!(text, " step {}", self.debugger.time());
        text
    }

    fn select(&mut self, rest: &str) -> Result<String, String> {
        if !rest.is_empty() {
            let number: usize = rest.parse().map_err(|_| format!("`{rest}` is not a frame number"))?;
            let count = self.debugger.stack().len();
            if number >= count {
                return Err(format!("the stack has {count} frames, numbered from 0"));
            }
            self.frame = number;
        }
        let frame = self.selected()?;
        Ok(self.place_line(&frame))
    }

    fn select_by(&mut self, rest: &str, outwards: bool) -> Result<String, String> {
        let count: usize = match rest {
            "" => 1,
            text => text.parse().map_err(|_| format!("`{text}` is not a number of frames"))?,
        };
        let last = self.debugger.stack().len().saturating_sub(1);
        let wanted = match outwards {
            true => self.frame.saturating_add(count).min(last),
            false => self.frame.saturating_sub(count),
        };
        if wanted == self.frame {
            return Err(
                if outwards { "this is the outermost frame" } else { "this is the innermost frame" }.into()
            );
        }
        self.frame = wanted;
        let frame = self.selected()?;
        Ok(self.place_line(&frame))
    }

    fn locals(&mut self) -> Result<String, String> {
        let frame = self.selected()?;
        let all = self.debugger.locals(&frame);
        if all.is_empty() {
            return Ok(format!("{} has no named variables\n", frame.source.function));
        }
        Ok(self.variables(&frame, &all))
    }

    fn globals(&mut self, rest: &str) -> Result<String, String> {
        let frame = self.selected()?;
        let mut all = self.debugger.globals(&frame);
        if !rest.is_empty() {
            let kind = |kind: VariableKind| format!("{kind:?}").to_lowercase();
            all.retain(|one| one.name.contains(rest) || kind(one.kind).contains(&rest.to_lowercase()));
        }
        Ok(self.variables(&frame, &all))
    }

    fn variables(&mut self, frame: &StackFrame, all: &[Variable]) -> String {
        let mut text = String::new();
        let (declared, others): (Vec<_>, Vec<_>) = all.iter().partition(|variable| variable.is_declared);
        for variable in declared {
            let value = self.debugger.with_lane(frame, |lane| match variable.place.value(lane) {
                Ok(value) => value.to_string(),
                Err(why) => format!("<{why}>"),
            });
            let several = all.iter().filter(|other| other.name == variable.name).count() > 1;
            let line = variable.declared_line.filter(|_| several);
            let of_line = line.map_or_else(String::new, |line| format!(" (of line {line})"));
            let _ = writeln!(text, "  {}{of_line} = {value}", variable.name);
        }
        if !others.is_empty() {
            let names: Vec<&str> = others.iter().map(|variable| &*variable.name).collect();
            let _ = writeln!(text, "  not declared yet: {}", names.join(", "));
        }
        text
    }

    fn set(&mut self, rest: &str) -> Result<String, String> {
        let Some((target, value)) = rest.split_once('=') else {
            return Err("`set NAME = EXPRESSION` sets a variable".into());
        };
        let frame = self.selected()?;
        let value = self.debugger.assign(&frame, target.trim(), value.trim())?;
        self.effect.edited = true;
        Ok(format!("{} = {value}\nthe history after this step is discarded\n", target.trim()))
    }

    fn list(&mut self, rest: &str) -> Result<String, String> {
        let position = match rest {
            "" => self.selected()?.position.ok_or("no source line is known here")?,
            text => {
                let place = places::parse(text, self.current_file().as_deref())?;
                let BreakpointPlace::Line { file, line } = place else {
                    return Err(format!("`{text}` is not a line: `list 27`, `list main.rgen:27`"));
                };
                places::find_line(self.debugger.sources(), &file, line)?
            }
        };
        if rest.is_empty() && self.debugger.sources().is_disassembly(position) {
            return self.instructions();
        }
        let current = self.selected().ok().and_then(|frame| frame.position);
        self.listing.around(self.debugger.sources(), position, current)
    }

    fn sources(&self) -> String {
        let sources = self.debugger.sources();
        sources.files().iter().fold(String::new(), |text, file| {
            let note = if file.text.is_some() { "" } else { " (text unavailable)" };
            text + "  " + &file.name + note + "\n"
        })
    }

    fn instructions(&mut self) -> Result<String, String> {
        let frame = self.selected()?;
        Ok(self.listing.instructions(self.debugger.sources(), &frame))
    }

    /// Shows the next of the traversal's events, and runs on where there is none.
    fn traversal(&mut self, backwards: bool) -> String {
        let shown = self.shown_event;
        let events = traversal_events::told(self.debugger.events());
        let next = match (backwards, shown) {
            (false, None) => Some(0),
            (false, Some(at)) => Some(at + 1),
            (true, None) => events.len().checked_sub(1),
            (true, Some(at)) => at.checked_sub(1),
        };
        if let Some(at) = next.filter(|&at| at < events.len()) {
            self.shown_event = Some(at);
            return format!("{} of {}: {}\n", at + 1, events.len(), events[at]);
        }
        let stop = match backwards {
            false => self.debugger.step(Stepping::Traversal),
            true => self.debugger.step_back(Stepping::Traversal),
        };
        let StopReason::Traversal(None) = stop else { return self.stopped(&stop) };
        let text = self.stopped(&StopReason::Step);
        let events = traversal_events::told(self.debugger.events());
        let at = if backwards { events.len().saturating_sub(1) } else { 0 };
        self.shown_event = Some(at);
        let event = events.get(at).cloned().unwrap_or_default();
        format!("{text}{} of {}: {event}\n", at + 1, events.len())
    }

    fn add_breakpoint(&mut self, rest: &str) -> Result<String, String> {
        let spec = places::specification(rest)?;
        let place = places::parse(spec.place, self.current_file().as_deref())?;
        spec.condition.map_or(Ok(()), Debugger::check_expression)?;
        let id = self.debugger.new_breakpoint_id();
        let breakpoint = Breakpoint {
            condition: spec.condition.map(str::to_owned),
            from_hit: spec.from_hit,
            ..Breakpoint::new(id, place)
        };
        self.add(breakpoint)
    }

    fn add_log_point(&mut self, rest: &str) -> Result<String, String> {
        let Some((place, text)) = rest.split_once(char::is_whitespace) else {
            return Err("`log PLACE TEXT` prints a text with {expressions} at a place".into());
        };
        let place = places::parse(place, self.current_file().as_deref())?;
        places::check_log(text)?;
        let id = self.debugger.new_breakpoint_id();
        self.add(Breakpoint { log: Some(text.trim().to_owned()), ..Breakpoint::new(id, place) })
    }

    fn add(&mut self, breakpoint: Breakpoint) -> Result<String, String> {
        let mut all = self.debugger.breakpoints().to_vec();
        all.push(breakpoint);
        let added = self.debugger.set_breakpoints(all).last().cloned();
        let added = added.ok_or("the breakpoint was not kept")?;
        if !added.is_somewhere() {
            let mut all = self.debugger.breakpoints().to_vec();
            all.pop();
            self.debugger.set_breakpoints(all);
            return Err(places::nowhere(&added.place, self.debugger.sources()));
        }
        Ok(places::describe(&added, self.debugger.sources(), self.debugger.time()))
    }

    fn add_watch(&mut self, rest: &str) -> Result<String, String> {
        let frame = self.selected()?;
        let place = self.debugger.place(&frame, rest)?;
        let id = self.debugger.new_breakpoint_id();
        let mut watches = self.debugger.watches().to_vec();
        watches.extend(self.debugger.watches_of(id, &frame, &place)?);
        self.debugger.set_watches(watches);
        self.watched.push((id.0, rest.to_owned(), place));
        Ok(format!("breakpoint {}: where {rest} is written\n", id.0))
    }

    fn delete(&mut self, rest: &str) -> Result<String, String> {
        let wanted = self.numbers(rest)?;
        let mut all = self.debugger.breakpoints().to_vec();
        let mut watches = self.debugger.watches().to_vec();
        all.retain(|one| !wanted.contains(&one.id.0));
        watches.retain(|one| one.breakpoint.is_none_or(|id| !wanted.contains(&id.0)));
        self.debugger.set_breakpoints(all);
        self.debugger.set_watches(watches);
        Ok(format!("{} deleted\n", wanted.len()))
    }

    fn enable(&mut self, rest: &str, enabled: bool) -> Result<String, String> {
        let wanted = self.numbers(rest)?;
        let mut all = self.debugger.breakpoints().to_vec();
        let meant = all.iter_mut().filter(|one| wanted.contains(&one.id.0));
        meant.for_each(|one| one.is_enabled = enabled);
        self.debugger.set_breakpoints(all);
        Ok(self.list_breakpoints())
    }

    /// The numbers of breakpoints that a text names; all without a text.
    fn numbers(&self, text: &str) -> Result<Vec<u32>, String> {
        let breakpoints = self.debugger.breakpoints().iter().map(|one| one.id.0);
        let watches = self.debugger.watches().iter().filter_map(|one| Some(one.breakpoint?.0));
        let mut known: Vec<u32> = breakpoints.chain(watches).collect();
        // A payload is watched in several shaders.
        known.dedup();
        if text.is_empty() {
            return Ok(known);
        }
        let number = |word: &str| word.parse().ok().filter(|number| known.contains(number));
        let named = text.split([' ', ',']).filter(|word| !word.is_empty());
        named.map(|word| number(word).ok_or_else(|| format!("breakpoint {word} does not exist"))).collect()
    }

    fn list_breakpoints(&self) -> String {
        let mut text = String::new();
        for breakpoint in self.debugger.breakpoints() {
            text += &places::describe(breakpoint, self.debugger.sources(), self.debugger.time());
        }
        for (number, name, _) in &self.watched {
            if self.debugger.watches().iter().any(|one| one.breakpoint.is_some_and(|id| id.0 == *number)) {
                let _ = writeln!(text, "breakpoint {number}: where {name} is written");
            }
        }
        if text.is_empty() { "no breakpoints\n".into() } else { text }
    }
}
