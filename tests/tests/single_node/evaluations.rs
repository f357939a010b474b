//! Tests evaluations for searches that run outside the coordinator. A worker evaluates such controllers as in a campaign, but the
//! coordinator does not store the results.

use murmuration_proto::{
    parts::whole,
    v1::{
        self, evaluate_request::Part, evaluation_description::Campaign,
        evaluation_service_client::EvaluationServiceClient,
    },
};
use murmuration_swarm::start_seed;
use murmuration_tests::{Cluster, small_latent_spec, small_spec};
use tonic::{Code, Status};

fn described(campaign: Option<Campaign>) -> Part {
    Part::Description(v1::EvaluationDescription {
        campaign,
        pictures: true,
        seed: None,
    })
}

fn controllers(tasks: Vec<v1::EvaluationTask>) -> Part {
    Part::Controllers(v1::ControllersToEvaluate { tasks })
}

/// Sends a stream of requests; returns the results.
async fn evaluate(cluster: &Cluster, parts: Vec<Part>) -> Result<Vec<v1::EvaluateResult>, Status> {
    let requests = parts.into_iter();
    let requests = requests.map(|part| v1::EvaluateRequest { part: Some(part) });
    let mut client = EvaluationServiceClient::new(cluster.channel().await);
    let requests: Vec<_> = requests.collect();
    let mut responses = client.evaluate(tokio_stream::iter(requests)).await?.into_inner();
    let mut results = Vec::new();
    while let Some(response) = responses.message().await? {
        results.extend(response.results);
    }
    Ok(results)
}

fn task(individual: &v1::Individual) -> v1::EvaluationTask {
    v1::EvaluationTask {
        controller: individual.controller.clone(),
        seed: individual.seed,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_controllers_of_an_archive_have_the_same_features_and_pictures_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 2).await;
    let spec = small_spec("");
    let campaign = cluster.create(&spec).await;
    cluster.finish(&campaign).await;
    let archive = cluster.archive(&campaign).await;
    // The requests have different lengths, and there are more requests than the coordinator handles at once.
    let tasks: Vec<_> = archive.iter().map(task).collect();
    let mut parts = vec![described(Some(Campaign::Spec((&spec).into())))];
    let (mut rest, mut length) = (&tasks[..], 1);
    while !rest.is_empty() {
        let (now, later) = rest.split_at(length.min(rest.len()));
        parts.push(controllers(now.to_vec()));
        (rest, length) = (later, length + 1);
    }
    assert!(parts.len() > 6);
    let results = evaluate(&cluster, parts).await.unwrap();
    assert_eq!(results.len(), archive.len());
    for (result, individual) in results.iter().zip(&archive) {
        let [trial] = &result.trials[..] else {
            panic!("{} trials", result.trials.len())
        };
        assert_eq!(trial.features, individual.features);
        assert_eq!(Some(&trial.image), individual.image.as_ref());
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn embeddings_are_those_of_the_checkpoint_that_is_named_and_of_every_start() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let campaign = cluster.create(&small_latent_spec("")).await;
    cluster.finish(&campaign).await;
    let archive = cluster.archive(&campaign).await;
    let checkpoint = cluster.status(&campaign).await.checkpoint;
    let mut table: toml::Table = small_latent_spec("").to_toml().parse().unwrap();
    for trained in ["dataset", "training"] {
        table.remove(trained);
    }
    let given = format!("checkpoint = \"{checkpoint}\"\nevaluation.starts = 2");
    table.extend(given.parse::<toml::Table>().unwrap());
    let text = toml::to_string(&table).unwrap();
    let parts = vec![
        described(Some(Campaign::Toml(text))),
        controllers(archive[..3].iter().map(task).collect()),
    ];
    let results = evaluate(&cluster, parts).await.unwrap();
    for (result, individual) in results.iter().zip(&archive) {
        assert_eq!(result.trials.len(), 2);
        assert_eq!(result.trials[0].embedding, individual.embedding);
        assert_ne!(result.trials[1].embedding, individual.embedding);
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn seeds_derive_from_one_across_requests() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    let of_one = v1::EvaluationTask {
        controller: vec![-0.7, 0.3, 1.0, 1.0],
        seed: 77,
    };
    let describe = |seed| {
        Part::Description(v1::EvaluationDescription {
            campaign: Some(Campaign::Spec((&small_spec("")).into())),
            pictures: false,
            seed,
        })
    };
    let two = controllers(vec![of_one.clone(); 2]);
    let one = controllers(vec![of_one]);
    let derived = evaluate(&cluster, vec![describe(Some(5)), two.clone(), one.clone()])
        .await
        .unwrap();
    let seeds = |results: &[v1::EvaluateResult]| results.iter().map(|result| result.seed).collect::<Vec<_>>();
    assert_eq!(seeds(&derived), [0, 1, 2].map(|number| start_seed(5, number)));
    assert_ne!(derived[0].trials, derived[2].trials);
    let given = evaluate(&cluster, vec![describe(None), one]).await.unwrap();
    assert_eq!(seeds(&given), [77]);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_evaluated_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    let spec = || described(Some(Campaign::Spec((&small_spec("")).into())));
    let toml = |text: &str| described(Some(Campaign::Toml(text.to_owned())));
    let one = |controller: &[f64]| v1::EvaluationTask {
        controller: controller.to_vec(),
        seed: 1,
    };
    let good = one(&[0.1, 0.2, 0.3, 0.4]);
    let cases = [
        (vec![], "description"),
        (vec![controllers(vec![good.clone()])], "description"),
        (vec![described(None)], "campaign"),
        (vec![toml("name = 1")], "line 1"),
        (
            vec![toml(
                "name = \"x\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n",
            )],
            "checkpoint",
        ),
        (vec![spec(), spec()], "every request but the first"),
        (vec![spec(), controllers(vec![])], "1 to 1024"),
        (vec![spec(), controllers(vec![good.clone(); 1025])], "1 to 1024"),
        (
            vec![spec(), controllers(vec![good.clone(), one(&[0.1, 0.2])])],
            "controllers[1]",
        ),
        (
            vec![
                spec(),
                controllers(vec![good.clone(); 2]),
                controllers(vec![one(&[0.1, 0.2, 0.3, f64::NAN])]),
            ],
            "controllers[2]",
        ),
    ];
    for (parts, expected) in cases {
        let refused = evaluate(&cluster, parts).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused}");
        assert!(refused.message().contains(expected), "{expected}: {refused}");
    }
    cluster.stop().await;
}

fn to_simulate(campaign: Campaign, individual: &v1::Individual) -> v1::SimulateRequest {
    v1::SimulateRequest {
        description: Some(v1::EvaluationDescription {
            campaign: Some(campaign),
            pictures: false,
            seed: None,
        }),
        controller: individual.controller.clone(),
        seed: individual.seed,
        steps: None,
    }
}

async fn simulate(cluster: &Cluster, request: v1::SimulateRequest) -> Result<v1::Motion, Status> {
    let mut client = EvaluationServiceClient::new(cluster.channel().await);
    whole(client.simulate(request).await?.into_inner()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_motion_of_a_controller_is_that_of_the_individual_in_full_precision() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    let spec = small_spec("");
    let campaign = cluster.create(&spec).await;
    cluster.finish(&campaign).await;
    let individual = cluster.archive(&campaign).await.remove(3);
    let replay = v1::GetReplayRequest {
        campaign,
        index: 3,
        stride: 1,
    };
    let replay = cluster.client.get_replay(replay).await.unwrap().into_inner();
    let replay = whole(replay).await.unwrap();
    let request = to_simulate(Campaign::Spec((&spec).into()), &individual);
    let motion = simulate(&cluster, request.clone()).await.unwrap();
    let rounded: Vec<f32> = motion.poses.iter().map(|&value| value as f32).collect();
    assert_eq!(rounded, replay.poses);
    // The values have double precision, unlike those of a replay.
    assert!(motion.poses.iter().any(|&value| f64::from(value as f32) != value));
    // A request for fewer steps returns the beginning of the motion. The text of a campaign file describes the same campaign.
    let shorter = v1::SimulateRequest {
        steps: Some(10),
        ..to_simulate(Campaign::Toml(spec.to_toml()), &individual)
    };
    let beginning = simulate(&cluster, shorter).await.unwrap().poses;
    assert_eq!(beginning.len(), 11 * motion.agents as usize * 3);
    assert_eq!(beginning, motion.poses[..beginning.len()]);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn motions_need_no_worker_and_what_has_none_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_without_trainer(folder.path(), 0).await;
    let individual = v1::Individual {
        controller: vec![0.1, 0.2, 0.3, 0.4],
        ..v1::Individual::default()
    };
    // The campaign learns an embedder, but simulating a motion needs no embedder.
    let latent = small_latent_spec("");
    let good = to_simulate(Campaign::Toml(latent.to_toml()), &individual);
    let motion = simulate(&cluster, good.clone()).await.unwrap();
    let frames = latent.world().horizon() as usize + 1;
    assert_eq!(motion.poses.len(), frames * motion.agents as usize * 3);
    let refusals = [
        (
            v1::SimulateRequest {
                description: None,
                ..good.clone()
            },
            "campaign is missing: must be",
        ),
        (
            v1::SimulateRequest {
                controller: vec![0.1, 0.2],
                ..good.clone()
            },
            "controller = [0.1, 0.2]: must be 4 values",
        ),
        (
            v1::SimulateRequest {
                controller: vec![0.1, 0.2, 0.3, f64::NAN],
                ..good.clone()
            },
            "controller.right_1 = NaN",
        ),
        (
            v1::SimulateRequest {
                steps: Some(u32::MAX),
                ..good.clone()
            },
            "steps = 4294967295: must be a whole number from 1 to",
        ),
    ];
    for (request, expected) in refusals {
        let refused = simulate(&cluster, request).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused}");
        assert!(refused.message().starts_with(expected), "{expected}: {refused}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_waits_for_workers_that_are_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_without_trainer(folder.path(), 0).await;
    let tasks = vec![v1::EvaluationTask {
        controller: vec![0.0; 4],
        seed: 1,
    }];
    let parts = vec![
        described(Some(Campaign::Spec((&small_spec("")).into()))),
        controllers(tasks),
    ];
    let refused = evaluate(&cluster, parts).await.unwrap_err();
    assert_eq!(refused.code(), Code::Unavailable, "{refused}");
    cluster.stop().await;
}
