//! How much of the coordinator any client, browser, worker or trainer may use: every limit on what comes over the network.
//!
//! Campaigns are limited where they are defined: `Search::MAX_EVALUATIONS`, `Dataset::MAX_BYTES`,
//! `CampaignSpec::MAX_GENERATION_BYTES` and their like in `proto`; so are texts (`Text`, `text::name`), motions
//! (`Frames::MAX_POSES`) and trainings put aside (`Configuration::saved_bytes`). All limits leave room for an honest user's
//! ten-fold. No message of an answer is longer than clients take by themselves (4 MiB): long answers are streams of parts
//! (`murmuration_proto::parts`).

use std::{num::NonZeroU32, time::Duration};

/// Connections at once, through the endpoint that other machines reach. Fewer where the system allows fewer open files.
pub const MAX_CONNECTIONS: usize = 4096;
/// Connections at once from one address, or one network of 64 bits of IPv6; never more than half of all.
pub const MAX_CONNECTIONS_PER_PEER: usize = 1024;
/// Connections at once, through the endpoint of this machine alone where access is restricted.
pub(crate) const MAX_LOCAL_CONNECTIONS: usize = 128;
/// Files that are kept free of connections: the store's, logs, the library of the operating system.
pub(crate) const RESERVED_FILES: u64 = 256;
/// Time of a TLS handshake, and the longest silence of a connection before its first request.
pub const HANDSHAKE_LIMIT: Duration = Duration::from_secs(10);
/// Time that a connection has until the headers of its first request are complete.
pub(crate) const FIRST_REQUEST_LIMIT: Duration = Duration::from_secs(30);
/// Longest silence of a connection on which no request was admitted for somebody who is known: longer than a log-in takes.
pub(crate) const STRANGER_IDLE_LIMIT: Duration = Duration::from_secs(20);
/// Time after which a connection on which nothing passes, either way, is closed. HTTP/2 connections and pages that follow
/// something are never silent for as long.
pub const IDLE_LIMIT: Duration = Duration::from_secs(120);
/// Time that an answer to a page's or a probe's request may take to begin: shorter than what closes a silent connection, so
/// that there are words. gRPC's clients set their own.
pub const PAGE_LIMIT: Duration = Duration::from_secs(100);
/// Requests at once on one HTTP/2 connection. More wait at the client.
pub const MAX_STREAMS_PER_CONNECTION: u32 = 256;
/// Bytes of a stream that a client may send before somebody reads them. A connection has room for as many of each stream, so that
/// requests that wait for a seat do not keep back those that have one.
pub const UNREAD_BYTES_PER_STREAM: u32 = 128 << 10;
/// Bytes of a request's headers and address, counted as HTTP/2 counts them: names, values, and 32 for each header.
pub const MAX_HEADER_BYTES: u32 = 16 << 10;
/// Headers of a request, the host included: as many as the library reads over HTTP/1.1.
pub const MAX_HEADERS: usize = 100;
/// Bytes of headers that are read over HTTP/2, so that what has too many can be told so. The library reads some more over
/// HTTP/1.1, and answers beyond that with an empty 431.
pub const MAX_READ_HEADER_BYTES: u32 = 4 * MAX_HEADER_BYTES;
/// Requests a second on one connection, and of one class from one principal, in the long run. What is said within a request, such
/// as a worker's stream, does not count: credits limit that.
pub(crate) const REQUESTS_PER_SECOND: NonZeroU32 = NonZeroU32::MIN.saturating_add(499);
/// Requests that may come at once after a pause: a page with a picture of every behaviour.
pub(crate) const REQUEST_BURST: NonZeroU32 = NonZeroU32::MIN.saturating_add(4_999);
/// Decisions a second from one principal, in the long run: the store's lock is held for each.
pub(crate) const DECISIONS_PER_SECOND: NonZeroU32 = NonZeroU32::MIN.saturating_add(249);
/// Decisions that may come at once after a pause.
pub(crate) const DECISION_BURST: NonZeroU32 = NonZeroU32::MIN.saturating_add(999);
/// Requests a second from one principal that read or compute, in the long run: what is kept is answered again by the network's threads.
pub(crate) const READINGS_PER_SECOND: NonZeroU32 = NonZeroU32::MIN.saturating_add(99);
/// Requests that read or compute and may come at once after a pause: a page with the motion of every behaviour.
pub(crate) const READING_BURST: NonZeroU32 = NonZeroU32::MIN.saturating_add(499);
/// Principals whose pace is kept before those that asked for little lately are forgotten.
pub(crate) const MAX_PACED: usize = 1024;
/// Bytes of a message, unless it is one of those below.
pub const MAX_MESSAGE: usize = 4 << 20;
/// Bytes of a message from a worker: a batch of the largest pictures, or the longest motion (48 MB).
pub const MAX_WORKER_MESSAGE: usize = 96 << 20;
/// Bytes of a message with labels: as many answers as may be in one, with the longest names.
pub const MAX_LABEL_MESSAGE: usize = 32 << 20;
/// Bytes of a decision's body, beyond which it needs a seat of the class bulk: some 100 labels.
pub(crate) const MAX_DECISION_BODY: usize = 2 << 10;
/// Bytes that a page may post.
pub const MAX_POST: usize = 2 << 20;
/// Browsers that are logged in with one token, at once: one more ends the oldest session.
pub(crate) const MAX_SESSIONS_PER_TOKEN: usize = 32;
/// Requests of a class that wait for a seat, of one principal ([`Seats`](crate::Seats)).
pub(crate) const MAX_WAITING_PER_PRINCIPAL: usize = 512;
/// Time that the request of a page or probe waits for a seat. A gRPC client waits for as long as it likes.
pub(crate) const SEAT_LIMIT: Duration = Duration::from_secs(30);
/// Time from the seat to the answer of a request without token or certificate.
pub(crate) const STRANGER_LIMIT: Duration = Duration::from_secs(10);
/// Time that a client has to send the next part of a request, or to take the next part of an answer. Who takes none has its
/// connection closed.
pub(crate) const PART_LIMIT: Duration = Duration::from_secs(60);
