//! All workers of a machine have one vote together. A machine's reports or losses do not end a task that another machine could
//! do.

use super::*;

#[test]
fn workers_of_one_machine_have_one_vote() {
    let (mut table, []) = workers([]);
    table.submit(audited(1));
    let liars = [1, 2].map(|instance| join(&mut table, worker_of(7, instance), 1));
    let lie = table.grant(now()).unwrap();
    assert!(liars.contains(&lie.worker));
    table.complete(lie.worker, lie.lease, vec![13], now()).unwrap();
    assert_eq!(
        table.take_events(),
        [Event::Progress {
            job: lie.job,
            settled: 0
        }]
    );
    let honest = join(&mut table, process(1), 1);
    let truth = table.grant(now()).unwrap();
    assert_eq!(truth.worker, honest);
    table
        .complete(honest, truth.lease, answers(&truth), now())
        .unwrap();
    assert_eq!(table.grant(now()), None, "its second worker has nothing to say");
    let third = join(&mut table, process(2), 1);
    let decides = table.grant(now()).unwrap();
    assert_eq!(decides.worker, third);
    table
        .complete(third, decides.lease, answers(&decides), now())
        .unwrap();
    let events = table.take_events();
    let quarantined = events.iter().find_map(|events| match events {
        Event::Quarantined { process, workers, .. } => Some((process.machine, workers.as_slice())),
        _ => None,
    });
    assert_eq!(quarantined, Some((MachineId(7), liars.as_slice())));
    let [Settled::Result { value, .. }] = results(events)[..] else {
        panic!("one result")
    };
    assert_eq!(value, answer(truth.job, 0));
    assert_eq!(
        table.join(worker_of(7, 3), ABLE, now()),
        None,
        "nor comes it back as another"
    );
}

#[test]
fn a_machine_that_contradicts_itself_is_quarantined() {
    let (mut table, []) = workers([]);
    let job = table.submit(audited(1));
    let start = now();
    let slow = join(&mut table, worker_of(7, 1), 1);
    let first = table.grant(start).unwrap();
    // Another machine is connected, so that the task is audited.
    let honest = join(&mut table, process(1), 0);
    join(&mut table, worker_of(7, 2), 1);
    let late = table.grant(start + 2 * SPECULATION_DELAY.1).unwrap();
    assert_eq!(late.tasks, first.tasks);
    table.complete(late.worker, late.lease, vec![13], start).unwrap();
    table.complete(slow, first.lease, vec![14], start).unwrap();
    assert_eq!(table.join(worker_of(7, 3), ABLE, start), None);
    table.add_credits(honest, 1);
    let again = table.grant(start).unwrap();
    assert_eq!((again.worker, again.job), (honest, job));
}

#[test]
fn three_workers_of_one_machine_do_not_condemn_a_task_that_another_can_try() {
    let (mut table, []) = workers([]);
    let job = table.submit(params(1));
    let other = join(&mut table, process(1), 0);
    for instance in 1..=3 {
        let victim = join(&mut table, worker_of(7, instance), 1);
        assert_eq!(table.grant(now()).unwrap().worker, victim);
        table.lose(victim);
    }
    join(&mut table, worker_of(7, 4), 1);
    assert_eq!(table.grant(now()), None, "it waits for the other machine");
    table.add_credits(other, 1);
    let grant = table.grant(now()).unwrap();
    assert_eq!(grant.worker, other);
    table
        .complete(other, grant.lease, answers(&grant), now())
        .unwrap();
    let done = results(table.take_events());
    assert!(matches!(done[..], [Settled::Result { value, .. }] if value == answer(job, 0)));
}

#[test]
fn where_there_is_one_machine_three_of_its_workers_condemn_a_task() {
    let (mut table, []) = workers([]);
    table.submit(params(1));
    for instance in 1..=3 {
        let victim = join(&mut table, worker_of(7, instance), 1);
        table.grant(now()).unwrap();
        table.lose(victim);
    }
    join(&mut table, worker_of(7, 4), 1);
    assert_eq!(table.grant(now()), None);
    let lost = (1..=3).map(|instance| worker_of(7, instance)).collect();
    assert_eq!(results(table.take_events()), [Settled::Poisoned { lost }]);
}

#[test]
fn what_embeds_goes_to_workers_that_embed() {
    let (mut table, []) = workers([]);
    let embeds = JobParams {
        embeds: true,
        ..audited(1)
    };
    let job = table.submit(embeds);
    assert!(!table.lacks_embedders(), "nobody is there at all");
    let unable = Abilities {
        embeds: false,
        ..ABLE
    };
    let unable = table.join(process(1), unable, now()).unwrap();
    table.add_credits(unable, 9);
    assert!(table.lacks_embedders());
    assert_eq!(table.grant(now()), None);
    let simulates = table.submit(params(1));
    assert_eq!(table.grant(now()).unwrap().job, simulates);
    let able = join(&mut table, process(2), 1);
    assert!(!table.lacks_embedders());
    let grant = table.grant(now()).unwrap();
    assert_eq!((grant.worker, grant.job), (able, job));
    table.complete(able, grant.lease, answers(&grant), now()).unwrap();
    // The worker that cannot embed does not audit either.
    table.grant(now());
    assert!(matches!(
        results(table.take_events())[..],
        [Settled::Result { audited: false, .. }]
    ));
}

#[test]
fn what_one_machine_cannot_do_another_does() {
    let (mut table, [_, _]) = workers([1, 1]);
    table.submit(params(1));
    let refused = table.grant(now()).unwrap();
    table.refuse(refused.worker, refused.lease, now());
    let done = table.grant(now()).unwrap();
    assert_ne!(done.worker, refused.worker);
    table
        .complete(done.worker, done.lease, answers(&done), now())
        .unwrap();
    assert_eq!(results(table.take_events()).len(), 1);
    assert!(
        table.process(refused.worker).is_some(),
        "nobody is quarantined for it"
    );
}

fn impossible(events: Vec<Event<u64>>) -> Option<Vec<WorkerProcessId>> {
    events.into_iter().find_map(|events| match events {
        Event::Impossible { by, .. } => Some(by),
        _ => None,
    })
}

#[test]
fn what_two_machines_cannot_do_ends_the_job() {
    let (mut table, []) = workers([]);
    table.submit(params(1));
    for process in [worker_of(1, 1), worker_of(1, 2), worker_of(2, 3)] {
        join(&mut table, process, 1);
    }
    let start = now();
    for _ in 0..2 {
        assert_eq!(impossible(table.take_events()), None);
        let grant = table.grant(start).unwrap();
        table.refuse(grant.worker, grant.lease, start);
    }
    let by = impossible(table.take_events()).expect("it is impossible");
    let machines: BTreeSet<_> = by.iter().map(|process| process.machine.0).collect();
    assert_eq!(machines, BTreeSet::from([1, 2]));
    assert!(table.jobs.is_empty());
}

#[test]
fn what_a_liar_alone_could_do_ends_the_job_once_the_liar_is_found_wrong() {
    let (mut table, []) = workers([]);
    table.submit(audited(1));
    let liar = join(&mut table, process(7), 1);
    // Another machine is connected, so that the audit is not waived.
    let hangs = join(&mut table, process(8), 0);
    let lie = table.grant(now()).unwrap();
    table.complete(liar, lie.lease, vec![13], now()).unwrap();
    for number in [1, 2] {
        let honest = join(&mut table, process(number), 1);
        let grant = table.grant(now()).unwrap();
        assert_eq!(grant.worker, honest);
        table.refuse(honest, grant.lease, now());
    }
    assert_eq!(impossible(table.take_events()), None, "somebody has done it");
    table.quarantine(process(7));
    assert_eq!(
        impossible(table.take_events()),
        Some(vec![process(1), process(2)])
    );
    assert!(table.jobs.is_empty() && table.process(hangs).is_some());
}

#[test]
fn what_the_only_machine_cannot_do_ends_the_job_unless_another_comes_in_time() {
    let (mut table, []) = workers([]);
    table.submit(params(1));
    let only = [1, 2].map(|instance| join(&mut table, worker_of(1, instance), 1));
    let start = now();
    let grant = table.grant(start).unwrap();
    table.refuse(grant.worker, grant.lease, start);
    assert_eq!(table.grant(start), None);
    // Without any worker, the task waits for a new worker.
    for worker in only {
        table.lose(worker);
    }
    let mut later = start + 2 * DISPUTE_TIMEOUT;
    assert_eq!(table.grant(later), None);
    join(&mut table, worker_of(1, 3), 1);
    assert_eq!(table.grant(later), None);
    assert_eq!(impossible(table.take_events()), None);
    later += 2 * DISPUTE_TIMEOUT;
    assert_eq!(table.grant(later), None);
    assert_eq!(
        impossible(table.take_events()),
        Some(vec![worker_of(1, grant_instance(&grant, only))])
    );
}

fn grant_instance(grant: &Grant, workers: [WorkerId; 2]) -> u64 {
    if grant.worker == workers[0] { 1 } else { 2 }
}

#[test]
fn a_quarantined_machine_condemns_nothing() {
    let (mut table, []) = workers([]);
    table.submit(params(2));
    for instance in 1..=3 {
        let victim = join(&mut table, worker_of(7, instance), 1);
        table.grant(now()).unwrap();
        table.lose(victim);
    }
    join(&mut table, worker_of(7, 4), 9);
    table.grant(now());
    table.quarantine(worker_of(7, 4));
    let honest = join(&mut table, process(1), 9);
    while let Some(grant) = table.grant(now()) {
        table
            .complete(honest, grant.lease, answers(&grant), now())
            .unwrap();
    }
    let done = results(table.take_events());
    assert!(
        done.iter()
            .all(|settled| matches!(settled, Settled::Result { .. }))
    );
}

/// A machine with this many connections that takes every lease and answers none, and a sound one.
fn beside_a_machine_that_hangs(connections: u64) -> (LeaseTable<u64>, WorkerId) {
    let (mut table, []) = workers([]);
    for instance in 0..connections {
        join(&mut table, worker_of(7, instance), 4096);
    }
    let sound = join(&mut table, process(1), 64);
    (table, sound)
}

/// Grants all that can be granted, and answers as the sound worker; other grants go to `hung`. Returns whether the jobs are over,
/// except for audits.
fn work(table: &mut LeaseTable<u64>, sound: WorkerId, hung: &mut Vec<Grant>, now: Instant) -> bool {
    while let Some(grant) = table.grant(now) {
        if grant.worker == sound {
            table.complete(sound, grant.lease, answers(&grant), now).unwrap();
            table.add_credits(sound, grant.tasks.len());
        } else {
            hung.push(grant);
        }
    }
    table.jobs.values().all(|job| job.is_audits)
}

/// Works in steps of a tenth of a second until the jobs are over; returns how long that takes.
fn work_until_over(table: &mut LeaseTable<u64>, sound: WorkerId, hung: &mut Vec<Grant>) -> Duration {
    let (start, step) = (now(), Duration::from_millis(100));
    let mut times = (0..1000).map(|steps| step * steps);
    let over = times.find(|&passed| work(table, sound, hung, start + passed));
    over.expect("the jobs end")
}

#[test]
fn an_audit_is_not_tried_on_each_connection_of_a_machine_that_hangs() {
    let (mut table, sound) = beside_a_machine_that_hangs(10);
    table.submit(audited(4));
    let took = work_until_over(&mut table, sound, &mut Vec::new());
    assert!(took <= 3 * SPECULATION_DELAY.1, "{took:?}");
}

#[test]
fn a_machine_that_hangs_gets_nothing_until_it_answers() {
    let (mut table, sound) = beside_a_machine_that_hangs(2);
    let (start, mut hung) = (now(), Vec::new());
    table.submit(params(64));
    work_until_over(&mut table, sound, &mut hung);
    assert!(!hung.is_empty(), "the machine has leases");
    let (later, leases) = (start + 2 * HOPELESS_AFTER, hung.len());
    for _ in 0..100 {
        table.submit(audited(8));
        assert!(
            work(&mut table, sound, &mut hung, later),
            "nothing waits for the other machine"
        );
    }
    assert_eq!(hung.len(), leases, "the machine gets nothing more");
    assert!(table.jobs.is_empty(), "audits do not wait either");
    // An answer to a lease that was never granted does not help.
    let stray = table.complete(hung[0].worker, LeaseNumber(u64::MAX), Vec::new(), later);
    assert_eq!(stray, Err(Refused::UnknownLease));
    table.submit(audited(8));
    assert!(work(&mut table, sound, &mut hung, later));
    // The jobs of the leases are over, and still the answers count.
    for grant in hung.drain(..) {
        let answer = table.complete(grant.worker, grant.lease, answers(&grant), later);
        assert_eq!(answer, Err(Refused::UnknownLease));
    }
    let job = table.submit(audited(8));
    assert!(
        !work(&mut table, sound, &mut hung, later),
        "audits wait for the machine again"
    );
    assert!(table.jobs.contains_key(&job));
}

#[test]
fn a_machine_whose_hung_process_is_lost_gets_work_again() {
    let (mut table, sound) = beside_a_machine_that_hangs(1);
    let (start, mut hung) = (now(), Vec::new());
    table.submit(params(64));
    work_until_over(&mut table, sound, &mut hung);
    let idle = table.join(worker_of(7, 99), ABLE, start).unwrap();
    table.add_credits(idle, 4096);
    table.lose(hung[0].worker);
    table.submit(audited(64));
    hung.clear();
    work(&mut table, sound, &mut hung, start + 3 * HANGS_AFTER);
    assert!(hung.iter().any(|grant| grant.worker == idle));
}

#[test]
fn a_machine_that_hangs_gets_work_that_no_other_can_do() {
    let (mut table, sound) = beside_a_machine_that_hangs(1);
    let start = now();
    table.submit(params(64));
    table.grant(start);
    table.drain(sound);
    let grant = table.grant(start + 2 * HANGS_AFTER).unwrap();
    assert_ne!(grant.worker, sound);
}

/// A table in which machine 1 reported the only task of a job as impossible. Machine 2 owes an answer for so long that it hangs,
/// and has another worker with this number of credits. Also that worker and the time.
fn refused_beside_a_machine_that_hangs(credits: usize) -> (LeaseTable<u64>, WorkerId, Instant) {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let sound = join(&mut table, worker_of(1, 1), 0);
    join(&mut table, worker_of(2, 2), 1);
    table.submit(JobParams {
        speculative: false,
        ..params(1)
    });
    table.grant(start).unwrap();
    let healthy = join(&mut table, worker_of(2, 3), credits);
    let later = start + 2 * HANGS_AFTER;
    table.submit(params(1));
    table.add_credits(sound, 1);
    let grant = table.grant(later).unwrap();
    assert_eq!(grant.worker, sound);
    table.refuse(sound, grant.lease, later);
    (table, healthy, later)
}

#[test]
fn what_one_machine_cannot_do_another_tries_even_if_it_hangs() {
    let (mut table, healthy, later) = refused_beside_a_machine_that_hangs(1);
    let grant = table
        .grant(later)
        .expect("only the machine that hangs can try it");
    assert_eq!(grant.worker, healthy);
}

#[test]
fn what_one_machine_cannot_do_does_not_wait_for_ever_for_a_machine_that_hangs() {
    let (mut table, _, later) = refused_beside_a_machine_that_hangs(0);
    let hopeless = later + HOPELESS_AFTER;
    table.grant(hopeless);
    table.grant(hopeless + 2 * DISPUTE_TIMEOUT);
    assert!(impossible(table.take_events()).is_some());
}

#[test]
fn a_task_is_not_poisoned_while_another_machine_is_busy() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let busy = join(&mut table, process(1), 1);
    table.submit(params(2));
    let long = table.grant(start).unwrap();
    assert_eq!((long.worker, long.tasks.len()), (busy, 1));
    let late = start + 2 * SPECULATION_DELAY.1;
    for instance in 1..=3 {
        let victim = join(&mut table, worker_of(7, instance), 1);
        let tasks = table.grant(late).unwrap().tasks;
        assert_ne!(tasks, long.tasks);
        table.lose(victim);
    }
    table.grant(late);
    let events = table.take_events();
    let is_over = |event: &Event<u64>| matches!(event, Event::Done { .. });
    assert!(!events.iter().any(is_over), "{events:?}");
    table.complete(busy, long.lease, answers(&long), late).unwrap();
    table.add_credits(busy, 1);
    let grant = table.grant(late).expect("the other machine tries the task");
    table.complete(busy, grant.lease, answers(&grant), late).unwrap();
    let done = results(table.take_events());
    assert!(matches!(
        done[..],
        [Settled::Result { .. }, Settled::Result { .. }]
    ));
}

#[test]
fn a_task_of_a_lost_worker_does_not_wait_for_a_worker_that_asks_for_nothing() {
    let (mut table, [_silent, victim, busy]) = workers([0, 1, 0]);
    table.submit(params(1));
    assert_eq!(table.grant(now()).unwrap().worker, victim);
    table.lose(victim);
    table.submit(params(64));
    table.add_credits(busy, 2 * AT_ONCE);
    let first = table.grant(now()).unwrap();
    assert_eq!(first.worker, busy);
    assert_eq!(
        first.tasks.len(),
        1,
        "the task of the lost worker comes first, alone"
    );
}

#[test]
fn a_machine_with_a_hung_process_works_on_beside_a_machine_that_does_nothing() {
    // The other machine asks for nothing, or returns every lease.
    for returns in [false, true] {
        let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
        join(&mut table, worker_of(1, 1), 1);
        table.submit(JobParams {
            speculative: false,
            ..params(1)
        });
        table.grant(start).unwrap();
        let healthy = join(&mut table, worker_of(1, 2), 1);
        let other = join(&mut table, worker_of(2, 3), usize::from(returns));
        table.submit(params(1));
        let later = start + 2 * HANGS_AFTER;
        if returns {
            table.add_credits(other, 1);
            let grant = table.grant(later).unwrap();
            assert_eq!(grant.worker, other);
            table.give_back(other, grant.lease, later);
        }
        assert_eq!(table.grant(later).map(|grant| grant.worker), Some(healthy));
    }
}

#[test]
fn a_training_that_one_trainer_cannot_do_waits_for_a_trainer_that_is_busy_for_long() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let training = JobParams {
        speculative: false,
        ..params(1)
    };
    let busy = join(&mut table, process(2), 1);
    table.submit(training.clone());
    table.grant(start).unwrap();
    let refuses = join(&mut table, process(1), 1);
    table.submit(training);
    let grant = table.grant(start).unwrap();
    assert_eq!(grant.worker, refuses);
    table.refuse(refuses, grant.lease, start);
    let late = start + 2 * HOPELESS_AFTER;
    for at in [late, late + 2 * DISPUTE_TIMEOUT] {
        table.keep_alive(busy, at);
        assert_eq!(table.grant(at), None);
    }
    assert_eq!(impossible(table.take_events()), None);
}

#[test]
fn a_lease_that_was_given_back_is_forgotten() {
    let (mut table, [worker]) = workers([1]);
    table.submit(params(1));
    let grant = table.grant(now()).unwrap();
    table.give_back(worker, grant.lease, now());
    assert!(table.leases.is_empty() && table.jobs[&grant.job].leases.is_empty());
}

#[test]
fn a_training_whose_trainer_makes_no_progress_goes_to_another() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let silent = join(&mut table, process(1), 1);
    let job = table.submit(JobParams {
        speculative: false,
        ..params(1)
    });
    let first = table.grant(start).unwrap();
    let other = join(&mut table, process(2), 1);
    // Progress counts as a new beginning.
    let progress = start + HOPELESS_AFTER;
    table.get_on(first.lease, progress);
    let late = progress + HOPELESS_AFTER + Duration::from_secs(1);
    assert_eq!(table.grant(progress + HOPELESS_AFTER), None);
    let second = table.grant(late).expect("the other trainer goes on");
    assert_eq!(second.worker, other);
    let taken = Event::TakenBack {
        job,
        worker: silent,
        lease: first.lease,
    };
    assert!(table.take_events().contains(&taken));
    // The other trainer has twice as much time.
    table.add_credits(silent, 1);
    assert_eq!(table.grant(late + HOPELESS_AFTER + Duration::from_secs(1)), None);
    assert!(table.grant(late + 3 * HOPELESS_AFTER).is_some());
    // The first result counts.
    table
        .complete(silent, first.lease, answers(&first), late)
        .unwrap();
    assert!(matches!(
        results(table.take_events())[..],
        [Settled::Result { .. }]
    ));
}

#[test]
fn a_machine_that_returns_a_task_gets_it_again_only_after_the_others() {
    // The machine drains each connection, returns the task, or breaks off as the same process.
    let end: [fn(&mut LeaseTable<u64>, &Grant); 3] = [
        |table, grant| {
            table.drain(grant.worker);
            table.lose(grant.worker);
        },
        |table, grant| table.give_back(grant.worker, grant.lease, now()),
        |table, grant| table.lose(grant.worker),
    ];
    for end in end {
        let (mut table, []) = workers([]);
        let greedy = join(&mut table, worker_of(7, 1), 4096);
        let honest = join(&mut table, process(1), 1);
        table.submit(params(1));
        let grant = table.grant(now()).unwrap();
        assert_eq!(grant.worker, greedy);
        end(&mut table, &grant);
        join(&mut table, worker_of(7, 1), 4096);
        assert_eq!(table.grant(now()).map(|grant| grant.worker), Some(honest));
    }
}

#[test]
fn connections_that_ask_for_nothing_or_answer_nothing_do_not_make_batches_small() {
    let (mut table, sound) = beside_a_machine_that_hangs(60);
    for instance in 100..400 {
        let huge = Abilities {
            capacity: 4096,
            embeds: true,
        };
        table.join(worker_of(7, instance), huge, now()).unwrap();
    }
    table.submit(params(1000));
    let granted = std::iter::from_fn(|| table.grant(now())).collect::<Vec<_>>();
    let first = granted.iter().find(|grant| grant.worker == sound).unwrap();
    assert!(first.tasks.len() >= AT_ONCE, "{}", first.tasks.len());
}
