//! The URL at which browsers reach the pages through a proxy.

use axum::http::{Uri, uri::Authority};
use std::{fmt, str::FromStr};

/// The URL at which a proxy serves the pages, such as `https://hub.example/user/ana/proxy/7700`. The proxy may remove the path from
/// requests, or leave it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PublicUrl {
    is_encrypted: bool,
    authority: Authority,
    /// Without a slash at the end; empty for the root.
    path: String,
}

/// Text that is not the URL of pages behind a proxy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("it is not a URL of pages, such as https://hub.example/user/ana/proxy/7700")]
pub struct NoPublicUrl;

impl PublicUrl {
    /// The path before that of each page, without a slash at its end; empty for none.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Whether browsers encrypt their connections to the proxy.
    #[must_use]
    pub const fn is_encrypted(&self) -> bool {
        self.is_encrypted
    }

    pub(super) const fn authority(&self) -> &Authority {
        &self.authority
    }

    /// The path of a request without the path of this URL; `None` if it does not begin with it.
    #[must_use]
    pub fn within<'a>(&self, path: &'a str) -> Option<&'a str> {
        match path.strip_prefix(&self.path)? {
            "" => Some("/"),
            rest => rest.starts_with('/').then_some(rest),
        }
    }
}

impl FromStr for PublicUrl {
    type Err = NoPublicUrl;

    fn from_str(text: &str) -> Result<Self, NoPublicUrl> {
        let url: Uri = text.parse().map_err(|_| NoPublicUrl)?;
        let is_encrypted = match url.scheme_str() {
            Some("https") => true,
            Some("http") => false,
            _ => return Err(NoPublicUrl),
        };
        let authority = url
            .authority()
            .filter(|authority| !authority.as_str().contains('@'));
        let path = url.path().trim_end_matches('/');
        // These characters need no escapes, neither in a page nor in a cookie.
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/-._~%+@".contains(&byte);
        match authority {
            Some(authority) if url.query().is_none() && path.bytes().all(is_plain) => Ok(Self {
                is_encrypted,
                authority: authority.clone(),
                path: path.to_owned(),
            }),
            _ => Err(NoPublicUrl),
        }
    }
}

impl fmt::Display for PublicUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scheme = if self.is_encrypted { "https" } else { "http" };
        write!(f, "{scheme}://{}{}", self.authority, self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_url_has_a_place_and_perhaps_a_path() {
        let read = |text: &str| text.parse::<PublicUrl>();
        let hub = read("https://hub.example/user/ana/proxy/7700/").unwrap();
        assert_eq!(hub.to_string(), "https://hub.example/user/ana/proxy/7700");
        assert_eq!(read("http://localhost:8080").unwrap().path(), "");
        for refused in [
            "",
            "hub.example",
            "/user",
            "ftp://hub/x",
            "https://hub/x?y",
            "https://a:b@hub/",
            "https://hub/\"x",
        ] {
            assert_eq!(read(refused), Err(NoPublicUrl), "{refused}");
        }
    }

    #[test]
    fn a_request_may_have_the_path_or_lack_it() {
        let hub: PublicUrl = "https://hub.example/user/ana".parse().unwrap();
        assert_eq!(hub.within("/user/ana/campaigns/x"), Some("/campaigns/x"));
        assert_eq!(hub.within("/user/ana"), Some("/"));
        assert_eq!(hub.within("/user/anabel"), None);
        assert_eq!(hub.within("/campaigns/x"), None);
    }
}
