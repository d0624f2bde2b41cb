//! Addresses of the pages and their data, for GET and HEAD alone: the router answers 405 to any other method.

use std::sync::Arc;

use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use maud::Markup;
use platen_report::picture::{self, Mark};
use serde::{Deserialize, Serialize};
use tokio::sync::Semaphore;

use super::access::{COOKIE, Gate, Passage};
use super::assets;
use super::connection::Peer;
use super::stream::{self, Feed};
use crate::page::{self, LivePage};
use crate::source::present;
use crate::view::{View, ViewQuery};
use crate::{CYCLE_LIMIT, FILES, Source, SourceError};

/// Largest number of concurrent queries of the record.
pub(super) const RECORD_QUERIES: usize = 2;
/// Content security policy of a page: it may load only content of this server. Its single form requests another page of
/// this server.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
                      base-uri 'none'; form-action 'self'; frame-ancestors 'none'; require-trusted-types-for 'script'";
/// Policy of a report, which is one file with its own style and pictures.
const REPORT_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; \
                             frame-ancestors 'none'";
/// A finished stroke never changes.
const FINISHED: &str = "private, max-age=86400, immutable";

/// State of every request.
#[derive(Clone)]
struct Site {
    source: Arc<dyn Source>,
    queries: Arc<Semaphore>,
}

/// Returns the router of all pages.
pub(super) fn router(source: Arc<dyn Source>, gate: Gate) -> Router {
    let site = Site { source, queries: Arc::new(Semaphore::new(RECORD_QUERIES)) };
    Router::new()
        .route("/", get(operator))
        .route("/strokes", get(strokes))
        .route("/strokes/{run}/{name}", get(stroke_picture))
        .route("/compare", get(compare))
        .route("/engineer", get(engineer))
        .route("/plate", get(plate))
        .route("/plates/{plate}/report.html", get(report))
        .route("/files/{run}/{name}", get(file))
        .route("/live/{page}", get(live))
        .route("/assets/{sum}/{name}", get(asset))
        .route("/api/v1/state", get(api_state))
        .route("/api/v1/stream", get(api_stream))
        .route("/api/v1/plates", get(api_plates))
        .route("/api/v1/plates/{plate}", get(api_strokes))
        .route("/api/v1/plates/{plate}/sequence", get(api_sequence))
        .route("/api/v1/strokes/{run}", get(api_stroke))
        .route("/api/v1/engineer", get(api_engineer))
        .route("/api/v1/diagnosis", get(api_diagnosis))
        .route("/metrics", get(metrics))
        .route("/healthz", get(health))
        .fallback(async || (StatusCode::NOT_FOUND, "no such page\n"))
        .layer(middleware::from_fn_with_state(Arc::new(gate), guard))
        .with_state(site)
}

/// Grants or refuses a request, and sets the headers of every answer.
async fn guard(
    State(gate): State<Arc<Gate>>,
    Extension(Peer(peer)): Extension<Peer>,
    request: Request,
    next: Next,
) -> Response {
    #[derive(Deserialize)]
    struct Given {
        token: Option<String>,
    }
    let uri = request.uri().clone();
    let given = Query::<Given>::try_from_uri(&uri).ok().and_then(|query| query.0.token);
    let data = ["/api/", "/live/", "/files/", "/strokes/", "/metrics"];
    let is_data = data.iter().any(|part| uri.path().starts_with(part));
    let mut response = match gate.passage(peer, request.headers(), given.as_deref(), is_data) {
        Passage::Open => next.run(request).await,
        Passage::Cookie(token) => with_cookie(&uri, &token),
        Passage::Closed(status, why) => {
            tracing::warn!(%peer, status = status.as_u16(), path = uri.path(), "pages: refused: {why}");
            (status, format!("{why}\n")).into_response()
        }
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Answers a token in the address with a cookie and a redirect to the address without it.
fn with_cookie(uri: &Uri, token: &str) -> Response {
    let parts = uri.query().unwrap_or_default().split('&');
    let query =
        parts.filter(|part| !part.is_empty() && !part.starts_with("token=")).collect::<Vec<_>>().join("&");
    let between = if query.is_empty() { "" } else { "?" };
    // A path that starts with two slashes would denote another host.
    let place = format!("/{}{between}{query}", uri.path().trim_start_matches('/'));
    let cookie = format!("{COOKIE}={token}; Path=/; Max-Age=7776000; HttpOnly; SameSite=Strict");
    (StatusCode::SEE_OTHER, [(header::LOCATION, place), (header::SET_COOKIE, cookie)]).into_response()
}

impl IntoResponse for SourceError {
    fn into_response(self) -> Response {
        let status = match self {
            Self::NotFound(_) => StatusCode::NOT_FOUND,
            Self::Unreadable(_) => StatusCode::INTERNAL_SERVER_ERROR,
        };
        (status, format!("{self}\n")).into_response()
    }
}

impl Site {
    /// Runs a query of the record or of files on a thread that may block; at most two run at once.
    async fn ask<T: Send + 'static>(
        &self,
        query: impl FnOnce(&dyn Source) -> Result<T, SourceError> + Send + 'static,
    ) -> Result<T, SourceError> {
        let permit = self.queries.acquire().await.map_err(|e| SourceError::Unreadable(e.to_string()))?;
        let source = Arc::clone(&self.source);
        let answer = tokio::task::spawn_blocking(move || query(&*source)).await;
        drop(permit);
        answer.unwrap_or_else(|e| Err(SourceError::Unreadable(e.to_string())))
    }
}

fn html(markup: Markup) -> Response {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], markup.into_string()).into_response()
}

/// Answers with JSON, or with the error.
fn json(answer: Result<impl Serialize, SourceError>) -> Response {
    let text =
        answer.and_then(|a| serde_json::to_vec(&a).map_err(|e| SourceError::Unreadable(e.to_string())));
    text.map_or_else(IntoResponse::into_response, |text| {
        ([(header::CONTENT_TYPE, "application/json")], text).into_response()
    })
}

/// Answers with a file of a finished stroke, or with the error.
fn finished(answer: Result<(Vec<u8>, &'static str), SourceError>) -> Response {
    match answer {
        Ok((bytes, kind)) => {
            ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, FINISHED)], bytes).into_response()
        }
        Err(error) => error.into_response(),
    }
}

async fn operator(State(site): State<Site>, Query(view): Query<ViewQuery>) -> Response {
    let snapshot = present(&*site.source);
    html(page::operator(&snapshot, view.into()))
}

async fn engineer(State(site): State<Site>, Query(view): Query<ViewQuery>) -> Response {
    let snapshot = present(&*site.source);
    html(page::engineer(&snapshot, &site.source.engineer(), view.into()))
}

/// Plate and strokes selected in the query of an address.
#[derive(Deserialize)]
struct Chosen {
    plate: Option<u32>,
    run: Option<u32>,
    a: Option<u32>,
    b: Option<u32>,
}

async fn strokes(
    State(site): State<Site>,
    Query(view): Query<ViewQuery>,
    Query(chosen): Query<Chosen>,
) -> Response {
    let view = View::from(view);
    let page = site.ask(move |source| {
        let plates = source.plates()?;
        let Some(plate) = chosen.plate else { return Ok(page::plates(&plates, view)) };
        let name = plates.iter().find(|row| row.plate == plate).map_or("", |row| &row.name);
        Ok(page::strokes(plate, name, &source.strokes(plate)?, source.sequence(plate)?.as_ref(), view))
    });
    page.await.map_or_else(IntoResponse::into_response, html)
}

async fn compare(
    State(site): State<Site>,
    Query(view): Query<ViewQuery>,
    Query(chosen): Query<Chosen>,
) -> Response {
    let view = View::from(view);
    let page = site.ask(move |source| {
        let Some((a, b)) = chosen.a.zip(chosen.b) else { return Ok(page::compare(None, view)) };
        let (first, second) = (source.result(a)?, source.result(b)?);
        Ok(page::compare(Some([(a, &*first), (b, &*second)]), view))
    });
    page.await.map_or_else(IntoResponse::into_response, html)
}

async fn plate(
    State(site): State<Site>,
    Query(view): Query<ViewQuery>,
    Query(chosen): Query<Chosen>,
) -> Response {
    let page = site.ask(move |source| {
        let run = chosen.run.ok_or_else(|| SourceError::NotFound("give a stroke: /plate?run=1".into()))?;
        Ok(page::plate(run, &*source.result(run)?, view.into()))
    });
    page.await.map_or_else(IntoResponse::into_response, html)
}

async fn report(State(site): State<Site>, Path(plate): Path<u32>) -> Response {
    let head = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, REPORT_POLICY),
    ];
    let report = site.ask(move |source| source.report(plate)).await;
    report.map_or_else(IntoResponse::into_response, |text| (head, text).into_response())
}

/// Returns the map of a field, `curvature_deficit.png`, and its words, `curvature_deficit.svg`; the mesh, `mesh.bin`.
async fn stroke_picture(
    State(site): State<Site>,
    Path((run, name)): Path<(u32, String)>,
    Query(view): Query<ViewQuery>,
) -> Response {
    let view = View::from(view);
    let answer = site.ask(move |source| {
        if name == "mesh.bin" {
            return Ok((mesh(source, run)?, "application/octet-stream"));
        }
        let (field, ending) = name.rsplit_once('.').unwrap_or((&name, ""));
        let record = source.result(run)?;
        let values = source.field(run, field)?;
        let line = advised_line(source, run);
        let mark = line.map(|(line, to)| Mark::Line(line, to)).or_else(|| Mark::of(record.next.as_ref()));
        let map = picture::screen_map(&values, &record.plate_file, view.picture(), mark);
        let map = map.map_err(|e| SourceError::Unreadable(e.to_string()))?;
        match ending {
            "png" => Ok((map.png, "image/png")),
            "svg" => Ok((map.svg.into_bytes(), "image/svg+xml")),
            _ => Err(SourceError::NotFound(format!("no picture {name}; ask for {field}.png"))),
        }
    });
    finished(answer.await)
}

/// Returns the advised bend line after a stroke and the interval of its place, while its result is shown.
fn advised_line(source: &dyn Source, run: u32) -> Option<([[f64; 2]; 2], Option<f64>)> {
    let snapshots = source.snapshots();
    let snapshot = snapshots.borrow();
    let result = snapshot.result.as_ref().filter(|result| result.run == run)?;
    result.advice.as_ref()?.bend.map(|bend| (bend.line_mm, bend.place_95_mm))
}

/// Returns the mesh: number of nodes of a side, then x, y, z, seen of each node as 32-bit floats, little endian.
fn mesh(source: &dyn Source, run: u32) -> Result<Vec<u8>, SourceError> {
    let (side, nodes) = source.mesh(run)?;
    let side = (side as u32).to_le_bytes();
    Ok(side.into_iter().chain(nodes.iter().flatten().flat_map(|x| x.to_le_bytes())).collect())
}

async fn file(State(site): State<Site>, Path((run, name)): Path<(u32, String)>) -> Response {
    let is_section = name.starts_with("section-") && name.ends_with(".svg") && !name.contains('/');
    if !is_section && !FILES.contains(&name.as_str()) {
        return (StatusCode::NOT_FOUND, "no such file\n").into_response();
    }
    let kind = match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("json") => "application/json",
        Some("csv") => "text/csv; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        _ => "application/octet-stream",
    };
    finished(site.ask(move |source| Ok((source.file(run, &name)?, kind))).await)
}

async fn asset(uri: Uri, headers: HeaderMap) -> Response {
    assets::response(uri.path(), &headers)
}

async fn live(State(site): State<Site>, Path(name): Path<String>, Query(view): Query<ViewQuery>) -> Response {
    match LivePage::from_name(&name) {
        Some(page) => stream::events(site.source, Feed::Page(page, view.into())).into_response(),
        None => (StatusCode::NOT_FOUND, "no such page\n").into_response(),
    }
}

async fn api_state(State(site): State<Site>) -> Response {
    let snapshot = present(&*site.source);
    json(Ok(&*snapshot))
}

async fn api_stream(State(site): State<Site>) -> Response {
    stream::events(site.source, Feed::Snapshots).into_response()
}

async fn api_plates(State(site): State<Site>) -> Response {
    json(site.ask(|source| source.plates()).await)
}

async fn api_strokes(State(site): State<Site>, Path(plate): Path<u32>) -> Response {
    json(site.ask(move |source| source.strokes(plate)).await)
}

async fn api_sequence(State(site): State<Site>, Path(plate): Path<u32>) -> Response {
    json(site.ask(move |source| source.sequence(plate)).await)
}

async fn api_stroke(State(site): State<Site>, Path(run): Path<u32>) -> Response {
    let record = site.ask(move |source| source.result(run)).await;
    json(record.as_deref().map_err(|error| SourceError::NotFound(error.to_string())))
}

async fn api_engineer(State(site): State<Site>) -> Response {
    json(Ok(site.source.engineer()))
}

/// Returns state, figures and metrics in one file, for support.
async fn api_diagnosis(State(site): State<Site>) -> Response {
    let snapshot = present(&*site.source);
    json(Ok(serde_json::json!({
        "schema": "platen.diagnosis/1", "at": jiff::Timestamp::now(), "state": &*snapshot, "engineer": site.source.engineer(),
        "metrics": site.source.metrics(),
    })))
}

async fn metrics(State(site): State<Site>) -> Response {
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4")], site.source.metrics()).into_response()
}

/// Returns 200 while the press cycle runs, else 503.
async fn health(State(site): State<Site>) -> Response {
    let age = site.source.cycle_age();
    let status = if age > CYCLE_LIMIT { StatusCode::SERVICE_UNAVAILABLE } else { StatusCode::OK };
    (status, format!("press cycle {} ms ago\n", age.as_millis())).into_response()
}
