//! Checks the instances of a TLAS, and names all mistakes.

use crate::accel::flags::InstanceFlags;
use crate::accel::instance::TlasInstance;
use crate::accel::validate::MAX_GEOMETRIES;
use crate::geometry::Transform;
use anyhit_base::error::{Error, ErrorKind};

/// The mistakes in the instances of a TLAS.
pub(super) fn instances(instances: &[TlasInstance]) -> Vec<Error> {
    const FIELD: u32 = 1 << 24;
    let mut mistakes = Vec::new();
    if instances.len() > MAX_GEOMETRIES {
        let text =
            format!("a TLAS of {} instances exceeds the limit 2^24 - 1 (maxInstanceCount)", instances.len());
        mistakes.push(Error::new(ErrorKind::InvalidScene, text));
    }
    for (index, instance) in instances.iter().enumerate() {
        let mut found = |text: &str| {
            mistakes.push(Error::new(ErrorKind::InvalidScene, format!("instance {index}: {text}")));
        };
        if instance.custom_index >= FIELD {
            found(&format!("custom index {} has more than 24 bits", instance.custom_index));
        }
        if instance.sbt_record_offset >= FIELD {
            found(&format!("SBT record offset {} has more than 24 bits", instance.sbt_record_offset));
        }
        if instance.flags.0 > 0xFF {
            found(&format!("flags {:#x} have more than 8 bits", instance.flags.0));
        }
        if instance.flags.contains(InstanceFlags::FORCE_OPAQUE)
            && instance.flags.contains(InstanceFlags::FORCE_NO_OPAQUE)
        {
            found("force-opaque and force-no-opaque exclude each other");
        }
        if let Some(motion) = &instance.motion {
            if !motion.is_finite() {
                found("the motion is not finite");
                continue;
            }
            for (key, time) in [(0, 0.0), (1, 1.0)] {
                if motion.at(time).is_none_or(|matrix| Transform::new(&matrix).is_none()) {
                    found(&format!(
                        "its transform at time {key} is singular (VUID-VkTransformMatrixKHR-matrix-03799)"
                    ));
                }
            }
            continue;
        }
        if !instance.transform.as_flattened().iter().all(|x| x.is_finite()) {
            found("the transform is not finite");
        } else if Transform::new(&instance.transform).is_none() {
            found("the transform is singular (VUID-VkTransformMatrixKHR-matrix-03799)");
        }
    }
    mistakes
}
