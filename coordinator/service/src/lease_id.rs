//! A lease as workers name it.

use murmuration_dispatch::LeaseNumber;
use murmuration_proto::{Invalid, v1};

/// The coordinator's epoch that the lease of `field` was given in, and its number.
pub(super) fn lease_id(lease: Option<v1::LeaseId>, field: &str) -> Result<(u64, LeaseNumber), Invalid> {
    let lease = lease.ok_or_else(|| Invalid::new(field, "nothing", "a lease id"))?;
    Ok((lease.epoch, LeaseNumber(lease.number)))
}
