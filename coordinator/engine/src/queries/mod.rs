//! Queries for annotators: the choice and order of behaviours, and the holder of each question.
//!
//! A *ranking* is an order of all behaviours of an archive, each with the reason for its place. A ranking does not depend on the
//! annotator or on earlier questions. `QueryLeases` leases the first open queries of a ranking, so that no two annotators are
//! asked about the same behaviour at once. For every campaign of a coordinator, [`Queries`] holds the rankings, the leases, and
//! the clusters on contact sheets.

mod clusters;
mod leases;
mod messages;
mod open;
mod ranking;
mod unlike;

pub use clusters::Clustered;
pub use leases::AnnotatorSession;
pub use murmuration_swarm::Strategy;
pub use open::{Asked, Queries, QueryError, QueryRequest};
pub use ranking::{Query, Reason, beyond_medoids, by_uncertainty, in_random_order};
