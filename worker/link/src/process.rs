//! What the processes of workers and trainers have in common, from their command line to their end.

use crate::{Credentials, Health, IdentityFiles, LinkError, TrustFiles, errln, stop::termination, telemetry};
use std::{
    fmt::Display,
    net::{IpAddr, SocketAddr},
    process::ExitCode,
};
use tokio::sync::watch;

/// Arguments of every worker and trainer.
#[derive(Debug, clap::Args)]
pub struct PartyArguments {
    /// URL of the coordinator
    #[arg(
        long,
        env = "MURMURATION_COORDINATOR",
        default_value = "http://127.0.0.1:7700"
    )]
    coordinator: String,
    #[command(flatten)]
    trust: TrustFiles,
    #[command(flatten)]
    identity: IdentityFiles,
    /// Answer gRPC's health service at this address, such as 127.0.0.1:7701 (`murmuration health` asks it)
    #[arg(long, env = "MURMURATION_HEALTH", value_name = "ADDRESS")]
    health: Option<SocketAddr>,
    /// Connect from this address, where this machine has several [default: as the system chooses]
    #[arg(long, env = "MURMURATION_LOCAL_ADDRESS", value_name = "ADDRESS")]
    local_address: Option<IpAddr>,
}

/// What a worker or trainer has to begin with.
#[derive(Debug)]
pub struct Post {
    /// URL of its coordinator.
    pub coordinator: String,
    /// What it shows there.
    pub credentials: Credentials,
    /// Address of this machine to connect from; `None` leaves the choice to the system.
    pub local_address: Option<IpAddr>,
    /// What others are told of how it is.
    pub health: Health,
    /// True once it is to leave, on SIGTERM or Ctrl-C.
    pub stop: watch::Receiver<bool>,
}

/// Runs a worker's or trainer's process: `service` is what its traces are of, and `leaving` what it logs when it is told
/// to leave. An error is named on stderr.
pub async fn run_party<E: Display + From<LinkError>>(
    service: &'static str,
    leaving: &'static str,
    arguments: PartyArguments,
    run: impl AsyncFnOnce(Post) -> Result<(), E>,
) -> ExitCode {
    let telemetry = telemetry(service, "info");
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

impl PartyArguments {
    async fn post(self, leaving: &'static str) -> Result<Post, LinkError> {
        // First of all: who is told to leave while it begins must leave as it should.
        let terminated = termination();
        let credentials = Credentials::read(&self.trust, &self.identity)?;
        let health = Health::new();
        if let Some(listen) = self.health {
            health.serve(listen).await?;
        }
        let (stop, stopped) = watch::channel(false);
        tokio::spawn(async move {
            let signal = terminated.await;
            tracing::info!("{signal}, {leaving}");
            stop.send_replace(true);
        });
        Ok(Post {
            coordinator: self.coordinator,
            credentials,
            local_address: self.local_address,
            health,
            stop: stopped,
        })
    }
}
