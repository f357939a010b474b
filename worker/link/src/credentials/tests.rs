//! Tests of refused credentials. Secrets never appear in errors.

use super::*;
use std::fs;

fn pem(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn an_encrypted_coordinator_needs_somebody_who_vouches_for_it() {
    let none = Credentials::default();
    assert!(none.endpoint("http://127.0.0.1:7700").is_ok());
    let error = none.endpoint("https://127.0.0.1:7700").unwrap_err().to_string();
    assert!(error.contains("--ca FILE"), "{error}");
    for wrong in ["", "127.0.0.1:7700", "ftp://127.0.0.1", "http://"] {
        let refused = none.endpoint(wrong);
        assert!(matches!(refused, Err(CredentialsError::Url(_))), "{wrong}");
    }
}

#[test]
fn a_refused_url_is_shown_without_its_password() {
    for url in ["https://ana:swordfish@127.0.0.1", "ftp://ana:swordfish@127.0.0.1"] {
        let error = Credentials::default().endpoint(url).unwrap_err().to_string();
        assert!(
            error.contains("://***@127.0.0.1") && !error.contains("swordfish"),
            "{error}"
        );
    }
}

#[test]
fn files_that_hold_something_else_are_named_and_not_quoted() {
    let folder = tempfile::tempdir().unwrap();
    let secret = pem(folder.path(), "secret", "swordfish");
    let files = TrustFiles {
        token_file: Some(secret.clone()),
        ca: None,
        access: None,
    };
    let identity = IdentityFiles {
        certificate: Some(secret.clone()),
        key: Some(secret.clone()),
    };
    let errors = [
        Credentials::read(&files, &IdentityFiles::default()).unwrap_err(),
        Credentials::read(&TrustFiles::default(), &identity).unwrap_err(),
        read_pem(&secret, "private key").unwrap_err(),
        read_token(&folder.path().join("missing")).unwrap_err(),
    ];
    for error in errors {
        let message = error.to_string();
        assert!(
            message.contains(&folder.path().display().to_string()),
            "{message}"
        );
        assert!(!format!("{message} {error:?}").contains("swordfish"), "{error:?}");
    }
}

#[test]
fn credentials_hide_what_they_hold() {
    let token = Token::generate().unwrap();
    let credentials = Credentials {
        identity: Some(Secret(Identity::from_pem("certificate", "swordfish"))),
        ..Credentials::token(token.clone())
    };
    let shown = format!("{credentials:?} {:?}", credentials.bearer());
    assert!(
        !shown.contains("swordfish") && !shown.contains(&token.reveal()[4..]),
        "{shown}"
    );
    let plain = credentials.endpoint("http://127.0.0.1:7700");
    assert!(matches!(plain, Err(CredentialsError::Plain(_))));
}
