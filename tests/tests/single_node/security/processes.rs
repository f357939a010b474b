//! Tests the programs: what they refuse, whether they reveal secrets, and who is admitted on the same machine.

use crate::security::Secrets;
use murmuration_tests::{Murmuration, Running, binary};
use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
};

/// Starts a coordinator with its most detailed log.
fn serve(secrets: &Secrets, arguments: &[&str]) -> Running {
    let arguments = [&["serve", "--workers", "1"], arguments].concat();
    secrets
        .murmuration()
        .start_with(&arguments, &[("RUST_LOG", "trace")])
}

/// Starts a coordinator with certificates and tokens; returns its URL too.
fn serve_guarded(secrets: &Secrets) -> (Running, String) {
    let certs = |name: &str| secrets.text(&format!("certs/{name}"));
    let mut serving = serve(
        secrets,
        &[
            "--listen",
            "127.0.0.1:0",
            "--certificate",
            &certs("server.pem"),
            "--key",
            &certs("server-key.pem"),
            "--client-ca",
            &certs("ca.pem"),
            "--tokens",
            &secrets.text("tokens.toml"),
        ],
    );
    let line = serving.wait_for("serving ");
    let url = line.rsplit(' ').next().unwrap().to_owned();
    (serving, url)
}

/// Runs a command as a person on another machine, without the data directory.
fn from_elsewhere(arguments: &[&str], variables: &[(&str, &str)]) -> Output {
    let mut command = Command::new(binary("murmuration"));
    command
        .args(arguments)
        .env_remove("MURMURATION_DATA")
        .envs(variables.iter().copied())
        .stdin(Stdio::null());
    command.output().unwrap()
}

fn stderr(output: &Output) -> &str {
    str::from_utf8(&output.stderr).unwrap()
}

#[track_caller]
fn check_refused(murmuration: &Murmuration, arguments: &[&str], expected: &[&str]) {
    let refused = murmuration.run(arguments);
    let says = expected.iter().all(|expected| refused.stderr.contains(expected));
    assert!(refused.code == Some(2) && says, "{arguments:?}: {refused:?}");
}

#[test]
fn one_listens_in_the_clear_only_on_purpose() {
    let secrets = Secrets::new();
    let murmuration = secrets.murmuration();
    let beyond = ["serve", "--workers", "0", "--listen", "0.0.0.0:0"];
    let certificate = secrets.text("certs/server.pem");
    let other = secrets.text("certs/worker-key.pem");
    let mixed = [&beyond[..], &["--certificate", &certificate, "--key", &other]].concat();
    check_refused(&murmuration, &mixed, &["server.pem cannot be used"]);
    check_refused(
        &murmuration,
        &[&beyond[..], &["--certificate", &certificate]].concat(),
        &["--key"],
    );

    let mut trusting = serve(&secrets, &["--listen", "0.0.0.0:0", "--insecure-listen"]);
    let pages = trusting.wait_for("  pages:");
    assert!(
        pages.contains(" http://") && !pages.contains("0.0.0.0"),
        "{pages}"
    );
    trusting.wait_for("connections are not encrypted");
    trusting.wait_for("no tokens are required");
    assert_eq!(trusting.terminate(), Some(0));
}

#[test]
fn secrets_stay_where_they_are() {
    let secrets = Secrets::new();
    let (serving, url) = serve_guarded(&secrets);
    let ca = secrets.text("certs/ca.pem");
    let token = secrets.people.operator.as_str();
    let at = ["--coordinator", &url, "--ca", &ca];

    let listed = from_elsewhere(&[&["list"][..], &at].concat(), &[("MURMURATION_TOKEN", token)]);
    assert!(listed.status.success(), "{}", stderr(&listed));
    let file = secrets.token_file(&secrets.people.viewer);
    let file = file.to_str().unwrap();
    let with_file = from_elsewhere(
        &[&["list"][..], &at].concat(),
        &[("MURMURATION_TOKEN_FILE", file)],
    );
    assert!(with_file.status.success(), "{}", stderr(&with_file));
    let nobody = from_elsewhere(&[&["list"][..], &at].concat(), &[]);
    assert!(
        stderr(&nobody).contains("requires a token"),
        "{}",
        stderr(&nobody)
    );
    let trusting = from_elsewhere(&["list", "--coordinator", &url], &[("MURMURATION_TOKEN", token)]);
    assert!(stderr(&trusting).contains("--ca FILE"), "{}", stderr(&trusting));
    let wrong = from_elsewhere(
        &["list", "--coordinator", &url],
        &[("MURMURATION_TOKEN", "swordfish")],
    );
    assert!(
        stderr(&wrong).contains("MURMURATION_TOKEN: this is not a token"),
        "{}",
        stderr(&wrong)
    );
    assert!(!stderr(&wrong).contains("swordfish"), "{}", stderr(&wrong));

    // A token cannot be an argument, because lists of processes show arguments. The help text does not show the values of
    // environment variables.
    let argument = from_elsewhere(&["list", "--token", token], &[]);
    assert_eq!(argument.status.code(), Some(2));
    for help in [vec!["--help"], vec!["serve", "--help"], vec!["list", "--help"]] {
        let help = from_elsewhere(&help, &[("MURMURATION_TOKEN", token)]);
        assert!(help.status.success() && !String::from_utf8_lossy(&help.stdout).contains(token));
    }

    let local = fs::read_to_string(secrets.path("data/local-token")).unwrap();
    let key = fs::read_to_string(secrets.path("certs/server-key.pem")).unwrap();
    let (code, message) = serving.terminate_and_hear();
    assert_eq!(code, Some(0));
    assert!(message.contains("TRACE"), "it was to say everything");
    for secret in [
        token,
        &secrets.people.viewer,
        local.trim(),
        key.lines().nth(1).unwrap(),
    ] {
        assert!(!message.contains(secret), "the log has {secret}");
    }
}

#[test]
fn commands_beside_a_guarded_coordinator_get_in() {
    let secrets = Secrets::new();
    let (serving, _) = serve_guarded(&secrets);
    let murmuration = secrets.murmuration();
    let spec = secrets.text("small.toml");
    fs::write(&spec, murmuration_tests::small_spec("").to_toml()).unwrap();
    assert_eq!(
        murmuration.run(&["submit", &spec, "--json"]).last_line()["id"],
        "small-1"
    );
    assert_eq!(
        murmuration.run(&["watch", "small-1", "--json"]).last_line()["state"],
        "completed"
    );
    assert!(is_private(&secrets.path("data/local-token")));
    assert_eq!(serving.terminate(), Some(0));
    // After the coordinator has ended, commands that start a coordinator of their own are admitted too.
    assert_eq!(murmuration.run(&["list", "--json"]).lines().len(), 1);
}

#[test]
fn certificates_are_private_and_never_overwritten() {
    let secrets = Secrets::new();
    let certs = secrets.text("certs");
    let before = fs::read(secrets.path("certs/ca-key.pem")).unwrap();
    check_refused(
        &secrets.murmuration(),
        &["certs", &certs],
        &["ca.pem exists already"],
    );
    assert_eq!(fs::read(secrets.path("certs/ca-key.pem")).unwrap(), before);
    for name in ["ca", "server", "worker", "trainer"] {
        assert!(
            is_private(&secrets.path(&format!("certs/{name}-key.pem"))),
            "{name}"
        );
    }
    let other = secrets.text("other");
    for (host, expected) in [
        ("", "must be a DNS name"),
        ("https://swarm.example:7700", "must be a DNS name"),
        ("worker.murmuration.internal", "the certificate of a worker"),
    ] {
        let arguments = ["certs", &other, "--host", "swarm.example", "--host", host];
        check_refused(&secrets.murmuration(), &arguments, &["--host", expected]);
    }
    assert!(!secrets.path("other").exists());
    // The command can add workers to an existing authority, but only to an authority that `certs` made.
    let more = secrets.murmuration().run(&["certs", &certs, "--worker", "alpha"]);
    assert_eq!(more.code, Some(0), "{}", more.stderr);
    assert!(is_private(&secrets.path("certs/alpha-key.pem")));
    assert_eq!(fs::read(secrets.path("certs/ca-key.pem")).unwrap(), before);
    let refused = |arguments: &[&str], expected| {
        check_refused(
            &secrets.murmuration(),
            &[&["certs", &certs], arguments].concat(),
            &[expected],
        );
    };
    refused(&["--worker", "alpha"], "alpha.pem exists already");
    refused(&["--worker", "beta", "--host", "swarm"], "leave out --host");
    refused(&["--worker", "../beta"], "letters, digits");
    refused(&["--worker", "server"], "another name than");
    fs::copy(
        secrets.path("certs/worker-key.pem"),
        secrets.path("certs/ca-key.pem"),
    )
    .unwrap();
    refused(&["--worker", "beta"], "were not created by `murmuration certs`");
    check_refused(
        &secrets.murmuration(),
        &["token", "", "--role", "viewer"],
        &["be seen"],
    );
}

#[test]
fn whoever_has_a_name_has_a_token() {
    let secrets = Secrets::new();
    let murmuration = secrets.murmuration();
    let mut lines = String::new();
    let names = ["Ange\u{301}lique", "अनीता शर्मा", "สมชาย ใจดี"];
    let tokens = names.map(|name| {
        let made = murmuration.run(&["token", name, "--role", "viewer"]);
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        lines += &made.stdout;
        let mut words = made.stderr.split_whitespace();
        words.find(|word| word.starts_with("mur_")).unwrap().to_owned()
    });
    fs::write(secrets.path("tokens.toml"), lines).unwrap();
    let (serving, url) = serve_guarded(&secrets);
    let ca = secrets.text("certs/ca.pem");
    for (name, token) in names.iter().zip(&tokens) {
        let at = ["--coordinator", &url, "--ca", &ca];
        let refused = from_elsewhere(
            &[&["pause", "latest"][..], &at].concat(),
            &[("MURMURATION_TOKEN", token)],
        );
        assert!(stderr(&refused).contains(name), "{}", stderr(&refused));
    }
    assert_eq!(serving.terminate(), Some(0));
    check_refused(
        &murmuration,
        &["token", "admin\u{200b}", "--role", "viewer"],
        &["be seen"],
    );
}

fn is_private(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    fs::metadata(path).unwrap().permissions().mode() & 0o777 == 0o600
}
