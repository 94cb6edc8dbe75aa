//! The repository itself: layers, names, documents, profiles.

mod book;
mod file_circles;
mod growth_fit;
mod hooks;
mod layering;
mod names;
mod profiles;
mod readme;
mod test_files;
