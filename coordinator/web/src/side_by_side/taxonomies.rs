//! The taxonomies of the compared campaigns together: one map of all behaviours if the campaigns share a space, and a table with
//! a row for each behaviour and a column for each campaign.

use super::{
    super::taxonomy::card::{Card, brief},
    Compared,
    matching::{Behaviour, Group, by_class, by_distance},
};
use maud::{Markup, html};
use murmuration_model::CampaignRecord;
use murmuration_report::point_map;
use murmuration_search::{interrupt::Interrupt, novelty::Behaviours, projection::principal_axes};
use murmuration_study::wide;
use murmuration_swarm::{BehaviourSpace, Scale, counted};

/// Side of the map, and margin above and below its content, in units of the drawing.
const MAP: f64 = 640.0;
const MARGIN: f64 = 24.0;

pub(super) fn section(compared: &[Compared]) -> Markup {
    let all = behaviours(compared);
    let with = compared
        .iter()
        .filter(|compared| compared.shown.is_some())
        .count();
    let has_one_space = with > 1 && have_one_space(compared);
    let groups = match has_one_space {
        true => by_distance(compared.len(), &all),
        false => by_class(compared.len(), &all),
    };
    html! {
        section aria-labelledby="taxonomies" {
            h2 #taxonomies { "Taxonomies" }
            @if with > 1 {
                (explanation(compared, has_one_space, &groups, with))
                @if has_one_space { (map(compared, &all, &groups)) }
            }
            (rows(compared, &all, &groups, has_one_space, with))
        }
    }
}

/// The medoids of all campaigns, campaign by campaign, largest cluster first.
fn behaviours(compared: &[Compared]) -> Vec<Behaviour> {
    let mut all = Vec::new();
    for (campaign, Compared { record, shown }) in compared.iter().enumerate() {
        let Some(shown) = shown else { continue };
        all.extend(shown.taxonomy.medoids.iter().enumerate().map(|(place, medoid)| {
            Behaviour {
                campaign,
                place,
                // Distances are used only if campaigns share a space, and campaigns share only spaces that are not scaled.
                at: medoid.individual.behaviour(&Scale::unscaled(record.spec.space())),
                mean_distance: medoid.mean_distance,
                class: shown.class(place),
            }
        }));
    }
    all
}

/// Whether all campaigns with a taxonomy share one space, so that distances between their behaviours have a meaning.
fn have_one_space(compared: &[Compared]) -> bool {
    let mut with = compared.iter().filter(|compared| compared.shown.is_some());
    let first = with.next();
    first.is_some_and(|first| with.all(|other| share_a_space(&first.record, &other.record)))
}

/// Whether two campaigns share a behaviour space. Embeddings can be compared if one checkpoint made them. Hand-crafted features
/// can be compared for the same robots in worlds of the same size, because the features depend on this size. Features and
/// embedding together cannot be compared: each campaign scales them by its own first generation.
fn share_a_space(one: &CampaignRecord, other: &CampaignRecord) -> bool {
    let [ours, theirs] = [one, other].map(|record| record.spec.space());
    let same_parts = ours == theirs && ours != BehaviourSpace::Both;
    let size = |record: &CampaignRecord| [record.spec.world().width(), record.spec.world().height()];
    let same_features =
        one.spec.model().species() == other.spec.model().species() && size(one) == size(other);
    let [ours_by, theirs_by] = [one, other].map(|record| record.embedder.checkpoint());
    same_parts && (!ours.has_features() || same_features) && (!ours.embeds() || ours_by == theirs_by)
}

/// The behaviour space of a campaign, in words.
fn space_in_words(record: &CampaignRecord) -> String {
    let space = record.spec.space();
    let checkpoint = record.embedder.checkpoint().filter(|_| space.embeds());
    let embedding = checkpoint.map(|digest| {
        let short: String = digest.to_string().chars().take(12).collect();
        format!("the embedding by checkpoint {short}")
    });
    let features = space.has_features().then(|| {
        let world = record.spec.world();
        format!(
            "the features of {} robots in a world of {} x {}",
            record.spec.model(),
            world.width(),
            world.height()
        )
    });
    let parts: Vec<String> = embedding.into_iter().chain(features).collect();
    parts.join(" and ")
}

fn explanation(compared: &[Compared], has_one_space: bool, groups: &[Group], with: usize) -> Markup {
    let shared = groups.iter().filter(|group| group.campaigns() == with).count();
    html! {
        @if has_one_space {
            p.lead {
                "These campaigns measure behaviours in one space, so that behaviours can be matched by their distance. Two behaviours count as "
                "the same if their clusters touch. Clusters touch if their medoids are nearer to each other than the sum of the two "
                "clusters' mean distances to their medoids. " (counted(shared as u64, "behaviour")) (if shared == 1 { " is" } else { " are" }) " in all " (with) " campaigns."
            }
        } @else {
            p.lead {
                "These campaigns measure behaviours in different spaces, in which distances do not mean the same. So behaviours are matched by "
                "the classes that annotators gave, or else by what the rule-based judge calls them. Random and mixed clusters have no class, and are not matched."
            }
            ul.reason {
                @for Compared { record, .. } in compared.iter().filter(|compared| compared.shown.is_some()) {
                    li { strong { (record.id) } ": " (space_in_words(record)) }
                }
            }
        }
    }
}

/// The map of all medoids along the two axes on which they differ most; lines join matched medoids.
fn map(compared: &[Compared], all: &[Behaviour], groups: &[Group]) -> Markup {
    let Some((places, shares)) = placed(all) else {
        return Markup::default();
    };
    let rows = places.iter().map(|[_, y]| *y);
    let [top, bottom] = rows.fold([MAP / 2.0; 2], |[top, bottom], y| [top.min(y), bottom.max(y)]);
    let (top, bottom) = (top - MARGIN, bottom + MARGIN);
    html! {
        figure.common-map {
            svg.version-map viewBox={ "0 " (format!("{top:.1}")) " " (MAP) " " (format!("{:.1}", bottom - top)) } role="group"
                aria-label={ "Map of " (counted(all.len() as u64, "behaviour")) " of " (counted(compared.len() as u64, "campaign")) } {
                @for group in groups {
                    @let members: Vec<usize> = group.members.iter().flatten().copied().collect();
                    @for pair in members.windows(2) {
                        @let ([x1, y1], [x2, y2]) = (places[pair[0]], places[pair[1]]);
                        line.joined x1=(format!("{x1:.1}")) y1=(format!("{y1:.1}")) x2=(format!("{x2:.1}")) y2=(format!("{y2:.1}")) {}
                    }
                }
                @for (row, group) in groups.iter().enumerate() {
                    @for &member in group.members.iter().flatten() {
                        @let Behaviour { campaign, place, .. } = &all[member];
                        @let [x, y] = places[member];
                        a href={ "#row-" (row + 1) } aria-label={ "Behaviour " (place + 1) " of " (compared[*campaign].record.id) } {
                            title { "Behaviour " (place + 1) " of " (compared[*campaign].record.id) @if let Some(class) = &all[member].class { ": " (class.shown()) } }
                            circle class={ "line-" (campaign) } cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="8" {}
                            text x=(format!("{:.1}", if x > MAP - 40.0 { x - 12.0 } else { x + 12.0 })) y=(format!("{:.1}", y + 5.0))
                                text-anchor=[(x > MAP - 40.0).then_some("end")] { (place + 1) }
                        }
                    }
                }
            }
            figcaption.reason {
                "Each ring is the medoid of a behaviour, with its number, in the colour and dashes of its campaign's line. The axes are the two along "
                "which these medoids differ most, and have " (format!("{:.0} %", 100.0 * shares)) " of their variance. Lines join behaviours that count as the same. "
                "A click on a ring leads to its row."
            }
        }
    }
}

/// The places on the map of behaviours of one space, and the share of the variance that the two axes have. `None` if there are
/// fewer than two behaviours, or if their vectors have different lengths.
fn placed(all: &[Behaviour]) -> Option<(Vec<[f64; 2]>, f64)> {
    let mut behaviours = Behaviours::new(all.first()?.at.len());
    for behaviour in all {
        behaviours.push(&behaviour.at).ok()?;
    }
    let projection = principal_axes(&behaviours, &Interrupt::default()).ok()?;
    let places = point_map::places(&projection.points, MAP);
    (all.len() > 1).then(|| (places, projection.shares.iter().sum()))
}

/// The table of groups, with a row for each group and a column for each campaign.
fn rows(
    compared: &[Compared],
    all: &[Behaviour],
    groups: &[Group],
    is_by_distance: bool,
    with: usize,
) -> Markup {
    let table = html! {
        table.taxonomies {
            thead { tr {
                th scope="col" { "Found in" }
                @for Compared { record, shown } in compared { th scope="col" { (record.id) @if shown.is_none() { p.reason { "It has no taxonomy yet." } } } }
            } }
            tbody {
                @for (place, group) in groups.iter().enumerate() {
                    tr id={ "row-" (place + 1) } {
                        th scope="row" { (found_in(compared, all, group, is_by_distance, with)) }
                        @for (campaign, members) in group.members.iter().enumerate() {
                            td { (pictures(&compared[campaign], all, members, is_by_distance)) }
                        }
                    }
                }
            }
        }
    };
    wide("Behaviours", &table)
}

/// Says which campaigns have a behaviour.
fn found_in(
    compared: &[Compared],
    all: &[Behaviour],
    group: &Group,
    is_by_distance: bool,
    with: usize,
) -> Markup {
    let campaigns = group.campaigns();
    let first = group.members.iter().flatten().next().map(|&member| &all[member]);
    let class = first.and_then(|first| first.class.as_ref());
    let touched = group.touches.map(|member| &all[member]);
    let alone = |first: &Behaviour| html! { strong { "only in " (compared[first.campaign].record.id) } };
    html! {
        @if is_by_distance {
            @match (campaigns, first) {
                (1, Some(first)) => {
                    (alone(first))
                    @if let Some(other) = touched {
                        p.reason { "touches behaviour " (other.place + 1) " of " (compared[other.campaign].record.id) ", which is nearer to another" }
                    }
                },
                _ => (in_so_many(campaigns, with)),
            }
        } @else if let Some(class) = class {
            strong { (class.shown()) }
            br;
            @match (campaigns, first) {
                (1, Some(first)) if with > 1 => { "only in " (compared[first.campaign].record.id) },
                _ => (in_so_many(campaigns, with)),
            }
        } @else {
            "no class"
        }
    }
}

fn in_so_many(campaigns: usize, with: usize) -> String {
    match (campaigns, with) {
        // If only one campaign has a taxonomy, there is nothing to compare.
        (_, 0 | 1) => String::new(),
        _ if campaigns == with => format!("all {with}"),
        _ => format!("{campaigns} of {with}"),
    }
}

fn pictures(
    Compared { record, shown }: &Compared,
    all: &[Behaviour],
    members: &[usize],
    is_by_distance: bool,
) -> Markup {
    html! {
        @if let Some(shown) = shown {
            @if members.is_empty() { span.reason { @if is_by_distance { "not found" } @else { "on none of its cards" } } }
            ul.found { @for &member in members { li { (brief(&Card { record, shown, place: all[member].place })) } } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use murmuration_model::ArchiveEmbedder;
    use murmuration_swarm::CheckpointDigest;

    fn by(name: &[u8], record: CampaignRecord) -> CampaignRecord {
        CampaignRecord {
            embedder: ArchiveEmbedder::Checkpoint(CheckpointDigest::of(name)),
            ..record
        }
    }

    #[test]
    fn embeddings_are_of_one_space_if_one_checkpoint_made_them() {
        let latent = || samples::record("model = \"two-sensor\"\nmethod = \"latent\"\nspace = \"embedding\"");
        let (one, other) = (by(b"one", latent()), by(b"other", latent()));
        assert!(share_a_space(&one, &by(b"one", latent())));
        assert!(!share_a_space(&one, &other));
        let both = by(
            b"one",
            samples::record("model = \"two-sensor\"\nmethod = \"latent\""),
        );
        assert!(!share_a_space(&one, &both) && !share_a_space(&both, &both));
        assert!(
            space_in_words(&both).contains(" and the features of two-sensor"),
            "{}",
            space_in_words(&both)
        );
    }

    #[test]
    fn features_are_of_one_space_for_the_same_robots_in_a_world_of_the_same_size() {
        let of = |text: &str| samples::record(&format!("method = \"hand-crafted\"\n{text}"));
        let one = of("model = \"two-sensor\"\nseed = 1");
        let random = samples::record("model = \"two-sensor\"\nmethod = \"random\"\nseed = 2");
        assert!(share_a_space(&one, &random));
        assert!(!share_a_space(&one, &of("model = \"single-sensor\"")));
        assert!(!share_a_space(
            &one,
            &of("model = \"two-sensor\"\n[world]\nwidth = 123")
        ));
    }
}
