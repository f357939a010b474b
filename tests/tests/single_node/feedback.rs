//! Tests feedback: labels, an embedder fine-tuned on these labels, and a search that continues with this embedder.

use murmuration_proto::{
    parts::whole,
    v1::{
        self, checkpoint_service_client::CheckpointServiceClient, label_service_client::LabelServiceClient,
    },
};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, small_latent_spec, small_spec};
use tonic::{Code, Status, transport::Channel};

const FEEDBACK: &str =
    "[feedback]\ngenerations = 2\nlabels = 40\n[feedback.recipe.labelled]\nepochs = 2\nsteps = 4";

fn taught(rounds: u32) -> CampaignSpec {
    small_latent_spec(&FEEDBACK.replace("[feedback]", &format!("[feedback]\nrounds = {rounds}")))
}

async fn labels(cluster: &Cluster) -> LabelServiceClient<Channel> {
    LabelServiceClient::connect(cluster.url()).await.unwrap()
}

async fn checkpoint(cluster: &Cluster, digest: &str) -> v1::Checkpoint {
    let mut client = CheckpointServiceClient::connect(cluster.url()).await.unwrap();
    let request = v1::GetCheckpointRequest {
        digest: digest.to_owned(),
    };
    client.get_checkpoint(request).await.unwrap().into_inner()
}

async fn refine(cluster: &mut Cluster, campaign: &str) -> Result<v1::Campaign, Status> {
    let request = v1::RefineCampaignRequest {
        campaign: campaign.to_owned(),
    };
    Ok(cluster.client.refine_campaign(request).await?.into_inner())
}

async fn completed(cluster: &mut Cluster, campaign: &str) -> v1::Campaign {
    let last = cluster.finish(campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    last
}

/// Labels the first individuals as the annotator `ana`. These tests do not depend on the individuals' behaviours.
async fn label(cluster: &Cluster, request_id: &str, classes: &[&str]) {
    let answers = classes.iter().zip(0..).map(|(class, index)| v1::Answer {
        index,
        answer: (*class).to_owned(),
        time_ms: 1,
        annotator: "ana".to_owned(),
    });
    let request = v1::AppendLabelsRequest {
        campaign: "latest".to_owned(),
        request_id: request_id.to_owned(),
        answers: answers.collect(),
    };
    labels(cluster).await.append_labels(request).await.unwrap();
}

/// The coordinator's description of how to reproduce the archive of a campaign.
async fn repetition(cluster: &mut Cluster, campaign: &str) -> v1::GetDigestResponse {
    let request = v1::GetDigestRequest {
        campaign: campaign.to_owned(),
    };
    cluster.client.get_digest(request).await.unwrap().into_inner()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unattended_campaign_labels_learns_and_searches_on_whatever_the_cluster() {
    let mut outcomes = Vec::new();
    for workers in [1, 3] {
        let folder = tempfile::tempdir().unwrap();
        let mut cluster = Cluster::start(folder.path(), workers).await;
        let id = cluster.create(&taught(2)).await;
        let last = completed(&mut cluster, &id).await;
        assert_eq!(
            (last.rounds_done, last.generations_done, last.generations),
            (2, 9, 9)
        );
        let request = v1::ListLabelsRequest { campaign: id.clone() };
        let labels = labels(&cluster).await.list_labels(request).await.unwrap();
        let labels = whole(labels.into_inner()).await.unwrap();
        assert_eq!(labels.labels.len(), 80);

        // The second round fine-tunes the checkpoint of the first round; the first round fine-tunes the pretrained checkpoint.
        let second = checkpoint(&cluster, &last.checkpoint).await;
        let first = checkpoint(&cluster, &second.parent).await;
        let pretrained = checkpoint(&cluster, &first.parent).await;
        assert_eq!((second.metrics["labels"], first.metrics["labels"]), (80.0, 40.0));
        // Each labelled controller is simulated from four starts.
        assert_eq!(second.metrics["labelled_pictures"], 320.0);
        assert!(pretrained.parent.is_empty() && pretrained.label_digest.is_empty());
        assert_ne!(first.label_digest, second.label_digest);
        // The specification suffices to reproduce the archive.
        let takes = repetition(&mut cluster, &id).await;
        assert_eq!(
            (takes.attended, takes.adopted, takes.rounds.len()),
            (false, false, 2)
        );
        assert_eq!(takes.rounds[0].parent, pretrained.digest);
        assert_eq!(
            (takes.rounds[1].labels, &takes.rounds[1].label_digest),
            (80, &second.label_digest)
        );
        outcomes.push((last.checkpoint, labels.digest, cluster.digest(&id).await));
        cluster.stop().await;
    }
    assert_eq!(outcomes[0], outcomes[1]);
}

#[tokio::test(flavor = "multi_thread")]
async fn people_teach_as_often_as_they_like() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let id = cluster.create(&taught(0)).await;
    let pretrained = completed(&mut cluster, &id).await;
    assert_eq!((pretrained.rounds_done, pretrained.generations_done), (0, 5));
    let takes = repetition(&mut cluster, &id).await;
    assert_eq!(
        (takes.attended, takes.adopted, takes.rounds.len()),
        (false, false, 0)
    );

    let refused = refine(&mut cluster, &id).await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    assert!(
        refused
            .message()
            .contains("name 0 classes, and learning takes at least 2"),
        "{refused}"
    );
    label(&cluster, "one", &["ring"; 8]).await;
    let refused = refine(&mut cluster, &id).await.unwrap_err();
    assert!(
        refused
            .message()
            .contains("name 1 class, and learning takes at least 2"),
        "{refused}"
    );
    let now = v1::Campaign {
        toml: None,
        ..cluster.status(&id).await
    };
    assert_eq!(now, pretrained);

    label(
        &cluster,
        "two",
        &["ring", "clump", "ring", "clump", "ring", "clump"],
    )
    .await;
    let begun = refine(&mut cluster, &id).await.unwrap();
    assert_eq!(begun.state(), v1::CampaignState::Running);
    let taught = completed(&mut cluster, &id).await;
    assert_eq!((taught.rounds_done, taught.generations_done), (1, 7));
    let lineage = checkpoint(&cluster, &taught.checkpoint).await;
    assert_eq!(lineage.parent, pretrained.checkpoint);
    assert_eq!(
        (lineage.metrics["labels"], lineage.metrics["classes"]),
        (8.0, 2.0)
    );

    let takes = repetition(&mut cluster, &id).await;
    assert_eq!(
        (takes.attended, takes.adopted, takes.rounds.len()),
        (true, false, 1)
    );
    let round = &takes.rounds[0];
    assert_eq!(
        (&round.parent, &round.checkpoint, round.labels),
        (&pretrained.checkpoint, &taught.checkpoint, 8)
    );

    refine(&mut cluster, "latest").await.unwrap();
    let again = completed(&mut cluster, &id).await;
    assert_eq!((again.rounds_done, again.generations_done), (2, 9));
    assert_eq!(
        checkpoint(&cluster, &again.checkpoint).await.parent,
        taught.checkpoint
    );

    // The campaign goes back to a behaviour space that is neither the specification's nor the last round's.
    let request = v1::AdoptCheckpointRequest {
        campaign: id.clone(),
        checkpoint: taught.checkpoint,
    };
    cluster.client.adopt_checkpoint(request).await.unwrap();
    completed(&mut cluster, &id).await;
    assert!(repetition(&mut cluster, &id).await.adopted);
    cluster.stop().await;
}

/// The most frequent class among the five nearest labelled individuals. If two classes are equally frequent, the class of the
/// nearer individual.
fn elected(archive: &[v1::Individual], classes: &[&str], place: usize) -> String {
    if let Some(own) = classes.get(place) {
        return (*own).to_owned();
    }
    let squared = |other: usize| -> f64 {
        let pairs = archive[place].embedding.iter().zip(&archive[other].embedding);
        pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    let mut voters: Vec<usize> = (0..classes.len()).collect();
    voters.sort_by(|&one, &other| squared(one).total_cmp(&squared(other)));
    voters.truncate(5);
    let votes = |class: &str| voters.iter().filter(|&&voter| classes[voter] == class).count();
    let most = voters.iter().rev().max_by_key(|&&voter| votes(classes[voter]));
    classes[*most.unwrap()].to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn each_class_that_was_learned_has_a_medoid_where_the_specification_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let mut table: toml::Table = taught(0).to_toml().parse().unwrap();
    table["taxonomy"]
        .as_table_mut()
        .unwrap()
        .insert("choose".into(), "by-class".into());
    table.insert("space".into(), "embedding".into());
    let spec = CampaignSpec::from_toml(&toml::to_string(&table).unwrap()).unwrap();
    let id = cluster.create(&spec).await;
    completed(&mut cluster, &id).await;
    // Each of the last three classes has only one individual.
    let mut classes = vec!["ring"; 17];
    classes.extend(["wall", "clump", "gap"]);
    label(&cluster, "all", &classes).await;
    refine(&mut cluster, &id).await.unwrap();
    completed(&mut cluster, &id).await;

    let archive = cluster.archive(&id).await;
    let taxonomy = cluster.taxonomy(&id).await;
    let medoids = taxonomy.medoids.iter().flat_map(|medoid| &medoid.individual);
    let elected = medoids.map(|medoid| elected(&archive, &classes, medoid.index as usize));
    let elected: std::collections::BTreeSet<String> = elected.collect();
    assert_eq!(
        elected,
        ["clump", "gap", "ring", "wall"].map(str::to_owned).into()
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_trained_elsewhere_is_taught_on_the_pictures_of_the_archive() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let id = cluster.create(&taught(0)).await;
    let published = completed(&mut cluster, &id).await.checkpoint;
    let mut table: toml::Table = taught(1).to_toml().parse().unwrap();
    table.remove("training");
    table.remove("dataset");
    table.insert("checkpoint".into(), published.clone().into());
    let spec = CampaignSpec::from_toml(&toml::to_string(&table).unwrap()).unwrap();
    let id = cluster.create(&spec).await;
    let last = completed(&mut cluster, &id).await;
    let lineage = checkpoint(&cluster, &last.checkpoint).await;
    assert_eq!(
        (lineage.parent, lineage.metrics["behaviours"]),
        (published.clone(), 100.0)
    );
    let takes = repetition(&mut cluster, &id).await;
    assert_eq!(
        (takes.attended, takes.adopted, takes.rounds.len()),
        (false, false, 1)
    );
    assert_eq!(takes.rounds[0].parent, published);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_judge_labels_when_asked_and_once_for_a_request() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let id = cluster.create(&small_spec("")).await;
    completed(&mut cluster, &id).await;
    let refused = refine(&mut cluster, &id).await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    assert!(
        refused.message().contains("behaviour space is \"features\""),
        "{refused}"
    );

    let mut labels = labels(&cluster).await;
    let mut ask = async |request_id: &str, count| {
        let request = v1::AppendSyntheticLabelsRequest {
            campaign: id.clone(),
            request_id: request_id.to_owned(),
            strategy: v1::QueryStrategy::Medoids as i32,
            count,
        };
        let added = labels.append_synthetic_labels(request).await;
        Ok::<_, Status>(whole(added?.into_inner()).await?.entries)
    };
    assert_eq!(ask("a", 0).await.unwrap_err().code(), Code::InvalidArgument);
    let first = ask("a", 60).await.unwrap();
    assert_eq!(first.len(), 60);
    assert!(first.iter().all(|entry| entry.annotator == "synthetic"));
    assert_eq!(ask("a", 60).await.unwrap(), first);
    // The coordinator does not ask about labelled individuals again: 40 of the 100 individuals are left.
    assert_eq!(ask("b", 60).await.unwrap().len(), 40);
    assert!(ask("c", 60).await.unwrap().is_empty());
    // The coordinator refuses a request with another person's request id.
    let request = v1::AppendLabelsRequest {
        campaign: id.clone(),
        request_id: "ana's".to_owned(),
        answers: vec![v1::Answer {
            index: 0,
            answer: "milling".to_owned(),
            time_ms: 1,
            annotator: "ana".to_owned(),
        }],
    };
    let mut person = self::labels(&cluster).await;
    person.append_labels(request).await.unwrap();
    assert_eq!(ask("ana's", 60).await.unwrap_err().code(), Code::AlreadyExists);
    cluster.stop().await;
}
