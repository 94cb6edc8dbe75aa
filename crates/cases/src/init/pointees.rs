//! The buffers that pointers of shaders lead to, each with the addresses that it holds itself.

use std::sync::Arc;

use anyhit_base::sorted::SortedSet;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::reflect::lookup::{same_layout, spelling, strides};
use anyhit_engine::reflect::{Layout, Rules};

/// How many pointers are followed one after the other; those behind are null.
const DEPTH: usize = 8;

/// Buffers that are made at most.
const MOST: usize = 64;

/// Elements of a buffer, or of an array, that hold addresses.
pub(super) const WITH_ADDRESSES: usize = 16;

/// A block of a shader, and the shader's name in the scene.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub module: Arc<Module>,
    pub shader: String,
    pub ty: TypeId,
}

impl Block {
    pub(super) fn layout(&self) -> Layout<'_> {
        Layout::new(&self.module, self.ty, Rules::Explicit)
    }

    /// Another type of its module.
    fn with(&self, ty: TypeId) -> Self {
        Self { ty, ..self.clone() }
    }
}

/// A buffer that a pointer leads to.
#[derive(Clone, Debug)]
struct Pointee {
    /// The member that points to it.
    member: String,
    block: Block,
    name: String,
    lines: Vec<String>,
}

/// All buffers that pointers lead to.
#[derive(Clone, Debug, Default)]
pub(super) struct Pointees {
    all: Vec<Pointee>,
    /// Names that are taken.
    names: SortedSet<String>,
}

impl Pointees {
    /// Buffers with other names than these.
    pub(super) fn beside<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        Self { all: Vec::new(), names: names.map(str::to_owned).collect() }
    }

    /// Names and lines of the buffers.
    pub(super) fn tables(&self) -> impl Iterator<Item = (&str, &[String])> {
        self.all.iter().map(|one| (one.name.as_str(), &one.lines[..]))
    }

    /// A piece of data with the addresses that a block holds, zeros else; `None` where it holds
    /// none.
    pub(super) fn piece(&mut self, block: &Block, elements: usize) -> Option<String> {
        let value = self.value(block, "", elements, &mut Vec::new())?;
        Some(format!("{{ shader = {:?}, value = {value}, rest = \"zeros\" }}", block.shader))
    }

    /// The addresses in a value by the names of its members; `None` where there are none.
    fn value(
        &mut self,
        block: &Block,
        member: &str,
        elements: usize,
        path: &mut Vec<(TypeId, String)>,
    ) -> Option<String> {
        let list = |value: String, count: usize| format!("[{}]", vec![value; count].join(", "));
        match *block.module.ty(block.ty) {
            Type::Pointer {
                storage_class: storage::PHYSICAL_STORAGE_BUFFER,
                pointee: Some(pointee),
                stride,
            } => {
                let name = self.target(&block.with(pointee), stride, member, elements, path)?;
                Some(format!("{{ address_of = {name:?} }}"))
            }
            Type::Struct { .. } => {
                let Type::Struct { members, .. } = block.module.ty(block.ty) else { return None };
                let values = members.iter().filter(|member| !member.name.is_empty()).filter_map(|member| {
                    let value = self.value(&block.with(member.ty), &member.name, elements, path)?;
                    Some(format!("{} = {value}", key(&member.name)))
                });
                let values: Vec<_> = values.collect();
                (!values.is_empty()).then(|| format!("{{ {} }}", values.join(", ")))
            }
            // An array has exactly its elements.
            Type::Array { element, length, .. } => {
                let length = array_length(&block.module, length);
                if !(1..=WITH_ADDRESSES).contains(&length) {
                    return None;
                }
                Some(list(self.value(&block.with(element), member, elements, path)?, length))
            }
            Type::RuntimeArray { element, .. } => {
                let value = self.value(&block.with(element), member, elements, path)?;
                Some(list(value, WITH_ADDRESSES.min(elements)))
            }
            _ => None,
        }
    }

    /// The name of the buffer that a pointer leads to, which is made where it is not there: a
    /// circle leads back to where it began. `None` for a null pointer.
    fn target(
        &mut self,
        block: &Block,
        stride: Option<u32>,
        member: &str,
        elements: usize,
        path: &mut Vec<(TypeId, String)>,
    ) -> Option<String> {
        if let Some((_, name)) = path.iter().find(|(ty, _)| *ty == block.ty) {
            return Some(name.clone());
        }
        let is_it = |one: &&Pointee| one.member == member && same_layout(one.block.layout(), block.layout());
        if let Some(known) = self.all.iter().find(is_it) {
            return Some(known.name.clone());
        }
        if path.len() == DEPTH || self.all.len() == MOST {
            return None;
        }
        let name = self.name(member);
        let at = self.all.len();
        let (member, lines) = (member.to_owned(), Vec::new());
        self.all.push(Pointee { member: member.clone(), block: block.clone(), name: name.clone(), lines });
        path.push((block.ty, name.clone()));
        let lines = self.lines(block, stride, &member, elements, path);
        path.pop();
        self.all[at].lines = lines;
        Some(name)
    }

    /// A name of its own for what a member points to.
    fn name(&mut self, member: &str) -> String {
        let plain = plain(member);
        let plain = if plain.is_empty() { "pointee".to_owned() } else { plain };
        let mut name = plain.clone();
        let mut number = 1;
        while !self.names.insert(name.clone()) {
            number += 1;
            name = format!("{plain}_{number}");
        }
        name
    }

    /// The lines of the table of a buffer.
    fn lines(
        &mut self,
        block: &Block,
        stride: Option<u32>,
        member: &str,
        elements: usize,
        path: &mut Vec<(TypeId, String)>,
    ) -> Vec<String> {
        let layout = block.layout();
        let is_struct = matches!(block.module.ty(block.ty), Type::Struct { .. });
        let mut lines: Vec<String> = match is_struct {
            true => layout.describe().iter().map(|line| format!("#{line}")).collect(),
            false => vec![format!("# {}", block.module.describe_type(block.ty))],
        };
        lines.push("type = \"buffer\"".to_owned());
        let (first, each) = match layout.runtime_stride() {
            Some(runtime) => runtime,
            None => (0, stride.map_or(layout.size().next_multiple_of(4), |stride| stride as usize)),
        };
        match self.value(block, member, elements, path) {
            Some(value) if is_struct => {
                // One behind the other they lie where the module says how far apart.
                let apart = layout.runtime_stride().is_none() && strides(layout).len() == 1;
                let repeat = if apart { format!(", repeat = {WITH_ADDRESSES}") } else { String::new() };
                lines.push(format!(
                    "data = {{ struct = {:?}, shader = {:?}, value = {value}, rest = \"zeros\"{repeat} }}",
                    spelling(layout),
                    block.shader
                ));
                if !apart && layout.runtime_stride().is_none() {
                    lines.push(format!("size = {}", each.saturating_mul(WITH_ADDRESSES)));
                }
            }
            // A pointer to a pointer.
            Some(address) if matches!(block.module.ty(block.ty), Type::Pointer { .. }) => {
                let address = address.trim_end_matches(" }");
                lines.push(format!("data = {address}, repeat = {WITH_ADDRESSES} }}"));
            }
            _ => {
                let size = first.saturating_add(elements.saturating_mul(each.max(4)));
                lines.push(format!("size = {size}"));
            }
        }
        lines
    }
}

/// A name as a resource may have it.
pub(super) fn plain(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
    name.chars().map(plain).collect()
}

/// A member as a key of TOML.
fn key(name: &str) -> String {
    if plain(name) == name { name.to_owned() } else { toml::Value::String(name.to_owned()).to_string() }
}
