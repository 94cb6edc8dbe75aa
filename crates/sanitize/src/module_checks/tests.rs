//! Modules that break one rule each, most of which no compiler writes.

use crate::module_checks::CHECKS;
use crate::module_checks::code::EntryCode;
use anyhit_base::sorted::SortedSet;
use anyhit_engine::module::assemble::Assembler;
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::{Module, Opcode};
use anyhit_engine::ops::pointer::storage;

const COMPUTE: u32 = 5;
const RAY_GENERATION: u32 = 5313;
const INTERSECTION: u32 = 5314;
const CLOSEST_HIT: u32 = 5316;
const MISS: u32 = 5317;

/// The rules that the first entry point of a module breaks.
fn broken(module: &Module) -> SortedSet<&'static str> {
    let code = EntryCode::new(module, &module.entry_points[0]);
    let breaks = |check: fn(&EntryCode<'_>, &mut Vec<_>)| {
        let mut faults = Vec::new();
        check(&code, &mut faults);
        !faults.is_empty()
    };
    CHECKS.iter().filter(|(_, check)| breaks(*check)).map(|(rule, _)| rule.id).collect()
}

/// A module of one entry point, `%40`, with decorations, declarations and a body.
fn assembled(
    stage: u32,
    before: impl FnOnce(&mut Assembler),
    declare: impl FnOnce(&mut Assembler),
    body: impl FnOnce(&mut Assembler),
) -> Assembler {
    let mut a = Assembler::new();
    a.with_string(Opcode::EntryPoint, &[stage, 40], "main", &[]);
    before(&mut a);
    a.types();
    declare(&mut a);
    a.function(40, 41, |a| {
        body(a);
        a.op(Opcode::Return, &[]);
    });
    a
}

/// A variable `%30` of a struct `%50` of one uint, and a pointer `%31` to the uint.
fn with_block(
    stage: u32,
    class: u32,
    decorate: impl FnOnce(&mut Assembler),
    access: impl FnOnce(&mut Assembler),
) -> SortedSet<&'static str> {
    let declare = |a: &mut Assembler| {
        a.op(Opcode::Constant, &[5, 49, 0]);
        a.op(Opcode::TypeStruct, &[50, 5]);
        a.op(Opcode::TypePointer, &[51, class, 50]);
        a.op(Opcode::TypePointer, &[52, class, 5]);
        a.op(Opcode::Variable, &[51, 30, class]);
    };
    let body = |a: &mut Assembler| {
        a.op(Opcode::AccessChain, &[52, 31, 30, 49]);
        access(a);
    };
    broken(&assembled(stage, decorate, declare, body).loaded())
}

fn block(a: &mut Assembler) {
    a.op(Opcode::Decorate, &[50, number::BLOCK]);
}

fn store(a: &mut Assembler) {
    a.op(Opcode::Store, &[31, 8]);
}

fn load(a: &mut Assembler) {
    a.op(Opcode::Load, &[5, 60, 31]);
}

fn rules<const N: usize>(ids: [&'static str; N]) -> SortedSet<&'static str> {
    SortedSet::from(ids)
}

#[test]
fn uniform_blocks_are_not_written() {
    assert_eq!(with_block(COMPUTE, storage::UNIFORM, block, store), rules(["uniform-store"]));
    assert_eq!(with_block(COMPUTE, storage::UNIFORM, block, load), rules([]));
    // The storage buffers of SPIR-V 1.0.
    let buffer_block = |a: &mut Assembler| {
        a.op(Opcode::Decorate, &[50, 3]);
    };
    assert_eq!(with_block(COMPUTE, storage::UNIFORM, buffer_block, store), rules([]));
    assert_eq!(with_block(COMPUTE, storage::STORAGE_BUFFER, block, store), rules([]));
}

#[test]
fn what_is_not_writable_or_readable_is_neither_written_nor_read() {
    let variable = |number: u32| {
        move |a: &mut Assembler| {
            a.op(Opcode::Decorate, &[50, number::BLOCK]);
            a.op(Opcode::Decorate, &[30, number]);
        }
    };
    let member = |number: u32| {
        move |a: &mut Assembler| {
            a.op(Opcode::Decorate, &[50, number::BLOCK]);
            a.op(Opcode::MemberDecorate, &[50, 0, number]);
        }
    };
    let buffer = storage::STORAGE_BUFFER;
    for (access, is_store) in [(store as fn(&mut Assembler), true), (load, false)] {
        let wanted = |id: &'static str, breaks: bool| if breaks { rules([id]) } else { rules([]) };
        let writable = wanted("non-writable", is_store);
        assert_eq!(with_block(COMPUTE, buffer, variable(number::NON_WRITABLE), access), writable);
        assert_eq!(with_block(COMPUTE, buffer, member(number::NON_WRITABLE), access), writable);
        let readable = wanted("non-readable", !is_store);
        assert_eq!(with_block(COMPUTE, buffer, variable(number::NON_READABLE), access), readable);
        assert_eq!(with_block(COMPUTE, buffer, member(number::NON_READABLE), access), readable);
    }
}

/// What spirv-opt makes of the initializer of a constant table, and another store to the same.
#[test]
fn a_constant_stored_to_a_local_variable_is_its_initializer() {
    let decorate = |a: &mut Assembler| {
        a.op(Opcode::Decorate, &[60, number::NON_WRITABLE]);
    };
    let declare = |a: &mut Assembler| {
        a.op(Opcode::TypePointer, &[52, 7, 5]);
    };
    let constant = |a: &mut Assembler| {
        a.op(Opcode::Variable, &[52, 60, 7]);
        a.op(Opcode::Store, &[60, 8]);
    };
    assert_eq!(broken(&assembled(COMPUTE, decorate, declare, constant).loaded()), rules([]));
    let computed = |a: &mut Assembler| {
        a.op(Opcode::Variable, &[52, 60, 7]);
        a.op(Opcode::IAdd, &[5, 61, 8, 8]);
        a.op(Opcode::Store, &[60, 61]);
    };
    assert_eq!(broken(&assembled(COMPUTE, decorate, declare, computed).loaded()), rules(["non-writable"]));
}

#[test]
fn ray_tracing_stages_have_no_workgroups() {
    let add = |a: &mut Assembler| {
        a.op(Opcode::AtomicIAdd, &[5, 60, 31, 8, 49, 8]);
    };
    assert_eq!(with_block(COMPUTE, storage::WORKGROUP, |_| (), add), rules([]));
    assert_eq!(with_block(RAY_GENERATION, storage::WORKGROUP, |_| (), add), rules(["workgroup-in-rt"]));
}

#[test]
fn an_atomic_instruction_reads_and_writes() {
    let add = |a: &mut Assembler| {
        a.op(Opcode::Constant, &[5, 49, 0]);
        a.op(Opcode::Constant, &[5, 48, 1]);
        a.op(Opcode::TypeStruct, &[50, 5]);
        a.op(Opcode::TypePointer, &[51, 12, 50]);
        a.op(Opcode::TypePointer, &[52, 12, 5]);
        a.op(Opcode::Variable, &[51, 30, 12]);
    };
    let body = |a: &mut Assembler| {
        a.op(Opcode::AccessChain, &[52, 31, 30, 49]);
        a.op(Opcode::AtomicIAdd, &[5, 60, 31, 48, 49, 8]);
    };
    for (decoration, id) in [(number::NON_WRITABLE, "non-writable"), (number::NON_READABLE, "non-readable")] {
        let decorate = |a: &mut Assembler| {
            a.op(Opcode::Decorate, &[30, decoration]);
        };
        assert_eq!(broken(&assembled(COMPUTE, decorate, add, body).loaded()), rules([id]));
    }
}

#[test]
fn a_pointer_is_followed_through_the_parameters_of_functions() {
    let decorate = |a: &mut Assembler| {
        a.op(Opcode::Decorate, &[30, number::NON_WRITABLE]);
    };
    let declare = |a: &mut Assembler| {
        a.op(Opcode::TypePointer, &[52, 12, 5]);
        a.op(Opcode::TypeFunction, &[53, 1, 52]);
        a.op(Opcode::Variable, &[52, 30, 12]);
    };
    let body = |a: &mut Assembler| {
        a.op(Opcode::FunctionCall, &[1, 60, 70, 30]);
    };
    let mut a = assembled(COMPUTE, decorate, declare, body);
    a.op(Opcode::Function, &[1, 70, 0, 53]);
    a.op(Opcode::FunctionParameter, &[52, 71]);
    a.op(Opcode::Label, &[72]);
    a.op(Opcode::Store, &[71, 8]);
    a.op(Opcode::Return, &[]);
    a.op(Opcode::FunctionEnd, &[]);
    assert_eq!(broken(&a.loaded()), rules(["non-writable"]));
}

#[test]
fn hit_attributes_and_records_are_only_read() {
    let none = |_: &mut Assembler| ();
    assert_eq!(with_block(CLOSEST_HIT, storage::HIT_ATTRIBUTE, none, store), rules(["attr-readonly"]));
    assert_eq!(with_block(INTERSECTION, storage::HIT_ATTRIBUTE, none, store), rules([]));
    let copy = |a: &mut Assembler| {
        a.op(Opcode::CopyMemory, &[31, 31]);
    };
    assert_eq!(with_block(CLOSEST_HIT, storage::HIT_ATTRIBUTE, none, copy), rules(["attr-readonly"]));
    assert_eq!(with_block(MISS, storage::SHADER_RECORD_BUFFER, block, store), rules(["record-block"]));
    assert_eq!(with_block(MISS, storage::SHADER_RECORD_BUFFER, block, load), rules([]));
    assert_eq!(with_block(MISS, storage::SHADER_RECORD_BUFFER, none, load), rules(["record-block"]));
}

#[test]
fn only_variables_without_another_source_have_an_initializer() {
    for (class, wanted) in [
        (storage::PRIVATE, rules([])),
        (storage::RAY_PAYLOAD, rules(["interface-initializer"])),
        (storage::CALLABLE_DATA, rules(["interface-initializer"])),
    ] {
        let declare = |a: &mut Assembler| {
            a.op(Opcode::TypePointer, &[52, class, 5]);
            a.op(Opcode::Variable, &[52, 30, class, 8]);
        };
        let body = |a: &mut Assembler| {
            a.op(Opcode::Load, &[5, 60, 30]);
        };
        assert_eq!(broken(&assembled(RAY_GENERATION, |_| (), declare, body).loaded()), wanted);
    }
}

#[test]
fn locations_stand_on_interfaces() {
    let found = |class: u32, builtin: Option<u32>| {
        let decorate = |a: &mut Assembler| {
            a.op(Opcode::Decorate, &[30, number::LOCATION, 0]);
            if let Some(builtin) = builtin {
                a.op(Opcode::Decorate, &[30, number::BUILT_IN, builtin]);
            }
        };
        let declare = |a: &mut Assembler| {
            a.op(Opcode::TypePointer, &[52, class, 5]);
            a.op(Opcode::Variable, &[52, 30, class]);
        };
        let body = |a: &mut Assembler| {
            a.op(Opcode::Load, &[5, 60, 30]);
        };
        broken(&assembled(RAY_GENERATION, decorate, declare, body).loaded())
    };
    assert_eq!(found(storage::RAY_PAYLOAD, None), rules([]));
    assert_eq!(found(storage::PRIVATE, None), rules(["payload-location"]));
    assert_eq!(found(storage::INPUT, Some(5319)), rules(["payload-location"]));
}

#[test]
fn fast_math_modes_fit_each_other() {
    // `ContractionOff`, `SignedZeroInfNanPreserve`, `FPFastMathDefault`
    const OFF: u32 = 31;
    const PRESERVE: u32 = 4461;
    const DEFAULT: u32 = 6028;
    let found = |mode: u32, before: fn(&mut Assembler)| {
        let decorate = |a: &mut Assembler| {
            a.op(Opcode::ExecutionModeId, &[40, DEFAULT, 6, 48]);
            before(a);
        };
        let declare = |a: &mut Assembler| {
            a.op(Opcode::Constant, &[5, 48, mode]);
            a.op(Opcode::Constant, &[6, 49, 0]);
        };
        let body = |a: &mut Assembler| {
            a.op(Opcode::FAdd, &[6, 60, 49, 49]);
        };
        broken(&assembled(COMPUTE, decorate, declare, body).loaded())
    };
    let none: fn(&mut Assembler) = |_| ();
    let broken = rules(["fastmath-modes"]);
    let with: [fn(&mut Assembler); 4] = [
        |a| {
            a.op(Opcode::ExecutionMode, &[40, OFF]);
        },
        |a| {
            a.op(Opcode::ExecutionMode, &[40, PRESERVE, 32]);
        },
        |a| {
            a.op(Opcode::Decorate, &[60, number::FP_FAST_MATH_MODE, 0x10]);
        },
        |a| {
            a.op(Opcode::Decorate, &[60, number::FP_FAST_MATH_MODE, 0x3]);
        },
    ];
    assert_eq!(found(0x7_0000, none), rules([]));
    assert_eq!(found(0x5_0000, none), broken);
    assert_eq!(with.map(|before| found(0, before) == broken), [true, true, true, false]);
}

#[test]
fn the_component_of_a_gather_is_a_constant() {
    let found = |component: u32| {
        let declare = |a: &mut Assembler| {
            a.op(Opcode::TypeImage, &[80, 6, 1, 0, 0, 0, 1, 0]);
            a.op(Opcode::TypeSampledImage, &[81, 80]);
            a.op(Opcode::TypePointer, &[82, 0, 81]);
            a.op(Opcode::Variable, &[82, 30, 0]);
            a.op(Opcode::TypeVector, &[83, 6, 4]);
            a.op(Opcode::TypeVector, &[84, 6, 2]);
            a.op(Opcode::ConstantNull, &[84, 85]);
        };
        let body = |a: &mut Assembler| {
            a.op(Opcode::Load, &[81, 60, 30]);
            a.op(Opcode::IAdd, &[5, 62, 8, 8]);
            a.op(Opcode::ImageGather, &[83, 61, 60, 85, component]);
        };
        broken(&assembled(COMPUTE, |_| (), declare, body).loaded())
    };
    assert_eq!(found(8), rules([]));
    assert_eq!(found(62), rules(["gather-component"]));
}

#[test]
fn a_texel_without_samples_is_pointed_to_with_sample_zero() {
    let found = |multisampled: u32, sample: u32| {
        let declare = |a: &mut Assembler| {
            a.op(Opcode::Constant, &[5, 47, 0]);
            a.op(Opcode::Constant, &[5, 48, 1]);
            a.op(Opcode::TypeImage, &[80, 5, 1, 0, 0, multisampled, 2, 33]);
            a.op(Opcode::TypePointer, &[82, 0, 80]);
            a.op(Opcode::Variable, &[82, 30, 0]);
            a.op(Opcode::TypeVector, &[83, 5, 2]);
            a.op(Opcode::ConstantNull, &[83, 84]);
            // Image
            a.op(Opcode::TypePointer, &[85, 11, 5]);
        };
        let body = |a: &mut Assembler| {
            a.op(Opcode::ImageTexelPointer, &[85, 61, 30, 84, sample]);
        };
        broken(&assembled(COMPUTE, |_| (), declare, body).loaded())
    };
    assert_eq!(found(0, 47), rules([]));
    assert_eq!(found(0, 48), rules(["image-sample-operand"]));
    assert_eq!(found(1, 48), rules([]));
}

#[test]
fn the_offset_of_a_sampled_texel_is_a_constant() {
    // Bits of the mask of image operands.
    const LOD: u32 = 0x2;
    const GRAD: u32 = 0x4;
    const CONST_OFFSET: u32 = 0x8;
    const OFFSET: u32 = 0x10;
    let found = |opcode: Opcode, operands: &[u32]| {
        let declare = |a: &mut Assembler| {
            a.op(Opcode::TypeImage, &[80, 6, 1, 0, 0, 0, 1, 0]);
            a.op(Opcode::TypeSampledImage, &[81, 80]);
            a.op(Opcode::TypePointer, &[82, 0, 81]);
            a.op(Opcode::Variable, &[82, 30, 0]);
            a.op(Opcode::TypeVector, &[83, 6, 4]);
            a.op(Opcode::TypeVector, &[84, 6, 2]);
            a.op(Opcode::ConstantNull, &[84, 85]);
            a.op(Opcode::ConstantNull, &[6, 86]);
            a.op(Opcode::TypeVector, &[87, 4, 2]);
            a.op(Opcode::ConstantNull, &[87, 88]);
        };
        let body = |a: &mut Assembler| {
            a.op(Opcode::Load, &[81, 60, 30]);
            a.op(Opcode::IAdd, &[87, 62, 88, 88]);
            a.op(opcode, &[&[83, 61, 60, 85], operands].concat());
        };
        broken(&assembled(COMPUTE, |_| (), declare, body).loaded())
    };
    let sample = Opcode::ImageSampleExplicitLod;
    assert_eq!(found(sample, &[LOD | CONST_OFFSET, 86, 88]), rules([]));
    assert_eq!(found(sample, &[LOD | OFFSET, 86, 88]), rules([]));
    assert_eq!(found(sample, &[LOD | OFFSET, 86, 62]), rules(["image-offset"]));
    assert_eq!(found(sample, &[GRAD | OFFSET, 85, 85, 62]), rules(["image-offset"]));
    assert_eq!(
        found(Opcode::ImageSampleDrefExplicitLod, &[86, LOD | OFFSET, 86, 62]),
        rules(["image-offset"])
    );
    // Gathers take any offset.
    assert_eq!(found(Opcode::ImageDrefGather, &[86, OFFSET, 62]), rules([]));
}

#[test]
fn addresses_are_converted_to_and_from_64_bits() {
    let found = |convert: fn(&mut Assembler)| {
        let mut a = Assembler::bare(1000);
        // Shader, Int64, PhysicalStorageBufferAddresses
        [1, 11, 5347].into_iter().for_each(|capability| _ = a.op(Opcode::Capability, &[capability]));
        a.op(Opcode::MemoryModel, &[5348, 1]);
        a.with_string(Opcode::EntryPoint, &[COMPUTE, 40], "main", &[]);
        a.types();
        a.op(Opcode::TypeInt, &[50, 64, 0]);
        a.op(Opcode::TypePointer, &[51, 5349, 5]);
        a.op(Opcode::ConstantNull, &[50, 52]);
        a.function(40, 41, |a| {
            convert(a);
            a.op(Opcode::Return, &[]);
        });
        broken(&a.loaded())
    };
    let both_ways = |a: &mut Assembler| {
        a.op(Opcode::ConvertUToPtr, &[51, 60, 52]);
        a.op(Opcode::ConvertPtrToU, &[50, 61, 60]);
    };
    assert_eq!(found(both_ways), rules([]));
    let from_narrow = |a: &mut Assembler| {
        a.op(Opcode::ConvertUToPtr, &[51, 60, 8]);
    };
    assert_eq!(found(from_narrow), rules(["pointer-convert"]));
    let to_narrow = |a: &mut Assembler| {
        a.op(Opcode::ConvertUToPtr, &[51, 60, 52]);
        a.op(Opcode::ConvertPtrToU, &[5, 61, 60]);
    };
    assert_eq!(found(to_narrow), rules(["pointer-convert"]));
}

#[test]
fn with_the_vulkan_memory_model_loads_of_changing_builtins_are_volatile() {
    let found = |stage: u32, access: &[u32]| {
        let mut a = Assembler::bare(1000);
        a.op(Opcode::Capability, &[1]);
        a.op(Opcode::Capability, &[5345]);
        a.op(Opcode::MemoryModel, &[0, 3]);
        a.with_string(Opcode::EntryPoint, &[stage, 40], "main", &[30]);
        // SubgroupLocalInvocationId
        a.op(Opcode::Decorate, &[30, number::BUILT_IN, 41]);
        a.types();
        a.op(Opcode::TypePointer, &[52, 1, 5]);
        a.op(Opcode::Variable, &[52, 30, 1]);
        a.function(40, 41, |a| {
            a.op(Opcode::Load, &[&[5, 60, 30], access].concat());
            a.op(Opcode::Return, &[]);
        });
        broken(&a.loaded())
    };
    assert_eq!(found(RAY_GENERATION, &[]), rules(["volatile-load"]));
    assert_eq!(found(RAY_GENERATION, &[1]), rules([]));
    assert_eq!(found(COMPUTE, &[]), rules([]));
}

/// The rules that a barrier or atomic instruction breaks.
fn ordered(stage: u32, opcode: Opcode, scope: u32, semantics: &[u32]) -> SortedSet<&'static str> {
    let declare = |a: &mut Assembler| {
        a.op(Opcode::Constant, &[5, 49, scope]);
        for (at, &bits) in semantics.iter().enumerate() {
            a.op(Opcode::Constant, &[5, 50 + at as u32, bits]);
        }
        a.op(Opcode::TypePointer, &[60, 12, 5]);
        a.op(Opcode::Variable, &[60, 30, 12]);
    };
    let body = |a: &mut Assembler| {
        match opcode {
            Opcode::MemoryBarrier => a.op(opcode, &[49, 50]),
            Opcode::ControlBarrier => a.op(opcode, &[49, 49, 50]),
            Opcode::AtomicLoad => a.op(opcode, &[5, 70, 30, 49, 50]),
            Opcode::AtomicStore => a.op(opcode, &[30, 49, 50, 8]),
            Opcode::AtomicCompareExchange => a.op(opcode, &[5, 70, 30, 49, 50, 51, 8, 8]),
            _ => a.op(opcode, &[5, 70, 30, 49, 50, 8]),
        };
    };
    broken(&assembled(stage, |_| (), declare, body).loaded())
}

#[test]
fn semantics_have_an_order_and_a_class_or_neither() {
    const ACQUIRE: u32 = 2;
    const RELEASE: u32 = 4;
    const BOTH: u32 = 8;
    const SEQUENTIAL: u32 = 16;
    const UNIFORM: u32 = 64;
    const SHARED: u32 = 256;
    const AVAILABLE: u32 = 0x2000;
    const VISIBLE: u32 = 0x4000;
    const VOLATILE: u32 = 0x8000;
    let found = |opcode: Opcode, semantics: &[u32]| !ordered(COMPUTE, opcode, 1, semantics).is_empty();
    for (opcode, semantics, breaks) in [
        (Opcode::MemoryBarrier, BOTH | UNIFORM, false),
        (Opcode::MemoryBarrier, ACQUIRE | RELEASE | UNIFORM, true),
        (Opcode::MemoryBarrier, SEQUENTIAL | UNIFORM, true),
        (Opcode::MemoryBarrier, 0, true),
        (Opcode::MemoryBarrier, BOTH, true),
        (Opcode::ControlBarrier, 0, false),
        (Opcode::ControlBarrier, UNIFORM, true),
        (Opcode::ControlBarrier, BOTH | UNIFORM | VOLATILE, true),
        (Opcode::AtomicIAdd, 0, false),
        (Opcode::AtomicIAdd, ACQUIRE, true),
        (Opcode::AtomicIAdd, RELEASE | UNIFORM | AVAILABLE, false),
        (Opcode::AtomicIAdd, ACQUIRE | UNIFORM | AVAILABLE, true),
        (Opcode::AtomicIAdd, RELEASE | UNIFORM | VISIBLE, true),
        (Opcode::AtomicIAdd, VOLATILE, false),
        (Opcode::AtomicStore, RELEASE | UNIFORM, false),
        (Opcode::AtomicStore, BOTH | UNIFORM, true),
        (Opcode::AtomicLoad, ACQUIRE | UNIFORM, false),
        (Opcode::AtomicLoad, RELEASE | UNIFORM, true),
    ] {
        assert_eq!(found(opcode, &[semantics]), breaks, "{opcode:?} {semantics:#x}");
    }
    for (equal, unequal, breaks) in [
        (BOTH | UNIFORM, ACQUIRE | UNIFORM, false),
        (BOTH | UNIFORM, 0, false),
        (BOTH | UNIFORM, RELEASE | UNIFORM, true),
        (0, ACQUIRE | UNIFORM, true),
        (BOTH | UNIFORM, ACQUIRE | UNIFORM | SHARED, true),
        (BOTH | UNIFORM, ACQUIRE | UNIFORM | VISIBLE, true),
        (VOLATILE, 0, true),
    ] {
        let found = found(Opcode::AtomicCompareExchange, &[equal, unequal]);
        assert_eq!(found, breaks, "{equal:#x} {unequal:#x}");
    }
}

#[test]
fn scopes_are_those_of_the_stage() {
    let add = |stage: u32, scope: u32| ordered(stage, Opcode::AtomicIAdd, scope, &[0]);
    // Device, Workgroup, Subgroup, Invocation, ShaderCallKHR
    for (scope, compute, rays) in [
        (1, true, true),
        (2, true, false),
        (3, true, true),
        (4, true, true),
        (6, false, true),
        (0, false, false),
    ] {
        let wanted = |allowed: bool| if allowed { rules([]) } else { rules(["memory-scope"]) };
        assert_eq!(add(COMPUTE, scope), wanted(compute), "scope {scope}");
        assert_eq!(add(MISS, scope), wanted(rays), "scope {scope}");
    }
    // QueueFamily
    assert_eq!(add(COMPUTE, 5), rules(["memory-scope"]));
    assert_eq!(ordered(COMPUTE, Opcode::AtomicIAdd, 4, &[0x48]), rules(["invocation-scope"]));
    assert_eq!(ordered(COMPUTE, Opcode::MemoryBarrier, 4, &[0x48]), rules(["invocation-scope"]));
}

#[test]
fn atomic_instructions_access_what_several_invocations_reach() {
    let add = |a: &mut Assembler| {
        // Of scope Subgroup, and relaxed.
        a.op(Opcode::AtomicIAdd, &[5, 60, 31, 8, 49, 8]);
    };
    assert_eq!(with_block(COMPUTE, storage::STORAGE_BUFFER, block, add), rules([]));
    assert_eq!(with_block(COMPUTE, storage::WORKGROUP, |_| (), add), rules([]));
    assert_eq!(with_block(COMPUTE, storage::PRIVATE, |_| (), add), rules(["atomic-class"]));
}

#[test]
fn structures_are_loaded_from_descriptors() {
    let found = |class: Option<u32>| {
        let mut a = Assembler::bare(1000);
        for capability in [1, 4472] {
            a.op(Opcode::Capability, &[capability]);
        }
        a.op(Opcode::MemoryModel, &[0, 1]);
        a.with_string(Opcode::EntryPoint, &[COMPUTE, 40], "main", &[]);
        a.types();
        a.op(Opcode::TypeAccelerationStructureKHR, &[50]);
        a.op(Opcode::TypeRayQueryKHR, &[51]);
        a.op(Opcode::TypePointer, &[52, storage::PRIVATE, 51]);
        a.op(Opcode::Variable, &[52, 30, storage::PRIVATE]);
        match class {
            None => {
                a.op(Opcode::Undef, &[50, 60]);
            }
            Some(class) => {
                a.op(Opcode::TypePointer, &[53, class, 50]);
                a.op(Opcode::Variable, &[53, 31, class]);
            }
        }
        a.function(40, 41, |a| {
            if class.is_some() {
                a.op(Opcode::Load, &[50, 60, 31]);
            }
            a.op(Opcode::RayQueryInitializeKHR, &[30, 60, 8, 8, 8, 8, 8, 8]);
            a.op(Opcode::Return, &[]);
        });
        broken(&a.loaded())
    };
    assert_eq!(found(Some(storage::UNIFORM_CONSTANT)), rules([]));
    assert_eq!(found(Some(storage::PRIVATE)), rules(["as-load-source"]));
    assert_eq!(found(None), rules(["as-load-source"]));
}

#[test]
fn a_hint_has_the_bits_that_it_says() {
    let found = |hint: u32, bits: u32| {
        let declare = |a: &mut Assembler| {
            a.op(Opcode::Constant, &[5, 50, hint]);
            a.op(Opcode::Constant, &[5, 51, bits]);
        };
        let body = |a: &mut Assembler| {
            a.op(Opcode::ReorderThreadWithHintEXT, &[50, 51]);
        };
        broken(&assembled(RAY_GENERATION, |_| (), declare, body).loaded())
    };
    for (hint, bits, breaks) in
        [(7, 3, false), (8, 3, true), (0, 0, false), (1, 0, true), (u32::MAX, 32, false), (0, 33, true)]
    {
        let wanted = if breaks { rules(["reorder-hint-bits"]) } else { rules([]) };
        assert_eq!(found(hint, bits), wanted, "{hint} {bits}");
    }
}
