//! A campaign's taxonomy with the names of its behaviours.

use super::Web;
use maud::{Markup, html};
use murmuration_engine::{
    campaign::CampaignError,
    taxonomy::{ClusterName, Names, Origin, Taxonomy},
};
use murmuration_model::{CampaignRecord, labels::ClassName};
use murmuration_report::card::{CardName, Namer};
use murmuration_store::{Store, StoreError};
use murmuration_swarm::grouped;

/// The current taxonomy, and the names of its clusters, names from earlier versions included.
#[derive(Debug)]
pub(super) struct NamedTaxonomy {
    pub(super) taxonomy: Taxonomy,
    names: Names,
}

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

impl NamedTaxonomy {
    /// Reads the taxonomy and its names; `None` if the campaign has no taxonomy yet.
    pub(super) async fn read(web: &Web, record: &CampaignRecord) -> Result<Option<Self>, CampaignError> {
        let (id, spec) = (record.id.clone(), record.spec.clone());
        let read = move |store: &Store| -> Result<Option<Self>, StoreError> {
            let Some(taxonomy) = Taxonomy::read(store, &id, &spec)? else {
                return Ok(None);
            };
            let versions = store.taxonomy_versions(&id)?;
            let names = Names::read(store, &id, &versions, &*store.labels(&id)?)?;
            Ok(Some(Self { taxonomy, names }))
        };
        Ok(web.store.run(read).await?)
    }

    fn name(&self, place: usize) -> Option<&ClusterName> {
        self.names.names.get(place)?.as_ref()
    }

    /// The name of the cluster at a place of the taxonomy, if its medoid has a label. Names that were carried over are not used:
    /// nobody has confirmed them.
    pub(super) fn class(&self, place: usize) -> Option<&ClassName> {
        let name = self.name(place)?;
        (!matches!(name.origin, Origin::Carried { .. })).then_some(&name.class)
    }

    /// The line under the picture of a medoid: its number, from 1, its name, if it has a name, and its cluster's share of all
    /// individuals.
    pub(super) fn caption(&self, place: usize) -> Markup {
        let all = self.taxonomy.clusters.len().max(1) as f64;
        let medoid = &self.taxonomy.medoids[place];
        let share = 100.0 * medoid.cluster_size as f64 / all;
        html! {
            span title={ "cluster of " (grouped(medoid.cluster_size)) } {
                strong { (place + 1) }
                @if let Some(name) = self.name(place).map(on_card) { " " strong class=[(!name.is_sure()).then_some("unsure")] { (name.shown()) } }
                " · " (format!("{share:.1} %"))
            }
        }
    }
}
