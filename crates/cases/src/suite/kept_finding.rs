//! Findings as results keep them: what reports print of them, however often they were met.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::source_tree::SourceTree;
use anyhit_base::count::grouped;
use anyhit_base::sorted::SortedMap;
use anyhit_sanitize::{Finding, FindingRecord, Findings, Level};

/// A finding of the sanitizer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptFinding {
    /// What tells it from others of the rule: numbers of modules and the words of instructions.
    key: [u64; 4],
    /// The whole report of one that was met once.
    once: String,
    /// The whole report before and behind how many more times it was met.
    more: [String; 2],
    /// What other formats have of it.
    record: FindingRecord,
}

impl KeptFinding {
    fn of(key: [u64; 4], finding: &Finding) -> Self {
        let counted = |count| Finding { count, ..finding.clone() }.render();
        // No other number of a report is as large.
        let many = counted(u64::MAX);
        let (before, behind) = many.split_once(&grouped(u64::MAX - 1)).unwrap_or((&many, ""));
        Self { key, once: counted(1), more: [before.to_owned(), behind.to_owned()], record: finding.record() }
    }

    /// All findings of a run of a scene, whose paths are found from the root of its repository.
    pub fn all(findings: &Findings, tree: &SourceTree, scene: &Path) -> Vec<Self> {
        let kept = |(key, finding)| {
            let mut kept = Self::of(key, finding);
            tree.place_one(&mut kept.record, scene);
            kept
        };
        findings.with_keys().into_iter().map(kept).collect()
    }

    /// Adds findings to others: those of one key are one, which counts all and has the first's
    /// report.
    pub fn add<'a>(sum: &mut Vec<Self>, more: impl IntoIterator<Item = &'a Self>) {
        let key = |one: &Self| (one.record.rule.clone(), one.key);
        let mut known: SortedMap<_, usize> = sum.iter().enumerate().map(|(at, one)| (key(one), at)).collect();
        for one in more {
            match known.get(&key(one)) {
                Some(&at) => {
                    let count = &mut sum[at].record.count;
                    *count = count.saturating_add(one.record.count);
                }
                None => {
                    known.insert(key(one), sum.len());
                    sum.push(one.clone());
                }
            }
        }
    }

    /// Whether it fails nothing.
    pub fn is_warning(&self) -> bool {
        self.record.level != Level::Deny
    }

    /// The whole report as the terminal shows it.
    pub fn text(&self) -> String {
        let [before, behind] = &self.more;
        match self.record.count {
            0 | 1 => self.once.clone(),
            count => format!("{before}{}{behind}", grouped(count - 1)),
        }
    }

    /// What other formats have of it.
    pub fn record(&self) -> &FindingRecord {
        &self.record
    }
}
