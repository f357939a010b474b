//! Workers that are slow, hang, or return impossible results.

use super::{
    Scale,
    campaign::{Undisturbed, campaign, latent},
    table::Row,
};
use murmuration_proto::v1;
use murmuration_tests::{FakeWorker, ProcessCluster};
use std::{path::Path, thread, time::Duration};
use tonic::Status;

/// A wrong evaluation that is not obviously impossible.
fn lie() -> v1::Evaluation {
    v1::Evaluation {
        features: vec![0.123; 5],
        image: vec![7; 2500],
        ..v1::Evaluation::default()
    }
}

/// Answers every lease with `evaluation`, from a worker on a machine of its own. Returns the number of evaluations and the
/// coordinator's last error.
fn answer_all(cluster: &ProcessCluster, evaluation: &v1::Evaluation) -> (usize, Status) {
    let url = cluster.url();
    cluster.runtime().block_on(async {
        let impostor = FakeWorker::connect(&url).await;
        impostor.answer_all(evaluation).await
    })
}

pub fn slow(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let stops = 5;
    let spec = campaign(scale, 40 * stops, 600);
    let mut cluster = ProcessCluster::start(2);
    let id = cluster.submit(&spec);
    let mut went_on = 0;
    for stop in 0..stops {
        let ready = |status: &v1::Campaign| status.workers == 2 && status.generations_done > 30 * stop;
        let before = cluster.wait_to_strike(&id, ready);
        cluster.workers[0].signal("STOP");
        // The pause is shorter than the silence limit, so the worker keeps its leases.
        thread::sleep(Duration::from_secs(2));
        let during = cluster.try_status(&id).unwrap();
        cluster.workers[0].signal("CONT");
        assert_eq!(during.workers, 2, "it was given up");
        went_on += during.generations_done - before.generations_done;
    }
    cluster.check_running(&id);
    let digest = cluster.finish(&id);
    assert!(went_on > stops, "its leases held the others up");
    Row {
        done: format!("one of two workers stopped {stops} times for 2 s, its leases in hand"),
        found: format!(
            "{went_on} generations went on without it; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

pub fn hung(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(scale, 20, 600);
    let mut cluster = ProcessCluster::start(0);
    let id = cluster.submit(&spec);
    let url = cluster.url();
    let took = cluster.runtime().block_on(async move {
        let mut impostor = FakeWorker::connect(&url).await;
        let (_, batch) = impostor.lease(64).await;
        tokio::spawn(impostor.dismissed());
        batch.tasks.len()
    });
    cluster.add_worker();
    cluster.add_worker();
    let digest = cluster.finish(&id);
    let status = cluster.try_status(&id).unwrap();
    assert_eq!(status.workers, 3, "it was dropped, which is another fault");
    Row {
        done: format!("a worker that is heard, took {took} evaluations and never answers"),
        found: undisturbed.check(&spec, &digest),
    }
}

pub fn wrong_bits(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(scale, 300, 600);
    let mut cluster = ProcessCluster::start(2);
    let id = cluster.submit(&spec);
    // Two honest workers are needed: with only one, the coordinator could not find out which of the two answers is wrong.
    cluster.wait_to_strike(&id, |status| status.workers == 2 && status.generations_done > 0);
    let (answered, status) = answer_all(&cluster, &lie());
    assert!(status.message().contains("quarantined"), "{status}");
    cluster.check_running(&id);
    let digest = cluster.finish(&id);
    Row {
        done: format!("a third worker answered {answered} evaluations with wrong bits, one in ten audited"),
        found: format!("quarantined; {}", undisturbed.check(&spec, &digest)),
    }
}

pub fn impossible(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(scale, 800, 600);
    let mut cluster = ProcessCluster::start(2);
    let id = cluster.submit(&spec);
    cluster.wait_to_strike(&id, |status| status.workers == 2 && status.generations_done > 0);
    let cases = [
        (
            "not a number",
            v1::Evaluation {
                features: vec![f64::NAN; 5],
                ..lie()
            },
            "must be finite",
        ),
        (
            "infinite",
            v1::Evaluation {
                features: vec![f64::INFINITY; 5],
                ..lie()
            },
            "must be finite",
        ),
        (
            "larger than any swarm's",
            v1::Evaluation {
                features: vec![1e300; 5],
                ..lie()
            },
            "must be at most 1e12 in magnitude",
        ),
        (
            "faster than its world allows",
            v1::Evaluation {
                features: vec![1e4, 0.0, 0.0, 0.0, 0.0],
                ..lie()
            },
            "features.average_speed = 1e4: must be from 0",
        ),
        (
            "four features",
            v1::Evaluation {
                features: vec![0.0; 4],
                ..lie()
            },
            "features = ",
        ),
        (
            "a picture too small",
            v1::Evaluation {
                image: vec![0; 2499],
                ..lie()
            },
            "not of 2500 pixels",
        ),
        (
            "a picture of 4 MiB",
            v1::Evaluation {
                image: vec![0; 4 << 20],
                ..lie()
            },
            "not of 2500 pixels",
        ),
        (
            "an embedding unasked",
            v1::Evaluation {
                embedding: vec![0.0; 5],
                ..lie()
            },
            "embedding",
        ),
    ];
    let names: Vec<_> = cases.iter().map(|(name, ..)| *name).collect();
    let done = format!("workers answered with {}", names.join(", "));
    for (name, evaluation, expected) in cases {
        let (_, status) = answer_all(&cluster, &evaluation);
        assert!(status.message().contains(expected), "{name}: {status}");
    }
    cluster.check_running(&id);
    let digest = cluster.finish(&id);
    Row {
        done,
        found: format!(
            "each told why and quarantined; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

pub fn connections_of_a_liar(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let (spec, connections) = (campaign(scale, 300, 600), 4);
    let mut cluster = ProcessCluster::start(2);
    let id = cluster.submit(&spec);
    // Two honest workers are needed: with only one, the coordinator could not find out which of the two answers is wrong.
    cluster.wait_to_strike(&id, |status| status.workers == 2 && status.generations_done > 0);
    let (url, machine) = (cluster.url(), 3);
    let (told, again) = cluster.runtime().block_on(async {
        let mut liars = Vec::new();
        for instance in 1..=connections {
            liars.push(FakeWorker::connect_as(&url, machine, instance).await.unwrap());
        }
        let lying = liars
            .into_iter()
            .map(|liar| tokio::spawn(async { liar.answer_all(&lie()).await }));
        let mut told = Vec::new();
        for liar in lying.collect::<Vec<_>>() {
            told.push(liar.await.unwrap());
        }
        let again = FakeWorker::connect_as(&url, machine, connections + 1).await;
        (told, again.unwrap_err())
    });
    for status in told.iter().map(|(_, status)| status).chain([&again]) {
        assert!(status.message().contains("quarantined"), "{status}");
    }
    cluster.check_running(&id);
    let digest = cluster.finish(&id);
    assert_eq!(
        cluster.metric("murmuration_quarantines_total"),
        1.0,
        "and nobody else"
    );
    let answered: usize = told.iter().map(|(answered, _)| answered).sum();
    Row {
        done: format!(
            "one machine with {connections} connections answered {answered} evaluations with the same wrong bits beside two \
             sound workers, then connected anew under a fresh number"
        ),
        found: format!(
            "all its connections quarantined, the new one refused, nobody else; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

pub fn unfit(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = latent(scale, 3);
    let mut cluster = ProcessCluster::start(0);
    let id = cluster.submit(&spec);
    let url = cluster.url();
    let _trainer = cluster.worker(&url, "murmuration-trainer");
    let nowhere = Path::new("/dev/null/cache");
    let _cannot_embed = cluster.odd_worker(nowhere, &[("ORT_DYLIB_PATH", "/dev/null/onnxruntime.so")]);
    // This worker can simulate the dataset, but the search after it needs embeddings.
    let waits_for = |expected: &'static str| move |status: &v1::Campaign| status.waiting.contains(expected);
    let status = cluster.wait_until(&id, waits_for("no connected worker can embed"));
    assert_eq!(status.state(), v1::CampaignState::Running, "{}", status.error);
    assert_eq!(status.dataset_done, 400);
    let _cannot_write = cluster.odd_worker(nowhere, &[]);
    let status = cluster.wait_until(&id, waits_for("checkpoint cache /dev/null/cache"));
    assert_eq!(status.state(), v1::CampaignState::Running, "{}", status.error);
    cluster.add_worker();
    let digest = cluster.finish(&id);
    Row {
        done: "one worker without ONNX Runtime, one whose cache cannot be written, later a sound one"
            .to_owned(),
        found: format!(
            "the campaign said what it waited for, and went on by itself; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

pub fn foreign_leases(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(scale, 800, 600);
    let mut cluster = ProcessCluster::start(2);
    let id = cluster.submit(&spec);
    // By now, some leases have ended, and other leases are open.
    cluster.wait_to_strike(&id, |status| status.workers == 2 && status.generations_done > 5);
    let url = cluster.url();
    let sent = cluster.runtime().block_on(async {
        let mut impostor = FakeWorker::connect(&url).await;
        let (own, batch) = impostor.lease(1).await;
        let mut sent = 0;
        for number in 0..own.number + 20 {
            if number != own.number {
                let lease = v1::LeaseId { number, ..own };
                impostor.answer(lease, lie(), 1 + number as usize % 3).await;
                sent += 1;
            }
        }
        for epoch in [0, 1, u64::MAX] {
            impostor
                .answer(v1::LeaseId { epoch, ..own }, lie(), batch.tasks.len())
                .await;
            sent += 1;
        }
        // The coordinator handles a worker's messages in order: another lease proves that the coordinator has handled all these
        // answers.
        impostor.lease(1).await;
        sent
    });
    assert!(sent > 20, "there were hardly any leases: {sent}");
    cluster.check_running(&id);
    let digest = cluster.finish(&id);
    Row {
        done: format!(
            "a worker answered {sent} leases of others, of no one, and of other epochs, then vanished"
        ),
        found: undisturbed.check(&spec, &digest),
    }
}
