//! The codes of traps: one row for each, with its name, its message and the rule that it cites.

use std::fmt;

/// Declares [`TrapCode`] from rows `Variant = "name", "message", "VUID";`. A message ends with the
/// VUID in parentheses where there is one.
macro_rules! trap_codes {
    ($($(#[doc = $doc:literal])* $code:ident = $name:literal, $message:literal $(, $vuid:literal)?;)+) => {
        /// Why an invocation was stopped by the machine.
        ///
        /// ```
        /// use anyhit::TrapCode;
        ///
        /// let code = TrapCode::from_name("invalid_hit_kind").unwrap();
        /// assert_eq!(code, TrapCode::InvalidHitKind);
        /// assert_eq!(code.vuid(), Some("VUID-RuntimeSpirv-OpReportIntersectionKHR-06998"));
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
                pub enum TrapCode {
            $($(#[doc = $doc])* $code,)+
            /// A shader that this one called trapped. No report has this code: it has that of the
            /// shader that was called.
            Callee,
            /// The file of an image cannot be read. No report has this code: the error is that of
            /// the file.
            ImageUnreadable,
        }

        impl TrapCode {
            /// All codes that a report may have, in the order of their declaration.
            pub const ALL: &'static [Self] = &[$(Self::$code),+];

            /// The name in scene files (`[expect.trap]`) and in JSON, in snake case:
            /// `index_out_of_bounds`.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$code => $name,)+
                    Self::Callee => "callee",
                    Self::ImageUnreadable => "image_unreadable",
                }
            }

            /// One line on what happened.
            pub const fn message(self) -> &'static str {
                match self {
                    $(Self::$code => concat!($message $(, " (", $vuid, ")")?),)+
                    Self::Callee => "a called shader trapped",
                    Self::ImageUnreadable => "the file of an image cannot be read",
                }
            }

            /// The valid-usage rule of Vulkan that the message cites; `None` where it cites none.
            /// Which rule the operands of a ray break depends on the instruction:
            /// [`Trap::vuid`](crate::error::Trap::vuid) has it.
            pub const fn vuid(self) -> Option<&'static str> {
                match self {
                    $($(Self::$code => Some($vuid),)?)+
                    _ => None,
                }
            }
        }
    };
}

trap_codes! {
    /// An index of an access chain is outside its array.
    IndexOutOfBounds = "index_out_of_bounds",
        "an index is outside its array";
    /// A load or store is outside its buffer.
    BufferOutOfBounds = "buffer_out_of_bounds",
        "a buffer is accessed outside its range";
    /// An access through a null pointer.
    NullPointer = "null_pointer",
        "an access through a null pointer";
    /// No buffer lies at a device address.
    AddressInvalid = "address_invalid",
        "a device address points to no buffer";
    /// A load or store through a device address goes beyond its buffer.
    AddressOutOfBounds = "address_out_of_bounds",
        "a buffer is accessed beyond its end through a device address";
    /// A device address is no multiple of what the instruction promises.
    AddressMisaligned = "address_misaligned",
        "a device address is not aligned as the instruction promises";
    /// An atomic instruction on an offset that is no multiple of its size.
    AtomicMisaligned = "atomic_misaligned",
        "an atomic instruction on a misaligned offset";
    /// No descriptor is bound, or one of another kind.
    DescriptorMissing = "descriptor_missing",
        "no descriptor of this kind is bound here";
    /// A descriptor's offset in its heap is no multiple of a descriptor's alignment.
    DescriptorMisaligned = "descriptor_misaligned",
        "a descriptor's offset in its heap is not a multiple of 32 bytes";
    /// A texel coordinate is outside its image.
    ImageOutOfBounds = "image_out_of_bounds",
        "a texel coordinate is outside its image";
    /// A texel of a row that the band of an image does not hold.
    ImageRowAbsent = "image_row_absent",
        "the texel is in a row of the image that is not in memory: the launch runs in bands of \
         rows";
    /// The image bound has another dimension, sample count or component type than the shader
    /// declares.
    ImageMismatch = "image_mismatch",
        "the dimension, sample count or component type of the bound image differs from the \
         shader's declaration";
    /// The sampler bound does not suit the instruction or the image.
    SamplerMismatch = "sampler_mismatch",
        "the bound sampler does not match: a comparison requires compare_op, unnormalized \
         coordinates require a 1D or 2D image (Vulkan, Instruction/Sampler/Image View Validation)";
    /// `OpUnreachable` was reached.
    Unreachable = "unreachable",
        "OpUnreachable was reached";
    /// `OpAbortKHR` was executed: the report has its message.
    Aborted = "aborted",
        "the shader aborted (SPV_KHR_abort)";
    /// The invocation has executed as many instructions as its fuel allows.
    OutOfFuel = "out_of_fuel",
        "the invocation ran out of fuel: an endless loop?";
    /// The invocations of the launch have executed as many instructions together as its fuel
    /// allows.
    LaunchOutOfFuel = "launch_out_of_fuel",
        "the launch ran out of fuel: an endless loop?";
    /// The launch took longer than its `timeout`.
    LaunchTimedOut = "launch_timed_out",
        "the launch ran out of time: an endless loop?";
    /// Invocations that run together took longer than their `batch_timeout`.
    BatchTimedOut = "batch_timed_out",
        "a batch of invocations ran out of time: an endless loop?";
    /// The operands of a trace break a rule for rays; the report names it.
    InvalidTrace = "invalid_trace",
        "the operands of a trace break a rule";
    /// The acceleration structure of a trace does not exist.
    AccelerationStructureMissing = "acceleration_structure_missing",
        "the acceleration structure of a trace does not exist";
    /// `maxPipelineRayRecursionDepth` would be passed.
    RecursionTooDeep = "recursion_too_deep",
        "maxPipelineRayRecursionDepth is exceeded";
    /// The shaders of an invocation that call each other hold more registers than the stack has.
    StackOverflow = "stack_overflow",
        "the stack of nested shader calls overflowed: an endless recursion?";
    /// Callable shaders nest deeper than this machine goes.
    CallablesTooDeep = "callables_too_deep",
        "callable shaders are nested too deeply: an endless recursion?";
    /// The shader binding table has no such record.
    ShaderRecordMissing = "shader_record_missing",
        "the shader binding table has no such record";
    /// The data of a shader record is accessed, and it has none.
    ShaderRecordEmpty = "shader_record_empty",
        "the shader record holds no data: nothing follows its handle";
    /// The hit shader binding table has no record for what a ray met.
    HitRecordMissing = "hit_record_missing",
        "the hit shader binding table has no record for the primitive that the ray hit";
    /// The miss shader binding table has no record of a ray's miss index.
    MissRecordMissing = "miss_record_missing",
        "the miss shader binding table has no record at the ray's miss index";
    /// A called shader takes a payload, or callable data, of another type than it is given.
    PayloadMismatch = "payload_mismatch",
        "a called shader declares its payload or callable data with a different type than its caller";
    /// The hit kind of a report is above 127 (VUID-RuntimeSpirv-OpReportIntersectionKHR-06998).
    InvalidHitKind = "invalid_hit_kind",
        "the hit kind of a report is above 127",
        "VUID-RuntimeSpirv-OpReportIntersectionKHR-06998";
    /// The operands of a ray query break a rule for rays; the report names it.
    InvalidRayQuery = "invalid_ray_query",
        "the operands of a ray query break a rule";
    /// A ray query is used before `OpRayQueryInitializeKHR`.
    RayQueryUninitialized = "ray_query_uninitialized",
        "a ray query is used before OpRayQueryInitializeKHR (SPV_KHR_ray_query)";
    /// `OpRayQueryProceedKHR` after it returned false.
    RayQueryComplete = "ray_query_complete",
        "OpRayQueryProceedKHR is executed after it returned false: the ray query is complete \
         (SPV_KHR_ray_query)";
    /// The candidate of a ray query is used, and there is none.
    RayQueryNoCandidate = "ray_query_no_candidate",
        "the candidate of a ray query is used, but the last OpRayQueryProceedKHR did not \
         return true (SPV_KHR_ray_query)";
    /// The committed hit of a ray query is read, and there is none.
    RayQueryNoCommitted = "ray_query_no_committed",
        "the committed hit of a ray query is read, but nothing is committed \
         (SPV_KHR_ray_query)";
    /// An instruction for triangles reads another intersection of a ray query.
    RayQueryNotTriangle = "ray_query_not_triangle",
        "the intersection of a ray query is not a triangle, as this instruction requires \
         (SPV_KHR_ray_query)";
    /// An instruction for AABBs reads another candidate of a ray query.
    RayQueryNotAabb = "ray_query_not_aabb",
        "the candidate of a ray query is not an AABB, as this instruction requires \
         (SPV_KHR_ray_query)";
    /// An instruction for triangles reads another primitive.
    NotTriangle = "not_triangle",
        "the hit primitive is not a triangle, as this instruction requires \
         (SPV_KHR_ray_tracing_position_fetch)";
    /// An instruction for spheres reads another primitive.
    NotSphere = "not_sphere",
        "the hit primitive is not a sphere, as this instruction requires (SPV_NV_linear_swept_spheres)";
    /// An instruction for linear swept spheres reads another primitive.
    NotLinearSweptSphere = "not_linear_swept_sphere",
        "the hit primitive is not a linear swept sphere, as this instruction requires \
         (SPV_NV_linear_swept_spheres)";
    /// `OpRayQueryGenerateIntersectionKHR` outside the ray's interval
    /// (VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06353).
    RayQueryOutsideInterval = "ray_query_outside_interval",
        "the generated hit is before t_min or behind the committed hit",
        "VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06353";
    /// A hit is generated in an acceleration structure with motion
    /// (VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06354).
    RayQueryMotion = "ray_query_motion",
        "a hit is generated in an acceleration structure with motion",
        "VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06354";
    /// A ray query in a structure with opacity micromaps, by a shader whose `OpacityMicromapIdKHR`
    /// is false.
    RayQueryMicromaps = "ray_query_micromaps",
        "a ray query traverses an acceleration structure with opacity micromaps, but the shader's \
         execution mode OpacityMicromapIdKHR is false (SPV_KHR_opacity_micromap)";
    /// `OpControlBarrier` that some invocations of the workgroup do not come to.
    BarrierDivergence = "barrier_divergence",
        "not every invocation of the workgroup reaches a barrier (SPIR-V, OpControlBarrier: \
         only in uniform control flow)";
    /// The operands of an instruction that records a hit object break a rule.
    InvalidHitObject = "invalid_hit_object",
        "the ray of a recorded hit object breaks a rule";
    /// A recorded hit names a primitive that its acceleration structure does not have.
    HitObjectNoPrimitive = "hit_object_no_primitive",
        "a recorded hit names an instance, geometry or primitive that its acceleration \
         structure does not have";
    /// A hit object is used before anything was recorded in it.
    HitObjectUnrecorded = "hit_object_unrecorded",
        "a hit object is used before anything was recorded in it \
         (SPV_EXT_shader_invocation_reorder)";
    /// The ray or the shader record of an empty hit object is read.
    HitObjectEmpty = "hit_object_empty",
        "an empty hit object has no ray and no shader record \
         (SPV_EXT_shader_invocation_reorder)";
    /// An instruction for hits reads a hit object that is none.
    HitObjectNotHit = "hit_object_not_hit",
        "a property of a hit is read from a hit object that encodes no hit \
         (SPV_EXT_shader_invocation_reorder)";
    /// An any-hit shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03512).
    NullAnyHit = "null_any_hit",
        "an any-hit shader is null, and the pipeline has NO_NULL_ANY_HIT_SHADERS",
        "VUID-vkCmdTraceRaysKHR-flags-03512";
    /// A closest-hit shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03513).
    NullClosestHit = "null_closest_hit",
        "a closest-hit shader is null, and the pipeline has NO_NULL_CLOSEST_HIT_SHADERS",
        "VUID-vkCmdTraceRaysKHR-flags-03513";
    /// A miss shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03511).
    NullMiss = "null_miss",
        "a miss shader is null, and the pipeline has NO_NULL_MISS_SHADERS",
        "VUID-vkCmdTraceRaysKHR-flags-03511";
    /// An intersection shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03514).
    NullIntersection = "null_intersection",
        "an intersection shader is null, and the pipeline has NO_NULL_INTERSECTION_SHADERS",
        "VUID-vkCmdTraceRaysKHR-flags-03514";
}

impl TrapCode {
    /// The code of a name; see [`TrapCode::name`]. `None` where no code that a report may have is
    /// called so.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|code| code.name() == name)
    }

    /// Whether the clock stopped the invocation: where it was then depends on the machine.
    #[must_use]
    pub fn is_of_clock(self) -> bool {
        matches!(self, Self::LaunchTimedOut | Self::BatchTimedOut)
    }

    /// Whether a limit of running stopped the invocation: what others have left behind then depends
    /// on how many of them run side by side.
    #[must_use]
    pub fn is_limit(self) -> bool {
        self.is_of_clock() || matches!(self, Self::OutOfFuel | Self::LaunchOutOfFuel)
    }
}

impl fmt::Display for TrapCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.message())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_code_has_a_name_and_a_message_of_its_own() {
        assert_eq!(TrapCode::ALL.len(), TrapCode::Callee as usize);
        let names: HashSet<_> = TrapCode::ALL.iter().map(|code| code.name()).collect();
        let messages: HashSet<_> = TrapCode::ALL.iter().map(|code| code.message()).collect();
        assert_eq!((names.len(), messages.len()), (TrapCode::ALL.len(), TrapCode::ALL.len()));
        assert_eq!(TrapCode::from_name("callee"), None);
        assert_eq!(TrapCode::from_name("not_sphere"), Some(TrapCode::NotSphere));
    }

    #[test]
    fn names_are_those_of_the_variants_in_snake_case() {
        for code in TrapCode::ALL {
            let mut name = String::new();
            for letter in format!("{code:?}").chars() {
                if letter.is_ascii_uppercase() && !name.is_empty() {
                    name.push('_');
                }
                name.push(letter.to_ascii_lowercase());
            }
            assert_eq!(code.name(), name);
        }
    }

    #[test]
    fn the_rule_of_a_code_is_the_one_in_its_message() {
        for code in TrapCode::ALL {
            assert_eq!(code.vuid().is_some(), code.message().contains("VUID"), "{code:?}");
            assert!(code.message().contains(code.vuid().unwrap_or_default()), "{code:?}");
        }
    }
}
