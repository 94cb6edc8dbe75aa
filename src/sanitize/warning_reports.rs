//! Reports of findings that are not denied.

use std::ops::Deref;

use crate::error::Error;

/// Reports of what a run is only warned of, as errors: a slice of them.
///
/// ```
/// use anyhit::{ComputeTest, Module};
///
/// # fn main() -> anyhit::Result<()> {
/// let module = Module::open("spirv-fixtures/pass/compute/prefix-sum/main.comp.spv")?;
/// let warnings = ComputeTest::new(&module, "main")?.buffer(0, 1, &[0u32; 256]).sanitize()?;
/// assert!(warnings.is_empty(), "{warnings:?}");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
#[must_use = "warnings that nothing looks at are lost: print them, or assert that there are none"]
pub struct WarningReports(Vec<Error>);

impl WarningReports {
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

impl Deref for WarningReports {
    type Target = [Error];

    fn deref(&self) -> &[Error] {
        &self.0
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
