//! The page of a campaign's taxonomy: people watch behaviours, name behaviours, see what learning changed, and download the
//! report.

mod alike;
mod card;
pub(super) mod changes;
pub(super) mod figure;
mod further_starts;
pub(super) mod map;
mod measured;
pub(super) mod starts;
mod versions;

pub use further_starts::FurtherStarts;
use measured::Measured;
pub use measured::Measurements;

use super::{
    Web,
    asked::Query,
    keys,
    layout::{Part, campaign_page},
    named::namer,
    of_campaign::OfCampaign,
    page_error::PageError,
    parts,
};
use axum::{
    body::Bytes,
    extract::{Path, State},
    http::header::{CONTENT_DISPOSITION, CONTENT_TYPE},
    response::IntoResponse,
};
use card::{Card, card};
use maud::{Markup, html};
use murmuration_engine::{
    blocking::{in_background, parallel},
    taxonomy::{Alike, Names, Taxonomy},
};
use murmuration_model::{ArchiveVersion, CampaignId, CampaignRecord, CampaignState, Rounds, labels::Labels};
use murmuration_proto::v1::{
    campaign_service_client::CampaignServiceClient, campaign_service_server::CampaignServiceServer,
    label_service_client::LabelServiceClient, label_service_server::LabelServiceServer,
};
use murmuration_report as report;
use murmuration_service::{
    OrStatus as _,
    report_data::{self, PicturesOf},
};
use murmuration_store::{Store, StoreError, TaxonomyVersion, kept::LatestAnswers};
use murmuration_swarm::{Choice, Verdict};
use serde::Deserialize;
use std::{collections::BTreeMap, sync::Arc};
use tonic::Status;

const KEYS: [(&str, &str); 3] = [
    ("Tab", "go from picture to picture and from name to name"),
    ("Enter Space", "on a picture: play or pause its motion"),
    ("Enter", "on a name: save it"),
];

/// The parameters of the page's address.
#[derive(Debug, Deserialize)]
pub(super) struct Asked {
    /// The version to show; by default the newest version.
    version: Option<u32>,
    /// Number of individuals to show beside the medoids.
    more: Option<usize>,
}

/// A version of a taxonomy, with the names of its clusters and all other versions.
struct Shown {
    versions: Vec<TaxonomyVersion>,
    version: TaxonomyVersion,
    taxonomy: Taxonomy,
    names: Names,
    labels: Arc<Labels>,
    /// Pairs of clusters that touch; empty unless the version is current.
    alike: Vec<Alike>,
    measured: Arc<Measured>,
    /// The judge's verdicts on medoids, by the index of the medoid.
    words: BTreeMap<u64, Verdict>,
    /// The purity of each cluster, if it is known, by place.
    purities: Vec<Option<report::Purity>>,
    /// The kind of behaviour of each card, by place.
    kinds: Vec<report::Shown>,
    /// Individuals shown besides the medoids, far from the medoids and from each other.
    further: Vec<u64>,
}

/// Number of individuals that a click adds besides the medoids, and maximum number of these individuals.
const MORE: usize = 12;
const MOST_MORE: usize = 240;

pub(super) async fn page(
    Query(asked): Query<Asked>,
    OfCampaign { web, record, visitor }: OfCampaign,
) -> Result<Markup, PageError> {
    let of = record.clone();
    let mut shown = web
        .store
        .run(move |store| read(store, &of, asked.version))
        .await?;
    match &mut shown {
        None if asked.version.is_some() => return Err(PageError::NoPage),
        None => {}
        Some(shown) => {
            let (taxonomy, stands) = (&shown.taxonomy, shown.version.stands);
            let measured = web.measured.of(&web, &record, taxonomy, stands).await?;
            shown.measure(measured);
            if let Some(more) = asked.more.filter(|_| shown.version.stands) {
                let queries = &web.labels.queries;
                let further = queries
                    .beyond_medoids(&record, more.min(MOST_MORE))
                    .await
                    .or_status()?;
                shown.further = further.into_iter().map(|index| index as u64).collect();
            }
        }
    }
    let content = html! {
        div.wide-bar {
            h1 { "Taxonomy" }
            @if let Some(shown) = &shown {
                (keys::fixed(&KEYS))
                div.choices { (actions(&record, shown)) }
            }
        }
        @match &shown {
            None => p.empty { "The taxonomy is computed when the search has ended." },
            Some(shown) => (behaviours(&record, shown)),
        }
    };
    Ok(campaign_page(&record, Part::Taxonomy, &visitor, content))
}

/// The buttons for actions on a whole version.
fn actions(record: &CampaignRecord, shown: &Shown) -> Markup {
    let of = format!("/campaigns/{}", record.id);
    html! {
        @if shown.version.stands {
            button.plain.scripted.once-named type="button" data-do="undo" { "Undo my last answer" }
        }
        @if shown.versions.len() > 1 { a.button href={ (of) "/taxonomy/changes" } { "Before and after" } }
        @if shown.version.stands {
            (figure::form(record, shown))
            a.button href={ (of) "/contact-sheet.svg" } { "Contact sheet (SVG)" }
            a.button href={ (of) "/report" } { "Export the report" }
        }
    }
}

/// Reads the requested version, by default the newest; `None` if this version does not exist.
fn read(store: &Store, record: &CampaignRecord, asked: Option<u32>) -> Result<Option<Shown>, StoreError> {
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
    Ok(Some(Shown {
        alike,
        further: Vec::new(),
        measured: Arc::default(),
        words: BTreeMap::new(),
        purities: Vec::new(),
        kinds: Vec::new(),
        versions,
        version,
        taxonomy,
        names,
        labels,
    }))
}

impl Shown {
    /// Notes what was measured of the version: verdicts, purities and the names that follow from them.
    fn measure(&mut self, measured: Arc<Measured>) {
        let (taxonomy, given) = (&self.taxonomy, self.labels.given_classes());
        self.words = measured.verdicts(taxonomy);
        let medoids = || taxonomy.medoids.iter().map(|medoid| medoid.individual.index);
        let purity = |(place, index)| {
            report::Purity::of_cluster(place, index, &taxonomy.clusters, &given, &measured.judged)
        };
        self.purities = medoids().enumerate().map(purity).collect();
        let kind = |(place, index): (usize, u64)| {
            let name = self.names.names.get(place).and_then(Option::as_ref);
            let name = name.map(|name| (&name.class, namer(name.origin)));
            report::Shown::of(name, self.words.get(&index).copied(), self.purities[place])
        };
        self.kinds = medoids().enumerate().map(kind).collect();
        self.measured = measured;
    }
}

/// The cards of a version, with an introduction.
fn behaviours(record: &CampaignRecord, shown: &Shown) -> Markup {
    let embeds = record.spec.space().embeds();
    html! {
        (versions::list(record, shown))
        (report::answer(&shown.kinds, &shown.measured.judged))
        p.lead {
            "Each card shows a behaviour that stands for a cluster. The largest cluster is first. "
            @if let Some(sample) = report::sample_in_words(&record.spec) { (sample) " " }
            @if shown.version.stands {
                span.scripted {
                    "Point at a picture to play its motion. A name counts as a label"
                    @if embeds { ": the embedding learns from it when it next learns from the labels" }
                    ". "
                }
                (alike::link(shown))
            }
        }
        (versions::uncarried(shown))
        @if shown.version.stands {
            dialog.introduction aria-label="Your name" { (parts::who()) }
            datalist #names { @for class in shown.labels.classes() { option value=(class.name.shown()) {} } }
        }
        @if shown.version.stands { (parts::status_line()) }
        @let (distinct, others) = folding(record, shown);
        (groups(record, shown, &distinct))
        @if !others.is_empty() {
            @let folded: Vec<usize> = others.concat();
            details.others-shown { summary { (report::folded(&shown.kinds, &folded)) } (groups(record, shown, &others)) }
        }
        @if shown.version.stands { (further(record, shown)) }
        (alike::section(record, shown))
    }
}

/// The groups of clusters with the same name that the page shows first, and the other groups, which it folds.
fn folding(record: &CampaignRecord, shown: &Shown) -> (Groups, Groups) {
    let (first, _) = report::folding(&shown.kinds, &record.spec);
    alike::groups(shown)
        .into_iter()
        .partition(|group| group.iter().any(|place| first.contains(place)))
}

/// Clusters with the same name, by their places.
type Groups = Vec<Vec<usize>>;

fn groups(record: &CampaignRecord, shown: &Shown, groups: &[Vec<usize>]) -> Markup {
    html! {
        ul.medoids {
            @for group in groups {
                @if let [place] = group.as_slice() {
                    li { (card(&Card { record, shown, place: *place })) }
                } @else {
                    li.merged { (card::merged(record, shown, group)) }
                }
            }
        }
    }
}

/// Individuals besides the medoids, and a link that adds more individuals.
fn further(record: &CampaignRecord, shown: &Shown) -> Markup {
    let count = shown.further.len();
    let medoids = shown.taxonomy.medoids.len();
    let given = shown.labels.given_classes();
    html! {
        section #more {
            @if count > 0 {
                h2 { "Further behaviours" }
                p.reason { "Each behaviour is the farthest from those above and from those listed before it." }
                ul.medoids { @for &index in &shown.further { li { (card::further(record, given.get(&index), index)) } } }
            }
            @if count < MOST_MORE && count + medoids < shown.taxonomy.clusters.len() {
                p { a.button href={ "/campaigns/" (record.id) "/taxonomy?more=" (count + MORE) "#more" } { "Show " (MORE) " more" } }
            }
        }
    }
}

/// The report as one file to download; workers simulate its motions again. The response to an error is a page. Links to the
/// report must not have the attribute `download`, or browsers would save this page as the report.
pub(super) async fn export(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<impl IntoResponse, PageError> {
    let (id, page) = drawn(&web, &id, PicturesOf::Individuals).await?;
    let name = format!("attachment; filename=\"{id}.html\"");
    let headers = [
        (CONTENT_TYPE, "text/html; charset=utf-8".to_owned()),
        (CONTENT_DISPOSITION, name),
    ];
    Ok((headers, page))
}

/// All behaviours in one figure, to download as SVG. The notes of [`export`] on errors and links also apply here.
pub(super) async fn contact_sheet(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<impl IntoResponse, PageError> {
    let (id, sheet) = drawn(&web, &id, PicturesOf::Medoids).await?;
    let name = format!("attachment; filename=\"{id}-contact-sheet.svg\"");
    let headers = [
        (CONTENT_TYPE, "image/svg+xml".to_owned()),
        (CONTENT_DISPOSITION, name),
    ];
    Ok((headers, sheet))
}

/// Maximum size of all cached reports in bytes, and the same of all cached contact sheets, and of all cached figures.
const MOST_BYTES: usize = 32 << 20;

/// The latest reports, contact sheets and figures. A clone is cheap.
#[derive(Debug, Clone)]
pub struct Reports {
    pages: LatestAnswers<ReportState, Bytes>,
    sheets: LatestAnswers<ReportState, Bytes>,
    figures: LatestAnswers<figure::FigureState, Bytes>,
}

impl Default for Reports {
    fn default() -> Self {
        Self {
            pages: LatestAnswers::within(MOST_BYTES),
            sheets: LatestAnswers::within(MOST_BYTES),
            figures: LatestAnswers::within(MOST_BYTES),
        }
    }
}

/// The state that a report depends on: the archive version, the number of individuals, the state and the rounds of the campaign,
/// and the length of the label log.
type ReportState = (ArchiveVersion, u64, CampaignState, Rounds, u64);

/// The id of a campaign, and the state of its report.
async fn state(web: &Web, id: &str) -> Result<(CampaignId, ReportState), PageError> {
    let record = web.campaigns.status(id).await?.record;
    let of = record.id.clone();
    let entries = web.store.run(move |store| store.label_entries(&of)).await?;
    let state = (
        record.archive_version(),
        record.individuals(),
        record.state,
        record.rounds,
        entries,
    );
    Ok((record.id, state))
}

/// The id of a campaign, and its report or contact sheet.
async fn drawn(web: &Web, id: &str, pictures: PicturesOf) -> Result<(CampaignId, Bytes), PageError> {
    let (id, state) = state(web, id).await?;
    let kept = match pictures {
        PicturesOf::Individuals => &web.reports.pages,
        PicturesOf::Medoids => &web.reports.sheets,
    };
    let drawn = kept.of(&id, state, Bytes::len, draw(web, &id, pictures)).await?;
    Ok((id, drawn))
}

async fn draw(web: &Web, id: &CampaignId, pictures: PicturesOf) -> Result<Bytes, PageError> {
    let gathered = gathered(web, id, pictures).await?;
    let draw = move || match pictures {
        PicturesOf::Individuals => report::page(&gathered),
        PicturesOf::Medoids => report::contact_sheet(&gathered),
    };
    let drawn = in_background(move |_| parallel(draw));
    let drawn = drawn
        .await?
        .map_err(|error| Status::internal(error.to_string()))?;
    Ok(drawn.into())
}

/// The contents of a report. Workers simulate the motions of the medoids.
async fn gathered(web: &Web, id: &CampaignId, pictures: PicturesOf) -> Result<report::Report, PageError> {
    web.archive.dispatch.check_staffed().or_status()?;
    // Clients of the services in this process, which use no network.
    let mut archive = CampaignServiceClient::new(CampaignServiceServer::new(web.archive.clone()));
    let mut labels = LabelServiceClient::new(LabelServiceServer::new(web.labels.clone()));
    let gathered = async {
        let names = report_data::names(&mut labels, id.as_str()).await?;
        report_data::report(&mut archive, id.as_str(), names, pictures).await
    };
    let gathered = gathered.await.map_err(|error| match error {
        report_data::ReportDataError::Service(status) => status,
        other => Status::internal(other.to_string()),
    })?;
    Ok(gathered)
}
