//! The page of a campaign's taxonomy: people watch behaviours, name behaviours, see what learning changed, and download the
//! report.

mod alike;
pub(super) mod card;
pub(super) mod changes;
pub(super) mod figure;
mod further_starts;
pub(super) mod map;
mod measured;
pub(super) mod shown_version;
pub(super) mod starts;
mod versions;

pub use further_starts::FurtherStarts;
pub use measured::Measurements;

use super::{
    Web,
    asked::Query,
    keys,
    layout::{Part, campaign_page},
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
use murmuration_engine::blocking::{in_background, parallel};
use murmuration_model::{ArchiveVersion, CampaignId, CampaignRecord, CampaignState, Rounds};
use murmuration_proto::v1::{
    campaign_service_client::CampaignServiceClient, campaign_service_server::CampaignServiceServer,
    label_service_client::LabelServiceClient, label_service_server::LabelServiceServer,
};
use murmuration_report as report;
use murmuration_service::{
    OrStatus as _,
    report_data::{self, PicturesOf},
};
use murmuration_store::kept::LatestAnswers;
use serde::Deserialize;
use shown_version::ShownVersion;
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

/// Number of individuals that a click adds besides the medoids, and maximum number of these individuals.
const MORE: usize = 12;
const MOST_MORE: usize = 240;

pub(super) async fn page(
    Query(asked): Query<Asked>,
    OfCampaign { web, record, visitor }: OfCampaign,
) -> Result<Markup, PageError> {
    let shown = ShownVersion::read(&web, &record, asked.version).await?;
    if shown.is_none() && asked.version.is_some() {
        return Err(PageError::NoPage);
    }
    let stands = shown.as_ref().is_some_and(|shown| shown.version.stands);
    let further = match asked.more.filter(|_| stands) {
        Some(more) => {
            let queries = &web.labels.queries;
            queries
                .beyond_medoids(&record, more.min(MOST_MORE))
                .await
                .or_status()?
        }
        None => Vec::new(),
    };
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
            Some(shown) => (behaviours(&record, shown, &further)),
        }
    };
    Ok(campaign_page(&record, Part::Taxonomy, &visitor, content))
}

/// The buttons for actions on a whole version.
fn actions(record: &CampaignRecord, shown: &ShownVersion) -> Markup {
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

/// The cards of a version, with an introduction.
fn behaviours(record: &CampaignRecord, shown: &ShownVersion, individuals: &[usize]) -> Markup {
    let embeds = record.spec.space().embeds();
    html! {
        (versions::list(record, shown))
        (shown.answer())
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
            details.others-shown { summary { (shown.folded(&folded)) } (groups(record, shown, &others)) }
        }
        @if shown.version.stands { (further(record, shown, individuals)) }
        (alike::section(record, shown))
    }
}

/// The groups of clusters with the same name that the page shows first, and the other groups, which it folds.
pub(super) fn folding(record: &CampaignRecord, shown: &ShownVersion) -> (Groups, Groups) {
    let (first, _) = shown.folding(record);
    alike::groups(shown)
        .into_iter()
        .partition(|group| group.iter().any(|place| first.contains(place)))
}

/// Clusters with the same name, by their places.
pub(super) type Groups = Vec<Vec<usize>>;

fn groups(record: &CampaignRecord, shown: &ShownVersion, groups: &[Vec<usize>]) -> Markup {
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
fn further(record: &CampaignRecord, shown: &ShownVersion, further: &[usize]) -> Markup {
    let count = further.len();
    let medoids = shown.taxonomy.medoids.len();
    let given = shown.labels.given_classes();
    html! {
        section #more {
            @if count > 0 {
                h2 { "Further behaviours" }
                p.reason { "Each behaviour is the farthest from those above and from those listed before it." }
                ul.medoids { @for index in further.iter().map(|&index| index as u64) { li { (card::further(record, given.get(&index), index)) } } }
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
