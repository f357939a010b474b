//! Bearer tokens: the credentials of people, and of processes on the coordinator's own machine.
//!
//! A token is 32 random bytes as text. A coordinator stores only its digest, from which the token cannot be derived.

use base64::{Engine as _, engine::general_purpose::URL_SAFE_NO_PAD};
use std::{fmt, str::FromStr};

/// Prefix of every token, which lets scanners for leaked secrets recognise it.
pub(crate) const PREFIX: &str = "mur_";
/// Number of random bytes in a token.
const BYTES: usize = 32;

/// A secret that admits its bearer. Only [`Token::reveal`] shows the secret; `Debug` never does.
#[derive(Clone)]
pub struct Token(String);

/// The BLAKE3 digest of a token, as 64 hexadecimal digits. Comparison takes constant time.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct TokenDigest(blake3::Hash);

/// Why a text is not a token or not a token's digest. The error never quotes the text, which may be secret.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    #[error(
        "this is not a token: a token begins with {PREFIX} and goes on with 43 letters, digits, '-' and '_'"
    )]
    Token,
    #[error("this is not a token's digest: a digest has 64 hexadecimal digits")]
    Digest,
}

impl Token {
    /// A new token, from the system's random numbers.
    ///
    /// # Errors
    /// Fails if the system has no random numbers.
    pub fn generate() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self(format!("{PREFIX}{}", URL_SAFE_NO_PAD.encode(bytes))))
    }

    /// The token's text, to send it, or to show it once to its holder.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// The digest by which a coordinator recognises the token.
    #[must_use]
    pub fn digest(&self) -> TokenDigest {
        TokenDigest::of(&self.0)
    }
}

impl TokenDigest {
    /// The digest of a text that a client presents as a token.
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
