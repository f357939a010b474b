//! `study run`: every campaign of a study to its end, several at once, each measured as soon as it is completed.

use super::{
    super::{
        CliError, Global,
        connection::{self, Connection},
        files::read_words,
        quoted,
        run::InProcessArgs,
    },
    campaign::{Clients, KnownCampaigns, begin, to_end},
    kept,
    labelled::Labelled,
    measuring::Measuring,
    progress::{CellProgress, Progress},
    shown,
};
use murmuration_embed::Runtime;
use murmuration_link::{InputKind, errln, termination};
use murmuration_proto::{CampaignSpec, CheckpointDigest, counted, v1};
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{DataDirectory, StoreError};
use murmuration_study::{
    Corrections, Measured, Study, StudyFolder, cell_digest, measures_digest, write_report,
};
use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    path::{Path, PathBuf, absolute},
    sync::Arc,
    time::Instant,
};
use tokio::task::JoinSet;

/// Arguments of `study run`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
A campaign with the same specification counts as a cell, whatever it is called: cells that have run do not run again, and an \
interrupted study continues when it is run again. The command uses the coordinator that was named or that holds the data \
directory, or else runs one itself.

Examples:
  murmuration study run studies/small.toml
  murmuration study run studies/paper.toml --quick")]
pub(in crate::cli) struct RunStudy {
    /// Study file (see studies/)
    file: PathBuf,
    /// Run the study as its [quick] table says
    #[arg(long)]
    quick: bool,
    /// Campaigns that run at once
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=64))]
    at_once: u8,
    #[command(flatten)]
    crew: InProcessArgs,
}

impl RunStudy {
    pub(in crate::cli) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let text = read_words(&self.file, InputKind::Study)?;
        let failed =
            |error: &dyn std::fmt::Display| CliError::Input(format!("{}: {error}", self.file.display()));
        let file = absolute(&self.file).map_err(|error| CliError::unreadable(&self.file, &error))?;
        let folder = file.parent().unwrap_or(Path::new("/"));
        let study = Study::from_toml(&text, folder, self.quick).map_err(|error| failed(&error))?;
        let crew = self.crew.some()?;
        let (labelled, contents) = Labelled::read(&study)?;
        let contents: Vec<&[u8]> = contents.iter().map(Vec::as_slice).collect();
        let measuring = Measuring {
            digest: measures_digest(study.measures(), &contents),
            measures: Arc::new(study.measures().clone()),
            labelled: Arc::new(labelled),
            interrupt: Interrupt::default(),
        };
        let own = match &global.coordinator {
            Some(_) => None,
            None => held(global)?,
        };
        if study.cells().iter().any(|cell| cell.spec.method().embeds()) {
            Runtime::load()?;
        }
        let kept_in = StudyFolder::of(&global.data, &study);
        kept_in.keep_study(&text, (folder, self.quick), &measuring.digest)?;
        let begun = Instant::now();
        let quick = if self.quick { " --quick" } else { "" };
        let again = global.next(&format!(
            "study run {}{quick}",
            quoted(&self.file.display().to_string())
        ));
        let run = async |connection: &mut Connection| {
            let run = StudyRun::begin(connection, &study, &kept_in, measuring).await?;
            run.finish(usize::from(self.at_once), &again).await
        };
        match own {
            Some(data) => connection::with_own(global, data, crew, run).await?,
            None => connection::with(global, crew, run).await?,
        }
        let (folder, outcome) = kept(&global.data, study.name().as_str(), Corrections::default())?;
        let files = write_report(&outcome, folder.path())?;
        shown::show(&outcome, Some(&files.page), global.json)?;
        let seconds = begun.elapsed().as_secs_f64();
        errln!("{seconds:.1} s; open the report in a browser");
        Ok(())
    }
}

/// The data directory, for a coordinator of this process; `None` if another process that can be asked holds it.
fn held(global: &Global) -> Result<Option<DataDirectory>, CliError> {
    match DataDirectory::hold(&global.data) {
        Ok(data) => Ok(Some(data)),
        Err(StoreError::InUse { holder, .. }) if !holder.address.is_empty() => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// A campaign that is to be done.
enum Job {
    /// One that trains the embedder of the cell at this place, and perhaps of others; by its digest.
    Embedder(String, Box<CampaignSpec>, usize),
    /// The cell at this place.
    Cell(usize),
}

/// What came of a job.
enum Done {
    Embedder(String, CheckpointDigest),
    Cell(Box<Measured>),
}

/// A study while it runs.
struct StudyRun<'a> {
    study: &'a Study,
    folder: &'a StudyFolder,
    clients: Clients,
    known: KnownCampaigns,
    measuring: Measuring,
    /// The checkpoints that cells share, by the digest of the campaign that trains each.
    embedders: BTreeMap<String, CheckpointDigest>,
    waiting: VecDeque<Job>,
    progress: Progress,
}

impl<'a> StudyRun<'a> {
    /// Finds out what is to be done.
    async fn begin(
        connection: &Connection,
        study: &'a Study,
        folder: &'a StudyFolder,
        measuring: Measuring,
    ) -> Result<Self, CliError> {
        let mut clients = Clients {
            campaigns: connection.client.clone(),
            checkpoints: connection.checkpoints.clone(),
        };
        let embedders = folder.embedders()?;
        let measured = folder.all_measured(study, &measuring.digest)?;
        let missing = measured
            .iter()
            .enumerate()
            .filter(|(_, measured)| measured.is_none());
        // Two rows may come to the same campaign.
        let mut wanted = BTreeSet::new();
        let missing: Vec<usize> = missing
            .map(|(place, _)| place)
            .filter(|&place| wanted.insert(cell_digest(&study.cells()[place].spec)))
            .collect();
        let mut trained = BTreeSet::new();
        let mut waiting = VecDeque::new();
        for &place in &missing {
            let Some(spec) = study.embedder_of(&study.cells()[place])? else {
                continue;
            };
            let digest = cell_digest(&spec);
            if !embedders.contains_key(&digest) && trained.insert(digest.clone()) {
                waiting.push_back(Job::Embedder(digest, Box::new(spec), place));
            }
        }
        waiting.extend(missing.iter().map(|&place| Job::Cell(place)));
        let done = measured.iter().flatten().count();
        errln!(
            "study {}: {}, {done} of them measured before",
            study.name().as_str(),
            counted(study.cells().len() as u64, "cell"),
        );
        Ok(Self {
            known: KnownCampaigns::list(&mut clients.campaigns).await?,
            progress: Progress::of(waiting.len()),
            study,
            folder,
            clients,
            measuring,
            embedders,
            waiting,
        })
    }

    /// Brings every campaign to its end, so many at once; `again` is the command that goes on.
    async fn finish(mut self, at_once: usize, again: &str) -> Result<(), CliError> {
        let mut running = JoinSet::new();
        let mut failures = Vec::new();
        let signal = termination();
        tokio::pin!(signal);
        loop {
            while running.len() < at_once
                && let Some((job, spec)) = self.next_ready()?
            {
                if let Err(error) = self.start(&mut running, job, spec).await {
                    failures.push(error);
                }
            }
            if running.is_empty() {
                break;
            }
            tokio::select! {
                Some(joined) = running.join_next() => match joined {
                    Ok(Ok(done)) => self.keep(done)?,
                    Ok(Err(error)) => failures.push(error),
                    Err(_) => failures.push("it broke off because of a bug".to_owned()),
                },
                signal = &mut signal => {
                    self.measuring.interrupt.raise();
                    self.progress.end();
                    return Err(CliError::Failed(format!(
                        "{signal}; complete generations are kept; next: {again}"
                    )));
                }
            }
        }
        self.progress.end();
        match failures.as_slice() {
            [] => Ok(()),
            failures => Err(CliError::Failed(format!(
                "{} failed, {} not begun: {}; next: {again}",
                counted(failures.len() as u64, "campaign"),
                self.waiting.len(),
                failures.join("; ")
            ))),
        }
    }

    /// The next campaign that waits for no embedder, with its specification.
    fn next_ready(&mut self) -> Result<Option<(Job, CampaignSpec)>, CliError> {
        for place in 0..self.waiting.len() {
            let spec = match &self.waiting[place] {
                Job::Embedder(_, spec, _) => Some(CampaignSpec::clone(spec)),
                Job::Cell(cell) => self
                    .study
                    .campaign_of(&self.study.cells()[*cell], &self.embedders)?,
            };
            if let Some(spec) = spec {
                return Ok(self.waiting.remove(place).map(|job| (job, spec)));
            }
        }
        Ok(None)
    }

    /// Begins a campaign, in the order of the study, and leaves the rest to a task.
    async fn start(
        &mut self,
        running: &mut JoinSet<Result<Done, String>>,
        job: Job,
        spec: CampaignSpec,
    ) -> Result<(), String> {
        let words = match &job {
            Job::Embedder(_, _, place) => format!("embedder of {}", self.words(*place)),
            Job::Cell(place) => self.words(*place),
        };
        let said = |error: CliError, words: &str| format!("{words}: {error}");
        let known = self.known.of(&spec);
        let begun = begin(&mut self.clients.campaigns, &spec, known).await;
        let begun = begun.map_err(|error| said(error, &words))?;
        let progress = self.progress.cell(words.clone());
        let (mut clients, measuring) = (self.clients.clone(), self.measuring.clone());
        running.spawn(async move {
            let done = done(&mut clients, &measuring, (job, &spec), begun, &progress).await;
            progress.end(if done.is_ok() { "done" } else { "failed" });
            done.map_err(|error| said(error, &words))
        });
        Ok(())
    }

    fn words(&self, place: usize) -> String {
        self.study.cell_in_words(&self.study.cells()[place])
    }

    fn keep(&mut self, done: Done) -> Result<(), CliError> {
        match done {
            Done::Embedder(cell, checkpoint) => {
                self.embedders.insert(cell, checkpoint);
                self.folder.keep_embedders(&self.embedders)?;
            }
            Done::Cell(measured) => self.folder.keep(&measured)?,
        }
        Ok(())
    }
}

/// Brings the campaign of a job to its end, and makes of it what the job is for.
async fn done(
    clients: &mut Clients,
    measuring: &Measuring,
    (job, spec): (Job, &CampaignSpec),
    begun: v1::Campaign,
    progress: &CellProgress,
) -> Result<Done, CliError> {
    let campaign = to_end(&mut clients.campaigns, begun, progress).await?;
    progress.now("measuring");
    match job {
        Job::Embedder(digest, ..) => Ok(Done::Embedder(digest, campaign.checkpoint.parse()?)),
        Job::Cell(_) => {
            let measured = measuring.measure(clients, spec, &campaign).await?;
            Ok(Done::Cell(Box::new(measured)))
        }
    }
}
