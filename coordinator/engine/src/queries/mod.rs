//! Queries for annotators: which behaviours, in which order, and who has a question.
//!
//! A *ranking* is an order of all behaviours of an archive, each with the reason for its place; it does not depend on who
//! asks, nor on what was asked. `QueryLeases` gives the first of a ranking that are open to whoever asks, so that nobody
//! is asked what somebody else is looking at. [`Queries`] holds both for every campaign of a coordinator, and the clusters
//! that contact sheets show.

mod clusters;
mod leases;
mod messages;
mod open;
mod ranking;

pub use clusters::Clustered;
pub use leases::AnnotatorSession;
pub use murmuration_proto::Strategy;
pub use open::{Asked, Queries, QueryError, QueryRequest};
pub use ranking::{Query, Reason, beyond_medoids, by_uncertainty, in_random_order};
