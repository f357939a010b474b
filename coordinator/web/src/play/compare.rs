//! "What is this like?": the individuals of a campaign nearest to the swarm of the page.

use super::{
    super::{Web, archived, motion::REPLAY_TIMEOUT, page_error::Refused},
    address::{Parameters, Play},
    strictly,
};
use crate::asked::Form;
use axum::extract::State;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, html};
use murmuration_engine::nearest::{Nearest, Neighbour, UNLIKE};
use murmuration_model::CampaignRecord;
use murmuration_report::picture;
use murmuration_service::{OrStatus as _, OtherBehaviour};
use murmuration_swarm::{CapabilityModel, Invalid, World, rounded};
use tonic::Status;

/// Number of individuals in the response.
const SHOWN: usize = 5;
/// Maximum number of robot steps (steps times robots) of a simulation by workers. The limit is enough for 1,000 robots in the
/// paper's world, and takes a worker a second or two.
const MOST_ROBOT_STEPS: u64 = 2_000_000;

/// Whether the individuals of a campaign can be compared with a swarm in `world`. Pictures can be compared if the arenas have the
/// same size.
pub(super) fn is_comparable(record: &CampaignRecord, world: &World) -> bool {
    let own = record.spec.world();
    (own.width(), own.height()) == (world.width(), world.height())
}

/// The part of the page with the individuals of the form's campaign that are most like the form's swarm.
pub(in super::super) async fn like(
    State(web): State<Web>,
    Form(mut parameters): Form<Parameters>,
) -> Result<Markup, Refused> {
    let campaign = campaign(&mut parameters)?;
    let play = strictly(&parameters)?;
    let record = web.campaigns.status(&campaign).await.or_status()?.record;
    check(&play, &record)?;
    // If no worker is connected, the request fails at once instead of waiting.
    web.archive.dispatch.check_staffed().or_status()?;
    let Play {
        controller,
        world,
        seed,
    } = play;
    let model = controller.model().clone();
    let evaluated = web.campaigns.evaluate_elsewhere(&record, controller, seed, world);
    let late = |_| Status::unavailable("the workers have not simulated this yet");
    let evaluated = tokio::time::timeout(REPLAY_TIMEOUT, evaluated)
        .await
        .map_err(late)?;
    let evaluation = evaluated.or_status()?;
    let behaviour = OtherBehaviour::of(&evaluation, record.embedder.checkpoint());
    let nearest = web.archive.nearest(&record, behaviour, SHOWN).await?;
    let pixels = picture::rgb(evaluation.image(), record.spec.image().shape());
    let pixels = pixels.map_err(|error| Status::internal(error.to_string()))?;
    Ok(shown(&record, &model, &pixels, &nearest))
}

/// Removes the campaign from the parameters, and returns its id.
fn campaign(parameters: &mut Parameters) -> Result<String, Invalid> {
    let place = parameters.iter().position(|(name, _)| name == "campaign");
    let place = place.ok_or_else(|| Invalid::missing("campaign", "the id of a campaign"))?;
    Ok(parameters.remove(place).1)
}

fn check(play: &Play, record: &CampaignRecord) -> Result<(), Invalid> {
    let world = &play.world;
    if !is_comparable(record, world) {
        let allowed = format!(
            "a campaign in a world of {} x {}, as this swarm's is",
            world.width(),
            world.height()
        );
        return Err(Invalid::new("campaign", &record.id, allowed));
    }
    if record
        .spec
        .image()
        .check_species(play.controller.model())
        .is_err()
    {
        let allowed = format!(
            "a campaign whose pictures fit this swarm: its pictures have {} channels, one for each species, and this swarm has {} species",
            record.spec.image().shape().channels(),
            play.controller.model().species().len()
        );
        return Err(Invalid::new("campaign", &record.id, allowed));
    }
    check_cost(world)
}

/// Checks that a worker can simulate the swarm in a second or two. The limit is low because the page Play shares the workers with
/// every campaign.
pub(super) fn check_cost(world: &World) -> Result<(), Invalid> {
    let (agents, horizon) = (world.agents(), world.horizon());
    if u64::from(agents) * u64::from(horizon) <= MOST_ROBOT_STEPS {
        return Ok(());
    }
    let most = MOST_ROBOT_STEPS / u64::from(agents);
    let allowed = format!("at most {most} with {agents} robots, from this page");
    Err(Invalid::new("world.horizon", horizon, allowed))
}

/// The swarm's picture, made from `pixels`, and the individuals that are most like the swarm.
fn shown(record: &CampaignRecord, model: &CapabilityModel, pixels: &[u8], nearest: &Nearest) -> Markup {
    let side = record.spec.image().resolution();
    html! {
        p { (verdict(record, nearest)) }
        @if record.spec.model() != model {
            p.reason { "The robots of " (record.id) " differ: " (difference(record.spec.model(), model)) "." }
        }
        ul.behaviours {
            li {
                canvas.picture width=(side) height=(side) data-image=(STANDARD.encode(pixels)) role="img"
                    aria-label="Picture of this swarm" {}
                p { "This swarm" }
            }
            @for near in &nearest.neighbours { li { (individual(record, near)) } }
        }
    }
}

/// The difference between the robots of a campaign and the robots of the page, in words.
fn difference(theirs: &CapabilityModel, own: &CapabilityModel) -> String {
    let [theirs, own] = [theirs.to_string(), own.to_string()];
    match theirs == own {
        true => format!("both are {own}, with another body or other sensors"),
        false => format!("its model is {theirs}, and this is {own}"),
    }
}

/// Says which behaviour of the campaign the swarm is most like.
fn verdict(record: &CampaignRecord, nearest: &Nearest) -> Markup {
    let medoid = &nearest.medoid;
    let times = nearest.relative_distance();
    html! {
        @if nearest.is_unlike() { strong { "This is unlike every behaviour in " (record.id) "." } " " }
        "The nearest cluster is " (medoid.cluster + 1) ", " (rounded(medoid.distance, 3)) " from its medoid"
        @if let Some(times) = times { ", " (rounded(times, 1)) " times as far as its members are on average" }
        ". "
        @if let Some(near) = nearest.neighbours.first() {
            "The nearest individual is " (rounded(near.distance, 3)) " away; individuals are " (rounded(nearest.spread, 3))
            " from their medoids on average. (A behaviour more than " (UNLIKE) " times as far from the medoid, and farther from the nearest "
            "individual than this, counts as unlike all others.)"
        }
        @if !nearest.is_taxonomy { " The campaign is not complete, so its archive and clusters may change." }
        @if let Some(labelled) = &nearest.labelled {
            " The nearest individual with a class is " (labelled.index) " (" (rounded(labelled.distance, 3)) "): "
            strong { (labelled.class.as_ref().map_or("", |class| class.as_str())) } "."
        }
    }
}

fn individual(record: &CampaignRecord, near: &Neighbour) -> Markup {
    html! {
        a href={ "/campaigns/" (record.id) "/map#individual-" (near.index) } {
            img.picture src=(archived::picture(record, near.index)) alt={ "Picture of individual " (near.index) };
            "Individual " (near.index)
        }
        p.reason {
            (rounded(near.distance, 3)) " away · cluster " (near.cluster + 1)
            @if let Some(class) = &near.class { " · " (class) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::grouped;

    #[test]
    fn the_page_on_security_names_the_limit() {
        let page = include_str!("../../../../docs/security.md");
        let limit = format!(
            "at most {} steps summed over the robots",
            grouped(MOST_ROBOT_STEPS)
        );
        assert!(page.contains(&limit), "{limit}");
    }

    #[test]
    fn the_campaign_is_taken_out_of_the_parameters() {
        let mut parameters = vec![
            ("seed".to_owned(), "2".to_owned()),
            ("campaign".to_owned(), "quick-1".to_owned()),
        ];
        assert_eq!(campaign(&mut parameters), Ok("quick-1".to_owned()));
        assert_eq!(parameters.len(), 1);
        assert_eq!(campaign(&mut parameters).unwrap_err().field, "campaign");
    }
}
