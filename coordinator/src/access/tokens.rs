//! The tokens file: who may come in, as what, and the digests of their tokens; never a token itself.

use super::Role;
use murmuration_link::TokenDigest;
use serde::Deserialize;
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// Most entries of a tokens file: every request is compared with all of them.
const MAX_HOLDERS: usize = 1000;
/// Longest name, in bytes.
const MAX_NAME: usize = 64;

/// Everybody who may come in with a token.
#[derive(Debug, Default)]
pub struct Tokens {
    holders: Vec<Holder>,
}

/// Whom a token lets in, as what.
#[derive(Debug)]
pub(crate) struct Holder {
    /// For people who read the file, and for refusals.
    pub(crate) name: String,
    pub(crate) role: Role,
    digest: TokenDigest,
}

/// Why a tokens file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokensError {
    /// It cannot be read.
    #[error("cannot read the tokens file {}: {source}", path.display())]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// It is no TOML, or not of this form.
    #[error("the tokens file {}: {reason}", path.display())]
    Syntax {
        /// Which file.
        path: PathBuf,
        /// Where, and what is wrong.
        reason: String,
    },
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    token: Vec<Entry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    role: Role,
    digest: String,
}

impl Tokens {
    /// Reads a tokens file: a `[[token]]` with `name`, `role` and `digest` for each token.
    ///
    /// # Errors
    /// Says where the file is wrong.
    pub fn read(path: &Path) -> Result<Self, TokensError> {
        let text = fs::read_to_string(path).map_err(|source| TokensError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        parse(&text).map_err(|reason| TokensError::Syntax {
            path: path.to_owned(),
            reason,
        })
    }

    /// These alone: name, role, digest.
    pub(crate) fn of(holders: impl IntoIterator<Item = (String, Role, TokenDigest)>) -> Self {
        let holders = holders.into_iter();
        Self {
            holders: holders
                .map(|(name, role, digest)| Holder { name, role, digest })
                .collect(),
        }
    }

    /// Whose token it is. Looks at all of them, whichever it is, so that the time it takes says nothing.
    pub(crate) fn holder(&self, digest: TokenDigest) -> Option<&Holder> {
        let holders = self.holders.iter();
        holders.fold(None, |found, holder| {
            if holder.digest == digest {
                Some(holder)
            } else {
                found
            }
        })
    }
}

/// An entry of a tokens file.
pub(crate) fn entry(name: &str, role: Role, digest: TokenDigest) -> Result<String, String> {
    let text = format!("[[token]]\nname = {name:?}\nrole = \"{role}\"\ndigest = \"{digest}\"\n");
    parse(&text).map(|_| text)
}

fn parse(text: &str) -> Result<Tokens, String> {
    let file: File = toml::from_str(text).map_err(|error| error.to_string())?;
    if file.token.len() > MAX_HOLDERS {
        return Err(format!(
            "{} entries: there may be {MAX_HOLDERS}",
            file.token.len()
        ));
    }
    let holders = file.token.into_iter().map(|Entry { name, role, digest }| {
        let fits = (1..=MAX_NAME).contains(&name.len()) && !name.chars().any(char::is_control);
        if !fits {
            return Err(format!(
                "name = {name:?}: must be 1 to {MAX_NAME} bytes on one line"
            ));
        }
        let digest = digest
            .parse()
            .map_err(|error| format!("the digest of {name:?}: {error}"))?;
        Ok((name, role, digest))
    });
    Ok(Tokens::of(holders.collect::<Result<Vec<_>, _>>()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_link::Token;

    #[test]
    fn an_entry_reads_back_and_knows_its_token_alone() {
        let (ana, bo) = (Token::generate().unwrap(), Token::generate().unwrap());
        let mut text = entry("ana \"a\"", Role::Annotator, ana.digest()).unwrap();
        text += &entry("bo", Role::Operator, bo.digest()).unwrap();
        assert!(!text.contains(&ana.reveal()[4..]), "{text}");
        let tokens = parse(&text).unwrap();
        let whose = |token: &Token| {
            tokens
                .holder(token.digest())
                .map(|holder| (holder.name.as_str(), holder.role))
        };
        assert_eq!(whose(&ana), Some(("ana \"a\"", Role::Annotator)));
        assert_eq!(whose(&bo), Some(("bo", Role::Operator)));
        assert_eq!(whose(&Token::generate().unwrap()), None);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let digest = "0".repeat(64);
        let cases = [
            ("[[token]]\nname = \"a\"", "missing field `role`"),
            (
                &format!("[[token]]\nname = \"a\"\nrole = \"king\"\ndigest = \"{digest}\""),
                "unknown variant `king`",
            ),
            (
                "[[token]]\nname = \"a\"\nrole = \"viewer\"\ndigest = \"mur_secret\"",
                "the digest of \"a\": this is no token's digest",
            ),
            (
                &format!("[[token]]\nname = \"\"\nrole = \"viewer\"\ndigest = \"{digest}\""),
                "must be 1 to 64 bytes",
            ),
            ("[[token]]\nsecret = 1", "unknown field `secret`"),
        ];
        for (text, said) in cases {
            let error = parse(text).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
        let entry = format!("[[token]]\nname = \"a\"\nrole = \"viewer\"\ndigest = \"{digest}\"\n");
        assert!(parse(&entry.repeat(MAX_HOLDERS)).is_ok());
        assert!(parse(&entry.repeat(MAX_HOLDERS + 1)).is_err());
    }
}
