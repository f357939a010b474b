//! The pages themselves.

use super::{
    Web,
    archived::{self, Created},
    examples::EXAMPLES,
    layout::{Part, campaign_page, layout},
    page_error::PageError,
    visitor::Visitor,
};
use axum::{
    extract::{Path, Query, State},
    http::header::CONTENT_TYPE,
    response::IntoResponse,
};
use maud::{Markup, html};
use murmuration_engine::{
    blocking::blocking,
    campaign::{CampaignError, CampaignStatus},
    taxonomy::Taxonomy,
};
use murmuration_model::{CampaignRecord, CampaignState, Change, Stage, generations_in_words};
use murmuration_proto::{EmbedderSource, Feedback, counted, figure, grouped};
use murmuration_report::picture::image_png;

/// Pixels of the page for one of a picture.
const SCALE: u32 = 3;

/// The list of campaigns, and the buttons that start one.
pub(super) async fn campaigns(State(web): State<Web>, visitor: Visitor) -> Result<Markup, PageError> {
    let listed = web.campaigns.list().await?;
    Ok(layout(
        "Campaigns",
        &visitor,
        html! {
            h1 { "Campaigns" }
            p.lead { "Each campaign searches for the collective behaviours that a swarm of simple robots can show." }
            noscript { p.scriptless {
                "Without JavaScript this list does not update. Reload the page to see the current state."
            } }
            section aria-label="Campaigns" data-live="/events" { (table(&listed)) }
            section aria-labelledby="start" {
                h2 #start { "Start from an example" }
                ul.examples {
                    @for (name, what, _) in EXAMPLES {
                        li {
                            form method="post" action="/" {
                                input type="hidden" name="example" value=(name);
                                button { "Start " (name) }
                                span { (what) }
                            }
                        }
                    }
                }
            }
        },
    ))
}

/// The part of the list that changes, newest first.
pub(super) fn table(campaigns: &[CampaignStatus]) -> Markup {
    html! {
        @if campaigns.is_empty() {
            p { "There are no campaigns yet." }
        } @else {
            ul.campaigns {
                @for status in campaigns.iter().rev() {
                    @let id = status.record.id.as_str();
                    li {
                        a id={ "campaign-" (id) } href={ "/campaigns/" (id) } { (id) }
                        span.about { (status.record.spec.model()) " · " (status.record.spec.method()) }
                        (progress(status))
                    }
                }
            }
        }
    }
}

/// A campaign: its status, the buttons that steer it, and its specification.
pub(super) async fn campaign(
    State(web): State<Web>,
    Path(id): Path<String>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let status = web.campaigns.status(&id).await?;
    let id = status.record.id.as_str();
    Ok(campaign_page(
        &status.record,
        Part::Progress,
        &visitor,
        "live.js",
        html! {
            p.eyebrow { (status.record.spec.model()) " · " (status.record.spec.method()) }
            h1 { (id) }
            section aria-label="Status" data-live={ "/campaigns/" (id) "/events" } {
                (figures(&status))
                (taxonomy(&web, &status.record).await?)
            }
            section aria-labelledby="specification" {
                h2 #specification { "Specification" }
                details { summary { "All fields" } pre tabindex="0" { code { (status.record.spec.to_toml()) } } }
            }
        },
    ))
}

/// The taxonomy on a campaign's page; nothing before there is one.
pub(super) async fn taxonomy(web: &Web, record: &CampaignRecord) -> Result<Markup, CampaignError> {
    let (store, of) = (web.store.clone(), record.clone());
    let taxonomy = blocking(move || Taxonomy::read(&store, &of.id, &of.spec)).await??;
    Ok(taxonomy.map_or_else(Markup::default, |taxonomy| behaviours(record, &taxonomy)))
}

/// The part of a campaign's page that changes while it runs: progress, current figures, and buttons.
pub(super) fn figures(status: &CampaignStatus) -> Markup {
    let id = status.record.id.as_str();
    html! {
        (progress(status))
        (facts(status))
        @if !status.record.error.is_empty() { p.error role="alert" { (status.record.error) } }
        @if let Some(waiting) = &status.waiting { p.error role="alert" { (waiting) } }
        div.actions {
            @for change in [Change::Pause, Change::Resume, Change::Cancel] {
                @if offered(status, change) {
                    form method="post" action={ "/campaigns/" (id) "/" (change.name()) } {
                        button id=(change.name()) { (capitalised(change.name())) }
                    }
                }
            }
        }
    }
}

/// Whether to show a button: the state allows the change, and a running campaign is not resumed.
fn offered(status: &CampaignStatus, change: Change) -> bool {
    let allowed = status.record.state.after(change).is_some();
    allowed && !(change == Change::Resume && status.active)
}

fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

/// The progress of a campaign, as a bar and in words.
fn progress(status: &CampaignStatus) -> Markup {
    let amount = amount(status);
    let (done, total) = amount.map_or((0, 1), |(done, total, _)| (done, total.max(1)));
    let state = match status.record.state {
        CampaignState::Running if !status.active => "interrupted",
        CampaignState::Running if status.waiting.is_some() => "waiting",
        CampaignState::Running => stage(status.stage),
        state => state.name(),
    };
    html! {
        div.progress {
            progress value=(done) max=(total) aria-label={ "Progress of " (status.record.id) } {}
            span.figures {
                strong { (state) }
                @if let Some((done, total, unit)) = amount { " · " (grouped(done)) " of " (counted(total, unit)) }
            }
        }
    }
}

/// The stage of a running campaign and its progress, as a sentence.
pub(super) fn doing(status: &CampaignStatus) -> String {
    let stage = stage(status.stage);
    match amount(status) {
        Some((done, total, unit)) => format!("Now {stage}: {} of {}.", grouped(done), counted(total, unit)),
        None => format!("Now {stage}."),
    }
}

const fn stage(stage: Stage) -> &'static str {
    match stage {
        Stage::Dataset => "simulating the dataset",
        Stage::Pretrain => "training the embedder",
        Stage::Embed => "re-embedding the archive",
        Stage::Evolve => "searching",
        Stage::Label => "labelling",
        Stage::FineTune => "learning from labels",
        Stage::Taxonomy => "clustering",
    }
}

/// The amount that the stage has done, the amount that it has to do, and their unit in the singular; nothing before a
/// trainer has reported its epochs.
fn amount(status: &CampaignStatus) -> Option<(u64, u64, &'static str)> {
    let spec = &status.record.spec;
    let search = spec.search();
    let archived = status.record.individuals();
    let evaluations = u64::from(status.record.generations()) * u64::from(search.population());
    let arrived = u64::from(status.arrived);
    let (done, total, unit) = match (status.stage, spec.embedder()) {
        (Stage::Dataset, Some(EmbedderSource::Trained { dataset, .. })) => (
            status.record.dataset_done() + arrived,
            dataset.pictures(),
            "picture",
        ),
        (Stage::Pretrain | Stage::FineTune, _) => {
            let training = status.training?;
            (training.epoch, training.epochs, "epoch")
        }
        (Stage::Embed, _) => (status.record.embedder.embedded() + arrived, archived, "picture"),
        (Stage::Label, _) => {
            let wanted = spec.feedback().map_or(0, Feedback::labels);
            (arrived, wanted.into(), "label")
        }
        (Stage::Evolve, _) => (archived + arrived, evaluations, "evaluation"),
        (Stage::Taxonomy | Stage::Dataset, _) => (archived, evaluations, "evaluation"),
    };
    Some((done.min(total), total, unit))
}

/// Current figures.
fn facts(status: &CampaignStatus) -> Markup {
    let fact = |name: &str, value: String| html! { div { dt { (name) } dd { (value) } } };
    let record = &status.record;
    let generations = record.generations();
    let why = generations_in_words(&record.spec, generations, record.rounds.done);
    let why = why.map_or_else(String::new, |why| format!(": {why}"));
    html! {
        dl.facts {
            (fact("Generations", format!(
                "{} of {}{why}",
                grouped(record.generations_done.into()),
                grouped(generations.into())
            )))
            @if let Some((best, mean)) = status.record.last_novelty {
                (fact("Best novelty of the last generation", figure(best)))
                (fact("Mean novelty of the last generation", figure(mean)))
            }
            @if let Some(training) = status.training {
                @if let Some(loss) = training.loss { (fact("Loss", figure(loss))) }
                @if let Some(share) = training.triplet_accuracy {
                    (fact("Accuracy on held-out triplets", format!("{:.1} %", 100.0 * share)))
                }
            }
            @if status.per_second > 0.0 { (fact("Rate", format!("{} per second", grouped(status.per_second.round() as u64)))) }
            (fact("Workers", status.workers.to_string()))
            (fact("Trainers", status.trainers.to_string()))
            @if let Some(checkpoint) = status.record.embedder.checkpoint() {
                (fact("Checkpoint", checkpoint.to_string().chars().take(12).collect()))
            }
        }
        @if !status.notices.is_empty() {
            ul.notices aria-label="Notices" {
                @for notice in &status.notices { li { (notice.text) } }
            }
        }
    }
}

/// The medoids, largest cluster first.
fn behaviours(record: &CampaignRecord, taxonomy: &Taxonomy) -> Markup {
    let all = taxonomy.clusters.len().max(1) as f64;
    html! {
        h2 { (counted(taxonomy.medoids.len() as u64, "behaviour")) }
        p.lead {
            "Each picture shows the last steps of the swarm at the centre of a cluster. "
            a href={ "/campaigns/" (record.id) "/taxonomy" } { "Watch and name the behaviours" }
        }
        ul.behaviours {
            @for (place, medoid) in taxonomy.medoids.iter().enumerate() {
                @let index = medoid.individual.index;
                li {
                    img src=(archived::picture(record, index)) width="150" height="150" loading="lazy"
                        alt={ "Paths of behaviour " (place + 1) ", individual " (index) };
                    p title={ "cluster of " (grouped(medoid.cluster_size)) } { strong { (place + 1) } " · " (format!("{:.1} %", 100.0 * medoid.cluster_size as f64 / all)) }
                    p { code { (medoid.individual.controller) } }
                }
            }
        }
    }
}

/// An individual's picture, as a PNG.
pub(super) async fn image(
    State(web): State<Web>,
    Path((id, index)): Path<(String, u64)>,
    Query(created): Query<Created>,
) -> Result<impl IntoResponse, PageError> {
    let record = web.campaigns.status(&id).await?.record;
    let shape = record.spec.image().shape();
    let kept = created.keep(&record);
    let individual = blocking(move || web.store.individual(&record.id, record.spec.model(), index)).await??;
    let pixels = individual.into_image().ok_or(PageError::NoPage)?;
    let file = image_png(&pixels, shape, SCALE)?;
    Ok(([(CONTENT_TYPE, "image/png"), kept], file))
}
