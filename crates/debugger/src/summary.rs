//! What happened, in about five lines.

use anyhit_base::count::grouped;
use anyhit_explain::hints;
use anyhit_explain::page::with_plural;
use anyhit_explain::summary_words::{counts, label, outcome};
use anyhit_explain::transcript::{ChangeLocation, MemoryChange, ShaderRun, SummaryLine, Trace, Transcript};
use anyhit_explain::walk::{self, AnyRay};

/// Writes the summary and the hints of a transcript.
pub(super) fn complete(transcript: &mut Transcript) {
    transcript.hints = hints::hints(&transcript.root, &transcript.writes);
    transcript.summary = lines(transcript);
}

fn lines(transcript: &Transcript) -> Vec<SummaryLine> {
    let rays: Vec<AnyRay<'_>> =
        walk::samples(&transcript.root).into_iter().filter_map(AnyRay::of_step).collect();
    let later = walk::shader_of_sample(&transcript.root, 0);
    let mut lines = vec![SummaryLine { about: "ray", text: fate(&rays, later) }];
    let mut add = |about: &'static str, text: String| lines.push(SummaryLine { about, text });
    if let [AnyRay::Trace(Trace { payload_after: Some(after), .. })] = rays[..] {
        add("payload", after.to_string());
    }
    add("wrote", wrote(transcript));
    add("ran", ran(transcript));
    if let Some(first) = transcript.printed.first() {
        let first = first.lines().next().unwrap_or_default();
        add(
            "printed",
            match transcript.printed.len() {
                1 => first.to_owned(),
                count => format!("{first} (and {} more)", with_plural(count as u64 - 1, "text")),
            },
        );
    }
    if let Some(trap) = &transcript.trap {
        add("trap", trap.message.clone());
    }
    lines
}

/// What became of the rays that the outermost shader traced itself. `shader` is the closest-hit or
/// miss shader of the first, which a hit object may have kept until it was executed.
fn fate(rays: &[AnyRay<'_>], shader: Option<&ShaderRun>) -> String {
    match rays {
        [] => "no ray was traced".to_owned(),
        [ray] => {
            let fate = outcome(*ray);
            match (*ray, shader) {
                (_, Some(run)) => format!("{fate} -> {}", label(&run.shader)),
                (AnyRay::Trace(Trace { no_shader: Some(why), .. }), None) => {
                    format!("{fate}; no shader runs: {why}")
                }
                _ => fate,
            }
        }
        rays => format!("{}: {}", with_plural(rays.len() as u64, "ray"), counts(rays)),
    }
}

fn wrote(transcript: &Transcript) -> String {
    let changed: Vec<&MemoryChange> =
        transcript.writes.iter().filter(|write| write.before != write.after).collect();
    let more = (changed.len() + transcript.writes_left_out).saturating_sub(1) as u64;
    let Some(first) = changed.first() else { return "no changed value".to_owned() };
    let at = place(first);
    let more = match more {
        0 => String::new(),
        more => format!(", and {} more", with_plural(more, "change")),
    };
    format!("{at}: {} -> {}{more}", first.before, first.after.content)
}

/// The resource and the place in it. The path of a member names its buffer, except in a block that
/// naga makes of an array or a scalar, whose member has no name.
fn place(change: &MemoryChange) -> String {
    let resource = &change.resource;
    match (change.at, &change.member) {
        (ChangeLocation::Texel([x, y, 0]), _) => format!("{resource} texel ({x}, {y})"),
        (ChangeLocation::Texel([x, y, z]), _) => format!("{resource} texel ({x}, {y}, {z})"),
        (ChangeLocation::Byte(_), Some(path)) if path.is_empty() || path.starts_with(['[', '.']) => {
            format!("{resource}{path}")
        }
        (ChangeLocation::Byte(_), Some(path)) => path.clone(),
        (ChangeLocation::Byte(offset), None) => format!("{resource} byte {offset}"),
    }
}

fn ran(transcript: &Transcript) -> String {
    let counts = &transcript.counts;
    let shaders: Vec<String> =
        counts.shaders.iter().map(|(stage, count)| format!("{} {stage}", grouped(count))).collect();
    let queries = match counts.ray_queries {
        0 => String::new(),
        1 => "1 ray query, ".to_owned(),
        count => format!("{} ray queries, ", grouped(count)),
    };
    let shaders = if shaders.is_empty() { "none".to_owned() } else { shaders.join(", ") };
    format!("{}, {queries}shaders: {shaders}", with_plural(counts.rays, "ray"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::reflect::value::{TypedValue, ValueContent};

    #[test]
    fn a_count_of_one_has_no_plural() {
        assert_eq!(with_plural(1, "ray"), "1 ray");
        assert_eq!(with_plural(0, "ray"), "0 rays");
        assert_eq!(counts(&[]), "");
        assert_eq!(fate(&[], None), "no ray was traced");
    }

    #[test]
    fn a_place_names_the_buffer() {
        let value = TypedValue { ty: "uint".into(), content: ValueContent::Uint(0) };
        let of = |member: Option<&str>| {
            let member = member.map(str::to_owned);
            let (before, after) = (value.clone(), value.clone());
            let at = ChangeLocation::Byte(4);
            place(&MemoryChange {
                resource: "sums".into(),
                set: None,
                binding: None,
                at,
                member,
                before,
                after,
            })
        };
        assert_eq!(of(Some("values[1]")), "values[1]");
        assert_eq!(of(Some("[1]")), "sums[1]");
        assert_eq!(of(Some("[1].weight")), "sums[1].weight");
        assert_eq!(of(Some("")), "sums");
        assert_eq!(of(None), "sums byte 4");
    }
}
