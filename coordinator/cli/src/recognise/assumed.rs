//! Assumptions about tracks that lack data.

use super::{super::CliError, Recognise};
use murmuration_link::errln;
use murmuration_swarm::{CampaignSpec, CapabilityModel, Controller, Invalid, World, counted};
use murmuration_tracks::{Filmed, Tracks, TracksError};

/// Width and height of an arena in the units of the tracks, both greater than 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Arena(pub(super) [f64; 2]);

/// The interpretation of the tracks.
pub(super) struct Assumed {
    pub(super) robots: u32,
    /// First and last frame.
    pub(super) frames: [u32; 2],
    /// Number of missing sightings; complete tracks have one sighting per robot and frame.
    pub(super) missing: u64,
    /// Share of the sightings with a heading, 0 to 1.
    pub(super) share_of_headings: f64,
    /// Time from one frame to the next, in units of the world's time.
    pub(super) frame_time: f64,
    /// World units in one unit of the tracks.
    pub(super) scale: f64,
    /// Steps that features and picture cover.
    pub(super) steps: u64,
    /// Steps that the campaign's features and pictures cover.
    wanted: u64,
    arena: Option<Arena>,
    /// Whether the direction of sensors depends on an unknown controller.
    looks_unknown: bool,
    /// Whether the number of robots of each species is unknown.
    counts_unknown: bool,
    /// Number of robots in the campaign's swarms.
    campaign_robots: u32,
    /// Trials of each individual of the campaign.
    campaign_starts: u32,
}

impl Assumed {
    pub(super) fn of(
        asked: &Recognise,
        tracks: &Tracks,
        controller: &Controller,
        world: &World,
        campaign: &CampaignSpec,
    ) -> Result<Self, TracksError> {
        let model = controller.model();
        let is_free = model
            .species()
            .iter()
            .any(|species| species.robot().free_angles().next().is_some());
        let mut assumed = Self {
            robots: tracks.robots(),
            frames: tracks.frames(),
            missing: tracks.missing(),
            share_of_headings: tracks.share_of_headings(),
            frame_time: asked.frame_time.unwrap_or(world.dt()),
            scale: 1.0,
            steps: 0,
            wanted: 0,
            arena: asked.arena,
            looks_unknown: asked.controller.is_none() && is_free,
            counts_unknown: asked.controller.is_none()
                && model.ratios().len() > 1
                && tracks.counts(model)?.is_none(),
            campaign_robots: campaign.world().agents(),
            campaign_starts: campaign.starts().into(),
        };
        assumed.scale = assumed.filmed(world)?.scale();
        Ok(assumed)
    }

    /// The scale between film and world.
    pub(super) fn filmed<'a>(&self, world: &'a World) -> Result<Filmed<'a>, Invalid> {
        let filmed = Filmed::new(world).with_frame_time(self.frame_time)?;
        match self.arena {
            Some(Arena(sides)) => filmed.with_arena(sides),
            None => Ok(filmed),
        }
    }

    /// Sets the number of steps in the tracks, and the number of steps that the campaign uses.
    pub(super) fn with_steps(self, steps: u64, wanted: u64) -> Self {
        Self {
            steps,
            wanted,
            ..self
        }
    }

    /// Reports the interpretation of the tracks on stderr.
    pub(super) fn tell(&self) {
        let [first, last] = self.frames;
        let missing = match self.missing {
            0 => String::new(),
            missing => format!(", {missing} of the rows missing"),
        };
        errln!(
            "tracks: {} in frames {first} to {last}{missing}; a frame lasts {}, a unit is {} in the world",
            counted(self.robots.into(), "robot"),
            self.frame_time,
            self.scale
        );
        if self.share_of_headings < 1.0 {
            errln!(
                "assumed: a robot looks where it moves, in the {:.0} % of the rows that have no heading",
                100.0 * (1.0 - self.share_of_headings)
            );
        }
        if self.looks_unknown {
            errln!(
                "assumed: sensors with free angles look straight ahead, or as nearly as they can; --controller gives their angles"
            );
        }
        if self.counts_unknown {
            errln!(
                "assumed: the numbers of robots of the species are those of the first ratio; a column species, or --controller, \
                 gives the numbers"
            );
        }
        if self.robots != self.campaign_robots {
            errln!(
                "the swarms of the campaign have {}, the tracks {}: distances between swarms of different sizes mean little",
                counted(self.campaign_robots.into(), "robot"),
                self.robots
            );
        }
        if self.campaign_starts > 1 {
            errln!(
                "the individuals of the campaign are means over {} starts, and a film shows one start: the film's own individual is \
                 near, but not at distance 0",
                self.campaign_starts
            );
        }
        if self.steps < self.wanted {
            errln!(
                "the tracks last only {}, but the campaign's features and pictures show {}: distances mean less",
                counted(self.steps, "step"),
                self.wanted
            );
        }
    }
}

/// A controller for robots whose controller is unknown. Its free angles are as near to straight ahead as possible. `counts` is
/// the number of robots of each species; without `counts`, the first ratio is used.
pub(super) fn unknown(model: &CapabilityModel, counts: Option<&[u32]>) -> Result<Controller, CliError> {
    let ratios = model.ratios();
    let ratio = counts.map_or(Some(0), |counts| ratios.iter().position(|ratio| ratio == counts));
    let ratio = match (ratio, counts) {
        (Some(ratio), _) => ratio,
        (None, Some(counts)) if !ratios.is_empty() => {
            let ratios: Vec<_> = ratios.iter().map(|ratio| format!("{ratio:?}")).collect();
            return Err(CliError::Input(format!(
                "the tracks have {counts:?} robots of the species, and the swarm may have {}",
                ratios.join(" or ")
            )));
        }
        (None, _) => 0,
    };
    let mut genes = Vec::with_capacity(model.genes());
    for species in model.species() {
        genes.resize(genes.len() + species.robot().speeds(), 0.0);
        genes.extend(species.robot().free_angles().map(|(_, angle)| {
            let nearest = |one: &f64, other: &f64| one.abs().total_cmp(&other.abs());
            match angle.range() {
                Some([low, high]) => 0.0_f64.clamp(low, high),
                None => angle
                    .choices()
                    .iter()
                    .copied()
                    .min_by(nearest)
                    .unwrap_or_default(),
            }
        }));
    }
    // If the ratio is a gene, it is the last gene.
    genes.resize(model.genes(), ratio as f64);
    Ok(Controller::new(model, &genes)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::Preset;

    #[test]
    fn sensors_of_robots_of_which_nothing_is_known_look_ahead_as_far_as_they_can() {
        let check = |model: &CapabilityModel, angles: &[f64]| {
            let controller = unknown(model, None).unwrap();
            let found: Vec<f64> = controller.robots().flat_map(|robot| robot.angles()).collect();
            assert_eq!(found, angles);
        };
        check(&Preset::SingleSensor.into(), &[0.0]);
        check(&Preset::TwoSensor.into(), &[0.0, 0.0]);
        let text = "ratios = [[3, 4], [4, 3]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{ angle = \"free\", angle_range = [0.5, 1] }]\n\
                    [[species]]\nname = \"b\"\nrobot.sensors = [{ angle = \"free\", angles = [-2, -1, 3] }]\n";
        check(&CampaignSpec::robots_from_toml(text).unwrap().0, &[0.5, -1.0]);
    }

    #[test]
    fn the_ratio_is_that_of_the_tracks() {
        let text = "ratios = [[3, 4], [4, 3]]\n[[species]]\nname = \"a\"\nmodel = \"turbopi\"\n\
                    [[species]]\nname = \"b\"\nmodel = \"turbopi\"\n";
        let (model, _) = CampaignSpec::robots_from_toml(text).unwrap();
        let counts = |of: Option<&[u32]>| unknown(&model, of).map(|controller| controller.counts(7));
        assert_eq!(counts(None).unwrap(), [3, 4]);
        assert_eq!(counts(Some(&[4, 3])).unwrap(), [4, 3]);
        let refused = counts(Some(&[6, 1])).unwrap_err().to_string();
        assert!(
            refused.contains("[6, 1] robots of the species, and the swarm may have [3, 4] or [4, 3]"),
            "{refused}"
        );
    }

    #[test]
    fn an_arena_is_two_lengths() {
        let sides = |text: &str| text.parse::<Arena>().map(|arena| arena.0);
        assert_eq!(sides("4x2.5"), Ok([4.0, 2.5]));
        for bad in ["", "4", "4x", "4x0", "-4x2", "4xinf", "4x2x1"] {
            assert!(sides(bad).is_err(), "{bad}");
        }
    }
}
