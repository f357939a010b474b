//! The names of behaviours as cards show them.

use murmuration_engine::taxonomy::{ClusterName, Origin};
use murmuration_report::card::{CardName, Namer};

/// The name of a cluster as cards show it.
pub(super) fn on_card(name: &ClusterName) -> CardName {
    CardName {
        name: name.class.shown(),
        by: namer(name.origin),
    }
}

pub(super) const fn namer(origin: Origin) -> Namer {
    match origin {
        Origin::Person => Namer::Annotator,
        Origin::Judge => Namer::Judge,
        Origin::Carried { .. } => Namer::Earlier,
    }
}
