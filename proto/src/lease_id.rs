//! Ids that connect the logs of several processes: of leases and of requests.

use crate::v1;
use std::fmt;

/// The header with a request's id, in requests and answers, in gRPC and plain HTTP.
///
/// The client may choose the id. A worker or trainer that makes a request for a lease uses the lease's id.
pub const REQUEST_ID: &str = "x-request-id";

/// `EPOCH-NUMBER`.
impl fmt::Display for v1::LeaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.epoch, self.number)
    }
}
