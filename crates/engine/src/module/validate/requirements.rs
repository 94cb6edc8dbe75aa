//! Undeclared requirements: capabilities, extensions and versions that the names in a module ask
//! for.
//!
//! One walk over the words looks up each distinct instruction and enumerant once, in the grammar;
//! `universal` adds the rules that the grammar does not encode.

use rspirv::spirv::{Capability, Decoration};
use rustc_hash::FxHashSet;

use crate::module::grammar::walk;
use crate::module::span::Span;
use crate::module::validate::declared::{Declared, STORAGE_16_BIT};
use crate::module::validate::entry::Kind;
use crate::module::validate::grammar_delta::NOT_IN_VULKAN;
use crate::module::validate::missing::{either, missing_capabilities, preferred, subject};
use crate::module::validate::requirement::{Requirement, is_enumerant, is_mask};
use crate::module::validate::universal::Universal;
use crate::module::validate::{ValidationClass, ValidationFinding};
use crate::module::words::Walker;
use crate::module::{Id, Module, Opcode};

/// Reports each name whose capability, extension or version the module does not declare.
pub(super) fn check(module: &Module) -> Vec<ValidationFinding> {
    let declared = Declared::of(module);
    let mut pass = Pass {
        module,
        declared: &declared,
        universal: Universal::new(module, &declared),
        opcodes: FxHashSet::default(),
        enumerants: FxHashSet::default(),
        findings: Vec::new(),
    };
    let mut walker = Walker::new(&module.words, module.limits);
    // A loaded module has been walked before.
    while let Ok(Some(span)) = walker.next() {
        pass.instruction(span);
    }
    pass.findings.append(&mut pass.universal.findings);
    pass.findings
}

struct Pass<'m> {
    module: &'m Module,
    declared: &'m Declared<'m>,
    universal: Universal<'m>,
    /// Opcodes that were looked up.
    opcodes: FxHashSet<Opcode>,
    /// Enumerants and bits that were looked up.
    enumerants: FxHashSet<(Kind, u32)>,
    findings: Vec<ValidationFinding>,
}

impl Pass<'_> {
    fn instruction(&mut self, span: Span) {
        if self.opcodes.insert(span.opcode)
            && let Some(requirement) = Requirement::of_opcode(span.opcode)
        {
            self.opcode(span, &requirement);
        }
        self.universal.instruction(span);
        const WITHOUT_ENUMERANTS: [Opcode; 3] = [Opcode::Constant, Opcode::SpecConstant, Opcode::Switch];
        // The words of these depend on types; no operand is an enumerant.
        if WITHOUT_ENUMERANTS.contains(&span.opcode) {
            return;
        }
        let module = self.module;
        // Debug information need not follow the grammar: what is behind a mistake is left out.
        let _ = walk(&module.words, span, 1, &mut |at, kind| {
            self.operand(span, at, kind);
            Ok(())
        });
    }

    fn operand(&mut self, span: Span, at: usize, kind: Kind) {
        let word = self.module.words[at];
        match kind {
            Kind::IdScope => {
                if let Some(scope) = self.constant(word) {
                    self.universal.scope(span, at, scope);
                    self.enumerant(span, at, Kind::Scope, scope, true);
                }
            }
            Kind::IdMemorySemantics => {
                /// `AtomicCounterMemory`: compilers set it without `AtomicStorage`, and Vulkan
                /// ignores it.
                const ATOMIC_COUNTER_MEMORY: u32 = 0x400;
                let semantics = self.constant(word).unwrap_or(0) & !ATOMIC_COUNTER_MEMORY;
                self.mask(span, at, Kind::MemorySemantics, semantics, true);
            }
            _ if is_enumerant(kind) => self.enumerant(span, at, kind, word, false),
            _ if is_mask(kind) => self.mask(span, at, kind, word, false),
            _ => {}
        }
    }

    fn constant(&self, id: u32) -> Option<u32> {
        self.module.constant_scalar(Id(id)).and_then(|bits| u32::try_from(bits).ok())
    }

    fn mask(&mut self, span: Span, at: usize, kind: Kind, word: u32, by_id: bool) {
        for bit in (0..u32::BITS).map(|index| 1 << index).filter(|bit| word & bit != 0) {
            self.enumerant(span, at, kind, bit, by_id);
        }
    }

    /// Checks one enumerant or bit; `by_id` where it is the value of a constant, which may exist in
    /// a version of the module that does not know its name.
    fn enumerant(&mut self, span: Span, at: usize, kind: Kind, number: u32, by_id: bool) {
        if !self.enumerants.insert((kind, number)) {
            return;
        }
        let Some(mut requirement) = Requirement::of_enumerant(kind, number) else { return };
        if self.is_exempt(kind, number) {
            return;
        }
        let name = format!("{kind:?} {}", requirement.name);
        let rule = format!("SPIR-V grammar, {name}");
        let place = (at, self.subject(span));
        if kind == Kind::Decoration && number == Decoration::FPRoundingMode as u32 {
            // VK_KHR_16bit_storage: decorates what is stored in 16 bits.
            requirement.capabilities = STORAGE_16_BIT.into();
        }
        if kind == Kind::Capability {
            self.capability(number, &requirement, place);
        } else if let Some(missing) = self.missing_capability(&requirement) {
            self.report(
                ValidationClass::Capability,
                &name,
                &rule,
                place,
                format!("{name} requires {}", missing.0),
                missing.1,
            );
            return;
        }
        if by_id {
            return;
        }
        let version = self.declared.version;
        if let Some(last) = requirement.until.filter(|&last| version > last) {
            let message = format!("{name} was removed after SPIR-V 1.{last}");
            let fix = format!("compile for SPIR-V 1.{last}, or use its replacement");
            return self.report(ValidationClass::Extension, &name, &rule, place, message, fix);
        }
        if let Some(missing) = self.missing_extension(&requirement) {
            self.report(
                ValidationClass::Extension,
                &name,
                &rule,
                place,
                format!("{name} requires {}", missing.0),
                missing.1,
            );
        }
    }

    /// Enumerants whose row in the grammar does not hold for this module.
    fn is_exempt(&self, kind: Kind, number: u32) -> bool {
        /// `PointSize`, `ClipDistance`, `CullDistance`: members of `gl_PerVertex`, which compilers
        /// declare whole; the capability is for a use.
        const OF_PER_VERTEX: [u32; 3] = [1, 3, 4];
        /// `ExclusiveScan`, the last group operation that `SPV_AMD_shader_ballot` adds.
        const EXCLUSIVE_SCAN: u32 = 2;
        match kind {
            Kind::BuiltIn => OF_PER_VERTEX.contains(&number),
            Kind::FPRoundingMode => self.declared.has_any(STORAGE_16_BIT),
            Kind::GroupOperation => {
                number <= EXCLUSIVE_SCAN
                    && (self.declared.has(Capability::Kernel as u32)
                        || self.declared.has_any_extension(&["SPV_AMD_shader_ballot"]))
            }
            _ => false,
        }
    }

    fn opcode(&mut self, span: Span, requirement: &Requirement) {
        let name = span.opcode.to_string();
        let rule = format!("SPIR-V grammar, {name}");
        let place = (span.start, self.subject(span));
        // SPV_AMD_shader_ballot adds these without a capability.
        let of_ballot = requirement.extensions.contains(&"SPV_AMD_shader_ballot")
            && self.declared.has_any_extension(&["SPV_AMD_shader_ballot"]);
        if !of_ballot && let Some(missing) = self.missing_capability(requirement) {
            self.report(
                ValidationClass::Capability,
                &name,
                &rule,
                place,
                format!("{name} requires {}", missing.0),
                missing.1,
            );
            return;
        }
        let version = self.declared.version;
        if let Some(last) = requirement.until.filter(|&last| version > last) {
            let message = format!("{name} was removed after SPIR-V 1.{last}");
            let fix = format!("compile for SPIR-V 1.{last}, or use its replacement");
            return self.report(ValidationClass::Extension, &name, &rule, place, message, fix);
        }
        // The declaration of a capability asks for the extension. `Shader` allows this one, too.
        let by_capability =
            !requirement.capabilities.is_empty() && span.opcode != Opcode::TerminateInvocation;
        if !by_capability && let Some(missing) = self.missing_extension(requirement) {
            self.report(
                ValidationClass::Extension,
                &name,
                &rule,
                place,
                format!("{name} requires {}", missing.0),
                missing.1,
            );
        }
    }

    /// Checks that Vulkan has a declared capability.
    fn capability(&mut self, number: u32, requirement: &Requirement, place: (usize, Option<Id>)) {
        if NOT_IN_VULKAN.contains(&number) && !self.declared.has_any_extension(&requirement.extensions) {
            let rule = "VUID-VkShaderModuleCreateInfo-pCode-08740";
            let message = format!("Vulkan has no feature for the capability {}", requirement.name);
            let fix = "compile the shader for Vulkan".to_owned();
            self.report(ValidationClass::Capability, &requirement.name, rule, place, message, fix);
        }
    }

    /// The undeclared capability of a name, and the fix; `None` where one of those that allow it is
    /// declared.
    fn missing_capability(&self, requirement: &Requirement) -> Option<(String, String)> {
        let all = &requirement.capabilities;
        (!all.is_empty() && !self.declared.has_any(all)).then(|| missing_capabilities(all))
    }

    /// The undeclared extension of a name, and the fix; `None` where the version has the name or
    /// one of its extensions is declared.
    fn missing_extension(&self, requirement: &Requirement) -> Option<(String, String)> {
        let in_version = requirement.since.is_some_and(|since| since <= self.declared.version);
        if in_version || self.declared.has_any_extension(&requirement.extensions) {
            return None;
        }
        let version = requirement.since.map(|since| format!("SPIR-V 1.{since}"));
        let extension = match requirement.extensions[..] {
            [] => None,
            [one] => Some(format!("the extension {one}")),
            _ => Some(format!("one of the extensions {}", either(&requirement.extensions))),
        };
        let declare =
            preferred(&requirement.extensions).map(|one| format!("declare `OpExtension \"{one}\"`"));
        let compile = version.as_ref().map(|version| format!("compile for {version}"));
        let text = |parts: [Option<String>; 2]| parts.into_iter().flatten().collect::<Vec<_>>().join(" or ");
        let what = text([version, extension]);
        Some((format!("{what}, which the module does not declare"), text([declare, compile])))
    }

    fn report(
        &mut self,
        class: ValidationClass,
        name: &str,
        rule: &str,
        place: (usize, Option<Id>),
        message: String,
        fix: String,
    ) {
        self.findings.push(ValidationFinding::new(class, name, rule, place, message, fix));
    }

    /// The id that an instruction is about: its result, or what it decorates.
    fn subject(&self, span: Span) -> Option<Id> {
        subject(self.module, span)
    }
}
