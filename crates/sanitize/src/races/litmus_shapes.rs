//! Litmus tests by their shape: independent reads of independent writes, load buffering, messages
//! over barriers and chains, atomic instructions beside others, `Volatile`.
//!
//! The verdicts are derived by hand from Vulkan's "Memory Model": two accesses do not race where
//! both are atomic, and each is in the scope of the other; or where the earlier one happens before
//! the later one, neither is private, and what the earlier one writes is available (and, for a
//! load, visible) to the later one's invocation.

use rspirv::spirv::{MemorySemantics as Semantics, Scope};

use crate::races::litmus::{
    ACQ, ACQ_VIS, BOTH, BUFFER, IMAGE, Litmus, Memory, NONE, Privacy, REL, REL_AV, Step, VISIBLE, X, Y, Z,
    check, litmus,
};

use Privacy::{NonPrivate, Private, Volatile, Within};
use Scope::{Device, QueueFamily, Subgroup, Workgroup};
use Step::{Add, AtomicLoad, AtomicStore, Barrier, Fence, Load, Store, SubgroupBarrier};

/// A fourth variable.
const W: u32 = 3;
/// Of a barrier that orders buffers, and makes what was written available.
const BAR_AV: Semantics = BOTH.union(BUFFER).union(Semantics::MAKE_AVAILABLE);
/// As [`BAR_AV`], and visible.
const BAR: Semantics = BAR_AV.union(VISIBLE);
const VOLATILE: Semantics = Semantics::VOLATILE;
/// An invocation that does nothing but wait.
const WAITS: &[Step] = &[SubgroupBarrier(BAR)];

static SHAPES: &[Litmus] = &[
    // All accesses are atomic, and in scope of each other.
    litmus(
        "iriw",
        false,
        &[
            &[&[AtomicStore(X, Device, NONE)]],
            &[&[AtomicStore(Y, Device, NONE)]],
            &[&[AtomicLoad(X, Device, ACQ), AtomicLoad(Y, Device, ACQ)]],
            &[&[AtomicLoad(Y, Device, ACQ), AtomicLoad(X, Device, ACQ)]],
        ],
    ),
    // The readers are in other workgroups than the writer of X.
    litmus(
        "iriw, a narrow writer",
        true,
        &[
            &[&[AtomicStore(X, Workgroup, NONE)]],
            &[&[AtomicStore(Y, Device, NONE)]],
            &[&[AtomicLoad(X, Device, ACQ), AtomicLoad(Y, Device, ACQ)]],
            &[&[AtomicLoad(Y, Device, ACQ), AtomicLoad(X, Device, ACQ)]],
        ],
    ),
    // Each reader acquires from both writers before it reads what they have written.
    litmus(
        "iriw, with data",
        false,
        &[
            &[&[Store(Z, Within(Device)), AtomicStore(X, Device, REL)]],
            &[&[Store(W, Within(Device)), AtomicStore(Y, Device, REL)]],
            &[&[
                AtomicLoad(X, Device, ACQ),
                AtomicLoad(Y, Device, ACQ),
                Load(Z, Within(Device)),
                Load(W, Within(Device)),
            ]],
            &[&[
                AtomicLoad(Y, Device, ACQ),
                AtomicLoad(X, Device, ACQ),
                Load(W, Within(Device)),
                Load(Z, Within(Device)),
            ]],
        ],
    ),
    // Nothing acquires.
    litmus(
        "iriw, with data, relaxed",
        true,
        &[
            &[&[Store(Z, Within(Device)), AtomicStore(X, Device, REL)]],
            &[&[Store(W, Within(Device)), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(X, Device, NONE), AtomicLoad(Y, Device, NONE), Load(Z, Within(Device))]],
            &[&[AtomicLoad(Y, Device, NONE), AtomicLoad(X, Device, NONE), Load(W, Within(Device))]],
        ],
    ),
    litmus(
        "lb",
        false,
        &[
            &[&[AtomicLoad(X, Device, NONE), AtomicStore(Y, Device, NONE)]],
            &[&[AtomicLoad(Y, Device, NONE), AtomicStore(X, Device, NONE)]],
        ],
    ),
    litmus(
        "lb, plain",
        true,
        &[&[&[Load(X, NonPrivate), Store(Y, NonPrivate)], &[Load(Y, NonPrivate), Store(X, NonPrivate)]]],
    ),
    // The first invocation comes first, so that it reads no flag that the second one has set.
    litmus(
        "lb, the flag comes too late",
        true,
        &[
            &[&[AtomicLoad(Y, Device, ACQ), Store(X, Within(Device))]],
            &[&[Load(X, Within(Device)), AtomicStore(Y, Device, REL)]],
        ],
    ),
    litmus(
        "mp over a subgroup barrier",
        false,
        &[&[&[Store(X, NonPrivate), SubgroupBarrier(BAR)], &[SubgroupBarrier(BAR), Load(X, NonPrivate)]]],
    ),
    litmus(
        "mp over a subgroup barrier, made available by the accesses",
        false,
        &[&[
            &[Store(X, Within(Subgroup)), SubgroupBarrier(BOTH.union(BUFFER))],
            &[SubgroupBarrier(BOTH.union(BUFFER)), Load(X, Within(Subgroup))],
        ]],
    ),
    // A control barrier without semantics synchronizes nothing.
    litmus(
        "mp over a subgroup barrier, relaxed",
        true,
        &[&[
            &[Store(X, Within(Subgroup)), SubgroupBarrier(NONE)],
            &[SubgroupBarrier(NONE), Load(X, Within(Subgroup))],
        ]],
    ),
    // Invocation 32 is in the second subgroup of 32.
    litmus(
        "mp over a subgroup barrier, to another subgroup",
        true,
        &[&[
            &[Store(X, NonPrivate), SubgroupBarrier(BAR)],
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            WAITS,
            &[SubgroupBarrier(BAR), Load(X, NonPrivate)],
        ]],
    ),
    litmus(
        "ww over a barrier, relaxed",
        true,
        &[&[&[Store(X, NonPrivate), Barrier(NONE)], &[Barrier(NONE), Store(X, NonPrivate)]]],
    ),
    // A write behind a write needs availability, and no visibility.
    litmus(
        "ww over a barrier that makes nothing available",
        true,
        &[&[
            &[Store(X, NonPrivate), Barrier(BOTH.union(BUFFER))],
            &[Barrier(BOTH.union(BUFFER)), Store(X, NonPrivate)],
        ]],
    ),
    litmus(
        "ww over a barrier",
        false,
        &[&[&[Store(X, NonPrivate), Barrier(BAR_AV)], &[Barrier(BAR_AV), Store(X, NonPrivate)]]],
    ),
    litmus(
        "ww over a barrier, private",
        true,
        &[&[&[Store(X, Private), Barrier(BAR)], &[Barrier(BAR), Store(X, Private)]]],
    ),
    litmus(
        "ww over a barrier of images",
        true,
        &[&[
            &[Store(X, NonPrivate), Barrier(BOTH.union(IMAGE).union(Semantics::MAKE_AVAILABLE))],
            &[Barrier(BOTH.union(IMAGE).union(Semantics::MAKE_AVAILABLE)), Store(X, NonPrivate)],
        ]],
    ),
    litmus(
        "ww over a flag",
        false,
        &[
            &[&[Store(X, NonPrivate), AtomicStore(Y, Device, REL_AV)]],
            &[&[AtomicLoad(Y, Device, ACQ), Store(X, NonPrivate)]],
        ],
    ),
    litmus(
        "ww over a flag that makes nothing available",
        true,
        &[
            &[&[Store(X, NonPrivate), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), Store(X, NonPrivate)]],
        ],
    ),
    // Available in the workgroup, and from there, by the second invocation, on the device.
    litmus(
        "a chain from the workgroup to the device",
        false,
        &[
            &[
                &[Store(X, NonPrivate), AtomicStore(Y, Workgroup, REL_AV)],
                &[AtomicLoad(Y, Workgroup, ACQ_VIS), AtomicStore(Z, Device, REL_AV)],
            ],
            &[&[AtomicLoad(Z, Device, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
    litmus(
        "mp within the queue family",
        false,
        &[
            &[&[Store(X, NonPrivate), AtomicStore(Y, QueueFamily, REL_AV)]],
            &[&[AtomicLoad(Y, QueueFamily, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
    litmus(
        "mp within the queue family, available in the workgroup alone",
        true,
        &[
            &[&[Store(X, Within(Workgroup)), AtomicStore(Y, QueueFamily, REL)]],
            &[&[AtomicLoad(Y, QueueFamily, ACQ), Load(X, Within(QueueFamily))]],
        ],
    ),
    litmus(
        "mp on the device, visible in the workgroup alone",
        true,
        &[
            &[&[Store(X, Within(Device)), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), Load(X, Within(Workgroup))]],
        ],
    ),
    litmus("an atomic add beside a store", true, &[&[&[Add(X, Device, NONE)]], &[&[Store(X, NonPrivate)]]]),
    // An atomic write is made available within its scope by itself.
    litmus(
        "an atomic store, then a flag",
        false,
        &[
            &[&[AtomicStore(X, Device, NONE), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), Load(X, Within(Device))]],
        ],
    ),
    litmus(
        "an atomic store in the workgroup, then a flag",
        true,
        &[
            &[&[AtomicStore(X, Workgroup, NONE), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), Load(X, Within(Device))]],
        ],
    ),
    litmus(
        "an atomic add, then a load behind a barrier",
        false,
        &[&[&[Add(X, Workgroup, NONE), Barrier(BAR)], &[Barrier(BAR), Load(X, NonPrivate)]]],
    ),
    litmus(
        "a load, then an atomic add behind a barrier",
        false,
        &[&[
            &[Load(X, NonPrivate), Barrier(BOTH.union(BUFFER))],
            &[Barrier(BOTH.union(BUFFER)), Add(X, Workgroup, NONE)],
        ]],
    ),
    // `Volatile` keeps an access where it stands. It orders nothing, and the access stays private.
    litmus("volatile", true, &[&[&[Store(X, Volatile)]], &[&[Load(X, Volatile)]]]),
    litmus(
        "mp, volatile",
        true,
        &[
            &[&[Store(X, Volatile), AtomicStore(Y, Device, REL_AV)]],
            &[&[AtomicLoad(Y, Device, ACQ_VIS), Load(X, Volatile)]],
        ],
    ),
    litmus(
        "volatile atomic instructions",
        false,
        &[&[&[AtomicStore(X, Device, VOLATILE)]], &[&[AtomicLoad(X, Device, VOLATILE)]]],
    ),
];

/// The last workgroup to count itself reads what all have written: a release fence stands before
/// the atomic instruction, an acquire fence behind it.
static COUNTED: &[Litmus] = &[
    litmus(
        "counted, fences around",
        false,
        &[
            &[&[Store(X, NonPrivate), Fence(Device, REL_AV), Add(Y, Device, NONE)]],
            &[&[Add(Y, Device, NONE), Fence(Device, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
    litmus(
        "counted, the release comes too late",
        true,
        &[
            &[&[Store(X, NonPrivate), Add(Y, Device, NONE), Fence(Device, REL_AV)]],
            &[&[Add(Y, Device, NONE), Fence(Device, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
    litmus(
        "counted, the release comes too early",
        true,
        &[
            &[&[Fence(Device, REL_AV), Store(X, NonPrivate), Add(Y, Device, NONE)]],
            &[&[Add(Y, Device, NONE), Fence(Device, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
    litmus(
        "counted, the acquire comes too early",
        true,
        &[
            &[&[Store(X, NonPrivate), Fence(Device, REL_AV), Add(Y, Device, NONE)]],
            &[&[Fence(Device, ACQ_VIS), Add(Y, Device, NONE), Load(X, NonPrivate)]],
        ],
    ),
    // A control barrier is a memory barrier, too, and its memory scope may hold more invocations
    // than wait at it.
    litmus(
        "counted behind a barrier of the workgroup alone",
        true,
        &[
            &[&[Store(X, NonPrivate), Barrier(BAR), Add(Y, Device, NONE)]],
            &[&[Add(Y, Device, NONE), Barrier(BAR), Load(X, NonPrivate)]],
        ],
    ),
];

#[test]
fn fences_order_through_atomic_instructions_on_their_right_side() {
    check(COUNTED, Memory::Buffer);
}

/// Each hop of a chain counts: an acquire of the one that has released, and what makes available.
static HOPS: &[Litmus] = &[
    // The second invocation acquires from the first one alone.
    litmus(
        "a flag that is not acquired",
        true,
        &[
            &[&[Store(Z, Within(Device)), AtomicStore(X, Device, REL)]],
            &[&[Store(W, Within(Device)), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(X, Device, ACQ), AtomicLoad(Y, Device, NONE), Load(W, Within(Device))]],
        ],
    ),
    // The release of the first invocation makes nothing available.
    litmus(
        "a chain without its first link",
        true,
        &[
            &[
                &[Store(X, NonPrivate), AtomicStore(Y, Workgroup, REL)],
                &[AtomicLoad(Y, Workgroup, ACQ), AtomicStore(Z, Device, REL_AV)],
            ],
            &[&[AtomicLoad(Z, Device, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
];

#[test]
fn verdicts_are_those_derived_by_hand() {
    check(SHAPES, Memory::Buffer);
}

#[test]
fn each_hop_of_a_chain_counts() {
    check(HOPS, Memory::Buffer);
}
