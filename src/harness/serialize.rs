//! Results for serde. Buffers and images are left out: they are read by name or binding, as
//! [`Value`](crate::Value)s or bytes.

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::error::ErrorReport;
use crate::harness::trace::Traced;
use crate::machine::Exit;
use crate::sanitize::WarningReports;

/// As a word: `returned`, `ignored`, `terminated`, `trapped`.
impl Serialize for Exit {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(match self {
            Self::Returned => "returned",
            Self::Ignored => "ignored",
            Self::Terminated => "terminated",
            Self::Trapped(_) => "trapped",
        })
    }
}

/// As a list of reports in the form that `--json` of every command has.
impl Serialize for WarningReports {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(self.iter().map(ErrorReport::of))
    }
}

/// The closest hit (nothing for a miss), the payload, counts and printed lines.
impl Serialize for Traced {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut fields = to.serialize_struct("Traced", 4)?;
        fields.serialize_field("hit", &(!self.missed()).then(|| self.hit()))?;
        fields.serialize_field("payload", &self.payload)?;
        fields.serialize_field("stats", &self.stats)?;
        fields.serialize_field("printed", &self.printed)?;
        fields.end()
    }
}
