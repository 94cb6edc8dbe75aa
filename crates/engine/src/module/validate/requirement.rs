//! Requirements of names: the capabilities, extensions and versions of SPIR-V that the grammar
//! gives for each instruction and enumerant.
//!
//! rspirv's tables have capabilities and extensions; `grammar_delta` has what they lack, versions
//! among it.

use std::borrow::Cow;

use rspirv::grammar::INSTRUCTION_TABLE;
use rspirv::{dr, spirv};
use smallvec::SmallVec;

use crate::module::Opcode;
use crate::module::validate::entry::{Entry, Kind};
use crate::module::validate::grammar_delta::{
    ENUMERANTS, ENUMERANTS_SINCE, ENUMERANTS_UNTIL, OPCODES, OPCODES_SINCE, OPCODES_UNTIL,
};

/// What a name requires of the module that uses it.
#[derive(Clone, Debug)]
pub(super) struct Requirement {
    /// The specification's name, that of an instruction without `Op`.
    pub(super) name: Cow<'static, str>,
    /// Numbers of the capabilities, any one of which allows the name; empty where none is needed.
    pub(super) capabilities: SmallVec<[u32; 4]>,
    /// The extensions that define the name.
    pub(super) extensions: SmallVec<[&'static str; 2]>,
    /// First minor version of SPIR-V 1 that has the name without an extension; `None` where all
    /// need one.
    pub(super) since: Option<u8>,
    /// Last minor version of SPIR-V 1 that has the name.
    pub(super) until: Option<u8>,
}

impl Requirement {
    fn of_entry(entry: &Entry) -> Self {
        Self {
            name: entry.name.into(),
            capabilities: entry.capabilities.into(),
            extensions: entry.extensions.into(),
            since: None,
            until: None,
        }
    }

    /// Adds versions: with extensions none has the name where the table says nothing, else 1.0.
    fn with_versions(mut self, since: Option<u8>, until: Option<u8>) -> Self {
        self.since = since.or_else(|| self.extensions.is_empty().then_some(0));
        self.until = until;
        self
    }

    /// Requirements of an instruction; `None` of an unknown opcode.
    pub(super) fn of_opcode(opcode: Opcode) -> Option<Self> {
        let number = u32::from(opcode.0);
        let found = OPCODES.iter().find(|entry| entry.number == number).map(Self::of_entry);
        let found = found.or_else(|| {
            let known = INSTRUCTION_TABLE.iter().find(|known| opcode == known.opcode.into())?;
            Some(Self {
                name: known.opname.into(),
                capabilities: known.capabilities.iter().map(|one| *one as u32).collect(),
                extensions: known.extensions.into(),
                since: None,
                until: None,
            })
        })?;
        let version = |table: &[(u8, &[u32])]| {
            table.iter().find(|(_, numbers)| numbers.contains(&number)).map(|(minor, _)| *minor)
        };
        Some(found.with_versions(version(OPCODES_SINCE), version(OPCODES_UNTIL)))
    }

    /// Requirements of an enumerant, or of one bit of a mask; `None` of an unknown one.
    pub(super) fn of_enumerant(kind: Kind, number: u32) -> Option<Self> {
        let found = added_enumerants(kind).iter().find(|entry| entry.number == number).map(Self::of_entry);
        let found = found.or_else(|| {
            let operand = operand(kind, number)?;
            let name = bit_name(kind, number).map_or_else(|| operand.to_string(), capitalised);
            Some(Self {
                name: name.into(),
                capabilities: operand.required_capabilities().into_iter().map(|one| one as u32).collect(),
                extensions: operand.required_extensions().into_iter().collect(),
                since: None,
                until: None,
            })
        })?;
        let version = |table: &[(Kind, u8, &[u32])]| {
            let mut rows = table.iter().filter(|(of, ..)| *of == kind);
            rows.find(|(.., numbers)| numbers.contains(&number)).map(|(_, minor, _)| *minor)
        };
        Some(found.with_versions(version(ENUMERANTS_SINCE), version(ENUMERANTS_UNTIL)))
    }
}

/// Enumerants of a kind that rspirv lacks, or has with other requirements.
fn added_enumerants(kind: Kind) -> &'static [Entry] {
    ENUMERANTS.iter().find(|(of, _)| *of == kind).map_or(&[], |(_, entries)| entries)
}

impl Opcode {
    /// Extensions that specify the instruction; empty for core instructions. An instruction that
    /// rspirv lacks has the extensions of its first capability.
    pub(crate) fn extensions(self) -> &'static [&'static str] {
        if let Some(known) = INSTRUCTION_TABLE.iter().find(|known| self == known.opcode.into()) {
            return known.extensions;
        }
        let entry = OPCODES.iter().find(|entry| entry.number == u32::from(self.0));
        let capability = entry.and_then(|entry| entry.capabilities.first());
        let mut capabilities = added_enumerants(Kind::Capability).iter();
        let found = capabilities.find(|entry| Some(&entry.number) == capability);
        found.map_or(&[], |entry| entry.extensions)
    }
}

/// The name of a capability, those included that rspirv does not know.
pub(crate) fn capability_name(number: u32) -> Cow<'static, str> {
    enumerant_name(Kind::Capability, number).unwrap_or_else(|| format!("capability {number}").into())
}

/// The name of an enumerant, also of one that rspirv lacks.
pub(crate) fn enumerant_name(kind: Kind, number: u32) -> Option<Cow<'static, str>> {
    Some(Requirement::of_enumerant(kind, number)?.name)
}

/// The name of a bit as the specification spells it: rspirv writes `MAKE_POINTER_VISIBLE`.
fn capitalised(name: &str) -> String {
    let capitalise = |part: &str| match part {
        "KHR" | "EXT" | "NV" | "INTEL" | "AMD" | "ARM" | "ALTERA" | "QCOM" => part.to_owned(),
        _ => part.chars().take(1).chain(part.chars().skip(1).map(|c| c.to_ascii_lowercase())).collect(),
    };
    name.split('_').map(capitalise).collect()
}

/// Generates which kinds of operands are enumerants or masks, and how rspirv reads them.
macro_rules! kinds {
    (masks: $($mask:ident)*; values: $($value:ident)*) => {
        /// Returns true for operands of which each bit has requirements.
        pub(super) fn is_mask(kind: Kind) -> bool {
            matches!(kind, $(Kind::$mask)|*)
        }

        /// Returns true for operands whose word is one enumerant.
        pub(super) fn is_enumerant(kind: Kind) -> bool {
            matches!(kind, $(Kind::$value)|*)
        }

        /// rspirv's name of a bit of a mask.
        fn bit_name(kind: Kind, bit: u32) -> Option<&'static str> {
            match kind {
                $(Kind::$mask => Some(spirv::$mask::from_bits(bit)?.iter_names().next()?.0),)*
                _ => None,
            }
        }

        /// rspirv's operand for a word; `None` of an unknown enumerant and of another kind.
        fn operand(kind: Kind, word: u32) -> Option<dr::Operand> {
            match kind {
                $(Kind::$mask => spirv::$mask::from_bits(word).map(dr::Operand::$mask),)*
                $(Kind::$value => spirv::$value::from_u32(word).map(dr::Operand::$value),)*
                _ => None,
            }
        }
    };
}

kinds! {
    masks:
        ImageOperands FPFastMathMode SelectionControl LoopControl FunctionControl MemorySemantics MemoryAccess
        KernelProfilingInfo RayFlags FragmentShadingRate RawAccessChainOperands CooperativeMatrixOperands
        CooperativeMatrixReduce TensorAddressingOperands MatrixMultiplyAccumulateOperands TensorOperands;
    values:
        SourceLanguage ExecutionModel AddressingModel MemoryModel ExecutionMode StorageClass Dim
        SamplerAddressingMode SamplerFilterMode ImageFormat ImageChannelOrder ImageChannelDataType
        FPRoundingMode FPDenormMode QuantizationModes FPOperationMode OverflowModes LinkageType AccessQualifier
        HostAccessQualifier FunctionParameterAttribute Decoration BuiltIn Scope GroupOperation
        KernelEnqueueFlags Capability RayQueryIntersection RayQueryCommittedIntersectionType
        RayQueryCandidateIntersectionType PackedVectorFormat CooperativeMatrixLayout CooperativeMatrixUse
        TensorClampMode InitializationModeQualifier LoadCacheControl StoreCacheControl
        NamedMaximumNumberOfRegisters FPEncoding CooperativeVectorMatrixLayout ComponentType
}
