//! Runs the program in a pseudo-terminal and reads its screen.

use std::fs::File;
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::fs::{Mode, OFlags};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};

/// Time within which a text must appear.
const PATIENCE: Duration = Duration::from_secs(120);

/// Rows of the terminal, enough for every help page.
const ROWS: u16 = 400;

/// The program in a terminal.
pub struct Terminal {
    child: Child,
    keyboard: File,
    screen: Arc<Mutex<Screen>>,
    reader: Option<JoinHandle<()>>,
}

struct Screen {
    parser: vt100::Parser,
    /// All that was printed, with the control sequences.
    printed: Vec<u8>,
}

impl Terminal {
    /// Starts the program in the folder of the repository, in a terminal with so many columns.
    pub fn start(arguments: &[&str], columns: u16) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&master).expect("a pseudo-terminal");
        unlockpt(&master).expect("a pseudo-terminal");
        let name = ptsname(&master, Vec::new()).expect("its name");
        let own =
            rustix::fs::open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).expect("its other end");
        let size = Winsize { ws_row: ROWS, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&own, size).expect("a size");
        let stream = |end: &OwnedFd| Stdio::from(end.try_clone().expect("a descriptor"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
        command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR"));
        command.env("TERM", "xterm-256color").env("HOME", env!("CARGO_TARGET_TMPDIR"));
        // On one thread work takes seconds on machines of many cores, too.
        command.env("RAYON_NUM_THREADS", "1");
        for variable in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "COLUMNS", "XDG_STATE_HOME"] {
            command.env_remove(variable);
        }
        let child = command.stdin(stream(&own)).stdout(stream(&own)).stderr(stream(&own)).spawn();
        let child = child.expect("the command starts");
        drop((command, own));
        let side = |count: u16| NonZeroU16::new(count).expect("a size");
        let parser = vt100::Parser::new(side(ROWS), side(columns), 0);
        let screen = Arc::new(Mutex::new(Screen { parser, printed: Vec::new() }));
        let mut output = File::from(master.try_clone().expect("a descriptor"));
        let shown = Arc::clone(&screen);
        // The terminal's end is read until the program has closed the other one.
        let reader = std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                let mut screen = shown.lock().expect("a screen");
                screen.parser.process(&bytes[..count]);
                screen.printed.extend_from_slice(&bytes[..count]);
            }
        });
        Self { child, keyboard: File::from(master), screen, reader: Some(reader) }
    }

    /// Types a text.
    pub fn write(&mut self, text: &str) {
        self.keyboard.write_all(text.as_bytes()).expect("a terminal");
    }

    /// The lines on the screen, without the empty ones at its end.
    pub fn lines(&self) -> Vec<String> {
        lines(&self.screen.lock().expect("a screen"))
    }

    /// Waits until a text is on the screen, and returns the lines then.
    pub fn wait_for(&self, text: &str) -> Vec<String> {
        self.wait_until(text, &|lines| lines.iter().any(|line| line.contains(text)))
    }

    /// Waits until a condition holds for the lines on the screen, and returns them.
    pub fn wait_until(&self, what: &str, holds: &dyn Fn(&[String]) -> bool) -> Vec<String> {
        let begin = Instant::now();
        loop {
            let has_ended = self.reader.as_ref().is_none_or(JoinHandle::is_finished);
            let lines = self.lines();
            if holds(&lines) {
                return lines;
            }
            let waits = !has_ended && begin.elapsed() < PATIENCE;
            assert!(waits, "not on the screen: {what}\n{}", lines.join("\n"));
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Sends what the terminal sends for Ctrl-C.
    pub fn interrupt(&self) {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, Signal::INT).expect("the program runs");
    }

    /// Waits for the end of the program. Returns its exit code, the lines on the screen, and all
    /// that was printed, with the control sequences.
    pub fn finish(mut self) -> (Option<i32>, Vec<String>, String) {
        let status = self.child.wait().expect("the program ends");
        let reader = self.reader.take().expect("a reader until the end");
        reader.join().expect("the terminal is read");
        let screen = self.screen.lock().expect("a screen");
        (status.code(), lines(&screen), String::from_utf8_lossy(&screen.printed).into_owned())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn lines(screen: &Screen) -> Vec<String> {
    let contents = screen.parser.screen().contents();
    contents.lines().map(|line| line.trim_end().to_owned()).collect()
}

/// Runs the program in a terminal to its end.
pub fn run(arguments: &[&str], columns: u16) -> (Option<i32>, Vec<String>, String) {
    Terminal::start(arguments, columns).finish()
}
