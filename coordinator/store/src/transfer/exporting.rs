//! Copies a campaign, as of one instant, into a database of its own.

use super::{APPLICATION, FURTHER_TABLES, new_folder};
use crate::{
    FileSystem, Store, StoreError,
    blocking::{in_background, shared},
    campaigns::number_of,
    checkpoints::{CheckpointError, Checkpoints},
    digest::digest,
    hidden::HIDDEN,
    open::uri_path,
    schema,
};
use murmuration_model::{CampaignId, CampaignState};
use murmuration_search::interrupt::Interrupt;
use murmuration_swarm::CheckpointDigest;
use rusqlite::{Connection, OpenFlags, OptionalExtension as _, Transaction, config::DbConfig, params};
use std::{fs::File, path::Path};
use tempfile::TempDir;

/// Steps of SQLite's virtual machine between two checks whether the export is still wanted.
const LOOK_STEPS: i32 = 10_000;

/// Statements that copy the rows of the campaign whose number is parameter 1. Campaigns and checkpoints keep their numbers.
const ROWS: [&str; 7] = [
    "INSERT INTO checkpoints
     WITH RECURSIVE needed (digest) AS (
        SELECT k.digest FROM source.checkpoints k JOIN source.campaigns c ON k.number IN (c.checkpoint, c.next_checkpoint)
            WHERE c.number = ?1
        UNION SELECT k.parent FROM source.checkpoints k JOIN needed USING (digest) WHERE k.parent <> '')
     SELECT * FROM source.checkpoints WHERE digest IN (SELECT digest FROM needed) ORDER BY number",
    "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms, weight, rollbacks, checkpoint,
        next_checkpoint, rounds, label_cutoff, last_label_cutoff, tags, note)
     SELECT number, id, spec, simulator_version, state, error, created_ms, weight, rollbacks, checkpoint, next_checkpoint, rounds,
        label_cutoff, last_label_cutoff, tags, note FROM source.campaigns WHERE number = ?1",
    "INSERT INTO generations SELECT * FROM source.generations WHERE campaign = ?1 ORDER BY generation",
    "INSERT INTO individual_chunks SELECT * FROM source.individual_chunks WHERE campaign = ?1 ORDER BY first",
    "INSERT INTO image_chunks SELECT * FROM source.image_chunks WHERE campaign = ?1 ORDER BY first",
    "INSERT INTO embedding_chunks SELECT * FROM source.embedding_chunks WHERE campaign = ?1
        AND checkpoint = (SELECT checkpoint FROM source.campaigns WHERE number = ?1) ORDER BY first",
    "INSERT INTO labels SELECT * FROM source.labels WHERE campaign = ?1 ORDER BY entry",
];

/// Statement that copies the current taxonomy of a completed campaign, without its time and its map.
const TAXONOMY: &str =
    "INSERT INTO taxonomies (campaign, version, stands, checkpoint, rounds, generations, medoids, clusters, loss, measures,
        robust_trials, points)
     SELECT t.campaign, 1, 1, c.checkpoint, c.rounds, t.generations, t.medoids, t.clusters, t.loss, t.measures, t.robust_trials, x''
     FROM source.taxonomies t JOIN source.campaigns c ON c.number = t.campaign
     WHERE t.campaign = ?1 AND t.stands AND c.state = ?2";

/// Exports a campaign into a database in a temporary folder of the data directory `data`, and returns the open file. The folder
/// is removed before this returns.
///
/// # Errors
/// [`StoreError::NoCampaign`], or if the campaign cannot be read, or the file cannot be written.
pub async fn export(
    store: &Store,
    checkpoints: &Checkpoints,
    data: &Path,
    campaign: &CampaignId,
) -> Result<File, CheckpointError> {
    let (source, data, id) = (store.clone(), data.to_path_buf(), campaign.clone());
    let alone = store.copying.lock().await;
    let copied = on_disk(move |interrupt| Copy::of(&source, &data, id, interrupt));
    let (mut copy, digests) = shared(copied).await?;
    drop(alone);
    for digest in digests {
        let model = checkpoints.fetch(digest).await?;
        copy = on_disk(move |_| copy.add_model(digest, &model).map(|()| copy)).await?;
    }
    on_disk(move |interrupt| copy.finish(interrupt)).await
}

/// A campaign's database that is being written.
struct Copy {
    store: Store,
    campaign: CampaignId,
    /// The database's temporary folder, which is dropped, and so removed, after the database's connection.
    _folder: TempDir,
}

impl Copy {
    /// Copies the rows of a campaign as of one instant. Also returns the checkpoints whose bytes must still be added.
    fn of(
        source: &Store,
        data: &Path,
        campaign: CampaignId,
        interrupt: &Interrupt,
    ) -> Result<(Self, Vec<CheckpointDigest>), StoreError> {
        let folder = new_folder(data)?;
        let path = folder.path().join("campaign.sqlite");
        let named = |source| StoreError::from_sqlite(source, &path);
        let mut connection = create(&path, &source.path).map_err(named)?;
        let wanted = interrupt.clone();
        connection
            .progress_handler(LOOK_STEPS, Some(move || wanted.check().is_err()))
            .map_err(named)?;
        let copied = connection
            .transaction()
            .map_err(StoreError::from)
            .and_then(|transaction| {
                copy_rows(&transaction, &campaign)?;
                Ok(transaction.commit()?)
            });
        interrupt.check()?;
        copied.map_err(|error| error.at(&path))?;
        connection
            .progress_handler(0, None::<fn() -> bool>)
            .map_err(named)?;
        connection.execute_batch("DETACH source").map_err(named)?;
        let store = Store::over(connection, &path);
        let checkpoints = store.checkpoints()?;
        let digests = checkpoints.into_iter().map(|record| record.digest).collect();
        let copy = Self {
            store,
            campaign,
            _folder: folder,
        };
        Ok((copy, digests))
    }

    fn add_model(&self, digest: CheckpointDigest, model: &[u8]) -> Result<(), StoreError> {
        self.store.write(|transaction| {
            let insert = "INSERT INTO embedders SELECT number, ?2 FROM checkpoints WHERE digest = ?1";
            transaction.execute(insert, params![digest.to_string(), model])?;
            Ok(())
        })
    }

    /// Adds the digest of the archive, and returns the file.
    fn finish(self, interrupt: &Interrupt) -> Result<File, StoreError> {
        let record = self.store.campaign(self.campaign.as_str())?;
        let digest = digest(&self.store, &self.campaign, record.spec.model(), interrupt)?.digest;
        self.store
            .write(|transaction| Ok(transaction.execute("INSERT INTO exported VALUES (?1)", [digest])?))?;
        let path = self.store.path.clone();
        drop(self.store);
        File::open(&path).map_err(|error| StoreError::from_io(error, "read", &path))
    }
}

/// An empty database for a campaign, with the store at `source` attached to it. Writes do not wait for the disk, because the next
/// start removes the leftovers of a crash.
fn create(path: &Path, source: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE
        | OpenFlags::SQLITE_OPEN_CREATE
        | OpenFlags::SQLITE_OPEN_NO_MUTEX
        | OpenFlags::SQLITE_OPEN_URI;
    let mut connection = Connection::open_with_flags(path, flags)?;
    connection
        .execute_batch("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA busy_timeout = 5000;")?;
    schema::create(&mut connection)?;
    connection.execute_batch(FURTHER_TABLES)?;
    connection.pragma_update(None, "application_id", APPLICATION)?;
    // The store has its own rules for the end of its log.
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)?;
    // On a shared file system, this process's own connections share the log's index by the same kind of access.
    let access = match FileSystem::of(source).is_local() {
        true => "mode=ro",
        false => "mode=rw&vfs=unix-excl",
    };
    let source = format!("file:{}?{access}", uri_path(source));
    connection.execute("ATTACH ?1 AS source", [source])?;
    Ok(connection)
}

fn copy_rows(transaction: &Transaction<'_>, campaign: &CampaignId) -> Result<(), StoreError> {
    let number = "SELECT number FROM source.campaigns WHERE id = ?1 AND state <> ?2";
    let number: Option<i64> = transaction
        .query_row(number, [campaign.as_str(), HIDDEN], |row| row.get(0))
        .optional()?;
    let Some(number) = number else {
        // Fails, because this database has no campaign yet; the error explains how to list campaigns.
        return number_of(transaction, campaign).map(drop);
    };
    for rows in ROWS {
        transaction.execute(rows, [number])?;
    }
    transaction.execute(TAXONOMY, params![number, CampaignState::Completed.name()])?;
    Ok(())
}

async fn on_disk<T: Send + 'static>(
    work: impl FnOnce(&Interrupt) -> Result<T, StoreError> + Send + 'static,
) -> Result<T, CheckpointError> {
    Ok(in_background(work).await??)
}
