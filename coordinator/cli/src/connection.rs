//! Connections of a command to a coordinator: to a running one, or to one that the command starts over the data directory.
//!
//! Only [`with`], [`with_new`] and [`with_own`] open a connection, so that every command ends the coordinator that it starts.

use super::{CliError, Global, files::is_there};
use murmuration_access::{ListenConfig, local_token};
use murmuration_coordinator::{
    local::{InProcess, LocalCluster},
    server::{Options, Publication, ServerError},
};
use murmuration_dispatch as dispatch;
use murmuration_files::UnfinishedFolder;
use murmuration_link::{
    AccessFile, Coordinator, Credentials, Target, access_file_of, is_loopback, machine_name,
};
use murmuration_proto::v1::{
    campaign_service_client::CampaignServiceClient, checkpoint_service_client::CheckpointServiceClient,
    evaluation_service_client::EvaluationServiceClient, label_service_client::LabelServiceClient,
    node_service_client::NodeServiceClient, study_service_client::StudyServiceClient,
    transfer_service_client::TransferServiceClient,
};
use murmuration_store::{DataDirectory, LockHolder, Store, StoreError, backup::copy_to_read};
use std::{
    net::Ipv4Addr,
    path::Path,
    time::{Duration, Instant},
};
use tonic::service::interceptor::InterceptedService;

pub type Client = CampaignServiceClient<Coordinator>;
pub type CheckpointClient = CheckpointServiceClient<Coordinator>;
pub type EvaluationClient = EvaluationServiceClient<Coordinator>;
pub type TransferClient = TransferServiceClient<Coordinator>;
pub type NodeClient = NodeServiceClient<Coordinator>;
pub type StudyClient = StudyServiceClient<Coordinator>;
pub type LabelClient = LabelServiceClient<Coordinator>;

/// A connection to a coordinator, which stays available for the lifetime of this value.
pub struct Connection {
    pub client: Client,
    pub checkpoints: CheckpointClient,
    pub evaluations: EvaluationClient,
    pub labels: LabelClient,
    pub transfers: TransferClient,
    pub studies: StudyClient,
    pub nodes: NodeClient,
    /// The coordinator that this process started, if any.
    own: Option<LocalCluster>,
    /// The copy of the data directory that this process reads, if the directory cannot be written.
    copy: Option<UnfinishedFolder>,
}

/// Longest wait for the address of the process that holds the data directory. A coordinator publishes its address when it begins
/// to listen.
const ADDRESS_WAIT: Duration = Duration::from_secs(5);
/// Pause between two attempts to read the address of the process that holds the data directory.
const ADDRESS_PAUSE: Duration = Duration::from_millis(50);

impl Connection {
    async fn open(
        global: &Global,
        in_process: InProcess,
        hold: fn(&Path) -> Result<DataDirectory, StoreError>,
    ) -> Result<Self, CliError> {
        if let Some(target) = global.target()? {
            return Self::to(&target).await;
        }
        let begun = Instant::now();
        loop {
            match hold(&global.data) {
                Ok(data) => {
                    let options = Self::options(global, data, in_process);
                    return match LocalCluster::start(options, in_process).await {
                        Err(ServerError::Store(refused)) if refused.leaves_reading() => {
                            Self::read(global, in_process, refused).await
                        }
                        started => Self::of(started?).await,
                    };
                }
                Err(refused) if refused.leaves_reading() => {
                    return Self::read(global, in_process, refused).await;
                }
                Err(StoreError::InUse { holder, .. }) if !holder.address.is_empty() => {
                    return Self::to(&of_holder(holder, &global.data)?).await;
                }
                Err(StoreError::InUse { .. }) if begun.elapsed() < ADDRESS_WAIT => {
                    tokio::time::sleep(ADDRESS_PAUSE).await;
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Options of a coordinator over a data directory that this process holds, for this process alone.
    fn options(global: &Global, data: DataDirectory, in_process: InProcess) -> Options {
        Options {
            data,
            listen: ListenConfig::new((Ipv4Addr::LOCALHOST, 0).into(), None, None),
            resume: false,
            checkpoints: global.checkpoint_store.clone(),
            tries_checkpoints: in_process != InProcess::NONE,
            dispatch: dispatch::Options::default(),
            mirror: None,
            reads_only: None,
            publication: None,
        }
    }

    /// A connection to a coordinator that this process has started.
    async fn of(own: LocalCluster) -> Result<Self, CliError> {
        let way = own.coordinator().local().clone();
        match Self::to(&way.target()).await {
            Ok(connection) => Ok(Self {
                own: Some(own),
                ..connection
            }),
            Err(error) => {
                own.shutdown().await?;
                Err(error)
            }
        }
    }

    /// Starts a coordinator over a copy of the data directory, which refuses changes because the directory `refused` them.
    async fn read(global: &Global, in_process: InProcess, refused: StoreError) -> Result<Self, CliError> {
        if !is_there(&global.data.join(Store::FILE))? {
            return Err(refused.into());
        }
        let copy = copy_to_read(&global.data)?;
        let data = DataDirectory::hold(copy.path())?;
        let options = Options {
            reads_only: Some(refused.to_string()),
            ..Self::options(global, data, in_process)
        };
        let own = LocalCluster::start(options, in_process).await?;
        Ok(Self {
            copy: Some(copy),
            ..Self::of(own).await?
        })
    }

    async fn to(target: &Target) -> Result<Self, CliError> {
        let channel = connect(target).await?;
        Ok(Self {
            client: Client::new(channel.clone()),
            checkpoints: CheckpointClient::new(channel.clone()),
            evaluations: EvaluationClient::new(channel.clone()),
            labels: LabelClient::new(channel.clone()),
            transfers: TransferClient::new(channel.clone()),
            studies: StudyClient::new(channel.clone()),
            nodes: NodeClient::new(channel),
            own: None,
            copy: None,
        })
    }

    /// Calls `ask`, then ends the coordinator that this process started, even after an error.
    async fn asked<T>(
        mut self,
        ask: impl AsyncFnOnce(&mut Self) -> Result<T, CliError>,
    ) -> Result<T, CliError> {
        let own = self.own.as_ref().map(|own| own.coordinator().taken_over());
        let answer = match own {
            Some(taken_over) => {
                tokio::pin!(taken_over);
                tokio::select! {
                    taken_over = &mut taken_over => Err(taken_over.into()),
                    answer = ask(&mut self) => match answer {
                        Ok(answer) => Ok(answer),
                        // The reason can be that the coordinator may change nothing any more.
                        Err(error) => tokio::select! {
                            biased;
                            taken_over = &mut taken_over => Err(taken_over.into()),
                            () = std::future::ready(()) => Err(error),
                        },
                    },
                }
            }
            None => ask(&mut self).await,
        };
        let ended = match self.own {
            Some(own) => own.shutdown().await.map_err(CliError::from),
            None => Ok(()),
        };
        // The coordinator reads the copy until it has ended.
        drop(self.copy);
        // The error of the command matters more than an error at shutdown.
        let answer = answer?;
        ended?;
        Ok(answer)
    }

    /// Whether this process runs the coordinator. Such a coordinator, and all its work, ends with the command.
    pub const fn is_own(&self) -> bool {
        self.own.is_some()
    }
}

/// Calls `ask` with a connection to a coordinator: the one named on the command line, else the one that holds the data directory,
/// else a new one with `in_process` workers and trainers. A new coordinator resumes no campaign by itself.
pub async fn with<T>(
    global: &Global,
    in_process: InProcess,
    ask: impl AsyncFnOnce(&mut Connection) -> Result<T, CliError>,
) -> Result<T, CliError> {
    // A command that only asks leaves a coordinator alone that it cannot hear.
    let hold = match in_process {
        InProcess::NONE => DataDirectory::hold_existing,
        _ => DataDirectory::take_over_existing,
    };
    let connection = Connection::open(global, in_process, hold).await?;
    connection.asked(ask).await
}

/// Calls `ask` as [`with`] does, and creates the data directory if it does not exist.
pub async fn with_new<T>(
    global: &Global,
    in_process: InProcess,
    ask: impl AsyncFnOnce(&mut Connection) -> Result<T, CliError>,
) -> Result<T, CliError> {
    let connection = Connection::open(global, in_process, DataDirectory::hold).await?;
    connection.asked(ask).await
}

/// Starts a coordinator over a data directory that this process holds, and calls `ask` with a connection to this coordinator. With a
/// `publication`, other machines reach the coordinator too.
pub async fn with_own<T>(
    global: &Global,
    data: DataDirectory,
    in_process: InProcess,
    publication: Option<Publication>,
    ask: impl AsyncFnOnce(&mut Connection) -> Result<T, CliError>,
) -> Result<T, CliError> {
    let mut options = Connection::options(global, data, in_process);
    if publication.is_some() {
        options.listen = ListenConfig::new((Ipv4Addr::UNSPECIFIED, 0).into(), None, None);
        options.publication = publication;
    }
    let own = LocalCluster::start(options, in_process).await?;
    Connection::of(own).await?.asked(ask).await
}

/// The coordinator that holds the data directory `data`.
///
/// # Errors
/// If the coordinator runs on another machine and is only for that machine, or if its token cannot be read.
pub(super) fn of_holder(holder: LockHolder, data: &Path) -> Result<Target, CliError> {
    if !is_on_this_machine(&holder) {
        let path = access_file_of(data);
        return match AccessFile::read(&path) {
            Ok(access) if access.is_for_other_machines() => Ok(Target::AccessFile {
                path,
                credentials: Credentials::default(),
            }),
            _ => Err(CliError::on_another_machine(&holder, data)),
        };
    }
    // The folder may be somebody else's. So the token is sent only to this machine, where a coordinator listens for its commands.
    let token = match is_loopback(&holder.address) {
        true => local_token(data)?,
        false => None,
    };
    Ok(Target::Url {
        url: holder.address,
        credentials: token.map_or_else(Credentials::default, Credentials::token),
    })
}

fn is_on_this_machine(holder: &LockHolder) -> bool {
    holder.machine.is_empty() || machine_name().is_none_or(|own| own == holder.machine)
}

pub async fn connect(target: &Target) -> Result<Coordinator, CliError> {
    let (url, credentials) = target.look_up()?;
    // Answers may take any time, but the server must answer pings.
    let endpoint = credentials
        .endpoint(&url)?
        .connect_timeout(Duration::from_secs(5))
        .http2_keep_alive_interval(Duration::from_secs(10))
        .keep_alive_timeout(Duration::from_secs(20));
    let channel = endpoint.connect().await;
    let channel = channel.map_err(|error| CliError::no_coordinator(&url, &error))?;
    Ok(InterceptedService::new(channel, credentials.bearer()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;
    use murmuration_proto::v1;
    use murmuration_swarm::CampaignSpec;

    #[derive(Debug, clap::Parser)]
    struct Arguments {
        #[command(flatten)]
        global: Global,
    }

    #[test]
    fn a_token_is_sent_to_this_machine_alone() {
        let folder = tempfile::tempdir().unwrap();
        murmuration_access::LocalToken::of(folder.path()).unwrap();
        let shown = |address: &str| {
            let holder = LockHolder {
                address: address.to_owned(),
                ..LockHolder::default()
            };
            format!("{:?}", of_holder(holder, folder.path()).unwrap())
        };
        assert!(shown("http://127.0.0.1:7700").contains("token: Some"));
        for elsewhere in [
            "http://10.0.0.7:7700",
            "http://evil.example:80",
            "http://127.0.0.1.evil.example:80",
        ] {
            assert!(shown(elsewhere).contains("token: None"), "{elsewhere}");
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_coordinator_that_a_command_started_ends_with_it_whatever_came_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        let Arguments { global } = Arguments::parse_from(["test", "--data", data.to_str().unwrap()]);
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        // The coordinator writes the log into the database when it ends.
        let log = data.join("murmuration.sqlite-wal");
        for fails in [false, true] {
            let ask = async |connection: &mut Connection| {
                // The campaign waits for workers until the coordinator shuts down.
                let request = v1::CreateCampaignRequest {
                    campaign: Some(v1::create_campaign_request::Campaign::Spec((&spec).into())),
                    ..v1::CreateCampaignRequest::default()
                };
                connection.client.create_campaign(request).await?;
                assert!(connection.is_own() && log.metadata().unwrap().len() > 0);
                match fails {
                    true => Err(CliError::Failed("as asked".to_owned())),
                    false => Ok(()),
                }
            };
            let held = DataDirectory::hold(&data).unwrap();
            let asked = with_own(&global, held, InProcess::NONE, None, ask).await;
            assert_eq!(
                asked.map_err(|error| error.to_string()).err(),
                fails.then(|| "as asked".to_owned())
            );
            assert_eq!(log.metadata().unwrap().len(), 0, "the database is still open");
            // A child process of a concurrent test also holds the lock, from its fork until its exec.
            let is_free = async || {
                while DataDirectory::hold(&data).is_err() {
                    tokio::time::sleep(Duration::from_millis(5)).await;
                }
            };
            let freed = tokio::time::timeout(Duration::from_secs(10), is_free()).await;
            assert!(freed.is_ok(), "the data directory is still held");
        }
    }
}
