//! The command's interpretation of the tracks, and its assumptions about missing data.

use super::super::CliError;
use murmuration_swarm::{CampaignSpec, CapabilityModel, Controller, counted, rounded};
use murmuration_tracks::{Axes, Jump, Origin, RobotName, Tracks, Understood, YAxis};

/// The tracks in the world of the campaign.
#[derive(Debug)]
pub(super) struct Compared {
    pub(super) understood: Understood,
    pub(super) axes: Axes,
    /// Moves that no robot of the campaign can make.
    pub(super) jumps: Vec<Jump>,
    /// Time from one frame to the next, in units of the world's time.
    pub(super) frame_time: f64,
    /// World units in one unit of the tracks.
    pub(super) scale: f64,
    /// Steps that features and picture cover.
    pub(super) steps: u64,
    /// Steps that the campaign's features and pictures cover.
    pub(super) wanted: u64,
    /// Whether the campaign is complete.
    pub(super) is_complete: bool,
}

/// The interpretation of the tracks.
#[derive(Debug)]
pub(super) struct Assumed {
    pub(super) robots: u32,
    /// First and last frame.
    pub(super) frames: [u32; 2],
    /// Number of missing sightings; complete tracks have one sighting per robot and frame.
    pub(super) missing: u64,
    /// Share of the sightings with a heading, 0 to 1.
    pub(super) share_of_headings: f64,
    pub(super) compared: Compared,
    /// The robots that are left out, with the number of frames in which each is seen.
    left_out: Vec<(RobotName, u64)>,
    /// Number of rows that name no robot.
    nameless: u64,
    /// Number of lines below the header that were skipped.
    header_lines: usize,
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
        compared: Compared,
        tracks: &Tracks,
        controller: &Controller,
        is_known: bool,
        campaign: &CampaignSpec,
    ) -> Self {
        let model = controller.model();
        let is_free = model
            .species()
            .iter()
            .any(|species| species.robot().free_angles().next().is_some());
        Self {
            robots: tracks.robots(),
            frames: tracks.frames(),
            missing: tracks.missing(),
            share_of_headings: tracks.share_of_headings(),
            compared,
            left_out: tracks.left_out().to_vec(),
            nameless: tracks.nameless(),
            header_lines: tracks.header_lines(),
            looks_unknown: !is_known && is_free,
            counts_unknown: !is_known && model.ratios().len() > 1 && !tracks.names_species(),
            campaign_robots: campaign.world().agents(),
            campaign_starts: campaign.starts().into(),
        }
    }

    /// The interpretation of the tracks, a line for each part.
    pub(super) fn notes(&self) -> Vec<String> {
        let [first, last] = self.frames;
        let missing = match self.missing {
            0 => String::new(),
            missing => format!(", {missing} of the rows missing"),
        };
        let (frames, Understood { inside, width }) =
            (u64::from(last) - u64::from(first) + 1, self.compared.understood);
        let mut notes = vec![format!(
            "tracks: {}, {} ({first} to {last}{missing}); a frame lasts {}, a unit is {} in the world; {:.0} % of the positions are \
             inside the walls, the swarm is {} units wide; 0, 0 is {}, y points {}",
            counted(self.robots.into(), "robot"),
            counted(frames, "frame"),
            self.compared.frame_time,
            self.compared.scale,
            100.0 * inside,
            rounded(width, 0),
            match self.compared.axes.origin {
                Origin::Corner => "a corner",
                Origin::Centre => "the middle",
            },
            match self.compared.axes.y {
                YAxis::Down => "down",
                YAxis::Up => "up",
            }
        )];
        for (robot, seen) in &self.left_out {
            notes.push(format!(
                "left out: robot {robot}, which is seen in {}",
                counted(*seen, "frame")
            ));
        }
        if self.nameless > 0 {
            notes.push(format!(
                "left out: {} without a robot",
                counted(self.nameless, "row")
            ));
        }
        if self.header_lines > 0 {
            notes.push(format!(
                "skipped: {} below the names of the columns",
                counted(self.header_lines as u64, "line")
            ));
        }
        if !self.compared.is_complete {
            notes.push("the campaign is not complete: its archive and clusters may change".to_owned());
        }
        if self.share_of_headings < 1.0 {
            notes.push(format!(
                "assumed: a robot looks where it moves, in the {:.0} % of the rows that have no heading",
                100.0 * (1.0 - self.share_of_headings)
            ));
        }
        if self.looks_unknown {
            notes.push("assumed: sensors with free angles look straight ahead, or as nearly as they can; --controller gives their angles".to_owned());
        }
        if self.counts_unknown {
            notes.push("assumed: the numbers of robots of the species are those of the first ratio; a column species, or --controller, \
                 gives the numbers".to_owned());
        }
        if self.robots != self.campaign_robots {
            notes.push(format!(
                "the swarms of the campaign have {}, the tracks {}: distances between swarms of different sizes mean little",
                counted(self.campaign_robots.into(), "robot"),
                self.robots
            ));
        }
        if self.campaign_starts > 1 {
            notes.push(format!(
                "the individuals of the campaign are means over {} starts, and a film shows one start: the film's own individual is \
                 near, but not at distance 0",
                self.campaign_starts
            ));
        }
        if self.compared.steps < self.compared.wanted {
            notes.push(format!(
                "the tracks last only {}, but the campaign's features and pictures show {}: distances mean less",
                counted(self.compared.steps, "step"),
                self.compared.wanted
            ));
        }
        if let Some(jump) = self.compared.jumps.first() {
            notes.push(format!(
                "{jump} (such moves: {}): two robots may have exchanged their names, or a position is wrong; distances mean less",
                self.compared.jumps.len()
            ));
        }
        notes
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
}
