//! `figure`: the paths of chosen behaviours in one file, for a paper.

use super::{
    CliError, Global,
    connection::{self, Connection},
    files::{Overwrite, check_outputs},
    json,
    report::tell_of_missing_worker,
    validation::{self, get_campaign},
};
use murmuration_coordinator::local::InProcess;
use murmuration_link::{errln, outln};
use murmuration_report::paper::{Behaviours, Columns, Format, Labels, Options, Panel, PaperFigure, Width};
use murmuration_service::report_data::{self, PicturesOf};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
Each picture shows the paths of the last steps of a behaviour, as in the report. The size of the text, 7.5 points, does not depend \
on the width, so include the figure at its own size.

Examples:
  murmuration figure latest --out behaviours.pdf
  murmuration figure latest --behaviours 1,3 --labels letters --out behaviours.svg
  murmuration figure latest --width page --columns 6 --shares --out behaviours.png")]
pub struct FigureCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Numbers of behaviours in the report, in the order of the figure [default: the distinct behaviours]
    #[arg(long, value_name = "NUMBERS")]
    behaviours: Option<Behaviours>,
    /// Width on paper: column (85mm), page (178mm), or from 20mm to 500mm
    #[arg(long, default_value_t)]
    width: Width,
    /// Number of behaviours in a row [default: as many as are large enough to see]
    #[arg(long, value_name = "N")]
    columns: Option<Columns>,
    /// Label of each behaviour: names, letters, numbers or none; names that no person gave have a question mark
    #[arg(long, default_value = Labels::Names.name())]
    labels: Labels,
    /// Show the share of each behaviour's cluster in the archive
    #[arg(long)]
    shares: bool,
    /// File for the figure; its ending is the format: .pdf, .svg, or .png (300 pixels per inch)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl FigureCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let format = format_of(&self.out)?;
        check_outputs([("--out", &self.out)], [], self.overwrite)?;
        let in_process = InProcess {
            workers: 1,
            ..InProcess::NONE
        };
        let draw = async |connection: &mut Connection| self.draw(connection).await;
        let figure = connection::with(global, in_process, draw).await?;
        self.overwrite.write(&self.out, figure.file(format)?)?;
        self.tell(&figure, global)
    }

    async fn draw(&self, connection: &mut Connection) -> Result<PaperFigure, CliError> {
        let campaign = get_campaign(&mut connection.client, &self.campaign).await?;
        tell_of_missing_worker(&campaign, connection);
        let id = validation::id(&campaign)?;
        let names = report_data::names(&mut connection.labels, id.as_str()).await?;
        let client = &mut connection.client;
        let report = report_data::report(client, id.as_str(), names, PicturesOf::Medoids).await?;
        let options = self.options();
        let draw = move || PaperFigure::draw(&report, &options);
        match tokio::task::spawn_blocking(draw).await {
            Ok(drawn) => Ok(drawn?),
            Err(_) => Err(CliError::Failed(
                "the figure could not be drawn because of a bug".to_owned(),
            )),
        }
    }

    fn options(&self) -> Options {
        Options {
            behaviours: self.behaviours.clone(),
            width: self.width,
            columns: self.columns,
            labels: self.labels,
            shares: self.shares,
        }
    }

    fn tell(&self, figure: &PaperFigure, global: &Global) -> Result<(), CliError> {
        let [width_mm, height_mm] = figure.size_mm();
        let path = self.out.display().to_string();
        if global.json {
            let behaviours = figure.panels.iter().map(document).collect();
            return Ok(json::print(json::Figure {
                figure: path,
                width_mm,
                height_mm,
                behaviours,
            })?);
        }
        errln!(
            "{width_mm} mm wide, {height_mm} mm high: {}",
            caption(&figure.panels, self.labels)
        );
        outln!("{path}")?;
        Ok(())
    }
}

/// The format that the ending of a file's name stands for.
fn format_of(path: &Path) -> Result<Format, CliError> {
    let ending = path.extension().unwrap_or_default();
    let mut formats = Format::ALL.into_iter();
    formats
        .find(|format| ending.eq_ignore_ascii_case(format.ending()))
        .ok_or_else(|| {
            CliError::Input(format!(
                "--out {}: name a file that ends in .pdf, .svg or .png",
                path.display()
            ))
        })
}

fn document(panel: &Panel) -> json::FigureBehaviour {
    json::FigureBehaviour {
        behaviour: panel.behaviour,
        label: panel.label.clone(),
        name: panel.name.clone(),
        share: panel.share,
    }
}

/// The behaviours in words, for the caption of a paper.
fn caption(panels: &[Panel], labels: Labels) -> String {
    let in_words = |panel: &Panel| {
        let name = match &panel.name {
            Some(name) => format!("behaviour {} ({name})", panel.behaviour),
            None => format!("behaviour {}", panel.behaviour),
        };
        match &panel.label {
            Some(label) if labels == Labels::Letters => format!("{label}: {name}"),
            _ => name,
        }
    };
    panels.iter().map(in_words).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_is_the_format() {
        for (name, format) in [
            ("a.pdf", Format::Pdf),
            ("a.b.SVG", Format::Svg),
            ("x/a.png", Format::Png),
        ] {
            assert_eq!(format_of(Path::new(name)).unwrap(), format);
        }
        for name in ["a", "a.eps", "pdf"] {
            let error = format_of(Path::new(name)).unwrap_err();
            assert_eq!(
                error.to_string(),
                format!("--out {name}: name a file that ends in .pdf, .svg or .png")
            );
        }
    }
}
