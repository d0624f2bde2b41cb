//! Style and scripts of the pages: embedded, compressed once, with addresses that change with the content so that
//! browsers keep them for a year.

use std::io::Write as _;
use std::sync::LazyLock;

use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use flate2::write::GzEncoder;
use flate2::{Compression, Crc};

/// A file of the pages.
#[derive(Debug)]
struct Asset {
    name: &'static str,
    kind: &'static str,
    text: &'static str,
    address: String,
    packed: Vec<u8>,
}

static ASSETS: LazyLock<[Asset; 4]> = LazyLock::new(|| {
    [
        Asset::new("style.css", "text/css", include_str!("../../assets/style.css")),
        Asset::new("live.js", "text/javascript", include_str!("../../assets/live.js")),
        Asset::new("plate.js", "text/javascript", include_str!("../../assets/plate.js")),
        Asset::new("icon.svg", "image/svg+xml", include_str!("../../assets/icon.svg")),
    ]
});

impl Asset {
    fn new(name: &'static str, kind: &'static str, text: &'static str) -> Self {
        let mut sum = Crc::new();
        sum.update(text.as_bytes());
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        // Writing to a vector cannot fail.
        let _ = encoder.write_all(text.as_bytes());
        let packed = encoder.finish().unwrap_or_default();
        Self { name, kind, text, address: format!("/assets/{:08x}/{name}", sum.sum()), packed }
    }
}

/// Returns the address of an embedded file.
pub(crate) fn address(name: &str) -> &'static str {
    ASSETS.iter().find(|asset| asset.name == name).map_or("", |asset| &asset.address)
}

/// Returns an embedded file.
pub(super) fn response(path: &str, headers: &HeaderMap) -> Response {
    let Some(asset) = ASSETS.iter().find(|asset| asset.address == path) else {
        return (StatusCode::NOT_FOUND, "no such file\n").into_response();
    };
    let head = [
        (header::CONTENT_TYPE, format!("{}; charset=utf-8", asset.kind)),
        (header::CACHE_CONTROL, "public, max-age=31536000, immutable".to_owned()),
        (header::VARY, "accept-encoding".to_owned()),
    ];
    let accepts = headers.get(header::ACCEPT_ENCODING).and_then(|value| value.to_str().ok());
    if accepts.is_some_and(|accepts| accepts.contains("gzip")) {
        return (head, [(header::CONTENT_ENCODING, "gzip")], asset.packed.clone()).into_response();
    }
    (head, asset.text).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_operators_page_is_light() {
        let of =
            |name: &str| ASSETS.iter().find(|asset| asset.name == name).map_or(0, |asset| asset.packed.len());
        let bytes = of("style.css") + of("live.js") + of("icon.svg");
        assert!(bytes < 10_000, "{bytes} bytes packed");
    }

    #[test]
    fn scripts_put_texts_and_never_markup() {
        for asset in ASSETS.iter().filter(|asset| asset.kind == "text/javascript") {
            for sink in
                ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function"]
            {
                assert!(!asset.text.contains(sink), "{}: {sink}", asset.name);
            }
        }
    }
}
