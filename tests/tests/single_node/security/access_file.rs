//! Tests the access file: a coordinator admits its owner's processes and browsers and nobody else, on loopback too.

use murmuration_tests::{Finished, Murmuration, Running, binary, block_on, http::client, small_spec};
use serde_json::Value;
use std::{fs, net::TcpListener, path::PathBuf, process::Command};
use tempfile::TempDir;

/// A data directory whose coordinators require their owner's token, as without options.
struct Owner {
    folder: TempDir,
    murmuration: Murmuration,
}

impl Owner {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let murmuration = Murmuration::over(&folder.path().join("data"));
        Self { folder, murmuration }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// Starts a coordinator without workers; returns the URL of its pages too.
    fn serve(&self, more: &[&str]) -> (Running, String) {
        let listen: &[&str] = match more.contains(&"--listen") {
            true => &[],
            false => &["--listen", "127.0.0.1:0"],
        };
        let mut serving = self
            .murmuration
            .start(&[&["serve", "--workers", "0"], listen, more].concat());
        let line = serving.wait_for("serving ");
        let url = line.rsplit(' ').next().unwrap().to_owned();
        // The last line about how to reach the coordinator.
        serving.wait_for("  trainers:");
        (serving, url)
    }

    /// The access file, as JSON.
    fn access(&self) -> Value {
        serde_json::from_str(&fs::read_to_string(self.path("data/access.json")).unwrap()).unwrap()
    }

    fn spec(&self) -> String {
        let path = self.path("small.toml");
        fs::write(&path, small_spec("").to_toml()).unwrap();
        path.display().to_string()
    }

    /// Starts a worker of a machine of its own.
    fn worker(&self, access: &str) -> Running {
        let mut command = Command::new(binary("murmuration-worker"));
        command
            .args(["--access", access, "--threads", "1", "--cache"])
            .arg(self.path("cache"));
        Running::start(command)
    }
}

/// Runs a command of another user, who cannot read the data directory.
fn from_elsewhere(arguments: &[&str]) -> Finished {
    let folder = tempfile::tempdir().unwrap();
    Murmuration::over(&folder.path().join("none")).run(arguments)
}

#[track_caller]
fn check_refused(finished: &Finished, expected: &str) {
    assert_ne!(finished.code, Some(0), "{finished:?}");
    assert!(finished.stderr.contains(expected), "{finished:?}");
}

/// The status and the cookie of an answer to a browser that has this cookie.
fn browse(url: &str, cookie: &str) -> (u16, String) {
    block_on(async {
        let browser = client()
            .redirect(reqwest::redirect::Policy::none())
            .build()
            .unwrap();
        let asked = browser
            .get(url)
            .header("cookie", cookie)
            .header("accept", "text/html");
        let answer = asked.send().await.unwrap();
        let cookie = answer
            .headers()
            .get("set-cookie")
            .map(|cookie| cookie.to_str().unwrap());
        let cookie = cookie
            .and_then(|cookie| cookie.split(';').next())
            .unwrap_or_default();
        (answer.status().as_u16(), cookie.to_owned())
    })
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

#[test]
fn loopback_is_no_proof_of_identity() {
    let owner = Owner::new();
    let (serving, pages) = owner.serve(&[]);
    let spec = owner.spec();
    for command in [["list"].as_slice(), &["submit", &spec], &["cancel", "latest"]] {
        let refused = from_elsewhere(&[command, &["--coordinator", &pages]].concat());
        check_refused(
            &refused,
            "requires a token: name its access file with --access FILE",
        );
    }
    // Pages lead to the log-in, and answer nothing else.
    assert_eq!(browse(&format!("{pages}/"), ""), (303, String::new()));
    assert_eq!(browse(&format!("{pages}/metrics"), "").0, 303);
    // The owner needs no option in the folder of the data directory, and the access file elsewhere.
    let submitted = owner.murmuration.run(&["submit", &spec]);
    assert_eq!(submitted.code, Some(0), "{submitted:?}");
    let listed = from_elsewhere(&["list", "--json", "--access", &owner.text("data/access.json")]);
    assert_eq!(listed.lines().len(), 1);
    assert_eq!(serving.terminate(), Some(0));
}

#[test]
fn a_link_logs_a_browser_in_once() {
    let owner = Owner::new();
    let (mut serving, pages) = owner.serve(&[]);
    let link = owner.murmuration.run(&["link"]);
    let link = link.stdout.trim();
    assert!(link.starts_with(&format!("{pages}/open?code=")), "{link}");
    let (status, cookie) = browse(link, "");
    assert!(
        status == 200 && cookie.starts_with("murmuration-session"),
        "{status} {cookie}"
    );
    assert_eq!(browse(&format!("{pages}/"), &cookie).0, 200);
    // The link does not work again, except that it leads this browser to the pages.
    assert_eq!(browse(link, ""), (401, String::new()));
    assert_eq!(browse(link, &cookie).0, 200);
    assert_eq!(browse(&format!("{pages}/open?code=guess"), "").0, 401);
    // Sessions outlive the coordinator, and links do not. The log of a coordinator has no link.
    let unused = owner.murmuration.run(&["link", "--json"]).last_line();
    let unused = unused["link"].as_str().unwrap().to_owned();
    assert_eq!(serving.terminate(), Some(0));
    let address = pages.strip_prefix("http://").unwrap();
    (serving, _) = owner.serve(&["--listen", address]);
    assert_eq!(browse(&format!("{pages}/"), &cookie).0, 200);
    assert_eq!(browse(&unused, "").0, 401);
    assert!(!serving.output().contains("code="));
    assert_eq!(serving.terminate(), Some(0));
}

#[test]
fn a_proxy_serves_the_pages_under_a_path_of_its_own() {
    let owner = Owner::new();
    let public = "https://hub.example/user/ana/proxy/7700";
    let path = "/user/ana/proxy/7700";
    let listen = format!("127.0.0.1:{}", free_port());
    let (_serving, _) = owner.serve(&["--listen", &listen, "--public-url", public]);
    assert_eq!(owner.access()["pages"], public);
    let link = owner.murmuration.run(&["link"]).stdout;
    let code = link.trim().strip_prefix(&format!("{public}/open?code=")).unwrap();
    // This test is the proxy, which leaves the path in the request or removes it.
    let own = format!("http://{listen}");
    let (status, cookie) = browse(&format!("{own}{path}/open?code={code}"), "");
    assert_eq!(status, 200);
    let text_of = |page: &str| {
        block_on(async {
            let asked = client().build().unwrap().get(page).header("cookie", &cookie);
            asked.send().await.unwrap().text().await.unwrap()
        })
    };
    let opened = text_of(&format!("{own}/open?code={code}"));
    let onward = opened.split_once("content=\"0;url=").unwrap().1;
    let onward = onward.split_once('"').unwrap().0;
    let of_browser = reqwest::Url::parse(link.trim()).unwrap();
    assert_eq!(of_browser.join(onward).unwrap().as_str(), format!("{public}/"));
    for page in [format!("{own}{path}/"), format!("{own}/")] {
        let text = text_of(&page);
        assert!(text.contains(&format!("href=\"{path}/new\"")), "{text}");
        let outside = text
            .split("=\"/")
            .skip(1)
            .filter(|rest| !format!("/{rest}").starts_with(path));
        assert_eq!(outside.count(), 0, "{text}");
    }
    let log_out = |origin: &str| {
        block_on(async {
            let browser = client()
                .redirect(reqwest::redirect::Policy::none())
                .build()
                .unwrap();
            let asked = browser.post(format!("{own}/logout")).header("cookie", &cookie);
            let answer = asked.header("origin", origin).send().await.unwrap();
            let to = answer
                .headers()
                .get("location")
                .map(|to| to.to_str().unwrap().to_owned());
            (answer.status().as_u16(), to)
        })
    };
    assert_eq!(log_out("https://evil.example").0, 403);
    assert_eq!(log_out("https://hub.example"), (303, Some(format!("{path}/"))));
}

#[test]
fn other_machines_reach_a_coordinator_encrypted_by_its_access_file() {
    let owner = Owner::new();
    let everywhere = ["--listen", "0.0.0.0:0", "--contact", "127.0.0.1", "--access"];
    let access = owner.text("shared/access.json");
    fs::create_dir(owner.path("shared")).unwrap();
    let (serving, pages) = owner.serve(&[&everywhere[..], &[&access]].concat());
    assert!(pages.starts_with("https://127.0.0.1:"), "{pages}");
    let listed = from_elsewhere(&["list", "--json", "--access", &access]);
    assert_eq!((listed.code, listed.stdout.as_str()), (Some(0), ""), "{listed:?}");
    // A home that machines share: the coordinator runs on another one.
    let lock = owner.path("data/lock.json");
    let mut holder: Value = serde_json::from_str(&fs::read_to_string(&lock).unwrap()).unwrap();
    holder["machine"] = "node-7".into();
    fs::write(&lock, holder.to_string()).unwrap();
    let mut file = owner.access();
    for coordinator in [pages.as_str(), "https://127.0.0.1:1"] {
        // A name for other machines, which leads here.
        file["coordinator"] = coordinator.replace("127.0.0.1", "localhost").into();
        fs::write(owner.path("data/access.json"), file.to_string()).unwrap();
        let listed = owner.murmuration.run(&["list"]);
        match coordinator == pages {
            true => assert_eq!(listed.code, Some(0), "{listed:?}"),
            false => check_refused(&listed, "no coordinator answers at https://localhost:1"),
        }
    }
    // Neither without the file, nor in the clear, nor with another certificate.
    let without = from_elsewhere(&["list", "--coordinator", &pages]);
    check_refused(&without, "is encrypted: name the coordinator's access file");
    let clear = pages.replace("https://", "http://");
    assert_ne!(from_elsewhere(&["list", "--coordinator", &clear]).code, Some(0));
    file["fingerprint"] = format!("sha256:{}", "0".repeat(64)).into();
    file["coordinator"] = pages.as_str().into();
    fs::write(&access, file.to_string()).unwrap();
    let other = from_elsewhere(&["list", "--access", &access]);
    check_refused(&other, "not the one that the access file names");
    assert_eq!(serving.terminate(), Some(0));
}

#[test]
fn a_worker_finds_a_coordinator_that_starts_later_and_elsewhere() {
    let owner = Owner::new();
    let (spec, access) = (owner.spec(), owner.text("data/access.json"));
    let undisturbed = {
        let alone = Owner::new();
        let run = alone.murmuration.run(&["run", &spec, "--json"]);
        run.last_line()["digest"].clone()
    };
    let mut worker = owner.worker(&access);
    worker.wait_for("not connected, will try again");
    let (serving, first) = owner.serve(&[]);
    worker.wait_until_joined();
    assert_eq!(owner.murmuration.run(&["submit", &spec]).code, Some(0));
    serving.kill();
    worker.wait_for("not connected, will try again");
    let (serving, second) = owner.serve(&[]);
    assert_ne!(first, second);
    worker.wait_until_joined();
    let watched = owner.murmuration.run(&["watch", "small-1"]);
    assert_eq!(watched.code, Some(0), "{watched:?}");
    assert_eq!(owner.murmuration.digest().trim(), undisturbed);
    assert_eq!(worker.terminate(), Some(0));
    assert_eq!(serving.terminate(), Some(0));
}

#[test]
fn an_access_file_replaces_only_an_access_file() {
    let owner = Owner::new();
    let notes = owner.text("notes.json");
    fs::write(&notes, "{\"my\": \"notes\"}").unwrap();
    let serve = ["serve", "--listen", "127.0.0.1:0", "--workers", "0", "--access"];
    let refused = owner.murmuration.run(&[&serve[..], &[&notes]].concat());
    check_refused(&refused, "another file is there, and is not replaced");
    assert_eq!(fs::read_to_string(&notes).unwrap(), "{\"my\": \"notes\"}");
    let wrong = from_elsewhere(&["list", "--access", &notes]);
    check_refused(&wrong, "is not an access file of a coordinator");
    let mut worker = owner.worker(&notes);
    worker.wait_for("is not an access file of a coordinator");
    assert_eq!(worker.wait(), Some(1));
    let none = owner.murmuration.run(&["link"]);
    check_refused(&none, "`murmuration serve` writes it");
    // A coordinator can require no tokens for a while.
    for more in [["--insecure-listen"].as_slice(), &[], &["--insecure-listen"]] {
        let place = owner.text("elsewhere.json");
        let (serving, _) = owner.serve(&[&["--access", &place], more].concat());
        assert_eq!(serving.terminate(), Some(0));
    }
    let both = ["list", "--access", &notes, "--coordinator", "http://127.0.0.1:1"];
    check_refused(
        &from_elsewhere(&both),
        "--coordinator and --access both name a coordinator",
    );
    // An option counts more than a variable.
    let variable = [("MURMURATION_COORDINATOR", "http://127.0.0.1:1")];
    let mut listing = owner
        .murmuration
        .start_with(&["list", "--access", &notes], &variable);
    listing.wait_for("is not an access file of a coordinator");
    // The workers of another coordinator would lose it.
    let other = Owner::new();
    let (serving, _) = other.serve(&[]);
    let refused = owner
        .murmuration
        .run(&[&serve[..], &[&other.text("data/access.json")]].concat());
    check_refused(&refused, "it is the access file of another coordinator");
    assert_eq!(serving.terminate(), Some(0));
}

#[test]
fn a_coordinator_that_goes_on_from_a_mirror_replaces_the_former_ones_access_file() {
    let site = Owner::new();
    let [mirror, shared] = ["mirror", "shared.json"].map(|name| site.text(name));
    let serve = [
        "serve",
        "--workers",
        "0",
        "--listen",
        "127.0.0.1:0",
        "--access",
        &shared,
        "--mirror",
        &mirror,
    ];
    let go_on = [serve.as_slice(), &["--from-mirror"]].concat();
    let over = |data: &str| Murmuration::over(&site.path(data));
    let mut first = over("first").start(&serve);
    first.wait_for("  trainers:");
    assert_eq!(first.terminate(), Some(0));
    let of_first = fs::read_to_string(&shared).unwrap();
    let refused = over("second").run(&serve);
    check_refused(&refused, "it is the access file of another coordinator");
    let mut second = over("second").start(&go_on);
    second.wait_for("  trainers:");
    assert_ne!(fs::read_to_string(&shared).unwrap(), of_first);
    let listed = from_elsewhere(&["list", "--access", &shared]);
    assert_eq!(listed.code, Some(0), "{listed:?}");
    assert_eq!(second.terminate(), Some(0));
    // A file of another kind stays.
    fs::write(&shared, "notes").unwrap();
    check_refused(&over("third").run(&go_on), "another file is there");
    assert_eq!(fs::read_to_string(&shared).unwrap(), "notes");
}

#[test]
fn two_coordinators_of_one_host_have_cookies_of_their_own() {
    let owners = [Owner::new(), Owner::new()];
    let serving = owners.each_ref().map(|owner| owner.serve(&[]));
    let cookies = owners.each_ref().map(|owner| {
        let link = owner.murmuration.run(&["link"]).stdout;
        browse(link.trim(), "").1
    });
    let both = cookies.join("; ");
    for (_, pages) in &serving {
        assert_eq!(browse(&format!("{pages}/"), &both).0, 200);
    }
}
