//! A cache of values that take long to compute, one value for each campaign, with a bound on their bytes.
//!
//! Every value can be made again from the store, with the same result. The cache uses the sizes of values, not their contents.

use crate::blocking::shared;
use hashlink::LruCache;
use murmuration_model::CampaignId;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync;

/// Bytes of an entry besides its value: its campaign's id, its place in the cache, its lock.
pub const ENTRY_BYTES: usize = 256;

/// A value for each campaign, within a total bound of bytes. The least recently used values are dropped.
///
/// Two kinds of values stay even beyond the bound. The newest value stays so that it is not computed over and over, and values in
/// use stay because dropping them would free nothing.
#[derive(Debug)]
pub struct Kept<V> {
    most_bytes: usize,
    entries: Mutex<Entries<V>>,
}

#[derive(Debug)]
struct Entries<V> {
    /// The entries, least recently used first.
    by_campaign: LruCache<CampaignId, Entry<V>>,
    bytes: usize,
}

#[derive(Debug)]
struct Entry<V> {
    value: Arc<V>,
    bytes: usize,
}

/// The latest answer to one question about each campaign, within a bound of bytes; cheap to clone. `State` is the state of the
/// campaign that the answer follows from. An answer that alone exceeds the bound is returned but not kept.
#[derive(Debug)]
pub struct LatestAnswers<State, Answer>(Arc<Kept<LatestAnswer<State, Answer>>>);

type LatestAnswer<State, Answer> = sync::Mutex<Option<(State, Answer)>>;

impl<State, Answer> Clone for LatestAnswers<State, Answer> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<State: PartialEq, Answer: Clone> LatestAnswers<State, Answer> {
    /// An empty cache with a bound of `most_bytes`.
    #[must_use]
    pub fn within(most_bytes: usize) -> Self {
        Self(Arc::new(Kept::within(most_bytes)))
    }

    /// The answer about a campaign in this state. The first caller makes the answer, and concurrent callers wait. If the first
    /// caller is cancelled, the next caller makes the answer. `bytes` gives the size of an answer.
    ///
    /// # Errors
    /// The errors of `make`, for the caller that makes the answer.
    pub async fn of<E>(
        &self,
        campaign: &CampaignId,
        state: State,
        bytes: impl FnOnce(&Answer) -> usize,
        make: impl Future<Output = Result<Answer, E>>,
    ) -> Result<Answer, E> {
        let slot = self.0.of(campaign);
        let mut latest = slot.lock().await;
        if let Some((of, answer)) = latest.as_ref()
            && *of == state
        {
            return Ok(answer.clone());
        }
        let answer = shared(make).await?;
        let bytes = bytes(&answer);
        let is_kept = bytes.saturating_add(ENTRY_BYTES) <= self.0.most_bytes;
        self.0.weigh(campaign, if is_kept { bytes } else { 0 });
        *latest = is_kept.then(|| (state, answer.clone()));
        Ok(answer)
    }
}

impl<V: Default> Kept<V> {
    /// An empty cache with a bound of `most_bytes`.
    pub fn within(most_bytes: usize) -> Self {
        Self {
            most_bytes,
            entries: Mutex::new(Entries {
                by_campaign: LruCache::new_unbounded(),
                bytes: 0,
            }),
        }
    }

    /// The value of a campaign, or the default value. A value stays in the cache while a caller holds it.
    pub fn of(&self, campaign: &CampaignId) -> Arc<V> {
        let mut entries = self.lock();
        if let Some(entry) = entries.by_campaign.get(campaign) {
            return Arc::clone(&entry.value);
        }
        let value = Arc::<V>::default();
        let entry = Entry {
            value: Arc::clone(&value),
            bytes: ENTRY_BYTES,
        };
        entries.by_campaign.insert(campaign.clone(), entry);
        entries.bytes += ENTRY_BYTES;
        entries.forget(self.most_bytes, campaign);
        value
    }

    /// Records that the value of a campaign now takes `bytes`, and drops other values if the bound requires this.
    pub fn weigh(&self, campaign: &CampaignId, bytes: usize) {
        let mut entries = self.lock();
        let bytes = bytes.saturating_add(ENTRY_BYTES);
        if let Some(entry) = entries.by_campaign.get_mut(campaign) {
            let before = std::mem::replace(&mut entry.bytes, bytes);
            entries.bytes = (entries.bytes - before).saturating_add(bytes);
            entries.forget(self.most_bytes, campaign);
        }
    }

    pub fn forget(&self, campaign: &CampaignId) {
        let mut entries = self.lock();
        let gone = entries.by_campaign.remove(campaign);
        entries.bytes -= gone.map_or(0, |entry| entry.bytes);
    }

    fn lock(&self) -> MutexGuard<'_, Entries<V>> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Total bytes of all entries.
    pub fn bytes(&self) -> usize {
        self.lock().bytes
    }
}

impl<V> Entries<V> {
    /// Drops values that are not in use until all entries together take at most `most_bytes`. Keeps the value of `newest`.
    fn forget(&mut self, most_bytes: usize, newest: &CampaignId) {
        let mut over = self.bytes.saturating_sub(most_bytes);
        let mut forgotten = Vec::new();
        for (campaign, entry) in self.by_campaign.iter() {
            if over == 0 {
                break;
            }
            if campaign != newest && Arc::strong_count(&entry.value) == 1 {
                over = over.saturating_sub(entry.bytes);
                forgotten.push(campaign.clone());
            }
        }
        for campaign in forgotten {
            let gone = self.by_campaign.remove(&campaign);
            self.bytes -= gone.map_or(0, |entry| entry.bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocking::{Priority, Turns, blocking, holding};
    use std::time::Duration;

    fn id(number: usize) -> CampaignId {
        CampaignId::from_store(format!("campaign-{number}"))
    }

    /// Keeps a value of `bytes` bytes for the campaign with this number.
    fn keep(kept: &Kept<Mutex<usize>>, number: usize, bytes: usize) {
        let value = kept.of(&id(number));
        *value.lock().unwrap() = number;
        kept.weigh(&id(number), bytes);
    }

    fn has(kept: &Kept<Mutex<usize>>, number: usize) -> bool {
        kept.lock().by_campaign.contains_key(&id(number))
    }

    #[tokio::test]
    async fn an_answer_is_made_once_and_again_when_the_campaign_changes_or_its_maker_goes() {
        let answers = LatestAnswers::within(10_000);
        let made = Mutex::new(0);
        let ask = |state: u64| {
            let (answers, made) = (answers.clone(), &made);
            async move {
                let make = async {
                    tokio::task::yield_now().await;
                    *made.lock().unwrap() += 1;
                    Ok::<_, ()>(state * 10)
                };
                answers.of(&id(1), state, |_| 100, make).await
            }
        };
        let (one, other, third) = tokio::join!(ask(1), ask(1), ask(1));
        assert_eq!([one, other, third], [Ok(10); 3]);
        assert_eq!(*made.lock().unwrap(), 1);
        assert_eq!(ask(2).await, Ok(20));
        assert_eq!(*made.lock().unwrap(), 2);
        // The task that makes the answer is cancelled.
        tokio::select! {
            biased;
            _ = ask(3) => unreachable!(),
            () = std::future::ready(()) => {}
        }
        assert_eq!(ask(3).await, Ok(30));
        assert_eq!(*made.lock().unwrap(), 3);
        let failing = answers.of(&id(1), 4, |_| 100, async { Err("no") }).await;
        assert_eq!(failing, Err("no"));
        assert_eq!(ask(3).await, Ok(30), "the former answer is kept");
    }

    /// Runs a task for the client of these turns.
    async fn as_client<F: Future>(turns: Turns, task: F) -> F::Output {
        holding(Arc::new(()), Priority::Low(turns), task).await
    }

    #[tokio::test]
    async fn nobody_waits_for_the_other_work_of_the_client_that_makes_the_answer() {
        let (answers, turns) = (LatestAnswers::within(10_000), Turns::default());
        let (go, gone) = std::sync::mpsc::channel::<()>();
        let gone = Arc::new(Mutex::new(gone));
        // The client has two turns.
        for _ in 0..2 {
            let gone = Arc::clone(&gone);
            let busy = blocking(move || gone.lock().unwrap().recv().is_err());
            tokio::spawn(as_client(turns.clone(), busy));
        }
        tokio::task::yield_now().await;
        let campaign = id(1);
        let answer = answers.of(&campaign, 1, |_| 100, blocking(|| 7));
        let answer = tokio::time::timeout(Duration::from_secs(10), as_client(turns, answer)).await;
        drop(go);
        assert_eq!(answer, Ok(Ok(7)));
    }

    #[tokio::test]
    async fn an_answer_over_the_bound_is_made_for_whoever_asks_and_not_kept() {
        let answers = LatestAnswers::within(10_000);
        let campaign = id(1);
        for made in 1..=2 {
            let answer = answers.of(&campaign, 1, |_| 20_000, async { Ok::<_, ()>(made) });
            assert_eq!(answer.await, Ok(made));
            assert!(answers.0.bytes() <= 10_000);
        }
    }

    #[test]
    fn what_is_kept_weighs_no_more_than_the_bound() {
        let kept = Kept::within(10_000);
        for number in 1..1000 {
            keep(&kept, number, 1000);
            assert!(kept.bytes() <= 10_000);
            let there: Vec<usize> = (1..=number).filter(|&number| has(&kept, number)).collect();
            assert_eq!(there.len(), number.min(7));
            assert!(there.contains(&number));
        }
        // Even values of no bytes take room.
        for number in 1000..2000 {
            drop(kept.of(&id(number)));
            assert!(kept.bytes() <= 10_000);
        }
    }

    #[test]
    fn what_was_asked_for_last_stays() {
        let kept = Kept::within(5000);
        (1..=3).for_each(|number| keep(&kept, number, 1000));
        assert_eq!(*kept.of(&id(1)).lock().unwrap(), 1);
        keep(&kept, 4, 1000);
        assert_eq!(
            [1, 2, 3, 4].map(|number| has(&kept, number)),
            [true, false, true, true]
        );
        // A value that grows displaces other values.
        kept.weigh(&id(3), 3400);
        assert_eq!([1, 3, 4].map(|number| has(&kept, number)), [false, true, true]);
    }

    #[test]
    fn what_is_larger_than_the_bound_and_what_is_in_use_stay() {
        let kept = Kept::within(2000);
        keep(&kept, 1, 9000);
        assert_eq!(*kept.of(&id(1)).lock().unwrap(), 1);
        let used = kept.of(&id(1));
        keep(&kept, 2, 1000);
        assert!(Arc::ptr_eq(&used, &kept.of(&id(1))));
        drop(used);
        keep(&kept, 3, 1000);
        assert_eq!([1, 2, 3].map(|number| has(&kept, number)), [false, false, true]);
        assert_eq!(*kept.of(&id(1)).lock().unwrap(), 0, "it is made again");
    }
}
