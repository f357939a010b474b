//! The studies of a data directory, as read from the store. A study is read again when it changes, but reading must not take more
//! than a share of the time. If only the classes that people gave change, only these classes are read again.

use super::known::{Digests, Known};
use axum::body::Bytes;
use murmuration_engine::{
    blocking::{Broken, blocking, in_background, parallel, shared},
    campaign::{CampaignError, Campaigns},
};
use murmuration_model::study_records::{StudyRecord, StudyRecordKind};
use murmuration_store::{Store, StoreError, StudyEntry, StudyVersion};
use murmuration_study::{
    Corrections, JudgedIndividual, KeptError, KeptStudy, Outcome, ReportError, Study, cell_digest,
    classes_record, kept_classes, report_page, tables_and_plots,
};
use murmuration_swarm::{CampaignName, CheckpointDigest, Class, Invalid};
use std::{
    collections::{BTreeMap, BTreeSet},
    hash::{DefaultHasher, Hash as _, Hasher as _},
    sync::{Arc, Mutex, PoisonError, Weak},
    time::{Duration, Instant},
};
use tokio::sync::{self, OnceCell};

/// Minimum pause between two reads of a study, as a multiple of the time that the last read took.
const REST: u32 = 3;
/// Time for which an unused study stays in memory. An open page uses its study several times a second.
const KEPT_FOR: Duration = Duration::from_secs(60);
/// Time for which the list of campaigns is used again. All pages of studies share the list.
const LISTED_FOR: Duration = Duration::from_secs(1);

/// The studies of a data directory. A clone is cheap.
#[derive(Debug, Clone)]
pub struct Studies(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    store: Store,
    held: Mutex<BTreeMap<String, Held>>,
    /// The coordinator's campaigns, and the time at which they were listed.
    listed: sync::Mutex<Option<(Instant, Arc<Known>)>>,
    digests: Arc<Digests>,
}

/// The cache slot of a study.
#[derive(Debug, Clone)]
struct Held {
    /// The study, if it has been read. Only one request reads at a time, and other requests wait for it.
    read: Arc<sync::Mutex<Option<Read>>>,
    /// Time of the last use of the study.
    used: Instant,
}

/// Why a study cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unusable {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("the study is damaged: {0}")]
    Damaged(#[from] KeptError),
    #[error(transparent)]
    Answer(#[from] Invalid),
    #[error(transparent)]
    Broken(#[from] Broken),
}

#[derive(Debug)]
struct Read {
    study: Arc<Loaded>,
    version: StudyVersion,
    /// The time at which the last full read ended, and its duration.
    ended: Instant,
    took: Duration,
}

/// A study as it was in the store.
#[derive(Debug)]
pub(super) struct Loaded {
    store: Store,
    name: CampaignName,
    pub(super) outcome: Outcome,
    pub(super) jobs: Arc<Jobs>,
    /// The reason why the classes that people gave cannot be read, if they cannot; the judge's verdicts then replace all classes.
    pub(super) problem: Option<String>,
    /// The markup of the tables and plots.
    pub(super) tables: String,
    /// A hash of the page's content, which changes whenever the content changes.
    pub(super) version: String,
    /// The page of the report; empty before the first request for this page.
    report: OnceCell<Bytes>,
}

#[derive(Debug)]
pub(super) struct Jobs {
    /// The jobs that come before the cells: the atlas, and embedders that cells share.
    pub(super) before: Vec<Job>,
    /// The cells, in the order of the study.
    pub(super) cells: Vec<Job>,
    /// The time at which the jobs were read; the campaigns in `done` existed at this time.
    pub(super) read: Instant,
}

#[derive(Debug)]
pub(super) struct Job {
    /// The name of the job, in words.
    pub(super) words: String,
    /// Digest of the specification of the job's campaign; `None` while the campaign's initial embedder is unknown.
    pub(super) digest: Option<String>,
    /// If the job is done, the id of its campaign; empty if this id is unknown.
    pub(super) done: Option<String>,
}

impl Studies {
    /// The studies of a data directory.
    pub fn of(store: &Store) -> Self {
        Self(Arc::new(Shared {
            store: store.clone(),
            held: Mutex::default(),
            listed: sync::Mutex::default(),
            digests: Arc::default(),
        }))
    }

    /// The names of all studies, in alphabetical order.
    pub(super) async fn names(&self) -> Result<Vec<String>, Unusable> {
        Ok(self.0.store.run(Store::studies).await?)
    }

    /// The jobs of a study alone, without reading its measurements.
    pub(super) async fn jobs(&self, name: &str) -> Result<Jobs, Unusable> {
        let name = name.to_owned();
        self.0.store.run(move |store| Jobs::look(store, &name)).await
    }

    /// The coordinator's campaigns, at most [`LISTED_FOR`] old.
    pub(super) async fn known(&self, campaigns: &Campaigns) -> Result<Arc<Known>, CampaignError> {
        // Only one request reads the list at a time, and other requests wait for it.
        let mut listed = self.0.listed.lock().await;
        if let Some((read, known)) = listed.as_ref()
            && read.elapsed() < LISTED_FOR
        {
            return Ok(Arc::clone(known));
        }
        let known = Arc::new(shared(Known::read(campaigns, &self.0.digests)).await?);
        *listed = Some((Instant::now(), Arc::clone(&known)));
        Ok(known)
    }

    /// A study from the store, or from memory if the study there is still recent.
    pub(super) async fn loaded(&self, name: &str) -> Result<Arc<Loaded>, Unusable> {
        let wanted = name.to_owned();
        let version = self
            .0
            .store
            .run(move |store| store.study_version(&wanted))
            .await?;
        let place = self.place(name);
        let mut read = place.lock().await;
        if let Some(read) = read.as_mut()
            && (read.version.measured == version.measured || read.ended.elapsed() < REST * read.took)
        {
            if read.version.classes != version.classes {
                let study = Arc::clone(&read.study);
                read.study = Arc::new(shared(blocking(move || study.with_current_classes())).await?);
                read.version.classes = version.classes;
            }
            return Ok(Arc::clone(&read.study));
        }
        let begun = Instant::now();
        let (store, name) = (self.0.store.clone(), name.to_owned());
        let study = Arc::new(shared(in_background(move |_| Loaded::read(store, &name))).await??);
        *read = Some(Read {
            study: Arc::clone(&study),
            version,
            ended: Instant::now(),
            took: begun.elapsed(),
        });
        Ok(study)
    }

    /// Stores a person's class for a judged individual; `None` restores the judge's verdict.
    pub(super) async fn judge(
        &self,
        name: &str,
        cell: String,
        index: u64,
        class: Option<Class>,
        by: String,
    ) -> Result<(), Unusable> {
        let study = self.loaded(name).await?;
        if study.judged(&cell, index).is_none() {
            let allowed = "an individual of this study that was judged";
            return Err(Invalid::new("index", index, allowed).into());
        }
        let place = self.place(name);
        // Classes are stored one at a time, because each is added to the classes before it. The lock is the change's own: the
        // change goes on if the client leaves.
        let alone = place.lock_owned().await;
        let keep = move |store: &Store| {
            let _alone = alone;
            let mut classes = classes(store, &study.name)?;
            classes.set(&cell, index, class, &by)?;
            let record = classes_record(&classes);
            Ok(store.keep_study(&study.name, None, &[record])?)
        };
        self.0.store.change(keep).await
    }

    /// The cache slot of a study. The slot is removed when the study has been unused for a while.
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

/// Waits until a study is unused, and removes it from memory.
async fn forget(shared: Weak<Shared>, name: String) {
    loop {
        tokio::time::sleep(KEPT_FOR).await;
        let Some(shared) = shared.upgrade() else {
            return;
        };
        let mut held = shared.held();
        if held
            .get(&name)
            .is_none_or(|place| place.used.elapsed() >= KEPT_FOR && Arc::strong_count(&place.read) == 1)
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

/// The classes that people gave on the page of a study.
fn classes(store: &Store, name: &CampaignName) -> Result<Corrections, Unusable> {
    match store.study_content(name.as_str(), StudyRecordKind::Classes, "")? {
        Some(content) => Ok(kept_classes(&content).map_err(KeptError::from)?),
        None => Ok(Corrections::default()),
    }
}

impl Jobs {
    /// The jobs of a study, without reading the measurements of its cells.
    fn look(store: &Store, name: &str) -> Result<Self, Unusable> {
        let file = store.study_file(name)?;
        let (mut embedders, mut measured) = (Vec::new(), BTreeSet::new());
        for StudyEntry { kind, key, measures } in store.study_entries(name)? {
            match kind {
                StudyRecordKind::Embedder => {
                    let content = store.study_content(name, kind, &key)?.unwrap_or_default();
                    embedders.push(StudyRecord {
                        kind,
                        key,
                        measures,
                        content,
                    });
                }
                StudyRecordKind::Cell if measures == file.measures => {
                    measured.insert(key);
                }
                _ => {}
            }
        }
        let kept = KeptStudy::new(&file, embedders)?;
        // The ids of the cells' campaigns are in the records of the measurements, which are not read here.
        let done = |_: usize, digest: Option<&str>| {
            let is_measured = digest.is_some_and(|digest| measured.contains(digest));
            is_measured.then(String::new)
        };
        Ok(Self::of(&kept.study, &kept.embedders()?, None, done)?)
    }

    /// The jobs of a study. `atlas` is the id of the atlas's campaign, if the atlas is done. `done` returns the same id for a
    /// cell, which it finds by the cell's place and by its digest, if known.
    fn of(
        study: &Study,
        embedders: &BTreeMap<String, CheckpointDigest>,
        atlas: Option<String>,
        done: impl Fn(usize, Option<&str>) -> Option<String>,
    ) -> Result<Self, Invalid> {
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
                done: done(place, digest.as_deref()),
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
    fn read(store: Store, name: &str) -> Result<Self, Unusable> {
        let kept = KeptStudy::new(&store.study_file(name)?, store.study_records(name)?)?;
        let (study, embedders) = (kept.study.clone(), kept.embedders()?);
        let outcome = kept.outcome(Corrections::default())?;
        let campaigns = outcome.campaigns();
        let atlas = outcome.reference().map(|reference| reference.campaign.clone());
        let done = |place: usize, _: Option<&str>| campaigns.get(place).cloned().flatten();
        let jobs = Arc::new(Jobs::of(&study, &embedders, atlas, done)?);
        Ok(Self::of(store, study.name, &outcome, jobs))
    }

    /// This study with the current classes of people.
    fn with_current_classes(&self) -> Self {
        let (store, name) = (self.store.clone(), self.name.clone());
        Self::of(store, name, &self.outcome, Arc::clone(&self.jobs))
    }

    /// A study with its stored classes. If the classes are damaged, the rest of the study is still shown.
    fn of(store: Store, name: CampaignName, outcome: &Outcome, jobs: Arc<Jobs>) -> Self {
        let (classes, problem) = match classes(&store, &name) {
            Ok(classes) => (classes, None),
            Err(error) => (Corrections::default(), Some(error.to_string())),
        };
        let outcome = outcome.with_corrections(classes);
        let tables = parallel(|| tables_and_plots(&outcome).into_string());
        let mut hasher = DefaultHasher::new();
        (&tables, &problem).hash(&mut hasher);
        Self {
            version: format!("{:x}", hasher.finish()),
            report: OnceCell::new(),
            store,
            name,
            outcome,
            jobs,
            problem,
            tables,
        }
    }

    /// The page of the report. Drawing takes seconds, so that the page is drawn only once. If the client leaves, the drawing
    /// continues for the next request.
    pub(super) async fn report(self: &Arc<Self>) -> Result<Bytes, Undrawn> {
        let loaded = Arc::clone(self);
        let drawing = tokio::spawn(async move {
            let study = Arc::clone(&loaded);
            let draw = || async move {
                let page = in_background(move |_| parallel(|| report_page(&study.outcome))).await??;
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
