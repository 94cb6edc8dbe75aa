//! The resources that shaders declare, with contents of the right kind and size.

use std::fmt::Write;

use crate::init::Shader;
use crate::init::pointees::{Block, Pointees, plain};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::Binding;
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::{InterfaceVariable, Stage};
use anyhit_engine::module::push_constant_bank::BANK_SET;
use anyhit_engine::module::ty::{ImageType, Type, TypeId};
use anyhit_engine::ops::heap::binding;
use anyhit_engine::ops::image::declared::declared_format;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::reflect::heap::{HeapUse, heap_uses};
use anyhit_engine::reflect::{Layout, Rules};
use anyhit_scene::image::format_name;

/// Elements that a texel buffer gets, and a runtime array of a case.
pub(super) const ELEMENTS: usize = 16;

/// What all shaders of a case declare.
#[derive(Debug)]
pub(super) struct Resources {
    /// Elements that a runtime array gets.
    elements: usize,
    /// By set and binding: several where passes declare several types or layouts there.
    bound: SortedMap<(u32, u32), Vec<BoundResource>>,
    /// The buffers that pointers lead to.
    pointees: Pointees,
    push_constants: Option<Data>,
    /// The blocks of shader records, by the shaders' references.
    records: SortedMap<String, Data>,
}

/// A resource of a scene: its name, its lines and the block of a buffer.
#[derive(Debug)]
struct BoundResource {
    name: String,
    /// The lines that say its type and size.
    content: Vec<String>,
    lines: Vec<String>,
    block: Option<Block>,
    /// The passes that declare it.
    passes: Vec<usize>,
}

/// A block with its data.
#[derive(Clone, Debug)]
struct Data {
    block: Block,
    piece: String,
}

impl Data {
    fn new(block: Block) -> Self {
        let piece = format!("{{ zeros = {} }}", block.layout().size());
        Self { block, piece }
    }

    fn size(&self) -> usize {
        self.block.layout().size()
    }

    /// The layout, in comments.
    fn comment(&self, what: &str) -> String {
        let lines = self.block.layout().describe().into_iter().map(|line| format!("#{line}\n"));
        format!("# {what}:\n{}", lines.collect::<String>())
    }
}

impl Resources {
    /// Everything that shaders declare; runtime arrays get so many elements.
    pub(super) fn of(shaders: &[Shader], elements: usize) -> Self {
        let mut all = Self {
            elements,
            bound: SortedMap::new(),
            pointees: Pointees::default(),
            push_constants: None,
            records: SortedMap::new(),
        };
        // The shaders of the pipeline are one pass, the first if it is launched; else they run for
        // rays from the host. Each compute shader is one of its own.
        let is_compute = |shader: &&Shader| shader.entry.stage == Stage::Compute;
        let launches = shaders.iter().any(|shader| shader.entry.stage == Stage::RayGeneration);
        for shader in shaders.iter().filter(|shader| !is_compute(shader)) {
            all.add(shader, launches.then_some(0));
        }
        for (at, shader) in shaders.iter().filter(is_compute).enumerate() {
            all.add(shader, Some(at + usize::from(launches)));
        }
        all.fill_heaps(shaders);
        all.tell_apart();
        all.follow_pointers();
        all
    }

    fn add(&mut self, shader: &Shader, pass: Option<usize>) {
        let module = &shader.module;
        for variable in module.interface_of(&shader.entry) {
            let Some(ty) = variable.ty else { continue };
            let name = shader.reference.split(':').next().unwrap_or_default().to_owned();
            let block = Block { module: module.clone(), shader: name, ty };
            match variable.storage_class {
                storage::PUSH_CONSTANT => {
                    let data = Data::new(block);
                    if self.push_constants.as_ref().is_none_or(|known| known.size() < data.size()) {
                        self.push_constants = Some(data);
                    }
                }
                storage::SHADER_RECORD_BUFFER => {
                    self.records.insert(shader.reference.clone(), Data::new(block));
                }
                storage::UNIFORM_CONSTANT | storage::UNIFORM | storage::STORAGE_BUFFER => {
                    self.bind(block, &variable, pass);
                }
                _ => {}
            }
        }
    }

    /// Adds the descriptors in heaps that shaders use: those of computed indices where others leave
    /// room.
    fn fill_heaps(&mut self, shaders: &[Shader]) {
        for is_computed in [false, true] {
            for shader in shaders {
                let uses = heap_uses(&shader.module, shader.entry.function).into_iter();
                for one in uses.filter(|one| one.index.is_none() == is_computed) {
                    let name = shader.reference.split(':').next().unwrap_or_default().to_owned();
                    let ty = one.block.unwrap_or(one.ty);
                    self.place_in_heap(Block { module: shader.module.clone(), shader: name, ty }, one);
                }
            }
        }
    }

    /// Adds a descriptor of a heap; one whose index is computed lies at the next free one.
    fn place_in_heap(&mut self, block: Block, one: HeapUse) {
        let class = match *block.module.ty(one.ty) {
            Type::Buffer { storage_class } => storage_class,
            _ => storage::UNIFORM_CONSTANT,
        };
        let heap = binding(one.heap);
        if one.is_data(&block.module) && heap == Binding::RESOURCE_HEAP {
            let data = heap.heap_data();
            let here = self.bound.entry((data.set, data.binding)).or_default();
            if here.is_empty() {
                let content = vec!["type = \"heap_data\"".to_owned(), "size = 65536".to_owned()];
                let (name, lines, passes) = ("heap_data".to_owned(), content.clone(), Vec::new());
                here.push(BoundResource { name, content, lines, block: None, passes });
            }
            return;
        }
        let Some(mut content) = content(&block.module, block.ty, class, self.elements) else { return };
        let here = self.bound.entry((heap.set, heap.binding)).or_default();
        let at = |index: u32| format!("heap = {index}");
        let is_taken = |index: u32| here.iter().any(|known| known.lines.contains(&at(index)));
        let index = match one.index {
            Some(index) => index,
            None => {
                content.insert(0, "# The shader computes the index.".to_owned());
                (0..=u32::MAX).find(|&index| !is_taken(index)).unwrap_or(0)
            }
        };
        // Two types at one index are a choice that the shader makes when it runs.
        if is_taken(index) || here.iter().any(|known| known.content == content) {
            return;
        }
        let mut lines = content.clone();
        lines.push(at(index));
        let kind = type_of(&content).and_then(|line| line.split('"').nth(1)).unwrap_or("descriptor");
        let is_struct = matches!(block.module.ty(block.ty), Type::Struct { .. });
        let (name, block) = (format!("heap_{kind}_{index}"), is_struct.then_some(block));
        here.push(BoundResource { name, content, lines, block, passes: Vec::new() });
    }

    fn bind(&mut self, block: Block, variable: &InterfaceVariable, pass: Option<usize>) {
        let (Some(set), Some(binding)) = (variable.descriptor_set, variable.binding) else { return };
        let class = variable.storage_class;
        let Some(content) = content(&block.module, block.ty, class, self.elements) else { return };
        let is_struct = matches!(block.module.ty(block.ty), Type::Struct { .. });
        let here = self.bound.entry((set, binding)).or_default();
        if pass.is_none() && !here.is_empty() {
            return;
        }
        // Of one pass all shaders find the same, and passes share buffers, whatever they call their
        // members, and what else they declare alike.
        let is_of_pass = |one: &BoundResource| pass.is_some_and(|pass| one.passes.contains(&pass));
        let is_same = |one: &BoundResource| match size_of(&content) {
            Some(_) => type_of(&one.content) == type_of(&content),
            None => one.content == content,
        };
        if let Some(known) = here.iter_mut().find(|one| is_of_pass(one) || is_same(one)) {
            known.passes.extend(pass.filter(|pass| !known.passes.contains(pass)));
            let (old, new) = (size_of(&known.content), size_of(&content));
            if !is_struct || new <= old || type_of(&known.content) != type_of(&content) {
                return;
            }
            let others = known.lines.split_off(known.content.len());
            known.lines = [content.clone(), others].concat();
            (known.content, known.block) = (content, Some(block));
            return;
        }
        let mut lines = content.clone();
        match set {
            BANK_SET => {
                lines.retain(|line| line != UNIFORM);
                lines.extend(["type = \"push_constant_bank\"".to_owned(), format!("bank = {binding}")]);
            }
            0 => lines.push(format!("binding = {binding}")),
            _ => lines.extend([format!("set = {set}"), format!("binding = {binding}")]),
        }
        let mut name = plain(&variable.name);
        let is_taken = |name: &str| self.bound.values().flatten().any(|known| known.name == name);
        if name.is_empty() || is_taken(&name) {
            name = format!("binding_{set}_{binding}");
        }
        let mut number = 2;
        while is_taken(&name) {
            name = format!("binding_{set}_{binding}_{number}");
            number += 1;
        }
        let (block, passes) = (is_struct.then_some(block), pass.into_iter().collect());
        let new = BoundResource { name, content, lines, block, passes };
        self.bound.entry((set, binding)).or_default().push(new);
    }

    /// Says of resources of one type at one set and binding which passes find them.
    fn tell_apart(&mut self) {
        for here in self.bound.values_mut() {
            let kinds: Vec<_> = here.iter().map(|one| type_of(&one.content).map(str::to_owned)).collect();
            for (at, one) in here.iter_mut().enumerate() {
                // All passes have the same heaps.
                if !one.passes.is_empty() && kinds[..at].contains(&kinds[at]) {
                    one.lines.push(format!("passes = {:?}", one.passes));
                }
            }
        }
    }

    /// Makes the buffers that pointers lead to, and writes their addresses.
    fn follow_pointers(&mut self) {
        let mut pointees = Pointees::beside(self.bound.values().flatten().map(|one| one.name.as_str()));
        for data in self.push_constants.iter_mut().chain(self.records.values_mut()) {
            if let Some(piece) = pointees.piece(&data.block, self.elements) {
                data.piece = piece;
            }
        }
        for bound in self.bound.values_mut().flatten() {
            let piece = bound.block.as_ref().and_then(|block| pointees.piece(block, self.elements));
            bound.lines.extend(piece.map(|piece| format!("data = {piece}")));
        }
        self.pointees = pointees;
    }

    /// The push constants with their layout.
    pub(super) fn push_constants(&self) -> Option<String> {
        let data = self.push_constants.as_ref()?;
        Some(format!("{}push_constants = {}\n", data.comment("The push constants"), data.piece))
    }

    /// The data of a record of these shaders, which is that of its largest block.
    pub(super) fn record<'a>(&self, shaders: impl Iterator<Item = &'a Shader>) -> Option<&str> {
        let blocks = shaders.filter_map(|shader| self.records.get(&shader.reference));
        blocks.max_by_key(|data| data.size()).map(|data| data.piece.as_str())
    }

    /// The layouts of shader records, in comments.
    pub(super) fn record_layouts(&self) -> String {
        let comment = |(shader, data): (&String, &Data)| data.comment(&format!("The record of `{shader}`"));
        self.records.iter().map(comment).collect()
    }

    /// Whether there are push constants, and records.
    pub(super) fn has(&self) -> (bool, bool) {
        (self.push_constants.is_some(), !self.records.is_empty())
    }

    /// The names of the buffers, which are full of zeros.
    pub(super) fn buffers(&self) -> impl Iterator<Item = &str> {
        let is_buffer = |lines: &[String]| lines.iter().any(|line| line.ends_with("_buffer\""));
        let bound = self
            .bound
            .values()
            .flatten()
            .filter(move |one| is_buffer(&one.lines))
            .map(|one| one.name.as_str());
        bound.chain(self.pointees.tables().map(|(name, _)| name))
    }

    /// The tables of a scene that renders: a block of two matrices holds a camera, and the first
    /// storage image is the picture.
    pub(super) fn text_with_camera(&self) -> String {
        let mut out = String::new();
        let mut has_output = false;
        for BoundResource { name, lines, .. } in self.bound.values().flatten() {
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
        out + &self.pointed()
    }

    /// The tables of the scene file.
    pub(super) fn text(&self) -> String {
        let mut out = String::new();
        for BoundResource { name, lines, .. } in self.bound.values().flatten() {
            // Writing to a string does not fail.
            let _ = writeln!(out, "\n[resources.{name}]\n{}", lines.join("\n"));
        }
        out + &self.pointed()
    }

    /// The tables of the buffers that pointers lead to.
    fn pointed(&self) -> String {
        let table =
            |(name, lines): (&str, &[String])| format!("\n[resources.{name}]\n{}\n", lines.join("\n"));
        self.pointees.tables().map(table).collect()
    }
}

/// The line that says a resource's type.
fn type_of(content: &[String]) -> Option<&str> {
    content.iter().find(|line| line.starts_with("type = ")).map(String::as_str)
}

/// How many bytes a buffer has; `None` of anything else.
fn size_of(content: &[String]) -> Option<usize> {
    let is_buffer = type_of(content).is_some_and(|line| matches!(line, STORAGE | UNIFORM));
    let size = content.iter().filter(|_| is_buffer).find_map(|line| line.strip_prefix("size = "))?;
    size.parse().ok()
}

const STORAGE: &str = "type = \"storage_buffer\"";
const UNIFORM: &str = "type = \"uniform_buffer\"";

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
        Type::Buffer { storage_class } => {
            let kind = if *storage_class == storage::UNIFORM { UNIFORM } else { STORAGE };
            Some(vec![kind.to_owned(), format!("size = {}", 4 * ELEMENTS)])
        }
        Type::Image(image) => Some(self::image(module, image, false)),
        Type::SampledImage(image) => match module.ty(*image) {
            Type::Image(image) => Some(self::image(module, image, true)),
            _ => None,
        },
        Type::Struct { buffer_block, .. } => {
            let layout = Layout::new(module, ty, Rules::Explicit);
            let is_uniform = class == storage::UNIFORM && !buffer_block;
            let kind = if is_uniform { UNIFORM } else { STORAGE };
            let mut lines: Vec<String> = layout.describe().iter().map(|line| format!("#{line}")).collect();
            let size = match layout.runtime_stride() {
                Some((offset, stride)) => offset.saturating_add(elements.saturating_mul(stride)),
                None => layout.size(),
            };
            lines.push(kind.to_owned());
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
