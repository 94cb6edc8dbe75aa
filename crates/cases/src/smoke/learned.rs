//! What is learned of a shader's memory from where it traps: which addresses lead to what, which
//! resources are too small, which geometry it needs.

use crate::smoke::fill::{FillContent, PlaceId, ResourceScale, WideIntegers, region_of};
use crate::smoke::hits::SmokeGeometry;
use crate::smoke::resources::Given;
use anyhit_base::error::TrapOperands;
use anyhit_base::sorted::{SortedMap, SortedSet};
use anyhit_engine::machine::TrapCode;
use anyhit_engine::module::interface::InterfaceVariable;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Id, Module, Opcode};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::Trapped;

/// Addresses that one shader may be taught.
const MOST_ADDRESSES: usize = 256;
/// How many times as large resources of a kind may become where an access goes beyond one, and in
/// which steps.
const MOST_SCALE: u32 = 64;
const SCALE_STEP: u32 = 8;
/// Bytes beyond which an offset is not made good by a larger buffer.
const MOST_OFFSET: u64 = 1 << 24;

/// What was learned of a shader's memory while it ran.
#[derive(Default)]
pub(super) struct Learned {
    /// What lies behind the addresses of what is made up.
    pub known: SortedMap<PlaceId, FillContent>,
    /// By how much resources are larger than at first.
    pub scale: ResourceScale,
    /// What was changed for which trap, in the run that goes on.
    pub mended: Option<(String, Box<Trapped>)>,
    /// The one kind of geometry that there is, where a shader needs it.
    pub geometry: Option<SmokeGeometry>,
    /// Whether it ran out of fuel: it has less of it from then on.
    pub is_spent: bool,
    /// Whether no image is large enough for some access: those outside no longer trap.
    pub leaves_images: bool,
    /// Instructions, by their word offset, for which no resource is large enough.
    hopeless: SortedSet<u32>,
    /// The instruction for which resources became larger last, and which did.
    larger_for: Option<(u32, TooSmall)>,
}

/// What an access goes beyond.
#[derive(Clone, Copy)]
enum TooSmall {
    Buffer,
    Descriptors,
    /// The side of an image, of which its levels follow.
    Image,
    /// The layers of an image.
    Layers,
    /// The samples of an image.
    Samples,
}

impl TooSmall {
    /// By how much all of its kind are larger than at first.
    fn scale(self, of: &mut ResourceScale) -> &mut u32 {
        match self {
            Self::Buffer => &mut of.buffers,
            Self::Descriptors => &mut of.descriptors,
            Self::Image => &mut of.images,
            Self::Layers => &mut of.layers,
            Self::Samples => &mut of.samples,
        }
    }
}

impl Learned {
    /// Goes back to resources of the first size where larger ones are larger than is allowed;
    /// whether there are larger ones.
    pub(super) fn give_up_larger(&mut self) -> bool {
        let Some((offset, kind)) = self.larger_for.take() else { return false };
        if std::mem::replace(kind.scale(&mut self.scale), 1) == 1 {
            return false;
        }
        self.mended = None;
        self.hopeless.insert(offset)
    }

    /// Learns from a trap what memory lacks; whether that was anything new.
    pub(super) fn learn(
        &mut self,
        shader: UsedMemory<'_>,
        trapped: &Trapped,
        given: &Given,
        wide: &mut WideIntegers,
        fuel: &mut u64,
    ) -> bool {
        if *fuel == 0 {
            return false;
        }
        let lost = match trapped.code {
            TrapCode::NullPointer
            | TrapCode::AddressInvalid
            | TrapCode::AddressMisaligned
            | TrapCode::AddressOutOfBounds => true,
            TrapCode::AccelerationStructureMissing => shader.addresses_structures(),
            _ => false,
        };
        let content = lost.then(|| shader.content(trapped)).flatten();
        let place = region_of(trapped.fault_value).and_then(|region| *given.places.get(region)?);
        if let (Some(content), Some(place)) = (content, place)
            && self.known.len() < MOST_ADDRESSES
        {
            return self.known.insert(place, content).is_none();
        }
        let too_small = match trapped.code {
            TrapCode::BufferOutOfBounds | TrapCode::AddressOutOfBounds => {
                (trapped.fault_value & u64::from(u32::MAX) < MOST_OFFSET).then_some(TooSmall::Buffer)
            }
            TrapCode::ImageOutOfBounds => Some(shader.too_small_of_image(trapped)),
            TrapCode::DescriptorMissing | TrapCode::IndexOutOfBounds => {
                shader.has_runtime_descriptors().then_some(TooSmall::Descriptors)
            }
            _ => None,
        };
        if trapped.code == TrapCode::ImageOutOfBounds && self.hopeless.contains(&trapped.offset) {
            return !std::mem::replace(&mut self.leaves_images, true);
        }
        if let Some(kind) = too_small.filter(|_| !self.hopeless.contains(&trapped.offset)) {
            let scale = kind.scale(&mut self.scale);
            if *scale < MOST_SCALE {
                *scale *= SCALE_STEP;
                self.larger_for = Some((trapped.offset, kind));
                let mended = || ("larger resources".to_owned(), Box::new(trapped.clone()));
                self.mended.get_or_insert_with(mended);
                return true;
            }
            *scale = 1;
            self.hopeless.insert(trapped.offset);
            if trapped.code == TrapCode::ImageOutOfBounds {
                self.mended = None;
                return !std::mem::replace(&mut self.leaves_images, true);
            }
        }
        let kind = match trapped.code {
            TrapCode::NotTriangle | TrapCode::RayQueryNotTriangle => Some(SmokeGeometry::Triangle),
            TrapCode::RayQueryNotAabb => Some(SmokeGeometry::Aabb),
            TrapCode::NotSphere => Some(SmokeGeometry::Sphere),
            TrapCode::NotLinearSweptSphere => Some(SmokeGeometry::Lss),
            _ => None,
        };
        if let (Some(kind), None) = (kind, self.geometry) {
            self.geometry = Some(kind);
            let mended = || (format!("only {} geometry", kind.name()), Box::new(trapped.clone()));
            self.mended.get_or_insert_with(mended);
            return true;
        }
        match (content, place) {
            (Some(_), None) if *wide == WideIntegers::Numbers => {
                *wide = WideIntegers::Addresses;
                true
            }
            // What is no address must not be as large as one: a count, say.
            _ if *wide == WideIntegers::Addresses && !self.known.is_empty() && !lost => {
                *wide = WideIntegers::Known;
                true
            }
            _ => false,
        }
    }
}

/// The module of a shader, and the variables that it uses.
#[derive(Clone, Copy)]
pub(super) struct UsedMemory<'a> {
    /// The module.
    pub module: &'a Module,
    /// The variables.
    pub variables: &'a [InterfaceVariable],
}

impl UsedMemory<'_> {
    /// Whether the module makes acceleration structures of addresses.
    fn addresses_structures(&self) -> bool {
        self.module
            .instructions()
            .any(|instruction| instruction.opcode == Opcode::ConvertUToAccelerationStructureKHR)
    }

    /// What the instruction that trapped expects behind its address.
    fn content(&self, trapped: &Trapped) -> Option<FillContent> {
        if trapped.code == TrapCode::AccelerationStructureMissing {
            return Some(FillContent::Structure);
        }
        let module = self.module;
        let instruction = module.instructions().find(|instruction| instruction.offset == trapped.offset)?;
        let pointers = module.operand_ids(instruction).into_iter();
        let mut found = pointers.filter_map(|id| physical_pointer(module, base(module, id)));
        found.next().map(FillContent::Pointer)
    }

    /// What of an image an access goes beyond.
    fn too_small_of_image(&self, trapped: &Trapped) -> TooSmall {
        let Some(TrapOperands::Texel { image, coordinate, extent, sample, samples, .. }) =
            trapped.error.trap().map(|trap| &trap.operands)
        else {
            return TooSmall::Image;
        };
        if sample >= samples {
            return TooSmall::Samples;
        }
        let inside = |(at, side): (&i64, &u32)| (0..i64::from(*side)).contains(at);
        let sides_fit = coordinate.iter().zip(extent).rev().skip(1).all(inside);
        let last_fits = coordinate.iter().zip(extent).next_back().is_none_or(inside);
        match image.as_ref().is_some_and(|image| self.has_layers(image.set, image.binding)) {
            true if sides_fit && !last_fits => TooSmall::Layers,
            _ => TooSmall::Image,
        }
    }

    /// Whether the images at a binding have layers, whose number is the last coordinate.
    fn has_layers(&self, set: u32, binding: u32) -> bool {
        let here = |variable: &&InterfaceVariable| {
            (variable.descriptor_set, variable.binding) == (Some(set), Some(binding))
        };
        self.variables.iter().filter(here).filter_map(|variable| variable.ty).any(|mut ty| {
            loop {
                ty = match *self.module.ty(ty) {
                    Type::Array { element, .. } | Type::RuntimeArray { element, .. } => element,
                    Type::SampledImage(image) => image,
                    Type::Image(ref image) => return image.arrayed,
                    _ => return false,
                };
            }
        })
    }

    /// Returns true if the shader declares runtime arrays of descriptors or descriptor heaps.
    fn has_runtime_descriptors(&self) -> bool {
        if self.variables.iter().any(|one| one.ty.is_none() && one.builtin.is_some()) {
            return true;
        }
        let arrays = self.variables.iter().filter(|variable| variable.binding.is_some());
        let mut types = arrays.filter_map(|variable| variable.ty);
        types.any(|ty| matches!(self.module.ty(ty), Type::RuntimeArray { .. }))
    }
}

/// The pointer that a chain of access chains begins with.
fn base(module: &Module, mut id: Id) -> Id {
    while let Some(made) = module.result_instruction(id)
        && let Some(chain) = module.access_chain(made)
    {
        id = chain.base;
    }
    id
}

/// The type of an id that is a pointer to device memory.
fn physical_pointer(module: &Module, id: Id) -> Option<TypeId> {
    let ty = module.type_of(id)?;
    let physical = storage::PHYSICAL_STORAGE_BUFFER;
    matches!(module.ty(ty), Type::Pointer { storage_class, .. } if *storage_class == physical).then_some(ty)
}
