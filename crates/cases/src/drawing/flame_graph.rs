//! Flame graphs of folded stacks, through inferno (feature `flamegraph`).

use anyhit_base::error::{Error, ErrorKind, Result, feature_note};

/// Refuses what this build cannot draw, before anything is computed.
///
/// # Errors
/// `UnsupportedTool` without the feature `flamegraph`.
pub fn check() -> Result<()> {
    if cfg!(feature = "flamegraph") {
        return Ok(());
    }
    let message = "this build of anyhit cannot draw flame graphs: it lacks the feature `flamegraph`";
    Err(Error::new(ErrorKind::UnsupportedTool, message)
        .note(feature_note("flamegraph"))
        .note("`inferno-flamegraph`, `flamegraph.pl` and speedscope can draw a .folded profile"))
}

/// Draws folded stacks as SVG.
///
/// # Errors
/// As [`check`]; `InvalidArgument` where there is no stack.
#[cfg_attr(not(feature = "flamegraph"), allow(unused_variables, reason = "nothing is drawn"))]
pub fn svg(folded: &str, title: &str) -> Result<Vec<u8>> {
    check()?;
    #[cfg(feature = "flamegraph")]
    {
        let mut options = inferno::flamegraph::Options::default();
        options.title = anyhit_base::escape::line(title).into_owned();
        options.count_name = "instructions".to_owned();
        options.name_type = "Line".to_owned();
        let mut svg = Vec::new();
        let drawn = inferno::flamegraph::from_lines(&mut options, folded.lines(), &mut svg);
        drawn.map_err(|error| {
            Error::new(
                ErrorKind::InvalidArgument,
                format!(
                    "cannot draw the flame graph: \
        {error}"
                ),
            )
        })?;
        Ok(svg)
    }
    #[cfg(not(feature = "flamegraph"))]
    Ok(Vec::new())
}

#[cfg(all(test, feature = "flamegraph"))]
mod tests {
    use super::*;

    #[test]
    fn frames_are_drawn_by_their_names() {
        let svg = svg("ray generation a.rgen:3;miss b.rmiss:7 5\n", "<a> & b").expect("a flame graph");
        let svg = String::from_utf8(svg).expect("UTF-8");
        assert!(svg.contains("miss b.rmiss:7") && svg.contains("&lt;a&gt; &amp; b"), "{svg}");
        assert!(super::svg("", "nothing").is_err());
    }
}
