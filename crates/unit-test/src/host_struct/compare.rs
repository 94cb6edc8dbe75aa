//! Comparison of a shader's block with a host's struct.

use std::collections::{HashMap, HashSet};

use serde::Serialize;

use crate::host_struct::{HostType, Parts, ScalarClass};
use anyhit_base::error::{Error, ErrorKind};
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::reflect::Layout;
use anyhit_engine::reflect::lookup::{name_of, strides};

/// Scalars of one struct that are compared.
const MAX_SCALARS: usize = 1 << 18;

/// Rows of a table above and below the difference.
const CONTEXT: usize = 12;

/// A member that is no struct: one row of a table.
#[derive(Clone, Debug, Serialize)]
struct Row {
    /// Bytes from the start of the struct.
    offset: usize,
    /// Size in bytes.
    size: usize,
    #[serde(rename = "type")]
    ty: String,
    name: String,
    #[serde(skip)]
    is_padding: bool,
    /// The name for comparisons: without case, underscores and indices.
    #[serde(skip)]
    key: String,
}

#[derive(Clone, Copy, Debug)]
struct Scalar {
    offset: usize,
    size: usize,
    class: ScalarClass,
    row: usize,
    /// Part of a runtime array, which a host may leave out.
    is_optional: bool,
}

/// One of the two structs, taken apart.
#[derive(Clone, Debug, Default, Serialize)]
struct Side {
    name: String,
    /// Bytes, without a runtime array at the end.
    size: usize,
    members: Vec<Row>,
    #[serde(skip)]
    scalars: Vec<Scalar>,
    /// Stride of the array without a length at the end.
    #[serde(skip)]
    last_stride: Option<usize>,
    #[serde(skip)]
    is_truncated: bool,
}

/// Where two structs differ first.
#[derive(Clone, Debug, Serialize)]
struct Difference {
    /// Bytes from the start of both structs.
    offset: usize,
    message: String,
    help: String,
}

/// The result of a comparison, with both layouts.
#[derive(Clone, Debug, Serialize)]
pub struct LayoutComparison {
    shader: Side,
    host: Side,
    difference: Option<Difference>,
    /// Names of the shader and of the host for the same bytes, where neither occurs on the other
    /// side.
    renamed: Vec<(String, String)>,
}

/// Compares a block of a shader with a struct of the host.
pub fn compare(layout: Layout<'_>, host: &HostType, host_name: &str) -> LayoutComparison {
    let name = name_of(layout.module, layout.ty)
        .map_or_else(|| layout.module.describe_type(layout.ty), str::to_owned);
    let mut shader = Side { name, size: layout.size(), ..Side::default() };
    shader.add_shader(layout, "", 0, None, false);
    let mut other = Side { name: host_name.to_owned(), size: host.size(), ..Side::default() };
    other.add_host(host, "", 0, None, false);
    for side in [&mut shader, &mut other] {
        sort_by_key(&mut side.scalars, |scalar| scalar.offset);
    }
    let mut comparison = LayoutComparison { shader, host: other, difference: None, renamed: Vec::new() };
    comparison.difference = comparison.first_difference(&strides(layout));
    comparison
}

impl Side {
    fn row(&mut self, offset: usize, size: usize, ty: String, name: &str) -> usize {
        let last = name.rsplit('.').next().unwrap_or(name);
        let key = name.split('.').map(normalised).collect::<Vec<_>>().join(".");
        self.members.push(Row { offset, size, ty, name: name.to_owned(), is_padding: is_padding(last), key });
        self.members.len() - 1
    }

    fn is_full(&mut self) -> bool {
        self.is_truncated |= self.scalars.len() >= MAX_SCALARS;
        self.is_truncated
    }

    fn add_scalar(&mut self, offset: usize, size: usize, class: ScalarClass, row: usize, is_optional: bool) {
        if !self.is_full() {
            self.scalars.push(Scalar { offset, size, class, row, is_optional });
        }
    }

    /// Adds a part of the shader's struct; `row` is that of the member around, once there is one.
    fn add_shader(&mut self, at: Layout<'_>, path: &str, offset: usize, row: Option<usize>, optional: bool) {
        if self.is_full() {
            return;
        }
        let module = at.module;
        if let Type::Struct { members, .. } = module.ty(at.ty) {
            for (member, (start, part)) in members.iter().zip(at.members()) {
                let path = joined(path, &member.name);
                self.add_shader(part, &path, offset.saturating_add(start), None, optional);
            }
            return;
        }
        let (element, count, optional) = match *module.ty(at.ty) {
            Type::Array { element, length, .. } => (Some(element), array_length(module, length), optional),
            Type::RuntimeArray { element, .. } => {
                self.last_stride = Some(at.stride());
                (Some(element), 1, true)
            }
            _ => (None, 0, optional),
        };
        if let Some(element) = element.filter(|element| holds_struct(at, *element)) {
            let part = Layout { ty: element, ..at };
            for index in 0..count {
                if self.is_full() {
                    return;
                }
                let start = index.saturating_mul(at.stride());
                let path = format!("{path}[{index}]");
                self.add_shader(part, &path, offset.saturating_add(start), None, optional);
            }
            return;
        }
        let row = row.unwrap_or_else(|| {
            let size = if optional && at.size() == 0 { at.stride() } else { at.size() };
            self.row(offset, size, module.describe_type(at.ty), path)
        });
        match *module.ty(at.ty) {
            Type::Bool | Type::Int { .. } | Type::Pointer { .. } => {
                self.add_scalar(offset, at.size(), ScalarClass::Integer, row, optional);
            }
            Type::Float { .. } => self.add_scalar(offset, at.size(), ScalarClass::Float, row, optional),
            _ => match element {
                Some(element) => {
                    let part = Layout { ty: element, ..at };
                    for index in 0..count {
                        if self.is_full() {
                            return;
                        }
                        let start = offset.saturating_add(index.saturating_mul(at.stride()));
                        self.add_shader(part, path, start, Some(row), optional);
                    }
                }
                None => {
                    for (start, part) in at.parts() {
                        self.add_shader(part, path, offset.saturating_add(start), Some(row), optional);
                    }
                }
            },
        }
    }

    fn add_host(&mut self, ty: &HostType, path: &str, offset: usize, row: Option<usize>, optional: bool) {
        if self.is_full() {
            return;
        }
        let (element, count, optional) = match &ty.parts {
            Parts::Struct(fields) => {
                for field in fields {
                    let path = joined(path, &field.name);
                    self.add_host(&field.ty, &path, offset.saturating_add(field.offset), None, optional);
                }
                return;
            }
            Parts::Scalar(class) => {
                let row = row.unwrap_or_else(|| self.row(offset, ty.size, ty.name.clone(), path));
                return self.add_scalar(offset, ty.size, *class, row, optional);
            }
            Parts::Array(element, count) => (element, *count, optional),
            Parts::Flexible(element) => {
                self.last_stride = Some(element.size);
                (element, 1, true)
            }
        };
        let is_nested = element.holds_struct();
        let row = match row {
            Some(row) => Some(row),
            None if is_nested => None,
            None => {
                let size = if ty.size == 0 { element.size } else { ty.size };
                Some(self.row(offset, size, ty.name.clone(), path))
            }
        };
        for index in 0..count {
            if self.is_full() {
                return;
            }
            let start = offset.saturating_add(index.saturating_mul(element.size));
            let path = if is_nested { format!("{path}[{index}]") } else { path.to_owned() };
            self.add_host(element, &path, start, row, optional);
        }
    }

    /// The first member of a name for comparisons.
    fn find(&self, key: &str) -> Option<&Row> {
        self.members.iter().find(|row| row.key == key)
    }
}

impl HostType {
    fn holds_struct(&self) -> bool {
        match &self.parts {
            Parts::Struct(_) => true,
            Parts::Array(element, _) | Parts::Flexible(element) => element.holds_struct(),
            Parts::Scalar(_) => false,
        }
    }
}

fn holds_struct(layout: Layout<'_>, mut ty: TypeId) -> bool {
    loop {
        ty = match *layout.module.ty(ty) {
            Type::Struct { .. } => return true,
            Type::Array { element, .. } | Type::RuntimeArray { element, .. } => element,
            _ => return false,
        }
    }
}

fn joined(path: &str, name: &str) -> String {
    match (path, name) {
        // Parts without a name, such as the struct that naga puts into a block.
        (_, "") => path.to_owned(),
        ("", _) => name.to_owned(),
        _ => format!("{path}.{name}"),
    }
}

/// A name as both sides may write it: `m_baseColor` and `base_color` are alike.
fn normalised(name: &str) -> String {
    let name = name.strip_prefix("m_").unwrap_or(name);
    name.chars().filter(|letter| *letter != '_').flat_map(char::to_lowercase).collect()
}

/// True if a name says that its member only fills space.
fn is_padding(name: &str) -> bool {
    let name = normalised(name.split('[').next().unwrap_or(name));
    let bare = name.trim_end_matches(|letter: char| letter.is_ascii_digit());
    ["pad", "padding", "unused", "reserved", "dummy", "filler", "spare"].contains(&bare)
        || bare.starts_with("pad") && name.len() > bare.len()
        || bare.starts_with("padding")
}

impl LayoutComparison {
    fn first_difference(&mut self, strides: &[u32]) -> Option<Difference> {
        let found = self.scalar_difference();
        if found.is_some() {
            return found;
        }
        let (shader, host) = (&self.shader, &self.host);
        if let (Some(ours), Some(theirs)) = (shader.last_stride, host.last_stride)
            && ours != theirs
        {
            let offset = shader.size.min(host.size);
            let message = format!(
                "the elements of the last array are {ours} bytes apart in the shader, {theirs} in the host"
            );
            return Some(Difference { offset, message, help: stride_help(ours, theirs) });
        }
        let size = host.size;
        if !strides.is_empty() && !strides.contains(&(size as u32)) {
            let stride = strides[0] as usize;
            let message = format!(
                "elements of `{}` are {stride} bytes apart in the shader, but `{}` has {size} bytes",
                shader.name, host.name
            );
            return Some(Difference { offset: size.min(stride), message, help: stride_help(stride, size) });
        }
        None
    }

    /// Walks over the scalars of both sides in the order of their offsets.
    fn scalar_difference(&mut self) -> Option<Difference> {
        let (shader, host) = (&self.shader, &self.host);
        let (mut ours, mut theirs) = (0, 0);
        let mut seen = HashSet::new();
        let mut renamed = Vec::new();
        let keys =
            |side: &Side| -> HashSet<String> { side.members.iter().map(|row| row.key.clone()).collect() };
        let (shader_keys, host_keys) = (keys(shader), keys(host));
        loop {
            match (shader.scalars.get(ours), host.scalars.get(theirs)) {
                (None, None) => break,
                // What was not looked at is no difference.
                (None, _) if shader.is_truncated => break,
                (_, None) if host.is_truncated => break,
                (Some(a), Some(b)) if a.offset == b.offset => {
                    let (row, other) = (&shader.members[a.row], &host.members[b.row]);
                    if row.is_padding != other.is_padding {
                        // One side may split its padding otherwise.
                        return Some(if row.is_padding {
                            self.only_host(b)
                        } else {
                            self.only_shader(a, Some(other))
                        });
                    }
                    if !row.is_padding && (a.class, a.size) != (b.class, b.size) {
                        return Some(self.kinds_differ(a, b));
                    }
                    if !row.is_padding && row.key != other.key && seen.insert((a.row, b.row)) {
                        if host_keys.contains(&row.key) || shader_keys.contains(&other.key) {
                            return Some(self.swapped(a, row, other));
                        }
                        if !is_within(&row.key, &other.key) && !is_within(&other.key, &row.key) {
                            renamed.push((row.name.clone(), other.name.clone()));
                        }
                    }
                    ours += 1;
                    theirs += 1;
                }
                (Some(a), b) if b.is_none_or(|b| a.offset < b.offset) => {
                    if !(shader.members[a.row].is_padding || a.is_optional && b.is_none()) {
                        let around = host.scalars[..theirs].last();
                        let around = around.filter(|one| one.offset + one.size > a.offset);
                        return Some(self.only_shader(a, around.map(|one| &host.members[one.row])));
                    }
                    ours += 1;
                }
                (next, Some(b)) => {
                    let is_clear = next.is_none_or(|a| b.offset.saturating_add(b.size) <= a.offset);
                    if !(host.members[b.row].is_padding && is_clear || b.is_optional && next.is_none()) {
                        return Some(self.only_host(b));
                    }
                    theirs += 1;
                }
                (Some(_), None) => break,
            }
        }
        self.renamed = renamed;
        None
    }

    /// The shader has a scalar where the host has none, or padding.
    fn only_shader(&self, scalar: &Scalar, covering: Option<&Row>) -> Difference {
        let row = &self.shader.members[scalar.row];
        if let Some(other) = self.host.find(&row.key).filter(|other| other.offset != row.offset) {
            return moved(scalar.offset, row, other, &self.host.name);
        }
        if let Some(other) = self.host.find(&row.key) {
            return extent_differs(scalar.offset, row, other);
        }
        let instead = match covering {
            Some(other) if other.is_padding => format!(", where `{}` has padding", self.host.name),
            Some(other) => format!(", within `{}` of `{}`", other.name, self.host.name),
            None if scalar.offset >= self.host.size => {
                format!(", past the end of `{}` ({} bytes)", self.host.name, self.host.size)
            }
            None => format!(", where `{}` has no member", self.host.name),
        };
        let message = format!("the shader has `{} {}` at byte {}{instead}", row.ty, row.name, row.offset);
        let help = format!("add `{}` to the host's struct at byte {}", row.name, row.offset);
        Difference { offset: scalar.offset, message, help }
    }

    fn only_host(&self, scalar: &Scalar) -> Difference {
        let row = &self.host.members[scalar.row];
        if let Some(other) = self.shader.find(&row.key).filter(|other| other.offset != row.offset) {
            return moved(scalar.offset, other, row, &self.host.name);
        }
        if let Some(other) = self.shader.find(&row.key) {
            return extent_differs(scalar.offset, other, row);
        }
        let place = if scalar.offset >= self.shader.size {
            "after the shader's last member"
        } else {
            "where the shader has no member"
        };
        let message =
            format!("`{}` has `{}` ({}) at byte {}, {place}", self.host.name, row.name, row.ty, row.offset);
        let help = format!("remove `{}` from the host's struct, or declare it in the shader", row.name);
        Difference { offset: scalar.offset, message, help }
    }

    /// Reports scalars of two kinds at one offset: members of one name have other elements, or
    /// their types differ.
    fn kinds_differ(&self, a: &Scalar, b: &Scalar) -> Difference {
        let (row, other) = (&self.shader.members[a.row], &self.host.members[b.row]);
        let pairs = [(Some(row), self.host.find(&row.key)), (self.shader.find(&other.key), Some(other))];
        let has_other_extent = |pair: &(Option<&Row>, Option<&Row>)| matches!(pair, (Some(ours), Some(theirs)) if ours.offset == theirs.offset && ours.size != theirs.size);
        let other_extent = pairs.into_iter().find(has_other_extent).filter(|_| row.key != other.key);
        if let Some((Some(ours), Some(theirs))) = other_extent {
            return extent_differs(a.offset, ours, theirs);
        }
        let kind = |scalar: &Scalar| {
            let class = if scalar.class == ScalarClass::Float { "a float" } else { "an integer" };
            format!("{class} of {} bits", scalar.size * 8)
        };
        let message = format!(
            "`{}` has {} in the shader ({}), `{}` has {} in the host ({})",
            row.name,
            kind(a),
            row.ty,
            other.name,
            kind(b),
            other.ty
        );
        Difference { offset: a.offset, message, help: "declare both with the same type".into() }
    }

    /// Reports bytes whose names belong elsewhere on the other side.
    fn swapped(&self, scalar: &Scalar, row: &Row, other: &Row) -> Difference {
        if let Some(there) = self.host.find(&row.key) {
            return moved(scalar.offset, row, there, &self.host.name);
        }
        if let Some(there) = self.shader.find(&other.key) {
            return moved(scalar.offset, there, other, &self.host.name);
        }
        let message = format!(
            "byte {} is `{}` in the shader and `{}` in the host",
            scalar.offset, row.name, other.name
        );
        Difference { offset: scalar.offset, message, help: "declare the members in the same order".into() }
    }

    /// True if the host's struct has the shader's layout.
    pub fn is_equal(&self) -> bool {
        self.difference.is_none()
    }

    /// The comparison as text: one line where the layouts are equal.
    pub fn text(&self) -> String {
        let (shader, host) = (&self.shader, &self.host);
        let mut text =
            format!("`{}` and `{}` have the same layout: {} bytes", shader.name, host.name, shader.size);
        if let Some(stride) = shader.last_stride {
            text += &format!(", and {stride} for each element of the last array");
        }
        text.push('\n');
        for (ours, theirs) in &self.renamed {
            text += &format!("note: `{ours}` of the shader is `{theirs}` in the host\n");
        }
        if shader.is_truncated {
            text += &format!("note: compared the first {MAX_SCALARS} scalars\n");
        }
        text
    }

    /// The difference as an error, both layouts side by side; `None` where they are equal.
    pub fn error(&self) -> Option<Error> {
        let difference = self.difference.as_ref()?;
        let message = format!(
            "`{}` and `{}` differ at byte {}: {}",
            self.shader.name, self.host.name, difference.offset, difference.message
        );
        let error =
            Error::new(ErrorKind::Expectation, message).note_lines(self.table(difference.offset).join("\n"));
        Some(error.note(format!("help: {}", difference.help)))
    }

    /// Both layouts, those of one offset in one line, around a byte.
    fn table(&self, at: usize) -> Vec<String> {
        type Cells = [Option<usize>; 2];
        let mut rows: Vec<(usize, Cells)> = Vec::new();
        let mut by_offset: HashMap<usize, usize> = HashMap::new();
        for (index, row) in self.shader.members.iter().enumerate() {
            by_offset.entry(row.offset).or_insert(rows.len());
            rows.push((row.offset, [Some(index), None]));
        }
        for (index, row) in self.host.members.iter().enumerate() {
            match by_offset.get(&row.offset) {
                Some(&found) if rows[found].1[1].is_none() => rows[found].1[1] = Some(index),
                _ => rows.push((row.offset, [None, Some(index)])),
            }
        }
        sort_by_key(&mut rows, |row| row.0);
        let covers = |row: &Row| row.offset <= at && at < row.offset.saturating_add(row.size.max(1));
        let sides = [&self.shader, &self.host];
        let is_marked = |cells: &Cells| {
            sides.iter().zip(cells).any(|(side, cell)| cell.is_some_and(|cell| covers(&side.members[cell])))
        };
        let marked = rows.iter().position(|row| is_marked(&row.1)).unwrap_or(rows.len());
        let shown = marked.saturating_sub(CONTEXT)..rows.len().min(marked.saturating_add(CONTEXT));
        let cell = |side: &Side, cell: Option<usize>| {
            cell.map_or_else(String::new, |cell| {
                let row = &side.members[cell];
                format!("{} {}", row.ty, row.name)
            })
        };
        let head = format!("{} ({} bytes)", self.shader.name, self.shader.size);
        let left: Vec<String> = rows[shown.clone()].iter().map(|row| cell(&self.shader, row.1[0])).collect();
        let width = left.iter().chain([&head]).map(|text| text.chars().count()).max().unwrap_or(0);
        let mut lines = vec![format!("  byte  {head:width$}  {} ({} bytes)", self.host.name, self.host.size)];
        if shown.start > 0 {
            lines.push("   ...".into());
        }
        for ((offset, cells), left) in rows[shown.clone()].iter().zip(left) {
            let mark = if is_marked(cells) { '>' } else { ' ' };
            let right = cell(&self.host, cells[1]);
            lines.push(format!("{mark}{offset:>5}  {left:width$}  {right}").trim_end().to_owned());
        }
        if shown.end < rows.len() {
            lines.push("   ...".into());
        }
        if marked == rows.len() {
            lines.push(format!(">{at:>5}  {:width$}  end", "end"));
        }
        lines
    }
}

/// True if a path leads into a member.
fn is_within(path: &str, member: &str) -> bool {
    path.strip_prefix(member).is_some_and(|rest| rest.starts_with(['.', '[']))
}

/// A member lies at different offsets.
fn moved(offset: usize, row: &Row, other: &Row, host: &str) -> Difference {
    let message = format!(
        "`{}` begins at byte {} in the shader, at byte {} in `{host}`",
        row.name, row.offset, other.offset
    );
    let name = &other.name;
    let help = if other.offset < row.offset {
        let missing = row.offset - other.offset;
        format!(
            "insert {missing} bytes of padding before `{name}` in the host, or declare the same members before it"
        )
    } else {
        let extra = other.offset - row.offset;
        format!(
            "the host has {extra} more bytes before `{name}`: remove them (alignment of a type, padding, \
             a member), or move the member in the shader"
        )
    };
    Difference { offset, message, help }
}

/// A member begins at the same offset and has other elements.
fn extent_differs(offset: usize, row: &Row, other: &Row) -> Difference {
    let message = format!(
        "`{}` is `{}` ({} bytes) in the shader and `{}` ({} bytes) in the host",
        row.name, row.ty, row.size, other.ty, other.size
    );
    let help = "declare the same number of elements with the same stride: in std140, the elements of an array \
         are 16 bytes apart";
    Difference { offset, message, help: help.into() }
}

fn stride_help(shader: usize, host: usize) -> String {
    if host < shader {
        format!("add {} bytes of padding to the end of the host's struct", shader - host)
    } else {
        format!(
            "remove {} bytes from the host's struct, or align the shader's elements to {host} bytes",
            host - shader
        )
    }
}
