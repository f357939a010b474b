//! Tests bad messages from strangers: the coordinator refuses each such message with an error, and loses no work.

use murmuration_embed::Device;
use murmuration_link::{Health, READY, Target};
use murmuration_proto::{
    PROTOCOL_VERSION, SIMULATOR_VERSION,
    v1::{self, coordinator_message::Message as Answer, worker_message::Message},
};
use murmuration_tests::{Cluster, FakeWorker, small_spec};
use tonic::Code;
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};
use tonic_reflection::pb::v1::{
    ServerReflectionRequest, server_reflection_client::ServerReflectionClient,
    server_reflection_request::MessageRequest, server_reflection_response::MessageResponse,
};

/// Runs `disturb`, and after that lets one honest worker join. The campaign must end with the digest of an undisturbed run.
async fn check_undisturbed<F: Future<Output = ()>>(disturb: impl FnOnce(String) -> F) {
    let spec = small_spec("seed = 9");
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let undisturbed = cluster.run(&spec).await;
    cluster.stop().await;

    // The honest worker joins only after the fault, so that the workers of `disturb` are sure to get work.
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let campaign = cluster.create(&spec).await;
    disturb(cluster.url()).await;
    let options = murmuration_worker::client::Options {
        coordinator: Target::open(&cluster.url()),
        name: "honest".to_owned(),
        local_address: None,
        health: Health::new(),
        leaving: murmuration_link::Leaving::default(),
        threads: std::num::NonZeroUsize::MIN,
        cache: folder.path().join("cache"),
        embed_on: Device::default(),
    };
    let (stop, stopped) = tokio::sync::watch::channel(false);
    let worker = tokio::spawn(murmuration_worker::client::run(options, stopped));
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    assert_eq!(cluster.digest(&campaign).await, undisturbed);
    stop.send_replace(true);
    worker.await.unwrap().unwrap();
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_vanishes_with_a_lease_costs_nothing() {
    check_undisturbed(async |url| {
        let mut impostor = FakeWorker::connect(&url).await;
        impostor.lease(10).await;
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_falls_silent_is_dropped_and_told_so() {
    check_undisturbed(async |url| {
        let mut impostor = FakeWorker::connect(&url).await;
        impostor.lease(8).await;
        let status = impostor.receive().await.unwrap_err();
        assert_eq!(status.code(), Code::DeadlineExceeded);
        assert!(status.message().contains("no message for"), "{status}");
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn impossible_results_are_refused_by_name() {
    let good = || v1::Evaluation {
        features: vec![0.0; 5],
        image: vec![0; 2500],
        ..v1::Evaluation::default()
    };
    let cases = [
        (
            v1::Evaluation {
                features: vec![f64::NAN; 5],
                ..good()
            },
            0,
            "features.average_speed = NaN: must be finite",
        ),
        (
            v1::Evaluation {
                features: vec![0.0; 4],
                ..good()
            },
            0,
            "features = 16 values: must be 20",
        ),
        (
            v1::Evaluation {
                image: vec![0; 2499],
                ..good()
            },
            0,
            "[0].picture = not of 2500 pixels: must be a zstd frame",
        ),
        (
            v1::Evaluation {
                verdict: v1::Verdict::Milling as i32,
                ..good()
            },
            0,
            "verdicts = 4 values: must be 0",
        ),
        (good(), 1, "features = 25 values: must be 20"),
        (
            v1::Evaluation {
                features: vec![1e4, 0.0, 0.0, 0.0, 0.0],
                ..good()
            },
            0,
            "features.average_speed = 1e4: must be from 0.000 to",
        ),
        (
            v1::Evaluation {
                features: vec![0.0, 0.0, -0.1, 0.0, 0.0],
                ..good()
            },
            0,
            "features.radial_variance_x20 = -1e-1: must be from 0.000 to",
        ),
    ];
    check_undisturbed(async |url| {
        for (evaluation, extra, expected) in cases {
            let mut impostor = FakeWorker::connect(&url).await;
            let (lease, batch) = impostor.lease(4).await;
            impostor
                .answer(lease, evaluation, batch.tasks.len() + extra)
                .await;
            let status = impostor.receive().await.unwrap_err();
            assert_eq!(status.code(), Code::InvalidArgument);
            assert!(
                status.message().contains(expected),
                "{:?} does not say {expected:?}",
                status.message()
            );
        }
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn results_for_leases_that_never_were_are_ignored() {
    check_undisturbed(async |url| {
        let mut impostor = FakeWorker::connect(&url).await;
        let evaluation = v1::Evaluation {
            features: vec![0.0; 5],
            image: vec![0; 2500],
            ..v1::Evaluation::default()
        };
        let (own, _) = impostor.lease(1).await;
        for lease in [
            v1::LeaseId {
                number: own.number + 7,
                ..own
            },
            v1::LeaseId { epoch: 1, number: 1 },
            v1::LeaseId {
                epoch: u64::MAX,
                number: 3,
            },
        ] {
            impostor.answer(lease, evaluation.clone(), 1).await;
        }
        // The coordinator handles a worker's messages in order: another lease proves that the coordinator has handled all these
        // messages.
        impostor.lease(1).await;
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn another_version_is_told_which_one_to_run() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let status = FakeWorker::say_hello(&cluster.url(), FakeWorker::hello("0"))
        .await
        .unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    let expected = format!(
        "needs workers with simulator version {SIMULATOR_VERSION}, worker \"impostor\" has version 0"
    );
    assert!(status.message().contains(&expected), "{status}");
    let Message::Hello(hello) = FakeWorker::hello(SIMULATOR_VERSION) else {
        panic!("not Hello");
    };
    let before = Message::Hello(v1::Hello {
        protocol_version: 0,
        ..hello
    });
    let status = FakeWorker::say_hello(&cluster.url(), before).await.unwrap_err();
    let expected =
        format!("needs workers with protocol version {PROTOCOL_VERSION}, worker \"impostor\" has version 0");
    assert!(status.message().contains(&expected), "{status}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn messages_out_of_order_or_range_end_the_stream() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let status = FakeWorker::say_hello(&cluster.url(), Message::Heartbeat(v1::Heartbeat {}))
        .await
        .unwrap_err();
    assert_eq!(status.message(), "the first message must be Hello");
    let mut impostor = FakeWorker::connect(&cluster.url()).await;
    impostor
        .send(Message::Credits(v1::Credits {
            evaluations: u32::MAX,
        }))
        .await;
    let status = impostor.receive().await.unwrap_err();
    assert_eq!(
        status.message(),
        "credits.evaluations = 4294967295: must be from 1 to 65536"
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_draining_worker_gets_no_more_leases() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let mut leaving = FakeWorker::connect(&cluster.url()).await;
    leaving
        .send(Message::Credits(v1::Credits { evaluations: 5 }))
        .await;
    leaving.send(Message::Drain(v1::Drain {})).await;
    cluster.create(&small_spec("")).await;
    // The silence limit ends the stream. Before that, no lease may arrive.
    match leaving.receive().await {
        Err(status) => assert_eq!(status.code(), Code::DeadlineExceeded),
        Ok(Some(Answer::Lease(_))) => panic!("a lease for a draining worker"),
        Ok(other) => panic!("unexpected: {other:?}"),
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_campaign_says_why_its_work_was_given_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(
            (&small_spec("")).into(),
        )),
        weight: Some(250),
        ..v1::CreateCampaignRequest::default()
    };
    let created = cluster
        .client
        .create_campaign(request)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(created.weight, 250);
    let mut unable = FakeWorker::connect(&cluster.url()).await;
    let (lease, _) = unable.lease(5).await;
    unable
        .fail(lease, v1::FailureClass::Retryable, "the cache is full")
        .await;
    // The worker stays connected, and pauses after the failure.
    let held_up = |status: &v1::Campaign| status.waiting.starts_with("impostor");
    let status = cluster.watch_until(&created.id, held_up).await;
    assert_eq!(
        status.waiting,
        "impostor returned work, which will be tried again: the cache is full"
    );
    assert_eq!(status.state(), v1::CampaignState::Running);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_one_machine_says_cannot_be_done_another_does() {
    check_undisturbed(async |url| {
        // Another worker is connected, but busy. The coordinator does not give up tasks that the busy worker could do.
        let busy = FakeWorker::connect(&url).await;
        tokio::spawn(busy.dismissed());
        let mut unfit = FakeWorker::connect_as(&url, 2, 1).await.unwrap();
        let (lease, batch) = unfit.lease(5).await;
        assert_eq!(batch.tasks.len(), 5);
        unfit.fail(lease, v1::FailureClass::Fatal, "no such model").await;
        tokio::spawn(unfit.dismissed());
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_two_machines_say_cannot_be_done_fails_the_campaign_aloud() {
    let folder = tempfile::tempdir().unwrap();
    let options = murmuration_dispatch::Options {
        // If only one machine had failed, the campaign would wait for this long.
        silence_limit: std::time::Duration::from_secs(100),
        ..murmuration_tests::quick_dispatch()
    };
    let mut cluster = Cluster::start_with(folder.path(), 0, options).await;
    let campaign = cluster.create(&small_spec("")).await;
    let mut asked = Vec::new();
    for (machine, instance) in [(2, 1), (3, 2)] {
        let mut unfit = FakeWorker::connect_as(&cluster.url(), machine, instance)
            .await
            .unwrap();
        let (lease, _) = unfit.lease(20).await;
        assert_eq!(
            cluster.status(&campaign).await.state(),
            v1::CampaignState::Running
        );
        unfit.fail(lease, v1::FailureClass::Fatal, "no such model").await;
        asked.push(unfit);
    }
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Failed);
    assert_eq!(
        last.error,
        "no such model (reported by impostor at 127.0.0.2 and impostor at 127.0.0.3)"
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_only_machine_says_cannot_be_done_fails_the_campaign_aloud() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let campaign = cluster.create(&small_spec("")).await;
    let mut unfit = FakeWorker::connect_as(&cluster.url(), 2, 1).await.unwrap();
    let (lease, _) = unfit.lease(5).await;
    unfit.fail(lease, v1::FailureClass::Fatal, "no such model").await;
    tokio::spawn(unfit.dismissed());
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Failed);
    assert_eq!(last.error, "no such model (reported by impostor at 127.0.0.2)");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_are_told_which_field_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let mut spec = v1::CampaignSpec::from(&small_spec(""));
    spec.search.as_mut().unwrap().population = Some(0);
    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(spec)),
        ..v1::CreateCampaignRequest::default()
    };
    let status = cluster.client.create_campaign(request).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert!(
        status.message().starts_with("search.population = 0: must be"),
        "{status}"
    );

    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(
            (&small_spec("")).into(),
        )),
        weight: Some(0),
        ..v1::CreateCampaignRequest::default()
    };
    let status = cluster.client.create_campaign(request).await.unwrap_err();
    assert_eq!(
        status.message(),
        "weight = 0: must be a whole number from 1 to 10,000"
    );

    let request = v1::GetCampaignRequest {
        campaign: "nobody".to_owned(),
    };
    let status = cluster.client.get_campaign(request).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);

    let campaign = cluster.create(&small_spec("")).await;
    let request = v1::GetReplayRequest {
        campaign: campaign.clone(),
        index: 0,
        stride: 0,
    };
    let status = cluster.client.get_replay(request).await.unwrap_err();
    assert!(
        status.message().starts_with("stride = 0: must be 1 or more"),
        "{status}"
    );
    let request = v1::GetTaxonomyRequest { campaign };
    let status = cluster.client.get_taxonomy(request).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn health_and_reflection_answer_any_client() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let mut health = HealthClient::new(cluster.channel().await);
    for service in [
        "",
        "murmuration.v1.CampaignService",
        "murmuration.v1.WorkerService",
        READY,
    ] {
        let request = HealthCheckRequest {
            service: service.to_owned(),
        };
        let answer = health.check(request).await.unwrap().into_inner();
        assert_eq!(answer.status(), ServingStatus::Serving, "{service}");
    }

    let mut reflection = ServerReflectionClient::new(cluster.channel().await);
    let request = ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::ListServices(String::new())),
    };
    let mut answers = reflection
        .server_reflection_info(tokio_stream::once(request))
        .await
        .unwrap()
        .into_inner();
    let answer = answers.message().await.unwrap().unwrap().message_response;
    let Some(MessageResponse::ListServicesResponse(list)) = answer else {
        panic!("no list: {answer:?}")
    };
    let names: Vec<_> = list.service.iter().map(|service| service.name.as_str()).collect();
    for name in [
        "murmuration.v1.CampaignService",
        "murmuration.v1.WorkerService",
        "grpc.health.v1.Health",
    ] {
        assert!(names.contains(&name), "{names:?}");
    }
    cluster.stop().await;
}
