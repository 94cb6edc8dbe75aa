fn main() -> std::process::ExitCode {
    anyhit::cli::main()
}
