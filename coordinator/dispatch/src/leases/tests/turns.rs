//! Turns of jobs and workers.

use super::*;
use std::collections::VecDeque;

#[test]
fn a_late_lease_is_also_given_to_an_idle_worker() {
    let (mut table, [_, _]) = workers([1, 1]);
    table.submit(params(1));
    let start = now();
    let slow = table.grant(start).unwrap();
    assert_eq!(table.grant(start), None, "it is not late yet");
    let spare = table.grant(start + SPECULATION_DELAY.1 * 2).unwrap();
    assert_ne!(spare.worker, slow.worker);
    assert_eq!(spare.tasks, slow.tasks);
    assert_eq!(
        table.grant(start + SPECULATION_DELAY.1 * 9),
        None,
        "nobody gets it twice"
    );
    table
        .complete(spare.worker, spare.lease, answers(&spare), start)
        .unwrap();
    assert_eq!(results(table.take_events()).len(), 1);
}

#[test]
fn jobs_share_the_workers_by_cost() {
    let (mut table, [worker]) = workers([1_000_000]);
    let heavy = table.submit(JobParams {
        cost: 3,
        ..params(4000)
    });
    let light = table.submit(params(4000));
    let mut had = BTreeMap::from([(heavy, 0), (light, 0)]);
    while table.waiting() > 3000 {
        let grant = table.grant(now()).unwrap();
        *had.get_mut(&grant.job).unwrap() += grant.tasks.len();
        table
            .complete(worker, grant.lease, answers(&grant), now())
            .unwrap();
    }
    let ratio = had[&light] as f64 / had[&heavy] as f64;
    assert!((2.5..3.5).contains(&ratio), "{had:?}");
}

#[test]
fn jobs_that_are_only_shown_have_a_small_share_together() {
    let (mut table, [worker]) = workers([1_000_000]);
    let shown = || JobParams {
        is_shown: true,
        ..params(20)
    };
    let own = table.submit(params(20_000));
    let mut guests: Vec<JobId> = (0..18).map(|_| table.submit(shown())).collect();
    let mut had = [0, 0];
    while had[0] < 10_000 {
        let grant = table.grant(now()).unwrap();
        had[usize::from(grant.job != own)] += grant.tasks.len();
        table
            .complete(worker, grant.lease, answers(&grant), now())
            .unwrap();
        // Whoever got an answer asks again at once.
        if grant.job != own && guests.len() < 1000 {
            guests.push(table.submit(shown()));
        }
    }
    assert!(had[1] > 0 && 8 * had[1] < 12 * had[0] / 10, "{had:?}");
}

#[test]
fn a_job_after_another_waits_for_it_and_both_have_one_turn() {
    let (mut table, [worker]) = workers([1_000_000]);
    let first = table.submit(params(1000));
    let other = table.submit(params(4000));
    let second = table.submit(JobParams {
        after: Some(first),
        ..params(1000)
    });
    let mut had = BTreeMap::from([(first, 0), (other, 0), (second, 0)]);
    while had[&second] < 900 {
        let grant = table.grant(now()).unwrap();
        *had.get_mut(&grant.job).unwrap() += grant.tasks.len();
        assert!(grant.job != second || had[&first] == 1000, "{had:?}");
        table
            .complete(worker, grant.lease, answers(&grant), now())
            .unwrap();
    }
    let ratio = (had[&first] + had[&second]) as f64 / had[&other] as f64;
    assert!((0.8..1.2).contains(&ratio), "{had:?}");
}

#[test]
fn who_gives_a_job_back_pauses_from_it_for_longer_each_time_and_does_others_meanwhile() {
    let (mut table, [worker]) = workers([1000]);
    let mut now = now();
    let broken = table.submit(params(1));
    let mut pauses = Vec::new();
    let mut grant = table.grant(now).unwrap();
    for _ in 0..8 {
        assert_eq!(grant.job, broken);
        table.give_back(worker, grant.lease, now);
        let sound = table.submit(params(1));
        let other = table.grant(now).unwrap();
        assert_eq!(other.job, sound, "another job is done at once");
        table.complete(worker, other.lease, answers(&other), now).unwrap();
        let begun = now;
        grant = loop {
            match table.grant(now) {
                Some(grant) => break grant,
                None => now += Duration::from_millis(50),
            }
        };
        pauses.push((now - begun).as_millis());
    }
    assert_eq!(pauses, [200, 400, 800, 1600, 3200, 6400, 10_000, 10_000]);
}

#[test]
fn a_small_job_does_not_wait_for_a_large_one() {
    let (mut table, [_]) = workers([1000]);
    let large = table.submit(params(10_000));
    assert_eq!(table.grant(now()).unwrap().job, large);
    let small = table.submit(params(2));
    let next: Vec<_> = (0..3).map(|_| table.grant(now()).unwrap().job).collect();
    assert!(next.contains(&small), "{next:?}");
}

#[test]
fn whoever_has_least_in_hand_is_next() {
    let (mut table, [many, few]) = workers([64, 4]);
    table.submit(params(2));
    assert_eq!(
        table.grant(now()).unwrap().worker,
        many,
        "with equal loads, the one with more room"
    );
    assert_eq!(table.grant(now()).unwrap().worker, few);
}

#[test]
fn silence_is_noticed() {
    let (mut table, [worker]) = workers([1]);
    let later = now() + Duration::from_secs(60);
    assert_eq!(table.silent(later, Duration::from_secs(30)), [worker]);
    table.keep_alive(worker, later);
    assert_eq!(table.silent(later, Duration::from_secs(30)), []);
}

/// Sizes of the batches of a job. Every worker answers in turn and asks for as many tasks again.
fn sizes(table: &mut LeaseTable<u64>, tasks: usize) -> Vec<usize> {
    table.submit(params(tasks));
    let (mut sizes, mut out) = (Vec::new(), VecDeque::new());
    loop {
        while let Some(grant) = table.grant(now()) {
            sizes.push(grant.tasks.len());
            out.push_back(grant);
        }
        let Some(grant) = out.pop_front() else {
            return sizes;
        };
        table
            .complete(grant.worker, grant.lease, answers(&grant), now())
            .unwrap();
        table.add_credits(grant.worker, grant.tasks.len());
    }
}

#[test]
fn batches_are_whole_vectors_for_as_long_as_there_are_enough_for_all() {
    let (mut table, [_, _]) = workers([16, 16]);
    let whole = [AT_ONCE; 12];
    assert_eq!(sizes(&mut table, 100), [&whole[..], &[1; 4]].concat());
    let (mut table, [_]) = workers([64]);
    assert_eq!(sizes(&mut table, 100), [32, 32, 16, 8, 8, 2, 1, 1]);
}

#[test]
fn where_workers_are_many_each_gets_little() {
    let (mut table, _) = workers([16; 40]);
    let sizes = sizes(&mut table, 100);
    assert_eq!(&sizes[..40], [vec![2; 10], vec![1; 30]].concat());
}
