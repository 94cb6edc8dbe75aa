//! What judges scenes and whole modules.
//!
//! A [`case`] is a `scene.toml` whose `[expect]` says what must come out; a [`suite`] runs folders
//! of them, with [`coverage`], [`sanitized`], through other orders ([`many_seeds`]) and with
//! perturbed inputs ([`stability`]), in parts on several machines ([`shares`]). [`smoke`] runs
//! whatever a module holds on made-up inputs, to see that it runs at all. [`init`] writes a first
//! scene for a module.
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
