//! Tests that a machine has one vote, even if it runs several workers.

use crate::integrity::{Honest, LIAR, connect, lie, longer, notices, undisturbed, with_a_liar};
use murmuration_proto::v1;
use murmuration_tests::{Cluster, FakeWorker, small_spec};

#[tokio::test(flavor = "multi_thread")]
async fn two_connections_of_a_liar_do_not_outvote_an_honest_worker() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longer();
    let (mut cluster, campaign, mut liar) = with_a_liar(folder.path(), &spec).await;
    let (lease, batch) = liar.lease(5).await;
    let honest = Honest::join(&cluster, folder.path(), 3);
    while cluster.status(&campaign).await.workers < 2 {
        tokio::task::yield_now().await;
    }
    liar.answer(lease, lie(), batch.tasks.len()).await;
    // The honest worker contradicts the liar; the liar's second connection repeats the wrong results.
    let second = connect(&cluster, (LIAR.0, 43)).await.unwrap();
    let second = tokio::spawn(async move { second.answer_all(&lie()).await });
    let first = tokio::spawn(liar.dismissed());
    let decides = Honest::join(&cluster, folder.path(), 4);
    for status in [first.await.unwrap(), second.await.unwrap().1] {
        assert!(status.message().contains("quarantined"), "{status}");
    }
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    assert_eq!(last.workers, 2, "both honest workers are still there");
    assert_eq!(cluster.digest(&campaign).await, undisturbed(&spec).await);
    for worker in [honest, decides] {
        worker.leave().await;
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_machine_whose_workers_vanish_condemns_nothing_that_another_can_do() {
    let folder = tempfile::tempdir().unwrap();
    let spec = small_spec("");
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let campaign = cluster.create(&spec).await;
    let mut busy = None;
    for instance in 1..=3 {
        if instance == 3 {
            // Another worker is connected, but busy.
            let other = FakeWorker::connect(&cluster.url()).await;
            busy = Some(tokio::spawn(other.dismissed()));
        }
        let mut vanishes = connect(&cluster, (LIAR.0, instance)).await.unwrap();
        vanishes.lease(1).await;
        drop(vanishes);
        let others = u32::from(busy.is_some());
        while cluster.status(&campaign).await.workers > others {
            tokio::task::yield_now().await;
        }
    }
    let worker = Honest::join(&cluster, folder.path(), 3);
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    assert_eq!(notices(&last), "");
    assert_eq!(cluster.digest(&campaign).await, undisturbed(&spec).await);
    busy.unwrap().abort();
    worker.leave().await;
    cluster.stop().await;
}
