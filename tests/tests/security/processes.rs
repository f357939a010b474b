//! The programs themselves: what they refuse to do, what they show of their secrets, and who gets in from beside them.

use crate::Desk;
use murmuration_tests::{Murmuration, binary};
use std::{
    fs,
    io::{BufRead as _, BufReader},
    path::Path,
    process::{Child, Command, Output, Stdio},
    sync::mpsc::{Receiver, channel},
    thread,
};

/// A coordinator's process, and what it says.
struct Serving {
    child: Child,
    lines: Receiver<String>,
    said: String,
}

impl Serving {
    fn start(desk: &Desk, arguments: &[&str]) -> Self {
        let mut command = Command::new(binary("murmuration"));
        let mut child = command
            .args(["serve", "--workers", "1"])
            .args(arguments)
            .env("MURMURATION_DATA", desk.path("data"))
            // Whoever looks for trouble has everything said.
            .env("RUST_LOG", "trace")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (said, lines) = channel();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        thread::spawn(move || {
            // Until nobody listens: it must not wait for a reader.
            stderr
                .lines()
                .map_while(Result::ok)
                .for_each(|line| drop(said.send(line)));
        });
        Self {
            child,
            lines,
            said: String::new(),
        }
    }

    /// A desk's coordinator, guarded in every way.
    fn guarded(desk: &Desk) -> (Self, String) {
        let certs = |name: &str| desk.text(&format!("certs/{name}"));
        let mut serving = Self::start(
            desk,
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
                &desk.text("tokens.toml"),
            ],
        );
        let line = serving.wait_for("serving ");
        let url = line.rsplit(' ').next().unwrap().to_owned();
        (serving, url)
    }

    fn wait_for(&mut self, sign: &str) -> String {
        loop {
            let line = self
                .lines
                .recv()
                .unwrap_or_else(|_| panic!("it ended:\n{}", self.said));
            self.said += &format!("{line}\n");
            if line.contains(sign) {
                return line;
            }
        }
    }

    /// SIGTERM; everything that it has said.
    fn end(mut self) -> String {
        let told = Command::new("kill").arg(self.child.id().to_string()).status();
        assert!(told.unwrap().success());
        let rest: Vec<String> = self.lines.iter().collect();
        assert!(self.child.wait().unwrap().success());
        self.said.clone() + &rest.join("\n")
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A command of somebody who is elsewhere: without the data directory.
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
fn check_refused(murmuration: &Murmuration, arguments: &[&str], said: &[&str]) {
    let refused = murmuration.run(arguments);
    let says = said.iter().all(|said| refused.stderr.contains(said));
    assert!(refused.code == Some(2) && says, "{arguments:?}: {refused:?}");
}

#[test]
fn one_listens_beyond_this_machine_only_on_purpose() {
    let desk = Desk::new();
    let murmuration = desk.murmuration();
    let beyond = ["serve", "--workers", "0", "--listen", "0.0.0.0:0"];
    check_refused(
        &murmuration,
        &beyond,
        &["0.0.0.0:0", "--certificate", "--insecure-listen"],
    );
    let (certificate, key) = (desk.text("certs/server.pem"), desk.text("certs/server-key.pem"));
    let encrypted = [&beyond[..], &["--certificate", &certificate, "--key", &key]].concat();
    check_refused(&murmuration, &encrypted, &["--tokens FILE", "murmuration token"]);
    let other = desk.text("certs/worker-key.pem");
    let mixed = [&beyond[..], &["--certificate", &certificate, "--key", &other]].concat();
    check_refused(&murmuration, &mixed, &["server.pem cannot be used"]);
    check_refused(
        &murmuration,
        &[&beyond[..], &["--certificate", &certificate]].concat(),
        &["--key"],
    );

    let mut trusting = Serving::start(&desk, &["--listen", "0.0.0.0:0", "--insecure-listen"]);
    trusting.wait_for("nothing is encrypted");
    trusting.wait_for("no tokens are asked for");
    trusting.end();
}

#[test]
fn secrets_stay_where_they_are() {
    let desk = Desk::new();
    let (serving, url) = Serving::guarded(&desk);
    let ca = desk.text("certs/ca.pem");
    let token = desk.people.operator.as_str();
    let at = ["--coordinator", &url, "--ca", &ca];

    let listed = from_elsewhere(&[&["list"][..], &at].concat(), &[("MURMURATION_TOKEN", token)]);
    assert!(listed.status.success(), "{}", stderr(&listed));
    let file = desk.token_file(&desk.people.viewer);
    let file = file.to_str().unwrap();
    let with_file = from_elsewhere(
        &[&["list"][..], &at].concat(),
        &[("MURMURATION_TOKEN_FILE", file)],
    );
    assert!(with_file.status.success(), "{}", stderr(&with_file));
    let nobody = from_elsewhere(&[&["list"][..], &at].concat(), &[]);
    assert!(
        stderr(&nobody).contains("asks for a token"),
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
        stderr(&wrong).contains("MURMURATION_TOKEN: this is no token"),
        "{}",
        stderr(&wrong)
    );
    assert!(!stderr(&wrong).contains("swordfish"), "{}", stderr(&wrong));

    // A token is no argument, so that no list of processes has it; and help does not show what is in the environment.
    let argument = from_elsewhere(&["list", "--token", token], &[]);
    assert_eq!(argument.status.code(), Some(2));
    for help in [vec!["--help"], vec!["serve", "--help"], vec!["list", "--help"]] {
        let help = from_elsewhere(&help, &[("MURMURATION_TOKEN", token)]);
        assert!(help.status.success() && !String::from_utf8_lossy(&help.stdout).contains(token));
    }

    let local = fs::read_to_string(desk.path("data/local-token")).unwrap();
    let key = fs::read_to_string(desk.path("certs/server-key.pem")).unwrap();
    let said = serving.end();
    assert!(said.contains("TRACE"), "it was to say everything");
    for secret in [
        token,
        &desk.people.viewer,
        local.trim(),
        key.lines().nth(1).unwrap(),
    ] {
        assert!(!said.contains(secret), "the log has {secret}");
    }
}

#[test]
fn commands_beside_a_guarded_coordinator_get_in() {
    let desk = Desk::new();
    let (serving, _) = Serving::guarded(&desk);
    let murmuration = desk.murmuration();
    let spec = desk.text("small.toml");
    fs::write(&spec, murmuration_tests::small_spec("").to_toml()).unwrap();
    assert_eq!(
        murmuration.run(&["submit", &spec, "--json"]).last_line()["campaign"],
        "small-1"
    );
    assert_eq!(
        murmuration.run(&["watch", "small-1", "--json"]).last_line()["state"],
        "completed"
    );
    assert!(is_private(&desk.path("data/local-token")));
    serving.end();
    // And so do those that start one of their own, afterwards.
    assert_eq!(murmuration.run(&["list", "--json"]).lines().len(), 1);
}

#[test]
fn certificates_are_private_and_never_overwritten() {
    let desk = Desk::new();
    let certs = desk.text("certs");
    let before = fs::read(desk.path("certs/ca-key.pem")).unwrap();
    check_refused(
        &desk.murmuration(),
        &["certs", &certs],
        &["ca.pem is there already"],
    );
    assert_eq!(fs::read(desk.path("certs/ca-key.pem")).unwrap(), before);
    for name in ["ca", "server", "worker", "trainer"] {
        assert!(is_private(&desk.path(&format!("certs/{name}-key.pem"))), "{name}");
    }
    let other = desk.text("other");
    for (host, said) in [
        ("", "must be a DNS name"),
        ("https://swarm.example:7700", "must be a DNS name"),
        ("worker.murmuration.internal", "one for a worker"),
    ] {
        let arguments = ["certs", &other, "--host", "swarm.example", "--host", host];
        check_refused(&desk.murmuration(), &arguments, &["--host", said]);
    }
    assert!(!desk.path("other").exists());
    // Workers are added to it, and to no other.
    let more = desk.murmuration().run(&["certs", &certs, "--worker", "alpha"]);
    assert_eq!(more.code, Some(0), "{}", more.stderr);
    assert!(is_private(&desk.path("certs/alpha-key.pem")));
    assert_eq!(fs::read(desk.path("certs/ca-key.pem")).unwrap(), before);
    let refused = |arguments: &[&str], said| {
        check_refused(
            &desk.murmuration(),
            &[&["certs", &certs], arguments].concat(),
            &[said],
        );
    };
    refused(&["--worker", "alpha"], "alpha.pem is there already");
    refused(&["--worker", "beta", "--host", "swarm"], "takes no --host");
    refused(&["--worker", "../beta"], "letters, digits");
    refused(&["--worker", "server"], "another name than");
    fs::copy(desk.path("certs/worker-key.pem"), desk.path("certs/ca-key.pem")).unwrap();
    refused(&["--worker", "beta"], "are not of `murmuration certs`");
    check_refused(
        &desk.murmuration(),
        &["token", "", "--role", "viewer"],
        &["be seen"],
    );
}

#[test]
fn whoever_has_a_name_has_a_token() {
    let desk = Desk::new();
    let murmuration = desk.murmuration();
    let mut lines = String::new();
    let names = ["Ange\u{301}lique", "अनीता शर्मा", "สมชาย ใจดี"];
    let tokens = names.map(|name| {
        let made = murmuration.run(&["token", name, "--role", "viewer"]);
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        lines += &made.stdout;
        let mut words = made.stderr.split_whitespace();
        words.find(|word| word.starts_with("mur_")).unwrap().to_owned()
    });
    fs::write(desk.path("tokens.toml"), lines).unwrap();
    let (serving, url) = Serving::guarded(&desk);
    let ca = desk.text("certs/ca.pem");
    for (name, token) in names.iter().zip(&tokens) {
        let at = ["--coordinator", &url, "--ca", &ca];
        let refused = from_elsewhere(
            &[&["pause", "latest"][..], &at].concat(),
            &[("MURMURATION_TOKEN", token)],
        );
        assert!(stderr(&refused).contains(name), "{}", stderr(&refused));
    }
    serving.end();
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
