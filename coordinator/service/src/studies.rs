//! Studies: their files, and the records of what was measured.

use super::Streamed;
use crate::status::OrStatus as _;
use murmuration_engine::blocking::spawn;
use murmuration_model::study_records::{StudyFile, StudyRecord};
use murmuration_proto::{
    PART_BYTES,
    v1::{self, study_part::Part},
};
use murmuration_store::Store;
use murmuration_swarm::{CampaignName, Invalid, counted};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Most records of a request: five times the cells of the largest study.
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
                // The client may be gone.
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
        let mut arriving = Arriving::begin(parts.message().await?.unwrap_or_default())?;
        while let Some(part) = parts.message().await? {
            arriving.add(part.part)?;
        }
        let keep =
            move |store: &Store| store.keep_study(&arriving.name, arriving.file.as_ref(), &arriving.records);
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
                // Read when the part before it was taken, so that slow clients hold no whole records.
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

/// A study whose parts are arriving.
struct Arriving {
    name: CampaignName,
    file: Option<StudyFile>,
    records: Vec<StudyRecord>,
    /// Of the contents of all records.
    bytes: usize,
}

impl Arriving {
    fn begin(first: v1::StudyPart) -> Result<Self, Invalid> {
        let name = CampaignName::try_from(first.study).map_err(|error| Invalid {
            field: "study".to_owned(),
            ..error
        })?;
        let mut arriving = Self {
            name,
            file: None,
            records: Vec::new(),
            bytes: 0,
        };
        arriving.add(first.part)?;
        Ok(arriving)
    }

    fn add(&mut self, part: Option<Part>) -> Result<(), Invalid> {
        match part {
            None => {}
            Some(Part::File(file)) => self.file = Some(file.into()),
            Some(Part::Record(record)) if self.records.len() < MAX_RECORDS => {
                self.records.push(record.try_into()?);
            }
            Some(Part::Record(_)) => {
                let allowed = format!("at most {MAX_RECORDS} in one request");
                return Err(Invalid::new("record", "more", allowed));
            }
            Some(Part::Content(content)) if content.is_empty() => {
                return Err(Invalid::new("content", "empty", "at least one byte a part"));
            }
            Some(Part::Content(content)) => {
                if content.len() > PART_BYTES {
                    let found = counted(content.len() as u64, "byte");
                    return Err(Invalid::new(
                        "content",
                        found,
                        format!("at most {PART_BYTES} bytes a part"),
                    ));
                }
                self.bytes += content.len();
                if self.bytes > StudyRecord::MAX_CONTENT {
                    let allowed = counted(StudyRecord::MAX_CONTENT as u64, "byte");
                    return Err(Invalid::new("content", "more", format!("at most {allowed}")));
                }
                let Some(record) = self.records.last_mut() else {
                    return Err(Invalid::missing("record", "before its content"));
                };
                record.content.extend(content);
            }
        }
        Ok(())
    }
}
