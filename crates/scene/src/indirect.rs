//! Sizes of dispatches and launches that buffers hold: `vkCmdDispatchIndirect` and
//! `vkCmdTraceRaysIndirectKHR`.

use std::sync::Arc;

use crate::ResolvedScene;
use crate::resolved::{IndirectSize, RebindingSource, ResolvedPassWork};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};

/// The size that a buffer holds now, in the resources as a pass finds them.
pub fn indirect_size(resources: &Resources) -> Option<[u32; 3]> {
    let buffer = resources.indirect.as_ref()?;
    Some([0, 4, 8].map(|offset| buffer.load(offset, 32).unwrap_or(0)))
}

/// The three words of a buffer that hold the size of a pass.
pub(super) fn size_buffer(indirect: &IndirectSize, resources: &Resources) -> Option<Arc<Buffer>> {
    let buffer = match &indirect.source {
        RebindingSource::Bound([set, binding, element]) => {
            let elements = resources.descriptors.get(&Binding { set: *set, binding: *binding })?;
            match elements.get(*element as usize)? {
                Descriptor::Buffer(buffer) => buffer,
                _ => return None,
            }
        }
        RebindingSource::Unbound(name) => resources.memory.named_buffer(name)?.1,
    };
    buffer.view(indirect.offset, IndirectSize::BYTES, &indirect.buffer)
}

/// The errors for sizes that go past the end of their buffers.
pub(super) fn mistakes(scene: &ResolvedScene) -> impl Iterator<Item = Error> {
    let launches = scene.passes.iter().filter_map(|pass| match &pass.work {
        ResolvedPassWork::Launch { indirect, .. } => indirect.as_deref(),
        ResolvedPassWork::Dispatch(_) => None,
    });
    let all = scene.dispatches.iter().filter_map(|dispatch| dispatch.indirect.as_ref()).chain(launches);
    all.filter_map(|indirect| check(scene, indirect).err())
}

/// Checks that a buffer holds a whole size.
fn check(scene: &ResolvedScene, indirect: &IndirectSize) -> Result<()> {
    let (size, place) = match &indirect.source {
        RebindingSource::Unbound(name) => {
            let Some(found) = scene.unbound.iter().find(|one| one.name == *name) else { return Ok(()) };
            (Some(found.data.size()?), &found.place)
        }
        RebindingSource::Bound(at) => {
            let found = scene.resources.iter().find(|one| [one.set, one.binding, one.element] == *at);
            let Some(found) = found else { return Ok(()) };
            (found.resource.buffer_size()?, &found.place)
        }
    };
    let size = size.unwrap_or(0);
    if indirect.offset.checked_add(IndirectSize::BYTES).is_some_and(|end| end <= size) {
        return Ok(());
    }
    let message = format!(
        "the size, 12 bytes at offset {}, extends past the end of `{}`, which has {size} bytes",
        indirect.offset, indirect.buffer
    );
    let rules = "VUID-vkCmdDispatchIndirect-offset-00407, \
                 VUID-vkCmdTraceRaysIndirectKHR-indirectDeviceAddress-03633";
    Err(Error::new(ErrorKind::InvalidScene, message)
        .at(indirect.place.clone())
        .at_with(place.clone(), format!("{size} bytes"))
        .note(rules))
}
