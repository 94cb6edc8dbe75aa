//! The builtin variables: number, type, stages, rules, and how each is read from an invocation.

use crate::accel::{HitKind, Primitive, Tlas};
use crate::geometry::ObjectRay;
use crate::machine::invocation::{HitRef, InvocationField as Field, Invocations, LaneInvocation};
use crate::machine::{Lanes, Mask};
use crate::math::array;
use crate::module::interface::Stage;

pub use check::{check, matches};

mod check;

/// A builtin variable of the Input storage class.
pub struct Builtin {
    /// The specification's name.
    pub name: &'static str,
    /// Its number.
    pub number: u32,
    /// The shape of its type.
    pub shape: ValueShape,
    /// The stages that may read it, by letter: R I A C M K, and G for `GLCompute`.
    pub stages: &'static str,
    /// The rules on execution model, storage class and type.
    pub vuids: [&'static str; 3],
    /// Whether it may change while the shader runs.
    pub volatile: bool,
    /// How it is read from the invocations.
    pub read: BuiltinRead,
}

/// How a builtin is read from the invocations of a batch. Words are 0 where nothing writes them.
#[derive(Clone, Copy, Debug)]
pub enum BuiltinRead {
    /// Fields of the invocations, copied.
    Fields(&'static [Field]),
    /// Words that are the same for all lanes, computed once.
    Uniform(fn(&LaneInvocation<'_>, &mut [u32])),
    /// Words that are computed for each lane.
    PerLane(fn(&LaneInvocation<'_>, &mut [u32])),
    /// Words of an instance at a point in time, computed once for lanes that share both.
    PerInstance(fn(&Tlas, u32, f32, &mut [u32])),
    /// Words that are computed for each lane; where all lanes hit one instance without a transform,
    /// fields are copied.
    ObjectRay(&'static [Field], fn(&LaneInvocation<'_>, &mut [u32])),
}

impl BuiltinRead {
    /// Reads it for the lanes of a mask, into its registers.
    pub fn read<const W: usize>(self, from: &Invocations<W>, mask: Mask<W>, to: &mut [Lanes<W>]) {
        let Some(first) = mask.lowest() else { return };
        let mut space = [0; 12];
        let words = &mut space[..to.len()];
        match self {
            Self::Fields(fields) => copy(to, from, fields),
            Self::ObjectRay(fields, _) if is_in_world(from, mask, first) => copy(to, from, fields),
            Self::Uniform(read) => {
                read(&from.lane(first), words);
                splat(to, words);
            }
            Self::PerLane(read) | Self::ObjectRay(_, read) => {
                for lane in mask.lanes() {
                    words.fill(0);
                    read(&from.lane(lane), words);
                    set(to, lane, words);
                }
            }
            Self::PerInstance(read) => {
                let key = |lane: usize| {
                    let lanes = [&from.hits.instance, from.structures.indices(), &from.rays.time];
                    array::map(lanes, |lanes| lanes.0[lane])
                };
                let mut known = None;
                let mut read_at = |lane: usize, words: &mut [u32]| {
                    if known != Some(key(lane)) {
                        words.fill(0);
                        if let Some(hit) = from.lane(lane).hit {
                            read(hit.tlas, hit.prim.instance, f32::from_bits(key(lane)[2]), words);
                        }
                        known = Some(key(lane));
                    }
                };
                read_at(first, words);
                if same_instance(from, mask, first)
                    && Mask::equal(&from.rays.time, key(first)[2]).covers(mask)
                {
                    return splat(to, words);
                }
                for lane in mask.lanes() {
                    read_at(lane, words);
                    set(to, lane, words);
                }
            }
        }
    }
}

/// Whether the lanes of a mask, of which the first is given, hit the same instance.
fn same_instance<const W: usize>(from: &Invocations<W>, mask: Mask<W>, first: usize) -> bool {
    let same = |lanes: &Lanes<W>| Mask::equal(lanes, lanes.0[first]).covers(mask);
    same(&from.hits.instance) && same(from.structures.indices())
}

/// Whether the lanes hit one instance without a transform: rays in object space are those in world
/// space.
fn is_in_world<const W: usize>(from: &Invocations<W>, mask: Mask<W>, first: usize) -> bool {
    let is_identity = from.lane(first).hit.is_some_and(|hit| hit.instance().is_identity());
    is_identity && same_instance(from, mask, first)
}

/// Copies fields.
fn copy<const W: usize>(to: &mut [Lanes<W>], from: &Invocations<W>, fields: &[Field]) {
    to.iter_mut().zip(fields).for_each(|(to, &field)| *to = *from.field(field));
}

/// Sets the words of all lanes.
fn splat<const W: usize>(registers: &mut [Lanes<W>], words: &[u32]) {
    registers.iter_mut().zip(words).for_each(|(register, &word)| *register = Lanes::splat(word));
}

/// Sets the words of a lane.
#[inline]
fn set<const W: usize>(registers: &mut [Lanes<W>], lane: usize, words: &[u32]) {
    registers.iter_mut().zip(words).for_each(|(register, &word)| register.0[lane] = word);
}

impl std::fmt::Debug for Builtin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Builtin {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for Builtin {}

/// The type of a builtin: 32-bit scalars, vectors of three, matrices and arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueShape {
    /// `bool`
    Bool,
    /// A 32-bit integer of either signedness.
    Int,
    /// A vector of two 32-bit integers.
    Int2,
    /// A vector of three 32-bit integers.
    Int3,
    /// A vector of four 32-bit integers.
    Int4,
    /// `f32`
    Float,
    /// Two `f32`.
    Float2,
    /// Three `f32`.
    Float3,
    /// Four columns of three `f32`.
    Matrix4x3,
    /// Two `f32`.
    FloatArray2,
    /// Two vectors of three.
    Float3Array2,
    /// Three vectors of three.
    Float3Array3,
}

impl ValueShape {
    /// All shapes.
    #[cfg(test)]
    pub const ALL: [Self; 12] = [
        Self::Bool,
        Self::Int,
        Self::Int2,
        Self::Int3,
        Self::Int4,
        Self::Float,
        Self::Float2,
        Self::Float3,
        Self::Matrix4x3,
        Self::FloatArray2,
        Self::Float3Array2,
        Self::Float3Array3,
    ];

    /// The type as the specification words it.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Bool => "a bool",
            Self::Int => "a 32-bit integer",
            Self::Int2 => "a vector of two 32-bit integers",
            Self::Int3 => "a vector of three 32-bit integers",
            Self::Int4 => "a vector of four 32-bit integers",
            Self::Float => "a 32-bit float",
            Self::Float2 => "a vector of two 32-bit floats",
            Self::Float3 => "a vector of three 32-bit floats",
            Self::Matrix4x3 => "a matrix of four columns of three 32-bit floats",
            Self::FloatArray2 => "an array of two 32-bit floats",
            Self::Float3Array2 => "an array of two vectors of three 32-bit floats",
            Self::Float3Array3 => "an array of three vectors of three 32-bit floats",
        }
    }

    /// The lengths of the nested arrays that hold a value, from the outermost; none for a scalar.
    pub fn lengths(self) -> &'static [usize] {
        match self {
            Self::Bool | Self::Int | Self::Float => &[],
            Self::Int2 | Self::Float2 | Self::FloatArray2 => &[2],
            Self::Int3 | Self::Float3 => &[3],
            Self::Int4 => &[4],
            Self::Float3Array2 => &[2, 3],
            Self::Float3Array3 => &[3, 3],
            Self::Matrix4x3 => &[4, 3],
        }
    }

    /// How many words a value takes.
    pub fn words(self) -> u32 {
        self.lengths().iter().product::<usize>() as u32
    }
}

macro_rules! builtins {
    ($($name:ident $number:literal $shape:ident $stages:literal [$($vuid:literal)*] $($volatile:ident)? = $how:ident $read:tt;)*) => {
        /// Every builtin, ascending by number.
        pub static BUILTINS: &[Builtin] = &[$(Builtin {
            name: stringify!($name),
            number: $number,
            shape: ValueShape::$shape,
            stages: $stages,
            vuids: [$($vuid),*],
            volatile: builtins!(@ $($volatile)?),
            read: builtins!(# $how $read),
        }),*];
    };
    (@) => { false };
    (@ volatile) => { true };
    (# fields [$($field:expr),*]) => { BuiltinRead::Fields(&[$($field),*]) };
    (# uniform (|$from:ident, $to:ident| $read:expr)) => { BuiltinRead::Uniform(|$from, $to| { $read; }) };
    (# per_lane (|$from:ident, $to:ident| $read:expr)) => { BuiltinRead::PerLane(|$from, $to| { $read; }) };
    (# object_ray ([$($field:expr),*] |$from:ident, $to:ident| $read:expr)) => {
        BuiltinRead::ObjectRay(&[$($field),*], |$from, $to| { $read; })
    };
    (# per_instance (|$tlas:ident, $instance:ident, $time:ident, $to:ident| $read:expr)) => {
        BuiltinRead::PerInstance(|$tlas, $instance, $time, $to| $read)
    };
}

builtins! {
    InstanceId 6 Int "IAC" ["InstanceId-InstanceId-04254" "InstanceId-InstanceId-04255" "InstanceId-InstanceId-04256"]
        = fields [Field::Instance];
    PrimitiveId 7 Int "IAC" ["PrimitiveId-PrimitiveId-04330" "PrimitiveId-PrimitiveId-04334" "PrimitiveId-PrimitiveId-04337"]
        = fields [Field::Primitive];
    NumWorkgroups 24 Int3 "G" ["NumWorkgroups-NumWorkgroups-04296" "NumWorkgroups-NumWorkgroups-04297" "NumWorkgroups-NumWorkgroups-04298"]
        = uniform (|from, to| if let Some(group) = from.workgroup { to.copy_from_slice(&group.count) });
    WorkgroupSize 25 Int3 "G" ["WorkgroupSize-WorkgroupSize-04425" "WorkgroupSize-WorkgroupSize-04426" "WorkgroupSize-WorkgroupSize-04427"]
        = uniform (|from, to| if let Some(group) = from.workgroup { to.copy_from_slice(&group.size) });
    WorkgroupId 26 Int3 "G" ["WorkgroupId-WorkgroupId-04422" "WorkgroupId-WorkgroupId-04423" "WorkgroupId-WorkgroupId-04424"]
        = per_lane (|from, to| if let Some(group) = from.workgroup { to.copy_from_slice(&group.id) });
    LocalInvocationId 27 Int3 "G" ["LocalInvocationId-LocalInvocationId-04281" "LocalInvocationId-LocalInvocationId-04282" "LocalInvocationId-LocalInvocationId-04283"]
        = per_lane (|from, to| if let Some(group) = from.workgroup { to.copy_from_slice(&group.local_id(from.local_index)) });
    GlobalInvocationId 28 Int3 "G" ["GlobalInvocationId-GlobalInvocationId-04236" "GlobalInvocationId-GlobalInvocationId-04237" "GlobalInvocationId-GlobalInvocationId-04238"]
        = fields [Field::LaunchId(0), Field::LaunchId(1), Field::LaunchId(2)];
    LocalInvocationIndex 29 Int "G" ["LocalInvocationIndex-LocalInvocationIndex-04284" "LocalInvocationIndex-LocalInvocationIndex-04285" "LocalInvocationIndex-LocalInvocationIndex-04286"]
        = fields [Field::LocalIndex];
    SubgroupSize 36 Int "RIACMKG" ["SubgroupSize-SubgroupSize-04382" "SubgroupSize-SubgroupSize-04382" "SubgroupSize-SubgroupSize-04383"]
        = uniform (|from, to| to[0] = from.subgroup_size);
    NumSubgroups 38 Int "G" ["NumSubgroups-NumSubgroups-04293" "NumSubgroups-NumSubgroups-04294" "NumSubgroups-NumSubgroups-04295"]
        = uniform (|from, to| to[0] = from.workgroup.map_or(0, |group| group.invocations().div_ceil(from.subgroup_size)));
    SubgroupId 40 Int "G" ["SubgroupId-SubgroupId-04367" "SubgroupId-SubgroupId-04368" "SubgroupId-SubgroupId-04369"]
        = per_lane (|from, to| to[0] = from.subgroup_id() as u32);
    SubgroupLocalInvocationId 41 Int "RIACMKG" ["SubgroupLocalInvocationId-SubgroupLocalInvocationId-04380" "SubgroupLocalInvocationId-SubgroupLocalInvocationId-04380" "SubgroupLocalInvocationId-SubgroupLocalInvocationId-04381"]
        = per_lane (|from, to| to[0] = from.subgroup_local_invocation_id());
    CoreIDARM 4160 Int "RIACMKG" ["CoreIDARM-CoreIDARM-07599" "CoreIDARM-CoreIDARM-07599" "CoreIDARM-CoreIDARM-07600"]
        = uniform (|_from, to| to[0] = 0);
    CoreCountARM 4161 Int "RIACMKG" ["CoreCountARM-CoreCountARM-07595" "CoreCountARM-CoreCountARM-07595" "CoreCountARM-CoreCountARM-07596"]
        = uniform (|_from, to| to[0] = 1);
    CoreMaxIDARM 4162 Int "RIACMKG" ["CoreMaxIDARM-CoreMaxIDARM-07597" "CoreMaxIDARM-CoreMaxIDARM-07597" "CoreMaxIDARM-CoreMaxIDARM-07598"]
        = uniform (|_from, to| to[0] = 0);
    WarpIDARM 4163 Int "RIACMKG" ["WarpIDARM-WarpIDARM-07603" "WarpIDARM-WarpIDARM-07603" "WarpIDARM-WarpIDARM-07604"]
        = uniform (|_from, to| to[0] = 0);
    WarpMaxIDARM 4164 Int "RIACMKG" ["WarpMaxIDARM-WarpMaxIDARM-07601" "WarpMaxIDARM-WarpMaxIDARM-07601" "WarpMaxIDARM-WarpMaxIDARM-07602"]
        = uniform (|_from, to| to[0] = 0);
    SubgroupEqMask 4416 Int4 "RIACMKG" ["SubgroupEqMask-SubgroupEqMask-04370" "SubgroupEqMask-SubgroupEqMask-04370" "SubgroupEqMask-SubgroupEqMask-04371"]
        = per_lane (|from, to| subgroup_mask(from, to, |own, other| other == own));
    SubgroupGeMask 4417 Int4 "RIACMKG" ["SubgroupGeMask-SubgroupGeMask-04372" "SubgroupGeMask-SubgroupGeMask-04372" "SubgroupGeMask-SubgroupGeMask-04373"]
        = per_lane (|from, to| subgroup_mask(from, to, |own, other| other >= own));
    SubgroupGtMask 4418 Int4 "RIACMKG" ["SubgroupGtMask-SubgroupGtMask-04374" "SubgroupGtMask-SubgroupGtMask-04374" "SubgroupGtMask-SubgroupGtMask-04375"]
        = per_lane (|from, to| subgroup_mask(from, to, |own, other| other > own));
    SubgroupLeMask 4419 Int4 "RIACMKG" ["SubgroupLeMask-SubgroupLeMask-04376" "SubgroupLeMask-SubgroupLeMask-04376" "SubgroupLeMask-SubgroupLeMask-04377"]
        = per_lane (|from, to| subgroup_mask(from, to, |own, other| other <= own));
    SubgroupLtMask 4420 Int4 "RIACMKG" ["SubgroupLtMask-SubgroupLtMask-04378" "SubgroupLtMask-SubgroupLtMask-04378" "SubgroupLtMask-SubgroupLtMask-04379"]
        = per_lane (|from, to| subgroup_mask(from, to, |own, other| other < own));
    DeviceIndex 4438 Int "RIACMKG" ["DeviceIndex-DeviceIndex-04205" "DeviceIndex-DeviceIndex-04205" "DeviceIndex-DeviceIndex-04206"]
        = uniform (|_from, to| to[0] = 0);
    LaunchIdKHR 5319 Int3 "RIACMK" ["LaunchIdKHR-LaunchIdKHR-04266" "LaunchIdKHR-LaunchIdKHR-04267" "LaunchIdKHR-LaunchIdKHR-04268"]
        = fields [Field::LaunchId(0), Field::LaunchId(1), Field::LaunchId(2)];
    LaunchSizeKHR 5320 Int3 "RIACMK" ["LaunchSizeKHR-LaunchSizeKHR-04269" "LaunchSizeKHR-LaunchSizeKHR-04270" "LaunchSizeKHR-LaunchSizeKHR-04271"]
        = uniform (|from, to| to.copy_from_slice(&from.launch_size));
    WorldRayOriginKHR 5321 Float3 "IACM" ["WorldRayOriginKHR-WorldRayOriginKHR-04431" "WorldRayOriginKHR-WorldRayOriginKHR-04432" "WorldRayOriginKHR-WorldRayOriginKHR-04433"]
        = fields [Field::Origin(0), Field::Origin(1), Field::Origin(2)];
    WorldRayDirectionKHR 5322 Float3 "IACM" ["WorldRayDirectionKHR-WorldRayDirectionKHR-04428" "WorldRayDirectionKHR-WorldRayDirectionKHR-04429" "WorldRayDirectionKHR-WorldRayDirectionKHR-04430"]
        = fields [Field::Direction(0), Field::Direction(1), Field::Direction(2)];
    ObjectRayOriginKHR 5323 Float3 "IAC" ["ObjectRayOriginKHR-ObjectRayOriginKHR-04302" "ObjectRayOriginKHR-ObjectRayOriginKHR-04303" "ObjectRayOriginKHR-ObjectRayOriginKHR-04304"]
        = object_ray ([Field::Origin(0), Field::Origin(1), Field::Origin(2)]
            |from, to| floats(to, &object_ray(from).map_or([0.0; 3], |ray| ray.object_origin_f32())));
    ObjectRayDirectionKHR 5324 Float3 "IAC" ["ObjectRayDirectionKHR-ObjectRayDirectionKHR-04299" "ObjectRayDirectionKHR-ObjectRayDirectionKHR-04300" "ObjectRayDirectionKHR-ObjectRayDirectionKHR-04301"]
        = object_ray ([Field::Direction(0), Field::Direction(1), Field::Direction(2)]
            |from, to| floats(to, &object_ray(from).map_or([0.0; 3], |ray| ray.object_direction_f32())));
    RayTminKHR 5325 Float "IACM" ["RayTminKHR-RayTminKHR-04351" "RayTminKHR-RayTminKHR-04352" "RayTminKHR-RayTminKHR-04353"]
        = fields [Field::TMin];
    RayTmaxKHR 5326 Float "IACM" ["RayTmaxKHR-RayTmaxKHR-04348" "RayTmaxKHR-RayTmaxKHR-04349" "RayTmaxKHR-RayTmaxKHR-04350"] volatile
        = fields [Field::TMax];
    InstanceCustomIndexKHR 5327 Int "IAC" ["InstanceCustomIndexKHR-InstanceCustomIndexKHR-04251" "InstanceCustomIndexKHR-InstanceCustomIndexKHR-04252" "InstanceCustomIndexKHR-InstanceCustomIndexKHR-04253"]
        = per_lane (|from, to| to[0] = hit(from).map_or(0, |hit| hit.instance().custom_index));
    ObjectToWorldKHR 5330 Matrix4x3 "IAC" ["ObjectToWorldKHR-ObjectToWorldKHR-04305" "ObjectToWorldKHR-ObjectToWorldKHR-04306" "ObjectToWorldKHR-ObjectToWorldKHR-04307"]
        = per_instance (|tlas, instance, time, to| columns(to, &tlas.instances()[instance as usize].object_to_world(time)));
    WorldToObjectKHR 5331 Matrix4x3 "IAC" ["WorldToObjectKHR-WorldToObjectKHR-04434" "WorldToObjectKHR-WorldToObjectKHR-04435" "WorldToObjectKHR-WorldToObjectKHR-04436"]
        = per_instance (|tlas, instance, time, to| columns(to, &tlas.world_to_object(instance, time)));
    HitTNV 5332 Float "AC" ["HitTNV-HitTNV-04245" "HitTNV-HitTNV-04246" "HitTNV-HitTNV-04247"]
        = fields [Field::TMax];
    HitKindKHR 5333 Int "AC" ["HitKindKHR-HitKindKHR-04242" "HitKindKHR-HitKindKHR-04243" "HitKindKHR-HitKindKHR-04244"]
        = fields [Field::Kind];
    CurrentRayTimeNV 5334 Float "IACM" ["CurrentRayTimeNV-CurrentRayTimeNV-04942" "CurrentRayTimeNV-CurrentRayTimeNV-04943" "CurrentRayTimeNV-CurrentRayTimeNV-04944"]
        = fields [Field::Time];
    HitTriangleVertexPositionsKHR 5335 Float3Array3 "AC" ["HitTriangleVertexPositionsKHR-HitTriangleVertexPositionsKHR-08747" "HitTriangleVertexPositionsKHR-HitTriangleVertexPositionsKHR-08748" "HitTriangleVertexPositionsKHR-HitTriangleVertexPositionsKHR-08749"]
        = per_lane (|from, to| if let Some(positions) = hit(from).and_then(|hit| hit.triangle(from.time())) { floats(to, positions.as_flattened()) });
    IncomingRayFlagsKHR 5351 Int "IACM" ["IncomingRayFlagsKHR-IncomingRayFlagsKHR-04248" "IncomingRayFlagsKHR-IncomingRayFlagsKHR-04249" "IncomingRayFlagsKHR-IncomingRayFlagsKHR-04250"]
        = fields [Field::Flags];
    RayGeometryIndexKHR 5352 Int "IAC" ["RayGeometryIndexKHR-RayGeometryIndexKHR-04345" "RayGeometryIndexKHR-RayGeometryIndexKHR-04346" "RayGeometryIndexKHR-RayGeometryIndexKHR-04347"]
        = fields [Field::Geometry];
    HitIsSphereNV 5359 Bool "AC" ["HitIsSphereNV-HitIsSphereNV-10513" "HitIsSphereNV-HitIsSphereNV-10514" "HitIsSphereNV-HitIsSphereNV-10515"]
        = per_lane (|from, to| to[0] = u32::from(hit(from).is_some_and(|hit| hit.kind == HitKind::SPHERE)));
    HitIsLSSNV 5360 Bool "AC" ["HitIsLSSNV-HitIsLSSNV-10516" "HitIsLSSNV-HitIsLSSNV-10517" "HitIsLSSNV-HitIsLSSNV-10518"]
        = per_lane (|from, to| to[0] = u32::from(hit(from).is_some_and(|hit| hit.kind == HitKind::LINEAR_SWEPT_SPHERE)));
    HitSpherePositionNV 5361 Float3 "AC" ["HitSpherePositionNV-HitSpherePositionNV-10519" "HitSpherePositionNV-HitSpherePositionNV-10520" "HitSpherePositionNV-HitSpherePositionNV-10521"]
        = per_lane (|from, to| if let Some((position, _)) = hit(from).and_then(|hit| hit.sphere()) { floats(to, &position) });
    WarpsPerSMNV 5374 Int "RIACMKG" ["WarpsPerSMNV-WarpsPerSMNV-04418" "WarpsPerSMNV-WarpsPerSMNV-04418" "WarpsPerSMNV-WarpsPerSMNV-04419"]
        = uniform (|_from, to| to[0] = 1);
    SMCountNV 5375 Int "RIACMKG" ["SMCountNV-SMCountNV-04363" "SMCountNV-SMCountNV-04363" "SMCountNV-SMCountNV-04364"]
        = uniform (|_from, to| to[0] = 1);
    WarpIDNV 5376 Int "RIACMKG" ["WarpIDNV-WarpIDNV-04420" "WarpIDNV-WarpIDNV-04420" "WarpIDNV-WarpIDNV-04421"]
        = uniform (|_from, to| to[0] = 0);
    SMIDNV 5377 Int "RIACMKG" ["SMIDNV-SMIDNV-04365" "SMIDNV-SMIDNV-04365" "SMIDNV-SMIDNV-04366"]
        = uniform (|_from, to| to[0] = 0);
    HitLSSPositionsNV 5396 Float3Array2 "AC" ["HitLSSPositionsNV-HitLSSPositionsNV-10525" "HitLSSPositionsNV-HitLSSPositionsNV-10526" "HitLSSPositionsNV-HitLSSPositionsNV-10527"]
        = per_lane (|from, to| if let Some((positions, _)) = hit(from).and_then(|hit| hit.linear_swept_sphere()) { floats(to, positions.as_flattened()) });
    HitSphereRadiusNV 5420 Float "AC" ["HitSphereRadiusNV-HitSphereRadiusNV-10522" "HitSphereRadiusNV-HitSphereRadiusNV-10523" "HitSphereRadiusNV-HitSphereRadiusNV-10524"]
        = per_lane (|from, to| if let Some((_, radius)) = hit(from).and_then(|hit| hit.sphere()) { floats(to, &[radius]) });
    HitLSSRadiiNV 5421 FloatArray2 "AC" ["HitLSSRadiiNV-HitLSSRadiiNV-10528" "HitLSSRadiiNV-HitLSSRadiiNV-10529" "HitLSSRadiiNV-HitLSSRadiiNV-10530"]
        = per_lane (|from, to| if let Some((_, radii)) = hit(from).and_then(|hit| hit.linear_swept_sphere()) { floats(to, &radii) });
    ClusterIDNV 5436 Int "AC" ["ClusterIDNV-ClusterIDNV-10531" "ClusterIDNV-ClusterIDNV-10532" "ClusterIDNV-ClusterIDNV-10533"]
        = per_lane (|from, to| to[0] = hit(from).map_or(u32::MAX, |hit| hit.cluster_id()));
    CullMaskKHR 6021 Int "IACM" ["CullMaskKHR-CullMaskKHR-06735" "CullMaskKHR-CullMaskKHR-06736" "CullMaskKHR-CullMaskKHR-06737"]
        = fields [Field::CullMask];
}

/// The builtin with a number.
pub fn find(number: u32) -> Option<&'static Builtin> {
    BUILTINS.binary_search_by_key(&number, |builtin| builtin.number).ok().map(|at| &BUILTINS[at])
}

/// The builtin with a name, with or without its suffix.
pub fn find_by_name(name: &str) -> Option<&'static Builtin> {
    let bare = |name: &'static str| name.trim_end_matches("KHR").trim_end_matches("NV");
    BUILTINS.iter().find(|builtin| builtin.name == name || bare(builtin.name) == name)
}

/// The letter of a stage in [`Builtin::stages`].
pub fn stage_letter(stage: Stage) -> char {
    match stage {
        Stage::RayGeneration => 'R',
        Stage::Intersection => 'I',
        Stage::AnyHit => 'A',
        Stage::ClosestHit => 'C',
        Stage::Miss => 'M',
        Stage::Callable => 'K',
        Stage::Compute => 'G',
        Stage::Other(_) => '-',
    }
}

fn hit<'a>(invocation: &LaneInvocation<'a>) -> Option<HitRef<'a>> {
    invocation.hit
}

fn object_ray(invocation: &LaneInvocation<'_>) -> Option<ObjectRay> {
    let hit = invocation.hit?;
    hit.tlas.object_ray(hit.prim.instance, &invocation.trace.ray, invocation.time())
}

/// The mask of the invocations of the subgroup whose id has a relation to this invocation's id.
fn subgroup_mask(from: &LaneInvocation<'_>, to: &mut [u32], holds: impl Fn(u32, u32) -> bool) {
    let own = from.subgroup_local_invocation_id();
    for id in (0..from.subgroup_size).filter(|&id| holds(own, id)) {
        to[id as usize / 32] |= 1 << (id % 32);
    }
}

#[inline]
pub(super) fn floats(to: &mut [u32], values: &[f32]) {
    for (at, to) in to.iter_mut().enumerate() {
        *to = values[at].to_bits();
    }
}

/// Writes a row-major 3x4 matrix column by column.
#[inline]
pub(super) fn columns(to: &mut [u32], rows: &[[f32; 4]; 3]) {
    for (at, to) in to.iter_mut().enumerate() {
        *to = rows[at % 3][at / 3].to_bits();
    }
}

impl HitRef<'_> {
    /// The primitive that a ray at a time hit.
    pub fn primitive(&self, time: f32) -> Option<Primitive> {
        self.instance().blas.primitive(self.prim.geometry, self.prim.primitive, time)
    }

    /// `ClusterIDNV`: -1 where the primitive belongs to no cluster.
    fn cluster_id(&self) -> u32 {
        let geometries = self.instance().blas.geometries();
        geometries[self.prim.geometry as usize].cluster_id.unwrap_or(u32::MAX)
    }

    /// The vertices of the triangle that a ray at a time hit, after the geometry's own transform;
    /// `None` for any other primitive.
    pub fn triangle(&self, time: f32) -> Option<[[f32; 3]; 3]> {
        match self.primitive(time)? {
            Primitive::Triangle(vertices) => Some(vertices),
            _ => None,
        }
    }

    /// Centre and radius of the sphere that was hit; `None` for any other primitive.
    pub fn sphere(&self) -> Option<([f32; 3], f32)> {
        match self.primitive(0.0)? {
            Primitive::Sphere { position, radius } => Some((position, radius)),
            _ => None,
        }
    }

    /// Centres and radii of the linear swept sphere that was hit; `None` for any other primitive.
    pub fn linear_swept_sphere(&self) -> Option<([[f32; 3]; 2], [f32; 2])> {
        match self.primitive(0.0)? {
            Primitive::LinearSweptSphere { positions, radii, .. } => Some((positions, radii)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Invocation;

    /// The words of a builtin that the last of three invocations reads.
    fn read_one<const WORDS: usize>(name: &str, invocation: Invocation) -> [u32; WORDS] {
        let mut invocations = Invocations::<8>::new();
        invocations.set(2, invocation);
        let mut registers = [Lanes([0; 8]); WORDS];
        find_by_name(name).unwrap().read.read(&invocations, Mask::lane(2), &mut registers);
        registers.map(|register| register.0[2])
    }

    #[test]
    fn the_table_is_sorted() {
        assert!(BUILTINS.windows(2).all(|pair| pair[0].number < pair[1].number));
    }

    #[test]
    fn subgroup_masks_end_with_the_subgroup() {
        let read = |name, size| {
            let launch_id = [5, 1, 0];
            let invocation = Invocation {
                launch_id,
                launch_size: [8, 2, 1],
                subgroup_size: size,
                ..Invocation::default()
            };
            read_one::<4>(name, invocation)
        };
        // Invocation 8 + 5 = 13 of the launch is the sixth of the second subgroup of 8.
        assert_eq!(read("SubgroupLocalInvocationId", 8)[0], 5);
        assert_eq!(read("SubgroupSize", 0)[0], 32);
        assert_eq!(read("SubgroupEqMask", 8), [0x20, 0, 0, 0]);
        assert_eq!(read("SubgroupGeMask", 8), [0xE0, 0, 0, 0]);
        assert_eq!(read("SubgroupGtMask", 8), [0xC0, 0, 0, 0]);
        assert_eq!(read("SubgroupLeMask", 8), [0x3F, 0, 0, 0]);
        assert_eq!(read("SubgroupLtMask", 8), [0x1F, 0, 0, 0]);
        assert_eq!(read("SubgroupGtMask", 128), [0xFFFF_C000, u32::MAX, u32::MAX, u32::MAX]);
    }

    /// `SPV_NV_ray_tracing` has a builtin of its own for what its successor calls `RayTmaxKHR`.
    #[test]
    fn the_older_distance_is_the_same() {
        let invocation = Invocation { t_max: 2.5, ..Invocation::default() };
        for name in ["HitTNV", "RayTmaxKHR"] {
            assert_eq!(read_one(name, invocation.clone()), [2.5f32.to_bits()], "{name}");
        }
    }

    #[test]
    fn matrices_are_written_column_by_column() {
        let mut words = [0; 12];
        columns(&mut words, &[[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [9.0, 10.0, 11.0, 12.0]]);
        assert_eq!(
            words.map(f32::from_bits),
            [1.0, 5.0, 9.0, 2.0, 6.0, 10.0, 3.0, 7.0, 11.0, 4.0, 8.0, 12.0]
        );
    }
}
