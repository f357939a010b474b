//! Workers that are slow, hang, or answer what no sound worker answers.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    processes::Cluster,
    table::Row,
};
use murmuration_proto::v1;
use murmuration_tests::Impostor;
use std::{thread, time::Duration};
use tonic::Status;

/// What no swarm does, in a form that any could have.
fn lie() -> v1::Evaluation {
    v1::Evaluation {
        features: vec![0.123; 5],
        image: vec![7; 2500],
        embedding: Vec::new(),
    }
}

/// Has a worker answer everything with `evaluation`; how many evaluations, and what it is told in the end.
fn answer_all(cluster: &Cluster, instance: u64, evaluation: &v1::Evaluation) -> (usize, Status) {
    let url = cluster.url();
    cluster.runtime().block_on(async {
        let impostor = Impostor::connect_as(&url, instance).await.unwrap();
        impostor.answer_all(evaluation).await
    })
}

pub fn slow(_: &Scale, undisturbed: &Undisturbed) -> Row {
    let stops = 5;
    let spec = campaign(40 * stops, 600);
    let mut cluster = Cluster::start(2);
    let id = cluster.submit(&spec);
    let mut went_on = 0;
    for stop in 0..stops {
        // One that is stopped before it has joined is not missed.
        let ready = |status: &v1::Campaign| status.workers == 2 && status.generations_done >= 30 * stop;
        let before = cluster.wait_until(&id, ready);
        assert_eq!(
            before.state(),
            v1::CampaignState::Running,
            "over before the last stop"
        );
        cluster.workers[0].signal("STOP");
        // Less than it takes to be missed: its leases stay with it.
        thread::sleep(Duration::from_secs(2));
        let during = cluster.try_status(&id).unwrap();
        cluster.workers[0].signal("CONT");
        assert_eq!(during.workers, 2, "it was given up");
        went_on += during.generations_done - before.generations_done;
    }
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

pub fn hung(_: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(20, 600);
    let mut cluster = Cluster::start(0);
    let id = cluster.submit(&spec);
    let url = cluster.url();
    let took = cluster.runtime().block_on(async move {
        let mut impostor = Impostor::connect_as(&url, 42).await.unwrap();
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

pub fn wrong_bits(_: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(60, 600);
    let mut cluster = Cluster::start(2);
    let id = cluster.submit(&spec);
    let (answered, status) = answer_all(&cluster, 42, &lie());
    assert!(status.message().contains("quarantined"), "{status}");
    let digest = cluster.finish(&id);
    Row {
        done: format!("a third worker answered {answered} evaluations with wrong bits, one in ten audited"),
        found: format!("quarantined; {}", undisturbed.check(&spec, &digest)),
    }
}

pub fn impossible(_: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(60, 600);
    let mut cluster = Cluster::start(2);
    let id = cluster.submit(&spec);
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
            "four features",
            v1::Evaluation {
                features: vec![0.0; 4],
                ..lie()
            },
            "must be 5 values",
        ),
        (
            "a picture too small",
            v1::Evaluation {
                image: vec![0; 2499],
                ..lie()
            },
            "must be 2500 bytes",
        ),
        (
            "a picture of 4 MiB",
            v1::Evaluation {
                image: vec![0; 4 << 20],
                ..lie()
            },
            "must be 2500 bytes",
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
    for (instance, (name, evaluation, said)) in (100..).zip(cases) {
        let (_, status) = answer_all(&cluster, instance, &evaluation);
        assert!(status.message().contains(said), "{name}: {status}");
    }
    let status = cluster.try_status(&id).unwrap();
    assert_eq!(
        status.state(),
        v1::CampaignState::Running,
        "over before the last of them"
    );
    let digest = cluster.finish(&id);
    Row {
        done,
        found: format!(
            "each told why and quarantined; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

pub fn foreign_leases(_: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(40, 600);
    let mut cluster = Cluster::start(2);
    let id = cluster.submit(&spec);
    let url = cluster.url();
    let sent = cluster.runtime().block_on(async {
        let mut impostor = Impostor::connect_as(&url, 42).await.unwrap();
        let (own, batch) = impostor.lease(1).await;
        let mut sent = 0;
        for number in 0..2 * own.number {
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
        sent
    });
    let digest = cluster.finish(&id);
    Row {
        done: format!(
            "a worker answered {sent} leases of others, of no one, and of other epochs, then vanished"
        ),
        found: undisturbed.check(&spec, &digest),
    }
}
