//! Reports of the crate in the words of Python: they name the methods of the crate and the options
//! of the command line.

/// Parts of reports that become others.
const PARTS: &[(&str, &str)] = &[
    (" in Rust: ", " in Python: "),
    ("PipelineBuilder::", "anyhit.Pipeline's "),
    ("with `buffer_bytes`", "with `read_buffer`"),
    (
        "the scene's [pipeline], with --fuel, or with `fuel` of PipelineBuilder, Compute and ShaderTest",
        "the scene's [pipeline], or with `fuel` of Pipeline, ShaderTest and ComputeTest",
    ),
    ("the scene's [pipeline], with --launch-fuel, or with LaunchLimits::fuel", "the scene's [pipeline]"),
    ("; --sanitize reports", "; `sanitize()` reports"),
    ("run `anyhit inspect` to list", "`Module.capabilities` and the program `anyhit inspect` list"),
    (", or in Rust with `InputLimits::with`", " of the program `anyhit`"),
    ("(--all shows them)", "(the program `anyhit trace-one-ray` shows all)"),
];

/// Beginnings of notes that become others up to the end of the line.
const NOTES: &[(&str, &str)] = &[
    (
        "create the image with ",
        "help: leave out `format`: the image then has the format that the shaders declare",
    ),
    (
        "combine the constants of `RayFlags`",
        "combine the numbers of the SPIR-V ray flags: 1 (opaque) | 512 (skip boxes)",
    ),
    (
        "help: set `language` (and `stage`) of the shader in a scene",
        "help: end the name with one of these extensions",
    ),
    (
        "help: for a plain .glsl file, set `stage`",
        "help: name the stage in the extension: `sky.rmiss`, `sky.rmiss.glsl`",
    ),
    ("a hit needs its ray: `Hit::", "help: a hit needs its ray: `anyhit.Hit.sphere(position, radius, ray)`"),
    ("help: enable the feature `", "help: this wheel was built without it; install the compiler"),
    ("help: install a newer glslang, or build anyhit", "help: install a newer glslang"),
];

/// A report with its notes in the words of Python.
pub(crate) fn in_python(text: &str) -> String {
    let line = |line: &str| {
        let note = NOTES.iter().find_map(|(begin, words)| {
            let at = line.find(begin)?;
            Some(format!("{}{words}", &line[..at]))
        });
        let line = note.unwrap_or_else(|| line.to_owned());
        PARTS.iter().fold(line, |line, (part, words)| line.replace(part, words))
    };
    let lines: Vec<String> = text.split('\n').map(line).collect();
    lines.join("\n")
}
