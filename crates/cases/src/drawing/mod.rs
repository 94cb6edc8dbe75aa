//! What is drawn for people to look at: heat maps with a legend, flame graphs, and a page in HTML.
//!
//! Drawing takes numbers, pictures and texts, and returns a picture or a text. It counts nothing
//! and writes no file.

mod bitmap_text;
pub mod flame_graph;
pub mod heat_map;
pub mod page;
