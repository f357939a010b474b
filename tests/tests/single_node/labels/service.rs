//! Tests the label service with several clients at once.

use crate::labels::annotator::{Annotator, stands};
use murmuration_proto::{parts::whole, v1};
use murmuration_tests::{Cluster, small_spec};
use std::{collections::BTreeSet, time::Duration};
use tempfile::TempDir;
use tokio::task::JoinSet;
use tonic::{Code, Status};

/// A cluster with a completed campaign of 100 individuals, and two annotators.
async fn labelled(folder: &TempDir) -> (Cluster, Annotator, Annotator) {
    let mut cluster = Cluster::start(folder.path(), 2).await;
    cluster.run(&small_spec("")).await;
    let channel = cluster.channel().await;
    let [ana, ben] = ["ana", "ben"].map(|name| Annotator::of(name, &channel));
    (cluster, ana, ben)
}

fn undone_entries(undone: Vec<v1::LabelEntry>) -> Vec<u64> {
    undone.into_iter().filter_map(|entry| entry.supersedes).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_sent_twice_is_one_label_and_an_undo_restores_what_was_superseded() {
    let folder = tempfile::tempdir().unwrap();
    let (cluster, mut ana, mut ben) = labelled(&folder).await;
    assert_eq!(ana.say("1", &[(7, "ring"), (8, "skip")]).await.unwrap(), [0, 1]);
    assert_eq!(ana.say("1", &[(7, "ring"), (8, "skip")]).await.unwrap(), [0, 1]);
    ana.say("2", &[(7, "clump")]).await.unwrap();
    ben.say("3", &[(7, "wall")]).await.unwrap();
    let both = [(7, "ana", "clump"), (7, "ben", "wall"), (8, "ana", "skip")];
    assert_eq!(ana.standing().await, stands(&both));

    for _ in 0..2 {
        assert_eq!(undone_entries(ana.undo("4").await.unwrap()), [2]);
    }
    let restored = [(7, "ana", "ring"), (7, "ben", "wall"), (8, "ana", "skip")];
    assert_eq!(ana.standing().await, stands(&restored));
    assert_eq!(ana.log().await.len(), 5);

    let other = ana.say("1", &[(7, "clump")]).await.unwrap_err();
    assert_eq!(other.code(), Code::AlreadyExists, "{other}");
    assert_eq!(ana.standing().await, stands(&restored));

    // One undo reverts all answers of one request.
    let sheet: Vec<(u64, &str)> = (0..30).map(|index| (index, "wall")).collect();
    ana.say("5", &sheet).await.unwrap();
    for _ in 0..2 {
        let undone = undone_entries(ana.undo("6").await.unwrap());
        assert_eq!(undone, (5..35).rev().collect::<Vec<_>>());
    }
    assert_eq!(ana.standing().await, stands(&restored));
    let taken = ben.say("6", &[(7, "clump")]).await.unwrap_err();
    assert_eq!(taken.code(), Code::AlreadyExists, "{taken}");
    cluster.stop().await;

    // The label log belongs to the campaign, so another coordinator over the same data directory has this log.
    let cluster = Cluster::start(folder.path(), 0).await;
    let mut ana = Annotator::of("ana", &cluster.channel().await);
    assert_eq!(ana.standing().await, stands(&restored));
    cluster.stop().await;
}

/// The coordinator handles one long request at a time. Waiting requests must not fill the shared connection.
#[tokio::test(flavor = "multi_thread")]
async fn long_requests_on_one_connection_are_all_done() {
    let folder = tempfile::tempdir().unwrap();
    let (cluster, mut ana, ben) = labelled(&folder).await;
    let class = "a swarm that does as all the others do";
    let answers: Vec<(u64, &str)> = (0..2_000).map(|number| (number % 100, class)).collect();
    let mut requests = JoinSet::new();
    for number in 0..8 {
        let (mut ben, answers) = (ben.clone(), answers.clone());
        requests.spawn(async move { ben.say(&format!("long {number}"), &answers).await.unwrap().len() });
    }
    let all = tokio::time::timeout(Duration::from_secs(60), requests.join_all());
    assert_eq!(all.await.unwrap(), [2_000; 8]);
    assert_eq!(ana.log().await.len(), 16_000);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_takes_an_id_of_the_coordinators_own_requests() {
    use v1::change_class_request::Change;
    let folder = tempfile::tempdir().unwrap();
    let (cluster, mut ana, _) = labelled(&folder).await;
    ana.say("1", &[(0, "ring")]).await.unwrap();
    let before = ana.log().await;
    let create = Change::Create(v1::CreateClass {
        class: "wall".to_owned(),
    });
    for id in ["synthetic-round-1", " synthetic-round-9 ", "withdrawal"] {
        let refused = [
            ana.say(id, &[(1, "wall")]).await.err(),
            ana.undo(id).await.err(),
            ana.change(id, create.clone()).await.err(),
            ana.call_the_judge(id, 1).await.err(),
        ];
        for status in refused {
            let status = status.unwrap();
            assert_eq!(status.code(), Code::InvalidArgument, "{id}: {status}");
            assert!(status.message().starts_with("request_id = "), "{status}");
        }
        let url = cluster.url();
        for (page, body) in [
            ("labels", r#""answers":[{"index":1,"answer":"wall"}]"#),
            ("undo", ""),
            ("classes", r#""change":{"create":{"class":"wall"}}"#),
        ] {
            let comma = if body.is_empty() { "" } else { "," };
            let posted = murmuration_tests::http::client()
                .build()
                .unwrap()
                .post(format!("{url}/campaigns/small-1/{page}"))
                .header("origin", &url)
                .header("content-type", "application/json")
                .body(format!(
                    r#"{{"request_id":"{id}","annotator":"ana"{comma}{body}}}"#
                ));
            let answer = posted.send().await.unwrap();
            assert_eq!(answer.status(), 400, "{page}");
            let words = answer.text().await.unwrap();
            assert!(words.starts_with("request_id = "), "{page}: {words}");
        }
    }
    assert_eq!(ana.log().await, before);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_answers_as_the_synthetic_annotator() {
    use v1::change_class_request::Change;
    let folder = tempfile::tempdir().unwrap();
    let (cluster, mut ana, _) = labelled(&folder).await;
    ana.call_the_judge("1", 2).await.unwrap();
    let before = ana.log().await;
    let create = Change::Create(v1::CreateClass {
        class: "wall".to_owned(),
    });
    let channel = cluster.channel().await;
    for name in ["synthetic", " Synthetic", "syn thetic"] {
        let mut impostor = Annotator::of(name, &channel);
        let refused = [
            impostor.say("2", &[(0, "ring")]).await.err(),
            impostor.change("2", create.clone()).await.err(),
            impostor.ask(v1::QueryStrategy::Random, 1, false).await.err(),
        ];
        for status in refused {
            let status = status.unwrap();
            assert_eq!(status.code(), Code::InvalidArgument, "{name}: {status}");
            assert!(status.message().contains("a person's name"), "{status}");
        }
        let url = cluster.url();
        for (page, body) in [
            (
                "labels",
                r#""request_id":"2","answers":[{"index":0,"answer":"ring"}]"#,
            ),
            (
                "classes",
                r#""request_id":"2","change":{"create":{"class":"wall"}}"#,
            ),
            (
                "questions",
                r#""session":"1","strategy":"random","count":1,"agreement":false,"again":[]"#,
            ),
        ] {
            let posted = murmuration_tests::http::client()
                .build()
                .unwrap()
                .post(format!("{url}/campaigns/small-1/{page}"))
                .header("origin", &url)
                .header("content-type", "application/json")
                .body(format!(r#"{{"annotator":"{name}",{body}}}"#));
            let answer = posted.send().await.unwrap();
            assert_eq!(answer.status(), 400, "{page}");
            let words = answer.text().await.unwrap();
            assert!(words.contains("a person's name"), "{page}: {words}");
        }
    }
    assert_eq!(ana.log().await, before);
    // The synthetic annotator's answers can be undone.
    let mut judge = Annotator::of("synthetic", &channel);
    assert_eq!(undone_entries(judge.undo("3").await.unwrap()), [1, 0]);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_said_has_a_status_and_leaves_nothing() {
    use v1::change_class_request::Change;
    let folder = tempfile::tempdir().unwrap();
    let (cluster, mut ana, mut ben) = labelled(&folder).await;
    ana.say("1", &[(0, "ring"), (1, "clump")]).await.unwrap();
    let before = ana.log().await;
    let refused = [
        (
            ana.say("2", &[(0, "wall"), (100, "wall")]).await.err(),
            Code::NotFound,
        ),
        (ana.say("2", &[(0, "a\nb")]).await.err(), Code::InvalidArgument),
        (ana.say("2", &[]).await.err(), Code::InvalidArgument),
        (ana.say("", &[(0, "wall")]).await.err(), Code::InvalidArgument),
        (ben.undo("2").await.err(), Code::FailedPrecondition),
        (
            ana.ask(v1::QueryStrategy::Unspecified, 1, false).await.err(),
            Code::InvalidArgument,
        ),
        (
            ana.ask(v1::QueryStrategy::Random, 0, false).await.err(),
            Code::InvalidArgument,
        ),
    ];
    for (error, code) in refused {
        assert_eq!(error.as_ref().map(Status::code), Some(code), "{error:?}");
    }
    let rename = |class: &str, to: &str| {
        let (class, to) = (class.to_owned(), to.to_owned());
        Change::Rename(v1::RenameClass { class, to })
    };
    let merge = |class: &str, into: &str| {
        let (class, into) = (class.to_owned(), into.to_owned());
        Change::Merge(v1::MergeClass { class, into })
    };
    for (change, code) in [
        (rename("wall", "x"), Code::NotFound),
        (rename("ring", "clump"), Code::AlreadyExists),
        (rename("ring", "skip"), Code::InvalidArgument),
        (merge("ring", "ring"), Code::InvalidArgument),
    ] {
        let error = ana.change("2", change).await.unwrap_err();
        assert_eq!(error.code(), code, "{error}");
    }
    assert_eq!(ana.log().await, before);
    for _ in 0..2 {
        assert_eq!(ana.change("2", merge("ring", "clump")).await.unwrap(), ["clump"]);
    }
    assert_eq!(
        ana.standing().await,
        stands(&[(0, "ana", "clump"), (1, "ana", "clump")])
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_is_asked_what_another_is_asked_and_nothing_is_asked_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (cluster, ana, ben) = labelled(&folder).await;
    let ask_until_nothing_is_left = async |mut who: Annotator, strategy: v1::QueryStrategy| {
        let mut asked = Vec::new();
        loop {
            let queries = who.ask(strategy, 4, false).await.unwrap();
            let Some(&first) = queries.first() else {
                return asked;
            };
            asked.push(first);
            let request = format!("{}-{first}", who.name);
            who.say(&request, &[(first, "ring")]).await.unwrap();
        }
    };
    let (anas, bens) = tokio::join!(
        ask_until_nothing_is_left(ana.clone(), v1::QueryStrategy::Medoids),
        ask_until_nothing_is_left(ben.clone(), v1::QueryStrategy::Random),
    );
    let together: BTreeSet<u64> = anas.iter().chain(&bens).copied().collect();
    assert_eq!((together.len(), anas.len() + bens.len()), (100, 100));

    // To measure agreement, the coordinator asks each annotator about individuals that the other annotator has answered.
    let mut ana = ana;
    let queries = ana.ask(v1::QueryStrategy::Medoids, 100, true).await.unwrap();
    let queries: BTreeSet<u64> = queries.into_iter().collect();
    assert_eq!(queries, bens.into_iter().collect());
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn medoids_are_those_of_the_taxonomy_and_stay_with_who_asked() {
    let folder = tempfile::tempdir().unwrap();
    let (mut cluster, mut ana, mut ben) = labelled(&folder).await;
    let request = v1::GetTaxonomyRequest {
        campaign: "latest".to_owned(),
    };
    let taxonomy = cluster.client.get_taxonomy(request).await.unwrap();
    let taxonomy = whole(taxonomy.into_inner()).await.unwrap();
    let individuals = taxonomy
        .medoids
        .into_iter()
        .filter_map(|medoid| medoid.individual);
    let medoids: Vec<u64> = individuals.map(|individual| individual.index).collect();
    for _ in 0..2 {
        assert_eq!(
            ana.ask(v1::QueryStrategy::Medoids, 4, false).await.unwrap(),
            medoids
        );
    }
    let others = ben.ask(v1::QueryStrategy::Medoids, 4, false).await.unwrap();
    assert!(others.len() == 4 && others.iter().all(|index| !medoids.contains(index)));
    cluster.stop().await;
}
