//! Float controls (`SPV_KHR_float_controls`): what holds anyway is accepted, the rest is refused.

use anyhit::error::ErrorKind;

use crate::run::Shader;

fn with_mode(mode: &str) -> Shader<'_> {
    Shader { annotations: mode, body: "out 0 %id", ..Shader::default() }
}

#[test]
fn modes_that_hold_anyway_are_accepted() {
    for mode in ["DenormPreserve", "RoundingModeRTE", "SignedZeroInfNanPreserve"] {
        assert_eq!(with_mode(&format!("OpExecutionMode %main {mode} 32")).run()[39][0], 39);
    }
}

#[test]
fn modes_that_would_change_results_are_refused_by_name() {
    for mode in ["DenormFlushToZero", "RoundingModeRTZ"] {
        let error = with_mode(&format!("OpExecutionMode %main {mode} 16")).refused();
        assert_eq!(error.kind(), ErrorKind::UnsupportedModule);
        assert_eq!(
            error.message(),
            format!("entry point `main`: the execution mode {mode} 16 is not supported")
        );
    }
}
