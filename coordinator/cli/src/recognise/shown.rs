//! Output about a recognised swarm.

use super::{
    super::{
        json,
        table::{Table, left, right},
    },
    Recognised,
};
use murmuration_engine::nearest::{UNLIKE, relative_distance};
use murmuration_link::{OutputError, outln};
use murmuration_proto::v1;
use murmuration_swarm::{FEATURE_NAMES, figure, in_full, rounded};

/// Prints the result, for a person or for programs.
pub(super) fn show(recognised: &Recognised, as_json: bool) -> Result<(), OutputError> {
    match as_json {
        true => json::print(document(recognised)),
        false => {
            for (name, value) in FEATURE_NAMES.iter().zip(recognised.evaluation.features()) {
                outln!("{name:<20} {}", in_full(*value))?;
            }
            outln!("")?;
            table(&recognised.nearest).print()?;
            outln!("")?;
            outln!("{}", verdict(&recognised.campaign, &recognised.nearest))
        }
    }
}

fn table(nearest: &v1::FindNearestResponse) -> Table {
    let mut table = Table::new([
        right("INDIVIDUAL"),
        right("DISTANCE"),
        right("CLUSTER"),
        left("CLASS"),
    ]);
    for neighbour in &nearest.neighbours {
        table.row([
            neighbour.index.to_string(),
            figure(neighbour.distance),
            (neighbour.cluster + 1).to_string(),
            named(neighbour),
        ]);
    }
    table
}

fn named(neighbour: &v1::Neighbour) -> String {
    match neighbour.class.as_str() {
        "" => "-".to_owned(),
        class => class.to_owned(),
    }
}

/// A message about the swarm: its nearest cluster, its distance from the medoid, and the class of the nearest labelled
/// individual.
fn verdict(campaign: &str, nearest: &v1::FindNearestResponse) -> String {
    let medoid = nearest.medoid.clone().unwrap_or_default();
    let mut message = match nearest.is_unlike {
        true => format!("It is unlike every behaviour in {campaign}: the"),
        false => "The".to_owned(),
    };
    message += &format!(
        " nearest cluster is {} (individual {}), {} from its medoid",
        medoid.cluster + 1,
        medoid.index,
        figure(medoid.distance)
    );
    if let Some(times) = relative(nearest) {
        message += &format!(
            ", {} times as far as its members are on average",
            rounded(times, 1)
        );
    }
    if let Some(near) = nearest.neighbours.first() {
        message += &format!(
            ". The nearest individual is {} away; individuals are {} from their medoids on average (a behaviour more than {UNLIKE} \
             times as far from the medoid, and farther from the nearest individual than this, counts as unlike all others)",
            figure(near.distance),
            figure(nearest.spread)
        );
    }
    if !nearest.is_taxonomy {
        message += ". The campaign has no taxonomy yet; these are the clusters that it would have now";
    }
    if let Some(labelled) = &nearest.labelled {
        message += &format!(
            ". The nearest individual with a class is {} ({}): {}",
            labelled.index,
            figure(labelled.distance),
            labelled.class
        );
    }
    message + "."
}

/// The swarm's distance from the nearest medoid, divided by the mean distance of the medoid's members; `None` if all members are
/// at one place.
fn relative(nearest: &v1::FindNearestResponse) -> Option<f64> {
    relative_distance(nearest.medoid.as_ref()?.distance, nearest.mean_distance)
}

fn document(recognised: &Recognised) -> json::Recognised<'_> {
    let assumed = &recognised.assumed;
    json::Recognised {
        campaign: recognised.campaign.clone(),
        robots: assumed.robots,
        frames: assumed.frames,
        missing: assumed.missing,
        share_of_headings: assumed.share_of_headings,
        frame_time: assumed.compared.frame_time,
        scale: assumed.compared.scale,
        inside: assumed.compared.understood.inside,
        width: assumed.compared.understood.width,
        steps: assumed.compared.steps,
        notes: assumed.notes(),
        behaviour: json::Behaviour::from(&recognised.evaluation),
        nearest: json::Document(&recognised.nearest),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_far_from_every_cluster_is_like_nothing() {
        let message = |distance: f64, is_unlike: bool| {
            let neighbour = |class: &str| v1::Neighbour {
                index: 7,
                distance,
                cluster: 2,
                class: class.to_owned(),
            };
            let nearest = v1::FindNearestResponse {
                neighbours: vec![neighbour("")],
                medoid: Some(neighbour("")),
                labelled: Some(neighbour("ring")),
                mean_distance: 0.5,
                spread: 0.25,
                is_taxonomy: true,
                is_unlike,
            };
            verdict("quick-1", &nearest)
        };
        assert_eq!(
            message(1.0, false),
            "The nearest cluster is 3 (individual 7), 1.0000 from its medoid, 2.0 times as far as its members are on average. The \
             nearest individual is 1.0000 away; individuals are 0.2500 from their medoids on average (a behaviour more than 3 times \
             as far from the medoid, and farther from the nearest individual than this, counts as unlike all others). The nearest \
             individual with a class is 7 (1.0000): ring."
        );
        assert!(
            message(1.6, true).starts_with("It is unlike every behaviour in quick-1: the nearest cluster")
        );
        assert!(message(1e301, true).len() < 600);
    }
}
