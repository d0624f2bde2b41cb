//! Errors of a mesh.

/// Reason why a set of parts is not a disk.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum MeshError {
    /// A length, index or number is out of range.
    #[error("mesh: {what}; the program that made this mesh is at fault, report it")]
    Malformed { what: String },
    /// The triangles do not form a disk.
    #[error("mesh: not a disk: {what}; scan again with the plate in full view, or report this scan")]
    NotADisk { what: String },
}

pub(super) fn malformed(what: impl Into<String>) -> MeshError {
    MeshError::Malformed { what: what.into() }
}

pub(super) fn not_a_disk(what: impl Into<String>) -> MeshError {
    MeshError::NotADisk { what: what.into() }
}
