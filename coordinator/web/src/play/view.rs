//! The markup of the page Play.

use super::{
    super::{
        by_example::{Example, FIELD},
        keys,
        layout::{PLAY, layout_with},
        new::token,
        parts,
        robot_editor::{self, MOST_DESCRIPTION_BYTES},
        visitor::Visitor,
    },
    Comparable, OFFERED,
    address::{Address, MOST_ROBOTS, Play, Robots},
    knobs::{Knob, Values, knobs},
    timeline,
};
use maud::{Markup, html};
use murmuration_model::colours;
use murmuration_report::picture::{columns::WorldView, sensor_reach};
use murmuration_swarm::{
    CampaignSpec, CapabilityModel, Invalid, Preset, Robot, Sensor, Species, World, grouped,
};
use serde::Serialize;
use serde_json::json;

/// The page for an address.
///
/// `campaigns` are the campaigns that can be compared with the address's swarm.
pub(super) fn page(address: &Address, campaigns: &[Comparable], visitor: &Visitor) -> Markup {
    let content = html! {
        div.wide-bar {
            h1 { "Play" }
            @if address.play.is_ok() { (keys::list(&[], keys::Page::Play)) }
            (presets(&address.robots))
        }
        noscript { p.scriptless { "This page needs JavaScript, which is not running in this browser." } }
        (problems(&address.problems))
        (description(address))
        @if let Ok(play) = &address.play {
            (playground(address, play))
            (timeline::section())
            details #around.around.scripted {
                summary { "Controllers around this one" }
                p.reason {
                    "Each controller differs from this one in one gene, by one step. The pictures show the paths of the last steps of a "
                    "whole run, with what the judge calls it."
                }
                p.status role="status" {}
                div.found-around {}
            }
            (comparison(play, campaigns))
        }
    };
    layout_with(PLAY, visitor, &["play.js", "roboteditor.js"], content)
}

/// Links to the preset robots.
fn presets(robots: &Robots) -> Markup {
    html! {
        nav aria-label="Robots" {
            @for preset in Preset::ALL {
                @let is_shown = *robots == Robots::Preset(preset);
                a href={ "/play?model=" (preset) } aria-current=[is_shown.then_some("true")] { (preset) }
            }
        }
    }
}

fn problems(problems: &[Invalid]) -> Markup {
    html! {
        @if !problems.is_empty() {
            div.problems role="alert" {
                p { "Parts of the address were not understood. The page shows the rest." }
                ul { @for problem in problems { li.error { (problem.to_string()) } } }
            }
        }
    }
}

/// The form for describing a robot, with the editor that draws it. It begins with the robots of the page.
fn description(address: &Address) -> Markup {
    let text = match &address.robots {
        Robots::Described(text) => text.clone(),
        Robots::Preset(preset) => robot_editor::robot_text(&preset.robot()),
    };
    html! {
        details.described.scripted open[address.play.is_err()] {
            summary { "Edit the robot" }
            (robot_editor::editor())
            form method="get" action="/play" {
                label for=(robot_editor::TEXT) {
                    "The " code { "[robot]" } " or " code { "[[species]]" } " of a campaign file, and its " code { "[world]" }
                    " if it is not the paper's"
                }
                textarea id=(robot_editor::TEXT) name=(robot_editor::TEXT) rows="9" maxlength=(MOST_DESCRIPTION_BYTES)
                    spellcheck="false" autocomplete="off" autocapitalize="off" { "\n" (text) }
                @if let Err(error) = &address.play { pre.error role="alert" tabindex="0" { (error) } }
                button { "Use this robot" }
            }
        }
    }
}

fn playground(address: &Address, play: &Play) -> Markup {
    let model = play.controller.model();
    let preset = match &address.robots {
        Robots::Preset(preset) => Some(preset.name()),
        Robots::Described(_) => None,
    };
    html! {
        div #play.columns.scripted data-model=[preset] data-swarm=(json!(SwarmView::of(play.controller.model(), &play.world))) {
            section.watch aria-label="The swarm" {
                div.player {
                    div.stage { canvas role="img" aria-label="Motion of the swarm" {} p.waiting hidden {} }
                    div.transport {
                        button.toggle type="button" aria-label="Play" {}
                        input.scrub type="range" min="0" max="0" value="0" aria-label="Step" disabled;
                        output.step { "–" }
                        button.plain #step-back type="button" { "Back " (keys::mark("step-back")) }
                        button.plain #one-step type="button" { "Step " (keys::mark("step")) }
                        button.plain #mark type="button" { "Mark this moment " (keys::mark("mark")) }
                        button.plain #restart type="button" { "Restart " (keys::mark("restart")) }
                        label { span.unseen { "Speed" } (parts::speeds()) }
                    }
                    p #judged {}
                    (legend(model))
                    p #status.status role="status" {}
                }
            }
            form #controller.side.controller aria-label="Controller" novalidate autocomplete="off" {
                (start(play))
                (controller(play))
            }
        }
        p.reason.scripted {
            "The address of this page holds the robots, the controller, the seed and the number of robots: a link shows the same "
            "motion to everybody. The key " kbd { "?" } " lists the keys."
        }
    }
}

/// The comparison with a campaign, and the button that starts a search from the swarm.
fn comparison(play: &Play, campaigns: &[Comparable]) -> Markup {
    html! {
        section.compare.scripted aria-label="This swarm and campaigns" {
            div.choices {
                @if campaigns.is_empty() {
                    p.reason {
                        "No campaign in a world of " (play.world.width()) " × " (play.world.height())
                        " has individuals yet that this swarm could be compared with."
                    }
                } @else {
                    label { "Campaign " select #campaign {
                        @for Comparable { id, is_complete } in campaigns {
                            option value=(id) { (id) @if !is_complete { " (not complete)" } }
                        }
                    } }
                    @if campaigns.len() == OFFERED { span.reason { "The newest " (OFFERED) " are listed." } }
                    button.plain #ask type="button" { "What is this like? " (keys::mark("like")) }
                }
                form #search.examples method="post" action="/play/search" {
                    input type="hidden" name="request" value=(token());
                    button name=(FIELD) value=(Example::Like.name()) { "Search from here" }
                    button.plain name=(FIELD) value=(Example::Sweep.name()) title=(Example::Sweep.title()) { "Sweep around this" }
                }
            }
            p.reason {
                "Search from here starts a campaign of " (grouped(CampaignSpec::BEGUN_EVALUATIONS.into())) " evaluations with these "
                "robots, on hand-crafted features. Half of its first generation is this controller and controllers near it. Sweep around "
                "this evaluates this controller and every controller within a step of it, and shows them on a map. Both take the robot "
                "as the editor has it."
            }
            p #compared.status role="status" {}
            div #likes {}
        }
    }
}

/// The legend of the colours in which robots are drawn.
fn legend(model: &CapabilityModel) -> Markup {
    html! {
        ul.legend aria-label="Colours" {
            @for (place, species) in model.species().iter().enumerate() {
                li {
                    svg.swatch viewBox="0 0 2 2" aria-hidden="true" { circle cx="1" cy="1" r="1" fill=(colour(place)) {} }
                    @if model.species().len() > 1 { (species.name()) } @else { "a sensor is on" }
                }
            }
            li {
                svg.swatch viewBox="0 0 2 2" aria-hidden="true" {
                    circle cx="1" cy="1" r=".85" fill="none" stroke="currentColor" stroke-width=".3" {}
                }
                @if model.species().len() > 1 { "hollow: all sensors are off" } @else { "all sensors are off" }
            }
        }
    }
}

/// The controls for the seed of the start and for the number of robots.
fn start(play: &Play) -> Markup {
    html! {
        fieldset.start {
            legend { "Start" }
            label for="seed" { "Seed" }
            input.number #seed type="text" inputmode="numeric" pattern="[0-9]{1,20}" value=(play.seed);
            button.plain #anew type="button" { "Another start " (keys::mark("anew")) }
            @if play.controller.model().robots().is_none() {
                label for="robots" { "Robots" }
                input.number #robots type="number" min="1" max=(MOST_ROBOTS) value=(play.world.agents());
                input #robots-slider type="range" min="1" max=(MOST_ROBOTS) value=(play.world.agents()) aria-label="Robots";
            }
        }
    }
}

/// The controls of the controller: the tables of all species, and the ratio of their numbers.
fn controller(play: &Play) -> Markup {
    let model = play.controller.model();
    let (knobs, genes) = (knobs(model), play.controller.genes());
    let settings: Vec<_> = knobs.iter().zip(genes.iter().copied()).enumerate().collect();
    let mut rest = &settings[..];
    let mut tables = Vec::new();
    for species in model.species() {
        let (own, others) = rest.split_at(species.robot().genes());
        tables.push(table(model, species, own));
        rest = others;
    }
    html! {
        @for table in tables { (table) }
        @for (gene, (knob, value)) in rest {
            div.angle { label for={ "gene-" (gene) } { "Ratio" } (setting(*gene, knob, *value)) }
        }
    }
}

/// A gene: its place among all genes, its limits, and its value.
type Setting<'a> = (usize, (&'a Knob, f64));

/// The state table of one species, and its free angles.
fn table(model: &CapabilityModel, species: &Species, settings: &[Setting<'_>]) -> Markup {
    let robot = species.robot();
    let (speeds, angles) = settings.split_at(robot.speeds());
    html! {
        table.states {
            caption {
                @if model.species().len() > 1 { "Species " (species.name()) } @else { "Controller" }
            }
            thead { tr {
                th scope="col" { "Sensors" }
                @for name in robot.drive().pair_names() { th scope="col" { (name) } }
            } }
            tbody {
                @for (state, pair) in speeds.chunks(2).enumerate() {
                    tr {
                        th scope="row" { (sensors_of(robot, state)) }
                        @for (gene, (knob, value)) in pair { td { (setting(*gene, knob, *value)) } }
                    }
                }
            }
        }
        @for ((gene, (knob, value)), (sensor, _)) in angles.iter().zip(robot.free_angles()) {
            div.angle {
                label for={ "gene-" (gene) } { "Angle of S" (sensor + 1) }
                (setting(*gene, knob, *value))
            }
        }
    }
}

/// Shows which sensors are on in a state, the first sensor first.
fn sensors_of(robot: &Robot, state: usize) -> Markup {
    let sensors = robot.sensors().len();
    html! {
        @for sensor in 0..sensors {
            @let is_on = state >> (sensors - 1 - sensor) & 1 == 1;
            span.sensor.on[is_on] { "S" (sensor + 1) " " (if is_on { "on" } else { "off" }) } " "
        }
    }
}

fn setting(gene: usize, knob: &Knob, value: f64) -> Markup {
    let id = format!("gene-{gene}");
    html! {
        code { (knob.name) }
        @match &knob.values {
            Values::Within([low, high]) => {
                input.number id=(id) type="number" data-gene=(gene) min=(low) max=(high) step="any" value=(value)
                    aria-label=(knob.name);
                input type="range" data-slides=(id) min=(low) max=(high) step=(step(*low, *high)) value=(value)
                    aria-label={ (knob.name) ", slider" };
            }
            Values::Angles(angles) => {
                select id=(id) data-gene=(gene) aria-label=(knob.name) {
                    @for angle in angles { option value=(angle) selected[*angle == value] { (angle) } }
                }
            }
            Values::Ratios(ratios) => {
                select id=(id) data-gene=(gene) aria-label=(knob.name) {
                    @for (place, counts) in ratios.iter().enumerate() {
                        option value=(place) selected[place as f64 == value] { (ratio(counts)) }
                    }
                }
            }
        }
    }
}

/// The step size of a control: a hundred steps lead from the middle to either end.
fn step(low: f64, high: f64) -> f64 {
    (high - low) / 200.0
}

/// The numbers of robots of each species as text, for example `12 : 12`.
fn ratio(counts: &[u32]) -> String {
    let counts: Vec<_> = counts.iter().map(u32::to_string).collect();
    counts.join(" : ")
}

/// The colour of a species, as in reports.
fn colour(place: usize) -> String {
    colours::hex(colours::AGENTS[place % colours::AGENTS.len()])
}

/// Drawn length of a cone with unlimited range, in radii of the robot.
const UNLIMITED_RADII: f64 = 12.0;

/// Half of a cone's opening angle, in radians, and the cone's drawn length, in world units; `None` for a ray with unlimited
/// range.
fn cone(robot: &Robot, sensor: &Sensor) -> (f64, Option<f64>) {
    let half = sensor.half_angle();
    let drawn = (half > 0.0).then(|| UNLIMITED_RADII * robot.radius());
    (half, sensor_reach(sensor).or(drawn))
}

/// Data from which the script draws a swarm.
#[derive(Debug, Serialize)]
pub(in super::super) struct SwarmView {
    world: WorldView,
    species: Vec<SpeciesView>,
    /// The allowed ratios; each ratio has the number of robots of each species.
    ratios: Vec<Vec<u32>>,
}

#[derive(Debug, Serialize)]
struct SpeciesView {
    colour: String,
    radius: f64,
    sensors: Vec<SensorView>,
}

#[derive(Debug, Serialize)]
struct SensorView {
    /// The sensor's angle in radians, if it is fixed; the gene `gene` has an angle that is free.
    angle: Option<f64>,
    gene: Option<usize>,
    /// Half of the opening angle, in radians.
    half: f64,
    /// Drawn length, in world units; `None` for a ray with unlimited range.
    reach: Option<f64>,
}

impl SwarmView {
    pub(in super::super) fn of(model: &CapabilityModel, world: &World) -> Self {
        Self {
            world: world.into(),
            species: species(model),
            ratios: model.ratios().to_vec(),
        }
    }
}

fn species(model: &CapabilityModel) -> Vec<SpeciesView> {
    let mut first = 0;
    let mut species = Vec::new();
    for (place, of) in model.species().iter().enumerate() {
        let robot = of.robot();
        let mut gene = first + robot.speeds();
        first += robot.genes();
        let sensor = |sensor: &Sensor| {
            let (half, reach) = cone(robot, sensor);
            let angle = sensor.angle().value();
            let free = angle.is_none().then_some(gene);
            gene += usize::from(angle.is_none());
            SensorView {
                angle,
                gene: free,
                half,
                reach,
            }
        };
        species.push(SpeciesView {
            colour: colour(place),
            radius: robot.radius(),
            sensors: robot.sensors().iter().map(sensor).collect(),
        });
    }
    species
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(parameters: &[(&str, &str)]) -> String {
        let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
        let address = Address::read(&parameters.iter().map(owned).collect());
        page(&address, &[], &Visitor::ANYBODY).into_string()
    }

    #[test]
    fn there_is_a_row_for_each_sensor_state_and_a_control_for_each_gene() {
        let text = "[robot]\nsensors = [{}, { angle = \"free\", angles = [0.5, 1.0] }, {}]\n";
        for (parameter, rows, genes) in [
            (("model", "single-sensor"), 2, 4),
            (("model", "two-sensor"), 4, 9),
            (("model", "flockbots"), 2, 4),
            (("robot", text), 8, 17),
        ] {
            let page = shown(&[parameter]);
            assert_eq!(page.matches("<th scope=\"row\">").count(), rows, "{parameter:?}");
            assert_eq!(page.matches("data-gene=").count(), genes, "{parameter:?}");
        }
        let page = shown(&[("robot", text)]);
        assert!(
            page.contains("<option value=\"0.5\" selected>0.5</option>"),
            "{page}"
        );
    }

    #[test]
    fn every_species_has_its_table_and_the_ratio_is_a_choice() {
        let text = "ratios = [[3, 4], [2, 5]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{}]\n\
                    [[species]]\nname = \"b\"\nrobot.sensors = [{ angle = \"free\", angle_range = [0.0, 1.0] }]\n";
        let page = shown(&[("robot", text), ("genes", "0,0,0,0,0,0,0,0,0.5,1")]);
        assert!(page.contains("Species a") && page.contains("Species b"), "{page}");
        assert!(page.contains("<code>b.left_0</code>"), "{page}");
        assert!(
            page.contains("<option value=\"1\" selected>2 : 5</option>"),
            "{page}"
        );
        assert!(!page.contains("id=\"robots\""), "their number is fixed: {page}");
        assert!(page.contains("&quot;gene&quot;:8"), "{page}");
    }

    #[test]
    fn cones_are_drawn_as_far_as_they_reach_and_rays_have_an_end_only_if_they_have_a_range() {
        let text = "[robot]\nradius = 6\nsensors = [{ half_angle = 0.25, range = 120 }, { half_angle = 0.5 }, { range = 40 }, {}]\n";
        let page = shown(&[("robot", text)]).replace("&quot;", "\"");
        for sensor in [
            r#"{"angle":0.0,"gene":null,"half":0.25,"reach":120.0}"#,
            r#"{"angle":0.0,"gene":null,"half":0.5,"reach":72.0}"#,
            r#"{"angle":0.0,"gene":null,"half":0.0,"reach":40.0}"#,
            r#"{"angle":0.0,"gene":null,"half":0.0,"reach":null}"#,
        ] {
            assert!(page.contains(sensor), "{sensor}: {page}");
        }
    }

    #[test]
    fn a_bad_description_is_shown_with_its_error_and_nothing_else() {
        let page = shown(&[("robot", "<script>[robot")]);
        assert!(page.contains("&lt;script&gt;[robot</textarea>"), "{page}");
        assert!(
            page.contains("role=\"alert\"") && !page.contains("canvas"),
            "{page}"
        );
    }

    #[test]
    fn a_bad_address_is_told_what_is_wrong_beside_the_swarm() {
        let page = shown(&[("model", "single-sensor"), ("genes", "0,0,0,<b>")]);
        assert!(page.contains("right_1 = &quot;&lt;b&gt;&quot;"), "{page}");
        assert!(page.contains("canvas"), "{page}");
    }
}
