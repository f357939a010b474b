//! Invalid values as gRPC errors.

use crate::{Invalid, Text};
use tonic::Status;

impl From<Invalid> for Status {
    fn from(invalid: Invalid) -> Self {
        // A value from outside may be of any length.
        Self::invalid_argument(Text::line(&invalid.to_string()))
    }
}
