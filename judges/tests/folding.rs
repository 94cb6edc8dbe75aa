//! SPIRV-Tools folds instructions on constants with an implementation of its own: what it folds
//! must have our bits. Each instruction runs here on edge values, decorated NoContraction, its
//! operands once as constants, once read from buffers. SPIRV-Tools is given the constants without
//! the decoration: it folds no decorated float, and an instruction by itself has nothing to be
//! contracted with.
//!
//! Where the specification leaves a result undefined, or open as that of an elementary function is,
//! the two may differ: such inputs are not drawn, such functions are counted and told. Where
//! SPIRV-Tools is known to differ, [`excuse`] says in what and why; these are counted and told,
//! too.

#[path = "../../tests/support/assembly.rs"]
mod assembly;

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{BatchWidth, Compute, RunOptions};
use anyhit_judges::{Recipe, optimise, words};
use rspirv::dr::{Module, Operand};
use rspirv::spirv::Op;

use crate::assembly::assemble;

/// A scalar type of SPIR-V.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Type {
    Bool,
    Int(u32),
    Uint(u32),
    Float(u32),
}

use Type::{Bool, Float, Int, Uint};

impl Type {
    fn width(self) -> u32 {
        match self {
            Bool => 32,
            Int(width) | Uint(width) | Float(width) => width,
        }
    }

    /// Its name in the modules here; a result that is a bool is stored as a uint.
    fn name(self) -> String {
        match self {
            Bool => "bool".into(),
            Int(width) => format!("i{width}"),
            Uint(width) => format!("u{width}"),
            Float(width) => format!("f{width}"),
        }
    }

    fn mask(self) -> u64 {
        u64::MAX >> (64 - self.width())
    }

    /// The bits of edge values.
    fn edges(self) -> Vec<u64> {
        let width = self.width();
        let half = 1u64 << (width - 1);
        match self {
            Bool => vec![0, 1],
            Int(_) | Uint(_) => {
                let mut values = vec![0, 1, 2, 3, 7, u64::from(width) - 1, half - 1, half, half + 1];
                values.extend([u64::MAX, u64::MAX - 1, u64::MAX - 6, 0x55, 0xA5A5_A5A5_A5A5_A5A5]);
                values.iter().map(|value| value & self.mask()).collect()
            }
            Float(_) => {
                let fraction = match width {
                    16 => 10,
                    32 => 23,
                    _ => 52,
                };
                let infinity = half - (1 << fraction);
                let one = infinity / 2 & !((1 << fraction) - 1) | (infinity >> 1) & (1 << fraction);
                let one = if width == 16 { 0x3C00 } else { one };
                let positive = [
                    0,
                    1,
                    (1 << fraction) - 1,
                    1 << fraction,
                    one,
                    one + 1,
                    one - 1,
                    // 1.5, 2, 2.5, 3, 0.5
                    one + (1 << (fraction - 1)),
                    one + (1 << fraction),
                    one + (5 << (fraction - 2)),
                    one + (3 << (fraction - 1)),
                    one - (1 << fraction),
                    // 1.1001100... times a small power
                    one + (3 << fraction)
                        + (one & ((1 << fraction) - 1))
                        + (infinity / 5 & ((1 << fraction) - 1)),
                    infinity - 1,
                    infinity,
                ];
                let both = positive.iter().flat_map(|&bits| [bits, bits | half]);
                both.chain([infinity | 1 << (fraction - 1)]).collect()
            }
        }
    }

    fn is_nan(self, bits: u64) -> bool {
        let fraction = match self {
            Float(16) => 10,
            Float(32) => 23,
            Float(64) => 52,
            _ => return false,
        };
        let half = 1u64 << (self.width() - 1);
        bits & (half - 1) > half - (1 << fraction)
    }

    fn number(self, bits: u64) -> f64 {
        match self {
            Float(16) => half::f16::from_bits(bits as u16).to_f64(),
            Float(32) => f32::from_bits(bits as u32).into(),
            _ => f64::from_bits(bits),
        }
    }

    /// The integer that bits stand for.
    fn integer(self, bits: u64) -> i128 {
        let width = self.width();
        match self {
            Int(_) if bits >> (width - 1) != 0 => i128::from(bits) - (1i128 << width),
            _ => bits.into(),
        }
    }
}

/// An instruction at one choice of types.
#[derive(Clone)]
struct Snippet {
    name: String,
    operands: Vec<Type>,
    result: Type,
    /// Lines that define `%r$` from `%a$`, `%b$`, `%c$`; `$` is the input's number.
    code: String,
    /// Whether a result is defined for these operands.
    defined: fn(&[(Type, u64)]) -> bool,
    /// Whether the specification fixes the bits.
    fixed: bool,
}

fn always(_: &[(Type, u64)]) -> bool {
    true
}

fn not_by_zero(operands: &[(Type, u64)]) -> bool {
    let [(ty, a), (_, b)] = operands else { return true };
    // The smallest integer has no negative.
    let overflows = matches!(ty, Int(width) if *a == 1 << (width - 1)) && *b == ty.mask();
    *b != 0 && !overflows
}

fn shift_below_width(operands: &[(Type, u64)]) -> bool {
    operands[1].1 < operands[0].0.width().into()
}

fn no_nan(operands: &[(Type, u64)]) -> bool {
    operands.iter().all(|&(ty, bits)| !ty.is_nan(bits))
}

/// `minVal <= maxVal`
fn ordered_bounds(operands: &[(Type, u64)]) -> bool {
    let [_, (ty, low), (_, high)] = operands else { return true };
    no_nan(operands)
        && match ty {
            Float(_) => ty.number(*low) <= ty.number(*high),
            _ => ty.integer(*low) <= ty.integer(*high),
        }
}

macro_rules! in_range {
    ($($name:ident $low:expr, $high:expr;)*) => {$(
        /// Whether the integer part is one of the type.
        fn $name(operands: &[(Type, u64)]) -> bool {
            let (ty, bits) = operands[0];
            let value = ty.number(bits).trunc();
            value >= $low && value < $high
        }
    )*};
}

in_range! {
    in_i32 -2f64.powi(31), 2f64.powi(31);
    in_u32 0.0, 2f64.powi(32);
    in_i64 -2f64.powi(63), 2f64.powi(63);
    in_u64 0.0, 2f64.powi(64);
}

/// A sum of products whose order of additions and roundings is ours, declared; a judge that rounds
/// otherwise would be as right.
const FIXED: bool = true;
/// An elementary function, or a formula whose rounding the specification leaves open.
const OPEN: bool = false;

fn snippets() -> Vec<Snippet> {
    let mut all = Vec::new();
    let mut add = |name: &str,
                   operands: &[Type],
                   result: Type,
                   fixed: bool,
                   defined: fn(&[(Type, u64)]) -> bool| {
        let arguments: Vec<_> = ["%a$", "%b$", "%c$"][..operands.len()].to_vec();
        let code = match name.strip_prefix("glsl ") {
            Some(name) => format!("%r$ = OpExtInst %{} %glsl {name} {}", result.name(), arguments.join(" ")),
            None => format!("%r$ = Op{name} %{} {}", result.name(), arguments.join(" ")),
        };
        let name = format!("{name} {}", operands.iter().map(|ty| ty.name()).collect::<Vec<_>>().join(" "));
        all.push(Snippet { name, operands: operands.to_vec(), result, code, defined, fixed });
    };
    for width in [8, 16, 32, 64] {
        let (int, uint) = (Int(width), Uint(width));
        for name in ["IAdd", "ISub", "IMul", "BitwiseOr", "BitwiseXor", "BitwiseAnd"] {
            add(name, &[uint, uint], uint, FIXED, always);
        }
        for name in ["UDiv", "UMod"] {
            add(name, &[uint, uint], uint, FIXED, not_by_zero);
        }
        for name in ["SDiv", "SRem", "SMod"] {
            add(name, &[int, int], int, FIXED, not_by_zero);
        }
        for name in ["ShiftRightLogical", "ShiftRightArithmetic", "ShiftLeftLogical"] {
            add(name, &[int, uint], int, FIXED, shift_below_width);
        }
        add("SNegate", &[int], int, FIXED, always);
        add("Not", &[uint], uint, FIXED, always);
        add("BitReverse", &[uint], uint, FIXED, always);
        add("BitCount", &[uint], Uint(32), FIXED, always);
        for name in
            ["IEqual", "INotEqual", "UGreaterThan", "UGreaterThanEqual", "ULessThan", "ULessThanEqual"]
        {
            add(name, &[uint, uint], Bool, FIXED, always);
        }
        for name in ["SGreaterThan", "SGreaterThanEqual", "SLessThan", "SLessThanEqual"] {
            add(name, &[int, int], Bool, FIXED, always);
        }
        for name in ["glsl SMin", "glsl SMax"] {
            add(name, &[int, int], int, FIXED, always);
        }
        for name in ["glsl UMin", "glsl UMax"] {
            add(name, &[uint, uint], uint, FIXED, always);
        }
        add("glsl SClamp", &[int, int, int], int, FIXED, ordered_bounds);
        add("glsl UClamp", &[uint, uint, uint], uint, FIXED, ordered_bounds);
        for name in ["glsl SAbs", "glsl SSign"] {
            add(name, &[int], int, FIXED, always);
        }
        for other in [8, 16, 32, 64] {
            if other != width {
                add("UConvert", &[uint], Uint(other), FIXED, always);
                add("SConvert", &[int], Int(other), FIXED, always);
            }
        }
        for other in [16, 32, 64] {
            add("ConvertSToF", &[int], Float(other), FIXED, always);
            add("ConvertUToF", &[uint], Float(other), FIXED, always);
        }
        add("Select", &[Bool, int, int], int, FIXED, always);
    }
    for name in ["LogicalEqual", "LogicalNotEqual", "LogicalOr", "LogicalAnd"] {
        add(name, &[Bool, Bool], Bool, FIXED, always);
    }
    add("LogicalNot", &[Bool], Bool, FIXED, always);
    for name in ["glsl FindILsb", "glsl FindUMsb"] {
        add(name, &[Uint(32)], Int(32), FIXED, always);
    }
    add("glsl FindSMsb", &[Int(32)], Int(32), FIXED, always);
    add("BitFieldUExtract", &[Uint(32), Uint(32), Uint(32)], Uint(32), FIXED, |operands| {
        operands[1].1 + operands[2].1 <= 32
    });
    add("BitFieldSExtract", &[Int(32), Uint(32), Uint(32)], Int(32), FIXED, |operands| {
        operands[1].1 + operands[2].1 <= 32
    });
    add("QuantizeToF16", &[Float(32)], Float(32), FIXED, always);
    for width in [16, 32, 64] {
        let float = Float(width);
        add("FNegate", &[float], float, FIXED, always);
        for name in ["FAdd", "FSub", "FMul", "FDiv"] {
            add(name, &[float, float], float, FIXED, always);
        }
        for name in ["FRem", "FMod"] {
            add(name, &[float, float], float, OPEN, always);
        }
        for name in [
            "FOrdEqual",
            "FUnordEqual",
            "FOrdNotEqual",
            "FUnordNotEqual",
            "FOrdLessThan",
            "FUnordLessThan",
            "FOrdGreaterThan",
            "FUnordGreaterThan",
            "FOrdLessThanEqual",
            "FUnordLessThanEqual",
            "FOrdGreaterThanEqual",
            "FUnordGreaterThanEqual",
        ] {
            add(name, &[float, float], Bool, FIXED, always);
        }
        for name in ["IsNan", "IsInf"] {
            add(name, &[float], Bool, FIXED, always);
        }
        for other in [16, 32, 64] {
            if other != width {
                add("FConvert", &[float], Float(other), FIXED, always);
            }
        }
        add("ConvertFToS", &[float], Int(32), FIXED, in_i32);
        add("ConvertFToU", &[float], Uint(32), FIXED, in_u32);
        add("ConvertFToS", &[float], Int(64), FIXED, in_i64);
        add("ConvertFToU", &[float], Uint(64), FIXED, in_u64);
        add("Bitcast", &[float], Uint(width), FIXED, no_nan);
        add("Bitcast", &[Int(width)], float, FIXED, always);
        add("Select", &[Bool, float, float], float, FIXED, always);
        for name in ["FAbs", "FSign", "Floor", "Ceil", "Trunc", "RoundEven", "Fract"] {
            add(&format!("glsl {name}"), &[float], float, FIXED, no_nan);
        }
        add("glsl Round", &[float], float, OPEN, no_nan);
        for name in ["FMin", "FMax"] {
            add(&format!("glsl {name}"), &[float, float], float, FIXED, no_nan);
        }
        for name in ["NMin", "NMax"] {
            add(&format!("glsl {name}"), &[float, float], float, FIXED, always);
        }
        add("glsl Step", &[float, float], float, FIXED, no_nan);
        add("glsl FClamp", &[float, float, float], float, FIXED, ordered_bounds);
        add("glsl NClamp", &[float, float, float], float, FIXED, ordered_bounds);
        // x (1 - a) + y a, each rounded: what NoContraction asks for.
        add("glsl FMix", &[float, float, float], float, FIXED, always);
        for name in ["Sqrt", "InverseSqrt"] {
            add(&format!("glsl {name}"), &[float], float, OPEN, no_nan);
        }
        // Of 16 and 32 bits alone.
        if width < 64 {
            for name in [
                "Sin", "Cos", "Tan", "Asin", "Acos", "Atan", "Sinh", "Cosh", "Tanh", "Asinh", "Acosh",
                "Atanh", "Exp", "Exp2", "Log", "Log2", "Radians", "Degrees",
            ] {
                add(&format!("glsl {name}"), &[float], float, OPEN, no_nan);
            }
            for name in ["Pow", "Atan2"] {
                add(&format!("glsl {name}"), &[float, float], float, OPEN, no_nan);
            }
        }
        for name in ["Fma", "SmoothStep"] {
            add(&format!("glsl {name}"), &[float, float, float], float, OPEN, no_nan);
        }
    }
    // Composites and vectors, in terms of scalars.
    let mut composite = |name: &str, ty: Type, operands: usize, code: &str| {
        let code = code.replace('@', &ty.name());
        let operands = vec![ty; operands];
        all.push(Snippet {
            name: format!("{name} {}", ty.name()),
            operands,
            result: ty,
            code,
            defined: no_nan,
            fixed: true,
        });
    };
    for ty in [Uint(32), Float(32), Float(64), Uint(64)] {
        composite(
            "CompositeExtract",
            ty,
            2,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%r$ = OpCompositeExtract %@ %v$ 1",
        );
        composite(
            "CompositeInsert",
            ty,
            3,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%w$ = OpCompositeInsert %v2@ %c$ %v$ 0\n\
             %r$ = OpCompositeExtract %@ %w$ 0",
        );
        composite(
            "VectorShuffle",
            ty,
            2,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%w$ = OpVectorShuffle %v2@ %v$ %v$ 3 0\n\
             %r$ = OpCompositeExtract %@ %w$ 0",
        );
        composite(
            "VectorExtractDynamic",
            ty,
            2,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%r$ = OpVectorExtractDynamic %@ %v$ %one",
        );
        composite("CopyObject", ty, 1, "%r$ = OpCopyObject %@ %a$");
    }
    for ty in [Float(32), Float(64)] {
        // A product and a sum of products; two terms have one order only.
        composite(
            "Dot",
            ty,
            3,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%w$ = OpCompositeConstruct %v2@ %c$ %a$\n\
             %r$ = OpDot %@ %v$ %w$",
        );
        composite(
            "VectorTimesScalar",
            ty,
            3,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%w$ = OpVectorTimesScalar %v2@ %v$ %c$\n\
             %r$ = OpCompositeExtract %@ %w$ 1",
        );
        composite(
            "MatrixTimesVector",
            ty,
            3,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%w$ = OpCompositeConstruct %v2@ %c$ %a$\n\
             %m$ = OpCompositeConstruct %m2@ %v$ %w$\n%x$ = OpMatrixTimesVector %v2@ %m$ %w$\n\
             %r$ = OpCompositeExtract %@ %x$ 1",
        );
        composite(
            "VectorTimesMatrix",
            ty,
            3,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%w$ = OpCompositeConstruct %v2@ %c$ %a$\n\
             %m$ = OpCompositeConstruct %m2@ %v$ %w$\n%x$ = OpVectorTimesMatrix %v2@ %w$ %m$\n\
             %r$ = OpCompositeExtract %@ %x$ 0",
        );
        composite(
            "FAdd of vectors",
            ty,
            3,
            "%v$ = OpCompositeConstruct %v2@ %a$ %b$\n%w$ = OpCompositeConstruct %v2@ %c$ %a$\n\
             %x$ = OpFAdd %v2@ %v$ %w$\n%r$ = OpCompositeExtract %@ %x$ 1",
        );
    }
    all
}

/// The inputs of a snippet: all combinations of edge values, thinned where they are many.
fn inputs(snippet: &Snippet) -> Vec<Vec<u64>> {
    const MOST: usize = 400;
    let edges: Vec<Vec<u64>> = snippet.operands.iter().map(|ty| ty.edges()).collect();
    let count: usize = edges.iter().map(Vec::len).product();
    // A prime, so that all values of each operand turn up.
    let step = if count > MOST { count / MOST + 1 } else { 1 };
    let step =
        (step..).find(|step| edges.iter().all(|one| step % one.len().min(7) != 0) || *step == 1).unwrap_or(1);
    let mut found = Vec::new();
    for number in (0..count).step_by(step) {
        let mut rest = number;
        let operands: Vec<u64> = edges
            .iter()
            .map(|one| {
                let value = one[rest % one.len()];
                rest /= one.len();
                value
            })
            .collect();
        let typed: Vec<(Type, u64)> =
            snippet.operands.iter().copied().zip(operands.iter().copied()).collect();
        if (snippet.defined)(&typed) {
            found.push(operands);
        }
    }
    found
}

/// A compute shader that stores a snippet's result for every input: operands as constants, or read
/// from buffers; decorated NoContraction or not.
fn module(snippet: &Snippet, inputs: &[Vec<u64>], constant: bool, decorated: bool) -> String {
    let mut declarations = String::new();
    let mut body = String::new();
    let mut buffers = vec![stored(snippet.result)];
    for &ty in &snippet.operands {
        buffers.push(stored(ty));
    }
    let mut annotations = String::new();
    for (at, ty) in buffers.iter().enumerate() {
        let stride = ty.width() / 8;
        annotations += &format!(
            "OpDecorate %array{at} ArrayStride {stride}\nOpDecorate %block{at} Block\n\
             OpMemberDecorate %block{at} 0 Offset 0\nOpDecorate %buffer{at} DescriptorSet 0\n\
             OpDecorate %buffer{at} Binding {at}\n"
        );
        declarations += &format!(
            "%array{at} = OpTypeRuntimeArray %{name}\n%block{at} = OpTypeStruct %array{at}\n\
             %block_pointer{at} = OpTypePointer StorageBuffer %block{at}\n\
             %pointer{at} = OpTypePointer StorageBuffer %{name}\n\
             %buffer{at} = OpVariable %block_pointer{at} StorageBuffer\n",
            name = ty.name()
        );
    }
    for (number, operands) in inputs.iter().enumerate() {
        if number > 1 {
            declarations += &format!("%index{number} = OpConstant %u32 {number}\n");
        }
        let index = match number {
            0 => "%nought".into(),
            1 => "%one".into(),
            _ => format!("%index{number}"),
        };
        for (at, (&bits, &ty)) in operands.iter().zip(&snippet.operands).enumerate() {
            let name = ["a", "b", "c"][at];
            if constant {
                declarations += &match ty {
                    Bool if bits == 0 => format!("%{name}{number} = OpConstantFalse %bool\n"),
                    Bool => format!("%{name}{number} = OpConstantTrue %bool\n"),
                    _ if ty.width() == 64 => format!("%{name}{number} = OpConstant %{} {bits}L\n", ty.name()),
                    Int(_) => {
                        // A narrow literal is sign-extended to its word.
                        let word = ty.integer(bits) as u32;
                        format!("%{name}{number} = OpConstant %{} {word}\n", ty.name())
                    }
                    _ => format!("%{name}{number} = OpConstant %{} {bits}\n", ty.name()),
                };
                continue;
            }
            let buffer = at + 1;
            let target = if ty == Bool { format!("%word{name}{number}") } else { format!("%{name}{number}") };
            body += &format!(
                "%chain{name}{number} = OpAccessChain %pointer{buffer} %buffer{buffer} %nought {index}\n\
                 {target} = OpLoad %{} %chain{name}{number}\n",
                stored(ty).name()
            );
            if ty == Bool {
                body += &format!("%{name}{number} = OpINotEqual %bool {target} %nought\n");
            }
        }
        body += &snippet.code.replace('$', &number.to_string());
        if decorated {
            annotations += &format!("OpDecorate %r{number} NoContraction\n");
        }
        let mut value = format!("%r{number}");
        if snippet.result == Bool {
            body += &format!("\n%stored{number} = OpSelect %u32 {value} %one %nought");
            value = format!("%stored{number}");
        }
        body += &format!(
            "\n%out{number} = OpAccessChain %pointer0 %buffer0 %nought {index}\nOpStore %out{number} {value}\n"
        );
    }
    format!(
        "OpCapability Shader\nOpCapability Int8\nOpCapability Int16\nOpCapability Int64\n\
         OpCapability Float16\nOpCapability Float64\n\
         %glsl = OpExtInstImport \"GLSL.std.450\"\nOpMemoryModel Logical GLSL450\n\
         OpEntryPoint GLCompute %main \"main\" {interface}\nOpExecutionMode %main LocalSize 1 1 1\n\
         {annotations}\
         %void = OpTypeVoid\n%main_type = OpTypeFunction %void\n%bool = OpTypeBool\n\
         %i8 = OpTypeInt 8 1\n%u8 = OpTypeInt 8 0\n%i16 = OpTypeInt 16 1\n%u16 = OpTypeInt 16 0\n\
         %i32 = OpTypeInt 32 1\n%u32 = OpTypeInt 32 0\n%i64 = OpTypeInt 64 1\n%u64 = OpTypeInt 64 0\n\
         %f16 = OpTypeFloat 16\n%f32 = OpTypeFloat 32\n%f64 = OpTypeFloat 64\n\
         %v2u32 = OpTypeVector %u32 2\n%v2u64 = OpTypeVector %u64 2\n\
         %v2f32 = OpTypeVector %f32 2\n%v2f64 = OpTypeVector %f64 2\n\
         %m2f32 = OpTypeMatrix %v2f32 2\n%m2f64 = OpTypeMatrix %v2f64 2\n\
         %nought = OpConstant %u32 0\n%one = OpConstant %u32 1\n\
         {declarations}\
         %main = OpFunction %void None %main_type\n%entry = OpLabel\n{body}OpReturn\nOpFunctionEnd\n",
        interface = (0..buffers.len()).map(|at| format!("%buffer{at}")).collect::<Vec<_>>().join(" "),
    )
}

fn stored(ty: Type) -> Type {
    if ty == Bool { Uint(32) } else { ty }
}

/// What our interpreter stores, the same at 1, 64 and 128 lanes.
fn ours(snippet: &Snippet, inputs: &[Vec<u64>], code: &[u8]) -> Vec<u64> {
    let module =
        Arc::new(anyhit_engine::module::load(code).unwrap_or_else(|error| panic!("{}", error.render())));
    let program = anyhit_engine::program::lower(&module, &module.entry_points[0]);
    let program = program.unwrap_or_else(|error| panic!("{}: {}", snippet.name, error.render()));
    let compute = Compute::new(program).expect("a compute shader");
    let width = stored(snippet.result).width() as usize / 8;
    let run = |lanes: BatchWidth| {
        let out = Buffer::zeroed(inputs.len() * width);
        let mut resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
        for (at, &ty) in snippet.operands.iter().enumerate() {
            let size = stored(ty).width() as usize / 8;
            let bytes: Vec<u8> =
                inputs.iter().flat_map(|operands| operands[at].to_le_bytes()[..size].to_vec()).collect();
            resources = resources.bind(0, at as u32 + 1, Descriptor::Buffer(Buffer::new(&bytes)));
        }
        let result = compute.run(&resources, [1, 1, 1], RunOptions::of(lanes));
        result.unwrap_or_else(|error| panic!("{}: {}", snippet.name, error.render()));
        out.bytes()
    };
    let [one, full, most] = BatchWidth::ALL.map(run);
    assert!(one == most && one == full, "{}: the widths differ", snippet.name);
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte));
    one.chunks_exact(width).map(number).collect()
}

/// What SPIRV-Tools folded each store's value to; `None` where it is no constant.
fn folded(snippet: &Snippet, count: usize, code: &[u8]) -> Vec<Option<u64>> {
    let better = optimise(&words(code), Recipe::Fold)
        .unwrap_or_else(|complaint| panic!("{}: {complaint}", snippet.name));
    let module: Module = rspirv::dr::load_words(&better).expect("what the optimizer wrote");
    let mut constants: BTreeMap<u32, u64> = BTreeMap::new();
    for constant in &module.types_global_values {
        let Some(id) = constant.result_id else { continue };
        match (constant.class.opcode, constant.operands.first()) {
            (Op::Constant, Some(Operand::LiteralBit32(word))) => constants.insert(id, u64::from(*word)),
            (Op::Constant, Some(Operand::LiteralBit64(word))) => constants.insert(id, *word),
            (Op::ConstantNull | Op::ConstantFalse, _) => constants.insert(id, 0),
            (Op::ConstantTrue, _) => constants.insert(id, 1),
            _ => None,
        };
    }
    let mut chains: BTreeMap<u32, u64> = BTreeMap::new();
    let mut found = vec![None; count];
    let id = |operand: &Operand| match operand {
        Operand::IdRef(id) => *id,
        _ => 0,
    };
    for block in module.functions.iter().flat_map(|function| &function.blocks) {
        for instruction in &block.instructions {
            match instruction.class.opcode {
                Op::AccessChain => {
                    let index = instruction.operands.get(2).and_then(|operand| constants.get(&id(operand)));
                    let index = *index.expect("a constant index");
                    chains.insert(instruction.result_id.expect("a pointer"), index);
                }
                Op::Store => {
                    let at = chains[&id(&instruction.operands[0])] as usize;
                    let mask = snippet.result.mask();
                    found[at] = constants.get(&id(&instruction.operands[1])).map(|bits| bits & mask);
                }
                _ => {}
            }
        }
    }
    found
}

/// The f16 of the bits of an f32 that is one.
fn half(bits: u64) -> u16 {
    half::f16::from_f32(f32::from_bits(bits as u32)).to_bits()
}

/// What the execution mode SignedZeroInfNanPreserve would forbid.
const UNPRESERVED: &str = "0 x, 0 / x, x / 0: SPIRV-Tools looks at the 0 alone, not at signs and NaN";

/// Why SPIRV-Tools may have another result, where that is known.
fn excuse(snippet: &Snippet, operands: &[u64], here: u64, there: u64) -> Option<&'static str> {
    let name = snippet.name.split(' ').find(|part| *part != "glsl").expect("a name");
    let typed: Vec<(Type, u64)> = snippet.operands.iter().copied().zip(operands.iter().copied()).collect();
    let zero = |bits: u64| matches!(snippet.result, Float(_)) && snippet.result.number(bits) == 0.0;
    match name {
        // OpSMod: "the remainder r of Operand 1 divided by Operand 2", and no remainder is as great
        // as that.
        "SMod" if here == 0 && there == operands[1] && typed[1].0.integer(there) < 0 => {
            Some("SMod: SPIRV-Tools takes a negative divisor for the rest where nothing remains")
        }
        // 0 times an infinity or NaN is NaN, and 0 times a negative number -0.
        "VectorTimesScalar" if zero(operands[2]) && there == 0 => Some(UNPRESERVED),
        "FMul" if (zero(operands[0]) || zero(operands[1])) && there == 0 => Some(UNPRESERVED),
        "FDiv" if zero(operands[0]) && there == 0 => Some(UNPRESERVED),
        "FDiv" if zero(operands[1]) && snippet.result.is_nan(here) => Some(UNPRESERVED),
        "FMix" if zero(operands[2]) && there == operands[0] => Some(UNPRESERVED),
        // Vulkan: correctly rounded, in no given direction.
        "QuantizeToF16" if half(here).abs_diff(half(there)) == 1 => {
            Some("QuantizeToF16: SPIRV-Tools rounds towards 0, we to the nearest")
        }
        "VectorTimesMatrix" | "MatrixTimesVector" | "Dot" if zero(here) && zero(there) => Some(
            "sums of products: SPIRV-Tools adds to +0, which -0 does not survive; the order of additions is open",
        ),
        // FMin and FMax: "either x or y if both x and y are zeros", and of them FClamp is made.
        "FMin" | "FMax" | "NMin" | "NMax" | "FClamp" | "NClamp" if zero(here) && zero(there) => {
            Some("minima and maxima of +0 and -0, which GLSL.std.450 leaves open")
        }
        _ => None,
    }
}

/// Snippets that SPIRV-Tools folded when this was written, and results that agreed.
const LEAST_FOLDED: usize = 221;
const LEAST_RESULTS: usize = 35_762;

#[test]
fn folded_constants_have_our_bits() {
    let (mut judged, mut results) = (0, 0);
    let mut wrong = Vec::new();
    let mut open: BTreeMap<String, (usize, Vec<String>)> = BTreeMap::new();
    let mut excused: BTreeMap<&str, usize> = BTreeMap::new();
    let mut unfolded = Vec::new();
    for snippet in snippets() {
        let inputs = inputs(&snippet);
        assert!(!inputs.is_empty(), "{}", snippet.name);
        let constant = assemble(&module(&snippet, &inputs, true, true));
        let read = assemble(&module(&snippet, &inputs, false, true));
        let here = ours(&snippet, &inputs, &constant);
        assert_eq!(here, ours(&snippet, &inputs, &read), "{}: constants against buffers", snippet.name);
        let there = folded(&snippet, inputs.len(), &assemble(&module(&snippet, &inputs, true, false)));
        let mut count = 0;
        for ((operands, &here), there) in inputs.iter().zip(&here).zip(there) {
            let Some(there) = there else { continue };
            count += 1;
            let nan = snippet.result.is_nan(here) && snippet.result.is_nan(there);
            let entry = open.entry(snippet.name.clone()).or_default();
            entry.0 += 1;
            if here != there && !nan {
                let told = format!("{} of {operands:x?}: {here:#x}, SPIRV-Tools {there:#x}", snippet.name);
                match excuse(&snippet, operands, here, there) {
                    _ if !snippet.fixed => entry.1.push(told),
                    Some(excuse) => *excused.entry(excuse).or_default() += 1,
                    None => wrong.push(told),
                }
            }
        }
        if count == 0 {
            unfolded.push(snippet.name.clone());
        } else {
            judged += 1;
            results += count;
        }
        if snippet.fixed {
            open.remove(&snippet.name);
        }
    }
    println!("{judged} instructions folded, {results} results");
    println!("not folded: {}", unfolded.join(", "));
    for (excuse, count) in &excused {
        println!("{count} results differ: {excuse}");
    }
    for (name, (count, differ)) in open {
        println!("open: {name}: {} of {count} differ", differ.len());
        for one in differ {
            println!("  {one}");
        }
    }
    assert!(wrong.is_empty(), "{} of {results}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(
        judged >= LEAST_FOLDED && results >= LEAST_RESULTS,
        "{judged} and {results}: fewer than there were"
    );
}
