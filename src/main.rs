//! The command `anyhit`.

fn main() -> std::process::ExitCode {
    anyhit::internals::cli::main()
}
