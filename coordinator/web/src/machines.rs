//! The table of connected workers and trainers, with their current work.

use maud::{Markup, html};
use murmuration_dispatch::{ConnectedMachine, WorkInHand, WorkKind};
use murmuration_model::CampaignId;
use murmuration_study::wide;
use murmuration_swarm::counted;

/// Maximum number of rows of the table.
const MOST: usize = 50;

/// The table of machines; empty if no machine is connected.
pub(super) fn table(workers: &[ConnectedMachine], trainers: &[ConnectedMachine]) -> Markup {
    let workers = workers.iter().map(|machine| ("worker", machine));
    let trainers = trainers.iter().map(|machine| ("trainer", machine));
    let all: Vec<_> = trainers.chain(workers).collect();
    html! {
        @if !all.is_empty() {
            div.machines {
                h2 #machines { "Workers and trainers" }
                (wide("Workers and trainers", &html! { table {
                    thead { tr { th scope="col" { "Machine" } th scope="col" { "Kind" } th scope="col" { "At once" } th scope="col" { "Now" } } }
                    tbody {
                        @for (kind, machine) in all.iter().take(MOST) {
                            tr {
                                th scope="row" { (machine.name) }
                                td { (kind) }
                                td { (machine.capacity) }
                                td { (doing(machine)) }
                            }
                        }
                    }
                } }))
                @if all.len() > MOST { p.reason { "and " (all.len() - MOST) " more" } }
            }
        }
    }
}

/// The current work of a machine, in words.
fn doing(machine: &ConnectedMachine) -> String {
    if machine.work.is_empty() {
        return match machine.capacity {
            0 => "leaving".to_owned(),
            _ => "waiting for work".to_owned(),
        };
    }
    let words: Vec<String> = machine.work.iter().map(in_words).collect();
    words.join("; ")
}

fn in_words(work: &WorkInHand) -> String {
    let what = match work.kind {
        WorkKind::Evaluation => format!("evaluates {}", counted(work.tasks as u64, "controller")),
        WorkKind::Embedding => format!("embeds {}", counted(work.tasks as u64, "individual")),
        WorkKind::Replay => "simulates a motion".to_owned(),
        WorkKind::Training => "trains the embedder".to_owned(),
    };
    match work.campaign.as_ref().map(CampaignId::as_str) {
        Some(campaign) => format!("{what} of {campaign}"),
        None => what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_machine_does_is_said_in_words() {
        let mut machine = ConnectedMachine {
            name: "bob".to_owned(),
            capacity: 2,
            work: Vec::new(),
        };
        assert_eq!(doing(&machine), "waiting for work");
        machine.work = [(WorkKind::Evaluation, 16), (WorkKind::Replay, 1)]
            .map(|(kind, tasks)| WorkInHand {
                kind,
                campaign: "small-1".parse().ok(),
                tasks,
            })
            .into();
        assert_eq!(
            doing(&machine),
            "evaluates 16 controllers of small-1; simulates a motion of small-1"
        );
    }
}
