//! The command line. stdout is data, everything else goes to stderr.
//!
//! Exit codes: 0 done; 1 failed; 2 bad usage or input. A command whose output nobody reads any more (`list | head -1`) ends
//! with 0 and without a word.

mod accuracy;
mod bench;
mod campaigns;
mod certs;
mod checkpoints;
mod connection;
mod controller;
mod error;
mod files;
mod filter;
mod follow;
mod health;
mod heard;
mod json;
mod judge;
mod labels;
mod maintenance;
mod next_step;
mod quarantine;
mod report;
mod run;
mod serve;
mod simulate;
mod token;

pub use error::CliError;

use clap::{CommandFactory as _, Parser, Subcommand};
use murmuration_link::{
    Credentials, CredentialsError, IdentityFiles, OutputError, Telemetry, TrustFiles, errln, parse_arguments,
    print, telemetry,
};
use std::{path::PathBuf, process::ExitCode};

const EXAMPLES: &str = "\
Examples:
  murmuration run examples/quick.toml              search, and write a report, in half a minute
  murmuration run examples/single-sensor.toml      the paper's single-sensor campaign
  murmuration simulate --controller -0.7,0.3,1,1 --gif pursuit.gif
  murmuration list                                 what there is
  murmuration resume latest                        go on after an interruption
  murmuration serve --workers 0                    a coordinator for workers elsewhere

Exit codes: 0 done, 1 failed, 2 bad usage or input.";

/// Which collective behaviours can a swarm of such robots show? Searches for them and answers with a taxonomy.
#[derive(Debug, Parser)]
#[command(name = "murmuration", version, after_help = EXAMPLES, arg_required_else_help = true)]
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
    /// URL of a running coordinator, instead of a data directory of this machine
    #[arg(long, global = true, env = "MURMURATION_COORDINATOR", value_name = "URL")]
    coordinator: Option<String>,
    #[command(flatten)]
    trust: TrustFiles,
    /// Where checkpoints are kept, such as s3://BUCKET/PREFIX or file:///FOLDER [default: a folder in the data directory]
    #[arg(long, global = true, env = "MURMURATION_CHECKPOINT_STORE", value_name = "URL")]
    checkpoint_store: Option<String>,
    /// Print JSON on stdout, for programs
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
    /// Run a campaign to its report, everything in this process
    Run(run::Run),
    /// Go on with a campaign that was paused, interrupted or failed
    Resume(run::Resume),
    /// Serve campaigns to clients and leases to workers
    Serve(serve::Serve),
    /// Make a token for somebody, and the lines by which a coordinator knows it
    Token(token::TokenCommand),
    /// Make a development CA, and certificates for a coordinator, workers and trainers
    Certs(certs::Certs),
    /// Hand a campaign to a running coordinator
    Submit(campaigns::Submit),
    /// Follow a campaign until it stops
    Watch(campaigns::Name),
    /// List the campaigns
    List,
    /// Show a campaign, or one individual of its archive
    Show(campaigns::Show),
    /// Stop a campaign, to continue later
    Pause(campaigns::Name),
    /// End a campaign for good; its archive stays
    Cancel(campaigns::Name),
    /// Move a campaign to another checkpoint: embed its archive anew, and cluster it
    Adopt(campaigns::Adopt),
    /// Fine-tune a campaign's embedder on its labels, and search on
    Refine(campaigns::Refine),
    /// Print the digest of a campaign's archive
    Digest(campaigns::Name),
    /// Write the report of a completed campaign
    Report(report::ReportCommand),
    /// Simulate one controller, or a reference case
    Simulate(simulate::Simulate),
    /// Score controllers with the heuristic filter
    Filter(filter::Filter),
    /// Published embedders
    #[command(subcommand)]
    Checkpoints(checkpoints::CheckpointsCommand),
    /// Add labels to a campaign: classes that people gave to individuals of its archive
    Label(labels::LabelCommand),
    /// List the labels of a campaign, or write them to a file
    Labels(labels::LabelsCommand),
    /// List the classes of a campaign; create, rename, merge or colour one
    Classes(labels::ClassesCommand),
    /// Compare the classes that two annotators gave: Cohen's kappa, and where they differ
    Agreement(labels::AgreementCommand),
    /// Measure how well an embedding agrees with classes that people gave
    Accuracy(accuracy::AccuracyCommand),
    /// Measure how well the rule-based judge agrees with classes that people gave
    Judge(judge::JudgeCommand),
    /// Ask whether a coordinator, worker or trainer is there and ready, for container engines and scripts
    Health(health::Health),
    /// Copy the data directory, also of a coordinator that runs
    Backup(maintenance::Backup),
    /// Put a backup back
    Restore(maintenance::Restore),
    /// Say what is whole in a data directory and what is not; save what can be saved
    Doctor(maintenance::Doctor),
    /// List the machines whose results were found wrong; listen to one of them again
    Quarantine(quarantine::QuarantineCommand),
    /// Measure this machine
    #[command(subcommand)]
    Bench(bench::Bench),
    /// Print completions for a shell
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
        .map_err(|error| CliError::Failed(format!("cannot start threads: {error}")))
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
    match command {
        Command::Run(run) => run.execute(&global).await,
        Command::Resume(resume) => resume.execute(&global).await,
        Command::Serve(serve) => serve.execute(&global).await,
        Command::Token(token) => token.execute(global.json),
        Command::Certs(certs) => certs.execute(global.json),
        Command::Submit(submit) => submit.execute(&global).await,
        Command::Watch(name) => campaigns::watch(&global, &name.campaign).await,
        Command::List => campaigns::list(&global).await,
        Command::Show(show) => show.execute(&global).await,
        Command::Pause(name) => campaigns::pause(&global, &name.campaign).await,
        Command::Cancel(name) => campaigns::cancel(&global, &name.campaign).await,
        Command::Adopt(adopt) => adopt.execute(&global).await,
        Command::Refine(refine) => refine.execute(&global).await,
        Command::Digest(name) => campaigns::digest(&global, &name.campaign).await,
        Command::Report(report) => report.execute(&global).await,
        Command::Simulate(simulate) => simulate.execute(global.json),
        Command::Filter(filter) => filter.execute(global.json),
        Command::Checkpoints(checkpoints) => checkpoints.execute(&global).await,
        Command::Label(label) => label.execute(&global).await,
        Command::Labels(labels) => labels.execute(&global).await,
        Command::Classes(classes) => classes.execute(&global).await,
        Command::Agreement(agreement) => agreement.execute(&global).await,
        Command::Accuracy(accuracy) => accuracy.execute(&global).await,
        Command::Judge(judge) => judge.execute(&global),
        Command::Health(health) => health.execute(&global).await,
        Command::Backup(backup) => backup.execute(&global).await,
        Command::Restore(restore) => restore.execute(&global).await,
        Command::Doctor(doctor) => doctor.execute(&global).await,
        Command::Quarantine(quarantine) => quarantine.execute(&global),
        Command::Bench(bench) => bench.execute(global.json),
        Command::Completions { shell } => {
            // To memory first: it panics where it cannot write.
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "murmuration", &mut script);
            Ok(print(String::from_utf8_lossy(&script))?)
        }
    }
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
