//! Tests the pages behind their log-in, over HTTP/2 and TLS, as in browsers.

use crate::security::Secrets;
use murmuration_tests::{Cluster, http, small_spec};
use reqwest::{
    Certificate, Client, RequestBuilder, Response, StatusCode, Version,
    header::{ACCEPT, CONTENT_TYPE, COOKIE, LOCATION, ORIGIN, SET_COOKIE},
    redirect::Policy,
};
use std::{collections::BTreeSet, fs, time::Duration};

/// A browser at a coordinator. After a log-in, the browser has a cookie.
struct Browser {
    client: Client,
    url: String,
    cookie: Option<String>,
}

impl Browser {
    fn at(secrets: &Secrets, cluster: &Cluster) -> Self {
        let ca = Certificate::from_pem(&fs::read(secrets.path("certs/ca.pem")).unwrap()).unwrap();
        let client = http::client().tls_certs_only([ca]).redirect(Policy::none());
        Self {
            client: client.build().unwrap(),
            url: cluster.url(),
            cookie: None,
        }
    }

    fn get(&self, path: &str) -> RequestBuilder {
        self.with_cookie(self.client.get(format!("{}{path}", self.url)))
    }

    /// A POST request of a form on the coordinator's own page.
    fn post(&self, path: &str, form: &str) -> RequestBuilder {
        self.post_from(&self.url, path, "application/x-www-form-urlencoded", form)
    }

    /// A POST request from a page of `origin`.
    fn post_from(&self, origin: &str, path: &str, kind: &str, body: &str) -> RequestBuilder {
        self.with_cookie(self.client.post(format!("{}{path}", self.url)))
            .header(ORIGIN, origin)
            .header(CONTENT_TYPE, kind)
            .body(body.to_owned())
    }

    fn with_cookie(&self, request: RequestBuilder) -> RequestBuilder {
        let request = request.header(ACCEPT, "text/html,*/*");
        match &self.cookie {
            Some(cookie) => request.header(COOKIE, format!("theme=dark; {cookie}")),
            None => request,
        }
    }

    /// Logs in; returns the `Set-Cookie` header.
    async fn log_in(&mut self, token: &str) -> String {
        let answer = self
            .post("/login", &format!("token={token}"))
            .send()
            .await
            .unwrap();
        assert_eq!(
            (answer.status(), &answer.headers()[LOCATION]),
            (StatusCode::SEE_OTHER, &"/".parse().unwrap())
        );
        let set = answer.headers()[SET_COOKIE].to_str().unwrap().to_owned();
        self.cookie = Some(set.split(';').next().unwrap().to_owned());
        set
    }
}

async fn status(request: RequestBuilder) -> StatusCode {
    request.send().await.unwrap().status()
}

fn policy(answer: &Response) -> &str {
    answer.headers()["content-security-policy"].to_str().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_log_in_there_is_the_log_in() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let browser = Browser::at(&secrets, &cluster);
    for (path, to) in [
        ("/", "%2F"),
        ("/campaigns/small-1?page=2", "%2Fcampaigns%2Fsmall-1%3Fpage%3D2"),
        ("/play", "%2Fplay"),
        ("/nothing", "%2Fnothing"),
        (
            "/play?to=//elsewhere.example",
            "%2Fplay%3Fto%3D%2F%2Felsewhere.example",
        ),
        ("/play?to=\\elsewhere", "%2F"),
    ] {
        let answer = browser.get(path).send().await.unwrap();
        assert_eq!(
            (answer.status(), &answer.headers()[LOCATION]),
            (StatusCode::SEE_OTHER, &format!("/login?to={to}").parse().unwrap())
        );
        assert_eq!(answer.version(), Version::HTTP_2);
        assert!(policy(&answer).contains("default-src 'none'"));
    }
    // Scripts get an error instead of a redirect.
    let script = browser
        .client
        .get(format!("{}/events", browser.url))
        .header(ACCEPT, "text/event-stream");
    assert_eq!(status(script).await, StatusCode::UNAUTHORIZED);
    let motion = browser
        .client
        .post(format!("{}/play/motion", browser.url))
        .header(ORIGIN, &browser.url);
    assert_eq!(status(motion).await, StatusCode::UNAUTHORIZED);
    assert_eq!(status(browser.get("/assets/style.css")).await, StatusCode::OK);

    let page = browser.get("/login").send().await.unwrap();
    assert!(policy(&page).contains("script-src 'self'") && !policy(&page).contains("unsafe"));
    let text = page.text().await.unwrap();
    assert!(text.contains("type=\"password\""), "{text}");
    assert!(
        text.split("<script")
            .skip(1)
            .all(|script| script.contains("src=\"/assets/")),
        "{text}"
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_is_taken_once_and_the_cookie_is_the_browsers_alone() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let mut browser = Browser::at(&secrets, &cluster);
    let wrong = browser.post("/login", "token=mur_nonsense").send().await.unwrap();
    assert_eq!(
        (wrong.status(), wrong.headers().get(SET_COOKIE)),
        (StatusCode::UNAUTHORIZED, None)
    );
    let form = format!("token={}", secrets.people.viewer);
    let kind = "application/x-www-form-urlencoded";
    let elsewhere = browser.post_from("https://evil.example", "/login", kind, &form);
    assert_eq!(status(elsewhere).await, StatusCode::FORBIDDEN);

    let set = browser.log_in(&secrets.people.viewer).await;
    for part in ["; HttpOnly", "; SameSite=Strict", "; Secure", "; Path=/"] {
        assert!(set.contains(part), "{set}");
    }
    assert!(!set.contains(&secrets.people.viewer), "{set}");
    assert_eq!(status(browser.get("/")).await, StatusCode::OK);
    let page = browser.get("/login").send().await.unwrap().text().await.unwrap();
    assert!(page.contains("ana the viewer"), "{page}");
    let out = browser.post("/logout", "").send().await.unwrap();
    assert!(out.headers()[SET_COOKIE].to_str().unwrap().contains("Max-Age=0"));
    assert_eq!(out.headers()["clear-site-data"], "\"cache\"");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_ends_with_its_log_out_for_good() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let (mut one, mut other) = (Browser::at(&secrets, &cluster), Browser::at(&secrets, &cluster));
    one.log_in(&secrets.people.operator).await;
    other.log_in(&secrets.people.operator).await;
    let (ok, to_log_in) = (StatusCode::OK, StatusCode::SEE_OTHER);
    // Another person who has a copy of the cookie follows the events.
    let mut followed = one.get("/events").send().await.unwrap();
    assert!(followed.chunk().await.unwrap().is_some());

    let elsewhere = one.post_from("https://evil.example", "/logout", "text/plain", "");
    assert_eq!(status(elsewhere).await, StatusCode::FORBIDDEN);
    assert_eq!(status(one.get("/")).await, ok);
    assert_eq!(status(one.post("/logout", "")).await, StatusCode::SEE_OTHER);
    assert_eq!(status(one.get("/")).await, to_log_in);
    assert_eq!(status(other.get("/")).await, ok);
    let rest = async { while followed.chunk().await.unwrap().is_some() {} };
    let ended = tokio::time::timeout(Duration::from_secs(30), rest).await;
    assert!(ended.is_ok(), "what it followed goes on");
    // Logging in again ends the previous session.
    let before = other.cookie.clone();
    other.log_in(&secrets.people.operator).await;
    let after = std::mem::replace(&mut other.cookie, before);
    assert_eq!(status(other.get("/")).await, to_log_in);
    other.cookie = after;
    cluster.stop().await;

    let cluster = secrets.cluster(0).await;
    for (browser, expected) in [(&mut one, to_log_in), (&mut other, ok)] {
        browser.url = cluster.url();
        assert_eq!(status(browser.get("/")).await, expected);
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_ends_with_its_token_for_good() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let (mut viewer, mut operator) = (Browser::at(&secrets, &cluster), Browser::at(&secrets, &cluster));
    viewer.log_in(&secrets.people.viewer).await;
    operator.log_in(&secrets.people.operator).await;
    cluster.stop().await;
    let all = fs::read_to_string(secrets.path("tokens.toml")).unwrap();
    let (of_viewer, others) = all.split_at(all.match_indices("[[token]]").nth(1).unwrap().0);
    assert!(of_viewer.contains("ana the viewer"), "{of_viewer}");
    // The coordinator starts without the viewer's token first, and with this token after that.
    for tokens in [others, &all] {
        fs::write(secrets.path("tokens.toml"), tokens).unwrap();
        let cluster = secrets.cluster(0).await;
        for (browser, expected) in [
            (&mut viewer, StatusCode::SEE_OTHER),
            (&mut operator, StatusCode::OK),
        ] {
            browser.url = cluster.url();
            assert_eq!(status(browser.get("/")).await, expected);
        }
        cluster.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_behind_the_log_in_is_kept_by_the_browser_alone() {
    let secrets = Secrets::new();
    let mut cluster = secrets.cluster(1).await;
    cluster.run(&small_spec("")).await;
    let mut browser = Browser::at(&secrets, &cluster);
    browser.log_in(&secrets.people.viewer).await;
    let created = cluster.status("small-1").await.created_ms;
    let (picture, lasting) = (
        "/campaigns/small-1/individuals/0",
        "private, max-age=31536000, immutable",
    );
    let mut seen: Vec<(String, StatusCode)> = Vec::new();
    let routes: BTreeSet<&str> = cluster
        .requirements()
        .pages()
        .map(|(_, route, _)| route)
        .collect();
    assert!(routes.len() > 25, "{routes:?}");
    for route in routes {
        let path = route
            .replace("{id}", "small-1")
            .replace("{index}", "0")
            .replace("{place}", "0")
            .replace("{name}", "style.css");
        let kept = match path.as_str() {
            // These addresses return HTML pages, not pictures.
            path if path.ends_with("/starts") || path.ends_with("/search") => "no-store",
            path if path.starts_with(picture) => "private, no-cache",
            // The style sheet is available without a log-in.
            "/assets/style.css" => "no-cache",
            _ => "no-store",
        };
        let answer = browser.get(&path).send().await.unwrap();
        assert_eq!(answer.headers()["cache-control"], kept, "{path}: {answer:?}");
        let status = answer.status();
        // The coordinator refuses actions that a viewer's role forbids. The test leaves out `/logout`, which would end the
        // session.
        if path != "/logout" {
            let posted = browser.post(&path, "").send().await.unwrap();
            assert_eq!(
                posted.headers()["cache-control"],
                "no-store",
                "{path}: {posted:?}"
            );
        }
        seen.push((path, status));
    }
    let of = |wanted: &str| seen.iter().find(|(path, _)| path == wanted).unwrap().1;
    for path in [
        "/events",
        "/campaigns/small-1/changes",
        "/campaigns/small-1/report",
    ] {
        assert_eq!(of(path), StatusCode::OK, "{path}");
    }
    for (path, kept) in [
        (format!("{picture}?created={created}"), lasting),
        (format!("{picture}/motion?created={created}"), lasting),
        ("/nothing".to_owned(), "no-store"),
    ] {
        let answer = browser.get(&path).send().await.unwrap();
        assert_eq!(answer.headers()["cache-control"], kept, "{path}: {answer:?}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_know_roles_and_cookies_are_for_pages() {
    let secrets = Secrets::new();
    let mut cluster = secrets.cluster(1).await;
    cluster.run(&small_spec("")).await;
    let people = &secrets.people;
    let answer = r#"{"request_id":"1","annotator":"ana","answers":[{"index":3,"answer":"ring"}]}"#;
    let (ok, forbidden) = (StatusCode::OK, StatusCode::FORBIDDEN);
    let cases = [
        (&people.viewer, forbidden, forbidden),
        (&people.annotator, ok, forbidden),
        // The campaign is completed, so it cannot be paused.
        (&people.operator, ok, StatusCode::CONFLICT),
    ];
    for (token, labels, pauses) in cases {
        let mut browser = Browser::at(&secrets, &cluster);
        browser.log_in(token).await;
        assert_eq!(status(browser.get("/campaigns/small-1")).await, ok);
        let label = browser.post_from(
            &browser.url,
            "/campaigns/small-1/labels",
            "application/json",
            answer,
        );
        assert_eq!(status(label).await, labels);
        assert_eq!(status(browser.post("/campaigns/small-1/pause", "")).await, pauses);
        assert_eq!(status(browser.post("/play/motion", "seed=2")).await, ok);
        assert_eq!(
            status(browser.post("/campaigns/small-1/pieces", "index=3")).await,
            ok
        );
        assert_eq!(status(browser.post("/play/like", "campaign=small-1")).await, ok);
        let searches = match pauses {
            StatusCode::FORBIDDEN => StatusCode::FORBIDDEN,
            _ => StatusCode::SEE_OTHER,
        };
        assert_eq!(status(browser.post("/play/search?seed=2", "")).await, searches);

        let service = "/murmuration.v1.CampaignService/ListCampaigns";
        let grpc = |request: RequestBuilder| {
            let request = request.header(CONTENT_TYPE, "application/grpc");
            async { request.body(vec![0; 5]).send().await.unwrap().headers()["grpc-status"].clone() }
        };
        let with_cookie = browser.with_cookie(browser.client.post(format!("{}{service}", browser.url)));
        assert_eq!(grpc(with_cookie).await, "16");
    }
    // Programs can use their token for pages too.
    let browser = Browser::at(&secrets, &cluster);
    assert_eq!(status(browser.get("/").bearer_auth(&people.viewer)).await, ok);
    cluster.stop().await;
}
