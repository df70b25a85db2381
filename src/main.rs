fn main() -> std::process::ExitCode {
    hemisplat::cli::run()
}
