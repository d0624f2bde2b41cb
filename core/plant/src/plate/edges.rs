//! Edges of the plate: square, or with a double-V bevel given by the inset of the face and the height of the root face.

use crate::TomlTable;
use crate::document::{Document, Reported};
use crate::key::Located;

/// Edges of a plate, millimetres; zeros if square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edges {
    pub(super) face_inset: f64,
    pub(super) root_face: f64,
}

/// The two keys of the edges as read, not yet checked against each other.
pub(super) struct EdgeKeys {
    face_inset: Result<Option<Located<f64>>, Reported>,
    root_face: Result<Option<Located<f64>>, Reported>,
}

impl EdgeKeys {
    /// Reads `face_inset_mm` and `root_face_mm`.
    pub(super) fn read(table: &mut TomlTable<'_>) -> Self {
        let mut key = |name| table.number(name).at_least(0.0).located().optional();
        Self { face_inset: key("face_inset_mm"), root_face: key("root_face_mm") }
    }

    /// Checks the keys against the plate's thickness, millimetres: the flanks of a bevel lean by less than 63 degrees.
    ///
    /// # Errors
    /// Reported: a root face of a square edge, a root face or an inset that leaves no bevel.
    pub(super) fn check(self, document: &Document, thickness: Option<f64>) -> Result<Edges, Reported> {
        let value = |key: &Option<Located<f64>>| key.as_ref().map_or(0.0, |key| key.value);
        let (inset, root) = (self.face_inset, self.root_face);
        if let (Ok(inset), Ok(Some(root))) = (&inset, &root)
            && root.value > 0.0
            && value(inset) == 0.0
        {
            let message = format!("found {}, of a bevelled edge only; state face_inset_mm", root.value);
            return Err(document.fault(&root.place, message));
        }
        if let (Ok(Some(root)), Some(thickness)) = (&root, thickness)
            && root.value >= thickness
        {
            let message = format!("found {}, must be below the thickness of {thickness} mm", root.value);
            return Err(document.fault(&root.place, message));
        }
        let (inset, root) = (inset?, root?);
        let root_face = value(&root);
        if let (Some(inset), Some(thickness)) = (&inset, thickness)
            && inset.value > thickness - root_face
        {
            let less =
                if root_face > 0.0 { format!(" less root_face_mm, {root_face} mm") } else { String::new() };
            let message =
                format!("found {}, must not be above the thickness of {thickness} mm{less}", inset.value);
            return Err(document.fault(&inset.place, message));
        }
        Ok(Edges { face_inset: value(&inset), root_face })
    }
}
