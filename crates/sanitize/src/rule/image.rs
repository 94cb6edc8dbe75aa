//! Rules about image instructions and samplers.

rules! {
    IMAGE_FORMAT "image-format" UndefinedValue
        "The view of an image has the format that the shader declares, and the same numeric type."
        "Vulkan, \"Instruction/Format/Sampler/Image View Validation\"; VUID-vkCmdDispatch-format-07753, \
         VUID-vkCmdDispatch-SampledType-04470 and 04471"
        "declare the format of the view in the shader, for example with `layout(rgba8)` or `uimage2D`, or \
         change the format of the image in the scene"
    IMAGE_READ_BOUNDS "image-read-bounds" UndefinedValue
        "The coordinates, layer, sample and level of a texel that is read are inside its image."
        "Vulkan, \"Image Coordinate Validation\" and \"Shader Out-of-Bounds Memory Access\": the value of such a read is undefined"
        "clamp the coordinates, or compare them with imageSize or textureSize"
    IMAGE_WRITE_BOUNDS "image-write-bounds" Lint
        "The coordinates, layer, sample and level of a texel that is written are inside its image."
        "Vulkan, \"Image Writes\": a write that is out of bounds is discarded"
        "return early if a coordinate is not less than imageSize: the last workgroups of a dispatch may \
         reach beyond the image"
    IMAGE_NAN_COORDINATE "image-nan-coordinate" Lint
        "The coordinates, level of detail, bias and gradients of a sampled image are finite."
        "no texel is at a NaN or at infinity: the texel that is read depends on the driver"
        "find the origin of the number: most often it is a division by zero"
    IMAGE_OFFSET "image-offset" UndefinedBehavior
        "A texel offset is from -8 to 7 (from -32 to 31 for a gather), and a constant except for a gather."
        "VUID-RuntimeSpirv-OpImageSample-06435 and 06436, OpImageGather-06376 and 06377, Offset-10213"
        "add the offset to the coordinates, in units of the size of a texel"
    IMAGE_SAMPLE_OPERAND "image-sample-operand" UndefinedBehavior
        "The sample of OpImageTexelPointer is 0 where the image is not multisampled."
        "SPIR-V 3.3.10, OpImageTexelPointer: behavior is undefined unless Sample is 0 where MS is 0"
        "pass the constant 0"
    IMAGE_LOD_RANGE "image-lod-range" UndefinedBehavior
        "The minimum level of detail of a sampler is not greater than its maximum."
        "VUID-VkSamplerCreateInfo-maxLod-01973"
        "swap min_lod and max_lod of the sampler"
    SAMPLER_MATCH "sampler-match" UndefinedBehavior
        "A sampler with a comparison is used with a reference, and one with unnormalized coordinates only \
         as these allow."
        "Vulkan, \"Image Operations\", instruction and sampler validation; VUID-vkCmdTraceRaysKHR-None-08610 and 08611, \
         VUID-VkSamplerCreateInfo-unnormalizedCoordinates-01072 to 01077"
        "use a sampler2DShadow for a sampler with compare_op, and a separate sampler for unnormalized \
         coordinates"
}
