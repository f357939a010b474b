//! Studies, read from their folders. A study is read again when its files change, but reading must not take more than a share of
//! the time. When only people's classes change, the rest of the study is kept.

use super::known::{Digests, Known};
use axum::body::Bytes;
use murmuration_engine::{
    blocking::{Broken, blocking, in_background},
    campaign::{CampaignError, Campaigns},
};
use murmuration_model::study_files::{STUDIES, STUDY_CLASSES, STUDY_EMBEDDERS, STUDY_FILE, STUDY_ORIGIN};
use murmuration_study::{
    Corrections, FolderError, JudgedIndividual, KeptStudy, Outcome, ReportError, Study, StudyFolder,
    cell_digest, report_page, studies, tables_and_plots,
};
use murmuration_swarm::{CheckpointDigest, Class, Invalid};
use std::{
    collections::BTreeMap,
    fs,
    hash::{DefaultHasher, Hash as _, Hasher as _},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError, Weak},
    time::{Duration, Instant, SystemTime},
};
use tokio::sync::{self, OnceCell};

/// The files of a study's folder whose changes change the study. The file with people's classes is watched separately. The folder
/// of cells changes when a cell is measured.
const FILES: [&str; 5] = [
    STUDY_FILE,
    STUDY_ORIGIN,
    STUDY_EMBEDDERS,
    "reference.json",
    "cells",
];
/// Pause between two reads of a study, as a multiple of the time that one read takes.
const REST: u32 = 3;
/// How long an unused study stays in memory; open pages use theirs several times a second.
const KEPT_FOR: Duration = Duration::from_secs(60);
/// How long the list of campaigns is reused: all pages of studies share it.
const LISTED_FOR: Duration = Duration::from_secs(1);

/// The studies of a data directory; cheap to clone.
#[derive(Debug, Clone)]
pub struct Studies(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    data: PathBuf,
    held: Mutex<BTreeMap<String, Held>>,
    /// The coordinator's campaigns, and when they were listed.
    listed: sync::Mutex<Option<(Instant, Arc<Known>)>>,
    digests: Arc<Digests>,
}

/// The cache slot of a study.
#[derive(Debug, Clone)]
struct Held {
    /// One request reads at a time, while others wait for it.
    read: Arc<sync::Mutex<Option<Read>>>,
    /// Time of the last use.
    used: Instant,
}

/// Why a study cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unusable {
    #[error("there is no study \"{0}\" in the data directory")]
    None(String),
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    Answer(#[from] Invalid),
    #[error(transparent)]
    Broken(#[from] Broken),
}

#[derive(Debug)]
struct Read {
    study: Arc<Loaded>,
    stamp: Stamp,
    /// When the last full read ended, and how long it took.
    ended: Instant,
    took: Duration,
}

/// Modification times of a study's files; `None` for missing files.
#[derive(Debug, Clone, Copy)]
struct Stamp {
    files: [Option<SystemTime>; FILES.len()],
    classes: Option<SystemTime>,
}

impl Stamp {
    fn of(folder: &Path) -> Self {
        let changed = |file: &str| {
            let about = fs::metadata(folder.join(file));
            about.and_then(|about| about.modified()).ok()
        };
        Self {
            files: FILES.map(changed),
            classes: changed(STUDY_CLASSES),
        }
    }
}

/// A study as it was in its folder.
#[derive(Debug)]
pub(super) struct Loaded {
    folder: StudyFolder,
    pub(super) outcome: Outcome,
    pub(super) jobs: Arc<Jobs>,
    /// Why people's classes cannot be read, if so; the judge's verdicts apply instead.
    pub(super) problem: Option<String>,
    /// The markup of the tables and plots.
    pub(super) tables: String,
    /// Changes whenever the page's content does.
    pub(super) version: String,
    /// The page of the report, after the first request for it.
    report: OnceCell<Bytes>,
}

#[derive(Debug)]
pub(super) struct Jobs {
    /// The jobs before the cells: the atlas, and embedders that cells share.
    pub(super) before: Vec<Job>,
    /// The cells, in the order of the study.
    pub(super) cells: Vec<Job>,
    /// When the jobs were read: the campaigns that they name existed then.
    pub(super) read: Instant,
}

#[derive(Debug)]
pub(super) struct Job {
    /// Its name, in words.
    pub(super) words: String,
    /// Digest of its specification; `None` while its initial embedder is unknown.
    pub(super) digest: Option<String>,
    /// If it is done, the id of its campaign; empty if that is unknown.
    pub(super) done: Option<String>,
}

impl Studies {
    /// The studies of a data directory.
    pub fn of(data: &Path) -> Self {
        Self(Arc::new(Shared {
            data: data.to_owned(),
            held: Mutex::default(),
            listed: sync::Mutex::default(),
            digests: Arc::default(),
        }))
    }

    /// The names of all studies, in alphabetical order.
    pub(super) async fn names(&self) -> Result<Vec<String>, Unusable> {
        let data = self.0.data.clone();
        Ok(blocking(move || studies(&data)).await??)
    }

    /// The jobs of a study alone, without reading its measurements.
    pub(super) async fn jobs(&self, name: &str) -> Result<Jobs, Unusable> {
        let (data, name) = (self.0.data.clone(), name.to_owned());
        Ok(blocking(move || Jobs::look(&data, &name)).await??)
    }

    /// The coordinator's campaigns, at most [`LISTED_FOR`] old.
    pub(super) async fn known(&self, campaigns: &Campaigns) -> Result<Arc<Known>, CampaignError> {
        // One request reads the list, and others wait for it.
        let mut listed = self.0.listed.lock().await;
        if let Some((read, known)) = listed.as_ref()
            && read.elapsed() < LISTED_FOR
        {
            return Ok(Arc::clone(known));
        }
        let known = Arc::new(Known::read(campaigns, &self.0.digests).await?);
        *listed = Some((Instant::now(), Arc::clone(&known)));
        Ok(known)
    }

    /// A study from its folder, or from memory if that was read recently.
    pub(super) async fn loaded(&self, name: &str) -> Result<Arc<Loaded>, Unusable> {
        let (data, wanted) = (self.0.data.clone(), name.to_owned());
        let stamp = blocking(move || -> Result<_, FolderError> {
            let is_there = studies(&data)?.contains(&wanted);
            Ok(is_there.then(|| Stamp::of(&data.join(STUDIES).join(&wanted))))
        });
        let stamp = stamp.await??.ok_or_else(|| Unusable::None(name.to_owned()))?;
        let place = self.place(name);
        let mut read = place.lock().await;
        if let Some(read) = read.as_mut()
            && (read.stamp.files == stamp.files || read.ended.elapsed() < REST * read.took)
        {
            if read.stamp.classes != stamp.classes {
                let study = Arc::clone(&read.study);
                read.study = Arc::new(blocking(move || study.with_classes_as_they_are()).await?);
                read.stamp.classes = stamp.classes;
            }
            return Ok(Arc::clone(&read.study));
        }
        let begun = Instant::now();
        let (data, name) = (self.0.data.clone(), name.to_owned());
        let study = Arc::new(in_background(move |_| Loaded::read(&data, &name)).await??);
        *read = Some(Read {
            study: Arc::clone(&study),
            stamp,
            ended: Instant::now(),
            took: begun.elapsed(),
        });
        Ok(study)
    }

    /// Stores a person's class for a judged individual; `None` restores the judge's verdict.
    pub(super) async fn judge(
        &self,
        name: &str,
        (cell, index): (String, u64),
        class: Option<Class>,
        by: String,
    ) -> Result<(), Unusable> {
        let study = self.loaded(name).await?;
        if study.judged(&cell, index).is_none() {
            let allowed = "an individual of this study that was judged";
            return Err(Invalid::new("index", index, allowed).into());
        }
        let place = self.place(name);
        // One answer at a time: each is added to those before it.
        let mut read = place.lock().await;
        let folder = study.folder.clone();
        let kept = blocking(move || {
            let mut classes = folder.classes()?;
            classes.set(&cell, index, class, &by)?;
            Ok(folder.keep_classes(&classes)?)
        });
        let kept: Result<(), Unusable> = kept.await?;
        kept?;
        // Makes the next request read this answer, even if the disk's clock has not advanced.
        if let Some(read) = read.as_mut() {
            read.stamp.classes = None;
        }
        Ok(())
    }

    /// The cache slot of a study; it is dropped when the study is unused for a while.
    fn place(&self, name: &str) -> Arc<sync::Mutex<Option<Read>>> {
        let mut held = self.0.held();
        let place = held.entry(name.to_owned()).or_insert_with(|| {
            tokio::spawn(forget(Arc::downgrade(&self.0), name.to_owned()));
            Held {
                read: Arc::default(),
                used: Instant::now(),
            }
        });
        place.used = Instant::now();
        Arc::clone(&place.read)
    }
}

/// Waits until a study is unused, and drops it.
async fn forget(shared: Weak<Shared>, name: String) {
    loop {
        tokio::time::sleep(KEPT_FOR).await;
        let Some(shared) = shared.upgrade() else {
            return;
        };
        let mut held = shared.held();
        if held
            .get(&name)
            .is_none_or(|place| place.used.elapsed() >= KEPT_FOR)
        {
            held.remove(&name);
            return;
        }
    }
}

impl Shared {
    fn held(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Held>> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Jobs {
    /// The jobs of a study, without reading its measurements.
    fn look(data: &Path, name: &str) -> Result<Self, FolderError> {
        let KeptStudy {
            folder,
            study,
            measures,
        } = StudyFolder::open(data, name)?;
        // The campaign's id is in the measurement, which is not read here.
        let done = |_: usize, digest: Option<&str>| -> Result<Option<String>, FolderError> {
            let is_measured = digest.map(|digest| folder.is_measured(digest, &measures));
            Ok(is_measured.transpose()?.unwrap_or_default().then(String::new))
        };
        Self::of(&study, &folder.embedders()?, None, done)
    }

    /// The jobs of a study. `atlas` is the atlas's result. `done` returns the result of a cell by its place, and its digest if that
    /// is known.
    fn of(
        study: &Study,
        embedders: &BTreeMap<String, CheckpointDigest>,
        atlas: Option<String>,
        done: impl Fn(usize, Option<&str>) -> Result<Option<String>, FolderError>,
    ) -> Result<Self, FolderError> {
        let mut before = Vec::new();
        if let Some(plan) = &study.measures.recall {
            before.push(Job {
                words: "atlas".to_owned(),
                digest: Some(cell_digest(&plan.atlas)),
                done: atlas,
            });
        }
        let mut trained = BTreeMap::new();
        let mut cells = Vec::new();
        for (place, cell) in study.cells.iter().enumerate() {
            let words = study.cell_in_words(cell);
            if let Some(spec) = study.embedder_of(cell)? {
                trained.entry(cell_digest(&spec)).or_insert_with(|| words.clone());
            }
            let spec = study.campaign_of(cell, embedders)?;
            let digest = spec.as_ref().map(cell_digest);
            cells.push(Job {
                words,
                done: done(place, digest.as_deref())?,
                digest,
            });
        }
        before.extend(trained.into_iter().map(|(digest, words)| Job {
            words: format!("embedder of {words}"),
            done: embedders.contains_key(&digest).then(String::new),
            digest: Some(digest),
        }));
        let read = Instant::now();
        Ok(Self { before, cells, read })
    }

    pub(super) fn measured(&self) -> usize {
        self.cells.iter().filter(|cell| cell.done.is_some()).count()
    }
}

impl Loaded {
    fn read(data: &Path, name: &str) -> Result<Self, FolderError> {
        let kept = StudyFolder::open(data, name)?;
        let (folder, study) = (kept.folder.clone(), kept.study.clone());
        let outcome = kept.outcome(Corrections::default())?;
        let campaigns = outcome.campaigns();
        let atlas = outcome.reference().map(|reference| reference.campaign.clone());
        let done = |place: usize, _: Option<&str>| Ok(campaigns.get(place).cloned().flatten());
        let jobs = Arc::new(Jobs::of(&study, &folder.embedders()?, atlas, done)?);
        Ok(Self::of(folder, &outcome, jobs))
    }

    /// The same study with people's current classes.
    fn with_classes_as_they_are(&self) -> Self {
        Self::of(self.folder.clone(), &self.outcome, Arc::clone(&self.jobs))
    }

    /// A study with the classes in its folder. If their file is damaged, everything else still shows.
    fn of(folder: StudyFolder, outcome: &Outcome, jobs: Arc<Jobs>) -> Self {
        let (classes, problem) = match folder.classes() {
            Ok(classes) => (classes, None),
            Err(error) => (Corrections::default(), Some(error.to_string())),
        };
        let outcome = outcome.with_corrections(classes);
        let tables = tables_and_plots(&outcome).into_string();
        let mut hasher = DefaultHasher::new();
        (&tables, &problem).hash(&mut hasher);
        Self {
            version: format!("{:x}", hasher.finish()),
            report: OnceCell::new(),
            folder,
            outcome,
            jobs,
            problem,
            tables,
        }
    }

    /// The page of the report. Drawing takes seconds, so it is drawn once. It continues after the client is gone, for the next
    /// request.
    pub(super) async fn report(self: &Arc<Self>) -> Result<Bytes, Undrawn> {
        let loaded = Arc::clone(self);
        let drawing = tokio::spawn(async move {
            let study = Arc::clone(&loaded);
            let draw = || async move {
                let page = in_background(move |_| report_page(&study.outcome)).await??;
                Ok::<_, Undrawn>(Bytes::from(page))
            };
            loaded.report.get_or_try_init(draw).await.cloned()
        });
        drawing.await.map_err(|_| Broken)?
    }

    /// The judge's verdict on an individual of the cell with this digest.
    fn judged(&self, cell: &str, index: u64) -> Option<&JudgedIndividual> {
        let measured = self.outcome.cell(cell)?.measured;
        measured.behaviours.as_ref()?.individuals.get(&index)
    }
}

/// Why the page of a report cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub(super) enum Undrawn {
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Broken(#[from] Broken),
}
