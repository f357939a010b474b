use super::*;
use axum::{
    http::header::{COOKIE as COOKIES, SET_COOKIE},
    response::IntoResponse as _,
};

/// Sessions that are kept in a data directory.
struct Kept {
    folder: tempfile::TempDir,
    secret: Token,
    sessions: Sessions,
}

impl Kept {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let secret = Token::generate().unwrap();
        let sessions = Sessions::kept_at(folder.path(), &secret, now(), |_| true).unwrap();
        Self {
            folder,
            secret,
            sessions,
        }
    }

    /// The sessions after a restart.
    fn again(&self, are_good: impl Fn(TokenDigest) -> bool) -> Sessions {
        self.again_at(now(), are_good)
    }

    /// The sessions after a restart at this time.
    fn again_at(&self, now: SystemTime, are_good: impl Fn(TokenDigest) -> bool) -> Sessions {
        Sessions::kept_at(self.folder.path(), &self.secret, now, are_good).unwrap()
    }

    fn log_in(&self, token: TokenDigest, now: SystemTime) -> HeaderMap {
        cookie_of(self.sessions.log_in(&HeaderMap::new(), token, true, now).unwrap())
    }
}

/// Headers of a browser that has these cookies.
fn cookie_of(jar: SignedCookieJar) -> HeaderMap {
    let set = jar.into_response().headers()[SET_COOKIE]
        .to_str()
        .unwrap()
        .to_owned();
    for part in [
        "; HttpOnly",
        "; SameSite=Strict",
        "; Secure",
        "; Path=/",
        "; Max-Age=604800",
    ] {
        assert!(set.contains(part), "{set}");
    }
    with_cookie(set.split(';').next().unwrap())
}

fn with_cookie(cookie: &str) -> HeaderMap {
    HeaderMap::from_iter([(COOKIES, format!("theme=dark; {cookie}").parse().unwrap())])
}

fn token() -> TokenDigest {
    Token::generate().unwrap().digest()
}

fn now() -> SystemTime {
    UNIX_EPOCH + Duration::from_secs(1_800_000_000)
}

fn whose(sessions: &Sessions, headers: &HeaderMap, now: SystemTime) -> Option<TokenDigest> {
    sessions.of(headers, now).map(|session| session.token)
}

#[test]
fn a_session_is_good_for_its_time_and_under_its_own_signature() {
    let (kept, ana) = (Kept::new(), token());
    let cookie = kept.log_in(ana, now());
    assert_eq!(whose(&kept.sessions, &cookie, now()), Some(ana));
    let last = now() + LIFETIME - Duration::from_secs(1);
    assert_eq!(whose(&kept.sessions, &cookie, last), Some(ana));
    assert_eq!(whose(&kept.sessions, &cookie, now() + LIFETIME), None);
    let text = cookie[COOKIES].to_str().unwrap();
    let id = text.rsplit('=').next().unwrap();
    assert_eq!(whose(&Kept::new().sessions, &cookie, now()), None);
    for forged in [
        format!("{COOKIE}="),
        format!("{COOKIE}={}", &id[1..]),
        format!("other={id}"),
        COOKIE.to_owned(),
    ] {
        assert_eq!(
            whose(&kept.sessions, &with_cookie(&forged), now()),
            None,
            "{forged}"
        );
    }
    assert_eq!(whose(&kept.sessions, &HeaderMap::new(), now()), None);
}

#[test]
fn what_was_logged_out_stays_so_after_a_restart_and_others_go_on() {
    let (kept, ana) = (Kept::new(), token());
    let (one, other) = (kept.log_in(ana, now()), kept.log_in(ana, now()));
    kept.sessions.log_out(&one).unwrap();
    // Neither a second log-out nor a log-out without a session is an error.
    kept.sessions.log_out(&one).unwrap();
    kept.sessions.log_out(&HeaderMap::new()).unwrap();
    for sessions in [kept.sessions.clone(), kept.again(|_| true)] {
        assert_eq!(whose(&sessions, &one, now()), None);
        assert_eq!(whose(&sessions, &other, now()), Some(ana));
    }
    let gone = kept.sessions.forget(&other).into_response();
    let gone = gone.headers()[SET_COOKIE].to_str().unwrap();
    assert!(gone.contains("Max-Age=0") && gone.contains("Path=/"), "{gone}");
}

#[test]
fn a_token_that_was_removed_and_comes_back_brings_no_session_back() {
    let (kept, ana, bo) = (Kept::new(), token(), token());
    let (of_ana, of_bo) = (kept.log_in(ana, now()), kept.log_in(bo, now()));
    let without = kept.again(|token| token == bo);
    assert_eq!(whose(&without, &of_ana, now()), None);
    assert_eq!(whose(&without, &of_bo, now()), Some(bo));
    let back = kept.again(|_| true);
    assert_eq!(whose(&back, &of_ana, now()), None);
    assert_eq!(whose(&back, &of_bo, now()), Some(bo));
}

#[test]
fn a_new_log_in_takes_the_place_of_the_browsers_last_and_of_the_oldest_when_there_are_too_many() {
    let (kept, ana, bo) = (Kept::new(), token(), token());
    let of_bo = kept.log_in(bo, now());
    let first = kept.log_in(ana, now());
    drop(kept.sessions.log_in(&first, ana, true, now()).unwrap());
    assert_eq!(whose(&kept.sessions, &first, now()), None);

    let second = Duration::from_secs(1);
    let later: Vec<HeaderMap> = (1..=MAX_SESSIONS_PER_TOKEN as u32)
        .map(|place| kept.log_in(ana, now() + place * second))
        .collect();
    let end = now() + LIFETIME - second;
    for cookie in &later {
        assert_eq!(whose(&kept.sessions, cookie, end), Some(ana));
    }
    kept.log_in(ana, now() + 1000 * second);
    assert_eq!(whose(&kept.sessions, &later[0], end), None);
    assert_eq!(whose(&kept.sessions, &later[1], end), Some(ana));
    assert_eq!(whose(&kept.sessions, &of_bo, end), Some(bo));
    // Expired sessions are not kept.
    kept.log_in(bo, now() + 2 * LIFETIME);
    let text = fs::read_to_string(kept.folder.path().join(FILE)).unwrap();
    assert_eq!(
        serde_json::from_str::<Vec<Row>>(&text).unwrap().len(),
        1,
        "{text}"
    );
}

#[test]
fn the_oldest_is_what_was_opened_first_within_a_second_and_when_the_clock_is_set_back() {
    let (kept, ana) = (Kept::new(), token());
    let second = Duration::from_secs(1);
    // The first log-ins happen within a second, and further log-ins happen while the clock runs backwards.
    let mut opened: Vec<HeaderMap> = (0..MAX_SESSIONS_PER_TOKEN)
        .map(|_| kept.log_in(ana, now()))
        .collect();
    let mut sessions = kept.sessions.clone();
    for place in 1..=MAX_SESSIONS_PER_TOKEN {
        let set_back = now() - place as u32 * second;
        let jar = sessions.log_in(&HeaderMap::new(), ana, true, set_back).unwrap();
        opened.push(cookie_of(jar));
        for (number, cookie) in opened.iter().enumerate() {
            let lasts = whose(&sessions, cookie, set_back).is_some();
            assert_eq!(lasts, number >= place, "session {number} after {place} more");
        }
        // A restart does not change the order of the sessions either.
        sessions = kept.again(|_| true);
    }
}

#[test]
fn a_file_that_cannot_be_understood_has_everybody_log_in_again() {
    let (kept, ana) = (Kept::new(), token());
    let cookie = kept.log_in(ana, now());
    let path = kept.folder.path().join(FILE);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    }
    fs::write(&path, "[{").unwrap();
    assert_eq!(whose(&kept.again(|_| true), &cookie, now()), None);
}

#[test]
fn without_a_disk_nobody_is_logged_in_and_a_log_out_says_that_it_may_not_last() {
    let (kept, ana) = (Kept::new(), token());
    let cookie = kept.log_in(ana, now());
    let path = kept.folder.path().to_owned();
    kept.folder.close().unwrap();
    let refused = kept.sessions.log_in(&HeaderMap::new(), ana, true, now());
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains(&path.display().to_string())
    );
    assert!(kept.sessions.log_out(&cookie).is_err());
    assert_eq!(whose(&kept.sessions, &cookie, now()), None);
    // A repeated log-out fails until the file can be written.
    assert!(kept.sessions.log_out(&cookie).is_err());
    std::fs::create_dir(&path).unwrap();
    kept.sessions.log_out(&cookie).unwrap();
    let restarted = Sessions::kept(&path, &kept.secret, |_| true).unwrap();
    assert_eq!(whose(&restarted, &cookie, now()), None);
    std::fs::remove_dir_all(&path).unwrap();
}

#[tokio::test(start_paused = true)]
async fn who_waits_for_a_session_to_end_is_told() {
    let (kept, ana) = (Kept::new(), token());
    let cookie = kept.log_in(ana, now());
    let waiting = tokio::spawn(kept.sessions.of(&cookie, now()).unwrap().ended());
    tokio::task::yield_now().await;
    assert!(!waiting.is_finished());
    kept.sessions.log_out(&cookie).unwrap();
    let begun = tokio::time::Instant::now();
    waiting.await.unwrap();
    assert_eq!(begun.elapsed(), Duration::ZERO);

    let cookie = kept.log_in(ana, now());
    kept.sessions.of(&cookie, now()).unwrap().ended().await;
    assert_eq!(begun.elapsed(), LIFETIME);
}

#[test]
fn a_clock_that_is_set_neither_revives_nor_prolongs_a_session() {
    let kept = Kept::new();
    let (token, day) = (token(), Duration::from_secs(24 * 3600));
    let headers = kept.log_in(token, now());
    // The clock was ahead at a restart, and is right at the next one.
    let ahead = kept.again_at(now() + 8 * day, |_| true);
    assert_eq!(whose(&ahead, &headers, now() + 8 * day), None);
    let right = kept.again_at(now() + 2 * day, |_| true);
    assert_eq!(whose(&right, &headers, now() + 2 * day), None);

    let kept = Kept::new();
    let headers = kept.log_in(token, now() + 3000 * day);
    let right = kept.again_at(now(), |_| true);
    assert_eq!(whose(&right, &headers, now() + 6 * day), Some(token));
    assert_eq!(whose(&right, &headers, now() + 8 * day), None);
    let since = right.now().duration_since(now()).unwrap();
    assert!(since < Duration::from_secs(60), "{since:?}");
}

#[test]
fn a_file_of_sessions_that_never_ends_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.path().join(FILE)).unwrap();
    let error = Sessions::kept(folder.path(), &Token::generate().unwrap(), |_| true).unwrap_err();
    assert!(error.to_string().contains("not a regular file"), "{error}");
}
