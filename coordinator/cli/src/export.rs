//! `controller export`: a controller for the firmware of a robot.

use super::{
    CliError, Global,
    connection::{self, Connection},
    controller,
    files::{FileType, Overwrite, check_outputs},
    json,
    robots::RobotArgs,
    validation::get_campaign,
};
use murmuration_coordinator::local::InProcess;
use murmuration_link::print;
use murmuration_proto::v1;
use murmuration_swarm::{
    CampaignSpec, CapabilityModel, CheckpointDigest, Controller, DriveKind, RobotController,
};
use std::{fmt::Write as _, path::PathBuf};

#[derive(Debug, clap::Subcommand)]
pub enum ControllerCommand {
    /// Write a controller as a C header, for the firmware of a robot, or as JSON
    Export(Export),
}

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The header is C99 and needs no other file. It has the table of speeds by sensor state, the angles of the sensors, and a function \
from sensor bits to a pair of speeds, for each species.

Examples:
  murmuration controller export --controller -0.7,0.3,1,1 --header pursuit.h
  murmuration controller export latest 0 --header controller.h")]
pub struct Export {
    /// Campaign of the individual to export
    #[arg(
        requires = "index",
        required_unless_present = "controller",
        conflicts_with = "controller"
    )]
    campaign: Option<String>,
    /// Index of the individual in the campaign's archive
    index: Option<u64>,
    /// Numbers of a controller, separated by commas: -0.7,0.3,1,1
    #[arg(long)]
    controller: Option<String>,
    #[command(flatten)]
    robots: RobotArgs,
    /// Write the header to this file [default: stdout]
    #[arg(long, value_name = "FILE")]
    header: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl ControllerCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let Self::Export(export) = self;
        export.execute(global).await
    }
}

impl Export {
    async fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(path) = &self.header {
            FileType::Header.check("--header", path)?;
            check_outputs([("--header", path)], self.robots.files(), self.overwrite)?;
        }
        let controller = match (&self.controller, &self.campaign, self.index) {
            (Some(text), ..) => controller::parse(text, self.robots.read()?.0.as_ref())?,
            (None, Some(campaign), Some(index)) => of_individual(global, campaign.clone(), index).await?,
            _ => {
                let message = "a controller is missing: name a campaign and an index, or give --controller";
                return Err(CliError::Input(message.to_owned()));
            }
        };
        if global.json {
            json::print(json::ExportedController::from(&controller))?;
        }
        match &self.header {
            Some(path) => self.overwrite.write(path, header(&controller)),
            None if global.json => Ok(()),
            None => Ok(print(header(&controller))?),
        }
    }
}

/// Fetches the controller of an individual in a campaign's archive.
async fn of_individual(global: &Global, campaign: String, index: u64) -> Result<Controller, CliError> {
    let get = async |connection: &mut Connection| {
        let campaign = get_campaign(&mut connection.client, campaign).await?;
        let request = v1::GetIndividualRequest {
            campaign: campaign.id.clone(),
            index,
        };
        let individual = connection.client.get_individual(request).await?.into_inner();
        Ok((campaign, individual))
    };
    let (campaign, individual) = connection::with(global, InProcess::NONE, get).await?;
    let spec = CampaignSpec::try_from(campaign.spec.unwrap_or_default())?;
    Ok(Controller::new(spec.model(), &individual.controller)?)
}

/// A C99 header with the controllers of all species.
fn header(controller: &Controller) -> String {
    let model = controller.model();
    let mut text = format!(
        "/* A controller of the {model} model, exported by Murmuration. A program can include only one\n   \
         such header: all of them define the same names.\n\n   Genes: {controller} */\n#ifndef {guard}\n#define {guard}\n",
        guard = guard(controller)
    );
    for (suffix, robot) in suffixes(model).iter().zip(controller.robots()) {
        text += &of_species(robot, suffix);
    }
    text + "\n#endif\n"
}

/// A guard name, different for each controller. A program that includes the headers of two controllers therefore fails to
/// compile; with equal guards, the compiler would ignore the second header.
fn guard(controller: &Controller) -> String {
    let text = format!("{} {controller}", controller.model().to_line());
    let digest = CheckpointDigest::of(text.as_bytes()).to_string();
    format!("MURMURATION_CONTROLLER_{}_H", digest[..8].to_uppercase())
}

/// Suffix of each species' names in C.
fn suffixes(model: &CapabilityModel) -> Vec<String> {
    let mut suffixes: Vec<String> = Vec::new();
    for (place, species) in model.species().iter().enumerate() {
        // A species' name can contain a minus sign; a name in C cannot.
        let name = format!("_{}", species.name().as_str().replace('-', "_"));
        suffixes.push(match model.species().len() {
            1 => String::new(),
            _ if suffixes.contains(&name) => format!("{name}_{}", place + 1),
            _ => name,
        });
    }
    suffixes
}

fn of_species(controller: RobotController<'_>, suffix: &str) -> String {
    let robot = controller.robot();
    let [first, second] = match robot.drive().kind() {
        DriveKind::Differential { .. } => ["speed of the left wheel", "speed of the right wheel"],
        DriveKind::Unicycle => ["speed", "turning rate"],
    };
    let (sensors, states) = (robot.sensors().len(), robot.states());
    let list = |numbers: &mut dyn Iterator<Item = f64>| {
        let numbers: Vec<_> = numbers.map(|number| format!("{number:?}")).collect();
        numbers.join(", ")
    };
    let mut text = format!(
        "\n/* The angle from the heading to the middle of each sensor, radians; positive angles turn as headings grow. */\n\
         static const double murmuration_angles{suffix}[{sensors}] = {{ {} }};\n\n\
         /* The {first} and the {second} for each state of the sensors. */\n\
         static const double murmuration_speeds{suffix}[{states}][2] = {{\n",
        list(&mut controller.angles())
    );
    for (state, pair) in controller.pairs().iter().enumerate() {
        let _ = writeln!(
            text,
            "    {{ {} }}, /* {state:0sensors$b} */",
            list(&mut pair.iter().copied())
        );
    }
    let last = sensors - 1;
    let _ = write!(
        text,
        "}};\n\n/* Sets speeds[0], the {first}, and speeds[1], the {second},\n   from what the sensors see. Bit {last} of `seen` is for \
         the first sensor, bit 0 for the last sensor;\n   other bits have no effect. */\n\
         static inline void murmuration_control{suffix}(unsigned seen, double speeds[2])\n{{\n    \
         speeds[0] = murmuration_speeds{suffix}[seen & {mask}u][0];\n    \
         speeds[1] = murmuration_speeds{suffix}[seen & {mask}u][1];\n}}\n",
        mask = states - 1
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{error::Error, fs, process::Command};

    /// Two species, one with three sensors, with names and numbers that are special in C.
    fn swarm() -> Result<Controller, Box<dyn Error>> {
        let text = "[[species]]\nname = \"a-b\"\ncount = 3\nrobot.sensors = [{}, { angle = 1e-3 }, { angle = \"free\", \
                    angle_range = [-1, 1] }]\n[[species]]\nname = \"a_b\"\ncount = 2\nmodel = \"turbopi\"\n";
        let (model, _) = CampaignSpec::robots_from_toml(text)?;
        let genes: Vec<f64> = (0..model.genes())
            .map(|gene| f64::from(gene as u32) * 1e-2 / 3.0)
            .collect();
        Ok(Controller::new(model, &genes)?)
    }

    #[test]
    fn a_header_is_c_and_does_what_the_controller_does() -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        let controller = swarm()?;
        let path = |name: &str| folder.path().join(name);
        fs::write(path("controller.h"), header(&controller))?;
        fs::write(
            path("main.c"),
            "#include <stdio.h>\n#include \"controller.h\"\nint main(void) {\n  double s[2];\n\
             for (unsigned seen = 0; seen < 8; seen++) { murmuration_control_a_b(seen, s); printf(\"%.17g %.17g\\n\", s[0], s[1]); }\n\
             for (unsigned seen = 0; seen < 2; seen++) { murmuration_control_a_b_2(seen + 6, s); printf(\"%.17g %.17g\\n\", s[0], s[1]); }\n\
             for (int i = 0; i < 3; i++) printf(\"%.17g 0\\n\", murmuration_angles_a_b[i]);\n  return 0;\n}\n",
        )?;
        let options = [
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-Wno-unused-const-variable",
            "-pedantic",
        ];
        let compiled = Command::new("cc")
            .args(options)
            .args([path("main.c"), "-o".into(), path("main")])
            .output()?;
        assert!(
            compiled.status.success(),
            "{}",
            String::from_utf8_lossy(&compiled.stderr)
        );
        let printed = String::from_utf8(Command::new(path("main")).output()?.stdout)?;
        let mut printed = printed.split_whitespace().map(str::parse::<f64>);
        for robot in controller.robots() {
            for speed in robot.pairs().as_flattened() {
                assert_eq!(printed.next(), Some(Ok(*speed)));
            }
        }
        for angle in controller
            .robots()
            .next()
            .into_iter()
            .flat_map(RobotController::angles)
        {
            assert_eq!(printed.next(), Some(Ok(angle)));
            printed.next();
        }
        assert_eq!(printed.next(), None);
        Ok(())
    }
}
