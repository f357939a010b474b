//! A campaign's page, the actions behind its buttons, and its pictures.

use super::{
    Web,
    archived::Created,
    asked::{Form, Query},
    delete, history,
    layout::{Part, campaign_page},
    machines, notes,
    of_campaign::{OfCampaign, page_of},
    page_error::PageError,
    parts,
    stages::{progress, stage_left, whole_left},
    taxonomy::{
        card::{Card, brief},
        folding,
        shown_version::ShownVersion,
    },
    visitor::Visitor,
};
use axum::{
    extract::{Path, State},
    http::header::CONTENT_TYPE,
    response::{IntoResponse, Redirect},
};
use maud::{Markup, html};
use murmuration_engine::campaign::{CampaignError, CampaignStatus};
use murmuration_model::{CampaignId, CampaignRecord, CampaignState, Change, Stage, generations_in_words};
use murmuration_report::picture::{image_png, robot_svg};
use murmuration_store::{Store, StoreError, TaxonomyVersion};
use murmuration_swarm::{EmbedderSource, World, counted, figure, grouped};

/// The warning before a campaign is cancelled.
const CANCELLING: &str = "Cancelling ends this campaign for good: it cannot be resumed. Its archive and its labels stay. To stop it for a while, \
                          pause it.";

/// Number of newest behaviours, and of most novel behaviours, on the page of a campaign that searches.
pub(super) const SHOWN: usize = 3;

/// The page of a campaign: its status, the buttons that control the campaign, and its specification.
pub(super) async fn campaign(
    State(web): State<Web>,
    Path(id): Path<String>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let status = web.campaigns.status(&id).await?;
    let id = status.record.id.as_str();
    let running = status.record.state == CampaignState::Running;
    let of = status.record.id.clone();
    // Read before the cards: if the state changes meanwhile, the page asks for them again.
    let cards_state = web.store.run(move |store| cards_state(store, &of)).await?;
    let cards = behaviours(&web, &status.record).await?;
    let slots = Slots {
        history: rounds(&web, &status.record).await?,
        ..Slots::of(&web, &status, cards_state.as_deref()).await
    };
    Ok(campaign_page(
        &status.record,
        Part::Progress,
        &visitor,
        html! {
            p.eyebrow {
                (status.record.spec.model()) " · " (status.record.spec.method())
                @if let Some(beginning) = parts::beginning(&status.record.spec) { " · " (beginning) }
            }
            h1 { (id) }
            (notes::section(&status.record))
            div data-live={ "/campaigns/" (id) "/events" } {
                section aria-label="Status" data-slot="status" { (slots.status) }
                div #found {
                    div #cards { (cards) }
                    (found(running, status.record.spec.world()))
                }
                (curve("novelty", "Novelty", running || status.record.generations_done > 1))
                (training_curves(trains(&status.record)))
                div data-slot="history" { (slots.history) }
                div data-slot="around" { (slots.around) }
            }
            section aria-labelledby="specification" {
                h2 #specification { "Specification" }
                p { a href={ "/new?from=" (id) } { "Start a campaign with this specification, changed or not" } }
                details { summary { "All fields" } pre tabindex="0" { code { (status.record.spec.to_toml()) } } }
            }
        },
    ))
}

/// State of the cards on a campaign's page: the version of the taxonomy and the length of the label log. `None` if the campaign has
/// no current taxonomy.
pub(super) fn cards_state(store: &Store, id: &CampaignId) -> Result<Option<String>, StoreError> {
    let versions = store.taxonomy_versions(id)?;
    let current = versions.last().filter(|version| version.stands);
    let state = |version: &TaxonomyVersion| Ok(format!("{}-{}", version.version, store.label_entries(id)?));
    current.map(state).transpose()
}

/// The findings and the cards alone, for a page whose cards have changed. They are no part of the event stream: measuring a
/// taxonomy costs too much for a stream.
pub(super) async fn cards(OfCampaign { web, record, .. }: OfCampaign) -> Result<Markup, PageError> {
    behaviours(&web, &record).await
}

/// The rounds of learning of a campaign, as a table.
pub(super) async fn rounds(web: &Web, record: &CampaignRecord) -> Result<Markup, CampaignError> {
    let record = record.clone();
    Ok(web.store.run(move |store| history::read(store, &record)).await?)
}

/// Placeholder in which a script plays behaviours that were found, until the campaign has a taxonomy. The placeholder has its
/// final size from the beginning.
fn found(running: bool, world: &World) -> Markup {
    html! {
        section.scripted #shown aria-label="Behaviours as they are found" hidden[!running] {
            div.heading { h2 { "Behaviours as they are found" } button.plain #rest type="button" aria-pressed="false" { "Pause the motions" } }
            @for (id, title) in [("newest", "The newest"), ("novel", "The most novel, each of another generation")] {
                h3 { (title) }
                ul.moving #(id) { @for _ in 0..SHOWN { li.player {
                    div.stage { (parts::shape(world)) img alt="" hidden; canvas role="img" aria-label="No behaviour yet" {} p.waiting { "None yet" } }
                    p.reason {}
                } } }
            }
        }
    }
}

/// Text in place of a curve that has fewer than two points.
const NO_CURVE: &str = "The curve begins with its second point.";

/// The place of a curve that a script draws. The place has its final size from the beginning.
fn curve(id: &str, title: &str, shown: bool) -> Markup {
    html! {
        section.scripted #(id) aria-label=(title) hidden[!shown] {
            h2 { (title) }
            div.chart { div.reason.none { (NO_CURVE) } }
        }
    }
}

/// The places of the two training curves, accuracy and loss, side by side.
fn training_curves(shown: bool) -> Markup {
    html! {
        section.scripted #training aria-label="Training" hidden[!shown] {
            h2 { "Training" }
            div.charts {
                @for (id, title) in [("accuracy", "Accuracy on held-out triplets"), ("loss", "Loss")] {
                    div {
                        h3 { (title) }
                        div.chart #(id) { div.reason.none { (NO_CURVE) } }
                    }
                }
            }
        }
    }
}

/// Whether a campaign has training curves: from the training of its own embedder, or from a round.
fn trains(record: &CampaignRecord) -> bool {
    matches!(record.spec.embedder(), Some(EmbedderSource::Trained { .. })) || record.rounds.done > 0
}

/// The parts of a campaign's page that change while the campaign runs. The fields have the names of the page's slots.
#[derive(Debug, Default)]
pub(super) struct Slots {
    pub(super) status: Markup,
    pub(super) history: Markup,
    /// Connected machines, and notices.
    pub(super) around: Markup,
}

impl Slots {
    /// The slots without the history, which takes longer to read. `cards` is the [`cards_state`].
    pub(super) async fn of(web: &Web, status: &CampaignStatus, cards: Option<&str>) -> Self {
        let running = status.record.state == CampaignState::Running;
        let (workers, trainers) = match running {
            true => web.campaigns.machines().await,
            false => Default::default(),
        };
        Self {
            status: figures(status, cards),
            history: Markup::default(),
            around: html! {
                (machines::table(&workers, &trainers))
                @if !status.notices.is_empty() {
                    section aria-labelledby="noticed" {
                        h2 #noticed { "Notices" }
                        ul.notices { @for notice in &status.notices { li { (notice.text) } } }
                    }
                }
                (extension(&status.record))
            },
        }
    }

    /// The markup for a script, which puts it into the slots of the page.
    pub(super) fn sent(&self) -> String {
        let slots = [
            ("status", &self.status),
            ("history", &self.history),
            ("around", &self.around),
        ];
        let slots = html! { @for (name, content) in slots { div data-slot=(name) { (content) } } };
        slots.into_string()
    }
}

/// The progress, the buttons and the current figures of a campaign.
fn figures(status: &CampaignStatus, cards: Option<&str>) -> Markup {
    let id = status.record.id.as_str();
    html! {
        (progress(status))
        @if !status.record.error.is_empty() { p.error role="alert" { (status.record.error) } }
        // While the campaign runs, the line always has its place, so that nothing below it moves.
        @if status.record.state == CampaignState::Running {
            div.waits-for { @if let Some(waiting) = &status.waiting { p.error role="status" { (waiting) } } }
        }
        div.actions {
            @if status.record.state == CampaignState::Completed {
                a.button.main href={ "/campaigns/" (id) "/taxonomy" } { "See the behaviours" }
            }
            @for change in [Change::Pause, Change::Resume, Change::Cancel] {
                @if offered(status, change) {
                    @let for_good = change == Change::Cancel;
                    form method="post" action={ "/campaigns/" (id) "/" (change.name()) } data-ask=[for_good.then_some(CANCELLING)]
                        data-yes=[for_good.then_some("Cancel the campaign")] {
                        button id=(change.name()) class=[for_good.then_some("danger")] { (capitalised(change.name())) }
                    }
                }
            }
            (delete::menu(&status.record))
        }
        // The figures come last, because their list becomes shorter when the campaign ends.
        (facts(status, cards))
    }
}

/// The form that continues the search of a completed campaign.
fn extension(record: &CampaignRecord) -> Markup {
    let generations = record.spec.search().generations();
    let can_go_on = record.state.after(Change::Extend).is_some()
        && record.study.is_none()
        && record.rounds.done == 0
        && record
            .spec
            .with_generations(generations.saturating_add(1))
            .is_ok();
    html! {
        @if can_go_on {
            form.extend method="post" action={ "/campaigns/" (record.id) "/extend" } {
                label for="generations" { "Search on to " }
                input #generations name="generations" type="number" required min=(generations + 1)
                    value=(generations.saturating_mul(2)) aria-describedby="extended";
                " generations "
                button #extend { "Extend" }
                p #extended {
                    "The archive becomes that of a campaign that asked for so many from the start, unless this one has adopted another \
                     checkpoint. The taxonomy stays in the history."
                }
            }
        }
    }
}

/// Whether the campaign evaluates generations now.
fn searches(status: &CampaignStatus) -> bool {
    status.active && status.stage == Stage::Evolve
}

/// Whether to show the button for a change: the state must allow the change, and a running campaign cannot be resumed.
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

/// The current figures of a campaign. While the campaign runs, unknown figures also have a place, so that nothing below them
/// moves.
fn facts(status: &CampaignStatus, cards: Option<&str>) -> Markup {
    let record = &status.record;
    let running = record.state == CampaignState::Running;
    let fact = |name: &str, value: Option<String>| {
        html! { @if running || value.is_some() { div { dt { (name) } dd { (value.as_deref().unwrap_or("–")) } } } }
    };
    let generations = record.generations();
    let why = generations_in_words(&record.spec, generations, record.rounds.done);
    let why = why.map_or_else(String::new, |why| format!(": {why}"));
    let done = format!(
        "{} of {}{why}",
        grouped(record.generations_done.into()),
        grouped(generations.into())
    );
    let training = status.training;
    let accuracy = training.and_then(|training| training.triplet_accuracy);
    let rate = Some(status.per_second).filter(|&rate| rate > 0.0);
    let checkpoint = record.embedder.checkpoint();
    html! {
        dl.facts data-generations=(record.generations_done) data-epoch=[training.map(|training| training.epoch)]
            data-notices=(status.notices.last().map_or(0, |notice| notice.number))
            data-searching=[searches(status).then_some("yes")] data-cards=[cards] {
            (fact("Generations", Some(done)))
            @if record.spec.has_novelty() {
                (fact("Best novelty of the last generation", record.last_novelty.map(|(best, _)| figure(best))))
                (fact("Mean novelty of the last generation", record.last_novelty.map(|(_, mean)| figure(mean))))
            }
            @if trains(record) {
                (fact("Loss", training.and_then(|training| training.loss).map(figure)))
                (fact("Accuracy on held-out triplets", accuracy.map(|share| format!("{:.1} %", 100.0 * share))))
            }
            (fact("Time left in this stage", stage_left(status)))
            // The time left always takes one line, so that nothing below it moves.
            @if running { div { dt { "Time left in all" } dd.on-one-line { (whole_left(status).as_deref().unwrap_or("–")) } } }
            (fact("Rate", rate.map(|rate| format!("{} per second", grouped(rate.round() as u64)))))
            (fact("Workers", Some(status.workers.to_string())))
            (fact("Trainers", Some(status.trainers.to_string())))
            @if record.spec.space().embeds() {
                (fact("Checkpoint", checkpoint.map(|checkpoint| checkpoint.to_string().chars().take(12).collect())))
            }
        }
    }
}

/// The findings and the cards of the distinct behaviours, largest cluster first; empty if the campaign has no taxonomy yet.
async fn behaviours(web: &Web, record: &CampaignRecord) -> Result<Markup, PageError> {
    let Some(shown) = &ShownVersion::current(web, record).await? else {
        return Ok(Markup::default());
    };
    let (distinct, others) = folding(record, shown);
    let others = others.concat();
    let taxonomy = format!("/campaigns/{}/taxonomy", record.id);
    Ok(html! {
        h2 { (counted(shown.taxonomy.medoids.len() as u64, "cluster")) " of behaviours" }
        (shown.answer())
        p.lead {
            "Each picture shows the last steps of a swarm that stands for a cluster. "
            a href=(taxonomy) { "Watch and name the behaviours" }
        }
        ul.medoids {
            @for group in &distinct {
                @if let [place, more @ ..] = group.as_slice() {
                    li {
                        (brief(&Card { record, shown, place: *place }))
                        @if !more.is_empty() { p.reason { "and " (counted(more.len() as u64, "more cluster")) " with this name" } }
                    }
                }
            }
        }
        @if !others.is_empty() { p.reason { a href=(taxonomy) { (shown.folded(&others)) } } }
    })
}

/// A drawing of the robots of a campaign's first species.
pub(super) async fn robot(OfCampaign { record, .. }: OfCampaign) -> Result<impl IntoResponse, PageError> {
    let species = record.spec.model().species().first().ok_or(PageError::NoPage)?;
    let drawing = robot_svg(species.robot(), None).into_string();
    Ok(([(CONTENT_TYPE, "image/svg+xml")], drawing))
}

/// An individual's picture, as a PNG in its own size. A browser enlarges the picture faster than this process encodes a larger
/// picture.
pub(super) async fn image(
    Path((_, index)): Path<(String, u64)>,
    Query(created): Query<Created>,
    OfCampaign { web, record, .. }: OfCampaign,
) -> Result<impl IntoResponse, PageError> {
    let shape = record.spec.image().shape();
    let kept = created.keep(&record);
    let read = move |store: &Store| store.individual(&record.id, record.spec.model(), index);
    let individual = web.store.run(read).await?;
    let pixels = individual.into_image().ok_or(PageError::NoPage)?;
    let file = image_png(&pixels, shape, 1)?;
    Ok(([(CONTENT_TYPE, "image/png"), kept], file))
}

pub(super) async fn pause(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    let paused = web.campaigns.pause(&id).await?;
    Ok(page_of(paused.record.id.as_str()))
}

pub(super) async fn resume(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    let resumed = web.campaigns.resume(&id).await?;
    Ok(page_of(resumed.record.id.as_str()))
}

pub(super) async fn cancel(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    let cancelled = web.campaigns.cancel(&id).await?;
    Ok(page_of(cancelled.record.id.as_str()))
}

/// The form of [`extend`].
#[derive(Debug, serde::Deserialize)]
pub(super) struct Extension {
    generations: u32,
}

pub(super) async fn extend(
    State(web): State<Web>,
    Path(id): Path<String>,
    Form(extension): Form<Extension>,
) -> Result<Redirect, PageError> {
    let extended = web.campaigns.extend(&id, extension.generations).await?;
    Ok(page_of(extended.record.id.as_str()))
}
