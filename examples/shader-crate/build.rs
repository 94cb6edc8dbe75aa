//! Compiles the GLSL of shaders/ into `OUT_DIR`, for the crate to include.
//!
//! Where no compiler is at hand that knows it, the module in spirv/ is taken, which was compiled
//! from the same text: its hash is compared, so that it cannot be stale. `UPDATE_SPIRV=1 cargo
//! build --features glsl` writes both anew.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

use anyhit::{CompileOptions, DebugInfoLevel, ErrorKind, Source};

const SHADERS: &[&str] = &["lss.rchit"];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=shaders");
    println!("cargo:rerun-if-changed=spirv");
    println!("cargo:rerun-if-env-changed=UPDATE_SPIRV");
    let out = env::var("OUT_DIR")?;
    for name in SHADERS {
        let source = Source::read_in(Path::new("shaders"), name)?;
        let (kept, hash) = (format!("spirv/{name}.spv"), format!("spirv/{name}.hash"));
        let options = CompileOptions::default().debug(DebugInfoLevel::Lines);
        let module = match source.compile(&options) {
            Ok(module) => module,
            Err(error) if error.kind() == ErrorKind::UnsupportedTool => {
                println!("cargo:warning={}: {kept} is used", error.message());
                if fs::read_to_string(&hash)?.trim() != source.content_hash() {
                    return Err(
                        format!("{kept} was made from another shaders/{name}\n{}", error.render()).into()
                    );
                }
                fs::read(&kept)?
            }
            Err(error) => return Err(error.render().into()),
        };
        if env::var_os("UPDATE_SPIRV").is_some() {
            fs::write(&kept, &module)?;
            fs::write(&hash, source.content_hash() + "\n")?;
        }
        fs::write(Path::new(&out).join(format!("{name}.spv")), module)?;
    }
    Ok(())
}
