//! Errors of commands, in words for people.

use murmuration_access::{TlsError, TokensError};
use murmuration_coordinator::server::ServerError;
use murmuration_embed::{EmbedError, RuntimeError};
use murmuration_export::ExportError;
use murmuration_files::FolderError;
use murmuration_link::{CredentialsError, OutputError, root_cause};
use murmuration_model::{CampaignId, csv_file::CsvError, labels::LabelFileError};
use murmuration_report::{ReportError, paper::FigureError, picture::PictureError};
use murmuration_service::report_data::ReportDataError;
use murmuration_store::{
    LockHolder, StoreError,
    backup::{BackupError, TargetError},
};
use murmuration_swarm::{
    Invalid, SpecFileError, Text,
    text::{masked_url, nearest},
};
use std::{
    error::Error as _,
    fmt, fs, io,
    path::{Path, PathBuf},
    process::ExitCode,
};
use tonic::{Code, Status};

/// Maximum number of files of a folder that are compared with a name.
const MOST_FILES: usize = 10_000;

/// Why a command failed, as a message for its user.
#[derive(Debug)]
pub enum CliError {
    /// Bad usage or input: exit code 2.
    Input(String),
    /// Failure of a valid request: exit code 1.
    Failed(String),
    /// A signal ended the command: exit code 1.
    Interrupted(String),
    /// A signal ended a command that its launcher is to start again: exit code 75, as of sysexits.h.
    TryAgain(String),
    /// Another process has taken the data directory over, and may go on with the same work.
    TakenOver(String),
    /// Standard output cannot be written.
    Output(OutputError),
}

impl CliError {
    /// Failure of a valid request, with its reason.
    pub fn failed(reason: impl fmt::Display) -> Self {
        Self::Failed(reason.to_string())
    }

    /// A file that cannot be read. If the file does not exist, the message names a similar file in the same folder.
    pub fn unreadable(path: &Path, error: &io::Error) -> Self {
        let similar = match error.kind() {
            io::ErrorKind::NotFound => similar_file(path),
            _ => None,
        };
        let question = similar.map_or_else(String::new, |similar| {
            format!(": did you mean {}?", similar.display())
        });
        Self::Input(format!("cannot read {}: {error}{question}", path.display()))
    }

    pub fn unwritable(path: &Path, error: &io::Error) -> Self {
        Self::Failed(format!("cannot write {}: {error}", path.display()))
    }

    pub(super) fn spec(path: &Path, error: &SpecFileError) -> Self {
        Self::Input(format!("{}: {error}", path.display()))
    }

    /// No answer from the coordinator at `url`.
    pub(super) fn no_coordinator(url: &str, error: &tonic::transport::Error) -> Self {
        let reason = root_cause(error);
        Self::Failed(format!(
            "no coordinator answers at {} ({reason}): check the URL, and that `murmuration serve` runs there",
            masked_url(url)
        ))
    }

    /// The process that holds the data directory `data` is on another machine, and listens for that machine alone.
    pub(super) fn on_another_machine(holder: &LockHolder, data: &Path) -> Self {
        Self::Failed(format!(
            "the coordinator of {} runs on the machine {} and listens for that machine alone: use this command there, or start the \
             coordinator with `serve --listen 0.0.0.0:7700`",
            data.display(),
            Text::line(&holder.machine)
        ))
    }

    /// Converts an error of the store. If another process holds the data directory, the message ends with the advice `hint`.
    pub(super) fn busy(error: StoreError, hint: &str) -> Self {
        match error {
            StoreError::InUse { .. } => Self::Failed(format!("{error}: {hint}")),
            error => error.into(),
        }
    }

    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Output(error) => error.exit_code(),
            Self::Failed(_) | Self::Interrupted(_) | Self::TakenOver(_) => ExitCode::from(1),
            Self::Input(_) => ExitCode::from(2),
            Self::TryAgain(_) => ExitCode::from(75),
        }
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(message)
            | Self::Failed(message)
            | Self::Interrupted(message)
            | Self::TryAgain(message)
            | Self::TakenOver(message) => f.write_str(message),
            Self::Output(error) => error.fmt(f),
        }
    }
}

impl From<OutputError> for CliError {
    fn from(error: OutputError) -> Self {
        Self::Output(error)
    }
}

impl From<Invalid> for CliError {
    fn from(invalid: Invalid) -> Self {
        Self::Input(invalid.to_string())
    }
}

impl From<TlsError> for CliError {
    fn from(error: TlsError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<TokensError> for CliError {
    fn from(error: TokensError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<CredentialsError> for CliError {
    fn from(error: CredentialsError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<ReportDataError> for CliError {
    fn from(error: ReportDataError) -> Self {
        match error {
            ReportDataError::Service(status) => status.into(),
            ReportDataError::Answer(_)
            | ReportDataError::Misfit(_)
            | ReportDataError::Picture(_)
            | ReportDataError::Broken(_)
            | ReportDataError::Interrupted(_) => Self::Failed(error.to_string()),
        }
    }
}

impl From<PictureError> for CliError {
    fn from(error: PictureError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// The file in the folder of `path` whose name is most similar, if any.
fn similar_file(path: &Path) -> Option<PathBuf> {
    let folder = path.parent()?;
    let entries = match folder == Path::new("") {
        true => fs::read_dir("."),
        false => fs::read_dir(folder),
    };
    let files = entries.ok()?.flatten().take(MOST_FILES);
    let files = files.filter(|entry| entry.file_type().is_ok_and(|kind| !kind.is_dir()));
    let names: Vec<String> = files
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    let similar = nearest(path.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(folder.join(similar))
}

impl From<ReportError> for CliError {
    fn from(error: ReportError) -> Self {
        match error {
            ReportError::Folder(error) => error.into(),
            error => Self::Failed(error.to_string()),
        }
    }
}

impl From<FigureError> for CliError {
    fn from(error: FigureError) -> Self {
        match error {
            FigureError::Options(invalid) => invalid.into(),
            FigureError::Report(error) => error.into(),
            FigureError::Picture(error) => error.into(),
        }
    }
}

impl From<FolderError> for CliError {
    fn from(error: FolderError) -> Self {
        match error {
            FolderError::Write { .. } => Self::Failed(error.to_string()),
            FolderError::Foreign { .. } | FolderError::Changed { .. } => Self::Input(error.to_string()),
        }
    }
}

impl From<ExportError> for CliError {
    fn from(error: ExportError) -> Self {
        let message = error.to_string();
        match error {
            ExportError::NotEmpty(_)
            | ExportError::NoExport(_)
            | ExportError::WorkingFolder(_)
            | ExportError::Damaged { .. } => Self::Input(message),
            ExportError::File { doing: "read", .. } => Self::Input(message),
            ExportError::File { .. } | ExportError::Aside { .. } | ExportError::Answer(_) => {
                Self::Failed(message)
            }
        }
    }
}

impl From<BackupError> for CliError {
    fn from(error: BackupError) -> Self {
        let message = error.to_string();
        match error {
            BackupError::Store(error) => error.into(),
            BackupError::Target(TargetError::NotEmpty(_) | TargetError::Within { .. })
            | BackupError::NoBackup { .. } => Self::Input(message),
            _ => Self::Failed(message),
        }
    }
}

impl From<CsvError> for CliError {
    fn from(error: CsvError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<LabelFileError> for CliError {
    fn from(error: LabelFileError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<StoreError> for CliError {
    fn from(error: StoreError) -> Self {
        let message = error.to_string();
        match error {
            StoreError::NoDirectory(_)
            | StoreError::NoFolder(_)
            | StoreError::Mirrored { .. }
            | StoreError::NoCampaign(_)
            | StoreError::NoStudy(_)
            | StoreError::NoCheckpoint(_)
            | StoreError::NoIndividual { .. } => Self::Input(message),
            StoreError::TakenOver(_) | StoreError::MirrorTaken(_) => Self::TakenOver(message),
            _ => Self::Failed(message),
        }
    }
}

impl From<ServerError> for CliError {
    fn from(error: ServerError) -> Self {
        match error {
            ServerError::Store(error) => error.into(),
            error => Self::Failed(error.to_string()),
        }
    }
}

impl From<RuntimeError> for CliError {
    fn from(error: RuntimeError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<EmbedError> for CliError {
    fn from(error: EmbedError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<Status> for CliError {
    fn from(status: Status) -> Self {
        let message = Text::line(status.message());
        let text = match (status.code(), status.source()) {
            (Code::Unavailable, Some(_)) => format!("the coordinator cannot be reached: {message}"),
            (_, Some(source)) => format!(
                "the connection to the coordinator failed ({}); the URL of an encrypted coordinator begins with https://",
                root_cause(source)
            ),
            (_, None) => message.into(),
        };
        match status.code() {
            Code::InvalidArgument | Code::NotFound => Self::Input(text),
            _ => Self::Failed(text),
        }
    }
}

/// The folder in which `murmuration` keeps the report of a campaign.
pub(super) fn report_folder(data: &Path, campaign: &CampaignId) -> PathBuf {
    data.join("reports").join(campaign.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_suggests_a_similar_one() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["quick.toml", "two-sensor.toml"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join("quik")).unwrap();
        let unreadable = |name: &str, kind: io::ErrorKind| {
            CliError::unreadable(&folder.path().join(name), &kind.into()).to_string()
        };
        let similar = format!(": did you mean {}?", folder.path().join("quick.toml").display());
        let message = unreadable("quik.toml", io::ErrorKind::NotFound);
        assert!(message.ends_with(&similar), "{message}");
        for message in [
            unreadable("elsewhere.csv", io::ErrorKind::NotFound),
            unreadable("nowhere/quick.toml", io::ErrorKind::NotFound),
            unreadable("quik.toml", io::ErrorKind::PermissionDenied),
        ] {
            assert!(!message.contains("did you mean"), "{message}");
        }
    }
}
