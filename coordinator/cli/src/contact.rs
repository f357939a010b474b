//! The name of this machine for other machines, as a user gives it.

use std::{net::IpAddr, str::FromStr};

/// A host name or address for other machines.
#[derive(Debug, Clone)]
pub struct Contact(String);

impl FromStr for Contact {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if let Ok(address) = text.parse::<IpAddr>() {
            return Ok(Self(match address {
                IpAddr::V4(address) => address.to_string(),
                IpAddr::V6(address) => format!("[{address}]"),
            }));
        }
        let is_in_one = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
        match !text.is_empty() && text.len() <= 253 && text.bytes().all(is_in_one) {
            true => Ok(Self(text.to_owned())),
            false => Err("must be a host name or an address, without a port"),
        }
    }
}

impl From<Contact> for String {
    /// The host, as in a URL.
    fn from(contact: Contact) -> Self {
        contact.0
    }
}
