//! Compiles the GLSL and Slang of shaders/ into `OUT_DIR`, for the crate to include.
//!
//! If no compiler for a source is installed, the build uses the module in spirv/. Its hash must
//! match the source, so that it cannot be stale. `UPDATE_SPIRV=1 cargo build --features glsl`
//! writes both anew.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::{env, fs};

use anyhit::{CompileOptions, DebugInfoLevel, ErrorKind, Source};

const SHADERS: &[&str] = &["lss.rchit", "lss.slang"];

fn main() -> ExitCode {
    println!("cargo:rerun-if-changed=shaders");
    println!("cargo:rerun-if-changed=spirv");
    println!("cargo:rerun-if-env-changed=UPDATE_SPIRV");
    println!("cargo:rerun-if-env-changed=SLANGC");
    match SHADERS.iter().try_for_each(|name| build(name)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // As it is displayed: what `main` returns would be shown with its line feeds escaped.
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Puts the module of a source into `OUT_DIR`.
fn build(name: &str) -> Result<(), Box<dyn Error>> {
    let updates = env::var_os("UPDATE_SPIRV").is_some();
    let source = Source::read_in(Path::new("shaders"), name)?;
    let (kept, hash) = (format!("spirv/{name}.spv"), format!("spirv/{name}.hash"));
    let options = CompileOptions::default().debug(DebugInfoLevel::Lines);
    let module = match source.compile(&options) {
        Ok(module) => module,
        Err(error) if error.kind() == ErrorKind::UnsupportedTool && !updates => {
            println!("cargo:warning={}: {kept} is used", error.message());
            if fs::read_to_string(&hash)?.trim() != source.content_hash() {
                return Err(format!("{kept} was made from another shaders/{name}\n{}", error.render()).into());
            }
            fs::read(&kept)?
        }
        Err(error) => return Err(error.render().into()),
    };
    if updates {
        fs::write(&kept, &module)?;
        fs::write(&hash, source.content_hash() + "\n")?;
    }
    fs::write(Path::new(&env::var("OUT_DIR")?).join(format!("{name}.spv")), module)?;
    Ok(())
}
