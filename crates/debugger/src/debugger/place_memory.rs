//! The memory that places lie in, and the descriptors that lead to it.

use std::ops::Range;
use std::sync::Arc;

use crate::debugger::lane_state::LaneState;
use anyhit_engine::machine::{Binding, Bindings, Buffer, DeviceMemory};
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{MatrixLayout, TypeId};
use anyhit_engine::ops::memory::{PUSH_CONSTANTS_HANDLE, SHADER_RECORD_HANDLE, WORKGROUP_HANDLE};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{Layout, Rules};

/// What all places of a program share.
#[derive(Debug)]
pub(super) struct PlaceContext {
    pub(super) module: Arc<Module>,
    /// By slot: the binding, and the name of the shader's variable.
    pub(super) slots: Vec<(Binding, String)>,
    /// Whether workgroup memory has no layout of its own: each scalar takes as many words as in
    /// registers.
    pub(super) packed_workgroup: bool,
}

impl PlaceContext {
    pub(super) fn new(program: &Program) -> Arc<Self> {
        Arc::new(Self {
            module: program.module.clone(),
            slots: program.slots.iter().map(|slot| (slot.binding, slot.name.clone())).collect(),
            packed_workgroup: !program.workgroup_variables.iter().any(|variable| variable.is_block),
        })
    }

    /// A type as its values lie in registers.
    pub(super) fn packed(&self, ty: TypeId) -> Layout<'_> {
        Layout::new(&self.module, ty, Rules::Packed)
    }

    /// The rules that place variables of a storage class: workgroup memory may have no layout.
    pub(super) fn rules(&self, storage_class: u32) -> Rules {
        match storage_class {
            storage::WORKGROUP if self.packed_workgroup => Rules::Packed,
            _ => Rules::Explicit,
        }
    }

    /// A descriptor in words: the name of its resource in the scene, else that of the shader.
    pub(super) fn describe_descriptor(&self, state: &dyn LaneState, handle: u32) -> String {
        let Some((slot, element)) = Bindings::slot_of(handle) else { return "a null descriptor".into() };
        let Some((binding, name)) = self.slots.get(slot) else { return format!("descriptor {handle:#x}") };
        let bindings = state.bindings();
        let summary = bindings.bound.iter().find(|one| one.binding == *binding);
        let name = match summary.and_then(|summary| summary.name.as_deref()) {
            Some(resource) => resource,
            None => name,
        };
        let several = element > 0 || summary.is_some_and(|summary| summary.count > 1);
        let element = if several { format!("[{element}]") } else { String::new() };
        let bound = bindings.descriptor(handle).and_then(|descriptor| descriptor.kind());
        let unbound = if bound.is_none() { ", which is not bound" } else { "" };
        format!("`{name}{element}` ({binding}){unbound}")
    }
}

/// Bytes of memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct MemoryPlace {
    pub(super) base: MemoryBase,
    pub(super) offset: u64,
    /// The rules that place the parts of the value.
    pub(super) rules: Rules,
    /// The layout of matrices, and of a vector that is a column of one.
    pub(super) matrix: Option<MatrixLayout>,
}

/// The memory from which a place counts its offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MemoryBase {
    /// The buffer of a descriptor.
    Descriptor(u32),
    PushConstants,
    ShaderRecord,
    Workgroup,
    /// Device memory from an address on.
    Address(u64),
}

impl MemoryBase {
    /// The memory that a handle stands for.
    pub(super) fn of_handle(handle: u32) -> Self {
        match handle {
            PUSH_CONSTANTS_HANDLE => Self::PushConstants,
            SHADER_RECORD_HANDLE => Self::ShaderRecord,
            WORKGROUP_HANDLE => Self::Workgroup,
            handle => Self::Descriptor(handle),
        }
    }

    /// The buffer, and the range of its bytes that counts.
    pub(super) fn buffer(self, state: &dyn LaneState) -> Result<(&Buffer, Range<u64>), String> {
        let whole = |buffer: &'_ Buffer| 0..buffer.size();
        match self {
            Self::Descriptor(handle) => {
                let found = state.bindings().buffer(handle).map(|buffer| (buffer, whole(buffer)));
                found.ok_or_else(|| "no buffer is bound".to_owned())
            }
            Self::PushConstants => {
                let found = state.bindings().push_constants.as_deref().map(|buffer| (buffer, whole(buffer)));
                found.ok_or_else(|| "there are no push constants".to_owned())
            }
            Self::ShaderRecord => {
                let found = state.shader_record().map(|(buffer, first, size)| (buffer, first..first + size));
                found.ok_or_else(|| "the shader record has no data".to_owned())
            }
            Self::Workgroup => {
                let found = state.workgroup_memory().map(|buffer| (buffer, whole(buffer)));
                found.ok_or_else(|| "there is no workgroup memory".to_owned())
            }
            Self::Address(address) => {
                if DeviceMemory::is_null(address) {
                    return Err(format!("{address:#x} is too close to the null pointer"));
                }
                let (buffer, first) = state
                    .bindings()
                    .memory
                    .buffer(address)
                    .ok_or_else(|| format!("no buffer contains the address {address:#x}"))?;
                Ok((buffer, first..buffer.size().max(first)))
            }
        }
    }
}

/// The message for a read or write outside of memory.
pub(super) fn outside(offset: u64, range: &Range<u64>) -> String {
    format!("the offset {offset} is outside the {} available bytes", range.end - range.start)
}
