//! Rules about the states of ray queries.

rules! {
    RQ_TERMINATE_LATE "rq-terminate-late" UndefinedBehavior
        "A ray query is not terminated after rayQueryProceedEXT has returned false."
        "SPV_KHR_ray_query, OpRayQueryTerminateKHR: the value of any prior OpRayQueryProceedKHR must be true"
        "terminate inside the loop over rayQueryProceedEXT, or not at all: the query is complete"
    RQ_NOT_FINISHED "rq-not-finished" Lint
        "The committed hit of a ray query is used after the query is complete, or was terminated."
        "until rayQueryProceedEXT returns false, a closer hit may follow"
        "call rayQueryProceedEXT until it returns false, or use gl_RayFlagsTerminateOnFirstHitEXT"
    RQ_IGNORED_RESULT "rq-ignored-result" Lint
        "A candidate to which rayQueryProceedEXT comes is looked at, where its result is not."
        "a candidate that is neither confirmed nor generated is no hit: hits of geometry that is not opaque get lost"
        "loop over rayQueryProceedEXT, or trace with gl_RayFlagsOpaqueEXT and gl_RayFlagsSkipAABBEXT"
    RQ_WRONG_SELECTOR "rq-wrong-selector" Lint
        "What decides on a candidate is read of the candidate, not of the committed hit."
        "the committed hit is another one than the candidate that is confirmed"
        "pass false as the last argument of rayQueryGetIntersection*EXT inside the loop"
}
