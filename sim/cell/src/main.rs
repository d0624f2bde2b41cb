//! Program `platen-sim`.
fn main() {}
