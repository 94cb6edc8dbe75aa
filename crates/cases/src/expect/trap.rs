//! `[expect.trap]`: how the launch must end.

use crate::expect::{Difference, Subject};
use anyhit_base::error::{Error, TrapOperands};
use anyhit_engine::machine::TrapCode;
use anyhit_scene::read::{Named, Parse, Spanned, Table, TomlValue};

/// The trap that the launch must end with: a name, or a table.
#[derive(Clone, Debug)]
pub struct TrapExpectation {
    /// The trap's code.
    pub code: Spanned<TrapName>,
    /// The launch index that traps.
    pub launch_id: Option<Spanned<[u32; 3]>>,
    /// The line of the shader's source.
    pub line: Option<Spanned<u32>>,
    /// The message of an abort.
    pub message: Option<Spanned<String>>,
    /// Why this is expected.
    pub because: Option<String>,
}

/// A trap's name in scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrapName(pub TrapCode);

impl Named for TrapName {
    const WHAT: &'static str = "trap";
    const NAMES: &'static [(&'static str, Self)] = &{
        let mut names = [("", Self(TrapCode::Unreachable)); TrapCode::ALL.len()];
        let mut at = 0;
        while at < names.len() {
            names[at] = (TrapCode::ALL[at].name(), Self(TrapCode::ALL[at]));
            at += 1;
        }
        names
    };
}

impl Parse for TrapExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.text().is_some() {
            let code = Spanned::parse(value)?;
            return Some(Self { code, launch_id: None, line: None, message: None, because: None });
        }
        let table = Table::new(value)?;
        let code = table.required("code");
        let launch_id = table.optional("launch_id");
        let line = table.optional("line");
        let message = table.optional("message");
        let because = table.optional("because");
        table.finish();
        Some(Self { code: code?, launch_id, line, message, because })
    }
}

impl TrapExpectation {
    /// Compares the error that ended the launch.
    pub(super) fn check(&self, error: &Error, found: &mut Vec<Difference>) {
        let because = self.because.as_ref();
        let trap = error.trap();
        let code = trap.map(|trap| trap.code);
        // A record without data was told as a missing one, and that name still holds.
        let empty =
            self.code.value.0 == TrapCode::ShaderRecordMissing && code == Some(TrapCode::ShaderRecordEmpty);
        if !empty && code != Some(self.code.value.0) {
            let message = format!("different trap: {error}");
            let mut difference = Difference::new(&self.code.span, message, because).about(invocation(error));
            if let Some(code) = code {
                difference = difference.mended(&self.code.span, format!("\"{}\"", code.name()), because);
            }
            found.push(difference);
            return;
        }
        let Some(trap) = trap else { return };
        if let Some(id) = &self.launch_id
            && trap.launch_id != id.value
        {
            let message = format!("a different invocation trapped: {error}");
            let difference = Difference::new(&id.span, message, because)
                .mended(&id.span, format!("{:?}", trap.launch_id), because)
                .about(Subject::Invocation(trap.launch_id));
            found.push(difference);
        }
        if let Some(line) = &self.line
            && trap.line() != Some(line.value)
        {
            let mut difference =
                Difference::new(&line.span, format!("trapped at a different line: {error}"), because);
            if let Some(other) = trap.line() {
                difference = difference.mended(&line.span, other.to_string(), because);
            }
            found.push(difference);
        }
        if let Some(message) = &self.message {
            let found_message = match &trap.operands {
                TrapOperands::Abort { message } => Some(message),
                _ => None,
            };
            if found_message != Some(&message.value) {
                let text = found_message
                    .map_or("without a message".to_owned(), |text| format!("with the message {text:?}"));
                let difference = Difference::new(&message.span, format!("trapped {text}: {error}"), because);
                found.push(match found_message {
                    Some(text) => difference.mended(&message.span, format!("{text:?}"), because),
                    None => difference,
                });
            }
        }
    }
}

/// The invocation that trapped, where a shader did.
pub(super) fn invocation(error: &Error) -> Subject {
    let trap = error.trap().filter(|trap| trap.frame().is_some());
    trap.map_or(Subject::Launch, |trap| Subject::Invocation(trap.launch_id))
}
