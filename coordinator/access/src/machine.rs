//! Machines: which kind of machine a certificate is for, and which machine is at the other end of a connection.

use crate::connections::ConnectionHandle;
use murmuration_model::{MachineId, Origin};
use rustls_pki_types::CertificateDer;
use std::{fmt, net::IpAddr};
use tonic::{Extensions, transport::server::TlsConnectInfo};
use webpki::EndEntityCert;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineKind {
    /// A machine that simulates and embeds.
    Worker,
    Trainer,
}

impl MachineKind {
    pub const ALL: [Self; 2] = [Self::Worker, Self::Trainer];

    /// The DNS name that restricts a certificate to this kind of machine. The certificate must have the name among the
    /// alternative names of its subject.
    #[must_use]
    pub const fn dns_name(self) -> &'static str {
        match self {
            Self::Worker => "worker.murmuration.internal",
            Self::Trainer => "trainer.murmuration.internal",
        }
    }
}

impl fmt::Display for MachineKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Worker => "worker",
            Self::Trainer => "trainer",
        })
    }
}

/// A certificate that the TLS library has checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Certificate {
    good_for: Vec<MachineKind>,
}

impl Certificate {
    /// Reads the kinds of machine that the certificate is for: the kinds that it names, or all kinds if it names no kind.
    pub(crate) fn read(der: &CertificateDer<'_>) -> Self {
        let names_in = |certificate: &EndEntityCert<'_>| {
            let names: Vec<&str> = certificate.valid_dns_names().collect();
            let named = |machine: &MachineKind| names.contains(&machine.dns_name());
            MachineKind::ALL.into_iter().filter(named).collect::<Vec<_>>()
        };
        let good_for = match EndEntityCert::try_from(der).map(|certificate| names_in(&certificate)) {
            Ok(named) if named.is_empty() => MachineKind::ALL.to_vec(),
            Ok(named) => named,
            Err(error) => {
                tracing::warn!(%error, "a certificate cannot be read and is not accepted for any machine");
                Vec::new()
            }
        };
        Self { good_for }
    }

    #[cfg(test)]
    pub(super) fn for_these(machines: &[MachineKind]) -> Self {
        let good_for = machines.to_vec();
        Self { good_for }
    }

    pub(crate) fn is_for(&self, machine: MachineKind) -> bool {
        self.good_for.contains(&machine)
    }
}

/// The machine and address that a request comes from, by its connection; `None` without a connection.
pub fn origin(request: &Extensions) -> Option<Origin> {
    let address = request.get::<ConnectionHandle>()?.peer();
    let chain = request
        .get::<TlsConnectInfo<ConnectionHandle>>()
        .and_then(TlsConnectInfo::peer_certs);
    let certificate = chain.as_ref().and_then(|chain| chain.first());
    Some(Origin {
        machine: machine_of(certificate, address),
        address,
    })
}

/// The machine that a request's certificate identifies. Requests with a certificate have this extension, unless they also have an
/// operator's token.
#[derive(Debug, Clone, Copy)]
pub struct ByCertificate(pub MachineId);

impl ByCertificate {
    pub(crate) fn of(request: &Extensions) -> Option<Self> {
        let connection = request.get::<TlsConnectInfo<ConnectionHandle>>()?;
        connection.peer_certs()?;
        Some(Self(origin(request)?.machine))
    }
}

/// The machine with `certificate`, which the TLS library has checked; without a certificate, the machine at `address`.
fn machine_of(certificate: Option<&CertificateDer<'_>>, address: IpAddr) -> MachineId {
    let key = certificate.map(|certificate| match EndEntityCert::try_from(certificate) {
        // A certificate that is renewed for the same key belongs to the same machine.
        Ok(read) => read.subject_public_key_info().to_vec(),
        Err(_) => certificate.to_vec(),
    });
    match (key, address) {
        (Some(key), _) => digest("certificate", &key),
        (None, IpAddr::V4(address)) => digest("address", &address.octets()),
        (None, IpAddr::V6(address)) => digest("address", &address.octets()),
    }
}

fn digest(kind: &str, bytes: &[u8]) -> MachineId {
    let mut hasher = blake3::Hasher::new_derive_key(&format!("murmuration machine by its {kind}"));
    let hash = hasher.update(bytes).finalize();
    let first = hash.as_bytes().first_chunk().copied().unwrap_or_default();
    // 0 means no machine.
    MachineId(u64::from_le_bytes(first) | 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rcgen::{CertificateParams, KeyPair};

    fn good_for(names: &[&str]) -> Vec<MachineKind> {
        let names: Vec<_> = names.iter().map(|&name| name.to_owned()).collect();
        let params = CertificateParams::new(names).unwrap();
        let made = params.self_signed(&KeyPair::generate().unwrap()).unwrap();
        Certificate::read(made.der()).good_for
    }

    #[test]
    fn a_certificate_is_good_for_what_it_names_and_for_all_if_it_names_nothing() {
        let (worker, trainer) = (MachineKind::Worker.dns_name(), MachineKind::Trainer.dns_name());
        assert_eq!(good_for(&[worker]), [MachineKind::Worker]);
        assert_eq!(good_for(&["swarm.example", trainer]), [MachineKind::Trainer]);
        assert_eq!(good_for(&[trainer, worker]), MachineKind::ALL);
        assert_eq!(good_for(&["swarm.example"]), MachineKind::ALL);
        assert_eq!(good_for(&[]), MachineKind::ALL);
        let garbage = CertificateDer::from(vec![0x30, 0x03, 1, 2, 3]);
        assert!(Certificate::read(&garbage).good_for.is_empty());
    }

    #[test]
    fn a_machine_is_its_key_and_without_one_its_address() {
        let signed = |key: &KeyPair| {
            let params = CertificateParams::new(Vec::new()).unwrap();
            params.self_signed(key).unwrap().der().clone()
        };
        let (key, other) = (KeyPair::generate().unwrap(), KeyPair::generate().unwrap());
        let by_key = |key, address: &str| machine_of(Some(&signed(key)), address.parse().unwrap());
        let by_address = |address: &str| machine_of(None, address.parse().unwrap());
        // A renewed certificate of the same key gives the same machine, from any address.
        assert_eq!(by_key(&key, "10.0.0.1"), by_key(&key, "10.0.0.2"));
        assert_ne!(by_key(&key, "10.0.0.1"), by_key(&other, "10.0.0.1"));
        assert_eq!(by_address("10.0.0.1"), by_address("10.0.0.1"));
        let all = ["10.0.0.1", "10.0.0.2", "::1", "2001:db8::1"].map(by_address);
        let distinct: std::collections::BTreeSet<_> = all.into_iter().collect();
        assert_eq!(distinct.len(), 4);
        assert_ne!(by_key(&key, "10.0.0.1"), by_address("10.0.0.1"));
    }
}
