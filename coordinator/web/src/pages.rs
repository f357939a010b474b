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
use murmuration_proto::{EmbedderSource, Feedback, counted, noun};
use murmuration_report::picture::grey_png;

/// Pixels of the page for one of a picture.
const SCALE: u32 = 3;

/// Every campaign, and how to start another.
pub(super) async fn campaigns(State(web): State<Web>, visitor: Visitor) -> Result<Markup, PageError> {
    let listed = web.campaigns.list().await?;
    Ok(layout(
        "Campaigns",
        &visitor,
        html! {
            h1 { "Campaigns" }
            p.lead { "Which collective behaviours can a swarm of such robots show? Each campaign is a search for them." }
            noscript { p.scriptless {
                "This list shows how the campaigns stood when it was loaded: without JavaScript it does not follow what happens. "
                "Load it again for news."
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
            p { "There is none yet." }
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

/// One campaign: how it stands, what can be done with it, what it was asked.
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
            section aria-label="How it stands" data-live={ "/campaigns/" (id) "/events" } {
                (figures(&status))
                (taxonomy(&web, &status.record).await?)
            }
            section aria-labelledby="specification" {
                h2 #specification { "Specification" }
                details { summary { "Every field" } pre tabindex="0" { code { (status.record.spec.to_toml()) } } }
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

/// What of a campaign's page changes while it runs: progress, figures of the moment, and what can be done.
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

/// Whether a button for that makes sense: what the state allows, but not to resume what runs.
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

/// How far a campaign has come, as a bar and in words.
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
                @if let Some((done, total, unit)) = amount { " · " (done) " of " (total) " " (noun(total, unit)) }
            }
        }
    }
}

/// What is being done with a campaign at work, and how far.
pub(super) fn doing(status: &CampaignStatus) -> String {
    let stage = stage(status.stage);
    match amount(status) {
        Some((done, total, unit)) => format!("Now {stage}: {done} of {total} {}.", noun(total, unit)),
        None => format!("Now {stage}."),
    }
}

const fn stage(stage: Stage) -> &'static str {
    match stage {
        Stage::Dataset => "simulating the dataset",
        Stage::Pretrain => "training the embedder",
        Stage::Embed => "embedding anew",
        Stage::Evolve => "searching",
        Stage::Label => "labelling",
        Stage::FineTune => "learning from labels",
        Stage::Taxonomy => "clustering",
    }
}

/// What the stage has done and has to do, and of what, in the singular; nothing before a trainer has said how much that is.
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
        (Stage::Embed, _) => (status.record.embedded + arrived, archived, "picture"),
        (Stage::Label, _) => {
            let wanted = spec.feedback().map_or(0, Feedback::labels);
            (arrived, wanted.into(), "label")
        }
        (Stage::Evolve, _) => (archived + arrived, evaluations, "evaluation"),
        (Stage::Taxonomy | Stage::Dataset, _) => (archived, evaluations, "evaluation"),
    };
    Some((done.min(total), total, unit))
}

/// Figures of the moment.
fn facts(status: &CampaignStatus) -> Markup {
    let fact = |name: &str, value: String| html! { div { dt { (name) } dd { (value) } } };
    let record = &status.record;
    let generations = record.generations();
    let why = generations_in_words(&record.spec, generations, record.rounds_done);
    let why = why.map_or_else(String::new, |why| format!(": {why}"));
    html! {
        dl.facts {
            (fact("Generations", format!("{} of {generations}{why}", record.generations_done)))
            @if let Some((best, mean)) = status.record.last_novelty {
                (fact("Best novelty of the last generation", format!("{best:.4}")))
                (fact("Mean novelty of the last generation", format!("{mean:.4}")))
            }
            @if let Some(training) = status.training {
                @if let Some(loss) = training.loss { (fact("Loss", format!("{loss:.4}"))) }
                @if let Some(share) = training.triplet_accuracy {
                    (fact("Held-out triplets", format!("{:.1} %", 100.0 * share)))
                }
            }
            @if status.per_second > 0.0 { (fact("Rate", format!("{:.0} a second", status.per_second))) }
            (fact("Workers", status.workers.to_string()))
            (fact("Trainers", status.trainers.to_string()))
            @if let Some(checkpoint) = status.record.checkpoint {
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
            "One picture a cluster: the last steps of the swarm at its centre. "
            a href={ "/campaigns/" (record.id) "/taxonomy" } { "Watch and name them" }
        }
        ul.behaviours {
            @for (place, medoid) in taxonomy.medoids.iter().enumerate() {
                @let index = medoid.individual.index;
                li {
                    img src=(archived::picture(record, index)) width="150" height="150" loading="lazy"
                        alt={ "Paths of behaviour " (place + 1) ", individual " (index) };
                    p title={ "cluster of " (medoid.cluster_size) } { strong { (place + 1) } " · " (format!("{:.1} %", 100.0 * medoid.cluster_size as f64 / all)) }
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
    let resolution = record.spec.image().resolution();
    let kept = created.keep(&record);
    let individual = blocking(move || web.store.individual(&record.id, record.spec.model(), index)).await??;
    let pixels = individual.image.ok_or(PageError::NoPage)?;
    let file = grey_png(&pixels, resolution, SCALE)?;
    Ok(([(CONTENT_TYPE, "image/png"), kept], file))
}
