//! A finding as files and other tools have it.

use std::collections::HashSet;

use serde::{Deserialize, Serialize, Serializer};

use crate::finding::{Finding, Findings};
use crate::rule::Level;
use anyhit_base::error::{ShaderFrame, SourceColumns};

/// What there is to tell of a finding, but for the source lines that a terminal shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FindingRecord {
    /// The id of the rule.
    pub rule: String,
    /// What happens to it.
    pub level: Level,
    /// The kind of the rule.
    pub kind: String,
    /// Whose fault it is: `bug`, `gap` or `stop`.
    pub class: String,
    /// What is wrong.
    pub message: String,
    /// The file, where the module has debug information.
    pub file: Option<String>,
    /// The path of the file from the root of its repository, without `..`, where that was looked
    /// for; that of the module without debug information, that of the scene without a module.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// The file of the module, or its source, of a finding about a shader.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub module: Option<String>,
    /// The line in the file, from 1.
    pub line: Option<usize>,
    /// The columns in the line, where they are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<SourceColumns>,
    /// How often invocations broke the rule here.
    pub count: u64,
    /// `LaunchIdKHR` of the first, in compute shaders `GlobalInvocationId`.
    pub launch_id: [u32; 3],
    /// The stack of shader calls where it was found, innermost first.
    pub stack: Vec<ShaderFrame>,
    /// What else there is to tell.
    pub notes: Vec<String>,
    /// Where the rule stands.
    pub source: String,
    /// What to do.
    pub help: String,
}

impl FindingRecord {
    /// The path by which other tools find the file, as far as it is known.
    pub fn shown_path(&self) -> Option<&str> {
        self.path.as_deref().or(self.file.as_deref())
    }

    /// Its line in a baseline: rule, file and message, whatever launch index met it first; the line
    /// may move.
    pub fn baseline_line(&self) -> String {
        format!("{}\t{}\t{}", self.rule, self.file.as_deref().unwrap_or_default(), self.message)
    }
}

impl Finding {
    /// What there is to tell of it.
    pub fn record(&self) -> FindingRecord {
        let place = self.place();
        FindingRecord {
            rule: self.rule.id.to_owned(),
            level: self.level,
            kind: self.rule.kind.name().to_owned(),
            class: self.rule.kind.class().to_owned(),
            message: self.error.message().to_owned(),
            file: place.map(|(file, _)| file.to_owned()),
            path: None,
            module: self.error.module().map(str::to_owned),
            line: place.map(|(_, line)| line),
            columns: self.columns(),
            count: self.count,
            launch_id: self.launch_id,
            stack: self.stack.clone(),
            notes: self.error.notes().to_vec(),
            source: self.rule.source.to_owned(),
            help: self.rule.help.to_owned(),
        }
    }
}

impl Findings {
    /// What there is to tell of all findings.
    pub fn records(&self) -> Vec<FindingRecord> {
        self.iter().map(Finding::record).collect()
    }

    /// Drops the findings that a baseline lists.
    pub fn forget_known(&mut self, baseline: &str) {
        let known: HashSet<&str> = baseline.lines().map(str::trim_end).collect();
        self.retain(|finding| !known.contains(finding.record().baseline_line().as_str()));
    }
}

impl Serialize for Finding {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.record().serialize(serializer)
    }
}
