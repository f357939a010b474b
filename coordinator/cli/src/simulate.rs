//! `simulate`: one controller, or a reference case, simulated on this machine.

use super::{
    CliError, controller,
    files::{FileType, Overwrite, check_outputs, read_words},
    film, json,
    robots::RobotArgs,
};
use murmuration_files::InputKind;
use murmuration_link::outln;
use murmuration_report::picture::{self, Animation, Bodies, Colouring, Paper};
use murmuration_sim::{
    case::Case,
    evaluate::evaluate,
    replay::{poses, replay},
    simulate::Start,
};
use murmuration_swarm::{Controller, FEATURE_NAMES, ImageFormat, Invalid, Replay, World};
use murmuration_tracks::to_csv;
use std::{
    num::NonZeroU32,
    path::{Path, PathBuf},
};

/// Side of the trajectory picture, pixels.
const TRAJECTORY_SIZE: u32 = 1000;
/// Side of an image pixel in the enlarged picture, in pixels.
const IMAGE_SCALE: u32 = 10;

#[derive(Debug, clap::Args)]
#[command(after_help = "\
A controller is a list of numbers separated by commas, with or without square brackets: 4 wheel speeds (single-sensor), or 8 \
wheel speeds and an angle (two-sensor). The angle may be a multiple of pi. `murmuration robot` prints the genes of other robots, \
which --robot describes.

Examples:
  murmuration simulate --controller -0.7,0.3,1,1 --gif pursuit.gif
  murmuration simulate --controller 0.8,0.5,0.6,-0.5,-0.5,0,-0.2,0.5,-pi/3 --seed 3 --png nested-cycle.png
  murmuration simulate --controller -0.7,0.3,1,1 --svg pursuit.svg
  murmuration simulate --controller=-0.7,0.3,1,1 --mp4 pursuit.mp4
  murmuration simulate --case tests/vectors/milling_s0.json --json
  murmuration simulate --case tests/vectors/robots/cyclone.feb2023.json --gif cyclone.gif")]
pub struct Simulate {
    /// Numbers of a controller, separated by commas: -0.7,0.3,1,1
    #[arg(long, required_unless_present = "case", conflicts_with = "case")]
    controller: Option<String>,
    #[command(flatten)]
    robots: RobotArgs,
    /// Seed of the swarm's start
    #[arg(long, default_value_t = 1, conflicts_with = "case")]
    seed: u64,
    /// Reference case to simulate; the command prints the case with the simulated values
    #[arg(long, value_name = "FILE")]
    case: Option<PathBuf>,
    /// Write the whole run to this animated GIF; robots of several species have the colour of their species
    #[arg(long, value_name = "FILE")]
    gif: Option<PathBuf>,
    /// Write the trajectories of the last steps to this PNG, in colour
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    /// Write the trajectories of the last steps to this SVG, in colour, with one SVG unit per world unit
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write the whole run to this MP4 film; this needs the program ffmpeg
    #[arg(long, value_name = "FILE")]
    mp4: Option<PathBuf>,
    /// Write each robot's position and heading before the first step and after every step to this CSV, for `recognise`
    #[arg(long, value_name = "FILE", conflicts_with = "case")]
    tracks: Option<PathBuf>,
    /// Write the picture that an embedder sees to this PNG, enlarged
    #[arg(long, value_name = "FILE", conflicts_with = "case")]
    image: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl Simulate {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        self.check_files()?;
        match (&self.case, &self.controller) {
            (Some(case), _) => self.simulate_case(case),
            (None, Some(controller)) => self.simulate_controller(controller, as_json),
            (None, None) => Err(CliError::Input(
                "a controller is missing: give --controller or --case".to_owned(),
            )),
        }
    }

    fn check_files(&self) -> Result<(), CliError> {
        let named = [
            (FileType::Gif, "--gif", &self.gif),
            (FileType::Png, "--png", &self.png),
            (FileType::Svg, "--svg", &self.svg),
            (FileType::Film, "--mp4", &self.mp4),
            (FileType::Png, "--image", &self.image),
            (FileType::Csv, "--tracks", &self.tracks),
        ];
        let named = named
            .into_iter()
            .filter_map(|(kind, option, path)| Some((kind, option, path.as_ref()?)));
        for (kind, option, path) in named.clone() {
            kind.check(option, path)?;
        }
        let outputs = named.map(|(_, option, path)| (option, path));
        check_outputs(outputs, self.robots.files().chain(&self.case), self.overwrite)
    }

    fn simulate_controller(&self, genes: &str, as_json: bool) -> Result<(), CliError> {
        let (model, world, format) = self.robots.read()?;
        let controller = &controller::parse(genes, model.as_ref())?;
        let start = Start::seeded(self.seed);
        let evaluation = evaluate(controller, &world, &format, &start)?;
        let bodies = Bodies::of(controller, &world);
        self.write_motion(&world, format.window(), bodies.colouring(), |stride| {
            replay(controller, &world, &start, stride)
        })?;
        if let Some(path) = &self.image {
            let image = evaluation.image();
            self.overwrite
                .write(path, &picture::image_png(image, format.shape(), IMAGE_SCALE)?)?;
        }
        if let Some(path) = &self.tracks {
            self.overwrite.write(
                path,
                to_csv(&poses(controller, &world, &start)?, &species(controller, &world)),
            )?;
        }
        if as_json {
            json::print(json::Simulated::new(controller, self.seed, &evaluation))?;
        } else {
            outln!("controller           {controller}")?;
            for (name, value) in FEATURE_NAMES.iter().zip(evaluation.features()) {
                outln!("{name:<20} {value}")?;
            }
        }
        Ok(())
    }

    /// Draws the motion that `replay` records at the given step interval.
    fn write_motion(
        &self,
        world: &World,
        window: u32,
        colouring: Colouring<'_>,
        replay: impl Fn(NonZeroU32) -> Result<Replay, Invalid>,
    ) -> Result<(), CliError> {
        let every = |frames| NonZeroU32::new(world.horizon() / frames).unwrap_or(NonZeroU32::MIN);
        if let Some(path) = &self.gif {
            let animation = Animation::default();
            let motion = replay(every(animation.frames))?;
            self.overwrite.write(
                path,
                &picture::animation_gif(&motion, world, colouring, &animation)?,
            )?;
        }
        if let Some(path) = &self.mp4 {
            let animation = Animation::default();
            let motion = replay(every(animation.frames))?;
            let film = picture::animation_film(&motion, world, colouring, &animation)?;
            film::encode(film, animation.fps, path, self.overwrite)?;
        }
        if let Some(path) = &self.svg {
            let motion = replay(every(1200))?;
            self.overwrite
                .write(path, picture::trajectory_svg(&motion, world, colouring, window))?;
        }
        if let Some(path) = &self.png {
            let motion = replay(every(1200))?;
            let png =
                picture::trajectory_png(&motion, world, colouring, window, TRAJECTORY_SIZE, Paper::Light)?;
            self.overwrite.write(path, &png)?;
        }
        Ok(())
    }

    fn simulate_case(&self, path: &Path) -> Result<(), CliError> {
        let named = |error| CliError::Input(format!("{}: {error}", path.display()));
        let case = Case::from_json(&read_words(path, InputKind::Case)?).map_err(named)?;
        let outcome = case.run().map_err(named)?;
        let bodies = Bodies::of(case.controller(), case.world());
        let window = ImageFormat::default().window();
        self.write_motion(case.world(), window, bodies.colouring(), |stride| {
            case.replay(stride)
        })?;
        Ok(outln!("{outcome}")?)
    }
}

/// The name of each robot's species; empty if there is only one species.
fn species<'a>(controller: &'a Controller, world: &World) -> Vec<&'a str> {
    let species = controller.model().species();
    if species.len() == 1 {
        return Vec::new();
    }
    let counts = controller.counts(world.agents());
    let names = species.iter().zip(counts);
    names
        .flat_map(|(species, count)| std::iter::repeat_n(species.name().as_str(), count as usize))
        .collect()
}
