//! SPIR-V modules: compiling, loading, validating and lowering them.

mod compile;
mod fixtures;
mod grammar_delta;
mod layouts;
mod load_fixtures;
mod load_hostile;
mod load_limits;
mod lower_fixtures;
mod lower_hostile;
mod module_validation;
mod obstacles;
mod support_table;
mod verdict;
