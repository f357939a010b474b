//! The states of the cells of a study, from the measurements and from the coordinator's campaigns.

use super::{
    known::{Known, State},
    loaded::{Job, Jobs, Loaded},
};
use maud::{Markup, html};
use murmuration_swarm::{counted, grouped};
use std::collections::BTreeMap;

/// The state of a campaign that a study needs, and the id of the campaign, if it exists.
#[derive(Debug)]
struct Seen {
    state: State,
    campaign: Option<String>,
    /// Whether the campaign was deleted; its measurements stay.
    is_deleted: bool,
}

/// The states of the campaigns of a study, in the order of its [`Jobs`].
#[derive(Debug)]
pub(super) struct Sight {
    before: Vec<Seen>,
    cells: Vec<Seen>,
}

impl Sight {
    /// Looks up the jobs of a study among the known campaigns.
    pub(super) fn of(jobs: &Jobs, known: &Known) -> Self {
        let seen = |job: &Job| {
            let found = job.digest.as_ref().and_then(|digest| known.get(digest));
            // A measurement names its campaign. This campaign is not always the oldest campaign with its specification.
            let named = job.done.clone().filter(|campaign| !campaign.is_empty());
            let campaign = named.or_else(|| found.map(|(id, _)| id.clone()));
            Seen {
                is_deleted: campaign.as_ref().is_some_and(|id| known.lost(id, jobs.read)),
                campaign,
                state: match &job.done {
                    Some(_) => State::Done,
                    None => found.map_or(State::Waiting, |(_, state)| state.clone()),
                },
            }
        };
        Self {
            before: jobs.before.iter().map(seen).collect(),
            cells: jobs.cells.iter().map(seen).collect(),
        }
    }

    pub(super) fn cells(&self) -> usize {
        self.cells.len()
    }

    fn done(&self) -> usize {
        self.cells.iter().filter(|seen| seen.state == State::Done).count()
    }

    /// The number of cells in each state, as a bar and in words.
    pub(super) fn progress(&self) -> Markup {
        let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
        for seen in &self.cells {
            *counts.entry(seen.state.name()).or_default() += 1;
        }
        html! {
            div.progress {
                progress value=(self.done()) max=(self.cells().max(1)) aria-label="Cells that are done" {}
                span.figures {
                    @for (place, (name, count)) in counts.iter().enumerate() {
                        @if place > 0 { " · " }
                        strong { (grouped(*count)) } " " (name)
                    }
                }
            }
        }
    }

    /// The part of a study's page that changes while the study runs. Its `data-version` shows a script when the tables have
    /// changed.
    pub(super) fn markup(&self, loaded: &Loaded) -> Markup {
        let study = loaded.outcome.study();
        let cells = study.cells.iter().zip(&self.cells);
        html! {
            div data-version=(loaded.version) {
                (self.progress())
                @if self.done() < self.cells() {
                    p.reason { code { "murmuration lab study run" } " starts the waiting cells and measures the completed ones." }
                }
                @if !self.before.is_empty() {
                    h2 { "Before the cells" }
                    ul.before {
                        @for (job, seen) in loaded.jobs.before.iter().zip(&self.before) {
                            li { (job.words) ": " (state_in_words(seen)) " " (campaign(seen)) }
                        }
                    }
                }
                h2 { "Cells" }
                div.study {
                    div.wide.cells tabindex="0" role="group" aria-label="Cells" {
                        table {
                            thead { tr {
                                @for axis in &study.axes { th { (axis.name) } }
                                th.number { "seed" } th { "state" } th { "campaign" }
                            } }
                            tbody {
                                @for (cell, seen) in cells {
                                    tr {
                                        @for name in study.names(&cell.values) { td { (name) } }
                                        td.number { (cell.spec.seed()) }
                                        td { (state_in_words(seen)) }
                                        td { (campaign(seen)) }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn state_in_words(seen: &Seen) -> Markup {
    html! {
        span.state data-state=(seen.state.name()) { (seen.state.name()) }
        @match &seen.state {
            State::Running(done, all) => {
                ": " (grouped((*done).into())) " of " (counted((*all).into(), "generation"))
            },
            State::Failed(error) => span.error { ": " (error) },
            State::Waiting | State::Stopped(_) | State::Measuring | State::Done => {},
        }
    }
}

fn campaign(seen: &Seen) -> Markup {
    html! {
        @match (&seen.campaign, seen.is_deleted) {
            (Some(id), true) => { (id) " (deleted)" },
            (Some(id), false) => a href={ "/campaigns/" (id) } { (id) },
            (None, _) => "–",
        }
    }
}
