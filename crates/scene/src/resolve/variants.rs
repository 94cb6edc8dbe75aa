//! Variants of a scene: other shaders for the same launch.

use crate::file::{VariantEntry, Variants};
use crate::read::Diagnostics;
use crate::resolve::LoadOptions;
use anyhit_base::error::names::list_of;
use anyhit_base::error::{Error, ErrorKind};

/// The variant that the options name.
pub(super) fn chosen_variant<'a>(
    options: &LoadOptions,
    variants: &'a Variants,
    report: &Diagnostics,
) -> Option<&'a VariantEntry> {
    for variant in variants.repeated.iter().map(|&place| &variants.all[place]) {
        let message = format!("two variants are named `{}`", variant.name.value);
        report.push(variant.name.span.error(message));
    }
    let wanted = options.variant.as_ref()?;
    let chosen = variants.named(wanted);
    if chosen.is_none() {
        let names = list_of(variants.all.iter().map(|variant| variant.name.value.as_str()));
        let error = Error::new(ErrorKind::InvalidArgument, format!("the scene has no variant `{wanted}`"));
        report.push(match names.is_empty() {
            true => error.note("declare variants with `[[variant]]` in the scene file"),
            false => error.note(format!("available: {names}")),
        });
    }
    chosen
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{EmbeddedFiles, load_text};

    #[test]
    fn a_variant_is_chosen_by_its_name() {
        let text = "version = 1\n[shaders.a]\npath = 'a.spv'\n[pipeline]\nraygen = 'a'\n\
            [[variant]]\nname = 'O0'\nshaders.a = 'b.spv'\n[[variant]]\nname = 'g'\nshaders.a = 'c.spv'\n";
        let files = EmbeddedFiles(&[("a.spv", b"SPIR"), ("c.spv", b"C")]);
        let load = |text: &str, name: &str| {
            let options = LoadOptions { variant: Some(name.into()), ..LoadOptions::default() };
            load_text(Path::new("s.toml"), text, &files, &options).map_err(|error| error.render())
        };
        assert_eq!(load(text, "g").unwrap().shaders[0].path, Path::new("c.spv"));
        let unknown = load(text, "O1").unwrap_err();
        assert!(unknown.contains("the scene has no variant `O1`"), "{unknown}");
        assert!(unknown.contains("available: O0, g"), "{unknown}");
        let twice = load(&text.replace("'g'", "'O0'"), "O0").unwrap_err();
        assert!(twice.contains("two variants are named `O0`"), "{twice}");
        let none = load(&text[..text.find("[[variant]]").unwrap()], "g").unwrap_err();
        assert!(none.contains("declare variants with `[[variant]]` in the scene file"), "{none}");
    }
}
