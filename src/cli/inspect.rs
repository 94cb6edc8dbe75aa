//! `anyhit inspect`: lists what a module declares and which entry points can run.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use serde::Serialize;

use crate::cli::input::{InputLimitArgs, StrictArgs};
use crate::cli::source::SourceArgs;
use crate::cli::{module_file, output};
use anyhit_base::error::{Error, ErrorKind, ErrorReport, Result};
use anyhit_base::escape;
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::{EntryPoint, InterfaceVariable};
use anyhit_engine::module::names::{
    addressing_model_name, builtin_name, capability_name, memory_model_name, storage_class_name,
};
use anyhit_engine::module::validate::ValidationFinding;
use anyhit_engine::program::{self, obstacles};
use anyhit_engine::reflect::heap::{HeapUse, heap_uses};
use anyhit_engine::reflect::lookup::{base_name, find, name_of, structs};
use anyhit_engine::reflect::table::StructTable;
use anyhit_engine::reflect::{Layout, Rules};
use anyhit_sanitize::module_checks::check_module;
use anyhit_sanitize::{Findings, Levels};
use anyhit_unit_test::host_struct::compare::LayoutComparison;
use anyhit_unit_test::host_struct::source::HostSource;
use anyhit_unit_test::host_struct::{self, HostType};

/// List a module's entry points, interface, requirements, unsupported features and broken rules
///
/// The rules reported are those that the module breaks independently of its inputs.
#[derive(Args, Clone, Debug)]
pub(super) struct InspectArgs {
    /// SPIR-V module or shader source (GLSL, WGSL, Slang, HLSL), or `-` for standard input
    #[arg(value_name = "MODULE", required_unless_present = "layout")]
    module: Option<PathBuf>,
    /// Print the memory layout of structs: offset, size, stride, type and name of each member.
    /// Without a name, print all structs that have offsets; a path such as `Params.sun` follows
    /// members and pointers
    #[arg(long, value_name = "STRUCT", num_args = 0..=1)]
    layout: Option<Option<String>>,
    /// Compare the layout with the host's structs: a Rust file (`.rs`) with `#[repr(C)]` structs,
    /// or a C or C++ header. Without a struct's name, compare all structs that both declare
    #[arg(long, value_name = "FILE", requires = "layout")]
    against: Option<PathBuf>,
    /// Name of the host's struct, if it differs from the shader's
    #[arg(long, value_name = "NAME", requires = "against")]
    host_struct: Option<String>,
    #[command(flatten)]
    how: SourceArgs,
    #[command(flatten)]
    limits: InputLimitArgs,
    #[command(flatten)]
    strict: StrictArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command. Entry points that are not supported are a finding, not an error.
///
/// # Errors
/// What reading, compiling and loading the module reports; `InvalidModule` after the report where
/// [`Module::validate`] finds a fault, or any rule broken under `--strict`.
pub(super) fn run(args: InspectArgs) -> Result<()> {
    let json = args.json;
    let errors = inspect(args).map_err(|error| output::json_error(json, error))?;
    if errors.is_empty() { Ok(()) } else { Err(Error::several(errors)) }
}

/// Prints what is asked for, and returns the differences of compared layouts, or the rules that
/// make the module invalid.
fn inspect(args: InspectArgs) -> Result<Vec<Error>> {
    // In `inspect --layout FILE` what looks like a struct's name is the module.
    let (path, layout) = match (args.module, args.layout) {
        (Some(path), layout) => (path, layout),
        (None, layout) => (PathBuf::from(layout.flatten().unwrap_or_default()), Some(None)),
    };
    if path.as_os_str().is_empty() {
        return Err(Error::new(ErrorKind::InvalidArgument, "no module given: `inspect MODULE --layout`"));
    }
    let module = Arc::new(module_file::read_or_compile(&path, &args.limits.limits(), &args.how.words())?);
    if let (Some(name), Some(file)) = (&layout, &args.against) {
        let host = HostSource::read(file, &args.limits.limits())?;
        return compare_layouts(
            &module,
            &path,
            name.as_deref(),
            &host,
            args.host_struct.as_deref(),
            args.json,
        );
    }
    if let Some(name) = layout {
        print_layouts(&module, &path, name.as_deref(), args.json)?;
        return Ok(Vec::new());
    }
    let strict = args.strict.is_set();
    let report = ModuleReport::of(&module);
    if args.json {
        print_json(&report, &path)?;
    } else {
        output::print(format_args!("{}\n{}", escape::path(&path), report.text(strict)))?;
    }
    let errors = report.validation.iter().filter(|finding| strict || finding.class.is_fault());
    let errors: Vec<Error> = errors.map(ValidationFinding::error).collect();
    // Lowering checks rules on values that it computes.
    let invalid = || report.entry_points.iter().filter_map(|entry| entry.invalid.clone());
    Ok(if errors.is_empty() { invalid().collect() } else { errors })
}

fn print_json(value: &impl Serialize, path: &Path) -> Result<()> {
    let json = serde_json::to_string_pretty(value)
        .map_err(|error| Error::new(ErrorKind::Io, format!("{}: {error}", escape::path(&path))))?;
    output::print(format_args!("{json}\n"))
}

/// Prints the layout of one struct, or of all of a module.
fn print_layouts(module: &Module, path: &Path, name: Option<&str>, json: bool) -> Result<()> {
    let tables = match name {
        Some(name) => vec![StructTable::of(find(module, name)?)],
        None => StructTable::all(module),
    };
    if json {
        return print_json(&tables, path);
    }
    if tables.is_empty() {
        return output::print(format_args!("{}: no struct has a layout\n", escape::path(&path)));
    }
    let texts: Vec<String> = tables.iter().map(StructTable::text).collect();
    output::print(format_args!("{}", texts.join("\n")))
}

/// Compares structs of a module with those of the host, and returns how each differs first.
fn compare_layouts(
    module: &Module,
    path: &Path,
    name: Option<&str>,
    host: &HostSource,
    host_name: Option<&str>,
    json: bool,
) -> Result<Vec<Error>> {
    let compare = |layout, host_type: HostType| {
        let title = format!("{} in {}", host_type.name(), host.name());
        host_struct::compare::compare(layout, &host_type, &title)
    };
    let comparisons = match (name, host_name) {
        (Some(name), _) => {
            let layout = find(module, name)?;
            let found = name_of(module, layout.ty).map(base_name).unwrap_or(name);
            let host_type = match host_name {
                Some(host_name) => host.layout(host_name)?,
                None => host.counterpart(found)?,
            };
            vec![compare(layout, host_type)]
        }
        (None, Some(_)) => {
            let message = "`--host-struct` requires the shader's struct: `--layout STRUCT`";
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
        (None, None) => {
            let mut found = Vec::new();
            for ty in structs(module) {
                let Some(name) = name_of(module, ty).map(base_name) else { continue };
                if host.structs().iter().any(|known| known == name) {
                    found.push(compare(Layout::new(module, ty, Rules::Explicit), host.layout(name)?));
                }
            }
            if found.is_empty() {
                let message = format!("{} and {} share no struct name", escape::path(&path), host.name());
                return Err(Error::new(ErrorKind::InvalidArgument, message)
                    .note("help: name both structs: `--layout STRUCT --host-struct NAME`"));
            }
            found
        }
    };
    if json {
        print_json(&comparisons, path)?;
    } else {
        let equal = comparisons.iter().filter(|one| one.is_equal());
        output::print(format_args!("{}", equal.map(LayoutComparison::text).collect::<String>()))?;
    }
    Ok(comparisons.iter().filter_map(LayoutComparison::error).collect())
}

/// The report on a module, which `--json` prints.
#[derive(Debug, Serialize)]
struct ModuleReport {
    version: String,
    generator: String,
    addressing_model: String,
    memory_model: String,
    capabilities: Vec<String>,
    extensions: Vec<String>,
    instruction_sets: Vec<String>,
    sizes: Sizes,
    debug_info: DebugInfoReport,
    /// The rules that it breaks as a whole.
    validation: Vec<ValidationFinding>,
    entry_points: Vec<EntryReport>,
}

#[derive(Debug, Serialize)]
struct Sizes {
    bytes: usize,
    functions: usize,
    instructions: usize,
    types: usize,
    constants: usize,
    variables: usize,
}

#[derive(Debug, Serialize)]
struct DebugInfoReport {
    names: usize,
    lines: usize,
    source_files: Vec<SourceFile>,
}

#[derive(Debug, Serialize)]
struct SourceFile {
    name: String,
    text: bool,
}

#[derive(Debug, Serialize)]
struct EntryReport {
    name: String,
    stage: &'static str,
    supported: bool,
    /// The rule of the specification that it breaks.
    #[serde(skip)]
    invalid: Option<Error>,
    reasons: Vec<String>,
    errors: Vec<ErrorReport>,
    interface: Vec<VariableReport>,
    /// The descriptors in heaps that it uses.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    heaps: Vec<HeapReport>,
    /// The rules that it breaks whatever its inputs are.
    #[serde(skip_serializing_if = "Findings::is_empty")]
    findings: Findings,
}

/// A descriptor in a heap.
#[derive(Debug, Serialize)]
struct HeapReport {
    /// `ResourceHeapEXT` or `SamplerHeapEXT`.
    heap: String,
    /// The index of the descriptor; none where the shader computes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    index: Option<u32>,
    #[serde(rename = "type")]
    ty: String,
    /// What an access finds in a buffer.
    #[serde(skip_serializing_if = "Option::is_none")]
    block: Option<String>,
}

#[derive(Debug, Serialize)]
struct VariableReport {
    name: String,
    storage_class: String,
    #[serde(rename = "type")]
    ty: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    set: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    binding: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    location: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    builtin: Option<String>,
}

impl ModuleReport {
    fn of(module: &Arc<Module>) -> Self {
        let blocks = module.functions.iter().flat_map(|function| &function.blocks);
        let debug = &module.debug_info;
        let files = debug.files.iter();
        Self {
            version: format!("{}.{}", module.version.0, module.version.1),
            generator: generator_name(module.generator),
            addressing_model: addressing_model_name(module.memory_model.0).into_owned(),
            memory_model: memory_model_name(module.memory_model.1).into_owned(),
            capabilities: module.capabilities.iter().map(|&one| capability_name(one).into_owned()).collect(),
            extensions: module.extensions.clone(),
            instruction_sets: module.instruction_sets.clone(),
            sizes: Sizes {
                bytes: module.words.len() * 4,
                functions: module.functions.len(),
                instructions: blocks.map(|block| block.instructions.len()).sum(),
                types: module.types.len(),
                constants: module.constants.len(),
                variables: module.variables.len(),
            },
            debug_info: DebugInfoReport {
                names: debug.names.len(),
                lines: debug.lines.iter().filter(|(_, line)| line.is_some()).count(),
                source_files: files
                    .map(|file| SourceFile { name: file.name.clone(), text: file.text.is_some() })
                    .collect(),
            },
            validation: module.validate(),
            entry_points: module.entry_points.iter().map(|entry| EntryReport::of(module, entry)).collect(),
        }
    }

    /// Renders the report as text; errors are left to who prints them.
    fn text(&self, strict: bool) -> String {
        let mut out = String::new();
        let list = |items: &[String]| match items {
            [] => "none".to_owned(),
            items => items.join("\n                     "),
        };
        let sizes = &self.sizes;
        let debug = &self.debug_info;
        let files = debug.source_files.iter().map(|file| match file.text {
            true => format!("{} (with its text)", file.name),
            false => file.name.clone(),
        });
        let facts = [
            ("version", format!("SPIR-V {}", self.version)),
            ("generator", self.generator.clone()),
            (
                "size",
                format!(
                    "{} bytes: {} instructions in {} functions, {} types, {} constants, {} variables",
                    sizes.bytes,
                    sizes.instructions,
                    sizes.functions,
                    sizes.types,
                    sizes.constants,
                    sizes.variables
                ),
            ),
            ("memory model", format!("{} {}", self.addressing_model, self.memory_model)),
            ("capabilities", list(&self.capabilities)),
            ("extensions", list(&self.extensions)),
            ("instruction sets", list(&self.instruction_sets)),
            ("debug info", format!("{} names, {} lines", debug.names, debug.lines)),
            ("source files", list(&files.collect::<Vec<_>>())),
        ];
        for (name, value) in facts {
            // Writing to a string does not fail.
            let _ = writeln!(out, "  {name:<17}  {value}");
        }
        for finding in self.validation.iter().filter(|finding| !(strict || finding.class.is_fault())) {
            write_indented(&mut out, &finding.diagnostic(true).render());
        }
        for entry in &self.entry_points {
            entry.write_text(&mut out);
        }
        if self.entry_points.is_empty() {
            out.push_str("\nno entry points\n");
        }
        out
    }
}

impl EntryReport {
    fn of(module: &Arc<Module>, entry: &EntryPoint) -> Self {
        let mut invalid = None;
        let (errors, reasons, findings) = match program::lower(module, entry) {
            Ok(program) => {
                (Vec::new(), Vec::new(), check_module(&program, ShaderIndex(0), &Levels::default()))
            }
            Err(error) => {
                invalid = Some(error.clone()).filter(|error| error.kind() == ErrorKind::InvalidModule);
                (ErrorReport::all(&error), obstacles(module, entry, &error), Findings::default())
            }
        };
        let variables = module.interface_of(entry);
        Self {
            name: entry.name.clone(),
            stage: entry.stage.name(),
            supported: reasons.is_empty(),
            invalid,
            reasons,
            errors,
            interface: variables.iter().map(|variable| VariableReport::of(module, variable)).collect(),
            heaps: heap_uses(module, entry.function).iter().map(|one| HeapReport::of(module, one)).collect(),
            findings,
        }
    }

    fn write_text(&self, out: &mut String) {
        let verdict = match (&self.invalid, self.supported) {
            (Some(_), _) => "INVALID",
            (None, true) => "supported",
            (None, false) => "NOT SUPPORTED",
        };
        let _ = writeln!(out, "\n{} `{}`: {verdict}", self.stage, self.name);
        for reason in &self.reasons {
            let _ = writeln!(out, "  - {reason}");
        }
        let mut rows: Vec<[String; 4]> = self.interface.iter().map(VariableReport::row).collect();
        rows.extend(self.heaps.iter().map(HeapReport::row));
        let mut widths = [0; 4];
        for row in &rows {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = (*width).max(cell.chars().count());
            }
        }
        for row in &rows {
            let mut line = String::new();
            for (cell, width) in row.iter().zip(widths) {
                let _ = write!(line, "  {cell:<width$}");
            }
            let _ = writeln!(out, "{}", line.trim_end());
        }
        for finding in &self.findings {
            write_indented(out, &finding.render());
        }
    }
}

/// Writes a rendered diagnostic behind an empty line.
fn write_indented(out: &mut String, rendered: &str) {
    out.push('\n');
    for line in rendered.trim_end().lines() {
        let _ = writeln!(out, "  {}", line.trim_end());
    }
}

impl HeapReport {
    fn of(module: &Module, one: &HeapUse) -> Self {
        Self {
            heap: builtin_name(one.heap.builtin()).into_owned(),
            index: one.index,
            ty: module.describe_type(one.ty),
            block: one.block.map(|block| module.describe_type(block)),
        }
    }

    /// A line with heap, index, type and the type of a buffer's bytes.
    fn row(&self) -> [String; 4] {
        let index = self.index.map_or_else(|| "computed index".to_owned(), |index| format!("index {index}"));
        [self.heap.clone(), index, self.ty.clone(), self.block.clone().unwrap_or_default()]
    }
}

impl VariableReport {
    fn of(module: &Module, variable: &InterfaceVariable) -> Self {
        Self {
            name: variable.name.clone(),
            storage_class: storage_class_name(variable.storage_class).into_owned(),
            ty: variable.ty.map_or_else(|| "untyped".to_owned(), |ty| module.describe_type(ty)),
            set: variable.descriptor_set,
            binding: variable.binding,
            location: variable.location,
            builtin: variable.builtin.map(|number| builtin_name(number).into_owned()),
        }
    }

    /// A line with storage class, binding, type and name.
    fn row(&self) -> [String; 4] {
        let numbers = [("set", self.set), ("binding", self.binding), ("location", self.location)];
        let bound =
            numbers.iter().filter_map(|(word, number)| number.map(|number| format!("{word} {number}")));
        let bound = self.builtin.iter().cloned().chain(bound).collect::<Vec<_>>().join(" ");
        [self.storage_class.clone(), bound, self.ty.clone(), self.name.clone()]
    }
}

/// The tool that made a module, by the registry of SPIR-V generators.
fn generator_name(word: u32) -> String {
    let (tool, version) = (word >> 16, word & 0xffff);
    let name = match tool {
        6 => "Khronos LLVM/SPIR-V Translator",
        7 => "Khronos SPIR-V Tools Assembler",
        8 => "Khronos Glslang Reference Front End",
        13 => "Google Shaderc over Glslang",
        14 => "Google spiregg (DirectX Shader Compiler)",
        28 => "gfx-rs Naga",
        40 => "NVIDIA Slang Compiler",
        _ => return format!("generator {tool}, version {version}"),
    };
    format!("{name}, version {version}")
}
