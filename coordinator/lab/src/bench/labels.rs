//! `bench labels`: accuracy against the number of labels.

use crate::{
    json,
    label_curve::{CurveError, Curves, LabelledBehaviours, Overlap, Point, Pretrained, Sets, plot},
};
use murmuration_accuracy::{LabelledSet, Summary};
use murmuration_cli::{
    CliError,
    files::{FileType, Overwrite},
    read_spec,
    table::{Table, left, right},
};
use murmuration_link::{OutputError, errln};
use murmuration_sim::{evaluate::Evaluator, simulate::Start};
use murmuration_swarm::{CampaignSpec, ImageFormat, Invalid, Strategy, counted, grouped, training::Recipe};
use rayon::prelude::*;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
For each seed, an embedder is trained without labels, as the campaign would train it. For each strategy and number of \
labels, the embedder is then fine-tuned on behaviours of train.csv and measured by validation.csv. Controllers are also \
simulated from further starts (feedback.starts), so train.csv needs the columns of controllers (docs/labels.md).

Example:
  murmuration lab bench labels examples/two-sensor-latent.toml --set labelled/two_sensor --plot curve.svg")]
pub struct LabelsBench {
    /// Campaign file; the command uses its [dataset], [training] and [feedback]
    spec: PathBuf,
    /// Folder with train.csv, validation.csv and images/ID.png; repeat the option to join sets
    #[arg(long, required = true, value_name = "DIR")]
    set: Vec<PathBuf>,
    /// Seeds, used instead of the file's seed
    #[arg(long, num_args = 1.., default_values_t = [1, 2, 3])]
    seeds: Vec<u64>,
    /// Numbers of labels; a number above the size of the set means all labels
    #[arg(long, num_args = 1.., default_values_t = [0, 25, 50, 100, 200, 500])]
    labels: Vec<usize>,
    /// Query strategies that choose the behaviours to label
    #[arg(long, num_args = 1.., default_values_t = Strategy::ALL)]
    strategies: Vec<Strategy>,
    /// Write the curves to this SVG file
    #[arg(long, value_name = "OUT")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl LabelsBench {
    pub(super) fn execute(mut self, as_json: bool) -> Result<(), CliError> {
        if let Some(file) = &self.plot {
            FileType::Svg.check("--plot", file)?;
            self.overwrite.check(file)?;
        }
        self.labels.sort_unstable();
        self.labels.dedup();
        let spec = read_spec(&self.spec, None)?;
        let sets = Sets::new(self.learned(&spec)?, self.judging(spec.image())?)?;
        let recipe = match spec.feedback() {
            Some(feedback) => feedback.recipe().clone(),
            None => Recipe::named("labelled")?,
        };
        let mut pretrained = Vec::new();
        for &seed in &self.seeds {
            errln!("seed {seed}: training without labels");
            pretrained.push(Pretrained::of(&spec.clone().with_seed(seed)?)?);
        }
        let curves = Curves {
            sets: &sets,
            pretrained: &pretrained,
            recipe: &recipe,
            medoids: spec.medoids() as usize,
        };
        let (mut points, mut told) = (Vec::new(), Ok(()));
        let mut took = |point: Point| {
            if told.is_ok() {
                told = tell(&point, as_json);
            }
            points.push(point);
        };
        for &strategy in &self.strategies {
            for which in 0..pretrained.len() {
                curves.curve(strategy, which, &self.labels, &mut took)?;
            }
        }
        told?;
        if !as_json {
            print_table(&points)?;
        }
        if let Some(file) = &self.plot {
            let svg = plot(&points, &spec.model().to_string());
            self.overwrite.write(file, svg)?;
        }
        Ok(())
    }

    /// The behaviours to learn from, with pictures of their controllers from further starts.
    fn learned(&self, spec: &CampaignSpec) -> Result<LabelledBehaviours, CliError> {
        let mut learned = LabelledBehaviours::new(spec.image().shape());
        for folder in &self.set {
            let labels = LabelledSet::read(folder.join("train.csv"))?;
            let pictures = images(&labels, folder, spec.image())?;
            let further = further(&labels, spec, learned.count() as u64)?;
            for ((class, picture), further) in labels.classes().zip(pictures).zip(further) {
                learned.push(class, picture, further);
            }
        }
        Ok(learned)
    }

    fn judging(&self, image: &ImageFormat) -> Result<LabelledBehaviours, CliError> {
        let mut judging = LabelledBehaviours::new(image.shape());
        for folder in &self.set {
            let labels = LabelledSet::read(folder.join("validation.csv"))?;
            for (class, picture) in labels.classes().zip(images(&labels, folder, image)?) {
                judging.push(class, picture, Vec::new());
            }
        }
        Ok(judging)
    }
}

fn images(labels: &LabelledSet, folder: &Path, image: &ImageFormat) -> Result<Vec<Vec<u8>>, CliError> {
    Ok(labels.images(&folder.join("images"), image.shape().into())?)
}

/// Simulates pictures of each controller from further starts, as a campaign does. The first controller has the further starts of
/// the individual `first`.
fn further(labels: &LabelledSet, spec: &CampaignSpec, first: u64) -> Result<Vec<Vec<Vec<u8>>>, CliError> {
    let Some(feedback) = spec.feedback().filter(|feedback| feedback.starts() > 1) else {
        return Ok(vec![Vec::new(); labels.classes().count()]);
    };
    let controllers = labels.controllers()?;
    let simulated = controllers.par_iter().enumerate().map(|(place, controller)| {
        let mut evaluator = Evaluator::new(spec.world(), spec.image())?;
        let seeds = feedback.further_starts(spec.seed(), first + place as u64);
        let pictures = seeds.map(|seed| {
            let evaluation = evaluator.evaluate(controller, &Start::seeded(seed))?;
            Ok(evaluation.into_image())
        });
        pictures.collect::<Result<_, Invalid>>()
    });
    Ok(simulated.collect::<Result<_, Invalid>>()?)
}

fn tell(point: &Point, as_json: bool) -> Result<(), OutputError> {
    if as_json {
        return json::print(json::BenchLabels {
            strategy: point.strategy.name(),
            labels: point.labels,
            seed: json::Whole(point.seed),
            anchor_not_random_percent: point.not_random,
            every_anchor_percent: point.every,
            seconds: point.took.as_secs_f64(),
        });
    }
    let percent = |figure: Option<f64>| figure.map_or("-".to_owned(), |figure| format!("{figure:.2} %"));
    errln!(
        "seed {}: {} ({}): {} / {} ({:.1} s)",
        point.seed,
        counted(point.labels as u64, "label"),
        point.strategy,
        percent(point.not_random),
        percent(point.every),
        point.took.as_secs_f64(),
    );
    Ok(())
}

fn print_table(points: &[Point]) -> Result<(), OutputError> {
    let mut table = Table::new([
        left("STRATEGY"),
        right("LABELS"),
        right("ANCHOR NOT RANDOM"),
        right("EVERY ANCHOR"),
    ]);
    let mut rows: BTreeMap<(Strategy, usize), Vec<&Point>> = BTreeMap::new();
    for point in points {
        rows.entry((point.strategy, point.labels))
            .or_default()
            .push(point);
    }
    for ((strategy, labels), points) in rows {
        let over = |figure: fn(&Point) -> Option<f64>| {
            let figures: Vec<f64> = points.iter().filter_map(|point| figure(point)).collect();
            Summary::of(&figures).map_or("-".to_owned(), |summary| {
                let deviation = summary
                    .deviation
                    .map_or(String::new(), |deviation| format!(" ± {deviation:.2}"));
                format!("{:.2}{deviation}", summary.mean)
            })
        };
        table.row([
            strategy.name().to_owned(),
            grouped(labels as u64),
            over(|point| point.not_random),
            over(|point| point.every),
        ]);
    }
    table.print()
}

impl From<Overlap> for CliError {
    fn from(error: Overlap) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<CurveError> for CliError {
    fn from(error: CurveError) -> Self {
        Self::Input(error.to_string())
    }
}
