//! Renders ray queries as text.

use crate::debug::page::{Ink, Page};
use crate::debug::render::{Way, Writer, called_at, ray};
use crate::debug::transcript::{QueryCandidate, QueryEnd, QueryReport};

impl Writer {
    pub(super) fn query(&mut self, query: &QueryReport) {
        let head = self.page.ink(Ink::Head, "ray query");
        self.page
            .line(format_args!("{head}{}", called_at(query.traversal.called_at.as_ref(), "initialised")));
        self.page.nested("│ ", |page| {
            let mut inner = Self { page: std::mem::replace(page, Page::new(false)), all: self.all };
            inner.query_body(query);
            *page = inner.page;
        });
    }

    fn query_body(&mut self, query: &QueryReport) {
        self.page.rows(ray(&query.traversal));
        self.page.gap();
        let shown = query.candidates.iter().map(|one| [one.instance, one.geometry, one.primitive]);
        let way = Way { traversal: &query.traversal, hit: query.hit.as_ref(), shown: shown.collect() };
        self.instances(&way);
        for candidate in &query.candidates {
            self.page.gap();
            self.query_candidate(candidate);
        }
        self.page.gap();
        match &query.hit {
            Some(hit) => self.hit(hit),
            None => {
                let head = self.page.ink(Ink::Head, "nothing committed");
                self.page.line(head);
            }
        }
        let end = match query.end {
            QueryEnd::Complete => "complete: OpRayQueryProceedKHR returned false",
            QueryEnd::Terminated => "ended by OpRayQueryTerminateKHR",
            QueryEnd::Underway => "left before its end",
        };
        self.page.line(end);
    }

    fn query_candidate(&mut self, candidate: &QueryCandidate) {
        let QueryCandidate { instance, geometry, primitive, t, is_box, opaque, .. } = candidate;
        let head = self.page.ink(Ink::Head, if *is_box { "box" } else { "candidate" });
        let at = if *is_box { "entered at" } else { "at" };
        let opaque = if *opaque { ", opaque" } else { "" };
        self.page.line(format_args!(
            "{head}  instance {instance}, geometry {geometry}, primitive {primitive}, {at} t {t}{opaque}"
        ));
        if candidate.confirmed {
            let text = self.page.ink(Ink::Kept, "confirmed");
            self.page.line(format_args!("  {text}"));
        }
        for t in &candidate.generated {
            let text = self.page.ink(Ink::Kept, format_args!("hit generated at t {t}"));
            self.page.line(format_args!("  {text}"));
        }
        if !candidate.confirmed && candidate.generated.is_empty() {
            let text = self.page.ink(Ink::Dim, "passed over");
            self.page.line(format_args!("  {text}"));
        }
    }
}
