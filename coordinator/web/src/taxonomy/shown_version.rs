//! A version of a taxonomy as pages show it: with names, the judge's verdicts, purities, and the kind of behaviour of each
//! cluster.

use super::measured::Measured;
use crate::{Web, page_error::PageError};
use maud::Markup;
use murmuration_engine::taxonomy::{Alike, ClusterName, Names, Origin, Taxonomy};
use murmuration_model::{
    CampaignRecord,
    labels::{ClassName, Labels},
};
use murmuration_report::{
    self as report,
    card::{CardName, Namer},
};
use murmuration_store::{Store, StoreError, TaxonomyVersion};
use murmuration_swarm::{Choice, Verdict};
use std::{collections::BTreeMap, sync::Arc};

/// A version of a taxonomy, with the names of its clusters and all other versions.
pub(crate) struct ShownVersion {
    pub(super) versions: Vec<TaxonomyVersion>,
    pub(super) version: TaxonomyVersion,
    pub(crate) taxonomy: Taxonomy,
    pub(super) names: Names,
    pub(super) labels: Arc<Labels>,
    /// Pairs of clusters that touch; empty unless the version is current.
    pub(super) alike: Vec<Alike>,
    pub(super) measurements: Arc<Measured>,
    /// The judge's verdicts on medoids, by the index of the medoid.
    pub(crate) verdicts: BTreeMap<u64, Verdict>,
    /// The purity of each cluster, if it is known, by place.
    pub(super) purities: Vec<Option<report::Purity>>,
    /// The kind of behaviour of each card, by place.
    pub(super) kinds: Vec<report::Shown>,
}

impl ShownVersion {
    /// The current taxonomy of a campaign; `None` if the campaign has none.
    pub(crate) async fn current(web: &Web, record: &CampaignRecord) -> Result<Option<Self>, PageError> {
        let newest = Self::stored(web, record, None).await?;
        match newest.filter(|shown| shown.version.stands) {
            Some(shown) => Ok(Some(shown.measured(web, record).await?)),
            None => Ok(None),
        }
    }

    /// The requested version, by default the newest; `None` if this version does not exist.
    pub(super) async fn read(
        web: &Web,
        record: &CampaignRecord,
        asked: Option<u32>,
    ) -> Result<Option<Self>, PageError> {
        match Self::stored(web, record, asked).await? {
            Some(shown) => Ok(Some(shown.measured(web, record).await?)),
            None => Ok(None),
        }
    }

    /// The requested version without its measurements.
    async fn stored(
        web: &Web,
        record: &CampaignRecord,
        asked: Option<u32>,
    ) -> Result<Option<Self>, PageError> {
        let of = record.clone();
        Ok(web.store.run(move |store| read(store, &of, asked)).await?)
    }

    async fn measured(mut self, web: &Web, record: &CampaignRecord) -> Result<Self, PageError> {
        let measured = web
            .measured
            .of(web, record, &self.taxonomy, self.version.stands)
            .await?;
        self.measure(measured);
        Ok(self)
    }

    /// Notes what was measured of the version: verdicts, purities and the names that follow from them.
    fn measure(&mut self, measured: Arc<Measured>) {
        let (taxonomy, given) = (&self.taxonomy, self.labels.given_classes());
        self.verdicts = measured.verdicts(taxonomy);
        let medoids = || taxonomy.medoids.iter().map(|medoid| medoid.individual.index);
        let purity = |(place, index)| {
            report::Purity::of_cluster(place, index, &taxonomy.clusters, &given, &measured.judged)
        };
        self.purities = medoids().enumerate().map(purity).collect();
        let kind = |(place, index): (usize, u64)| {
            let name = self.name(place).map(|name| (&name.class, namer(name.origin)));
            report::Shown::of(name, self.verdicts.get(&index).copied(), self.purities[place])
        };
        self.kinds = medoids().enumerate().map(kind).collect();
        self.measurements = measured;
    }

    pub(super) fn name(&self, place: usize) -> Option<&ClusterName> {
        self.names.names.get(place)?.as_ref()
    }

    /// The kind of the cluster at a place, by an annotator or else by the judge; `None` if it is mixed, random or unknown.
    pub(crate) fn class(&self, place: usize) -> Option<ClassName> {
        match self.kinds.get(place)? {
            report::Shown::Named(name) | report::Shown::Judged(name) => name.parse().ok(),
            report::Shown::Mixed | report::Shown::Random => None,
        }
    }

    /// Places of the clusters that pages show first, and of those that they fold beneath them.
    pub(crate) fn folding(&self, record: &CampaignRecord) -> (Vec<usize>, Vec<usize>) {
        report::folding(&self.kinds, &record.spec)
    }

    /// Summary of the findings in one paragraph; empty if no behaviour has a name.
    pub(crate) fn answer(&self) -> Markup {
        report::answer(&self.kinds, &self.measurements.judged)
    }

    /// Summary of the clusters at these places, which a page folds.
    pub(crate) fn folded(&self, places: &[usize]) -> String {
        report::folded(&self.kinds, places)
    }
}

/// The name of a cluster as cards show it.
pub(crate) fn on_card(name: &ClusterName) -> CardName {
    CardName {
        name: name.class.shown(),
        by: namer(name.origin),
    }
}

const fn namer(origin: Origin) -> Namer {
    match origin {
        Origin::Person => Namer::Annotator,
        Origin::Judge => Namer::Judge,
        Origin::Carried { .. } => Namer::Earlier,
    }
}

fn read(
    store: &Store,
    record: &CampaignRecord,
    asked: Option<u32>,
) -> Result<Option<ShownVersion>, StoreError> {
    let versions = store.taxonomy_versions(&record.id)?;
    let asked = asked.or(versions.last().map(|version| version.version));
    let Some(place) = versions.iter().position(|version| Some(version.version) == asked) else {
        return Ok(None);
    };
    let (version, until) = (versions[place].clone(), &versions[..=place]);
    let Some(taxonomy) = Taxonomy::read_version(store, &record.id, version.version, &record.spec)? else {
        return Ok(None);
    };
    let labels = store.labels(&record.id)?;
    let names = Names::read(store, &record.id, until, &labels)?;
    // Medoids chosen for coverage are at the rims of their clusters, so that almost all clusters touch.
    let alike = match version.stands && record.spec.choice() != Choice::Coverage {
        true => taxonomy.alike(&store.scale(record)?),
        false => Vec::new(),
    };
    Ok(Some(ShownVersion {
        alike,
        measurements: Arc::default(),
        verdicts: BTreeMap::new(),
        purities: Vec::new(),
        kinds: Vec::new(),
        versions,
        version,
        taxonomy,
        names,
        labels,
    }))
}
