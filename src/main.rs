//! The command `anyhit`.

fn main() -> std::process::ExitCode {
    anyhit::cli::main()
}
