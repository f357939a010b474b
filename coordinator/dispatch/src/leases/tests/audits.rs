//! Audits wait for the only other machine while it restarts, leaves or returns work, but not for ever.

use super::*;

/// A table with an audited task that machine 1 has answered, and the time of the answer. The only other machine had a worker, which
/// `leaves` before the answer.
fn answered_beside(
    leaves: impl FnOnce(&mut LeaseTable<u64>, WorkerId, Instant),
) -> (LeaseTable<u64>, Instant) {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let fast = join(&mut table, process(1), 1);
    let other = join(&mut table, process(2), 0);
    table.submit(audited(1));
    let grant = table.grant(start).unwrap();
    leaves(&mut table, other, start);
    table.complete(fast, grant.lease, answers(&grant), start).unwrap();
    assert_eq!(table.grant(start), None);
    (table, start)
}

/// Machine 2 comes back at this time with a credit.
fn come_back(table: &mut LeaseTable<u64>, instance: u64, at: Instant) -> WorkerId {
    let worker = table.join(worker_of(2, instance), ABLE, at).unwrap();
    table.add_credits(worker, 1);
    worker
}

/// Number of audits that ended without a second result since the last call.
fn waived(table: &mut LeaseTable<u64>) -> usize {
    let events = table.take_events().into_iter();
    let tasks = events.map(|event| match event {
        Event::Waived { tasks, .. } => tasks,
        _ => 0,
    });
    tasks.sum()
}

fn leave(table: &mut LeaseTable<u64>, worker: WorkerId, _: Instant) {
    table.lose(worker);
}

#[test]
fn an_audit_waits_for_a_machine_that_restarts() {
    let (mut table, start) = answered_beside(leave);
    let later = start + AWAY - Duration::from_secs(1);
    assert_eq!(table.grant(later), None);
    let back = come_back(&mut table, 9, later);
    let audit = table.grant(later).expect("the audit goes on");
    assert_eq!(audit.worker, back);
    table
        .complete(back, audit.lease, vec![13], later)
        .expect("the lease is its own");
    table.grant(later + 2 * DISPUTE_TIMEOUT);
    table.grant(later + 4 * DISPUTE_TIMEOUT);
    let events = table.take_events();
    assert!(
        events
            .iter()
            .any(|event| matches!(event, Event::Disagreement { .. })),
        "{events:?}"
    );
}

#[test]
fn an_audit_waits_for_a_machine_that_drains_and_restarts() {
    let (mut table, start) = answered_beside(|table, worker, _| table.drain(worker));
    let later = start + 2 * AWAY;
    table.grant(later);
    assert_eq!(waived(&mut table), 0);
    table.grant(later + HOPELESS_AFTER + Duration::from_secs(2));
    assert_eq!(
        waived(&mut table),
        1,
        "a machine that drains for ever is not waited for"
    );
}

#[test]
fn an_audit_ends_once_the_other_machine_is_away_for_too_long() {
    let (mut table, start) = answered_beside(leave);
    assert_eq!(waived(&mut table), 0);
    table.grant(start + AWAY + Duration::from_secs(2));
    assert_eq!(waived(&mut table), 1);
    assert!(table.jobs.is_empty());
}

#[test]
fn an_audit_of_a_worker_that_drains_waits_for_its_answer() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let fast = join(&mut table, process(1), 1);
    table.submit(audited(1));
    let grant = table.grant(start).unwrap();
    table.complete(fast, grant.lease, answers(&grant), start).unwrap();
    let other = join(&mut table, process(2), 1);
    let audit = table.grant(start).expect("the other machine audits");
    table.drain(other);
    table.grant(start + Duration::from_secs(20));
    assert_eq!(waived(&mut table), 0);
    let answer = table.complete(
        other,
        audit.lease,
        answers(&audit),
        start + Duration::from_secs(20),
    );
    answer.expect("the answer counts");
    assert!(table.jobs.is_empty());
    assert_eq!(waived(&mut table), 0);
}

#[test]
fn late_answers_to_a_lease_that_went_over_count_for_all_its_tasks() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let slow = join(&mut table, process(2), 64);
    let job = table.submit(JobParams {
        audited: BTreeSet::from([1]),
        ..params(64)
    });
    let late = table.grant(start).unwrap();
    assert!(late.tasks.contains(&1) && late.tasks.len() > 1);
    let fast = join(&mut table, process(1), 1000);
    table.drain(slow);
    let later = start + 2 * SPECULATION_DELAY.1;
    while let Some(grant) = table.grant(later) {
        let lies = vec![13; grant.tasks.len()];
        table.complete(fast, grant.lease, lies, later).unwrap();
    }
    let done = table.take_events().into_iter().find_map(|event| match event {
        Event::Done { job: of, audits, .. } => Some((of, audits)),
        _ => None,
    });
    let (of, audits) = done.expect("nothing waits for the slow machine");
    let audits = audits.expect("the audit goes on");
    assert_eq!((of, &audits.places), (job, &late.tasks));
    table.complete(slow, late.lease, answers(&late), later).unwrap();
    assert!((0..late.tasks.len()).all(|place| table.is_disputed(audits.job, place)));
}

#[test]
fn an_audit_that_a_worker_gave_back_is_leased_to_it_again() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let fast = join(&mut table, process(1), 1);
    table.submit(audited(1));
    let grant = table.grant(start).unwrap();
    table.complete(fast, grant.lease, answers(&grant), start).unwrap();
    let other = join(&mut table, process(2), 8);
    let mut times = (0..200).map(|steps| start + steps * Duration::from_millis(500));
    for returns in 1..=2 {
        let audit = times.find_map(|at| table.grant(at)).expect("it is leased again");
        assert_eq!(
            (audit.worker, waived(&mut table)),
            (other, 0),
            "{returns} returns"
        );
        table.give_back(other, audit.lease, start);
    }
    let ends = times.find(|&at| {
        if let Some(audit) = table.grant(at) {
            table.give_back(other, audit.lease, at);
        }
        table.jobs.is_empty()
    });
    assert!(
        ends.is_some(),
        "a worker that never does it does not keep the audit open"
    );
}

#[test]
fn a_machine_that_reconnects_again_and_again_gets_no_further_time() {
    // The machine takes the audit on each connection, or never asks for work.
    for credits in [1, 0] {
        let (mut table, start) = answered_beside(leave);
        let over = (1..)
            .map(|round| start + round * Duration::from_secs(20))
            .find(|&at| {
                let back = table.join(worker_of(2, 1), ABLE, at).unwrap();
                table.add_credits(back, credits);
                table.grant(at);
                let later = at + Duration::from_secs(4);
                table.keep_alive(back, later);
                table.grant(later);
                table.lose(back);
                table.jobs.is_empty()
            });
        let took = over.unwrap() - start;
        assert!(
            took > HOPELESS_AFTER && took < HOPELESS_AFTER + 2 * AWAY,
            "{took:?}"
        );
    }
}

#[test]
fn a_machine_that_answers_slowly_on_purpose_is_waited_for_an_hour_at_most() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let other = join(&mut table, process(2), 1);
    table.submit(params(1));
    let slow = table.grant(start).unwrap();
    let late = start + 2 * LONGEST_PATIENCE;
    table.complete(other, slow.lease, answers(&slow), late).unwrap();
    let fast = join(&mut table, process(1), 1);
    table.submit(audited(1));
    let grant = table.grant(late).unwrap();
    table.complete(fast, grant.lease, answers(&grant), late).unwrap();
    table.add_credits(other, 1);
    assert!(table.grant(late).is_some_and(|audit| audit.worker == other));
    table.keep_alive(other, late + LONGEST_PATIENCE + AWAY);
    table.grant(late + LONGEST_PATIENCE + AWAY);
    table.grant(late + LONGEST_PATIENCE + AWAY + Duration::from_secs(2));
    assert!(table.jobs.is_empty());
}

#[test]
fn a_generation_does_not_wait_for_a_machine_that_only_reconnects() {
    // The machine never asks for work, or takes the audit on each connection.
    for credits in [0, 1] {
        let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
        let fast = join(&mut table, process(1), 1);
        let mut last = table.join(worker_of(2, 0), ABLE, start).unwrap();
        let job = table.submit(audited(1));
        let grant = table.grant(start).unwrap();
        table.complete(fast, grant.lease, answers(&grant), start).unwrap();
        assert_eq!(table.grant(start), None);
        assert!(
            table.jobs.contains_key(&job),
            "the machine is about to ask for work"
        );
        let mut times = (1..20).map(|round| start + Duration::from_secs(4) * round);
        let ended = times.find(|&at| {
            let next = table.join(worker_of(2, 0), ABLE, at).unwrap();
            table.add_credits(next, credits);
            table.lose(last);
            last = next;
            table.grant(at);
            !table.jobs.contains_key(&job)
        });
        assert!(ended.is_some(), "the audit goes on after the job");
        assert!(table.jobs.values().all(|job| job.is_audits) && !table.jobs.is_empty());
    }
}

#[test]
fn a_dispute_ends_beside_a_machine_that_drains() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let two = [1, 2].map(|number| join(&mut table, process(number), 1));
    let drains = join(&mut table, process(3), 0);
    table.drain(drains);
    let job = table.submit(audited(1));
    for result in [7, 13] {
        let grant = table.grant(start).unwrap();
        assert!(two.contains(&grant.worker));
        table
            .complete(grant.worker, grant.lease, vec![result], start)
            .unwrap();
    }
    let end = start + HOPELESS_AFTER + Duration::from_secs(1);
    for at in [start, end, end + 2 * DISPUTE_TIMEOUT] {
        assert!(table.jobs.contains_key(&job));
        table.grant(at);
    }
    assert!(!table.jobs.contains_key(&job), "the job ends in a disagreement");
}

#[test]
fn an_audit_that_a_machine_sits_on_comes_before_other_work() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let fast = join(&mut table, process(1), 1);
    let hangs = join(&mut table, process(2), 0);
    table.submit(audited(1));
    let grant = table.grant(start).unwrap();
    table.complete(fast, grant.lease, answers(&grant), start).unwrap();
    table.add_credits(hangs, 1);
    let audit = table.grant(start).unwrap();
    assert_eq!(audit.worker, hangs);
    let later = start + 2 * SPECULATION_DELAY.1;
    assert_eq!(table.grant(later), None, "the audit goes on after its job");
    let audits = table.leased(hangs, audit.lease).unwrap();
    table.submit(params(1000));
    let third = join(&mut table, process(3), 1);
    let next = table.grant(later).unwrap();
    assert_eq!((next.worker, next.job), (third, audits));
}

#[test]
fn an_audit_waits_for_a_machine_that_has_just_answered_too_late() {
    let (mut table, start) = (LeaseTable::new(DISPUTE_TIMEOUT), now());
    let slow = join(&mut table, process(2), 1);
    let over = table.submit(params(1));
    let late = table.grant(start).unwrap();
    assert_eq!(late.worker, slow);
    let later = start + 3 * SPECULATION_DELAY.1;
    let fast = join(&mut table, process(1), 1);
    let again = table.grant(later).unwrap();
    assert_eq!((again.worker, again.job), (fast, over));
    table.complete(fast, again.lease, answers(&again), later).unwrap();
    // The worker's credits come after its answer.
    assert!(table.answered(slow, late.lease, later));
    table.add_credits(fast, 1);
    table.submit(audited(1));
    let first = table.grant(later).unwrap();
    table.complete(fast, first.lease, answers(&first), later).unwrap();
    assert_eq!(table.grant(later), None);
    assert_eq!(waived(&mut table), 0);
    table.add_credits(slow, 1);
    assert_eq!(table.grant(later).expect("the audit goes on").worker, slow);
}
