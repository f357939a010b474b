//! The owner's token: a token that only the owner of the data directory can read, for the owner's processes and browsers.

use super::{Access, HolderName, Role, Tokens};
use murmuration_files::{InputKind, expect_own_file, read_bytes};
use murmuration_link::{CredentialsError, Token, read_token};
use murmuration_store::{StoreError, files::is_there};
use std::{
    fs,
    io::{self, Write as _},
    path::{Path, PathBuf},
    sync::Arc,
};

/// Name of the token's file in the data directory.
const FILE: &str = "local-token";

/// The token of a data directory.
#[derive(Debug)]
pub struct LocalToken {
    token: Token,
}

/// The token of a data directory, if the directory has a token.
///
/// # Errors
/// If there is a token that this process cannot read.
pub fn local_token(data: &Path) -> Result<Option<Token>, CredentialsError> {
    let path = data.join(FILE);
    // In another user's folder, the file could be a link to this user's token, which a command would then send to that user's
    // process.
    let unread = |source| CredentialsError::File {
        path: path.clone(),
        source,
    };
    match expect_own_file(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        checked => checked.map_err(unread)?,
    }
    match read_token(&path) {
        Ok(token) => Ok(Some(token)),
        Err(CredentialsError::File { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

impl LocalToken {
    /// Reads the token of a data directory. Makes a token if there is no token, or if the token was not completely written.
    pub fn of(data: &Path) -> Result<Self, StoreError> {
        let path = data.join(FILE);
        let unread = |source| StoreError::File {
            doing: "read",
            path: path.clone(),
            source,
        };
        is_there(&path).map_err(unread)?;
        match local_token(data) {
            Ok(Some(token)) => return Ok(Self { token }),
            Err(error) if !is_begun(&path) => {
                return Err(unread(match error {
                    CredentialsError::File { source, .. } => source,
                    other => io::Error::other(other.to_string()),
                }));
            }
            Ok(None) | Err(_) => {}
        }
        let token = Token::generate().map_err(io::Error::other);
        let made = token.and_then(|token| write(&path, &token).map(|()| Self { token }));
        made.map_err(|source| StoreError::File {
            doing: "make the token for this machine's processes",
            path,
            source,
        })
    }

    pub const fn token(&self) -> &Token {
        &self.token
    }

    /// Access rules that accept this token as an operator's token, and the tokens of `others`.
    pub(crate) fn access_with(&self, others: Tokens, certificates: bool) -> Access {
        let mut tokens = others;
        tokens.add(HolderName::owner(), Role::Operator, self.token.digest());
        Access {
            tokens: Some(Arc::new(tokens)),
            owner: Some(self.token.digest()),
            certificates,
        }
    }

    /// Access rules that accept only this token, as an operator's token.
    pub fn access(&self) -> Access {
        self.access_with(Tokens::default(), false)
    }
}

/// Whether a file is a token of which only the beginning was written. The coordinator did not make any other file of that name.
fn is_begun(path: &Path) -> bool {
    let is_begun = |bytes: Vec<u8>| b"mur_".starts_with(&bytes) || bytes.starts_with(b"mur_");
    expect_own_file(path).is_ok() && read_bytes(path, InputKind::Token).is_ok_and(is_begun)
}

/// Writes a file that only its owner can read.
fn write(path: &PathBuf, token: &Token) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut options = fs::File::options();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    writeln!(options.open(path)?, "{}", token.reveal())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stays_the_same_and_its_owner_alone_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        assert!(local_token(folder.path()).unwrap().is_none());
        let made = LocalToken::of(folder.path()).unwrap();
        let again = LocalToken::of(folder.path()).unwrap();
        assert_eq!(made.token().digest(), again.token().digest());
        let path = folder.path().join(FILE);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        }
        fs::write(&path, "somebody's notes").unwrap();
        assert!(LocalToken::of(folder.path()).is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "somebody's notes");
        fs::write(&path, "mur_a").unwrap();
        LocalToken::of(folder.path()).unwrap();
        // An unreadable token is not replaced, because it must stay valid.
        let kept = folder.path().join("kept");
        fs::rename(&path, &kept).unwrap();
        fs::create_dir(&path).unwrap();
        assert!(LocalToken::of(folder.path()).is_err());
        fs::remove_dir(&path).unwrap();
        std::os::unix::fs::symlink(folder.path().join("unmounted"), &path).unwrap();
        assert!(LocalToken::of(folder.path()).is_err());
        fs::rename(&kept, &path).unwrap();
        fs::write(&path, "mur_torn").unwrap();
        let other = LocalToken::of(folder.path()).unwrap();
        assert_ne!(other.token().digest(), made.token().digest());
        assert_eq!(
            local_token(folder.path()).unwrap().unwrap().digest(),
            other.token().digest()
        );
    }

    #[test]
    fn a_link_to_a_token_elsewhere_is_not_followed() {
        let (own, others) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        LocalToken::of(own.path()).unwrap();
        let path = others.path().join(FILE);
        for link in [std::os::unix::fs::symlink, fs::hard_link] {
            link(own.path().join(FILE), &path).unwrap();
            let error = local_token(others.path()).unwrap_err().to_string();
            assert!(error.contains("link"), "{error}");
            assert!(LocalToken::of(others.path()).is_err());
            fs::remove_file(&path).unwrap();
        }
        // Opening a pipe would wait for ever.
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        assert!(local_token(others.path()).is_err() && LocalToken::of(others.path()).is_err());
    }
}
