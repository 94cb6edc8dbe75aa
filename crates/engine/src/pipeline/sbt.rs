//! The shader binding table.

use std::sync::Arc;

use crate::accel::RecordIndex;
use crate::machine::{Buffer, ShaderRecord};
use crate::module::interface::Stage;
use crate::pipeline::group::Group;
use crate::program::Program;
use anyhit_base::error::{Error, ErrorKind, Result};

/// A record: a group and the application's data behind its handle.
#[derive(Clone, Debug)]
#[must_use]
pub struct SbtRecord {
    /// Index of the group.
    pub group: u32,
    /// The data, if any: `ShaderRecordBufferKHR` begins at its first byte.
    pub data: Option<Arc<Buffer>>,
}

impl SbtRecord {
    /// A record without data.
    #[must_use]
    pub fn new(group: u32) -> Self {
        Self { group, data: None }
    }

    /// A record with data.
    #[must_use]
    pub fn with_data(group: u32, data: &[u8]) -> Self {
        Self { group, data: Some(Buffer::new(data)) }
    }

    /// The data as an invocation sees it.
    #[doc(hidden)]
    pub fn shader_record(&self) -> Option<ShaderRecord> {
        let data = self.data.clone()?;
        let size = data.size();
        Some(ShaderRecord { data, offset: 0, size })
    }
}

/// The shader binding table: one table for each kind of shader. `None` is a record with a null
/// handle, for which no shader runs.
#[derive(Clone, Debug, Default)]
#[must_use]
pub struct Sbt {
    /// The ray generation record that launches run.
    pub ray_generation: Option<SbtRecord>,
    /// Miss records, by the miss index of a trace.
    pub miss: Vec<Option<SbtRecord>>,
    /// Hit records, by instance offset + geometry index * SBT stride + SBT offset.
    pub hit: Vec<Option<SbtRecord>>,
    /// Callable records, by the SBT index of `OpExecuteCallableKHR`.
    pub callable: Vec<Option<SbtRecord>>,
}

/// Whether an index is beyond the end of a table. A table without records is like one whose handles
/// are all null: an application without such shaders binds no memory for it.
pub(super) fn is_beyond_end(table: &[Option<SbtRecord>], index: RecordIndex) -> bool {
    !table.is_empty() && index.0 >= table.len() as u64
}

impl Sbt {
    /// Checks that every record names a group of its kind.
    pub(super) fn check(&self, programs: &[Arc<Program>], groups: &[Group]) -> Result<()> {
        let tables = [
            ("ray generation", std::slice::from_ref(&self.ray_generation), Some(Stage::RayGeneration)),
            ("miss", &self.miss[..], Some(Stage::Miss)),
            ("hit", &self.hit[..], None),
            ("callable", &self.callable[..], Some(Stage::Callable)),
        ];
        for (table, records, stage) in tables {
            for (at, record) in records.iter().enumerate() {
                let Some(record) = record else { continue };
                let error = |what: String| {
                    Error::new(
                        ErrorKind::InvalidScene,
                        format!("{table} record {at} refers to group {}, {what}", record.group),
                    )
                };
                match (groups.get(record.group as usize), stage) {
                    (None, _) => return Err(error(format!("but the pipeline has {} groups", groups.len()))),
                    (Some(Group::Hit(_)), None) => {}
                    (Some(Group::General(shader)), Some(stage)) => {
                        let found = programs[shader.index()].stage;
                        if found != stage {
                            return Err(error(format!("which is {}", found.name())));
                        }
                    }
                    (Some(Group::Hit(_)), Some(_)) => return Err(error("which is a hit group".into())),
                    (Some(Group::General(_)), None) => return Err(error("which is not a hit group".into())),
                }
            }
        }
        Ok(())
    }
}
