//! The module `anyhit._anyhit`: the crate's public face for Python, with numpy arrays for what is
//! many. `anyhit/__init__.py` names what is public, `anyhit/_anyhit.pyi` its types.
//!
//! Names are those of the crate. What its public face lacks is taken from the crates below it.

mod argument;
mod array;
mod bound;
mod compute_test;
mod copies;
mod coverage;
mod debugger;
mod device_buffers;
mod dtype;
mod error;
mod given;
mod images;
mod instance;
mod loaded_scene;
mod module;
mod numbers;
mod outcome;
mod payload;
mod pickled;
mod pipeline;
mod place;
mod run;
mod sampler;
mod scene;
mod shader_test;
mod stress;
mod suite;
mod trace;
mod used;
mod value;
mod words;

use pyo3::prelude::*;

/// Runs ray-tracing shaders (SPIR-V) on the CPU.
#[pymodule]
mod _anyhit {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::compute_test::{ComputeOutcome, ComputeTest};
    #[pymodule_export]
    use crate::coverage::{_record_coverage, _recorded_coverage, Coverage};
    #[pymodule_export]
    use crate::debugger::_serve_editors;
    #[pymodule_export]
    use crate::device_buffers::DeviceBuffers;
    #[pymodule_export]
    use crate::instance::{_instance, Hit, Instance, Ray};
    #[pymodule_export]
    use crate::loaded_scene::{LoadedScene, SceneOutcome};
    #[pymodule_export]
    use crate::module::{_program, EntryPoint, Module, ModuleBinding, Program};
    #[pymodule_export]
    use crate::outcome::{Launched, ShaderOutcome};
    #[pymodule_export]
    use crate::pipeline::Pipeline;
    #[pymodule_export]
    use crate::sampler::Sampler;
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::shader_test::{ExecuteCall, ShaderTest, TraceCall};
    #[pymodule_export]
    use crate::stress::stress;
    #[pymodule_export]
    use crate::suite::{Finished, Suite};
    #[pymodule_export]
    use crate::trace::Traced;

    /// The version of the crate that runs.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
