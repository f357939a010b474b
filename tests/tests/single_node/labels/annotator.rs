//! A client for a campaign's labels.

use murmuration_proto::{
    parts::whole,
    v1::{self, label_service_client::LabelServiceClient},
};
use tonic::{Status, transport::Channel};

#[derive(Clone)]
pub(crate) struct Annotator {
    pub(crate) name: &'static str,
    client: LabelServiceClient<Channel>,
}

impl Annotator {
    pub(crate) fn of(name: &'static str, channel: &Channel) -> Self {
        Self {
            name,
            client: LabelServiceClient::new(channel.clone()),
        }
    }

    pub(crate) async fn say(
        &mut self,
        request_id: &str,
        answers: &[(u64, &str)],
    ) -> Result<Vec<u64>, Status> {
        let answer = |(index, answer): &(u64, &str)| v1::Answer {
            index: *index,
            answer: (*answer).to_owned(),
            time_ms: 0,
            annotator: self.name.to_owned(),
        };
        let request = v1::AppendLabelsRequest {
            campaign: "latest".to_owned(),
            request_id: request_id.to_owned(),
            answers: answers.iter().map(answer).collect(),
        };
        let added = self.client.append_labels(request).await?;
        let added = whole(added.into_inner()).await?;
        Ok(added.entries.iter().map(|entry| entry.number).collect())
    }

    /// Makes the synthetic annotator label `count` individuals.
    pub(crate) async fn call_the_judge(&mut self, request_id: &str, count: u32) -> Result<(), Status> {
        let request = v1::AppendSyntheticLabelsRequest {
            campaign: "latest".to_owned(),
            request_id: request_id.to_owned(),
            strategy: v1::QueryStrategy::Medoids as i32,
            count,
        };
        self.client.append_synthetic_labels(request).await.map(drop)
    }

    pub(crate) async fn undo(&mut self, request_id: &str) -> Result<Vec<v1::LabelEntry>, Status> {
        let request = v1::UndoLabelsRequest {
            campaign: "latest".to_owned(),
            request_id: request_id.to_owned(),
            annotator: self.name.to_owned(),
        };
        let undone = self.client.undo_labels(request).await?;
        let undone = whole(undone.into_inner()).await?;
        let undone_entries: Vec<_> = undone.undone.iter().map(|label| Some(label.entry)).collect();
        let superseded: Vec<_> = undone.entries.iter().map(|entry| entry.supersedes).collect();
        assert_eq!(undone_entries, superseded);
        Ok(undone.entries)
    }

    /// The current answers: individual, annotator, class.
    pub(crate) async fn standing(&mut self) -> Vec<(u64, String, String)> {
        let request = v1::ListLabelsRequest {
            campaign: "latest".to_owned(),
        };
        let labels = self.client.list_labels(request).await.unwrap();
        let labels = whole(labels.into_inner()).await.unwrap().labels;
        let answers = labels.into_iter().filter_map(|label| label.answer);
        answers
            .map(|answer| (answer.index, answer.annotator, answer.answer))
            .collect()
    }

    pub(crate) async fn log(&mut self) -> Vec<v1::LabelEntry> {
        let request = v1::ListLabelEntriesRequest {
            campaign: "latest".to_owned(),
        };
        let log = self.client.list_label_entries(request).await.unwrap();
        whole(log.into_inner()).await.unwrap().entries
    }

    pub(crate) async fn ask(
        &mut self,
        strategy: v1::QueryStrategy,
        count: u32,
        agreement: bool,
    ) -> Result<Vec<u64>, Status> {
        let request = v1::NextQueriesRequest {
            campaign: "latest".to_owned(),
            annotator: self.name.to_owned(),
            session: String::new(),
            strategy: strategy as i32,
            count,
            agreement,
            again: Vec::new(),
        };
        let asked = self.client.next_queries(request).await?.into_inner();
        assert_eq!(asked.individuals, 100);
        assert!(asked.queries.iter().all(|query| !query.reason.is_empty()));
        Ok(asked.queries.iter().map(|query| query.index).collect())
    }

    pub(crate) async fn change(
        &mut self,
        request_id: &str,
        change: v1::change_class_request::Change,
    ) -> Result<Vec<String>, Status> {
        let request = v1::ChangeClassRequest {
            campaign: "latest".to_owned(),
            request_id: request_id.to_owned(),
            annotator: self.name.to_owned(),
            change: Some(change),
        };
        let classes = self.client.change_class(request).await?.into_inner().classes;
        Ok(classes.into_iter().map(|class| class.name).collect())
    }
}

pub(crate) fn stands(message: &[(u64, &str, &str)]) -> Vec<(u64, String, String)> {
    let owned = |(index, who, answer): &(u64, &str, &str)| (*index, (*who).to_owned(), (*answer).to_owned());
    message.iter().map(owned).collect()
}
