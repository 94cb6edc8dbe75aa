//! Scalar types and vectors of them, and the values that are worth trying.

use std::sync::LazyLock;

use crate::execution::instructions::operand_types::exact;

/// A scalar type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

pub const KINDS: [Kind; 12] = [
    Kind::Bool,
    Kind::I8,
    Kind::U8,
    Kind::I16,
    Kind::U16,
    Kind::I32,
    Kind::U32,
    Kind::I64,
    Kind::U64,
    Kind::F16,
    Kind::F32,
    Kind::F64,
];

impl Kind {
    /// Its id in the text of a module.
    pub fn name(self) -> &'static str {
        [
            "bool", "char", "uchar", "short", "ushort", "int", "uint", "long", "ulong", "half", "float",
            "double",
        ][self as usize]
    }

    /// Bits, 0 for a bool.
    pub fn bits(self) -> u32 {
        [0, 8, 8, 16, 16, 32, 32, 64, 64, 16, 32, 64][self as usize]
    }

    pub fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    pub fn is_signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I32 | Self::I64)
    }

    pub fn is_integer(self) -> bool {
        self != Self::Bool && !self.is_float()
    }

    /// The bits that a value may have.
    pub fn mask(self) -> u64 {
        match self.bits() {
            0 => 1,
            bits => u64::MAX >> (64 - bits),
        }
    }

    /// The number that bits mean, read with a sign or without.
    pub fn number(self, bits: u64, signed: bool) -> i128 {
        let bits = i128::from(bits & self.mask());
        let width = self.bits();
        if signed && bits >> (width - 1) & 1 == 1 { bits - (1 << width) } else { bits }
    }

    /// The number that its type makes of bits.
    pub fn own_number(self, bits: u64) -> i128 {
        self.number(bits, self.is_signed())
    }

    /// Values on the edges of the type, and some in between.
    pub fn edges(self) -> &'static [u64] {
        static EDGES: LazyLock<[Vec<u64>; 12]> = LazyLock::new(|| KINDS.map(Kind::list_edges));
        &EDGES[self as usize]
    }

    fn list_edges(self) -> Vec<u64> {
        let mut edges: Vec<u64> = if self == Self::Bool {
            vec![0, 1]
        } else if self.is_integer() {
            let small =
                [0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 24, 31, 32, 33, 63, 64, 65, 100, 127, 128, 129, 255];
            let top = 1u64 << (self.bits() - 1);
            let large = [top, top + 1, top - 1, top - 2, u64::MAX, u64::MAX - 1, u64::MAX - 6];
            let mixed = [0x5555_5555_5555_5555, 0xAAAA_AAAA_AAAA_AAAA, 0x1234_5678_9ABC_DEF0, 1 << 32];
            [&small[..], &large, &mixed].concat()
        } else {
            let values = [
                0.0,
                -0.0,
                1.0,
                -1.0,
                0.5,
                -0.5,
                1.5,
                2.5,
                -2.5,
                3.0,
                -3.5,
                0.1,
                -0.3,
                100.25,
                1.0e-3,
                255.5,
                -128.75,
                32_768.0,
                65_504.0,
                -65_504.0,
                65_535.5,
                2_147_483_648.0,
                4_294_967_296.0,
                1e10,
                -1e18,
                1.8e19,
                6.1e-5,
                3e-8,
                1e-38,
                1e-45,
                1e-310,
                3e38,
                f64::INFINITY,
                f64::NEG_INFINITY,
                f64::NAN,
            ];
            values.iter().map(|&value| exact::of_f64(self, value)).collect()
        };
        edges.iter_mut().for_each(|bits| *bits &= self.mask());
        edges.sort_unstable();
        edges.dedup();
        edges
    }
}

/// A scalar (`count` 1) or vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ty {
    pub kind: Kind,
    pub count: usize,
}

impl Ty {
    /// Its id in the text of a module, without `%`.
    pub fn name(self) -> String {
        match self.count {
            1 => self.kind.name().to_owned(),
            count => format!("{}{count}", self.kind.name()),
        }
    }

    /// Every scalar, and every vector of two to four components.
    pub fn all() -> impl Iterator<Item = Self> {
        KINDS.into_iter().flat_map(|kind| (1..=4).map(move |count| Self { kind, count }))
    }
}

/// The declarations of every type that the prelude of
/// [`Shader`](crate::execution::instructions::run::Shader) lacks.
pub fn declarations() -> String {
    let mut text = String::from("%char = OpTypeInt 8 1\n%short = OpTypeInt 16 1\n");
    for ty in Ty::all().filter(|ty| ty.count > 1) {
        if !matches!(ty.kind, Kind::U32 | Kind::F32) {
            text += &format!("%{} = OpTypeVector %{} {}\n", ty.name(), ty.kind.name(), ty.count);
        }
    }
    text
}

/// A number that looks random and is the same every time.
pub fn hash(parts: &[u64]) -> u64 {
    let mut state = 0x9E37_79B9_7F4A_7C15u64;
    for &part in parts {
        state = (state ^ part).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        state ^= state >> 29;
        state = state.wrapping_mul(0x94D0_49BB_1331_11EB);
        state ^= state >> 32;
    }
    state
}
