//! What machine code made by Cranelift could do for the arithmetic row: the loop of
//! `shaders/bench/arithmetic.rgen` over four pixels at a time (its vectors have 128 bits), beside
//! the same formulas as Rust compiles them.
//!
//! A prototype to decide by, not a part of the crate: what it makes is called through a pointer,
//! which is unsafe, and nothing here checks anything.

use std::hint::black_box;
use std::time::Instant;

use cranelift::codegen::ir::immediates::V128Imm;
use cranelift::prelude::*;
use cranelift_jit::{JITBuilder, JITModule};
use cranelift_module::{Linkage, Module};

const PIXELS: usize = 512 * 384;
const WIDTH: usize = 512;
const OCTAVES: i64 = 32;

/// Builds the shader's loop from vectors.
struct Shader<'a, 'b> {
    builder: &'a mut FunctionBuilder<'b>,
}

impl Shader<'_, '_> {
    fn float(&mut self, value: f32) -> Value {
        let one = self.builder.ins().f32const(value);
        self.builder.ins().splat(types::F32X4, one)
    }

    fn int(&mut self, value: u32) -> Value {
        let one = self.builder.ins().iconst(types::I32, i64::from(value));
        self.builder.ins().splat(types::I32X4, one)
    }

    fn shifted(&mut self, x: Value, by: i64) -> Value {
        let moved = self.builder.ins().ushr_imm(x, by);
        self.builder.ins().bxor(x, moved)
    }

    fn unit_interval(&mut self, x: Value) -> Value {
        let (first, second) = (self.int(0x7FEB_352D), self.int(0x846C_A68B));
        let x = self.shifted(x, 16);
        let x = self.builder.ins().imul(x, first);
        let x = self.shifted(x, 15);
        let x = self.builder.ins().imul(x, second);
        let x = self.shifted(x, 16);
        let x = self.builder.ins().ushr_imm(x, 8);
        // Below 2^24: the signed cast is the same.
        let x = self.builder.ins().fcvt_from_sint(types::F32X4, x);
        let scale = self.float(1.0 / 16_777_216.0);
        self.builder.ins().fmul(x, scale)
    }

    fn mix(&mut self, a: Value, b: Value, t: Value) -> Value {
        let one = self.float(1.0);
        let rest = self.builder.ins().fsub(one, t);
        let (a, b) = (self.builder.ins().fmul(a, rest), self.builder.ins().fmul(b, t));
        self.builder.ins().fadd(a, b)
    }

    fn noise(&mut self, at: [Value; 3]) -> Value {
        const STEP: [u32; 3] = [0x9E37_79B1, 0x85EB_CA77, 0xC2B2_AE3D];
        let base = at.map(|x| self.builder.ins().floor(x));
        let inside = [0, 1, 2].map(|k| {
            let x = self.builder.ins().fsub(at[k], base[k]);
            let (two, three) = (self.float(2.0), self.float(3.0));
            let twice = self.builder.ins().fmul(two, x);
            let rest = self.builder.ins().fsub(three, twice);
            let square = self.builder.ins().fmul(x, x);
            self.builder.ins().fmul(square, rest)
        });
        let cell = [0, 1, 2].map(|k| {
            let whole = self.builder.ins().fcvt_to_sint_sat(types::I32X4, base[k]);
            let step = self.int(STEP[k]);
            self.builder.ins().imul(whole, step)
        });
        let low = self.builder.ins().iadd(cell[0], cell[1]);
        let low = self.builder.ins().iadd(low, cell[2]);
        let corner = |shader: &mut Self, bits: u32| {
            let offset = (0..3).filter(|k| bits >> k & 1 != 0).fold(0u32, |sum, k| sum.wrapping_add(STEP[k]));
            let offset = shader.int(offset);
            let x = shader.builder.ins().iadd(low, offset);
            shader.unit_interval(x)
        };
        let mut planes = [low; 2];
        for (z, plane) in planes.iter_mut().enumerate() {
            let z = (z as u32) << 2;
            let (a, b) = (corner(self, z), corner(self, z | 1));
            let bottom = self.mix(a, b, inside[0]);
            let (a, b) = (corner(self, z | 2), corner(self, z | 3));
            let top = self.mix(a, b, inside[0]);
            *plane = self.mix(bottom, top, inside[1]);
        }
        self.mix(planes[0], planes[1], inside[2])
    }
}

/// fn(out: *mut f32, count of pixels)
fn build(module: &mut JITModule) -> cranelift_module::FuncId {
    let mut context = module.make_context();
    let pointer = module.target_config().pointer_type();
    context.func.signature.params.extend([AbiParam::new(pointer), AbiParam::new(types::I64)]);
    let mut memory = FunctionBuilderContext::new();
    let mut builder = FunctionBuilder::new(&mut context.func, &mut memory);
    let [entry, pixels, octaves, after, end] = [(); 5].map(|()| builder.create_block());
    builder.append_block_params_for_function_params(entry);
    builder.switch_to_block(entry);
    let (out, count) = (builder.block_params(entry)[0], builder.block_params(entry)[1]);
    let zero = builder.ins().iconst(types::I64, 0);
    builder.ins().jump(pixels, &[zero.into()]);

    let index = builder.append_block_param(pixels, types::I64);
    builder.switch_to_block(pixels);
    let x = builder.ins().band_imm(index, WIDTH as i64 - 1);
    let y = builder.ins().ushr_imm(index, i64::from(WIDTH.trailing_zeros()));
    let [x, y] = [x, y].map(|one| {
        let one = builder.ins().ireduce(types::I32, one);
        builder.ins().splat(types::I32X4, one)
    });
    let lanes: Vec<u8> = (0u32..4).flat_map(u32::to_le_bytes).collect();
    let lanes = builder.func.dfg.constants.insert(V128Imm::from(&lanes[..]).into());
    let lanes = builder.ins().vconst(types::I32X4, lanes);
    let x = builder.ins().iadd(x, lanes);
    let mut shader = Shader { builder: &mut builder };
    let scale = shader.float(0.01);
    let (none, half) = (shader.float(0.0), shader.float(0.5));
    let [x, y] = [x, y].map(|one| {
        let one = builder.ins().fcvt_from_sint(types::F32X4, one);
        builder.ins().fmul(one, scale)
    });
    builder.ins().jump(octaves, &[zero.into(), x.into(), y.into(), none.into(), half.into(), none.into()]);

    let octave = builder.append_block_param(octaves, types::I64);
    let [x, y, z, weight, sum] = [(); 5].map(|()| builder.append_block_param(octaves, types::F32X4));
    builder.switch_to_block(octaves);
    let mut shader = Shader { builder: &mut builder };
    let noise = shader.noise([x, y, z]);
    let (grow, less) = (shader.float(1.02), shader.float(0.9));
    let shift = [1.7, 9.2, 3.1].map(|one| shader.float(one));
    let part = builder.ins().fmul(weight, noise);
    let sum = builder.ins().fadd(sum, part);
    let next = [z, x, y];
    let next = [0, 1, 2].map(|k| {
        let scaled = builder.ins().fmul(next[k], grow);
        builder.ins().fadd(scaled, shift[k])
    });
    let weight = builder.ins().fmul(weight, less);
    let octave = builder.ins().iadd_imm(octave, 1);
    let more = builder.ins().icmp_imm(IntCC::UnsignedLessThan, octave, OCTAVES);
    let again = [octave.into(), next[0].into(), next[1].into(), next[2].into(), weight.into(), sum.into()];
    builder.ins().brif(more, octaves, &again, after, &[]);

    builder.switch_to_block(after);
    let offset = builder.ins().ishl_imm(index, 2);
    let place = builder.ins().iadd(out, offset);
    builder.ins().store(MemFlags::new(), sum, place, 0);
    let index = builder.ins().iadd_imm(index, 4);
    let more = builder.ins().icmp(IntCC::UnsignedLessThan, index, count);
    builder.ins().brif(more, pixels, &[index.into()], end, &[]);
    builder.switch_to_block(end);
    builder.ins().return_(&[]);
    builder.seal_all_blocks();
    builder.finalize();
    let id = module.declare_function("shader", Linkage::Export, &context.func.signature).expect("a new name");
    module.define_function(id, &mut context).expect("valid code");
    id
}

/// One pixel of the picture, computed by hand-written Rust.
fn reference(x: f32, y: f32) -> f32 {
    fn unit(mut x: u32) -> f32 {
        x ^= x >> 16;
        x = x.wrapping_mul(0x7FEB_352D);
        x ^= x >> 15;
        x = x.wrapping_mul(0x846C_A68B);
        ((x ^ x >> 16) >> 8) as f32 * (1.0 / 16_777_216.0)
    }
    const STEP: [u32; 3] = [0x9E37_79B1, 0x85EB_CA77, 0xC2B2_AE3D];
    let mix = |a: f32, b: f32, t: f32| a * (1.0 - t) + b * t;
    let (mut at, mut weight, mut sum) = ([x * 0.01, y * 0.01, 0.0], 0.5f32, 0.0f32);
    for _ in 0..OCTAVES {
        let base = at.map(f32::floor);
        let inside = [0, 1, 2].map(|k| {
            let x = at[k] - base[k];
            x * x * (3.0 - 2.0 * x)
        });
        let low = (0..3).fold(0u32, |sum, k| sum.wrapping_add((base[k] as i32 as u32).wrapping_mul(STEP[k])));
        let corner = |bits: u32| {
            unit((0..3).filter(|k| bits >> k & 1 != 0).fold(low, |sum, k| sum.wrapping_add(STEP[k])))
        };
        let plane = |z: u32| {
            let bottom = mix(corner(z), corner(z | 1), inside[0]);
            mix(bottom, mix(corner(z | 2), corner(z | 3), inside[0]), inside[1])
        };
        sum += weight * mix(plane(0), plane(4), inside[2]);
        at = [at[2] * 1.02 + 1.7, at[0] * 1.02 + 9.2, at[1] * 1.02 + 3.1];
        weight *= 0.9;
    }
    sum
}

fn main() {
    let begin = Instant::now();
    let mut flags = settings::builder();
    flags.set("opt_level", "speed").expect("a known setting");
    let isa = cranelift_native::builder().expect("a known processor");
    let isa = isa.finish(settings::Flags::new(flags)).expect("valid flags");
    let mut module = JITModule::new(JITBuilder::with_isa(isa, cranelift_module::default_libcall_names()));
    let id = build(&mut module);
    module.finalize_definitions().expect("memory that may run");
    println!("to compile it: {:.2} ms", begin.elapsed().as_secs_f64() * 1e3);
    let code = module.get_finalized_function(id);
    // SAFETY: `build` made a function of this signature, and writes `count` numbers from `out` on.
    let shader: extern "C" fn(*mut f32, u64) = unsafe { std::mem::transmute(code) };
    let mut out = vec![0.0f32; PIXELS];
    let mut times = Vec::new();
    for _ in 0..9 {
        let begin = Instant::now();
        shader(black_box(out.as_mut_ptr()), PIXELS as u64);
        times.push(begin.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    let wrong = (0..PIXELS)
        .step_by(97)
        .filter(|&at| out[at].to_bits() != reference((at % WIDTH) as f32, (at / WIDTH) as f32).to_bits());
    println!("{:.2} Mpixels a second, {} wrong", PIXELS as f64 / times[4] / 1e6, wrong.count());
}
