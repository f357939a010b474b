//! What people say about behaviours: kept once it is acknowledged, said once however often it is sent, asked once
//! whoever asks.

use murmuration_proto::v1::{self, label_service_client::LabelServiceClient};
use murmuration_tests::{Cluster, Finished, Murmuration, Running, small_spec};
use serde_json::Value;
use std::{collections::BTreeSet, fs, path::Path};
use tempfile::TempDir;
use tonic::{Code, Status, transport::Channel};

/// A client of a campaign's labels.
#[derive(Clone)]
struct Annotator {
    name: &'static str,
    client: LabelServiceClient<Channel>,
}

impl Annotator {
    fn of(name: &'static str, channel: &Channel) -> Self {
        Self {
            name,
            client: LabelServiceClient::new(channel.clone()),
        }
    }

    async fn say(&mut self, request_id: &str, answers: &[(u64, &str)]) -> Result<Vec<u64>, Status> {
        let answer = |(index, answer): &(u64, &str)| v1::Answer {
            index: *index,
            answer: (*answer).to_owned(),
            time_ms: 0,
            annotator: self.name.to_owned(),
        };
        let request = v1::AppendLabelsRequest {
            campaign: "latest".to_owned(),
            request_id: request_id.to_owned(),
            answers: answers.iter().map(answer).collect(),
        };
        let added = self.client.append_labels(request).await?.into_inner();
        Ok(added.entries.iter().map(|entry| entry.number).collect())
    }

    async fn undo(&mut self, request_id: &str) -> Result<v1::LabelEntry, Status> {
        let request = v1::UndoLabelRequest {
            campaign: "latest".to_owned(),
            request_id: request_id.to_owned(),
            annotator: self.name.to_owned(),
        };
        Ok(self.client.undo_label(request).await?.into_inner())
    }

    /// What stands: individual, annotator, class.
    async fn standing(&mut self) -> Vec<(u64, String, String)> {
        let request = v1::ListLabelsRequest {
            campaign: "latest".to_owned(),
        };
        let labels = self
            .client
            .list_labels(request)
            .await
            .unwrap()
            .into_inner()
            .labels;
        let answers = labels.into_iter().filter_map(|label| label.answer);
        answers
            .map(|answer| (answer.index, answer.annotator, answer.answer))
            .collect()
    }

    async fn log(&mut self) -> Vec<v1::LabelEntry> {
        let request = v1::ListLabelEntriesRequest {
            campaign: "latest".to_owned(),
        };
        let log = self.client.list_label_entries(request).await;
        log.unwrap().into_inner().entries
    }

    async fn ask(
        &mut self,
        strategy: v1::QueryStrategy,
        count: u32,
        agreement: bool,
    ) -> Result<Vec<u64>, Status> {
        let request = v1::NextQueriesRequest {
            campaign: "latest".to_owned(),
            annotator: self.name.to_owned(),
            session: String::new(),
            strategy: strategy as i32,
            count,
            agreement,
            again: Vec::new(),
        };
        let asked = self.client.next_queries(request).await?.into_inner();
        assert_eq!(asked.individuals, 100);
        assert!(asked.queries.iter().all(|query| !query.reason.is_empty()));
        Ok(asked.queries.iter().map(|query| query.index).collect())
    }

    async fn change(
        &mut self,
        request_id: &str,
        change: v1::change_class_request::Change,
    ) -> Result<Vec<String>, Status> {
        let request = v1::ChangeClassRequest {
            campaign: "latest".to_owned(),
            request_id: request_id.to_owned(),
            annotator: self.name.to_owned(),
            change: Some(change),
        };
        let classes = self.client.change_class(request).await?.into_inner().classes;
        Ok(classes.into_iter().map(|class| class.name).collect())
    }
}

fn stands(said: &[(u64, &str, &str)]) -> Vec<(u64, String, String)> {
    let owned = |(index, who, answer): &(u64, &str, &str)| (*index, (*who).to_owned(), (*answer).to_owned());
    said.iter().map(owned).collect()
}

/// A cluster with a completed campaign of 100 individuals, and two who label them.
async fn labelled(folder: &TempDir) -> (Cluster, Annotator, Annotator) {
    let mut cluster = Cluster::start(folder.path(), 2).await;
    cluster.run(&small_spec("")).await;
    let channel = cluster.channel().await;
    let [ana, ben] = ["ana", "ben"].map(|name| Annotator::of(name, &channel));
    (cluster, ana, ben)
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
        assert_eq!(ana.undo("4").await.unwrap().supersedes, Some(2));
    }
    let restored = [(7, "ana", "ring"), (7, "ben", "wall"), (8, "ana", "skip")];
    assert_eq!(ana.standing().await, stands(&restored));
    assert_eq!(ana.log().await.len(), 5);

    let other = ana.say("1", &[(7, "clump")]).await.unwrap_err();
    assert_eq!(other.code(), Code::AlreadyExists, "{other}");
    assert_eq!(ana.standing().await, stands(&restored));
    cluster.stop().await;

    // The log is the campaign's: another coordinator over the same directory knows it.
    let cluster = Cluster::start(folder.path(), 0).await;
    let mut ana = Annotator::of("ana", &cluster.channel().await);
    assert_eq!(ana.standing().await, stands(&restored));
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
        (
            ana.ask(v1::QueryStrategy::Committee, 1, false).await.err(),
            Code::FailedPrecondition,
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

    // For agreement, each is asked what the other has answered.
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
    let taxonomy = cluster.client.get_taxonomy(request).await.unwrap().into_inner();
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

fn serve(murmuration: &Murmuration) -> (Running, String) {
    let mut coordinator = murmuration.start(&["serve", "--workers", "0", "--listen", "127.0.0.1:0"]);
    let said = coordinator.wait_for("serving");
    let url = said.rsplit(' ').next().unwrap().to_owned();
    (coordinator, url)
}

/// A data directory with a completed campaign of 100 individuals, and a folder beside it.
fn campaign() -> (TempDir, Murmuration) {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("small.toml");
    fs::write(&spec, small_spec("").to_toml()).unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let run = murmuration.run(&["run", &spec.display().to_string()]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    (folder, murmuration)
}

#[tokio::test(flavor = "multi_thread")]
async fn killed_right_after_it_acknowledged_a_label_the_coordinator_still_knows_it() {
    let (_folder, murmuration) = campaign();
    let (mut coordinator, mut url) = serve(&murmuration);
    let mut said = Vec::new();
    for round in 0..5u64 {
        let channel = Channel::from_shared(url).unwrap().connect().await.unwrap();
        let mut ana = Annotator::of("ana", &channel);
        let (request, index) = (round.to_string(), round * 7);
        ana.say(&request, &[(index, "ring")]).await.unwrap();
        coordinator.kill();
        said.push((index, "ana", "ring"));

        (coordinator, url) = serve(&murmuration);
        let channel = Channel::from_shared(url.clone())
            .unwrap()
            .connect()
            .await
            .unwrap();
        let mut ana = Annotator::of("ana", &channel);
        assert_eq!(ana.standing().await, stands(&said));
        // Who heard no answer sends it again.
        assert_eq!(ana.say(&request, &[(index, "ring")]).await.unwrap(), [round]);
        assert_eq!(ana.log().await.len() as u64, round + 1);
    }
}

fn lines(finished: &Finished) -> Vec<Value> {
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    let lines = finished.stdout.lines();
    lines.map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn labels_go_through_files_unchanged() {
    let (folder, murmuration) = campaign();
    let text = "id,class,annotator,time\n3,ring,ana,1700000000000\n3,\"clump, loose\",ben,1700000000001\n\
                4,not sure,ana,1700000000002\n99,skip,ana,1700000000003\n";
    let file = write(folder.path(), "mine.csv", text);
    let added = lines(&murmuration.run(&["label", "latest", "--csv", &file, "--json"]));
    assert_eq!(added[0]["added"], 4);
    let out = folder.path().join("out.csv").display().to_string();
    let exported = murmuration.run(&["labels", "latest", "--csv", &out, "--json"]);
    assert_eq!(fs::read_to_string(&out).unwrap(), text);
    let labels = lines(&exported);
    assert_eq!(
        (&labels[1]["class"], &labels[1]["annotator"]),
        (&"clump, loose".into(), &"ben".into())
    );

    // In another campaign the same file comes to the same labels.
    let spec = folder.path().join("small.toml").display().to_string();
    assert_eq!(murmuration.run(&["run", &spec]).code, Some(0));
    let again = lines(&murmuration.run(&["label", "small-2", "--csv", &out, "--json"]));
    assert_eq!(again[0]["label_digest"], added[0]["label_digest"]);
    let out = folder.path().join("again.csv").display().to_string();
    assert_eq!(
        murmuration.run(&["labels", "small-2", "--csv", &out]).code,
        Some(0)
    );
    assert_eq!(fs::read_to_string(&out).unwrap(), text);
}

#[test]
fn a_file_with_a_bad_row_is_refused_whole_and_its_line_named() {
    let (folder, murmuration) = campaign();
    for (rows, said) in [
        ("1,ring,ana,\n2,ring,ana,soon\n", "line 3: time"),
        (
            "1,ring,ana,\n\n100,ring,ana,\n",
            "line 4: id = 100: must be the index of one of the 100",
        ),
        ("1,ring,,\n", "line 2: annotator = nothing"),
    ] {
        let file = write(
            folder.path(),
            "bad.csv",
            &format!("id,class,annotator,time\n{rows}"),
        );
        let refused = murmuration.run(&["label", "latest", "--csv", &file]);
        assert!(
            refused.code == Some(2) && refused.stderr.contains(said),
            "{}",
            refused.stderr
        );
    }
    let listed = murmuration.run(&["labels", "latest", "--json"]);
    assert_eq!(lines(&listed), [] as [Value; 0]);
}

#[test]
fn classes_and_agreement_on_the_command_line() {
    let (folder, murmuration) = campaign();
    let file = write(
        folder.path(),
        "ana.csv",
        "id,class\n1,ring\n2,ring\n3,clump\n4,clump\n",
    );
    lines(&murmuration.run(&["label", "latest", "--csv", &file, "--annotator", "ana", "--json"]));
    let file = write(
        folder.path(),
        "ben.csv",
        "id,class\n1,ring\n2,clump\n3,clump\n4,blob\n5,ring\n",
    );
    lines(&murmuration.run(&["label", "latest", "--csv", &file, "--annotator", "ben", "--json"]));

    let classes = |arguments: &[&str]| -> Vec<(String, u64)> {
        let command = [&["classes", "latest", "--json"], arguments].concat();
        let classes = lines(&murmuration.run(&command)).into_iter();
        let read = |class: Value| {
            let name = class["class"].as_str().unwrap().to_owned();
            (name, class["labels"].as_u64().unwrap())
        };
        classes.map(read).collect()
    };
    let named = |classes: &[(&str, u64)]| -> Vec<(String, u64)> {
        let owned = |(name, labels): &(&str, u64)| ((*name).to_owned(), *labels);
        classes.iter().map(owned).collect()
    };
    assert_eq!(classes(&[]), named(&[("ring", 4), ("clump", 4), ("blob", 1)]));
    assert_eq!(
        classes(&["--merge", "blob", "clump"]),
        named(&[("ring", 4), ("clump", 5)])
    );
    assert_eq!(
        classes(&["--rename", "ring", "milling"]),
        named(&[("milling", 4), ("clump", 5)])
    );
    classes(&["--colour", "milling", "#010203"]);
    let table = murmuration.run(&["classes", "latest"]).stdout;
    assert!(table.contains("#010203"), "{table}");

    // ana: milling, milling, clump, clump; ben: milling, clump, clump, clump. 3/4 observed, 1/2 by chance.
    let agreement = ["agreement", "latest", "--annotators", "ana", "ben", "--json"];
    let agreement = &lines(&murmuration.run(&agreement))[0];
    assert_eq!(
        (&agreement["both"], &agreement["kappa"]),
        (&4.into(), &0.5.into())
    );
    assert_eq!(agreement["disagreements"][0]["index"], 2);

    let wrong = [
        (
            vec!["classes", "latest", "--rename", "ring", "x"],
            "there is no class \"ring\"",
        ),
        (
            vec!["classes", "latest", "--colour", "clump", "blue"],
            "six hexadecimal digits",
        ),
        (
            vec!["classes", "latest", "--rename", "a", "b", "--merge", "a", "b"],
            "cannot be used with",
        ),
        (vec!["labels", "nobody-1"], "there is no campaign"),
    ];
    for (arguments, said) in wrong {
        let refused = murmuration.run(&arguments);
        assert!(
            refused.code == Some(2) && refused.stderr.contains(said),
            "{}",
            refused.stderr
        );
    }
}
