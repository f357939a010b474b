//! `certs`: certificates to begin with, for a cluster of one's own.

use super::{CliError, json};
use crate::access::Machine;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use serde_json::json;
use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

/// How long they are good for.
const DAYS: u32 = 365;
const DAY: Duration = Duration::from_secs(24 * 3600);
/// Names by which a coordinator is always reached from its own machine.
const OWN_NAMES: [&str; 3] = ["localhost", "127.0.0.1", "::1"];

const EXAMPLES: &str = "\
Examples:
  murmuration certs certs --host swarm.example --host 192.168.0.7

Makes ca.pem, and server.pem, worker.pem and trainer.pem with their keys beside them. Whoever has ca-key.pem can make
more: keep it away from the cluster.";

/// Arguments of `certs`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Certs {
    /// Folder for them, made if need be
    dir: PathBuf,
    /// Name or address by which others reach the coordinator; may be given again
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
}

/// A certificate and its key, as PEM.
struct Pair {
    name: &'static str,
    certificate: String,
    key: String,
}

impl Certs {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let pairs = self
            .make()
            .map_err(|error| CliError::Input(format!("cannot make certificates: {error}")))?;
        let files: Vec<(PathBuf, PathBuf)> = pairs.iter().map(|pair| self.files(pair.name)).collect();
        if let Some(there) = files.iter().flat_map(|(a, b)| [a, b]).find(|path| path.exists()) {
            return Err(CliError::Input(format!(
                "{} is there already: name another folder, or remove it",
                there.display()
            )));
        }
        fs::create_dir_all(&self.dir).map_err(|error| CliError::unwritable(&self.dir, &error))?;
        for (pair, (certificate, key)) in pairs.iter().zip(&files) {
            write(key, &pair.key, 0o600)?;
            write(certificate, &pair.certificate, 0o644)?;
        }
        if as_json {
            let names = pairs.iter().zip(&files);
            let names = names.map(|(pair, (certificate, key))| {
                json!({ "name": pair.name, "certificate": certificate, "key": key })
            });
            json::print(
                &json!({ "schema": json::SCHEMA, "days": DAYS, "certificates": names.collect::<Vec<_>>() }),
            );
        } else {
            self.say_what_next();
        }
        Ok(())
    }

    fn make(&self) -> Result<Vec<Pair>, rcgen::Error> {
        let mut params = params("Murmuration development CA", Vec::new())?;
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        let key = KeyPair::generate()?;
        let ca = Pair {
            name: "ca",
            certificate: params.self_signed(&key)?.pem(),
            key: key.serialize_pem(),
        };
        let issuer = Issuer::new(params, key);
        let names = OWN_NAMES
            .map(str::to_owned)
            .into_iter()
            .chain(self.host.iter().cloned());
        let machine = |name, machine: Machine| {
            let only = vec![machine.dns_name().to_owned()];
            signed(&issuer, name, only, ExtendedKeyUsagePurpose::ClientAuth)
        };
        Ok(vec![
            ca,
            signed(
                &issuer,
                "server",
                names.collect(),
                ExtendedKeyUsagePurpose::ServerAuth,
            )?,
            machine("worker", Machine::Worker)?,
            machine("trainer", Machine::Trainer)?,
        ])
    }

    fn files(&self, name: &str) -> (PathBuf, PathBuf) {
        (
            self.dir.join(format!("{name}.pem")),
            self.dir.join(format!("{name}-key.pem")),
        )
    }

    fn say_what_next(&self) {
        let dir = self.dir.display();
        let host = self.host.first().map_or("localhost", String::as_str);
        let there = format!("--coordinator https://{host}:7700 --ca {dir}/ca.pem");
        eprintln!(
            "made {dir}/ca.pem, server.pem, worker.pem, trainer.pem and their keys, good for {DAYS} days; next:"
        );
        eprintln!("  murmuration token me --role operator >> tokens.toml");
        eprintln!(
            "  murmuration serve --workers 0 --listen 0.0.0.0:7700 --certificate {dir}/server.pem --key \
             {dir}/server-key.pem --client-ca {dir}/ca.pem --tokens tokens.toml"
        );
        for machine in ["worker", "trainer"] {
            eprintln!(
                "  murmuration-{machine} {there} --certificate {dir}/{machine}.pem --key {dir}/{machine}-key.pem"
            );
        }
        eprintln!("  murmuration submit SPEC.toml {there} --token-file FILE");
    }
}

fn signed(
    issuer: &Issuer<'_, KeyPair>,
    name: &'static str,
    hosts: Vec<String>,
    usage: ExtendedKeyUsagePurpose,
) -> Result<Pair, rcgen::Error> {
    let mut params = params(&format!("Murmuration {name}"), hosts)?;
    params.use_authority_key_identifier_extension = true;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![usage];
    let key = KeyPair::generate()?;
    Ok(Pair {
        name,
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

/// Writes a new file with these permissions.
fn write(path: &Path, text: &str, mode: u32) -> Result<(), CliError> {
    let mut options = fs::File::options();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, mode);
    let written = options
        .open(path)
        .and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|error| CliError::unwritable(path, &error))
}
