//! Fair shares: limits how many requests are answered at once, by cost class, in total and per principal.
//!
//! A request takes a seat of its class before a handler sees it, and returns the seat once the response has been sent or given
//! up. A principal (the holder of a token, a certificate, an address) never has more seats of a class than its share. A request
//! that finds no seat waits; the next free seat goes to the waiting principal with the fewest seats. Streams last long, so a
//! stream that finds no seat is refused at once. Decisions have seats of their own, which requests that read or compute cannot
//! take.

use crate::{
    connections::network_of,
    limits::{
        DECISION_BURST, DECISIONS_PER_SECOND, MAX_PACED, MAX_WAITING_PER_PRINCIPAL, READING_BURST,
        READINGS_PER_SECOND, REQUEST_BURST, REQUESTS_PER_SECOND,
    },
};
use governor::{DefaultKeyedRateLimiter, Quota};
use murmuration_link::TokenDigest;
use murmuration_model::MachineId;
use murmuration_store::{
    LabelBudget,
    blocking::{Priority, Turns},
};
use std::{
    collections::{HashMap, VecDeque},
    fmt,
    hash::BuildHasher as _,
    net::IpAddr,
    num::NonZeroUsize,
    str::FromStr,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use tokio::sync::{oneshot, watch};

/// Cost of answering a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CostClass {
    /// Requests that change something, and must be acknowledged under any load: pausing, labelling, submitting.
    Decision,
    /// Requests that change as much as hundreds of labels: a decision of more than 2 KiB, or the undo of such a decision.
    Bulk,
    /// Requests that read a few rows.
    Light,
    /// Requests that read up to a whole archive or label log.
    Reading,
    /// Requests that simulate, draw or compare.
    Computing,
    /// Requests that follow something for as long as the client wants.
    Streaming,
    /// Requests without token or certificate to a route that requires neither: login, assets, the health service.
    Stranger,
    /// Requests that need no seat: streams of workers and trainers, which leases and credits limit, and probes.
    Free,
}

/// How many seats a class has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SeatLimits {
    /// Number of seats for all principals together.
    pub total: NonZeroUsize,
    /// Number of seats for one principal.
    pub share: NonZeroUsize,
}

/// A class and its seats, as an option gives them: `CLASS=TOTAL/SHARE`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClassSeats(CostClass, SeatLimits);

/// Parse error of [`ClassSeats`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "must be CLASS=TOTAL/SHARE, such as reading=16/4: decision, bulk, light, reading, computing, streaming or stranger, and two whole numbers \
     from 1 to {MAX_SEATS}, the share at most the total"
)]
pub struct NoClassSeats;

/// Maximum number of seats of a class.
const MAX_SEATS: usize = 65_536;

/// The client that a request counts against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Principal {
    /// The holder of a token that was accepted.
    Token(TokenDigest),
    /// The machine with a certificate.
    Machine(MachineId),
    /// A client without credentials, by its address; for IPv6, by its /64 network, because one machine may own a whole /64
    /// network.
    Address(IpAddr),
    /// A request without a connection, in tests.
    Unknown,
}

/// The client that made a request, for handlers that share something among clients: they find this value in the request's
/// extensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Client(pub(crate) Principal);

impl Client {
    /// A request without a connection, in tests.
    pub const UNKNOWN: Self = Self(Principal::Unknown);

    /// A client without credentials, by its address.
    #[must_use]
    pub fn at(address: IpAddr) -> Self {
        Self(Principal::at(address))
    }
}

/// Why a request has no seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoSeat {
    #[error(
        "too many requests at once from this token, certificate or address ({0}): try again when others have been answered"
    )]
    Busy(CostClass),
    #[error("the coordinator is shutting down: try again once it serves again")]
    Closing,
}

/// Numbers of requests of a class that are being answered, that are waiting, and that were refused so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SeatCounts {
    pub answered: usize,
    pub waiting: usize,
    pub refused: u64,
}

/// The seats of a coordinator, for all its endpoints; cheap to clone.
#[derive(Debug, Clone)]
pub struct Seats {
    lanes: Arc<[Lane; CostClass::LIMITED.len()]>,
    /// The turns of each principal that reads or computes.
    turns: Arc<Mutex<HashMap<Principal, Turns>>>,
    /// The label budgets of annotators.
    labels: Arc<Mutex<HashMap<Principal, LabelBudget>>>,
    closing: Arc<watch::Sender<bool>>,
}

/// The seats of one class.
#[derive(Debug)]
struct Lane {
    limits: SeatLimits,
    /// Limits the request rate of each principal: even cheap requests may come by the thousand.
    pace: DefaultKeyedRateLimiter<Principal>,
    room: Mutex<Room>,
    refused: AtomicU64,
}

#[derive(Debug, Default)]
struct Room {
    /// Seats by principal. Principals without a seat have no entry.
    held: HashMap<Principal, usize>,
    /// Sum of `held`.
    taken: usize,
    waiting: VecDeque<Waiter>,
}

#[derive(Debug)]
struct Waiter {
    principal: Principal,
    seat: oneshot::Sender<Seat>,
}

/// A request's seat. Dropping the seat returns it.
#[derive(Debug)]
pub(crate) struct Seat {
    seats: Seats,
    class: CostClass,
    principal: Principal,
    /// Index of the seat's lane; `None` while the request waits for a seat of another class.
    lane: Mutex<Option<usize>>,
}

impl CostClass {
    /// The classes that have seats.
    pub const LIMITED: [Self; 7] = [
        Self::Decision,
        Self::Bulk,
        Self::Light,
        Self::Reading,
        Self::Computing,
        Self::Streaming,
        Self::Stranger,
    ];

    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Decision => "decision",
            Self::Bulk => "bulk",
            Self::Light => "light",
            Self::Reading => "reading",
            Self::Computing => "computing",
            Self::Streaming => "streaming",
            Self::Stranger => "stranger",
            Self::Free => "free",
        }
    }

    /// Index of the class's lane; `None` for a class without seats.
    fn lane(self) -> Option<usize> {
        Self::LIMITED.iter().position(|&class| class == self)
    }

    /// Whether a request of this class ends at once when the coordinator shuts down.
    pub(crate) const fn ends_at_shutdown(self) -> bool {
        matches!(
            self,
            Self::Reading | Self::Computing | Self::Streaming | Self::Stranger
        )
    }

    /// Request rate allowed to one principal.
    const fn pace(self) -> Quota {
        let (per_second, burst) = match self {
            Self::Decision => (DECISIONS_PER_SECOND, DECISION_BURST),
            Self::Reading | Self::Computing => (READINGS_PER_SECOND, READING_BURST),
            Self::Bulk | Self::Light | Self::Streaming | Self::Stranger | Self::Free => {
                (REQUESTS_PER_SECOND, REQUEST_BURST)
            }
        };
        Quota::per_second(per_second).allow_burst(burst)
    }

    /// Default seats.
    #[must_use]
    pub const fn limits(self) -> SeatLimits {
        match self {
            Self::Decision => SeatLimits::of(64, 16),
            Self::Bulk => SeatLimits::of(8, 1),
            Self::Light => SeatLimits::of(256, 64),
            Self::Reading | Self::Computing => SeatLimits::of(16, 4),
            Self::Streaming | Self::Free => SeatLimits::of(1024, 128),
            Self::Stranger => SeatLimits::of(512, 64),
        }
    }
}

impl fmt::Display for CostClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl SeatLimits {
    /// Limits of at least one seat each.
    const fn of(total: usize, share: usize) -> Self {
        Self {
            total: NonZeroUsize::MIN.saturating_add(total.saturating_sub(1)),
            share: NonZeroUsize::MIN.saturating_add(share.saturating_sub(1)),
        }
    }
}

impl FromStr for ClassSeats {
    type Err = NoClassSeats;

    fn from_str(text: &str) -> Result<Self, NoClassSeats> {
        let (name, numbers) = text.split_once('=').ok_or(NoClassSeats)?;
        let (total, share) = numbers.split_once('/').ok_or(NoClassSeats)?;
        let class = CostClass::LIMITED.into_iter().find(|class| class.name() == name);
        let count = |text: &str| {
            let count = text.parse::<NonZeroUsize>().ok();
            count.filter(|count| count.get() <= MAX_SEATS).ok_or(NoClassSeats)
        };
        let limits = SeatLimits {
            total: count(total)?,
            share: count(share)?,
        };
        match class {
            Some(class) if limits.share <= limits.total => Ok(Self(class, limits)),
            _ => Err(NoClassSeats),
        }
    }
}

impl Principal {
    pub(crate) fn at(address: IpAddr) -> Self {
        Self::Address(network_of(address))
    }
}

impl Seats {
    /// The default seats, except for the classes in `changed`. If a class is in `changed` twice, its last entry counts.
    #[must_use]
    pub fn new(changed: &[ClassSeats]) -> Self {
        let lanes = CostClass::LIMITED.map(|class| {
            let newest = changed.iter().rev().find(|ClassSeats(of, _)| *of == class);
            Lane {
                limits: newest.map_or(class.limits(), |ClassSeats(_, limits)| *limits),
                pace: DefaultKeyedRateLimiter::keyed(class.pace()),
                room: Mutex::default(),
                refused: AtomicU64::new(0),
            }
        });
        Self {
            lanes: Arc::new(lanes),
            turns: Arc::default(),
            labels: Arc::default(),
            closing: Arc::new(watch::Sender::new(false)),
        }
    }

    /// Takes a seat of `class`; `None` if that class needs no seat. Waits at most for `patience`; without `patience`, as long
    /// as it takes.
    ///
    /// # Errors
    /// See [`NoSeat`].
    pub(crate) async fn take(
        &self,
        class: CostClass,
        principal: Principal,
        patience: Option<Duration>,
    ) -> Result<Option<Seat>, NoSeat> {
        let Some(place) = class.lane() else {
            return Ok(None);
        };
        let refused = |refusal| {
            self.lanes[place].refused.fetch_add(1, Ordering::Relaxed);
            Err(refusal)
        };
        let coming = match self.take_or_wait(class, place, principal) {
            Ok(coming) => coming,
            Err(refusal) => return refused(refusal),
        };
        // A request of a principal over its rate waits with its seat taken, so that only few requests wait.
        let seated = async {
            let seat = coming.await.map_err(|_| NoSeat::Closing)?;
            self.lanes[place].paced(principal).await;
            Ok(Some(seat))
        };
        let waited = async {
            match patience {
                Some(patience) => tokio::time::sleep(patience).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            seat = seated => seat,
            () = self.closed() => refused(NoSeat::Closing),
            () = waited => refused(NoSeat::Busy(class)),
        }
    }

    /// Receiver of a seat: a seat that is free now, or the seat that the request waits for.
    fn take_or_wait(
        &self,
        class: CostClass,
        place: usize,
        principal: Principal,
    ) -> Result<oneshot::Receiver<Seat>, NoSeat> {
        let (seat, coming) = oneshot::channel();
        let mut room = self.lanes[place].room();
        if *self.closing.borrow() && class.ends_at_shutdown() {
            return Err(NoSeat::Closing);
        }
        if room.has_seat(self.lanes[place].limits, principal) {
            room.seat(principal);
            drop(room);
            // Sending cannot fail, because `coming` is the receiver.
            let _ = seat.send(self.seat(place, principal));
            return Ok(coming);
        }
        room.waiting.retain(|waiter| !waiter.seat.is_closed());
        let of_principal = room.waiting.iter().filter(|waiter| waiter.principal == principal);
        if class == CostClass::Streaming || of_principal.count() >= MAX_WAITING_PER_PRINCIPAL {
            return Err(NoSeat::Busy(class));
        }
        room.waiting.push_back(Waiter { principal, seat });
        Ok(coming)
    }

    fn seat(&self, lane: usize, principal: Principal) -> Seat {
        Seat {
            seats: self.clone(),
            class: CostClass::LIMITED[lane],
            principal,
            lane: Mutex::new(Some(lane)),
        }
    }

    fn turns(&self, principal: Principal) -> Turns {
        let mut turns = self.turns.lock().unwrap_or_else(PoisonError::into_inner);
        turns.retain(|_, turns| !turns.is_idle());
        turns.entry(principal).or_default().clone()
    }

    /// The label budget of an annotator, shared by all their requests.
    pub(crate) fn label_budget(&self, annotator: Principal) -> LabelBudget {
        let mut budgets = self.labels.lock().unwrap_or_else(PoisonError::into_inner);
        budgets.retain(|_, budget| !budget.is_unused());
        let number = budgets.hasher().hash_one(annotator);
        let budget = budgets
            .entry(annotator)
            .or_insert_with(|| LabelBudget::of(number));
        budget.clone()
    }

    /// Ends all requests of the classes that end at shutdown: waiting requests are refused, and running requests end.
    pub fn close(&self) {
        self.closing.send_replace(true);
    }

    /// Returns once the seats are closed.
    pub(crate) async fn closed(&self) {
        // Waiting cannot fail, because `self` owns the sender.
        let _ = self.closing.subscribe().wait_for(|&closing| closing).await;
    }

    pub fn counts(&self) -> impl Iterator<Item = (CostClass, SeatCounts)> {
        CostClass::LIMITED
            .into_iter()
            .zip(self.lanes.iter())
            .map(|(class, lane)| {
                let room = lane.room();
                let waiting = room.waiting.iter().filter(|waiter| !waiter.seat.is_closed());
                let counts = SeatCounts {
                    answered: room.taken,
                    waiting: waiting.count(),
                    refused: lane.refused.load(Ordering::Relaxed),
                };
                (class, counts)
            })
    }
}

impl Lane {
    /// Returns once a further request of `principal` may be answered.
    async fn paced(&self, principal: Principal) {
        if self.pace.len() >= MAX_PACED {
            self.pace.retain_recent();
        }
        self.pace.until_key_ready(&principal).await;
    }

    fn room(&self) -> MutexGuard<'_, Room> {
        self.room.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Room {
    fn of(&self, principal: Principal) -> usize {
        self.held.get(&principal).copied().unwrap_or_default()
    }

    fn has_seat(&self, limits: SeatLimits, principal: Principal) -> bool {
        self.taken < limits.total.get() && self.of(principal) < limits.share.get()
    }

    fn seat(&mut self, principal: Principal) {
        self.taken += 1;
        *self.held.entry(principal).or_default() += 1;
    }

    fn free(&mut self, principal: Principal) {
        self.taken -= 1;
        match self.held.get_mut(&principal) {
            Some(held) if *held > 1 => *held -= 1,
            _ => drop(self.held.remove(&principal)),
        }
    }

    /// Takes the waiting request that gets the next seat: the oldest request of the principals with the fewest seats.
    fn next(&mut self, limits: SeatLimits) -> Option<Waiter> {
        if self.taken >= limits.total.get() {
            return None;
        }
        self.waiting.retain(|waiter| !waiter.seat.is_closed());
        let held = |waiter: &Waiter| self.of(waiter.principal);
        let may = self
            .waiting
            .iter()
            .enumerate()
            .filter(|(_, waiter)| held(waiter) < limits.share.get());
        let (place, _) = may.min_by_key(|(place, waiter)| (held(waiter), *place))?;
        let waiter = self.waiting.remove(place)?;
        self.seat(waiter.principal);
        Some(waiter)
    }
}

impl Seat {
    pub(crate) fn class(&self) -> CostClass {
        self.class
    }

    /// Returns the seat, and waits for a seat of `class` instead.
    ///
    /// # Errors
    /// See [`NoSeat`].
    pub(crate) async fn exchange(&self, class: CostClass) -> Result<(), NoSeat> {
        self.give_back();
        if let Some(other) = self.seats.take(class, self.principal, None).await? {
            *self.lane() = other.lane().take();
        }
        Ok(())
    }

    /// Priority of work for the request. Reading and computing have low priority, limited by the principal's turns.
    pub(crate) fn priority(&self) -> Priority {
        match self.class {
            CostClass::Reading | CostClass::Computing => Priority::Low(self.seats.turns(self.principal)),
            CostClass::Decision
            | CostClass::Bulk
            | CostClass::Light
            | CostClass::Streaming
            | CostClass::Stranger
            | CostClass::Free => Priority::Normal,
        }
    }

    fn give_back(&self) {
        let Some(place) = self.lane().take() else {
            return;
        };
        let lane = &self.seats.lanes[place];
        let mut room = lane.room();
        room.free(self.principal);
        let next = room.next(lane.limits);
        drop(room);
        if let Some(Waiter { principal, seat }) = next {
            // If the client has disconnected, sending fails and drops the seat, which returns the seat.
            let _ = seat.send(self.seats.seat(place, principal));
        }
    }

    fn lane(&self) -> MutexGuard<'_, Option<usize>> {
        self.lane.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.give_back();
    }
}

#[cfg(test)]
mod tests;
