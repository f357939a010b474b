//! The entries of a mirror, and the objects that hold them.
//!
//! Entry N is the object `log/N`, with N in 20 digits: a line of JSON, then zstd-compressed bytes. An entry never changes. The
//! object store makes an object for one writer only, so two writers never both write entry N. Snapshots of the database's file are
//! objects `snapshots/B-ATTEMPT`, where B is the number of the first entry of their epoch.

use super::MirrorError;
use crate::objects::{Objects, SLOWEST};
use bytes::Bytes;
use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use object_store::{ObjectStoreExt as _, PutMode, PutPayload, WriteMultipart};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fs::{self, File},
    io::{self, Write as _},
    os::unix::fs::FileExt as _,
    path::Path,
    sync::Arc,
    time::{Duration, SystemTime},
};

/// Limit for one attempt to write or read an object; the client of a bucket repeats requests for minutes otherwise.
const LIMIT: Duration = Duration::from_secs(20);
/// Size of the parts in which a snapshot is written.
const PART_BYTES: usize = 8 << 20;
/// Number of parts of a snapshot that are on their way at once.
pub(super) const PARTS_AT_ONCE: usize = 4;
/// Longest payload of an entry, bytes.
pub(super) const MAX_PAYLOAD: u64 = 4 << 20;
/// Objects younger than this stay: somebody may be reading them.
const KEPT: Duration = Duration::from_secs(if cfg!(test) { 0 } else { 3600 });
/// Unfinished files that were written to within this time stay: a living process may be writing them.
const UNFINISHED_KEPT: Duration = Duration::from_secs(3600);
/// Limit for an attempt to write or read a part of a snapshot or a long entry, while others are on their way.
const LIMIT_OF_PARTS: Duration =
    Duration::from_secs(LIMIT.as_secs() + (PARTS_AT_ONCE * PART_BYTES) as u64 / SLOWEST);
/// Longest object that can be the entry of a snapshot, bytes. Parts of a log can be as short.
const LONGEST_SNAPSHOT_ENTRY: u64 = 1 << 10;
/// Longest object of an entry: a payload that zstd could not compress, and the first line.
const LONGEST_ENTRY: u64 = MAX_PAYLOAD + (64 << 10);
/// Longest object that can be a claim, bytes. Parts of a log that are as short stay in the mirror too.
const LONGEST_CLAIM: u64 = 512;
/// Level of zstd: a fast one, because a decision waits for its entry.
const LEVEL: i32 = 1;

/// The first line of an entry.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// The process that wrote the entry.
    pub(super) writer: String,
    /// The number of the database's log, counted over all writers: a log that begins anew has the next number.
    pub(super) epoch: u64,
    pub(super) what: What,
    /// The writer's count of changes of its database (see [`crate::open::changes`]), which the database has at least; `None` if
    /// the writer had no database yet.
    #[serde(default)]
    pub(super) changes: Option<u32>,
    /// BLAKE3 of the payload.
    digest: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum What {
    /// The writer goes on from here: former writers can write no more.
    Claim,
    /// Bytes of the log of epoch `epoch`, beginning at byte `from`.
    Frames {
        from: u64,
    },
    Snapshot(Snapshot),
}

/// The database's file at some time during an epoch. With the whole log of this epoch and of all later ones, it gives the database.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Snapshot {
    /// Name of the object.
    pub(super) object: String,
    pub(super) epoch: u64,
    bytes: u64,
    /// BLAKE3 of the file.
    digest: String,
}

/// Which writer's entry has the number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Placed {
    Ours,
    Another,
}

/// An object of the mirror.
#[derive(Debug, Clone)]
pub(super) struct Listed {
    /// The name within the mirror.
    pub(super) name: String,
    pub(super) bytes: u64,
    /// When the object was made, by the object store's clock.
    pub(super) made: SystemTime,
}

/// The objects of a mirror; cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Entries {
    pub(super) objects: Objects,
}

impl Entry {
    /// The object of an entry with this payload.
    pub(super) fn encode(
        writer: &str,
        epoch: u64,
        changes: Option<u32>,
        what: What,
        payload: &[u8],
    ) -> Result<Bytes, MirrorError> {
        let entry = Self {
            writer: writer.to_owned(),
            epoch,
            what,
            changes,
            digest: digest(payload),
        };
        let mut bytes = serde_json::to_vec(&entry).map_err(io::Error::other)?;
        bytes.push(b'\n');
        bytes.extend(zstd::bulk::compress(payload, LEVEL)?);
        Ok(bytes.into())
    }

    fn decode(object: &[u8]) -> Result<(Self, Vec<u8>), String> {
        let mut parts = object.splitn(2, |&byte| byte == b'\n');
        let (line, compressed) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        let entry: Self = serde_json::from_slice(line).map_err(|error| error.to_string())?;
        let payload =
            zstd::bulk::decompress(compressed, MAX_PAYLOAD as usize).map_err(|error| error.to_string())?;
        match digest(&payload) == entry.digest {
            true => Ok((entry, payload)),
            false => Err("its bytes have another digest".to_owned()),
        }
    }
}

fn digest(payload: &[u8]) -> String {
    blake3::hash(payload).to_hex().to_string()
}

impl Listed {
    /// Whether an entry can be that of a snapshot, by its length.
    pub(super) const fn is_short(&self) -> bool {
        self.bytes <= LONGEST_SNAPSHOT_ENTRY
    }
}

impl Entries {
    /// All entries, by number.
    pub(super) async fn list(&self) -> Result<BTreeMap<u64, Listed>, MirrorError> {
        self.list_from(0).await
    }

    /// The entries from number `first` on.
    pub(super) async fn list_from(&self, first: u64) -> Result<BTreeMap<u64, Listed>, MirrorError> {
        let before = first.checked_sub(1).map(name_of);
        let listed = self.listed(LOG, before.as_deref()).await?.into_iter();
        let numbered = listed.filter_map(|listed| Some((number_of(&listed.name)?, listed)));
        Ok(numbered.collect())
    }

    /// Whether there is any snapshot of a database; the folder may have objects of others.
    pub(super) async fn has_snapshots(&self) -> Result<bool, MirrorError> {
        let all = self.snapshots().await?;
        Ok(all.iter().any(|listed| snapshot_begins(&listed.name).is_some()))
    }

    /// All snapshots, those whose logs begin last first.
    pub(super) async fn snapshots(&self) -> Result<Vec<Listed>, MirrorError> {
        let mut listed = self.listed(SNAPSHOTS, None).await?;
        listed.sort_by(|one, other| other.name.cmp(&one.name));
        Ok(listed)
    }

    /// The objects of a folder whose names come after `after`.
    async fn listed(&self, folder: &str, after: Option<&str>) -> Result<Vec<Listed>, MirrorError> {
        let prefix = self.objects.path(folder);
        let mut objects = match after {
            Some(after) => self
                .objects
                .store
                .list_with_offset(Some(&prefix), &self.objects.path(after)),
            None => self.objects.store.list(Some(&prefix)),
        };
        let mut listed = Vec::new();
        while let Some(object) = self.within(objects.try_next()).await? {
            let name = object.location.prefix_match(&prefix).into_iter().flatten();
            let name: Vec<_> = name.map(|part| part.as_ref().to_owned()).collect();
            listed.push(Listed {
                name: format!("{folder}/{}", name.join("/")),
                bytes: object.size,
                made: object.last_modified.into(),
            });
        }
        Ok(listed)
    }

    /// The entry `number`, with its payload.
    pub(super) async fn read(&self, number: u64) -> Result<(Entry, Vec<u8>), MirrorError> {
        let object = self.object(number).await?;
        Entry::decode(&object).map_err(|reason| MirrorError::Damaged {
            object: self.objects.name(&name_of(number)),
            reason,
        })
    }

    async fn object(&self, number: u64) -> Result<Bytes, MirrorError> {
        self.object_within(LIMIT_OF_PARTS, number).await
    }

    async fn object_within(&self, limit: Duration, number: u64) -> Result<Bytes, MirrorError> {
        let name = name_of(number);
        let path = self.objects.path(&name);
        let found = self.within_limit(limit, self.objects.store.get(&path)).await?;
        if found.meta.size > LONGEST_ENTRY {
            return Err(MirrorError::Damaged {
                object: self.objects.name(&name),
                reason: "it is too long for an entry".to_owned(),
            });
        }
        self.within_limit(limit, found.bytes()).await
    }

    /// Whether there is an entry `number`.
    pub(super) async fn exists(&self, number: u64) -> Result<bool, MirrorError> {
        let path = self.objects.path(&name_of(number));
        match self.within(self.objects.store.head(&path)).await {
            Ok(_) => Ok(true),
            Err(MirrorError::Objects {
                source: object_store::Error::NotFound { .. },
                ..
            }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Writes entry `number`, unless another writer has written it. May be repeated with the same bytes after an error, when it is
    /// unknown whether the entry was written.
    pub(super) async fn put(&self, number: u64, entry: &Bytes) -> Result<Placed, MirrorError> {
        let path = self.objects.path(&name_of(number));
        let payload = PutPayload::from(entry.clone());
        let options = PutMode::Create.into();
        let put = self.objects.store.put_opts(&path, payload, options);
        match self.within(put).await {
            Ok(_) => Ok(Placed::Ours),
            Err(MirrorError::Objects {
                source: object_store::Error::AlreadyExists { .. } | object_store::Error::Precondition { .. },
                ..
            }) => match self.object(number).await? == *entry {
                true => Ok(Placed::Ours),
                false => Ok(Placed::Another),
            },
            Err(error) => Err(error),
        }
    }

    /// Checks that entry `number` is there with these bytes. Otherwise the mirror's folder is another one than before, such as the
    /// empty folder under a file system that is not mounted any more.
    ///
    /// # Errors
    /// [`MirrorError::Gone`].
    pub(super) async fn expect(&self, number: u64, entry: &Bytes) -> Result<(), MirrorError> {
        let found = self
            .object_within(LIMIT, number)
            .await
            .map(|found| found == *entry);
        self.is_there(found, &name_of(number))
    }

    /// Checks that entry `number` is there with one of these BLAKE3 digests, as [`expect`](Self::expect) does.
    pub(super) async fn expect_digest(&self, number: u64, expected: &[String]) -> Result<(), MirrorError> {
        let found = self.object_within(LIMIT, number).await;
        let found = found.map(|found| expected.contains(&digest(&found)));
        self.is_there(found, &name_of(number))
    }

    /// Checks that the object of a snapshot is there, as [`expect`](Self::expect) does.
    pub(super) async fn expect_snapshot(&self, snapshot: &Snapshot) -> Result<(), MirrorError> {
        let path = self.objects.path(&snapshot.object);
        let found = self.within(self.objects.store.head(&path)).await;
        self.is_there(found.map(|found| found.size == snapshot.bytes), &snapshot.object)
    }

    fn is_there(&self, found: Result<bool, MirrorError>, name: &str) -> Result<(), MirrorError> {
        let gone = || MirrorError::Gone(self.objects.name(name));
        match found {
            Ok(true) => Ok(()),
            Ok(false) => Err(gone()),
            Err(error) if error.is_not_found() => Err(gone()),
            Err(error) => Err(error),
        }
    }

    /// The name of entry `number`, for messages.
    pub(super) fn name(&self, number: u64) -> String {
        self.objects.name(&name_of(number))
    }

    /// Writes the database's file as the object of a snapshot.
    pub(super) async fn put_snapshot(
        &self,
        object: String,
        epoch: u64,
        file: Arc<File>,
    ) -> Result<Snapshot, MirrorError> {
        let path = self.objects.path(&object);
        let upload = self.within(self.objects.store.put_multipart(&path)).await?;
        let mut parts = WriteMultipart::new_with_chunk_size(upload, PART_BYTES);
        match self.put_parts(&mut parts, file).await {
            Ok((bytes, digest)) => {
                // This waits for the last parts, and for the whole file to be on disk.
                let limit = LIMIT + Duration::from_secs(bytes / SLOWEST);
                self.within_limit(limit, parts.finish()).await?;
                Ok(Snapshot {
                    object,
                    epoch,
                    bytes,
                    digest,
                })
            }
            Err(error) => {
                let _ = self.within(parts.abort()).await;
                Err(error)
            }
        }
    }

    /// Writes an object of `bytes` bytes, and gives it up again before it has its name.
    pub(super) async fn try_room(&self, bytes: u64, writer: &str) -> Result<(), MirrorError> {
        self.remove_unfinished().await;
        let path = self.objects.path(&format!("{TRIALS}/{writer}"));
        let mut upload = self.within(self.objects.store.put_multipart(&path)).await?;
        let mut random = vec![0; PART_BYTES];
        // A file system that compresses would have room for any number of zeros.
        getrandom::fill(&mut random).map_err(io::Error::other)?;
        let random = Bytes::from(random);
        let mut written = Ok(());
        for begin in (0..bytes).step_by(PART_BYTES) {
            let len = (bytes - begin).min(PART_BYTES as u64) as usize;
            let part = upload.put_part(random.slice(..len).into());
            written = self.within_limit(LIMIT_OF_PARTS, part).await;
            if written.is_err() {
                break;
            }
        }
        let aborted = self.within(upload.abort()).await;
        written.and(aborted)
    }

    /// Removes the unfinished files that killed processes left in the mirror's folder. Failures do no harm.
    async fn remove_unfinished(&self) {
        let Some(folder) = self.objects.folder() else {
            return;
        };
        let folders = [TRIALS, LOG, SNAPSHOTS].map(|name| folder.join(name));
        let remove = move || {
            let files = folders.iter().flat_map(fs::read_dir).flatten().flatten();
            for file in files.filter(|file| is_unfinished(&file.file_name())) {
                let written = file.metadata().and_then(|file| file.modified());
                let age = written.map(|written| written.elapsed().unwrap_or_default());
                if age.is_ok_and(|age| age > UNFINISHED_KEPT) {
                    let _ = fs::remove_file(file.path());
                }
            }
        };
        let _ = tokio::task::spawn_blocking(remove).await;
    }

    /// Returns the size and digest of the file.
    async fn put_parts(
        &self,
        parts: &mut WriteMultipart,
        file: Arc<File>,
    ) -> Result<(u64, String), MirrorError> {
        let (mut hasher, mut bytes) = (blake3::Hasher::new(), 0);
        loop {
            let file = file.clone();
            let part = tokio::task::spawn_blocking(move || read_part(&file, bytes)).await;
            let part = part.map_err(io::Error::other)??;
            if part.is_empty() {
                return Ok((bytes, hasher.finalize().to_hex().to_string()));
            }
            hasher.update(&part);
            bytes += part.len() as u64;
            self.within_limit(LIMIT_OF_PARTS, parts.wait_for_capacity(PARTS_AT_ONCE))
                .await?;
            parts.put(part.into());
        }
    }

    /// Reads a snapshot into `file`, and checks it.
    pub(super) async fn get_snapshot(&self, snapshot: &Snapshot, file: &Path) -> Result<(), MirrorError> {
        let path = &self.objects.path(&snapshot.object);
        let (mut hasher, mut file) = (blake3::Hasher::new(), File::create_new(file)?);
        let begins = (0..snapshot.bytes).step_by(PART_BYTES);
        // One request for a whole snapshot would take longer than the client of a bucket allows for a request.
        let part = |begin: u64| {
            let range = begin..snapshot.bytes.min(begin + PART_BYTES as u64);
            self.within_limit(LIMIT_OF_PARTS, self.objects.store.get_range(path, range))
        };
        let mut parts = stream::iter(begins).map(part).buffered(PARTS_AT_ONCE);
        while let Some(part) = parts.try_next().await? {
            hasher.update(&part);
            file.write_all(&part)?;
        }
        file.sync_all()?;
        match hasher.finalize().to_hex().as_str() == snapshot.digest {
            true => Ok(()),
            false => Err(MirrorError::Damaged {
                object: self.objects.name(&snapshot.object),
                reason: "its bytes have another digest".to_owned(),
            }),
        }
    }

    /// Removes the entries before `first`, and the snapshots of earlier epochs than `snapshot`, unless they are young. Claims stay,
    /// because the former writer of each claim must find its next number taken, whenever it comes back. Later snapshots stay too:
    /// another process may have gone on from the mirror, and written them. A failure is only logged.
    pub(super) async fn remove_before(&self, first: u64, snapshot: &str) {
        let old = async {
            self.remove_unfinished().await;
            let mut entries = self.list().await?;
            entries.retain(|&number, listed| number < first && listed.bytes > LONGEST_CLAIM);
            let entries = entries.into_iter();
            let snapshots = self.snapshots().await?.into_iter();
            let former = snapshots.filter(|listed| listed.name.as_str() < snapshot);
            let all = entries.map(|(_, listed)| listed).chain(former);
            let is_old = |listed: &Listed| listed.made.elapsed().is_ok_and(|age| age > KEPT);
            for listed in all.filter(is_old) {
                let path = self.objects.path(&listed.name);
                match self.within(self.objects.store.delete(&path)).await {
                    Err(error) if !error.is_not_found() => return Err(error),
                    _ => {}
                }
            }
            Ok(())
        };
        if let Err(error) = old.await {
            tracing::warn!(%error, "old objects stay in the mirror");
        }
    }

    async fn within<T>(
        &self,
        attempt: impl Future<Output = Result<T, object_store::Error>>,
    ) -> Result<T, MirrorError> {
        self.within_limit(LIMIT, attempt).await
    }

    async fn within_limit<T>(
        &self,
        limit: Duration,
        attempt: impl Future<Output = Result<T, object_store::Error>>,
    ) -> Result<T, MirrorError> {
        let place = || self.objects.to_string();
        match tokio::time::timeout(limit, attempt).await {
            Ok(done) => done.map_err(|source| MirrorError::Objects {
                place: place(),
                source,
            }),
            Err(_) => Err(MirrorError::Silent { place: place() }),
        }
    }
}

const LOG: &str = "log";
const SNAPSHOTS: &str = "snapshots";
/// Folder of objects that never get their names.
const TRIALS: &str = "trials";

/// The next part of a file from byte `from`; empty at its end.
fn read_part(file: &File, from: u64) -> io::Result<Vec<u8>> {
    let mut part = vec![0; PART_BYTES];
    let mut len = 0;
    while len < part.len() {
        match file.read_at(&mut part[len..], from + len as u64)? {
            0 => break,
            read => len += read,
        }
    }
    part.truncate(len);
    Ok(part)
}

/// Whether a file in the mirror's folder is one that the library of object stores writes before it gives the object its name: `#`
/// and a number follow the name.
fn is_unfinished(name: &OsStr) -> bool {
    let number = name.to_str().and_then(|name| name.rsplit_once('#'));
    number.is_some_and(|(_, number)| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}

/// The number of the entry with this name.
fn number_of(name: &str) -> Option<u64> {
    let number = name.rsplit('/').next()?.parse().ok()?;
    (name == name_of(number)).then_some(number)
}

fn name_of(number: u64) -> String {
    format!("{LOG}/{number:020}")
}

/// The name of a snapshot during an epoch whose entries begin with number `begins`.
pub(super) fn snapshot_name(begins: u64, attempt: &str) -> String {
    format!("{SNAPSHOTS}/{begins:020}-{attempt}")
}

/// The number of the first entry of the epoch of a snapshot.
pub(super) fn snapshot_begins(name: &str) -> Option<u64> {
    let name = name.strip_prefix(SNAPSHOTS)?.strip_prefix('/')?;
    name.split_once('-')?.0.parse().ok()
}
