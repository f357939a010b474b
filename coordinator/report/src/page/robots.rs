//! The robots of a behaviour: a drawing of each kind of robot, and its action in each state of its sensors.

use crate::{Report, picture};
use maud::{Markup, html};
use murmuration_swarm::{Controller, RobotController};

/// The robots of each species, in a section that is folded at first.
pub(super) fn robots(report: &Report, controller: &Controller) -> Markup {
    let species = report.spec.model().species();
    let counts = controller.counts(report.spec.world().agents());
    html! {
        details.robots {
            summary { "The robot" @if species.len() > 1 { "s" } ": sensors and speeds" }
            @for ((species_of, robot), count) in species.iter().zip(controller.robots()).zip(counts) {
                @if species.len() > 1 { h5 { (species_of.name()) ", " (count) " robots" } }
                (of_species(robot))
            }
        }
    }
}

fn of_species(controller: RobotController<'_>) -> Markup {
    let robot = controller.robot();
    let angles: Vec<_> = controller.angles().collect();
    let sensors = robot.sensors().len();
    let is_on = move |state: usize, sensor: usize| state >> (sensors - 1 - sensor) & 1 == 1;
    html! {
        div.drawn { (picture::robot_svg(robot, Some(&angles))) }
        ul.sensors {
            @for (i, (sensor, &angle)) in robot.sensors().iter().zip(&angles).enumerate() {
                li { "S" (i + 1) ": " (picture::sensor_in_words(sensor, Some(angle))) }
            }
        }
        table.states {
            thead {
                tr {
                    @for sensor in 1..=sensors { th scope="col" { "S" (sensor) } }
                    @for name in robot.drive().pair_names() { th scope="col" { (name) } }
                }
            }
            tbody {
                @for (state, pair) in controller.pairs().iter().enumerate() {
                    tr {
                        @for sensor in 0..sensors { td { @if is_on(state, sensor) { "sees" } @else { "–" } } }
                        @for speed in pair { td { (speed) } }
                    }
                }
            }
        }
    }
}
