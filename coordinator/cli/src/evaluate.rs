//! `evaluate`: controllers of an external search, evaluated by the workers of a coordinator.

use super::{
    CliError, Global,
    connection::{self, Connection},
    files::{FileType, Overwrite, check_outputs, finish, is_there, read, read_words},
    follow::Count,
    genomes, json,
    run::InProcessArgs,
};
use csv::Writer;
use murmuration_coordinator::local::InProcess;
use murmuration_files::{InputKind, UnfinishedFolder};
use murmuration_link::{OutputError, errln, termination};
use murmuration_model::{
    csv_file::{CsvError, CsvFile, CsvRow},
    labels::Row,
};
use murmuration_proto::v1::{self, evaluate_request::Part, evaluation_description::Campaign};
use murmuration_store::DataDirectory;
use murmuration_swarm::{CampaignSpec, Controller, FEATURE_NAMES, Text, counted, start_seed};
use std::{
    env,
    io::{self, Write},
    iter, mem,
    path::{Path, PathBuf},
};
use tokio_stream::StreamExt as _;

/// Controllers per request.
const IN_A_REQUEST: usize = 64;
/// Largest response, bytes: one result with the largest pictures and the most starts.
const MAX_RESPONSE: usize = 128 << 20;

#[derive(Debug, clap::Args)]
#[command(after_help = "\
For searches of your own: nothing is stored, and a controller has the same features and the same picture on every machine. The \
table has a column for each gene, named as `murmuration robot` names it, and may have a column seed; other columns are passed \
over, so that a report's archive.csv will do. A table without a header has the genes alone, in that order, as \
RobotSwarmSimulator writes genomes. Results are in the order of the rows.

If no coordinator runs and no data directory exists, this process evaluates the controllers.

Examples:
  murmuration evaluate examples/quick.toml controllers.csv --out results.csv
  murmuration evaluate examples/quick.toml controllers.csv --json")]
pub struct Evaluate {
    /// Campaign file with robots, world, pictures, starts and, if its method embeds, the checkpoint
    spec: PathBuf,
    /// Controllers, CSV
    controllers: PathBuf,
    /// Seed for the rows that have no seed of their own
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Write the results to this CSV [default: print them]
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    in_process: InProcessArgs,
}

type Tasks = Vec<(Controller, u64)>;

impl Evaluate {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(path) = &self.out {
            FileType::Csv.check("--out", path)?;
            check_outputs([("--out", path)], [&self.spec, &self.controllers], self.overwrite)?;
        }
        let spec = CampaignSpec::from_toml(&read_words(&self.spec, InputKind::Campaign)?)
            .map_err(|error| CliError::Input(format!("{}: {error}", self.spec.display())))?;
        let tasks = self.tasks(&spec)?;
        let Some(path) = &self.out else {
            let table = (!global.json).then(|| Table::of(io::stdout().lock(), None));
            return all_evaluated(self.write_results(table, global, &spec, &tasks).await?);
        };
        let mut file = self.overwrite.begin(path)?;
        let table = Some(Table::of(&mut file, Some(path)));
        let failed = self.write_results(table, global, &spec, &tasks).await?;
        finish(file, path)?;
        all_evaluated(failed)
    }

    /// The controllers of the file, with the seeds of their starts.
    fn tasks(&self, spec: &CampaignSpec) -> Result<Tasks, CliError> {
        let model = spec.model();
        let names = model.gene_names();
        let columns: Vec<&str> = names.iter().map(String::as_str).collect();
        let text = read(&self.controllers, InputKind::Labels)?;
        if let Some(genomes) = genomes::read(&self.controllers, &text, &columns)? {
            return self.tasks_of(spec, &genomes);
        }
        let file = CsvFile::open(&self.controllers, text.as_slice(), &columns)?;
        let has_seeds = file.header().has("seed");
        let task = |(row, place): (Result<CsvRow, CsvError>, u64)| {
            let row = row?;
            let genes = columns.iter().map(|name| row.finite(name));
            let controller = Controller::new(model.clone(), &genes.collect::<Result<Vec<_>, _>>()?)
                .map_err(|error| row.refused(error))?;
            let seed = match has_seeds {
                true => Row(&row).seed()?,
                false => start_seed(self.seed, place),
            };
            Ok((controller, seed))
        };
        let tasks: Tasks = file.zip(0..).map(task).collect::<Result<_, CsvError>>()?;
        if tasks.is_empty() {
            let empty = format!("{}: the file has no controllers", self.controllers.display());
            return Err(CliError::Input(empty));
        }
        Ok(tasks)
    }

    /// The controllers of a table without header, with the seeds of their starts.
    fn tasks_of(&self, spec: &CampaignSpec, genomes: &[Vec<f64>]) -> Result<Tasks, CliError> {
        let task = |(genes, place): (&Vec<f64>, u64)| {
            let refused = |error| {
                let row = place + 1;
                CliError::Input(format!("{}: row {row}: {error}", self.controllers.display()))
            };
            let controller = Controller::new(spec.model().clone(), genes).map_err(refused)?;
            Ok((controller, start_seed(self.seed, place)))
        };
        genomes.iter().zip(0..).map(task).collect()
    }

    /// Evaluates the controllers, and writes each result as it arrives: to a table, or as JSON. Returns the number of controllers
    /// that have no result because their evaluation failed.
    async fn write_results(
        &self,
        table: Option<Table<'_, impl Write>>,
        global: &Global,
        spec: &CampaignSpec,
        tasks: &Tasks,
    ) -> Result<u64, CliError> {
        let in_process = InProcess {
            trainers: 0,
            ..self.in_process.count()?
        };
        let evaluate = async |connection: &mut Connection| {
            tokio::select! {
                failed = evaluated(connection, spec, tasks, table) => failed,
                signal = termination() => Err(CliError::Failed(signal.to_owned())),
            }
        };
        if global.names_coordinator() || is_there(&global.data)? {
            return connection::with(global, in_process, evaluate).await;
        }
        // This also removes the folders that killed commands of this user left.
        let folder = UnfinishedFolder::secret(&env::temp_dir(), "murmuration-evaluate-")
            .map_err(|error| CliError::Failed(format!("cannot create a temporary folder: {error}")))?;
        let data = DataDirectory::hold(folder.path())?;
        connection::with_own(global, data, in_process, None, evaluate).await
    }
}

/// The table of the results, in a file or on standard output.
struct Table<'a, W: Write> {
    writer: Writer<W>,
    path: Option<&'a Path>,
}

impl<'a, W: Write> Table<'a, W> {
    fn of(to: W, path: Option<&'a Path>) -> Self {
        let writer = Writer::from_writer(to);
        Self { writer, path }
    }

    fn row(&mut self, cells: impl IntoIterator<Item = String>) -> Result<(), CliError> {
        let written = self.writer.write_record(cells);
        written.map_err(|error| self.unwritten(error.into()))
    }

    fn flush(mut self) -> Result<(), CliError> {
        let flushed = self.writer.flush();
        flushed.map_err(|error| self.unwritten(error))
    }

    fn unwritten(&self, error: io::Error) -> CliError {
        match self.path {
            Some(path) => CliError::unwritable(path, &error),
            None => OutputError::from(error).into(),
        }
    }
}

fn all_evaluated(failed: u64) -> Result<(), CliError> {
    match failed {
        0 => Ok(()),
        failed => {
            let message = format!("{} could not be evaluated", counted(failed, "controller"));
            Err(CliError::Failed(message))
        }
    }
}

/// Evaluates controllers, and writes each result as it arrives. Returns the number of failures.
async fn evaluated(
    connection: &mut Connection,
    spec: &CampaignSpec,
    tasks: &Tasks,
    mut table: Option<Table<'_, impl Write>>,
) -> Result<u64, CliError> {
    let client = connection.evaluations.clone();
    let mut client = client.max_decoding_message_size(MAX_RESPONSE);
    let requests = tokio_stream::iter(requests(spec, tasks));
    let mut responses = client.evaluate(requests).await?.into_inner();
    let mut count = Count::of(tasks.len() as u64, "controller");
    let mut rows = tasks.iter().enumerate();
    let (mut failed, mut has_header) = (0, false);
    while let Some(response) = responses.next().await {
        for result in response?.results {
            let Some((index, (controller, seed))) = rows.next() else {
                let message = "more results came than there are controllers";
                return Err(CliError::Failed(message.to_owned()));
            };
            count.add();
            if !result.failure.is_empty() {
                failed += 1;
                let failure = Text::line(&result.failure);
                errln!("index {index}: {failure}");
                continue;
            }
            let evaluated = json::Evaluated::new(index as u64, controller, *seed, &result.trials)?;
            let Some(table) = &mut table else {
                json::print(evaluated)?;
                continue;
            };
            if !mem::replace(&mut has_header, true) {
                table.row(header(controller, &evaluated))?;
            }
            table.row(row(&evaluated))?;
        }
    }
    count.end();
    if let Some(table) = table {
        table.flush()?;
    }
    match rows.len() {
        0 => Ok(failed),
        missing => Err(CliError::Failed(format!(
            "the coordinator stopped before it had evaluated {}",
            counted(missing as u64, "controller")
        ))),
    }
}

/// The requests: the first has the description, and the others have the controllers.
fn requests(spec: &CampaignSpec, tasks: &Tasks) -> Vec<v1::EvaluateRequest> {
    let description = Part::Description(v1::EvaluationDescription {
        campaign: Some(Campaign::Spec(spec.into())),
        pictures: false,
        seed: None,
    });
    let task = |(controller, seed): &(Controller, u64)| v1::EvaluationTask {
        controller: controller.genes().to_vec(),
        seed: *seed,
    };
    let controllers = tasks.chunks(IN_A_REQUEST).map(|tasks| {
        let tasks = tasks.iter().map(task).collect();
        Part::Controllers(v1::ControllersToEvaluate { tasks })
    });
    let parts = iter::once(description).chain(controllers);
    parts
        .map(|part| v1::EvaluateRequest { part: Some(part) })
        .collect()
}

/// The columns of the table, named as in a report's archive.csv.
fn header(controller: &Controller, evaluated: &json::Evaluated) -> impl Iterator<Item = String> {
    let own = ["index", "seed"].into_iter().chain(FEATURE_NAMES);
    let embedding = (0..evaluated.embedding.len()).map(|dimension| format!("embedding_{dimension}"));
    let genes = controller.model().gene_names();
    own.map(str::to_owned).chain(genes).chain(embedding)
}

fn row(evaluated: &json::Evaluated) -> impl Iterator<Item = String> {
    let own = [evaluated.index.to_string(), evaluated.seed.0.to_string()];
    let features = evaluated.features.iter().map(f64::to_string);
    let genes = evaluated.controller.iter().map(f64::to_string);
    let embedding = evaluated.embedding.iter().map(f32::to_string);
    own.into_iter().chain(features).chain(genes).chain(embedding)
}
