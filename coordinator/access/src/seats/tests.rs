//! Seats by class: shares, fairness, and shutdown.

use super::*;
use proptest::prelude::*;
use std::pin::pin;
use tokio::time::Instant;

fn of(number: u8) -> Principal {
    Principal::at([10, 0, 0, number].into())
}

fn seats(class: &str) -> Seats {
    Seats::new(&[class.parse().unwrap()])
}

fn counts(seats: &Seats, class: CostClass) -> SeatCounts {
    seats.counts().find(|(of, _)| *of == class).unwrap().1
}

async fn take(seats: &Seats, principal: Principal) -> Result<Seat, NoSeat> {
    let patience = Some(Duration::from_secs(1));
    let taken = seats.take(CostClass::Reading, principal, patience).await;
    taken.map(|seat| seat.unwrap())
}

#[tokio::test(start_paused = true)]
async fn nobody_has_more_than_a_share_and_the_others_find_seats() {
    let seats = seats("reading=3/2");
    let _first = [
        take(&seats, of(1)).await.unwrap(),
        take(&seats, of(1)).await.unwrap(),
    ];
    let begun = Instant::now();
    let refused = take(&seats, of(1)).await.unwrap_err();
    assert_eq!(refused, NoSeat::Busy(CostClass::Reading));
    assert!(begun.elapsed() >= Duration::from_secs(1));
    let _other = take(&seats, of(2)).await.unwrap();
    // All seats are taken now.
    assert!(take(&seats, of(3)).await.is_err());
    let decision = seats.take(CostClass::Decision, of(1), None).await.unwrap();
    assert!(decision.is_some(), "decisions have seats of their own");
    let counted = SeatCounts {
        answered: 3,
        waiting: 0,
        refused: 2,
    };
    assert_eq!(counts(&seats, CostClass::Reading), counted);
}

#[tokio::test(start_paused = true)]
async fn the_next_seat_goes_to_whoever_has_fewest() {
    let seats = seats("reading=2/2");
    let held = [
        take(&seats, of(1)).await.unwrap(),
        take(&seats, of(1)).await.unwrap(),
    ];
    let mut again = pin!(take(&seats, of(1)));
    let mut new = pin!(take(&seats, of(2)));
    // Both requests wait; the principal that already has two seats has waited longer.
    tokio::select! {
        biased;
        _ = &mut again => unreachable!(),
        _ = &mut new => unreachable!(),
        () = tokio::time::sleep(Duration::from_millis(1)) => {}
    }
    assert_eq!(counts(&seats, CostClass::Reading).waiting, 2);
    drop(held);
    let (again, new) = tokio::join!(again, new);
    assert!(again.is_ok() && new.is_ok());
    // Both seats were returned: a single one would have gone to the other principal.
    drop(again);
    let _kept = take(&seats, of(1)).await.unwrap();
    let mut third = pin!(take(&seats, of(1)));
    let mut fourth = pin!(take(&seats, of(3)));
    tokio::select! {
        biased;
        _ = &mut third => unreachable!(),
        _ = &mut fourth => unreachable!(),
        () = tokio::time::sleep(Duration::from_millis(1)) => {}
    }
    drop(new);
    tokio::select! {
        biased;
        _ = &mut third => panic!("it has one already"),
        seat = &mut fourth => assert!(seat.is_ok()),
    }
}

#[tokio::test(start_paused = true)]
async fn streams_do_not_wait_and_machines_need_no_seat() {
    let seats = seats("streaming=2/1");
    let watch = |principal| seats.take(CostClass::Streaming, principal, None);
    let seat = watch(of(1)).await.unwrap();
    assert_eq!(
        watch(of(1)).await.unwrap_err(),
        NoSeat::Busy(CostClass::Streaming)
    );
    assert!(watch(of(2)).await.is_ok());
    drop(seat);
    assert!(watch(of(1)).await.is_ok());
    assert!(seats.take(CostClass::Free, of(1), None).await.unwrap().is_none());
}

#[tokio::test(start_paused = true)]
async fn a_shutdown_ends_waiting_and_decisions_still_find_seats() {
    let seats = seats("reading=1/1");
    let held = take(&seats, of(1)).await.unwrap();
    let closing = async {
        tokio::task::yield_now().await;
        seats.close();
    };
    let (waited, ()) = tokio::join!(take(&seats, of(1)), closing);
    assert_eq!(waited.unwrap_err(), NoSeat::Closing);
    drop(held);
    assert_eq!(take(&seats, of(2)).await.unwrap_err(), NoSeat::Closing);
    let decision = seats.take(CostClass::Decision, of(1), None).await;
    assert!(decision.unwrap().is_some());
}

#[tokio::test(start_paused = true)]
async fn only_so_many_of_one_principal_wait() {
    let seats = seats("reading=1/1");
    let _held = take(&seats, of(1)).await.unwrap();
    let waiting: Vec<_> = (0..MAX_WAITING_PER_PRINCIPAL)
        .map(|_| {
            let seats = seats.clone();
            tokio::spawn(async move { take(&seats, of(1)).await.is_ok() })
        })
        .collect();
    tokio::time::sleep(Duration::from_millis(1)).await;
    let begun = Instant::now();
    assert!(take(&seats, of(1)).await.is_err());
    assert!(begun.elapsed() < Duration::from_millis(1));
    // Cancelled requests leave the queue.
    waiting.iter().for_each(tokio::task::JoinHandle::abort);
    tokio::time::sleep(Duration::from_millis(1)).await;
    assert!(take(&seats, of(1)).await.is_err());
    assert!(begun.elapsed() >= Duration::from_secs(1));
}

#[tokio::test]
async fn who_asks_too_often_waits_and_the_others_do_not() {
    let seats = Seats::new(&[]);
    let seats = &seats;
    let ask = |principal| async move { drop(take(seats, principal).await.unwrap()) };
    let begun = Instant::now();
    for _ in 0..READING_BURST.get() + 50 {
        ask(of(1)).await;
    }
    let pace = 50 * Duration::from_secs(1) / READINGS_PER_SECOND.get();
    assert!(begun.elapsed() >= pace, "{:?}", begun.elapsed());
    let mut waits = pin!(ask(of(1)));
    tokio::select! {
        biased;
        () = &mut waits => panic!("it need not wait"),
        () = ask(of(2)) => {}
    }
    let decision = seats.take(CostClass::Decision, of(1), None);
    tokio::select! {
        biased;
        decision = decision => assert!(decision.unwrap().is_some()),
        () = &mut waits => panic!("decisions have a pace of their own"),
    }
    assert_eq!(
        counts(seats, CostClass::Reading).answered,
        1,
        "it waits in a seat"
    );
}

#[test]
fn a_network_is_one_principal() {
    let at = |address: &str| Principal::at(address.parse().unwrap());
    assert_eq!(at("2001:db8:1:2::7"), at("2001:db8:1:2:ffff::1"));
    assert_ne!(at("2001:db8:1:2::7"), at("2001:db8:1:3::7"));
    assert_ne!(at("10.0.0.1"), at("10.0.0.2"));
}

#[test]
fn seats_are_named_by_class_total_and_share() {
    let named = |text: &str| text.parse::<ClassSeats>();
    assert_eq!(
        named("reading=32/8"),
        Ok(ClassSeats(CostClass::Reading, SeatLimits::of(32, 8)))
    );
    for wrong in [
        "reading=8/32",
        "reading=0/0",
        "reading=32",
        "machine=1/1",
        "reading=100000/1",
        "writing=2/1",
        "",
    ] {
        assert_eq!(named(wrong), Err(NoClassSeats), "{wrong}");
    }
    let twice = Seats::new(&[named("light=9/9").unwrap(), named("light=7/2").unwrap()]);
    let limits = |class: CostClass| twice.lanes[class.lane().unwrap()].limits;
    assert_eq!(limits(CostClass::Light), SeatLimits::of(7, 2));
    assert_eq!(limits(CostClass::Reading), CostClass::Reading.limits());
}

proptest! {
    /// In any order of taking, returning, waiting and cancelling: no principal has more than its share, no seat is lost, and no
    /// request waits for a seat that it could have.
    #[test]
    fn no_seat_is_lost(steps in prop::collection::vec((0_u8..4, any::<bool>(), any::<prop::sample::Index>()), 1..200)) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        runtime.block_on(async {
            let limits = SeatLimits::of(5, 2);
            let seats = seats("reading=5/2");
            let place = CostClass::Reading.lane().unwrap();
            let mut held: Vec<Seat> = Vec::new();
            let mut waiting: Vec<(Principal, oneshot::Receiver<Seat>)> = Vec::new();
            for (number, takes, which) in steps {
                if takes {
                    let coming = seats.take_or_wait(CostClass::Reading, place, of(number)).unwrap();
                    waiting.push((of(number), coming));
                } else if number == 0 && !waiting.is_empty() {
                    let gone = which.index(waiting.len());
                    drop(waiting.swap_remove(gone));
                } else if !held.is_empty() {
                    let gone = which.index(held.len());
                    drop(held.swap_remove(gone));
                }
                for place in (0..waiting.len()).rev() {
                    if let Ok(seat) = waiting[place].1.try_recv() {
                        held.push(seat);
                        waiting.swap_remove(place);
                    }
                }
                let of_principal = |principal: Principal| held.iter().filter(|seat| seat.principal == principal).count();
                assert_eq!(counts(&seats, CostClass::Reading).answered, held.len());
                assert!(held.len() <= limits.total.get());
                assert!((0..4).all(|number| of_principal(of(number)) <= limits.share.get()));
                for (principal, _) in &waiting {
                    assert!(held.len() == limits.total.get() || of_principal(*principal) == limits.share.get());
                }
            }
            drop((held, waiting));
            assert_eq!(counts(&seats, CostClass::Reading).answered, 0);
        });
    }
}
