//! Searches that begin from an individual of an archive.

use super::Browser;
use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, Controller};
use murmuration_tests::{Cluster, small_spec};
use reqwest::StatusCode;

/// Presses a button of an individual, on a page with the token `request`; returns the location of the redirect.
async fn press(browser: &Browser, index: usize, example: &str, request: &str) -> String {
    let path = format!("/campaigns/small-1/individuals/{index}/search");
    let form = [("request", request), ("example", example)];
    let answer = browser.post(&path, &form, Some(&browser.url)).await;
    assert_eq!(answer.status(), StatusCode::SEE_OTHER, "{example}");
    answer.headers()["location"].to_str().unwrap().to_owned()
}

async fn spec(cluster: &mut Cluster, id: &str) -> CampaignSpec {
    cluster.status(id).await.spec.unwrap().try_into().unwrap()
}

fn genes(spec: &CampaignSpec) -> Vec<&[f64]> {
    let initial = spec.controllers().initial();
    initial.iter().map(Controller::genes).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn campaigns_begin_around_an_individual_or_with_those_that_are_least_like_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    let browser = Browser::at(&cluster);
    let archive = cluster.archive("small-1").await;
    let controllers: Vec<Vec<f64>> = archive
        .iter()
        .map(|individual| individual.controller.clone())
        .collect();

    let card = browser.page("/campaigns/small-1/taxonomy").await;
    let medoid = card
        .split("<article class=\"medoid behaviour\" data-index=\"")
        .nth(1)
        .unwrap();
    let index: usize = medoid.split('"').next().unwrap().parse().unwrap();
    assert!(
        medoid.contains(&format!(
            "action=\"/campaigns/small-1/individuals/{index}/search\""
        )) && medoid.contains("Less like this")
            && medoid.contains("Sweep around this"),
        "{medoid}"
    );

    let id = format!("like-small-1-{index}-2");
    assert_eq!(
        press(&browser, index, "like", "1").await,
        format!("/campaigns/{id}")
    );
    let like = spec(&mut cluster, &id).await;
    assert_eq!(
        (genes(&like)[0], genes(&like).len()),
        (&controllers[index][..], 50)
    );
    assert_eq!(like.world(), small_spec("").world());
    // A second click starts no second campaign, and another button of the page does.
    assert_eq!(
        press(&browser, index, "like", "1").await,
        format!("/campaigns/{id}")
    );
    let id = format!("unlike-small-1-{index}-3");
    assert_eq!(
        press(&browser, index, "unlike", "1").await,
        format!("/campaigns/{id}")
    );
    let unlike = spec(&mut cluster, &id).await;
    let begun = genes(&unlike);
    assert!((40..=50).contains(&begun.len()), "{}", begun.len());
    for genes in &begun {
        assert!(controllers.contains(&genes.to_vec()) && *genes != controllers[index]);
    }
    let page = browser.page(&format!("/campaigns/{id}")).await;
    assert!(
        page.contains(&format!("begins with {} controllers", begun.len())),
        "{page}"
    );
    let list = browser.page("/").await;
    assert!(
        list.contains(&id) && list.contains("begins with 50 controllers"),
        "{list}"
    );

    let path = "/campaigns/small-1/individuals/100/search";
    let beyond = browser
        .post(path, &[("example", "like")], Some(&browser.url))
        .await;
    assert_eq!(beyond.status(), StatusCode::NOT_FOUND);
    let path = "/campaigns/small-1/individuals/1/search";
    let unknown = browser
        .post(path, &[("example", "near")], Some(&browser.url))
        .await;
    assert_eq!(unknown.status(), StatusCode::BAD_REQUEST);
    assert_eq!(cluster.campaigns().await.len(), 3);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sweep_evaluates_all_controllers_within_a_step_once_and_shows_them_on_its_map() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    let browser = Browser::at(&cluster);
    let id = "sweep-small-1-7-2";
    let map = format!("/campaigns/{id}/map");
    assert_eq!(
        press(&browser, 7, "sweep", "1").await,
        format!("{map}#individual-0")
    );
    let swept = spec(&mut cluster, id).await;
    let number = swept.controllers().initial().len();
    let done = cluster.finish(id).await;
    assert_eq!(done.state(), v1::CampaignState::Completed);
    let archive = cluster.archive(id).await;
    assert_eq!(archive.len(), number);
    for (individual, controller) in archive.iter().zip(genes(&swept)) {
        assert_eq!(individual.controller, controller);
    }
    let list = browser.page("/").await;
    assert!(list.contains(&format!("sweep of {number} controllers")), "{list}");
    let page = browser.page(&map).await;
    assert!(page.contains("The cross is the centre of the sweep"), "{page}");
    let points = browser.page(&format!("/campaigns/{id}/points")).await;
    assert!(points.contains("\"centre\":0"), "{points}");
    let others = browser.page("/campaigns/small-1/points").await;
    assert!(others.contains("\"centre\":null"), "{others}");

    // The page Play starts sweeps too.
    let form = [("example", "sweep"), ("request", "2")];
    let play = "/play/search?model=single-sensor&genes=0,0,0,0&seed=3";
    let answer = browser.post(play, &form, Some(&browser.url)).await;
    assert_eq!(
        answer.headers()["location"],
        "/campaigns/play-sweep-3/map#individual-0"
    );
    assert_eq!(genes(&spec(&mut cluster, "play-sweep-3").await).len(), 81);
    let unlike = [("example", "unlike")];
    let refused = browser.post(play, &unlike, Some(&browser.url)).await;
    assert_eq!(refused.status(), StatusCode::BAD_REQUEST);
    cluster.stop().await;
}
