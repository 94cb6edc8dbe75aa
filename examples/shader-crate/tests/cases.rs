//! Each folder of cases/ as a test; `anyhit test cases` runs the same.

anyhit::cases!("cases");
