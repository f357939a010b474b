//! Keeps pages of other sites from using a coordinator through a person's browser: checks the host that a request names, the
//! page that it comes from, and, for gRPC, its content type.
//!
//! Browsers state truthfully the host and the page of a request, and send gRPC's content type to another site only after that
//! site has agreed. Other programs can state anything, so passing these checks grants nothing.

use super::{Access, PublicUrl, Refusal};
use axum::{
    extract::Request,
    http::{
        HeaderMap, HeaderValue, Method, Uri,
        header::{CONTENT_TYPE, HOST, ORIGIN},
        uri::Authority,
    },
};
use std::net::{IpAddr, SocketAddr};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked {
    /// A gRPC method that the coordinator has.
    Method,
    /// A gRPC method of a service that the coordinator does not have.
    NoService,
    /// A page, or an HTTP endpoint for programs.
    Page,
}

/// The host names that an endpoint answers to. An attacker can make the name of another site lead to this coordinator (DNS
/// rebinding), so that a browser takes the coordinator for a part of that site.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hosts {
    /// Any host name: a certificate proves the name, or a token is required, which no browser sends for another site.
    Any,
    /// Addresses and `localhost`.
    ThisMachine,
    /// Addresses, `localhost`, and names without a dot, because no site of the Internet has such a name. A gRPC request may use
    /// any name, because no page can send such a request.
    TrustedNetwork,
}

impl Hosts {
    /// The host names of an endpoint at `address`.
    pub(super) fn of(address: SocketAddr, access: &Access, is_encrypted: bool) -> Self {
        match (
            is_encrypted || access.tokens.is_some(),
            address.ip().to_canonical().is_loopback(),
        ) {
            (true, _) => Self::Any,
            (false, true) => Self::ThisMachine,
            (false, false) => Self::TrustedNetwork,
        }
    }

    fn has(self, host: Option<&Authority>, asked: Asked) -> bool {
        let is_ours = |host: &Authority| {
            let name = host.host().trim_start_matches('[').trim_end_matches(']');
            let is_address = name.parse::<IpAddr>().is_ok();
            is_address || name.eq_ignore_ascii_case("localhost") || {
                self == Self::TrustedNetwork && (asked != Asked::Page || !name.contains('.'))
            }
        };
        self == Self::Any || host.is_some_and(is_ours)
    }
}

/// Refuses a request that a page of another site may have sent. A request that changes something must come from a page of the
/// same host, or of the `public` URL: a proxy need not pass on the host that the browser named. A gRPC request must not come from a
/// page.
pub(super) fn check(
    hosts: Hosts,
    is_encrypted: bool,
    public: Option<&PublicUrl>,
    asked: Asked,
    request: &Request,
) -> Result<(), Refusal> {
    let headers = request.headers();
    let host = named_host(request.uri(), headers)?;
    let is_public = |host: &Authority| public.is_some_and(|public| public.authority() == host);
    if !hosts.has(host.as_ref(), asked) && !host.as_ref().is_some_and(is_public) {
        return Err(Refusal::Host);
    }
    let looks = [Method::GET, Method::HEAD].contains(request.method());
    let mut origins = headers.get_all(ORIGIN).iter().peekable();
    let from_here = match asked {
        Asked::Method | Asked::NoService => origins.peek().is_none(),
        Asked::Page if origins.peek().is_none() => looks,
        Asked::Page => origins.all(|origin| {
            let is_public =
                |public: &PublicUrl| is_same(origin, Some(public.authority()), public.is_encrypted());
            is_same(origin, host.as_ref(), is_encrypted) || public.is_some_and(is_public)
        }),
    };
    if !from_here {
        return Err(Refusal::Origin);
    }
    match asked {
        Asked::Method if !is_grpc(headers) => Err(Refusal::ContentType),
        _ => Ok(()),
    }
}

/// Whether a request's body is of the type that gRPC clients send: messages in protocol buffers.
pub(super) fn is_grpc(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
    let kind = kind.and_then(|kind| kind.split(';').next()).map(str::trim);
    kind.is_some_and(|kind| {
        ["application/grpc", "application/grpc+proto"]
            .iter()
            .any(|grpc| kind.eq_ignore_ascii_case(grpc))
    })
}

/// The host that a request names in its address, in a header, or in both; an error if the two differ.
fn named_host(uri: &Uri, headers: &HeaderMap) -> Result<Option<Authority>, Refusal> {
    let read = |host: &HeaderValue| host.to_str().ok()?.parse::<Authority>().ok();
    let in_headers = headers.get_all(HOST).iter().map(read);
    let mut named = uri.authority().cloned().map(Some).into_iter().chain(in_headers);
    let Some(first) = named.next() else {
        return Ok(None);
    };
    match first.is_some() && named.all(|other| other == first) {
        true => Ok(first),
        false => Err(Refusal::Host),
    }
}

fn is_same(origin: &HeaderValue, host: Option<&Authority>, is_encrypted: bool) -> bool {
    let scheme = if is_encrypted { "https://" } else { "http://" };
    let origin = origin
        .to_str()
        .ok()
        .and_then(|origin| origin.strip_prefix(scheme));
    // The comparison ignores case.
    origin.zip(host).is_some_and(|(origin, host)| *host == *origin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;

    const OWN: (&str, &str) = ("host", "127.0.0.1:7700");
    const NAMED: (&str, &str) = ("host", "swarm.example:7700");
    const GRPC: (&str, &str) = ("content-type", "application/grpc");

    /// An endpoint, and the kind of request sent to it.
    struct At(Hosts, bool, Asked);

    /// An endpoint on one person's machine, without encryption.
    const PAGE: At = At(Hosts::ThisMachine, false, Asked::Page);
    const METHOD: At = At(Hosts::ThisMachine, false, Asked::Method);

    impl At {
        fn check_request(&self, method: &Method, headers: &[(&str, &str)]) -> Result<(), Refusal> {
            let mut request = Request::builder().method(method).uri("/");
            for (name, value) in headers {
                request = request.header(*name, *value);
            }
            check(
                self.0,
                self.1,
                None,
                self.2,
                &request.body(Body::empty()).unwrap(),
            )
        }

        fn allows(&self, method: &Method, headers: &[(&str, &str)]) -> bool {
            self.check_request(method, headers).is_ok()
        }
    }

    #[test]
    fn only_addresses_and_this_machine_are_hosts() {
        for host in [
            "127.0.0.1:7700",
            "localhost:7700",
            "LocalHost",
            "[::1]:7700",
            "192.168.0.7:80",
        ] {
            assert!(PAGE.allows(&Method::GET, &[("host", host)]), "{host}");
            assert!(METHOD.allows(&Method::POST, &[("host", host), GRPC]), "{host}");
        }
        for host in ["evil.example:7700", "localhost.evil.example", "swarm", "", "a b"] {
            assert!(!PAGE.allows(&Method::GET, &[("host", host)]), "{host}");
            assert!(!METHOD.allows(&Method::POST, &[("host", host), GRPC]), "{host}");
        }
        assert!(!PAGE.allows(&Method::GET, &[]));
        assert!(!PAGE.allows(&Method::GET, &[OWN, ("host", "evil.example")]));
        assert!(PAGE.allows(&Method::GET, &[OWN, OWN]));
    }

    #[test]
    fn on_a_trusted_network_names_without_a_dot_are_hosts_and_programs_come_under_any() {
        let page = At(Hosts::TrustedNetwork, false, Asked::Page);
        let method = At(Hosts::TrustedNetwork, false, Asked::Method);
        for host in ["coordinator:7700", "10.0.0.7:7700"] {
            assert!(page.allows(&Method::GET, &[("host", host)]), "{host}");
        }
        for host in ["evil.example:7700", "swarm.", ""] {
            assert!(!page.allows(&Method::GET, &[("host", host)]), "{host}");
        }
        assert!(method.allows(&Method::POST, &[NAMED, GRPC]));
        assert_eq!(
            method.check_request(
                &Method::POST,
                &[NAMED, GRPC, ("origin", "http://swarm.example:7700")]
            ),
            Err(Refusal::Origin)
        );
    }

    #[test]
    fn pages_of_the_public_url_are_our_own_whatever_host_the_proxy_names() {
        let public = "https://hub.example/user/ana".parse().unwrap();
        let allowed = |host: &str, origin: &str| {
            let request = Request::post("/").header("host", host).header("origin", origin);
            let request = request.body(Body::empty()).unwrap();
            check(Hosts::ThisMachine, false, Some(&public), Asked::Page, &request).is_ok()
        };
        assert!(allowed("127.0.0.1:7700", "https://hub.example"));
        assert!(allowed("hub.example", "https://hub.example"));
        assert!(allowed("127.0.0.1:7700", "http://127.0.0.1:7700"));
        assert!(!allowed("127.0.0.1:7700", "http://hub.example"));
        assert!(!allowed("127.0.0.1:7700", "https://evil.example"));
        assert!(!allowed("evil.example", "https://hub.example"));
    }

    #[test]
    fn only_our_own_pages_change_anything() {
        let post = |origin: &str| PAGE.allows(&Method::POST, &[OWN, ("origin", origin)]);
        assert!(post("http://127.0.0.1:7700"));
        for origin in [
            "http://evil.example",
            "http://127.0.0.1:8000",
            "null",
            "https://127.0.0.1:7700",
        ] {
            assert!(!post(origin), "{origin}");
            // Pages of other sites may not read either.
            assert!(!PAGE.allows(&Method::GET, &[OWN, ("origin", origin)]), "{origin}");
        }
        assert!(!PAGE.allows(&Method::POST, &[OWN]));
        let both = [
            OWN,
            ("origin", "http://127.0.0.1:7700"),
            ("origin", "http://evil.example"),
        ];
        assert!(!PAGE.allows(&Method::POST, &both));
    }

    #[test]
    fn under_tls_or_with_tokens_a_name_will_do_and_origins_still_count() {
        for (is_encrypted, scheme, other) in [(true, "https", "http"), (false, "http", "https")] {
            let page = At(Hosts::Any, is_encrypted, Asked::Page);
            assert!(page.allows(&Method::GET, &[NAMED]));
            assert!(page.allows(&Method::GET, &[]));
            let post = |scheme: &str, host: &str| {
                let origin = format!("{scheme}://{host}");
                page.allows(&Method::POST, &[NAMED, ("origin", &origin)])
            };
            assert!(post(scheme, "swarm.example:7700"));
            assert!(!post(other, "swarm.example:7700") && !post(scheme, "evil.example"));
            assert!(!page.allows(&Method::POST, &[("origin", "https://swarm.example:7700")]));
        }
    }

    #[test]
    fn grpc_is_known_by_its_content_type() {
        for kind in [
            "application/grpc",
            "application/grpc+proto",
            "application/GRPC ; a=b",
        ] {
            assert!(
                METHOD.allows(&Method::POST, &[OWN, ("content-type", kind)]),
                "{kind}"
            );
        }
        for kind in [
            "text/plain",
            "application/grpc-web",
            "application/grpc+json",
            "application/grp",
            "",
        ] {
            assert_eq!(
                METHOD.check_request(&Method::POST, &[OWN, ("content-type", kind)]),
                Err(Refusal::ContentType),
                "{kind}"
            );
        }
        assert_eq!(
            METHOD.check_request(&Method::POST, &[OWN]),
            Err(Refusal::ContentType)
        );
    }

    #[test]
    fn an_endpoint_without_tls_and_tokens_answers_under_fewer_names() {
        let open = Access::default();
        let guarded = Access {
            tokens: Some(std::sync::Arc::default()),
            ..Access::default()
        };
        let at =
            |address: &str, access, is_encrypted| Hosts::of(address.parse().unwrap(), access, is_encrypted);
        assert_eq!(at("127.0.0.1:7700", &open, false), Hosts::ThisMachine);
        assert_eq!(at("[::ffff:127.0.0.1]:7700", &open, false), Hosts::ThisMachine);
        assert_eq!(at("0.0.0.0:7700", &open, false), Hosts::TrustedNetwork);
        assert_eq!(at("0.0.0.0:7700", &open, true), Hosts::Any);
        assert_eq!(at("127.0.0.1:7700", &guarded, false), Hosts::Any);
    }
}
