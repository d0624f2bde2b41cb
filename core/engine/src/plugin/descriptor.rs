//! Description of a plugin: name, kind, options, formats.

use platen_plant::OptionDecl;
use serde::{Deserialize, Serialize};

/// Kind of a plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Scanner driver: from a trigger to a lattice.
    Scanner,
    /// Flattening: from the mid-surface mesh to a chart (u, v).
    Flattening,
    /// Comparison: from surfaces to findings.
    Comparison,
    /// Advisor: from the history of a plate to its next stroke.
    Advisor,
}

impl Kind {
    /// Returns the name in descriptors.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scanner => "scanner",
            Self::Flattening => "flattening",
            Self::Comparison => "comparison",
            Self::Advisor => "advisor",
        }
    }
}

/// Description of a plugin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Descriptor {
    /// Name in plant files.
    pub id: String,
    /// Kind.
    pub kind: Kind,
    /// Name for people.
    pub name: String,
    /// Maker.
    pub vendor: String,
    /// Version.
    pub version: String,
    /// Purpose, in sentences.
    pub doc: String,
    /// SPDX expression.
    pub license: String,
    /// Address of its documentation; empty for none.
    pub url: String,
    /// It drives hardware.
    pub hardware: bool,
    /// Formats read.
    pub inputs: Vec<String>,
    /// Formats written.
    pub outputs: Vec<String>,
    /// Options.
    pub options: Vec<OptionDecl>,
}
