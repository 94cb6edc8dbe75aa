//! Finds where two runs part: the first value that differs, and the first way that differs.
//!
//! It compares the JSON of two transcripts, so that one of them may be of an earlier version of the
//! shaders. Numbers of lines are not compared, as an edit moves them.

use std::collections::{HashMap, HashSet};

use serde_json::Value;

use anyhit_base::style::Style;
use anyhit_explain::page::Page;

/// A place where two runs differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RunDifference {
    /// The shaders and rays that it is in, the outermost first.
    pub path: Vec<String>,
    /// The line of the first run, `file:line: text`, where it is known.
    pub line: Option<String>,
    /// What differs.
    pub what: String,
    /// It in the first and in the second run.
    pub values: [String; 2],
}

/// Where two runs part.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Parting {
    /// The first difference of all.
    pub value: Option<RunDifference>,
    /// The first thing that went another way: another hit, another shader, another line.
    pub way: Option<RunDifference>,
}

/// Whether a difference is of a value alone.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Value,
    Way,
}

/// What of a ray is compared before its traversal, in order.
const OF_RAY: [&str; 11] = [
    "origin",
    "direction",
    "t_min",
    "t_max",
    "flags",
    "cull_mask",
    "time",
    "sbt_offset",
    "sbt_stride",
    "miss_index",
    "payload_before",
];

/// Where the runs of two transcripts part, given as JSON.
pub(super) fn parting(first: &Value, second: &Value) -> Parting {
    let mut comparison = Comparison::default();
    comparison.step(&first["root"], &second["root"]);
    comparison.writes(&first["writes"], &second["writes"]);
    comparison.plain("trap", Kind::Way, &first["trap"]["message"], &second["trap"]["message"]);
    comparison.found
}

#[derive(Default)]
struct Comparison {
    path: Vec<String>,
    line: Option<String>,
    /// The number of the next ray among those of its shader.
    ray_number: Option<usize>,
    found: Parting,
}

impl Comparison {
    fn differ(&mut self, what: &str, kind: Kind, values: [String; 2]) {
        let difference = || RunDifference {
            path: self.path.clone(),
            line: self.line.clone(),
            what: what.to_owned(),
            values,
        };
        match kind {
            Kind::Way if self.found.way.is_none() => {
                let difference = difference();
                self.found.value.get_or_insert_with(|| difference.clone());
                self.found.way = Some(difference);
            }
            Kind::Value if self.found.value.is_none() => self.found.value = Some(difference()),
            _ => {}
        }
    }

    /// Compares two values as a whole.
    fn plain(&mut self, what: &str, kind: Kind, a: &Value, b: &Value) {
        if a != b {
            self.differ(what, kind, [show(a), show(b)]);
        }
    }

    /// Compares two typed values; of structs the members, by their names.
    fn typed(&mut self, what: &str, a: &Value, b: &Value) {
        if a == b {
            return;
        }
        let (Some(of_a), Some(of_b)) = (members(a), members(b)) else {
            self.plain(what, Kind::Value, a, b);
            return;
        };
        for (member, other) in of_one_name(of_a, of_b) {
            let name = member["name"].as_str().unwrap_or_default();
            self.typed(&format!("{what}.{name}"), member, other);
        }
    }

    /// Compares lists of values with names: each with its namesake. What one of the runs alone has
    /// is no difference of values: the sources or the surfaces that are hit differ.
    fn named(&mut self, fallback: &str, a: &Value, b: &Value) {
        let list = |value: &Value| value.as_array().map_or(&[][..], Vec::as_slice).to_vec();
        let (of_a, of_b) = (list(a), list(b));
        for (one, other) in of_one_name(&of_a, &of_b) {
            self.typed(one["name"].as_str().unwrap_or(fallback), one, other);
        }
    }

    /// Goes into a part with a name.
    fn inside(&mut self, name: String, compare: impl FnOnce(&mut Self)) {
        self.path.push(name);
        let line = self.line.take();
        compare(self);
        self.line = line;
        self.path.pop();
    }

    fn step(&mut self, a: &Value, b: &Value) {
        if a["kind"] != b["kind"] {
            self.differ("the next step", Kind::Way, [step_name(a), step_name(b)]);
            return;
        }
        match a["kind"].as_str() {
            Some("shader") => self.shader(a, b),
            Some("trace" | "ray_query") => {
                self.line = place(&a["called_at"]);
                let number = self.ray_number.take().map_or_else(String::new, |at| format!(" (number {at})"));
                let name = format!("{}{number}", step_name(a));
                let line = self.line.clone();
                self.inside(name, |inner| {
                    inner.line = line;
                    inner.ray(a, b);
                });
                self.line = None;
            }
            _ => {
                self.plain("the reported t", Kind::Value, &a["t"], &b["t"]);
                self.plain("the hit kind", Kind::Value, &a["hit_kind"], &b["hit_kind"]);
                self.plain("whether the hit was accepted", Kind::Way, &a["accepted"], &b["accepted"]);
            }
        }
    }

    fn ray(&mut self, a: &Value, b: &Value) {
        for name in OF_RAY {
            self.typed(&name.replace('_', " "), &a[name], &b[name]);
        }
        self.instances(&a["instances"], &b["instances"]);
        for (one, other) in pairs(&a["decisions"], &b["decisions"]) {
            self.candidate(one, other);
        }
        for (one, other) in pairs(&a["candidates"], &b["candidates"]) {
            self.candidate(one, other);
        }
        self.hit(&a["hit"], &b["hit"]);
        self.plain("the record", Kind::Way, &a["record"]["index"], &b["record"]["index"]);
        self.optional_shader(&a["shader"], &b["shader"]);
        self.typed("payload after the ray", &a["payload_after"], &b["payload_after"]);
        self.plain("how the query ended", Kind::Way, &a["end"], &b["end"]);
    }

    fn instances(&mut self, a: &Value, b: &Value) {
        for (one, other) in pairs(a, b) {
            let name = match (one, other) {
                (Value::Null, present) | (present, _) => format!("instance {}", show(&present["instance"])),
            };
            self.plain(&format!("{name}, verdict"), Kind::Way, &one["verdict"], &other["verdict"]);
            for (tested, against) in pairs(&one["tested"], &other["tested"]) {
                let primitive = |one: &Value| match one {
                    Value::Null => "none".to_owned(),
                    one => {
                        format!("geometry {}, primitive {}", show(&one["geometry"]), show(&one["primitive"]))
                    }
                };
                let both = [primitive(tested), primitive(against)];
                if both[0] != both[1] {
                    self.differ(&format!("{name}, the next primitive tested"), Kind::Way, both);
                    continue;
                }
                let what = format!("{name}, {}", both[0]);
                self.plain(&format!("{what}, t"), Kind::Value, &tested["t"], &against["t"]);
                self.plain(&format!("{what}, verdict"), Kind::Way, &tested["verdict"], &against["verdict"]);
            }
        }
    }

    fn candidate(&mut self, a: &Value, b: &Value) {
        let name = |one: &Value| match one {
            Value::Null => "none".to_owned(),
            one => format!("instance {}, primitive {}", show(&one["instance"]), show(&one["primitive"])),
        };
        if name(a) != name(b) {
            self.differ("the next candidate", Kind::Way, [name(a), name(b)]);
            return;
        }
        self.plain("the candidate's t", Kind::Value, &a["t"], &b["t"]);
        self.plain("the candidate's record", Kind::Way, &a["record"]["index"], &b["record"]["index"]);
        self.plain("whether the candidate was confirmed", Kind::Way, &a["confirmed"], &b["confirmed"]);
        self.plain("the hits generated for the candidate", Kind::Value, &a["generated"], &b["generated"]);
        self.optional_shader(&a["shader"], &b["shader"]);
    }

    fn hit(&mut self, a: &Value, b: &Value) {
        let name = |hit: &Value| match hit {
            Value::Null => "a miss".to_owned(),
            hit => format!(
                "instance {}, geometry {}, primitive {}",
                show(&hit["instance"]),
                show(&hit["geometry"]),
                show(&hit["primitive"])
            ),
        };
        if name(a) != name(b) {
            self.differ("the hit", Kind::Way, [name(a), name(b)]);
        }
        self.plain("the hit's t", Kind::Value, &a["t"], &b["t"]);
        self.plain("the surface hit", Kind::Way, &a["surface"], &b["surface"]);
        self.plain("the hit kind", Kind::Way, &a["hit_kind"], &b["hit_kind"]);
        self.named("the attribute", &a["attributes"], &b["attributes"]);
    }

    fn optional_shader(&mut self, a: &Value, b: &Value) {
        if !a.is_null() && !b.is_null() {
            self.shader(a, b);
        } else if a != b {
            self.differ("the shader that runs", Kind::Way, [shader_name(a), shader_name(b)]);
        }
    }

    fn shader(&mut self, a: &Value, b: &Value) {
        if !is_same_shader(a, b) {
            self.differ("the shader that runs", Kind::Way, [shader_name(a), shader_name(b)]);
            return;
        }
        self.inside(shader_name(a), |inner| inner.run(a, b));
    }

    fn run(&mut self, a: &Value, b: &Value) {
        self.named("a builtin", &a["builtins"], &b["builtins"]);
        self.typed("hit attribute", &a["attributes"], &b["attributes"]);
        self.typed("payload before", &a["payload_before"], &b["payload_before"]);
        let lines = common_lines(&a["lines"], &b["lines"]);
        let (mut next, mut rays) = (0, 0);
        for (step, other) in pairs(&a["steps"], &b["steps"]) {
            // Lines that first ran before that of the step.
            let own = &step["called_at"];
            let at =
                lines.iter().position(|(line, _)| line["line"] == own["line"] && line["file"] == own["file"]);
            if let Some(at) = at.filter(|at| *at > next) {
                lines[next..at].iter().for_each(|(one, other)| self.line(one, other));
                next = at;
            }
            self.ray_number = is_ray(step).then_some(rays);
            self.step(step, other);
            rays += usize::from(is_ray(step));
        }
        lines[next..].iter().for_each(|(one, other)| self.line(one, other));
        self.typed("payload after", &a["payload_after"], &b["payload_after"]);
        self.line = place(&a["exit"]["at"]);
        self.plain("how the shader ended", Kind::Way, &a["exit"]["how"], &b["exit"]["how"]);
        self.line = None;
    }

    /// Compares what a line set in both runs.
    fn line(&mut self, a: &Value, b: &Value) {
        self.line = place(a).or_else(|| place(b));
        match (a, b) {
            (Value::Null, _) | (_, Value::Null) => {
                let ran = |line: &Value| if line.is_null() { "does not run" } else { "runs" }.to_owned();
                self.differ("the line", Kind::Way, [ran(a), ran(b)]);
            }
            _ => {
                let name = |one: &Value| one["name"].as_str().unwrap_or_default().to_owned();
                let others: HashMap<String, &Value> =
                    b["values"].as_array().into_iter().flatten().map(|one| (name(one), one)).collect();
                for value in a["values"].as_array().into_iter().flatten() {
                    let Some(other) = others.get(&name(value)) else { continue };
                    self.typed(&name(value), &value["first"], &other["first"]);
                    self.typed(&format!("{}, the last time", name(value)), &value["last"], &other["last"]);
                }
                self.plain("how often the line ran", Kind::Way, &a["count"], &b["count"]);
            }
        }
        self.line = None;
    }

    fn writes(&mut self, a: &Value, b: &Value) {
        let place = |write: &Value| match &write["member"] {
            Value::String(member) => format!("{} {member}", show(&write["resource"])),
            _ => format!("{} {}", show(&write["resource"]), write["at"]),
        };
        let list = |value: &Value| value.as_array().map_or(&[][..], Vec::as_slice).to_vec();
        let (of_a, of_b) = (list(a), list(b));
        let changed = |all: &[Value], at: &str| all.iter().find(|one| place(one) == at).cloned();
        for one in &of_a {
            let at = place(one);
            let what = format!("the value written to {at}");
            match changed(&of_b, &at) {
                Some(other) => self.typed(&what, &one["after"], &other["after"]),
                None => self.differ(&what, Kind::Value, [show(&one["after"]), "no change".to_owned()]),
            }
        }
        for other in of_b.iter().filter(|other| changed(&of_a, &place(other)).is_none()) {
            let what = format!("the value written to {}", place(other));
            self.differ(&what, Kind::Value, ["no change".to_owned(), show(&other["after"])]);
        }
    }
}

/// The lines of two runs in the order of the first: those of one text are one line. A line that
/// only one of the runs has is left out where the other's source does not have its text, as that
/// was edited; where lines were not followed in one of them there are none.
fn common_lines<'a>(a: &'a Value, b: &'a Value) -> Vec<(&'a Value, &'a Value)> {
    let (Some(of_a), Some(of_b)) = (a.as_array(), b.as_array()) else { return Vec::new() };
    let key = |line: &Value| (show(&line["function"]), show(&line["text"]));
    let others: HashMap<_, &Value> = of_b.iter().map(|line| (key(line), line)).collect();
    let own: HashSet<_> = of_a.iter().map(key).collect();
    // Where the numbers of all common lines are the same, nothing was edited.
    let is_same_source =
        of_a.iter().all(|line| others.get(&key(line)).is_none_or(|other| other["line"] == line["line"]));
    let mut lines: Vec<(&Value, &Value)> = of_a
        .iter()
        .filter_map(|line| match others.get(&key(line)) {
            Some(other) => Some((line, *other)),
            None => is_same_source.then_some((line, &Value::Null)),
        })
        .collect();
    if is_same_source {
        lines.extend(of_b.iter().filter(|line| !own.contains(&key(line))).map(|line| (&Value::Null, line)));
    }
    lines
}

/// The elements of two lists by their places; where one is shorter, null.
fn pairs<'a>(a: &'a Value, b: &'a Value) -> impl Iterator<Item = (&'a Value, &'a Value)> {
    let list = |value: &'a Value| value.as_array().map_or(&[][..], Vec::as_slice);
    let (a, b) = (list(a), list(b));
    let at = |list: &'a [Value], at: usize| list.get(at).unwrap_or(&Value::Null);
    (0..a.len().max(b.len())).map(move |number| (at(a, number), at(b, number)))
}

/// The elements of two lists that have one name, in the order of the first list.
fn of_one_name<'a>(a: &'a [Value], b: &'a [Value]) -> impl Iterator<Item = (&'a Value, &'a Value)> {
    a.iter().filter_map(|one| Some((one, b.iter().find(|other| other["name"] == one["name"])?)))
}

/// Whether two runs are of one shader: of the same stage, and either of one name in their scenes or
/// of one file and entry point.
fn is_same_shader(a: &Value, b: &Value) -> bool {
    let (one, other) = (&a["shader"], &b["shader"]);
    let has_file = !one["file"].is_null() && one["file"] == other["file"] && one["entry"] == other["entry"];
    one["stage"] == other["stage"] && (has_file || shader_name(a) == shader_name(b))
}

/// The members of a typed value that is a struct.
fn members(value: &Value) -> Option<&Vec<Value>> {
    let members = value["value"].as_array()?;
    members.first()?.get("name").map(|_| members)
}

fn step_name(step: &Value) -> String {
    match step["kind"].as_str() {
        Some("trace") => format!("ray at depth {}", step["depth"]),
        Some("ray_query") => "ray query".to_owned(),
        Some("shader") => shader_name(step),
        Some("report") => "a reported hit".to_owned(),
        _ => "none".to_owned(),
    }
}

fn is_ray(step: &Value) -> bool {
    matches!(step["kind"].as_str(), Some("trace" | "ray_query"))
}

fn shader_name(run: &Value) -> String {
    if run.is_null() {
        return "none".to_owned();
    }
    let shader = &run["shader"];
    let name = if shader["name"].is_null() { &shader["entry"] } else { &shader["name"] };
    format!("{} `{}`", show(&shader["stage"]), show(name))
}

/// A line as `file:line: text`.
fn place(line: &Value) -> Option<String> {
    let file = line["file"].as_str()?;
    let text = line["text"].as_str().map_or_else(String::new, |text| format!(": {text}"));
    Some(format!("{file}:{}{text}", line["line"]))
}

/// A value in words: `vec3(0, 0.5, 1)`, `float 0.5`.
fn show(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) => {
            let text = number.to_string();
            text.strip_suffix(".0").map_or_else(|| text.clone(), str::to_owned)
        }
        Value::Array(items) => {
            let items: Vec<String> = items
                .iter()
                .map(|item| match item["name"].as_str() {
                    Some(name) => format!("{name}: {}", show(item)),
                    None => show(item),
                })
                .collect();
            format!("({})", items.join(", "))
        }
        Value::Object(object) => match (object.get("type").and_then(Value::as_str), object.get("value")) {
            (Some(ty), Some(list @ Value::Array(_))) => format!("{ty}{}", show(list)),
            (Some(ty), Some(value)) => format!("{ty} {}", show(value)),
            _ => value.to_string(),
        },
        Value::Bool(value) => value.to_string(),
    }
}

/// Two runs and where they part, as text; `names` says which runs they are.
pub(in crate::cli) fn text(first: &Value, second: &Value, names: [&str; 2], colour: bool) -> String {
    let mut page = Page::new(colour);
    page.rows([("A", names[0]), ("B", names[1])]);
    let Parting { value, way } = parting(first, second);
    match &value {
        None => {
            page.blank_line();
            page.line(page.styled(Style::Heading, "no difference"));
        }
        Some(value) => {
            difference(&mut page, "the first value that differs", value);
            match &way {
                Some(way) if way != value => difference(&mut page, "the first divergence", way),
                Some(_) => {}
                None => {
                    page.blank_line();
                    page.line("the runs do not diverge");
                }
            }
        }
    }
    for (name, run) in ["A", "B"].into_iter().zip([first, second]) {
        page.blank_line();
        page.line(page.styled(Style::Heading, format_args!("outcome of {name}")));
        let line = |line: &Value| (format!("  {}", show(&line["about"])), show(&line["text"]));
        page.rows(run["summary"].as_array().into_iter().flatten().map(line));
    }
    page.finish()
}

fn difference(page: &mut Page, title: &str, difference: &RunDifference) {
    page.blank_line();
    page.line(page.styled(Style::Heading, title));
    page.nested("  ", |page| {
        if !difference.path.is_empty() {
            page.line(format_args!("in {}", difference.path.join(" > ")));
        }
        if let Some(line) = &difference.line {
            page.line(format_args!("at {line}"));
        }
        page.line(format_args!("{}:", difference.what));
        let [first, second] = &difference.values;
        page.rows([("  A", first), ("  B", second)]);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn run(lines: Value, hit: Value) -> Value {
        let ray = json!({ "kind": "trace", "depth": 1, "hit": hit, "origin": [0.0, 0.0, 4.0] });
        json!({ "root": {
            "kind": "shader", "shader": { "stage": "RayGenerationKHR", "name": "main" },
            "lines": lines, "steps": [ray],
        } })
    }

    fn line(number: u32, text: &str, value: f32) -> Value {
        let value = json!({ "type": "float", "value": value });
        json!({ "file": "a.rgen", "line": number, "text": text, "function": "main", "count": 1,
                "values": [{ "name": "x", "count": 1, "first": value, "last": value }] })
    }

    #[test]
    fn equal_runs_do_not_part() {
        let one = run(json!([line(3, "x = 1;", 1.0)]), json!({ "instance": 0, "t": 2.0 }));
        assert_eq!(parting(&one, &one), Parting::default());
    }

    #[test]
    fn a_value_and_a_way_are_told_apart() {
        let hit = |primitive: u32| json!({ "instance": 0, "geometry": 0, "primitive": primitive, "t": 2.0 });
        let one = run(json!([line(3, "x = f();", 1.0)]), hit(4));
        // A line more before it moves the number; the text is the same.
        let two = run(json!([line(4, "x = f();", 1.5)]), hit(5));
        let found = parting(&one, &two);
        let way = found.way.expect("another hit");
        assert_eq!(way.what, "the hit");
        assert_eq!(way.path, ["RayGenerationKHR `main`", "ray at depth 1 (number 0)"]);
        assert_eq!(
            way.values,
            ["instance 0, geometry 0, primitive 4", "instance 0, geometry 0, primitive 5"]
        );
        let one = run(json!([line(3, "x = f();", 1.0)]), hit(4));
        let two = run(json!([line(4, "x = f();", 1.5)]), hit(4));
        let found = parting(&one, &two);
        let value = found.value.expect("another value");
        assert_eq!((value.what.as_str(), value.line.as_deref()), ("x", Some("a.rgen:3: x = f();")));
        assert_eq!(value.values, ["float 1", "float 1.5"]);
        assert_eq!(found.way, None);
    }

    #[test]
    fn a_line_that_one_run_alone_has_is_another_way() {
        let one = run(json!([line(3, "x = f();", 1.0), line(5, "x = 2;", 2.0)]), Value::Null);
        let two = run(json!([line(3, "x = f();", 1.0)]), Value::Null);
        let way = parting(&one, &two).way.expect("the line");
        assert_eq!(
            (way.line.as_deref(), way.values),
            (Some("a.rgen:5: x = 2;"), ["runs".to_owned(), "does not run".to_owned()],)
        );
    }

    /// Runs of one shader that read other builtins: each is compared with its namesake.
    #[test]
    fn builtins_members_and_writes_are_compared_by_name() {
        let value = |name: &str, ty: &str, value: f32| json!({ "name": name, "type": ty, "value": value });
        let run = |builtins: Value| {
            let shader =
                json!({ "stage": "ClosestHitKHR", "name": "hit", "file": "a.rchit", "entry": "main" });
            json!({ "root": { "kind": "shader", "shader": shader, "builtins": builtins } })
        };
        let one = run(json!([value("RayTmaxKHR", "float", 2.0)]));
        let two = run(json!([value("HitKindKHR", "uint", 255.0), value("RayTmaxKHR", "float", 2.0)]));
        assert_eq!(parting(&one, &two), Parting::default());
        assert_eq!(parting(&two, &one), Parting::default());
        let other = run(json!([value("HitKindKHR", "uint", 255.0), value("RayTmaxKHR", "float", 3.0)]));
        let found = parting(&one, &other).value.expect("another t");
        assert_eq!((found.what.as_str(), found.values), ("RayTmaxKHR", ["float 2".into(), "float 3".into()]));

        let payload = |members: Value| json!({ "type": "P", "value": members });
        let mut comparison = Comparison::default();
        comparison.typed(
            "payload",
            &payload(json!([value("t", "float", 1.0)])),
            &payload(json!([value("seen", "uint", 4.0), value("t", "float", 1.0)])),
        );
        assert_eq!(comparison.found, Parting::default());

        let write = |member: &str, to: f32| json!({ "resource": "out", "member": member, "after": value("", "float", to) });
        comparison
            .writes(&json!([write("out[1]", 1.0)]), &json!([write("out[0]", 5.0), write("out[1]", 1.0)]));
        let found = comparison.found.value.expect("one write more");
        assert_eq!(found.what, "the value written to out out[0]");
        assert_eq!(found.values, ["no change".to_owned(), "float 5".to_owned()]);
    }

    #[test]
    fn a_shader_is_the_same_under_another_name_and_in_one_stage_alone() {
        let run = |stage: &str, name: &str, file: &str| json!({ "shader": { "stage": stage, "name": name, "file": file, "entry": "main" } });
        let of = |name: &str, file: &str| run("MissKHR", name, file);
        assert!(is_same_shader(&of("sky", "a.rmiss"), &of("blue", "a.rmiss")));
        assert!(is_same_shader(&of("sky", "a.rmiss"), &of("sky", "b.rmiss")));
        assert!(!is_same_shader(&of("sky", "a.rmiss"), &of("blue", "b.rmiss")));
        assert!(!is_same_shader(&of("all", "a.slang"), &run("ClosestHitKHR", "all", "a.slang")));
    }

    #[test]
    fn members_are_compared_by_themselves() {
        let payload = |seen: u32| {
            json!({ "type": "Payload", "value": [
            { "name": "t", "type": "float", "value": 1.0 }, { "name": "seen", "type": "uint", "value": seen } ] })
        };
        let mut comparison = Comparison::default();
        comparison.typed("payload", &payload(1), &payload(2));
        let value = comparison.found.value.expect("a difference");
        assert_eq!((value.what, value.values), ("payload.seen".into(), ["uint 1".into(), "uint 2".into()]));
    }
}
