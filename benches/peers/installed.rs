//! The folder that `benches/peers/setup` has filled, and how its programs are called.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of the peers.
pub struct Installed {
    root: PathBuf,
    /// The folder that the programs see as `/share`.
    pub share: PathBuf,
}

/// What a program printed: a name and a number a line.
pub type Printed = BTreeMap<String, f64>;

impl Installed {
    /// The folder that `ANYHIT_PEERS` names, if it is set.
    pub fn from_environment() -> Option<Self> {
        let root = PathBuf::from(std::env::var_os("ANYHIT_PEERS").filter(|root| !root.is_empty())?);
        Some(Self { share: root.join("share"), root })
    }

    /// Runs lavapipe's program, on one thread, with or without its cache of shaders.
    pub fn lavapipe(&self, cache: bool, arguments: &[&str]) -> Result<Printed, String> {
        let cache = if cache { "MESA_SHADER_CACHE_DISABLE=false" } else { "MESA_SHADER_CACHE_DISABLE=true" };
        self.run("sid", &[&["LP_NUM_THREADS=1", cache, "/share/bin/lavapipe"], arguments].concat())
    }

    /// Runs Embree's program.
    pub fn embree(&self, arguments: &[&str]) -> Result<Printed, String> {
        self.run("trixie", &[&["/share/bin/embree"], arguments].concat())
    }

    fn run(&self, system: &str, words: &[&str]) -> Result<Printed, String> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/chroot");
        let output = Command::new(&script)
            .arg(&self.root)
            .arg(system)
            .arg("env")
            .args(words)
            .output()
            .map_err(|error| format!("{}: {error}", script.display()))?;
        if !output.status.success() {
            return Err(format!("{words:?}: {}\n{}", output.status, String::from_utf8_lossy(&output.stderr)));
        }
        let text = String::from_utf8_lossy(&output.stdout);
        text.lines()
            .map(|line| {
                let (name, number) = line.split_once(' ').ok_or_else(|| format!("{words:?}: `{line}`"))?;
                let number = number.parse().map_err(|error| format!("{words:?}: `{line}`: {error}"))?;
                Ok((name.to_owned(), number))
            })
            .collect()
    }
}
