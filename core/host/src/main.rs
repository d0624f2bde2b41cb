//! Program `platen`.
fn main() {}
