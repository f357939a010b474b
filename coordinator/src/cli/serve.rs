//! `serve`: a coordinator that stays.

use super::{CliError, Global, loopback, run::CrewSize};
use crate::{dispatch, local::LocalCluster, server::Options, store::DataDirectory};
use murmuration_link::termination;
use std::net::SocketAddr;

/// Port on which coordinators listen unless told otherwise.
const PORT: u16 = 7700;

/// Arguments of `serve`.
#[derive(Debug, clap::Args)]
pub(super) struct Serve {
    /// Where to listen; this machine alone unless told otherwise
    #[arg(long, default_value_t = loopback(PORT))]
    listen: SocketAddr,
    #[command(flatten)]
    crew: CrewSize,
}

impl Serve {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let data = DataDirectory::hold(&global.data)
            .map_err(|error| CliError::busy(error, "one coordinator serves a data directory at a time"))?;
        let options = Options {
            data,
            listen: self.listen,
            resume: true,
            checkpoints: global.checkpoint_store.clone(),
            dispatch: dispatch::Options::default(),
        };
        let cluster = LocalCluster::start(options, self.crew.count()).await?;
        let url = cluster.coordinator().url();
        eprintln!("serving {} at {url}", global.data.display());
        eprintln!("  pages:     {url} in a browser");
        eprintln!("  campaigns: murmuration submit SPEC.toml --coordinator {url}");
        eprintln!("  workers:   murmuration-worker --coordinator {url}");
        eprintln!("  trainers:  murmuration-trainer --coordinator {url}");
        let signal = termination().await;
        eprintln!("{signal}; running campaigns go on with the next `murmuration serve`");
        cluster.shutdown().await?;
        Ok(())
    }
}
