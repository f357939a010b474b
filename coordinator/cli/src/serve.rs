//! `serve`: a coordinator that runs until it is stopped.

use super::{CliError, Global, run::InProcessArgs};
use clap::builder::BoolishValueParser;
use murmuration_access::{ClassSeats, ListenConfig, Tls, Tokens};
use murmuration_coordinator::{local::LocalCluster, server::Options};
use murmuration_dispatch as dispatch;
use murmuration_dispatch::Share;
use murmuration_link::{errln, machine_name, termination};
use murmuration_store::DataDirectory;
use std::{
    net::{Ipv4Addr, SocketAddr},
    path::PathBuf,
};

/// Advice if another process holds the data directory.
const ONE_COORDINATOR: &str =
    "only one coordinator can use a data directory: stop that process first, or name another --data DIR";

/// Default port of coordinators.
const PORT: u16 = 7700;

#[derive(Debug, clap::Args)]
pub struct Serve {
    /// Address to listen on; the default accepts connections from this machine only
    #[arg(
        long,
        env = "MURMURATION_LISTEN",
        default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, PORT)),
        value_name = "ADDRESS"
    )]
    listen: SocketAddr,
    /// Certificate of the coordinator, followed by intermediate certificates (PEM); turns encryption on
    #[arg(long, env = "MURMURATION_CERTIFICATE", value_name = "FILE", requires = "key")]
    certificate: Option<PathBuf>,
    /// Private key of the certificate (PEM)
    #[arg(long, env = "MURMURATION_KEY", value_name = "FILE", requires = "certificate")]
    key: Option<PathBuf>,
    /// Accept only workers and trainers with a certificate signed by this authority (PEM)
    #[arg(
        long,
        env = "MURMURATION_CLIENT_CA",
        value_name = "FILE",
        requires = "certificate"
    )]
    client_ca: Option<PathBuf>,
    /// Accept only people with a token listed in this file; `murmuration token` prints its entries
    #[arg(long, env = "MURMURATION_TOKENS", value_name = "FILE")]
    tokens: Option<PathBuf>,
    /// Allow listening beyond this machine without encryption or tokens, for a network that you trust
    #[arg(
        long,
        env = "MURMURATION_INSECURE_LISTEN",
        value_parser = BoolishValueParser::new()
    )]
    insecure_listen: bool,
    /// Largest number of requests of a cost class that are answered at the same time, in total and for one token, certificate or
    /// address; commas separate several classes. Classes: decision, bulk, light, reading, computing, streaming, stranger
    #[arg(
        long,
        env = "MURMURATION_SEATS",
        value_name = "CLASS=TOTAL/SHARE",
        value_delimiter = ','
    )]
    seats: Vec<ClassSeats>,
    /// Share of the evaluations that a second machine repeats, to find machines that compute wrong results
    #[arg(long, env = "MURMURATION_AUDIT", default_value_t = Share::default(), value_name = "0..1")]
    audit: Share,
    #[command(flatten)]
    in_process: InProcessArgs,
}

impl Serve {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let listen = self.listen_config()?;
        let data =
            DataDirectory::hold(&global.data).map_err(|error| CliError::busy(error, ONE_COORDINATOR))?;
        let options = Options {
            data,
            listen,
            resume: true,
            checkpoints: global.checkpoint_store.clone(),
            tries_checkpoints: true,
            dispatch: dispatch::Options {
                audited: self.audit,
                ..dispatch::Options::default()
            },
        };
        // As the first process of a container, a process without handlers ignores these signals.
        let ended = termination();
        tokio::pin!(ended);
        let started = LocalCluster::start(options, self.in_process.count());
        let cluster = tokio::select! {
            biased;
            signal = &mut ended => {
                errln!("{signal}; the coordinator had not started yet");
                return Ok(());
            }
            cluster = started => cluster?,
        };
        let url = self.url_for_others(cluster.coordinator().url());
        errln!("serving {} at {url}", global.data.display());
        self.say_how_to_reach(&url);
        let signal = ended.await;
        errln!("{signal}; the next `murmuration serve` continues the running campaigns");
        cluster.shutdown().await?;
        Ok(())
    }

    fn listen_config(&self) -> Result<ListenConfig, CliError> {
        let tls = match (&self.certificate, &self.key) {
            (Some(certificate), Some(key)) => Some(Tls::read(certificate, key, self.client_ca.as_deref())?),
            _ => None,
        };
        let tokens = self.tokens.as_deref().map(Tokens::read).transpose()?;
        let listen = ListenConfig::new(self.listen, tls, tokens, self.insecure_listen)?;
        Ok(listen.with_seats(&self.seats))
    }

    /// `url` with the name of this machine, if the coordinator listens on all addresses: nobody reaches it at 0.0.0.0.
    fn url_for_others(&self, url: String) -> String {
        let listens_everywhere = self.listen.ip().to_canonical().is_unspecified();
        match machine_name().filter(|_| listens_everywhere) {
            Some(machine) => ["0.0.0.0", "[::]"]
                .iter()
                .fold(url, |url, all| url.replacen(all, &machine, 1)),
            None => url,
        }
    }

    fn say_how_to_reach(&self, url: &str) {
        let ca = if self.certificate.is_some() {
            " --ca CA.pem"
        } else {
            ""
        };
        let machine = match (&self.client_ca, &self.tokens) {
            (Some(_), _) => " --certificate FILE --key FILE",
            (None, Some(_)) => " --token-file FILE",
            (None, None) => "",
        };
        let person = if self.tokens.is_some() {
            " --token-file FILE"
        } else {
            ""
        };
        errln!("  pages:     {url} in a browser");
        errln!("  campaigns: murmuration submit SPEC.toml --coordinator {url}{ca}{person}");
        errln!("  workers:   murmuration-worker --coordinator {url}{ca}{machine}");
        errln!("  trainers:  murmuration-trainer --coordinator {url}{ca}{machine}");
        let beyond = !self.listen.ip().to_canonical().is_loopback();
        if beyond && self.certificate.is_none() {
            errln!(
                "  warning:   connections are not encrypted: everyone on the network can read them, tokens included"
            );
        }
        if beyond && self.tokens.is_none() {
            errln!("  warning:   no tokens are required: everyone who can reach {url} is an operator");
        }
    }
}
