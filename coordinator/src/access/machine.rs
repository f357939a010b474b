//! Machines, and what a certificate says that its holder is.

use rustls_pki_types::CertificateDer;
use std::fmt;
use webpki::EndEntityCert;

/// What a machine of a cluster does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Machine {
    Worker,
    Trainer,
}

impl Machine {
    const ALL: [Self; 2] = [Self::Worker, Self::Trainer];

    /// The DNS name, among the alternative names of a certificate's subject, that makes it one for such machines alone.
    pub(crate) const fn dns_name(self) -> &'static str {
        match self {
            Self::Worker => "worker.murmuration.internal",
            Self::Trainer => "trainer.murmuration.internal",
        }
    }
}

impl fmt::Display for Machine {
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
    good_for: Vec<Machine>,
}

impl Certificate {
    /// Reads what it is good for: the machines that it names; all of them if it names none.
    pub(crate) fn read(der: &CertificateDer<'_>) -> Self {
        let names_in = |certificate: &EndEntityCert<'_>| {
            let names: Vec<&str> = certificate.valid_dns_names().collect();
            let named = |machine: &Machine| names.contains(&machine.dns_name());
            Machine::ALL.into_iter().filter(named).collect::<Vec<_>>()
        };
        let good_for = match EndEntityCert::try_from(der).map(|certificate| names_in(&certificate)) {
            Ok(named) if named.is_empty() => Machine::ALL.to_vec(),
            Ok(named) => named,
            Err(error) => {
                tracing::warn!(%error, "a certificate that cannot be read is good for nothing");
                Vec::new()
            }
        };
        Self { good_for }
    }

    #[cfg(test)]
    pub(super) fn for_these(machines: &[Machine]) -> Self {
        let good_for = machines.to_vec();
        Self { good_for }
    }

    pub(super) fn is_for(&self, machine: Machine) -> bool {
        self.good_for.contains(&machine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rcgen::{CertificateParams, KeyPair};

    fn good_for(names: &[&str]) -> Vec<Machine> {
        let names: Vec<_> = names.iter().map(|&name| name.to_owned()).collect();
        let params = CertificateParams::new(names).unwrap();
        let made = params.self_signed(&KeyPair::generate().unwrap()).unwrap();
        Certificate::read(made.der()).good_for
    }

    #[test]
    fn a_certificate_is_good_for_what_it_names_and_for_all_if_it_names_nothing() {
        let (worker, trainer) = (Machine::Worker.dns_name(), Machine::Trainer.dns_name());
        assert_eq!(good_for(&[worker]), [Machine::Worker]);
        assert_eq!(good_for(&["swarm.example", trainer]), [Machine::Trainer]);
        assert_eq!(good_for(&[trainer, worker]), Machine::ALL);
        assert_eq!(good_for(&["swarm.example"]), Machine::ALL);
        assert_eq!(good_for(&[]), Machine::ALL);
        let garbage = CertificateDer::from(vec![0x30, 0x03, 1, 2, 3]);
        assert!(Certificate::read(&garbage).good_for.is_empty());
    }
}
