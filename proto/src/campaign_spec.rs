//! Everything that determines a campaign's outcome, validated as a whole.

use crate::{
    CapabilityModel, ControllerSpace, EmbedderSource, Feedback, Frames, ImageFormat, Invalid, Method, Pose,
    Search, TomlError, World, embedder, invalid, robot, text, toml_errors, v1,
};
use std::f64::consts::PI;

/// A campaign's name: 1 to 64 letters, digits, `-` and `_`, so that it fits into ids and paths.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignName(String);

impl CampaignName {
    /// The name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for CampaignName {
    type Error = Invalid;

    fn try_from(name: String) -> Result<Self, Invalid> {
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        // With a leading '-', a campaign's id would be read as an option.
        if (1..=64).contains(&name.len()) && name.chars().all(fits) && !name.starts_with('-') {
            return Ok(Self(name));
        }
        let allowed = "1 to 64 letters, digits, '-' and '_', the first of them no '-'";
        Err(Invalid::new("name", text::quoted(&name), allowed))
    }
}

/// The specification of a campaign: everything that determines its outcome. The same specification gives the same archive,
/// bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignSpec {
    name: CampaignName,
    seed: u64,
    method: Method,
    filter: bool,
    world: World,
    image: ImageFormat,
    controllers: ControllerSpace,
    search: Search,
    medoids: u32,
    embedder: Option<EmbedderSource>,
    feedback: Option<Feedback>,
}

impl CampaignSpec {
    /// Reads a campaign file (TOML; the fields are those of the message `CampaignSpec`).
    ///
    /// # Errors
    /// Says where the text is not TOML, which field is unknown, or which value is not allowed.
    pub fn from_toml(text: &str) -> Result<Self, SpecFileError> {
        Ok(toml_errors::campaign(text)?.try_into()?)
    }

    /// Reads the robots of a campaign file, and the world that they are in. The file need not be whole: other fields than those
    /// are not looked at.
    ///
    /// # Errors
    /// As [`CampaignSpec::from_toml`].
    pub fn robots_from_toml(text: &str) -> Result<(CapabilityModel, World), SpecFileError> {
        Ok(swarm(&toml_errors::campaign(text)?)?)
    }

    /// Writes a campaign file with every field but those of obstacles, start and noise where the world has the paper's;
    /// [`CampaignSpec::from_toml`] reads the same specification back.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(&v1::CampaignSpec::from(self)).unwrap_or_default()
    }

    /// Its name.
    #[must_use]
    pub const fn name(&self) -> &CampaignName {
        &self.name
    }

    /// Seed of every random stream, 0 to 2^63 - 1.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    /// The robots' capability model.
    #[must_use]
    pub const fn model(&self) -> &CapabilityModel {
        self.controllers.model()
    }

    /// How controllers are proposed.
    #[must_use]
    pub const fn method(&self) -> Method {
        self.method
    }

    /// Whether proposals must pass the heuristic filter.
    #[must_use]
    pub const fn filter(&self) -> bool {
        self.filter
    }

    /// The arena.
    #[must_use]
    pub const fn world(&self) -> &World {
        &self.world
    }

    /// The pictures.
    #[must_use]
    pub const fn image(&self) -> &ImageFormat {
        &self.image
    }

    /// The controllers that a search can propose.
    #[must_use]
    pub const fn controllers(&self) -> &ControllerSpace {
        &self.controllers
    }

    /// The parameters of the search.
    #[must_use]
    pub const fn search(&self) -> &Search {
        &self.search
    }

    /// Number of medoids in the taxonomy.
    #[must_use]
    pub const fn medoids(&self) -> u32 {
        self.medoids
    }

    /// The source of the first embedder; `None` if and only if the method has no embedding.
    #[must_use]
    pub const fn embedder(&self) -> Option<&EmbedderSource> {
        self.embedder.as_ref()
    }

    /// How the campaign is taught; `None` if and only if the method has no embedding.
    #[must_use]
    pub const fn feedback(&self) -> Option<&Feedback> {
        self.feedback.as_ref()
    }

    /// Maximum number of bytes of a generation's pictures (4 GiB): a coordinator holds them all until the generation is on disk.
    pub const MAX_GENERATION_BYTES: u64 = 4 << 30;
    /// Maximum number of bytes of the pictures and motions of a report's behaviours (1 GiB): a report holds them all.
    pub const MAX_TAXONOMY_BYTES: u64 = 1 << 30;

    /// Number of evaluations if nobody intervenes, including those after unattended rounds.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        let further = self.feedback.as_ref().map_or(0, |feedback| {
            u64::from(feedback.rounds()) * u64::from(feedback.generations())
        });
        self.search.evaluations() + further * u64::from(self.search.population())
    }

    /// A copy with another seed (0 to 2^63 - 1). The training gets the seed too, unless it has its own.
    ///
    /// # Errors
    /// If the seed is out of range.
    pub fn with_seed(self, seed: u64) -> Result<Self, Invalid> {
        let mut message = v1::CampaignSpec::from(&self);
        message.seed = Some(seed);
        if let Some(EmbedderSource::Trained { training, .. }) = &self.embedder
            && training.seed() == self.seed
        {
            message.training = Some(training.with_seed(seed)?.to_toml());
        }
        message.try_into()
    }
}

impl CampaignSpec {
    /// Checks that everything held in memory at the same time fits.
    fn check_memory(&self) -> Result<(), Invalid> {
        let pixels = self.image.pixels() as u64;
        let population = self.search.population();
        let pictures = u64::from(population) * pixels;
        if pictures > Self::MAX_GENERATION_BYTES {
            let allowed = format!(
                "at most {} where image.resolution = {}: the pictures of a generation come to {pictures} bytes, and at \
                 most {} are held at once",
                Self::MAX_GENERATION_BYTES / pixels,
                self.image.resolution(),
                Self::MAX_GENERATION_BYTES
            );
            return Err(Invalid::new("search.population", population, allowed));
        }
        let motion = Frames::to_watch(&self.world).poses(&self.world) * size_of::<Pose>() as u64;
        let report = u64::from(self.medoids) * (pixels + motion);
        if report > Self::MAX_TAXONOMY_BYTES {
            let allowed = format!(
                "at most {} where image.resolution = {} and world.agents = {}: their pictures and motions come to \
                 {report} bytes, and a report holds at most {}",
                Self::MAX_TAXONOMY_BYTES / (pixels + motion),
                self.image.resolution(),
                self.world.agents(),
                Self::MAX_TAXONOMY_BYTES
            );
            return Err(Invalid::new("taxonomy.medoids", self.medoids, allowed));
        }
        Ok(())
    }
}

impl TryFrom<v1::CampaignSpec> for CampaignSpec {
    type Error = Invalid;

    fn try_from(message: v1::CampaignSpec) -> Result<Self, Invalid> {
        let (model, world) = swarm(&message)?;
        let search = Search::try_from(message.search.unwrap_or_default()).map_err(|e| e.within("search"))?;
        let default_medoids = match model.species() {
            [alone] if alone.robot().sensors().len() == 1 => 12,
            _ => 16,
        };
        let medoids = message
            .taxonomy
            .unwrap_or_default()
            .medoids
            .unwrap_or(default_medoids);
        let most_medoids = search.evaluations().min(1000) as u32;
        let seed = invalid::whole("seed", message.seed.unwrap_or(1), 0..=i64::MAX as u64)?;
        let method = Method::try_from(message.method)?;
        let filter = message.filter.unwrap_or(false);
        let image = ImageFormat::for_world(message.image.unwrap_or_default(), &world)
            .map_err(|e| e.within("image"))?;
        let embedder = embedder::Fields {
            checkpoint: message.checkpoint,
            dataset: message.dataset,
            training: message.training,
        };
        let feedback = match (method.embeds(), message.feedback) {
            (true, given) => {
                let feedback = Feedback::try_from(given.unwrap_or_default());
                Some(feedback.map_err(|error| error.within("feedback"))?)
            }
            (false, None) => None,
            (false, Some(_)) => {
                let allowed = format!("absent: the method \"{method}\" has no embedding to be taught");
                return Err(Invalid::new("feedback", "given", allowed));
            }
        };
        let spec = Self {
            feedback,
            name: message
                .name
                .unwrap_or_else(|| default_name(&model).to_owned())
                .try_into()?,
            embedder: EmbedderSource::from_fields(embedder, method, (seed, filter), &image)?,
            seed,
            method,
            filter,
            image,
            controllers: ControllerSpace::for_model(message.controllers.unwrap_or_default(), &model)
                .map_err(|e| e.within("controllers"))?,
            medoids: invalid::whole("taxonomy.medoids", medoids, 1..=most_medoids)?,
            world,
            search,
        };
        spec.check_memory()?;
        // Without planned rounds, one round counts: a person may request it.
        let round = spec.feedback.as_ref().map_or(0, |feedback| {
            u64::from(feedback.generations()) * u64::from(spec.search.population())
        });
        if spec.evaluations().max(round) > Search::MAX_EVALUATIONS {
            let value = format!("{round} evaluations a round");
            let allowed = format!(
                "at most {} evaluations in all, after every round",
                Search::MAX_EVALUATIONS
            );
            return Err(Invalid::new("feedback.generations", value, allowed));
        }
        Ok(spec)
    }
}

fn default_name(model: &CapabilityModel) -> &'static str {
    match (model.preset(), model.ratios()) {
        (Some(preset), _) => preset.name(),
        (None, []) => "robot",
        (None, _) => "swarm",
    }
}

/// The robots, and the world that they are in: its agents are as many as the robots, and its radius is that of the largest.
fn swarm(message: &v1::CampaignSpec) -> Result<(CapabilityModel, World), Invalid> {
    let mut world = message.world.clone().unwrap_or_default();
    let angles = message
        .controllers
        .as_ref()
        .map_or(&[][..], |space| &space.angles);
    let model = capability_model(message, &robot::Defaults::of(&world), angles)?;
    world.radius = Some(model.largest_radius());
    if let Some(robots) = model.robots() {
        match world.agents {
            Some(agents) if agents != robots => {
                let allowed = format!("{robots}, as many as all species have together, or absent");
                return Err(Invalid::new("world.agents", agents, allowed));
            }
            _ => world.agents = Some(robots),
        }
    }
    Ok((
        model,
        World::try_from(world).map_err(|error| error.within("world"))?,
    ))
}

fn capability_model(
    message: &v1::CampaignSpec,
    default: &robot::Defaults,
    angles: &[f64],
) -> Result<CapabilityModel, Invalid> {
    if message.species.is_empty() {
        if !message.ratios.is_empty() {
            return Err(Invalid::new(
                "ratios",
                "given",
                "absent where there are no species",
            ));
        }
        let described = message.robot.clone().map(|robot| with_range(robot, angles));
        let robot = robot::robot(message.model.as_deref(), described, default);
        return CapabilityModel::of_one(robot.map_err(|error| match error.field.as_str() {
            "radius" | "wheel_radius" => error.within("world"),
            _ => error,
        })?)
        .map_err(|error| error.within("robot"));
    }
    for (field, given) in [
        ("model", message.model.is_some()),
        ("robot", message.robot.is_some()),
    ] {
        if given {
            return Err(Invalid::new(
                field,
                "given",
                "absent where there are species, which say what they are",
            ));
        }
    }
    let mut species = message.species.clone();
    for species in &mut species {
        species.robot = species.robot.take().map(|robot| with_range(robot, angles));
    }
    CapabilityModel::of_messages(species, message.ratios.clone(), default)
}

/// The same robot, its sensors with a free angle of which nothing is said free in a whole turn: the angles of the controller
/// space are what they choose from.
fn with_range(mut robot: v1::Robot, angles: &[f64]) -> v1::Robot {
    for sensor in &mut robot.sensors {
        let is_free = sensor.angle.is_some_and(|angle| angle.fixed.is_none());
        if is_free && !angles.is_empty() && sensor.angle_range.is_empty() && sensor.angles.is_empty() {
            sensor.angle_range = vec![-PI, PI];
        }
    }
    robot
}

impl From<&CampaignSpec> for v1::CampaignSpec {
    fn from(spec: &CampaignSpec) -> Self {
        let embedder = spec.embedder.as_ref().map(EmbedderSource::to_fields);
        let (checkpoint, dataset, training) = embedder.map_or((None, None, None), |fields| {
            (fields.checkpoint, fields.dataset, fields.training)
        });
        let model = spec.model();
        let preset = model.preset();
        let (robot, species, ratios) = match (preset, model.ratios(), model.species()) {
            (Some(_), _, _) => (None, Vec::new(), Vec::new()),
            (None, [], [alone, ..]) => (Some(alone.robot().into()), Vec::new(), Vec::new()),
            (None, _, species) => (
                None,
                species.iter().map(Into::into).collect(),
                robot::ratios(model),
            ),
        };
        Self {
            checkpoint,
            dataset,
            training,
            feedback: spec.feedback.as_ref().map(Into::into),
            name: Some(spec.name.0.clone()),
            seed: Some(spec.seed),
            model: preset.map(|preset| preset.name().to_owned()),
            robot,
            species,
            ratios,
            method: v1::Method::from(spec.method) as i32,
            filter: Some(spec.filter),
            world: Some(spec.world.clone().into()),
            image: Some(spec.image.into()),
            controllers: Some((&spec.controllers).into()),
            search: Some(spec.search.into()),
            taxonomy: Some(v1::TaxonomyFormat {
                medoids: Some(spec.medoids),
            }),
        }
    }
}

/// Why a campaign file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SpecFileError {
    /// Not TOML, or a field that does not exist, or a value of the wrong type; says where.
    #[error("{0}")]
    Syntax(#[from] TomlError),
    /// A value that is not allowed.
    #[error("{0}")]
    Value(#[from] Invalid),
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[track_caller]
    fn check_refused(text: &str, said: &str) {
        let error = CampaignSpec::from_toml(text).unwrap_err().to_string();
        assert!(error.contains(said), "{error:?} does not say {said:?}");
    }

    const MINIMAL: &str = "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n";

    #[test]
    fn what_is_not_said_takes_its_default() {
        let spec = CampaignSpec::from_toml(MINIMAL).unwrap();
        assert_eq!(spec.search().evaluations(), 10_000);
        assert_eq!((spec.medoids(), spec.search().neighbours()), (12, 15));
        assert_eq!(spec.name().as_str(), "single-sensor");
    }

    #[test]
    fn what_is_wrong_is_named() {
        check_refused("model = ", "line 1");
        check_refused(
            "method = \"random\"",
            "model = nothing: must be \"single-sensor\" or \"two-sensor\" or \"flockbots\" or \"turbopi\", or absent where the robot is described",
        );
        check_refused(
            "model = \"three-sensor\"\nmethod = \"random\"",
            "model = \"three-sensor\": must be",
        );
        check_refused(&format!("{MINIMAL}sed = 3"), "unknown field `sed`");
        check_refused(&format!("{MINIMAL}name = \"a b\""), "name = \"a b\"");
        check_refused(&format!("{MINIMAL}name = \"-x\""), "name = \"-x\"");
        check_refused(
            &format!("{MINIMAL}[search]\npopulation = 0"),
            "search.population = 0: must be a whole number from 1",
        );
        check_refused(
            &format!("{MINIMAL}[search]\nmutation = nan"),
            "search.mutation = NaN",
        );
        check_refused(
            &format!("{MINIMAL}[search]\npopulation = 1\ngenerations = 3"),
            "taxonomy.medoids = 12",
        );
        check_refused(
            &format!("{MINIMAL}[world]\nwidth = 30"),
            "world.width = 30: must be at least 2 (radius + padding) = 40",
        );
        check_refused(
            &format!("{MINIMAL}[image]\nresolution = 501"),
            "image.resolution = 501: must be a whole number from 1 to 500",
        );
        check_refused(
            &format!("{MINIMAL}[controllers]\nangles = [1.0]"),
            "controllers.angles",
        );
    }

    const THREE: &str = "method = \"random\"\n[robot]\nradius = 6\nsensors = [\n  { angle = 0.0 },\n  { angle = \"free\", \
                         angles = [0.5, -0.5], half_angle = 0.2, range = 120 },\n  { angle = 1.5, range = 40, sees = \
                         [\"walls\"] },\n]\n";

    #[test]
    fn a_described_robot_is_read_and_written() {
        let spec = CampaignSpec::from_toml(THREE).unwrap();
        assert_eq!((spec.model().genes(), spec.world().radius()), (17, 6.0));
        assert_eq!((spec.name().as_str(), spec.medoids()), ("robot", 16));
        assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        let of_list = THREE.replace("angles = [0.5, -0.5], ", "");
        check_refused(
            &of_list,
            "robot.sensors[1].angle = free: must be free within a range",
        );
        let spec = CampaignSpec::from_toml(&format!("{of_list}[controllers]\nangles = [0.5]")).unwrap();
        assert_eq!(spec.controllers().genes()[16], crate::GeneSpace::Among(vec![0.5]));
        assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        check_refused(
            &format!("model = \"two-sensor\"\n{THREE}"),
            "model = \"two-sensor\": must be absent",
        );
        check_refused(&THREE.replace("0.2", "3.2"), "robot.sensors[1].half_angle = 3.2");
        check_refused(
            &THREE.replace("\"walls\"", "\"cats\""),
            "robot.sensors[2].sees = \"cats\"",
        );
        check_refused(
            &THREE.replace("0.5, -0.5", "\"x\""),
            "robot.sensors[1].angles must be a number",
        );
    }

    const TWO: &str = "method = \"random\"\nratios = [[12, 12], [8, 16]]\n[[species]]\nname = \"a\"\nmodel = \"two-sensor\"\n\
                       [[species]]\nname = \"b\"\nrobot.sensors = [{ sees = [\"a\"] }]\n";

    #[test]
    fn species_are_read_and_written() {
        let spec = CampaignSpec::from_toml(TWO).unwrap();
        assert_eq!((spec.model().genes(), spec.world().agents()), (14, 24));
        assert_eq!(spec.model().to_string(), "swarm of a and b");
        assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        check_refused(
            &format!("{TWO}[world]\nagents = 9"),
            "world.agents = 9: must be 24",
        );
        check_refused(
            &TWO.replace("\"a\"]", "\"c\"]"),
            "species[1].robot.sensors[0].sees = \"c\"",
        );
        check_refused(
            &TWO.replace("ratios = [[12, 12], [8, 16]]\n", ""),
            "species[0].count = nothing",
        );
        check_refused(
            &TWO.replace("name = \"b\"", "name = \"b\"\ncount = 3"),
            "species[1].count = 3",
        );
        let shares = TWO
            .replace("ratios = [[12, 12], [8, 16]]\n", "")
            .replace("name = ", "share = 0.5\nname = ");
        let spec = CampaignSpec::from_toml(&shares).unwrap();
        assert_eq!(spec.model().ratios(), [[12, 12]]);
        check_refused(&shares.replace("0.5", "0.3"), "species[0].share = 0.3");
    }

    #[test]
    fn what_cannot_be_held_at_once_is_refused_with_the_sum() {
        let large = "[world]\nwidth = 1000\nheight = 1000\n";
        check_refused(
            &format!("{MINIMAL}{large}[image]\nresolution = 1000\n[search]\npopulation = 100000"),
            "search.population = 100000: must be at most 4294 where image.resolution = 1000: the pictures of a \
             generation come to 100000000000 bytes, and at most 4294967296 are held at once",
        );
        check_refused(
            &format!("{MINIMAL}{large}[image]\nresolution = 1000\n[taxonomy]\nmedoids = 1000"),
            "taxonomy.medoids = 1000: must be at most",
        );
        check_refused(
            &format!("{MINIMAL}[world]\nagents = 10000\n[taxonomy]\nmedoids = 100"),
            "taxonomy.medoids = 100: must be at most 29 where image.resolution = 50 and world.agents = 10000",
        );
        let fits = [
            "[image]\nresolution = 1000\n[search]\npopulation = 4000\ngenerations = 3",
            "[image]\nresolution = 1000\n[taxonomy]\nmedoids = 900",
        ];
        for more in fits {
            CampaignSpec::from_toml(&format!("{MINIMAL}{large}{more}")).unwrap();
        }
        CampaignSpec::from_toml(&format!("{MINIMAL}[search]\npopulation = 100000")).unwrap();
    }

    #[test]
    fn rounds_count_into_what_a_campaign_may_be() {
        let latent = "model = \"single-sensor\"\nmethod = \"latent\"\n[search]\npopulation = 1000\ngenerations = 1000\n";
        let rounds = |rounds, generations| {
            let text = format!("{latent}[feedback]\nrounds = {rounds}\ngenerations = {generations}");
            CampaignSpec::from_toml(&text)
        };
        assert_eq!(rounds(9, 1000).unwrap().evaluations(), Search::MAX_EVALUATIONS);
        assert!(rounds(0, 10_000).is_ok());
        for (many, long) in [(9, 1001), (10, 1000), (0, 10_001), (1000, 100_000)] {
            let error = rounds(many, long).unwrap_err().to_string();
            assert!(error.contains("at most 10000000 evaluations in all"), "{error}");
        }
    }

    proptest! {
        #[test]
        fn a_written_specification_reads_back(seed in 0..=i64::MAX as u64, width in 50.0..10_000.0f64, two: bool, filter: bool) {
            let model = if two { "two-sensor" } else { "single-sensor" };
            let text = format!("model = \"{model}\"\nmethod = \"random\"\nseed = {seed}\nfilter = {filter}\n[world]\nwidth = {width}\nradius = 4");
            let spec = CampaignSpec::from_toml(&text).unwrap();
            prop_assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,200}") {
            let _ = CampaignSpec::from_toml(&text);
        }
    }
}
