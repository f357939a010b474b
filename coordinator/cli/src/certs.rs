//! `certs`: certificates for a first cluster of one's own.

use super::{
    CliError,
    files::{is_there, read, read_words},
    json,
};
use murmuration_access::MachineKind;
use murmuration_files::InputKind;
use murmuration_link::errln;
use murmuration_swarm::Invalid;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use rustls_pki_types::{CertificateDer, ServerName, pem::PemObject as _};
use std::{
    collections::BTreeSet,
    fs,
    io::{self, Write as _},
    net::IpAddr,
    path::{Path, PathBuf},
    str::FromStr,
    time::{Duration, SystemTime},
};
use webpki::EndEntityCert;

/// Validity of the certificates, days.
const DAYS: u32 = 365;
const DAY: Duration = Duration::from_secs(24 * 3600);
/// Names by which a coordinator can always be reached from its own machine.
const OWN_NAMES: [&str; 3] = ["localhost", "127.0.0.1", "::1"];
/// Common name of the CA.
const CA_NAME: &str = "Murmuration development CA";
/// The certificates that the command always creates with a new CA.
const OWN_FILES: [&str; 3] = ["ca", "server", "trainer"];

const EXAMPLES: &str = "\
Examples:
  murmuration certs certs --host swarm.example --host 192.168.0.7
  murmuration certs certs --host swarm.example --worker alpha --worker beta
  murmuration certs certs --worker gamma   add a certificate by the CA of an earlier call

The command writes the certificates ca.pem, server.pem, worker.pem and trainer.pem, and their keys. With --worker, it writes \
one certificate for each name instead of worker.pem. A certificate stands for a machine: workers that share a certificate \
count as one machine and do not audit each other. Everyone who has ca-key.pem can create certificates: keep it away from the \
cluster.";

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Certs {
    /// Folder for the certificates, created if it does not exist
    dir: PathBuf,
    /// Host name or address of the coordinator; repeat the option for several
    #[arg(long, value_name = "NAME")]
    host: Vec<Host>,
    /// Name of a worker's machine, which gets its own certificate; repeat the option for several
    #[arg(long, value_name = "NAME")]
    worker: Vec<MachineName>,
}

/// The name of a machine's certificate files.
#[derive(Debug, Clone, PartialEq, Eq)]
struct MachineName(String);

impl FromStr for MachineName {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let may_be_in_one = |letter: u8| letter.is_ascii_alphanumeric() || b"-_.".contains(&letter);
        let is_one = text
            .bytes()
            .next()
            .is_some_and(|first| first.is_ascii_alphanumeric())
            && text.len() <= 64
            && text.bytes().all(may_be_in_one)
            && !OWN_FILES.contains(&text);
        match is_one {
            true => Ok(Self(text.to_owned())),
            false => Err(Invalid::new(
                "worker",
                text,
                "1 to 64 letters, digits, '-', '_' and '.', beginning with a letter or digit, and another name than \
                 ca, server and trainer",
            )),
        }
    }
}

/// A host that a certificate can name: an address, or a DNS name, which can begin with the wildcard `*.`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Host(String);

/// Why a text is not a [`Host`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum HostError {
    #[error(
        "must be a DNS name in ASCII such as swarm.example, or an address such as 192.168.0.7, without scheme, port or \
         brackets"
    )]
    NoHost,
    #[error("must be another name: this one marks the certificate of a {0}")]
    Reserved(MachineKind),
}

impl FromStr for Host {
    type Err = HostError;

    fn from_str(text: &str) -> Result<Self, HostError> {
        let machine = MachineKind::ALL.into_iter();
        if let Some(machine) = machine
            .into_iter()
            .find(|machine| machine.dns_name().eq_ignore_ascii_case(text))
        {
            return Err(HostError::Reserved(machine));
        }
        let name = text.strip_prefix("*.").unwrap_or(text);
        let is_address = name.parse::<IpAddr>().is_ok();
        let fits = match ServerName::try_from(name) {
            // A wildcard stands for names within a domain, and names in certificates do not end with a dot.
            Ok(ServerName::DnsName(_)) => !name.ends_with('.') && (name == text || name.contains('.')),
            Ok(_) => is_address && name == text,
            Err(_) => false,
        };
        match fits {
            true => Ok(Self(text.to_owned())),
            false => Err(HostError::NoHost),
        }
    }
}

impl Host {
    pub(super) fn is_wildcard(&self) -> bool {
        self.0.starts_with("*.")
    }

    /// The host in the form for a URL.
    pub(super) fn in_url(&self) -> String {
        match self.0.parse() {
            Ok(IpAddr::V6(address)) => format!("[{address}]"),
            _ => self.0.clone(),
        }
    }
}

/// A certificate and its key, as PEM.
struct Pair {
    name: String,
    certificate: String,
    key: String,
}

impl Certs {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let (ca, ca_key) = self.files("ca");
        let adds = !self.worker.is_empty() && is_there(&ca)? && is_there(&ca_key)?;
        let pairs = match adds {
            true => self.add(&ca, &ca_key)?,
            false => self.make().map_err(|error| cannot(&error))?,
        };
        let files: Vec<(PathBuf, PathBuf)> = pairs.iter().map(|pair| self.files(&pair.name)).collect();
        for path in files.iter().flat_map(|(certificate, key)| [certificate, key]) {
            if is_there(path)? {
                let message = format!(
                    "{} exists already: name another folder, or remove the file",
                    path.display()
                );
                return Err(CliError::Input(message));
            }
        }
        fs::create_dir_all(&self.dir).map_err(|error| CliError::unwritable(&self.dir, &error))?;
        let contents = pairs
            .iter()
            .flat_map(|pair| [(&pair.certificate, 0o644), (&pair.key, 0o600)]);
        let paths = files.iter().flat_map(|(certificate, key)| [certificate, key]);
        let mut written = Vec::new();
        for (path, (content, mode)) in paths.zip(contents) {
            if let Err(error) = write(path, content, mode) {
                // An incomplete set of files would make the next call fail. The next call reports files that this call cannot
                // remove.
                written
                    .into_iter()
                    .for_each(|path: &PathBuf| drop(fs::remove_file(path)));
                return Err(error);
            }
            written.push(path);
        }
        if as_json {
            let certificates = pairs.iter().zip(&files);
            let certificates = certificates.map(|(pair, (certificate, key))| json::Certificate {
                name: pair.name.clone(),
                certificate: certificate.display().to_string(),
                key: key.display().to_string(),
            });
            json::print(json::Certificates {
                days: DAYS,
                certificates: certificates.collect(),
            })?;
        } else if adds {
            self.say_what_was_added();
        } else {
            self.say_what_next();
        }
        Ok(())
    }

    /// Creates certificates for workers only, signed by the existing CA.
    fn add(&self, ca: &Path, ca_key: &Path) -> Result<Vec<Pair>, CliError> {
        if !self.host.is_empty() {
            return Err(CliError::Input(format!(
                "{} exists already, and --worker adds to it: leave out --host, or name another folder",
                ca.display()
            )));
        }
        let other = || {
            CliError::Input(format!(
                "{} and its key were not created by `murmuration certs`: let your own CA sign a certificate for each worker",
                ca.display()
            ))
        };
        let certificate = CertificateDer::from_pem_slice(&read(ca, InputKind::Pem)?).map_err(|_| other())?;
        let key = read_words(ca_key, InputKind::Pem)?;
        let key = KeyPair::from_pem(&key).map_err(|_| other())?;
        let params = ca_params().map_err(|error| cannot(&error))?;
        let same = params.self_signed(&key).map_err(|error| cannot(&error))?;
        match (
            EndEntityCert::try_from(&certificate),
            EndEntityCert::try_from(same.der()),
        ) {
            (Ok(ca), Ok(same))
                if ca.subject() == same.subject()
                    && ca.subject_public_key_info() == same.subject_public_key_info() => {}
            _ => return Err(other()),
        }
        self.workers(&Issuer::new(params, key))
            .map_err(|error| cannot(&error))
    }

    /// Creates one certificate for each named machine or, without names, one certificate for all workers.
    fn workers(&self, issuer: &Issuer<'_, KeyPair>) -> Result<Vec<Pair>, rcgen::Error> {
        let names = self.worker_names().into_iter();
        names
            .map(|name| machine(issuer, name, MachineKind::Worker))
            .collect()
    }

    fn worker_names(&self) -> BTreeSet<&str> {
        match self.worker.is_empty() {
            true => BTreeSet::from(["worker"]),
            false => self.worker.iter().map(|name| name.0.as_str()).collect(),
        }
    }

    fn make(&self) -> Result<Vec<Pair>, rcgen::Error> {
        let params = ca_params()?;
        let key = KeyPair::generate()?;
        let ca = Pair {
            name: "ca".to_owned(),
            certificate: params.self_signed(&key)?.pem(),
            key: key.serialize_pem(),
        };
        let issuer = Issuer::new(params, key);
        let names = OWN_NAMES
            .map(str::to_owned)
            .into_iter()
            .chain(self.host.iter().map(|Host(name)| name.clone()));
        let server = signed(
            &issuer,
            "server",
            names.collect(),
            ExtendedKeyUsagePurpose::ServerAuth,
        )?;
        let mut pairs = vec![ca, server];
        pairs.extend(self.workers(&issuer)?);
        pairs.push(machine(&issuer, "trainer", MachineKind::Trainer)?);
        Ok(pairs)
    }

    fn files(&self, name: &str) -> (PathBuf, PathBuf) {
        (
            self.dir.join(format!("{name}.pem")),
            self.dir.join(format!("{name}-key.pem")),
        )
    }

    fn say_what_was_added(&self) {
        let dir = self.dir.display();
        for name in self.worker_names() {
            errln!("wrote {dir}/{name}.pem and its key, valid for {DAYS} days, for a worker on one machine");
        }
    }

    fn say_what_next(&self) {
        let dir = self.dir.display();
        let host = self
            .host
            .first()
            .map_or_else(|| "localhost".to_owned(), Host::in_url);
        let there = format!("--coordinator https://{host}:7700 --ca {dir}/ca.pem");
        let workers: Vec<_> = self.worker_names().into_iter().collect();
        errln!(
            "wrote {dir}/ca.pem, server.pem, {}.pem, trainer.pem and their keys, valid for {DAYS} days; next:",
            workers.join(".pem, ")
        );
        errln!("  murmuration token me --role operator >> tokens.toml");
        errln!(
            "  murmuration serve --workers 0 --listen 0.0.0.0:7700 --certificate {dir}/server.pem --key \
             {dir}/server-key.pem --client-ca {dir}/ca.pem --tokens tokens.toml"
        );
        let workers = workers.iter().map(|name| ("worker", *name));
        for (machine, name) in workers.chain([("trainer", "trainer")]) {
            errln!(
                "  murmuration-{machine} {there} --certificate {dir}/{name}.pem --key {dir}/{name}-key.pem"
            );
        }
        errln!("  murmuration submit SPEC.toml {there} --token-file FILE");
    }
}

fn cannot(error: &rcgen::Error) -> CliError {
    CliError::Input(format!("certificates cannot be created: {error}"))
}

fn ca_params() -> Result<CertificateParams, rcgen::Error> {
    let mut params = params(CA_NAME, Vec::new())?;
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    Ok(params)
}

fn machine(issuer: &Issuer<'_, KeyPair>, name: &str, machine: MachineKind) -> Result<Pair, rcgen::Error> {
    let only = vec![machine.dns_name().to_owned()];
    signed(issuer, name, only, ExtendedKeyUsagePurpose::ClientAuth)
}

fn signed(
    issuer: &Issuer<'_, KeyPair>,
    name: &str,
    hosts: Vec<String>,
    usage: ExtendedKeyUsagePurpose,
) -> Result<Pair, rcgen::Error> {
    let mut params = params(&format!("Murmuration {name}"), hosts)?;
    params.use_authority_key_identifier_extension = true;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![usage];
    let key = KeyPair::generate()?;
    Ok(Pair {
        name: name.to_owned(),
        certificate: params.signed_by(&key, issuer)?.pem(),
        key: key.serialize_pem(),
    })
}

fn params(name: &str, hosts: Vec<String>) -> Result<CertificateParams, rcgen::Error> {
    let mut params = CertificateParams::new(hosts)?;
    params.distinguished_name.push(DnType::CommonName, name);
    // Clocks of machines differ.
    params.not_before = (SystemTime::now() - DAY).into();
    params.not_after = (SystemTime::now() + DAY * DAYS).into();
    Ok(params)
}

fn write(path: &Path, text: &str, mode: u32) -> Result<(), CliError> {
    let mut options = fs::File::options();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, mode);
    let unwritable = |error: io::Error| CliError::unwritable(path, &error);
    let mut file = options.open(path).map_err(unwritable)?;
    let written = file.write_all(text.as_bytes()).and_then(|()| file.sync_all());
    written.map_err(|error| {
        // An incomplete file would make the next call fail.
        let _ = fs::remove_file(path);
        unwritable(error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_is_a_name_or_an_address() {
        for host in [
            "swarm.example",
            "coordinator",
            "*.swarm.example",
            "xn--schwrme-5wa.example",
            "192.168.0.7",
            "::1",
            "fd00::7",
        ] {
            assert_eq!(host.parse(), Ok(Host(host.to_owned())));
        }
        let long = format!("{}.example", "x".repeat(64));
        for host in [
            "",
            " ",
            "*",
            "*.",
            "*.example",
            "a.*.example",
            "*.192.168.0.7",
            "a b",
            "swarm.example.",
            "swarm..example",
            "-swarm.example",
            "schw\u{e4}rme.example",
            "192.168.0.999",
            "192.168.0.7:7700",
            "[::1]",
            "https://swarm.example",
            "swarm.example:7700",
            "swarm.example/x",
            "evil.example\0",
            &long,
        ] {
            assert_eq!(host.parse::<Host>(), Err(HostError::NoHost), "{host:?}");
        }
        let reserved = "Worker.murmuration.internal".parse::<Host>();
        assert_eq!(reserved, Err(HostError::Reserved(MachineKind::Worker)));
        let in_url = |host: &str| host.parse::<Host>().unwrap().in_url();
        assert_eq!(
            (in_url("fd00::7"), in_url("a.example")),
            ("[fd00::7]".to_owned(), "a.example".to_owned())
        );
    }
}
