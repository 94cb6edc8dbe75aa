//! `anyhit dap`: sessions as editors hold them, written down in `tests/debugger/dap/*.jsonl`, and
//! input that no editor sends.
//!
//! A line of a session is a request with the response that is expected to be the next message
//! (`request`, `arguments`, and `body` or `error`), a request whose response comes later (`send`),
//! a response (`response`, and `body` or `error`) or an event (`event`, `body`) that is expected
//! next, or a comment (`note`). Of an expected object only the members that it has are compared; an
//! array whose last item is `"..."` may go on. `"$name"` stands for any value and remembers it, and
//! for that value from then on; `{root}` stands for this repository's folder.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Map, Value, json};

/// The program, as an editor runs it.
pub(super) struct Adapter {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    seq: i64,
}

impl Adapter {
    pub(super) fn start() -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_anyhit"))
            .args(["dap", "--fuel", "1000000000000"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program");
        let input = child.stdin.take();
        let output = BufReader::new(child.stdout.take().expect("its output"));
        Self { child, input, output, seq: 0 }
    }

    fn write(&mut self, bytes: &[u8]) {
        let input = self.input.as_mut().expect("an open input");
        input.write_all(bytes).and_then(|()| input.flush()).expect("the program reads");
    }

    fn send(&mut self, message: &Value) {
        let text = message.to_string();
        self.write(format!("Content-Length: {}\r\n\r\n{text}", text.len()).as_bytes());
    }

    pub(super) fn request(&mut self, command: &str, arguments: &Value) -> i64 {
        self.seq += 1;
        let mut message = json!({ "seq": self.seq, "type": "request", "command": command });
        if !arguments.is_null() {
            message["arguments"] = arguments.clone();
        }
        self.send(&message);
        self.seq
    }

    /// The next message; `None` where the program has ended.
    pub(super) fn receive(&mut self) -> Option<Value> {
        let mut header = String::new();
        if self.output.read_line(&mut header).expect("a header") == 0 {
            return None;
        }
        let length = header.trim().strip_prefix("Content-Length: ").expect("a length");
        let mut blank = String::new();
        self.output.read_line(&mut blank).expect("the end of the header");
        assert_eq!(blank, "\r\n");
        let mut text = vec![0; length.parse().expect("a length")];
        self.output.read_exact(&mut text).expect("a whole message");
        Some(serde_json::from_slice(&text).expect("JSON"))
    }
}

impl Drop for Adapter {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Whether a value is as expected; where not, the path to the difference.
fn compare(
    expected: &Value,
    found: &Value,
    names: &mut HashMap<String, Value>,
    path: &str,
) -> Result<(), String> {
    match (expected, found) {
        (Value::String(name), found) if name.starts_with('$') => match names.get(name).cloned() {
            Some(known) => compare(&known, found, names, path),
            None => {
                names.insert(name.clone(), found.clone());
                Ok(())
            }
        },
        (Value::Object(expected), Value::Object(found)) => expected.iter().try_for_each(|(key, value)| {
            let found = found.get(key).unwrap_or(&Value::Null);
            compare(value, found, names, &format!("{path}.{key}"))
        }),
        (Value::Array(expected), Value::Array(found)) => {
            let goes_on = expected.last() == Some(&json!("..."));
            let expected = &expected[..expected.len() - usize::from(goes_on)];
            if found.len() < expected.len() || !goes_on && found.len() > expected.len() {
                return Err(format!("{path} has {} items: {}", found.len(), json!(found)));
            }
            expected.iter().zip(found).enumerate().try_for_each(|(at, (expected, found))| {
                compare(expected, found, names, &format!("{path}[{at}]"))
            })
        }
        (expected, found) if expected == found => Ok(()),
        (expected, found) => Err(format!("{path} is {found}, not {expected}")),
    }
}

/// A value with what known names stand for.
fn filled(value: &Value, names: &HashMap<String, Value>) -> Value {
    match value {
        Value::String(name) if name.starts_with('$') => names.get(name).unwrap_or(value).clone(),
        Value::String(text) => text.replace("{root}", env!("CARGO_MANIFEST_DIR")).into(),
        Value::Array(items) => items.iter().map(|item| filled(item, names)).collect(),
        Value::Object(members) => {
            let all: Map<String, Value> =
                members.iter().map(|(key, value)| (key.clone(), filled(value, names))).collect();
            all.into()
        }
        value => value.clone(),
    }
}

/// Holds a session that is written down.
fn hold(name: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/debugger/dap").join(name);
    let text = std::fs::read_to_string(&path).expect("a session");
    let mut adapter = Adapter::start();
    let mut names: HashMap<String, Value> = HashMap::new();
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let here = format!("{name}:{}", number + 1);
        let step: Value = serde_json::from_str(line).unwrap_or_else(|error| panic!("{here}: {error}"));
        let arguments = filled(&step["arguments"], &names);
        let mut expected = Map::new();
        if let Some(command) = step["request"].as_str() {
            let seq = adapter.request(command, &arguments);
            expected.insert("type".into(), "response".into());
            expected.insert("request_seq".into(), seq.into());
            expected.insert("command".into(), command.into());
            expected.insert("success".into(), step["error"].is_null().into());
            if let Some(message) = step.get("error") {
                expected.insert("message".into(), message.clone());
            }
        } else if let Some(command) = step["send"].as_str() {
            adapter.request(command, &arguments);
            continue;
        } else if let Some(command) = step["response"].as_str() {
            expected.insert("type".into(), "response".into());
            expected.insert("command".into(), command.into());
            expected.insert("success".into(), step["error"].is_null().into());
            if let Some(message) = step.get("error") {
                expected.insert("message".into(), message.clone());
            }
        } else if let Some(event) = step["event"].as_str() {
            expected.insert("type".into(), "event".into());
            expected.insert("event".into(), event.into());
        } else {
            assert!(step["note"].is_string(), "{here}: neither request nor event");
            continue;
        }
        if let Some(body) = step.get("body") {
            expected.insert("body".into(), filled(body, &names));
        }
        let found = adapter.receive().unwrap_or_else(|| panic!("{here}: the program has ended"));
        if let Err(difference) = compare(&expected.into(), &found, &mut names, "message") {
            panic!("{here}: {difference}\nin {found:#}");
        }
    }
}

#[test]
fn visual_studio_code_follows_a_ray_into_its_shaders() {
    hold("vscode-swept-spheres.jsonl");
}

#[test]
fn nvim_dap_goes_back_to_the_beginning() {
    hold("nvim-dap-backwards.jsonl");
}

#[test]
fn zed_debugs_a_slang_module() {
    hold("zed-slang.jsonl");
}

#[test]
fn helix_debugs_a_compute_shader_with_ray_queries() {
    hold("helix-ray-query.jsonl");
}

#[test]
fn a_module_without_debug_information_has_its_disassembly() {
    hold("disassembly.jsonl");
}

#[test]
fn a_trap_stops_before_its_step() {
    hold("trap.jsonl");
}

#[test]
fn findings_of_the_sanitizer_stop() {
    hold("sanitizer.jsonl");
    hold("sanitizer-rays.jsonl");
    hold("sanitizer-subgroup.jsonl");
}

#[test]
fn lanes_of_a_subgroup_are_threads() {
    hold("lanes.jsonl");
}

#[test]
fn data_breakpoints_follow_payloads_and_have_conditions() {
    hold("data-breakpoints.jsonl");
}

#[test]
fn the_console_takes_commands() {
    hold("console.jsonl");
}

#[test]
fn runs_backwards_and_commands_are_cancelled() {
    hold("cancel.jsonl");
}

#[test]
fn names_are_completed_and_values_set_and_copied() {
    hold("values.jsonl");
}

#[test]
fn a_ray_of_a_unit_test_is_debugged() {
    hold("test-case.jsonl");
}

#[test]
fn sources_memory_and_instructions_are_told() {
    hold("requests.jsonl");
}

#[test]
fn requests_that_no_editor_sends_are_refused() {
    hold("hostile.jsonl");
}

#[test]
fn mistakes_of_a_launch_are_shown() {
    hold("launch-errors.jsonl");
}

#[test]
fn a_run_is_paused_and_left() {
    hold("pause.jsonl");
}

/// One editor after the other, on a port that is free.
#[test]
fn editors_connect_to_a_port() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .args(["dap", "--port", "0"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program");
    let mut line = String::new();
    let mut errors = BufReader::new(child.stderr.take().expect("its standard error"));
    errors.read_line(&mut line).expect("a line");
    let address = line.trim().strip_prefix("listening on ").expect("an address");
    assert!(address.starts_with("127.0.0.1:"), "{address}");
    for _ in 0..2 {
        let mut stream = TcpStream::connect(address).expect("a connection");
        let message = json!({ "seq": 1, "type": "request", "command": "disconnect" }).to_string();
        write!(stream, "Content-Length: {}\r\n\r\n{message}", message.len()).expect("it reads");
        let mut header = String::new();
        BufReader::new(stream).read_line(&mut header).expect("a response");
        assert!(header.starts_with("Content-Length: "), "{header}");
    }
    child.kill().and_then(|()| child.wait()).expect("an end");
}

/// What is sent, and a part of the message of the only response.
#[test]
fn broken_frames_are_told_and_skipped() {
    let cases: [(&[u8], &str); 6] = [
        (b"GET / HTTP/1.1\r\n\r\n", "is not a header line"),
        (b"Content-Length: -1\r\n\r\n", "is not a message length"),
        (b"Content-Length: 18446744073709551615\r\n\r\n", "is too long"),
        (b"\r\n\r\n", "has no Content-Length"),
        (b"Content-Length: 4\r\n\r\nnull", "a message is a JSON object"),
        (b"Content-Length: 3\r\n\r\n{\"a", "the message is not valid JSON"),
    ];
    for (bytes, why) in cases {
        let mut adapter = Adapter::start();
        adapter.write(bytes);
        let response = adapter.receive().expect("a response");
        assert_eq!(response["success"], false);
        let message = response["message"].as_str().expect("a message");
        assert!(message.contains(why), "{message}");
        // The next message is found again.
        adapter.request("threads", &Value::Null);
        let response = adapter.receive().expect("a response");
        assert_eq!((&response["command"], &response["success"]), (&json!("threads"), &json!(true)));
    }
}

/// An editor that goes away in the middle of a message ends the program.
#[test]
fn the_end_of_the_input_ends_the_program() {
    let mut adapter = Adapter::start();
    adapter.write(b"Content-Length: 10\r\n\r\n{}");
    adapter.input = None;
    let response = adapter.receive().expect("a response");
    assert!(response["message"].as_str().is_some_and(|text| text.contains("after 2 of the 10 bytes")));
    assert!(adapter.receive().is_none());
    assert!(adapter.child.wait().expect("an end").success());
}

impl Adapter {
    /// The next message of which something holds.
    fn wait_for(&mut self, holds: impl Fn(&Value) -> bool) -> Value {
        loop {
            let message = self.receive().expect("the program goes on");
            if holds(&message) {
                return message;
            }
        }
    }

    /// Stopped at the first line of a scene.
    fn stopped_at_entry() -> Self {
        let mut adapter = Self::start();
        adapter.request("initialize", &json!({ "adapterID": "anyhit" }));
        let scene = "shaders/debugging/negative-pow/scene.toml";
        adapter.request("launch", &json!({ "scene": scene, "pixel": [0, 0], "stopOnEntry": true }));
        adapter.request("configurationDone", &json!({}));
        adapter.wait_for(|message| message["event"] == "stopped");
        adapter
    }
}

/// Carets behind, before and within letters of several bytes or units, and beyond the text.
#[test]
fn completions_take_letters_of_any_size() {
    let mut adapter = Adapter::stopped_at_entry();
    for text in [
        "\u{20ac}",
        "p \u{20ac}",
        ":p \u{1d11e}x",
        "\u{e9}\u{20ac}\u{1d11e}",
        "a\u{301}.",
        "\u{202e}",
        "",
        ":",
        "x\n\u{20ac}y",
    ] {
        for column in [0, 1, 2, 3, 4, 5, 99, -7, i64::MAX, i64::MIN] {
            for line in [Value::Null, json!(0), json!(2), json!(-1), json!(i64::MAX)] {
                let seq =
                    adapter.request("completions", &json!({ "text": text, "column": column, "line": line }));
                let answer = adapter.wait_for(|message| message["request_seq"] == seq);
                assert_eq!(answer["success"], true, "{text:?} {column} {line}: {answer}");
            }
        }
    }
}

/// A client that asks for no page is told of parts that are not listed, and one that copies a value
/// has all of it: 10,100 floats, of which the scene sets two.
#[test]
fn no_value_is_cut_without_a_word() {
    let mut adapter = Adapter::start();
    let mut ask = |command: &str, arguments: Value| {
        let seq = adapter.request(command, &arguments);
        adapter.wait_for(|message| message["request_seq"] == seq)["body"].clone()
    };
    ask("initialize", json!({ "adapterID": "anyhit" }));
    ask(
        "launch",
        json!({ "scene": "tests/debugger/dap/large.toml", "invocation": [0], "stopOnEntry": true }),
    );
    ask("configurationDone", json!({}));
    adapter.wait_for(|message| message["event"] == "stopped");
    let mut ask = |command: &str, arguments: Value| {
        let seq = adapter.request(command, &arguments);
        adapter.wait_for(|message| message["request_seq"] == seq)["body"].clone()
    };
    let shown = ask("evaluate", json!({ "expression": "nearest", "context": "watch" }));
    let of = shown["variablesReference"].clone();
    let list = |body: Value| body["variables"].as_array().expect("variables").clone();
    let all = list(ask("variables", json!({ "variablesReference": of })));
    assert_eq!(all.len(), 10_001);
    assert_eq!((&all[1]["name"], &all[1]["value"]), (&json!("[1]"), &json!("1.5")));
    let more = "100 more are not listed: print one by its index, `[10000]`";
    assert_eq!((&all[10_000]["name"], &all[10_000]["value"]), (&json!("..."), &json!(more)));
    let page = list(ask("variables", json!({ "variablesReference": of, "start": 10_000, "count": 99 })));
    assert_eq!((page.len(), &page[98]["name"]), (99, &json!("[10098]")));
    let copied = ask("evaluate", json!({ "expression": "nearest", "context": "clipboard" }));
    let copied = copied["result"].as_str().expect("a text");
    assert!(copied.starts_with("(0.5, 1.5, 0, 0, ") && copied.ends_with(", 0)"), "{copied:.40}");
    assert_eq!(copied.split(", ").count(), 10_100);
}

/// Every run backwards ends, whatever was cancelled before: the adapter's flag never outlives the
/// message that has raised it.
#[test]
fn a_message_that_was_handled_ends_no_later_run() {
    let mut adapter = Adapter::stopped_at_entry();
    for _ in 0..2 {
        let seq = adapter.request("next", &json!({ "threadId": 1 }));
        adapter.wait_for(|message| message["request_seq"] == seq);
        adapter.wait_for(|message| message["event"] == "stopped");
    }
    for round in 0..150 {
        // One that is answered before the reader has gone on, at times.
        let cancelled = ["cancel", "pause"][round % 2];
        let seq = adapter.request(cancelled, &json!({ "requestId": 1, "threadId": 1 }));
        adapter.wait_for(|message| message["request_seq"] == seq);
        for command in ["next", "stepBack"] {
            let seq = adapter.request(command, &json!({ "threadId": 1 }));
            let answer = adapter.wait_for(|message| message["request_seq"] == seq);
            assert_eq!(answer["success"], true, "{round}: {answer}");
            adapter.wait_for(|message| message["event"] == "stopped");
        }
    }
}
