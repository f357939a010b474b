//! The lease table under every order of events that a cluster can produce.

use super::*;
use proptest::prelude::*;

impl Agree for u64 {
    fn agrees_with(&self, other: &Self) -> bool {
        self == other
    }
}

/// What the one right answer to a task is.
fn answer(job: JobId, task: usize) -> u64 {
    job.0 * 1000 + task as u64
}

fn answers(grant: &Grant) -> Vec<u64> {
    grant.tasks.iter().map(|&task| answer(grant.job, task)).collect()
}

fn one_worker(credits: usize) -> (LeaseTable<u64>, WorkerId) {
    let mut table = LeaseTable::new();
    let worker = table.join(1, Instant::now());
    table.add_credits(worker, credits);
    (table, worker)
}

#[test]
fn without_credits_nothing_is_leased() {
    let (mut table, worker) = one_worker(0);
    table.submit(3);
    assert_eq!(table.grant(), None);
    table.add_credits(worker, 1);
    assert_eq!(table.grant().unwrap().tasks.len(), 1);
    assert_eq!(table.grant(), None);
}

#[test]
fn a_lost_workers_tasks_go_out_again_and_its_late_result_still_counts() {
    let (mut table, first) = one_worker(1);
    let job = table.submit(1);
    let lost = table.grant().unwrap();
    table.lose(first);
    let second = table.join(1, Instant::now());
    table.add_credits(second, 1);
    let again = table.grant().unwrap();
    assert_eq!((again.worker, &again.tasks), (second, &lost.tasks));
    let done = Progress::JobDone {
        job,
        results: answers(&lost),
    };
    assert_eq!(table.complete(lost.lease, answers(&lost)), Ok(done));
    assert_eq!(
        table.complete(again.lease, answers(&again)),
        Err(Refused::UnknownLease)
    );
}

#[test]
fn a_second_result_that_differs_ends_the_job_in_disagreement() {
    let (mut table, first) = one_worker(1);
    let job = table.submit(2);
    let lost = table.grant().unwrap();
    table.lose(first);
    let second = table.join(1, Instant::now());
    table.add_credits(second, 1);
    let again = table.grant().unwrap();
    assert_eq!(again.tasks, lost.tasks);
    assert_eq!(
        table.complete(lost.lease, answers(&lost)),
        Ok(Progress::Kept { job, fresh: 1 })
    );
    let task = again.tasks[0];
    assert_eq!(
        table.complete(again.lease, vec![99_999]),
        Ok(Progress::Disagreement { job, task })
    );
}

#[test]
fn a_wrong_number_of_results_changes_nothing() {
    let (mut table, _) = one_worker(5);
    table.submit(4);
    let grant = table.grant().unwrap();
    let refused = Refused::WrongCount {
        got: 0,
        wanted: grant.tasks.len(),
    };
    assert_eq!(table.complete(grant.lease, vec![]), Err(refused));
    assert!(table.complete(grant.lease, answers(&grant)).is_ok());
}

#[test]
fn jobs_take_turns() {
    let (mut table, _) = one_worker(1000);
    let (big, small) = (table.submit(500), table.submit(2));
    let order: Vec<_> = (0..4)
        .filter_map(|_| table.grant())
        .map(|grant| grant.job)
        .collect();
    assert_eq!(order, [big, small, big, small]);
}

#[test]
fn silence_is_noticed() {
    let (mut table, worker) = one_worker(1);
    let later = Instant::now() + Duration::from_secs(60);
    assert_eq!(table.silent(later, Duration::from_secs(30)), [worker]);
    table.hear(worker, later);
    assert_eq!(table.silent(later, Duration::from_secs(30)), []);
}

/// One thing that may happen to a cluster.
#[derive(Debug, Clone)]
enum Event {
    Join { credits: usize },
    Lose { pick: usize },
    Drain { pick: usize },
    Grant,
    Answer { pick: usize },
    AnswerAgain { pick: usize },
    GiveBack { pick: usize },
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        (1..20usize).prop_map(|credits| Event::Join { credits }),
        (0..8usize).prop_map(|pick| Event::Lose { pick }),
        (0..8usize).prop_map(|pick| Event::Drain { pick }),
        Just(Event::Grant),
        Just(Event::Grant),
        (0..50usize).prop_map(|pick| Event::Answer { pick }),
        (0..50usize).prop_map(|pick| Event::AnswerAgain { pick }),
        (0..50usize).prop_map(|pick| Event::GiveBack { pick }),
    ]
}

proptest! {
    /// Whatever happens on the way, one patient worker at the end finishes every job, and each task once.
    #[test]
    fn no_task_is_lost_or_done_twice(sizes in prop::collection::vec(1..40usize, 1..4), events in prop::collection::vec(event(), 0..200)) {
        let now = Instant::now();
        let mut table = LeaseTable::new();
        let mut left: BTreeMap<JobId, usize> = sizes.iter().map(|&size| (table.submit(size), size)).collect();
        let (mut workers, mut out, mut answered) = (vec![], vec![], vec![]);
        let mut take = |progress: Result<Progress<u64>, Refused>| match progress {
            Ok(Progress::Kept { job, fresh }) => *left.get_mut(&job).unwrap() -= fresh,
            Ok(Progress::JobDone { job, results }) => {
                assert!(left.remove(&job).is_some(), "a job ended twice");
                assert!(results.iter().enumerate().all(|(task, &result)| result == answer(job, task)));
            }
            Ok(Progress::Disagreement { .. }) => panic!("workers that tell the truth agree"),
            Err(refused) => assert_eq!(refused, Refused::UnknownLease),
        };
        for event in events {
            match event {
                Event::Join { credits } => {
                    let worker = table.join(2, now);
                    table.add_credits(worker, credits);
                    workers.push(worker);
                }
                Event::Lose { pick } if pick < workers.len() => table.lose(workers.swap_remove(pick)),
                Event::Drain { pick } if pick < workers.len() => table.drain(workers[pick]),
                Event::Grant => out.extend(table.grant()),
                Event::Answer { pick } if pick < out.len() => {
                    let grant: Grant = out.swap_remove(pick);
                    take(table.complete(grant.lease, answers(&grant)));
                    answered.push(grant);
                }
                Event::AnswerAgain { pick } if pick < answered.len() => {
                    let grant = &answered[pick];
                    take(table.complete(grant.lease, answers(grant)));
                }
                Event::GiveBack { pick } if pick < out.len() => table.come_back(out[pick].lease),
                _ => {}
            }
        }
        for worker in workers {
            table.lose(worker);
        }
        let patient = table.join(1, now);
        table.add_credits(patient, 1_000_000);
        while let Some(grant) = table.grant() {
            take(table.complete(grant.lease, answers(&grant)));
        }
        prop_assert!(left.is_empty(), "tasks were lost: {left:?}");
        prop_assert!(table.leases.is_empty(), "leases leak");
    }
}
