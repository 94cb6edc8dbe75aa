//! Renders ray queries as text.

use crate::render::words::{ray, source_suffix};
use crate::render::{TraversalView, Writer};
use crate::transcript::{QueryCandidate, QueryEnd, QueryReport};
use anyhit_base::style::Style;

impl Writer<'_> {
    pub(super) fn query(&mut self, query: &QueryReport) {
        let head = self.page.styled(Style::Heading, "ray query");
        self.page
            .line(format_args!("{head}{}", source_suffix(query.traversal.called_at.as_ref(), "initialised")));
        self.nested("│ ", |writer| writer.query_body(query));
    }

    fn query_body(&mut self, query: &QueryReport) {
        self.page.rows(ray(&query.traversal));
        self.page.blank_line();
        let shown = query.candidates.iter().map(|one| [one.instance, one.geometry, one.primitive]);
        let view =
            TraversalView { traversal: &query.traversal, hit: query.hit.as_ref(), shown: shown.collect() };
        self.instances(&view);
        for candidate in &query.candidates {
            self.page.blank_line();
            self.query_candidate(candidate);
        }
        self.page.blank_line();
        match &query.hit {
            Some(hit) => self.hit(hit),
            None => {
                let head = self.page.styled(Style::Heading, "nothing committed");
                self.page.line(head);
            }
        }
        let end = match query.end {
            QueryEnd::Complete => "complete: OpRayQueryProceedKHR returned false",
            QueryEnd::Terminated => "ended by OpRayQueryTerminateKHR",
            QueryEnd::Underway => "not completed",
        };
        self.page.line(end);
    }

    fn query_candidate(&mut self, candidate: &QueryCandidate) {
        let QueryCandidate { instance, geometry, primitive, t, is_box, opaque, .. } = candidate;
        let head = self.page.styled(Style::Heading, if *is_box { "box" } else { "candidate" });
        let at = if *is_box { "entered at" } else { "at" };
        let opaque = if *opaque { ", opaque" } else { "" };
        self.page.line(format_args!(
            "{head}  instance {instance}, geometry {geometry}, primitive {primitive}, {at} t {t}{opaque}"
        ));
        if candidate.confirmed {
            let text = self.page.styled(Style::Good, "confirmed");
            self.page.line(format_args!("  {text}"));
        }
        for t in &candidate.generated {
            let text = self.page.styled(Style::Good, format_args!("hit generated at t {t}"));
            self.page.line(format_args!("  {text}"));
        }
        if !candidate.confirmed && candidate.generated.is_empty() {
            let text = self.page.styled(Style::Faint, "passed over");
            self.page.line(format_args!("  {text}"));
        }
    }
}
