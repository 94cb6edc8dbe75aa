//! Modules, and the programs that are made of their entry points.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhit::{CompileOptions, DebugInfoLevel, InputLimits, NestedScalars, Source, Stage};
use anyhit_compile::SourceWords;
use anyhit_engine::machine::Binding;
use anyhit_engine::module::constant::ConstantValue;
use anyhit_engine::module::names::capability_name;
use anyhit_engine::program::descriptors::declared;
use anyhit_engine::reflect::lookup::{DataBlock, find_block};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::argument::{self, Argument, Bytes, wrong_class};
use crate::copies::never_changes;
use crate::dtype::{of_block, with_sides};
use crate::error::{invalid, raised};
use crate::numbers::nested;
use crate::place::{Variable, split, variables};
use crate::run::run;

/// A SPIR-V module.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct Module {
    pub(crate) module: Arc<anyhit::Module>,
}

#[pymethods]
impl Module {
    /// Reads a SPIR-V file, or compiles a source of GLSL, Slang, HLSL or WGSL; the extension tells
    /// the language.
    /// Includes are also searched in `include_folders`; `flags` are those of scene files, such as
    /// `-DCOUNT=3`.
    #[staticmethod]
    #[pyo3(signature = (path, *, include_folders=Vec::new(), flags=Vec::new()))]
    fn open(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::path)] path: PathBuf,
        #[pyo3(from_py_with = argument::include_folders)] include_folders: Vec<PathBuf>,
        #[pyo3(from_py_with = argument::compiler_flags)] flags: Vec<String>,
    ) -> PyResult<Self> {
        let words = SourceWords { include_folders, flags, ..SourceWords::default() };
        let limits = InputLimits::default();
        let (module, _) = run(py, || anyhit::Module::open_as(&path, &limits, None, &words))?;
        Ok(Self { module })
    }

    /// Reads the bytes of a SPIR-V module.
    #[staticmethod]
    fn from_spirv(py: Python<'_>, #[pyo3(from_py_with = argument::spirv)] spirv: Bytes) -> PyResult<Self> {
        let module = run(py, || anyhit::Module::from_spirv(&spirv.0))?;
        Ok(Self { module })
    }

    /// Compiles a source text in the language of the name's extension: "shade.rchit",
    /// "shade.slang", "shade.wgsl". Includes are searched beside that name, then in
    /// `include_folders`; `flags` are those of scene files, such as `-DCOUNT=3`.
    #[staticmethod]
    #[pyo3(signature = (name, text, *, include_folders=Vec::new(), flags=Vec::new()))]
    fn from_source(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::name)] name: String,
        #[pyo3(from_py_with = argument::text)] text: String,
        #[pyo3(from_py_with = argument::include_folders)] include_folders: Vec<PathBuf>,
        #[pyo3(from_py_with = argument::compiler_flags)] flags: Vec<String>,
    ) -> PyResult<Self> {
        let words = SourceWords { include_folders, flags, ..SourceWords::default() };
        let module = run(py, || {
            let source = Source::from_text(&*name, text)?;
            let settings = words.settings(Path::new(&name))?.unwrap_or_default();
            let options = settings.over(&CompileOptions::default().debug(DebugInfoLevel::Lines));
            anyhit::Module::compile(&source.include_folders(&settings.include_folders), &options)
        })?;
        Ok(Self { module })
    }

    /// Modules are equal where their words are.
    fn __eq__(&self, other: &Self) -> bool {
        self.module.words == other.module.words
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.module.words.hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes: Vec<u8> = self.module.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        Ok((py.get_type::<Self>().getattr("from_spirv")?, (PyBytes::new(py, &bytes),)))
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

    /// What the module breaks of the specification: one message each, with its rule and the fix.
    fn validate(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let findings = run(py, || Ok(self.module.validate()))?;
        Ok(findings
            .iter()
            .map(|one| {
                format!("{} (word {}): {} ({}); {}", one.name, one.word, one.message, one.rule, one.fix)
            })
            .collect())
    }

    /// The resources that the entry points use, in the order of their bindings.
    #[getter]
    fn bindings(&self) -> Vec<ModuleBinding> {
        let of = |variable: Variable| {
            let Binding { set, binding } = variable.binding;
            let types = declared(&self.module, variable.binding);
            let ty = types.first().map_or("", |ty| ty.name()).to_owned();
            ModuleBinding { name: variable.name, set, binding, ty }
        };
        variables(&self.module).into_iter().map(of).collect()
    }

    /// The dtype of a buffer, by the name of its variable or by set and binding: that of the
    /// elements of a block that is an array, and of the whole block otherwise. The array without a
    /// length that ends a block has `count` elements.
    #[pyo3(signature = (set, binding=None, *, count=0))]
    fn buffer_dtype<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = argument::count)] count: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (place, _) = split(set, binding, None)?;
        let Binding { set, binding } = place.binding([&*self.module])?;
        let block = find_block(&self.module, DataBlock::Buffer(Binding { set, binding })).map_err(raised)?;
        let block =
            block.ok_or_else(|| invalid(format!("no buffer is declared at set {set}, binding {binding}")))?;
        with_sides(py, of_block(py, block, count)?)
    }

    fn __repr__(&self) -> String {
        let entries = self.module.entry_points.iter();
        let entries: Vec<_> = entries.map(|entry| format!("{} {}", entry.stage.name(), entry.name)).collect();
        format!("<anyhit.Module: {}>", entries.join(", "))
    }
}

impl Module {
    /// The module with specialization constants of a dict, by their `SpecId`.
    pub(crate) fn specialized(&self, constants: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(constants) = constants.filter(|given| !given.is_none()) else { return Ok(self.clone()) };
        let constants =
            constants.cast::<PyDict>().map_err(|_| wrong_class("specialization", "dict", constants))?;
        let mut module = (*self.module).clone();
        for (id, value) in constants {
            let id = u32::of("a key of specialization", &id)?;
            let NestedScalars::One(value) = nested("specialization", &value, 0)? else {
                return Err(wrong_class(&format!("specialization[{id}]"), "a number", &value));
            };
            module.specialize(id, value).map_err(raised)?;
        }
        Ok(Self { module: Arc::new(module) })
    }
}

/// A resource of a module: its name, set, binding and descriptor type.
#[pyclass(frozen, eq, hash, get_all, module = "anyhit")]
#[derive(Clone, PartialEq, Eq, Hash)]
pub(crate) struct ModuleBinding {
    /// The name of the variable.
    name: String,
    /// The descriptor set.
    set: u32,
    /// The binding.
    binding: u32,
    /// The descriptor type in the words of scene files: "storage_buffer".
    #[pyo3(name = "type")]
    ty: String,
}

#[pymethods]
impl ModuleBinding {
    /// Element of `Module.bindings`.
    #[new]
    #[pyo3(signature = (name, set, binding, r#type))]
    fn new(
        #[pyo3(from_py_with = argument::name)] name: String,
        #[pyo3(from_py_with = argument::set)] set: u32,
        #[pyo3(from_py_with = argument::binding)] binding: u32,
        #[pyo3(from_py_with = argument::binding_type)] r#type: String,
    ) -> Self {
        Self { name, set, binding, ty: r#type }
    }

    fn __getnewargs__(&self) -> (&str, u32, u32, &str) {
        (&self.name, self.set, self.binding, &self.ty)
    }

    fn __repr__(&self) -> String {
        let Self { name, set, binding, ty } = self;
        format!("ModuleBinding(name={name:?}, set={set}, binding={binding}, type={ty:?})")
    }
}

/// An entry point: its name, and its stage in the specification's words.
#[pyclass(frozen, eq, hash, get_all, module = "anyhit")]
#[derive(Clone, PartialEq, Eq, Hash)]
pub(crate) struct EntryPoint {
    /// The name.
    name: String,
    /// The execution model: "ClosestHitKHR".
    stage: String,
}

#[pymethods]
impl EntryPoint {
    /// Element of `Module.entry_points`.
    #[new]
    fn new(
        #[pyo3(from_py_with = argument::name)] name: String,
        #[pyo3(from_py_with = argument::stage)] stage: String,
    ) -> Self {
        Self { name, stage }
    }

    fn __getnewargs__(&self) -> (&str, &str) {
        (&self.name, &self.stage)
    }

    fn __repr__(&self) -> String {
        format!("EntryPoint(name={:?}, stage={:?})", self.name, self.stage)
    }
}

/// A prepared entry point of a module. What the module breaks of the specification, and what is not
/// supported, is an error here.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct Program {
    pub(crate) program: Arc<anyhit::Program>,
}

#[pymethods]
impl Program {
    /// The entry point with a name; with its stage, where several stages share the name.
    /// `specialization` is a dict of constants by their `SpecId`.
    #[new]
    #[pyo3(
        signature = (module, entry="main".to_owned(), stage=None, *, specialization=None),
        text_signature = "(module, entry='main', stage=None, *, specialization=None)"
    )]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::module)] module: Module,
        #[pyo3(from_py_with = argument::entry)] entry: String,
        #[pyo3(from_py_with = argument::of_stage)] stage: Option<String>,
        specialization: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        Self::of(py, &module.specialized(specialization)?, &entry, stage.as_deref())
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

    /// Programs are equal where their modules, specialization constants and entry points are.
    fn __eq__(&self, other: &Self) -> bool {
        let of = |program: &anyhit::Program| (program.stage, program.name.clone());
        let (module, others) = (&self.program.module, &other.program.module);
        Arc::ptr_eq(&self.program, &other.program)
            || of(&self.program) == of(&other.program)
                && module.words == others.words
                && module.constants == others.constants
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.program.module.words.hash(&mut hasher);
        (self.program.stage.name(), &self.program.name).hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledProgram)> {
        let restore = py.import("anyhit._anyhit")?.getattr("_program")?;
        let module = Module { module: Arc::clone(&self.program.module) };
        let mut constants = Vec::new();
        for constant in &module.module.constants {
            if let (Some(id), ConstantValue::Scalar(bits), true) =
                (constant.spec_id, &constant.value, constant.specializable)
            {
                constants.push((id, *bits));
            }
        }
        Ok((restore, (module, self.name(), self.stage(), constants)))
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.Program: {} {}>", self.program.stage.name(), self.program.name)
    }
}

/// What a pickled program is made of: module, entry point, stage, and the bits of its
/// specialization constants by their `SpecId`.
type PickledProgram = (Module, String, &'static str, Vec<(u32, u64)>);

/// Restores a pickled program.
#[pyfunction]
pub(crate) fn _program(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::module)] module: Module,
    #[pyo3(from_py_with = argument::entry)] entry: String,
    #[pyo3(from_py_with = argument::stage)] stage: String,
    constants: Vec<(u32, u64)>,
) -> PyResult<Program> {
    let mut module = module;
    for (id, bits) in constants {
        Arc::make_mut(&mut module.module).specialize_bits(id, bits).map_err(raised)?;
    }
    Program::of(py, &module, &entry, Some(&stage))
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
pub(crate) enum Shader {
    /// A program.
    Program(Program),
    /// A module whose only entry point is meant.
    Module(Module),
}

impl Argument for Shader {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        match (given.cast::<Program>(), given.cast::<Module>()) {
            (Ok(program), _) => Ok(Self::Program(program.get().clone())),
            (_, Ok(module)) => Ok(Self::Module(module.get().clone())),
            _ => Err(wrong_class(name, "anyhit.Program or anyhit.Module", given)),
        }
    }
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

never_changes!(Module, ModuleBinding, EntryPoint, Program);
