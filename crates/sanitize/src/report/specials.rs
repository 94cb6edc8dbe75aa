//! Reports of NaNs and infinities: which instruction made one, of which operands, through which
//! variables it went, and where it arrived.

use crate::cause::{Cause, OpPlace};
use crate::report::{Reporter, Told, line_or_offset, offset};
use crate::rule::{Rule, arithmetic, image, trace};
use crate::value_path::names_on_path;
use anyhit_engine::machine::{Mask, OpIndex, Reg, ShadowRegisters};

/// Where a NaN or an infinity arrives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpecialSink {
    /// A comparison.
    Comparison,
    /// The t of a reported intersection.
    ReportedT,
    /// A buffer.
    Buffer,
    /// A texel that is written, of the image with a handle.
    Image(u32),
    /// `debugPrintfEXT`.
    Print,
    /// The attributes of a reported or recorded hit.
    Attributes,
    /// An operand of a trace or ray query, by its name.
    Ray(&'static str),
    /// An operand of an image instruction, by its name.
    Sample(&'static str),
    /// The payload of a ray from the host.
    Payload,
}

impl<const W: usize> Reporter<'_, W> {
    /// Reports that a register holds NaNs or infinities where it should not, if instructions made
    /// them.
    pub(crate) fn special(
        &mut self,
        shadow: &ShadowRegisters<W>,
        op: OpIndex,
        register: Reg,
        lanes: Mask<W>,
        sink: SpecialSink,
    ) {
        let told = |reporter: &Self, cause| reporter.tell_special(cause, op, sink);
        self.add_for_causes(shadow, register, op, lanes, told);
    }

    /// Reports a NaN or an infinity that has a cause.
    pub(crate) fn special_for(&mut self, cause: u32, op: OpIndex, lanes: Mask<W>, sink: SpecialSink) {
        if let Some(told) = self.tell_special(cause, op, sink) {
            self.add(told, op, lanes);
        }
    }

    fn tell_special(&self, number: u32, op: OpIndex, sink: SpecialSink) -> Option<Told> {
        let (Cause::Born { place, special }, Some(details)) = self.causes.get(number)? else { return None };
        let here = OpPlace { shader: self.shader(), op };
        let rule: &'static Rule = match sink {
            SpecialSink::Comparison => &arithmetic::NAN_BRANCH,
            SpecialSink::ReportedT => &trace::REPORT_NAN_T,
            SpecialSink::Sample(_) => &image::IMAGE_NAN_COORDINATE,
            _ => details.rule,
        };
        let arrives = self.arrives(op, sink);
        let (what, made) = (special.name(), &details.message);
        let mut notes = self.births(details.operand);
        let born = self.program(place.shader)?;
        if place.shader == here.shader {
            let through = names_on_path(&born.module, offset(born, here.op), offset(born, place.op));
            if !through.is_empty() {
                let names: Vec<String> = through.iter().map(|name| format!("`{name}`")).collect();
                notes.push(format!("it passes through {}", names.join(", then ")));
            }
        } else {
            notes.push(format!("it is made in the {} shader `{}`", born.stage.name(), born.name));
        }
        notes.push(format!("it {arrives}{}", self.line(here)));
        Some(Told {
            label: format!("{made} makes {what}"),
            notes,
            cause: (here.shader, line_or_offset(self.program(here.shader)?, op)),
            by_line: true,
            ..Told::at(rule, place, format!("{what}, made by {made}, {arrives}"))
        })
    }

    /// Where the NaN or infinity of a cause was made, and those that it was made of.
    pub(crate) fn births(&self, number: u32) -> Vec<String> {
        /// Operands of operands that are told.
        const MOST: usize = 4;
        let mut told = Vec::new();
        let mut number = number;
        while let Some((Cause::Born { place, special }, Some(details))) = self.causes.get(number)
            && told.len() < MOST
        {
            let (what, line) = (special.name(), self.line(place));
            told.push(format!("{what} among the operands is made by {}{line}", details.message));
            number = details.operand;
        }
        told
    }

    /// What a report says of a value that arrives somewhere.
    fn arrives(&self, op: OpIndex, sink: SpecialSink) -> String {
        let program = self.program(self.shader());
        match sink {
            SpecialSink::Comparison => "is compared".into(),
            SpecialSink::ReportedT => "is the t of a reported intersection".into(),
            SpecialSink::Buffer => {
                let path = program.and_then(|program| program.stored_path(op));
                path.map_or_else(|| "is written to memory".into(), |path| format!("is written to `{path}`"))
            }
            SpecialSink::Image(handle) => {
                let image = program.and_then(|program| program.describe_descriptor(handle));
                format!("is written to {}", image.unwrap_or_else(|| "an image".into()))
            }
            SpecialSink::Print => "is printed".into(),
            SpecialSink::Attributes => "is in the attributes of a hit".into(),
            SpecialSink::Ray(operand) => format!("is in the {operand} of a ray"),
            SpecialSink::Sample(operand) => format!("is {operand} of an image access"),
            SpecialSink::Payload => "is left in the payload of the ray".into(),
        }
    }
}
