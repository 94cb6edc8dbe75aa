//! Rules about hit objects.

rules! {
    HO_SBT_LIMIT "ho-sbt-limit" UndefinedBehavior
        "The record index that is set in a hit object is at most maxShaderBindingTableRecordIndex of the \
         device."
        "VUID-RuntimeSpirv-maxShaderBindingTableRecordIndex-11888"
        "set a smaller index, or raise the limit in the scene: `max_shader_binding_table_record_index` in \
         [device]"
    HO_ATTRIBUTES_TYPE "ho-attributes-type" UndefinedBehavior
        "The attributes of a hit object are read with the type with which they were recorded or reported."
        "GL_EXT_shader_invocation_reorder: the type and structure of attributes stored must match the type expected when \
         retrieved"
        "read the attributes through a hitObjectAttributeEXT variable of the recorded type; those of \
         triangles are two floats"
    HO_EXECUTE_ATTRIBUTES "ho-execute-attributes" UndefinedBehavior
        "The closest-hit shader that a hit object executes declares the type of the hit object's attributes."
        "GL_EXT_shader_invocation_reorder, hitObjectExecuteShaderEXT: if the types do not match, the behavior is undefined"
        "set the index of a record whose shader has this attribute type, or record attributes of the type \
         that the shader declares"
    HO_FROM_QUERY "ho-from-query" UndefinedBehavior
        "A hit object that is recorded from a ray query that hit a box has a hit kind."
        "SPV_EXT_shader_invocation_reorder, OpHitObjectRecordFromQueryEXT: Hit Kind must be present"
        "pass the hit kind as the last argument of hitObjectRecordFromQueryEXT"
    HO_RECORD_KIND "ho-record-kind" UndefinedBehavior
        "The hit kind that is recorded for a box is at most 127."
        "SPV_EXT_shader_invocation_reorder, Hit Kind of recorded hits; as for reports, \
         VUID-RuntimeSpirv-OpReportIntersectionKHR-06998"
        "pass a hit kind from 0 to 127: greater values are reserved for triangles"
    HO_TIME "ho-time" Lint
        "The time is read only from hit objects that were traced or recorded with a time."
        "SPV_EXT_shader_invocation_reorder, OpHitObjectGetCurrentTimeEXT: it returns the encoded time, and \
         this hit object has none"
        "trace with hitObjectTraceRayMotionEXT, or do not read the time"
}
