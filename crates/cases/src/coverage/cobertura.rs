//! The XML format of Cobertura (coverage-04.dtd), which GitLab, Jenkins and Azure read.

use std::fmt::Write;

use crate::coverage::{Coverage, FileCoverage, sum};
use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;

/// Covered count and total count.
type Part = [usize; 2];

impl Coverage {
    /// The lines and branches as XML of Cobertura: a class for each file, a package for each
    /// folder. `sources` is the folder from which files are named. There is no time stamp, so that
    /// equal coverage has equal bytes.
    pub fn cobertura(&self, sources: &str) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        let _ = self.write_cobertura(&mut text, sources);
        text
    }

    fn write_cobertura(&self, out: &mut String, sources: &str) -> std::fmt::Result {
        let [lines, branches] = self.totals();
        writeln!(
            out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <!DOCTYPE coverage SYSTEM \"http://cobertura.sourceforge.net/xml/coverage-04.dtd\">\n\
             <coverage {} lines-covered=\"{}\" lines-valid=\"{}\" branches-covered=\"{}\" \
             branches-valid=\"{}\" complexity=\"0\" version=\"anyhit {}\" timestamp=\"0\">",
            rates([lines, branches]),
            lines[0],
            lines[1],
            branches[0],
            branches[1],
            env!("CARGO_PKG_VERSION"),
        )?;
        writeln!(out, "  <sources>\n    <source>{}</source>\n  </sources>", escape::markup(sources))?;
        writeln!(out, "  <packages>")?;
        let files: Vec<(&String, &FileCoverage)> = self.files.iter().collect();
        for group in files.chunk_by(|(one, _), (next, _)| folder(one) == folder(next)) {
            writeln!(
                out,
                "    <package name=\"{}\" {} complexity=\"0\">\n      <classes>",
                escape::markup(folder(group[0].0)),
                rates(sum(group.iter().map(|(_, file)| *file))),
            )?;
            group.iter().try_for_each(|(name, file)| class(out, name, file))?;
            writeln!(out, "      </classes>\n    </package>")?;
        }
        writeln!(out, "  </packages>\n</coverage>")
    }
}

fn class(out: &mut String, name: &str, file: &FileCoverage) -> std::fmt::Result {
    writeln!(
        out,
        "        <class name=\"{}\" filename=\"{}\" {} complexity=\"0\">\n          <methods/>\n          <lines>",
        escape::markup(name.rsplit('/').next().unwrap_or(name)),
        escape::markup(name),
        rates(file.totals()),
    )?;
    let mut ways: SortedMap<u32, Part> = SortedMap::new();
    for (edge, taken) in &file.branches {
        let [some, all] = ways.entry(edge.line).or_default();
        *some += usize::from(taken.is_some_and(|taken| taken > 0));
        *all += 1;
    }
    for (line, count) in &file.lines {
        let branch = match ways.get(line) {
            None => "false\"".to_owned(),
            Some([taken, all]) => {
                format!("true\" condition-coverage=\"{}% ({taken}/{all})\"", 100 * taken / all)
            }
        };
        writeln!(out, "            <line number=\"{line}\" hits=\"{count}\" branch=\"{branch}/>")?;
    }
    writeln!(out, "          </lines>\n        </class>")
}

/// The name of a file's package.
fn folder(name: &str) -> &str {
    name.rsplit_once('/').map_or(".", |(folder, _)| folder)
}

/// The attributes of an element with the covered parts of lines and branches.
fn rates([lines, branches]: [Part; 2]) -> String {
    // An empty set counts as covered.
    let rate = |[some, all]: Part| if all == 0 { 1.0 } else { some as f64 / all as f64 };
    format!("line-rate=\"{:.4}\" branch-rate=\"{:.4}\"", rate(lines), rate(branches))
}

#[cfg(test)]
mod tests {
    use crate::coverage::{Coverage, Edge, FileCoverage};

    #[test]
    fn a_line_has_its_hits_and_the_ways_of_its_branches() {
        let mut file = FileCoverage::default();
        file.lines.extend([(3, 7), (4, 0)]);
        for (way, taken) in [(0, Some(7)), (1, None)] {
            file.branches.insert(Edge { line: 3, branch: 0, way }, taken);
        }
        let mut coverage = Coverage::default();
        for name in ["a/<b>.rchit", "a/c.comp", "d.comp"] {
            coverage.files.insert(name.into(), file.clone());
        }
        let xml = coverage.cobertura("/home/a&b");
        for line in [
            "<line number=\"3\" hits=\"7\" branch=\"true\" condition-coverage=\"50% (1/2)\"/>",
            "<line number=\"4\" hits=\"0\" branch=\"false\"/>",
            "<source>/home/a&amp;b</source>",
            "filename=\"a/&lt;b&gt;.rchit\" line-rate=\"0.5000\" branch-rate=\"0.5000\"",
            "<coverage line-rate=\"0.5000\" branch-rate=\"0.5000\" lines-covered=\"3\" lines-valid=\"6\"",
        ] {
            assert!(xml.contains(line), "{line}: {xml}");
        }
        assert_eq!(xml.matches("<package name=").count(), 2);
        assert!(xml.contains("<package name=\"a\"") && xml.contains("<package name=\".\""), "{xml}");
    }
}
