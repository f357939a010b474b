//! A Python client, generated from `proto/`, submits and watches a campaign on a coordinator with TLS and tokens.

use murmuration_tests::{Murmuration, Running, small_spec};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// A Python program that gets the log-in page over HTTP/1.1, without ALPN, as simple programs do.
const GET: &str = "\
import http.client, ssl, sys
context = ssl.create_default_context(cafile=sys.argv[2])
connection = http.client.HTTPSConnection(sys.argv[1], context=context)
connection.request('GET', '/login')
answer = connection.getresponse()
print(answer.status, answer.version, context.check_hostname)
";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn python(arguments: &[&str], stubs: &Path, token: &Path) -> Output {
    let output = Command::new("python3")
        .args(arguments)
        .env("PYTHONPATH", stubs)
        .env("MURMURATION_TOKEN_FILE", token)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// Generates Python code from `proto/` with protoc.
fn generate(stubs: &Path) {
    let proto = root().join("proto");
    let mut protoc = Command::new("python3");
    protoc.args(["-m", "grpc_tools.protoc"]);
    protoc.arg("-I").arg(&proto);
    protoc.arg(format!("--python_out={}", stubs.display()));
    protoc.arg(format!("--grpc_python_out={}", stubs.display()));
    for file in fs::read_dir(proto.join("murmuration/v1")).unwrap() {
        protoc.arg(file.unwrap().path());
    }
    assert!(protoc.status().unwrap().success());
}

/// A coordinator's process with certificates and tokens, and its address.
fn serve(murmuration: &Murmuration, folder: &Path) -> (Running, String) {
    let path = |name: &str| folder.join(name).display().to_string();
    assert_eq!(murmuration.run(&["certs", &path("certs")]).code, Some(0));
    let made = murmuration.run(&["token", "python", "--role", "operator"]);
    fs::write(folder.join("tokens.toml"), &made.stdout).unwrap();
    let token = made
        .stderr
        .split_whitespace()
        .find(|word| word.starts_with("mur_"));
    fs::write(folder.join("token"), token.unwrap()).unwrap();
    let mut serving = murmuration.start(&[
        "serve",
        "--listen",
        "127.0.0.1:0",
        "--workers",
        "1",
        "--certificate",
        &path("certs/server.pem"),
        "--key",
        &path("certs/server-key.pem"),
        "--tokens",
        &path("tokens.toml"),
    ]);
    let line = serving.wait_for("serving ");
    let (_, address) = line.rsplit_once("https://").unwrap();
    let address = address.to_owned();
    (serving, address)
}

pub fn python_submits_and_watches_a_campaign_over_tls_with_a_token() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let (_serving, address) = serve(&murmuration, folder.path());
    let ca = folder.path().join("certs/ca.pem").display().to_string();
    let (stubs, token) = (folder.path().join("stubs"), folder.path().join("token"));
    fs::create_dir(&stubs).unwrap();
    generate(&stubs);

    let example = root()
        .join("examples/python/submit_and_watch.py")
        .display()
        .to_string();
    let output = python(&[&example, &address, &ca], &stubs, &token);
    let printed = String::from_utf8(output.stdout).unwrap();
    // The project's own client runs the same campaign.
    let spec = folder.path().join("small.toml");
    fs::write(&spec, small_spec("").to_toml()).unwrap();
    for command in [["submit", spec.to_str().unwrap()], ["watch", "small-2"]] {
        assert_eq!(murmuration.run(&command).code, Some(0), "{command:?}");
    }
    let digest = murmuration.run(&["digest", "small-2"]);
    assert_eq!(printed.trim(), format!("from-python-1 {}", digest.stdout.trim()));

    let got = python(&["-c", GET, &address, &ca], &stubs, &token);
    assert_eq!(String::from_utf8(got.stdout).unwrap().trim(), "200 11 True");
}
