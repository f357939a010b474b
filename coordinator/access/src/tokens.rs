//! The tokens file: the holders of tokens, their roles, and the digests of the tokens, never the tokens themselves.

use super::Role;
use murmuration_files::{InputKind, read_text};
use murmuration_link::TokenDigest;
use murmuration_swarm::{Invalid, grouped, text};
use serde::{Deserialize, Serialize};
use std::{
    fmt, io,
    path::{Path, PathBuf},
    str::FromStr,
};

/// Maximum number of entries of a tokens file: the token of every request is compared with all entries.
const MAX_HOLDERS: usize = 1000;
/// Maximum number of characters of a name.
const MAX_NAME: usize = 64;

/// The name of the holder of a token: 1 to 64 visible characters of any script, without a space at either end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HolderName(String);

/// The tokens that are accepted, with their holders.
#[derive(Debug, Clone, Default)]
pub struct Tokens {
    holders: Vec<TokenHolder>,
}

/// The holder of a token, and their role.
#[derive(Debug, Clone)]
pub(crate) struct TokenHolder {
    /// The holder's name, for people who read the file, and for refusals.
    pub(crate) name: HolderName,
    pub(crate) role: Role,
    digest: TokenDigest,
}

/// Why a tokens file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokensError {
    /// The tokens file cannot be read.
    #[error("cannot read the tokens file {}: {source}", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    /// The tokens file is not TOML of the right form.
    #[error("the tokens file {}: {reason}", path.display())]
    Syntax {
        path: PathBuf,
        /// The place of the error, and its kind.
        reason: String,
    },
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    token: Vec<Entry>,
}

#[derive(Debug, Serialize, Deserialize)]
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
    /// If the file cannot be read, or is wrong; the error then names the place.
    pub fn read(path: &Path) -> Result<Self, TokensError> {
        let text = read_text(path, InputKind::Tokens).map_err(|source| TokensError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        parse(&text).map_err(|reason| TokensError::Syntax {
            path: path.to_owned(),
            reason,
        })
    }

    /// The tokens of these holders: name, role, digest.
    pub(crate) fn of(holders: impl IntoIterator<Item = (HolderName, Role, TokenDigest)>) -> Self {
        let mut tokens = Self::default();
        for (name, role, digest) in holders {
            tokens.add(name, role, digest);
        }
        tokens
    }

    pub(crate) fn add(&mut self, name: HolderName, role: Role, digest: TokenDigest) {
        self.holders.push(TokenHolder { name, role, digest });
    }

    /// The holder of a token. The token is compared with every holder's token, so that the time of the comparison reveals
    /// nothing.
    pub(crate) fn holder(&self, digest: TokenDigest) -> Option<&TokenHolder> {
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

impl HolderName {
    /// The owner of the data directory, who holds its token.
    pub(super) fn owner() -> Self {
        Self("owner".to_owned())
    }
}

impl FromStr for HolderName {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        text::name("name", name, MAX_NAME).map(Self)
    }
}

impl fmt::Display for HolderName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// An entry of a tokens file.
///
/// # Errors
/// If the entry cannot be written as TOML.
pub fn file_entry(name: &HolderName, role: Role, digest: TokenDigest) -> Result<String, toml::ser::Error> {
    let entry = Entry {
        name: name.to_string(),
        role,
        digest: digest.to_string(),
    };
    toml::to_string(&File { token: vec![entry] })
}

fn parse(text: &str) -> Result<Tokens, String> {
    let file: File = toml::from_str(text).map_err(|error| error.to_string())?;
    if file.token.len() > MAX_HOLDERS {
        return Err(format!(
            "{} entries: at most {} are allowed",
            grouped(file.token.len() as u64),
            grouped(MAX_HOLDERS as u64)
        ));
    }
    let holders = file.token.into_iter().map(|Entry { name, role, digest }| {
        let name: HolderName = name.parse().map_err(|error: Invalid| error.to_string())?;
        let digest = digest
            .parse()
            .map_err(|error| format!("the digest of \"{name}\": {error}"))?;
        Ok::<_, String>((name, role, digest))
    });
    let holders = holders.collect::<Result<Vec<_>, _>>()?;
    for (place, (name, _, digest)) in holders.iter().enumerate() {
        if let Some((other, ..)) = holders[..place].iter().find(|(.., known)| known == digest) {
            return Err(format!(
                "\"{other}\" and \"{name}\" have the same token: give each a token of their own"
            ));
        }
    }
    Ok(Tokens::of(holders))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_link::Token;

    #[test]
    fn an_entry_reads_back_and_knows_its_token_alone() {
        let (ana, bo) = (Token::generate().unwrap(), Token::generate().unwrap());
        let mut text = written("ana \"a\"", Role::Annotator, &ana);
        text += &written("bo", Role::Operator, &bo);
        assert!(!text.contains(&ana.reveal()[4..]), "{text}");
        let tokens = parse(&text).unwrap();
        let whose = |token: &Token| {
            tokens
                .holder(token.digest())
                .map(|holder| (holder.name.to_string(), holder.role))
        };
        assert_eq!(whose(&ana), Some(("ana \"a\"".to_owned(), Role::Annotator)));
        assert_eq!(whose(&bo), Some(("bo".to_owned(), Role::Operator)));
        assert_eq!(whose(&Token::generate().unwrap()), None);
        text += &written("bo again", Role::Viewer, &bo);
        let refused = parse(&text).unwrap_err();
        assert!(
            refused.contains("\"bo\" and \"bo again\" have the same token"),
            "{refused}"
        );
    }

    fn written(name: &str, role: Role, token: &Token) -> String {
        file_entry(&name.parse().unwrap(), role, token.digest()).unwrap()
    }

    #[test]
    fn a_name_is_of_any_script_and_can_be_seen() {
        let token = Token::generate().unwrap();
        for name in [
            "Ana",
            "Ang\u{e9}lique",
            // The same name as macOS and some keyboards write it: with a letter and a mark.
            "Ange\u{301}lique",
            "अनीता शर्मा",
            "क्\u{200d}षमा",
            "สมชาย ใจดี",
            "مريم",
            "می\u{200c}خواهم",
            "山田太郎",
            "O'Brien-Smith, 2nd \\ 👩\u{200d}🚀",
            &"अ".repeat(64),
        ] {
            let tokens = parse(&written(name, Role::Viewer, &token)).unwrap();
            let holder = tokens.holder(token.digest()).unwrap();
            assert_eq!(holder.name.to_string(), name);
        }
        for name in [
            "",
            " ",
            "a\u{202e}nimda",
            "admin\u{200b}",
            // These characters are not allowed in other names either.
            "ad\u{200d}min",
            "a\u{fe0f}",
            "\u{2800}",
            "a\nb",
            "\u{1b}[2J",
            &"a".repeat(65),
        ] {
            assert_eq!(name.parse::<HolderName>().unwrap_err().field, "name", "{name:?}");
        }
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
                "the digest of \"a\": this is not a token's digest",
            ),
            (
                &format!("[[token]]\nname = \"\"\nrole = \"viewer\"\ndigest = \"{digest}\""),
                "be seen",
            ),
            ("[[token]]\nsecret = 1", "unknown field `secret`"),
        ];
        for (text, expected) in cases {
            let error = parse(text).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
        let entry =
            |place| format!("[[token]]\nname = \"a\"\nrole = \"viewer\"\ndigest = \"{place:064x}\"\n");
        let entries = |count| (0..count).map(entry).collect::<String>();
        assert!(parse(&entries(MAX_HOLDERS)).is_ok());
        assert!(parse(&entries(MAX_HOLDERS + 1)).is_err());
    }
}
