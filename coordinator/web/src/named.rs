//! A campaign's taxonomy with the names that its behaviours were given.

use super::Web;
use maud::{Markup, html};
use murmuration_engine::{blocking::blocking, campaign::CampaignError, taxonomy::Taxonomy};
use murmuration_model::{
    CampaignRecord,
    labels::{ClassName, GivenClass},
};
use murmuration_proto::grouped;
use murmuration_store::StoreError;
use std::collections::BTreeMap;

/// A taxonomy, and the classes of individuals.
#[derive(Debug)]
pub(super) struct NamedTaxonomy {
    pub(super) taxonomy: Taxonomy,
    /// By individual.
    classes: BTreeMap<u64, GivenClass>,
}

impl NamedTaxonomy {
    /// Reads them; `None` before the campaign has a taxonomy.
    pub(super) async fn read(web: &Web, record: &CampaignRecord) -> Result<Option<Self>, CampaignError> {
        let (store, id, spec) = (web.store.clone(), record.id.clone(), record.spec.clone());
        let read = move || -> Result<Option<Self>, StoreError> {
            let Some(taxonomy) = Taxonomy::read(&store, &id, &spec)? else {
                return Ok(None);
            };
            let classes = store.labels(&id)?.given_classes();
            Ok(Some(Self { taxonomy, classes }))
        };
        Ok(blocking(read).await??)
    }

    /// The class of the medoid at a place, if it has one.
    pub(super) fn class(&self, place: usize) -> Option<&ClassName> {
        let medoid = self.taxonomy.medoids.get(place)?;
        Some(&self.classes.get(&medoid.individual.index)?.class)
    }

    /// The line under the picture of a medoid: its place from 1, its name if it has one, and its cluster's share of all individuals.
    pub(super) fn caption(&self, place: usize) -> Markup {
        let all = self.taxonomy.clusters.len().max(1) as f64;
        let medoid = &self.taxonomy.medoids[place];
        let share = 100.0 * medoid.cluster_size as f64 / all;
        let class = self.classes.get(&medoid.individual.index);
        html! {
            span title={ "cluster of " (grouped(medoid.cluster_size)) } {
                strong { (place + 1) @if let Some(class) = class { " " (class.class.shown()) } }
                " · " (format!("{share:.1} %"))
            }
        }
    }
}
