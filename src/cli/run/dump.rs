//! `--dump`: prints buffers by the types of the shader that uses them, images texel by texel.

use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::json;

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::json_object;
use anyhit_cases::typed_scene::{programs, roots, typed};
use anyhit_engine::machine::format::Class;
use anyhit_engine::machine::image::Image;
use anyhit_engine::machine::{Binding, Buffer, Descriptor, DeviceMemory, Resources};
use anyhit_engine::ops::pointer::storage;
use anyhit_scene::resources::Resource;
use anyhit_scene::{Assembled, ResolvedScene, resolved};
use anyhit_unit_test::typed::{bound, pointed};
use anyhit_unit_test::value::Value;

/// How a resource is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Format {
    Typed,
    Hex,
    Json,
    /// Its bytes, in a file.
    File(PathBuf),
}

/// A resource to print, as `--dump` names it.
#[derive(Clone, Debug)]
pub(super) struct Dump {
    what: String,
    format: Format,
    /// Whether a resource that holds only zeros is left out.
    unless_zero: bool,
}

/// A resource that was found.
#[derive(Clone, Debug)]
pub(super) enum FoundResource {
    Buffer(Arc<Buffer>),
    Image(Arc<Image>),
}

/// A resource to print, looked up in the scene.
#[derive(Clone, Debug)]
pub(super) struct FoundDump {
    name: String,
    /// Where its descriptor is kept; `None` for a buffer that is bound nowhere.
    binding: Option<Binding>,
    /// The set and binding at which shaders declare it.
    declared_at: Option<Binding>,
    element: u32,
    format: Format,
    unless_zero: bool,
    found: FoundResource,
}

pub(super) fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}

/// A hint at the options that show what a run wrote.
pub(super) fn hint(scene: &ResolvedScene) -> String {
    let holds_data = |one: &&resolved::ResolvedBinding| match &one.resource {
        Resource::StorageBuffer(_) | Resource::StorageImage(_) => true,
        Resource::BufferView(view) => view.kind.is_storage(),
        _ => false,
    };
    let names: Vec<_> =
        scene.resources.iter().filter(holds_data).map(|one| format!("`{}`", one.name)).collect();
    match names.is_empty() {
        true => "done; --stats prints statistics".to_owned(),
        false => {
            format!("done; --dump WHAT prints the content of {}, --stats prints statistics", names.join(", "))
        }
    }
}

impl Dump {
    /// `WHAT[=FORMAT]` or `WHAT=FILE`
    pub(super) fn parse(text: &str) -> Result<Self> {
        let (what, format) = match text.split_once('=') {
            None | Some((_, "typed")) => (text.split('=').next().unwrap_or(text), Format::Typed),
            Some((what, "hex")) => (what, Format::Hex),
            Some((what, "json")) => (what, Format::Json),
            // A misspelt format is no file.
            Some((what, file)) if file.contains(['.', '/', '\\']) => (what, Format::File(file.into())),
            Some((_, other)) => {
                let error = invalid(format!("`--dump {text}`: `{other}` is not typed, hex or json"));
                return Err(error.note("the name of a file to write contains a dot or a slash"));
            }
        };
        Ok(Self { what: what.to_owned(), format, unless_zero: false })
    }

    /// Every storage buffer that the compute shaders use; of an array the first element, and those
    /// that are not all zeros.
    pub(super) fn storage_buffers(assembled: &Assembled, scene: &ResolvedScene) -> Vec<Self> {
        let mut dumps = Vec::new();
        for program in programs(assembled) {
            for variable in bound(program) {
                let (storage::STORAGE_BUFFER, Some(place)) = (variable.0, variable.1) else { continue };
                let bound = scene.resources.iter();
                let bound = bound.filter(|one| (one.set, one.binding) == (place.set, place.binding));
                for one in bound {
                    let what = format!("{},{}[{}]", one.set, one.binding, one.element);
                    let (format, unless_zero) = (Format::Typed, one.element > 0);
                    dumps.push(Self { what, format, unless_zero });
                }
            }
        }
        dumps
    }

    /// Finds the resource to print.
    pub(super) fn find(&self, scene: &ResolvedScene, resources: &Resources) -> Result<FoundDump> {
        let unbound = scene.unbound.iter().any(|one| one.name == self.what);
        if let Some((_, buffer)) = resources.memory.named_buffer(&self.what).filter(|_| unbound) {
            return Ok(FoundDump {
                name: self.what.clone(),
                binding: None,
                declared_at: None,
                element: 0,
                format: self.format.clone(),
                unless_zero: self.unless_zero,
                found: FoundResource::Buffer(buffer.clone()),
            });
        }
        let (binding, element, found) = descriptor(&self.what, scene, resources)?;
        let place = (binding.set, binding.binding, element);
        let named = scene.resources.iter().find(|one| (one.set, one.binding, one.element) == place);
        let name = named.map_or_else(String::new, |one| one.name.clone());
        Ok(FoundDump {
            name,
            binding: Some(binding),
            declared_at: Some(named.map_or(binding, |one| one.declared_at())),
            element,
            format: self.format.clone(),
            unless_zero: self.unless_zero,
            found,
        })
    }
}

/// The resource with a name in the scene, or at `[SET,]BINDING`: its binding and array element.
pub(super) fn descriptor(
    what: &str,
    scene: &ResolvedScene,
    resources: &Resources,
) -> Result<(Binding, u32, FoundResource)> {
    let named = scene.resources.iter().find(|one| one.name == what);
    let (binding, element) = match named {
        Some(one) => (Binding { set: one.set, binding: one.binding }, one.element),
        None => match binding(what) {
            Some((at, element)) => {
                let element = element.unwrap_or(0);
                // Where passes alone find something there, it is kept elsewhere.
                let apart = || {
                    let is_there =
                        |one: &&resolved::ResolvedBinding| one.declared_at() == at && one.element == element;
                    scene.resources.iter().find(is_there).map(resolved::ResolvedBinding::kept_at)
                };
                let kept = Some(at).filter(|at| resources.descriptors.contains_key(at)).or_else(apart);
                (kept.unwrap_or(at), element)
            }
            None => {
                let known: Vec<_> = scene.resources.iter().map(|one| format!("`{}`", one.name)).collect();
                let error = invalid(format!("`{what}` is neither a resource of the scene nor a binding"));
                return Err(error.note(format!("the scene's resources: {}", known.join(", "))));
            }
        },
    };
    let list = resources.descriptors.get(&binding);
    let found = match list.and_then(|list| list.get(element as usize)) {
        Some(Descriptor::Buffer(buffer)) => FoundResource::Buffer(buffer.clone()),
        Some(Descriptor::Image(image) | Descriptor::ImageSampler(image, _)) => {
            image.read()?;
            FoundResource::Image(image.clone())
        }
        _ => {
            return Err(invalid(format!("`{what}`: neither a buffer nor an image is bound at {binding}")));
        }
    };
    Ok((binding, element, found))
}

impl FoundDump {
    /// The file that is to receive the bytes, if it is not to be printed.
    pub(super) fn file(&self) -> Option<&Path> {
        match &self.format {
            Format::File(path) => Some(path),
            _ => None,
        }
    }

    /// All bytes of the resource.
    pub(super) fn bytes(&self) -> Vec<u8> {
        match &self.found {
            FoundResource::Buffer(buffer) => buffer.bytes(),
            FoundResource::Image(image) => image.bytes(),
        }
    }

    /// The text.
    pub(super) fn text(&self, assembled: &Assembled) -> Result<String> {
        let memory = &assembled.resources.memory;
        let address = match &self.found {
            FoundResource::Buffer(buffer) => memory.address_of(buffer),
            FoundResource::Image(_) => None,
        };
        let typed = |bytes: &[u8]| {
            let declared = self.binding.and_then(|binding| typed(assembled, binding, self.element, bytes));
            declared.or_else(|| {
                let programs: Vec<_> = programs(assembled).collect();
                pointed(&programs, &assembled.resources, &roots(assembled), address?)
            })
        };
        let title = match self.declared_at {
            Some(at) => {
                let name = if self.name.is_empty() { String::new() } else { format!(" `{}`", self.name) };
                let element =
                    if self.element > 0 { format!(", element {}", self.element) } else { String::new() };
                format!("{at}{element}{name}")
            }
            None => format!("`{}` at {:#x}", self.name, address.unwrap_or(0)),
        };
        let bytes = self.bytes();
        if self.unless_zero && bytes.iter().all(|&byte| byte == 0) {
            return Ok(String::new());
        }
        if self.format == Format::Hex {
            return Ok(format!("{title}: {} bytes\n{}", bytes.len(), hex(&bytes)));
        }
        let image = match &self.found {
            FoundResource::Image(image) => Some(image),
            FoundResource::Buffer(_) => None,
        };
        if self.format == Format::Json {
            let value = match image {
                Some(image) => texels(image).into_iter().map(|texel| texel.map(TexelNumber::json)).collect(),
                None => typed(&bytes).map_or_else(|| json!(bytes), |value| json_of(&value)),
            };
            let mut json = match self.declared_at {
                Some(at) if at.is_heap() => json!({ "heap": self.element }),
                Some(Binding { set, binding }) => json!({ "set": set, "binding": binding }),
                None => json!({ "address": address }),
            };
            json["name"] = json!(self.name);
            json["value"] = value;
            if self.element > 0 && !self.declared_at.is_some_and(Binding::is_heap) {
                json["element"] = json!(self.element);
            }
            let text =
                serde_json::to_string(&json).map_err(|error| Error::new(ErrorKind::Io, error.to_string()))?;
            return Ok(format!("{text}\n"));
        }
        if let Some(image) = image {
            let [width, height, depth] = image.shape().extent;
            let mut text = format!("{title}: image of {width} x {height} x {depth}\n");
            for (at, texel) in texels(image).iter().enumerate() {
                let words: Vec<_> = texel.iter().map(|number| format!("{number}")).collect();
                // Writing to a string does not fail.
                let _ = writeln!(text, "{at:6}  {}", words.join(" "));
            }
            return Ok(text);
        }
        Ok(match typed(&bytes) {
            Some(value) => format!("{title}:{}", lines(&value, memory)),
            None => format!("{title}: no shader declares its type: {} bytes\n{}", bytes.len(), hex(&bytes)),
        })
    }
}

/// A hex dump, sixteen bytes a line.
fn hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for (at, line) in bytes.chunks(16).enumerate() {
        let words: Vec<_> = line.iter().map(|byte| format!("{byte:02x}")).collect();
        let _ = writeln!(text, "{:08x}  {}", at * 16, words.join(" "));
    }
    text
}

/// A component of a texel: integers of 64 bits are not rounded.
#[derive(Clone, Copy)]
enum TexelNumber {
    Float(f32),
    Signed(i64),
    Unsigned(u64),
}

impl TexelNumber {
    fn json(self) -> serde_json::Value {
        match self {
            Self::Float(number) => json_number(number.into()),
            Self::Signed(number) => json!(number),
            Self::Unsigned(number) => json!(number),
        }
    }
}

impl fmt::Display for TexelNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Float(number) => write!(f, "{}", f64::from(*number)),
            Self::Signed(number) => write!(f, "{number}"),
            Self::Unsigned(number) => write!(f, "{number}"),
        }
    }
}

/// The texels of an image in the order of its memory.
fn texels(image: &Image) -> Vec<[TexelNumber; 4]> {
    let format = image.format();
    let count = image.bytes().len() / format.texel_size() as usize;
    let number = |part: u64| match format.class() {
        Class::Float => TexelNumber::Float(f32::from_bits(part as u32)),
        Class::Sint => TexelNumber::Signed(part as i64),
        Class::Uint => TexelNumber::Unsigned(part),
    };
    (0..count).map(|at| format.decode(image.load(at)).map(number)).collect()
}

/// A member a line, an element of an array of structs a line.
fn lines(value: &Value, memory: &DeviceMemory) -> String {
    let words = |value: &Value| words(value, memory);
    let mut text = String::from("\n");
    for (at, element) in value.elements().iter().enumerate() {
        let _ = writeln!(text, "  [{at}] = {}", words(element));
    }
    for (name, member) in value.fields() {
        let elements = member.elements();
        let nested = elements.iter().any(|element| element.fields().next().is_some());
        if nested {
            for (at, element) in elements.iter().enumerate() {
                let _ = writeln!(text, "  {name}[{at}] = {}", words(element));
            }
        } else {
            let _ = writeln!(text, "  {name} = {}", words(member));
        }
    }
    text
}

/// A value on one line, all of it.
fn words(value: &Value, memory: &DeviceMemory) -> String {
    let words = |value: &Value| words(value, memory);
    if value.ty().starts_with("pointer ")
        && let Some(&address) = value.bytes().first_chunk()
    {
        let address = u64::from_le_bytes(address);
        return memory.describe(address).unwrap_or_else(|| format!("{address:#x}"));
    }
    let fields: Vec<_> = value.fields().map(|(name, field)| format!("{name}: {}", words(field))).collect();
    if !fields.is_empty() {
        return format!("{{ {} }}", fields.join(", "));
    }
    if value.elements().is_empty() {
        return scalar(value);
    }
    let elements: Vec<_> = value.elements().iter().map(words).collect();
    format!("[{}]", elements.join(", "))
}

/// The shortest digits that say which number it is; an integer's sign shows in its type already.
fn scalar(value: &Value) -> String {
    let text = format!("{value:?}");
    match text.strip_suffix('u') {
        Some(digits) if !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()) => {
            digits.to_owned()
        }
        _ if text.starts_with(value.ty()) => "[]".to_owned(),
        _ => text,
    }
}

fn json_of(value: &Value) -> serde_json::Value {
    if value.fields().next().is_some() {
        return json_object(value.fields().map(|(name, field)| (name.to_owned(), json_of(field))));
    }
    if !value.elements().is_empty() {
        return value.elements().iter().map(json_of).collect();
    }
    let text = scalar(value);
    // JSON has no numbers for NaN and infinity: they become strings.
    serde_json::from_str(&text).unwrap_or(serde_json::Value::String(text))
}

/// A number of a texel; NaN and infinity become strings.
fn json_number(number: f64) -> serde_json::Value {
    if number.is_finite() { json!(number) } else { json!(number.to_string()) }
}

/// Parses `[SET,]BINDING`, or `[SET,]BINDING[ELEMENT]` for an element of an array of descriptors.
pub(super) fn binding(text: &str) -> Option<(Binding, Option<u32>)> {
    let number = |text: &str| text.trim().parse().ok();
    let (numbers, element) = match text.trim().strip_suffix(']').map(|text| text.split_once('[')) {
        Some(parts) => parts.and_then(|(numbers, element)| Some((numbers, Some(number(element)?))))?,
        None => (text, None),
    };
    let binding = match numbers.split_once(',') {
        Some((set, binding)) => Binding { set: number(set)?, binding: number(binding)? },
        None => Binding { set: 0, binding: number(numbers)? },
    };
    Some((binding, element))
}
