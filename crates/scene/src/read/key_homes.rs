//! Where a scene's keys belong, for the message about one that stands in another table.

/// Before the first table: TOML puts a key that is written below a table's header into that table.
const TOP: &str = "at the top of the file, before the first table";
const PIPELINE: &str = "in `[pipeline]`";
const INSTANCE: &str = "in an `[[instance]]`";
const RESOURCE: &str = "in a `[resources.NAME]`";
const DISPATCH: &str = "in a `[[dispatch]]`";

/// The keys that one table of a scene has and that mean the same wherever they are written by
/// mistake.
pub(crate) const HOMES: [(&str, &str); 24] = [
    ("version", TOP),
    ("title", TOP),
    ("include", TOP),
    ("launch", TOP),
    ("precision", TOP),
    ("push_constants", TOP),
    ("raygen", PIPELINE),
    ("miss", PIPELINE),
    ("callable", PIPELINE),
    ("hit", PIPELINE),
    ("max_recursion_depth", PIPELINE),
    ("max_callable_depth", PIPELINE),
    ("max_stack_size", PIPELINE),
    ("subgroup_size", PIPELINE),
    ("fuel", PIPELINE),
    ("launch_fuel", PIPELINE),
    ("printed_bytes", PIPELINE),
    ("mask", INSTANCE),
    ("translate", INSTANCE),
    ("rotate", INSTANCE),
    ("scale", INSTANCE),
    ("binding", RESOURCE),
    ("set", RESOURCE),
    ("groups", DISPATCH),
];

/// Where a key belongs, if that is one place.
pub(super) fn home_of(key: &str) -> Option<&'static str> {
    HOMES.iter().find(|(known, _)| *known == key).map(|(_, home)| *home)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::SceneFile;
    use crate::read::Diagnostics;

    /// The messages about unknown keys.
    fn unknown(text: &str) -> Vec<String> {
        let report = Diagnostics::default();
        let parsed = SceneFile::parse("s.toml", text, &report).map(|_| ()).and(report.finish());
        let Err(error) = parsed else { return Vec::new() };
        let all = [&error].into_iter().chain(error.others());
        let unknown = all.filter(|error| error.message().starts_with("unknown key"));
        unknown.map(|error| error.render()).collect()
    }

    #[test]
    fn every_key_is_known_at_its_home_and_sent_there_from_elsewhere() {
        for (key, home) in HOMES {
            let table = match home {
                TOP => "",
                PIPELINE => "[pipeline]\n",
                INSTANCE => "[[instance]]\n",
                RESOURCE => "[resources.r]\ntype = 'storage_buffer'\n",
                _ => "[[dispatch]]\n",
            };
            let version = if key == "version" { "" } else { "version = 1\n" };
            let value = if key == "version" { "1" } else { "'x'" };
            assert_eq!(unknown(&format!("{version}{table}{key} = {value}\n")), [""; 0], "{key}");
            let wrong = unknown(&format!("version = 1\n[shaders.s]\n{key} = 1\n"));
            assert_eq!(wrong.len(), 1, "{key}");
            assert!(wrong[0].contains(&format!("`{key}` belongs {home}")), "{}", wrong[0]);
        }
    }
}
