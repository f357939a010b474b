//! Every limit on what comes over the network: how much of the coordinator a client, browser, worker or trainer may use.
//!
//! The limits of campaigns are in `swarm`, such as `Search::MAX_EVALUATIONS`, `Dataset::MAX_BYTES` and
//! `CampaignSpec::MAX_GENERATION_BYTES`. The limits of texts (`Text`, `text::name`), motions (`Frames::MAX_POSES`) and saved
//! trainings (`Configuration::saved_bytes`) are also in `swarm`. All limits allow ten times what an honest user needs. No message
//! of a response is longer than clients accept by default (4 MiB): long responses are streams of parts
//! (`murmuration_proto::parts`).

use std::{num::NonZeroU32, time::Duration};

/// Maximum number of open connections of the endpoint that other machines reach; fewer if the system allows fewer open files.
pub const MAX_CONNECTIONS: usize = 12_288;
/// Maximum number of open connections from one address (for IPv6, one /64 network); never more than half of all connections.
pub const MAX_CONNECTIONS_PER_PEER: usize = 1024;
/// Maximum number of open connections of the endpoint for this machine alone, where access is restricted.
pub const MAX_LOCAL_CONNECTIONS: usize = 128;
/// Open files that are reserved for other uses than connections: the store, logs, the operating system's library.
pub const RESERVED_FILES: u64 = 256;
/// Time of a TLS handshake, and the longest silence of a connection before its first request.
pub const HANDSHAKE_LIMIT: Duration = Duration::from_secs(10);
/// Time that a connection has until the headers of its first request are complete.
pub(crate) const FIRST_REQUEST_LIMIT: Duration = Duration::from_secs(30);
/// Longest silence of a connection on which no authenticated request was admitted yet: longer than a log-in takes.
pub(crate) const STRANGER_IDLE_LIMIT: Duration = Duration::from_secs(20);
/// A connection that is silent in both directions for this time is closed. HTTP/2 connections and pages that follow something are
/// never silent for so long.
pub const IDLE_LIMIT: Duration = Duration::from_secs(120);
/// Time within which the response to the request of a page or probe must begin: shorter than [`IDLE_LIMIT`], so that the client
/// gets an error message instead of a closed connection. gRPC clients set their own limits.
pub const PAGE_LIMIT: Duration = Duration::from_secs(100);
/// Maximum number of requests at once on one HTTP/2 connection. Further requests wait at the client.
pub const MAX_STREAMS_PER_CONNECTION: u32 = 256;
/// Bytes of a stream that a client may send before a handler reads them. A connection has room for this number of bytes of each
/// of its streams, so that requests that wait for a seat do not block requests that have a seat.
pub const UNREAD_BYTES_PER_STREAM: u32 = 128 << 10;
/// Bytes of a request's headers and address, counted as HTTP/2 counts them: names, values, and 32 bytes for each header.
pub const MAX_HEADER_BYTES: u32 = 16 << 10;
/// Maximum number of headers of a request, including the host: as many as the HTTP library reads over HTTP/1.1.
pub const MAX_HEADERS: usize = 100;
/// Bytes of headers that are read over HTTP/2: more than [`MAX_HEADER_BYTES`], so that the refusal can give the reason. Over
/// HTTP/1.1, the HTTP library reads somewhat more bytes, and answers longer headers with an empty response of status 431.
pub const MAX_READ_HEADER_BYTES: u32 = 4 * MAX_HEADER_BYTES;
/// Requests a second in the long run, on one connection, and of one class from one principal. Messages within a request, such as
/// a worker's stream, do not count as requests: credits limit these messages.
pub(crate) const REQUESTS_PER_SECOND: NonZeroU32 = NonZeroU32::MIN.saturating_add(499);
/// Requests that may come at once after a pause: enough for a page with a picture of every behaviour.
pub(crate) const REQUEST_BURST: NonZeroU32 = NonZeroU32::MIN.saturating_add(4_999);
/// Decisions a second from one principal, in the long run. Each decision holds the store's lock.
pub(crate) const DECISIONS_PER_SECOND: NonZeroU32 = NonZeroU32::MIN.saturating_add(249);
/// Decisions that may come at once after a pause.
pub(crate) const DECISION_BURST: NonZeroU32 = NonZeroU32::MIN.saturating_add(999);
/// Requests to read or compute that one principal may send a second, in the long run. Even cached answers take time of the
/// network's threads.
pub(crate) const READINGS_PER_SECOND: NonZeroU32 = NonZeroU32::MIN.saturating_add(99);
/// Requests to read or compute that may come at once after a pause: enough for a page with the motion of every behaviour.
pub(crate) const READING_BURST: NonZeroU32 = NonZeroU32::MIN.saturating_add(499);
/// Number of principals whose request rate is remembered. Beyond this number, principals with few recent requests are forgotten.
pub(crate) const MAX_PACED: usize = 1024;
/// Maximum number of bytes of a message that has no limit of its own below.
pub const MAX_MESSAGE: usize = 4 << 20;
/// Bytes of a message from a worker: a batch of the largest pictures, or the longest motion (48 MB).
pub const MAX_WORKER_MESSAGE: usize = 96 << 20;
/// Maximum size, in bytes, of a request to a method for viewers. The request only names what the viewer asks for.
pub const MAX_NAMING_MESSAGE: usize = 64 << 10;
/// Maximum size, in bytes, of a request to a method that requires no credentials, such as a probe.
pub(crate) const MAX_PROBE_MESSAGE: usize = 1 << 10;
/// A message with more bytes than this needs room while it arrives.
pub(crate) const LONG_MESSAGE: usize = 2 << 20;
/// Slowest pace at which a long message arrives, in bytes a second: a slower message would keep its room from others.
pub(crate) const LONG_MESSAGE_PACE: usize = 64 << 10;
/// Maximum number of bytes of long messages that are arriving: from all principals, half for people and half for machines, and
/// from one principal.
pub(crate) const MAX_ARRIVING: usize = 1 << 30;
pub(crate) const MAX_ARRIVING_PER_PRINCIPAL: usize = 256 << 20;
/// Bytes of a message with labels: the most answers that one message may hold, with the longest names.
pub const MAX_LABEL_MESSAGE: usize = 32 << 20;
/// Bytes of a decision's body: some 100 labels. A longer decision needs a seat of the class `bulk`.
pub(crate) const MAX_DECISION_BODY: usize = 2 << 10;
/// Bytes that a page may post.
pub const MAX_POST: usize = 2 << 20;
/// Maximum number of browsers that are logged in with one token at once. One more log-in ends the oldest session.
pub(crate) const MAX_SESSIONS_PER_TOKEN: usize = 32;
/// Maximum number of requests of one principal and class that wait for a seat ([`Seats`](crate::Seats)).
pub(crate) const MAX_WAITING_PER_PRINCIPAL: usize = 512;
/// Time that the request of a page or probe waits for a seat. A gRPC client sets its own time limit.
pub(crate) const SEAT_LIMIT: Duration = Duration::from_secs(30);
/// Time for a request without token or certificate, from its seat to its response.
pub(crate) const STRANGER_LIMIT: Duration = Duration::from_secs(10);
/// Time that a client has to send the next part of a request, or to take the next part of a response. The connection of a client
/// that takes no part in this time is closed.
pub(crate) const PART_LIMIT: Duration = Duration::from_secs(60);
