//! Changing elements of a page, which are updated while the page is open.
//!
//! A page renders them into its HTML, so that the first paint is correct without a script. Every later event contains
//! the same cells as JSON, and the script writes them to the elements with the same ids.

use std::collections::BTreeMap;

use maud::{Markup, html};
use serde::Serialize;

/// Content of one element: its text and some of its attributes.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct Cell {
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<String>,
    /// Null removes it.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    attributes: BTreeMap<&'static str, Option<String>>,
}

/// Content of the changing elements of a page, by their ids.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[serde(transparent)]
pub(crate) struct Cells(BTreeMap<String, Cell>);

impl Cells {
    /// Sets the text of an element.
    pub(crate) fn text(&mut self, id: impl Into<String>, text: impl Into<String>) {
        self.0.entry(id.into()).or_default().text = Some(text.into());
    }

    /// Sets or removes an attribute of an element.
    pub(crate) fn set(&mut self, id: impl Into<String>, name: &'static str, value: Option<String>) {
        self.0.entry(id.into()).or_default().attributes.insert(name, value);
    }

    /// Sets the class of an element.
    pub(crate) fn class(&mut self, id: impl Into<String>, class: impl Into<String>) {
        self.set(id, "class", Some(class.into()));
    }

    /// Returns an attribute of an element, for one that the page itself renders.
    pub(crate) fn attribute(&self, id: &str, name: &str) -> Option<&str> {
        self.0.get(id)?.attributes.get(name)?.as_deref()
    }

    fn text_of(&self, id: &str) -> &str {
        self.0.get(id).and_then(|cell| cell.text.as_deref()).unwrap_or_default()
    }

    /// Renders an element of the page with its cell: `span`.
    pub(crate) fn span(&self, id: &str) -> Markup {
        html! { span id=(id) class=[self.attribute(id, "class")] { (self.text_of(id)) } }
    }

    /// Renders a paragraph with its cell.
    pub(crate) fn p(&self, id: &str) -> Markup {
        html! { p id=(id) class=[self.attribute(id, "class")] { (self.text_of(id)) } }
    }

    /// Renders an image with its cell.
    pub(crate) fn img(&self, id: &str) -> Markup {
        html! { img id=(id) src=[self.attribute(id, "src")] alt=(self.attribute(id, "alt").unwrap_or_default()); }
    }

    /// Renders a bar of a drawing with its cell.
    pub(crate) fn rect(&self, id: &str) -> Markup {
        let [x, y, width, height, class] =
            ["x", "y", "width", "height", "class"].map(|name| self.attribute(id, name).unwrap_or("0"));
        html! { rect id=(id) x=(x) y=(y) width=(width) height=(height) class=(class) {} }
    }

    /// Sets a bar of a drawing.
    pub(crate) fn bar(&mut self, id: &str, [x, y, width, height]: [f64; 4], class: &str) {
        for (name, value) in [("x", x), ("y", y), ("width", width), ("height", height)] {
            self.set(id, name, Some(format!("{value:.1}")));
        }
        self.class(id, class);
    }
}
