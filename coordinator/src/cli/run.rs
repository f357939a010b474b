//! `run` and `resume`: a campaign to its report.

use super::{
    CliError, Global,
    connection::Connection,
    follow::{Show, follow, stage_name},
    json,
    report::write_report,
};
use crate::{local::Crew, store::DataDirectory};
use indicatif::HumanCount;
use murmuration_embed::Runtime;
use murmuration_link::termination;
use murmuration_proto::{CampaignSpec, v1};
use std::{
    fs,
    num::NonZeroUsize,
    path::{Path, PathBuf},
    thread,
    time::Instant,
};

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
pub(super) struct Run {
    /// Campaign file (see examples/)
    spec: PathBuf,
    /// Seed instead of the file's, of its training too
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    crew: CrewSize,
}

/// Arguments of `resume`.
#[derive(Debug, clap::Args)]
pub(super) struct Resume {
    /// Campaign id, or `latest`
    campaign: String,
    #[command(flatten)]
    crew: CrewSize,
}

/// How many workers and trainers to start in this process.
#[derive(Debug, Default, clap::Args)]
pub(super) struct CrewSize {
    /// Workers in this process, one thread each [default: number of cores]
    #[arg(long, value_name = "N")]
    workers: Option<usize>,
    /// Trainers in this process [default: 1, or 0 with --workers 0]
    #[arg(long, value_name = "N")]
    trainers: Option<usize>,
}

impl CrewSize {
    pub(super) fn count(&self) -> Crew {
        let cores = || thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let workers = self.workers.unwrap_or_else(cores);
        Crew {
            workers,
            trainers: self.trainers.unwrap_or(workers.min(1)),
        }
    }

    /// At least one of each, where nobody else could do the work.
    fn some(&self) -> Result<Crew, CliError> {
        let crew = self.count();
        if crew.workers == 0 {
            let said = "--workers 0: without workers nothing would be evaluated";
            return Err(CliError::Input(said.to_owned()));
        }
        if crew.trainers == 0 {
            let said = "--trainers 0: without a trainer no embedder would be trained";
            return Err(CliError::Input(said.to_owned()));
        }
        Ok(crew)
    }
}

impl Run {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let spec = read_spec(&self.spec, self.seed)?;
        let crew = self.crew.some()?;
        if let Some(url) = &global.coordinator {
            let hint =
                format!("`run` does everything in this process; for the coordinator at {url} use `submit`");
            return Err(CliError::Input(hint));
        }
        let data = DataDirectory::hold(&global.data)
            .map_err(|error| CliError::busy(error, "hand the campaign to it with `murmuration submit`"))?;
        if spec.method().embeds() {
            // To be told after the dataset is simulated would be late.
            Runtime::load()?;
        }
        let mut connection = Connection::start(global, data, crew).await?;
        let request = v1::CreateCampaignRequest {
            spec: Some((&spec).into()),
            weight: None,
        };
        let campaign = connection.client.create_campaign(request).await?.into_inner();
        eprintln!(
            "campaign {} · {} · {} · {} evaluations · {} workers",
            campaign.id,
            spec.model(),
            spec.method(),
            HumanCount(spec.evaluations()),
            crew.workers,
        );
        to_report(connection, global, &campaign.id).await
    }
}

impl Resume {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(global, self.crew.some()?).await?;
        let request = v1::ResumeCampaignRequest {
            campaign: self.campaign,
        };
        let campaign = connection.client.resume_campaign(request).await?.into_inner();
        if connection.is_own() {
            eprintln!(
                "campaign {} goes on with its stage {} after generation {}",
                campaign.id,
                stage_name(campaign.stage()),
                campaign.generations_done
            );
            return to_report(connection, global, &campaign.id).await;
        }
        super::campaigns::changed(
            global,
            &campaign,
            "goes on",
            &format!("murmuration watch {}", campaign.id),
        );
        Ok(())
    }
}

/// Reads a campaign file, with another seed if there is one.
pub(super) fn read_spec(path: &Path, seed: Option<u64>) -> Result<CampaignSpec, CliError> {
    let text = fs::read_to_string(path).map_err(|error| CliError::unreadable(path, &error))?;
    let spec = CampaignSpec::from_toml(&text).map_err(|error| CliError::spec(path, &error))?;
    Ok(match seed {
        Some(seed) => spec.with_seed(seed)?,
        None => spec,
    })
}

/// Follows a campaign of this process to its end, writes its report and says where.
pub(super) async fn to_report(
    mut connection: Connection,
    global: &Global,
    campaign: &str,
) -> Result<(), CliError> {
    let begun = Instant::now();
    let outcome = tokio::select! {
        last = follow(&mut connection.client, campaign, Show::Person) => finish(&mut connection, global, last?).await,
        signal = termination() => Err(CliError::Failed(format!(
            "{signal}; everything up to the last complete generation is kept: `murmuration resume {campaign}`"
        ))),
    };
    connection.close().await?;
    let (digest, report) = outcome?;
    let seconds = begun.elapsed().as_secs_f64();
    let path = report.display().to_string();
    if global.json {
        json::print(&json::outcome(campaign, &digest, Some(&path), seconds));
    } else {
        println!("campaign  {campaign}");
        println!("digest    {}", digest.digest);
        println!("report    {path}");
        eprintln!("{seconds:.1} s; open the report in a browser");
    }
    Ok(())
}

async fn finish(
    connection: &mut Connection,
    global: &Global,
    last: v1::Campaign,
) -> Result<(v1::GetDigestResponse, PathBuf), CliError> {
    match last.state() {
        v1::CampaignState::Completed => {}
        v1::CampaignState::Failed => {
            return Err(CliError::Failed(format!("campaign {}: {}", last.id, last.error)));
        }
        _ => {
            return Err(CliError::Failed(format!(
                "campaign {} was stopped by someone else",
                last.id
            )));
        }
    }
    let folder = super::error::report_folder(&global.data, &last.id);
    let report = write_report(connection, &last.id, &folder).await?;
    let request = v1::GetDigestRequest { campaign: last.id };
    Ok((connection.client.get_digest(request).await?.into_inner(), report))
}
