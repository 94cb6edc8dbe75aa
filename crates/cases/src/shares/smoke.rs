//! What `anyhit smoke` finds in several modules, or in a share of them.

use std::fmt::Write;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::shares::results::{ShareResult, ShareResults};
use crate::smoke::{SmokeReport, SmokeVerdict};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorClass, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::sorted::{SortedSet, json_object, sort_by_key};

/// What the shares of a run have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SmokeWhole {
    /// How many modules there are.
    pub modules: usize,
    /// A hash of their names.
    pub names: String,
    /// How they are run.
    pub options: String,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SmokeResult {
    /// The modules, in order.
    pub modules: Vec<ModuleResult>,
}

/// What became of a module.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModuleResult {
    /// Its place in the whole run, from 0.
    pub place: usize,
    /// Its file.
    pub file: String,
    /// The worst of it.
    pub verdict: ModuleVerdict,
    /// What is told behind its name.
    pub about: Option<String>,
    /// The class of its error; `None` where all is well.
    pub class: Option<ErrorClass>,
    /// What `--json` of the module by itself has: an object.
    pub json: Map<String, Value>,
}

/// The worst of a module, from the best on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ModuleVerdict {
    /// All entry points that are in scope ran to their end.
    Ok,
    /// All entry points belong to stages that are out of scope.
    OutOfScope,
    /// It has none.
    NoEntryPoints,
    /// Fewer blocks were entered than was asked for.
    TooLittleReached,
    /// The sanitizer denies what is in it.
    Finding,
    /// One trapped.
    Trap,
    /// Something in it is not supported.
    Unsupported,
    /// It exceeds a limit.
    Limit,
    /// It breaks a rule of SPIR-V or Vulkan, or its source does not compile.
    Invalid,
    /// It cannot be read.
    Unreadable,
    /// This program has a bug.
    Bug,
}

impl ModuleVerdict {
    const ALL: [(Self, &'static str); 11] = [
        (Self::Ok, "ok"),
        (Self::OutOfScope, "out of scope"),
        (Self::NoEntryPoints, "no entry points"),
        (Self::TooLittleReached, "too little reached"),
        (Self::Finding, "finding"),
        (Self::Trap, "trap"),
        (Self::Unsupported, "NOT SUPPORTED"),
        (Self::Limit, "limit"),
        (Self::Invalid, "invalid"),
        (Self::Unreadable, "unreadable"),
        (Self::Bug, "BUG IN ANYHIT"),
    ];

    /// The word for it.
    pub fn word(self) -> &'static str {
        Self::ALL.iter().find(|(verdict, _)| *verdict == self).map_or("", |(_, word)| word)
    }

    /// The verdict on a module that ran, given the error that it leads to.
    pub fn of(report: &SmokeReport, error: Option<&Error>) -> Self {
        let is_out_of_scope = |result: SmokeVerdict| result == SmokeVerdict::OutOfScope;
        match (report.worst(), error.map(Error::kind)) {
            (SmokeVerdict::Bug, _) => Self::Bug,
            (SmokeVerdict::Invalid, _) => Self::Invalid,
            (SmokeVerdict::Unsupported, _) => Self::Unsupported,
            (SmokeVerdict::Limit, _) => Self::Limit,
            (SmokeVerdict::Trap, _) => Self::Trap,
            (_, Some(ErrorKind::Finding)) => Self::Finding,
            (_, Some(_)) => Self::TooLittleReached,
            _ if report.entry_points.is_empty() => Self::NoEntryPoints,
            _ if report.entry_points.iter().all(|entry| is_out_of_scope(entry.result)) => Self::OutOfScope,
            _ => Self::Ok,
        }
    }

    /// The verdict on a module that could not be loaded.
    pub fn of_unloaded(error: &Error) -> Self {
        match (error.class(), error.kind()) {
            (ErrorClass::Limit, _) => Self::Limit,
            (ErrorClass::Unsupported, _) => Self::Unsupported,
            (_, ErrorKind::Io) => Self::Unreadable,
            _ => Self::Invalid,
        }
    }
}

impl ModuleResult {
    /// The line about it.
    pub fn text(&self) -> String {
        let about =
            self.about.as_ref().map_or_else(String::new, |about| format!(": {}", escape::line(about)));
        format!("{}  {}{about}\n", self.verdict.word(), escape::line(&self.file))
    }
}

impl SmokeResult {
    /// The shares of a run as one result.
    pub fn of_shares(results: &ShareResults<Self>) -> Self {
        let mut modules: Vec<_> = results.shares().flat_map(|share| share.modules.iter().cloned()).collect();
        sort_by_key(&mut modules, |module| module.place);
        Self { modules }
    }

    /// Whether the shares of a run hold each of its modules once.
    ///
    /// # Errors
    /// `InvalidArgument` where one is in two shards or is none of the run, and where one is in none
    /// though no share is missing.
    pub fn check_shares(results: &ShareResults<Self>) -> Result<()> {
        let all = results.whole().modules;
        let refuse = |message: String| Err(Error::new(ErrorKind::InvalidArgument, message));
        let mut places = SortedSet::new();
        for module in results.shares().flat_map(|share| &share.modules) {
            if module.place >= all {
                return refuse(format!(
                    "module number {} exceeds the {all} modules of the run",
                    module.place
                ));
            }
            if !places.insert(module.place) {
                return refuse(format!("the module `{}` is in two shards", module.file));
            }
        }
        if results.missing().is_empty() && places.len() != all {
            return refuse(format!(
                "all shards together have {} modules, but the run has {all}",
                places.len()
            ));
        }
        Ok(())
    }

    /// How many modules have each verdict that one has.
    fn counts(&self) -> Vec<(ModuleVerdict, usize)> {
        let count = |verdict| self.modules.iter().filter(|module| module.verdict == verdict).count();
        let all = ModuleVerdict::ALL.iter().map(|(verdict, _)| (*verdict, count(*verdict)));
        all.filter(|(_, count)| *count > 0).collect()
    }

    /// `3 modules: 2 ok, 1 trap`
    pub fn summary(&self) -> String {
        let mut out = match self.modules.len() {
            1 => "1 module".to_owned(),
            count => format!("{} modules", grouped(count)),
        };
        for (at, (verdict, count)) in self.counts().into_iter().enumerate() {
            let sign = if at == 0 { ":" } else { "," };
            // Writing to a string does not fail.
            let _ = write!(out, "{sign} {} {}", grouped(count), verdict.word());
        }
        out.push('\n');
        out
    }

    /// All as JSON: `modules`, and `counts` by verdict.
    pub fn json(&self) -> Value {
        let module = |module: &ModuleResult| {
            let mut json = module.json.clone();
            json.insert("file".to_owned(), json!(module.file));
            json.insert("verdict".to_owned(), json!(module.verdict));
            json
        };
        let name = |verdict| json!(verdict).as_str().unwrap_or_default().to_owned();
        let counts =
            json_object(self.counts().into_iter().map(|(verdict, count)| (name(verdict), json!(count))));
        json!({ "modules": self.modules.iter().map(module).collect::<Vec<_>>(), "counts": counts })
    }

    /// The worst class of error of a module: what is wrong with the module itself weighs more than
    /// how it ran.
    pub fn class(&self) -> Option<ErrorClass> {
        let rank = |class: &ErrorClass| match class {
            ErrorClass::Expectation => 0,
            ErrorClass::Trap => 1,
            ErrorClass::Finding => 2,
            ErrorClass::Unsupported => 3,
            ErrorClass::Limit => 4,
            ErrorClass::Other => 5,
        };
        self.modules.iter().filter_map(|module| module.class).max_by_key(rank)
    }
}

impl ShareResult for SmokeResult {
    const COMMAND: &'static str = "smoke";
    type Whole = SmokeWhole;

    fn without_times(&self) -> Self {
        self.clone()
    }
}
