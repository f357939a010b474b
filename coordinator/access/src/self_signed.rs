//! The certificate that a coordinator makes for itself. Its clients know the certificate by its fingerprint in the access file.

use crate::{Tls, TlsError};
use murmuration_files::{InputKind, NewFile, read_text};
use murmuration_store::StoreError;
use rcgen::{CertificateParams, DnType, KeyPair};
use std::{
    io::{self, Write as _},
    path::Path,
};

/// Name of the file of the certificate and its key in the data directory.
const FILE: &str = "self-signed.pem";
const NAME: &str = "Murmuration coordinator";
/// A name that no host has: gRPC's libraries compare the name in a certificate with one that their user gives.
const HOST: &str = "coordinator.murmuration.internal";

/// The certificate of a data directory, which is made at its first use and stays the same, so that browsers need to accept it
/// only once.
///
/// # Errors
/// If the file cannot be read or written, or is not a certificate with its key.
pub fn self_signed(data: &Path) -> Result<Tls, TlsError> {
    let path = data.join(FILE);
    let pem = match read_text(&path, InputKind::Pem) {
        Ok(pem) => pem,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let made = make().and_then(|pem| write(&path, &pem).map(|()| pem));
            made.map_err(|error| StoreError::from_io(error, "write", &path))?
        }
        Err(error) => return Err(StoreError::from_io(error, "read", &path).into()),
    };
    Ok(Tls::of(&path, &pem, &pem, None)?.made_with(HOST))
}

/// A certificate and its key, in PEM format.
fn make() -> io::Result<String> {
    let key = KeyPair::generate().map_err(io::Error::other)?;
    let mut params = CertificateParams::new([HOST.to_owned()]).map_err(io::Error::other)?;
    params.distinguished_name.push(DnType::CommonName, NAME);
    let certificate = params.self_signed(&key).map_err(io::Error::other)?;
    Ok(certificate.pem() + &key.serialize_pem())
}

fn write(path: &Path, pem: &str) -> io::Result<()> {
    let mut file = NewFile::create_secret(path)?;
    file.write_all(pem.as_bytes())?;
    file.finish().map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{fs, os::unix::fs::PermissionsExt as _};

    #[test]
    fn it_stays_the_same_and_its_owner_alone_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        let first = self_signed(folder.path()).unwrap().fingerprint();
        assert_eq!(self_signed(folder.path()).unwrap().fingerprint(), first);
        let path = folder.path().join(FILE);
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        let elsewhere = tempfile::tempdir().unwrap();
        assert_ne!(self_signed(elsewhere.path()).unwrap().fingerprint(), first);
        fs::write(&path, "somebody's notes").unwrap();
        let error = self_signed(folder.path()).unwrap_err().to_string();
        assert!(error.contains(FILE), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "somebody's notes");
    }
}
