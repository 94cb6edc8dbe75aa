//! Serves editors: messages with their headers over any input and output, files of the disk.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

use serde_json::Value;

use crate::adapter::{Adapter, Host, InterruptFlags};
use anyhit_base::error::{Error, Result};
use anyhit_base::input::InputLimit;
use anyhit_scene::{Files, LoadOptions, ResolvedScene, RunLimits, SceneFiles, load};

/// The most bytes of a message that are read: breakpoints of many files take less.
const MOST_MESSAGE_BYTES: u64 = 16 << 20;
/// The one field of a header that is read, in small letters.
const CONTENT_LENGTH: &str = "content-length";
/// The most bytes of a header line.
const MOST_HEADER_BYTES: u64 = 4096;

/// Serves one editor after the other on a local port; 0 selects a free one. `listening` is called
/// with the address, `ended` with what ended a connection.
///
/// # Errors
/// `Io` where the port is taken.
pub fn listen(
    host: &Rc<dyn Host>,
    port: u16,
    listening: &mut dyn FnMut(SocketAddr),
    ended: &mut dyn FnMut(std::io::Error),
) -> Result<()> {
    let at = |error| Error::io(format!("local port {port}"), error);
    // Other machines have no business here: a debugger reads files.
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(at)?;
    listening(listener.local_addr().map_err(at)?);
    for stream in listener.incoming() {
        let mut stream = stream.map_err(at)?;
        let reading = stream.try_clone().map_err(at)?;
        // An editor that went away is no reason to turn away the next one.
        // A web page that finds the port sends other headers, and gets no second try.
        if let Err(error) = serve(host.clone(), reading, &mut stream, false) {
            ended(error);
        }
    }
    Ok(())
}

/// Files of the disk, and the limits of running.
#[derive(Debug)]
pub struct DiskHost {
    /// Reads files, within limits.
    pub files: SceneFiles,
    /// The limits of what runs, over those of a scene.
    pub limits: RunLimits,
}

impl Host for DiskHost {
    fn scene(&self, path: &Path, options: &LoadOptions) -> Result<ResolvedScene> {
        let mut scene = load(path, &self.files, options)?;
        self.limits.give(&mut scene);
        Ok(scene)
    }

    fn text(&self, path: &Path) -> Option<String> {
        // A module may name any file: no devices, no pipes.
        path.is_file().then_some(())?;
        let bytes = self.files.read_limited(path, InputLimit::SceneBytes).ok()?;
        String::from_utf8(bytes).ok()
    }

    fn absolute(&self, path: &Path) -> PathBuf {
        std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
    }
}

/// Input from the editor.
#[derive(Debug)]
enum Incoming {
    Message(Value),
    /// Bytes that are no message, and why.
    Garbage(String),
}

/// Serves one editor to the end of its session. `recovers` says whether a broken header is skipped.
///
/// # Errors
/// Errors of writing to the editor.
pub fn serve(
    host: Rc<dyn Host>,
    input: impl Read + Send + 'static,
    output: &mut dyn Write,
    recovers: bool,
) -> std::io::Result<()> {
    let flags = InterruptFlags::default();
    let (sender, receiver) = channel();
    let raised = flags.clone();
    // It may wait for input when everything else has ended, and ends with the program.
    std::thread::Builder::new()
        .name("editor".into())
        .spawn(move || read_messages(input, sender, &raised, recovers))?;
    let mut adapter = Adapter::new(host, flags.clone());
    while !adapter.is_over() {
        let Some(incoming) = next(&receiver, &flags, adapter.is_running()) else { break };
        let messages = match incoming {
            Some(Incoming::Message(message)) => adapter.receive(message),
            Some(Incoming::Garbage(why)) => adapter.receive_garbage(&why),
            None => adapter.run(),
        };
        for message in messages {
            write_message(output, &message)?;
        }
    }
    Ok(())
}

/// Returns the next input, or nothing while the invocation runs; `None` if the editor has
/// disconnected.
fn next(receiver: &Receiver<Incoming>, flags: &InterruptFlags, is_running: bool) -> Option<Option<Incoming>> {
    if !is_running {
        return receiver.recv().ok().map(Some);
    }
    // Lowered before looking: a message that comes later raises it again.
    flags.lower();
    match receiver.try_recv() {
        Ok(incoming) => Some(Some(incoming)),
        Err(TryRecvError::Empty) => Some(None),
        Err(TryRecvError::Disconnected) => None,
    }
}

/// Reads messages until the input ends or cannot be followed. `recovers` tells whether a broken
/// header is skipped.
fn read_messages<R: Read>(input: R, sender: Sender<Incoming>, flags: &InterruptFlags, recovers: bool) {
    let mut reader = MessageReader { input: BufReader::new(input), found: None, is_lost: false };
    while let Some((incoming, goes_on)) = reader.next(recovers) {
        let message = match &incoming {
            Incoming::Message(message) => message.clone(),
            Incoming::Garbage(_) => Value::Null,
        };
        flags.announce(Some(&message));
        let is_wanted = sender.send(incoming).is_ok();
        flags.raise();
        if !is_wanted || !goes_on {
            break;
        }
    }
    // Nobody waits for a run any more.
    flags.announce(None);
    drop(sender);
    flags.raise();
}

/// Reads messages from an input.
#[derive(Debug)]
struct MessageReader<R> {
    input: R,
    /// The first line of a header that was found behind something that is no message.
    found: Option<String>,
    /// True after a broken header: the next one is searched for.
    is_lost: bool,
}

impl<R: BufRead> MessageReader<R> {
    /// The next message, or why there is none, and whether another one may follow; `None` at the
    /// end of the input.
    fn next(&mut self, recovers: bool) -> Option<(Incoming, bool)> {
        if std::mem::take(&mut self.is_lost) && !self.skip_to_header() {
            return None;
        }
        match self.message() {
            Ok(None) => None,
            Ok(Some(bytes)) => Some(match serde_json::from_slice(&bytes) {
                Ok(message) => (Incoming::Message(message), true),
                Err(error) => (Incoming::Garbage(format!("the message is not valid JSON: {error}")), true),
            }),
            Err(why) => {
                self.is_lost = true;
                Some((Incoming::Garbage(why), recovers))
            }
        }
    }

    /// The bytes of the next message; `None` at the end of the input.
    fn message(&mut self) -> std::result::Result<Option<Vec<u8>>, String> {
        let mut length = None;
        let mut is_first = true;
        loop {
            let Some(line) = self.header_line()? else {
                return match is_first {
                    true => Ok(None),
                    false => Err("the input ends in the header of a message".into()),
                };
            };
            is_first = false;
            if line.is_empty() {
                break;
            }
            let (name, value) = line
                .split_once(':')
                .ok_or_else(|| format!("`{line}` is not a header line: expected `Content-Length: N`"))?;
            if name.trim().eq_ignore_ascii_case(CONTENT_LENGTH) {
                let number: Option<u64> = value.trim().parse().ok();
                length = Some(number.ok_or_else(|| format!("`{}` is not a message length", value.trim()))?);
            }
        }
        let length = length.ok_or("the header of a message has no Content-Length")?;
        if length > MOST_MESSAGE_BYTES {
            return Err(format!(
                "a message of {length} bytes is too long: the maximum is {MOST_MESSAGE_BYTES}"
            ));
        }
        let mut bytes = Vec::new();
        let read = self.input.by_ref().take(length).read_to_end(&mut bytes);
        read.map_err(|error| format!("the input cannot be read: {error}"))?;
        match bytes.len() as u64 == length {
            true => Ok(Some(bytes)),
            false => Err(format!("the input ends after {} of the {length} bytes of a message", bytes.len())),
        }
    }

    /// A line of a header without its end; `None` at the end of the input.
    fn header_line(&mut self) -> std::result::Result<Option<String>, String> {
        let text = match self.found.take() {
            Some(found) => found,
            None => self.line().map_err(|error| format!("the input cannot be read: {error}"))?,
        };
        if text.is_empty() {
            return Ok(None);
        }
        let line = text.strip_suffix('\n').ok_or("a header line is too long or does not end")?;
        Ok(Some(line.trim_end_matches('\r').to_owned()))
    }

    /// A line, or a part of one that is too long for a header; nothing at the end of the input.
    fn line(&mut self) -> std::io::Result<String> {
        let mut bytes = Vec::new();
        self.input.by_ref().take(MOST_HEADER_BYTES).read_until(b'\n', &mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Skips what is no message up to where a header begins; whether there is one.
    fn skip_to_header(&mut self) -> bool {
        while let Ok(line) = self.line()
            && !line.is_empty()
        {
            // A body ends without a newline.
            let begin = line.to_ascii_lowercase().find(&format!("{CONTENT_LENGTH}:"));
            if let Some(begin) = begin {
                self.found = Some(line[begin..].to_owned());
                return true;
            }
        }
        false
    }
}

fn write_message(output: &mut dyn Write, message: &Value) -> std::io::Result<()> {
    let text = message.to_string();
    write!(output, "Content-Length: {}\r\n\r\n{text}", text.len())?;
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reader(input: &[u8]) -> MessageReader<&[u8]> {
        MessageReader { input, found: None, is_lost: false }
    }

    fn read(bytes: &[u8]) -> std::result::Result<Option<Vec<u8>>, String> {
        reader(bytes).message()
    }

    #[test]
    fn messages_are_framed_by_their_length() {
        assert_eq!(read(b"Content-Length: 2\r\n\r\n{}rest"), Ok(Some(b"{}".to_vec())));
        let both = b"Content-Type: x\ncontent-length:2\n\n[]";
        assert_eq!(read(both), Ok(Some(b"[]".to_vec())));
        assert_eq!(read(b""), Ok(None));
    }

    #[test]
    fn broken_frames_are_told() {
        for (bytes, why) in [
            (&b"{\"seq\":1}\r\n\r\n"[..], "has no Content-Length"),
            (b"Content-Length: x\r\n\r\n", "`x` is not a message length"),
            (b"Content-Length: 99999999999999999999\r\n\r\n", "is not a message length"),
            (b"Content-Length: 999999999999\r\n\r\n", "is too long"),
            (b"Content-Length: 5\r\n\r\n{}", "the input ends after 2 of the 5 bytes"),
            (b"Content-Length: 5\r\n", "the input ends in the header"),
            (b"Content-Length 5\r\n\r\n", "is not a header line"),
            (b"\r\n", "has no Content-Length"),
        ] {
            let found = read(bytes).unwrap_err();
            assert!(found.contains(why), "{found}");
        }
    }

    #[test]
    fn a_broken_header_is_skipped() {
        let bytes = b"Content-Length: x\r\n\r\n{\"seq\":1}Content-Length: 2\r\n\r\n{}Content-Length: 1\n\n7";
        let mut all = reader(bytes);
        let is_broken = |next: Option<(Incoming, bool)>| matches!(next, Some((Incoming::Garbage(_), true)));
        assert!(is_broken(all.next(true)));
        let message = |next| match next {
            Some((Incoming::Message(message), true)) => message,
            other => panic!("{other:?}"),
        };
        assert_eq!(message(all.next(true)), serde_json::json!({}));
        assert_eq!(message(all.next(true)), serde_json::json!(7));
        assert!(all.next(true).is_none());
        // Nothing follows.
        let broken = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n";
        let mut lost = reader(broken);
        assert!(is_broken(lost.next(true)));
        assert!(lost.next(true).is_none());
        assert!(matches!(reader(bytes).next(false), Some((Incoming::Garbage(_), false))));
    }
}
