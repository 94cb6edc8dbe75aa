//! Push constants as a shader reads them.

use serde::Serialize;

use crate::values::TypedValue;
use anyhit_engine::machine::Buffer;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;
use anyhit_engine::program::descriptors::declared_blocks;
use anyhit_engine::program::layout::{Layout, Rules};

/// The largest block whose value is shown, in bytes.
const MAX_SHOWN: usize = 1024;

/// The push constants of a shader run.
#[derive(Clone, Debug, Serialize)]
pub struct GivenBlock {
    /// Bytes that the run was given.
    pub given: u64,
    /// Bytes that the shader declares, a runtime array at the end left out.
    pub declared: u64,
    /// The value as the shader declares it, bytes beyond those given being 0; omitted where it is
    /// large.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<TypedValue>,
}

/// The push constants that a shader declares and was given; `named` names the buffers that
/// addresses in the value lead to.
pub(super) fn given_block(
    named: impl Fn(TypedValue) -> TypedValue,
    program: &Program,
    data: &Buffer,
) -> Option<GivenBlock> {
    let (ty, ..) = declared_blocks(program).find(|(_, class, _)| *class == storage::PUSH_CONSTANT)?;
    let bytes = data.bytes();
    let layout = Layout::new(&program.module, ty, Rules::Explicit);
    let declared = layout.size();
    let value = (declared <= MAX_SHOWN && !has_runtime_array(layout)).then(|| {
        let words = packed_words(layout, &bytes);
        named(TypedValue::of_type(&program.module, ty, &words))
    });
    Some(GivenBlock { given: bytes.len() as u64, declared: declared as u64, value })
}

fn has_runtime_array(layout: Layout<'_>) -> bool {
    let is_runtime = |ty: TypeId| matches!(layout.module.ty(ty), Type::RuntimeArray { .. });
    match layout.module.ty(layout.ty) {
        Type::Struct { members, .. } => members.last().is_some_and(|member| is_runtime(member.ty)),
        _ => false,
    }
}

/// The words of a value, scalar after scalar, from its bytes in a layout.
fn packed_words(layout: Layout<'_>, bytes: &[u8]) -> Vec<u32> {
    let mut words = Vec::new();
    for (offset, scalar) in layout.scalars() {
        let mut bits = [0; 8];
        let size = scalar.size().min(bits.len());
        let given = bytes.get(offset..).unwrap_or_default();
        let count = size.min(given.len());
        bits[..count].copy_from_slice(&given[..count]);
        let bits = u64::from_le_bytes(bits);
        words.push(bits as u32);
        if size > 4 {
            words.push((bits >> 32) as u32);
        }
    }
    words
}
