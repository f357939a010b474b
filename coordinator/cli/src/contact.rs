//! The name of this machine for other machines, as a user gives it.

use super::certs::{Host, HostError};
use std::str::FromStr;

/// A host name or address, as in a URL: an IPv6 address has brackets.
#[derive(Debug, Clone)]
pub struct Contact(String);

impl FromStr for Contact {
    type Err = HostError;

    fn from_str(text: &str) -> Result<Self, HostError> {
        let host: Host = text.parse()?;
        match host.is_wildcard() {
            true => Err(HostError::NoHost),
            false => Ok(Self(host.in_url())),
        }
    }
}

impl From<Contact> for String {
    fn from(contact: Contact) -> Self {
        contact.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_is_one_host() {
        for (text, host) in [
            ("node-7.cluster", "node-7.cluster"),
            ("10.0.0.7", "10.0.0.7"),
            ("2001:db8::1", "[2001:db8::1]"),
        ] {
            assert_eq!(String::from(text.parse::<Contact>().unwrap()), host);
        }
        for wrong in ["", "*.cluster", "node:7700", "http://node", "a b"] {
            assert!(wrong.parse::<Contact>().is_err(), "{wrong}");
        }
    }
}
