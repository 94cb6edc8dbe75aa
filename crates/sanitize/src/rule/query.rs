//! Rules about the states of ray queries.

rules! {
    RQ_TERMINATE_LATE "rq-terminate-late" UndefinedBehavior
        "A ray query is not terminated after rayQueryProceedEXT has returned false."
        "SPV_KHR_ray_query, OpRayQueryTerminateKHR: the value of any prior OpRayQueryProceedKHR must be true"
        "terminate inside the rayQueryProceedEXT loop, or remove the call: the query is already complete"
    RQ_NOT_FINISHED "rq-not-finished" Lint
        "The committed hit of a ray query is used only after the query is complete or terminated."
        "until rayQueryProceedEXT returns false, a closer hit may follow"
        "call rayQueryProceedEXT until it returns false, or use gl_RayFlagsTerminateOnFirstHitEXT"
    RQ_IGNORED_RESULT "rq-ignored-result" Lint
        "A shader that ignores the result of rayQueryProceedEXT reads the candidate."
        "a candidate that is neither confirmed nor generated is not a hit: hits on non-opaque geometry are \
         lost"
        "loop while rayQueryProceedEXT returns true, or trace with gl_RayFlagsOpaqueEXT and \
         gl_RayFlagsSkipAABBEXT"
    RQ_WRONG_SELECTOR "rq-wrong-selector" Lint
        "A candidate is confirmed by values of the candidate, not of the committed hit."
        "the committed hit is not the candidate that is confirmed"
        "pass false as the last argument of rayQueryGetIntersection*EXT inside the loop"
}
