//! Campaigns that begin with one controller.

use super::CampaignSpec;
use crate::{Controller, ControllerSpace, Invalid, Purpose, RandomStream, World, robot};
use murmuration_proto::v1;

/// Name of a campaign that begins with one controller.
const NAME: &str = "play";
/// Controllers per generation. With [`GENERATIONS`] generations, a campaign with the paper's robots takes half a minute on two
/// cores, like `examples/quick.toml`.
const POPULATION: u32 = 100;
const GENERATIONS: u32 = 30;
/// Controllers with which the first generation begins: the given one, and others near it. The rest of the generation is sampled
/// from the whole space, so that the search can also leave the surroundings.
const INITIAL: u32 = POPULATION / 2;

impl CampaignSpec {
    /// Number of evaluations of a campaign of [`CampaignSpec::begun_with`].
    pub const BEGUN_EVALUATIONS: u32 = POPULATION * GENERATIONS;

    /// A small campaign with hand-crafted features, for the robots of `controller` in `world`. Half of the first generation is
    /// `controller` and controllers near it; `seed` is the campaign's seed.
    ///
    /// # Errors
    /// If the robots do not fit the world, or the search does not fit in memory.
    pub fn begun_with(controller: &Controller, world: &World, seed: u64) -> Result<Self, Invalid> {
        let robots = robot::Written::from(controller.model());
        Self::try_from(v1::CampaignSpec {
            name: Some(NAME.to_owned()),
            seed: Some(seed),
            model: robots.model,
            robot: robots.robot,
            species: robots.species,
            ratios: robots.ratios,
            method: v1::Method::HandCrafted as i32,
            world: Some(world.clone().into()),
            controllers: Some(v1::ControllerSpace {
                initial: around(controller, seed)?.iter().map(Into::into).collect(),
                ..v1::ControllerSpace::default()
            }),
            search: Some(v1::Search {
                population: Some(POPULATION),
                generations: Some(GENERATIONS),
                ..v1::Search::default()
            }),
            ..v1::CampaignSpec::default()
        })
    }
}

/// The controller, and controllers of its space near it, each once. A small space can have fewer than [`INITIAL`].
fn around(controller: &Controller, seed: u64) -> Result<Vec<Controller>, Invalid> {
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), controller.model())?;
    let mut stream = RandomStream::derive(seed, Purpose::Around, 0);
    let mut around = vec![controller.clone()];
    for _ in 0..10 * INITIAL {
        let near = space.near(controller, &mut stream);
        if around.len() < INITIAL as usize && !around.contains(&near) {
            around.push(near);
        }
    }
    Ok(around)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_campaign_has_the_robots_the_world_and_the_controller_that_it_is_begun_with() {
        let species = "ratios = [[3, 4], [2, 5]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{}]\n\
                       [[species]]\nname = \"b\"\nrobot = { radius = 8, sensors = [{ angle = \"free\", angle_range = [0, 1] }] }\n";
        for robots in [
            "model = \"two-sensor\"\n[world]\nagents = 30\nboundary = \"torus\"\n",
            "model = \"turbopi\"\n",
            "[robot]\nradius = 7\nsensors = [{ half_angle = 0.2, range = 120 }]\n",
            species,
        ] {
            let (model, world) = CampaignSpec::robots_from_toml(robots).unwrap();
            let controller = Controller::new(&model, &vec![0.0; model.genes()]).unwrap();
            let spec = CampaignSpec::begun_with(&controller, &world, 5).unwrap();
            assert_eq!(
                (spec.model(), spec.world(), spec.seed()),
                (&model, &world, 5),
                "{robots}"
            );
            let initial = spec.controllers().initial();
            assert_eq!((&initial[0], initial.len()), (&controller, 50), "{robots}");
            assert!((1..50).all(|place| !initial[..place].contains(&initial[place])));
            let again = CampaignSpec::begun_with(&controller, &world, 5).unwrap();
            let other = CampaignSpec::begun_with(&controller, &world, 6).unwrap();
            assert_eq!(again, spec);
            assert_ne!(other.controllers().initial(), initial);
            assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        }
    }
}
