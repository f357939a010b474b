//! `health`: checks whether a process answers, for container engines and scripts.

use super::{CliError, Global, connection};
use murmuration_link::{READY, Target, outln};
use murmuration_store::{DataDirectory, StoreError};
use std::time::Duration;
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

/// How long a process may take to answer.
const LIMIT: Duration = Duration::from_secs(5);

#[derive(Debug, clap::Args)]
pub struct Health {
    /// Check only that the process answers, not that it is ready
    #[arg(long)]
    alive: bool,
}

impl Health {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let target = target(global)?;
        let shown = target.to_string();
        let service = if self.alive { "" } else { READY };
        let mut client = HealthClient::new(connection::connect(&target).await?);
        let request = HealthCheckRequest {
            service: service.to_owned(),
        };
        let answer = tokio::time::timeout(LIMIT, client.check(request))
            .await
            .map_err(|_| {
                CliError::Failed(format!(
                    "{shown} does not answer within {LIMIT:?}: check that a Murmuration process listens there"
                ))
            })??;
        if answer.into_inner().status() != ServingStatus::Serving {
            return Err(CliError::Failed(format!(
                "{shown} answers but is not ready: a coordinator is starting, or a worker or trainer has no coordinator"
            )));
        }
        outln!("{}", if self.alive { "alive" } else { "ready" })?;
        Ok(())
    }
}

/// The process named on the command line, or else the coordinator that holds the data directory.
fn target(global: &Global) -> Result<Target, CliError> {
    if let Some(target) = global.target()? {
        return Ok(target);
    }
    match DataDirectory::hold_existing(&global.data) {
        Err(StoreError::InUse { holder, .. }) if !holder.address.is_empty() => {
            connection::of_holder(holder, &global.data)
        }
        Err(error) => Err(error.into()),
        Ok(_) => Err(CliError::Failed(format!(
            "no coordinator runs over {}",
            global.data.display()
        ))),
    }
}
