//! The numbers of heat maps as text and as JSON.

use serde_json::{Value, json};

use anyhit_base::count::grouped;
use anyhit_base::sorted::json_object;
use anyhit_cases::drawing::heat_map::number;
use anyhit_cases::picture_page::{WORST, heat_facts};
use anyhit_cases::pixel_cost::{Heat, InvocationPlane};

/// The version of what `--json` prints.
const VERSION: u32 = 1;

/// A heat map as text, with commands that explain the worst invocations: what is before and behind
/// the ID of each.
pub(super) fn format_heat(heat: &Heat, plane: &InvocationPlane, command: Option<&[String; 2]>) -> String {
    let word = plane.kind.word();
    let mut text = format!("{}, {}\n", heat.title(), plane.size_words());
    for line in heat_facts(heat) {
        text += &format!("  {line}\n");
    }
    let (worst, ties) = heat.worst(WORST);
    let worst: Vec<(String, String)> = worst
        .into_iter()
        .map(|(pixel, value)| {
            let id = plane.id_words(pixel);
            let place = match command {
                Some([before, behind]) => format!("{before}{id}{behind}"),
                None => format!("{word} {id}"),
            };
            (number(value), place)
        })
        .collect();
    if !worst.is_empty() {
        text += &format!("worst {word}s:\n");
    }
    let width = worst.iter().map(|(value, _)| value.len()).max().unwrap_or(0);
    for (value, place) in worst {
        text += &format!("  {value:>width$}  {place}\n");
    }
    if ties > 0 {
        text += &format!("  {} more {word}s have the same number as the last one\n", grouped(ties));
    }
    text
}

/// A heat map as JSON, with commands as [`format_heat`] has them.
pub(super) fn heat_json(heat: &Heat, plane: &InvocationPlane, command: Option<&[String; 2]>) -> String {
    const PERCENTS: [u32; 5] = [0, 50, 90, 99, 100];
    let percentiles = heat.percentiles(PERCENTS);
    let percentiles = json_object(
        PERCENTS.iter().zip(percentiles).map(|(percent, value)| (percent.to_string(), json!(value))),
    );
    let (worst, ties) = heat.worst(WORST);
    let worst: Vec<Value> = worst
        .into_iter()
        .map(|(pixel, value)| {
            let mut one = json!({ "pixel": pixel, "value": value });
            if plane.dimensions() == 3 {
                one["invocation"] = json!(plane.id(pixel));
            }
            if let Some([before, behind]) = command {
                one["command"] = json!(format!("{before}{}{behind}", plane.id_words(pixel)));
            }
            one
        })
        .collect();
    let mut all = json!({
        "version": VERSION,
        "measure": heat.measure.name(),
        "size": heat.extent,
        "total": heat.total(),
        "mean": heat.mean(),
        "percentiles": percentiles,
        "worst": worst,
        "ties": ties,
    });
    if plane.dimensions() == 3 {
        all["invocations"] = json!(plane.size);
    }
    format!("{all:#}\n")
}
