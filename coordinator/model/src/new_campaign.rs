//! A requested campaign.

use super::{Weight, labels::RequestId};
use murmuration_proto::v1::{self, create_campaign_request::Campaign};
use murmuration_swarm::{CampaignName, CampaignSpec, Invalid, SpecFileError};

/// A requested campaign that is not stored yet.
#[derive(Debug, Clone, PartialEq)]
pub struct NewCampaign {
    pub spec: CampaignSpec,
    /// The campaign's share of the workers.
    pub weight: Weight,
    pub study: Option<CampaignName>,
    /// Id of the request for the campaign. A repeated request starts nothing.
    pub request: Option<RequestId>,
}

impl From<CampaignSpec> for NewCampaign {
    /// A campaign without a study, with the default weight.
    fn from(spec: CampaignSpec) -> Self {
        Self {
            spec,
            weight: Weight::default(),
            study: None,
            request: None,
        }
    }
}

impl TryFrom<v1::CreateCampaignRequest> for NewCampaign {
    type Error = SpecFileError;

    fn try_from(message: v1::CreateCampaignRequest) -> Result<Self, SpecFileError> {
        let v1::CreateCampaignRequest {
            campaign,
            seed,
            weight,
            study,
            request_id,
        } = message;
        let spec = match campaign {
            Some(Campaign::Spec(spec)) => spec.try_into()?,
            Some(Campaign::Toml(text)) => CampaignSpec::from_toml(&text)?,
            None => return Err(Invalid::missing("spec", "a campaign specification").into()),
        };
        Ok(Self {
            spec: match seed {
                Some(seed) => spec.with_seed(seed)?,
                None => spec,
            },
            weight: weight.map(Weight::try_from).transpose()?.unwrap_or_default(),
            study: study_name(study)?,
            request: match request_id.as_str() {
                "" => None,
                id => Some(id.parse()?),
            },
        })
    }
}

/// The name of a study; `None` if the text is empty.
///
/// # Errors
/// If the text is not a valid name.
pub fn study_name(text: String) -> Result<Option<CampaignName>, Invalid> {
    match text.as_str() {
        "" => Ok(None),
        _ => CampaignName::try_from(text).map(Some).map_err(|error| Invalid {
            field: "study".to_owned(),
            ..error
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_is_checked_by_name() {
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let request = v1::CreateCampaignRequest {
            campaign: Some(Campaign::Spec((&spec).into())),
            seed: None,
            weight: Some(7),
            study: "small".to_owned(),
            request_id: "1".to_owned(),
        };
        let asked = NewCampaign::try_from(request.clone()).unwrap();
        assert_eq!(asked.study.as_ref().map(CampaignName::as_str), Some("small"));
        assert_eq!((asked.weight.get(), &asked.spec), (7, &spec));
        let refused = |change: fn(&mut v1::CreateCampaignRequest)| {
            let mut request = request.clone();
            change(&mut request);
            match NewCampaign::try_from(request).unwrap_err() {
                SpecFileError::Value(invalid) => invalid.field,
                SpecFileError::Syntax(error) => error.to_string(),
            }
        };
        assert_eq!(refused(|one| one.campaign = None), "spec");
        assert_eq!(refused(|one| one.weight = Some(0)), "weight");
        let file = refused(|one| one.campaign = Some(Campaign::Toml("model = 5".to_owned())));
        assert!(file.contains("line 1"), "{file}");
        let seeded = v1::CreateCampaignRequest {
            campaign: Some(Campaign::Toml(spec.to_toml())),
            seed: Some(9),
            ..v1::CreateCampaignRequest::default()
        };
        let seeded = NewCampaign::try_from(seeded).unwrap();
        assert_eq!(seeded.spec, spec.with_seed(9).unwrap());
        assert_eq!(refused(|one| one.study = "../x".to_owned()), "study");
        assert_eq!(refused(|one| one.request_id = "x".repeat(100)), "request_id");
    }
}
