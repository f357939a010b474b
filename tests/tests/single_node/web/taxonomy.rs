//! Tests the page of the taxonomy: its behaviours, its versions, and what learning changed.

use super::Browser;
use murmuration_proto::{parts::whole, v1};
use murmuration_tests::{Cluster, small_latent_spec, small_spec};
use reqwest::StatusCode;
use serde_json::Value;

#[tokio::test(flavor = "multi_thread")]
async fn a_finished_campaign_shows_its_behaviours() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let browser = Browser::at(&cluster);
    assert!(browser.page("/").await.contains("There are no campaigns yet"));
    let id = cluster.create(&small_spec("")).await;
    cluster.finish(&id).await;
    let list = browser.page("/").await;
    let shown = "src=\"/campaigns/small-1/behaviour\"";
    assert!(
        list.contains(shown) && list.contains("100 of 100 evaluations"),
        "{list}"
    );
    let page = browser.page("/campaigns/small-1").await;
    let novelty = "<dt>Best novelty of the last generation</dt>";
    for shown in [novelty, "4 clusters of behaviours", ">completed</strong>"] {
        assert!(page.contains(shown), "{shown}: {page}");
    }

    let request = v1::GetTaxonomyRequest { campaign: id };
    let taxonomy = cluster.client.get_taxonomy(request).await.unwrap();
    let taxonomy = whole(taxonomy.into_inner()).await.unwrap();
    // The page shows the novelty within the final archive, not the novelty when evaluated.
    let cards = browser.page("/campaigns/small-1/taxonomy").await;
    for medoid in &taxonomy.medoids {
        let size = format!("<dt>Cluster</dt><dd>{}</dd>", medoid.cluster_size);
        assert!(cards.contains(&size), "{size} {cards}");
        let shown = format!("<dt>Novelty</dt><dd>{:.4}</dd>", medoid.novelty);
        assert!(cards.contains(&shown), "{shown} {cards}");
    }
    let medoid = taxonomy.medoids[0].individual.as_ref().unwrap();
    // An address with the campaign's creation time is unique across data directories, so browsers may cache it for ever.
    let path = format!("/campaigns/small-1/individuals/{}", medoid.index);
    let created = cluster.status("small-1").await.created_ms;
    let lasting = format!("{path}?created={created}");
    assert!(cards.contains(&lasting), "{cards}");
    let paths = format!("{path}/paths.png?created={created}");
    assert!(page.contains(&paths) && cards.contains(&paths), "{page}");
    for (path, kept) in [
        (&lasting, "private, max-age=31536000, immutable"),
        (&paths, "private, max-age=31536000, immutable"),
        (&path, "private, no-cache"),
        (&format!("{path}?created=1"), "private, no-cache"),
        (&format!("{path}/motion"), "private, no-cache"),
    ] {
        assert_eq!(browser.get(path).await.headers()["cache-control"], kept, "{path}");
    }
    let behaviour = browser.get("/campaigns/small-1/behaviour").await;
    assert_eq!(behaviour.headers()["location"], paths);
    for (path, size) in [(&lasting, (50, 50)), (&paths, (400, 400))] {
        let picture = browser.get(path).await;
        assert_eq!(picture.headers()["content-type"], "image/png");
        let bytes = picture.bytes().await.unwrap();
        let decoder = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        assert_eq!(decoder.info().size(), size);
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_figure_for_a_paper_has_the_chosen_behaviours() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let browser = Browser::at(&cluster);
    let id = cluster.create(&small_spec("")).await;
    cluster.finish(&id).await;
    let page = browser.page("/campaigns/small-1/taxonomy").await;
    for part in [
        "Figure for a paper",
        "action=\"/campaigns/small-1/figure.pdf\"",
        "name=\"behaviours\" value=\"4\"",
    ] {
        assert!(page.contains(part), "{part}: {page}");
    }
    let asked = "behaviours=4&behaviours=2&width=page&labels=numbers";
    let svg = browser
        .get(&format!("/campaigns/small-1/figure.svg?{asked}"))
        .await;
    assert_eq!(svg.headers()["content-type"], "image/svg+xml");
    assert_eq!(
        svg.headers()["content-disposition"],
        "attachment; filename=\"small-1-figure.svg\""
    );
    let svg = svg.text().await.unwrap();
    assert!(svg.contains("width=\"178mm\""), "{svg}");
    let numbers: Vec<&str> = svg.split("<g><title>").skip(1).map(|text| &text[..1]).collect();
    assert_eq!(numbers, ["4", "2"]);
    let pdf = browser
        .get(&format!("/campaigns/small-1/figure.pdf?{asked}"))
        .await;
    assert_eq!(pdf.headers()["content-type"], "application/pdf");
    assert!(pdf.bytes().await.unwrap().starts_with(b"%PDF-1."));
    for asked in ["behaviours=5", "width=3mm", "labels=roman"] {
        let refused = browser
            .get(&format!("/campaigns/small-1/figure.pdf?{asked}"))
            .await;
        assert_eq!(refused.status(), StatusCode::BAD_REQUEST, "{asked}");
    }
    cluster.stop().await;
}

const FEEDBACK: &str = "[feedback]\ngenerations = 1\n[feedback.recipe.labelled]\nepochs = 2\nsteps = 4";

/// Ana's answers, as a page's script sends them.
fn answers_of(request: &str, names: &[(u64, &str)]) -> String {
    let answers: Vec<Value> = names
        .iter()
        .map(|(index, answer)| serde_json::json!({ "index": index, "answer": answer }))
        .collect();
    serde_json::json!({ "request_id": request, "annotator": "Ana", "answers": answers }).to_string()
}

/// The individuals on the cards of a page, in order.
fn on_cards(page: &str) -> Vec<u64> {
    let cards = page
        .split("<article class=\"medoid behaviour\" data-index=\"")
        .skip(1);
    cards
        .map(|card| card.split('"').next().unwrap().parse().unwrap())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_taxonomy_outlives_learning_and_its_names_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let browser = Browser::at(&cluster);
    let id = cluster.create(&small_latent_spec(FEEDBACK)).await;
    cluster.finish(&id).await;
    let page = "/campaigns/small-1/taxonomy";
    let first = browser.page(page).await;
    assert!(!first.contains("Before and after"), "{first}");
    let changes = browser.page("/campaigns/small-1/taxonomy/changes").await;
    assert!(changes.contains("There is nothing to compare"), "{changes}");

    // All clusters have names. After learning, clusters of the new taxonomy have some of these names, and the page lists the
    // other names.
    let medoids = on_cards(&first);
    let names = ["ring", "wall hugger", "clump", "cloud"];
    let named: Vec<(u64, &str)> = medoids.iter().copied().zip(names).collect();
    assert_eq!(named.len(), 4);
    browser
        .tell("labels", &answers_of("a", &named), StatusCode::OK)
        .await;
    let request = v1::RefineCampaignRequest { campaign: id.clone() };
    cluster.client.refine_campaign(request).await.unwrap();
    cluster.finish(&id).await;

    let second = browser.page(page).await;
    let own = on_cards(&second)
        .iter()
        .filter(|index| medoids.contains(index))
        .count();
    let carried = second.matches("Carried over from behaviour").count();
    let lost = second.split("class=\"uncarried\"").nth(1).map_or(0, |rest| {
        let list = rest.split("</details>").next().unwrap();
        list.matches("<li>").count()
    });
    // Two clusters with the same medoid may have merged, and a name may be the medoid's own.
    assert!(
        own + carried + lost >= 4 && own + carried > 0,
        "{own} {carried} {lost} {second}"
    );
    // The service, the map and the page Progress show the same names.
    let told = cluster.taxonomy(&id).await.medoids;
    let progress = browser.page("/campaigns/small-1").await;
    let mut seen = 0;
    for (place, medoid) in told.iter().enumerate() {
        // Progress has one card for the clusters of a kind, and none for random ones.
        let number = format!("aria-hidden=\"true\">{}</span>", place + 1);
        let card = progress.split(&number).nth(1);
        let Some((card, name)) = card.zip(medoid.name.as_ref()) else {
            continue;
        };
        let heading = card.split("</h3>").next().unwrap();
        // Nobody has confirmed a name that was carried over.
        let shown = match name.carried {
            Some(_) => format!("{}?</span>", name.name),
            None => format!("<span>{}</span>", name.name),
        };
        assert!(heading.contains(&shown), "{shown} {heading}");
        seen += 1;
    }
    assert!(seen > 0, "{progress}");
    let from: Vec<u32> = told
        .iter()
        .filter_map(|medoid| Some(medoid.name.as_ref()?.carried.as_ref()?.version))
        .collect();
    assert_eq!(from, vec![1; carried]);
    let points = browser.get("/campaigns/small-1/points").await;
    let points = points.text().await.unwrap();
    let legend = points.matches("(carried over from version 1)").count();
    assert_eq!(legend, carried, "{points}");
    assert!(
        second.contains("Version 2 · after round 1 of learning"),
        "{second}"
    );

    // The former taxonomy is unchanged. Its page accepts no names.
    let former = browser.page(&format!("{page}?version=1")).await;
    // Names decide the order of the cards.
    let sorted = |mut indices: Vec<u64>| {
        indices.sort_unstable();
        indices
    };
    assert_eq!(sorted(on_cards(&former)), sorted(medoids));
    assert!(
        names
            .iter()
            .all(|name| former.contains(&format!("<span>{name}</span>"))),
        "{former}"
    );
    assert!(!former.contains("<form class=\"naming"), "{former}");
    let nowhere = browser.get(&format!("{page}?version=7")).await;
    assert_eq!(nowhere.status(), StatusCode::NOT_FOUND);

    let changes = browser.page("/campaigns/small-1/taxonomy/changes").await;
    for expected in [
        "<h2 id=\"maps\">Maps</h2>",
        "Accuracy on held-out triplets",
        "<td>100</td><td>120</td>",
        "The taxonomy now has 4 behaviours: ",
    ] {
        assert!(changes.contains(expected), "{expected} {changes}");
    }
    assert!(!changes.contains("not known"), "{changes}");
    for version in [1, 2] {
        let map = browser
            .get(&format!("{page}/map.png?version={version}&after=2"))
            .await;
        assert_eq!(map.headers()["content-type"], "image/png");
        let bytes = map.bytes().await.unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        assert_eq!(reader.info().width, 720);
    }
    let nowhere = browser.get(&format!("{page}/map.png?version=1&after=7")).await;
    assert_eq!(nowhere.status(), StatusCode::NOT_FOUND);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_medoid_is_tried_from_further_starts_and_downloaded() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let browser = Browser::at(&cluster);
    let id = cluster.create(&small_spec("")).await;
    cluster.finish(&id).await;
    let cards = browser.page("/campaigns/small-1/taxonomy").await;
    let index = on_cards(&cards)[0];
    // The judge names every card, with a question mark.
    assert_eq!(
        cards.matches("?</span><small>judge</small>").count(),
        4,
        "{cards}"
    );

    // Giving two clusters the same name merges them into one behaviour, except if the name is `random`.
    let [first, second] = [on_cards(&cards)[1], on_cards(&cards)[3]];
    for (request, name, merged) in [("a", "ring", true), ("b", "Random", false)] {
        let names = [(first, name), (second, name)];
        browser
            .tell("labels", &answers_of(request, &names), StatusCode::OK)
            .await;
        let page = browser.page("/campaigns/small-1/taxonomy").await;
        assert_eq!(page.contains("One behaviour in 2 clusters"), merged, "{page}");
    }

    let of = format!("/campaigns/small-1/individuals/{index}");
    let starts = browser.page(&format!("{of}/starts")).await;
    assert!(starts.contains(" of 20 starts: "), "{starts}");
    assert_eq!(starts.matches(&format!("{of}/starts/")).count(), 20);
    let mut pictures = Vec::new();
    for place in 0..20 {
        let picture = browser.get(&format!("{of}/starts/{place}")).await;
        assert_eq!(picture.headers()["content-type"], "image/png");
        pictures.push(picture.bytes().await.unwrap());
    }
    pictures.push(browser.get(&of).await.bytes().await.unwrap());
    pictures.sort();
    pictures.dedup();
    assert!(pictures.len() > 2, "all starts are the same");
    let nowhere = browser.get(&format!("{of}/starts/20")).await;
    assert_eq!(nowhere.status(), StatusCode::NOT_FOUND);
    assert_eq!(browser.page(&format!("{of}/starts")).await, starts);

    for (name, kind, begins, ending) in [
        ("motion.gif", "image/gif", &b"GIF89a"[..], "gif"),
        ("paths.svg", "image/svg+xml", b"<svg", "svg"),
    ] {
        let file = browser.get(&format!("{of}/{name}")).await;
        assert_eq!(file.headers()["content-type"], kind);
        let attached = format!("attachment; filename=\"small-1-individual-{index}.{ending}\"");
        assert_eq!(file.headers()["content-disposition"], attached);
        assert!(file.bytes().await.unwrap().starts_with(begins), "{name}");
    }
    let nowhere = browser.get("/campaigns/small-1/individuals/100/motion.gif").await;
    assert_eq!(nowhere.status(), StatusCode::NOT_FOUND);
    cluster.stop().await;
}
