//! The state of a batch's invocations beside their registers: what builtins read.

use std::sync::Arc;

use crate::accel::{Candidate, HitKind, HitPrimitive, RayFlags, RecordIndex, Tlas, TlasInstance, TraceRay};
use crate::geometry::Ray;
use crate::machine::buffer::Buffer;
use crate::machine::lanes::{Lanes, Mask, Reg, Registers};
use crate::machine::shared_by_lanes::SharedByLanes;
use crate::machine::workgroup::Workgroup;
use crate::math::array;

/// The initial state of one invocation, for [`Invocations::set`].
#[derive(Clone, Debug, Default)]
pub struct Invocation {
    /// `LaunchIdKHR`; in compute `GlobalInvocationId`
    pub launch_id: [u32; 3],
    /// `LaunchSizeKHR`; in compute the invocations of the whole dispatch
    pub launch_size: [u32; 3],
    /// The trace that called this shader, where one did.
    pub trace: Option<TraceRay>,
    /// `RayTmaxKHR` as this stage sees it.
    pub t_max: f32,
    /// What was hit, in any-hit, closest-hit and intersection shaders.
    pub hit: Option<TlasHit>,
    /// The shader record's data after the handle.
    pub record: Option<ShaderRecord>,
    /// The recursion depth of traces: 0 in ray generation.
    pub depth: u32,
    /// `SubgroupSize`; 0 stands for [`DEFAULT_SUBGROUP_SIZE`].
    pub subgroup_size: u32,
    /// The workgroup, in compute.
    pub workgroup: Option<Arc<Workgroup>>,
    /// `LocalInvocationIndex`, in compute.
    pub local_index: u32,
    /// The index in the order from which subgroups are formed, in compute.
    pub subgroup_order: u32,
}

/// `SubgroupSize` unless set otherwise.
pub const DEFAULT_SUBGROUP_SIZE: u32 = 32;

/// The operands of traces that traversal needs: structure of arrays, one word a lane for each.
#[derive(Clone, Copy, Debug)]
pub struct RayLanes<const W: usize> {
    /// The rays' flags.
    pub flags: Lanes<W>,
    /// The cull masks; only the low 8 bits are used.
    pub cull_mask: Lanes<W>,
    /// x, y and z of the origin, bits of f32.
    pub origin: [Lanes<W>; 3],
    /// The least ray parameter, bits of f32.
    pub t_min: Lanes<W>,
    /// x, y and z of the direction, bits of f32.
    pub direction: [Lanes<W>; 3],
    /// The greatest ray parameter, bits of f32.
    pub t_max: Lanes<W>,
    /// The times, bits of f32: see [`TraceRay::time`].
    pub time: Lanes<W>,
}

impl<const W: usize> RayLanes<W> {
    /// Operands that are all zero.
    pub const ZERO: Self = {
        let zero = Lanes([0; W]);
        Self {
            flags: zero,
            cull_mask: zero,
            origin: [zero; 3],
            t_min: zero,
            direction: [zero; 3],
            t_max: zero,
            time: zero,
        }
    };

    /// The ray of a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> TraceRay {
        let float = |lanes: &Lanes<W>| f32::from_bits(lanes.0[lane]);
        let three = |axes: &[Lanes<W>; 3]| [float(&axes[0]), float(&axes[1]), float(&axes[2])];
        let ray = Ray {
            origin: three(&self.origin),
            t_min: float(&self.t_min),
            direction: three(&self.direction),
            t_max: float(&self.t_max),
        };
        let flags = RayFlags(self.flags.0[lane]);
        TraceRay { ray, flags, cull_mask: self.cull_mask.0[lane], time: float(&self.time) }
    }

    /// Sets the ray of a lane.
    pub fn set(&mut self, lane: usize, trace: &TraceRay) {
        let TraceRay { ray, flags, cull_mask, time } = trace;
        for axis in 0..3 {
            self.origin[axis].0[lane] = ray.origin[axis].to_bits();
            self.direction[axis].0[lane] = ray.direction[axis].to_bits();
        }
        self.t_min.0[lane] = ray.t_min.to_bits();
        self.t_max.0[lane] = ray.t_max.to_bits();
        self.flags.0[lane] = flags.0;
        self.cull_mask.0[lane] = *cull_mask;
        self.time.0[lane] = time.to_bits();
    }

    /// Lanes whose rays certainly keep the rules of [`TraceRay::check`] when `flags` are added to
    /// their own.
    pub fn valid_rays(&self, flags: u32) -> Mask<W> {
        // The flags that are mutually exclusive, at least in part.
        const EXCLUSIVE: u32 = 1 | 2 | 16 | 32 | 64 | 128 | 256 | 512;
        let [[x, y, z], [dx, dy, dz]] = [&self.origin, &self.direction];
        let mut valid = Lanes::splat(0);
        for lane in 0..W {
            let finite = |lanes: &Lanes<W>| lanes.0[lane] & 0x7FFF_FFFF < 0x7F80_0000;
            let float = |lanes: &Lanes<W>| f32::from_bits(lanes.0[lane]);
            let (t_min, t_max, time) = (float(&self.t_min), float(&self.t_max), float(&self.time));
            let exclusive = (self.flags.0[lane] | flags) & EXCLUSIVE;
            let is_finite = finite(x) & finite(y) & finite(z) & finite(dx) & finite(dy) & finite(dz);
            let interval = (t_min >= 0.0) & (t_min <= t_max) & (0.0..=1.0).contains(&time);
            let compatible_flags = exclusive & exclusive.wrapping_sub(1) == 0;
            valid.0[lane] = u32::from(is_finite & interval & compatible_flags);
        }
        Mask::of(&valid)
    }

    /// The lanes whose direction is zero: such rays
    /// [go nowhere](crate::geometry::Ray::goes_nowhere).
    pub fn without_direction(&self) -> Mask<W> {
        let [x, y, z] = &self.direction;
        let mut zero = Lanes::splat(0);
        for lane in 0..W {
            // The sign bit does not matter.
            zero.0[lane] = u32::from((x.0[lane] | y.0[lane] | z.0[lane]) << 1 == 0);
        }
        Mask::of(&zero)
    }

    /// Copies the operands from registers. From `ray` on lie origin (3), t_min, direction (3),
    /// t_max and time, one register each.
    pub fn copy(&mut self, registers: &Registers<W>, flags: Reg, cull_mask: Reg, ray: Reg) {
        self.flags = registers[flags];
        self.cull_mask = registers[cull_mask];
        for axis in 0..3 {
            self.origin[axis] = registers[ray.plus(axis as u32)];
            self.direction[axis] = registers[ray.plus(4 + axis as u32)];
        }
        self.t_min = registers[ray.plus(3)];
        self.t_max = registers[ray.plus(7)];
        self.time = registers[ray.plus(8)];
    }
}

/// Hits or candidates of the lanes: structure of arrays.
#[derive(Clone, Copy, Debug)]
pub struct HitLanes<const W: usize> {
    /// `InstanceId`
    pub instance: Lanes<W>,
    /// `RayGeometryIndexKHR`
    pub geometry: Lanes<W>,
    /// `PrimitiveId`
    pub primitive: Lanes<W>,
    /// `HitKindKHR`
    pub kind: Lanes<W>,
}

impl<const W: usize> HitLanes<W> {
    /// Sets the hit of a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, prim: HitPrimitive, kind: HitKind) {
        self.instance.0[lane] = prim.instance;
        self.geometry.0[lane] = prim.geometry;
        self.primitive.0[lane] = prim.primitive;
        self.kind.0[lane] = kind.0;
    }
}

/// A field of [`Invocations`] that has one word for each lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "fields of the same names tell them")]
pub enum InvocationField {
    LaunchId(usize),
    Flags,
    CullMask,
    Origin(usize),
    TMin,
    Direction(usize),
    Time,
    TMax,
    Instance,
    Geometry,
    Primitive,
    Kind,
    LocalIndex,
}

/// The acceleration structure that the ray of each lane traverses.
pub type LaneTlases<const W: usize> = SharedByLanes<Tlas, W>;

/// The state of a batch's invocations that its shader reads through builtin variables: structure of
/// arrays.
#[derive(Clone, Debug)]
pub struct Invocations<const W: usize> {
    /// `LaunchIdKHR`; in compute `GlobalInvocationId`
    pub launch_id: [Lanes<W>; 3],
    /// `LaunchSizeKHR`; in compute the invocations of the whole dispatch
    pub launch_size: [u32; 3],
    /// The operands of the trace that called them; zeros where none did.
    pub rays: RayLanes<W>,
    /// `RayTmaxKHR` as this stage sees it.
    pub t_max: Lanes<W>,
    /// Whether [`Self::hits`] are set.
    pub hit: bool,
    /// What was hit, in any-hit, closest-hit and intersection shaders.
    pub hits: HitLanes<W>,
    /// Where instances and primitives are looked up.
    pub structures: LaneTlases<W>,
    /// The index of the shader record that each was called through, in its table.
    pub record_indices: [RecordIndex; W],
    /// The recursion depth of traces: 0 in ray generation.
    pub depth: u32,
    /// See [`Invocation::subgroup_size`].
    pub subgroup_size: u32,
    /// `LocalInvocationIndex`, in compute.
    local_index: Lanes<W>,
    subgroup_order: Lanes<W>,
    records: Vec<Option<ShaderRecord>>,
    workgroups: SharedByLanes<Workgroup, W>,
}

impl<const W: usize> Invocations<W> {
    /// Returns the state of invocations that no trace has called.
    pub fn new() -> Self {
        let zero = Lanes([0; W]);
        Self {
            launch_id: [zero; 3],
            launch_size: [0; 3],
            rays: RayLanes::ZERO,
            t_max: zero,
            hit: false,
            hits: HitLanes { instance: zero, geometry: zero, primitive: zero, kind: zero },
            structures: LaneTlases::default(),
            record_indices: [RecordIndex(0); W],
            depth: 0,
            subgroup_size: 0,
            local_index: zero,
            subgroup_order: zero,
            records: vec![None; W],
            workgroups: SharedByLanes::default(),
        }
    }

    /// Sets a lane. Values that the lanes of a batch share are those of the last call.
    pub fn set(&mut self, lane: usize, invocation: Invocation) {
        let Invocation { launch_id, launch_size, trace, t_max, hit, record, .. } = invocation;
        self.set_launch_id(lane, launch_id);
        self.launch_size = launch_size;
        let nothing = TraceRay {
            ray: Ray { origin: [0.0; 3], t_min: 0.0, direction: [0.0; 3], t_max: 0.0 },
            flags: RayFlags(0),
            cull_mask: 0,
            time: 0.0,
        };
        self.rays.set(lane, &trace.unwrap_or(nothing));
        self.t_max.0[lane] = t_max.to_bits();
        self.hit = hit.is_some();
        let nowhere = (HitPrimitive { instance: 0, geometry: 0, primitive: 0 }, HitKind(0));
        let (prim, kind) = hit.as_ref().map_or(nowhere, |hit| (hit.candidate.hit_primitive(), hit.kind));
        self.hits.set(lane, prim, kind);
        if let Some(TlasHit { tlas, .. }) = hit {
            self.structures.set(Mask::lane(lane), &tlas);
        }
        self.records[lane] = record;
        self.record_indices[lane] = RecordIndex(0);
        self.depth = invocation.depth;
        self.subgroup_size = invocation.subgroup_size;
        if let Some(workgroup) = &invocation.workgroup {
            self.workgroups.set(Mask::lane(lane), workgroup);
        }
        self.local_index.0[lane] = invocation.local_index;
        self.subgroup_order.0[lane] = invocation.subgroup_order;
    }

    /// Begins invocations of other workgroups, of a dispatch of so many invocations.
    pub fn begin_workgroups(&mut self, launch_size: [u32; 3], subgroup_size: u32) {
        (self.launch_size, self.subgroup_size) = (launch_size, subgroup_size);
        self.workgroups.clear();
    }

    /// Sets a lane to an invocation of a workgroup.
    #[inline]
    pub fn set_in_workgroup(
        &mut self,
        lane: usize,
        workgroup: &Arc<Workgroup>,
        local_index: u32,
        subgroup_order: u32,
    ) {
        self.set_launch_id(lane, workgroup.global_id(local_index));
        self.workgroups.set(Mask::lane(lane), workgroup);
        self.local_index.0[lane] = local_index;
        self.subgroup_order.0[lane] = subgroup_order;
    }

    /// The lanes of one field.
    #[inline]
    pub fn field(&self, field: InvocationField) -> &Lanes<W> {
        use InvocationField as Field;
        match field {
            Field::LaunchId(axis) => &self.launch_id[axis],
            Field::Flags => &self.rays.flags,
            Field::CullMask => &self.rays.cull_mask,
            Field::Origin(axis) => &self.rays.origin[axis],
            Field::TMin => &self.rays.t_min,
            Field::Direction(axis) => &self.rays.direction[axis],
            Field::Time => &self.rays.time,
            Field::TMax => &self.t_max,
            Field::Instance => &self.hits.instance,
            Field::Geometry => &self.hits.geometry,
            Field::Primitive => &self.hits.primitive,
            Field::Kind => &self.hits.kind,
            Field::LocalIndex => &self.local_index,
        }
    }

    /// `LaunchIdKHR` of a lane.
    #[inline]
    pub fn launch_id(&self, lane: usize) -> [u32; 3] {
        array::map([0, 1, 2], |axis| self.launch_id[axis].0[lane])
    }

    /// The number of a lane's invocation in the order in which a launch tells its traps: x of the
    /// launch index is fastest; in compute that of the workgroup, then the place in it.
    pub fn number(&self, lane: usize) -> u64 {
        if let Some(workgroup) = self.workgroup(lane) {
            let each = u64::from(workgroup.invocations());
            return workgroup.index().saturating_mul(each) + u64::from(self.subgroup_order.0[lane]);
        }
        let [x, y, z] = array::map(self.launch_id(lane), u64::from);
        let [width, height, _] = array::map(self.launch_size, u64::from);
        z.saturating_mul(height).saturating_add(y).saturating_mul(width).saturating_add(x)
    }

    /// Sets `LaunchIdKHR` of a lane.
    #[inline]
    fn set_launch_id(&mut self, lane: usize, id: [u32; 3]) {
        for (lanes, word) in self.launch_id.iter_mut().zip(id) {
            lanes.0[lane] = word;
        }
    }

    /// Sets `LaunchIdKHR` of `run` lanes from `lane` on: x increases by 1 from lane to lane.
    #[inline]
    pub fn set_launch_ids(&mut self, lane: usize, [x, y, z]: [u32; 3], run: usize) {
        let [xs, ys, zs] = &mut self.launch_id;
        for (to, x) in xs.0[lane..lane + run].iter_mut().zip(x..) {
            *to = x;
        }
        ys.0[lane..lane + run].fill(y);
        zs.0[lane..lane + run].fill(z);
    }

    /// Copies `LaunchIdKHR` and `LaunchSizeKHR` of other invocations.
    pub fn copy_launch_ids(&mut self, of: &Self) {
        (self.launch_id, self.launch_size) = (of.launch_id, of.launch_size);
    }

    /// `RayTmaxKHR` of a lane.
    #[inline]
    pub fn t_max(&self, lane: usize) -> f32 {
        f32::from_bits(self.t_max.0[lane])
    }

    /// Sets `RayTmaxKHR` of a lane.
    #[inline]
    pub fn set_t_max(&mut self, lane: usize, t_max: f32) {
        self.t_max.0[lane] = t_max.to_bits();
    }

    /// The shader record of a lane.
    #[inline]
    pub fn record(&self, lane: usize) -> Option<&ShaderRecord> {
        self.records[lane].as_ref()
    }

    /// Sets the shader record of a lane. It does not touch the reference count of a buffer that
    /// stays, as all threads share that count.
    #[inline]
    pub fn set_record(&mut self, lane: usize, record: Option<&ShaderRecord>) {
        match (&mut self.records[lane], record) {
            (None, None) => {}
            (Some(old), Some(new)) if Arc::ptr_eq(&old.data, &new.data) => {
                (old.offset, old.size) = (new.offset, new.size);
            }
            (old, new) => *old = new.cloned(),
        }
    }

    /// The workgroup of a lane.
    #[inline]
    pub fn workgroup(&self, lane: usize) -> Option<&Arc<Workgroup>> {
        self.workgroups.get(lane)
    }

    /// `LocalInvocationIndex` of a lane, in compute.
    pub fn local_index(&self, lane: usize) -> u32 {
        self.local_index.0[lane]
    }

    /// `SubgroupSize`
    pub fn subgroup_size(&self) -> u32 {
        if self.subgroup_size == 0 { DEFAULT_SUBGROUP_SIZE } else { self.subgroup_size }
    }

    /// The state of one lane, for builtins that are no field.
    #[inline]
    pub fn lane(&self, lane: usize) -> LaneInvocation<'_> {
        let tlas = self.structures.get(lane).filter(|_| self.hit);
        let hit = tlas.map(|tlas| {
            let HitLanes { instance, geometry, primitive, .. } = &self.hits;
            let [instance, geometry, primitive] =
                array::map([instance, geometry, primitive], |lanes| lanes.0[lane]);
            HitRef {
                tlas,
                prim: HitPrimitive { instance, geometry, primitive },
                kind: HitKind(self.hits.kind.0[lane]),
            }
        });
        LaneInvocation {
            launch_id: self.launch_id(lane),
            launch_size: self.launch_size,
            trace: self.rays.get(lane),
            hit,
            subgroup_size: self.subgroup_size(),
            workgroup: self.workgroup(lane),
            local_index: self.local_index.0[lane],
            subgroup_order: self.subgroup_order.0[lane],
        }
    }
}

impl<const W: usize> Default for Invocations<W> {
    fn default() -> Self {
        Self::new()
    }
}

/// One invocation of a batch.
#[derive(Clone, Debug)]
pub struct LaneInvocation<'a> {
    /// `LaunchIdKHR`; in compute `GlobalInvocationId`
    pub launch_id: [u32; 3],
    /// `LaunchSizeKHR`; in compute the invocations of the whole dispatch
    pub launch_size: [u32; 3],
    /// The trace that called it; zeros where none did.
    pub trace: TraceRay,
    /// What was hit.
    pub hit: Option<HitRef<'a>>,
    /// `SubgroupSize`
    pub subgroup_size: u32,
    /// The workgroup, in compute.
    pub workgroup: Option<&'a Arc<Workgroup>>,
    /// `LocalInvocationIndex`, in compute.
    pub local_index: u32,
    subgroup_order: u32,
}

impl LaneInvocation<'_> {
    /// `CurrentRayTimeNV`: 0 for a trace without motion, and where there is none.
    pub fn time(&self) -> f32 {
        self.trace.time
    }

    /// The linear index in the launch, x fastest.
    fn launch_index(&self) -> u64 {
        let [x, y, z] = array::map(self.launch_id, u64::from);
        let [width, height, _] = array::map(self.launch_size, u64::from);
        (z * height + y) * width + x
    }

    /// The index in the order from which subgroups are formed: that of the launch, or in compute
    /// that of the workgroup.
    fn order_index(&self) -> u64 {
        if self.workgroup.is_some() { self.subgroup_order.into() } else { self.launch_index() }
    }

    /// `SubgroupLocalInvocationId`: subgroups are runs of consecutive indices.
    pub fn subgroup_local_invocation_id(&self) -> u32 {
        (self.order_index() % u64::from(self.subgroup_size)) as u32
    }

    /// `SubgroupId`
    pub fn subgroup_id(&self) -> u64 {
        self.order_index() / u64::from(self.subgroup_size)
    }
}

/// What one invocation hit, together with the structure that holds it.
#[derive(Clone, Copy, Debug)]
pub struct HitRef<'a> {
    /// Where instance and primitive are looked up.
    pub tlas: &'a Tlas,
    /// The instance, geometry and primitive.
    pub prim: HitPrimitive,
    /// `HitKindKHR`
    pub kind: HitKind,
}

impl<'a> HitRef<'a> {
    /// The instance that was hit.
    pub fn instance(&self) -> &'a TlasInstance {
        &self.tlas.instances()[self.prim.instance as usize]
    }
}

/// A hit or candidate together with the structure that holds it.
#[derive(Clone, Debug)]
pub struct TlasHit {
    /// Where instance and primitive are looked up.
    pub tlas: Arc<Tlas>,
    /// The instance, geometry and primitive.
    pub candidate: Candidate,
    /// `HitKindKHR`
    pub kind: HitKind,
}

/// The data of a shader record: a range of bytes of a buffer.
#[derive(Clone, Debug)]
pub struct ShaderRecord {
    /// The table's data.
    pub data: Arc<Buffer>,
    /// Where the record's data begins, in bytes.
    pub offset: u64,
    /// How many bytes it has.
    pub size: u64,
}
