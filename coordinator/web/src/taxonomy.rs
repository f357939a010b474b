//! The taxonomy of a campaign: people watch its behaviours, name them, and download the report.

use super::{
    Web, archived,
    layout::{Part, campaign_page},
    page_error::PageError,
    parts,
    visitor::Visitor,
};
use axum::{
    extract::{Path, State},
    http::header::{CONTENT_DISPOSITION, CONTENT_TYPE},
    response::IntoResponse,
};
use maud::{Markup, html};
use murmuration_engine::{blocking::blocking, taxonomy::Taxonomy};
use murmuration_model::{
    CampaignRecord,
    labels::{GivenClass, Labels},
};
use murmuration_proto::{
    counted, grouped,
    v1::{
        campaign_service_client::CampaignServiceClient, campaign_service_server::CampaignServiceServer,
        label_service_client::LabelServiceClient, label_service_server::LabelServiceServer,
    },
};
use murmuration_report as report;
use murmuration_service::{OrStatus as _, report_data};
use murmuration_store::StoreError;
use std::{collections::BTreeMap, sync::Arc};
use tonic::Status;

/// The page.
pub(super) async fn page(
    State(web): State<Web>,
    Path(id): Path<String>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let record = web.campaigns.status(&id).await?.record;
    let (store, campaign, spec) = (web.store.clone(), record.id.clone(), record.spec.clone());
    let read = move || -> Result<(Option<Taxonomy>, Arc<Labels>), StoreError> {
        let taxonomy = Taxonomy::read(&store, &campaign, &spec)?;
        Ok((taxonomy, store.labels(&campaign)?))
    };
    let (taxonomy, labels) = blocking(read).await??;
    let names = labels.given_classes();
    let content = html! {
        div.wide-bar {
            h1 { "Taxonomy" }
            @if taxonomy.is_some() {
                a.button href={ "/campaigns/" (record.id) "/report" } { "Export the report" }
            }
        }
        @match &taxonomy {
            None => p.empty { "The taxonomy is computed when the search has ended." },
            Some(taxonomy) => {
                p.lead {
                    "Each card shows the behaviour at the centre of a cluster. The largest cluster is first. "
                    span.scripted {
                        "Point at a picture to play its motion. A name counts as a label"
                        @if record.spec.method().embeds() { ": the embedding learns from it when it next learns from the labels" }
                        "."
                    }
                }
                (parts::who())
                datalist #names { @for class in labels.classes() { option value=(class.name) {} } }
                ul.medoids {
                    @for place in 0..taxonomy.medoids.len() {
                        li { (card(&record, place, taxonomy, &names)) }
                    }
                }
                (parts::status_line())
            }
        }
    };
    Ok(campaign_page(
        &record,
        Part::Taxonomy,
        &visitor,
        "taxonomy.js",
        content,
    ))
}

fn card(
    record: &CampaignRecord,
    place: usize,
    taxonomy: &Taxonomy,
    names: &BTreeMap<u64, GivenClass>,
) -> Markup {
    let (medoid, individuals) = (&taxonomy.medoids[place], taxonomy.clusters.len());
    let index = medoid.individual.index;
    let robust = taxonomy.robust_trials.get(index as usize);
    let share = medoid.cluster_size as f64 / individuals.max(1) as f64;
    let number = place + 1;
    let given = names.get(&index);
    html! {
        article.medoid data-index=(index) aria-labelledby={ "behaviour-" (number) } {
            div.stage tabindex="0" role="button" aria-label={ "Play behaviour " (number) } {
                img src=(archived::picture(record, index)) width="150" height="150" loading="lazy"
                    alt={ "Picture of behaviour " (number) };
                canvas aria-hidden="true" {}
            }
            h2 id={ "behaviour-" (number) } { "Behaviour " (number) }
            p.reason title={
                (grouped(medoid.cluster_size)) " of " (counted(individuals as u64, "individual"))
                " are nearer to this behaviour than to any other on this page"
            } { (format!("{:.1} %", 100.0 * share)) " · cluster of " (grouped(medoid.cluster_size)) }
            progress value=(medoid.cluster_size) max=(individuals) aria-label="Share of all individuals" {}
            form.naming.scripted data-index=(index) {
                label { span.unseen { "Name of behaviour " (number) }
                    input name="name" list="names" maxlength="64" autocomplete="off" placeholder="Name it"
                        value=[given.map(|given| &given.class)];
                }
                button.plain { "Save" }
            }
            @if given.is_some_and(|given| given.by_machine) {
                p.reason { "Named “" (given.map_or("", |given| given.class.as_str())) "” by the rule-based judge, not by a person." }
            }
            dl.figures {
                div { dt { "Individual" } dd { (grouped(index)) } }
                div { dt { "Generation" } dd { (grouped(medoid.individual.generation.into())) } }
                div { dt { "Novelty" } dd { (format!("{:.4}", medoid.novelty)) } }
                @if let Some(robust) = robust {
                    div title="Trials of this individual to which no other behaviour on this page is nearer than this one" {
                        dt { "Robustness" }
                        dd { (robust) " of " (record.spec.starts().get()) " starts" }
                    }
                }
            }
            code { (medoid.individual.controller) }
        }
    }
}

/// The report as one file to download; workers simulate its motions again. An error is answered with a page, so the link
/// must not be a `download`: browsers would save that page as the report.
pub(super) async fn export(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<impl IntoResponse, PageError> {
    let id = web.campaigns.status(&id).await?.record.id;
    web.archive.dispatch.check_staffed().or_status()?;
    // The service of this process, without a network between.
    let mut archive = CampaignServiceClient::new(CampaignServiceServer::new(web.archive));
    let mut labels = LabelServiceClient::new(LabelServiceServer::new(web.labels));
    let failed = |error: String| Status::internal(error);
    let gathered = async {
        let names = report_data::names(&mut labels, id.as_str()).await?;
        report_data::report(&mut archive, id.as_str(), names).await
    };
    let gathered = gathered.await.map_err(|error| match error {
        report_data::ReportDataError::Service(status) => status,
        other => failed(other.to_string()),
    })?;
    let page = blocking(move || report::page(&gathered)).await?;
    let page = page.map_err(|error| failed(error.to_string()))?;
    let name = format!("attachment; filename=\"{id}.html\"");
    let headers = [
        (CONTENT_TYPE, "text/html; charset=utf-8".to_owned()),
        (CONTENT_DISPOSITION, name),
    ];
    Ok((headers, page))
}
