//! Bearer tokens: what a person, or a process of the coordinator's own machine, shows to be let in.
//!
//! A token is 32 random bytes as text. A coordinator keeps its digest alone: whoever reads that learns no token.

use base64::{Engine as _, engine::general_purpose::URL_SAFE_NO_PAD};
use std::{fmt, str::FromStr};

/// What every token begins with, so that programs that look for leaked secrets know one.
const PREFIX: &str = "mur_";
/// Random bytes in a token.
const BYTES: usize = 32;

/// A secret that lets its bearer in. Shows itself to [`Token::reveal`] alone, never to `Debug`.
#[derive(Clone)]
pub struct Token(String);

/// The BLAKE3 digest of a token, as 64 hexadecimal digits. Two are compared in constant time.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct TokenDigest(blake3::Hash);

/// Why a text is no token or no token's digest. It never quotes the text, which may be a secret.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// Not a token.
    #[error("this is no token: one begins with {PREFIX} and goes on with 43 letters, digits, '-' and '_'")]
    Token,
    /// Not a digest.
    #[error("this is no token's digest: one is 64 hexadecimal digits")]
    Digest,
}

impl Token {
    /// A new one, from the system's random numbers.
    ///
    /// # Errors
    /// Where the system has none to give.
    pub fn generate() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self(format!("{PREFIX}{}", URL_SAFE_NO_PAD.encode(bytes))))
    }

    /// Its text: to be sent, or shown once to whom it is for.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// What a coordinator knows it by.
    #[must_use]
    pub fn digest(&self) -> TokenDigest {
        TokenDigest::of(&self.0)
    }
}

impl TokenDigest {
    /// That of whatever somebody shows for a token.
    #[must_use]
    pub fn of(shown: &str) -> Self {
        Self(blake3::hash(shown.as_bytes()))
    }
}

impl FromStr for Token {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Self, TokenError> {
        let random = text.strip_prefix(PREFIX).ok_or(TokenError::Token)?;
        match URL_SAFE_NO_PAD.decode(random) {
            Ok(bytes) if bytes.len() == BYTES => Ok(Self(text.to_owned())),
            _ => Err(TokenError::Token),
        }
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(hidden)")
    }
}

impl FromStr for TokenDigest {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Self, TokenError> {
        blake3::Hash::from_hex(text)
            .map(Self)
            .map_err(|_| TokenError::Digest)
    }
}

impl fmt::Display for TokenDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.to_hex().as_str())
    }
}

impl fmt::Debug for TokenDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "TokenDigest({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_reads_back_and_never_shows_itself() {
        let token = Token::generate().unwrap();
        let again: Token = token.reveal().parse().unwrap();
        assert_eq!(again.digest(), token.digest());
        assert_eq!(token.digest().to_string().parse(), Ok(token.digest()));
        assert!(!format!("{token:?}").contains(&token.reveal()[4..]));
        assert_ne!(Token::generate().unwrap().digest(), token.digest());
    }

    #[test]
    fn other_texts_are_none_and_are_not_quoted() {
        let token = Token::generate().unwrap();
        let text = token.reveal();
        for wrong in [
            "",
            "mur_",
            &text[4..],
            &text[..46],
            &format!("{text}A"),
            &format!("{text} "),
        ] {
            let error = wrong.parse::<Token>().unwrap_err();
            assert!(wrong.len() < 9 || !error.to_string().contains(wrong), "{error}");
        }
        assert_eq!("abc".parse::<TokenDigest>(), Err(TokenError::Digest));
    }
}
