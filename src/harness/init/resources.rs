//! The resources that shaders declare, with contents of the right kind and size.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::harness::layout::{Layout, Rules};
use crate::module::Module;
use crate::module::interface::{EntryPoint, InterfaceVariable};
use crate::module::ty::{ImageType, Type, TypeId};
use crate::ops::pointer::storage;
use crate::scene::image::{declared_format, format_name};

/// Elements that a texel buffer gets, and a runtime array of a case.
pub(super) const ELEMENTS: usize = 16;

/// What all shaders of a case declare.
#[derive(Debug)]
pub(super) struct Resources {
    /// Elements that a runtime array gets.
    elements: usize,
    /// By set and binding: name and lines.
    bound: BTreeMap<(u32, u32), (String, Vec<String>)>,
    /// Bytes of the push constants.
    pub push_constants: Option<usize>,
    /// Bytes of the shader record.
    pub record: Option<usize>,
}

impl Resources {
    pub fn new(elements: usize) -> Self {
        Self { elements, bound: BTreeMap::new(), push_constants: None, record: None }
    }

    pub fn add(&mut self, module: &Module, entry: &EntryPoint) {
        for variable in module.interface_of(entry) {
            let Some(ty) = variable.ty else { continue };
            let size = || Layout::new(module, ty, Rules::Explicit).size();
            match variable.storage_class {
                storage::PUSH_CONSTANT => self.push_constants = self.push_constants.max(Some(size())),
                storage::SHADER_RECORD_BUFFER => self.record = self.record.max(Some(size())),
                storage::UNIFORM_CONSTANT | storage::UNIFORM | storage::STORAGE_BUFFER => {
                    self.bind(module, &variable, ty);
                }
                _ => {}
            }
        }
    }

    fn bind(&mut self, module: &Module, variable: &InterfaceVariable, ty: TypeId) {
        let (Some(set), Some(binding)) = (variable.descriptor_set, variable.binding) else { return };
        let Some(mut lines) = content(module, ty, variable.storage_class, self.elements) else { return };
        if self.bound.contains_key(&(set, binding)) {
            return;
        }
        if set > 0 {
            lines.push(format!("set = {set}"));
        }
        lines.push(format!("binding = {binding}"));
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
        let mut name: String = variable.name.chars().map(plain).collect();
        if name.is_empty() || self.bound.values().any(|(known, _)| *known == name) {
            name = format!("binding_{set}_{binding}");
        }
        self.bound.insert((set, binding), (name, lines));
    }

    /// The names of the buffers, which are full of zeros.
    pub fn buffers(&self) -> impl Iterator<Item = &str> {
        let is_buffer = |lines: &[String]| lines.iter().any(|line| line.ends_with("_buffer\""));
        self.bound.values().filter(move |(_, lines)| is_buffer(lines)).map(|(name, _)| name.as_str())
    }

    /// The tables of a scene that renders: a block of two matrices holds a camera, and the first
    /// storage image is the picture.
    pub fn text_with_camera(&self) -> String {
        let mut out = String::new();
        let mut has_output = false;
        for (name, lines) in self.bound.values() {
            let mut lines = lines.clone();
            if !has_output && lines.iter().any(|line| line == "type = \"storage_image\"") {
                has_output = true;
                lines.push("output = true".to_owned());
            }
            if lines.iter().filter(|line| line.starts_with('#') && line.contains(" mat4 ")).count() == 2
                && lines.iter().any(|line| line.starts_with("#    0  mat4"))
                && lines.iter().any(|line| line.starts_with("#   64  mat4"))
            {
                lines.push(
                    "# The inverses of view and projection; `size` fills the rest with zeros.".to_owned(),
                );
                lines.push("data = { camera = { eye = [0, 0, 5], look_at = [0, 0, 0] } }".to_owned());
            }
            // Writing to a string does not fail.
            let _ = writeln!(out, "\n[resources.{name}]\n{}", lines.join("\n"));
        }
        out
    }

    /// The tables of the scene file.
    pub fn text(&self) -> String {
        let mut out = String::new();
        for (name, lines) in self.bound.values() {
            // Writing to a string does not fail.
            let _ = writeln!(out, "\n[resources.{name}]\n{}", lines.join("\n"));
        }
        out
    }
}

/// The lines that describe a resource of a type.
fn content(module: &Module, ty: TypeId, class: u32, elements: usize) -> Option<Vec<String>> {
    let line = |text: &str| Some(vec![text.to_owned()]);
    match module.ty(ty) {
        // The first element of an array of descriptors.
        Type::Array { element, .. } | Type::RuntimeArray { element, .. } => {
            content(module, *element, class, elements)
        }
        Type::AccelerationStructure => line("type = \"acceleration_structure\""),
        Type::Sampler => line("type = \"sampler\""),
        Type::Image(image) => Some(self::image(module, image, false)),
        Type::SampledImage(image) => match module.ty(*image) {
            Type::Image(image) => Some(self::image(module, image, true)),
            _ => None,
        },
        Type::Struct { buffer_block, .. } => {
            let layout = Layout::new(module, ty, Rules::Explicit);
            let is_uniform = class == storage::UNIFORM && !buffer_block;
            let kind = if is_uniform { "uniform_buffer" } else { "storage_buffer" };
            let mut lines: Vec<String> = layout.describe().iter().map(|line| format!("#{line}")).collect();
            let size = match layout.runtime_stride() {
                Some((offset, stride)) => offset.saturating_add(elements.saturating_mul(stride)),
                None => layout.size(),
            };
            lines.push(format!("type = \"{kind}\""));
            lines.push(format!("size = {}", size.max(4)));
            Some(lines)
        }
        _ => None,
    }
}

fn image(module: &Module, image: &ImageType, with_sampler: bool) -> Vec<String> {
    const BUFFER: u32 = 5;
    let is_storage = image.sampled == 2;
    let kind = match (image.dim == BUFFER, is_storage, with_sampler) {
        (true, true, _) => "storage_texel_buffer",
        (true, false, _) => "uniform_texel_buffer",
        (false, true, _) => "storage_image",
        (false, false, true) => "combined_image_sampler",
        (false, false, false) => "sampled_image",
    };
    let mut lines = vec![format!("type = \"{kind}\"")];
    lines.push(format!("format = \"{}\"", format_name(declared_format(module, image))));
    match image.dim {
        BUFFER => lines.push(format!("size = {ELEMENTS}")),
        dim => {
            let (dimension, size): (_, &[u32]) = match dim {
                0 => ("1d", &[4]),
                2 => ("3d", &[4, 4, 4]),
                3 => ("cube", &[4, 4]),
                _ => ("2d", &[4, 4]),
            };
            if image.arrayed {
                lines.push(format!("dimension = \"{dimension}_array\""));
            } else if dimension != "2d" {
                lines.push(format!("dimension = \"{dimension}\""));
            }
            if dimension == "cube" {
                lines.push("layers = 6".into());
            }
            // A storage image is as large as the launch.
            if !is_storage || dim != 1 {
                lines.push(format!("size = {size:?}"));
            }
        }
    }
    if image.multisampled {
        lines.push("samples = 4".into());
    }
    lines
}
