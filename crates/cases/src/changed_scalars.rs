//! The scalars of a memory that differ between two runs, found by its layout without reading the
//! rest.

use anyhit_engine::module::ty::Type;
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::reflect::Layout;
use anyhit_unit_test::value::leaves::Leaf;

/// A scalar that differs: its path, its offset in bytes, and both values.
type ScalarVisitor<'v> = dyn FnMut(&str, usize, [Leaf; 2]) + 'v;

/// Visits every scalar whose bytes differ between two states of a value, or of a list of values
/// with a stride. Paths are those of [`Value::scalars`](anyhit_unit_test::value::Value):
/// `path.normal[2]`. Parts that either state does not reach are not visited.
///
/// Members may share their bytes, so that a few types make any number of parts: the walk ends
/// after some sixty visits of all bytes.
pub(super) fn changed_scalars(
    layout: Layout<'_>,
    stride: Option<usize>,
    states: [&[u8]; 2],
    visit: &mut ScalarVisitor<'_>,
) {
    let budget = states[0].len().saturating_mul(64).saturating_add(1 << 16);
    let mut walk = Walk { path: String::new(), budget, visit };
    match stride {
        None => walk.part(layout, 0, states),
        Some(stride) => walk.elements(layout, usize::MAX, stride, 0, states),
    }
}

struct Walk<'v> {
    path: String,
    /// Parts that may still be visited.
    budget: usize,
    visit: &'v mut ScalarVisitor<'v>,
}

impl Walk<'_> {
    /// Walks through a part whose bytes begin both states, at an offset in the whole.
    fn part(&mut self, layout: Layout<'_>, offset: usize, states: [&[u8]; 2]) {
        let Some(left) = self.budget.checked_sub(1) else { return };
        self.budget = left;
        let is_open = layout.runtime_stride().is_some()
            || matches!(layout.module.ty(layout.ty), Type::RuntimeArray { .. });
        let size = if is_open { usize::MAX } else { layout.size() };
        let states = states.map(|state| &state[..state.len().min(size)]);
        if states[0] == states[1] {
            return;
        }
        match *layout.module.ty(layout.ty) {
            Type::Array { element, length, .. } => {
                let length = array_length(layout.module, length);
                self.elements(Layout { ty: element, ..layout }, length, layout.stride(), offset, states);
            }
            Type::RuntimeArray { element, .. } => {
                self.elements(Layout { ty: element, ..layout }, usize::MAX, layout.stride(), offset, states);
            }
            Type::Struct { ref members, .. } => {
                for (index, (member, (at, part))) in members.iter().zip(layout.members()).enumerate() {
                    let length = self.path.len();
                    if length > 0 {
                        self.path.push('.');
                    }
                    match member.name.as_str() {
                        "" => self.path += &format!("_{index}"),
                        name => self.path += name,
                    }
                    self.part(part, offset + at, from(states, at));
                    self.path.truncate(length);
                }
            }
            Type::Vector { .. } | Type::Matrix { .. } => {
                for (index, (at, part)) in layout.parts().into_iter().enumerate() {
                    self.indexed(index, part, offset + at, from(states, at));
                }
            }
            _ => {
                let size = layout.size();
                let leaf = |state: &[u8]| layout.read_scalar(state.get(..size)?).and_then(Leaf::of);
                if let [Some(one), Some(other)] = states.map(leaf) {
                    (self.visit)(&self.path, offset, [one, other]);
                }
            }
        }
    }

    fn elements(
        &mut self,
        element: Layout<'_>,
        length: usize,
        stride: usize,
        offset: usize,
        states: [&[u8]; 2],
    ) {
        let stride = stride.max(1);
        let reached = states[0].len().max(states[1].len()).div_ceil(stride);
        for index in 0..length.min(reached) {
            let at = index * stride;
            let elements = from(states, at);
            let [one, other] = elements.map(|state| &state[..state.len().min(stride)]);
            if one != other {
                self.indexed(index, element, offset + at, elements);
            }
        }
    }

    fn indexed(&mut self, index: usize, part: Layout<'_>, offset: usize, states: [&[u8]; 2]) {
        let length = self.path.len();
        self.path += &format!("[{index}]");
        self.part(part, offset, states);
        self.path.truncate(length);
    }
}

fn from(states: [&[u8]; 2], offset: usize) -> [&[u8]; 2] {
    states.map(|state| state.get(offset..).unwrap_or_default())
}
