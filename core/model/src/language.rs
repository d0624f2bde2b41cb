//! Texts for people in each language.

use serde::Serialize;

/// Language of texts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Language {
    /// English.
    #[default]
    En,
    /// Japanese.
    Ja,
}

/// A text in each language.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Texts {
    /// English.
    pub en: &'static str,
    /// Japanese.
    pub ja: &'static str,
}

impl Texts {
    /// Returns the text in a language.
    #[must_use]
    pub fn of(self, language: Language) -> &'static str {
        match language {
            Language::En => self.en,
            Language::Ja => self.ja,
        }
    }
}

/// Fills the places `{}` of a text in their order.
#[must_use]
pub fn fill(text: &str, values: &[&str]) -> String {
    let mut parts = text.split("{}");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.zip(values).fold(first, |filled, (part, value)| filled + value + part)
}

/// Makes a table of texts, one constant each: name, English, Japanese.
#[macro_export]
macro_rules! texts {
    ($visible:vis, $($name:ident $en:literal $ja:literal)*) => {
        $($visible const $name: $crate::Texts = $crate::Texts { en: $en, ja: $ja };)*
    };
}
