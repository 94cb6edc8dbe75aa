//! The types of a module: which ones there are, how they lie in memory, and what parts they have.

use rspirv::spirv::StorageClass;

use super::module::{Layout, Module, Ty, Type};

/// A way to a part: the index at each step.
pub type Path = Vec<u32>;

impl Module {
    pub fn int(&mut self, width: u32, signed: bool) -> Ty {
        self.ty(Type::Int { width, signed })
    }

    pub fn vector(&mut self, of: Ty, count: u32) -> Ty {
        if count == 1 { of } else { self.ty(Type::Vector(of, count)) }
    }

    pub fn pointer(&mut self, class: StorageClass, to: Ty) -> Ty {
        self.ty(Type::Pointer(class, to))
    }

    /// Scalars in a value.
    pub fn cells(&self, ty: Ty) -> u32 {
        match self.at(ty) {
            Type::Bool | Type::Int { .. } | Type::Float { .. } | Type::Pointer(..) => 1,
            Type::Vector(of, count) | Type::Matrix(of, count) => self.cells(*of) * count,
            Type::Array { element, count, .. } => self.cells(*element) * count,
            Type::Struct { members, .. } => members.iter().map(|&member| self.cells(member)).sum(),
            _ => 0,
        }
    }

    /// The scalar of a vector or of a scalar, and how many there are.
    pub fn scalar_of(&self, ty: Ty) -> (Ty, u32) {
        match *self.at(ty) {
            Type::Vector(of, count) => (of, count),
            _ => (ty, 1),
        }
    }

    pub fn width(&self, ty: Ty) -> u32 {
        match self.at(self.scalar_of(ty).0) {
            Type::Int { width, .. } | Type::Float { width } => *width,
            _ => 0,
        }
    }

    pub fn is_int(&self, ty: Ty) -> bool {
        matches!(self.at(self.scalar_of(ty).0), Type::Int { .. })
    }

    pub fn is_float(&self, ty: Ty) -> bool {
        matches!(self.at(self.scalar_of(ty).0), Type::Float { .. })
    }

    pub fn is_scalar(&self, ty: Ty) -> bool {
        matches!(self.at(ty), Type::Bool | Type::Int { .. } | Type::Float { .. })
    }

    pub fn is_composite(&self, ty: Ty) -> bool {
        matches!(self.at(ty), Type::Vector(..) | Type::Matrix(..) | Type::Array { .. } | Type::Struct { .. })
    }

    /// The direct parts of a composite.
    pub fn parts(&self, ty: Ty) -> Vec<Ty> {
        match self.at(ty) {
            Type::Vector(of, count) | Type::Matrix(of, count) => vec![*of; *count as usize],
            Type::Array { element, count, .. } => vec![*element; *count as usize],
            Type::Struct { members, .. } => members.clone(),
            _ => Vec::new(),
        }
    }

    /// The part at an index; for all but structs any index will do.
    pub fn part(&self, ty: Ty, index: u32) -> Ty {
        match self.at(ty) {
            Type::Vector(of, _) | Type::Matrix(of, _) => *of,
            Type::Array { element, .. } | Type::RuntimeArray { element, .. } => *element,
            Type::Struct { members, .. } => members[index as usize],
            _ => unreachable!("a part of a scalar"),
        }
    }

    pub fn at_path(&self, ty: Ty, path: &[u32]) -> Ty {
        path.iter().fold(ty, |ty, &index| self.part(ty, index))
    }

    /// Ways to the parts that `wanted` takes; of parts that are alike only the first.
    pub fn paths(&self, ty: Ty, wanted: &dyn Fn(Ty) -> bool) -> Vec<Path> {
        let mut found = Vec::new();
        self.add_paths(ty, wanted, &mut Vec::new(), &mut found);
        found
    }

    fn add_paths(&self, ty: Ty, wanted: &dyn Fn(Ty) -> bool, path: &mut Path, found: &mut Vec<Path>) {
        if wanted(ty) {
            found.push(path.clone());
        }
        let parts = match self.at(ty) {
            Type::Struct { members, .. } => members.clone(),
            Type::Vector(of, _) | Type::Matrix(of, _) => vec![*of],
            Type::Array { element, .. } => vec![*element],
            _ => return,
        };
        for (index, part) in parts.into_iter().enumerate() {
            path.push(index as u32);
            self.add_paths(part, wanted, path, found);
            path.pop();
        }
    }

    /// Whether a value may lie in a buffer.
    pub fn has_bool(&self, ty: Ty) -> bool {
        !self.paths(ty, &|part| matches!(self.at(part), Type::Bool)).is_empty()
    }

    /// A type with a layout, and its size and alignment (as `std430` has them).
    pub fn laid_out(&mut self, ty: Ty, rows: bool) -> (Ty, u32, u32) {
        match self.at(ty).clone() {
            Type::Int { width, .. } | Type::Float { width } => (ty, width / 8, width / 8),
            Type::Vector(of, count) => {
                let (_, size, _) = self.laid_out(of, rows);
                (ty, size * count, size * if count == 2 { 2 } else { 4 })
            }
            Type::Matrix(column, count) => {
                let (scalar, height) = self.scalar_of(column);
                let (along, across) = if rows { (count, height) } else { (height, count) };
                let vector = self.vector(scalar, along);
                let (_, _, align) = self.laid_out(vector, rows);
                (ty, align * across, align)
            }
            Type::Array { element, count, .. } => {
                let (element, size, align) = self.laid_out(element, rows);
                let stride = size.next_multiple_of(align);
                (self.ty(Type::Array { element, count, stride }), stride * count, align)
            }
            Type::Struct { members, .. } => {
                let (mut at, mut most) = (0u32, 1);
                let (mut offsets, mut matrices, mut laid) = (Vec::new(), Vec::new(), Vec::new());
                for member in members {
                    let (ty, size, align) = self.laid_out(member, rows);
                    at = at.next_multiple_of(align);
                    offsets.push(at);
                    matrices.push(self.matrix_in(ty).map(|matrix| (self.laid_out(matrix, rows).2, rows)));
                    laid.push(ty);
                    at += size;
                    most = most.max(align);
                }
                let size = at.next_multiple_of(most);
                let layout = Layout { offsets, matrices, size, block: false };
                (self.ty(Type::Struct { members: laid, layout: Some(layout) }), size, most)
            }
            other => unreachable!("{other:?} in a buffer"),
        }
    }

    fn matrix_in(&self, ty: Ty) -> Option<Ty> {
        match self.at(ty) {
            Type::Matrix(..) => Some(ty),
            Type::Array { element, .. } => self.matrix_in(*element),
            _ => None,
        }
    }

    /// Where floats lie in a value of a type with a layout.
    pub fn float_places(&self, ty: Ty, at: u32, matrix: Option<(u32, bool)>, found: &mut Vec<(u32, u32)>) {
        match self.at(ty) {
            Type::Float { width } => found.push((at, *width)),
            Type::Vector(of, count) => {
                let step = matrix.filter(|it| it.1).map_or(self.width(ty) / 8, |it| it.0);
                (0..*count).for_each(|index| self.float_places(*of, at + index * step, None, found));
            }
            Type::Matrix(column, count) => {
                let (stride, rows) = matrix.expect("a matrix's stride");
                let step = if rows { self.width(*column) / 8 } else { stride };
                (0..*count).for_each(|index| self.float_places(*column, at + index * step, matrix, found));
            }
            Type::Array { element, count, stride } => {
                (0..*count).for_each(|index| self.float_places(*element, at + index * stride, matrix, found));
            }
            Type::Struct { members, layout: Some(layout) } => {
                for (index, member) in members.iter().enumerate() {
                    self.float_places(*member, at + layout.offsets[index], layout.matrices[index], found);
                }
            }
            _ => {}
        }
    }
}
