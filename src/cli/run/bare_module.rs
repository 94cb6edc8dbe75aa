//! A module's compute shader without a scene file: the scene is made from the command line.
//!
//! The arguments become the text of a scene file, so that their values are written and checked as
//! in any other scene. Nobody sees this text: errors in it are reported at the flag behind them
//! ([`CommandLineScene::reported`]). Resources that the shader binds and the command line does not
//! mention are made by reflection, filled with zeros.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::cli::run::dump::{binding, invalid};
use crate::cli::{module_file, numbers};
use anyhit_base::error::{Error, ErrorKind, Place, Relocation, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, read_argument};
use anyhit_compile::{CompileOptions, DebugInfoLevel, Language, SourceSettings};
use anyhit_engine::machine::Binding;
use anyhit_engine::math::array;
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::{EntryPoint, InterfaceVariable, Stage};
use anyhit_engine::module::ty::{ImageType, Type};
use anyhit_engine::ops::image::declared::declared_format;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::program::Program;
use anyhit_scene::image::format_name;
use anyhit_scene::read::{Diagnostics, Document};
use anyhit_scene::specialization::{SpecializationKey, SpecializationValue};
use anyhit_scene::{Files, LoadOptions, ResolvedScene, load_text};

/// The arguments that a bare module needs and a scene file holds itself.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct Arguments {
    /// Compute entry point, if the module has several
    #[arg(long, value_name = "NAME")]
    entry: Option<String>,
    /// Workgroups along x, y and z [default: 1,1,1]
    #[arg(long, value_name = "X[,Y[,Z]]")]
    groups: Option<String>,
    /// Push constants, as in a scene file: "u32 = 3" or "[{ u32 = 3 }, { f32 = [1, 2] }]"
    #[arg(long, value_name = "DATA")]
    push: Option<String>,
    /// Value of a specialization constant, by its `constant_id` or its name
    #[arg(long, value_name = "ID=VALUE")]
    spec: Vec<String>,
    /// Content of a buffer: a size in bytes, data as in a scene file, or a file [default: zeros,
    /// with one element of a runtime array per invocation]. `1@ADDRESS=...` places it at a device
    /// address, `1@=...` at an automatic one; an empty value selects the default content.
    /// `NAME@ADDRESS=...` and `NAME@=...` declare buffers without a binding
    #[arg(long, value_name = "([SET,]BINDING|NAME)[@[ADDRESS]]=SIZE|DATA|FILE")]
    buffer: Vec<String>,
    /// Image: a size with a format, or a file [default for a storage image: one texel per
    /// invocation]
    #[arg(long, value_name = "[SET,]BINDING=WxH[,FORMAT]|FILE")]
    image: Vec<String>,
    /// SubgroupSize [default: 32]
    #[arg(long, value_name = "N", value_parser = numbers::subgroup_size)]
    subgroup_size: Option<u32>,
}

impl Arguments {
    /// The flags that are given, with their values.
    pub(super) fn flags(&self) -> Vec<(&'static str, Option<String>)> {
        let mut flags = vec![
            ("--entry", self.entry.clone()),
            ("--groups", self.groups.clone()),
            ("--push", self.push.clone()),
            ("--subgroup-size", self.subgroup_size.map(|size| size.to_string())),
        ];
        let several = [("--spec", &self.spec), ("--buffer", &self.buffer), ("--image", &self.image)];
        let values = several.into_iter().flat_map(|(flag, values)| values.iter().map(move |one| (flag, one)));
        flags.extend(values.map(|(flag, value)| (flag, Some(value.clone()))));
        flags
    }
}

/// A resource given on the command line. Without an element it is the default of all elements that
/// are not given one by one.
struct ResourceArgument {
    /// The argument: `--buffer 0=64`.
    flag: String,
    binding: Binding,
    element: Option<u32>,
    /// The device address of a buffer as the scene writes it.
    address: Option<String>,
    value: String,
}

impl ResourceArgument {
    fn list(name: &str, all: &[String]) -> Result<Vec<Self>> {
        let given = all.iter().map(|text| {
            let parts = text.split_once('=').and_then(|(at, value)| {
                let (at, address) = match at.split_once('@') {
                    Some((at, address)) if name == "buffer" => (at, Some(address_value(address))),
                    _ => (at, None),
                };
                Some((binding(at)?, address, value))
            });
            match parts {
                Some(((binding, element), address, value)) => {
                    let (flag, value) = (format!("--{name} {text}"), value.trim().to_owned());
                    Ok(Self { flag, binding, element, address, value })
                }
                None => Err(invalid(format!("`--{name} {text}` is not [SET,]BINDING=..."))),
            }
        });
        let given: Vec<Self> = given.collect::<Result<_>>()?;
        for (index, one) in given.iter().enumerate() {
            let is_same = |other: &&Self| other.binding == one.binding && other.element == one.element;
            if let Some(other) = given[..index].iter().find(is_same) {
                return Err(invalid(format!("`{}` and `{}` name the same binding", other.flag, one.flag)));
            }
        }
        Ok(given)
    }
}

/// The files of the made scene: the module's is in memory, others are named by the command line,
/// too.
struct ModuleAndDisk {
    path: PathBuf,
    bytes: Vec<u8>,
    limits: InputLimits,
    /// Whether a module that lacks a declaration is rejected.
    strict: bool,
}

impl Files for ModuleAndDisk {
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>> {
        match path == self.path {
            true => Ok(self.bytes.clone()),
            false => read_argument(path, limit, &self.limits),
        }
    }

    fn limits(&self) -> InputLimits {
        self.limits
    }

    fn strict(&self) -> bool {
        self.strict
    }

    /// What the command line gives is read.
    fn read_all(&self) -> bool {
        true
    }
}

impl Arguments {
    /// Checks that none of these arguments is given with a scene file, which sets them itself.
    pub(super) fn check_unused(&self) -> Result<()> {
        let given = [
            ("--entry", self.entry.is_some()),
            ("--groups", self.groups.is_some()),
            ("--push", self.push.is_some()),
            ("--spec", !self.spec.is_empty()),
            ("--buffer", !self.buffer.is_empty()),
            ("--image", !self.image.is_empty()),
            ("--subgroup-size", self.subgroup_size.is_some()),
        ];
        match given.iter().find(|(_, given)| *given) {
            Some((name, _)) => {
                Err(invalid(format!("{name} is only for bare modules: a scene file sets its own values")))
            }
            None => Ok(()),
        }
    }

    /// The scene that dispatches a module's compute shader once, and which flag each part of its
    /// text is from; `streamed` holds the module where it was read already.
    pub(super) fn scene(
        &self,
        path: &Path,
        streamed: Option<Vec<u8>>,
        limits: InputLimits,
        strict: bool,
    ) -> Result<(ResolvedScene, CommandLineScene)> {
        let (bytes, module) = read(path, streamed, &limits)?;
        let entry = self.entry_point(&module, path)?;
        let groups = self.groups()?;
        let text = self.text(path, module, &entry, groups)?;
        let files = ModuleAndDisk { path: named(path).into(), bytes, limits, strict };
        let scene = load_text(Path::new(COMMAND_LINE), &text.text, &files, &LoadOptions::default());
        match scene {
            Ok(_) if text.too_large.is_some() => Err(invalid(text.too_large.unwrap_or_default())),
            Ok(mut scene) => {
                scene.notes.extend(text.notes.iter().cloned());
                Ok((scene, text))
            }
            Err(error) => Err(text.reported(error)),
        }
    }

    fn entry_point(&self, module: &Module, path: &Path) -> Result<EntryPoint> {
        let compute: Vec<_> =
            module.entry_points.iter().filter(|entry| entry.stage == Stage::Compute).collect();
        let found = match &self.entry {
            Some(name) => compute.iter().find(|entry| entry.name == *name),
            None if compute.len() == 1 => compute.first(),
            None => None,
        };
        if let Some(&entry) = found {
            return Ok(entry.clone());
        }
        let list = |entries: &[&EntryPoint]| {
            let names = entries.iter().map(|entry| format!("`{}` ({})", entry.name, entry.stage.name()));
            names.collect::<Vec<_>>().join(", ")
        };
        let shown = escape::path(&path);
        Err(match (&self.entry, compute.is_empty()) {
            (_, true) => {
                let all: Vec<_> = module.entry_points.iter().collect();
                invalid(format!("{shown} has no compute entry point"))
                    .note(format!(
                        "its entry points: {}",
                        if all.is_empty() { "none".into() } else { list(&all) }
                    ))
                    .note("a ray-tracing shader requires a scene file: anyhit run scene.toml")
            }
            (Some(name), _) => invalid(format!("{shown} has no compute entry point `{name}`"))
                .note(format!("its compute entry points: {}", list(&compute))),
            (None, _) => invalid(format!("{shown} has several compute entry points"))
                .note(format!("its compute entry points: {}", list(&compute)))
                .note("help: select one with --entry"),
        })
    }

    fn groups(&self) -> Result<[u32; 3]> {
        let Some(text) = &self.groups else { return Ok([1; 3]) };
        let sides: Option<Vec<u32>> = text.split(',').map(|side| side.trim().parse().ok()).collect();
        match sides.as_deref() {
            Some([x]) => Ok([*x, 1, 1]),
            Some([x, y]) => Ok([*x, *y, 1]),
            Some([x, y, z]) => Ok([*x, *y, *z]),
            _ => Err(invalid(format!("`--groups {text}` is not X, X,Y or X,Y,Z"))),
        }
    }

    /// The scene file's text.
    fn text(
        &self,
        path: &Path,
        module: Module,
        entry: &EntryPoint,
        groups: [u32; 3],
    ) -> Result<CommandLineScene> {
        let mut out = CommandLineScene::default();
        let mut specialization = Vec::new();
        let mut module = module;
        for text in &self.spec {
            let parts = text.split_once('=').filter(|(key, _)| !key.trim().is_empty());
            let Some((key, value)) = parts else {
                return Err(invalid(format!("`--spec {text}` is not ID=VALUE or NAME=VALUE")));
            };
            let id = match key.trim().parse() {
                Ok(id) => id,
                Err(_) => {
                    let place = Place::File(path.to_owned());
                    SpecializationKey::Name(key.trim().to_owned(), place).id(&module)?
                }
            };
            if !module.constants.iter().any(|constant| constant.spec_id == Some(id)) {
                // VkSpecializationMapEntry: such an entry "does not affect the behavior of the
                // pipeline".
                out.notes.push(format!("`--spec {text}`: the module has no specialization constant {id}"));
                continue;
            }
            specialization.push((format!("{id} = {}", value.trim()), format!("--spec {text}")));
            // Sizes of arrays and workgroups depend on it; the scene checks all other values.
            if let Some(value) = specialization_value(value) {
                let _ = value.specialize(&mut module, &SpecializationKey::Id(id), None);
            }
        }
        let module = std::sync::Arc::new(module);
        let program = Program::with_stage(&module, Stage::Compute, &entry.name)?;
        let size = program.workgroup.map_or([1; 3], |layout| layout.size);
        let sides: [u64; 3] = array::from_fn(|axis| u64::from(groups[axis]) * u64::from(size[axis]));
        let invocations: u64 = sides.iter().fold(1, |count: u64, &side| count.saturating_mul(side));

        let file = quoted(&named(path));
        let groups_text = format!("--groups {}", self.groups.as_deref().unwrap_or("1"));
        let groups_flag = Origin::Flag(groups_text.clone());
        let is_too_large = invocations >= 1 << 40 || sides.iter().any(|&side| side > u64::from(u32::MAX));
        out.too_large = is_too_large.then(|| {
            let [x, y, z] = size;
            format!(
                "`{groups_text}`: with workgroups of {x} x {y} x {z} the dispatch has {invocations} invocations; the \
                 maximum is 2^32 - 1 along each axis and 2^40 - 1 in total"
            )
        });
        out.text += "version = 1\n";
        // What it is for, images by default, has a texel for each invocation.
        if invocations <= MAX_LAUNCH && sides.iter().all(|&side| side <= u64::from(u32::MAX)) {
            out.add(groups_flag.clone(), |text| {
                let _ = writeln!(text, "launch = {:?}", sides.map(|side| side.max(1)));
            });
        }
        let declared_size = push_constant_size(&module, entry);
        if let Some(push) = &self.push {
            if declared_size.is_none() {
                out.notes.push(format!("`--push {push}`: `{}` has no push constants", entry.name));
            }
            out.add(Origin::Flag(format!("--push {push}")), |text| {
                let _ = writeln!(text, "push_constants = {}", data(push));
            });
        } else if let Some(size) = declared_size {
            let _ = writeln!(out.text, "push_constants = {{ zeros = {size} }}");
        }
        let _ = writeln!(out.text, "[shaders.main]\npath = {file}\nentry = {}", quoted(&entry.name));
        out.text += "specialization = {";
        for (at, (pair, flag)) in specialization.into_iter().enumerate() {
            out.text += if at == 0 { " " } else { ", " };
            out.add(Origin::Flag(flag), |text| *text += &pair);
        }
        out.text += " }\n";
        if let Some(size) = self.subgroup_size {
            out.add(Origin::Flag(format!("--subgroup-size {size}")), |text| {
                let _ = writeln!(text, "[pipeline]\nsubgroup_size = {size}");
            });
        }
        out.add(groups_flag, |text| {
            let _ = writeln!(text, "[[dispatch]]\nshader = \"main\"\ngroups = {groups:?}");
        });
        let (addressed, bound): (Vec<_>, Vec<_>) =
            self.buffer.iter().map(|text| (text, addressed(text))).partition(|(_, found)| found.is_some());
        let bound: Vec<String> = bound.into_iter().map(|(text, _)| text.clone()).collect();
        let (buffers, images) =
            (ResourceArgument::list("buffer", &bound)?, ResourceArgument::list("image", &self.image)?);
        let variables = module.interface_of(entry);
        let mut names = HashSet::new();
        let addressed = addressed.into_iter().filter_map(|(flag, found)| Some((flag, found?)));
        for (flag, (name, address, value)) in addressed {
            if !names.insert(name.to_owned()) {
                return Err(invalid(format!("two buffers are named `{name}`")));
            }
            let address = address_value(address);
            out.add(Origin::Flag(format!("--buffer {flag}")), |text| {
                let _ =
                    writeln!(text, "[resources.{}]\ntype = \"buffer\"\naddress = {address}", quoted(name));
                content(text, value);
            });
        }
        for variable in &variables {
            if let Some((set, binding)) = variable.descriptor_set.zip(variable.binding) {
                let binding = Binding { set, binding };
                let here = |given: &&ResourceArgument| given.binding == binding;
                let (buffers, images) = (buffers.iter().filter(here), images.iter().filter(here));
                let given = [buffers.collect::<Vec<_>>(), images.collect()];
                let elements = elements(&module, variable, &given);
                let bound = elements.unwrap_or(1);
                let beyond = given.iter().flatten().filter_map(|one| one.element).find(|at| *at >= bound);
                if let Some(at) = beyond {
                    return Err(invalid(format!(
                        "set {set}, binding {} has no element {at} (bound elements: {bound})",
                        binding.binding
                    )));
                }
                for element in 0..bound {
                    let [buffer, image] = [of_element(&given[0], element), of_element(&given[1], element)];
                    let element = elements.map(|_| element);
                    let name = unique_name(&mut names, &variable.name, binding, element);
                    let table = ResourceTable { variable, name, binding, element, buffer, image };
                    table.write(&mut out, &module, (&groups_text, invocations))?;
                }
            }
        }
        for given in buffers.iter().chain(&images) {
            let used = |one: &InterfaceVariable| {
                one.descriptor_set == Some(given.binding.set) && one.binding == Some(given.binding.binding)
            };
            if !variables.iter().any(used) {
                let Binding { set, binding } = given.binding;
                let (flag, name) = (&given.flag, &entry.name);
                out.notes.push(format!("`{flag}`: `{name}` does not use set {set}, binding {binding}"));
            }
        }
        Ok(out)
    }
}

/// The name of the made scene as a file.
const COMMAND_LINE: &str = "the command line";

/// Invocations of the largest launch.
const MAX_LAUNCH: u64 = 1 << 30;

/// What a part of the made scene is from.
#[derive(Clone, Debug)]
enum Origin {
    /// A flag with its value.
    Flag(String),
    /// A default, and how to change it.
    Default(String),
}

/// The text of the made scene.
#[derive(Default)]
pub(super) struct CommandLineScene {
    text: String,
    /// What parts of the text are from.
    origins: Vec<(Range<usize>, Origin)>,
    /// Arguments without effect.
    notes: Vec<String>,
    /// Why the dispatch cannot run, where it is too large.
    too_large: Option<String>,
}

impl CommandLineScene {
    /// Writes a part of the text.
    fn add(&mut self, origin: Origin, write: impl FnOnce(&mut String)) {
        let start = self.text.len();
        write(&mut self.text);
        self.origins.push((start..self.text.len(), origin));
    }

    /// Returns an error about the made scene as one about the command line: a place in the scene
    /// becomes the place in the flag that it is from, or a note about a default.
    pub(super) fn reported(&self, error: Error) -> Error {
        error.relocated(&|place| match place {
            Place::Text { ref file, ref span, .. } if file == COMMAND_LINE => {
                let part = self.origins.iter().find(|(range, _)| range.contains(&span.start));
                match part.map(|(_, origin)| origin) {
                    Some(Origin::Flag(flag)) => {
                        let wanted = self.text.get(span.clone()).unwrap_or_default();
                        let start = flag.find(wanted).filter(|_| !wanted.is_empty());
                        let span = start.map_or(0..flag.len(), |start| start..start + wanted.len());
                        Relocation::To(Place::Text {
                            file: COMMAND_LINE.to_owned(),
                            text: flag.as_str().into(),
                            span,
                        })
                    }
                    Some(Origin::Default(note)) => Relocation::Note(note.clone()),
                    None => Relocation::Nowhere,
                }
            }
            place => Relocation::To(place),
        })
    }
}

/// Reads a module, or compiles a source.
fn read(path: &Path, streamed: Option<Vec<u8>>, limits: &InputLimits) -> Result<(Vec<u8>, Module)> {
    if let Some(bytes) = streamed {
        let module = module_file::load(path, &bytes, limits)?;
        return Ok((bytes, module));
    }
    if Language::of(path).is_none() {
        return module_file::read_with_bytes(path, limits);
    }
    let options = CompileOptions { debug: DebugInfoLevel::Lines, ..CompileOptions::default() };
    module_file::compile(path, limits, &SourceSettings::of(path), &options)
}

/// What the scene calls the module, whatever its path has that no scene can hold: bytes that are
/// no Unicode, control characters.
fn named(path: &Path) -> String {
    escape::path(path).to_string()
}

/// A TOML string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// The value of a specialization constant as a scene file has it.
fn specialization_value(text: &str) -> Option<SpecializationValue> {
    let document = Document::parse(COMMAND_LINE, &format!("value = {}", text.trim())).ok()?;
    let report = Diagnostics::default();
    document.root(&report).required("value")
}

/// Data as in a scene file; the braces of a single piece may be left out.
fn data(text: &str) -> String {
    let text = text.trim();
    if text.starts_with(['{', '[']) { text.to_owned() } else { format!("{{ {text} }}") }
}

/// Adds the content of a buffer: a size, data or a file.
fn content(text: &mut String, value: &str) {
    // Writing to a string does not fail.
    let _ = match value {
        size if size.bytes().all(|byte| byte.is_ascii_digit()) => writeln!(text, "size = {size}"),
        pieces if pieces.starts_with(['{', '[']) || pieces.contains('=') => {
            writeln!(text, "data = {}", data(pieces))
        }
        file => writeln!(text, "data = {{ file = {} }}", quoted(file)),
    };
}

/// Parses `NAME@[ADDRESS]=...`: name, address and content. A binding with an address is none.
fn addressed(text: &str) -> Option<(&str, &str, &str)> {
    let (at, value) = text.split_once('=')?;
    let (name, address) = at.split_once('@')?;
    binding(name).is_none().then_some((name.trim(), address.trim(), value.trim()))
}

/// An address as a scene writes it; an automatic one where none is given.
fn address_value(text: &str) -> String {
    let text = text.trim();
    if text.is_empty() { "true".to_owned() } else { text.to_owned() }
}

fn push_constant_size(module: &Module, entry: &EntryPoint) -> Option<u64> {
    let variables = module.interface_of(entry);
    let variable = variables.iter().find(|one| one.storage_class == storage::PUSH_CONSTANT)?;
    module.size_of(variable.ty?)
}

/// What is given for an element of a binding: its own, or that of all elements.
fn of_element<'a>(list: &[&'a ResourceArgument], element: u32) -> Option<&'a ResourceArgument> {
    let own = list.iter().find(|one| one.element == Some(element));
    own.or_else(|| list.iter().find(|one| one.element.is_none())).copied()
}

/// The number of elements of an array of descriptors that are bound; `None` for a single
/// descriptor.
fn elements(
    module: &Module,
    variable: &InterfaceVariable,
    given: &[Vec<&ResourceArgument>; 2],
) -> Option<u32> {
    /// The number of bound elements of a runtime array.
    const ELEMENTS: u32 = 16;
    let requested =
        given.iter().flatten().filter_map(|one| one.element).max().map_or(1, |last| last.saturating_add(1));
    let (mut ty, mut count) = (variable.ty?, None);
    loop {
        match *module.ty(ty) {
            Type::Array { element, length, .. } => {
                let length = u32::try_from(array_length(module, length)).unwrap_or(u32::MAX);
                count = Some(count.unwrap_or(1u32).saturating_mul(length));
                ty = element;
            }
            Type::RuntimeArray { element, .. } => {
                let sampled = matches!(module.ty(element), Type::SampledImage(_))
                    || matches!(module.ty(element), Type::Image(image) if image.sampled != 2);
                // A sampled image needs a file of the user: bind only the elements that are given.
                count = Some(if sampled { requested } else { requested.max(ELEMENTS) });
                ty = element;
            }
            _ => return count.map(|count| count.min(1 << 16)),
        }
    }
}

/// The bytes of a buffer that ends with an element for each invocation: at most the greatest number
/// that TOML has, which the limit `buffer-bytes` refuses.
fn element_for_each(offset: u32, stride: u32, invocations: u64) -> u64 {
    let elements = u64::from(stride).saturating_mul(invocations);
    elements.saturating_add(offset.into()).min(i64::MAX as u64)
}

/// What a resource is called: as its variable or, where that name is taken, by its binding.
fn unique_name(
    names: &mut HashSet<String>,
    variable: &str,
    Binding { set, binding }: Binding,
    element: Option<u32>,
) -> String {
    let of_element = element.map_or_else(String::new, |element| format!("[{element}]"));
    let numbered = format!("{set}.{binding}{of_element}");
    let name = match variable {
        "" => numbered.clone(),
        name => format!("{name}{of_element}"),
    };
    let name = if names.contains(&name) { numbered } else { name };
    names.insert(name.clone());
    name
}

/// A descriptor of a variable, for which the scene gets a table.
struct ResourceTable<'a> {
    /// The variable.
    variable: &'a InterfaceVariable,
    /// What the resource is called.
    name: String,
    /// Where it is bound.
    binding: Binding,
    /// The number of its array element, if the variable is an array.
    element: Option<u32>,
    /// What the command line says of it as a buffer.
    buffer: Option<&'a ResourceArgument>,
    /// What the command line says of it as an image.
    image: Option<&'a ResourceArgument>,
}

impl ResourceTable<'_> {
    /// Adds the table to the text of the scene.
    fn write(
        &self,
        out: &mut CommandLineScene,
        module: &Module,
        (groups, invocations): (&str, u64),
    ) -> Result<()> {
        let start = out.text.len();
        self.write_text(&mut out.text, module, invocations)?;
        let origin = match self.buffer.or(self.image) {
            Some(given) => Origin::Flag(given.flag.clone()),
            None => {
                let (name, Binding { set, binding }) = (&self.name, self.binding);
                let is_image = self.variable.storage_class == storage::UNIFORM_CONSTANT;
                let (each, flag) = match is_image {
                    true => ("a texel", format!("--image {set},{binding}=WxH")),
                    false => ("an element of its runtime array", format!("--buffer {set},{binding}=SIZE")),
                };
                Origin::Default(format!(
                    "by default, `{name}` at set {set}, binding {binding} has {each} for each of the {invocations} \
                     invocations of `{groups}`: set its size with `{flag}`"
                ))
            }
        };
        out.origins.push((start..out.text.len(), origin));
        Ok(())
    }

    fn write_text(&self, text: &mut String, module: &Module, invocations: u64) -> Result<()> {
        let Self { variable, ref name, binding, element, buffer, image } = *self;
        let Binding { set, binding: number } = binding;
        let Some(mut ty) = variable.ty else { return Ok(()) };
        while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = module.ty(ty) {
            ty = *element;
        }
        let _ = writeln!(text, "[resources.{}]\nset = {set}\nbinding = {number}", quoted(name));
        if let Some(element) = element {
            let _ = writeln!(text, "element = {element}");
        }
        match module.ty(ty) {
            Type::Struct { members, buffer_block, .. } => {
                let storage = variable.storage_class == storage::STORAGE_BUFFER || *buffer_block;
                let kind = if storage { "storage_buffer" } else { "uniform_buffer" };
                let _ = writeln!(text, "type = \"{kind}\"");
                if let Some(address) = buffer.and_then(|given| given.address.as_ref()) {
                    let _ = writeln!(text, "address = {address}");
                }
                match buffer {
                    Some(given) if given.address.is_none() || !given.value.is_empty() => {
                        content(text, &given.value);
                    }
                    _ => {
                        let runtime = members.last().and_then(|last| match module.ty(last.ty) {
                            Type::RuntimeArray { stride, .. } => {
                                Some(element_for_each(last.offset?, (*stride)?, invocations))
                            }
                            _ => None,
                        });
                        let size = runtime.or_else(|| module.size_of(ty));
                        let Some(size) = size else {
                            return Err(invalid(format!(
                                "the size of `{name}` is unknown: set it with --buffer {set},{number}=SIZE"
                            )));
                        };
                        let _ = writeln!(text, "size = {size}");
                    }
                }
            }
            Type::Image(image_type) => return image_table(text, module, *image_type, name, image, false),
            Type::SampledImage(inner) => match module.ty(*inner) {
                Type::Image(image_type) => return image_table(text, module, *image_type, name, image, true),
                _ => return Ok(()),
            },
            Type::Sampler => {
                let _ = writeln!(text, "type = \"sampler\"");
            }
            Type::AccelerationStructure => {
                return Err(invalid(format!(
                    "`{name}` is an acceleration structure, which requires a scene file"
                ))
                .note("a [[dispatch]] in a scene also runs a compute shader: docs/scene.md"));
            }
            _ => {
                return Err(Error::new(
                    ErrorKind::UnsupportedModule,
                    format!("`{name}`: a resource of type {}", module.describe_type(ty)),
                ));
            }
        }
        Ok(())
    }
}

/// Adds the keys of an image.
fn image_table(
    text: &mut String,
    module: &Module,
    ty: ImageType,
    name: &str,
    given: Option<&ResourceArgument>,
    combined: bool,
) -> Result<()> {
    let storage = ty.sampled == 2;
    let kind = match (ty.dim, storage, combined) {
        (5, true, _) => "storage_texel_buffer",
        (5, false, _) => "uniform_texel_buffer",
        (_, true, _) => "storage_image",
        (_, false, true) => "combined_image_sampler",
        (_, false, false) => "sampled_image",
    };
    let _ = writeln!(text, "type = \"{kind}\"");
    let dimension = ["1d", "2d", "3d", "cube"].get(ty.dim as usize);
    if let Some(dimension) = dimension {
        let arrayed = if ty.arrayed { "_array" } else { "" };
        let _ = writeln!(text, "dimension = \"{dimension}{arrayed}\"");
    }
    let format = format_name(declared_format(module, &ty));
    let Some(given) = given.map(|given| given.value.as_str()) else {
        if !storage {
            return Err(invalid(format!("`{name}` is sampled: load it with --image [SET,]BINDING=FILE")));
        }
        let _ = writeln!(text, "format = \"{format}\"");
        return Ok(());
    };
    let (sides, own) = given.split_once(',').unwrap_or((given, format));
    let size: Option<Vec<u32>> = sides.split('x').map(|side| side.trim().parse().ok()).collect();
    let _ = match size {
        Some(size) => writeln!(text, "size = {size:?}\nformat = {}", quoted(own.trim())),
        None => writeln!(text, "file = {}", quoted(given)),
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_element_that_is_not_bound_is_a_mistake() {
        for (element, buffer) in [("4294967295", "1[4294967295]=4"), ("1", "1[1]=4")] {
            let arguments = Arguments { buffer: vec![buffer.to_owned()], ..Arguments::default() };
            let module = Path::new("spirv-fixtures/pass/compute/prefix-sum/main.comp.spv");
            let error =
                arguments.scene(module, None, InputLimits::default(), false).err().expect("no such element");
            let wanted = format!("set 0, binding 1 has no element {element} (bound elements: 1)");
            assert_eq!(error.message(), wanted);
        }
    }

    #[test]
    fn a_trap_tells_shader_line_and_values() {
        use anyhit_base::error::TrapOperands;
        use anyhit_engine::machine::TrapCode;
        use anyhit_engine::module::interface::Stage;
        use anyhit_engine::pipeline::RunOptions;

        // Line 10 writes word `at` of buffer `at / 2`: the last of four invocations is beyond the
        // 12 bytes of the second one.
        let buffer = ["1[0]=8", "1[1]=12"].map(str::to_owned).to_vec();
        let arguments = Arguments { buffer, ..Arguments::default() };
        let module = Path::new("spirv-fixtures/fail/compute/array-of-buffers/main.comp.spv");
        let (scene, _) = arguments.scene(module, None, InputLimits::default(), false).unwrap();
        let assembled = anyhit_scene::assemble(&scene).unwrap();
        let error = assembled.run(&assembled.resources, RunOptions::default()).unwrap_err();
        let trap = error.trap().expect("a trap");
        assert_eq!((trap.code, trap.launch_id), (TrapCode::BufferOutOfBounds, [3, 0, 0]));
        assert_eq!((trap.stage(), trap.line()), (Some(Stage::Compute), Some(10)));
        let TrapOperands::Buffer { descriptor, offset, size, index, length, .. } = &trap.operands else {
            panic!("{trap:?}")
        };
        assert_eq!((*offset, *size, *index, *length), (12, Some(12), Some(3), Some(3)));
        let found = descriptor.as_ref().expect("where the buffer is bound");
        assert_eq!((found.set, found.binding, found.element), (0, 1, 1));
    }

    #[test]
    fn sizes_of_runtime_arrays_do_not_wrap() {
        assert_eq!(element_for_each(16, 4, 10), 16 + 4 * 10);
        // 2^63 - 1 is the greatest number of TOML: a scene's text with more is none.
        for (stride, invocations) in [(4, 1 << 62), (u32::MAX, u64::MAX), (1, u64::MAX)] {
            assert_eq!(element_for_each(16, stride, invocations), (1 << 63) - 1);
        }
    }

    #[test]
    fn resources_that_share_a_variables_name_are_told_apart() {
        let mut names = HashSet::new();
        let mut name = |variable, binding, element| {
            unique_name(&mut names, variable, Binding { set: 2, binding }, element)
        };
        assert_eq!(name("data", 0, None), "data");
        assert_eq!(name("data", 1, None), "2.1");
        assert_eq!(name("data", 2, Some(0)), "data[0]");
        assert_eq!(name("data", 3, Some(0)), "2.3[0]");
        assert_eq!(name("", 4, Some(7)), "2.4[7]");
    }
}
