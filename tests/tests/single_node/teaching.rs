//! Tests, over HTTP, changes of classes and answers on the pages, and the tables that people download.

use murmuration_tests::{Murmuration, http};
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};
use std::fs;

/// A browser at a coordinator.
struct Page {
    client: Client,
    url: String,
}

impl Page {
    async fn get(&self, path: &str) -> reqwest::Response {
        let address = format!("{}/campaigns/small-1/{path}", self.url);
        let answer = self.client.get(address).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        answer
    }

    async fn text(&self, path: &str) -> String {
        self.get(path).await.text().await.unwrap()
    }

    async fn json(&self, path: &str) -> Value {
        serde_json::from_str(&self.text(path).await).unwrap()
    }

    /// Sends a POST request as the annotator ana. Returns the status and the answer, which is null if it is not JSON.
    async fn post(&self, path: &str, request: &str, mut message: Value) -> (StatusCode, Value) {
        message["request_id"] = request.into();
        message["annotator"] = "ana".into();
        let address = format!("{}/campaigns/small-1/{path}", self.url);
        let posted = self.client.post(address).header("Origin", &self.url);
        let posted = posted.header("Content-Type", "application/json");
        let answer = posted.body(message.to_string()).send().await.unwrap();
        let status = answer.status();
        let text = answer.text().await.unwrap();
        (status, serde_json::from_str(&text).unwrap_or_default())
    }

    /// Makes a valid change to a class; returns the classes after the change.
    async fn change(&self, request: &str, change: Value) -> Value {
        let (status, told) = self.post("classes", request, json!({ "change": change })).await;
        assert_eq!(status, StatusCode::OK, "{change} {told}");
        told
    }

    async fn answer(&self, request: &str, indices: &[u64], class: &str) {
        let answers: Vec<Value> = indices
            .iter()
            .map(|index| json!({ "index": index, "answer": class }))
            .collect();
        let (status, _) = self.post("labels", request, json!({ "answers": answers })).await;
        assert_eq!(status, StatusCode::OK);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn classes_are_changed_and_reverted_and_answers_withdrawn() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let (coordinator, url) = murmuration.serve("127.0.0.1:0", &["--workers", "1"]);
    let page = Page {
        client: http::client().build().unwrap(),
        url,
    };
    page.answer("1", &[0, 1, 2], "wall following").await;
    page.answer("2", &[3], "ring").await;
    let told = page.json("classes/details").await;
    let wall = &told["classes"][0];
    assert_eq!(
        (
            &wall["name"],
            &wall["labels"],
            &wall["people"],
            &wall["individuals"]
        ),
        (
            &json!("wall_following"),
            &json!(3),
            &json!(["ana"]),
            &json!([0, 1, 2])
        )
    );

    let told = page
        .change("3", json!({ "shortcut": { "class": "ring", "shortcut": "q" } }))
        .await;
    assert_eq!(told["classes"][1]["shortcut"], "q");
    let told = page
        .change("4", json!({ "delete": { "class": "wall following" } }))
        .await;
    assert_eq!(told["classes"].as_array().unwrap().len(), 1);
    assert_eq!(told["changes"][0]["description"], "deleted “wall following”");
    // A page that got no answer repeats its request; the coordinator does not make the change twice.
    page.change("4", json!({ "delete": { "class": "wall following" } }))
        .await;
    let standing = page.json("answers/standing").await;
    assert_eq!(standing["classes"][0]["name"], "ring");

    // Only the newest change can be reverted, and only once.
    let (key, deletion) = (4, 5);
    let revert = |entry: u64| json!({ "change": { "revert": { "entry": entry } } });
    let (status, _) = page.post("classes", "5", revert(key)).await;
    assert_eq!(status, StatusCode::CONFLICT);
    let (status, told) = page.post("classes", "6", revert(deletion)).await;
    assert_eq!(
        (status, &told["classes"][0]["labels"]),
        (StatusCode::OK, &json!(3))
    );
    let (status, _) = page.post("classes", "7", revert(deletion)).await;
    assert_eq!(status, StatusCode::CONFLICT);

    for (individuals, status) in [
        (json!([1, 3]), StatusCode::OK),
        (json!([0, 1]), StatusCode::CONFLICT),
        (json!([0, 0]), StatusCode::BAD_REQUEST),
        (json!([]), StatusCode::BAD_REQUEST),
    ] {
        let request = format!("withdraw {individuals}");
        let message = json!({ "individuals": individuals });
        assert_eq!(
            page.post("withdraw", &request, message).await.0,
            status,
            "{individuals}"
        );
    }
    let told = page.json("classes/details").await;
    assert_eq!(told["classes"][0]["labels"], 2);
    assert_eq!(told["classes"].as_array().unwrap().len(), 1);
    assert_eq!(coordinator.terminate(), Some(0));
    // The stored log is consistent.
    assert_eq!(murmuration.run(&["doctor"]).code, Some(0));
}

#[tokio::test(flavor = "multi_thread")]
async fn tables_from_a_page_are_those_of_the_commands() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let (coordinator, url) = murmuration.serve("127.0.0.1:0", &["--workers", "1"]);
    let page = Page {
        client: http::client().build().unwrap(),
        url,
    };
    page.answer("1", &[7, 1], "=HYPERLINK(\"http://evil.example\")")
        .await;
    page.change("2", json!({ "create": { "class": "later" } })).await;
    page.change("3", json!({ "shortcut": { "class": "later", "shortcut": "q" } }))
        .await;
    page.change("4", json!({ "delete": { "class": "later" } })).await;

    let labels = folder.path().join("labels.csv");
    let export = folder.path().join("export");
    for arguments in [
        vec!["labels", "latest", "--csv", labels.to_str().unwrap()],
        vec!["export", "latest", export.to_str().unwrap(), "--csv"],
    ] {
        let done = murmuration.run(&arguments);
        assert_eq!(done.code, Some(0), "{}", done.stderr);
    }
    let download = page.get("labels.csv").await;
    assert_eq!(
        download.headers()["content-disposition"],
        "attachment; filename=\"small-1-labels.csv\""
    );
    let text = download.text().await.unwrap();
    assert_eq!(text, fs::read_to_string(labels).unwrap());
    assert!(text.contains("'=HYPERLINK"), "{text}");
    let archive = page.text("archive.csv").await;
    assert_eq!(archive.lines().count(), 101);
    assert_eq!(
        archive,
        fs::read_to_string(export.join("individuals.csv")).unwrap()
    );
    assert_eq!(coordinator.terminate(), Some(0));

    // An export keeps every kind of entry.
    let other = folder.path().join("other");
    let imported = [
        "import",
        export.to_str().unwrap(),
        "--data",
        other.to_str().unwrap(),
    ];
    let done = murmuration.run(&imported);
    assert_eq!(done.code, Some(0), "{}", done.stderr);
}
