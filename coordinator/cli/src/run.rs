//! `run` and `resume`: bring a campaign to its report.

use super::{
    CliError, Global,
    connection::{self, Connection},
    files::read_words,
    follow::{Show, follow, stage_name},
    json,
    launch::{Launch, TogetherArgs, is_interrupted},
    next_step, quoted,
    report::write_report,
    validation::{self, get_campaign, get_digest, list_campaigns, validated},
};
use murmuration_coordinator::local::InProcess;
use murmuration_embed::{Device, Runtime};
use murmuration_files::{InputKind, Replaces};
use murmuration_link::{OutputError, cores, errln, outln, termination};
use murmuration_proto::v1;
use murmuration_store::{DataDirectory, StoreError, blocking::interruptible};
use murmuration_swarm::{CampaignSpec, counted};
use std::{
    path::{Path, PathBuf},
    pin::Pin,
    time::{Duration, Instant},
};

/// Ready with the name of a signal that ends this process.
type Ended = Pin<Box<dyn Future<Output = &'static str> + Send>>;

/// Longest wait of a launch for its data directory.
const HOLD_WAIT: Duration = Duration::from_secs(60);
const HOLD_PAUSE: Duration = Duration::from_millis(100);

#[derive(Debug, clap::Args)]
pub struct Run {
    /// Campaign file (see examples/)
    spec: PathBuf,
    /// Seed of the search and the training, used instead of the file's seed
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Go on with the newest campaign of this specification in the data directory, if there is one that was not cancelled; if it is
    /// complete, print its report
    #[arg(long = "continue")]
    goes_on: bool,
    #[command(flatten)]
    in_process: InProcessArgs,
    #[command(flatten)]
    together: TogetherArgs,
}

#[derive(Debug, clap::Args)]
pub struct Resume {
    /// Campaign id, or `latest`
    campaign: String,
    #[command(flatten)]
    in_process: InProcessArgs,
}

/// Number of workers and trainers to start in this process.
#[derive(Debug, Default, clap::Args)]
pub struct InProcessArgs {
    /// Workers in this process, one thread each [default: number of cores that this process may use]
    #[arg(long, env = "MURMURATION_WORKERS", value_name = "N", value_parser = at_most_4096())]
    workers: Option<usize>,
    /// Trainers in this process [default: 1, or 0 with --workers 0]
    #[arg(long, env = "MURMURATION_TRAINERS", value_name = "N", value_parser = at_most_4096())]
    trainers: Option<usize>,
    /// Device on which the workers of this process embed; `cuda` needs a build of ONNX Runtime for CUDA
    #[arg(
        long,
        env = "MURMURATION_EMBED_ON",
        value_name = "DEVICE",
        value_enum,
        default_value_t
    )]
    embed_on: Device,
}

/// Accepts at most 4096, more than the threads of any machine. A larger number would use up the memory.
fn at_most_4096() -> clap::builder::RangedU64ValueParser<usize> {
    clap::builder::RangedU64ValueParser::new().range(0..=4096)
}

impl InProcessArgs {
    /// Workers and trainers of this process.
    ///
    /// # Errors
    /// If this machine cannot embed on the device.
    pub(super) fn count(&self) -> Result<InProcess, CliError> {
        let workers = self.workers.unwrap_or_else(|| cores().get());
        if self.embed_on != Device::default() {
            Runtime::load()?.on(self.embed_on)?;
        }
        Ok(InProcess {
            workers,
            trainers: self.trainers.unwrap_or(workers.min(1)),
            embed_on: self.embed_on,
        })
    }

    /// Workers and trainers of a command that works alone: at least one worker and one trainer.
    pub fn some(&self) -> Result<InProcess, CliError> {
        let in_process = self.count()?;
        if in_process.workers == 0 {
            let message = "--workers 0: a campaign needs at least one worker";
            return Err(CliError::Input(message.to_owned()));
        }
        if in_process.trainers == 0 {
            let message = "--trainers 0: a campaign needs at least one trainer";
            return Err(CliError::Input(message.to_owned()));
        }
        Ok(in_process)
    }
}

impl Run {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        // A signal that arrives early counts too.
        let mut ended: Ended = Box::pin(termination());
        let spec = read_spec(&self.spec, self.seed)?;
        let in_process = self.in_process.some()?;
        let launch = self.together.launch(&spec, global)?;
        if let Some(launch) = launch.as_ref().filter(|launch| !launch.coordinates()) {
            return launch.work(in_process).await;
        }
        let held = self.hold(global, launch.as_ref(), &mut ended).await;
        let holds = held.is_ok();
        let run = match held {
            Ok(data) => {
                self.coordinate(&spec, global, data, in_process, launch.as_ref(), &mut ended)
                    .await
            }
            Err(error) => Err(error),
        };
        match (run, launch) {
            // The launcher starts the processes again, and they go on.
            (Err(CliError::Interrupted(message) | CliError::TakenOver(message)), Some(_)) => {
                Err(CliError::TryAgain(message))
            }
            (run, Some(launch)) => {
                launch.end(holds);
                run
            }
            (run, None) => run,
        }
    }

    /// Whether this process works for another process of its launch, which runs the campaign.
    pub(super) fn works_for_another(&self) -> bool {
        self.together.works_for_another()
    }

    /// Holds the data directory; a launch waits for it.
    async fn hold(
        &self,
        global: &Global,
        launch: Option<&Launch>,
        ended: &mut Ended,
    ) -> Result<DataDirectory, CliError> {
        if let Some(target) = global.target()? {
            let hint =
                format!("`run` runs the campaign in this process: for {target} use `murmuration submit`");
            return Err(CliError::Input(hint));
        }
        let limit = launch.map_or(Duration::ZERO, |_| HOLD_WAIT);
        let held = tokio::select! {
            held = hold_within(limit, &global.data) => held,
            signal = ended => return Err(CliError::Interrupted(format!("{signal} before the start"))),
        };
        held.map_err(|error| self.in_use(error, global))
    }

    /// Runs the campaign in a coordinator of this process, until it has its report or the future `ended` is ready.
    async fn coordinate(
        &self,
        spec: &CampaignSpec,
        global: &Global,
        data: DataDirectory,
        in_process: InProcess,
        launch: Option<&Launch>,
        ended: &mut Ended,
    ) -> Result<(), CliError> {
        if spec.space().embeds() {
            // A missing ONNX Runtime must be reported now, not after the simulation of the dataset.
            Runtime::load()?;
        }
        let run = async |connection: &mut Connection| {
            let former = match self.goes_on {
                true => newest_of(connection, spec).await?,
                false => None,
            };
            let goes_on = launch.is_some() || former.is_some();
            let mut campaign = match former {
                Some(former) => former,
                None => {
                    let request = v1::CreateCampaignRequest {
                        campaign: Some(v1::create_campaign_request::Campaign::Spec(spec.into())),
                        request_id: launch.map(Launch::request_id).unwrap_or_default().to_owned(),
                        ..v1::CreateCampaignRequest::default()
                    };
                    validated(connection.client.create_campaign(request).await?)?
                }
            };
            let has_stopped =
                [v1::CampaignState::Paused, v1::CampaignState::Failed].contains(&campaign.state());
            if goes_on && (is_interrupted(&campaign) || self.goes_on && has_stopped) {
                let request = v1::ResumeCampaignRequest {
                    campaign: campaign.id.clone(),
                };
                campaign = validated(connection.client.resume_campaign(request).await?)?;
            }
            errln!(
                "campaign {} · {} · {} · {} · {}",
                campaign.id,
                spec.model(),
                spec.method(),
                counted(spec.evaluations(), "evaluation"),
                counted(in_process.workers as u64, "worker"),
            );
            to_report(connection, global, &campaign.id, ended).await
        };
        let publication = launch.map(Launch::publication);
        let reported = connection::with_own(global, data, in_process, publication, run).await?;
        Ok(reported.print(global)?)
    }

    /// Error if another process holds the data directory, with the advice to submit the campaign to that process.
    fn in_use(&self, error: StoreError, global: &Global) -> CliError {
        let StoreError::InUse { holder, .. } = &error else {
            return error.into();
        };
        if holder.address.is_empty() {
            return CliError::busy(
                error,
                "wait until that process has ended, or name another --data DIR",
            );
        }
        if let Err(elsewhere) = connection::of_holder(holder.clone(), &global.data) {
            return elsewhere;
        }
        let seed = self.seed.map_or(String::new(), |seed| format!(" --seed {seed}"));
        let submit = format!("submit {}{seed}", quoted(&self.spec.display().to_string()));
        // `submit` finds the process, and the token for it, by the data directory.
        let submit = global.next(&submit);
        CliError::busy(
            error,
            &format!("to submit the campaign to that process: {submit}"),
        )
    }
}

/// The newest campaign of a specification, unless it was cancelled.
async fn newest_of(
    connection: &mut Connection,
    spec: &CampaignSpec,
) -> Result<Option<v1::Campaign>, CliError> {
    let all = list_campaigns(&mut connection.client).await?;
    let wanted = v1::CampaignSpec::from(spec);
    let is_wanted = |campaign: &v1::Campaign| {
        campaign.spec.as_ref() == Some(&wanted) && campaign.state() != v1::CampaignState::Cancelled
    };
    Ok(all.into_iter().rev().find(is_wanted))
}

/// Holds a data directory, which a short command or the same launch before may still hold, within this time. Dropping the future
/// ends the wait for a holder on another machine.
pub(super) async fn hold_within(limit: Duration, data: &Path) -> Result<DataDirectory, StoreError> {
    let begun = Instant::now();
    loop {
        let path = data.to_path_buf();
        match interruptible(move |interrupt| DataDirectory::hold_unless(&path, interrupt)).await? {
            Err(StoreError::InUse { .. }) if begun.elapsed() < limit => {
                tokio::time::sleep(HOLD_PAUSE).await;
            }
            held => return held,
        }
    }
}

impl Resume {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let in_process = self.in_process.some()?;
        let resume = async |connection: &mut Connection| {
            let campaign = get_campaign(&mut connection.client, &self.campaign).await?;
            if campaign.state() == v1::CampaignState::Completed {
                errln!("campaign {} is complete", campaign.id);
                return Ok(campaign);
            }
            let request = v1::ResumeCampaignRequest {
                campaign: campaign.id,
            };
            let campaign = validated(connection.client.resume_campaign(request).await?)?;
            if connection.is_own() {
                errln!(
                    "campaign {} continues with stage {} after generation {}",
                    campaign.id,
                    stage_name(campaign.stage()),
                    campaign.generations_done
                );
            }
            Ok(campaign)
        };
        go_on(global, in_process, "continues", resume).await
    }
}

/// Continues a campaign after a `change`. If this process runs the coordinator, brings the campaign to its report. `what` is the
/// verb of the message about the campaign, such as `learns from its labels`.
pub(super) async fn go_on(
    global: &Global,
    in_process: InProcess,
    what: &str,
    change: impl AsyncFnOnce(&mut Connection) -> Result<v1::Campaign, CliError>,
) -> Result<(), CliError> {
    let changed = async |connection: &mut Connection| {
        let campaign = change(connection).await?;
        let reported = match connection.is_own() {
            true => {
                let mut ended: Ended = Box::pin(termination());
                Some(to_report(connection, global, &campaign.id, &mut ended).await?)
            }
            false => None,
        };
        Ok((campaign, reported))
    };
    let (campaign, reported) = connection::with(global, in_process, changed).await?;
    match reported {
        Some(reported) => reported.print(global)?,
        None => {
            let next = format!("watch {}", campaign.id);
            let running = v1::CampaignState::Running;
            next_step::changed(global, &campaign, running, what, &next)?;
        }
    }
    Ok(())
}

/// Reads a campaign file. A `seed` replaces the seed of the file.
pub fn read_spec(path: &Path, seed: Option<u64>) -> Result<CampaignSpec, CliError> {
    let text = read_words(path, InputKind::Campaign)?;
    let spec = CampaignSpec::from_toml(&text).map_err(|error| CliError::spec(path, &error))?;
    Ok(match seed {
        Some(seed) => spec.with_seed(seed)?,
        None => spec,
    })
}

/// A campaign that this process has brought to its report.
struct Reported {
    campaign: String,
    digest: v1::GetDigestResponse,
    path: String,
    seconds: f64,
}

impl Reported {
    fn print(&self, global: &Global) -> Result<(), OutputError> {
        let Self {
            campaign,
            digest,
            path,
            seconds,
        } = self;
        if global.json {
            return json::print(json::Run {
                campaign: campaign.clone(),
                digest: digest.digest.clone(),
                report: path.clone(),
                evaluations: digest.evaluations,
                seconds: *seconds,
            });
        }
        outln!("campaign  {campaign}")?;
        outln!("digest    {}", digest.digest)?;
        outln!("report    {path}")?;
        errln!("{seconds:.1} s; open the report in a browser");
        Ok(())
    }
}

/// Follows a campaign of this process to its end, and writes its report.
async fn to_report(
    connection: &mut Connection,
    global: &Global,
    campaign: &str,
    ended: &mut Ended,
) -> Result<Reported, CliError> {
    let begun = Instant::now();
    let (digest, report) = tokio::select! {
        last = follow(&mut connection.client, campaign, Show::Person) => finish(connection, global, last?).await?,
        signal = ended => return Err(CliError::Interrupted(format!(
            "{signal}; complete generations are kept; next: {}",
            global.next(&format!("resume {campaign}"))
        ))),
    };
    Ok(Reported {
        campaign: campaign.to_owned(),
        digest,
        path: report.display().to_string(),
        seconds: begun.elapsed().as_secs_f64(),
    })
}

async fn finish(
    connection: &mut Connection,
    global: &Global,
    last: v1::Campaign,
) -> Result<(v1::GetDigestResponse, PathBuf), CliError> {
    match last.state() {
        v1::CampaignState::Completed => {}
        v1::CampaignState::Failed => return Err(next_step::failed(global, &last)),
        _ => {
            let next = next_step::what_next(global, &last);
            let message = format!("campaign {} was stopped by another command; {next}", last.id);
            return Err(CliError::Failed(message));
        }
    }
    let id = validation::id(&last)?;
    let folder = super::error::report_folder(&global.data, &id);
    let report = write_report(connection, &id, &folder, Replaces::All).await?;
    Ok((get_digest(&mut connection.client, last.id).await?, report))
}
