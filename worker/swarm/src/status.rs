//! Errors about input as gRPC statuses, with `google.rpc` details for programs: `BadRequest` has the field and the allowed
//! values; `ErrorInfo` has the value.

use crate::{Invalid, SpecFileError, Text, TomlError};
use std::collections::HashMap;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

/// Domain of every `ErrorInfo`.
const DOMAIN: &str = "murmuration.v1";
/// Maximum number of bytes of details: clients refuse an answer whose headers have more than 8 to 16 KiB.
const MAX_DETAILS_BYTES: usize = 4 << 10;

impl From<SpecFileError> for Status {
    fn from(error: SpecFileError) -> Self {
        match error {
            SpecFileError::Value(invalid) => invalid.into(),
            SpecFileError::Syntax(error) => error.into(),
        }
    }
}

impl From<TomlError> for Status {
    fn from(error: TomlError) -> Self {
        // The message includes the line of the file.
        let message = error.to_string();
        invalid_argument(
            message,
            "INVALID_FILE",
            error.field(),
            error.value(),
            error.allowed(),
        )
    }
}

impl From<Invalid> for Status {
    fn from(invalid: Invalid) -> Self {
        // A value from outside may have any length.
        let message = Text::line(&invalid.to_string()).into();
        let Invalid {
            field,
            value,
            allowed,
        } = invalid;
        invalid_argument(message, "INVALID_VALUE", &field, value.as_deref(), Some(&allowed))
    }
}

fn invalid_argument(
    message: String,
    reason: &str,
    field: &str,
    value: Option<&str>,
    allowed: Option<&str>,
) -> Status {
    let mut details = ErrorDetails::new();
    if !field.is_empty() {
        details.add_bad_request_violation(field, allowed.unwrap_or_default());
    }
    let metadata = value.map(|value| ("value".to_owned(), value.to_owned()));
    details.set_error_info(reason, DOMAIN, metadata.into_iter().collect::<HashMap<_, _>>());
    let status = Status::with_error_details(Code::InvalidArgument, message.clone(), details);
    match status.details().len() {
        ..=MAX_DETAILS_BYTES => status,
        _ => Status::invalid_argument(message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CampaignSpec;

    /// Field, allowed values and value in the details.
    #[track_caller]
    fn detailed(status: &Status) -> (String, String, Option<String>) {
        let details = status.get_error_details();
        let violation = details.bad_request().unwrap().field_violations[0].clone();
        let info = details.error_info().unwrap();
        assert_eq!(info.domain, DOMAIN);
        (
            violation.field,
            violation.description,
            info.metadata.get("value").cloned(),
        )
    }

    #[track_caller]
    fn check(rest: &str, field: &str, allowed: &str, value: Option<&str>) {
        let text = format!("model = \"single-sensor\"\nmethod = \"latent\"\n[search]\n{rest}");
        let status = Status::from(CampaignSpec::from_toml(&text).unwrap_err());
        assert_eq!(
            detailed(&status),
            (field.to_owned(), allowed.to_owned(), value.map(str::to_owned))
        );
    }

    #[test]
    fn the_details_name_the_field_the_value_and_what_is_allowed() {
        check(
            "mutation = 1.5",
            "search.mutation",
            "a number from 0 to 1",
            Some("1.5"),
        );
        check(
            "population = true",
            "search.population",
            "a whole number, 0 or more",
            Some("true"),
        );
        check("populaton = 5", "search.populaton", "", None);
    }

    #[test]
    fn details_that_are_too_long_for_a_header_are_left_out() {
        let long = Invalid::new("field", "value", "x".repeat(1_900));
        let status = Status::from(long);
        assert_eq!(detailed(&status).1.len(), 1_900);
        let longer = Invalid::new("field", "value", "é".repeat(1_900));
        let status = Status::from(longer);
        assert!(status.details().is_empty() && status.message().starts_with("field = value: must be é"));
    }
}
