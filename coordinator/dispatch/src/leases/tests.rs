//! Tests of the lease table, case by case.

use super::*;

mod audits;
mod machines;
mod turns;

const DISPUTE_TIMEOUT: Duration = Duration::from_secs(5);
const ABLE: Abilities = Abilities {
    capacity: 1,
    embeds: true,
};

/// A process on a machine of its own.
fn process(number: u64) -> WorkerProcessId {
    worker_of(number, number)
}

fn worker_of(machine: u64, instance: u64) -> WorkerProcessId {
    WorkerProcessId {
        machine: MachineId(machine),
        instance,
    }
}

/// Connects a worker with `credits` credits.
fn join(table: &mut LeaseTable<u64>, process: WorkerProcessId, credits: usize) -> WorkerId {
    let worker = table.join(process, ABLE, now()).unwrap();
    table.add_credits(worker, credits);
    worker
}

fn now() -> Instant {
    Instant::now()
}

fn answer(job: JobId, place: usize) -> u64 {
    job.0 * 1000 + place as u64
}

fn answers(grant: &Grant) -> Vec<u64> {
    grant
        .tasks
        .iter()
        .map(|&place| answer(grant.job, place))
        .collect()
}

fn params(tasks: usize) -> JobParams {
    JobParams {
        tasks,
        cost: 1,
        audited: BTreeSet::new(),
        embeds: false,
        speculative: true,
        after: None,
        is_shown: false,
    }
}

fn audited(tasks: usize) -> JobParams {
    JobParams {
        audited: (0..tasks).collect(),
        ..params(tasks)
    }
}

/// A table with one worker for each entry of `credits`, on machines 1, 2, ...
fn workers<const N: usize>(credits: [usize; N]) -> (LeaseTable<u64>, [WorkerId; N]) {
    let mut table = LeaseTable::new(DISPUTE_TIMEOUT);
    let mut instance = 0;
    let ids = credits.map(|credits| {
        instance += 1;
        let id = table.join(process(instance), ABLE, now()).unwrap();
        table.add_credits(id, credits);
        id
    });
    (table, ids)
}

fn results(events: Vec<Event<u64>>) -> Vec<Settled<u64>> {
    events
        .into_iter()
        .find_map(|events| match events {
            Event::Done { results, .. } => Some(results),
            _ => None,
        })
        .expect("the job is done")
}

#[test]
fn without_credits_nothing_is_leased() {
    let (mut table, [worker]) = workers([0]);
    table.submit(params(3));
    assert_eq!(table.grant(now()), None);
    table.add_credits(worker, 1);
    assert_eq!(table.grant(now()).unwrap().tasks.len(), 1);
    assert_eq!(table.grant(now()), None);
}

#[test]
fn a_lost_workers_tasks_go_out_again_and_its_late_result_still_counts() {
    let (mut table, [first, second]) = workers([1, 0]);
    let job = table.submit(params(1));
    let lost = table.grant(now()).unwrap();
    table.lose(first);
    table.add_credits(second, 1);
    let again = table.grant(now()).unwrap();
    assert_eq!((again.worker, &again.tasks), (second, &lost.tasks));
    let back = table.join(process(1), ABLE, now()).unwrap();
    table.complete(back, lost.lease, answers(&lost), now()).unwrap();
    let expected = Settled::Result {
        value: answer(job, 0),
        by: process(1),
        audited: false,
    };
    assert_eq!(results(table.take_events()), [expected]);
    let late = table.complete(second, again.lease, answers(&again), now());
    assert_eq!(late, Err(Refused::UnknownLease));
}

#[test]
fn results_count_only_from_the_worker_that_has_the_lease() {
    let (mut table, [first, second]) = workers([1, 0]);
    table.submit(params(1));
    let grant = table.grant(now()).unwrap();
    let stolen = table.complete(second, grant.lease, vec![13], now());
    assert_eq!(stolen, Err(Refused::NotYours));
    assert_eq!(table.complete(first, grant.lease, answers(&grant), now()), Ok(()));
}

#[test]
fn a_wrong_number_of_results_changes_nothing() {
    let (mut table, [worker]) = workers([5]);
    table.submit(params(4));
    let grant = table.grant(now()).unwrap();
    let refused = Refused::WrongCount {
        got: 0,
        wanted: grant.tasks.len(),
    };
    assert_eq!(table.complete(worker, grant.lease, vec![], now()), Err(refused));
    assert_eq!(
        table.complete(worker, grant.lease, answers(&grant), now()),
        Ok(())
    );
}

#[test]
fn an_audited_task_is_done_by_two_and_whoever_is_outvoted_is_quarantined() {
    let (mut table, [_, _, honest]) = workers([1, 1, 1]);
    table.submit(audited(1));
    let right = table.grant(now()).unwrap();
    table
        .complete(right.worker, right.lease, answers(&right), now())
        .unwrap();
    let wrong = table.grant(now()).unwrap();
    assert_ne!(wrong.worker, right.worker);
    let liar = table.process(wrong.worker).unwrap();
    table
        .complete(wrong.worker, wrong.lease, vec![13], now())
        .unwrap();
    let third = table.grant(now()).unwrap();
    assert!(![right.worker, wrong.worker].contains(&third.worker));
    table
        .complete(third.worker, third.lease, answers(&third), now())
        .unwrap();
    let events = table.take_events();
    let quarantined = Event::Quarantined {
        process: liar,
        workers: vec![wrong.worker],
        again: 0,
    };
    assert!(events.contains(&quarantined), "{events:?}");
    assert!(matches!(
        results(events)[..],
        [Settled::Result { audited: true, .. }]
    ));
    assert_eq!(table.join(liar, ABLE, now()), None);
    assert!(table.quarantined.contains(&liar.machine) && table.process(honest).is_some());
}

#[test]
fn what_a_quarantined_worker_did_unaudited_is_done_again() {
    let (mut table, [first, _]) = workers([1, 0]);
    let job = table.submit(params(2));
    let grant = table.grant(now()).unwrap();
    table.complete(first, grant.lease, vec![13], now()).unwrap();
    table.quarantine(process(1));
    let events = table.take_events();
    assert!(events.contains(&Event::Progress { job, settled: 1 }));
    assert!(events.contains(&Event::Progress { job, settled: 0 }));
    table.add_credits(WorkerId(1), 2);
    let again: Vec<_> = std::iter::from_fn(|| table.grant(now()))
        .flat_map(|grant| grant.tasks)
        .collect();
    assert_eq!(again, [0, 1]);
}

#[test]
fn an_audit_without_a_second_worker_is_waived() {
    let (mut table, [only]) = workers([9]);
    table.submit(audited(1));
    let grant = table.grant(now()).unwrap();
    table.complete(only, grant.lease, answers(&grant), now()).unwrap();
    assert_eq!(table.grant(now()), None);
    assert!(matches!(
        results(table.take_events())[..],
        [Settled::Result { audited: false, .. }]
    ));
}

#[test]
fn an_audit_does_not_wait_for_a_worker_that_hangs() {
    let (mut table, [_, _]) = workers([1, 1]);
    table.submit(audited(1));
    let start = now();
    let first = table.grant(start).unwrap();
    table
        .complete(first.worker, first.lease, answers(&first), start)
        .unwrap();
    let second = table.grant(start).unwrap();
    assert_ne!(second.worker, first.worker);
    assert_eq!(table.grant(start), None);
    assert!(table.jobs.contains_key(&second.job));
    assert_eq!(table.grant(start + 2 * SPECULATION_DELAY.1), None);
    assert!(matches!(
        results(table.take_events())[..],
        [Settled::Result { audited: false, .. }]
    ));
}

#[test]
fn an_audit_does_not_wait_for_a_worker_that_hangs_and_takes_nothing_more() {
    let (mut table, [_]) = workers([1]);
    let start = now();
    table.submit(params(1));
    table.grant(start).expect("what it hangs over");
    let job = table.submit(audited(1));
    let sound = join(&mut table, process(2), 1);
    let first = table.grant(start).unwrap();
    assert_eq!(first.worker, sound);
    table
        .complete(sound, first.lease, answers(&first), start)
        .unwrap();
    assert_eq!(table.grant(start), None);
    assert!(table.jobs.contains_key(&job), "it may be done in time");
    assert_eq!(table.grant(start + 2 * SPECULATION_DELAY.1), None);
    assert!(!table.jobs.contains_key(&job));
}

#[test]
fn an_audit_that_is_too_slow_for_its_job_goes_on_and_finds_who_was_wrong() {
    let (mut table, [liar, slow, third]) = workers([1, 1, 0]);
    table.submit(audited(1));
    let start = now();
    let first = table.grant(start).unwrap();
    let second = table.grant(start);
    assert_eq!(
        (first.worker, second),
        (liar, None),
        "the second vote is not wanted yet"
    );
    table.complete(liar, first.lease, vec![13], start).unwrap();
    let late = table.grant(start).unwrap();
    assert_eq!(late.worker, slow);
    let later = start + 2 * SPECULATION_DELAY.1;
    // The third machine asks for nothing for so long that only the slow one could answer.
    table.lose(third);
    assert_eq!(table.grant(later), None);
    let events = table.take_events();
    let audits = events.iter().find_map(|event| match event {
        Event::Done { audits, .. } => audits.clone(),
        _ => None,
    });
    let audits = audits.expect("the audit goes on");
    assert_eq!(audits.places, [0]);
    assert!(matches!(
        results(events)[..],
        [Settled::Result {
            value: 13,
            audited: false,
            ..
        }]
    ));
    // The lease of the slow worker has gone over to the audits.
    assert_eq!(table.leased(slow, late.lease), Some(audits.job));
    table.complete(slow, late.lease, vec![7], later).unwrap();
    let third = join(&mut table, process(3), 1);
    let decides = table.grant(later).unwrap();
    assert_eq!(decides.worker, third);
    table.complete(third, decides.lease, vec![7], later).unwrap();
    let events = table.take_events();
    let quarantined = |event: &Event<u64>| matches!(event, Event::Quarantined { process, .. } if process.machine == MachineId(1));
    assert!(events.iter().any(quarantined), "{events:?}");
    assert!(table.jobs.is_empty());
}

#[test]
fn a_job_waits_for_audits_beyond_the_limit_unless_the_other_machines_hang() {
    let (mut table, [fast, _slow]) = workers([0, 1]);
    let start = now();
    table.submit(params(1));
    table
        .grant(start)
        .expect("a lease that the slow worker is late with");
    table.add_credits(fast, 1_000_000);
    let work = |table: &mut LeaseTable<u64>, now: Instant| {
        let job = table.submit(audited(30));
        while let Some(grant) = table.grant(now) {
            table.complete(fast, grant.lease, answers(&grant), now).unwrap();
        }
        let waits = table.jobs.contains_key(&job);
        table.forget(job);
        waits
    };
    let later = start + 2 * SPECULATION_DELAY.1;
    let waits: Vec<_> = (0..12).map(|_| work(&mut table, later)).collect();
    assert_eq!(
        waits.iter().filter(|&&waits| waits).count(),
        4,
        "8 jobs of 30 have room"
    );
    let audits = |table: &LeaseTable<u64>| {
        let audits = table.jobs.values().filter(|job| job.is_audits);
        audits.map(|job| job.tasks.len()).sum::<usize>()
    };
    assert_eq!(audits(&table), 240);
    let hangs = start + 2 * HANGS_AFTER;
    assert!(!work(&mut table, hangs), "nobody waits for a machine that hangs");
    assert!(audits(&table) >= 240, "audits go on");
    table.grant(start + 2 * HOPELESS_AFTER);
    assert_eq!(audits(&table), 0, "no machine could answer any more");
}

#[test]
fn an_audit_does_not_wait_for_a_worker_that_asks_for_nothing() {
    let (mut table, [sound, _]) = workers([1, 0]);
    let start = now();
    table.submit(audited(1));
    let first = table.grant(start).unwrap();
    table
        .complete(sound, first.lease, answers(&first), start)
        .unwrap();
    assert_eq!(table.grant(start), None);
    assert_eq!(table.jobs.len(), 1, "it may have only just come");
    assert_eq!(table.grant(start + 2 * SPECULATION_DELAY.1), None);
    assert_eq!(table.jobs.len(), 0);
}

#[test]
fn an_audit_does_not_wait_for_a_machine_that_gives_work_back() {
    let (mut table, [sound]) = workers([1]);
    table.submit(audited(1));
    let first = table.grant(now()).unwrap();
    let unfit = join(&mut table, process(2), 1);
    table
        .complete(sound, first.lease, answers(&first), now())
        .unwrap();
    let second = table.grant(now()).unwrap();
    assert_eq!(second.worker, unfit);
    table.give_back(unfit, second.lease, now());
    assert_eq!(table.grant(now()), None);
    assert!(matches!(
        results(table.take_events())[..],
        [Settled::Result { audited: false, .. }]
    ));
}

#[test]
fn two_that_differ_with_no_third_end_the_job() {
    let (mut table, _) = workers([1, 1]);
    let job = table.submit(audited(1));
    for words in [13, 14] {
        let grant = table.grant(now()).unwrap();
        table
            .complete(grant.worker, grant.lease, vec![words], now())
            .unwrap();
    }
    assert_eq!(table.grant(now()), None);
    assert!(table.jobs.contains_key(&job), "a third may come");
    assert_eq!(table.grant(now() + 2 * DISPUTE_TIMEOUT), None);
    let between = vec![process(2), process(1)];
    let expected = |between: &[WorkerProcessId]| Event::Disagreement {
        job,
        task: 0,
        between: between.to_vec(),
    };
    let events = table.take_events();
    let reversed: Vec<_> = between.iter().rev().copied().collect();
    assert!(
        events.contains(&expected(&between)) || events.contains(&expected(&reversed)),
        "{events:?}"
    );
}

#[test]
fn a_task_that_takes_three_workers_is_poisoned_and_its_neighbours_are_not() {
    let (mut table, [first]) = workers([4]);
    table.submit(params(4));
    while table.grant(now()).is_some() {}
    table.lose(first);
    let deadly = 2;
    let mut lost = vec![process(1)];
    for instance in 2.. {
        let worker = table.join(process(instance), ABLE, now()).unwrap();
        table.add_credits(worker, 100);
        while let Some(grant) = table.grant(now()) {
            assert_eq!(grant.tasks.len(), 1, "suspects go out alone");
            assert_eq!(table.grant(now()), None, "and with nothing beside them");
            if grant.tasks == [deadly] {
                lost.push(process(instance));
                table.lose(worker);
                break;
            }
            table
                .complete(worker, grant.lease, answers(&grant), now())
                .unwrap();
        }
        if lost.len() == MOST_LOST {
            break;
        }
    }
    let worker = table.join(process(99), ABLE, now()).unwrap();
    table.add_credits(worker, 100);
    while let Some(grant) = table.grant(now()) {
        table
            .complete(worker, grant.lease, answers(&grant), now())
            .unwrap();
    }
    for (place, settled) in results(table.take_events()).into_iter().enumerate() {
        match settled {
            Settled::Poisoned { lost: whom } => assert_eq!((place, &whom), (deadly, &lost)),
            Settled::Result { .. } => assert_ne!(place, deadly),
        }
    }
}

#[test]
fn a_worker_that_comes_back_was_not_taken_by_what_it_held() {
    let (mut table, [worker]) = workers([1]);
    table.submit(params(1));
    let mut held = table.grant(now()).unwrap();
    let mut connection = worker;
    for _ in 0..10 {
        table.lose(connection);
        connection = table.join(process(1), ABLE, now()).unwrap();
        table.add_credits(connection, 1);
        held = table.grant(now()).expect("it is tried again");
    }
    assert_eq!(
        table.complete(connection, held.lease, answers(&held), now()),
        Ok(())
    );
}

#[test]
fn what_gets_on_is_not_poisoned_however_often_it_is_interrupted() {
    let (mut table, _) = workers([]);
    table.submit(params(1));
    for instance in 1..10 {
        let worker = table.join(process(instance), ABLE, now()).unwrap();
        table.add_credits(worker, 1);
        let held = table.grant(now()).expect("it is tried again");
        table.get_on(held.lease, now());
        table.lose(worker);
    }
    assert_eq!((table.waiting(), table.take_events().len()), (1, 9));
}
