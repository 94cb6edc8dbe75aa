//! Litmus tests of others. The verdicts of [`MODEL`] are those of the Khronos Group's formal model
//! (the repository Vulkan-MemoryModel, `alloy/tests`, by the names given here), those of [`SHARED`]
//! of the tests of shared memory in the Vulkan validation layers.

use rspirv::spirv::{MemorySemantics as Semantics, Scope};

use crate::races::litmus::{
    ACQ, ACQ_VIS, AVAILABLE, BOTH, BUFFER, IMAGE, Litmus, Memory, NONE, Privacy, REL, REL_AV, RELEASE, Step,
    X, Y, Z, check, litmus,
};

use Privacy::{NonPrivate, Private, Within};
use Scope::{Device, QueueFamily, Workgroup};
use Step::{Add, AtomicLoad, AtomicStore, Barrier, Fence, Load, Store};

static MODEL: &[Litmus] = &[
    litmus("races", true, &[&[&[Store(X, Private), Store(X, Private)]], &[&[Store(X, Private)]]]),
    litmus(
        "mp",
        false,
        &[&[
            &[Store(X, Within(Device)), AtomicStore(Y, Workgroup, REL)],
            &[AtomicLoad(Y, Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "mp-no-avvis",
        true,
        &[&[
            &[Store(X, Private), AtomicStore(Y, Workgroup, REL)],
            &[AtomicLoad(Y, Workgroup, ACQ), Load(X, Private)],
        ]],
    ),
    litmus(
        "mp3",
        false,
        &[&[
            &[Store(X, Within(Device)), AtomicStore(Y, Workgroup, REL)],
            &[AtomicLoad(Y, Workgroup, ACQ), AtomicStore(Z, Workgroup, REL)],
            &[AtomicLoad(Z, Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "qfmp",
        false,
        &[
            &[&[Store(X, Within(QueueFamily)), AtomicStore(Y, QueueFamily, REL)]],
            &[&[AtomicLoad(Y, QueueFamily, ACQ), Load(X, Within(QueueFamily))]],
        ],
    ),
    litmus(
        "privmp",
        true,
        &[&[
            &[Store(X, Private), AtomicStore(Y, Workgroup, REL_AV)],
            &[AtomicLoad(Y, Workgroup, ACQ_VIS), Load(X, Private)],
        ]],
    ),
    litmus(
        "privwar",
        true,
        &[&[
            &[Load(X, Private), AtomicStore(Y, Workgroup, REL_AV)],
            &[AtomicLoad(Y, Workgroup, ACQ_VIS), Store(X, Private)],
        ]],
    ),
    litmus(
        "noncohwar",
        false,
        &[&[
            &[Load(X, NonPrivate), AtomicStore(Y, Workgroup, REL_AV)],
            &[AtomicLoad(Y, Workgroup, ACQ_VIS), Store(X, NonPrivate)],
        ]],
    ),
    litmus(
        "privpo",
        false,
        &[&[&[Load(X, Private), Store(X, Private), Load(X, Private), Store(X, NonPrivate)]]],
    ),
    litmus("noncohandatom", false, &[&[&[Store(Y, NonPrivate), Add(Y, Workgroup, NONE), Load(Y, Private)]]]),
    litmus(
        "noncohmpbar",
        false,
        &[
            &[&[Store(X, NonPrivate), Fence(Device, REL_AV), AtomicStore(Y, Device, NONE)]],
            &[&[AtomicLoad(Y, Device, NONE), Fence(Device, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
    litmus(
        "noncohmpfail",
        true,
        &[&[
            &[Store(X, NonPrivate), Store(Y, Within(Device)), AtomicStore(Z, Workgroup, REL)],
            &[AtomicLoad(Z, Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "noncohmpfail2",
        true,
        &[&[
            &[Store(X, NonPrivate), AtomicStore(Z, Workgroup, RELEASE.union(IMAGE).union(AVAILABLE))],
            &[AtomicLoad(Z, Workgroup, ACQ_VIS), Load(X, NonPrivate)],
        ]],
    ),
    litmus(
        "fencefence",
        false,
        &[&[
            &[Store(X, Within(Device)), Fence(Workgroup, REL), AtomicStore(Y, Workgroup, NONE)],
            &[AtomicLoad(Y, Workgroup, NONE), Fence(Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "fencefencebroken",
        true,
        &[
            &[&[Store(X, Within(Device)), Fence(Workgroup, REL), AtomicStore(Y, Device, NONE)]],
            &[&[AtomicLoad(Y, Device, NONE), Fence(Workgroup, ACQ), Load(X, Within(Device))]],
        ],
    ),
    litmus(
        "mpnotinscope1",
        false,
        &[
            &[&[AtomicStore(X, Workgroup, REL), AtomicStore(Y, Device, REL_AV)]],
            &[&[AtomicLoad(Y, Device, ACQ_VIS), AtomicLoad(X, Workgroup, ACQ)]],
        ],
    ),
    litmus(
        "mpnotinscope3",
        true,
        &[
            &[&[AtomicStore(X, Workgroup, REL_AV), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), AtomicLoad(X, Workgroup, ACQ_VIS)]],
        ],
    ),
    litmus(
        "mpnotinscope5",
        true,
        &[
            &[&[Fence(Workgroup, REL_AV), AtomicStore(X, Workgroup, REL), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), AtomicLoad(X, Workgroup, ACQ), Fence(Workgroup, ACQ_VIS)]],
        ],
    ),
    litmus(
        "sb2dv",
        true,
        &[
            &[&[AtomicStore(X, Workgroup, REL), AtomicLoad(Y, Device, ACQ)]],
            &[&[AtomicStore(Y, Workgroup, REL), AtomicLoad(X, Device, ACQ)]],
        ],
    ),
    litmus(
        "corr",
        false,
        &[
            &[&[AtomicStore(X, Device, NONE)]],
            &[&[AtomicStore(X, Device, NONE)]],
            &[&[AtomicLoad(X, Device, NONE), AtomicLoad(X, Device, NONE)]],
            &[&[AtomicLoad(X, Device, NONE), AtomicLoad(X, Device, NONE)]],
        ],
    ),
    litmus(
        "PC-bar-nonpriv",
        true,
        &[&[&[Load(X, NonPrivate), Barrier(NONE)], &[Barrier(NONE), Store(X, NonPrivate)]]],
    ),
    litmus(
        "PC-bar-acq-rel-priv",
        true,
        &[&[
            &[Load(X, Private), Barrier(BOTH.union(BUFFER))],
            &[Barrier(BOTH.union(BUFFER)), Store(X, Private)],
        ]],
    ),
    litmus(
        "PC-bar-acq-rel-nonpriv",
        false,
        &[&[
            &[Load(X, NonPrivate), Barrier(BOTH.union(BUFFER))],
            &[Barrier(BOTH.union(BUFFER)), Store(X, NonPrivate)],
        ]],
    ),
    litmus(
        "test5",
        false,
        &[
            &[
                &[Store(X, Within(Device)), AtomicStore(Y, Workgroup, REL)],
                &[AtomicLoad(Y, Workgroup, ACQ), AtomicStore(Z, Device, REL)],
            ],
            &[
                &[AtomicLoad(Z, Device, ACQ), AtomicStore(3, Workgroup, REL)],
                &[AtomicLoad(3, Workgroup, ACQ), Load(X, Within(Device))],
            ],
        ],
    ),
    litmus(
        "test12",
        false,
        &[&[
            &[Store(X, Within(Device)), Fence(Workgroup, REL), Barrier(NONE)],
            &[Barrier(NONE), Fence(Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
];

/// Shared memory, in which `barrier()` orders and atomic instructions race with plain ones.
static SHARED: &[Litmus] = &[
    litmus("SingleScalar", true, &[&[&[Store(X, Private)], &[Store(X, Private)]]]),
    litmus(
        "TwoThreadsShareValuesThroughArray",
        true,
        &[&[&[Store(X, Private), Load(Y, Private)], &[Store(Y, Private), Load(X, Private)]]],
    ),
    litmus(
        "TwoThreadsShareValuesThroughArray, barrier",
        false,
        &[&[
            &[Store(X, Private), Barrier(SHARED_BARRIER), Load(Y, Private)],
            &[Store(Y, Private), Barrier(SHARED_BARRIER), Load(X, Private)],
        ]],
    ),
    litmus(
        "TwoVariables",
        true,
        &[&[&[Store(X, Private), Store(Y, Private)], &[Store(Y, Private), Store(X, Private)]]],
    ),
    litmus(
        "TwoVariablesBarrier",
        false,
        &[&[
            &[Store(X, Private), Barrier(SHARED_BARRIER), Store(Y, Private)],
            &[Store(Y, Private), Barrier(SHARED_BARRIER), Store(X, Private)],
        ]],
    ),
    litmus("AtomicStoreAndStore", true, &[&[&[AtomicStore(X, Workgroup, NONE)], &[Store(X, Private)]]]),
    litmus("AtomicAddAndLoad", true, &[&[&[Add(X, Device, NONE)], &[Store(X, Private)]]]),
    litmus(
        "SingleScalar, atomic",
        false,
        &[&[&[AtomicStore(X, Workgroup, NONE)], &[AtomicStore(X, Workgroup, NONE)]]],
    ),
    litmus("SingleElementAccess", false, &[&[&[Store(X, Private)], &[Store(Y, Private)]]]),
    litmus("MultiLoad", false, &[&[&[Load(X, Private), Load(Y, Private)], &[Load(X, Private)]]]),
    litmus(
        "FirstLoadThenSameInvocationStore",
        false,
        &[&[
            &[
                Store(X, Private),
                Barrier(SHARED_BARRIER),
                Load(X, Private),
                Store(X, Private),
                Load(X, Private),
            ],
            &[
                Store(Y, Private),
                Barrier(SHARED_BARRIER),
                Load(Y, Private),
                Store(Y, Private),
                Load(Y, Private),
            ],
        ]],
    ),
    litmus(
        "OffenderIsOpLoadFromMultipleLoaders",
        true,
        &[&[&[Load(X, Private)], &[Load(X, Private)], &[Store(X, Private)]]],
    ),
];
/// What GLSL's `barrier()` has.
const SHARED_BARRIER: Semantics = BOTH.union(Semantics::WORKGROUP_MEMORY);

#[test]
fn verdicts_are_those_of_the_formal_model() {
    check(MODEL, Memory::Buffer);
}

#[test]
fn verdicts_on_shared_memory_are_those_of_the_validation_layers() {
    check(SHARED, Memory::Shared);
}
