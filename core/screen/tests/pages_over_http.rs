//! Tests of the pages over real sockets, with a source without press and record: methods, headers, access, limits,
//! foreign texts, events.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use platen_model::{CannotAdvise, Code, Field, Sentence, Verdict};
use platen_report::result::ResultRecord;
use platen_report::sequence::Sequence;
use platen_screen::{
    Access, AdvicePart, AdvisedBend, AdvisedStep, Engineer, HostPart, LastAdvice, Listener, PlatePart,
    PlateRow, PressPart, RecordPart, ResultPart, SCHEMA, ScannerPart, ScannerState, Server, ShownAlarm,
    Snapshot, Source, SourceError, Stage, StrokePart, StrokeRow, Token, Worst,
};
use tokio::sync::watch;

const EVIL: &str = "<script>alert(1)</script>\"><img onerror=alert(2)>";

struct Stand {
    snapshots: watch::Sender<Arc<Snapshot>>,
    /// Cycle age that is answered, milliseconds.
    cycle_age: AtomicU64,
    asked: Mutex<Vec<String>>,
}

fn snapshot(result: Option<ResultPart>) -> Snapshot {
    Snapshot {
        schema: SCHEMA,
        boot: "boot-1".into(),
        seq: 1,
        host: HostPart { version: "0", mode: "measure", state: "idle".into(), simulated: false },
        press: PressPart { name: EVIL.into(), in_step: true, alive: true, ready: true },
        scanner: ScannerPart { state: ScannerState::Ready, estimate_s: Some(10.0) },
        record: RecordPart { complete: true, lost: 0 },
        plate: Some(PlatePart {
            id: Some(EVIL.into()),
            part: Some(7),
            recipe: Some(9),
            size_mm: Some([3000.0, 2000.0]),
            press_side: Some([0, -1]),
        }),
        stroke: Some(StrokePart {
            run: Some(1),
            number: 4,
            attempt: 0,
            baseline: false,
            stage: Stage::Done,
            since_ms: Some(0),
            scanned_percent: None,
        }),
        result,
        strip: Vec::new(),
        alarms: vec![ShownAlarm::new(Code::PressStale, 0, 2), ShownAlarm::new(Code::AckTimeout, 0, 1)],
    }
}

fn result(verdict: Verdict, sense: i8) -> ResultPart {
    ResultPart {
        run: 1,
        verdict,
        reason: None,
        why: None,
        worst: Some(Worst {
            gap_mm: 4.26,
            uncertainty_mm: 0.11,
            limit_mm: 3.0,
            at_mm: [500.0, 300.0],
            sense,
        }),
        next: None,
        again: false,
        advice: None,
        fields: vec!["curvature_deficit".into()],
    }
}

impl Source for Stand {
    fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.snapshots.subscribe()
    }

    fn cycle_age(&self) -> Duration {
        Duration::from_millis(self.cycle_age.load(Ordering::Relaxed))
    }

    fn plates(&self) -> Result<Vec<PlateRow>, SourceError> {
        let row = |name: String| PlateRow {
            plate: 1,
            name,
            part: None,
            first: "2026-01-01".into(),
            strokes: 1,
            verdict: Verdict::Fail,
            sense: -1,
        };
        Ok(vec![row(EVIL.into()), row("\u{202e}".repeat(10_000))])
    }

    fn strokes(&self, plate: u32) -> Result<Vec<StrokeRow>, SourceError> {
        if plate != 1 {
            return Err(SourceError::NotFound("no such plate".into()));
        }
        Ok(vec![StrokeRow {
            run: 1,
            label: EVIL.into(),
            accepted: "2026-01-01".into(),
            verdict: Verdict::NotMeasured,
            reason: Some(EVIL.into()),
            gap_mm: None,
            uncertainty_mm: None,
            sense: 0,
            files: Vec::new(),
        }])
    }

    fn sequence(&self, _: u32) -> Result<Option<Sequence>, SourceError> {
        Ok(None)
    }

    fn result(&self, run: u32) -> Result<Arc<ResultRecord>, SourceError> {
        Err(SourceError::NotFound(format!("run {run} was not measured")))
    }

    fn field(&self, _: u32, name: &str) -> Result<Arc<Field>, SourceError> {
        Err(SourceError::NotFound(name.into()))
    }

    fn mesh(&self, _: u32) -> Result<(usize, Vec<[f32; 4]>), SourceError> {
        Ok((1, vec![[1.0, 2.0, 3.0, 0.0]]))
    }

    fn file(&self, run: u32, name: &str) -> Result<Vec<u8>, SourceError> {
        self.asked.lock().unwrap().push(format!("{run}/{name}"));
        Ok(b"{}".to_vec())
    }

    fn report(&self, _: u32) -> Result<String, SourceError> {
        Ok("<!DOCTYPE html><p>report".into())
    }

    fn engineer(&self) -> Engineer {
        Engineer { figures: vec![("link".into(), EVIL.into())], ..Engineer::default() }
    }

    fn metrics(&self) -> String {
        "platen_up 1\n".into()
    }
}

struct Site {
    address: SocketAddr,
    stand: Arc<Stand>,
    _server: Server,
}

fn site_with(access: Access) -> Site {
    let stand = Arc::new(Stand {
        snapshots: watch::Sender::new(Arc::new(snapshot(Some(result(Verdict::Fail, -1))))),
        cycle_age: AtomicU64::new(0),
        asked: Mutex::default(),
    });
    let listener = Listener::open("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = listener.address();
    let server = Server::start(listener, access, Arc::clone(&stand) as Arc<dyn Source>).unwrap();
    Site { address, stand, _server: server }
}

fn site() -> Site {
    site_with(Access::default())
}

impl Site {
    fn open(&self, method: &str, path: &str, more: &str) -> BufReader<TcpStream> {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        write!(stream, "{method} {path} HTTP/1.1\r\nHost: {}\r\n{more}\r\n", self.address).unwrap();
        BufReader::new(stream)
    }

    /// Returns status, head and body of an answer.
    fn ask(&self, method: &str, path: &str, more: &str) -> (u16, String, String) {
        let mut text = Vec::new();
        self.open(method, path, &format!("Connection: close\r\n{more}")).read_to_end(&mut text).unwrap();
        let text = String::from_utf8_lossy(&text).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), head.to_lowercase(), body.to_owned())
    }

    fn get(&self, path: &str) -> (u16, String, String) {
        self.ask("GET", path, "")
    }
}

const PAGES: [&str; 5] = ["/", "/strokes", "/strokes?plate=1", "/compare", "/engineer"];

#[test]
fn only_get_and_head_are_answered() {
    let site = site();
    for path in PAGES.into_iter().chain([
        "/api/v1/state",
        "/metrics",
        "/healthz",
        "/files/1/result.json",
        "/plates/1/report.html",
    ]) {
        assert_eq!(site.get(path).0, 200, "{path}");
        assert_eq!(site.ask("HEAD", path, "").0, 200, "{path}");
        for method in ["POST", "PUT", "DELETE", "PATCH", "OPTIONS"] {
            let (status, _, _) = site.ask(method, path, "Content-Length: 0\r\n");
            assert_eq!(status, 405, "{method} {path}");
        }
    }
}

#[test]
fn every_answer_carries_its_policy_and_data_are_not_stored() {
    let site = site();
    for path in PAGES.into_iter().chain(["/nowhere", "/api/v1/state"]) {
        let (_, head, _) = site.get(path);
        for line in [
            "content-security-policy: default-src 'none'; script-src 'self'",
            "require-trusted-types-for 'script'",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cache-control: no-store",
        ] {
            assert!(head.contains(line), "{path}: {line}\n{head}");
        }
        assert!(!head.contains("access-control"), "{path}: no other origin may read\n{head}");
    }
}

#[test]
fn texts_of_others_are_text() {
    let site = site();
    for path in PAGES {
        let (_, _, body) = site.get(path);
        for bad in ["<script>alert", "<img onerror", "\u{202e}"] {
            assert!(!body.contains(bad), "{path}: {bad}");
        }
    }
    assert!(site.get("/").2.contains("&lt;script&gt;alert(1)"));
    assert!(site.get("/strokes").2.len() < 20_000);
}

#[test]
fn the_first_paint_says_the_truth_without_script() {
    let site = site();
    let (_, _, page) = site.get("/");
    for text in [
        "BEND MORE",
        ">4.3</span>",
        "\u{b1} 0.2 mm",
        "(limit 3.0 mm)",
        "Stroke 4, Plate",
        "Press: in step",
        "103 the heartbeat",
    ] {
        assert!(page.contains(text), "{text}\n{page}");
    }
    assert!(!page.contains("122"), "an alarm of the engineer is none of the operator's");
    assert!(page.contains("http-equiv=\"refresh\""), "a browser without script asks again");
    let (_, _, page) = site.get("/?lang=ja&units=in&theme=dark");
    for text in
        ["\u{66f2}\u{3052}\u{4e0d}\u{8db3}", ">0.17</span>", "\u{b1} 0.01 in", "lang=\"ja\"", "operator dark"]
    {
        assert!(page.contains(text), "{text}\n{page}");
    }
}

#[test]
fn a_result_that_is_taken_back_leaves_the_page() {
    let site = site();
    let mut next = snapshot(None);
    next.stroke.as_mut().unwrap().stage = Stage::Scanning;
    site.stand.snapshots.send_replace(Arc::new(next));
    let (_, _, page) = site.get("/");
    assert!(page.contains("SCANNING"));
    for gone in ["BEND MORE", "4.3", "curvature_deficit", "limit 3.0"] {
        assert!(!page.contains(gone), "{gone}");
    }
}

#[test]
fn out_of_step_with_the_press_nothing_is_good() {
    let site = site();
    let mut next = snapshot(Some(result(Verdict::Pass, 0)));
    next.press.in_step = false;
    site.stand.snapshots.send_replace(Arc::new(next));
    let (_, _, page) = site.get("/");
    assert!(page.contains("NO CONNECTION") && !page.contains(">DONE<"));
}

/// Returns the next event of a stream: its name and data.
fn event(stream: &mut BufReader<TcpStream>) -> (String, serde_json::Value) {
    let (mut name, mut line) = (String::new(), String::new());
    loop {
        line.clear();
        assert!(stream.read_line(&mut line).unwrap() > 0, "the stream has ended");
        if let Some(given) = line.strip_prefix("event: ") {
            name = given.trim().to_owned();
        } else if let Some(data) = line.strip_prefix("data: ") {
            return (name, serde_json::from_str(data.trim()).unwrap());
        }
    }
}

fn event_named(stream: &mut BufReader<TcpStream>, wanted: &str) -> serde_json::Value {
    loop {
        let (name, data) = event(stream);
        if name == wanted {
            return data;
        }
    }
}

#[test]
fn the_stream_starts_whole_follows_changes_and_beats() {
    let site = site();
    let mut stream = site.open("GET", "/api/v1/stream", "");
    assert_eq!(event_named(&mut stream, "state")["result"]["verdict"], "fail");
    site.stand.cycle_age.store(2500, Ordering::Relaxed);
    let beat = event_named(&mut stream, "beat");
    assert_eq!(beat["boot"], "boot-1");
    // The first beat may have been sent before.
    let aged = (0..3).any(|_| event_named(&mut stream, "beat")["cycle_age_ms"] == 2500);
    assert!(aged);
    site.stand.snapshots.send_replace(Arc::new(snapshot(None)));
    assert!(event_named(&mut stream, "state")["result"].is_null());
    let mut page = site.open("GET", "/live/operator?lang=ja", "");
    let cells = event_named(&mut page, "state");
    assert_eq!(cells["gap"]["text"], "");
    assert!(cells["map"]["attributes"]["src"].is_null());
}

#[test]
fn while_the_press_cycle_stands_no_result_is_given() {
    let site = site();
    site.stand.cycle_age.store(10_000, Ordering::Relaxed);
    let (_, _, page) = site.get("/");
    assert!(
        !page.contains("BEND MORE") && !page.contains(">4.3<") && !page.contains("curvature_deficit"),
        "{page}"
    );
    let (_, _, state) = site.get("/api/v1/state");
    let state: serde_json::Value = serde_json::from_str(&state).unwrap();
    assert!(state["result"].is_null() && state["press"]["in_step"] == false);
    let mut stream = site.open("GET", "/live/operator", "");
    assert_eq!(event_named(&mut stream, "state")["gap"]["text"], "");
}

#[test]
fn health_follows_the_press_cycle() {
    let site = site();
    assert_eq!(site.get("/healthz").0, 200);
    site.stand.cycle_age.store(10_000, Ordering::Relaxed);
    assert_eq!(site.get("/healthz").0, 503);
}

#[test]
fn a_file_is_one_of_a_list_and_never_a_path() {
    let site = site();
    for name in [
        "../history.sqlite",
        "..%2fhistory.sqlite",
        "surface.platen",
        "section-..%2f..%2fx.svg",
        "section-%2e%2e/x.svg",
        "a.toml",
    ] {
        assert_eq!(site.get(&format!("/files/1/{name}")).0, 404, "{name}");
    }
    assert_eq!(site.get("/files/1/section-low.svg").0, 200);
    assert_eq!(*site.stand.asked.lock().unwrap(), ["1/section-low.svg"]);
    assert_eq!(site.get("/files/x/result.json").0, 400);
}

#[test]
fn wrong_names_sites_and_tokens_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("token");
    std::fs::write(&file, "0123456789abcdef0123456789abcdef").unwrap();
    let site = site_with(Access { token: Some(Token::load(&file).unwrap()), names: Vec::new() });
    assert_eq!(site.get("/").0, 401);
    let (status, head, _) = site.get("/strokes?lang=ja&token=0123456789abcdef0123456789abcdef");
    assert_eq!(status, 303);
    assert!(
        head.contains("location: /strokes?lang=ja\r\n") && head.contains("httponly; samesite=strict"),
        "{head}"
    );
    let cookie = "Cookie: platen_token=0123456789abcdef0123456789abcdef\r\n";
    assert_eq!(site.ask("GET", "/", cookie).0, 200);
    assert_eq!(site.ask("GET", "/api/v1/state", &format!("{cookie}Sec-Fetch-Site: cross-site\r\n")).0, 403);
    let (status, head, _) = site.get("//evil.example/?token=0123456789abcdef0123456789abcdef");
    assert!(status == 303 && head.contains("location: /evil.example/"), "{head}");
    let mut stream = TcpStream::connect(site.address).unwrap();
    write!(stream, "GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n{cookie}\r\n").unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    assert!(text.starts_with("HTTP/1.1 421"), "{text}");
}

#[test]
fn readers_that_never_read_and_heads_without_end_cost_the_others_nothing() {
    let site = site();
    let silent: Vec<_> = (0..40).map(|_| site.open("GET", "/api/v1/stream", "")).collect();
    let mut endless = TcpStream::connect(site.address).unwrap();
    endless.write_all(b"GET / HTTP/1.1\r\nX: ").unwrap();
    let start = Instant::now();
    for seq in 0..200 {
        site.stand.snapshots.send_replace(Arc::new(Snapshot { seq, ..snapshot(None) }));
    }
    assert_eq!(site.get("/").0, 200);
    // An incomplete head is answered or the connection closed after its time.
    let mut rest = Vec::new();
    endless.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let _ = endless.read_to_end(&mut rest);
    assert!(start.elapsed() < Duration::from_secs(30), "closed after its time, not after ours");
    drop(silent);
}

#[test]
fn assets_are_kept_for_a_year_under_the_address_of_their_content() {
    let site = site();
    let (_, _, page) = site.get("/");
    let address = page.split("href=\"").find_map(|part| part.strip_prefix("/assets/")).unwrap();
    let path = format!("/assets/{}", address.split('"').next().unwrap());
    let (status, head, _) = site.ask("GET", &path, "Accept-Encoding: gzip\r\n");
    assert!(status == 200 && head.contains("immutable") && head.contains("content-encoding: gzip"), "{head}");
    assert_eq!(site.get("/assets/00000000/style.css").0, 404);
}

fn advised(advice: AdvicePart) -> Snapshot {
    snapshot(Some(ResultPart { advice: Some(advice), ..result(Verdict::Fail, -1) }))
}

fn bend(line_mm: [[f64; 2]; 2]) -> AdvicePart {
    let bend = AdvisedBend {
        line_mm,
        angle_deg: 1.5,
        place_95_mm: Some(20.0),
        depth_mm: Some(4.81),
        depth_not_beyond_mm: Some(5.34),
        gap_after_mm: [9.0, 12.0, 15.2],
    };
    AdvicePart {
        step: AdvisedStep::Bend,
        bend: Some(bend),
        why: None,
        strokes_left: Some([5, 7]),
        last: Some(LastAdvice::Made { advised_deg: 1.9, advised_95_deg: Some([1.66, 2.14]), made_deg: 1.84 }),
        says: vec![Sentence { en: EVIL.into(), ja: "金型を確認".into() }],
    }
}

#[test]
fn advice_is_a_line_a_depth_and_what_comes_of_it() {
    let site = site();
    let show = |advice: AdvicePart| site.stand.snapshots.send_replace(Arc::new(advised(advice)));
    assert!(!site.get("/").2.contains("PRESS ALONG"), "no advice, no line");
    show(bend([[1650.4, 0.0], [1650.4, 2000.0]]));
    let (_, _, page) = site.get("/");
    for text in [
        "PRESS ALONG THE LINE",
        ">1650 mm<",
        ">from the left<",
        ">4.8 mm<",
        ">deep<",
        ">Last stroke: advised 1.9 deg (1.7 to 2.1), made 1.8 deg<",
        "not beyond 5.3 mm; then 12.0 mm open (9.0 to 15.2); 5 to 7 strokes left",
    ] {
        assert!(page.contains(text), "{text}: {page}");
    }
    assert!(!page.contains("<script>alert"), "sentences of a plugin are text");
    let (_, _, page) = site.get("/?lang=ja&units=in");
    for text in [
        "線に沿って押す",
        ">65.0 in<",
        "左から",
        ">0.19 in<",
        "残り 5 ~ 7 回",
        "金型を確認",
        ">直前: 助言 1.9° (1.7 ~ 2.1)、実際 1.8°<",
    ] {
        assert!(page.contains(text), "{text}");
    }
    // Across, and oblique: from the press, with both ends.
    show(bend([[0.0, 700.0], [3000.0, 820.0]]));
    let (_, _, page) = site.get("/");
    assert!(page.contains(">700 mm<") && page.contains("from the press, far end 820 mm"), "{page}");
    let cannot = AdvicePart {
        step: AdvisedStep::Cannot,
        bend: None,
        why: Some(CannotAdvise::EdgeOutOfReach.texts()),
        strokes_left: None,
        says: Vec::new(),
        last: Some(LastAdvice::TooLate),
    };
    show(cannot);
    assert!(site.get("/").2.contains("No advice: what is missing lies nearer to an edge"));
    assert!(site.get("/?lang=ja").2.contains("助言なし: 端部"));
    // The stroke before it was made before its advice was ready.
    assert!(site.get("/").2.contains(">Last stroke: made before the advice was ready<"));
    assert!(site.get("/?lang=ja").2.contains(">直前: 助言の準備前に押されました<"));
}
