//! Campaigns: the search, its archive and taxonomy, the leases that farm it out, and the command line.
//!
//! ARCHITECTURE.md has the map. Knows `proto`, and `worker` only to start workers in-process and for the
//! `simulate` command.
#![deny(missing_docs)]

pub mod access;
pub mod accuracy;
pub mod backup;
pub mod blocking;
pub mod breeding;
pub mod campaign;
pub mod checkpoints;
pub mod cli;
mod connections;
pub mod digest;
pub mod dispatch;
pub mod doctor;
mod files;
pub mod filter;
pub mod gather;
pub mod interrupt;
pub mod judge;
mod kept;
pub mod label_curve;
pub mod labels;
pub mod leases;
pub mod limits;
pub mod local;
pub mod maps;
pub mod medoids;
pub mod metrics;
pub mod model;

pub mod novelty;
pub mod picture;
mod probes;
pub mod projection;
pub mod queries;
pub mod report;
mod requests;
pub mod server;
pub mod service;
pub mod space;
pub mod store;
pub mod synthetic;
pub mod taxonomy;
mod web;
