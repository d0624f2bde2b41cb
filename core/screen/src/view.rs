//! View settings of a page, from the query of its address: `/?lang=ja&units=in&turn=drawing&theme=dark`.
//!
//! The browser stores nothing.

use platen_model::Language;
use platen_report::picture::{self, Turn, Units};
use serde::Deserialize;

/// View of a page. A parameter that is missing or wrong in the address has its default value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct View {
    /// Language of texts.
    pub language: Language,
    /// Unit of lengths.
    pub units: Units,
    /// Orientation of the plate in pictures.
    pub turn: Turn,
    /// Colours around the pictures.
    pub theme: Theme,
}

/// Colours around the pictures; the colours of a map are the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Theme {
    /// Dark on light gray.
    #[default]
    Light,
    /// Light on dark gray.
    Dark,
}

/// Query of an address, as far as the view needs it.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct ViewQuery {
    lang: Option<String>,
    units: Option<String>,
    turn: Option<String>,
    theme: Option<String>,
}

impl From<ViewQuery> for View {
    fn from(query: ViewQuery) -> Self {
        Self {
            language: if query.lang.as_deref() == Some("ja") { Language::Ja } else { Language::En },
            units: if query.units.as_deref() == Some("in") { Units::Inch } else { Units::Millimetre },
            turn: if query.turn.as_deref() == Some("drawing") { Turn::Drawing } else { Turn::Press },
            theme: if query.theme.as_deref() == Some("dark") { Theme::Dark } else { Theme::Light },
        }
    }
}

impl View {
    /// Returns the parameters of this view that differ from the default, as names and values.
    pub(crate) fn pairs(self) -> Vec<(&'static str, &'static str)> {
        let default = Self::default();
        let all = [
            (self.language != default.language, ("lang", "ja")),
            (self.units != default.units, ("units", "in")),
            (self.turn != default.turn, ("turn", "drawing")),
            (self.theme != default.theme, ("theme", "dark")),
        ];
        all.into_iter().filter(|(differs, _)| *differs).map(|(_, pair)| pair).collect()
    }

    /// Returns an address of this server with this view.
    pub(crate) fn link(self, path: &str) -> String {
        let mut link = path.to_owned();
        for (name, value) in self.pairs() {
            let between = if link.contains('?') { '&' } else { '?' };
            link += &format!("{between}{name}={value}");
        }
        link
    }

    /// Returns the settings that pictures need.
    pub(crate) fn picture(self) -> picture::View {
        picture::View { language: self.language, units: self.units, turn: self.turn }
    }

    /// Returns the code of the language: `en` or `ja`.
    pub(crate) fn lang(self) -> &'static str {
        match self.language {
            Language::En => "en",
            Language::Ja => "ja",
        }
    }

    /// Formats a length with its unit: millimetres with one decimal, inches with two.
    pub(crate) fn length(self, mm: f64) -> String {
        format!("{} {}", self.units.number(mm), self.units.symbol())
    }

    /// Formats a length with its expanded uncertainty and its unit; the uncertainty is rounded up and never 0.
    pub(crate) fn with_uncertainty(self, mm: f64, uncertainty_mm: f64) -> String {
        let uncertainty = Some(uncertainty_mm).filter(|mm| mm.is_finite());
        format!("{} {}", self.units.with_uncertainty(mm, uncertainty), self.units.symbol())
    }

    /// Formats a place on the plate for a ruler: whole millimetres, tenths of an inch.
    pub(crate) fn place(self, mm: f64) -> String {
        match self.units {
            Units::Millimetre => format!("{mm:.0} mm"),
            Units::Inch => format!("{:.1} in", mm / 25.4),
        }
    }

    /// Formats a distance along the plate: metres with one decimal, inches with none.
    pub(crate) fn distance(self, mm: f64) -> String {
        match self.units {
            Units::Millimetre => format!("{:.1} m", mm / 1000.0),
            Units::Inch => format!("{:.0} in", mm / 25.4),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_comes_back_from_its_own_address() {
        for language in [Language::En, Language::Ja] {
            for units in [Units::Millimetre, Units::Inch] {
                for turn in [Turn::Press, Turn::Drawing] {
                    for theme in [Theme::Light, Theme::Dark] {
                        let view = View { language, units, turn, theme };
                        let link = view.link("/strokes?plate=1");
                        let uri: axum::http::Uri = link.parse().unwrap();
                        let query: axum::extract::Query<ViewQuery> =
                            axum::extract::Query::try_from_uri(&uri).unwrap();
                        assert_eq!(View::from(query.0), view, "{link}");
                    }
                }
            }
        }
        assert_eq!(View::default().link("/"), "/");
    }
}
