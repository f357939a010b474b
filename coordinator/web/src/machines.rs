//! The table of connected workers and trainers, with their current work.

use maud::{Markup, html};
use murmuration_dispatch::ConnectedMachine;
use murmuration_proto::v1::NodeKind;
use murmuration_service::nodes::{doing, node};
use murmuration_study::wide;

/// Maximum number of rows of the table.
const MOST: usize = 50;

/// The table of machines; empty if no machine is connected.
pub(super) fn table(workers: &[ConnectedMachine], trainers: &[ConnectedMachine]) -> Markup {
    let workers = workers
        .iter()
        .map(|machine| ("worker", NodeKind::Worker, machine));
    let trainers = trainers
        .iter()
        .map(|machine| ("trainer", NodeKind::Trainer, machine));
    let all: Vec<_> = trainers.chain(workers).collect();
    html! {
        @if !all.is_empty() {
            div.machines {
                h2 #machines { "Workers and trainers" }
                (wide("Workers and trainers", &html! { table {
                    thead { tr { th scope="col" { "Machine" } th scope="col" { "Kind" } th scope="col" { "At once" } th scope="col" { "Now" } } }
                    tbody {
                        @for &(name, kind, machine) in all.iter().take(MOST) {
                            tr {
                                th scope="row" { (machine.name) }
                                td { (name) }
                                td { (machine.capacity) }
                                td { (doing(&node(machine.clone(), kind))) }
                            }
                        }
                    }
                } }))
                @if all.len() > MOST { p.reason { "and " (all.len() - MOST) " more" } }
            }
        }
    }
}
