//! How a trajectory becomes a picture.

use crate::{CapabilityModel, Invalid, PictureShape, World, invalid, text};
use murmuration_proto::v1;

/// Name in files for pictures with all species in one channel.
const ONE: &str = "one";
/// Name in files for pictures with a channel for each species.
const SPECIES: &str = "species";

/// The format of the picture of a behaviour: its shape, and the number of last steps that it shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageFormat {
    shape: PictureShape,
    window: u32,
}

impl ImageFormat {
    /// Pixels along a side: 1 to 1,000, and at most the world's smaller side (one canvas pixel per unit).
    #[must_use]
    pub const fn resolution(&self) -> u32 {
        self.shape.side() as u32
    }

    /// Number of last steps that a picture shows, 2 to 10,000,000. The first of these steps clears the canvas.
    #[must_use]
    pub const fn window(&self) -> u32 {
        self.window
    }

    /// The shape of pictures: one channel, or one channel for each species of the swarm.
    #[must_use]
    pub const fn shape(&self) -> PictureShape {
        self.shape
    }

    /// Number of bytes of a picture.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.shape.bytes()
    }

    /// Name of the kind of channels in files: `one`, or `species`.
    #[must_use]
    pub const fn channels_name(&self) -> &'static str {
        match self.shape.channels() {
            1 => ONE,
            _ => SPECIES,
        }
    }

    /// Validates a format for simulations of swarms of `model` in `world`.
    ///
    /// # Errors
    /// The error names the field that is out of range, too large for the world, or not allowed for swarms of `model`.
    pub fn for_swarm(
        message: v1::ImageFormat,
        world: &World,
        model: &CapabilityModel,
    ) -> Result<Self, Invalid> {
        let default = Self::default();
        let channels = channels(message.channels.as_deref(), model)?;
        let side = message.resolution.unwrap_or(default.resolution());
        Ok(Self {
            shape: PictureShape::new(channels, check_resolution(side, world)? as usize)?,
            window: invalid::whole("window", message.window.unwrap_or(default.window), 2..=10_000_000)?,
        })
    }

    /// Checks that simulations in `world` can have pictures of this format.
    ///
    /// # Errors
    /// If the world is smaller than the picture.
    pub fn check_world(&self, world: &World) -> Result<(), Invalid> {
        check_resolution(self.resolution(), world).map(drop)
    }

    /// Checks that swarms of `model` can have pictures of this format.
    ///
    /// # Errors
    /// If there are several channels, and their number is not the model's number of species.
    pub fn check_species(&self, model: &CapabilityModel) -> Result<(), Invalid> {
        match (self.shape.channels(), model.species().len()) {
            (1, _) => Ok(()),
            (channels, species) if channels == species => Ok(()),
            (channels, species) => Err(Invalid::new(
                "channels",
                channels,
                format!("1, or as many as the swarm has species: {species}"),
            )),
        }
    }
}

fn check_resolution(resolution: u32, world: &World) -> Result<u32, Invalid> {
    let smaller_side = world.width().min(world.height()) as u32;
    let most = smaller_side.min(PictureShape::MAX_SIDE as u32);
    invalid::whole("resolution", resolution, 1..=most)
}

/// The number of channels of pictures of swarms of `model`.
fn channels(name: Option<&str>, model: &CapabilityModel) -> Result<usize, Invalid> {
    let refused = |allowed: String| {
        let name = name.unwrap_or_default();
        Err(Invalid::new("channels", text::quoted(name), allowed))
    };
    let most = PictureShape::MAX_CHANNELS;
    match (name, model.species().len()) {
        (None | Some(ONE), _) => Ok(1),
        (Some(SPECIES), 1) => refused(format!("\"{ONE}\": all robots are of one species")),
        (Some(SPECIES), species) if species <= most => Ok(species),
        (Some(SPECIES), species) => refused(format!(
            "\"{ONE}\" where there are {species} species: a picture has at most {most} channels"
        )),
        (Some(_), _) => refused(format!("\"{ONE}\" or \"{SPECIES}\"")),
    }
}

impl Default for ImageFormat {
    fn default() -> Self {
        Self {
            shape: PictureShape::PAPER,
            window: 160,
        }
    }
}

impl From<ImageFormat> for v1::ImageFormat {
    fn from(format: ImageFormat) -> Self {
        Self {
            resolution: Some(format.resolution()),
            window: Some(format.window),
            channels: Some(format.channels_name().to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CampaignSpec;

    fn of_species(count: usize, channels: &str) -> Result<ImageFormat, Invalid> {
        let species = |i: usize| format!("[[species]]\nname = \"s{i}\"\ncount = 1\nrobot.sensors = [{{}}]\n");
        let robots: String = (0..count).map(species).collect();
        let (model, world) = CampaignSpec::robots_from_toml(&robots).unwrap();
        let message = v1::ImageFormat {
            channels: Some(channels.to_owned()),
            ..v1::ImageFormat::default()
        };
        ImageFormat::for_swarm(message, &world, &model)
    }

    #[test]
    fn a_channel_each_means_as_many_channels_as_species() {
        for species in 2..=4 {
            let format = of_species(species, "species").unwrap();
            assert_eq!(
                (format.shape().channels(), format.bytes()),
                (species, species * 2500)
            );
            assert_eq!(format.channels_name(), "species");
            assert_eq!(of_species(species, "one").unwrap(), ImageFormat::default());
        }
    }

    #[test]
    fn what_the_channels_cannot_show_is_refused() {
        let message = |species, channels| of_species(species, channels).unwrap_err().to_string();
        assert_eq!(
            message(1, "species"),
            "channels = \"species\": must be \"one\": all robots are of one species"
        );
        assert_eq!(
            message(5, "species"),
            "channels = \"species\": must be \"one\" where there are 5 species: a picture has at most 4 channels"
        );
        assert_eq!(
            message(2, "rgb"),
            "channels = \"rgb\": must be \"one\" or \"species\""
        );
    }
}
