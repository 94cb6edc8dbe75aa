//! Rules about hit objects.

rules! {
    HO_SBT_LIMIT "ho-sbt-limit" UndefinedBehavior
        "The record's index that is set in a hit object is at most maxShaderBindingTableRecordIndex of the device."
        "VUID-RuntimeSpirv-maxShaderBindingTableRecordIndex-11888"
        "the limit is the scene's: `max_shader_binding_table_record_index` of [device]"
    HO_ATTRIBUTES_TYPE "ho-attributes-type" UndefinedBehavior
        "The attributes of a hit object are read as the type that they were recorded or reported as."
        "GL_EXT_shader_invocation_reorder: the type and structure of attributes stored must match the type expected when \
         retrieved"
        "those of triangles are two floats; read others by a hitObjectAttributeEXT variable of the type that was recorded"
    HO_EXECUTE_ATTRIBUTES "ho-execute-attributes" UndefinedBehavior
        "The closest-hit shader that a hit object executes declares the type of its attributes."
        "GL_EXT_shader_invocation_reorder, hitObjectExecuteShaderEXT: if the types do not match, the behavior is undefined"
        "let the record's index lead to a shader of this type of attributes, or record what the shader declares"
    HO_FROM_QUERY "ho-from-query" UndefinedBehavior
        "A hit object that is made from a ray query whose hit is a box is given a hit kind."
        "SPV_EXT_shader_invocation_reorder, OpHitObjectRecordFromQueryEXT: Hit Kind must be present"
        "pass the hit kind as the last argument of hitObjectRecordFromQueryEXT"
    HO_RECORD_KIND "ho-record-kind" UndefinedBehavior
        "The hit kind that is recorded for a box is at most 127."
        "SPV_EXT_shader_invocation_reorder, Hit Kind of recorded hits; as of reports, \
         VUID-RuntimeSpirv-OpReportIntersectionKHR-06998"
        "pass a hit kind of 0 to 127: those above are the triangles'"
    HO_TIME "ho-time" Lint
        "The time is asked only of hit objects that were traced or recorded at one."
        "SPV_EXT_shader_invocation_reorder, OpHitObjectGetCurrentTimeEXT returns the time that is encoded: here is none"
        "trace with hitObjectTraceRayMotionEXT, or do not ask"
}
