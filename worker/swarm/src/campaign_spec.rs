//! Everything that determines a campaign's outcome, validated as a whole.

mod begun;
mod exhaustive;
mod limits;
mod sample;
mod swarm;
#[cfg(test)]
mod tests;

use crate::{
    BehaviourSpace, CapabilityModel, Choice, ControllerSpace, EmbedderSource, Enumeration, Features,
    Feedback, ImageFormat, Invalid, Method, Scale, Search, Starts, TomlError, World, embedder, invalid,
    robot, text, toml_file,
};
pub use begun::Begun;
use murmuration_proto::v1;

/// A campaign's name: 1 to 64 letters, digits, `-` and `_`, so that it fits into ids and paths.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignName(String);

impl CampaignName {
    /// Maximum number of characters.
    pub const MAX_LENGTH: usize = 64;

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
        if (1..=Self::MAX_LENGTH).contains(&name.len()) && name.chars().all(fits) && !name.starts_with('-') {
            return Ok(Self(name));
        }
        let allowed = "1 to 64 letters, digits, '-' and '_', not beginning with '-'";
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
    space: BehaviourSpace,
    filter: bool,
    world: World,
    image: ImageFormat,
    controllers: ControllerSpace,
    search: Search,
    starts: Starts,
    judges: bool,
    medoids: u32,
    choice: Choice,
    sample: Option<u32>,
    embedder: Option<EmbedderSource>,
    feedback: Option<Feedback>,
}

impl CampaignSpec {
    /// Reads a campaign file (TOML; the fields are those of the message `CampaignSpec`).
    ///
    /// # Errors
    /// The error names the place that is not TOML, the unknown field, or the value that is not allowed.
    pub fn from_toml(text: &str) -> Result<Self, SpecFileError> {
        Ok(toml_file::campaign(text)?.try_into()?)
    }

    /// Reads a campaign file from a table in memory; the fields are those of [`CampaignSpec::from_toml`].
    ///
    /// # Errors
    /// The errors of [`CampaignSpec::from_toml`], without a line.
    pub fn from_table(table: toml::Table) -> Result<Self, SpecFileError> {
        Ok(toml_file::campaign_of_table(&table)?.try_into()?)
    }

    /// Reads the robots of a campaign file and their world. The file may be incomplete: the values of other fields are not
    /// checked.
    ///
    /// # Errors
    /// The errors of [`CampaignSpec::from_toml`].
    pub fn robots_from_toml(text: &str) -> Result<(CapabilityModel, World), SpecFileError> {
        Ok(swarm::swarm(&toml_file::campaign(text)?)?)
    }

    /// Writes a campaign file with every field, except some fields of the world and of the evaluation that have their defaults.
    /// [`CampaignSpec::from_toml`] reads the same specification from the file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(&v1::CampaignSpec::from(self)).unwrap_or_default()
    }

    #[must_use]
    pub const fn name(&self) -> &CampaignName {
        &self.name
    }

    /// Seed of every random stream, 0 to 2^63 - 1.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    #[must_use]
    pub const fn model(&self) -> &CapabilityModel {
        self.controllers.model()
    }

    /// How controllers are proposed.
    #[must_use]
    pub const fn method(&self) -> Method {
        self.method
    }

    /// Behaviour space, in which novelty, clusters, queries and maps are measured.
    #[must_use]
    pub const fn space(&self) -> BehaviourSpace {
        self.space
    }

    /// The scale of an archive whose first individuals have these features and embeddings.
    pub fn scale(&self, archive: impl Iterator<Item = (Features, Vec<f32>)>) -> Scale {
        let first = archive.take(self.search.population() as usize);
        Scale::of(self.space, &first.collect::<Vec<_>>())
    }

    /// Whether proposals must pass the heuristic filter.
    #[must_use]
    pub const fn filter(&self) -> bool {
        self.filter
    }

    #[must_use]
    pub const fn world(&self) -> &World {
        &self.world
    }

    #[must_use]
    pub const fn image(&self) -> &ImageFormat {
        &self.image
    }

    /// The controllers that a search can propose.
    #[must_use]
    pub const fn controllers(&self) -> &ControllerSpace {
        &self.controllers
    }

    #[must_use]
    pub const fn search(&self) -> &Search {
        &self.search
    }

    /// Number of trials of each individual.
    #[must_use]
    pub const fn starts(&self) -> Starts {
        self.starts
    }

    /// Whether the judge names the class of each trial.
    #[must_use]
    pub const fn judges(&self) -> bool {
        self.judges
    }

    /// Number of medoids in the taxonomy.
    #[must_use]
    pub const fn medoids(&self) -> u32 {
        self.medoids
    }

    /// How the behaviours of the taxonomy are chosen.
    #[must_use]
    pub const fn choice(&self) -> Choice {
        self.choice
    }

    /// Number of individuals that taxonomy, map and report cover, the first of the archive; `None` for all individuals. With a
    /// sample, the method is [`Method::Random`] or [`Method::Exhaustive`], and the behaviour space has no embedding.
    #[must_use]
    pub const fn sample(&self) -> Option<u32> {
        self.sample
    }

    /// All controllers of the space, in the order in which the method [`Method::Exhaustive`] evaluates them; `None` if they cannot
    /// be enumerated.
    #[must_use]
    pub fn enumeration(&self) -> Option<Enumeration<'_>> {
        let all = Enumeration::of(&self.controllers, &self.world)?;
        Some(if self.sample.is_some() {
            all.scattered()
        } else {
            all
        })
    }

    /// Whether the novelty of individuals is measured when they are evaluated.
    #[must_use]
    pub const fn has_novelty(&self) -> bool {
        self.method.has_novelty() && self.sample.is_none()
    }

    /// The source of the first embedder; `None` if and only if the behaviour space has no embedding.
    #[must_use]
    pub const fn embedder(&self) -> Option<&EmbedderSource> {
        self.embedder.as_ref()
    }

    /// How the campaign learns from labels; `None` if and only if the behaviour space has no embedding.
    #[must_use]
    pub const fn feedback(&self) -> Option<&Feedback> {
        self.feedback.as_ref()
    }

    /// Maximum number of bytes of a generation's pictures (4 GiB): a coordinator holds all pictures in memory until the
    /// generation is on disk.
    pub const MAX_GENERATION_BYTES: u64 = 4 << 30;
    /// Maximum number of bytes of the pictures of an individual's trials: one result of a worker contains the pictures of many
    /// individuals.
    pub(crate) const MAX_INDIVIDUAL_BYTES: usize = 1_000_000;
    /// Maximum number of bytes of the pictures and motions of a report's behaviours (1 GiB): a report holds all of these pictures
    /// and motions.
    pub(crate) const MAX_TAXONOMY_BYTES: u64 = 1 << 30;

    /// Number of bytes of an individual's pictures, one picture per trial.
    #[must_use]
    pub const fn individual_bytes(&self) -> usize {
        self.starts.get() * self.image.bytes()
    }

    /// Number of evaluations if nobody intervenes, including the evaluations after unattended rounds.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        let further = self.feedback.as_ref().map_or(0, |feedback| {
            u64::from(feedback.rounds()) * u64::from(feedback.generations())
        });
        self.search.evaluations() + further * u64::from(self.search.population())
    }

    /// A copy with another seed (0 to 2^63 - 1). The training gets the seed too, unless the training has a seed of its own.
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

    /// A copy with another number of generations of the search, without those of rounds of feedback.
    ///
    /// # Errors
    /// If a campaign cannot have so many generations, or has all controllers of its method already.
    pub fn with_generations(&self, generations: u32) -> Result<Self, Invalid> {
        let mut message = v1::CampaignSpec::from(self);
        message.search.get_or_insert_default().generations = Some(generations);
        message.try_into()
    }
}

impl TryFrom<v1::CampaignSpec> for CampaignSpec {
    type Error = Invalid;

    fn try_from(message: v1::CampaignSpec) -> Result<Self, Invalid> {
        let (model, world) = swarm::swarm(&message)?;
        let method = Method::try_from(message.method)?;
        let space = BehaviourSpace::from_field(message.space.as_deref(), method)?;
        let filter = message.filter.unwrap_or(false);
        let controllers = ControllerSpace::for_model(message.controllers.unwrap_or_default(), &model)
            .map_err(|e| e.within("controllers"))?;
        exhaustive::check_unused(method, filter, &controllers)?;
        let evaluation = message.evaluation.unwrap_or_default();
        let starts = match evaluation.starts {
            Some(starts) => Starts::new("evaluation.starts", starts)?,
            None => Starts::ONE,
        };
        let taxonomy = message.taxonomy.unwrap_or_default();
        let most = sample::most_evaluations(taxonomy.sample);
        let search = exhaustive::search(
            message.search.unwrap_or_default(),
            method,
            &controllers,
            &world,
            most / u64::from(u32::from(starts)),
        )?;
        let search = Search::try_from(search).map_err(|e| e.within("search"))?;
        let sample = sample::checked(taxonomy.sample, method, space, &search)?;
        let default_medoids = match model.species() {
            [alone] if alone.robot().sensors().len() == 1 => 12,
            _ => 16,
        };
        let choice = Choice::from_field(taxonomy.choose.as_deref(), space)
            .map_err(|error| error.within("taxonomy"))?;
        let most_medoids = search.evaluations().min(1000) as u32;
        let medoids = taxonomy.medoids.unwrap_or(default_medoids.min(most_medoids));
        let seed = invalid::whole("seed", message.seed.unwrap_or(1), 0..=i64::MAX as u64)?;
        let image = ImageFormat::for_swarm(message.image.unwrap_or_default(), &world, &model)
            .map_err(|e| e.within("image"))?;
        let embedder = embedder::Fields {
            checkpoint: message.checkpoint,
            dataset: message.dataset,
            training: message.training,
        };
        let feedback = match (space.embeds(), message.feedback) {
            (true, given) => {
                let feedback = Feedback::try_from(given.unwrap_or_default());
                Some(feedback.map_err(|error| error.within("feedback"))?)
            }
            (false, None) => None,
            (false, Some(_)) => {
                let allowed = format!("absent: the space \"{space}\" has no embedding to be taught");
                return Err(Invalid::new("feedback", "given", allowed));
            }
        };
        let spec = Self {
            feedback,
            name: message
                .name
                .unwrap_or_else(|| swarm::default_name(&model).to_owned())
                .try_into()?,
            embedder: EmbedderSource::from_fields(embedder, method, space, seed, filter, &image)?,
            seed,
            method,
            space,
            filter,
            image,
            controllers,
            medoids: invalid::whole("taxonomy.medoids", medoids, 1..=most_medoids)?,
            choice,
            sample,
            starts,
            judges: evaluation.judge.unwrap_or(method == Method::Exhaustive),
            world,
            search,
        };
        spec.check_limits()?;
        Ok(spec)
    }
}

impl From<&CampaignSpec> for v1::CampaignSpec {
    fn from(spec: &CampaignSpec) -> Self {
        let embedder = spec.embedder.as_ref().map(EmbedderSource::to_fields);
        let (checkpoint, dataset, training) = embedder.map_or((None, None, None), |fields| {
            (fields.checkpoint, fields.dataset, fields.training)
        });
        let robots = robot::Written::from(spec.model());
        Self {
            checkpoint,
            dataset,
            training,
            feedback: spec.feedback.as_ref().map(Into::into),
            name: Some(spec.name.0.clone()),
            seed: Some(spec.seed),
            model: robots.model,
            robot: robots.robot,
            species: robots.species,
            ratios: robots.ratios,
            method: v1::Method::from(spec.method) as i32,
            space: Some(spec.space.name().to_owned()),
            filter: Some(spec.filter),
            world: Some(spec.world.clone().into()),
            image: Some(spec.image.into()),
            controllers: Some((&spec.controllers).into()),
            search: Some(spec.search.into()),
            taxonomy: Some(v1::TaxonomyFormat {
                medoids: Some(spec.medoids),
                choose: Some(spec.choice.name().to_owned()),
                sample: spec.sample,
            }),
            evaluation: Some(v1::EvaluationParams {
                starts: Some(spec.starts.into()),
                judge: (spec.judges || spec.method == Method::Exhaustive).then_some(spec.judges),
            }),
        }
    }
}

/// Error in a campaign file.
#[derive(Debug, thiserror::Error)]
pub enum SpecFileError {
    /// A text that is not TOML, an unknown field, or a value of the wrong type, with the place in the file.
    #[error(transparent)]
    Syntax(#[from] TomlError),
    #[error(transparent)]
    Value(#[from] Invalid),
}
