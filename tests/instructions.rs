//! Instructions that are no rows: small programs, run at every width of a batch.

mod atomic_order;
mod atomics;
mod builtins;
mod calls;
mod constants;
mod declarations;
mod extended;
mod float_controls;
mod float_encodings;
mod formulas;
mod half_vector_atomics;
mod images;
mod integers;
mod loops;
mod memory;
mod messages;
mod motion;
mod null_pointers;
mod operand_types;
mod pointers;
mod ray_queries;
mod resources;
mod run;
mod sharing;
mod subgroups;
mod verdicts;
