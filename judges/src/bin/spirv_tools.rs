//! Runs SPIRV-Tools on one module after the other for `anyhit_judges::process::ToolProcess`.

fn main() -> std::io::Result<()> {
    anyhit_judges::process::serve()
}
