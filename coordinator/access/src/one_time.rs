//! Codes in links with which the owner of a data directory logs a browser in: each code works once, for some minutes.
//!
//! Whoever has the owner's token can make a code, without asking the coordinator. The token itself would stay in the browser's
//! history, and in the list of processes of the program that opens the browser.

use base64::{Engine as _, engine::general_purpose::URL_SAFE_NO_PAD};
use murmuration_link::{Token, TokenDigest};
use ring::hmac;
use std::{
    collections::BTreeMap,
    io,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

/// How long a code is valid.
const LIFETIME: Duration = Duration::from_secs(15 * 60);
/// How far the clock of the machine that makes a code may be ahead.
const CLOCK_DIFFERENCE: Duration = Duration::from_secs(60);
/// Purpose of the key, which is part of its derivation: keys of the token for other purposes differ.
const PURPOSE: &[u8] = b"murmuration one-time code";
const RANDOM_BYTES: usize = 16;
const TIME_BYTES: usize = 8;
const TAG_BYTES: usize = 32;

/// A new code for the bearer of `token`.
///
/// # Errors
/// If the system has no random numbers.
pub fn one_time_code(token: &Token) -> io::Result<String> {
    code_at(token, SystemTime::now())
}

/// A code is 16 random bytes, the time of its making in milliseconds since 1970-01-01 UTC, and their HMAC-SHA256.
fn code_at(token: &Token, now: SystemTime) -> io::Result<String> {
    let mut bytes = vec![0; RANDOM_BYTES];
    getrandom::fill(&mut bytes).map_err(io::Error::other)?;
    bytes.extend(milliseconds(now).to_be_bytes());
    let tag = hmac::sign(&key_of(token), &bytes);
    bytes.extend(tag.as_ref());
    Ok(URL_SAFE_NO_PAD.encode(bytes))
}

fn key_of(token: &Token) -> hmac::Key {
    let of_token = hmac::Key::new(hmac::HMAC_SHA256, token.reveal().as_bytes());
    hmac::Key::new(hmac::HMAC_SHA256, hmac::sign(&of_token, PURPOSE).as_ref())
}

/// The codes that a coordinator accepts; cheap to clone.
#[derive(Debug, Clone)]
pub struct OneTimeCodes(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    key: hmac::Key,
    owner: TokenDigest,
    /// The start of this coordinator: codes that are older may have been used with the coordinator before it.
    started: u64,
    /// The random bytes of used codes, with the time of their making.
    used: Mutex<BTreeMap<[u8; RANDOM_BYTES], u64>>,
}

impl OneTimeCodes {
    /// The codes of the bearer of `token` that are made from now on.
    pub fn new(token: &Token) -> Self {
        Self::since(token, SystemTime::now())
    }

    fn since(token: &Token, started: SystemTime) -> Self {
        Self(Arc::new(Shared {
            key: key_of(token),
            owner: token.digest(),
            started: milliseconds(started),
            used: Mutex::default(),
        }))
    }

    /// The owner's token, if `code` is valid. The code is not valid again.
    pub fn redeem(&self, code: &str, now: SystemTime) -> Option<TokenDigest> {
        let bytes = URL_SAFE_NO_PAD.decode(code).ok()?;
        if bytes.len() != RANDOM_BYTES + TIME_BYTES + TAG_BYTES {
            return None;
        }
        let (signed, tag) = bytes.split_at(RANDOM_BYTES + TIME_BYTES);
        hmac::verify(&self.0.key, signed, tag).ok()?;
        let (random, time) = signed.split_first_chunk::<RANDOM_BYTES>()?;
        let made = u64::from_be_bytes(time.try_into().ok()?);
        let now = milliseconds(now);
        let is_fresh = |made: u64| {
            now.saturating_sub(made) <= LIFETIME.as_millis() as u64
                && made.saturating_sub(now) <= CLOCK_DIFFERENCE.as_millis() as u64
        };
        if !is_fresh(made) || made < self.0.started {
            return None;
        }
        let mut used = self.0.used.lock().unwrap_or_else(PoisonError::into_inner);
        used.retain(|_, made| is_fresh(*made));
        used.insert(*random, made).is_none().then_some(self.0.owner)
    }
}

fn milliseconds(time: SystemTime) -> u64 {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_millis()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_works_once_and_for_some_minutes() {
        let (token, now) = (Token::generate().unwrap(), SystemTime::now());
        let codes = OneTimeCodes::since(&token, now);
        let code = code_at(&token, now).unwrap();
        assert_eq!(codes.redeem(&code, now), Some(token.digest()));
        assert_eq!(codes.redeem(&code, now), None);
        let code = code_at(&token, now).unwrap();
        assert_eq!(codes.redeem(&code, now + LIFETIME + Duration::from_secs(1)), None);
        assert_eq!(codes.redeem(&code, now + LIFETIME), Some(token.digest()));
        let early = code_at(&token, now + 2 * CLOCK_DIFFERENCE).unwrap();
        assert_eq!(codes.redeem(&early, now), None);
    }

    #[test]
    fn a_used_code_is_not_valid_after_a_restart() {
        let (token, now) = (Token::generate().unwrap(), SystemTime::now());
        let code = code_at(&token, now).unwrap();
        assert!(OneTimeCodes::since(&token, now).redeem(&code, now).is_some());
        let restarted = OneTimeCodes::since(&token, now + Duration::from_secs(1));
        assert_eq!(restarted.redeem(&code, now + Duration::from_secs(2)), None);
    }

    #[test]
    fn other_texts_and_codes_of_others_are_not_valid() {
        let (token, now) = (Token::generate().unwrap(), SystemTime::now());
        let codes = OneTimeCodes::since(&token, now);
        let code = code_at(&token, now).unwrap();
        let others = code_at(&Token::generate().unwrap(), now).unwrap();
        let mut changed = URL_SAFE_NO_PAD.decode(&code).unwrap();
        changed[0] ^= 1;
        for wrong in ["", "a", &code[1..], &others, &URL_SAFE_NO_PAD.encode(changed)] {
            assert_eq!(codes.redeem(wrong, now), None, "{wrong}");
        }
        assert!(codes.redeem(&code, now).is_some());
    }
}
