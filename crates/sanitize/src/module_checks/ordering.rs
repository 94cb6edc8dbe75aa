//! Rules about the scopes and memory semantics of barriers and atomic instructions.

use rspirv::spirv::{MemorySemantics as Semantics, Scope};
use rustc_hash::FxHashMap;

use crate::module_checks::Fault;
use crate::module_checks::code::{EntryCode, Part};
use anyhit_base::sorted::sort;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::{Id, Opcode};
use anyhit_engine::ops::atomic;
use anyhit_engine::ops::pointer::storage;

/// `VulkanMemoryModelDeviceScope`
const VULKAN_MEMORY_MODEL_DEVICE_SCOPE: u32 = 5346;

/// A barrier or an atomic instruction.
struct Ordering {
    offset: u32,
    opcode: Opcode,
    scope: Option<u32>,
    semantics: Option<Semantics>,
    /// Those of `OpAtomicCompareExchange` where the values are not equal.
    unequal: Option<Semantics>,
}

impl Ordering {
    fn is_barrier(&self) -> bool {
        self.opcode.is_control_barrier() || self.opcode == Opcode::MemoryBarrier
    }

    fn fault(&self, says: impl std::fmt::Display) -> Fault {
        Fault { offset: self.offset, message: format!("{} {says}", self.opcode) }
    }
}

/// All barriers and atomic instructions.
fn orderings(code: &EntryCode<'_>) -> impl Iterator<Item = Ordering> {
    code.with_operands().filter_map(|(opcode, instruction, operands)| {
        let scope_at = match opcode {
            Opcode::MemoryBarrier => 0,
            _ if opcode.is_control_barrier() || atomic::OPCODES.contains(&opcode) => 1,
            _ => return None,
        };
        let constant = |at: usize| {
            let bits = code.module.scalar_value(Id(*operands.get(at)?))?;
            u32::try_from(bits).ok()
        };
        let unequal = (opcode == Opcode::AtomicCompareExchange).then(|| constant(3)).flatten();
        Some(Ordering {
            offset: instruction.offset,
            opcode,
            scope: constant(scope_at),
            semantics: constant(scope_at + 1).map(Semantics::from_bits_retain),
            unequal: unequal.map(Semantics::from_bits_retain),
        })
    })
}

const ORDERS: Semantics = Semantics::ACQUIRE.union(Semantics::RELEASE).union(Semantics::ACQUIRE_RELEASE);
const CLASSES: Semantics = Semantics::UNIFORM_MEMORY
    .union(Semantics::WORKGROUP_MEMORY)
    .union(Semantics::IMAGE_MEMORY)
    .union(Semantics::OUTPUT_MEMORY);

pub(super) fn barrier_semantics(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for one in orderings(code) {
        let broken = one.semantics.and_then(|semantics| broken_semantics(&one, semantics));
        let unequal =
            one.semantics.zip(one.unequal).and_then(|(equal, unequal)| broken_unequal(equal, unequal));
        faults.extend(broken.or(unequal).map(|says| one.fault(says)));
    }
}

/// What is wrong with semantics: VUID-StandaloneSpirv-MemorySemantics-10865 to 10874, in order.
fn broken_semantics(one: &Ordering, semantics: Semantics) -> Option<String> {
    let order = semantics & ORDERS;
    let releases = semantics.intersects(Semantics::RELEASE | Semantics::ACQUIRE_RELEASE);
    let acquires = semantics.intersects(Semantics::ACQUIRE | Semantics::ACQUIRE_RELEASE);
    let classes = semantics & CLASSES;
    Some(match () {
        () if order.bits().count_ones() > 1 => format!("has several memory orders: {}", names(order)),
        () if semantics.contains(Semantics::SEQUENTIALLY_CONSISTENT) => {
            "is SequentiallyConsistent, which Vulkan does not have".into()
        }
        () if one.opcode == Opcode::AtomicStore && acquires => "acquires, though it loads nothing".into(),
        () if one.opcode == Opcode::AtomicLoad && releases => "releases, though it stores nothing".into(),
        () if one.opcode == Opcode::MemoryBarrier && order.is_empty() => "has no memory order".into(),
        () if !order.is_empty() && classes.is_empty() => {
            format!("is {}, and names no class of memory that is ordered", names(order))
        }
        () if order.is_empty() && !classes.is_empty() => {
            format!("names {}, and has no memory order", names(classes))
        }
        () if semantics.contains(Semantics::MAKE_AVAILABLE) && !releases => {
            "makes available, and does not release".into()
        }
        () if semantics.contains(Semantics::MAKE_VISIBLE) && !acquires => {
            "makes visible, and does not acquire".into()
        }
        () if semantics.contains(Semantics::VOLATILE) && one.is_barrier() => "is Volatile".into(),
        () => return None,
    })
}

/// What is wrong with the semantics of a comparison that fails: 10875 to 10879.
fn broken_unequal(equal: Semantics, unequal: Semantics) -> Option<String> {
    let more = (unequal & CLASSES).difference(equal);
    Some(match () {
        () if unequal.intersects(Semantics::RELEASE | Semantics::ACQUIRE_RELEASE) => {
            "releases where the values are not equal, and nothing is stored".into()
        }
        () if unequal.contains(Semantics::ACQUIRE) && !equal.intersects(ORDERS) => {
            "has a stronger memory order where the values are not equal".into()
        }
        () if !more.is_empty() => format!("names {} only where the values are not equal", names(more)),
        () if unequal.contains(Semantics::MAKE_VISIBLE) && !equal.contains(Semantics::MAKE_VISIBLE) => {
            "makes visible only where the values are not equal".into()
        }
        () if unequal.contains(Semantics::VOLATILE) != equal.contains(Semantics::VOLATILE) => {
            "is Volatile in one of its semantics alone".into()
        }
        () => return None,
    })
}

/// The names of bits, as the specification writes them.
fn names(semantics: Semantics) -> String {
    let all = [
        (Semantics::ACQUIRE, "Acquire"),
        (Semantics::RELEASE, "Release"),
        (Semantics::ACQUIRE_RELEASE, "AcquireRelease"),
        (Semantics::UNIFORM_MEMORY, "UniformMemory"),
        (Semantics::WORKGROUP_MEMORY, "WorkgroupMemory"),
        (Semantics::IMAGE_MEMORY, "ImageMemory"),
        (Semantics::OUTPUT_MEMORY, "OutputMemory"),
    ];
    let set: Vec<&str> =
        all.into_iter().filter(|(bit, _)| semantics.contains(*bit)).map(|(_, name)| name).collect();
    set.join(" | ")
}

pub(super) fn memory_scope(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let stage = code.entry.stage;
    let has = |capability: u32| code.module.capabilities.contains(&capability);
    let has_model = code.module.has_vulkan_memory_model();
    for one in orderings(code) {
        let Some(number) = one.scope else { continue };
        let says = match Scope::from_u32(number) {
            Some(Scope::Workgroup) if stage != Stage::Compute => {
                format!("has memory scope Workgroup in {}, which has no workgroups", stage.name())
            }
            Some(Scope::ShaderCallKHR) if stage == Stage::Compute => {
                "has memory scope ShaderCallKHR in a compute shader".into()
            }
            Some(Scope::QueueFamily) if !has_model => {
                "has memory scope QueueFamily without the Vulkan memory model".into()
            }
            Some(Scope::Device) if has_model && !has(VULKAN_MEMORY_MODEL_DEVICE_SCOPE) => {
                "has memory scope Device without the capability VulkanMemoryModelDeviceScope".into()
            }
            Some(
                Scope::Device
                | Scope::QueueFamily
                | Scope::Workgroup
                | Scope::ShaderCallKHR
                | Scope::Subgroup
                | Scope::Invocation,
            ) => continue,
            Some(other) => format!("has memory scope {other:?}"),
            None => format!("has memory scope {number}, which is none"),
        };
        faults.push(one.fault(says));
    }
}

pub(super) fn invocation_scope(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for one in orderings(code).filter(|one| one.scope == Some(Scope::Invocation as u32)) {
        let semantics =
            one.semantics.unwrap_or(Semantics::empty()) | one.unequal.unwrap_or(Semantics::empty());
        let order = semantics & (ORDERS | Semantics::SEQUENTIALLY_CONSISTENT);
        if !order.is_empty() {
            let order = names(order);
            faults
                .push(one.fault(format!("is {order} of memory scope Invocation: of one invocation, alone")));
        }
    }
}

/// Barriers of a shader that order no class of memory which it uses, though it writes and reads
/// some.
pub(super) fn barrier_class(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let barriers: Vec<Ordering> = orderings(code).filter(Ordering::is_barrier).collect();
    let named =
        barriers.iter().filter_map(|one| one.semantics).fold(Semantics::empty(), |all, one| all | one);
    if barriers.is_empty() {
        return;
    }
    let (mut used, mut by_variable) = (Semantics::empty(), FxHashMap::default());
    for access in code.accesses() {
        used |= class_of(code, access.pointer);
        for variable in code.reached(&access) {
            let (reads, writes) = by_variable.entry(variable).or_insert((false, false));
            *reads |= access.reads && !access.writes;
            *writes |= access.writes;
        }
    }
    // A barrier that orders something else that the shader uses is there for that.
    if named.intersects(used) {
        return;
    }
    let mut both: Vec<Id> =
        by_variable.iter().filter(|(_, (reads, writes))| *reads && *writes).map(|(id, _)| *id).collect();
    sort(&mut both);
    let Some(variable) = both.into_iter().find(|&id| !class_of(code, id).is_empty()) else { return };
    let orders = |one: &&Ordering| one.semantics.is_some_and(|semantics| semantics.intersects(CLASSES));
    let Some(barrier) = barriers.iter().find(orders) else { return };
    let classes = names(barrier.semantics.unwrap_or(Semantics::empty()) & CLASSES);
    let (name, class) = (code.describe(Part::Variable(variable)), names(class_of(code, variable)));
    faults.push(barrier.fault(format!(
        "orders {classes}, of which the shader has none; {name}, which it writes and reads, is {class}"
    )));
}

/// The class of memory that a pointer or image belongs to; none for what only its invocation sees.
fn class_of(code: &EntryCode<'_>, pointer: Id) -> Semantics {
    /// `Image`
    const IMAGE: u32 = 11;
    match code.storage_class(pointer) {
        Some(storage::STORAGE_BUFFER | storage::UNIFORM | storage::PHYSICAL_STORAGE_BUFFER) => {
            Semantics::UNIFORM_MEMORY
        }
        Some(storage::WORKGROUP) => Semantics::WORKGROUP_MEMORY,
        Some(storage::UNIFORM_CONSTANT | IMAGE) | None => Semantics::IMAGE_MEMORY,
        _ => Semantics::empty(),
    }
}
