//! Families of litmus tests, all variants of each: which accesses are private, which instructions
//! release, acquire, make available and visible, in which scopes, of which classes of memory. The
//! verdict of each is compared with that of [`litmus_oracle`](super::litmus_oracle).

use rspirv::spirv::{MemorySemantics as Semantics, Scope};

use crate::races::litmus::{
    ACQUIRE, AVAILABLE, BOTH, BUFFER, IMAGE, Memory, NONE, Privacy, RELEASE, Step, VISIBLE, X, Y, Z,
    broken_by,
};
use crate::races::litmus_oracle;

use Privacy::{NonPrivate, Private, Within};
use Scope::{Device, Subgroup, Workgroup};
use Step::{Add, AtomicLoad, AtomicStore, Barrier, Fence, Load, Store, SubgroupBarrier};

/// A fourth variable.
const W: u32 = 3;

/// Invocations by workgroup.
type Groups = Vec<Vec<Vec<Step>>>;

/// Ways to put the code of some invocations into workgroups: how many are in each.
fn grouped(invocations: &[Vec<Step>], sizes: &[usize]) -> Groups {
    let mut rest = invocations.iter().cloned();
    sizes.iter().map(|&size| rest.by_ref().take(size).collect()).collect()
}

/// Compares the verdicts on tests.
fn compare(name: &str, tests: impl Iterator<Item = Groups>) {
    let (mut wrong, mut races, mut all) = (Vec::new(), 0, 0);
    for groups in tests {
        let steps: Vec<Vec<&[Step]>> =
            groups.iter().map(|group| group.iter().map(Vec::as_slice).collect()).collect();
        let steps: Vec<&[&[Step]]> = steps.iter().map(Vec::as_slice).collect();
        for subgroup_size in [1, 32] {
            let expected = litmus_oracle::races(&steps, subgroup_size);
            let found = broken_by(&steps, Memory::Buffer, subgroup_size as u32);
            all += 1;
            races += usize::from(expected);
            if found.is_empty() == expected {
                wrong.push(format!("{groups:?} in subgroups of {subgroup_size}: {expected}, {found:?}"));
            }
        }
    }
    // A family that never races, or always, shows nothing.
    assert!(0 < races && races < all, "{name}: {races} of {all} race");
    let first: Vec<_> = wrong.iter().take(6).collect();
    assert!(wrong.is_empty(), "{name}: {} of {all} are wrong: {first:#?}", wrong.len());
}

const PLAIN: [Privacy; 5] = [Private, NonPrivate, Within(Subgroup), Within(Workgroup), Within(Device)];
const SCOPES: [Scope; 3] = [Subgroup, Workgroup, Device];

/// Releases: of buffers, with availability; of buffers; of images alone; none.
const RELEASES: [Semantics; 4] = [
    RELEASE.union(BUFFER).union(AVAILABLE),
    RELEASE.union(BUFFER),
    RELEASE.union(IMAGE).union(AVAILABLE),
    NONE,
];
/// Acquires, alike.
const ACQUIRES: [Semantics; 4] =
    [ACQUIRE.union(BUFFER).union(VISIBLE), ACQUIRE.union(BUFFER), ACQUIRE.union(IMAGE).union(VISIBLE), NONE];

fn pairs<A: Copy, B: Copy>(one: &[A], other: &[B]) -> Vec<(A, B)> {
    one.iter().flat_map(|&one| other.iter().map(move |&other| (one, other))).collect()
}

#[test]
fn messages_over_a_flag() {
    let mut tests = Vec::new();
    for (then, now) in pairs(&PLAIN, &PLAIN) {
        for (release, acquire) in pairs(&RELEASES, &ACQUIRES) {
            for (to, from) in
                [(Device, Device), (Workgroup, Workgroup), (Device, Workgroup), (Subgroup, Subgroup)]
            {
                let writer = vec![Store(X, then), AtomicStore(Y, to, release)];
                let reader = vec![AtomicLoad(Y, from, acquire), Load(X, now)];
                for sizes in [&[2][..], &[1, 1]] {
                    tests.push(grouped(&[writer.clone(), reader.clone()], sizes));
                }
            }
        }
    }
    // All are too many for a debug build; the steps are prime to the numbers of variants.
    compare("messages over a flag", tests.into_iter().step_by(13));
}

#[test]
fn messages_over_fences() {
    let mut tests = Vec::new();
    for (release, acquire) in pairs(&RELEASES[..3], &ACQUIRES[..3]) {
        for (to, from) in pairs(&SCOPES, &SCOPES) {
            for (then, now) in
                [(NonPrivate, NonPrivate), (Within(Device), Within(Device)), (NonPrivate, Within(Device))]
            {
                let writer = vec![Store(X, then), Fence(to, release), Add(Y, Device, NONE)];
                let late = vec![Store(X, then), Add(Y, Device, NONE), Fence(to, release)];
                let reader = vec![Add(Y, Device, NONE), Fence(from, acquire), Load(X, now)];
                let early = vec![Fence(from, acquire), Add(Y, Device, NONE), Load(X, now)];
                for [one, other] in [[&writer, &reader], [&late, &reader], [&writer, &early]] {
                    for sizes in [&[2][..], &[1, 1]] {
                        tests.push(grouped(&[one.clone(), other.clone()], sizes));
                    }
                }
            }
        }
    }
    compare("messages over fences", tests.into_iter().step_by(7));
}

#[test]
fn chains_of_two_hops() {
    let mut tests = Vec::new();
    for (then, now) in pairs(&PLAIN[1..], &PLAIN[1..]) {
        for (first, second) in
            [(Workgroup, Device), (Device, Workgroup), (Device, Device), (Subgroup, Device)]
        {
            for bits in 0..16 {
                let with = |bit: u32, one: Semantics, more: Semantics| {
                    if bits >> bit & 1 == 1 { one | more } else { one }
                };
                let [release, acquire] = [RELEASE | BUFFER, ACQUIRE | BUFFER];
                let middle = with(1, acquire, VISIBLE);
                let invocations = [
                    vec![Store(X, then), AtomicStore(Y, first, with(0, release, AVAILABLE))],
                    vec![AtomicLoad(Y, first, middle), AtomicStore(Z, second, with(2, release, AVAILABLE))],
                    vec![AtomicLoad(Z, second, with(3, acquire, VISIBLE)), Load(X, now)],
                ];
                for sizes in [&[2, 1][..], &[1, 2], &[1, 1, 1], &[3]] {
                    tests.push(grouped(&invocations, sizes));
                }
            }
        }
    }
    compare("chains of two hops", tests.into_iter().step_by(29));
}

#[test]
fn chains_of_three_hops() {
    let mut tests = Vec::new();
    for bits in 0..64 {
        let with =
            |bit: u32, one: Semantics, more: Semantics| if bits >> bit & 1 == 1 { one | more } else { one };
        let [release, acquire] = [RELEASE | BUFFER, ACQUIRE | BUFFER];
        for (then, now) in
            [(NonPrivate, NonPrivate), (Within(Workgroup), NonPrivate), (NonPrivate, Within(Workgroup))]
        {
            let invocations = [
                vec![Store(X, then), AtomicStore(Y, Workgroup, with(0, release, AVAILABLE))],
                vec![
                    AtomicLoad(Y, Workgroup, with(1, acquire, VISIBLE)),
                    AtomicStore(Z, Device, with(2, release, AVAILABLE)),
                ],
                vec![
                    AtomicLoad(Z, Device, with(3, acquire, VISIBLE)),
                    AtomicStore(W, Workgroup, with(4, release, AVAILABLE)),
                ],
                vec![AtomicLoad(W, Workgroup, with(5, acquire, VISIBLE)), Load(X, now)],
            ];
            tests.push(grouped(&invocations, &[2, 2]));
        }
    }
    compare("chains of three hops", tests.into_iter().step_by(2));
}

#[test]
fn control_barriers() {
    let mut tests = Vec::new();
    let orders = [BOTH, RELEASE, ACQUIRE];
    let classes = [BUFFER, IMAGE, BUFFER.union(IMAGE)];
    let mut semantics = vec![NONE];
    for (order, class) in pairs(&orders, &classes) {
        semantics.push(order | class);
        semantics.push(order | class | if order == ACQUIRE { VISIBLE } else { AVAILABLE });
        semantics.push(order | class | if order == BOTH { AVAILABLE | VISIBLE } else { NONE });
    }
    let fences: [&[Step]; 4] = [
        &[],
        &[Fence(Workgroup, RELEASE.union(BUFFER).union(AVAILABLE))],
        &[Fence(Workgroup, ACQUIRE.union(BUFFER).union(VISIBLE))],
        &[Fence(Workgroup, BOTH.union(BUFFER))],
    ];
    for semantics in semantics {
        for (then, now) in
            [(NonPrivate, NonPrivate), (Within(Workgroup), Within(Workgroup)), (Private, NonPrivate)]
        {
            for (before, after) in pairs(&fences, &fences) {
                for barrier in [Barrier(semantics), SubgroupBarrier(semantics)] {
                    let writer = [&[Store(X, then)][..], before, &[barrier]].concat();
                    let reader = [&[barrier][..], after, &[Load(X, now)]].concat();
                    tests.push(grouped(&[writer, reader], &[2]));
                }
            }
        }
    }
    compare("control barriers", tests.into_iter().step_by(13));
}

#[test]
fn a_flag_and_then_a_barrier() {
    let mut tests = Vec::new();
    for bits in 0..16 {
        let with =
            |bit: u32, one: Semantics, more: Semantics| if bits >> bit & 1 == 1 { one | more } else { one };
        let barrier = with(2, with(3, BOTH | BUFFER, VISIBLE), AVAILABLE);
        for now in [NonPrivate, Within(Workgroup), Within(Device)] {
            for scope in [Device, Workgroup] {
                let writer =
                    vec![Store(X, NonPrivate), AtomicStore(Y, scope, with(0, RELEASE | BUFFER, AVAILABLE))];
                let first = vec![AtomicLoad(Y, scope, with(1, ACQUIRE | BUFFER, VISIBLE)), Barrier(barrier)];
                let second = vec![Barrier(barrier), Load(X, now)];
                tests.push(vec![vec![writer.clone()], vec![first.clone(), second.clone()]]);
                // From the barrier to the other workgroup.
                let first = vec![Store(X, NonPrivate), Barrier(barrier)];
                let second =
                    vec![Barrier(barrier), AtomicStore(Y, scope, with(0, RELEASE | BUFFER, AVAILABLE))];
                let reader = vec![
                    Barrier(barrier),
                    AtomicLoad(Y, scope, with(1, ACQUIRE | BUFFER, VISIBLE)),
                    Load(X, now),
                ];
                tests.push(vec![vec![first, second], vec![reader]]);
            }
        }
    }
    compare("a flag and then a barrier", tests.into_iter());
}

#[test]
fn late_and_early_accesses() {
    let mut tests = Vec::new();
    for (then, seen) in pairs(&PLAIN[1..], &PLAIN[1..]) {
        for now in PLAIN {
            for scope in [Workgroup, Device] {
                let writer = vec![Store(X, then), AtomicStore(Y, scope, RELEASE | BUFFER)];
                let late = vec![AtomicLoad(Y, scope, ACQUIRE | BUFFER), Load(X, seen), Load(X, now)];
                let early = vec![Load(X, seen), AtomicLoad(Y, scope, ACQUIRE | BUFFER), Load(X, now)];
                for reader in [late, early] {
                    for sizes in [&[2][..], &[1, 1]] {
                        tests.push(grouped(&[writer.clone(), reader.clone()], sizes));
                    }
                }
            }
        }
    }
    compare("late and early accesses", tests.into_iter().step_by(3));
}

#[test]
fn release_sequences() {
    let mut tests = Vec::new();
    let middle = [
        AtomicStore(Y, Device, NONE),
        Add(Y, Device, NONE),
        Add(Y, Workgroup, NONE),
        Add(Y, Device, RELEASE | BUFFER | AVAILABLE),
        Store(Y, Within(Device)),
    ];
    for step in middle {
        for (release, acquire) in pairs(&RELEASES[..2], &ACQUIRES[..2]) {
            for (then, now) in [(NonPrivate, NonPrivate), (Within(Device), Within(Device))] {
                let writer = vec![Store(X, then), AtomicStore(Y, Device, release)];
                let fenced = vec![Store(X, then), Fence(Device, release), AtomicStore(Y, Device, NONE)];
                let reader = vec![AtomicLoad(Y, Device, acquire), Load(X, now)];
                for writer in [writer, fenced] {
                    for sizes in [&[1, 1, 1][..], &[2, 1], &[1, 2], &[3]] {
                        tests.push(grouped(&[writer.clone(), vec![step], reader.clone()], sizes));
                    }
                }
            }
        }
    }
    compare("release sequences", tests.into_iter().step_by(3));
}

#[test]
fn writes_after_reads_and_writes() {
    let mut tests = Vec::new();
    for (release, acquire) in pairs(&RELEASES, &ACQUIRES[..3]) {
        for privacy in PLAIN {
            for first in
                [Load(X, privacy), Store(X, privacy), Add(X, Device, NONE), AtomicStore(X, Workgroup, NONE)]
            {
                for last in [
                    Store(X, NonPrivate),
                    Store(X, Within(Device)),
                    Add(X, Device, NONE),
                    Load(X, NonPrivate),
                ] {
                    let one = vec![first, AtomicStore(Y, Device, release)];
                    let other = vec![AtomicLoad(Y, Device, acquire), last];
                    for sizes in [&[2][..], &[1, 1]] {
                        tests.push(grouped(&[one.clone(), other.clone()], sizes));
                    }
                }
            }
        }
    }
    compare("writes after reads and writes", tests.into_iter().step_by(11));
}
