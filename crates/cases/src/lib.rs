//! Tests of scenes and modules.
//!
//! A [`case`] is a `scene.toml` with the expected results in `[expect]`. A [`suite`] runs folders
//! of cases: with [`coverage`], under the sanitizer ([`sanitized`]), in other orders
//! ([`many_seeds`]), with perturbed inputs ([`stability`]), and split over several machines
//! ([`shares`]). [`smoke`] runs every entry point of a module on synthetic inputs. [`init`] writes
//! a first scene for a module.
//!
//! The crate `anyhit` re-exports what its users need; other items may change in any version.

pub mod blame;
pub mod bless;
pub mod case;
mod changed_scalars;
mod check_optimizer;
mod clean_launch;
pub mod cost;
pub mod coverage;
#[cfg(feature = "reports")]
pub mod drawing;
pub mod expect;
pub mod in_order;
pub mod init;
#[cfg(feature = "libtest")]
pub mod libtest;
pub mod loaded_scene;
pub mod many_seeds;
mod module_files;
mod observe;
mod pairs;
#[cfg(feature = "reports")]
pub mod picture_page;
pub mod pixel_cost;
#[cfg(feature = "recordings")]
pub mod recording;
pub mod rendering;
pub mod run;
pub mod sanitized;
pub mod shares;
pub mod smoke;
pub mod source_tree;
pub mod stability;
pub mod suite;
mod tasks;
pub mod typed_scene;
