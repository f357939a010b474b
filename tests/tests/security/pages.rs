//! The pages behind their log-in, as browsers reach them: HTTP/2 over TLS.

use crate::Desk;
use murmuration_tests::{Cluster, small_spec};
use reqwest::{
    Certificate, Client, RequestBuilder, Response, StatusCode, Version,
    header::{ACCEPT, CONTENT_TYPE, COOKIE, LOCATION, ORIGIN, SET_COOKIE},
    redirect::Policy,
};
use std::fs;

/// A browser at a coordinator, with a cookie if it has logged in.
struct Browser {
    client: Client,
    url: String,
    cookie: Option<String>,
}

impl Browser {
    fn at(desk: &Desk, cluster: &Cluster) -> Self {
        let ca = Certificate::from_pem(&fs::read(desk.path("certs/ca.pem")).unwrap()).unwrap();
        let client = Client::builder().tls_certs_only([ca]).redirect(Policy::none());
        Self {
            client: client.build().unwrap(),
            url: cluster.url(),
            cookie: None,
        }
    }

    fn get(&self, path: &str) -> RequestBuilder {
        self.with_cookie(self.client.get(format!("{}{path}", self.url)))
    }

    /// What a form of ours posts.
    fn post(&self, path: &str, form: &str) -> RequestBuilder {
        self.post_from(&self.url, path, "application/x-www-form-urlencoded", form)
    }

    /// What a page of `origin` posts.
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

    /// Logs in; the whole line with which the cookie was set.
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
    let desk = Desk::new();
    let cluster = desk.cluster(0).await;
    let browser = Browser::at(&desk, &cluster);
    for path in ["/", "/campaigns/small-1", "/nothing"] {
        let answer = browser.get(path).send().await.unwrap();
        assert_eq!(
            (answer.status(), &answer.headers()[LOCATION]),
            (
                StatusCode::SEE_OTHER,
                &format!("/login?to={path}").parse().unwrap()
            )
        );
        assert_eq!(answer.version(), Version::HTTP_2);
        assert!(policy(&answer).contains("default-src 'none'"));
    }
    // Scripts are told, and not sent elsewhere.
    let script = browser
        .client
        .get(format!("{}/events", browser.url))
        .header(ACCEPT, "text/event-stream");
    assert_eq!(status(script).await, StatusCode::UNAUTHORIZED);
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
    let desk = Desk::new();
    let cluster = desk.cluster(0).await;
    let mut browser = Browser::at(&desk, &cluster);
    let wrong = browser.post("/login", "token=mur_nonsense").send().await.unwrap();
    assert_eq!(
        (wrong.status(), wrong.headers().get(SET_COOKIE)),
        (StatusCode::UNAUTHORIZED, None)
    );
    let form = format!("token={}", desk.people.viewer);
    let kind = "application/x-www-form-urlencoded";
    let elsewhere = browser.post_from("https://evil.example", "/login", kind, &form);
    assert_eq!(status(elsewhere).await, StatusCode::FORBIDDEN);

    let set = browser.log_in(&desk.people.viewer).await;
    for part in ["; HttpOnly", "; SameSite=Strict", "; Secure", "; Path=/"] {
        assert!(set.contains(part), "{set}");
    }
    assert!(!set.contains(&desk.people.viewer), "{set}");
    assert_eq!(status(browser.get("/")).await, StatusCode::OK);
    let page = browser.get("/login").send().await.unwrap().text().await.unwrap();
    assert!(page.contains("ana the viewer"), "{page}");
    let out = browser.post("/logout", "").send().await.unwrap();
    assert!(out.headers()[SET_COOKIE].to_str().unwrap().contains("Max-Age=0"));
    let forged = browser.cookie.take().map(|cookie| cookie.replace('.', ".9"));
    browser.cookie = forged;
    assert_eq!(status(browser.get("/")).await, StatusCode::SEE_OTHER);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_know_roles_and_cookies_are_for_pages() {
    let desk = Desk::new();
    let mut cluster = desk.cluster(1).await;
    cluster.run(&small_spec("")).await;
    let people = &desk.people;
    let answer = r#"{"request_id":"1","annotator":"ana","answers":[{"index":3,"answer":"ring"}]}"#;
    let (ok, forbidden) = (StatusCode::OK, StatusCode::FORBIDDEN);
    let cases = [
        (&people.viewer, forbidden, forbidden),
        (&people.annotator, ok, forbidden),
        // It is completed.
        (&people.operator, ok, StatusCode::CONFLICT),
    ];
    for (token, labels, pauses) in cases {
        let mut browser = Browser::at(&desk, &cluster);
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

        let service = "/murmuration.v1.CampaignService/ListCampaigns";
        let grpc = |request: RequestBuilder| {
            let request = request.header(CONTENT_TYPE, "application/grpc");
            async { request.body(vec![0; 5]).send().await.unwrap().headers()["grpc-status"].clone() }
        };
        let with_cookie = browser.with_cookie(browser.client.post(format!("{}{service}", browser.url)));
        assert_eq!(grpc(with_cookie).await, "16");
    }
    // Programs show their token to pages too.
    let browser = Browser::at(&desk, &cluster);
    assert_eq!(status(browser.get("/").bearer_auth(&people.viewer)).await, ok);
    cluster.stop().await;
}
