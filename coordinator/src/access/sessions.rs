//! What a browser keeps instead of a token: whose session it is and until when, under the coordinator's seal.
//!
//! Nothing is kept here: a session lasts through restarts, and ends with its time or with its token.

use murmuration_link::TokenDigest;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// The cookie's name.
pub(crate) const COOKIE: &str = "murmuration-session";
/// How long a log-in lasts.
pub(crate) const LIFETIME: Duration = Duration::from_secs(7 * 24 * 3600);

/// Makes sessions, and knows its own.
pub(crate) struct Sessions {
    key: [u8; 32],
}

impl std::fmt::Debug for Sessions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Sessions(hidden)")
    }
}

impl Sessions {
    /// Sealed with this key.
    pub(crate) const fn sealed_with(key: [u8; 32]) -> Self {
        Self { key }
    }

    /// A session for the bearer of a token.
    pub(crate) fn open(&self, token: TokenDigest, now: SystemTime) -> String {
        let said = format!("{token}.{}", seconds(now + LIFETIME));
        format!("{said}.{}", self.seal(&said).to_hex())
    }

    /// The token that a session was opened with, if it is ours and its time is not over.
    pub(crate) fn token(&self, session: &str, now: SystemTime) -> Option<TokenDigest> {
        let (said, seal) = session.rsplit_once('.')?;
        // Compares in constant time.
        if blake3::Hash::from_hex(seal).ok()? != self.seal(said) {
            return None;
        }
        let (token, until) = said.split_once('.')?;
        let until: u64 = until.parse().ok()?;
        if seconds(now) < until {
            token.parse().ok()
        } else {
            None
        }
    }

    fn seal(&self, said: &str) -> blake3::Hash {
        blake3::keyed_hash(&self.key, said.as_bytes())
    }
}

fn seconds(time: SystemTime) -> u64 {
    time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_link::Token;

    #[test]
    fn a_session_is_good_for_its_time_and_under_its_own_seal() {
        let sessions = Sessions::sealed_with([7; 32]);
        let token = Token::generate().unwrap().digest();
        let now = UNIX_EPOCH + Duration::from_secs(1_800_000_000);
        let session = sessions.open(token, now);
        assert_eq!(sessions.token(&session, now), Some(token));
        let last = now + LIFETIME - Duration::from_secs(1);
        assert_eq!(sessions.token(&session, last), Some(token));
        assert_eq!(sessions.token(&session, now + LIFETIME), None);
        assert_eq!(Sessions::sealed_with([8; 32]).token(&session, now), None);
        let longer = session.replacen(".18", ".19", 1);
        assert_ne!(longer, session);
        let other = session.replacen(
            &token.to_string(),
            &Token::generate().unwrap().digest().to_string(),
            1,
        );
        for forged in [longer.as_str(), other.as_str(), "", ".", "a.b.c", &session[1..]] {
            assert_eq!(sessions.token(forged, now), None, "{forged}");
        }
    }
}
