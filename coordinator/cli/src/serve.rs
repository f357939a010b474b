//! `serve`: a coordinator that runs until it is stopped.

use super::{
    CliError, Global,
    contact::Contact,
    link::page_link,
    quoted,
    run::{InProcessArgs, hold_within},
};
use clap::builder::BoolishValueParser;
use murmuration_access::{ClassSeats, ListenConfig, PublicUrl, Tls, Tokens};
use murmuration_coordinator::{
    local::LocalCluster,
    server::{MirrorOptions, Options, Publication},
};
use murmuration_dispatch as dispatch;
use murmuration_dispatch::Share;
use murmuration_link::{AccessFile, access_file_of, errln, termination};
use std::{
    io::{self, IsTerminal as _},
    net::{Ipv4Addr, SocketAddr, ToSocketAddrs as _},
    path::{self, PathBuf},
    time::Duration,
};

/// Advice if another process holds the data directory.
const ONE_COORDINATOR: &str =
    "only one coordinator can use a data directory: stop that process first, or name another --data DIR";

/// Longest wait for a short command that holds the data directory.
const HOLD_WAIT: Duration = Duration::from_secs(3);
/// Default port of coordinators.
const PORT: u16 = 7700;

#[derive(Debug, clap::Args)]
pub struct Serve {
    /// Address or name to listen on, with a port; the default accepts connections from this machine only. For other machines, such
    /// as at 0.0.0.0:7700 or :7700, connections are encrypted, and the access file has what clients need
    #[arg(
        long,
        env = "MURMURATION_LISTEN",
        default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, PORT)),
        value_name = "ADDRESS",
        value_parser = listen_address
    )]
    listen: SocketAddr,
    /// URL at which a proxy serves the pages, such as https://hub.example/user/ana/proxy/7700 of JupyterHub
    #[arg(long, env = "MURMURATION_PUBLIC_URL", value_name = "URL")]
    public_url: Option<PublicUrl>,
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
    /// Encrypt nothing without --certificate, and require no token without --tokens: everyone who can reach the coordinator may
    /// do everything, on this machine too
    #[arg(
        long,
        env = "MURMURATION_INSECURE_LISTEN",
        value_parser = BoolishValueParser::new()
    )]
    insecure_listen: bool,
    /// Name or address by which other machines reach this machine, for the access file [default: the address of --listen or, for
    /// 0.0.0.0, the name of this machine]
    #[arg(long, env = "MURMURATION_CONTACT", value_name = "HOST")]
    contact: Option<Contact>,
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
    /// Keep a copy of all data in this folder or bucket (s3://BUCKET/PREFIX), from which a coordinator on another machine can go on
    #[arg(long, env = "MURMURATION_MIRROR", value_name = "DIR|URL")]
    mirror: Option<String>,
    /// Go on from the copy of --mirror, in a new data directory; the coordinator that wrote the copy can change nothing more
    #[arg(long, env = "MURMURATION_FROM_MIRROR", value_parser = BoolishValueParser::new(), requires = "mirror")]
    from_mirror: bool,
    #[command(flatten)]
    in_process: InProcessArgs,
}

/// The address of `HOST:PORT`, where HOST is an address, a name of this machine, or nothing for all addresses.
fn listen_address(text: &str) -> Result<SocketAddr, String> {
    let Some((host, port)) = text.rsplit_once(':') else {
        return Err("it has no port: such as 127.0.0.1:7700".to_owned());
    };
    if port.parse::<u16>().is_err() {
        return Err(format!("\"{port}\" is no port: such as 127.0.0.1:7700"));
    }
    let place = match host {
        "" | "*" => format!("{}:{port}", Ipv4Addr::UNSPECIFIED),
        _ => text.to_owned(),
    };
    let mut addresses: Vec<SocketAddr> = place
        .to_socket_addrs()
        .map_err(|error| error.to_string())?
        .collect();
    // `localhost` can be both; clients try 127.0.0.1 first.
    addresses.sort_by_key(SocketAddr::is_ipv6);
    addresses
        .first()
        .copied()
        .ok_or_else(|| format!("\"{host}\" has no address"))
}

impl Serve {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        // As the first process of a container, a process without handlers ignores these signals.
        let ended = termination();
        tokio::pin!(ended);
        let cluster = tokio::select! {
            biased;
            signal = &mut ended => {
                errln!("{signal}; the coordinator had not started yet");
                return Ok(());
            }
            cluster = self.start(global) => cluster?,
        };
        if let Some(access) = cluster.coordinator().published() {
            errln!("serving {} at {}", global.data.display(), access.pages);
            self.say_how_to_reach(global, access)?;
        }
        let taken_over = tokio::select! {
            signal = &mut ended => {
                errln!("{signal}; the next `murmuration serve` continues the running campaigns");
                None
            }
            taken_over = cluster.coordinator().taken_over() => Some(taken_over),
        };
        cluster.shutdown().await?;
        taken_over.map_or(Ok(()), |taken_over| Err(taken_over.into()))
    }

    async fn start(&self, global: &Global) -> Result<LocalCluster, CliError> {
        let listen = self.listen_config()?;
        let data = hold_within(HOLD_WAIT, &global.data)
            .await
            .map_err(|error| CliError::busy(error, ONE_COORDINATOR))?;
        let options = Options {
            reads_only: None,
            data,
            listen,
            resume: true,
            checkpoints: global.checkpoint_store.clone(),
            tries_checkpoints: true,
            dispatch: dispatch::Options {
                audited: self.audit,
                ..dispatch::Options::default()
            },
            mirror: self.mirror.clone().map(|location| MirrorOptions {
                location,
                from_mirror: self.from_mirror,
            }),
            publication: Some(Publication {
                file: global.trust.access.clone(),
                contact: self.contact.clone().map(String::from),
            }),
        };
        Ok(LocalCluster::start(options, self.in_process.count()?).await?)
    }

    fn listen_config(&self) -> Result<ListenConfig, CliError> {
        let tls = match (&self.certificate, &self.key) {
            (Some(certificate), Some(key)) => Some(Tls::read(certificate, key, self.client_ca.as_deref())?),
            _ => None,
        };
        let tokens = self.tokens.as_deref().map(Tokens::read).transpose()?;
        let listen = match self.insecure_listen {
            true => ListenConfig::trusting(self.listen, tls, tokens),
            false => ListenConfig::new(self.listen, tls, tokens),
        };
        Ok(listen
            .with_seats(&self.seats)
            .with_public_url(self.public_url.clone()))
    }

    fn say_how_to_reach(&self, global: &Global, access: &AccessFile) -> Result<(), CliError> {
        let by = match access.is_for_other_machines() {
            true => {
                let named = global.trust.access.clone();
                let file = named.unwrap_or_else(|| access_file_of(&global.data));
                let file = path::absolute(&file).unwrap_or(file);
                format!(" --access {}", quoted(&file.display().to_string()))
            }
            false => global.place(),
        };
        let identity = match &self.client_ca {
            Some(_) => " --certificate FILE --key FILE",
            None => "",
        };
        let another = global.next("link");
        match &access.token {
            // A link would stay in the log of a service manager.
            Some(_) if io::stderr().is_terminal() => errln!(
                "  pages:     {} in a browser, once; `{another}` prints another link",
                page_link(access)?
            ),
            Some(_) => errln!("  pages:     {}, by a link that `{another}` prints", access.pages),
            None => errln!("  pages:     {} in a browser", access.pages),
        }
        errln!("  campaigns: murmuration submit SPEC.toml{by}");
        errln!("  workers:   murmuration-worker{by}{identity}");
        errln!("  trainers:  murmuration-trainer{by}{identity}");
        if self.certificate.is_none()
            && let Some(fingerprint) = access.fingerprint.filter(|_| access.pages == access.coordinator)
        {
            errln!(
                "  browsers will not know the coordinator's certificate, which has the fingerprint {fingerprint}"
            );
        }
        if self.insecure_listen && self.certificate.is_none() {
            errln!(
                "  warning:   connections are not encrypted: everyone on the network can read them, tokens included"
            );
        }
        if self.insecure_listen && self.tokens.is_none() {
            errln!(
                "  warning:   no tokens are required: everyone who can reach {} is an operator",
                access.pages
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_all_addresses_can_be_listened_on() {
        let check =
            |text, expected: &str| assert_eq!(listen_address(text), Ok(expected.parse().unwrap()), "{text}");
        check("127.0.0.1:7762", "127.0.0.1:7762");
        check("localhost:7762", "127.0.0.1:7762");
        check(":7762", "0.0.0.0:7762");
        check("[::1]:7762", "[::1]:7762");
        for refused in [
            "7762",
            "localhost",
            "localhost:",
            "localhost:99999",
            "no such name:1",
        ] {
            assert!(listen_address(refused).is_err(), "{refused}");
        }
    }
}
