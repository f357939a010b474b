//! Tests the pages over HTTP, on the port of gRPC.

mod by_example;
mod managing;
mod taxonomy;

use murmuration_proto::{
    parts::whole,
    v1::{self, label_service_client::LabelServiceClient},
};
use murmuration_tests::{Cluster, http, small_spec};
use reqwest::{Client, Response, StatusCode, redirect};
use serde_json::Value;
use std::time::{Duration, Instant};
use tonic::Code;

/// A browser at a coordinator. The browser treats status codes as answers, not as errors, and does not follow redirects.
#[derive(Clone)]
struct Browser {
    client: Client,
    url: String,
}

impl Browser {
    fn at(cluster: &Cluster) -> Self {
        let client = http::client().redirect(redirect::Policy::none());
        Self {
            client: client.build().unwrap(),
            url: cluster.url(),
        }
    }

    async fn get(&self, path: &str) -> Response {
        let request = self.client.get(format!("{}{path}", self.url));
        request.send().await.unwrap()
    }

    async fn page(&self, path: &str) -> String {
        let answer = self.get(path).await;
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        answer.text().await.unwrap()
    }

    /// Sends a POST request with JSON about `small-1`, as a page's script does; returns the JSON answer, or null.
    async fn tell(&self, path: &str, message: &str, status: StatusCode) -> Value {
        let request = self
            .client
            .post(format!("{}/campaigns/small-1/{path}", self.url))
            .header("Origin", &self.url)
            .header("Content-Type", "application/json");
        let answer = request.body(message.to_owned()).send().await.unwrap();
        let got = answer.status();
        let told = answer.text().await.unwrap();
        assert_eq!(got, status, "{path} {message}: {told}");
        serde_json::from_str(&told).unwrap_or_default()
    }

    async fn post(&self, path: &str, form: &[(&str, &str)], origin: Option<&str>) -> Response {
        let mut request = self.client.post(format!("{}{path}", self.url));
        if let Some(origin) = origin {
            request = request.header("Origin", origin);
        }
        request.form(form).send().await.unwrap()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_campaign_is_started_and_cancelled_with_buttons() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let browser = Browser::at(&cluster);
    let own = Some(browser.url.clone());
    let started = browser.post("/new", &QUICK, own.as_deref()).await;
    assert_eq!(started.status(), StatusCode::SEE_OTHER);
    assert_eq!(started.headers()["location"], "/campaigns/quick-latent-1");
    // A second click starts no second campaign.
    let again = browser.post("/new", &QUICK, own.as_deref()).await;
    assert_eq!(again.headers()["location"], "/campaigns/quick-latent-1");
    assert_eq!(cluster.campaigns().await.len(), 1);
    let page = browser.page("/campaigns/quick-latent-1").await;
    assert!(
        page.contains("Pause") && page.contains("Cancel") && !page.contains("Resume"),
        "{page}"
    );
    let cancelled = browser
        .post("/campaigns/quick-latent-1/cancel", &[], own.as_deref())
        .await;
    assert_eq!(cancelled.status(), StatusCode::SEE_OTHER);
    let status = cluster.status("quick-latent-1").await;
    assert_eq!(status.state(), v1::CampaignState::Cancelled);
    let again = browser
        .post("/campaigns/quick-latent-1/pause", &[], own.as_deref())
        .await;
    assert_eq!(again.status(), StatusCode::CONFLICT);
    // A changed form starts another campaign.
    let mut changed = QUICK;
    changed[2] = ("name", "other");
    let other = browser.post("/new", &changed, own.as_deref()).await;
    assert_eq!(other.headers()["location"], "/campaigns/other-2");
    let unknown = browser.get("/new?example=nothing").await;
    assert_eq!(unknown.status(), StatusCode::BAD_REQUEST);
    cluster.stop().await;
}

/// The filled-in form of a new campaign.
const QUICK: [(&str, &str); 7] = [
    ("step", "start"),
    ("request", "1"),
    ("name", "quick-latent"),
    ("model", "single-sensor"),
    ("method", "latent"),
    ("search.population", "50"),
    ("search.generations", "1,000"),
];

#[tokio::test(flavor = "multi_thread")]
async fn what_scripts_say_is_checked_and_said_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    let browser = Browser::at(&cluster);
    let ring = r#"{"request_id":"1","annotator":"ana","answers":[{"index":3,"answer":"ring"}]}"#;
    for _ in 0..2 {
        let told = browser.tell("labels", ring, StatusCode::OK).await;
        assert_eq!(
            (&told["classes"][0]["name"], &told["classes"][0]["labels"]),
            (&"ring".into(), &1.into())
        );
    }
    let ask = |strategy: &str, again: &str| {
        format!(
            r#"{{"annotator":"ana","session":"1","strategy":"{strategy}","count":4,"agreement":false,"again":[{again}]}}"#
        )
    };
    let asked = browser
        .tell("questions", &ask("medoids", ""), StatusCode::OK)
        .await;
    assert_eq!(
        (asked["queries"].as_array().unwrap().len(), &asked["answered"]),
        (4, &1.into())
    );

    let undone = browser
        .tell("undo", r#"{"request_id":"2","annotator":"ana"}"#, StatusCode::OK)
        .await;
    assert_eq!(
        (&undone["individuals"], &undone["classes"]),
        (&serde_json::json!([3]), &serde_json::json!([]))
    );
    let wall = r#"{"request_id":"4","annotator":"ana","change":{"create":{"class":"wall"}}}"#;
    let made = browser.tell("classes", wall, StatusCode::OK).await;
    assert_eq!(made["classes"][0]["name"], "wall");
    let asked = browser
        .tell("questions", &ask("medoids", "3"), StatusCode::OK)
        .await;
    assert_eq!(asked["queries"][0]["index"], 3);

    let refused = [
        (
            "labels",
            r#"{"request_id":"1","annotator":"ana","answers":[{"index":4,"answer":"ring"}]}"#,
            StatusCode::CONFLICT,
        ),
        (
            "labels",
            r#"{"request_id":"3","annotator":"ana","answers":[{"index":100,"answer":"ring"}]}"#,
            StatusCode::NOT_FOUND,
        ),
        (
            "labels",
            r#"{"request_id":"3","annotator":"","answers":[{"index":4,"answer":"ring"}]}"#,
            StatusCode::BAD_REQUEST,
        ),
        (
            "labels",
            r#"{"request_id":"3","annotator":"ana","answers":[]}"#,
            StatusCode::BAD_REQUEST,
        ),
        ("labels", "{", StatusCode::BAD_REQUEST),
        (
            "labels",
            r#"{"answers":"many"}"#,
            StatusCode::UNPROCESSABLE_ENTITY,
        ),
        (
            "undo",
            r#"{"request_id":"3","annotator":"ana"}"#,
            StatusCode::CONFLICT,
        ),
        ("questions", &ask("clairvoyance", ""), StatusCode::BAD_REQUEST),
        (
            "classes",
            r#"{"request_id":"3","annotator":"ana","change":{"create":{"class":"Wall"}}}"#,
            StatusCode::CONFLICT,
        ),
    ];
    for (path, message, status) in refused {
        browser.tell(path, message, status).await;
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_page_cannot_be_asked_for_is_told_on_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 1).await;
    let browser = Browser::at(&cluster);
    for (asked, field) in [("/?page=-1", "page"), ("/events?page=x", "page")] {
        let answer = browser.get(asked).await;
        assert_eq!(answer.status(), StatusCode::BAD_REQUEST, "{asked}");
        let page = answer.text().await.unwrap();
        let expected = format!("{field} = &quot;");
        assert!(
            page.contains(&expected) && page.contains("All campaigns"),
            "{page}"
        );
        assert!(!page.contains("deserialize"), "{page}");
    }
    let long = format!("/?words={}", "-+".repeat(101));
    let answer = browser.get(&long).await;
    assert_eq!(answer.status(), StatusCode::BAD_REQUEST);
    let page = answer.text().await.unwrap();
    assert!(page.contains("at most 200 characters"), "{page}");
    let origin = browser.url.clone();
    let answer = browser
        .post("/play/motion", &[("a", ""); 1001], Some(&origin))
        .await;
    assert_eq!(answer.status(), StatusCode::BAD_REQUEST);
    let answer = answer.text().await.unwrap();
    assert!(answer.contains("at most 1000 fields"), "{answer}");
    let answer = browser.post("/login", &[("other", "x")], Some(&origin)).await;
    assert_eq!(answer.status(), StatusCode::BAD_REQUEST);
    let page = answer.text().await.unwrap();
    assert!(page.contains("is missing: must be given"), "{page}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_machine_said_is_told_apart_from_what_people_say() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    let browser = Browser::at(&cluster);
    let request = v1::GetTaxonomyRequest {
        campaign: "small-1".to_owned(),
    };
    let taxonomy = cluster.client.get_taxonomy(request).await.unwrap();
    let taxonomy = whole(taxonomy.into_inner()).await.unwrap();
    let medoid = |place: usize| taxonomy.medoids[place].individual.as_ref().unwrap().index;
    let (first, second) = (medoid(0), medoid(1));
    let marks = async || {
        let cards = browser.page("/campaigns/small-1/taxonomy").await;
        cards.matches("by the rule-based judge, not by a person.").count()
    };
    // The synthetic annotator labels the first medoids.
    let synthetic = v1::AppendSyntheticLabelsRequest {
        campaign: "small-1".to_owned(),
        request_id: "1".to_owned(),
        count: 2,
        strategy: v1::QueryStrategy::Medoids as i32,
    };
    let mut labels = LabelServiceClient::connect(cluster.url()).await.unwrap();
    let message = labels.append_synthetic_labels(synthetic).await.unwrap();
    assert_eq!(whole(message.into_inner()).await.unwrap().entries.len(), 2);
    // The other cards have the judge's verdict.
    assert_eq!(marks().await, 4);
    let message =
        format!(r#"{{"request_id":"2","annotator":"ben","answers":[{{"index":{second},"answer":"ring"}}]}}"#);
    browser.tell("labels", &message, StatusCode::OK).await;
    assert_eq!(marks().await, 3);
    let labels: Value = serde_json::from_str(&browser.page("/campaigns/small-1/labels").await).unwrap();
    let machine = labels["machine"].as_str().unwrap();
    let expected: &str = if first < second { "AQA=" } else { "AAE=" };
    assert_eq!(machine, expected);
    let ask =
        r#"{"annotator":"ana","session":"1","strategy":"random","count":1,"agreement":false,"again":[]}"#;
    let asked = browser.tell("questions", ask, StatusCode::OK).await;
    let counts = ["answered", "own", "synthetic", "individuals"].map(|count| asked[count].as_u64().unwrap());
    assert_eq!(counts, [2, 0, 1, 100]);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn scripts_are_given_motions_and_maps() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    let browser = Browser::at(&cluster);
    let look = async |path: &str| -> Value {
        serde_json::from_str(&browser.page(&format!("/campaigns/small-1/{path}")).await).unwrap()
    };
    let motion = look("individuals/7/motion").await;
    assert_eq!(
        (&motion["run"]["agents"], &motion["run"]["steps"][200]),
        (&24.into(), &200.into())
    );
    let points = look("points").await;
    assert_eq!(
        (&points["count"], points["medoids"].as_array().unwrap().len()),
        (&100.into(), 4)
    );
    // The column has 100 numbers of two bytes; base64 has four characters for three bytes.
    assert_eq!(look("points/axes").await["x"].as_str().unwrap().len(), 268);
    for path in ["individuals/100/motion", "points/nothing"] {
        let answer = browser.get(&format!("/campaigns/small-1/{path}")).await;
        assert_eq!(answer.status(), StatusCode::NOT_FOUND, "{path}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_takes_workers_says_at_once_that_there_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    cluster.stop().await;
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let browser = Browser::at(&cluster);
    let expected = "no worker is connected: start one with `murmuration-worker --access FILE`";
    let begun = Instant::now();
    for (path, begins) in [
        ("/campaigns/small-1/report", "<!DOCTYPE html>"),
        ("/campaigns/small-1/individuals/0/motion", "no worker"),
    ] {
        let answer = browser.get(path).await;
        assert_eq!(answer.status(), StatusCode::SERVICE_UNAVAILABLE, "{path}");
        let text = answer.text().await.unwrap();
        assert!(
            text.contains(expected) && text.starts_with(begins),
            "{path}: {text}"
        );
    }
    assert!(begun.elapsed() < Duration::from_secs(10));
    // With a `download` link, browsers would save the error text as the report.
    let page = browser.page("/campaigns/small-1/taxonomy").await;
    assert!(
        page.contains("Export the report") && !page.contains(" download"),
        "{page}"
    );

    // Requests of programs wait a little for a worker, because workers may be restarting.
    let campaign = || "small-1".to_owned();
    let replay = v1::GetReplayRequest {
        campaign: campaign(),
        index: 0,
        stride: 1,
    };
    let mut labels = LabelServiceClient::new(cluster.channel().await);
    let synthetic = v1::AppendSyntheticLabelsRequest {
        campaign: campaign(),
        request_id: "1".to_owned(),
        strategy: v1::QueryStrategy::Medoids as i32,
        count: 2,
    };
    let (replay, labelled) = tokio::join!(
        cluster.client.get_replay(replay),
        labels.append_synthetic_labels(synthetic)
    );
    for refused in [replay.unwrap_err(), labelled.unwrap_err()] {
        assert_eq!((refused.code(), refused.message()), (Code::Unavailable, expected));
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn other_sites_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let browser = Browser::at(&cluster);
    for origin in [None, Some("http://evil.example"), Some("null")] {
        let answer = browser.post("/new", &QUICK, origin).await;
        assert_eq!(answer.status(), StatusCode::FORBIDDEN, "{origin:?}");
        assert!(
            answer.headers()["content-security-policy"]
                .to_str()
                .unwrap()
                .contains("default-src 'none'")
        );
    }
    assert_eq!(cluster.campaigns().await, []);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_not_there_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let browser = Browser::at(&cluster);
    for path in [
        "/nothing",
        "/campaigns/nobody-7",
        "/campaigns/nobody-7/individuals/0",
    ] {
        for (accepts, begins) in [
            ("text/html,*/*", "<!DOCTYPE html>"),
            ("application/json", "{\"error\":\"there is no "),
            ("*/*", "there is no "),
        ] {
            let request = browser.client.get(format!("{}{path}", browser.url));
            let answer = request.header("Accept", accepts).send().await.unwrap();
            assert_eq!(answer.status(), StatusCode::NOT_FOUND, "{path}");
            let told = answer.text().await.unwrap();
            assert!(told.starts_with(begins), "{path}: {told}");
            let has_ways = told.contains("href=\"/new\"");
            assert_eq!(has_ways, accepts.contains("html"), "{path}");
        }
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_follows_what_happens() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let mut events = Browser::at(&cluster).get("/events").await;
    assert_eq!(events.headers()["content-type"], "text/event-stream");
    let mut heard = String::new();
    hear(&mut events, &mut heard, "There are no campaigns yet").await;
    let id = cluster.create(&small_spec("")).await;
    cluster.finish(&id).await;
    hear(&mut events, &mut heard, "completed").await;
    cluster.stop().await;
    // The coordinator ends the stream properly, and does not cut it off.
    let end = async { while events.chunk().await.unwrap().is_some() {} };
    tokio::time::timeout(Duration::from_secs(60), end).await.unwrap();
}

/// Reads events into `heard` until `sign` arrives.
async fn hear(events: &mut Response, heard: &mut String, sign: &str) {
    while !heard.contains(sign) {
        let chunk = events.chunk().await.unwrap().expect("the stream goes on");
        heard.push_str(str::from_utf8(&chunk).unwrap());
    }
}
