//! Damaged modules that still load are lowered and run, or refused with an error: never a panic.

use std::path::Path;
use std::sync::Arc;

use anyhit_engine::machine::{Bindings, Mask, Resources, Stop};
use anyhit_engine::program::lower;
use anyhit_engine::{interp, module};

use crate::support::{assembly, files};

/// The generator SplitMix64 (Steele, Lea and Flood, 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }
}

/// Changes a few words behind the header: another word of the module, a small number, a bit.
fn damage(words: &mut [u32], random: &mut Random) {
    for _ in 0..1 + random.below(3) {
        let at = 5 + random.below(words.len() - 5);
        words[at] = match random.below(4) {
            0 => words[5 + random.below(words.len() - 5)],
            1 => random.below(300) as u32,
            2 => words[at] ^ 1 << random.below(32),
            _ => words[at].wrapping_add(1),
        };
    }
}

/// Runs what can be run; gives whether it was lowered.
fn try_all(bytes: &[u8]) -> bool {
    let Ok(module) = module::load(bytes) else { return false };
    let module = Arc::new(module);
    let mut lowered = false;
    for entry in &module.entry_points {
        let Ok(program) = lower(&module, entry) else { continue };
        lowered = true;
        if program.register_count > 20_000 {
            continue;
        }
        let bindings: Bindings = Resources::default().bindings(program.bindings());
        let mut batch = program.batch::<64>();
        program.begin(&mut batch, Mask::first(5), 20_000);
        for _ in 0..64 {
            if interp::run(&mut batch, &program, &bindings, &mut ()) == Stop::Done {
                break;
            }
        }
    }
    lowered
}

#[test]
fn damaged_modules_are_run_or_refused() {
    let cases = std::env::var("ANYHIT_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(60);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures");
    let mut random = Random(7);
    let mut lowered = 0;
    let mut damaged = 0;
    let mut panicked = Vec::new();
    for path in files::with_extension(&root, "spv") {
        let bytes = std::fs::read(&path).expect("a readable fixture");
        let words: Vec<u32> = bytes
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
            .collect();
        for case in 0..cases {
            let mut copy = words.clone();
            damage(&mut copy, &mut random);
            let bytes: Vec<u8> = copy.iter().flat_map(|word| word.to_le_bytes()).collect();
            match std::panic::catch_unwind(|| try_all(&bytes)) {
                Ok(ok) => lowered += usize::from(ok),
                Err(_) => panicked.push(format!("{} case {case}", path.display())),
            }
            damaged += 1;
        }
    }
    assert!(panicked.is_empty(), "{}", panicked.join("\n"));
    // The damage is mild enough that the interesting half is reached.
    assert!(lowered * 10 > damaged, "only {lowered} of {damaged} damaged modules could be lowered");
}

/// The merge block of an endless loop is lowered though control never comes to it, and may name
/// what another such block computes: only a use that control comes to must be dominated (SPIR-V,
/// 2.16.1).
#[test]
fn what_control_never_comes_to_needs_no_value() {
    let bytes = assembly::assemble(
        "OpCapability Shader
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %main \"main\"
        OpExecutionMode %main LocalSize 1 1 1
        %void = OpTypeVoid
        %proc = OpTypeFunction %void
        %uint = OpTypeInt 32 0
        %three = OpConstant %uint 3
        %main = OpFunction %void None %proc
        %entry = OpLabel
        OpBranch %header
        %header = OpLabel
        OpLoopMerge %merge %continue None
        OpBranch %continue
        %dead = OpLabel
        %sum = OpIAdd %uint %three %three
        OpBranch %continue
        %continue = OpLabel
        OpBranch %header
        %merge = OpLabel
        %other = OpIAdd %uint %sum %three
        OpReturn
        OpFunctionEnd",
    );
    let module = Arc::new(module::load(&bytes).expect("a valid module"));
    let _ = lower(&module, &module.entry_points[0]).expect("a valid module");
    let reached: Vec<bool> = (0..5).map(|block| module.reaches(0, block)).collect();
    assert_eq!(reached, [true, true, false, true, false]);
}
