//! Runs work that computes or waits for the disk on separate threads, so that it does not delay network tasks.

mod turns;

pub use turns::Turns;

use murmuration_search::interrupt::Interrupt;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::{
    any::Any,
    cell::Cell,
    sync::{Arc, LazyLock},
};
use tokio::{
    runtime::{Builder, Handle, Runtime},
    sync::OwnedSemaphorePermit,
};
use turns::Turn;

/// Number of threads of [`in_background`]: one for each seat of the classes whose requests use these threads. Most of them wait for
/// the database.
const BACKGROUND_THREADS: usize = 32;
/// Number of threads for [`LongTurn`]s.
const LONG_THREADS: usize = 2;
/// Nice value of the threads of [`in_background`]: one such thread gets a tenth of a core that campaigns also use. With a larger
/// share, a guest who opens hundreds of pages would slow campaigns by more than a fifth.
const NICE: i32 = 10;

/// A bug: the work panicked. The log names the place of the panic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a task stopped because of a bug, which the log describes; committed data is safe")]
pub struct Broken;

/// How urgent the work of a task is.
#[derive(Debug, Clone)]
pub enum Priority {
    Normal,
    /// All work of the task runs as in [`in_background`], within the limits of the turns, except for [`changing`] the store.
    Low(Turns),
}

tokio::task_local! {
    static TASK: (Arc<dyn Any + Send + Sync>, Priority);
}

/// Runs `task` with a priority. All work that `task` gives to [`blocking`] and [`in_background`] holds `held` until that work has
/// ended, even if `task` is dropped before. So a request's seat is not free while a thread still works for the request.
pub async fn holding<F: Future>(held: Arc<dyn Any + Send + Sync>, priority: Priority, task: F) -> F::Output {
    TASK.scope((held, priority), task).await
}

/// Spawns `task`, which makes a part of a response while the response is sent. `task` holds the same `held` as the current task
/// (see [`holding`]), and has the same priority.
pub fn spawn(task: impl Future<Output = ()> + Send + 'static) {
    let this = TASK.try_with(Clone::clone);
    match this {
        Ok(this) => drop(tokio::spawn(TASK.scope(this, task))),
        Err(_) => drop(tokio::spawn(task)),
    }
}

/// Spawns `task`, which goes on after the response. `task` has the priority of the current task, and holds nothing of it.
pub fn outlive(task: impl Future<Output = ()> + Send + 'static) {
    let priority = TASK.try_with(|(_, priority)| priority.clone());
    let priority = priority.unwrap_or(Priority::Normal);
    drop(tokio::spawn(holding(Arc::new(()), priority, task)));
}

/// Runs `work` on a thread that may block. `blocking` is for work that a campaign or a decision waits for, or that takes only a
/// moment. In a task of low priority, `work` runs as in [`in_background`]. Work that has not begun when the future is dropped
/// never begins.
///
/// # Errors
/// [`Broken`] if `work` panics.
pub async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Broken> {
    match turns() {
        Some(_) => in_background(|_| work()).await,
        None => run(Handle::current(), |_| work()).await,
    }
}

/// Runs `work` like [`blocking`], but with normal priority in every task. `changing` is for changes of the store, because other
/// tasks wait for the store's lock.
///
/// # Errors
/// [`Broken`] if `work` panics.
pub async fn changing<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Broken> {
    run(Handle::current(), |_| work()).await
}

/// Runs `work` like [`changing`]. If the future is dropped, the work is interrupted, or never begins.
///
/// # Errors
/// [`Broken`] if `work` panics.
pub async fn interruptible<T: Send + 'static>(
    work: impl FnOnce(&Interrupt) -> T + Send + 'static,
) -> Result<T, Broken> {
    run(Handle::current(), work).await
}

/// Runs `work` that a client waits for, but no campaign. The work runs on one of a few threads of low priority, or with normal
/// priority as far as the task's [`Turns`] allow this. If the future is dropped, for example when a request's client disconnects,
/// the work is interrupted, or never begins.
///
/// # Errors
/// [`Broken`] if `work` panics.
pub async fn in_background<T: Send + 'static>(
    work: impl FnOnce(&Interrupt) -> T + Send + 'static,
) -> Result<T, Broken> {
    let mut turn = match turns() {
        Some(turns) => Some(turns.next().await),
        None => None,
    };
    let (threads, level) = match &turn {
        Some(turn) if turn.is_prompt => (Handle::current(), Level::Prompt),
        _ => (handle_of(&BACKGROUND), Level::Low),
    };
    let work = move |interrupt: &Interrupt| {
        let _marked = Marked::new(level);
        turn.iter_mut().for_each(Turn::begin);
        work(interrupt)
    };
    run(threads, work).await
}

/// Runs a task that makes something for several clients while they wait, for example under a lock that they share. The task has
/// the priority of this client, but does not wait for this client's other work, so that the others do not wait for it either.
pub async fn shared<F: Future>(make: F) -> F::Output {
    let this = TASK.try_with(Clone::clone);
    match this {
        Ok((held, Priority::Low(turns))) => TASK.scope((held, Priority::Low(turns.at_once())), make).await,
        _ => make.await,
    }
}

/// Permission of a client for one piece of long work, until dropped.
#[derive(Debug)]
pub struct LongTurn {
    _permit: Option<OwnedSemaphorePermit>,
}

impl LongTurn {
    /// The permission of this task's client; `None` while the client has other long work.
    #[must_use]
    pub fn free() -> Option<Self> {
        match turns() {
            Some(turns) => turns.long().map(|permit| Self {
                _permit: Some(permit),
            }),
            None => Some(Self { _permit: None }),
        }
    }

    /// Runs `work` that takes very long, with low priority on threads of its own, beside the client's turns and seats. If the
    /// future is dropped, work that has not begun never begins.
    ///
    /// # Errors
    /// [`Broken`] if `work` panics.
    pub async fn run<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Broken> {
        let work = move |_: &Interrupt| {
            let _turn = self;
            let _marked = Marked::new(Level::Low);
            work()
        };
        run(handle_of(&LONG), work).await
    }
}

/// Runs a pure computation that uses several threads (rayon). Work of [`in_background`] must use this function, so that the other
/// threads have low priority too, or count towards the client's [`Turns`].
pub fn parallel<T: Send>(compute: impl FnOnce() -> T + Send) -> T {
    match (LEVEL.get(), PARALLEL.as_ref()) {
        (Level::Low, Some(pool)) => pool.install(compute),
        (Level::Prompt, _) => turns::counted(compute),
        _ => compute(),
    }
}

/// The turns of this task; `None` if it has normal priority.
fn turns() -> Option<Turns> {
    let turns = TASK.try_with(|(_, priority)| match priority {
        Priority::Low(turns) => Some(turns.clone()),
        Priority::Normal => None,
    });
    turns.ok().flatten()
}

async fn run<T: Send + 'static>(
    threads: Handle,
    work: impl FnOnce(&Interrupt) -> T + Send + 'static,
) -> Result<T, Broken> {
    let wanted = Wanted(Interrupt::default());
    let done = threads.spawn_blocking(wanted.by_a_thread(work));
    // Work that never began has no caller left, so nobody sees this error.
    done.await.ok().flatten().ok_or(Broken)
}

/// Whether this thread does work of [`in_background`].
pub(crate) fn is_in_background() -> bool {
    LEVEL.get() != Level::Foreground
}

/// The kind of work that a thread does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    /// Other work than that of [`in_background`].
    Foreground,
    /// Work of [`in_background`] with normal priority.
    Prompt,
    /// Work of [`in_background`] with low priority.
    Low,
}

/// Marks this thread as doing work of [`in_background`] until dropped.
struct Marked;

impl Marked {
    fn new(level: Level) -> Self {
        LEVEL.set(level);
        Self
    }
}

impl Drop for Marked {
    fn drop(&mut self) {
        LEVEL.set(Level::Foreground);
    }
}

/// Interrupts the work when this value is dropped.
struct Wanted(Interrupt);

impl Wanted {
    /// Wraps `work` for another thread: the wrapper returns `None` if the work is no longer wanted when the thread begins. Until
    /// the work ends, the wrapper holds the `held` of this task (see [`holding`]).
    fn by_a_thread<T, W: FnOnce(&Interrupt) -> T>(&self, work: W) -> impl FnOnce() -> Option<T> + use<T, W> {
        let held = TASK.try_with(|(held, _)| Arc::clone(held)).ok();
        let interrupt = self.0.clone();
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
    static LEVEL: Cell<Level> = const { Cell::new(Level::Foreground) };
}

/// The threads of low priority for [`parallel`], one for each core; `None` if the system could not make them.
static PARALLEL: LazyLock<Option<ThreadPool>> = LazyLock::new(|| {
    let pool = ThreadPoolBuilder::new()
        .thread_name(|_| "parallel".to_owned())
        .start_handler(|_| lower_priority())
        .build();
    pool.inspect_err(|error| tracing::warn!(%error, "parallel threads could not be started: maps and clusters have normal priority"))
        .ok()
});

/// The process's threads of low priority; `None` if the system could not make them.
static BACKGROUND: LazyLock<Option<Runtime>> =
    LazyLock::new(|| low_threads("background", BACKGROUND_THREADS));

/// The process's threads for [`LongTurn`]s.
static LONG: LazyLock<Option<Runtime>> = LazyLock::new(|| low_threads("long", LONG_THREADS));

/// Up to `count` threads of low priority.
fn low_threads(name: &str, count: usize) -> Option<Runtime> {
    let threads = Builder::new_current_thread()
        .max_blocking_threads(count)
        .thread_name(name)
        .on_thread_start(lower_priority)
        .build();
    threads
        .inspect_err(|error| tracing::warn!(%error, "background threads could not be started: reads run with normal priority"))
        .ok()
}

/// These threads of low priority, or else the threads of the current runtime.
fn handle_of(threads: &Option<Runtime>) -> Handle {
    threads
        .as_ref()
        .map_or_else(Handle::current, |threads| threads.handle().clone())
}

/// Lowers the priority of this thread, on Linux only: on other systems a priority applies to the whole process.
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
        // Work that has not begun goes first: it must not begin when a thread becomes free.
        running.iter().rev().for_each(tokio::task::JoinHandle::abort);
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
        let task = tokio::spawn(holding(Arc::clone(&held), Priority::Normal, work));
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
        for (priority, yields) in [(Priority::Normal, false), (Priority::Low(Turns::default()), true)] {
            let work = holding(Arc::new(()), priority.clone(), blocking(is_in_background));
            assert_eq!(work.await, Ok(yields));
            let change = holding(Arc::new(()), priority, changing(is_in_background));
            assert_eq!(change.await, Ok(false));
        }
        assert_eq!(
            in_background(|_| panic!("on purpose")).await,
            Err::<(), _>(Broken)
        );
    }

    #[tokio::test]
    async fn tasks_that_share_turns_have_few_threads_and_leave_others_theirs() {
        let shared = Turns::default();
        let (began, begun) = mpsc::channel();
        let (go, gone) = mpsc::channel::<()>();
        let gone = Arc::new(std::sync::Mutex::new(gone));
        let tasks: Vec<_> = (0..2 * turns::AT_ONCE)
            .map(|_| {
                let (began, gone) = (began.clone(), Arc::clone(&gone));
                let work = in_background(move |_| {
                    began.send(()).unwrap();
                    let _ = gone.lock().unwrap().recv();
                });
                tokio::spawn(holding(Arc::new(()), Priority::Low(shared.clone()), work))
            })
            .collect();
        let other = holding(
            Arc::new(()),
            Priority::Low(Turns::default()),
            in_background(|_| 7),
        );
        assert_eq!(other.await, Ok(7));
        tokio::time::sleep(Duration::from_millis(200)).await;
        assert_eq!(begun.try_iter().count(), turns::AT_ONCE);
        drop(go);
        for task in tasks {
            assert_eq!(task.await.unwrap(), Ok(()));
        }
        assert_eq!(begun.try_iter().count(), turns::AT_ONCE);
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn who_reads_little_has_normal_priority_and_who_reads_on_has_not() {
        let nice = |_: &Interrupt| rustix::process::getpriority_process(None).unwrap();
        let normal = nice(&Interrupt::default());
        let low = Ok((normal + NICE).min(19));
        assert_eq!(in_background(nice).await, low);
        let read = async {
            assert_eq!(in_background(nice).await, Ok(normal));
            let begun = Instant::now();
            while in_background(nice).await == Ok(normal) {
                assert!(begun.elapsed() < Duration::from_secs(120));
                let computes = in_background(|_| {
                    let until = Instant::now() + Duration::from_millis(500);
                    while Instant::now() < until {}
                });
                computes.await.unwrap();
            }
            in_background(nice).await
        };
        assert_eq!(
            holding(Arc::new(()), Priority::Low(Turns::default()), read).await,
            low
        );
        let other = holding(Arc::new(()), Priority::Low(Turns::default()), in_background(nice));
        assert_eq!(other.await, Ok(normal));
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn computations_of_several_threads_have_low_priority_or_are_counted() {
        let nice = || rayon::join(nice_of_this_thread, nice_of_this_thread);
        let (normal, _) = parallel(nice);
        let low = (normal + NICE).min(19);
        assert_eq!(in_background(move |_| parallel(nice)).await, Ok((low, low)));
        let turns = Turns::default();
        let as_client = |work: fn() -> i32| {
            let work = in_background(move |_| parallel(work));
            holding(Arc::new(()), Priority::Low(turns.clone()), work)
        };
        assert_eq!(as_client(nice_of_this_thread).await, Ok(normal));
        // The thread that waits for the others uses next to no processor time itself.
        let waits = || {
            thread::sleep(Duration::from_millis(1500));
            0
        };
        assert_eq!(as_client(waits).await, Ok(0));
        assert_eq!(as_client(nice_of_this_thread).await, Ok(low));
    }

    #[cfg(target_os = "linux")]
    fn nice_of_this_thread() -> i32 {
        rustix::process::getpriority_process(None).unwrap()
    }

    #[tokio::test]
    async fn shared_and_long_work_does_not_wait_for_a_busy_client() {
        let turns = Turns::default();
        let (go, gone) = mpsc::channel::<()>();
        let gone = Arc::new(std::sync::Mutex::new(gone));
        let busy: Vec<_> = (0..turns::AT_ONCE)
            .map(|_| {
                let gone = Arc::clone(&gone);
                let work = in_background(move |_| {
                    let _ = gone.lock().unwrap().recv();
                });
                tokio::spawn(holding(Arc::new(()), Priority::Low(turns.clone()), work))
            })
            .collect();
        let as_client = async |work: &mut (dyn Future<Output = Result<i32, Broken>> + Unpin)| {
            let limited = tokio::time::timeout(Duration::from_millis(200), work);
            holding(Arc::new(()), Priority::Low(turns.clone()), limited).await
        };
        assert_eq!(as_client(&mut Box::pin(shared(blocking(|| 1)))).await, Ok(Ok(1)));
        let long = async {
            let turn = LongTurn::free();
            assert!(LongTurn::free().is_none(), "there is one at a time");
            turn.unwrap().run(|| 2).await
        };
        assert_eq!(as_client(&mut Box::pin(long)).await, Ok(Ok(2)));
        assert!(as_client(&mut Box::pin(blocking(|| 3))).await.is_err());
        drop(go);
        for task in busy {
            task.await.unwrap().unwrap();
        }
    }

    #[tokio::test]
    async fn a_spawned_task_is_as_that_which_spawned_it() {
        let (ended, end) = mpsc::channel();
        let held: Arc<dyn Any + Send + Sync> = Arc::new(());
        let spawns = async {
            spawn(async move {
                let yields = blocking(is_in_background).await;
                ended.send(yields).unwrap();
            });
        };
        holding(Arc::clone(&held), Priority::Low(Turns::default()), spawns).await;
        assert_eq!(Arc::strong_count(&held), 2);
        let yields = tokio::task::spawn_blocking(move || end.recv()).await.unwrap();
        assert_eq!(yields, Ok(Ok(true)));
    }
}
