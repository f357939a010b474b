//! "Controllers around this one": every controller that differs from the page's in one gene by one step, with its paths and its name.
//!
//! The coordinator itself simulates these swarms, so only small swarms have this part.

use super::{
    super::page_error::Refused,
    address::{Parameters, Play},
    motion::Watched,
    strictly,
};
use crate::asked::Form;
use maud::{Markup, PreEscaped, html};
use murmuration_engine::blocking::in_background;
use murmuration_report::picture::{Bodies, trajectory_svg};
use murmuration_search::interrupt::Interrupt;
use murmuration_service::OrStatus as _;
use murmuration_sim::moments::FEWEST_ROBOTS;
use murmuration_swarm::{Controller, GeneSpace, Invalid, Replay, Verdict, World, grouped};
use std::iter;
use tonic::Status;

/// Maximum number of robot steps (steps times robots) of all swarms of a request: the usual ones come to about 500,000, which take
/// a few tens of milliseconds.
const MOST_ROBOT_STEPS: u64 = 2_000_000;
/// Maximum number of robots. The time of a step and of the judge grows with the square of this number.
const MOST_ROBOTS: u32 = 64;

/// Number of steps whose paths are drawn, as the judge sees them, and the steps between two points of a path.
const DRAWN_STEPS: u32 = 160;
const DRAWN_STRIDE: usize = 4;

/// A controller that differs from the page's in one gene.
struct Neighbour {
    play: Play,
    /// The place and the name of this gene.
    gene: usize,
    name: String,
}

/// The end of the motion of a neighbour.
struct Seen {
    neighbour: Neighbour,
    verdict: Option<Verdict>,
    /// The last steps at the judge's frames, as a motion of their own.
    motion: Replay,
}

/// The part of the page with the controllers around the form's.
pub(in super::super) async fn around(Form(parameters): Form<Parameters>) -> Result<Markup, Refused> {
    let play = strictly(&parameters)?;
    let neighbours = neighbours(&play);
    check_cost(&play.world, neighbours.len())?;
    let seen = in_background(move |interrupt| -> Result<Vec<Seen>, Status> {
        neighbours
            .into_iter()
            .map(|neighbour| seen(neighbour, interrupt))
            .collect()
    });
    let seen = seen.await.or_status()??;
    Ok(shown(&parameters, &play, &seen))
}

fn check_cost(world: &World, swarms: usize) -> Result<(), Invalid> {
    let (agents, horizon) = (world.agents(), world.horizon());
    if agents > MOST_ROBOTS {
        return Err(Invalid::new(
            "robots",
            agents,
            format!("at most {MOST_ROBOTS} for this part of the page"),
        ));
    }
    let steps = u64::from(agents) * u64::from(horizon) * swarms as u64;
    if steps > MOST_ROBOT_STEPS {
        let allowed = format!(
            "at most {}, summed over the {swarms} swarms and their robots",
            grouped(MOST_ROBOT_STEPS)
        );
        return Err(Invalid::new("steps", grouped(steps), allowed));
    }
    Ok(())
}

/// The controllers that differ from the page's in one gene by one step, gene by gene, the lower value first.
fn neighbours(play: &Play) -> Vec<Neighbour> {
    let model = play.controller.model();
    let own = play.controller.genes();
    let mut neighbours = Vec::new();
    let named = iter::zip(model.gene_names(), GeneSpace::of_model(model));
    for (gene, (name, values)) in named.enumerate() {
        for value in values.beside(own[gene]) {
            let mut genes = own.to_vec();
            genes[gene] = value;
            // Each value is one of the gene's allowed values, so there is always such a controller.
            let Ok(controller) = Controller::new(model, &genes) else {
                continue;
            };
            neighbours.push(Neighbour {
                play: Play {
                    controller,
                    ..play.clone()
                },
                gene,
                name: name.clone(),
            });
        }
    }
    neighbours
}

/// Simulates a neighbour over the world's horizon.
fn seen(neighbour: Neighbour, interrupt: &Interrupt) -> Result<Seen, Status> {
    let mut watched = Watched::new(&neighbour.play)?;
    let horizon = neighbour.play.world.horizon();
    let (mut steps, mut poses) = (Vec::new(), Vec::new());
    let first = horizon.saturating_sub(DRAWN_STEPS);
    for step in (first..=horizon).step_by(DRAWN_STRIDE) {
        if !watched.advance(step, || interrupt.check().is_ok()) {
            return Err(Status::cancelled("nobody waits for these swarms any more"));
        }
        steps.push(step - first);
        poses.extend(watched.agents().map(|agent| {
            let [x, y] = agent.position;
            [x, y, agent.theta].map(|value| value as f32)
        }));
    }
    let robots = neighbour.play.world.agents() as usize;
    Ok(Seen {
        verdict: watched.verdict(),
        motion: Replay::new(steps, robots, poses)?,
        neighbour,
    })
}

fn shown(parameters: &Parameters, play: &Play, seen: &[Seen]) -> Markup {
    html! {
        ul.behaviours {
            @for seen in seen {
                @let Neighbour { play: other, gene, name } = &seen.neighbour;
                @let [from, to] = [play, other].map(|play| short(play.controller.genes()[*gene]));
                li {
                    a href={ "/play?" (address(parameters, other)) } {
                        (paths(other, &seen.motion))
                        (name) " " (from) " → " (to)
                    }
                    p.reason {
                        @match seen.verdict {
                            Some(verdict) => (verdict.words()),
                            None if play.world.agents() < FEWEST_ROBOTS => "too few robots for a name",
                            None => "not enough motion for a name",
                        }
                    }
                }
            }
        }
    }
}

/// The paths of a swarm as SVG: the pages allow no pictures in addresses.
fn paths(play: &Play, motion: &Replay) -> Markup {
    let bodies = Bodies::of(&play.controller, &play.world);
    let drawn = trajectory_svg(motion, &play.world, bodies.colouring(), DRAWN_STEPS);
    html! { span aria-hidden="true" { (PreEscaped(drawn)) } }
}

/// A value with at most three decimals.
fn short(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// The address of the page Play with the genes of another swarm.
fn address(parameters: &Parameters, other: &Play) -> String {
    let genes: Vec<String> = other.controller.genes().iter().map(f64::to_string).collect();
    let others = parameters.iter().filter(|(name, _)| name != "genes").cloned();
    let all: Parameters = others.chain([("genes".to_owned(), genes.join(","))]).collect();
    // Texts are always encodable.
    serde_urlencoded::to_string(all).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::{super::address::Address, *};

    fn play(parameters: &[(&str, &str)]) -> (Parameters, Play) {
        let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
        let parameters: Parameters = parameters.iter().map(owned).collect();
        let play = Address::read(&parameters).strictly().unwrap();
        (parameters, play)
    }

    #[test]
    fn neighbours_differ_in_one_gene_by_one_allowed_step() {
        let (_, play) = play(&[("model", "single-sensor"), ("genes", "0.7,1,-1,0.05")]);
        let genes: Vec<_> = neighbours(&play)
            .into_iter()
            .map(|it| it.play.controller.genes().to_vec())
            .collect();
        assert_eq!(
            genes,
            [
                [0.6, 1.0, -1.0, 0.05],
                [0.8, 1.0, -1.0, 0.05],
                [0.7, 0.9, -1.0, 0.05],
                [0.7, 1.0, -0.9, 0.05],
                [0.7, 1.0, -1.0, -0.05],
                [0.7, 1.0, -1.0, 0.15],
            ]
        );
        let text = "ratios = [[3, 4], [2, 5]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{ angle = \"free\", angles = [1.0, 0.5, 2.0] }]\n\
                    [[species]]\nname = \"b\"\nrobot.sensors = [{}]\n";
        let (_, play) = self::play(&[("robot", text), ("genes", "1,1,1,1,1,0,0,0,0,0")]);
        let changed = neighbours(&play)
            .into_iter()
            .map(|it| (it.gene, it.play.controller.genes()[it.gene]));
        let last: Vec<_> = changed.filter(|(gene, _)| [4, 9].contains(gene)).collect();
        assert_eq!(last, [(4, 0.5), (4, 2.0), (9, 1.0)]);
    }

    #[test]
    fn each_neighbour_is_drawn_and_named_and_leads_to_its_page() {
        let (parameters, play) = play(&[("model", "single-sensor"), ("seed", "3"), ("robots", "12")]);
        let interrupt = Interrupt::default();
        let seen: Vec<_> = neighbours(&play)
            .into_iter()
            .map(|it| seen(it, &interrupt).unwrap())
            .collect();
        let page = shown(&parameters, &play, &seen).into_string();
        assert_eq!(page.matches("<svg ").count(), seen.len());
        assert_eq!(page.matches("<circle ").count(), 12 * seen.len());
        assert!(
            page.contains("/play?model=single-sensor&amp;seed=3&amp;robots=12&amp;genes=-0.8%2C0.3%2C1%2C1"),
            "{page}"
        );
        assert!(
            seen.iter()
                .all(|seen| seen.verdict.is_some() && seen.motion.frames().count() == 41)
        );
    }

    #[test]
    fn large_swarms_are_refused() {
        let error = |robots: &str| {
            let (_, play) = play(&[("robots", robots)]);
            check_cost(&play.world, neighbours(&play).len()).map_err(|error| error.to_string())
        };
        assert_eq!(error("64"), Ok(()));
        assert_eq!(
            error("65").unwrap_err(),
            "robots = 65: must be at most 64 for this part of the page"
        );
    }
}
