//! The sanitizer: which rules of Vulkan and SPIR-V a shader breaks while it runs, that no driver
//! tells.
//!
//! A [`Sanitizer`] observes a launch, a dispatch or a ray as an
//! [`Observer`](anyhit_engine::machine::Observer): programs that are not optimised, 64 lanes at a
//! time. [`rule`] lists the rules, [`operand_check`] has those about operands of single
//! instructions, a row each; `checks` looks at operations that have run, and spreads what is
//! undefined from registers to registers; `races` orders what several invocations access, and
//! [`unwritten`] knows which memory nobody has filled; `sanitizer` is what they know together;
//! `report` says why.

pub mod cause;
mod checks;
pub mod choices;
pub mod contract;
mod expectations;
pub mod finding;
mod flushed_use;
pub mod formats;
pub mod hit_indices;
mod host_ray;
mod interface_types;
pub mod lane_operands;
pub mod levels;
mod memory_shadow;
pub mod module_checks;
mod names;
mod observer;
pub mod operand_check;
mod payload_use;
pub mod plan;
mod possible_constants;
mod races;
pub mod record;
pub mod report;
pub mod rule;
pub mod sanitizer;
mod stopped;
pub mod structures;
mod surface_point;
pub mod traced_rays;
mod traversal_lints;
pub mod unreached_records;
pub mod unwritten;
mod value_path;
mod warning_reports;
mod word_range;
mod world_reads;

pub use finding::{Finding, Findings, Occurrence, OccurrenceLog};
pub use levels::Levels;
pub use plan::ProgramPlan;
pub use record::FindingRecord;
pub use rule::{Level, Rule, RuleKind};
pub use sanitizer::Sanitizer;
pub use structures::StructureNames;
pub use traced_rays::{PausedRayWatch, RayWatch, SeenRays};
pub use unwritten::{LaunchSize, UnwrittenMemory};
pub use warning_reports::WarningReports;
