//! Campaigns: the search, its archive and taxonomy, the leases that farm it out, and the command line.
#![deny(missing_docs)]

pub mod breeding;
pub mod filter;
pub mod medoids;
pub mod novelty;
pub mod picture;
pub mod projection;
pub mod report;
