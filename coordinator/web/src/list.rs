//! The list of campaigns: one line for each campaign, or for each study.

use super::{
    Web, archived,
    asked::Query,
    delete,
    found::{Line, Order, STATES, Values, Wanted},
    glossary::term,
    layout::layout_with,
    notes,
    of_campaign::OfCampaign,
    page_error::PageError,
    parts,
    stages::progress,
    visitor::Visitor,
};
use axum::{extract::State, response::Redirect};
use maud::{Markup, html};
use murmuration_engine::{blocking::in_background, campaign::CampaignStatus};
use murmuration_model::{CampaignId, CampaignRecord, CampaignState, Scalar};
use murmuration_swarm::{CampaignName, counted, figure, grouped};
use std::{
    collections::BTreeMap,
    sync::Arc,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

pub(super) async fn page(
    State(web): State<Web>,
    Query(parameters): Query<Vec<(String, String)>>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let wanted = Wanted::try_from(parameters)?;
    let table = table(&web, &wanted, Duration::ZERO).await?;
    Ok(layout_with(
        "Campaigns",
        &visitor,
        &["live.js", "campaigns.js"],
        html! {
            div.heading {
                h1 { "Campaigns" }
                a.button href="/new" { "New campaign" }
            }
            p.lead { "Each " (term("campaign", "campaign")) " searches for the collective behaviours that a swarm of simple robots can show." }
            noscript { p.scriptless {
                "Without JavaScript this list does not update. Reload the page to see the current state."
            } }
            form #find.filters method="get" action="/" role="search" {
                label { "Find " input #words name="words" type="search" placeholder="words" autocomplete="off" value=(wanted.words.as_str()) maxlength="200"; }
                label { "State "
                    select #state name="state" {
                        option value="" { "all" }
                        @for state in STATES { option selected[wanted.state == state] { (state) } }
                    }
                }
                label { "Sort by "
                    select #order name="order" {
                        @for order in Order::all() { option value=(order.name()) selected[wanted.order == order] { (order.title()) } }
                    }
                }
                label { input name="reversed" type="checkbox" value="yes" checked[wanted.reversed]; " reversed" }
                @for (name, value) in [("tag", &wanted.tag), ("study", &wanted.study)] {
                    @if !value.is_empty() { input type="hidden" name=(name) value=(value); }
                }
                button.plain { "Find" }
                (choice(&wanted))
            }
            section aria-label="Campaigns" data-live=(wanted.address("/events", wanted.page)) { (table) }
            form #compare.comparing method="get" action="/compare" {
                button.plain { "Compare the chosen campaigns" }
                button.plain.scripted #clear type="button" hidden { "Choose none" }
                p.reason #comparing role="status" { "Choose two to six campaigns with the boxes on the left." }
            }
        },
    ))
}

/// The part of the list that changes over time, with the newest campaign first. All searches share a list of campaigns that is at
/// most `age` old.
pub(super) async fn table(web: &Web, wanted: &Wanted, age: Duration) -> Result<Markup, PageError> {
    let heads = web.heads.follow(String::new());
    let campaigns = heads
        .within(age, async { web.campaigns.heads().await.map(Arc::new) })
        .await?;
    let values = values(web, wanted.order, age).await?;
    let of = wanted.clone();
    let found = in_background(move |_| of.of(&campaigns, &values)).await?;
    let statuses = web.campaigns.statuses(found.ids()).await?;
    let (ids, shown) = (found.ids(), wanted.scalars());
    let scalars = web.store.run(move |store| store.scalars(&ids, &shown)).await?;
    let by_id: BTreeMap<&str, &CampaignStatus> = statuses
        .iter()
        .map(|status| (status.record.id.as_str(), status))
        .collect();
    let line_of = |id: &CampaignId| html! { @if let Some(status) = by_id.get(id.as_str()) { (line(status, wanted, scalars.get(id))) } };
    Ok(html! {
        p.reason #shown {
            @if !wanted.tag.is_empty() { "With the tag " strong { (wanted.tag) } ": " }
            @if wanted.filters() { (grouped(found.matching as u64)) " of " (grouped(found.all as u64)) " shown. " a href=(wanted.unfiltered().address("/", 0)) { "Show all" } }
        }
        @if found.all == 0 {
            p { "There are no campaigns yet. " a href="/new" { "Start one" } "." }
        } @else if found.matching == 0 {
            p { "No campaign matches." }
        } @else {
            ul.campaigns {
                @for entry in &found.lines {
                    @match entry {
                        Line::Campaign(id) => (line_of(id)),
                        Line::Study { name, cells, states } => (folded(wanted, name, states, html! { @for id in cells { (line_of(id)) } })),
                    }
                }
            }
            (pages(wanted, found.pages))
        }
    })
}

/// The values of the scalar that the order needs; empty if the order needs none. All searches share values that are at most `age`
/// old.
async fn values(web: &Web, order: Order, age: Duration) -> Result<Arc<Values>, PageError> {
    let Order::By(scalar) = order else {
        return Ok(Arc::default());
    };
    let values = web.scalars.follow(order.name().to_owned());
    let read = async {
        web.store
            .run(move |store| store.scalar(scalar))
            .await
            .map(Arc::new)
    };
    Ok(values.within(age, read).await?)
}

/// The folded boxes that choose the scalars of the list.
fn choice(wanted: &Wanted) -> Markup {
    html! {
        details.choice {
            summary { "Numbers" }
            fieldset {
                legend.unseen { "Numbers to show" }
                @for scalar in Scalar::ALL.into_iter().filter(|scalar| *scalar != Scalar::Duration) {
                    label { input name="show" type="checkbox" value=(scalar.name()) checked[wanted.shown.contains(&scalar)]; " " (scalar.title()) }
                }
            }
        }
    }
}

/// The value of a scalar as text.
fn shown(scalar: Scalar, value: f64) -> String {
    match scalar {
        Scalar::Evaluations | Scalar::Generations | Scalar::Clusters | Scalar::LabelEntries => {
            grouped(value as u64)
        }
        Scalar::BestNovelty | Scalar::MeanNovelty | Scalar::Loss => figure(value),
        Scalar::Accuracy => format!("{:.1} %", 100.0 * value),
        Scalar::Duration => duration(value as u64),
    }
}

/// Links to the other pages of the list; empty if the list has only one page.
fn pages(wanted: &Wanted, pages: usize) -> Markup {
    let page = wanted.page.min(pages - 1);
    html! {
        @if pages > 1 {
            nav.pages aria-label="Pages of the list" {
                @if page > 0 { a href=(wanted.address("/", page - 1)) { "Previous" } }
                span { "Page " (page + 1) " of " (grouped(pages as u64)) }
                @if page + 1 < pages { a href=(wanted.address("/", page + 1)) { "Next" } }
            }
        }
    }
}

/// The campaigns of a study, folded until a person unfolds them; a filtered list has them unfolded.
fn folded(wanted: &Wanted, study: &CampaignName, states: &BTreeMap<&str, u64>, cells: Markup) -> Markup {
    let all: u64 = states.values().sum();
    let message: Vec<String> = states
        .iter()
        .map(|(state, count)| format!("{count} {state}"))
        .collect();
    let of_study = Wanted {
        study: study.as_str().to_owned(),
        ..wanted.clone()
    };
    html! {
        li.study id={ "study-" (study.as_str()) } {
            details open[wanted.filters()] {
                summary {
                    strong { "Study " (study.as_str()) }
                    span.about { (counted(all, "campaign")) ": " (message.join(", ")) }
                }
                ul.campaigns { (cells) }
                p.reason { a href=(of_study.address("/", 0)) { "Only the campaigns of this study" } }
            }
        }
    }
}

fn line(status: &CampaignStatus, wanted: &Wanted, values: Option<&Vec<Option<f64>>>) -> Markup {
    let record = &status.record;
    let id = record.id.as_str();
    html! {
        li.listed id={ "line-" (id) } {
            input.choose type="checkbox" form="compare" name="campaign" value=(id) aria-label={ "Compare " (id) };
            img src=(picture(record)) alt="" width="60" height="60" loading="lazy";
            div.what {
                a id={ "campaign-" (id) } href={ "/campaigns/" (id) } { (id) }
                span.about {
                    (record.spec.model()) " · " (record.spec.method())
                    @if let Some(beginning) = parts::beginning(&record.spec) { " · " (beginning) }
                }
                span.about { (when(record)) }
                (notes::chips(&record.notes.tags, wanted))
                @if let Some(first) = record.notes.note.as_str().lines().next() { span.about.first-line { (first) } }
            }
            (progress(status))
            div { (delete::menu(record)) }
            @if let Some(values) = values.filter(|values| !values.is_empty()) {
                dl.scalars {
                    @for (scalar, value) in wanted.scalars().into_iter().zip(values) {
                        div { dt { (scalar.title()) } dd { (value.map_or_else(|| "–".to_owned(), |value| shown(scalar, value))) } }
                    }
                }
            }
        }
    }
}

/// The address of the picture of a campaign: of its largest cluster's medoid, or else of its newest individual, or else of its
/// robot.
fn picture(record: &CampaignRecord) -> String {
    match record.individuals().checked_sub(1) {
        None => format!("/campaigns/{}/robot", record.id),
        Some(_) if record.state == CampaignState::Completed => format!("/campaigns/{}/behaviour", record.id),
        Some(newest) => archived::picture(record, newest),
    }
}

/// Redirects to the picture of the largest cluster's medoid. With the redirect, the coordinator looks up this medoid only if a
/// browser shows the campaign.
pub(super) async fn behaviour(OfCampaign { web, record, .. }: OfCampaign) -> Result<Redirect, PageError> {
    let campaign = record.id.clone();
    let first = web.store.run(move |store| store.first_medoid(&campaign)).await?;
    let first = first.ok_or(PageError::NoPage)?;
    Ok(Redirect::temporary(&archived::paths(&record, first)))
}

/// The time at which a campaign was created, and its duration.
fn when(record: &CampaignRecord) -> Markup {
    let is_running = record.state == CampaignState::Running;
    let ended = record.ended_ms.or_else(|| is_running.then(now_ms));
    let took = ended.map(|ended| {
        let ms = ended.saturating_sub(record.created_ms);
        // The duration of a running campaign is rounded to the minute, because the list is sent again whenever it changes.
        if is_running { so_far(ms) } else { duration(ms) }
    });
    html! {
        (parts::moment(record.created_ms))
        @if let Some(took) = took {
            " · " span title="From when the campaign was created, pauses included" { (took) @if is_running { " so far" } }
        }
    }
}

fn now_ms() -> u64 {
    let age = SystemTime::now().duration_since(UNIX_EPOCH);
    age.map_or(0, |age| age.as_millis() as u64)
}

/// A duration that continues, to the minute.
fn so_far(ms: u64) -> String {
    match ms / 60_000 {
        0 => "under a minute".to_owned(),
        minutes @ 1..60 => format!("{minutes} min"),
        _ => duration(ms),
    }
}

/// A duration, in at most two units.
fn duration(ms: u64) -> String {
    let seconds = ms / 1000;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        3600..86_400 => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
        _ => format!("{} d {} h", seconds / 86_400, seconds / 3600 % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_two_parts() {
        for (seconds, expected) in [
            (59, "59 s"),
            (60, "1 min 0 s"),
            (3_599, "59 min 59 s"),
            (3_660, "1 h 1 min"),
            (180_000, "2 d 2 h"),
        ] {
            assert_eq!(duration(seconds * 1000 + 999), expected);
        }
    }

    #[test]
    fn a_duration_that_goes_on_changes_once_a_minute() {
        for minute in [0, 1, 59, 60, 61, 2000] {
            let begins = minute * 60_000;
            assert_eq!(so_far(begins), so_far(begins + 59_999));
        }
        assert_eq!(so_far(61_000), "1 min");
    }
}
