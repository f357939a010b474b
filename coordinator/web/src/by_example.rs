//! Searches by example: campaigns that begin from an individual of an archive, and the buttons that start them.

use super::{
    Web,
    asked::Form,
    new::{request_of, token},
    of_campaign::OfCampaign,
    of_campaign::page_of,
    page_error::PageError,
};
use axum::{extract::Path, response::Redirect};
use maud::{Markup, html};
use murmuration_engine::blocking::in_background;
use murmuration_model::{CampaignId, CampaignRecord, NewCampaign};
use murmuration_service::OrStatus as _;
use murmuration_store::{Store, StoreError};
use murmuration_swarm::{Begun, CampaignName, CampaignSpec, Controller, ControllerSpace, Invalid, grouped};
use serde::Deserialize;

/// The field of a form that has the [`Example`] of the pressed button.
pub(super) const FIELD: &str = "example";

/// The relation of a campaign to its example.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Example {
    /// The first generation begins around the example.
    #[default]
    Like,
    /// The first generation begins with individuals that are least like the example.
    Unlike,
    /// The only generation is the example and all controllers within a step of it.
    Sweep,
}

/// The form of a search by example.
#[derive(Debug, Deserialize)]
pub(super) struct Asked {
    #[serde(default)]
    pub(super) example: Example,
    /// The token of the form's page, so that a second click starts no second campaign.
    pub(super) request: Option<String>,
}

impl Example {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Like => "like",
            Self::Unlike => "unlike",
            Self::Sweep => "sweep",
        }
    }

    const fn label(self) -> &'static str {
        match self {
            Self::Like => "More like this",
            Self::Unlike => "Less like this",
            Self::Sweep => "Sweep around this",
        }
    }

    /// Explanation of the button, which a pointer shows.
    pub(super) fn title(self) -> String {
        let search = format!(
            "Starts a campaign of {} evaluations, on hand-crafted features",
            grouped(CampaignSpec::BEGUN_EVALUATIONS.into())
        );
        match self {
            Self::Like => format!(
                "{search}, whose first generation begins around this controller. Novelty search moves on from there: a sweep shows what is near"
            ),
            Self::Unlike => format!(
                "{search}, whose first generation begins with {} individuals of this archive: from the quarter that is farthest from \
                 this behaviour, those farthest from each other",
                CampaignSpec::BEGUN_CONTROLLERS
            ),
            Self::Sweep => format!(
                "Evaluates this controller and every controller within a step of it (a tenth of a speed's limit), once each, and shows \
                 them on a map. With more than {} combinations, at most two genes change",
                grouped(ControllerSpace::MAX_INITIAL as u64)
            ),
        }
    }
}

/// The buttons that start campaigns from an individual, in a form. The individual is given by its index, and in words for people who
/// do not see the page; `None` if a script fills in the address of the form and then enables the buttons.
pub(super) fn buttons(id: &CampaignId, individual: Option<(u64, &str)>) -> Markup {
    let action = individual.map(|(index, _)| address(id, index));
    html! {
        form.examples method="post" action=[action] {
            input type="hidden" name="request" value=(token());
            @for example in [Example::Like, Example::Unlike, Example::Sweep] {
                button.plain name=(FIELD) value=(example.name()) title=(example.title()) disabled[individual.is_none()] {
                    (example.label())
                    @if let Some((_, of)) = individual { span.unseen { " " (of) } }
                }
            }
        }
    }
}

/// The address to which the buttons of an individual are sent.
fn address(id: &CampaignId, index: u64) -> String {
    format!("/campaigns/{id}/individuals/{index}/search")
}

/// Starts a campaign from an individual, and redirects to it.
pub(super) async fn search(
    Path((_, index)): Path<(String, u64)>,
    OfCampaign { web, record, .. }: OfCampaign,
    Form(asked): Form<Asked>,
) -> Result<Redirect, PageError> {
    let (id, model) = (record.id.clone(), record.spec.model().clone());
    let individual = web.store.run(move |store| store.individual(&id, &model, index));
    let individual = individual.await?;
    let controller = &individual.controller;
    let begun = Begun {
        name: &name(asked.example, &record.id, index),
        world: record.spec.world(),
        seed: CampaignSpec::seed_of(individual.seed),
    };
    let spec = match asked.example {
        Example::Like => CampaignSpec::begun_around(controller, begun)?,
        Example::Sweep => CampaignSpec::sweep_around(controller, begun)?,
        Example::Unlike => {
            let others = unlike(&web, &record, index).await?;
            CampaignSpec::begun_with(controller.model(), &others, begun)?
        }
    };
    begin(&web, spec, &asked).await
}

/// Starts a campaign that a form asked for, and redirects to it: to the map of a sweep, and to the page of another campaign.
pub(super) async fn begin(web: &Web, spec: CampaignSpec, asked: &Asked) -> Result<Redirect, PageError> {
    let request = asked.request.as_deref();
    let new = NewCampaign {
        request: request.map(|token| request_of(token, &spec)).transpose()?,
        ..spec.into()
    };
    let created = web.campaigns.create(new).await?;
    let id = &created.record.id;
    Ok(match asked.example {
        // The map shows the centre first.
        Example::Sweep => Redirect::to(&format!("/campaigns/{id}/map#individual-0")),
        Example::Like | Example::Unlike => page_of(id.as_str()),
    })
}

/// The controllers of the individuals that are least like an individual, each once.
async fn unlike(web: &Web, record: &CampaignRecord, index: u64) -> Result<Vec<Controller>, PageError> {
    let (queries, of) = (web.labels.queries.clone(), record.clone());
    let found = in_background(move |interrupt| {
        queries.unlike(&of, index as usize, CampaignSpec::BEGUN_CONTROLLERS, interrupt)
    });
    let found = found.await.or_status()?.or_status()?;
    if found.is_empty() {
        let allowed = "an individual that the map shows, beside others";
        return Err(Invalid::new("the individual", index, allowed).into());
    }
    let (id, model) = (record.id.clone(), record.spec.model().clone());
    let read = move |store: &Store| {
        let mut controllers: Vec<Controller> = Vec::new();
        for index in found {
            let controller = store.individual(&id, &model, index as u64)?.controller;
            if !controllers.contains(&controller) {
                controllers.push(controller);
            }
        }
        Ok::<_, StoreError>(controllers)
    };
    Ok(web.store.run(read).await?)
}

/// The name of a campaign that begins from an individual: `like-CAMPAIGN-INDEX`. Of a long id, only the end fits.
fn name(example: Example, of: &CampaignId, index: u64) -> String {
    let (begins, ends) = (example.name(), format!("-{index}"));
    let room = CampaignName::MAX_LENGTH.saturating_sub(begins.len() + 1 + ends.len());
    let id = of.as_str();
    let id = id.get(id.len().saturating_sub(room)..).unwrap_or_default();
    format!("{begins}-{id}{ends}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_tells_its_origin_and_fits() {
        let name = |id: &str, index| {
            let name = name(Example::Unlike, &id.parse().unwrap(), index);
            CampaignName::try_from(name).unwrap().as_str().to_owned()
        };
        assert_eq!(name("quick-1", 57), "unlike-quick-1-57");
        let long = name(&format!("{}-12", "x".repeat(64)), 9_999_999);
        assert_eq!(long.len(), 64);
        assert!(
            long.starts_with("unlike-xxx") && long.ends_with("xxx-12-9999999"),
            "{long}"
        );
    }
}
