//! Input of any kind: hostile, damaged or without sense.

mod hostile_text;
mod limits;
mod misuse;
mod readers;
mod reading;
mod robustness;
