//! Reports of findings that are not denied.

use anyhit_base::error::{Error, ErrorReport};
use serde::{Serialize, Serializer};

/// Reports of what a run is only warned of, as errors.
///
/// ```
/// use anyhit::{ComputeTest, Module};
///
/// # fn main() -> anyhit::Result<()> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
/// let module = Module::open("spirv-fixtures/pass/compute/prefix-sum/main.comp.spv")?;
/// let warnings = ComputeTest::new(&module, "main")?.buffer(0, 1, &[0u32; 256]).sanitize()?;
/// assert!(warnings.is_empty(), "{warnings:?}");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
#[must_use = "unread warnings are lost: print them, or assert that there are none"]
pub struct WarningReports(Vec<Error>);

impl WarningReports {
    /// Returns whether nothing was warned of.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The number of reports.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The reports in order.
    #[must_use]
    pub fn iter(&self) -> std::slice::Iter<'_, Error> {
        self.0.iter()
    }

    /// The reports as a slice.
    #[must_use]
    pub fn as_slice(&self) -> &[Error] {
        &self.0
    }

    /// The reports as a list.
    #[must_use]
    pub fn into_vec(self) -> Vec<Error> {
        self.0
    }
}

impl From<Vec<Error>> for WarningReports {
    fn from(reports: Vec<Error>) -> Self {
        Self(reports)
    }
}

impl IntoIterator for WarningReports {
    type Item = Error;
    type IntoIter = std::vec::IntoIter<Error>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a> IntoIterator for &'a WarningReports {
    type Item = &'a Error;
    type IntoIter = std::slice::Iter<'a, Error>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl std::ops::Index<usize> for WarningReports {
    type Output = Error;

    /// # Panics
    /// Where there are fewer reports.
    fn index(&self, index: usize) -> &Error {
        &self.0[index]
    }
}

/// As a list of reports in the form that `--json` of every command has.
impl Serialize for WarningReports {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(self.iter().map(ErrorReport::of))
    }
}
