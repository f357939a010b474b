//! Tests the page Play, over HTTP.

use murmuration_access::CostClass;
use murmuration_proto::v1;
use murmuration_sim::simulate::{Start, Swarm};
use murmuration_swarm::{Controller, Preset, World};
use murmuration_tests::{Cluster, http, small_latent_spec};
use reqwest::{
    Client, Response, StatusCode,
    header::{CACHE_CONTROL, CONTENT_TYPE, ORIGIN},
};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};
use tempfile::TempDir;
use tonic::Code;

/// A browser at a coordinator without workers. For the page Play, the coordinator simulates by itself.
struct Playground {
    _folder: TempDir,
    cluster: Cluster,
    client: Client,
}

impl Playground {
    async fn open() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self {
            cluster: Cluster::start(folder.path(), 0).await,
            _folder: folder,
            client: http::client().build().unwrap(),
        }
    }

    async fn page(&self, query: &str) -> String {
        let page = self.client.get(format!("{}/play?{query}", self.cluster.url()));
        let answer = page.send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{query}");
        answer.text().await.unwrap()
    }

    /// Requests a motion from a page of `origin`.
    async fn motion(&self, origin: Option<&str>, form: &str) -> Response {
        let request = self.client.post(format!("{}/play/motion", self.cluster.url()));
        let request = match origin {
            Some(origin) => request.header(ORIGIN, origin),
            None => request,
        };
        let request = request.header(CONTENT_TYPE, "application/x-www-form-urlencoded");
        request.body(form.to_owned()).send().await.unwrap()
    }

    async fn own_motion(&self, form: &str) -> Response {
        self.motion(Some(&self.cluster.url()), form).await
    }
}

const MILLING: &str = "model=single-sensor&genes=0.6,1,0.4,0.5&seed=4&robots=30";

#[tokio::test(flavor = "multi_thread")]
async fn a_motion_is_that_of_the_swarm_and_is_kept_by_nobody() {
    let playground = Playground::open().await;
    let answer = playground.own_motion(&format!("{MILLING}&from=700")).await;
    assert_eq!(answer.status(), StatusCode::OK);
    assert_eq!(answer.headers()[CACHE_CONTROL], "no-store");
    assert_eq!(answer.headers()[CONTENT_TYPE], "application/octet-stream");
    let bytes = answer.bytes().await.unwrap();
    let words: Vec<[u8; 4]> = bytes.as_chunks().0.to_vec();
    let header: Vec<u32> = words[..6].iter().map(|&word| u32::from_le_bytes(word)).collect();
    assert_eq!(header, [2, 700, 1, 600, 30, 15]);
    assert_eq!(bytes.len(), 4 * 6 + 600 * 30 * (3 * 4 + 1) + 15 * 7 * 4);

    let world = World::try_from(murmuration_proto::v1::World {
        agents: Some(30),
        ..World::default().into()
    });
    let controller = Controller::new(Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5]).unwrap();
    let mut swarm = Swarm::new(&controller, &world.unwrap(), &Start::seeded(4)).unwrap();
    swarm.advance(700);
    let (poses, _) = words[6..].as_chunks::<3>();
    for (agent, pose) in swarm.agents().zip(poses) {
        let [x, y] = agent.position;
        let expected = [x, y, agent.theta].map(|value| (value as f32).to_le_bytes());
        assert_eq!(*pose, expected);
    }
    playground.cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_simulated_is_refused_with_what_is_wrong() {
    let playground = Playground::open().await;
    for (form, expected) in [
        ("model=none", "model = \"none\": must be \"single-sensor\""),
        (
            "robots=1001",
            "robots = \"1001\": must be a whole number from 1 to 1000",
        ),
        ("genes=1", "genes = \"1\": must be 9 numbers"),
        (
            "from=1000001",
            "from = \"1000001\": must be a whole number from 0 to 1000000",
        ),
        ("robot=%5Brobot%5D%0Asensor+%3D+1", "did you mean `sensors`?"),
        ("wheels=3", "parameter = \"wheels\": must be one of"),
    ] {
        let answer = playground.own_motion(form).await;
        assert_eq!(answer.status(), StatusCode::BAD_REQUEST, "{form}");
        let text = answer.text().await.unwrap();
        assert!(text.contains(expected), "{form}: {text}");
    }
    for origin in [Some("https://evil.example"), None] {
        let answer = playground.motion(origin, MILLING).await;
        assert_eq!(answer.status(), StatusCode::FORBIDDEN, "{origin:?}");
    }
    playground.cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_shows_what_its_address_holds_and_says_what_it_cannot() {
    let playground = Playground::open().await;
    let page = playground.page(MILLING).await;
    assert!(
        page.contains("<code>right_1</code>") && !page.contains("role=\"alert\""),
        "{page}"
    );
    assert!(
        page.contains("value=\"0.4\"") && page.contains("value=\"30\""),
        "{page}"
    );
    let wrong = playground.page("model=turbopi&genes=20,2,x,0&seed=5").await;
    assert!(
        wrong.contains("speed_1 = &quot;x&quot;: must be a number from -20 to 20"),
        "{wrong}"
    );
    assert!(wrong.contains("value=\"5\""), "{wrong}");
    let home = playground
        .client
        .get(playground.cluster.url())
        .send()
        .await
        .unwrap();
    assert!(home.text().await.unwrap().contains("href=\"/play\""));
    playground.cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_seats_of_those_who_leave_go_to_whoever_waits() {
    let playground = Arc::new(Playground::open().await);
    let far = |seed: usize| {
        let playground = playground.clone();
        tokio::spawn(async move {
            let form = format!("robots=1000&seed={seed}&from=1000000");
            playground.own_motion(&form).await
        })
    };
    let share = CostClass::Computing.limits().share.get();
    let computing: Vec<_> = (0..share).map(far).collect();
    tokio::time::sleep(Duration::from_millis(300)).await;
    let waiting = {
        let playground = playground.clone();
        tokio::spawn(async move { playground.own_motion(MILLING).await.status() })
    };
    tokio::time::sleep(Duration::from_millis(100)).await;
    assert!(!waiting.is_finished());
    // Without the abort, these simulations would run for two seconds.
    computing.iter().for_each(tokio::task::JoinHandle::abort);
    let left = Instant::now();
    assert_eq!(waiting.await.unwrap(), StatusCode::OK);
    assert!(left.elapsed() < Duration::from_millis(1500), "nobody has left");
    for gone in computing {
        assert!(gone.await.is_err_and(|error| error.is_cancelled()));
    }
    let playground = Arc::into_inner(playground).unwrap();
    playground.cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_swarm_is_like_is_found_in_the_space_of_the_campaign() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let id = cluster.create(&small_latent_spec("")).await;
    let last = cluster.finish(&id).await;
    let request = v1::GetIndividualRequest {
        campaign: id.clone(),
        index: 42,
    };
    let individual = cluster.client.get_individual(request).await.unwrap().into_inner();
    let mut request = v1::FindNearestRequest {
        campaign: id.clone(),
        features: individual.features.clone(),
        embedding: individual.embedding.clone(),
        checkpoint: last.checkpoint.clone(),
        count: None,
    };
    let found = cluster
        .client
        .find_nearest(request.clone())
        .await
        .unwrap()
        .into_inner();
    assert!(found.is_taxonomy && found.neighbours.len() == 5 && found.labelled.is_none());
    assert_eq!(
        (found.neighbours[0].index, found.neighbours[0].distance),
        (42, 0.0)
    );
    request.checkpoint = "0".repeat(64);
    let refused = cluster.client.find_nearest(request.clone()).await.unwrap_err();
    assert!(
        refused.code() == Code::FailedPrecondition && refused.message().contains(&last.checkpoint),
        "{refused}"
    );
    request.count = Some(101);
    let refused = cluster.client.find_nearest(request.clone()).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);

    let post = async |form: String| {
        let request = http::client()
            .build()
            .unwrap()
            .post(format!("{}/play/like", cluster.url()));
        let request = request.header(ORIGIN, cluster.url());
        let request = request.header(CONTENT_TYPE, "application/x-www-form-urlencoded");
        let answer = request.body(form).send().await.unwrap();
        (answer.status(), answer.text().await.unwrap())
    };
    let (status, page) = post(format!("{MILLING}&campaign={id}")).await;
    assert_eq!(status, StatusCode::OK, "{page}");
    assert_eq!(page.matches("<img").count(), 5, "{page}");
    assert!(
        page.contains(&format!("/campaigns/{id}/map#individual-")),
        "{page}"
    );
    let (status, page) = post(format!("model=turbopi&campaign={id}")).await;
    assert_eq!(status, StatusCode::OK, "{page}");
    assert!(
        page.contains("its model is single-sensor, and this is turbopi"),
        "{page}"
    );
    for (form, expected) in [
        (MILLING.to_owned(), "campaign is missing"),
        (format!("{MILLING}&campaign=other-1"), "other-1"),
        (
            format!("campaign={id}&robot=model%3D%22turbopi%22%0A%5Bworld%5D%0Awidth%3D400"),
            "a world of 400 x 500",
        ),
        (
            format!("campaign={id}&robot=model%3D%22turbopi%22%0A%5Bworld%5D%0Ahorizon%3D9000000"),
            "world.horizon",
        ),
    ] {
        let (status, page) = post(form).await;
        assert!(
            status.is_client_error() && page.contains(expected),
            "{status}: {page}"
        );
    }
    cluster.stop().await;
}
