//! Names by which logs of several processes speak of the same thing: a lease, a request.

use crate::v1;
use std::fmt;

/// The header under which a request's id travels, in gRPC and in plain HTTP, there and back.
///
/// Whoever asks may choose it; a worker or trainer that asks on behalf of a lease takes the lease's.
pub const REQUEST_ID: &str = "x-request-id";

/// `EPOCH-NUMBER`.
impl fmt::Display for v1::LeaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.epoch, self.number)
    }
}
