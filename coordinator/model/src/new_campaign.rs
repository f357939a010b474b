//! A campaign that somebody asks for.

use super::{Weight, labels::RequestId};
use murmuration_proto::{CampaignName, CampaignSpec, Invalid, v1};

/// A campaign that somebody asks for, not stored yet.
#[derive(Debug, Clone, PartialEq)]
pub struct NewCampaign {
    pub spec: CampaignSpec,
    /// Its share of the workers.
    pub weight: Weight,
    pub study: Option<CampaignName>,
    /// The request that asks for it: repeated, it starts nothing.
    pub request: Option<RequestId>,
}

impl From<CampaignSpec> for NewCampaign {
    /// A campaign of no study, of the default weight.
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
    type Error = Invalid;

    fn try_from(message: v1::CreateCampaignRequest) -> Result<Self, Invalid> {
        let v1::CreateCampaignRequest {
            spec,
            weight,
            study,
            request_id,
        } = message;
        let spec = spec.ok_or_else(|| Invalid::missing("spec", "a campaign specification"))?;
        Ok(Self {
            spec: spec.try_into()?,
            weight: weight.map(Weight::try_from).transpose()?.unwrap_or_default(),
            study: study_name(study)?,
            request: match request_id.as_str() {
                "" => None,
                id => Some(id.parse()?),
            },
        })
    }
}

/// The name of a study; nothing is none.
///
/// # Errors
/// If it is no name.
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
            spec: Some((&spec).into()),
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
            NewCampaign::try_from(request).unwrap_err().field
        };
        assert_eq!(refused(|one| one.spec = None), "spec");
        assert_eq!(refused(|one| one.weight = Some(0)), "weight");
        assert_eq!(refused(|one| one.study = "../x".to_owned()), "study");
        assert_eq!(refused(|one| one.request_id = "x".repeat(100)), "request_id");
    }
}
