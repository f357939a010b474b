//! Code that worker and trainer processes share, from command line to exit.

use crate::{
    Credentials, CredentialsError, Health, IdentityFiles, Leaving, LinkError, Target, TrustFiles,
    access_file_of, errln, leaving::LeavingArguments, stop::termination, telemetry,
};
use std::{
    fmt::Display,
    net::{IpAddr, SocketAddr},
    path::PathBuf,
    process::ExitCode,
};
use tokio::sync::watch;

/// Arguments of every worker and trainer.
#[derive(Debug, clap::Args)]
pub struct PeerArguments {
    /// URL of the coordinator, used instead of an access file
    #[arg(long, env = "MURMURATION_COORDINATOR", value_name = "URL")]
    coordinator: Option<String>,
    /// Data directory of the coordinator, for its access file
    #[arg(
        long,
        env = "MURMURATION_DATA",
        default_value = "murmuration-data",
        value_name = "DIR"
    )]
    data: PathBuf,
    #[command(flatten)]
    trust: TrustFiles,
    #[command(flatten)]
    identity: IdentityFiles,
    /// Answer gRPC's health service at this address, such as 127.0.0.1:7701 (`murmuration health` asks it)
    #[arg(long, env = "MURMURATION_HEALTH", value_name = "ADDRESS")]
    health: Option<SocketAddr>,
    /// Connect from this address, if this machine has several [default: as the system chooses]
    #[arg(long, env = "MURMURATION_LOCAL_ADDRESS", value_name = "ADDRESS")]
    local_address: Option<IpAddr>,
    #[command(flatten)]
    leaving: LeavingArguments,
}

/// The parameters of a worker or trainer.
#[derive(Debug)]
pub struct Post {
    pub coordinator: Target,
    /// Address of this machine to connect from; `None` leaves the choice to the system.
    pub local_address: Option<IpAddr>,
    /// Health of the process, for other processes to query.
    pub health: Health,
    /// Conditions under which the process leaves by itself.
    pub leaving: Leaving,
    /// True after SIGTERM or Ctrl-C, or when it is time to leave.
    pub stop: watch::Receiver<bool>,
}

/// Runs a worker's or trainer's process. `service` is the name of the process in traces; `leaving` is logged when the process
/// must leave. Errors go to stderr.
pub async fn run_peer<E: Display + From<LinkError>>(
    service: &'static str,
    leaving: &'static str,
    arguments: PeerArguments,
    run: impl AsyncFnOnce(Post) -> Result<(), E>,
) -> ExitCode {
    let telemetry = telemetry(service, tracing::Level::INFO);
    let ended = async {
        let post = arguments.post(leaving).await?;
        run(post).await
    };
    let code = match ended.await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            errln!("error: {error}");
            ExitCode::FAILURE
        }
    };
    telemetry.end().await;
    code
}

impl PeerArguments {
    fn target(&self) -> Result<Target, CredentialsError> {
        let named = Target::named(self.coordinator.as_deref(), &self.trust, &self.identity)?;
        match named {
            Some(target) => Ok(target),
            None => Ok(Target::AccessFile {
                path: access_file_of(&self.data),
                credentials: Credentials::beside_access_file(&self.trust, &self.identity)?,
            }),
        }
    }

    async fn post(self, how: &'static str) -> Result<Post, LinkError> {
        // Wait for signals first, so that a signal during the start also leads to a clean exit.
        let terminated = termination();
        let coordinator = self.target()?;
        let health = Health::new();
        if let Some(listen) = self.health {
            health.serve(listen).await?;
        }
        let (stop, stopped) = watch::channel(false);
        let leaving = self.leaving.leaving();
        let leaves = self.leaving.time_to_leave(leaving.clone());
        tokio::spawn(async move {
            tokio::pin!(terminated);
            let (reason, was_signal) = tokio::select! {
                signal = &mut terminated => (signal.to_owned(), true),
                reason = leaves => (reason, false),
            };
            tracing::info!("{reason}, {how}");
            stop.send_replace(true);
            if !was_signal {
                // Two signals end the process at once, as they do otherwise.
                terminated.await;
            }
        });
        Ok(Post {
            coordinator,
            local_address: self.local_address,
            health,
            leaving,
            stop: stopped,
        })
    }
}
