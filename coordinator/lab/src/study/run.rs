//! `study run`: runs every campaign of a study to its end, several at once, and measures each campaign as soon as it has
//! completed.

use super::{
    kept,
    labelled::Labelled,
    measuring::{Clients, Measuring},
    outcome,
    progress::{CellProgress, Progress},
    report_error, report_folder, shown,
};
use crate::known_campaigns::{KnownCampaigns, to_end};
use murmuration_cli::{
    CliError, Global, InProcessArgs,
    connection::{self, Connection, StudyClient},
    files::read_words,
    quoted,
};
use murmuration_embed::Runtime;
use murmuration_files::{Folder, InputKind, Replaces};
use murmuration_link::{errln, termination};
use murmuration_model::study_records::StudyFile;
use murmuration_proto::v1;
use murmuration_search::interrupt::Interrupt;
use murmuration_study::{
    Corrections, Measured, Reference, Study, cell_digest, cell_record, embedder_record, measures_digest,
    reference_record, write_report,
};
use murmuration_swarm::{CampaignSpec, CheckpointDigest, counted};
use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    path::{Path, PathBuf, absolute},
    sync::Arc,
    time::Instant,
};
use tokio::task::JoinSet;

#[derive(Debug, clap::Args)]
#[command(after_help = "\
A campaign with the same specification counts as a cell, whatever it is called: cells that have run do not run again, and an \
interrupted study continues when it is run again. The command uses the coordinator that was named or that holds the data \
directory, or else runs one itself.

Examples:
  murmuration lab study run studies/small.toml
  murmuration lab study run studies/paper.toml --quick")]
pub struct RunStudy {
    /// Study file (see studies/)
    file: PathBuf,
    /// Run the study with the settings of its [quick] table
    #[arg(long)]
    quick: bool,
    /// Campaigns that run at once
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(1..=64))]
    at_once: u8,
    #[command(flatten)]
    in_process: InProcessArgs,
}

impl RunStudy {
    pub(crate) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let text = read_words(&self.file, InputKind::Study)?;
        let failed =
            |error: &dyn std::fmt::Display| CliError::Input(format!("{}: {error}", self.file.display()));
        let file = absolute(&self.file).map_err(|error| CliError::unreadable(&self.file, &error))?;
        let folder = file.parent().unwrap_or(Path::new("/"));
        let study = Study::from_toml(&text, folder, self.quick).map_err(|error| failed(&error))?;
        let in_process = self.in_process.some()?;
        let (labelled, contents) = Labelled::read(&study)?;
        let contents: Vec<&[u8]> = contents.iter().map(Vec::as_slice).collect();
        let measuring = Measuring {
            digest: measures_digest(&study.measures, &contents),
            measures: Arc::new(study.measures.clone()),
            labelled: Arc::new(labelled),
            reference: None,
            interrupt: Interrupt::default(),
        };
        if study.cells.iter().any(|cell| cell.spec.space().embeds()) {
            Runtime::load()?;
        }
        let begun = Instant::now();
        let quick = if self.quick { " --quick" } else { "" };
        let again = global.next(&format!(
            "lab study run {}{quick}",
            quoted(&self.file.display().to_string())
        ));
        let run = async |connection: &mut Connection| {
            let name = study.name.as_str();
            let file = StudyFile {
                toml: text,
                folder: folder.display().to_string(),
                quick: self.quick,
                measures: measuring.digest.clone(),
            };
            kept::keep(&mut connection.studies, name, Some(file), Vec::new()).await?;
            let run = StudyRun::begin(connection, &study, measuring).await?;
            run.finish(usize::from(self.at_once), &again).await?;
            outcome(&mut connection.studies, name, Corrections::default()).await
        };
        let outcome = connection::with_new(global, in_process, run).await?;
        let folder = Folder::create(&report_folder(&global.data, &outcome), Replaces::All)?;
        let page = write_report(&outcome, folder).map_err(report_error)?;
        shown::show(&outcome, Some(&page), global.json)?;
        let seconds = begun.elapsed().as_secs_f64();
        errln!("{seconds:.1} s; open the report in a browser");
        Ok(())
    }
}

/// A campaign to run.
enum Job {
    /// The campaign of the atlas, against which recall is measured.
    Atlas(Box<CampaignSpec>),
    /// A campaign that trains the embedder of the cell at this index, and perhaps of other cells; with the campaign's digest.
    Embedder(String, Box<CampaignSpec>, usize),
    /// The cell at this index; if the cell shares an embedder, with the digest of the campaign that trains the embedder.
    Cell(usize, Option<String>),
}

enum Done {
    Atlas(Box<Reference>),
    Embedder(String, CheckpointDigest),
    Cell(Box<Measured>),
}

struct StudyRun<'a> {
    study: &'a Study,
    kept: StudyClient,
    clients: Clients,
    measuring: Measuring,
    /// The checkpoints that cells share, by the digest of the campaign that trains the checkpoint.
    embedders: BTreeMap<String, CheckpointDigest>,
    waiting: VecDeque<Job>,
    /// The campaigns of the coordinator at the last lookup.
    known: KnownCampaigns,
    progress: Progress,
}

impl<'a> StudyRun<'a> {
    async fn begin(
        connection: &Connection,
        study: &'a Study,
        measuring: Measuring,
    ) -> Result<Self, CliError> {
        let clients = Clients {
            campaigns: connection.client.clone(),
            checkpoints: connection.checkpoints.clone(),
            labels: connection.labels.clone(),
        };
        let mut kept = connection.studies.clone();
        let known = kept::get(&mut kept, study.name.as_str()).await?;
        let (embedders, measured) = (known.embedders()?, known.all_measured()?);
        let missing = measured
            .iter()
            .enumerate()
            .filter(|(_, measured)| measured.is_none());
        // Two rows can have the same campaign.
        let mut wanted = BTreeSet::new();
        let missing: Vec<usize> = missing
            .map(|(place, _)| place)
            .filter(|&place| wanted.insert(cell_digest(&study.cells[place].spec)))
            .collect();
        let mut trained = BTreeSet::new();
        let mut waiting = VecDeque::new();
        let reference = known.reference().map(Arc::new);
        // Figures of earlier runs also depend on the atlas, so the atlas is made again even if no cell is missing.
        if let (Some(plan), None) = (&study.measures.recall, &reference) {
            waiting.push_back(Job::Atlas(Box::new(plan.atlas.clone())));
        }
        let mut cells = Vec::new();
        for place in missing {
            let trains = study.embedder_of(&study.cells[place])?;
            let needed = trains.as_ref().map(cell_digest);
            if let (Some(spec), Some(digest)) = (trains, &needed)
                && !embedders.contains_key(digest)
                && trained.insert(digest.clone())
            {
                waiting.push_back(Job::Embedder(digest.clone(), Box::new(spec), place));
            }
            cells.push(Job::Cell(place, needed));
        }
        waiting.extend(cells);
        let done = measured.iter().flatten().count();
        errln!(
            "study {}: {}, {done} of them measured before",
            study.name.as_str(),
            counted(study.cells.len() as u64, "cell"),
        );
        Ok(Self {
            kept,
            progress: Progress::of(waiting.len()),
            study,
            clients,
            measuring: Measuring {
                reference,
                ..measuring
            },
            embedders,
            waiting,
            known: KnownCampaigns::default(),
        })
    }

    /// Runs all campaigns to their end, `at_once` at a time; `again` is the command that continues after a failure.
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
                    Ok(Ok(done)) => self.keep(done).await?,
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

    /// The next campaign that is ready to run, with its specification.
    fn next_ready(&mut self) -> Result<Option<(Job, CampaignSpec)>, CliError> {
        let place = self.waiting.iter().position(|job| self.is_ready(job));
        let Some(job) = place.and_then(|place| self.waiting.remove(place)) else {
            return Ok(None);
        };
        let spec = match &job {
            Job::Atlas(spec) | Job::Embedder(_, spec, _) => CampaignSpec::clone(spec),
            Job::Cell(place, _) => {
                let spec = self
                    .study
                    .campaign_of(&self.study.cells[*place], &self.embedders)?;
                spec.ok_or_else(|| {
                    let words = self.words(*place);
                    CliError::Failed(format!("{words}: its embedder is not known because of a bug"))
                })?
            }
        };
        Ok(Some((job, spec)))
    }

    /// Whether the embedder and the atlas that a campaign needs are there.
    fn is_ready(&self, job: &Job) -> bool {
        match job {
            Job::Atlas(_) | Job::Embedder(..) => true,
            Job::Cell(_, needed) => {
                let has_embedder = needed
                    .as_ref()
                    .is_none_or(|digest| self.embedders.contains_key(digest));
                has_embedder && !self.waits_for_atlas()
            }
        }
    }

    /// Whether cells must wait for the atlas, because their measures need it.
    fn waits_for_atlas(&self) -> bool {
        self.study.measures.recall.is_some() && self.measuring.reference.is_none()
    }

    /// Begins the campaign of a job, and spawns a task that brings the campaign to its end. Campaigns begin in the order of the
    /// study.
    async fn start(
        &mut self,
        running: &mut JoinSet<Result<Done, String>>,
        job: Job,
        spec: CampaignSpec,
    ) -> Result<(), String> {
        let words = match &job {
            Job::Atlas(_) => "atlas".to_owned(),
            Job::Embedder(_, _, place) => format!("embedder of {}", self.words(*place)),
            Job::Cell(place, _) => self.words(*place),
        };
        let message = |error: CliError, words: &str| format!("{words}: {error}");
        let begun = self
            .known
            .find_or_begin(&mut self.clients.campaigns, &spec, self.study.name.as_str())
            .await;
        let begun = begun.map_err(|error| message(error, &words))?;
        let progress = self.progress.cell(words.clone());
        let (mut clients, measuring) = (self.clients.clone(), self.measuring.clone());
        running.spawn(async move {
            let done = done(&mut clients, &measuring, job, &spec, begun, &progress).await;
            progress.end(if done.is_ok() { "done" } else { "failed" });
            done.map_err(|error| message(error, &words))
        });
        Ok(())
    }

    fn words(&self, place: usize) -> String {
        self.study.cell_in_words(&self.study.cells[place])
    }

    /// Stores the outcome of a job.
    async fn keep(&mut self, done: Done) -> Result<(), CliError> {
        let record = match done {
            Done::Atlas(reference) => {
                let record = reference_record(&reference);
                self.measuring.reference = Some(Arc::from(reference));
                record
            }
            Done::Embedder(cell, checkpoint) => {
                let record = embedder_record(&cell, checkpoint);
                self.embedders.insert(cell, checkpoint);
                record
            }
            Done::Cell(measured) => cell_record(&measured),
        };
        kept::keep(&mut self.kept, self.study.name.as_str(), None, vec![record]).await
    }
}

/// Runs the campaign of a job to its end, and makes the job's result from it.
async fn done(
    clients: &mut Clients,
    measuring: &Measuring,
    job: Job,
    spec: &CampaignSpec,
    begun: v1::Campaign,
    progress: &CellProgress,
) -> Result<Done, CliError> {
    progress.begin(&begun.id);
    let draw = |status: &v1::Campaign| {
        progress.draw(status);
        Ok(())
    };
    let campaign = to_end(&mut clients.campaigns, begun, draw).await?;
    progress.now("measuring");
    match job {
        Job::Atlas(_) => {
            let reference = measuring.reference(clients, spec, &campaign).await?;
            Ok(Done::Atlas(Box::new(reference)))
        }
        Job::Embedder(digest, ..) => Ok(Done::Embedder(digest, campaign.checkpoint.parse()?)),
        Job::Cell(..) => {
            let measured = measuring.measure(clients, spec, &campaign).await?;
            Ok(Done::Cell(Box::new(measured)))
        }
    }
}
