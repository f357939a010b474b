//! The commands of the command line, and code that they share with `murmuration-lab`.
//!
//! Stdout is for data; everything else goes to stderr. ARCHITECTURE.md has the map of the crates.

mod campaigns;
mod certs;
mod checkpoints;
pub mod connection;
mod contact;
mod controller;
mod delete;
mod error;
mod evaluate;
mod export;
mod figure;
pub mod files;
mod film;
mod filter;
pub mod follow;
mod genomes;
mod health;
pub mod json;
mod labels;
mod launch;
mod link;
mod maintenance;
pub mod next_step;
mod nodes;
mod note;
mod quarantine;
mod recognise;
mod report;
mod robots;
mod run;
mod serve;
mod simulate;
pub mod table;
mod taxonomy;
mod token;
mod transfer;
pub mod validation;

pub use checkpoints::fetch as fetch_checkpoint;
pub use controller::marked as controller_argument;
pub use error::CliError;
pub use run::{InProcessArgs, read_spec};

use clap::{Args as _, Subcommand};
use murmuration_link::{CredentialsError, IdentityFiles, Target, TrustFiles};
use murmuration_swarm::text::masked_url;
use std::{future::ready, path::PathBuf, pin::Pin};

/// Options of every command.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Options of every command")]
pub struct Global {
    /// Data directory
    #[arg(
        long,
        global = true,
        env = "MURMURATION_DATA",
        default_value = "murmuration-data",
        value_name = "DIR"
    )]
    pub data: PathBuf,
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
    pub json: bool,
}

impl Global {
    /// The coordinator that the user named by its URL or access file.
    fn target(&self) -> Result<Option<Target>, CredentialsError> {
        Target::named(
            self.coordinator.as_deref(),
            &self.trust,
            &IdentityFiles::default(),
        )
    }

    /// Whether the user named a coordinator, by its URL or access file, so that the data directory does not matter.
    const fn names_coordinator(&self) -> bool {
        self.coordinator.is_some() || self.trust.access.is_some()
    }

    /// A command to type next: `words`, with the options that name this command's coordinator or data directory.
    pub fn next(&self, words: &str) -> String {
        format!("murmuration {words}{}", self.place())
    }

    /// The option that names this command's coordinator or data directory, after a space; empty if that is the default.
    fn place(&self) -> String {
        let (option, place) = match (&self.coordinator, &self.trust.access) {
            (Some(url), _) => ("coordinator", url.clone()),
            (None, Some(file)) => ("access", file.display().to_string()),
            (None, None) => ("data", self.data.display().to_string()),
        };
        let is_default = Self::defaults(option)
            .iter()
            .flatten()
            .any(|default| *default == place);
        if is_default {
            return String::new();
        }
        let place = self.coordinator.as_deref().map_or(place, masked_url);
        format!(" --{option} {}", quoted(&place))
    }

    /// The values of an option that the user does not give: the environment's value, and the default.
    fn defaults(option: &str) -> [Option<String>; 2] {
        let command = Self::augment_args(clap::Command::new("murmuration"));
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

/// The boxed future of a command: one state machine for all commands would take long to compile.
pub type Execution<'a> = Pin<Box<dyn Future<Output = Result<(), CliError>> + 'a>>;

/// A command, grouped as in `murmuration --help`.
#[derive(Debug, Subcommand)]
pub enum Command {
    #[command(flatten)]
    Campaigns(CampaignCommand),
    #[command(flatten)]
    Labels(LabelCommand),
    #[command(flatten)]
    Robots(RobotCommand),
    #[command(flatten)]
    Data(DataCommand),
    #[command(flatten)]
    Cluster(ClusterCommand),
}

impl Command {
    /// The groups of commands, in order, each under its heading.
    pub fn groups() -> [clap::Command; 5] {
        [
            CampaignCommand::augment_subcommands(clap::Command::new("Campaigns")),
            LabelCommand::augment_subcommands(clap::Command::new("Labels")),
            RobotCommand::augment_subcommands(clap::Command::new("Robots")),
            DataCommand::augment_subcommands(clap::Command::new("Data")),
            ClusterCommand::augment_subcommands(clap::Command::new("Cluster")),
        ]
    }

    /// Whether the command is a server or a worker. Servers and workers log their work, other commands only errors.
    pub fn logs_its_work(&self) -> bool {
        match self {
            Self::Cluster(ClusterCommand::Serve(_)) => true,
            Self::Campaigns(CampaignCommand::Run(run)) => run.works_for_another(),
            _ => false,
        }
    }

    pub fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Campaigns(command) => command.execute(global),
            Self::Labels(command) => command.execute(global),
            Self::Robots(command) => command.execute(global),
            Self::Data(command) => command.execute(global),
            Self::Cluster(command) => command.execute(global),
        }
    }
}

/// Commands about campaigns, from the campaign file to the report.
#[derive(Debug, Subcommand)]
pub enum CampaignCommand {
    /// Run a campaign to its report, in this process
    Run(run::Run),
    /// Continue a paused, interrupted or failed campaign
    Resume(run::Resume),
    /// Search on after the last generation of a campaign
    Extend(campaigns::Extend),
    /// Submit a campaign to a running coordinator
    Submit(campaigns::Submit),
    /// Follow a campaign until it stops
    Watch(campaigns::Name),
    /// List the campaigns
    List(campaigns::List),
    /// Show a campaign, or one individual of its archive
    Show(campaigns::Show),
    /// Write the report of a completed campaign
    Report(report::ReportCommand),
    /// Draw behaviours of a completed campaign in one figure, for a paper
    Figure(figure::FigureCommand),
    /// Change the tags and the note of a campaign
    Note(note::NoteCommand),
    /// Pause a campaign; `resume` continues it
    Pause(campaigns::Name),
    /// End a campaign permanently, and keep its archive
    Cancel(campaigns::Name),
    /// Delete a campaign with its archive, labels and taxonomy
    Delete(delete::Delete),
    /// Embed and cluster a campaign with another checkpoint
    Adopt(campaigns::Adopt),
    /// Fine-tune the embedder on labels; continue the search
    Refine(campaigns::Refine),
    /// Print the digest of a campaign's archive
    Digest(campaigns::Digest),
}

impl CampaignCommand {
    fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Run(run) => Box::pin(run.execute(global)),
            Self::Resume(resume) => Box::pin(resume.execute(global)),
            Self::Extend(extend) => Box::pin(extend.execute(global)),
            Self::Submit(submit) => Box::pin(submit.execute(global)),
            Self::Watch(name) => Box::pin(async move { campaigns::watch(global, &name.campaign).await }),
            Self::List(list) => Box::pin(list.execute(global)),
            Self::Show(show) => Box::pin(show.execute(global)),
            Self::Report(report) => Box::pin(report.execute(global)),
            Self::Figure(figure) => Box::pin(figure.execute(global)),
            Self::Note(note) => Box::pin(note.execute(global)),
            Self::Pause(name) => Box::pin(async move { campaigns::pause(global, &name.campaign).await }),
            Self::Cancel(name) => Box::pin(async move { campaigns::cancel(global, &name.campaign).await }),
            Self::Delete(delete) => Box::pin(delete.execute(global)),
            Self::Adopt(adopt) => Box::pin(adopt.execute(global)),
            Self::Refine(refine) => Box::pin(refine.execute(global)),
            Self::Digest(digest) => Box::pin(digest.execute(global)),
        }
    }
}

/// Commands about labels.
#[derive(Debug, Subcommand)]
pub enum LabelCommand {
    /// Add labels to a campaign
    Label(labels::LabelCommand),
    /// List the labels of a campaign, or write them as CSV
    Labels(labels::LabelsCommand),
    /// List, create, rename, merge and recolour classes
    Classes(labels::ClassesCommand),
    /// Compare the labels of two annotators: Cohen's kappa
    Agreement(labels::AgreementCommand),
}

impl LabelCommand {
    fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Label(label) => Box::pin(label.execute(global)),
            Self::Labels(labels) => Box::pin(labels.execute(global)),
            Self::Classes(classes) => Box::pin(classes.execute(global)),
            Self::Agreement(agreement) => Box::pin(agreement.execute(global)),
        }
    }
}

/// Commands about robots and controllers.
#[derive(Debug, Subcommand)]
pub enum RobotCommand {
    /// Simulate one controller, or a reference case
    Simulate(simulate::Simulate),
    /// Evaluate the controllers of your own search
    Evaluate(evaluate::Evaluate),
    /// Score controllers with the heuristic filter
    Filter(filter::Filter),
    /// Find the behaviours most like a filmed swarm
    Recognise(recognise::Recognise),
    /// Show the sensors, drives and genes of robots
    Robot(robots::ShowRobot),
    /// Export a controller to real robots
    #[command(subcommand)]
    Controller(export::ControllerCommand),
}

impl RobotCommand {
    fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Simulate(simulate) => Box::pin(ready(simulate.execute(global.json))),
            Self::Evaluate(evaluate) => Box::pin(evaluate.execute(global)),
            Self::Filter(filter) => Box::pin(ready(filter.execute(global.json))),
            Self::Recognise(recognise) => Box::pin(recognise.execute(global)),
            Self::Robot(robot) => Box::pin(ready(robot.execute(global.json))),
            Self::Controller(controller) => Box::pin(controller.execute(global)),
        }
    }
}

/// Exports, checkpoints and data directories.
#[derive(Debug, Subcommand)]
pub enum DataCommand {
    /// Export a campaign to a folder of open formats
    Export(transfer::Export),
    /// Import an exported campaign
    Import(transfer::Import),
    /// List, show, export and import checkpoints (embedders)
    #[command(subcommand)]
    Checkpoints(checkpoints::CheckpointsCommand),
    /// Back up a data directory, also while it is in use
    Backup(maintenance::Backup),
    /// Restore a backup
    Restore(maintenance::Restore),
    /// Check a data directory for damage
    Doctor(maintenance::Doctor),
}

impl DataCommand {
    fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Export(export) => Box::pin(export.execute(global)),
            Self::Import(import) => Box::pin(import.execute(global)),
            Self::Checkpoints(checkpoints) => Box::pin(checkpoints.execute(global)),
            Self::Backup(backup) => Box::pin(backup.execute(global)),
            Self::Restore(restore) => Box::pin(restore.execute(global)),
            Self::Doctor(doctor) => Box::pin(doctor.execute(global)),
        }
    }
}

/// Commands about coordinators and access to them.
#[derive(Debug, Subcommand)]
pub enum ClusterCommand {
    /// Run a coordinator for workers, trainers and browsers
    Serve(Box<serve::Serve>),
    /// List the workers and trainers, and how many are wanted
    Nodes(nodes::Nodes),
    /// Print a link that logs a browser in to a coordinator's pages
    Link(link::LinkCommand),
    /// Create an access token and its entry in the tokens file
    Token(token::TokenCommand),
    /// Create a development CA and its certificates
    Certs(certs::Certs),
    /// Check that a coordinator, worker or trainer is ready
    Health(health::Health),
    /// List quarantined machines, or lift a quarantine
    Quarantine(quarantine::QuarantineCommand),
}

impl ClusterCommand {
    fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Serve(serve) => Box::pin(serve.execute(global)),
            Self::Nodes(nodes) => Box::pin(nodes.execute(global)),
            Self::Link(link) => Box::pin(ready(link.execute(global))),
            Self::Token(token) => Box::pin(ready(token.execute(global.json))),
            Self::Certs(certs) => Box::pin(ready(certs.execute(global.json))),
            Self::Health(health) => Box::pin(health.execute(global)),
            Self::Quarantine(quarantine) => Box::pin(ready(quarantine.execute(global))),
        }
    }
}

/// Quotes a word for a shell.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:=@%+,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}
