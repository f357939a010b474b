//! `show --taxonomy`: the clusters of a campaign and their names.

use super::{
    CliError, Global,
    connection::Connection,
    json,
    table::{Table, left, right},
    validation::Validated as _,
};
use murmuration_proto::{parts::whole, v1};
use murmuration_swarm::grouped;

/// The clusters of a completed campaign.
pub(super) async fn of(connection: &mut Connection, campaign: &str) -> Result<v1::Taxonomy, CliError> {
    let request = v1::GetTaxonomyRequest {
        campaign: campaign.to_owned(),
    };
    let taxonomy = connection.client.get_taxonomy(request).await?;
    whole(taxonomy.into_inner()).await?.validated()
}

pub(super) fn show(global: &Global, campaign: &str, taxonomy: &v1::Taxonomy) -> Result<(), CliError> {
    if global.json {
        let mut taxonomy = taxonomy.clone();
        let medoids = taxonomy.medoids.iter_mut();
        medoids
            .filter_map(|medoid| medoid.individual.as_mut())
            .for_each(|individual| individual.image = None);
        return Ok(json::print(json::Taxonomy {
            campaign,
            taxonomy: json::Document(&taxonomy),
        })?);
    }
    let mut table = Table::new([
        right("CLUSTER"),
        right("INDIVIDUALS"),
        right("MEDOID"),
        left("NAME"),
        left("NAMED BY"),
    ]);
    for (place, medoid) in taxonomy.medoids.iter().enumerate() {
        let index = medoid.individual.as_ref().map_or(0, |medoid| medoid.index);
        let name = medoid.name.as_ref();
        table.row([
            (place + 1).to_string(),
            grouped(medoid.cluster_size),
            index.to_string(),
            name.map_or_else(|| "-".to_owned(), |name| name.name.clone()),
            name.map_or_else(|| "-".to_owned(), origin),
        ]);
    }
    Ok(table.print()?)
}

fn origin(name: &v1::ClusterName) -> String {
    match &name.carried {
        Some(from) => format!(
            "version {}, cluster {} ({} of {} members)",
            from.version,
            u64::from(from.cluster) + 1,
            grouped(from.shared),
            grouped(from.members)
        ),
        None if name.by_machine => "the rule-based judge".to_owned(),
        None => "a person".to_owned(),
    }
}
