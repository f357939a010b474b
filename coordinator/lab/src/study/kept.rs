//! Reads and stores studies at the coordinator.

use murmuration_cli::{CliError, connection::StudyClient};
use murmuration_model::study_records::{StudyFile, StudyParts, StudyRecord};
use murmuration_proto::v1::{self, study_part::Part};
use murmuration_study::{KeptError, KeptStudy};
use murmuration_swarm::Invalid;

/// A study as it was last run.
pub(super) async fn get(client: &mut StudyClient, study: &str) -> Result<KeptStudy, CliError> {
    let request = v1::GetStudyRequest {
        study: study.to_owned(),
    };
    let mut parts = client.get_study(request).await?.into_inner();
    let mut arriving = StudyParts::default();
    while let Some(part) = parts.message().await? {
        arriving.add(part.part)?;
    }
    let file = arriving
        .file
        .ok_or_else(|| Invalid::missing("file", "the first part of a study"))?;
    KeptStudy::new(&file, arriving.records).map_err(|error| damaged(study, &error))
}

/// Stores the file of a study, records of the study, or both.
pub(super) async fn keep(
    client: &mut StudyClient,
    study: &str,
    file: Option<StudyFile>,
    records: Vec<StudyRecord>,
) -> Result<(), CliError> {
    let file = file.map(|file| Part::File(file.into()));
    let parts = file
        .into_iter()
        .chain(records.into_iter().flat_map(StudyRecord::parts));
    let mut name = study.to_owned();
    let parts: Vec<v1::StudyPart> = parts
        .map(|part| v1::StudyPart {
            study: std::mem::take(&mut name),
            part: Some(part),
        })
        .collect();
    client.keep_study(tokio_stream::iter(parts)).await?;
    Ok(())
}

/// The error of a study whose records cannot be used.
pub(super) fn damaged(study: &str, error: &KeptError) -> CliError {
    CliError::Failed(format!("the study {study} is damaged: {error}"))
}
