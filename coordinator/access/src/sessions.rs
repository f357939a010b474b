//! The sessions of browsers. A session consists of an entry here, and of a signed cookie with the entry's random id in the
//! browser.
//!
//! A session ends with a log-out, when it expires, or when its token is no longer in the tokens file. The session's entry is then
//! removed, also from the file in the data directory that keeps the entries through restarts. A cookie without an entry is not
//! accepted.

use crate::limits::MAX_SESSIONS_PER_TOKEN;
use axum::http::HeaderMap;
use axum_extra::extract::cookie::{Cookie, Key, SameSite, SignedCookieJar};
use base64::{Engine as _, engine::general_purpose::URL_SAFE_NO_PAD};
use murmuration_files::{InputKind, expect_regular, read_bytes};
use murmuration_link::{Token, TokenDigest};
use murmuration_store::StoreError;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError, RwLock,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};
use tokio::sync::watch;

/// How long a log-in lasts.
const LIFETIME: Duration = Duration::from_secs(7 * 24 * 3600);
/// Beginning of the cookie's name. Browsers send a cookie to all ports of a host, so coordinators on one host need different names.
const COOKIE: &str = "murmuration-session";
/// Name of the sessions' file in the data directory.
const FILE: &str = "sessions.json";
/// Number of random bytes of an id.
const ID_BYTES: usize = 16;

/// The sessions of a coordinator; cheap to clone.
#[derive(Clone)]
pub struct Sessions(Arc<Shared>);

struct Shared {
    /// The key that signs the cookies.
    key: Key,
    /// The name of the cookie, different for each data directory.
    cookie: String,
    path: PathBuf,
    /// The open sessions by id. The lock is never held while the file is written, so that no request waits for the disk.
    open: RwLock<Open>,
    /// Held from a change of the sessions until the file is written, so that the file is written in the order of changes.
    changing: Mutex<()>,
    /// Whether the file differs from memory. This flag is only set and read while `changing` is locked.
    unwritten: AtomicBool,
    /// The start of this process, by the clock and by a timer that nobody sets.
    started: (SystemTime, Instant),
}

type Open = BTreeMap<String, Entry>;

#[derive(Clone)]
struct Entry {
    token: TokenDigest,
    /// A number above the numbers of all sessions that were opened before, whatever the clock showed.
    number: u64,
    /// Time at which the session ends, in seconds since 1970-01-01 UTC.
    until_s: u64,
    /// Dropped when the session has ended.
    end: Arc<watch::Sender<()>>,
}

/// An entry in the file. Entries are in the order in which the sessions were opened.
#[derive(Serialize, Deserialize)]
struct Row {
    id: String,
    token: String,
    until_s: u64,
}

/// The session of a request.
#[derive(Debug)]
pub(crate) struct Session {
    /// The token that the session was opened with.
    pub(crate) token: TokenDigest,
    left: Duration,
    end: watch::Receiver<()>,
}

impl Session {
    /// Waits until the session has ended.
    pub(crate) async fn ended(mut self) {
        // Nothing is ever sent: the sender is dropped, or the time is over.
        let _ = tokio::time::timeout(self.left, self.end.changed()).await;
    }
}

impl std::fmt::Debug for Sessions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Sessions(hidden)")
    }
}

impl Sessions {
    /// Reads the sessions in the data directory `data` whose tokens `are_good`; a key derived from `secret` signs the cookies.
    /// If the file cannot be parsed, everybody must log in again.
    ///
    /// # Errors
    /// If the file exists and cannot be read, or sessions of other tokens cannot be removed from it.
    pub fn kept(
        data: &Path,
        secret: &Token,
        are_good: impl Fn(TokenDigest) -> bool,
    ) -> Result<Self, StoreError> {
        Self::kept_at(data, secret, SystemTime::now(), are_good)
    }

    fn kept_at(
        data: &Path,
        secret: &Token,
        now: SystemTime,
        are_good: impl Fn(TokenDigest) -> bool,
    ) -> Result<Self, StoreError> {
        let path = data.join(FILE);
        let read = expect_regular(&path).and_then(|()| read_bytes(&path, InputKind::Sessions));
        let rows = match read {
            Ok(text) => serde_json::from_slice(&text).unwrap_or_else(|error| {
                tracing::warn!(path = %path.display(), %error, "no sessions can be read: everybody logs in again");
                Vec::new()
            }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(StoreError::from_io(error, "read", &path)),
        };
        let found = rows.len();
        // A session that was opened while the clock was ahead does not last longer than others.
        let longest = seconds(now + LIFETIME);
        let entry = |(number, Row { id, token, until_s })| {
            Some((id, Entry::new(token.parse().ok()?, number, until_s.min(longest))))
        };
        // An expired session stays closed if the clock is set back later.
        let open: Open = (0..)
            .zip(rows)
            .filter_map(entry)
            .filter(|(_, entry)| are_good(entry.token) && entry.lasts(now))
            .collect();
        let shared = Shared {
            key: Key::derive_from(secret.reveal().as_bytes()),
            cookie: cookie_of(secret.digest()),
            path,
            open: RwLock::new(open),
            changing: Mutex::new(()),
            unwritten: AtomicBool::new(false),
            started: (now, Instant::now()),
        };
        // If a removed token is added again later, its old sessions must stay closed.
        let open = shared.open();
        if open.len() < found {
            shared.write(&open)?;
        }
        Ok(Self(Arc::new(shared)))
    }

    /// The time for sessions: the time at which this process started, and the time since then. Setting the clock neither ends nor
    /// prolongs a session.
    pub fn now(&self) -> SystemTime {
        let (clock, timer) = self.0.started;
        clock + timer.elapsed()
    }

    /// The session that a request came with, if it has not ended.
    pub(crate) fn of(&self, headers: &HeaderMap, now: SystemTime) -> Option<Session> {
        let id = self.id(headers)?;
        let open = self.0.open.read().unwrap_or_else(PoisonError::into_inner);
        let entry = open.get(&id).filter(|entry| entry.lasts(now))?;
        Some(Session {
            token: entry.token,
            left: Duration::from_secs(entry.until_s.saturating_sub(seconds(now))),
            end: entry.end.subscribe(),
        })
    }

    /// Opens a session for the bearer of a token, in place of the session of the request, and returns its cookie.
    ///
    /// # Errors
    /// If the session cannot be written; it is not opened then.
    pub fn log_in(
        &self,
        headers: &HeaderMap,
        token: TokenDigest,
        is_encrypted: bool,
        now: SystemTime,
    ) -> Result<SignedCookieJar, StoreError> {
        let mut bytes = [0; ID_BYTES];
        getrandom::fill(&mut bytes).map_err(|error| {
            StoreError::from_io(io::Error::other(error), "make random numbers for", &self.0.path)
        })?;
        let id = URL_SAFE_NO_PAD.encode(bytes);
        let _changing = self.0.changing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut open = self.0.open();
        open.retain(|_, entry| entry.lasts(now));
        if let Some(before) = self.id(headers) {
            open.remove(&before);
        }
        make_room(&mut open, token);
        let number = open.values().map(|entry| entry.number + 1).max().unwrap_or(0);
        open.insert(id.clone(), Entry::new(token, number, seconds(now + LIFETIME)));
        self.0.write(&open)?;
        self.0.set(open);
        let cookie = Cookie::build((self.0.cookie.clone(), id))
            .max_age(time::Duration::seconds(LIFETIME.as_secs() as i64))
            .path("/")
            .http_only(true)
            .same_site(SameSite::Strict)
            .secure(is_encrypted);
        Ok(self.jar(headers).add(cookie))
    }

    /// Ends the session of a request, if the request has a session: in memory at once, and on disk when this returns.
    ///
    /// # Errors
    /// If the change cannot be written: the session would be open again after a restart.
    pub fn log_out(&self, headers: &HeaderMap) -> Result<(), StoreError> {
        let _changing = self.0.changing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut open = self.0.open();
        let has_ended = self.id(headers).and_then(|id| open.remove(&id)).is_some();
        // If an earlier write failed, a repeated request writes the file.
        if has_ended || self.0.unwritten.load(Ordering::Relaxed) {
            self.0.set(open.clone());
            self.0.write(&open)?;
        }
        Ok(())
    }

    /// The cookie that makes a browser forget its session.
    pub fn forget(&self, headers: &HeaderMap) -> SignedCookieJar {
        self.jar(headers)
            .remove(Cookie::build(self.0.cookie.clone()).path("/"))
    }

    /// The id in the cookie of a request, if its signature is valid.
    fn id(&self, headers: &HeaderMap) -> Option<String> {
        Some(self.jar(headers).get(&self.0.cookie)?.value().to_owned())
    }

    fn jar(&self, headers: &HeaderMap) -> SignedCookieJar {
        SignedCookieJar::from_headers(headers, self.0.key.clone())
    }
}

fn cookie_of(secret: TokenDigest) -> String {
    // Eight digits of the digest of a random token reveal nothing about the token.
    let digits: String = secret.to_string().chars().take(8).collect();
    format!("{COOKIE}-{digits}")
}

/// Ends the oldest sessions of a token that has reached its limit.
fn make_room(open: &mut Open, token: TokenDigest) {
    let of_token = open.iter().filter(|(_, entry)| entry.token == token);
    let mut by_age: Vec<(u64, String)> = of_token.map(|(id, entry)| (entry.number, id.clone())).collect();
    by_age.sort_unstable();
    let excess = (by_age.len() + 1).saturating_sub(MAX_SESSIONS_PER_TOKEN);
    for (_, id) in by_age.into_iter().take(excess) {
        open.remove(&id);
    }
}

impl Entry {
    fn new(token: TokenDigest, number: u64, until_s: u64) -> Self {
        Self {
            token,
            number,
            until_s,
            end: Arc::new(watch::Sender::new(())),
        }
    }

    fn lasts(&self, now: SystemTime) -> bool {
        seconds(now) < self.until_s
    }
}

impl Shared {
    /// A copy of all entries.
    fn open(&self) -> Open {
        self.open.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set(&self, open: Open) {
        *self.open.write().unwrap_or_else(PoisonError::into_inner) = open;
    }

    /// Replaces the file, which only its owner can read. A failure leaves the old file unchanged.
    fn write(&self, open: &Open) -> Result<(), StoreError> {
        self.unwritten.store(true, Ordering::Relaxed);
        let mut entries: Vec<_> = open.iter().collect();
        entries.sort_unstable_by_key(|(_, entry)| entry.number);
        let rows: Vec<Row> = entries
            .into_iter()
            .map(|(id, entry)| Row {
                id: id.clone(),
                token: entry.token.to_string(),
                until_s: entry.until_s,
            })
            .collect();
        let folder = self.path.parent().unwrap_or(Path::new("."));
        let write = || {
            let mut file = tempfile::Builder::new()
                .prefix(".sessions-")
                .tempfile_in(folder)?;
            serde_json::to_writer(&mut file, &rows)?;
            file.as_file().sync_all()?;
            file.persist(&self.path)?;
            fs::File::open(folder)?.sync_all()
        };
        write().map_err(|error| StoreError::from_io(error, "write", &self.path))?;
        self.unwritten.store(false, Ordering::Relaxed);
        Ok(())
    }
}

fn seconds(time: SystemTime) -> u64 {
    time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

#[cfg(test)]
mod tests;
