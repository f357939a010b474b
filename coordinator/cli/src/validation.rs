//! Validation of a coordinator's messages, before any part of them is printed or used in a path.
//!
//! A coordinator may be untrusted: commands clean its texts, and refuse invalid ids.

use super::{CliError, connection::Client};
use murmuration_model::CampaignId;
use murmuration_proto::{parts::whole, v1};
use murmuration_swarm::{CheckpointDigest, Invalid, Text};
use tonic::Response;

/// A message that can be made safe to print.
pub trait Validated: Sized {
    /// Cleans the texts of the message.
    ///
    /// # Errors
    /// Fails if an id or digest is invalid.
    fn validated(self) -> Result<Self, CliError>;
}

/// Gets the campaign with this id, or the newest campaign for `latest`.
pub async fn get_campaign(
    client: &mut Client,
    campaign: impl Into<String>,
) -> Result<v1::Campaign, CliError> {
    let campaign = campaign.into();
    validated(client.get_campaign(v1::GetCampaignRequest { campaign }).await?)
}

/// All campaigns, oldest first.
pub async fn list_campaigns(client: &mut Client) -> Result<Vec<v1::Campaign>, CliError> {
    let listed = client.list_campaigns(v1::ListCampaignsRequest {}).await?;
    whole(listed.into_inner()).await?.campaigns.validated()
}

/// The digest of the archive of a campaign.
pub async fn get_digest(
    client: &mut Client,
    campaign: impl Into<String>,
) -> Result<v1::GetDigestResponse, CliError> {
    let campaign = campaign.into();
    validated(client.get_digest(v1::GetDigestRequest { campaign }).await?)
}

/// The message of a response, cleaned.
pub fn validated<T: Validated>(answer: Response<T>) -> Result<T, CliError> {
    answer.into_inner().validated()
}

fn clean(words: &mut String) {
    *words = Text::line(words).into();
}

/// Error for an invalid answer, which is the coordinator's fault and not the user's.
fn nonsense(invalid: &Invalid) -> CliError {
    CliError::Failed(format!("the coordinator's answer is invalid: {invalid}"))
}

/// The id of a campaign, checked so that it can be part of a path.
pub fn id(campaign: &v1::Campaign) -> Result<CampaignId, CliError> {
    campaign.id.parse().map_err(|invalid| nonsense(&invalid))
}

fn check_digest(digest: &str) -> Result<(), CliError> {
    match digest {
        "" => Ok(()),
        digest => {
            let parsed = digest.parse::<CheckpointDigest>().map(drop);
            parsed.map_err(|invalid| nonsense(&invalid))
        }
    }
}

impl Validated for v1::Campaign {
    fn validated(mut self) -> Result<Self, CliError> {
        id(&self)?;
        for digest in [&self.checkpoint, &self.next_checkpoint] {
            check_digest(digest)?;
        }
        let notices = self.notices.iter_mut().map(|notice| &mut notice.text);
        notices
            .chain([&mut self.error, &mut self.waiting])
            .chain(&mut self.tags)
            .for_each(clean);
        self.note = Text::lines(&self.note).into();
        self.toml = self.toml.map(|toml| Text::lines(&toml).into());
        Ok(self)
    }
}

impl Validated for v1::Taxonomy {
    fn validated(mut self) -> Result<Self, CliError> {
        let names = self.medoids.iter_mut().filter_map(|medoid| medoid.name.as_mut());
        names.for_each(|name| clean(&mut name.name));
        Ok(self)
    }
}

impl Validated for v1::Node {
    fn validated(mut self) -> Result<Self, CliError> {
        clean(&mut self.name);
        self.work.iter_mut().for_each(|work| clean(&mut work.campaign));
        Ok(self)
    }
}

impl Validated for v1::FindNearestResponse {
    fn validated(mut self) -> Result<Self, CliError> {
        let others = self.labelled.iter_mut().chain(&mut self.medoid);
        let neighbours = self.neighbours.iter_mut().chain(others);
        neighbours.for_each(|neighbour| clean(&mut neighbour.class));
        Ok(self)
    }
}

impl Validated for v1::Checkpoint {
    fn validated(mut self) -> Result<Self, CliError> {
        for digest in [&self.digest, &self.parent] {
            check_digest(digest)?;
        }
        clean(&mut self.data_digest);
        clean(&mut self.label_digest);
        self.configuration = Text::lines(&self.configuration).into();
        let metrics = self.metrics.into_iter();
        self.metrics = metrics
            .map(|(name, value)| (Text::line(&name).into(), value))
            .collect();
        Ok(self)
    }
}

impl Validated for v1::Label {
    fn validated(mut self) -> Result<Self, CliError> {
        if let Some(answer) = &mut self.answer {
            clean(&mut answer.answer);
            clean(&mut answer.annotator);
        }
        Ok(self)
    }
}

impl Validated for v1::ListClassesResponse {
    fn validated(mut self) -> Result<Self, CliError> {
        for class in &mut self.classes {
            clean(&mut class.name);
            clean(&mut class.colour);
        }
        Ok(self)
    }
}

impl Validated for v1::Agreement {
    fn validated(mut self) -> Result<Self, CliError> {
        for confusion in &mut self.confusions {
            clean(&mut confusion.first);
            clean(&mut confusion.second);
        }
        for disagreement in &mut self.disagreements {
            clean(&mut disagreement.first);
            clean(&mut disagreement.second);
        }
        Ok(self)
    }
}

impl Validated for v1::GetDigestResponse {
    fn validated(mut self) -> Result<Self, CliError> {
        clean(&mut self.digest);
        for round in &mut self.rounds {
            clean(&mut round.parent);
            clean(&mut round.checkpoint);
            clean(&mut round.label_digest);
        }
        Ok(self)
    }
}

impl<T: Validated> Validated for Vec<T> {
    fn validated(self) -> Result<Self, CliError> {
        self.into_iter().map(Validated::validated).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(id: &str) -> v1::Campaign {
        v1::Campaign {
            id: id.to_owned(),
            error: "broken\u{1b}]0;owned\u{7}".to_owned(),
            notices: vec![v1::Notice {
                number: 1,
                time_ms: 1,
                text: "fine\u{9b}2J \u{202e}enif".to_owned(),
            }],
            ..v1::Campaign::default()
        }
    }

    #[test]
    fn a_campaigns_words_do_not_move_the_cursor() {
        let validated = campaign("small-1").validated().unwrap();
        assert_eq!(validated.error, "broken]0;owned");
        assert_eq!(validated.notices[0].text, "fine2J enif");
    }

    #[test]
    fn an_id_that_would_be_a_path_is_refused() {
        for bad in [
            "/etc/cron.d/x-1",
            "../../x-1",
            "small",
            "a/b-1",
            ".-1",
            "small-1/..",
            "",
            "small-\u{1b}[2J",
            "small-+1",
        ] {
            let CliError::Failed(message) = campaign(bad).validated().unwrap_err() else {
                panic!("{bad} is the person's fault");
            };
            assert!(
                message.starts_with("the coordinator's answer is invalid: campaign = "),
                "{message}"
            );
            assert!(!message.contains('\u{1b}'), "{message:?}");
        }
        for good in ["small-1", "a-b_C-9-12"] {
            assert_eq!(id(&campaign(good)).unwrap().as_str(), good);
        }
    }

    #[test]
    fn a_checkpoints_words_are_cleaned_and_its_digest_is_one() {
        let checkpoint = |digest: &str| v1::Checkpoint {
            digest: digest.to_owned(),
            configuration: "seed = 1\n\u{1b}[31mred = 2\n".to_owned(),
            metrics: [("lo\u{202e}ss".to_owned(), 1.0)].into(),
            ..v1::Checkpoint::default()
        };
        let validated = checkpoint(&"a".repeat(64)).validated().unwrap();
        assert_eq!(validated.configuration, "seed = 1\n[31mred = 2\n");
        assert!(validated.metrics.contains_key("loss"));
        assert!(checkpoint("../../x").validated().is_err());
    }
}
