//! Tables of the layouts of structs.

use std::fmt::Write;

use serde::Serialize;

use crate::module::Module;
use crate::module::ty::Type;
use crate::reflect::Layout;
use crate::reflect::lookup::{explicit, name_of, strides, structs};

/// Rows of one layout that are written.
const ROWS: usize = 4096;

/// The layout of one struct as a table.
#[derive(Clone, Debug, Serialize)]
pub struct StructTable {
    /// Its name, or its id where it has none.
    pub name: String,
    /// Bytes up to the end of its last member; a runtime array at the end counts as nothing.
    pub size: usize,
    /// The strides of arrays of it and of pointers to it.
    pub strides: Vec<u32>,
    /// Its members, each followed by those of a struct inside it.
    pub members: Vec<MemberRow>,
}

/// A member of a struct, or of a struct inside it.
#[derive(Clone, Debug, Serialize)]
pub struct MemberRow {
    /// Bytes from the start of the whole struct.
    pub offset: usize,
    /// Its size in bytes; 0 for a runtime array.
    pub size: usize,
    /// Bytes between elements of an array, or columns (or rows) of a matrix.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride: Option<usize>,
    /// Its type; `row_major` before a matrix that lies so.
    #[serde(rename = "type")]
    pub ty: String,
    /// The path of names from the struct to it.
    pub name: String,
}

impl StructTable {
    /// The table of a struct.
    pub fn of(layout: Layout<'_>) -> Self {
        let mut members = Vec::new();
        rows(layout, "", 0, &mut members);
        let id = || layout.module.id_of_type(layout.ty).map_or(0, |id| id.0);
        let name = name_of(layout.module, layout.ty);
        Self {
            name: name.map_or_else(|| format!("%{}", id()), str::to_owned),
            size: layout.size(),
            strides: strides(layout),
            members,
        }
    }

    /// The tables of all structs of a module that have a layout.
    pub fn all(module: &Module) -> Vec<Self> {
        structs(module).map(|ty| Self::of(explicit(module, ty))).collect()
    }

    /// The table as text.
    pub fn text(&self) -> String {
        let mut out = format!("struct {}: {} bytes", self.name, self.size);
        if !self.strides.is_empty() {
            let strides: Vec<_> = self.strides.iter().map(u32::to_string).collect();
            let _ = write!(out, ", stride {}", strides.join(" or "));
        }
        let _ = writeln!(out, "\n  offset    size  stride  type and name");
        let width = self.members.iter().map(|row| row.ty.chars().count()).max().unwrap_or(0);
        for row in &self.members {
            let stride = row.stride.map(|stride| stride.to_string()).unwrap_or_default();
            let _ = writeln!(
                out,
                "  {:>6}  {:>6}  {stride:>6}  {:<width$}  {}",
                row.offset, row.size, row.ty, row.name
            );
        }
        if self.members.len() == ROWS {
            let _ = writeln!(out, "  and more, not shown");
        }
        out
    }
}

fn rows(layout: Layout<'_>, path: &str, offset: usize, out: &mut Vec<MemberRow>) {
    let Type::Struct { members, .. } = layout.module.ty(layout.ty) else { return };
    for (member, (at, part)) in members.iter().zip(layout.members()) {
        if out.len() == ROWS {
            return;
        }
        let row_major = part.matrix.is_some_and(|matrix| matrix.row_major);
        let stride = match layout.module.ty(part.ty) {
            Type::Matrix { .. } => part.matrix.map(|matrix| matrix.stride as usize),
            _ => Some(part.stride()).filter(|stride| *stride > 0),
        };
        let ty = layout.module.describe_type(part.ty);
        let name = format!("{path}{}{}", if path.is_empty() { "" } else { "." }, member.name);
        out.push(MemberRow {
            offset: offset.saturating_add(at),
            size: part.size(),
            stride,
            ty: if row_major { format!("row_major {ty}") } else { ty },
            name: name.clone(),
        });
        rows(part, &name, offset.saturating_add(at), out);
    }
}
