//! The state of the page Play, as it stands in the address of the page.
//!
//! `model` names a preset, or else `robot` describes the robots as a campaign file does; `genes` are the numbers of the
//! controller, separated by commas; `seed` is the seed of the start, and `robots` the number of robots. A missing parameter has
//! its default. A wrong part of an address is ignored, and the rest of the address applies.

use super::{
    super::robot_editor::MOST_DESCRIPTION_BYTES,
    knobs::{Knob, knobs},
};
use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, CapabilityModel, Controller, Invalid, Preset, World};
use std::iter;

/// The parameters of an address, or of a form, in order.
pub(super) type Parameters = Vec<(String, String)>;

/// Maximum number of robots on the page.
pub(super) const MOST_ROBOTS: u32 = 1000;

/// The swarm of an address, and the errors in the address.
#[derive(Debug)]
pub(super) struct Address {
    /// The name or description of the robots.
    pub(super) robots: Robots,
    /// The swarm, or a message about the error in the description.
    pub(super) play: Result<Play, String>,
    /// The rejected parameters; their defaults apply.
    pub(super) problems: Vec<Invalid>,
}

/// The robots of a swarm, as an address gives them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Robots {
    /// The name of a preset.
    Preset(Preset),
    /// A description, in the format of a campaign file.
    Described(String),
}

/// A swarm, ready to be simulated.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Play {
    pub(super) controller: Controller,
    pub(super) world: World,
    /// The seed of the swarm's start.
    pub(super) seed: u64,
}

impl Address {
    /// Reads the valid parts of an address.
    pub(super) fn read(parameters: &Parameters) -> Self {
        let given = |name: &str| {
            let mut of_name = parameters.iter().filter(|(known, _)| known == name);
            of_name.next().map(|(_, text)| text.as_str())
        };
        let mut problems = strange(parameters);
        let robots = robots(given("model"), given("robot"), &mut problems);
        let play = described(&robots).map(|(model, world)| {
            let controller = controller(&model, given("genes"), &mut problems);
            Play {
                world: counted_out(world, &model, given("robots"), &mut problems),
                seed: kept(seed(given("seed")), 1, &mut problems),
                controller,
            }
        });
        Self {
            robots,
            play,
            problems,
        }
    }

    /// The swarm, if the whole address is valid.
    ///
    /// # Errors
    /// The first error in the address.
    pub(super) fn strictly(self) -> Result<Play, String> {
        let play = self.play?;
        match self.problems.into_iter().next() {
            Some(problem) => Err(problem.to_string()),
            None => Ok(play),
        }
    }
}

/// The address of the page Play for an individual of a campaign; `None` if the page cannot show its swarm.
pub(in super::super) fn address_of(
    spec: &CampaignSpec,
    controller: &Controller,
    seed: u64,
) -> Option<String> {
    let (model, world) = (controller.model(), spec.world());
    let usual = World::for_model(model).ok();
    let usual = usual.filter(|usual| usual == world);
    let robots = match model.preset().zip(usual) {
        Some((preset, _)) => ("model", preset.to_string()),
        None => ("robot", without_initial(spec)?.to_toml()),
    };
    let genes: Vec<String> = controller.genes().iter().map(f64::to_string).collect();
    let parameters = vec![
        (robots.0.to_owned(), robots.1),
        ("genes".to_owned(), genes.join(",")),
        ("seed".to_owned(), seed.to_string()),
    ];
    let is_shown = Address::read(&parameters)
        .strictly()
        .is_ok_and(|play| play.controller == *controller && play.world == *world);
    is_shown
        .then(|| serde_urlencoded::to_string(parameters).ok())
        .flatten()
}

/// The specification without its initial controllers: the address has room for a description of robots, but not for all of them.
fn without_initial(spec: &CampaignSpec) -> Option<CampaignSpec> {
    let mut message = v1::CampaignSpec::from(spec);
    if let Some(controllers) = &mut message.controllers {
        controllers.initial.clear();
    }
    CampaignSpec::try_from(message).ok()
}

/// The value that was read. After an error, it adds the error to `problems` and returns the default.
fn kept<T>(read: Result<T, Invalid>, usual: T, problems: &mut Vec<Invalid>) -> T {
    read.unwrap_or_else(|problem| {
        problems.push(problem);
        usual
    })
}

/// Errors about unknown and repeated parameters.
fn strange(parameters: &Parameters) -> Vec<Invalid> {
    const KNOWN: [&str; 5] = ["model", "robot", "genes", "seed", "robots"];
    let named = |name: &str| parameters.iter().filter(|(known, _)| known == name).count();
    let unknown = parameters
        .iter()
        .find(|(name, _)| !KNOWN.contains(&name.as_str()));
    let unknown = unknown.map(|(name, _)| {
        let allowed = format!("one of {}", KNOWN.join(", "));
        Invalid::new("parameter", format!("{name:?}"), allowed)
    });
    let twice = KNOWN.into_iter().filter(|name| named(name) > 1);
    let twice = twice.map(|name| Invalid::new(name, "given twice", "given once: the first counts"));
    unknown.into_iter().chain(twice).collect()
}

fn robots(model: Option<&str>, text: Option<&str>, problems: &mut Vec<Invalid>) -> Robots {
    match (model, text) {
        (None, Some(text)) => Robots::Described(text.to_owned()),
        (model, text) => {
            if text.is_some() {
                let allowed = "absent if a model is given, because the model defines the robots";
                problems.push(Invalid::new("robot", "given", allowed));
            }
            let preset = model.map_or(Ok(Preset::TwoSensor), str::parse);
            Robots::Preset(kept(preset, Preset::TwoSensor, problems))
        }
    }
}

fn described(robots: &Robots) -> Result<(CapabilityModel, World), String> {
    match robots {
        Robots::Preset(preset) => {
            let model = CapabilityModel::from(*preset);
            let world = World::for_model(&model).map_err(|error| error.to_string())?;
            Ok((model, world))
        }
        Robots::Described(text) if text.len() > MOST_DESCRIPTION_BYTES => Err(format!(
            "The description has {} bytes; an address has room for {MOST_DESCRIPTION_BYTES}.",
            text.len()
        )),
        Robots::Described(text) => {
            let (model, world) = CampaignSpec::robots_from_toml(text).map_err(|error| error.to_string())?;
            match model.robots().or(Some(world.agents())) {
                Some(robots) if robots > MOST_ROBOTS => Err(format!(
                    "The description has {robots} robots; this page shows at most {MOST_ROBOTS}."
                )),
                _ => Ok((model, world)),
            }
        }
    }
}

/// The controller with these genes; a gene that is not allowed has its default.
fn controller(model: &CapabilityModel, genes: Option<&str>, problems: &mut Vec<Invalid>) -> Controller {
    let knobs = knobs(model);
    let usual = || knobs.iter().map(|knob| knob.usual).collect::<Vec<_>>();
    let genes = match genes {
        None => usual(),
        Some(text) if text.split(',').count() != knobs.len() => {
            let allowed = format!("{} numbers for the {model}, separated by commas", knobs.len());
            problems.push(Invalid::new("genes", format!("{text:?}"), allowed));
            usual()
        }
        Some(text) => {
            let read = |(knob, text): (&Knob, &str)| kept(knob.read(text), knob.usual, problems);
            iter::zip(&knobs, text.split(',')).map(read).collect()
        }
    };
    allowed(model, &genes)
}

/// The controller with genes that were already checked one by one.
#[expect(
    clippy::expect_used,
    reason = "a controller is its genes, each of which is allowed"
)]
fn allowed(model: &CapabilityModel, genes: &[f64]) -> Controller {
    Controller::new(model, genes).expect("each of its genes is allowed")
}

/// The world with the given number of robots.
fn counted_out(
    world: World,
    model: &CapabilityModel,
    asked: Option<&str>,
    problems: &mut Vec<Invalid>,
) -> World {
    let asked = asked.map_or(Ok(world.agents()), |text| {
        let fixed = model.robots();
        let allowed = match fixed {
            Some(robots) => format!("{robots}, the number of robots of all species, or absent"),
            None => format!("a whole number from 1 to {MOST_ROBOTS}"),
        };
        let refused = || Invalid::new("robots", format!("{text:?}"), allowed.clone());
        let robots: u32 = text.trim().parse().map_err(|_| refused())?;
        let fits = fixed.map_or((1..=MOST_ROBOTS).contains(&robots), |fixed| fixed == robots);
        fits.then_some(robots).ok_or_else(refused)
    });
    let message = v1::World {
        agents: Some(kept(asked, world.agents(), problems)),
        ..world.clone().into()
    };
    kept(World::try_from(message), world, problems)
}

fn seed(given: Option<&str>) -> Result<u64, Invalid> {
    let Some(text) = given else { return Ok(1) };
    let seed = text.trim().parse().ok();
    let allowed = format!("a whole number from 0 to {}", u64::MAX);
    seed.ok_or_else(|| Invalid::new("seed", format!("{text:?}"), allowed))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: &str = "[robot]\nsensors = [{ half_angle = 0.2, range = 120.0 }]\n";

    fn read(parameters: &[(&str, &str)]) -> Address {
        let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
        Address::read(&parameters.iter().map(owned).collect())
    }

    #[track_caller]
    fn check(parameters: &[(&str, &str)], message: &str) -> Play {
        let address = read(parameters);
        let problems: Vec<_> = address.problems.iter().map(Invalid::to_string).collect();
        assert_eq!(problems, [message]);
        address.play.unwrap()
    }

    #[test]
    fn an_empty_address_is_the_usual_swarm() {
        let address = read(&[]);
        assert_eq!(address.robots, Robots::Preset(Preset::TwoSensor));
        let play = address.strictly().unwrap();
        assert_eq!((play.world.agents(), play.seed), (24, 1));
    }

    #[test]
    fn an_address_holds_the_whole_state() {
        let address = read(&[
            ("model", "single-sensor"),
            ("genes", "0.6,1,-0.4,0.123456789"),
            ("seed", "18446744073709551615"),
            ("robots", "1000"),
        ]);
        let play = address.strictly().unwrap();
        assert_eq!(play.controller.genes(), [0.6, 1.0, -0.4, 0.123_456_789]);
        assert_eq!((play.world.agents(), play.seed), (1000, u64::MAX));

        let address = read(&[("robot", CAMERA), ("genes", "0,0,1,1"), ("robots", "30")]);
        assert_eq!(address.robots, Robots::Described(CAMERA.to_owned()));
        let play = address.strictly().unwrap();
        assert_eq!(
            (play.controller.model().preset(), play.world.agents()),
            (None, 30)
        );
    }

    #[test]
    fn what_is_wrong_is_named_and_the_rest_is_kept() {
        let play = check(
            &[("model", "three-sensor"), ("seed", "7")],
            "model = \"three-sensor\": must be \"single-sensor\" or \"two-sensor\" or \"flockbots\" or \"turbopi\"",
        );
        assert_eq!(play.seed, 7);
        let play = check(
            &[
                ("model", "single-sensor"),
                ("genes", "0.5,2,0.25,0"),
                ("robots", "50"),
            ],
            "right_0 = \"2\": must be a number from -1 to 1",
        );
        assert_eq!(play.controller.genes(), [0.5, 0.3, 0.25, 0.0]);
        assert_eq!(play.world.agents(), 50);
        check(
            &[("model", "single-sensor"), ("genes", "0,0")],
            "genes = \"0,0\": must be 4 numbers for the single-sensor, separated by commas",
        );
        for (robots, shown) in [("0", "\"0\""), ("1001", "\"1001\""), ("many", "\"many\"")] {
            let message = format!("robots = {shown}: must be a whole number from 1 to 1000");
            assert_eq!(check(&[("robots", robots)], &message).world.agents(), 24);
        }
        let message = "seed = \"-1\": must be a whole number from 0 to 18446744073709551615";
        assert_eq!(
            check(&[("seed", "-1"), ("robots", "30")], message).world.agents(),
            30
        );
        let message = "parameter = \"gene\": must be one of model, robot, genes, seed, robots";
        check(&[("gene", "1")], message);
        let message = "seed = given twice: must be given once: the first counts";
        assert_eq!(check(&[("seed", "2"), ("seed", "3")], message).seed, 2);
        let message =
            "robot = given: must be absent if a model is given, because the model defines the robots";
        check(&[("model", "turbopi"), ("robot", CAMERA)], message);
    }

    #[test]
    fn a_description_that_cannot_be_used_says_so_as_a_campaign_file_does() {
        let message = |text: &str| read(&[("robot", text), ("seed", "3")]).play.unwrap_err();
        let text = "[robot]\nsensors = [{ agnle = 1.0 }]\n";
        assert!(message(text).contains("did you mean `angle`?"));
        assert_eq!(
            message(text),
            CampaignSpec::robots_from_toml(text).unwrap_err().to_string()
        );
        assert!(message("[robot]\nsensors = []\n").contains("1 to 6 sensors"));
        assert!(message(&"#".repeat(6001)).contains("6001 bytes"));
        assert!(message("[robot]\nsensors = [{}]\n[world]\nagents = 2000\n").contains("at most 1000"));
    }

    #[test]
    fn species_have_the_number_of_robots_that_they_have() {
        let text = "ratios = [[3, 4]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{}]\n\
                    [[species]]\nname = \"b\"\nrobot.sensors = [{}]\n";
        let address = read(&[("robot", text), ("robots", "7")]);
        assert_eq!(address.strictly().unwrap().world.agents(), 7);
        let message = "robots = \"24\": must be 7, the number of robots of all species, or absent";
        assert_eq!(
            check(&[("robot", text), ("robots", "24")], message)
                .world
                .agents(),
            7
        );
    }

    #[test]
    fn whatever_a_gene_says_there_is_a_swarm() {
        let text = "ratios = [[3, 4], [4, 3]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{}]\n\
                    [[species]]\nname = \"b\"\nrobot.sensors = [{ angle = \"free\", angles = [0.5, 0.5] }]\n";
        let strange = [
            "",
            " ",
            "-0",
            "+1",
            " 1 ",
            "1e309",
            "1e-320",
            "NaN",
            "-inf",
            "0x1",
            "１",
            "1\0",
            "0.5",
            "1.0000000000000002",
        ];
        let presets = Preset::ALL.map(|preset| ("model", preset.name()));
        for robots in presets.into_iter().chain([("robot", text)]) {
            let count = read(&[robots]).play.unwrap().controller.genes().len();
            for gene in strange {
                let genes = vec![gene; count].join(",");
                let play = read(&[robots, ("genes", &genes)]).play.unwrap();
                assert_eq!(play.controller.genes().len(), count);
            }
        }
    }

    #[test]
    fn every_individual_of_a_campaign_has_an_address_with_its_swarm() {
        for world in ["", "[world]\nboundary = \"torus\"\nagents = 30"] {
            let text = format!("model = \"single-sensor\"\nmethod = \"random\"\n{world}");
            let spec = CampaignSpec::from_toml(&text).unwrap();
            let controller = Controller::new(spec.model(), &[0.1, -0.3, 1.0, 0.7]).unwrap();
            let address = address_of(&spec, &controller, u64::MAX).unwrap();
            let parameters: Parameters = serde_urlencoded::from_str(&address).unwrap();
            let play = Address::read(&parameters).strictly().unwrap();
            assert_eq!((&play.controller, &play.world), (&controller, spec.world()));
            assert_eq!(play.seed, u64::MAX);
        }
    }
}
