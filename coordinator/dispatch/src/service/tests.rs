//! Tests of the service without its task: messages are taken one by one.

use super::*;
use crate::{EmbeddingJob, Families, PeerKind, Share, embedding_cost, submitted::Submitted};
use murmuration_model::{CampaignRecord, EmbedderRef, Origin, TrainingPictures, Weight};
use murmuration_proto::v1::{batch_result::Outcome, coordinator_message::Message};
use murmuration_swarm::{CampaignSpec, CheckpointDigest, Starts, training::Configuration};
use prometheus_client::registry::Registry;
use std::net::Ipv4Addr;

fn service() -> Service {
    let options = Options {
        audited: Share(1.0),
        ..Options::default()
    };
    let metrics = Families::register(&mut Registry::default()).of(PeerKind::Worker);
    let (count, wrong, audits) = (
        watch::Sender::new(0),
        watch::Sender::default(),
        watch::Sender::default(),
    );
    Service::new(options, count, wrong, audits, metrics)
}

/// A worker on a machine of its own.
struct Peer {
    id: WorkerId,
    inbox: mpsc::Receiver<Result<v1::CoordinatorMessage, Status>>,
    _present: oneshot::Receiver<Infallible>,
}

impl Peer {
    fn join(service: &mut Service, machine: u64) -> Self {
        let (outbox, inbox) = mpsc::channel(64);
        let (present, still_present) = oneshot::channel();
        let (reply, mut answer) = oneshot::channel();
        let join_request = JoinRequest {
            name: format!("worker-{machine}"),
            origin: Origin {
                machine: MachineId(machine),
                address: Ipv4Addr::LOCALHOST.into(),
            },
            instance: None,
            capacity: 1,
            kind: EmbeddingKind::of("any"),
            outbox,
            present,
        };
        service.take(Request::Join { join_request, reply });
        Self {
            id: answer.try_recv().unwrap().unwrap(),
            inbox,
            _present: still_present,
        }
    }

    fn report(&self, service: &mut Service, report: WorkerReport) {
        service.take(Request::Report {
            worker: self.id,
            report,
        });
    }

    /// The next lease that the worker has received.
    fn lease(&mut self) -> Option<v1::LeaseId> {
        std::iter::from_fn(|| self.inbox.try_recv().ok()).find_map(|message| match message.unwrap().message {
            Some(Message::Lease(lease)) => lease.id,
            _ => None,
        })
    }

    /// Gets a lease of one picture.
    fn ask(&mut self, service: &mut Service) -> v1::LeaseId {
        self.report(service, WorkerReport::Credits(1));
        service.follow_up();
        self.lease().expect("there is work")
    }

    fn answer(&self, service: &mut Service, lease: v1::LeaseId) {
        let embedding = v1::Embedding { values: vec![1.0] };
        let outcome = Outcome::Embeddings(v1::Embeddings {
            embeddings: vec![embedding],
        });
        let report = WorkerReport::Result {
            epoch: lease.epoch,
            lease: LeaseNumber(lease.number),
            outcome,
        };
        self.report(service, report);
    }
}

fn two_pictures() -> EmbeddingJob {
    EmbeddingJob {
        campaign: CampaignId::from_store("small-1".to_owned()),
        weight: Weight::default(),
        embedder: EmbedderRef {
            checkpoint: CheckpointDigest::of(b"model"),
            dimensions: 1,
        },
        starts: Starts::ONE,
        images: vec![vec![Vec::new()]; 2],
    }
}

/// A service whose job of two audited pictures waits for the last vote, and the worker and lease of this vote. The audit of the other
/// picture goes on after the job. Also the receiver of the job's results.
fn before_the_last_vote() -> (Service, Peer, v1::LeaseId, oneshot::Receiver<impl Sized>) {
    let mut service = service();
    let mut fast = Peer::join(&mut service, 1);
    let restarting = Peer::join(&mut service, 2);
    let (job, results) = Submitted::new(two_pictures());
    service.take(Request::Submit {
        job: Box::new(job),
        job_progress: Arc::default(),
    });
    let first = fast.ask(&mut service);
    restarting.report(&mut service, WorkerReport::Gone);
    fast.answer(&mut service, first);
    let second = fast.ask(&mut service);
    fast.answer(&mut service, second);
    let mut third = Peer::join(&mut service, 3);
    let last = third.ask(&mut service);
    (service, third, last, results)
}

#[test]
#[allow(clippy::float_cmp, reason = "the cost of one task is a whole number")]
fn the_pace_counts_the_plain_cost_of_tasks() {
    let mut service = service();
    let mut worker = Peer::join(&mut service, 1);
    let (job, _results) = Submitted::new(two_pictures());
    service.take(Request::Submit {
        job: Box::new(job),
        job_progress: Arc::default(),
    });
    let lease = worker.ask(&mut service);
    worker.answer(&mut service, lease);
    assert_eq!(service.pace.steps, embedding_cost(Starts::ONE) as f64);
}

#[test]
fn an_audit_goes_on_after_its_job() {
    let (mut service, mut third, last, mut results) = before_the_last_vote();
    third.answer(&mut service, last);
    service.follow_up();
    assert!(results.try_recv().is_ok());
    let audit = third.ask(&mut service);
    third.answer(&mut service, audit);
    service.follow_up();
    assert!(service.jobs.is_empty() && service.given.is_empty());
}

#[test]
fn audits_of_a_job_whose_submitter_has_gone_take_no_worker() {
    let (mut service, mut third, last, results) = before_the_last_vote();
    drop(results);
    third.answer(&mut service, last);
    third.report(&mut service, WorkerReport::Credits(1));
    service.follow_up();
    assert!(third.lease().is_none());
    assert_eq!((service.table.waiting(), service.table.out()), (0, 0));
    assert!(service.jobs.is_empty() && service.given.is_empty());
    // The worker still takes work.
    let (job, _results) = Submitted::new(two_pictures());
    service.take(Request::Submit {
        job: Box::new(job),
        job_progress: Arc::default(),
    });
    service.follow_up();
    assert!(third.lease().is_some());
}

#[test]
fn a_late_answer_counts_in_the_same_batch_of_messages_as_the_end_of_its_job() {
    let mut service = service();
    let mut fast = Peer::join(&mut service, 1);
    let mut slow = Peer::join(&mut service, 2);
    let (job, mut results) = Submitted::new(two_pictures());
    service.take(Request::Submit {
        job: Box::new(job),
        job_progress: Arc::default(),
    });
    let first = fast.ask(&mut service);
    fast.answer(&mut service, first);
    let late = slow.ask(&mut service);
    let second = fast.ask(&mut service);
    // The worker is late with the audit after a tenth of a second, and takes no other work: the audit will go on after the job.
    slow.report(&mut service, WorkerReport::Drain);
    std::thread::sleep(Duration::from_millis(150));
    service.wake();
    service.follow_up();
    fast.answer(&mut service, second);
    let mut third = Peer::join(&mut service, 3);
    let last = third.ask(&mut service);
    third.answer(&mut service, last);
    slow.answer(&mut service, late);
    service.follow_up();
    assert!(results.try_recv().is_ok());
    assert!(service.jobs.is_empty() && service.given.is_empty());
}

#[test]
fn a_machine_that_is_wrong_elsewhere_is_quarantined_here() {
    let mut service = service();
    let mut wrong = Peer::join(&mut service, 1);
    let (job, _results) = Submitted::new(two_pictures());
    service.take(Request::Submit {
        job: Box::new(job),
        job_progress: Arc::default(),
    });
    let lie = wrong.ask(&mut service);
    wrong.answer(&mut service, lie);
    let found = Quarantined {
        machine: MachineId(1),
        name: "trainer-1".to_owned(),
    };
    for _ in 0..2 {
        let (reply, mut done) = oneshot::channel();
        let wrong = vec![found.clone()];
        service.take(Request::Mistrust { wrong, reply });
        assert!(done.try_recv().is_ok());
    }
    service.follow_up();
    assert_eq!(*service.wrong.borrow(), [found]);
    let dismissed = std::iter::from_fn(|| wrong.inbox.try_recv().ok()).find_map(Result::err);
    assert!(dismissed.is_some_and(|status| status.message().contains("quarantined")));
    // The other machine gets both pictures.
    let mut sound = Peer::join(&mut service, 2);
    for _ in 0..2 {
        let lease = sound.ask(&mut service);
        sound.answer(&mut service, lease);
    }
}

#[test]
fn after_a_stall_of_the_coordinator_no_worker_counts_as_silent() {
    let silence = 2 * STALL;
    // The same silence with the coordinator awake, or stopped.
    for (wakes, workers) in [(4, 0), (1, 1)] {
        let mut service = service();
        service.options.silence_limit = silence;
        let _worker = Peer::join(&mut service, 1);
        for _ in 0..wakes {
            service.woken = service.woken.checked_sub(4 * STALL / wakes).unwrap();
            service.wake();
        }
        service.lose_silent_workers();
        assert_eq!(service.workers.len(), workers);
    }
}

fn training() -> TrainingJob {
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"latent\"").unwrap();
    let record = CampaignRecord::begun(CampaignId::from_store("small-1".to_owned()), spec);
    TrainingJob {
        campaign: record.id.clone(),
        weight: record.weight,
        configuration: Configuration::default(),
        shape: record.spec.image().shape(),
        pictures: TrainingPictures::of(&record),
        fine_tuning: None,
        progress: watch::Sender::default(),
        saved: watch::Sender::default(),
    }
}

#[test]
fn a_trainer_that_makes_no_progress_is_told_to_stop() {
    let mut service = service();
    let mut slow = Peer::join(&mut service, 1);
    let (job, _results) = Submitted::new(training());
    service.take(Request::Submit {
        job: Box::new(job),
        job_progress: Arc::default(),
    });
    let lease = slow.ask(&mut service);
    let mut other = Peer::join(&mut service, 2);
    other.report(&mut service, WorkerReport::Credits(1));
    service.clock += Duration::from_mins(6);
    service.follow_up();
    let told = std::iter::from_fn(|| slow.inbox.try_recv().ok()).find_map(|message| {
        match message.unwrap().message {
            Some(Message::Withdrawal(withdrawal)) => withdrawal.lease,
            _ => None,
        }
    });
    assert_eq!(told, Some(lease));
    service.follow_up();
    assert!(other.lease().is_some());
}
