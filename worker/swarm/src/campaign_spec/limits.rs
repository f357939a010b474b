//! Limits of a whole campaign: the memory that it needs at one time, and its number of simulations.

use super::{CampaignSpec, sample};
use crate::{Frames, Invalid, Pose, Search, StartShape, Starts, counted};

impl CampaignSpec {
    /// Checks limits that depend on several fields.
    ///
    /// # Errors
    /// The error names the field to change.
    pub(super) fn check_limits(&self) -> Result<(), Invalid> {
        self.check_memory()?;
        self.check_initial()?;
        self.check_round()?;
        self.check_trials()
    }

    /// Checks that the first generation has room for the controllers that it begins with.
    fn check_initial(&self) -> Result<(), Invalid> {
        let (initial, population) = (self.controllers.initial().len(), self.search.population());
        if initial <= population as usize {
            return Ok(());
        }
        let value = counted(initial as u64, "controller");
        let allowed = format!("at most {population} controllers where search.population = {population}");
        Err(Invalid::new("controllers.initial", value, allowed))
    }

    /// Checks that everything held in memory at the same time fits.
    fn check_memory(&self) -> Result<(), Invalid> {
        self.check_individual()?;
        let (individual, format) = (self.individual_bytes() as u64, self.format_in_words());
        let population = self.search.population();
        let pictures = u64::from(population) * individual;
        if pictures > Self::MAX_GENERATION_BYTES {
            let allowed = format!(
                "at most {} where {format}: the pictures of a generation come to {pictures} bytes, and at most {} are \
                 held at once",
                Self::MAX_GENERATION_BYTES / individual,
                Self::MAX_GENERATION_BYTES
            );
            return Err(Invalid::new("search.population", population, allowed));
        }
        let picture = self.image.bytes() as u64;
        let motion = Frames::to_watch(&self.world).poses(&self.world) * size_of::<Pose>() as u64;
        let report = u64::from(self.medoids) * (picture + motion);
        if report > Self::MAX_TAXONOMY_BYTES {
            let allowed = format!(
                "at most {} where {format} and world.agents = {}: their pictures and motions come to \
                 {report} bytes, and a report holds at most {}",
                Self::MAX_TAXONOMY_BYTES / (picture + motion),
                self.world.agents(),
                Self::MAX_TAXONOMY_BYTES
            );
            return Err(Invalid::new("taxonomy.medoids", self.medoids, allowed));
        }
        Ok(())
    }

    /// Checks that the pictures of an individual are few enough for a message with many individuals.
    fn check_individual(&self) -> Result<(), Invalid> {
        let bytes = self.individual_bytes();
        let most = Self::MAX_INDIVIDUAL_BYTES;
        if bytes <= most {
            return Ok(());
        }
        let (channels, starts) = (self.image.shape().channels(), self.starts.get());
        if self.image.bytes() > most {
            let side = (most / channels).isqrt();
            let allowed = format!("at most {side} in {channels} channels: a picture may have {most} bytes");
            return Err(Invalid::new("image.resolution", self.image.resolution(), allowed));
        }
        let allowed = format!(
            "at most {} where {}: the pictures of an individual come to {bytes} bytes, and may come to {most}",
            most / self.image.bytes(),
            self.picture_in_words(),
        );
        Err(Invalid::new("evaluation.starts", starts, allowed))
    }

    /// `image.resolution = 50 in 2 channels`.
    fn picture_in_words(&self) -> String {
        let resolution = self.image.resolution();
        match self.image.shape().channels() {
            1 => format!("image.resolution = {resolution}"),
            channels => format!("image.resolution = {resolution} in {channels} channels"),
        }
    }

    /// The picture's format in words, with the number of starts if there are several.
    fn format_in_words(&self) -> String {
        let picture = self.picture_in_words();
        match self.starts {
            Starts::ONE => picture,
            starts => format!("{picture} and evaluation.starts = {}", u32::from(starts)),
        }
    }

    /// Checks that a campaign with its planned rounds does not have too many evaluations. A round that a person can request must
    /// not have too many evaluations by itself.
    fn check_round(&self) -> Result<(), Invalid> {
        let round = self.feedback.as_ref().map_or(0, |feedback| {
            u64::from(feedback.generations()) * u64::from(self.search.population())
        });
        if self.evaluations().max(round) <= sample::most_evaluations(self.sample) {
            return Ok(());
        }
        let value = format!("{round} evaluations a round");
        let allowed = format!(
            "at most {} evaluations in all, after every round",
            Search::MAX_EVALUATIONS
        );
        Err(Invalid::new("feedback.generations", value, allowed))
    }

    /// Checks that the trials of an individual can differ, and that a campaign does not need too many simulations.
    fn check_trials(&self) -> Result<(), Invalid> {
        let starts = u32::from(self.starts);
        let noise = self.world.noise();
        let is_random = !matches!(self.world.start(), StartShape::Poses(_))
            || noise.moves()
            || noise.misreads()
            || self.world.jitter();
        if starts > 1 && !is_random {
            let allowed = "1: all trials would be alike, since every agent starts at a given pose and nothing is random";
            return Err(Invalid::new("evaluation.starts", starts, allowed));
        }
        let most = sample::most_evaluations(self.sample);
        if self.evaluations() * u64::from(starts) > most {
            let allowed = format!(
                "at most {} for {} evaluations: at most {most} simulations in all",
                most / self.evaluations(),
                self.evaluations(),
            );
            return Err(Invalid::new("evaluation.starts", starts, allowed));
        }
        Ok(())
    }
}
