//! `initialize`: who the client is, and what this adapter can do.

use emmy_dap_types::requests::{InitializeArguments, PathFormat};
use emmy_dap_types::types::Capabilities;

use super::Adapter;
use super::exceptions::ExceptionFilters;
use super::protocol::{Answer, Request, body};

/// What the client said of itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Client {
    /// The number of its first line.
    first: i64,
    /// The number of its first column.
    first_column: i64,
    /// Whether its paths are URIs.
    pub(super) sends_uris: bool,
    /// Whether it can be told that values have changed.
    pub(super) takes_invalidated: bool,
}

impl Default for Client {
    fn default() -> Self {
        Self { first: 1, first_column: 1, sends_uris: false, takes_invalidated: false }
    }
}

impl Client {
    /// The client's number of a line.
    pub(super) fn line(self, line: u32) -> i64 {
        i64::from(line) - 1 + self.first
    }

    /// The client's number of a column; where it is not known, of the first.
    pub(super) fn column(self, column: u32) -> i64 {
        i64::from(column.max(1)) - 1 + self.first_column
    }

    /// The column that the client means, from 1.
    pub(super) fn column_from(self, column: i64) -> u32 {
        let column = column.saturating_sub(self.first_column).saturating_add(1);
        u32::try_from(column.max(1)).unwrap_or(u32::MAX)
    }

    /// The line that the client means; the first where it has no such number.
    pub(super) fn line_from(self, line: i64) -> u32 {
        let line = line.saturating_sub(self.first).saturating_add(1);
        u32::try_from(line.max(1)).unwrap_or(u32::MAX)
    }
}

impl Adapter {
    pub(super) fn initialize(&mut self, request: &Request) -> Answer {
        let arguments: InitializeArguments = request.arguments()?;
        self.client = Client {
            first: i64::from(arguments.lines_start_at1.unwrap_or(true)),
            first_column: i64::from(arguments.columns_start_at1.unwrap_or(true)),
            sends_uris: matches!(arguments.path_format, Some(PathFormat::Uri)),
            takes_invalidated: arguments.supports_invalidated_event.unwrap_or(false),
        };
        let yes = Some(true);
        body(Capabilities {
            supports_configuration_done_request: yes,
            supports_function_breakpoints: yes,
            supports_conditional_breakpoints: yes,
            supports_hit_conditional_breakpoints: yes,
            supports_evaluate_for_hovers: yes,
            exception_breakpoint_filters: Some(ExceptionFilters::offered()),
            supports_exception_filter_options: yes,
            supports_completions_request: yes,
            supports_step_back: yes,
            supports_set_variable: yes,
            supports_set_expression: yes,
            supports_modules_request: yes,
            supports_restart_request: yes,
            supports_exception_info_request: yes,
            supports_delayed_stack_trace_loading: yes,
            supports_loaded_sources_request: yes,
            supports_log_points: yes,
            supports_terminate_request: yes,
            supports_data_breakpoints: yes,
            supports_read_memory_request: yes,
            supports_disassemble_request: yes,
            supports_cancel_request: yes,
            supports_breakpoint_locations_request: yes,
            supports_clipboard_context: yes,
            supports_stepping_granularity: yes,
            supports_instruction_breakpoints: yes,
            ..Capabilities::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Client;

    #[test]
    fn lines_are_counted_as_the_client_counts_them() {
        let from_zero = Client { first: 0, ..Client::default() };
        assert_eq!((from_zero.line(1), from_zero.line_from(0)), (0, 1));
        let from_one = Client::default();
        assert_eq!((from_one.line(7), from_one.line_from(7)), (7, 7));
        assert_eq!(from_one.line_from(i64::MIN), 1);
        assert_eq!(from_one.line_from(i64::MAX), u32::MAX);
    }
}
