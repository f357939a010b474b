//! Shares one computation of a value among all its followers.

use murmuration_engine::blocking::shared;
use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError, Weak},
    time::{Duration, Instant},
};
use tokio::sync;

/// The latest values by name, while they have followers; cheap to clone.
#[derive(Debug)]
pub struct Recent<T>(Arc<Mutex<HashMap<String, Weak<Latest<T>>>>>);

/// One shared value, kept while it has followers.
#[derive(Debug)]
pub struct Followed<T>(Arc<Latest<T>>);

type Latest<T> = sync::Mutex<Option<(Instant, T)>>;

impl<T> Clone for Followed<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Clone for Recent<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Clone> Recent<T> {
    /// The value that all followers of `name` share.
    pub fn follow(&self, name: String) -> Followed<T> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(latest) = all.get(&name).and_then(Weak::upgrade) {
            return Followed(latest);
        }
        all.retain(|_, latest| latest.strong_count() > 0);
        let latest = Arc::<Latest<T>>::default();
        all.insert(name, Arc::downgrade(&latest));
        Followed(latest)
    }
}

impl<T: Clone> Followed<T> {
    /// The latest value if it is younger than `age`, or else a new value from `make`.
    ///
    /// # Errors
    /// The errors of `make`.
    pub async fn within<E>(&self, age: Duration, make: impl Future<Output = Result<T, E>>) -> Result<T, E> {
        let mut latest = self.0.lock().await;
        if let Some((made, value)) = latest.as_ref()
            && made.elapsed() < age
        {
            return Ok(value.clone());
        }
        let value = shared(make).await?;
        *latest = Some((Instant::now(), value.clone()));
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[tokio::test]
    async fn many_who_follow_one_thing_have_it_made_once() {
        let recent = Recent::<u32>::default();
        let made = AtomicU32::new(0);
        let make = async || {
            tokio::task::yield_now().await;
            Ok::<_, ()>(made.fetch_add(1, Ordering::Relaxed))
        };
        let [one, other, third] = ["a", "a", "b"].map(|name| recent.follow(name.to_owned()));
        let hour = Duration::from_hours(1);
        let (first, second) = tokio::join!(one.within(hour, make()), other.within(hour, make()));
        assert_eq!((first, second), (Ok(0), Ok(0)));
        assert_eq!(third.within(hour, make()).await, Ok(1));
        assert_eq!(one.within(Duration::ZERO, make()).await, Ok(2));
        assert_eq!(other.within(hour, make()).await, Ok(2));
        drop((one, other));
        let again = recent.follow("a".to_owned());
        assert_eq!(again.within(hour, make()).await, Ok(3), "nobody followed it");
    }
}
