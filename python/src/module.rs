//! Modules, and the programs that are made of their entry points.

use std::path::PathBuf;
use std::sync::Arc;

use anyhit::Stage;
use anyhit_engine::module::names::capability_name;
use pyo3::prelude::*;

use crate::error::invalid;
use crate::run::run;

/// A SPIR-V module.
#[pyclass(frozen, module = "anyhit", from_py_object)]
#[derive(Clone)]
pub(crate) struct Module {
    pub(crate) module: Arc<anyhit::Module>,
}

#[pymethods]
impl Module {
    /// Reads a SPIR-V file, or compiles a source of GLSL, Slang, HLSL or WGSL; the extension tells
    /// the language.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let module = run(py, || anyhit::Module::open(path))?;
        Ok(Self { module })
    }

    /// Reads the bytes of a SPIR-V module.
    #[staticmethod]
    fn from_spirv(py: Python<'_>, spirv: &[u8]) -> PyResult<Self> {
        let module = run(py, || anyhit::Module::from_spirv(spirv))?;
        Ok(Self { module })
    }

    /// Compiles a source text; the extension of the name tells its language: "shade.rchit",
    /// "shade.slang", "shade.wgsl".
    #[staticmethod]
    fn from_source(py: Python<'_>, name: &str, text: &str) -> PyResult<Self> {
        let module = run(py, || anyhit::Module::from_source(name, text))?;
        Ok(Self { module })
    }

    /// The entry points, in the module's order.
    #[getter]
    fn entry_points(&self) -> Vec<EntryPoint> {
        let of = |entry: &anyhit::EntryPoint| EntryPoint {
            name: entry.name.clone(),
            stage: entry.stage.name().to_owned(),
        };
        self.module.entry_points.iter().map(of).collect()
    }

    /// The names of the declared capabilities.
    #[getter]
    fn capabilities(&self) -> Vec<String> {
        self.module.capabilities.iter().map(|&number| capability_name(number).into_owned()).collect()
    }

    /// The names of the declared extensions.
    #[getter]
    fn extensions(&self) -> Vec<String> {
        self.module.extensions.clone()
    }

    /// The names of the imported instruction sets.
    #[getter]
    fn instruction_sets(&self) -> Vec<String> {
        self.module.instruction_sets.clone()
    }

    /// What the compiler of the source warned of.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.module.warnings.iter().map(ToString::to_string).collect()
    }

    fn __repr__(&self) -> String {
        let entries = self.module.entry_points.iter();
        let entries: Vec<_> = entries.map(|entry| format!("{} {}", entry.stage.name(), entry.name)).collect();
        format!("<anyhit.Module: {}>", entries.join(", "))
    }
}

/// An entry point: its name, and its stage in the specification's words.
#[pyclass(frozen, eq, get_all, module = "anyhit")]
#[derive(Clone, PartialEq)]
pub(crate) struct EntryPoint {
    /// The name.
    name: String,
    /// The execution model: "ClosestHitKHR".
    stage: String,
}

#[pymethods]
impl EntryPoint {
    fn __repr__(&self) -> String {
        format!("EntryPoint(name={:?}, stage={:?})", self.name, self.stage)
    }
}

/// A prepared entry point of a module. What the module breaks of the specification, and what is not
/// supported, is an error here.
#[pyclass(frozen, module = "anyhit", from_py_object)]
#[derive(Clone)]
pub(crate) struct Program {
    pub(crate) program: Arc<anyhit::Program>,
}

#[pymethods]
impl Program {
    /// The entry point with a name; with its stage, where several stages share the name.
    #[new]
    #[pyo3(signature = (module, entry="main", stage=None))]
    fn new(py: Python<'_>, module: &Module, entry: &str, stage: Option<&str>) -> PyResult<Self> {
        Self::of(py, module, entry, stage)
    }

    /// The name of the entry point.
    #[getter]
    fn name(&self) -> String {
        self.program.name.clone()
    }

    /// The stage of the entry point.
    #[getter]
    fn stage(&self) -> &'static str {
        self.program.stage.name()
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.Program: {} {}>", self.program.stage.name(), self.program.name)
    }
}

impl Program {
    pub(crate) fn of(py: Python<'_>, module: &Module, entry: &str, stage: Option<&str>) -> PyResult<Self> {
        let module = &module.module;
        let program = match stage {
            None => run(py, || anyhit::Program::of(module, entry)),
            Some(stage) => {
                let stage = self::stage(stage)?;
                run(py, || anyhit::Program::with_stage(module, stage, entry))
            }
        };
        Ok(Self { program: Arc::new(program?) })
    }
}

/// The stage with a name, with or without the suffix of its extension.
fn stage(name: &str) -> PyResult<Stage> {
    let all = [
        Stage::RayGeneration,
        Stage::Intersection,
        Stage::AnyHit,
        Stage::ClosestHit,
        Stage::Miss,
        Stage::Callable,
        Stage::Compute,
    ];
    let found =
        all.into_iter().find(|stage| [stage.name(), stage.name().trim_end_matches("KHR")].contains(&name));
    found.ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|stage| stage.name()).collect();
        invalid(format!("there is no stage `{name}`: it is one of {}", names.join(", ")))
    })
}

/// What a pipeline takes for a shader: a `Program`, or a `Module` with a single entry point.
#[derive(FromPyObject)]
pub(crate) enum Shader {
    /// A program.
    Program(Program),
    /// A module whose only entry point is meant.
    Module(Module),
}

impl Shader {
    pub(crate) fn program(self, py: Python<'_>) -> PyResult<Arc<anyhit::Program>> {
        let module = match self {
            Self::Program(program) => return Ok(program.program),
            Self::Module(module) => module.module,
        };
        let [only] = &module.entry_points[..] else {
            let count = module.entry_points.len();
            return Err(invalid(format!(
                "a module of {count} entry points: `anyhit.Program(module, name)` chooses one"
            )));
        };
        run(py, || anyhit::Program::with_stage(&module, only.stage, &only.name)).map(Arc::new)
    }
}
