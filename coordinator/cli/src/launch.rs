//! Processes of a launcher, such as `srun`, that run a campaign together: the first one coordinates, and all of them work.

use super::{CliError, Global, contact::Contact};
use clap::builder::BoolishValueParser;
use murmuration_coordinator::{
    local::{InProcess, WorkerError, work_for},
    server::Publication,
};
use murmuration_link::{
    AccessFile, AccessFileError, Credentials, LinkError, OnLost, Rank, Target, errln, host_name, rank,
    termination,
};
use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;
use std::{num::NonZeroUsize, path::PathBuf, time::Duration};
use tokio::sync::watch;

/// How long a process that works waits for the process that coordinates.
const PATIENCE: Duration = Duration::from_secs(600);
/// Folder of the access files of launches in a data directory.
const FOLDER: &str = "launches";

#[derive(Debug, clap::Args)]
pub struct TogetherArgs {
    /// Run the campaign together with the other processes of this launch: the first one coordinates, and all of them work. Started
    /// again in the same job, they go on with the campaign [default: true for several tasks of srun or MPI]
    #[arg(
        long,
        env = "MURMURATION_TOGETHER",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "true",
        value_name = "BOOL",
        value_parser = BoolishValueParser::new()
    )]
    together: Option<bool>,
    /// Name or address by which the other processes reach this machine [default: the name of this machine]
    #[arg(long, env = "MURMURATION_LAUNCH_CONTACT", value_name = "HOST")]
    contact: Option<Contact>,
}

/// The launch that this process belongs to.
#[derive(Debug)]
pub struct Launch {
    /// The id of the request for the campaign.
    request_id: String,
    /// 0 for the process that coordinates.
    number: u64,
    /// The access file of the process that coordinates.
    access: PathBuf,
    contact: Option<Contact>,
}

impl TogetherArgs {
    /// Whether this process works for another process of its launch.
    pub(super) fn works_for_another(&self) -> bool {
        self.rank().is_some_and(|rank| rank.number > 0)
    }

    /// The rank of this process, if it is to run its campaign together with others.
    fn rank(&self) -> Option<Rank> {
        match self.together {
            Some(false) => None,
            Some(true) => rank(),
            None => rank().filter(|rank| rank.is_parallel),
        }
    }

    /// The launch of a campaign, if this process is to run it together with others.
    pub(super) fn launch(&self, spec: &CampaignSpec, global: &Global) -> Result<Option<Launch>, CliError> {
        let found = self.rank();
        if found.is_none() && self.together == Some(true) {
            return Err(CliError::Input(
                "--together: no launcher has numbered this process: start it with srun or mpirun, or in an array job"
                    .to_owned(),
            ));
        }
        found
            .map(|rank| Launch::of(rank, spec, global, self.contact.clone()))
            .transpose()
    }
}

impl Launch {
    fn of(
        rank: Rank,
        spec: &CampaignSpec,
        global: &Global,
        contact: Option<Contact>,
    ) -> Result<Self, CliError> {
        let (Some(launch), Some(job)) = (rank.launch, rank.job) else {
            return Err(CliError::Input(
                "the launcher gives its processes no name in common: set MURMURATION_LAUNCH to a name that is new for each \
                 launch (or --together=false)"
                    .to_owned(),
            ));
        };
        // Names come from outside, and could be paths. A launch can run several campaigns, one after the other.
        let of_campaign = |name: &str| {
            let mut hasher = blake3::Hasher::new();
            hasher
                .update(name.as_bytes())
                .update(&[0])
                .update(spec.to_toml().as_bytes());
            hasher.finalize().to_hex()
        };
        let file = format!("{}.json", &of_campaign(&launch)[..16]);
        Ok(Self {
            access: global.data.join(FOLDER).join(file),
            number: rank.number,
            request_id: format!("job-{}", &of_campaign(&job)[..32]),
            contact,
        })
    }

    /// Whether this process coordinates.
    pub(super) const fn coordinates(&self) -> bool {
        self.number == 0
    }

    /// The id of the request for the campaign: a launch in the same job goes on with the campaign.
    pub(super) fn request_id(&self) -> &str {
        &self.request_id
    }

    pub(super) fn publication(&self) -> Publication {
        Publication {
            file: Some(self.access.clone()),
            contact: self.contact.clone().map(String::from).or_else(host_name),
        }
    }

    /// Tells the other processes that the campaign has ended. If this process did not hold the data directory, the process that
    /// does may coordinate the same launch.
    pub(super) fn end(&self, held: bool) {
        if !held && AccessFile::read(&self.access).is_ok() {
            return;
        }
        if let Err(error) = AccessFile::end(&self.access) {
            errln!(
                "the other processes of the launch wait for up to ten minutes, because {} cannot be written: {error}",
                self.access.display()
            );
        }
    }

    /// Works for the process that coordinates, with a thread for each worker (at least one), until the campaign has ended.
    pub(super) async fn work(&self, in_process: InProcess) -> Result<(), CliError> {
        let target = Target::AccessFile {
            path: self.access.clone(),
            credentials: Credentials::default(),
        };
        errln!(
            "process {} of the launch works for the first one, by {} (--together=false runs a campaign of its own)",
            self.number,
            self.access.display()
        );
        let threads = NonZeroUsize::new(in_process.workers).unwrap_or(NonZeroUsize::MIN);
        let (stop, stopped) = watch::channel(false);
        let terminated = termination();
        tokio::spawn(async move {
            let signal = terminated.await;
            errln!("{signal}; leaving");
            stop.send_replace(true);
        });
        let worked = work_for(
            target,
            threads,
            in_process.embed_on,
            OnLost::RetryFor(PATIENCE),
            stopped,
        )
        .await;
        match (worked, AccessFile::read(&self.access)) {
            (Ok(()), Err(AccessFileError::Ended { .. })) => Ok(()),
            // The launcher starts the processes again, and they go on.
            (Ok(()), _) => Err(CliError::TryAgain("the campaign has not ended yet".to_owned())),
            (Err(WorkerError::Link(LinkError::Lost { .. })), _) => Err(CliError::Failed(format!(
                "the first process of the launch has not begun within {} minutes: all processes need the same campaign file, seed and \
                 data directory; with --together=false, each runs a campaign of its own",
                PATIENCE.as_secs() / 60
            ))),
            // A launcher ends all processes when one fails, and starts them again on the same machines.
            (Err(error), Ok(_)) => {
                errln!("error: {error}\nthis process leaves the launch, and the others go on without it");
                Ok(())
            }
            (Err(error), Err(_)) => Err(CliError::failed(error)),
        }
    }
}

/// Whether no process works on a campaign that its coordinator left running.
pub(super) fn is_interrupted(campaign: &v1::Campaign) -> bool {
    campaign.state() == v1::CampaignState::Running && !campaign.active
}
