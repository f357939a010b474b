//! Tests of access control: certificates, tokens, the log-in, secrets in the output of processes, and limits.

mod access_file;
mod endpoints;
mod limits;
mod machines;
mod pages;
mod people;
mod processes;
mod roles;
mod shares;
mod sizes;
mod snapshots;
mod unreadable;
mod words;

use murmuration_access::{ListenConfig, Tls, Tokens};
use murmuration_link::{Credentials, IdentityFiles, TrustFiles};
use murmuration_tests::{Cluster, Murmuration};
use std::{
    fs,
    path::{Path, PathBuf},
};
use tempfile::TempDir;

/// A token of each role.
struct People {
    viewer: String,
    annotator: String,
    operator: String,
}

/// A folder with certificates and tokens, made by `murmuration certs` and `murmuration token`.
struct Secrets {
    folder: TempDir,
    people: People,
}

impl Secrets {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let murmuration = Murmuration::over(&folder.path().join("data"));
        let certs = folder.path().join("certs").display().to_string();
        assert_eq!(murmuration.run(&["certs", &certs]).code, Some(0));
        let mut lines = String::new();
        let [viewer, annotator, operator] = ["viewer", "annotator", "operator"].map(|role| {
            let made = murmuration.run(&["token", &format!("ana the {role}"), "--role", role]);
            assert_eq!(made.code, Some(0), "{}", made.stderr);
            lines += &made.stdout;
            let token = made
                .stderr
                .split_whitespace()
                .find(|word| word.starts_with("mur_"));
            token.unwrap().to_owned()
        });
        fs::write(folder.path().join("tokens.toml"), lines).unwrap();
        Self {
            folder,
            people: People {
                viewer,
                annotator,
                operator,
            },
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    fn murmuration(&self) -> Murmuration {
        Murmuration::over(&self.path("data"))
    }

    /// A file that contains a token.
    fn token_file(&self, token: &str) -> PathBuf {
        let path = self.path(&token[..12]);
        fs::write(&path, format!("{token}\n")).unwrap();
        path
    }

    /// A coordinator with TLS, a client CA and tokens, and `workers` workers and a trainer in its process.
    pub async fn cluster(&self, workers: usize) -> Cluster {
        let certs = self.path("certs");
        let ca = certs.join("ca.pem");
        let tls = Tls::read(
            &certs.join("server.pem"),
            &certs.join("server-key.pem"),
            Some(&ca),
        )
        .unwrap();
        let tokens = Tokens::read(&self.path("tokens.toml")).unwrap();
        let listen = ListenConfig::new(([127, 0, 0, 1], 0).into(), Some(tls), Some(tokens));
        Cluster::start_at(&self.path("data"), workers, listen).await
    }

    /// Credentials with a token, with a certificate (its path without the ending), or with neither.
    fn credentials(&self, token: Option<&str>, certificate: Option<&Path>) -> Credentials {
        let trust = TrustFiles {
            ca: Some(self.path("certs/ca.pem")),
            token_file: token.map(|token| self.token_file(token)),
            access: None,
        };
        let identity = IdentityFiles {
            certificate: certificate.map(|name| name.with_extension("pem")),
            key: certificate.map(|name| PathBuf::from(format!("{}-key.pem", name.display()))),
        };
        Credentials::read(&trust, &identity).unwrap()
    }
}
