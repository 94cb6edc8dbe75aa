//! The state of a running batch of invocations, without any instruction.
//!
//! A batch runs one entry point for up to W invocations at once. Everything a shader holds in
//! Function, Private, Input, payload and attribute storage is a register of the batch's register
//! file: one 32-bit word for each lane. Buffers, images and acceleration structures are shared
//! [`resource`]s.

pub mod batch;
pub mod buffer;
pub mod device_memory;
mod equality;
pub mod format;
pub mod hit_object;
pub mod image;
mod image_words;
pub mod index;
pub mod invocation;
pub mod lanes;
mod lazy_words;
pub mod object;
pub mod observe;
pub mod open_choices;
pub mod out_of_bounds;
pub mod printed;
pub mod ray_query;
pub mod resource;
pub mod sampler;
pub mod shared_by_lanes;
pub mod stop;
pub mod trap;
pub mod turns;
pub mod watchdog;
pub mod workgroup;

pub use batch::{Batch, Frame};
pub use buffer::Buffer;
pub use device_memory::DeviceMemory;
pub use hit_object::{HitObject, HitObjects};
pub use index::{BlockIndex, OpIndex, ShaderIndex};
pub use invocation::{Invocation, Invocations, ShaderRecord, TlasHit};
pub use lanes::{
    Freshness, Lanes, Mask, NO_CAUSE, REGISTER_POINTER, Reg, Registers, Scalar, ShadowRegisters,
};
pub use observe::{LaunchObserver, Observer};
pub use open_choices::{
    ChoiceKind, ChoiceLog, ChoiceSite, DrawnDetails, DrawnTraversal, OpenChoices, OrderLimits, OrderPart,
};
pub use out_of_bounds::OutOfBoundsIndices;
pub use printed::{Printed, PrintedBytes};
pub use ray_query::{QueryNotes, RayQuery, RayQueryEvent, RayQueryStep};
pub use resource::{Binding, BindingSummary, Bindings, Descriptor, MemoryPolicy, Resources};
pub use stop::Stop;
pub use trap::{AccessFault, Exit, HitRecordTerms, LaneTrap, TrapCode};
pub use turns::{LoopTurns, Turns};
pub use watchdog::{LaunchFuel, LaunchLimits, TaskWatch, Watchdog};
pub use workgroup::Workgroup;
