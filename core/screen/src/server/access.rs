//! Access control of the pages: the host name of a request, the site that it comes from, and the token.
//!
//! A page of another site must not read the pages through a browser of the plant (DNS rebinding, cross-site requests).
//! Therefore `Host` must be one of our own names, and `Sec-Fetch-Site` must not be another site. Off loopback a token
//! is required. It is given once as `?token=`, which is answered by a cookie, or as `Authorization: Bearer`.

use std::collections::HashMap;
use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::http::{HeaderMap, StatusCode, header};
use subtle::ConstantTimeEq as _;

/// Name of the cookie with the token.
pub(super) const COOKIE: &str = "platen_token";
/// Number of wrong tokens from one address within [`WINDOW`] after which it is refused.
const WRONG: usize = 5;
const WINDOW: Duration = Duration::from_secs(60);
/// Largest number of addresses for which wrong tokens are counted.
const COUNTED: usize = 1024;
/// Smallest length of a token, characters.
const LEAST: usize = 32;

/// Failure to read a token.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum TokenError {
    /// The file cannot be read.
    #[error("{file}: cannot be read: {source}; make it with `platen screen token FILE`")]
    Unreadable { file: String, source: std::io::Error },
    /// Too short to be random enough, or not of printable characters.
    #[error(
        "{file}: holds no token of at least {LEAST} printable characters; make one with `platen screen token FILE`"
    )]
    Unusable { file: String },
}

/// Secret that a browser must give.
#[derive(Clone)]
pub struct Token(String);

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token")
    }
}

impl Token {
    /// Reads the token in a file.
    ///
    /// # Errors
    /// [`TokenError`].
    pub fn load(path: &Path) -> Result<Self, TokenError> {
        let file = path.display().to_string();
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(source) => return Err(TokenError::Unreadable { file, source }),
        };
        let token = text.trim();
        if token.len() < LEAST || !token.chars().all(|c| c.is_ascii_alphanumeric() || "-_=.".contains(c)) {
            return Err(TokenError::Unusable { file });
        }
        Ok(Self(token.to_owned()))
    }

    fn is(&self, given: &str) -> bool {
        self.0.as_bytes().ct_eq(given.as_bytes()).into()
    }
}

/// Access control of the pages: token, and names of the host.
#[derive(Debug, Clone, Default)]
pub struct Access {
    /// Token, where one is required.
    pub token: Option<Token>,
    /// Host names by which browsers reach the host, besides loopback and its address.
    pub names: Vec<String>,
}

impl Access {
    /// Returns the gate of a server at an address.
    pub(super) fn at(self, address: SocketAddr) -> Gate {
        Gate { access: self, address, wrong: Mutex::default() }
    }
}

/// Decision on a request.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Passage {
    /// Access granted.
    Open,
    /// Access granted by the token in the address, which is replaced by a cookie.
    Cookie(String),
    /// Access refused, with the reason.
    Closed(StatusCode, &'static str),
}

/// Access check for every request.
#[derive(Debug)]
pub(super) struct Gate {
    access: Access,
    address: SocketAddr,
    wrong: Mutex<HashMap<IpAddr, Vec<Instant>>>,
}

impl Gate {
    /// Decides on a request from its headers, the token in its address, and whether it is for data rather than for a
    /// page.
    pub(super) fn passage(
        &self,
        peer: IpAddr,
        headers: &HeaderMap,
        token: Option<&str>,
        is_data: bool,
    ) -> Passage {
        let header = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
        if !header(header::HOST.as_str()).is_some_and(|host| self.is_own(host)) {
            return Passage::Closed(
                StatusCode::MISDIRECTED_REQUEST,
                "this name is not one of platen's; add it to names in [screen] if it should be",
            );
        }
        if is_data && !matches!(header("sec-fetch-site"), None | Some("same-origin" | "none")) {
            return Passage::Closed(StatusCode::FORBIDDEN, "pages of other sites may not read platen");
        }
        let Some(expected) = &self.access.token else { return Passage::Open };
        if self.is_blocked(peer) {
            return Passage::Closed(StatusCode::TOO_MANY_REQUESTS, "too many wrong tokens; wait a minute");
        }
        let bearer = header(header::AUTHORIZATION.as_str()).and_then(|value| value.strip_prefix("Bearer "));
        let cookie = header(header::COOKIE.as_str()).and_then(|cookies| {
            cookies.split(';').find_map(|cookie| cookie.trim().strip_prefix(COOKIE)?.strip_prefix('='))
        });
        match (token, bearer.or(cookie)) {
            (Some(given), _) if expected.is(given) => Passage::Cookie(given.to_owned()),
            (None, Some(given)) if expected.is(given) => Passage::Open,
            (None, None) => {
                Passage::Closed(StatusCode::UNAUTHORIZED, "give the token: add ?token=... to the address")
            }
            _ => {
                self.count_wrong(peer);
                Passage::Closed(StatusCode::UNAUTHORIZED, "wrong token")
            }
        }
    }

    /// Returns whether `Host` is this server: loopback or its address with its port, or one of the names. For a name
    /// any port is accepted, since a proxy in front may use another one.
    fn is_own(&self, host: &str) -> bool {
        let (name, port) = match host.rsplit_once(':') {
            Some((name, port)) if port.chars().all(|c| c.is_ascii_digit()) => (name, port.parse().ok()),
            _ => (host, Some(80)),
        };
        let name = name.trim_start_matches('[').trim_end_matches(']');
        if self.access.names.iter().any(|own| own.eq_ignore_ascii_case(name)) {
            return true;
        }
        // A rebound name is never an address: when listening on all addresses, any of them is ours.
        let own = self.address.ip();
        let is_address =
            name.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback() || ip == own || own.is_unspecified());
        (name.eq_ignore_ascii_case("localhost") || is_address) && port == Some(self.address.port())
    }

    fn is_blocked(&self, peer: IpAddr) -> bool {
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        wrong.retain(|_, times| {
            times.retain(|time| time.elapsed() < WINDOW);
            !times.is_empty()
        });
        wrong.get(&peer).is_some_and(|times| times.len() >= WRONG)
    }

    fn count_wrong(&self, peer: IpAddr) {
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        if wrong.len() < COUNTED || wrong.contains_key(&peer) {
            wrong.entry(peer).or_default().push(Instant::now());
        }
    }
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderName;

    use super::*;

    const TOKEN: &str = "0123456789abcdef0123456789abcdef";
    const PEER: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(192, 0, 2, 7));

    fn gate(listen: &str, token: Option<&str>) -> Gate {
        let token = token.map(|text| Token(text.to_owned()));
        Access { token, names: vec!["press3.example".into()] }.at(listen.parse().unwrap())
    }

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (HeaderName::from_static(name), value.parse().unwrap())).collect()
    }

    #[test]
    fn only_our_own_names_are_answered() {
        let gate = gate("127.0.0.1:8380", None);
        let passage = |host: &str| gate.passage(PEER, &headers(&[("host", host)]), None, false);
        let own = [
            "127.0.0.1:8380",
            "localhost:8380",
            "LOCALHOST:8380",
            "[::1]:8380",
            "press3.example",
            "press3.example:443",
        ];
        for host in own {
            assert_eq!(passage(host), Passage::Open, "{host}");
        }
        let foreign = [
            "evil.example:8380",
            "127.0.0.1:80",
            "127.0.0.1",
            "192.0.2.9:8380",
            "localhost.evil.example:8380",
            "",
        ];
        for host in foreign {
            assert!(matches!(passage(host), Passage::Closed(StatusCode::MISDIRECTED_REQUEST, _)), "{host}");
        }
        let missing = gate.passage(PEER, &HeaderMap::new(), None, false);
        assert!(matches!(missing, Passage::Closed(StatusCode::MISDIRECTED_REQUEST, _)));
    }

    #[test]
    fn another_site_reads_no_data() {
        let gate = gate("127.0.0.1:8380", None);
        let passage = |site: &str, is_data| {
            gate.passage(
                PEER,
                &headers(&[("host", "localhost:8380"), ("sec-fetch-site", site)]),
                None,
                is_data,
            )
        };
        assert_eq!(passage("same-origin", true), Passage::Open);
        assert_eq!(passage("none", true), Passage::Open);
        for site in ["cross-site", "same-site", "sideways"] {
            assert!(matches!(passage(site, true), Passage::Closed(StatusCode::FORBIDDEN, _)), "{site}");
        }
        assert_eq!(passage("cross-site", false), Passage::Open, "a link to the page itself");
    }

    #[test]
    fn a_token_is_asked_for_and_five_wrong_ones_are_enough() {
        let gate = gate("0.0.0.0:8380", Some(TOKEN));
        let ask = |token: Option<&str>, pairs: &[(&'static str, &str)]| {
            let mut all = vec![("host", "192.0.2.1:8380")];
            all.extend_from_slice(pairs);
            gate.passage(PEER, &headers(&all), token, true)
        };
        assert!(matches!(ask(None, &[]), Passage::Closed(StatusCode::UNAUTHORIZED, _)));
        assert_eq!(ask(Some(TOKEN), &[]), Passage::Cookie(TOKEN.to_owned()));
        assert_eq!(ask(None, &[("cookie", &format!("a=b; {COOKIE}={TOKEN}"))]), Passage::Open);
        assert_eq!(ask(None, &[("authorization", &format!("Bearer {TOKEN}"))]), Passage::Open);
        for _ in 0..WRONG {
            assert!(matches!(ask(Some("guess"), &[]), Passage::Closed(StatusCode::UNAUTHORIZED, _)));
        }
        assert!(matches!(ask(Some(TOKEN), &[]), Passage::Closed(StatusCode::TOO_MANY_REQUESTS, _)));
    }

    #[test]
    fn a_short_token_is_refused_and_none_is_printed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        std::fs::write(&path, "secret\n").unwrap();
        assert!(matches!(Token::load(&path), Err(TokenError::Unusable { .. })));
        std::fs::write(&path, format!("{TOKEN}\n")).unwrap();
        let token = Token::load(&path).unwrap();
        assert!(token.is(TOKEN) && !token.is("guess"));
        assert_eq!(format!("{token:?}"), "Token");
    }
}
