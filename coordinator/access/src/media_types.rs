//! The media type of a response that a client prefers, by the header `Accept` of its request (RFC 9110).

use axum::http::{HeaderMap, header::ACCEPT};
use std::cmp::Ordering;

/// A media range of a header `Accept`: `text/html;q=0.9`, `text/*` or `*/*`.
struct Range<'a> {
    kind: &'a str,
    subtype: &'a str,
    /// From 0, not accepted, to 1.
    quality: f64,
}

/// The media type among `offered` that the client prefers. Among types that the client prefers equally, this is a type that it
/// names, or else the first one. Without the header, or if the client accepts none of the types, this is the first one too:
/// a response of another type helps more than an error 406. Parameters of media types other than the quality are ignored: those that
/// Prometheus sends differ from version to version, and the crate headers-accept would require them.
#[must_use]
pub fn preferred<'a>(headers: &HeaderMap, offered: &[&'a str]) -> &'a str {
    let headers = headers.get_all(ACCEPT).iter();
    let headers: Vec<&str> = headers.filter_map(|header| header.to_str().ok()).collect();
    let ranges: Vec<Range<'_>> = headers
        .iter()
        .flat_map(|header| split(header, ','))
        .filter_map(Range::parse)
        .collect();
    let rated = offered.iter().map(|offered| (*offered, rate(&ranges, offered)));
    // The last of several equal items is the maximum of an iterator.
    let best = rated.rev().max_by(|(_, one), (_, other)| compare(*one, *other));
    match best {
        Some((best, (quality, _))) if quality > 0.0 => best,
        _ => offered.first().copied().unwrap_or_default(),
    }
}

/// The quality of a media type for the client, and how precisely the client names the type. The most precise range counts.
fn rate(ranges: &[Range<'_>], offered: &str) -> (f64, u8) {
    let matching = ranges
        .iter()
        .filter_map(|range| Some((range.quality, range.precision(offered)?)));
    let by_precision =
        |one: &(f64, u8), other: &(f64, u8)| one.1.cmp(&other.1).then(one.0.total_cmp(&other.0));
    matching.max_by(by_precision).unwrap_or((0.0, 0))
}

fn compare(one: (f64, u8), other: (f64, u8)) -> Ordering {
    one.0.total_cmp(&other.0).then(one.1.cmp(&other.1))
}

impl<'a> Range<'a> {
    /// Parses a media range; `None` if it is malformed.
    fn parse(text: &'a str) -> Option<Self> {
        let mut parts = split(text, ';');
        let (kind, subtype) = parts.next()?.trim().split_once('/')?;
        let mut quality = 1.0;
        for parameter in parts {
            if let Some((name, value)) = parameter.split_once('=')
                && name.trim().eq_ignore_ascii_case("q")
            {
                quality = value
                    .trim()
                    .parse()
                    .ok()
                    .filter(|quality| (0.0..=1.0).contains(quality))?;
            }
        }
        Some(Self {
            kind,
            subtype,
            quality,
        })
    }

    /// How precisely the range names a media type; `None` if the range does not contain it.
    fn precision(&self, offered: &str) -> Option<u8> {
        let (kind, subtype) = offered.split_once('/')?;
        match (self.kind, self.subtype) {
            ("*", "*") => Some(0),
            (own, "*") if own.eq_ignore_ascii_case(kind) => Some(1),
            (own, named) if own.eq_ignore_ascii_case(kind) && named.eq_ignore_ascii_case(subtype) => Some(2),
            _ => None,
        }
    }
}

/// The parts of a header between separators, except for separators in quoted strings.
fn split(header: &str, separator: char) -> impl Iterator<Item = &str> {
    let (mut is_quoted, mut is_escaped) = (false, false);
    header.split(move |c| {
        let separates = c == separator && !is_quoted;
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' if is_quoted => is_escaped = true,
            '"' => is_quoted = !is_quoted,
            _ => {}
        }
        separates
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    const OFFERED: [&str; 3] = ["text/plain", "text/html", "application/json"];

    fn check(accept: &str, expected: &str) {
        let headers = HeaderMap::from_iter([(ACCEPT, HeaderValue::from_str(accept).unwrap())]);
        assert_eq!(preferred(&headers, &OFFERED), expected, "{accept}");
    }

    #[test]
    fn a_client_gets_the_media_type_that_it_prefers() {
        assert_eq!(preferred(&HeaderMap::new(), &OFFERED), "text/plain");
        check("*/*", "text/plain");
        check("text/*", "text/plain");
        check("image/png", "text/plain");
        check("application/*", "application/json");
        check("text/html,*/*", "text/html");
        check(
            "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8",
            "text/html",
        );
        check("application/json, text/html;q=0.5", "application/json");
        check("TEXT/HTML", "text/html");
    }

    #[test]
    fn a_type_that_a_client_does_not_accept_or_that_only_looks_alike_does_not_count() {
        check("text/html;q=0, application/json;q=0.1", "application/json");
        check("text/html; Q=0.000, */*", "text/plain");
        check("application/json;q=0, text/*", "text/plain");
        check("text/plain;q=0, */*;q=0.1", "text/html");
        check("text/html-sandboxed", "text/plain");
        check("x-text/html", "text/plain");
        check("application/problem;type=\"a,text/html\"", "text/plain");
        check(
            "application/problem;type=\"\\\",text/html\", application/json",
            "application/json",
        );
        check("text/html;q=2", "text/plain");
        check("text/html;q=NaN", "text/plain");
        check("text/html;level=\"1;q=0\"", "text/html");
    }

    #[test]
    fn several_headers_are_one_list() {
        let mut headers = HeaderMap::new();
        headers.append(ACCEPT, HeaderValue::from_static("text/html;q=0.2"));
        headers.append(ACCEPT, HeaderValue::from_static("application/json"));
        assert_eq!(preferred(&headers, &OFFERED), "application/json");
    }
}
