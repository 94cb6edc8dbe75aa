//! The command line: one file per command.
//!
//! A command is a struct of arguments and a function `run`; its results go to standard output
//! through `output`, and [`main`] prints the error that it returns. Its class is the exit code, as
//! `EXIT_CODES` lists; clap exits with 2 for an invalid command line, too.

#[cfg(feature = "stress")]
mod check_math;
mod compare;
mod compile;
mod completions;
#[cfg(feature = "debugger")]
mod dap;
mod input;
mod inspect;
#[cfg(feature = "debugger")]
mod interactive;
mod interrupt;
mod limits;
mod look;
mod man;
mod many_seeds;
mod merge;
mod module_file;
mod numbers;
mod output;
mod page_args;
mod precision;
mod progress;
mod render;
mod run;
mod sanitize;
mod scene;
pub mod scene_schema;
mod schema;
mod share;
mod short_help;
mod smoke;
mod source;
mod stability;
mod stats;
#[cfg(feature = "stress")]
mod stress;
mod suite_report;
mod test;
mod trace_one_ray;
mod verify;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory, Parser};

use anyhit_base::error::Result;
use anyhit_base::escape;
use anyhit_engine::pipeline::BatchWidth;

/// Generates the enum of commands and its dispatch from one line for each command: the file, the
/// variant, the arguments.
macro_rules! commands {
    ($($(#[$when:meta])* $file:ident $variant:ident($args:ident)),* $(,)?) => {
        #[derive(clap::Subcommand)]
        enum Command {
            $($(#[$when])* #[command(after_help = EXIT_CODES)] $variant($file::$args),)*
        }

        impl Command {
            fn run(self) -> Result<()> {
                match self {
                    $($(#[$when])* Self::$variant(args) => $file::run(args),)*
                }
            }
        }
    };
}

commands! {
    inspect Inspect(InspectArgs),
    render Render(RenderArgs),
    run Run(RunArgs),
    scene Scene(SceneArgs),
    trace_one_ray TraceOneRay(TraceOneRayArgs),
    #[cfg(feature = "debugger")]
    dap Dap(DapArgs),
    smoke Smoke(SmokeArgs),
    verify Verify(VerifyArgs),
    compile Compile(CompileArgs),
    schema Schema(SchemaArgs),
    completions Completions(CompletionsArgs),
    man Man(ManArgs),
    #[cfg(feature = "stress")]
    check_math CheckMath(CheckMathArgs),
    #[cfg(feature = "stress")]
    stress Stress(StressArgs),
    test Test(TestArgs),
    merge Merge(MergeArgs),
}

/// Exit codes, as the help of every command lists them.
const EXIT_CODES: &str = "\
Exit codes:
  0  success
  1  an expectation failed
  2  any other error
  3  a shader trapped
  4  a feature is not supported
  5  a limit was exceeded
  6  the sanitizer or --many-seeds denied a finding";

/// Run Vulkan ray-tracing and compute shaders on the CPU.
#[derive(Parser)]
#[command(name = "anyhit", version, arg_required_else_help = true, after_help = EXIT_CODES)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,

    /// When to colour output; on terminals by default, unless the variables NO_COLOR, CLICOLOR or
    /// TERM disable it
    // Its value is read before the rest is parsed.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto", help_heading = "Output")]
    color: output::ColorArg,
}

/// The possible numbers of lanes of a batch; results do not depend on the number.
fn batch_widths() -> impl TypedValueParser<Value = BatchWidth> {
    PossibleValuesParser::new(BatchWidth::ALL.map(BatchWidth::name))
        .try_map(|text| text.parse::<BatchWidth>())
}

/// Parses the command line, runs the command and reports its error on standard error.
///
/// It handles signals of the whole process, and so is for a program that does nothing else.
pub fn main() -> ExitCode {
    interrupt::prepare();
    progress::prepare();
    output::choose_colours(std::env::args_os());
    let arguments = || std::env::args_os().map(|argument| argument.to_string_lossy().into_owned());
    let run = match CommandLine::try_parse().map_err(|error| in_escapes(error, std::env::args_os())) {
        Ok(line) => line.command.run(),
        Err(error) if short_help::is_asked(&error, arguments()) => {
            match short_help::print(CommandLine::command(), arguments()) {
                Ok(()) => return ExitCode::SUCCESS,
                Err(error) => Err(error),
            }
        }
        Err(error) => match output::command_line(&error) {
            Ok(()) => {
                if let Some(feature) = lacking_feature(&error) {
                    output::hint(format_args!(
                        "note: this build of anyhit lacks the feature `{feature}`, which provides the \
                         command\nhelp: build it with `--features {feature}`"
                    ));
                }
                return u8::try_from(error.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from);
            }
            Err(error) => Err(error),
        },
    };
    let Err(error) = run else { return ExitCode::SUCCESS };
    output::report(&error);
    ExitCode::from(error.class().exit_code())
}

/// Parses a command line that clap does not take once more, with control characters as escapes:
/// clap repeats arguments in its answer.
fn in_escapes(answer: clap::Error, arguments: impl Iterator<Item = OsString>) -> clap::Error {
    let escaped = arguments.map(|one| escape::line(&one.to_string_lossy()).into_owned());
    CommandLine::try_parse_from(escaped).err().unwrap_or(answer)
}

/// The commands of a build with all features that others lack, each with its feature.
const OPTIONAL_COMMANDS: [(&str, &str); 3] =
    [("check-math", "stress"), ("dap", "debugger"), ("stress", "stress")];

/// The feature that has the command which this build does not know.
fn lacking_feature(error: &clap::Error) -> Option<&'static str> {
    let Some(ContextValue::String(command)) = error.get(ContextKind::InvalidSubcommand) else { return None };
    OPTIONAL_COMMANDS.iter().find(|(name, _)| name == command).map(|(_, feature)| *feature)
}

/// The command line as clap defines it, so that documents can be checked against it.
pub fn command() -> clap::Command {
    CommandLine::command()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_of_all_commands_are_consistent() {
        command().debug_assert();
    }

    #[test]
    fn a_command_that_a_build_lacks_is_answered_with_its_feature() {
        let without = clap::Command::new("anyhit").subcommand(clap::Command::new("inspect"));
        let lacking = |name| {
            let error = without.clone().try_get_matches_from(["anyhit", name]).expect_err("no such command");
            lacking_feature(&error)
        };
        assert_eq!(lacking("dap"), Some("debugger"));
        assert_eq!(lacking("check-math"), Some("stress"));
        assert_eq!(lacking("inspct"), None);
        let built = [("debugger", cfg!(feature = "debugger")), ("stress", cfg!(feature = "stress"))];
        for (name, feature) in OPTIONAL_COMMANDS {
            let is_built = built.iter().any(|&(built, is_built)| built == feature && is_built);
            assert_eq!(command().find_subcommand(name).is_some(), is_built, "{name}");
        }
    }

    #[test]
    fn no_argument_begins_a_line_of_an_answer() {
        let line = ["anyhit", "run", "m.comp", "--limit", "v\n::error::pwn=3"];
        let answer = CommandLine::try_parse_from(line).err().unwrap();
        let answer = in_escapes(answer, line.iter().map(OsString::from)).to_string();
        assert!(answer.contains("::error::pwn") && !answer.contains("\n::error::"), "{answer}");
        let line = ["anyhit", "test", "d", "--bogus\n::error::pwn"];
        let answer = CommandLine::try_parse_from(line).err().unwrap();
        let answer = in_escapes(answer, line.iter().map(OsString::from)).to_string();
        assert!(answer.contains("--bogus") && !answer.contains("\n::error::"), "{answer}");
    }

    #[test]
    fn the_help_of_every_command_lists_all_exit_codes() {
        let program = command();
        for one in std::iter::once(&program).chain(program.get_subcommands()) {
            let help = one.get_after_help().map(ToString::to_string).unwrap_or_default();
            let listed: Vec<&str> =
                help.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
            assert_eq!(listed, ["0", "1", "2", "3", "4", "5", "6"], "{}", one.get_name());
        }
    }

    /// Options of a subject are together, and none follows those of another subject by chance.
    #[test]
    fn options_are_grouped_by_headings() {
        let program = command();
        let heading = |command: &str, option: &str| {
            let command = program.find_subcommand(command).expect("the command");
            let option = command.get_arguments().find(|one| one.get_long() == Some(option)).expect(option);
            option.get_help_heading().map(str::to_owned)
        };
        for (command, option, expected) in [
            ("render", "size", None),
            ("render", "json", None),
            ("render", "variant", None),
            ("render", "heat", Some("Heat maps, profiles and pages")),
            ("render", "perturb", Some("Rounding")),
            ("render", "deny", Some("Sanitizer")),
            ("render", "many-seeds", Some("Seeds")),
            ("render", "shard", Some("Shares")),
            ("render", "fuel", Some("Limits")),
            ("test", "filter", None),
            ("test", "init", None),
            ("test", "junit", Some("Reports")),
            ("test", "pictures", Some("Reports")),
            ("test", "sanitize", Some("Sanitizer")),
            ("run", "json", None),
            ("trace-one-ray", "miss-index", None),
        ] {
            assert_eq!(heading(command, option).as_deref(), expected, "{command} --{option}");
        }
    }

    #[test]
    fn a_misspelt_command_is_answered_with_the_nearest() {
        let error = CommandLine::try_parse_from(["anyhit", "inspct", "a.spv"]).err().unwrap();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("'inspect'"), "{error}");
    }
}
