//! Push constants as a shader reads them.

use serde::Serialize;

use anyhit_engine::machine::Buffer;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;
use anyhit_engine::program::descriptors::declared_blocks;
use anyhit_engine::reflect::value::TypedValue;
use anyhit_engine::reflect::{Layout, Rules};

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
        let mut given = bytes.clone();
        given.resize(declared, 0);
        named(TypedValue::of_bytes(layout, &given))
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
