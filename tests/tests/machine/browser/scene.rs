//! A coordinator with a finished campaign, and a browser at one of its pages.

use crate::browser::driver::{Driver, Window};
use murmuration_proto::{
    parts::whole,
    v1::{self, label_service_client::LabelServiceClient},
};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, small_spec};
use std::collections::BTreeMap;
use tempfile::TempDir;
use tonic::transport::Channel;

/// A finished campaign of 100 individuals.
pub struct Scene {
    folder: TempDir,
    pub cluster: Cluster,
    pub labels: LabelClient,
}

/// A client for a campaign's labels.
pub struct LabelClient(LabelServiceClient<Channel>);

impl Scene {
    pub async fn set() -> Self {
        Self::of(&small_spec("")).await
    }

    pub async fn of(spec: &CampaignSpec) -> Self {
        let mut scene = Self::begun(spec).await;
        let last = scene.cluster.finish("latest").await;
        assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
        scene
    }

    /// A campaign that has just started.
    pub async fn begun(spec: &CampaignSpec) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut cluster = Cluster::start(folder.path(), 2).await;
        cluster.create(spec).await;
        let labels = LabelClient(LabelServiceClient::new(cluster.channel().await));
        Self {
            folder,
            cluster,
            labels,
        }
    }

    pub fn url(&self, page: &str) -> String {
        format!("{}/campaigns/small-1{page}", self.cluster.url())
    }

    /// Opens a page in a browser whose annotator is `name`.
    pub async fn visit(&self, driver: &Driver, page: &str, name: &str) -> Window {
        let window = driver.open(&self.url("/label")).await;
        introduce(&window, name).await;
        window.driver.goto(self.url(page)).await.unwrap();
        window
    }

    /// Saves the report as a file and opens the file.
    pub async fn report(&self, driver: &Driver) -> Window {
        let text = murmuration_tests::http::get(self.url("/report"))
            .await
            .unwrap()
            .text()
            .await
            .unwrap();
        let page = self.folder.path().join("report.html");
        std::fs::write(&page, text).unwrap();
        let window = driver.open(&format!("file://{}", page.display())).await;
        // Smooth scrolling is switched off, because the pointer aims at an element's position before the scroll.
        let at_once = "document.documentElement.style.scrollBehavior = 'auto'";
        window.driver.execute(at_once, vec![]).await.unwrap();
        window
    }
}

impl LabelClient {
    pub async fn at(url: &str) -> Self {
        Self(LabelServiceClient::connect(url.to_owned()).await.unwrap())
    }

    /// The current answers, by individual.
    pub async fn standing(&mut self) -> BTreeMap<u64, String> {
        let request = v1::ListLabelsRequest {
            campaign: "latest".to_owned(),
        };
        let labels = self.0.list_labels(request).await.unwrap();
        let labels = whole(labels.into_inner()).await.unwrap().labels;
        let answers = labels.into_iter().filter_map(|label| label.answer);
        answers.map(|answer| (answer.index, answer.answer)).collect()
    }

    /// Sends answers about individuals as `annotator`.
    pub async fn say(&mut self, annotator: &str, message: impl IntoIterator<Item = (u64, String)>) {
        let answer = |(index, answer)| v1::Answer {
            index,
            answer,
            time_ms: 0,
            annotator: annotator.to_owned(),
        };
        let request = v1::AppendLabelsRequest {
            campaign: "latest".to_owned(),
            request_id: format!("{annotator} says"),
            answers: message.into_iter().map(answer).collect(),
        };
        self.0.append_labels(request).await.unwrap();
    }

    /// Lets the synthetic annotator answer about `count` individuals.
    pub async fn judge(&mut self, count: u32) {
        let request = v1::AppendSyntheticLabelsRequest {
            campaign: "latest".to_owned(),
            request_id: "the judge says".to_owned(),
            strategy: v1::QueryStrategy::Random as i32,
            count,
        };
        let message = self.0.append_synthetic_labels(request).await.unwrap();
        let message = whole(message.into_inner()).await.unwrap().entries;
        assert_eq!(message.len(), count as usize);
    }

    /// Undoes the last request of `annotator`.
    pub async fn undo(&mut self, annotator: &str) {
        let request = v1::UndoLabelsRequest {
            campaign: "latest".to_owned(),
            request_id: format!("{annotator} undoes"),
            annotator: annotator.to_owned(),
        };
        self.0.undo_labels(request).await.unwrap();
    }

    /// Number of entries of the log.
    pub async fn entries(&mut self) -> usize {
        self.log().await.len()
    }

    async fn log(&mut self) -> Vec<v1::LabelEntry> {
        let request = v1::ListLabelEntriesRequest {
            campaign: "latest".to_owned(),
        };
        let log = self.0.list_label_entries(request).await.unwrap();
        whole(log.into_inner()).await.unwrap().entries
    }
}

/// Enters the annotator's name, and waits for a question.
pub async fn introduce(window: &Window, name: &str) {
    introduce_here(window, name).await;
    asked(window).await;
    // Hides the paper's classes, because they would get the first keys.
    window
        .until("document.querySelector('.palette').classList.contains('ready')")
        .await;
    let own =
        "const hide = document.querySelector('[data-do=own]'); if (hide.checkVisibility()) hide.click()";
    window.driver.execute(own, vec![]).await.unwrap();
}

/// Enters the annotator's name on a page that asks about no behaviour.
pub async fn introduce_here(window: &Window, name: &str) {
    window.until("!document.getElementById('who').hidden").await;
    window.press(name).await;
    window.press("\u{e007}").await;
    window.until("document.getElementById('who').hidden").await;
}

/// Enters the annotator's name, and keeps the paper's classes.
pub async fn introduce_to_offers(window: &Window, name: &str) {
    window.until("!document.getElementById('who').hidden").await;
    window.press(name).await;
    window.press("\u{e007}").await;
    window
        .until("document.querySelector('.offer')?.checkVisibility()")
        .await;
    asked(window).await;
}

/// Waits for a question; returns the individual that it is about.
pub async fn asked(window: &Window) -> u64 {
    window
        .until("/^Individual [\\d,]+$/.test(document.getElementById('which')?.textContent)")
        .await;
    let message = window.text("#which").await;
    message
        .trim_start_matches("Individual ")
        .replace(',', "")
        .parse()
        .unwrap()
}

/// Answers the question by pressing `key`, and waits for the next question. Returns the answered individual.
pub async fn answer(window: &Window, key: &str) -> u64 {
    let index = asked(window).await;
    window.press(key).await;
    window
        .until(&format!(
            "document.getElementById('which').textContent !== 'Individual {index}'"
        ))
        .await;
    index
}

/// Answers the question with the name of a class. Returns the answered individual.
pub async fn name(window: &Window, class: &str) -> u64 {
    let index = asked(window).await;
    window.press("n").await;
    window.press(class).await;
    window.press("\u{e007}").await;
    saved(window).await;
    index
}

/// Waits until all answers are acknowledged.
pub async fn saved(window: &Window) {
    window
        .until("document.getElementById('status').textContent === 'All saved.'")
        .await;
}
