//! Studies: their files, and the records of their measurements.

use super::Streamed;
use crate::status::OrStatus as _;
use murmuration_engine::blocking::spawn;
use murmuration_model::study_records::{StudyFile, StudyParts, StudyRecord};
use murmuration_proto::{
    PART_BYTES,
    v1::{self, study_part::Part},
};
use murmuration_store::Store;
use murmuration_swarm::{CampaignName, Invalid, counted};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Maximum number of records of a request: five times the cells of the largest study.
const MAX_RECORDS: usize = 10_000;

/// Implements `murmuration.v1.StudyService`.
#[derive(Debug, Clone)]
pub struct StudyApi {
    pub store: Store,
}

#[tonic::async_trait]
impl v1::study_service_server::StudyService for StudyApi {
    type GetStudyStream = Streamed<v1::StudyPart>;

    async fn list_studies(
        &self,
        _: Request<v1::ListStudiesRequest>,
    ) -> Result<Response<v1::ListStudiesResponse>, Status> {
        let studies = self.store.run(Store::studies).await.or_status()?;
        Ok(Response::new(v1::ListStudiesResponse { studies }))
    }

    async fn get_study(
        &self,
        request: Request<v1::GetStudyRequest>,
    ) -> Result<Response<Self::GetStudyStream>, Status> {
        let study = request.into_inner().study;
        let name = study.clone();
        let file = self.store.run(move |store| store.study_file(&name)).await;
        let file = file.or_status()?;
        let (parts, stream) = mpsc::channel(2);
        let api = self.clone();
        spawn(async move {
            if let Err(status) = api.send(study, file, &parts).await {
                // The client may have disconnected.
                let _ = parts.send(Err(status)).await;
            }
        });
        Ok(Response::new(Box::pin(ReceiverStream::new(stream))))
    }

    async fn keep_study(
        &self,
        request: Request<Streaming<v1::StudyPart>>,
    ) -> Result<Response<v1::KeepStudyResponse>, Status> {
        let mut parts = request.into_inner();
        let first = parts.message().await?.unwrap_or_default();
        let name = CampaignName::try_from(first.study).map_err(|error| Invalid {
            field: "study".to_owned(),
            ..error
        })?;
        let mut arriving = StudyParts::default();
        add(&mut arriving, first.part)?;
        while let Some(part) = parts.message().await? {
            add(&mut arriving, part.part)?;
        }
        let keep = move |store: &Store| store.keep_study(&name, arriving.file.as_ref(), &arriving.records);
        self.store.change(keep).await.or_status()?;
        Ok(Response::new(v1::KeepStudyResponse {}))
    }
}

impl StudyApi {
    /// Sends the parts of a study, one record after the other.
    async fn send(
        &self,
        study: String,
        file: StudyFile,
        parts: &mpsc::Sender<Result<v1::StudyPart, Status>>,
    ) -> Result<(), Status> {
        let name = study.clone();
        let entries = self.store.run(move |store| store.study_entries(&name)).await;
        let entries = entries.or_status()?;
        let part = |part| v1::StudyPart {
            study: String::new(),
            part: Some(part),
        };
        let first = v1::StudyPart {
            study: study.clone(),
            ..part(Part::File(file.into()))
        };
        if parts.send(Ok(first)).await.is_err() {
            return Ok(());
        }
        for entry in entries {
            let record = v1::StudyRecord {
                kind: v1::StudyRecordKind::from(entry.kind).into(),
                key: entry.key.clone(),
                measures: entry.measures.clone(),
            };
            let mut next = Some(Part::Record(record));
            let mut from = 0;
            while let Some(present) = next.take() {
                if parts.send(Ok(part(present))).await.is_err() {
                    return Ok(());
                }
                // A part is read when the client has taken the previous part, so that slow clients hold no whole records.
                let (name, of) = (study.clone(), entry.clone());
                let read = move |store: &Store| store.study_content_part(&name, &of, from, PART_BYTES);
                let content = self.store.run(read).await.or_status()?;
                from += content.len();
                next = (!content.is_empty()).then_some(Part::Content(content));
            }
        }
        Ok(())
    }
}

/// Adds a part to a study that will be stored.
fn add(arriving: &mut StudyParts, part: Option<Part>) -> Result<(), Invalid> {
    arriving.add(part)?;
    if arriving.records.len() > MAX_RECORDS {
        let allowed = format!("at most {MAX_RECORDS} in one request");
        return Err(Invalid::new("record", "more", allowed));
    }
    if arriving.bytes() > StudyRecord::MAX_CONTENT {
        let allowed = counted(StudyRecord::MAX_CONTENT as u64, "byte");
        return Err(Invalid::new("content", "more", format!("at most {allowed}")));
    }
    Ok(())
}
