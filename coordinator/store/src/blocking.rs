//! Work that computes or waits for the disk, where it does not hold up the network.

use murmuration_search::interrupt::Interrupt;
use std::{
    any::Any,
    cell::Cell,
    sync::{Arc, LazyLock},
};
use tokio::runtime::{Builder, Handle, Runtime};

/// Threads of [`in_background`].
const BACKGROUND_THREADS: usize = 8;
/// Their priority: of a core that campaigns want too, one such thread gets a quarter. With less, a person who plays on a busy machine
/// would wait for seconds.
const NICE: i32 = 5;

/// A bug: the work panicked. The log says where.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a task stopped because of a bug, which the log describes; committed data is safe")]
pub struct Broken;

tokio::task_local! {
    static HELD: Arc<dyn Any + Send + Sync>;
}

/// Runs `task`. All work that it gives to [`blocking`] and [`in_background`] holds `held` until that work has ended, even if `task`
/// is dropped before: a request's seat is not free while somebody still works for it.
pub async fn holding<F: Future>(held: Arc<dyn Any + Send + Sync>, task: F) -> F::Output {
    HELD.scope(held, task).await
}

/// Runs `work` on a thread that may block: what a campaign or a decision waits for, or what takes a moment. What has not begun
/// when the future is dropped does not begin.
///
/// # Errors
/// [`Broken`] if it panics.
pub async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Broken> {
    let wanted = Wanted(Interrupt::default());
    let done = tokio::task::spawn_blocking(wanted.by_a_thread(|_| work()));
    // Nobody is told that it did not begin.
    done.await.ok().flatten().ok_or(Broken)
}

/// Runs `work`, which somebody wants to look at and no campaign waits for, on one of a few threads of low priority. It is
/// interrupted when the future is dropped, as when a request's client goes; what has not begun by then does not begin.
///
/// # Errors
/// [`Broken`] if it panics.
pub async fn in_background<T: Send + 'static>(
    work: impl FnOnce(&Interrupt) -> T + Send + 'static,
) -> Result<T, Broken> {
    let wanted = Wanted(Interrupt::default());
    let threads = BACKGROUND
        .as_ref()
        .map_or_else(Handle::current, |threads| threads.handle().clone());
    let done = threads.spawn_blocking(wanted.by_a_thread(work));
    // Nobody is told that it did not begin.
    done.await.ok().flatten().ok_or(Broken)
}

/// Whether this thread is one of those of low priority.
pub(crate) fn is_in_background() -> bool {
    IN_BACKGROUND.get()
}

/// Interrupts work when it is dropped.
struct Wanted(Interrupt);

impl Wanted {
    /// `work` for another thread: `None` if it is no longer wanted when the thread begins. It keeps what the task holds.
    fn by_a_thread<T, W: FnOnce(&Interrupt) -> T>(&self, work: W) -> impl FnOnce() -> Option<T> + use<T, W> {
        let (interrupt, held) = (self.0.clone(), HELD.try_with(Arc::clone).ok());
        move || {
            let done = interrupt.check().is_ok().then(|| work(&interrupt));
            drop(held);
            done
        }
    }
}

impl Drop for Wanted {
    fn drop(&mut self) {
        self.0.raise();
    }
}

thread_local! {
    static IN_BACKGROUND: Cell<bool> = const { Cell::new(false) };
}

/// The process's threads of low priority; `None` where the system has no thread left.
static BACKGROUND: LazyLock<Option<Runtime>> = LazyLock::new(|| {
    let threads = Builder::new_current_thread()
        .max_blocking_threads(BACKGROUND_THREADS)
        .thread_name("background")
        .on_thread_start(|| {
            IN_BACKGROUND.set(true);
            lower_priority();
        })
        .build();
    threads
        .inspect_err(|error| tracing::warn!(%error, "reading has the priority of searching"))
        .ok()
});

/// Elsewhere a priority is that of the whole process.
#[cfg(target_os = "linux")]
fn lower_priority() {
    if let Err(error) = rustix::process::setpriority_process(None, NICE) {
        tracing::debug!(%error, "the priority of a thread stays as it is");
    }
}

#[cfg(not(target_os = "linux"))]
fn lower_priority() {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{
        sync::mpsc,
        thread,
        time::{Duration, Instant},
    };

    #[tokio::test]
    async fn work_that_nobody_waits_for_is_interrupted_or_does_not_begin() {
        let (began, begun) = mpsc::channel();
        let (ended, end) = mpsc::channel();
        let running: Vec<_> = (0..2 * BACKGROUND_THREADS)
            .map(|_| {
                let (began, ended) = (began.clone(), ended.clone());
                tokio::spawn(in_background(move |interrupt| {
                    began.send(()).unwrap();
                    let until = Instant::now() + Duration::from_secs(20);
                    while interrupt.check().is_ok() && Instant::now() < until {
                        thread::sleep(Duration::from_millis(1));
                    }
                    ended.send(interrupt.check().is_err()).unwrap();
                }))
            })
            .collect();
        while begun.try_iter().count() == 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        running.iter().for_each(tokio::task::JoinHandle::abort);
        for gone in running {
            assert!(gone.await.is_err_and(|error| error.is_cancelled()));
        }
        drop((began, ended));
        let ends: Vec<bool> = tokio::task::spawn_blocking(move || end.into_iter().collect())
            .await
            .unwrap();
        assert!(
            !ends.is_empty() && ends.len() <= BACKGROUND_THREADS,
            "{}",
            ends.len()
        );
        assert!(ends.into_iter().all(|interrupted| interrupted));
    }

    #[tokio::test]
    async fn a_task_that_is_gone_holds_until_its_work_has_ended() {
        let held: Arc<dyn Any + Send + Sync> = Arc::new(());
        let (go, gone) = mpsc::channel::<()>();
        let (began, begun) = mpsc::channel();
        let work = async {
            let _ = blocking(move || {
                began.send(()).unwrap();
                gone.recv()
            })
            .await;
        };
        let task = tokio::spawn(holding(Arc::clone(&held), work));
        tokio::task::spawn_blocking(move || begun.recv())
            .await
            .unwrap()
            .unwrap();
        task.abort();
        assert!(task.await.is_err_and(|error| error.is_cancelled()));
        assert_eq!(Arc::strong_count(&held), 2, "the work goes on");
        go.send(()).unwrap();
        while Arc::strong_count(&held) > 1 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }

    #[tokio::test]
    async fn it_runs_beside_the_others_and_says_what_broke() {
        assert!(!is_in_background());
        assert_eq!(in_background(|_| is_in_background()).await, Ok(true));
        assert_eq!(blocking(is_in_background).await, Ok(false));
        assert_eq!(
            in_background(|_| panic!("on purpose")).await,
            Err::<(), _>(Broken)
        );
    }
}
