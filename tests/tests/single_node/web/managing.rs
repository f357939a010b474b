//! Tests new campaigns, deleted campaigns, and campaigns side by side.

use super::Browser;
use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, small_spec};
use reqwest::StatusCode;
use tonic::Code;

#[tokio::test(flavor = "multi_thread")]
async fn a_new_campaign_says_what_it_costs_or_what_is_wrong_before_it_starts() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let browser = Browser::at(&cluster);
    let own = Some(browser.url.clone());
    let page = browser.page("/new?example=quick-latent").await;
    assert!(page.contains("1,000 (20 generations of 50)"), "{page}");
    assert!(
        page.contains("Controllers per generation, 1 to 100,000"),
        "{page}"
    );
    let send = async |form: &[(&str, &str)]| {
        let answer = browser.post("/new", form, own.as_deref()).await;
        assert_eq!(answer.status(), StatusCode::OK);
        answer.text().await.unwrap()
    };
    let text = "model = \"single-sensor\"\r\nmethod = \"random\"\r\n[search]\r\npopulation = 0\r\n";
    let told = send(&[("step", "start"), ("text", text)]).await;
    assert!(
        told.contains("Line 4:") && told.contains("4 | population = 0"),
        "{told}"
    );
    let fields = |seed| {
        [
            ("step", "start"),
            ("model", "two-sensor"),
            ("method", "random"),
            ("seed", seed),
        ]
    };
    let told = send(&fields("x")).await;
    assert!(told.contains("Seed</a> must be a whole number"), "{told}");
    let mut form = fields("7");
    form[0].1 = "file";
    let as_file = send(&form).await;
    assert!(as_file.contains("seed = 7\n"), "{as_file}");
    assert_eq!(cluster.campaigns().await, []);

    // A copy of a campaign has its specification.
    let id = cluster.create(&small_spec("seed = 3")).await;
    let copy = browser.page(&format!("/new?from={id}")).await;
    assert!(copy.contains("name=\"seed\" value=\"3\""), "{copy}");

    // A POST request that is not a form starts no campaign, and a form without a swarm starts no campaign either.
    let json = browser
        .client
        .post(format!("{}/play/search", browser.url))
        .header("Origin", &browser.url)
        .header("Content-Type", "application/json");
    let refused = json.body("{}").send().await.unwrap();
    assert_eq!(refused.status(), StatusCode::UNSUPPORTED_MEDIA_TYPE);
    let nothing = browser.post("/play/search", &[], own.as_deref()).await;
    assert_eq!(nothing.status(), StatusCode::BAD_REQUEST);
    assert_eq!(cluster.campaigns().await.len(), 1);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_campaign_is_deleted_once_it_does_not_run_and_leaves_the_list() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let browser = Browser::at(&cluster);
    let own = Some(browser.url.clone());
    cluster.run(&small_spec("")).await;
    let asks = browser.page("/campaigns/small-1/delete").await;
    assert!(asks.contains("This deletes 100 individuals"), "{asks}");
    let list = browser.page("/").await;
    assert!(
        list.contains("/campaigns/small-1/delete") && list.contains("UTC"),
        "{list}"
    );
    let delete = async |id: &str| {
        let path = format!("/campaigns/{id}/delete");
        browser.post(&path, &[], own.as_deref()).await.status()
    };
    assert_eq!(delete("latest").await, StatusCode::BAD_REQUEST);
    assert_eq!(delete("small-1").await, StatusCode::SEE_OTHER);
    assert_eq!(delete("small-1").await, StatusCode::NOT_FOUND);
    assert_eq!(cluster.campaigns().await, []);
    // The id of a deleted campaign is not used again.
    let endless = small_spec("")
        .to_toml()
        .replace("generations = 5", "generations = 100000");
    let next = cluster.create(&CampaignSpec::from_toml(&endless).unwrap()).await;
    assert_eq!(next, "small-2");
    assert_eq!(delete(&next).await, StatusCode::CONFLICT);

    // The list folds a cell of a study. A cell is never `latest`, and is deleted only together with its study.
    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(
            (&small_spec("")).into(),
        )),
        study: "mini".to_owned(),
        ..v1::CreateCampaignRequest::default()
    };
    let cell = cluster
        .client
        .create_campaign(request)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(cluster.status("latest").await.id, next);
    assert_eq!(cluster.finish(&cell.id).await.study, "mini");
    assert!(browser.page("/").await.contains("Study mini"));
    assert_eq!(delete(&cell.id).await, StatusCode::CONFLICT);
    let page = format!("/campaigns/{}/delete", cell.id);
    let asks = browser.page(&page).await;
    assert!(
        asks.contains("This deletes 100 individuals") && asks.contains("name=\"study\" value=\"mini\""),
        "{asks}"
    );
    let other = browser.post(&page, &[("study", "another")], own.as_deref()).await;
    assert_eq!(other.status(), StatusCode::CONFLICT);
    let deleted = browser.post(&page, &[("study", "mini")], own.as_deref()).await;
    assert_eq!(deleted.status(), StatusCode::SEE_OTHER);
    assert_eq!(cluster.campaigns().await.len(), 1);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_list_comes_in_parts_and_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let mut created = Vec::new();
    for _ in 0..120 {
        created.push(cluster.create(&small_spec("")).await);
    }
    let listed = cluster.campaigns().await;
    let ids: Vec<_> = listed.into_iter().map(|campaign| campaign.id).collect();
    assert_eq!(ids, created);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tags_and_notes_are_written_on_a_page_and_found_in_the_list() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let noted = cluster.create(&small_spec("")).await;
    let other = cluster.create(&small_spec("")).await;
    let browser = Browser::at(&cluster);
    let own = Some(browser.url.clone());
    let form = format!("/campaigns/{noted}/notes");
    let change = [
        ("former", ""),
        ("former_note", ""),
        ("tags", "paper, baseline"),
        ("note", "First\r\n<b>second</b>"),
    ];
    let saved = browser.post(&form, &change, own.as_deref()).await;
    assert_eq!(
        saved.headers()["location"],
        format!("/campaigns/{noted}").as_str()
    );
    // Another person has seen the campaign without its tags and its note, and adds a tag.
    let later = [
        ("former", ""),
        ("former_note", ""),
        ("tags", "later"),
        ("note", ""),
    ];
    browser.post(&form, &later, own.as_deref()).await;
    let status = cluster.status(&noted).await;
    assert_eq!(
        (status.tags, status.note.as_str()),
        (
            vec!["baseline".to_owned(), "later".to_owned(), "paper".to_owned()],
            "First\n<b>second</b>"
        )
    );
    let page = browser.page(&format!("/campaigns/{noted}")).await;
    assert!(page.contains("First\n&lt;b&gt;second&lt;/b&gt;</p>"), "{page}");
    let line = |id: &str| format!("id=\"line-{id}\"");
    for (query, found) in [
        ("", true),
        ("?tag=paper", false),
        ("?words=SECOND", false),
        ("?words=later", false),
    ] {
        let list = browser.page(&format!("/{query}")).await;
        assert!(list.contains(&line(&noted)), "{query}: {list}");
        assert_eq!(list.contains(&line(&other)), found, "{query}: {list}");
        assert!(list.contains("tag=baseline\""), "{list}");
    }
    let refused = [
        ("former", "paper"),
        ("former_note", ""),
        ("tags", "a/b"),
        ("note", ""),
    ];
    let refused = browser.post(&form, &refused, own.as_deref()).await;
    assert_eq!(refused.status(), StatusCode::BAD_REQUEST);
    let many: Vec<String> = (0..15).map(|number| format!("t{number}")).collect();
    let request = v1::NoteCampaignRequest {
        campaign: noted.clone(),
        add_tags: many,
        ..v1::NoteCampaignRequest::default()
    };
    let error = cluster.client.note_campaign(request).await.unwrap_err();
    assert_eq!(
        (error.code(), error.message()),
        (Code::InvalidArgument, "tags = 18 tags: must be at most 16")
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_list_shows_chosen_numbers_and_is_sorted_by_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let long = cluster.create(&small_spec("")).await;
    let short = cluster.create(&small_spec("").with_generations(2).unwrap()).await;
    for campaign in [&long, &short] {
        cluster.finish(campaign).await;
    }
    let browser = Browser::at(&cluster);
    let order = |list: &str| {
        let place = |id: &str| list.find(&format!("id=\"line-{id}\"")).unwrap();
        place(&long) < place(&short)
    };
    let plain = browser.page("/").await;
    assert!(!order(&plain) && !plain.contains("<dl"), "{plain}");
    let sorted = browser.page("/?order=evaluations&show=clusters&show=loss").await;
    assert!(order(&sorted), "{sorted}");
    for (title, value) in [
        ("evaluations", "100"),
        ("evaluations", "40"),
        ("clusters", "4"),
        ("loss", "–"),
    ] {
        let shown = format!("<dt>{title}</dt><dd>{value}</dd>");
        assert!(sorted.contains(&shown), "{shown} is not in {sorted}");
    }
    let followed = "/events?order=evaluations&amp;show=clusters&amp;show=loss";
    assert!(sorted.contains(followed), "{sorted}");
    assert!(!order(&browser.page("/?order=evaluations&reversed=yes").await));
    for wrong in ["/?order=best", "/?show=best"] {
        assert_eq!(
            browser.get(wrong).await.status(),
            StatusCode::BAD_REQUEST,
            "{wrong}"
        );
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_id_that_was_typed_wrongly_leads_to_the_campaign_that_was_meant() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    let request = murmuration_tests::http::client()
        .build()
        .unwrap()
        .get(format!("{}/campaigns/smal-1/map", cluster.url()));
    let answer = request.header("accept", "text/html").send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::NOT_FOUND);
    let page = answer.text().await.unwrap();
    assert!(
        page.contains("did you mean") && page.contains("<a href=\"/campaigns/small-1\">Campaign small-1</a>"),
        "{page}"
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn behaviours_in_different_spaces_are_matched_by_what_the_judge_calls_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let browser = Browser::at(&cluster);
    let wide = small_spec("").to_toml().replace("width = 500.0", "width = 600.0");
    for spec in [small_spec(""), CampaignSpec::from_toml(&wide).unwrap()] {
        cluster.run(&spec).await;
    }
    let compare = "/compare?campaign=small-1&campaign=small-2";
    let judged = browser.page(compare).await;
    // The page Taxonomy shows the same classes.
    let mut named = 0;
    for campaign in ["small-1", "small-2"] {
        let cards = browser.page(&format!("/campaigns/{campaign}/taxonomy")).await;
        let parts: Vec<&str> = cards.split("?</span><small>judge</small>").collect();
        let words = parts[..parts.len() - 1]
            .iter()
            .filter_map(|part| part.rsplit('>').next());
        // Behaviours are matched by what the judge calls the medoid, also where its cluster is mixed.
        let words = words.map(|word| word.trim_start_matches("mixed; medoid: "));
        for word in words.filter(|word| *word != "random") {
            assert!(
                judged.contains(&format!("<strong>{word}</strong>")),
                "{word}: {judged}"
            );
            named += 1;
        }
    }
    assert!(named > 0, "{judged}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn campaigns_are_compared_field_by_field() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let browser = Browser::at(&cluster);
    for spec in ["", "seed = 7"] {
        cluster.run(&small_spec(spec)).await;
    }
    let page = browser
        .page("/compare?campaign=small-1&campaign=small-2&campaign=small-2")
        .await;
    assert!(
        page.contains("<code>seed</code>") && page.contains("<td>7</td>"),
        "{page}"
    );
    assert!(!page.contains("<code>model</code>"), "{page}");
    assert_eq!(page.matches("Paths of behaviour").count(), 8);
    for (path, status) in [
        ("/compare?campaign=small-1", StatusCode::BAD_REQUEST),
        ("/compare?campaign=small-1&campaign=none-9", StatusCode::NOT_FOUND),
    ] {
        assert_eq!(browser.get(path).await.status(), status, "{path}");
    }
    cluster.stop().await;
}
