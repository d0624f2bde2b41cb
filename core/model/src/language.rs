//! Texts for people, in each language.

use serde::{Deserialize, Serialize};

/// Language of texts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Language {
    /// English.
    #[default]
    En,
    /// Japanese.
    Ja,
}

/// Text in each language.
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

/// A sentence with its numbers, in each language.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Sentence {
    /// English.
    pub en: String,
    /// Japanese; empty: the English one is shown.
    #[serde(default)]
    pub ja: String,
}

impl Sentence {
    /// Creates a sentence from a text; `values` replace its placeholders in order.
    #[must_use]
    pub fn new(texts: Texts, values: &[&str]) -> Self {
        Self { en: fill(texts.en, values), ja: fill(texts.ja, values) }
    }

    /// Returns the sentence in a language.
    #[must_use]
    pub fn of(&self, language: Language) -> &str {
        match language {
            Language::Ja if !self.ja.is_empty() => &self.ja,
            _ => &self.en,
        }
    }
}

/// Replaces the placeholders `{}` of a text in order.
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
