//! The command line. stdout is data, everything else goes to stderr.
//!
//! Exit codes: 0 done; 1 failed; 2 bad usage or input. A command whose output nobody reads any more (`list | head -1`) ends
//! with 0 and without a word.

mod accuracy;
mod atlas;
mod bench;
mod campaigns;
mod certs;
mod checkpoints;
mod connection;
mod controller;
mod delete;
mod error;
mod evaluate;
mod export;
mod files;
mod film;
mod filter;
mod follow;
mod genomes;
mod health;
mod heard;
mod json;
mod judge;
mod known_campaigns;
mod labels;
mod maintenance;
mod manual;
mod next_step;
mod quarantine;
mod recognise;
mod report;
mod robots;
mod run;
mod serve;
mod simulate;
mod study;
mod table;
mod taxonomy;
mod token;
mod transfer;
mod world;

pub use error::CliError;

use clap::{CommandFactory as _, Parser, Subcommand};
use murmuration_link::{
    Credentials, CredentialsError, IdentityFiles, OutputError, Telemetry, TrustFiles, errln, outln,
    parse_arguments, print, telemetry,
};
use murmuration_proto::text::masked_url;
use std::{
    future::ready,
    path::{Path, PathBuf},
    pin::Pin,
    process::ExitCode,
};

const EXIT_CODES: &str = "Exit codes: 0 done, 1 failed, 2 bad usage or input.";

const EXAMPLES: &str = "\
Examples:
  murmuration run examples/quick.toml              search and write a report, in ten seconds
  murmuration run examples/single-sensor.toml      run the paper's single-sensor campaign
  murmuration simulate --controller -0.7,0.3,1,1 --gif pursuit.gif
  murmuration list                                 list the campaigns
  murmuration resume latest                        continue after an interruption
  murmuration serve --workers 0                    run a coordinator for workers on other machines";

/// Searches for the collective behaviours that a swarm of robots can show, and reports them as a taxonomy.
#[derive(Debug, Parser)]
#[command(name = "murmuration", version, after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"), arg_required_else_help = true)]
struct Arguments {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// What every command understands.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Options of every command")]
struct Global {
    /// Data directory
    #[arg(
        long,
        global = true,
        env = "MURMURATION_DATA",
        default_value = "murmuration-data",
        value_name = "DIR"
    )]
    data: PathBuf,
    /// URL of a running coordinator, used instead of a data directory
    #[arg(long, global = true, env = "MURMURATION_COORDINATOR", value_name = "URL")]
    coordinator: Option<String>,
    #[command(flatten)]
    trust: TrustFiles,
    /// Location of the checkpoints, such as s3://BUCKET/PREFIX or file:///FOLDER [default: a folder in the data directory]
    #[arg(long, global = true, env = "MURMURATION_CHECKPOINT_STORE", value_name = "URL")]
    checkpoint_store: Option<String>,
    /// Print JSON for programs, documented by `murmuration schema`
    #[arg(long, global = true)]
    json: bool,
}

impl Global {
    /// What to show to a coordinator that was named.
    fn credentials(&self) -> Result<Credentials, CredentialsError> {
        Credentials::read(&self.trust, &IdentityFiles::default())
    }

    /// A command to type next: `words`, with what names the same coordinator or data directory as this command line did.
    fn next(&self, words: &str) -> String {
        let (option, place) = match &self.coordinator {
            Some(url) => ("coordinator", url.clone()),
            None => ("data", self.data.display().to_string()),
        };
        let is_default = Self::defaults(option)
            .iter()
            .flatten()
            .any(|default| *default == place);
        if is_default {
            return format!("murmuration {words}");
        }
        let place = self.coordinator.as_deref().map_or(place, masked_url);
        format!("murmuration {words} --{option} {}", quoted(&place))
    }

    /// What an option is without being named: by the environment, and by itself.
    fn defaults(option: &str) -> [Option<String>; 2] {
        let command = command();
        let option = command
            .get_arguments()
            .find(|argument| argument.get_long() == Some(option));
        let text = |value: &std::ffi::OsStr| value.to_str().map(str::to_owned);
        let environment = option.and_then(clap::Arg::get_env).and_then(std::env::var_os);
        let own = option.and_then(|option| option.get_default_values().first());
        [
            environment.as_deref().and_then(text),
            own.and_then(|own| text(own)),
        ]
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a campaign to its report, in this process
    Run(run::Run),
    /// Continue a campaign that was paused or interrupted, or that failed
    Resume(run::Resume),
    /// Evaluate and judge every controller of a robot, and draw the map of what they do
    Atlas(atlas::AtlasCommand),
    /// Run a coordinator for workers, trainers and browsers
    Serve(serve::Serve),
    /// Create an access token and its entry in the tokens file
    Token(token::TokenCommand),
    /// Create a development CA, and certificates for a coordinator, workers and trainers
    Certs(certs::Certs),
    /// Submit a campaign to a running coordinator
    Submit(campaigns::Submit),
    /// Follow a campaign until it stops
    Watch(campaigns::Name),
    /// List the campaigns
    List(campaigns::List),
    /// Show a campaign, or one individual of its archive
    Show(campaigns::Show),
    /// Pause a campaign; `resume` continues it
    Pause(campaigns::Name),
    /// End a campaign permanently, and keep its archive
    Cancel(campaigns::Name),
    /// Delete a campaign with its archive, labels and taxonomy
    Delete(delete::Delete),
    /// Move a campaign to another checkpoint: embed and cluster its archive again
    Adopt(campaigns::Adopt),
    /// Fine-tune a campaign's embedder on its labels, and continue the search
    Refine(campaigns::Refine),
    /// Print the digest of a campaign's archive
    Digest(campaigns::Name),
    /// Write the report of a completed campaign
    Report(report::ReportCommand),
    /// Export a campaign to a folder of open formats: Parquet, NPZ, ONNX, TOML
    Export(transfer::Export),
    /// Import a campaign that was exported
    Import(transfer::Import),
    /// Run a study: a grid of campaigns with tables of what is measured of them
    #[command(subcommand)]
    Study(study::StudyCommand),
    /// Simulate one controller, or a reference case
    Simulate(simulate::Simulate),
    /// Evaluate controllers of a search of your own on all workers
    Evaluate(evaluate::Evaluate),
    /// Find what in a campaign is like a swarm that a camera tracked
    Recognise(recognise::Recognise),
    /// Show the robots that a file describes: their sensors, drives and genes
    Robot(robots::ShowRobot),
    /// Turn a world of RobotSwarmSimulator, JSON, into a campaign file
    World(world::WorldCommand),
    /// Export a controller to real robots
    #[command(subcommand)]
    Controller(export::ControllerCommand),
    /// Score controllers with the heuristic filter
    Filter(filter::Filter),
    /// List, show, export and import checkpoints (trained embedders)
    #[command(subcommand)]
    Checkpoints(checkpoints::CheckpointsCommand),
    /// Add labels to a campaign
    Label(labels::LabelCommand),
    /// List the labels of a campaign, or write them to a CSV file
    Labels(labels::LabelsCommand),
    /// List the classes of a campaign; create, rename, merge or recolour a class
    Classes(labels::ClassesCommand),
    /// Compare the labels of two annotators: Cohen's kappa and disagreements
    Agreement(labels::AgreementCommand),
    /// Measure how well an embedding agrees with people's labels
    Accuracy(accuracy::AccuracyCommand),
    /// Measure how well the rule-based judge agrees with people's labels
    Judge(judge::JudgeCommand),
    /// Check that a coordinator, worker or trainer is ready, for container engines and scripts
    Health(health::Health),
    /// Back up the data directory, also while a coordinator runs
    Backup(maintenance::Backup),
    /// Restore a backup
    Restore(maintenance::Restore),
    /// Check a data directory for damage, and salvage what is undamaged
    Doctor(maintenance::Doctor),
    /// List the machines that returned wrong results, or lift a machine's quarantine
    Quarantine(quarantine::QuarantineCommand),
    /// Measure the speed of this machine, and the accuracy that labels bring
    #[command(subcommand)]
    Bench(bench::Bench),
    /// Print the JSON Schema of what --json prints
    Schema {
        /// Kind of document
        #[arg(value_name = "DOCUMENT")]
        kind: json::Kind,
    },
    /// Write the pages of the manual, a file for each command
    #[command(hide = true)]
    Man {
        /// Folder for the pages
        folder: PathBuf,
    },
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// The command line as clap knows it: for completions, and to check what documents say of it.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line and does what it says.
#[must_use]
pub fn main() -> ExitCode {
    let words = std::env::args_os().map(controller::marked);
    let arguments: Arguments = match parse_arguments(words) {
        Ok(arguments) => arguments,
        Err(code) => return code,
    };
    let done = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| CliError::Failed(format!("threads cannot be started: {error}")))
        .and_then(|runtime| {
            runtime.block_on(async {
                let telemetry = tell(&arguments.command);
                let done = execute(arguments).await;
                telemetry.end().await;
                done
            })
        });
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if !matches!(error, CliError::Output(OutputError::Closed)) {
                errln!("error: {error}");
            }
            error.exit_code()
        }
    }
}

async fn execute(Arguments { global, command }: Arguments) -> Result<(), CliError> {
    // Apart from each other: one state machine of all commands takes long to compile.
    let global = &global;
    let done: Pin<Box<dyn Future<Output = Result<(), CliError>> + '_>> = match command {
        Command::Run(run) => Box::pin(run.execute(global)),
        Command::Resume(resume) => Box::pin(resume.execute(global)),
        Command::Atlas(atlas) => Box::pin(atlas.execute(global)),
        Command::Serve(serve) => Box::pin(serve.execute(global)),
        Command::Token(token) => Box::pin(ready(token.execute(global.json))),
        Command::Certs(certs) => Box::pin(ready(certs.execute(global.json))),
        Command::Submit(submit) => Box::pin(submit.execute(global)),
        Command::Watch(name) => Box::pin(async move { campaigns::watch(global, &name.campaign).await }),
        Command::List(list) => Box::pin(list.execute(global)),
        Command::Show(show) => Box::pin(show.execute(global)),
        Command::Pause(name) => Box::pin(async move { campaigns::pause(global, &name.campaign).await }),
        Command::Cancel(name) => Box::pin(async move { campaigns::cancel(global, &name.campaign).await }),
        Command::Delete(delete) => Box::pin(delete.execute(global)),
        Command::Adopt(adopt) => Box::pin(adopt.execute(global)),
        Command::Refine(refine) => Box::pin(refine.execute(global)),
        Command::Digest(name) => Box::pin(async move { campaigns::digest(global, &name.campaign).await }),
        Command::Report(report) => Box::pin(report.execute(global)),
        Command::Export(export) => Box::pin(export.execute(global)),
        Command::Import(import) => Box::pin(import.execute(global)),
        Command::Study(study) => Box::pin(study.execute(global)),
        Command::Simulate(simulate) => Box::pin(ready(simulate.execute(global.json))),
        Command::Evaluate(evaluate) => Box::pin(evaluate.execute(global)),
        Command::Recognise(recognise) => Box::pin(recognise.execute(global)),
        Command::Robot(robot) => Box::pin(ready(robot.execute(global.json))),
        Command::World(world) => Box::pin(ready(world.execute())),
        Command::Controller(controller) => Box::pin(controller.execute(global)),
        Command::Filter(filter) => Box::pin(ready(filter.execute(global.json))),
        Command::Checkpoints(checkpoints) => Box::pin(checkpoints.execute(global)),
        Command::Label(label) => Box::pin(label.execute(global)),
        Command::Labels(labels) => Box::pin(labels.execute(global)),
        Command::Classes(classes) => Box::pin(classes.execute(global)),
        Command::Agreement(agreement) => Box::pin(agreement.execute(global)),
        Command::Accuracy(accuracy) => Box::pin(accuracy.execute(global)),
        Command::Judge(judge) => Box::pin(ready(judge.execute(global))),
        Command::Health(health) => Box::pin(health.execute(global)),
        Command::Backup(backup) => Box::pin(backup.execute(global)),
        Command::Restore(restore) => Box::pin(restore.execute(global)),
        Command::Doctor(doctor) => Box::pin(doctor.execute(global)),
        Command::Quarantine(quarantine) => Box::pin(ready(quarantine.execute(global))),
        Command::Bench(bench) => Box::pin(bench.execute(global)),
        Command::Schema { kind } => Box::pin(ready(schema(kind))),
        Command::Man { folder } => Box::pin(ready(manual(&folder))),
        Command::Completions { shell } => Box::pin(ready(completions(shell))),
    };
    done.await
}

fn schema(kind: json::Kind) -> Result<(), CliError> {
    Ok(outln!("{:#}", kind.schema().as_value())?)
}

fn manual(folder: &Path) -> Result<(), CliError> {
    let written = manual::write(Arguments::command(), folder);
    written.map_err(|error| CliError::unwritable(folder, &error))
}

fn completions(shell: clap_complete::Shell) -> Result<(), CliError> {
    // To memory first: it panics where it cannot write.
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "murmuration", &mut script);
    Ok(print(String::from_utf8_lossy(&script))?)
}

/// A word of a command line as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:=@%+,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// Servers tell what they do; other commands only what goes wrong.
fn tell(command: &Command) -> Telemetry {
    let default = if matches!(command, Command::Serve(_)) {
        "info"
    } else {
        "error"
    };
    telemetry("murmuration", default)
}
