//! The output of shaders (`NonSemantic.DebugPrintf`), collected while they run.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use serde::Serialize;

/// A text that an invocation printed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct PrintedLine {
    /// `LaunchIdKHR` of the invocation.
    pub launch_id: [u32; 3],
    /// The text, as the shader's format makes it.
    pub text: String,
}

/// How many bytes of what shaders print are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrintedBytes(pub u64);

impl Default for PrintedBytes {
    /// 64 MiB
    fn default() -> Self {
        Self(64 << 20)
    }
}

/// What a text takes beside its own bytes.
const OF_A_LINE: u64 = 64;

/// Collects texts from all threads, up to a limit: the first ones in launch order, whatever the
/// order in which they come.
#[derive(Debug, Default)]
pub struct Printed {
    lines: Mutex<Lines>,
}

#[derive(Debug, Default)]
struct Lines {
    /// By z, y and x of the launch index.
    kept: BTreeMap<[u32; 3], Vec<String>>,
    /// What they take.
    bytes: u64,
    /// The first invocation of which a text was cut.
    cut_at: Option<[u32; 3]>,
    /// How many texts were cut.
    cut: u64,
    limit: PrintedBytes,
}

impl Lines {
    /// Drops the last texts until the others keep the limit.
    fn keep(&mut self) {
        while self.bytes > self.limit.0
            && let Some(mut last) = self.kept.last_entry()
        {
            if let Some(text) = last.get_mut().pop() {
                self.bytes -= text.len() as u64 + OF_A_LINE;
                self.cut += 1;
                self.cut_at = Some(*last.key());
            }
            if last.get().is_empty() {
                last.remove();
            }
        }
    }
}

impl Printed {
    /// Adds a text, which is made only if it is kept.
    pub fn push(&self, limit: PrintedBytes, launch_id: [u32; 3], text: impl FnOnce() -> String) {
        let [x, y, z] = launch_id;
        let at = [z, y, x];
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.limit = limit;
        // Those of an invocation behind one that was cut are cut, too.
        if lines.cut_at.is_some_and(|cut_at| at >= cut_at) {
            lines.cut += 1;
            return;
        }
        let text = text();
        lines.bytes += text.len() as u64 + OF_A_LINE;
        lines.kept.entry(at).or_default().push(text);
        lines.keep();
    }

    /// How many texts of an invocation are kept.
    pub fn count_of(&self, [x, y, z]: [u32; 3]) -> usize {
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.kept.get(&[z, y, x]).map_or(0, Vec::len)
    }

    /// Takes all texts so far, in launch order; those of one invocation in the order of printing.
    /// Where some were cut, the last text says how many.
    pub fn take(&self) -> Vec<PrintedLine> {
        let lines = std::mem::take(&mut *self.lines.lock().unwrap_or_else(PoisonError::into_inner));
        let line = |[z, y, x]: [u32; 3], text| PrintedLine { launch_id: [x, y, z], text };
        let each =
            lines.kept.into_iter().flat_map(|(at, texts)| texts.into_iter().map(move |text| line(at, text)));
        let cut = lines.cut_at.map(|at| {
            let many = if lines.cut == 1 {
                "1 more text was".to_owned()
            } else {
                format!("{} more texts were", lines.cut)
            };
            let text = format!(
                "[{many} cut: the limit is printed_bytes = {}, {OF_A_LINE} for each text among them; \
                 raise it in the scene's [pipeline], with --printed-bytes, or with \
                 Resources::printed_bytes]",
                lines.limit.0
            );
            line(at, text)
        });
        each.chain(cut).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(limit: u64, pushed: &[([u32; 3], &str)]) -> (String, usize) {
        let printed = Printed::default();
        for &(id, text) in pushed {
            printed.push(PrintedBytes(limit), id, || text.to_owned());
        }
        let lines = printed.take();
        assert!(printed.take().is_empty());
        let cut = lines.iter().filter(|line| line.text.contains("printed_bytes")).count();
        (lines[..lines.len() - cut].iter().map(|line| line.text.as_str()).collect(), cut)
    }

    const PUSHED: [([u32; 3], &str); 4] =
        [([1, 0, 0], "b"), ([0, 1, 0], "d"), ([0, 0, 0], "a"), ([1, 0, 0], "c")];

    #[test]
    fn texts_come_in_launch_order() {
        assert_eq!(texts(1 << 20, &PUSHED), ("abcd".into(), 0));
    }

    #[test]
    fn the_first_texts_are_kept_in_whatever_order_they_come() {
        // 65 bytes each: three of them are 195.
        for (limit, kept) in [(0, ""), (64, ""), (65, "a"), (194, "ab"), (195, "abc"), (260, "abcd")] {
            let mut pushed = PUSHED;
            for _ in 0..4 {
                pushed.rotate_left(1);
                // Texts of one invocation keep their order.
                if pushed.iter().position(|one| one.1 == "b") < pushed.iter().position(|one| one.1 == "c") {
                    assert_eq!(texts(limit, &pushed), (kept.into(), usize::from(kept.len() < 4)), "{limit}");
                }
            }
        }
    }

    #[test]
    fn what_is_cut_is_counted_and_not_made() {
        let printed = Printed::default();
        for number in 0..1000 {
            printed.push(PrintedBytes(650), [0; 3], || {
                assert!(number <= 10, "text {number} is made");
                "x".to_owned()
            });
        }
        let lines = printed.take();
        assert_eq!(lines.len(), 11);
        assert!(lines[10].text.starts_with("[990 more texts were cut"), "{}", lines[10].text);
    }
}
