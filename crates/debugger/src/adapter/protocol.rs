//! Messages of the Debug Adapter Protocol: what a request must be, and how answers are made.
//!
//! The arguments and bodies are the types of `emmy_dap_types`. The messages around them are made
//! here: a request that nobody knows, or whose arguments are wrong, is refused by itself, and its
//! sender told why.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use anyhit_base::error::Error;
use anyhit_base::sorted::json_object;

/// A request of the client.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Request {
    /// Its number, which the response repeats.
    pub seq: i64,
    /// Its name.
    pub command: String,
    /// Its arguments; null where there are none.
    pub arguments: Value,
}

/// Why a request is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    /// The reason, one line.
    pub message: String,
    /// The whole report, which may have several lines.
    pub report: String,
    /// Whether the client is to show it to the user.
    pub is_shown: bool,
}

impl Refusal {
    /// A refusal that the client may show or not.
    pub(super) fn new(message: impl Into<String>) -> Self {
        let message = message.into();
        Self { report: message.clone(), message, is_shown: false }
    }

    /// A refusal that the client is to show to the user.
    pub(super) fn shown(message: impl Into<String>) -> Self {
        Self { is_shown: true, ..Self::new(message) }
    }
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self { message: error.message().to_owned(), report: error.render(), is_shown: true }
    }
}

/// Words on why something has no value or place.
impl From<String> for Refusal {
    fn from(message: String) -> Self {
        Self::new(message)
    }
}

/// The answer to a request: the body of its response.
pub(super) type Answer = Result<Value, Refusal>;

impl Request {
    /// Reads a message.
    ///
    /// # Errors
    /// Where it is no request: with its number, as far as it has one, and why.
    pub(super) fn read(message: Value) -> Result<Self, (i64, Refusal)> {
        let Value::Object(mut message) = message else {
            return Err((0, Refusal::new("a message is a JSON object")));
        };
        let seq = message.get("seq").and_then(Value::as_i64).unwrap_or(0);
        match message.get("type").and_then(Value::as_str) {
            Some("request") => {}
            Some(other) => {
                return Err((seq, Refusal::new(format!("a message of type `{other}` is not a request"))));
            }
            None => return Err((seq, Refusal::new("the message has no `type`"))),
        }
        let Some(command) = message.get("command").and_then(Value::as_str) else {
            return Err((seq, Refusal::new("the request has no `command`")));
        };
        let command = command.to_owned();
        let arguments = message.remove("arguments").unwrap_or(Value::Null);
        Ok(Self { seq, command, arguments })
    }

    /// Its arguments. A member that is null counts as absent, as some clients write absent ones so.
    ///
    /// # Errors
    /// Which of them is missing or of the wrong type.
    pub(super) fn arguments<T: DeserializeOwned>(&self) -> Result<T, Refusal> {
        let arguments = match without_nulls(self.arguments.clone()) {
            Value::Null => Value::Object(Map::new()),
            arguments => arguments,
        };
        let wrong = |error| Refusal::new(format!("the arguments of `{}` are invalid: {error}", self.command));
        serde_json::from_value(arguments).map_err(wrong)
    }
}

/// A body from the protocol's types, without members that are absent.
pub(super) fn body(body: impl Serialize) -> Answer {
    let value = serde_json::to_value(body);
    value.map(without_nulls).map_err(|error| Refusal::new(format!("the response cannot be written: {error}")))
}

/// Messages to the client, in their order.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    last_seq: i64,
    messages: Vec<Value>,
}

impl Outbox {
    /// Adds the response to a request.
    pub(super) fn respond(&mut self, seq: i64, command: &str, answer: Answer) {
        let mut response = json!({ "type": "response", "request_seq": seq, "command": command });
        match answer {
            Ok(body) => {
                response["success"] = true.into();
                if !body.is_null() {
                    response["body"] = body;
                }
            }
            Err(Refusal { message, report, is_shown }) => {
                response["success"] = false.into();
                response["message"] = message.into();
                // Braces of a format stand for variables.
                response["body"] = json!({
                    "error": {
                        "id": 1,
                        "format": "{report}",
                        "variables": { "report": report },
                        "showUser": is_shown,
                    },
                });
            }
        }
        self.send(response);
    }

    /// Adds an event.
    pub(super) fn event(&mut self, event: &str, body: Value) {
        let mut message = json!({ "type": "event", "event": event });
        if !body.is_null() {
            message["body"] = without_nulls(body);
        }
        self.send(message);
    }

    fn send(&mut self, mut message: Value) {
        self.last_seq += 1;
        message["seq"] = self.last_seq.into();
        self.messages.push(message);
    }

    /// Takes the messages.
    pub(super) fn take(&mut self) -> Vec<Value> {
        std::mem::take(&mut self.messages)
    }
}

/// A value without the members that are null, in whatever depth.
fn without_nulls(value: Value) -> Value {
    match value {
        Value::Object(members) => {
            let kept = members.into_iter().filter(|(_, value)| !value.is_null());
            json_object(kept.map(|(name, value)| (name, without_nulls(value))))
        }
        Value::Array(items) => Value::Array(items.into_iter().map(without_nulls).collect()),
        value => value,
    }
}

#[cfg(test)]
mod tests {
    use emmy_dap_types::requests::SetFunctionBreakpointsArguments;

    use super::*;

    #[test]
    fn members_that_are_null_count_as_absent() {
        let message = json!({
            "seq": 3,
            "type": "request",
            "command": "setFunctionBreakpoints",
            "arguments": { "breakpoints": [{ "name": "main", "condition": null }] },
        });
        let request = Request::read(message).unwrap();
        let arguments: SetFunctionBreakpointsArguments = request.arguments().unwrap();
        assert_eq!(arguments.breakpoints[0].condition, None);
    }

    #[test]
    fn what_is_no_request_is_told_with_its_number() {
        let (seq, refusal) = Request::read(json!({ "seq": 9, "type": "event" })).unwrap_err();
        assert_eq!((seq, refusal.message.as_str()), (9, "a message of type `event` is not a request"));
        assert_eq!(Request::read(json!([])).unwrap_err().0, 0);
    }
}
