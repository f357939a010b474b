//! The access file of a coordinator: where the coordinator listens, the certificate that it must show, and a token.
//!
//! The coordinator writes this file when it begins to listen. Its workers, trainers and clients read the file, again at every
//! connection, so that they find a coordinator that was restarted elsewhere.

use crate::{Token, TokenDigest};
use murmuration_files::{InputKind, NewFile, expect_regular, read_text};
use murmuration_swarm::text;
use ring::digest::{SHA256, SHA256_OUTPUT_LEN, digest};
use serde::{Deserialize, Serialize};
use std::{
    fmt::{self, Write as _},
    fs,
    io::{self, Write as _},
    net::IpAddr,
    path::{Path, PathBuf},
    str::FromStr,
    time::SystemTime,
};

/// The contents of an access file.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "Fields", into = "Fields")]
pub struct AccessFile {
    /// URL for workers, trainers and commands.
    pub coordinator: String,
    /// URL of the pages, for browsers.
    pub pages: String,
    /// Fingerprint of the certificate at `coordinator`; `None` if the connection is not encrypted.
    pub fingerprint: Option<Fingerprint>,
    /// The name in a certificate that the coordinator made for itself, for clients that cannot know a certificate by its fingerprint
    /// alone; `None` for a certificate of an authority.
    pub name: Option<String>,
    /// A token that lets its bearer do everything; `None` if the coordinator requires no token.
    pub token: Option<Token>,
}

/// Why an access file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AccessFileError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unread { path: PathBuf, source: io::Error },
    /// The file is something else.
    #[error("{} is not an access file of a coordinator: {reason}", path.display())]
    Other { path: PathBuf, reason: String },
    /// The coordinator has ended for good.
    #[error("the coordinator of {} has ended", path.display())]
    Ended {
        path: PathBuf,
        /// When the file was written, if the system knows.
        at: Option<SystemTime>,
    },
}

impl AccessFileError {
    /// Whether the file does not exist, for example because its coordinator has not started yet.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Unread { source, .. } if source.kind() == io::ErrorKind::NotFound)
    }
}

/// The SHA-256 digest of a certificate (of its DER form), as browsers and `openssl x509 -fingerprint -sha256` show it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint([u8; SHA256_OUTPUT_LEN]);

/// An access file in JSON.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Stored {
    /// The coordinator has ended, and no other one takes its place.
    Ended {
        ended: bool,
    },
    Listens(AccessFile),
}

/// The access file as JSON has it.
#[derive(Serialize, Deserialize)]
struct Fields {
    coordinator: String,
    pages: String,
    fingerprint: Option<String>,
    name: Option<String>,
    token: Option<String>,
}

impl AccessFile {
    /// Name of the access file in a data directory.
    pub const NAME: &str = "access.json";

    /// Reads an access file.
    ///
    /// # Errors
    /// The error names the file and the reason, and quotes no token.
    pub fn read(path: &Path) -> Result<Self, AccessFileError> {
        let unread = |source| AccessFileError::Unread {
            path: path.to_owned(),
            source,
        };
        expect_regular(path).map_err(unread)?;
        let text = read_text(path, InputKind::Access).map_err(unread)?;
        if let Ok(Stored::Ended { ended: true }) = serde_json::from_str(&text) {
            return Err(AccessFileError::Ended {
                path: path.to_owned(),
                at: fs::metadata(path).and_then(|about| about.modified()).ok(),
            });
        }
        serde_json::from_str(&text).map_err(|error| AccessFileError::Other {
            path: path.to_owned(),
            reason: reason(&error),
        })
    }

    /// Writes an access file that only its owner can read. Replaces only an access file, with a token of this `owner` if one is
    /// given.
    ///
    /// # Errors
    /// The errors of [`AccessFile::expect_no_other`], or the system's error.
    pub fn write(&self, path: &Path, owner: Option<TokenDigest>) -> io::Result<()> {
        Self::expect_no_other(path, owner)?;
        replace(path, &Stored::Listens(self.clone()))
    }

    /// Writes in place of an access file that its coordinator has ended for good: its workers leave.
    ///
    /// # Errors
    /// The errors of [`AccessFile::write`].
    pub fn end(path: &Path) -> io::Result<()> {
        Self::expect_no_other(path, None)?;
        replace(path, &Stored::Ended { ended: true })
    }

    /// Checks that [`AccessFile::write`] can write here: it would [replace no other file](Self::expect_no_other), and the folder takes
    /// new files.
    ///
    /// # Errors
    /// If another file is there, or no file can be written.
    pub fn expect_writable(path: &Path, owner: Option<TokenDigest>) -> io::Result<()> {
        Self::expect_no_other(path, owner)?;
        NewFile::create_secret(path).map(drop)
    }

    /// Checks that [`AccessFile::write`] would replace no other file and, if an `owner` is given, no access file with a token of
    /// another owner.
    ///
    /// # Errors
    /// If another file is there, or the system cannot determine what is there.
    pub fn expect_no_other(path: &Path, owner: Option<TokenDigest>) -> io::Result<()> {
        match Self::read(path) {
            Ok(found)
                if owner.is_some()
                    && found
                        .token
                        .as_ref()
                        .is_some_and(|token| Some(token.digest()) != owner) =>
            {
                let others = "it is the access file of another coordinator: remove it, or name another file with --access";
                Err(io::Error::new(io::ErrorKind::AlreadyExists, others))
            }
            Ok(_) | Err(AccessFileError::Ended { .. }) => Ok(()),
            Err(error) if error.is_missing() => Ok(()),
            Err(AccessFileError::Unread { source, .. }) => Err(source),
            Err(_) => {
                let foreign = "another file is there, and is not replaced: name another file with --access";
                Err(io::Error::new(io::ErrorKind::AlreadyExists, foreign))
            }
        }
    }

    /// Whether other machines can reach the coordinator: whether its host is not a loopback address.
    #[must_use]
    pub fn is_for_other_machines(&self) -> bool {
        !is_loopback(&self.coordinator)
    }
}

/// Whether the host of a URL is a loopback address.
#[must_use]
pub fn is_loopback(url: &str) -> bool {
    let host = url.split_once("://").map_or("", |(_, rest)| rest);
    let host = host.rsplit_once(':').map_or(host, |(host, _)| host);
    let address = host
        .trim_start_matches('[')
        .trim_end_matches(']')
        .parse::<IpAddr>();
    address.is_ok_and(|address| address.to_canonical().is_loopback())
}

fn replace(path: &Path, stored: &Stored) -> io::Result<()> {
    let mut file = NewFile::create_secret(path)?;
    serde_json::to_writer_pretty(&mut file, stored)?;
    writeln!(file)?;
    file.finish().map(drop)
}

/// The text of a JSON error, without a token that it might quote.
fn reason(error: &serde_json::Error) -> String {
    let reason = text::printable(&error.to_string());
    match reason.contains(crate::token::PREFIX) {
        true => format!("line {} is not as in an access file", error.line()),
        false => reason,
    }
}

impl TryFrom<Fields> for AccessFile {
    type Error = &'static str;

    fn try_from(fields: Fields) -> Result<Self, Self::Error> {
        let fingerprint = fields.fingerprint.as_deref().map(str::parse).transpose();
        let token = fields.token.as_deref().map(str::parse).transpose();
        let fingerprint = fingerprint?;
        if fingerprint.is_some() && !fields.coordinator.starts_with("https://") {
            return Err("`fingerprint` is that of a `coordinator` which begins with https://");
        }
        if [&fields.coordinator, &fields.pages]
            .iter()
            .any(|url| !url.chars().all(|letter| letter.is_ascii_graphic()))
        {
            return Err("`coordinator` or `pages` is not a URL");
        }
        Ok(Self {
            coordinator: fields.coordinator,
            pages: fields.pages,
            fingerprint,
            name: fields.name,
            token: token.map_err(|_| "`token` is not a token")?,
        })
    }
}

impl From<AccessFile> for Fields {
    fn from(file: AccessFile) -> Self {
        Self {
            coordinator: file.coordinator,
            pages: file.pages,
            fingerprint: file.fingerprint.map(|fingerprint| fingerprint.to_string()),
            name: file.name,
            token: file.token.map(|token| token.reveal().to_owned()),
        }
    }
}

impl Fingerprint {
    /// The fingerprint of a certificate in DER form.
    #[must_use]
    pub fn of(certificate: &[u8]) -> Self {
        let mut bytes = [0; SHA256_OUTPUT_LEN];
        bytes.copy_from_slice(digest(&SHA256, certificate).as_ref());
        Self(bytes)
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut digits = String::with_capacity(2 * SHA256_OUTPUT_LEN);
        for byte in self.0 {
            write!(digits, "{byte:02x}")?;
        }
        write!(f, "sha256:{digits}")
    }
}

impl FromStr for Fingerprint {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = "`fingerprint` is not \"sha256:\" and 64 hexadecimal digits";
        let digits = text.strip_prefix("sha256:").ok_or(wrong)?;
        if digits.len() != 2 * SHA256_OUTPUT_LEN || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return Err(wrong);
        }
        let mut bytes = [0; SHA256_OUTPUT_LEN];
        for (byte, place) in bytes.iter_mut().zip((0..digits.len()).step_by(2)) {
            *byte = u8::from_str_radix(&digits[place..place + 2], 16).map_err(|_| wrong)?;
        }
        Ok(Self(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    fn example() -> AccessFile {
        AccessFile {
            coordinator: "https://node-7.cluster:7700".to_owned(),
            pages: "https://node-7.cluster:7700".to_owned(),
            fingerprint: Some(Fingerprint::of(b"certificate")),
            name: None,
            token: Some(Token::generate().unwrap()),
        }
    }

    #[test]
    fn an_access_file_reads_back_and_only_its_owner_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("access.json");
        let written = example();
        written.write(&path, None).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        written.write(&path, None).unwrap();
        let mode = fs::metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        let read = AccessFile::read(&path).unwrap();
        assert_eq!(read.coordinator, written.coordinator);
        assert_eq!(read.fingerprint, written.fingerprint);
        let digest = |file: &AccessFile| file.token.as_ref().map(Token::digest);
        assert_eq!(digest(&read), digest(&written));
        AccessFile::end(&path).unwrap();
        assert!(matches!(
            AccessFile::read(&path),
            Err(AccessFileError::Ended { at: Some(_), .. })
        ));
        let owner = digest(&written);
        written.write(&path, owner).unwrap();
        // The workers of another coordinator would lose it.
        let other = example();
        let error = other.write(&path, digest(&other)).unwrap_err().to_string();
        assert!(error.contains("of another coordinator"), "{error}");
        // A coordinator without tokens has the same owner.
        let open = AccessFile {
            token: None,
            ..example()
        };
        open.write(&path, owner).unwrap();
        written.write(&path, owner).unwrap();
    }

    #[test]
    fn another_file_is_neither_read_nor_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notes.json");
        for foreign in ["{\"dependencies\": {}}", "swordfish", ""] {
            fs::write(&path, foreign).unwrap();
            let error = AccessFile::read(&path).unwrap_err().to_string();
            assert!(
                error.contains("notes.json") && !error.contains("swordfish"),
                "{error}"
            );
            let error = example().write(&path, None).unwrap_err().to_string();
            assert!(error.contains("another file"), "{error}");
            assert_eq!(fs::read_to_string(&path).unwrap(), foreign);
        }
        assert!(example().write(folder.path(), None).is_err());
        let pipe = folder.path().join("pipe");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        assert!(AccessFile::read(&pipe).is_err() && example().write(&pipe, None).is_err());
    }

    #[test]
    fn a_wrong_value_is_named_and_a_token_is_not_quoted() {
        let secret = "mur_swordfish";
        let text = |fingerprint: &str, token: &str| {
            format!(
                "{{\"coordinator\": \"x\", \"pages\": \"x\", \"fingerprint\": {fingerprint}, \"token\": {token}}}"
            )
        };
        let error = |text: &str| serde_json::from_str::<AccessFile>(text).unwrap_err().to_string();
        let wrong = error(&text("\"sha256:12\"", "null"));
        assert!(wrong.contains("`fingerprint`"), "{wrong}");
        let wrong = error(&text("null", &format!("\"{secret}\"")));
        assert!(wrong.contains("`token`") && !wrong.contains(secret), "{wrong}");
        let long = format!("\"sha256:{}\"", "é".repeat(32));
        assert!(error(&text(&long, "null")).contains("`fingerprint`"));
        assert!(serde_json::from_str::<AccessFile>(&text("null", "null")).is_ok());
    }

    #[test]
    fn loopback_is_for_this_machine_alone() {
        let of = |url: &str| {
            AccessFile {
                coordinator: url.to_owned(),
                ..example()
            }
            .is_for_other_machines()
        };
        for url in [
            "https://127.0.0.1:7700",
            "https://[::1]:7700",
            "http://127.8.8.8:1",
        ] {
            assert!(!of(url), "{url}");
        }
        for url in [
            "https://node-7:7700",
            "https://10.0.0.7:7700",
            "https://[2001:db8::1]:7700",
        ] {
            assert!(of(url), "{url}");
        }
        for other in [
            "http://127.0.0.1@evil.example:80",
            "http://127.0.0.1.evil.example",
            "http://",
            "",
        ] {
            assert!(!is_loopback(other), "{other}");
        }
    }
}
