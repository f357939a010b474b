//! The lease of a data directory: it tells which process holds the directory where locks of files do not.
//!
//! On some file systems, locks are local to each mount (NFS with `nolock`, Lustre with `localflock`, sshfs), so two processes can
//! lock the same file. A holder therefore makes the file `lease/NUMBER.json`, with the next number: a file system makes a new file
//! for only one of several processes. The holder writes a counter into `lease/NUMBER.beat` every [`BEAT`]. A process takes over if
//! the former holder has ended, or if its counter did not change for [`SILENCE`]; it then removes the file of the former holder,
//! who looks for this file before and after each commit.

use super::{
    FileSystem, StoreError,
    files::{log_of, read_short},
};
use murmuration_search::interrupt::{Interrupt, Interrupted};
use rustix::{
    fs::OFlags,
    process::{Pid, test_kill_process},
    time::{ClockId, clock_gettime},
};
use std::{
    fs, io,
    os::unix::fs::{MetadataExt as _, OpenOptionsExt as _},
    path::{Path, PathBuf},
    sync::atomic::{AtomicI64, Ordering},
    thread,
    time::{Duration, Instant, SystemTime},
};
use tokio::sync::watch;

/// Name of the folder of leases in a data directory.
pub(super) const FOLDER: &str = "lease";
/// Time from one change of the counter to the next one.
pub(super) const BEAT: Duration = Duration::from_millis(if cfg!(test) { 100 } else { 2_000 });
/// A holder whose counter does not change for this time is taken to have ended.
const SILENCE: Duration = Duration::from_secs(if cfg!(test) { 2 } else { 20 });
/// Number of beats, about an hour, after which the file of the lease gets a new date.
const BEATS_TO_TOUCH: u64 = 1_800;
/// Pause between two looks at another process's counter.
const LOOK_PAUSE: Duration = Duration::from_millis(if cfg!(test) { 50 } else { 200 });

/// A lease that this process holds.
#[derive(Debug)]
pub(super) struct Lease {
    data: PathBuf,
    number: u64,
    holder: Holder,
    /// When the counter was changed last, in seconds of the clock that also counts while the machine is suspended.
    beaten: AtomicI64,
    /// Whether another process has taken the data directory over.
    lost: watch::Sender<bool>,
}

/// The process that took a lease, as the file of the lease describes it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
struct Holder {
    /// A random text, different for each lease.
    #[serde(default)]
    id: String,
    /// Name of the machine.
    machine: String,
    /// Identity of this run of the machine's kernel; empty if it is unknown.
    boot: String,
    /// Identity of the group of processes in which `process` is a number; empty if it is unknown.
    processes: String,
    process: i32,
    /// When the process began, in the kernel's ticks; `None` if it is unknown.
    began: Option<u64>,
    /// Whether the holder reaches the data directory through a local file system, so that its lock excludes all processes of its
    /// kernel.
    is_local: bool,
    /// Whether the former holder may still run, and this holder does not work on copies of its files yet.
    #[serde(default)]
    renews: bool,
    /// Whether the holder has given the lease back.
    ended: bool,
}

/// How to treat a former holder if it is unknown whether it still runs.
#[derive(Debug, Clone, Copy)]
pub(super) enum Unknown<'a> {
    /// Wait for a change of its counter; without a change, take over.
    TakeOver(&'a Interrupt),
    /// Treat it as running.
    Spare,
}

impl Unknown<'_> {
    /// The flag that ends waits and copies, if there is one.
    pub(super) const fn interrupt(&self) -> Option<&Interrupt> {
        match self {
            Self::TakeOver(interrupt) => Some(interrupt),
            Self::Spare => None,
        }
    }
}

/// The state of a former holder of the data directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Former {
    Runs,
    Ended,
    /// Nothing has been heard for [`SILENCE`]: the process can still run, and write what it had begun to write.
    Silent,
}

/// Why a lease was not taken.
#[derive(Debug)]
pub(super) enum Refusal {
    /// Another process holds the data directory.
    Held,
    Interrupted(Interrupted),
    Failed {
        doing: &'static str,
        path: PathBuf,
        source: io::Error,
    },
}

impl Lease {
    /// Takes the lease of the data directory `data`. `locked` tells whether this process has the lock of the directory.
    /// [`Lease::renew`] must succeed before the database is opened.
    pub(super) fn take(
        data: &Path,
        file_system: &FileSystem,
        locked: bool,
        unknown: Unknown<'_>,
    ) -> Result<Self, Refusal> {
        let folder = data.join(FOLDER);
        make_folder(&folder).map_err(failed("make", &folder))?;
        let own = Holder::current(file_system);
        let known = numbers(&folder).map_err(failed("list", &folder))?;
        let examined = Examined::of(&folder, &known)?;
        let renews = match all_former(&folder, &known, &own, locked, unknown)? {
            Former::Runs => return Err(Refusal::Held),
            Former::Ended => false,
            Former::Silent => {
                expect_room(data).map_err(failed("copy the database in", data))?;
                true
            }
        };
        let full = || io::Error::other("its numbers are used up: remove the folder");
        let number = newest_of(&known).unwrap_or(0).checked_add(1);
        let number = number.ok_or_else(full).map_err(failed("use", &folder))?;
        let lease = Self {
            data: data.to_path_buf(),
            number,
            holder: Holder { renews, ..own },
            beaten: AtomicI64::new(0),
            lost: watch::Sender::new(false),
        };
        lease.make(&folder, &examined)?;
        Ok(lease)
    }

    /// If the former holder may still run, lets `copy` replace the files that it may have open: what it had begun to write must not
    /// get into the database of this process. `copy` gets a text for the names of its new files, and a check for the moment before
    /// each replacement. If this process ends meanwhile, the next holder does the same. Copying can take long, so other processes
    /// must hear this process meanwhile (see [`Lease::beat`]).
    pub(super) fn renew(
        &self,
        copy: impl FnOnce(&str, &dyn Fn() -> Result<(), StoreError>) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        if !self.holder.renews {
            return Ok(());
        }
        copy(&self.holder.id, &|| self.check())?;
        self.check()?;
        let path = self.path();
        let renewed = Holder {
            renews: false,
            ..self.holder.clone()
        };
        self.write(&renewed)
            .map_err(|error| StoreError::from_io(error, "write", &path))?;
        let folder = self.data.join(FOLDER);
        let all = numbers(&folder).map_err(|error| StoreError::from_io(error, "list", &folder))?;
        if newest_of(&all) != Some(self.number) {
            // The file had been removed before it was written again.
            self.remove(self.number);
        }
        self.check()
    }

    fn make(&self, folder: &Path, examined: &Examined) -> Result<(), Refusal> {
        let path = self.path();
        match own_file().create_new(true).open(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Err(Refusal::Held),
            made => drop(made.map_err(failed("make", &path))?),
        }
        let begun = self.write(&self.holder).and_then(|()| self.beat(0));
        let older = begun
            .map_err(failed("write", &path))
            .and_then(|()| self.older(folder, examined));
        if older.is_err() {
            self.remove(self.number);
        }
        // From here on, this lease stays even after an error: only it tells the next holder whether a former one may still write.
        self.fence_off(folder, older?)
    }

    /// The leases before this one. Each must be one that this process has examined: if a process that could not take a lease has
    /// removed it again, its number can have a new holder.
    fn older(&self, folder: &Path, examined: &Examined) -> Result<Vec<u64>, Refusal> {
        let mut all = numbers(folder).map_err(failed("list", folder))?;
        // A process that was slow to make its file may be late: others have taken later leases meanwhile.
        if newest_of(&all) != Some(self.number) {
            return Err(Refusal::Held);
        }
        all.retain(|&number| number != self.number);
        match Examined::of(folder, &all)?.are_among(examined) {
            true => Ok(all),
            false => Err(Refusal::Held),
        }
    }

    /// Removes the leases before this one, so that their holders change nothing more.
    fn fence_off(&self, folder: &Path, older: Vec<u64>) -> Result<(), Refusal> {
        for older in older {
            let path = file_of(folder, older);
            match fs::remove_file(&path) {
                Err(error) if !is_gone(&error) => return Err(failed("remove", &path)(error)),
                _ => self.remove(older),
            }
        }
        Ok(())
    }

    /// Fails if another process has taken the data directory over.
    ///
    /// # Errors
    /// [`StoreError::TakenOver`], and [`StoreError::Unwritable`] if it cannot be determined for now who holds the directory.
    pub(super) fn check(&self) -> Result<(), StoreError> {
        match self.is_held() {
            Ok(true) => Ok(()),
            Ok(false) => {
                self.lost.send_replace(true);
                Err(StoreError::TakenOver(self.data.clone()))
            }
            // Nobody takes over before `SILENCE` is over.
            Err(_) if self.seconds_since_beat() < SILENCE.as_secs().cast_signed() / 2 => Ok(()),
            Err(error) => Err(StoreError::Unwritable {
                path: self.path(),
                reason: error.to_string(),
            }),
        }
    }

    /// Checks as [`Lease::check`] does, after a commit. Waits until it is known who holds the directory: a change that is on disk
    /// must not be reported as refused.
    ///
    /// # Errors
    /// [`StoreError::TakenOver`].
    pub(super) fn check_committed(&self) -> Result<(), StoreError> {
        loop {
            match self.check() {
                Err(StoreError::Unwritable { .. }) => thread::sleep(LOOK_PAUSE),
                known => return known,
            }
        }
    }

    fn is_held(&self) -> io::Result<bool> {
        match read_short(&self.path()) {
            Ok(bytes) => {
                let holder: Option<Holder> = serde_json::from_slice(&bytes).ok();
                Ok(holder.is_some_and(|holder| holder.id == self.holder.id))
            }
            Err(error) if is_gone(&error) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Changes the counter to `count`, so that other processes see that this process runs.
    pub(super) fn beat(&self, count: u64) -> io::Result<()> {
        use io::Write as _;
        let now = seconds();
        // The bytes are replaced in place: most file systems can do this on a full disk, too.
        let mut file = own_file().create(true).open(self.beat_path())?;
        file.write_all(format!("{count:020}").as_bytes())?;
        self.beaten.store(now, Ordering::Relaxed);
        if count.is_multiple_of(BEATS_TO_TOUCH) {
            // Programs that remove old files must not take the lease for one.
            own_file().open(self.path())?.set_modified(SystemTime::now())?;
        }
        Ok(())
    }

    /// Gives the lease back, so that the next holder need not wait. Ignores failures: without this, the next holder waits.
    pub(super) fn end(&self) {
        let ended = Holder {
            ended: true,
            ..self.holder.clone()
        };
        if self.check().is_ok() {
            let _ = self.write(&ended);
            let _ = fs::remove_file(self.beat_path());
        }
    }

    /// Becomes true when another process has taken the data directory over.
    pub(super) fn lost(&self) -> watch::Receiver<bool> {
        self.lost.subscribe()
    }

    fn write(&self, holder: &Holder) -> io::Result<()> {
        use io::Write as _;
        // A process that reads meanwhile sees one of the two contents.
        let path = self.path();
        let new = path.with_extension("new");
        match fs::remove_file(&new) {
            Err(error) if !is_gone(&error) => return Err(error),
            _ => {}
        }
        let mut file = own_file().create_new(true).open(&new)?;
        file.write_all(&serde_json::to_vec(holder)?)?;
        file.sync_all()?;
        fs::rename(&new, &path)
    }

    /// Removes the files of a lease that is over. Ignores failures: at worst, the next holder waits for a sign of it.
    fn remove(&self, number: u64) {
        let folder = self.data.join(FOLDER);
        for extension in ["json", "beat", "new"] {
            let _ = fs::remove_file(folder.join(format!("{number}.{extension}")));
        }
    }

    fn seconds_since_beat(&self) -> i64 {
        seconds() - self.beaten.load(Ordering::Relaxed)
    }

    fn path(&self) -> PathBuf {
        file_of(&self.data.join(FOLDER), self.number)
    }

    fn beat_path(&self) -> PathBuf {
        beat_of(&self.data.join(FOLDER), self.number)
    }
}

impl Holder {
    fn current(file_system: &FileSystem) -> Self {
        let text =
            |text: io::Result<String>| text.map_or_else(|_| String::new(), |text| text.trim().to_owned());
        let processes = fs::read_link("/proc/self/ns/pid").map(|link| link.display().to_string());
        let process = rustix::process::getpid();
        Self {
            id: format!("{:016x}", getrandom::u64().unwrap_or_default()),
            machine: rustix::system::uname().nodename().to_string_lossy().into_owned(),
            boot: text(fs::read_to_string("/proc/sys/kernel/random/boot_id")),
            processes: text(processes),
            process: process.as_raw_pid(),
            began: Life::own().map(|life| life.began),
            is_local: file_system.is_local(),
            renews: false,
            ended: false,
        }
    }

    /// Whether the process runs, as far as the process `own` can tell.
    fn runs(&self, own: &Self) -> Option<bool> {
        let is_known = !own.boot.is_empty() && !own.processes.is_empty() && own.began.is_some();
        if !is_known || (&self.boot, &self.processes) != (&own.boot, &own.processes) {
            return None;
        }
        let process = Pid::from_raw(self.process)?;
        if test_kill_process(process) == Err(rustix::io::Errno::SRCH) {
            return Some(false);
        }
        let (life, began) = (Life::of(process)?, self.began?);
        Some(life.runs && life.began == began)
    }
}

/// The life of a process, from `/proc/PID/stat` (see proc(5)).
struct Life {
    began: u64,
    runs: bool,
}

impl Life {
    /// This process; `None` if `/proc` does not show this process under its number, as in a new namespace of processes.
    fn own() -> Option<Self> {
        let own = fs::read_link("/proc/self").ok()?;
        let process = rustix::process::getpid();
        (own.to_str()? == process.as_raw_pid().to_string()).then(|| Self::of(process))?
    }

    /// `None` if the system does not tell.
    fn of(process: Pid) -> Option<Self> {
        let process = process.as_raw_pid();
        let line = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
        // The name of the program, which can have spaces and parentheses, ends with the last parenthesis.
        let (_, fields) = line.rsplit_once(") ")?;
        let mut fields = fields.split(' ');
        let has_ended = matches!(fields.next()?, "Z" | "X");
        let began = fields.nth(18)?.parse().ok()?;
        let threads = fs::read_dir(format!("/proc/{process}/task"));
        Some(Self {
            began,
            // The first thread can have ended while others still write.
            runs: !has_ended || threads.map_or(0, Iterator::count) > 1,
        })
    }
}

/// Looks at the holders of all leases: a process that ended while it took the newest lease can have left another's behind.
fn all_former(
    folder: &Path,
    known: &[u64],
    own: &Holder,
    locked: bool,
    unknown: Unknown<'_>,
) -> Result<Former, Refusal> {
    let mut all = Former::Ended;
    for &number in known {
        match former(folder, number, own, locked, unknown)? {
            Former::Runs => return Ok(Former::Runs),
            Former::Silent => all = Former::Silent,
            Former::Ended => {}
        }
    }
    Ok(all)
}

/// Looks at the holder of lease `number`: waits up to [`SILENCE`] for a sign of it, if nothing else tells whether it runs.
fn former(
    folder: &Path,
    number: u64,
    own: &Holder,
    locked: bool,
    unknown: Unknown<'_>,
) -> Result<Former, Refusal> {
    // The lock of a local file system excludes all processes that reach the directory in the same way.
    let excludes = locked && own.is_local;
    let count = beat_count(folder, number);
    let (mut unheard, mut is_told) = (Duration::ZERO, false);
    loop {
        let begun = Instant::now();
        match read(folder, number)? {
            Read::Gone => return Ok(Former::Ended),
            Read::Holder(holder) => {
                let excludes = excludes && holder.is_local;
                let ended = match holder.renews {
                    true => Former::Silent,
                    false => Former::Ended,
                };
                match holder.runs(own) {
                    _ if holder.ended => return Ok(Former::Ended),
                    Some(true) => return Ok(Former::Runs),
                    Some(false) => return Ok(ended),
                    None if excludes => return Ok(ended),
                    None => {}
                }
                if !std::mem::replace(&mut is_told, true) {
                    tracing::warn!(
                        machine = holder.machine,
                        folder = %folder.display(),
                        "the data directory's last process did not give it back: waiting up to {} s for a sign of it",
                        SILENCE.as_secs()
                    );
                }
            }
            // Its process ended while it took the lease, perhaps from a process that still runs.
            Read::Empty if excludes => return Ok(Former::Silent),
            // Its process is about to write it.
            Read::Empty => {}
        }
        let Unknown::TakeOver(interrupt) = unknown else {
            return Ok(Former::Runs);
        };
        interrupt.check().map_err(Refusal::Interrupted)?;
        if beat_count(folder, number) != count {
            // A process that ends removes its counter.
            return Ok(match read(folder, number)? {
                Read::Holder(holder) if !holder.ended => Former::Runs,
                Read::Holder(_) | Read::Gone => Former::Ended,
                Read::Empty => Former::Silent,
            });
        }
        if unheard >= SILENCE {
            return Ok(Former::Silent);
        }
        thread::sleep(LOOK_PAUSE);
        // While a file server does not answer, nobody is heard.
        unheard += begun.elapsed().min(2 * LOOK_PAUSE);
    }
}

/// Whether another process holds the data directory `data`. Waits as [`Lease::take`] does, and changes nothing.
pub(super) fn is_held(data: &Path, file_system: &FileSystem, locked: bool) -> Result<bool, Refusal> {
    let folder = data.join(FOLDER);
    let known = match fs::symlink_metadata(&folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        _ => numbers(&folder).map_err(failed("list", &folder))?,
    };
    let (own, never) = (Holder::current(file_system), Interrupt::default());
    Ok(all_former(&folder, &known, &own, locked, Unknown::TakeOver(&never))? == Former::Runs)
}

/// The leases that a process has examined: their numbers and the ids of their holders. A lease that is still empty has no id.
struct Examined(Vec<(u64, String)>);

impl Examined {
    fn of(folder: &Path, numbers: &[u64]) -> Result<Self, Refusal> {
        let id = |&number: &u64| {
            Ok(match read(folder, number)? {
                Read::Gone => None,
                Read::Empty => Some((number, String::new())),
                Read::Holder(holder) => Some((number, holder.id)),
            })
        };
        let ids = numbers.iter().map(id).filter_map(Result::transpose);
        ids.collect::<Result<_, _>>().map(Self)
    }

    fn are_among(&self, others: &Self) -> bool {
        self.0.iter().all(|lease| others.0.contains(lease))
    }
}

/// Fails if the disk has no room for a copy of the database. Otherwise the former holder would be excluded in vain.
fn expect_room(data: &Path) -> io::Result<()> {
    let database = data.join(super::Store::FILE);
    let log = log_of(&database);
    let bytes = |path: &Path| path.metadata().map_or(0, |file| file.len());
    let disk = rustix::fs::statvfs(data)?;
    match disk.f_bavail.saturating_mul(disk.f_frsize) >= bytes(&database) + bytes(&log) {
        true => Ok(()),
        false => Err(io::ErrorKind::StorageFull.into()),
    }
}

enum Read {
    Gone,
    Empty,
    Holder(Holder),
}

fn read(folder: &Path, number: u64) -> Result<Read, Refusal> {
    let path = file_of(folder, number);
    let bytes = match read_short(&path) {
        Ok(bytes) if bytes.is_empty() => return Ok(Read::Empty),
        Ok(bytes) => bytes,
        Err(error) if is_gone(&error) => return Ok(Read::Gone),
        Err(source) => return Err(failed("read", &path)(source)),
    };
    let foreign = |_| io::Error::other("it is not Murmuration's: name another folder as the data directory");
    let holder = serde_json::from_slice(&bytes).map_err(foreign);
    Ok(Read::Holder(holder.map_err(failed("use", &path))?))
}

fn beat_count(folder: &Path, number: u64) -> Option<Vec<u8>> {
    read_short(&beat_of(folder, number)).ok()
}

fn newest_of(numbers: &[u64]) -> Option<u64> {
    numbers.iter().max().copied()
}

/// Numbers of the leases in a folder.
fn numbers(folder: &Path) -> io::Result<Vec<u64>> {
    let number = |entry: io::Result<fs::DirEntry>| {
        let name = entry?.file_name();
        let number = name.to_str().and_then(|name| name.strip_suffix(".json"));
        Ok(number.and_then(|number| number.parse().ok()))
    };
    fs::read_dir(folder)?
        .map(number)
        .filter_map(Result::transpose)
        .collect()
}

/// Makes the folder of leases. In another user's data directory, the folder could be a link to anywhere.
fn make_folder(folder: &Path) -> io::Result<()> {
    let mut new = fs::DirBuilder::new();
    std::os::unix::fs::DirBuilderExt::mode(&mut new, 0o700);
    match new.create(folder) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            match fs::symlink_metadata(folder)?.is_dir() {
                true => Ok(()),
                false => Err(io::Error::other("it is not a folder")),
            }
        }
        Ok(()) => give_to_owner(folder, folder.parent().unwrap_or(folder)),
        failed => failed,
    }
}

fn file_of(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("{number}.json"))
}

fn beat_of(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("{number}.beat"))
}

/// How files of leases are opened for writing: never through a link, which could lead to any file of this user.
fn own_file() -> fs::OpenOptions {
    let mut options = fs::File::options();
    options
        .write(true)
        // Nothing in them is secret, and the next holder can be another user: the owner after root, for example.
        .mode(0o644)
        // Opening a pipe for writing would wait for a reader.
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits().cast_signed());
    options
}

/// Whether a file was removed. A stale handle (ESTALE) is no sign of that: a file server that starts again gives it for files that
/// are there.
fn is_gone(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::NotFound
}

/// Seconds of the clock that also counts while the machine is suspended.
fn seconds() -> i64 {
    #[cfg(target_os = "linux")]
    let clock = ClockId::Boottime;
    #[cfg(not(target_os = "linux"))]
    let clock = ClockId::Monotonic;
    clock_gettime(clock).tv_sec
}

/// Gives a file that root has made to the owner of `like`, who could not use it otherwise.
pub(super) fn give_to_owner(path: &Path, like: &Path) -> io::Result<()> {
    if !rustix::process::geteuid().is_root() {
        return Ok(());
    }
    let owner = like.metadata()?;
    std::os::unix::fs::chown(path, Some(owner.uid()), Some(owner.gid()))
}

fn failed(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Refusal + use<> {
    let path = path.to_path_buf();
    move |source| Refusal::Failed { doing, path, source }
}

#[cfg(test)]
mod tests;
