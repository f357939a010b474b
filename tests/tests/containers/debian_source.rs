//! Tests how `debian-source` finds a mirror and a suite of Debian in apt's sources, in both formats of these files.

use std::{fs, process::Command};

/// The script's output for these files in a folder like /etc/apt; `None` if it fails.
fn source(files: &[(&str, &str)]) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("sources.list.d")).unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/containers/debian-source");
    let mut command = Command::new(script);
    command.arg(folder.path());
    let output = command
        .env_remove("DEBIAN_MIRROR")
        .env_remove("DEBIAN_SUITE")
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    output.status.success().then(|| printed.trim().to_owned())
}

pub fn the_mirror_and_the_suite_are_those_of_apts_sources() {
    let one_line = "# deb http://no.example/debian sid main\n\
        deb [signed-by=/key arch=amd64] http://mirror.example/debian-security trixie-security main\n\
        deb-src http://source.example/debian trixie main\n\
        deb [trusted=yes] http://mirror.example/debian/ trixie contrib main\n";
    let deb822 = "Types: deb\nEnabled: no\nURIs: http://off.example/debian\nSuites: sid\nComponents: main\n\n\
        Types: deb deb-src\n# The archive\nURIs:\n http://other.example/debian\nSuites: bookworm-updates\n bookworm\n\
        Components: main contrib\n";
    let trixie = Some("http://mirror.example/debian trixie".to_owned());
    let bookworm = Some("http://other.example/debian bookworm".to_owned());
    let debian = "sources.list.d/debian.sources";
    assert_eq!(source(&[("sources.list", one_line)]), trixie);
    assert_eq!(source(&[("sources.list.d/own.list", one_line)]), trixie);
    assert_eq!(source(&[(debian, deb822)]), bookworm);
    assert_eq!(source(&[(debian, deb822), ("sources.list", one_line)]), trixie);
    assert_eq!(source(&[("sources.list.d/other.list.off", one_line)]), None);
    assert_eq!(source(&[]), None);
}
