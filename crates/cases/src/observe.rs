//! What is observed of a run: its first ray, and what its shaders wrote and printed.

use std::sync::Arc;

use crate::expect::{Observed, ObservedMemory, RayFound};
use anyhit_engine::machine::{Binding, Descriptor, Printed, Resources, ShaderIndex};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{Event, Pipeline};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{Layout, Rules};
use anyhit_scene::{Assembled, ResolvedScene};
use anyhit_unit_test::value::Value;

/// A copy of a scene's resources for runs of its passes and rays, that collects what shaders print:
/// what no shader of the scene can write is shared.
pub(super) fn fresh_resources(assembled: &Assembled) -> Resources {
    let resources = &assembled.resources;
    let copied = assembled.written_memory(resources).copied(resources);
    Resources { printed: Some(Arc::<Printed>::default()), ..copied }
}

/// Takes printed lines, and notes buffers and images, whose bytes are read when they are compared.
pub(super) fn read_resources(scene: &ResolvedScene, resources: &Resources, observed: &mut Observed) {
    for line in resources.printed.iter().flat_map(|printed| printed.take()) {
        observed.printed += &line.text;
        if !line.text.ends_with('\n') {
            observed.printed.push('\n');
        }
    }
    let encodings = scene.image_encodings();
    for binding in &scene.resources {
        let key = Binding { set: binding.set, binding: binding.binding };
        let found = resources.descriptors.get(&key).and_then(|list| list.get(binding.element as usize));
        let name = binding.name.clone();
        let place = [binding.set, binding.binding, binding.element];
        match found {
            Some(Descriptor::Buffer(buffer)) => {
                observed.buffers.push(ObservedMemory::of_buffer(name, Some(place), buffer.clone()));
            }
            Some(Descriptor::Image(image) | Descriptor::ImageSampler(image, _)) => {
                let encoding = encodings.of(binding);
                observed.images.push(ObservedMemory::of_image(name, place, image.clone(), encoding));
            }
            _ => {}
        }
    }
    for unbound in &scene.unbound {
        if let Some((_, buffer)) = resources.memory.named_buffer(&unbound.name) {
            observed.buffers.push(ObservedMemory::of_buffer(unbound.name.clone(), None, buffer.clone()));
        }
    }
}

/// The result of the first ray of a run.
pub(super) fn first_ray(pipeline: &Pipeline, events: &[Event]) -> RayFound {
    // Traversal ends before a closest-hit shader traces on: the first to end is the first ray.
    let traversed = events.iter().find_map(|event| match event {
        Event::Traversed { committed, shader, .. } => Some((*committed, *shader)),
        _ => None,
    });
    let (committed, shader) = traversed.unwrap_or_default();
    let mut depth = 0;
    let payload = events.iter().find_map(|event| match event {
        Event::Trace { .. } => {
            depth += 1;
            None
        }
        Event::Traced { payload } => {
            depth -= 1;
            (depth == 0).then_some(&payload[..])
        }
        _ => None,
    });
    let payload = payload.map_or_else(Value::nothing, |words| payload_of(pipeline, shader, words));
    let traced = events.iter().find_map(|event| match event {
        Event::Trace { tlas, trace, .. } => Some((tlas.clone(), *trace)),
        _ => None,
    });
    let custom_index = committed.zip(traced.as_ref()).map_or(0, |(hit, (tlas, _))| {
        let instance = hit.candidate.instance as usize;
        tlas.instances()[instance].custom_index
    });
    RayFound { committed, custom_index, traced, payload }
}

/// A payload, typed as the last shader declares it, or as the largest declared payload.
fn payload_of(pipeline: &Pipeline, shader: Option<ShaderIndex>, words: &[u32]) -> Value {
    let registers = |program: &Arc<Program>| {
        program
            .interface_registers(storage::INCOMING_RAY_PAYLOAD)
            .map(|registers| (program.clone(), registers.ty, registers.count))
    };
    let ran = shader.and_then(|shader| registers(&pipeline.programs[shader.index()]));
    let declared =
        ran.or_else(|| pipeline.programs.iter().filter_map(registers).max_by_key(|(.., count)| *count));
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    declared.map_or_else(Value::nothing, |(program, ty, _)| {
        Layout::new(&program.module, ty, Rules::Packed).read(&bytes)
    })
}
