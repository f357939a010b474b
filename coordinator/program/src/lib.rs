//! The program `murmuration`: one command line for the commands of the client, of the lab, and about the program itself.
//!
//! Exit codes: 0 done; 1 failed; 2 bad usage or input. A command whose output is closed early (`list | head -1`) ends silently
//! with 0.

mod help;
mod manual;

use clap::{CommandFactory as _, Parser, Subcommand, ValueEnum, builder::PossibleValue};
pub use help::groups;
use murmuration_cli::{CliError, Execution, Global, controller_argument, json::Kind};
use murmuration_link::{OutputError, Telemetry, errln, outln, parse_arguments, print, telemetry};
use std::{
    future::ready,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::LazyLock,
    time::Duration,
};
use tracing::Level;

const EXIT_CODES: &str = "Exit codes: 0 done, 1 failed, 2 bad usage or input.";

const EXAMPLES: &str = "\
Examples:
  murmuration run examples/quick.toml    search and write a report: 10 s";

/// Find and report the collective behaviours that a swarm of robots can show
#[derive(Debug, Parser)]
#[command(
    name = "murmuration",
    version,
    help_template = help::overview(),
    after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"),
    arg_required_else_help = true
)]
struct Arguments {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[command(flatten)]
    Client(murmuration_cli::Command),
    #[command(flatten)]
    Lab(Lab),
    #[command(flatten)]
    Help(Help),
}

/// The lab's commands, as subcommands of one command.
#[derive(Debug, Subcommand)]
enum Lab {
    /// Measure and study: study, atlas, accuracy, judge, bench
    #[command(subcommand)]
    Lab(murmuration_lab::Command),
}

/// Commands about the program itself.
#[derive(Debug, Subcommand)]
enum Help {
    /// Print the JSON Schema of a document that --json prints
    Schema {
        /// Kind of document
        #[arg(value_name = "DOCUMENT")]
        kind: Document,
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

/// Time limit for a coordinator's remaining work after its end. No client waits for that work.
const LEAVING: Duration = Duration::from_secs(1);

/// The command line as a clap command, for completions and for checks of the documentation.
pub fn command() -> clap::Command {
    Arguments::command()
}

pub fn main() -> ExitCode {
    let words = std::env::args_os().map(controller_argument);
    let Arguments { global, command } = match parse_arguments(words) {
        Ok(arguments) => arguments,
        Err(code) => return code,
    };
    let done = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| CliError::Failed(format!("threads cannot be started: {error}")))
        .and_then(|runtime| {
            let is_server = is_server(&command);
            let done = runtime.block_on(async {
                let telemetry = tell(is_server);
                let done = command.execute(&global).await;
                telemetry.end().await;
                done
            });
            if is_server {
                // A coordinator's acknowledged data is on disk, so the program need not wait. Other commands finish writing their
                // files.
                runtime.shutdown_timeout(LEAVING);
            }
            done
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

impl Command {
    fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Client(command) => command.execute(global),
            Self::Lab(Lab::Lab(command)) => command.execute(global),
            Self::Help(Help::Schema { kind }) => Box::pin(ready(schema(kind))),
            Self::Help(Help::Man { folder }) => Box::pin(ready(manual(&folder))),
            Self::Help(Help::Completions { shell }) => Box::pin(ready(completions(shell, global.json))),
        }
    }
}

/// A kind of document, as printed with `--json`.
#[derive(Debug, Clone, Copy)]
struct Document(Kind);

impl ValueEnum for Document {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<Document>> = LazyLock::new(|| {
            let kinds = murmuration_cli::json::KINDS.into_iter();
            kinds.chain(murmuration_lab::json::KINDS).map(Document).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name).help(self.0.help))
    }
}

fn schema(Document(kind): Document) -> Result<(), CliError> {
    Ok(outln!("{:#}", (kind.schema)().as_value())?)
}

fn manual(folder: &Path) -> Result<(), CliError> {
    let written = manual::write(command(), &help::groups(), folder);
    written.map_err(|error| CliError::unwritable(folder, &error))
}

fn completions(shell: clap_complete::Shell, as_json: bool) -> Result<(), CliError> {
    if as_json {
        let message = "`completions` prints a script for a shell, and no JSON: leave out --json";
        return Err(CliError::Input(message.to_owned()));
    }
    // Generate in memory first, because clap panics when it cannot write.
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command(), "murmuration", &mut script);
    Ok(print(String::from_utf8_lossy(&script))?)
}

/// Whether the command is a server. Servers log what they do, other commands only errors.
fn is_server(command: &Command) -> bool {
    matches!(command, Command::Client(command) if command.logs_its_work())
}

fn tell(is_server: bool) -> Telemetry {
    telemetry("murmuration", if is_server { Level::INFO } else { Level::ERROR })
}
