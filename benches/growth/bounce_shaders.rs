//! Shaders of pipelines: rays that hit a wall as often as a buffer or a payload asks for.

use rspirv::spirv::{BuiltIn, ExecutionModel, Op, StorageClass};

use crate::module_writer::{Id, Writer};

const RGBA32F: u32 = 1;

/// Traces as many rays as word 0 of the buffer says at z = 1 along -z, each with word 1 as its
/// payload. Stores the payload that the last one returns to the picture at binding 2.
pub fn ray_generation() -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::RayGenerationKHR);
    let tracer = Tracer::new(&mut it, StorageClass::RayPayloadKHR);
    let (uint, float, zero, one) = (it.uint, it.float, it.constant(0), it.constant(1));
    let [pair, triple, floats] = [(uint, 2), (uint, 3), (float, 4)].map(|parts| vector(&mut it, parts));
    let place = vector(&mut it, (float, 3));
    let image = it.global(Op::TypeImage, &[float, 1, 0, 0, 0, 2, RGBA32F]);
    let picture = it.variable(StorageClass::UniformConstant, image);
    it.bind(picture, 2);
    let id = it.builtin(BuiltIn::LaunchIdKHR, triple);
    let size = it.builtin(BuiltIn::LaunchSizeKHR, triple);
    let [id, size] = [id, size].map(|builtin| it.result(Op::Load, triple, &[builtin]));
    let [half, two] = [0.5, 2.0].map(|number| it.number(number));
    let minus = it.number(-1.0);
    let axis = |it: &mut Writer, axis: u32| {
        let [at, extent] = [id, size].map(|whole| {
            let part = it.result(Op::CompositeExtract, uint, &[whole, axis]);
            it.result(Op::ConvertUToF, float, &[part])
        });
        let at = it.result(Op::FAdd, float, &[at, half]);
        let at = it.result(Op::FDiv, float, &[at, extent]);
        let at = it.result(Op::FMul, float, &[at, two]);
        it.result(Op::FAdd, float, &[at, minus])
    };
    let [x, y] = [axis(&mut it, 0), axis(&mut it, 1)];
    let [front, none] = [1.0, 0.0].map(|number| it.number(number));
    let origin = it.result(Op::CompositeConstruct, place, &[x, y, front]);
    let direction = it.result(Op::CompositeConstruct, place, &[none, none, minus]);
    let [count, depth] = [zero, one].map(|index| it.load_word(index));
    it.repeat(count, |it, _| {
        it.op(Op::Store, &[tracer.payload, depth]);
        tracer.trace(it, origin, direction);
    });
    let value = it.result(Op::Load, uint, &[tracer.payload]);
    let value = it.result(Op::ConvertUToF, float, &[value]);
    let texel = it.result(Op::CompositeConstruct, floats, &[value, x, y, front]);
    let at = it.result(Op::VectorShuffle, pair, &[id, id, 0, 1]);
    let image = it.result(Op::Load, image, &[picture]);
    it.op(Op::ImageWrite, &[image, at, texel]);
    it.finish()
}

/// Traces the same ray again, with one less in its payload, until that is 0.
pub fn closest_hit() -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::ClosestHitKHR);
    let tracer = Tracer::new(&mut it, StorageClass::IncomingRayPayloadKHR);
    let (uint, bool, zero, one) = (it.uint, it.bool, it.constant(0), it.constant(1));
    let float = it.float;
    let place = vector(&mut it, (float, 3));
    let origin = it.builtin(BuiltIn::WorldRayOriginKHR, place);
    let direction = it.builtin(BuiltIn::WorldRayDirectionKHR, place);
    let left = it.result(Op::Load, uint, &[tracer.payload]);
    let more = it.result(Op::UGreaterThan, bool, &[left, zero]);
    let merge = it.begin_if(more);
    let left = it.result(Op::ISub, uint, &[left, one]);
    it.op(Op::Store, &[tracer.payload, left]);
    let [origin, direction] = [origin, direction].map(|builtin| it.result(Op::Load, place, &[builtin]));
    tracer.trace(&mut it, origin, direction);
    it.end_if(merge);
    it.finish()
}

/// Does nothing.
pub fn miss() -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::MissKHR);
    let uint = it.uint;
    let _ = it.variable(StorageClass::IncomingRayPayloadKHR, uint);
    it.finish()
}

/// Ignores every hit.
pub fn any_hit() -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::AnyHitKHR);
    it.op(Op::IgnoreIntersectionKHR, &[]);
    it.finish()
}

/// Calls the callable shader with word 0 of the buffer.
pub fn calling_ray_generation() -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::RayGenerationKHR);
    let (uint, zero, one) = (it.uint, it.constant(0), it.constant(1));
    let data = it.variable(StorageClass::CallableDataKHR, uint);
    let depth = it.load_word(zero);
    it.op(Op::Store, &[data, depth]);
    it.op(Op::ExecuteCallableKHR, &[zero, data]);
    let value = it.result(Op::Load, uint, &[data]);
    it.store_word(one, value);
    it.finish()
}

/// Calls itself with its callable data minus one until they are 0, and returns the depth in them.
pub fn callable() -> Vec<u8> {
    let mut it = Writer::new(ExecutionModel::CallableKHR);
    let (uint, bool, zero, one) = (it.uint, it.bool, it.constant(0), it.constant(1));
    let given = it.variable(StorageClass::IncomingCallableDataKHR, uint);
    let own = it.variable(StorageClass::CallableDataKHR, uint);
    let left = it.result(Op::Load, uint, &[given]);
    let more = it.result(Op::UGreaterThan, bool, &[left, zero]);
    let merge = it.begin_if(more);
    let left = it.result(Op::ISub, uint, &[left, one]);
    it.op(Op::Store, &[own, left]);
    it.op(Op::ExecuteCallableKHR, &[zero, own]);
    let value = it.result(Op::Load, uint, &[own]);
    let value = it.result(Op::IAdd, uint, &[value, one]);
    it.op(Op::Store, &[given, value]);
    it.end_if(merge);
    it.finish()
}

/// Declares the acceleration structure at binding 0, and a payload.
struct Tracer {
    structure_type: Id,
    structure: Id,
    payload: Id,
}

impl Tracer {
    fn new(it: &mut Writer, class: StorageClass) -> Self {
        let structure_type = it.global(Op::TypeAccelerationStructureKHR, &[]);
        let structure = it.variable(StorageClass::UniformConstant, structure_type);
        it.bind(structure, 0);
        let uint = it.uint;
        Self { structure_type, structure, payload: it.variable(class, uint) }
    }

    fn trace(&self, it: &mut Writer, origin: Id, direction: Id) {
        let [zero, all] = [0, 0xFF].map(|number| it.constant(number));
        let [near, far] = [0.0, 100.0].map(|number| it.number(number));
        let structure = it.result(Op::Load, self.structure_type, &[self.structure]);
        let operands = [structure, zero, all, zero, zero, zero, origin, near, direction, far, self.payload];
        it.op(Op::TraceRayKHR, &operands);
    }
}

fn vector(it: &mut Writer, (ty, count): (Id, u32)) -> Id {
    it.global(Op::TypeVector, &[ty, count])
}
