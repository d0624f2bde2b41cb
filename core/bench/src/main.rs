//! Program `platen-bench`.

fn main() -> std::process::ExitCode {
    platen_bench::main()
}
