//! The page of two versions of a taxonomy side by side, with the changes of clusters and names.

use super::{map, versions};
use crate::asked::Query;
use crate::{
    archived,
    layout::{Part, campaign_page},
    of_campaign::OfCampaign,
    page_error::PageError,
    parts,
};
use maud::{Markup, html};
use murmuration_engine::{
    blocking::in_background,
    maps::Maps,
    space::SpaceError,
    taxonomy::{Change, ClusterName, Names, Origin},
};
use murmuration_model::{CampaignRecord, colours};
use murmuration_report::point_map;
use murmuration_service::OrStatus as _;
use murmuration_store::{Store, StoredTaxonomy, TaxonomyVersion};
use murmuration_swarm::{counted, grouped, rounded};
use serde::Deserialize;

/// Side of a map in the units of its drawing.
const MAP: f64 = 480.0;
/// Margin above and below the content of a map.
const MARGIN: f64 = 40.0;

/// The requested versions; by default the newest version and the version before it.
#[derive(Debug, Deserialize)]
pub(crate) struct Asked {
    before: Option<u32>,
    after: Option<u32>,
}

/// One of the two compared versions.
struct Side {
    version: TaxonomyVersion,
    stored: StoredTaxonomy,
    /// Accuracy of the version's checkpoint on the held-out triplets, if known.
    accuracy: Option<f64>,
    /// Places of the version's medoids on its map, by place in the taxonomy; empty if the map is unknown.
    rings: Vec<[f64; 2]>,
    /// The highest and the lowest used row of the map.
    rows: [f64; 2],
}

/// Both compared versions, and the change between them.
struct Compared {
    versions: Vec<TaxonomyVersion>,
    before: Side,
    after: Side,
    change: Change,
    /// The names in the version before, and the names in the version after; both include inherited names.
    named: Names,
    names: Names,
}

pub(crate) async fn page(
    Query(asked): Query<Asked>,
    OfCampaign { web, record, visitor }: OfCampaign,
) -> Result<Markup, PageError> {
    let (store, maps, of) = (web.store.clone(), web.maps.clone(), record.clone());
    let compared = in_background(move |_| read(&store, &maps, &of, &asked))
        .await?
        .or_status()?;
    let content = html! {
        div.wide-bar {
            h1 { "Before and after" }
            a.button href={ "/campaigns/" (record.id) "/taxonomy" } { "Back to the taxonomy" }
        }
        @match &compared {
            None => p.empty {
                "There is nothing to compare yet: the taxonomy has only one version. A new version is made each time the campaign has "
                "learned from labels and continued its search."
            },
            Some(compared) => {
                (choices(compared))
                (summary(&record, compared))
                (maps_of(&record, compared))
                (clusters(&record, compared))
                (names(compared))
            }
        }
    };
    Ok(campaign_page(&record, Part::Taxonomy, &visitor, content))
}

/// Reads the requested versions; `None` if a version is missing, or if both versions are the same.
fn read(
    store: &Store,
    maps: &Maps,
    record: &CampaignRecord,
    asked: &Asked,
) -> Result<Option<Compared>, SpaceError> {
    let versions = store.taxonomy_versions(&record.id)?;
    let place = |asked: Option<u32>, otherwise: Option<usize>| match asked {
        Some(number) => versions.iter().position(|known| known.version == number),
        None => otherwise,
    };
    let last = versions.len().checked_sub(1);
    let after = place(asked.after, last);
    let before = place(asked.before, after.and_then(|after| after.checked_sub(1)));
    let (Some(before), Some(after)) = (before, after) else {
        return Ok(None);
    };
    let (from, to) = (before.min(after), before.max(after));
    if from == to {
        return Ok(None);
    }
    let (before, after) = (&versions[from], &versions[to]);
    let before = side(store, maps, record, before)?;
    let (Some(before), Some(after)) = (before, side(store, maps, record, after)?) else {
        return Ok(None);
    };
    let labels = store.labels(&record.id)?;
    let change = Change::between(&before.stored, &after.stored);
    let named = Names::read(store, &record.id, &versions[..=from], &labels)?;
    let medoids = &after.stored.medoids;
    let names = named.carried(before.version.version, &change, medoids, &labels.given_classes());
    Ok(Some(Compared {
        versions,
        before,
        after,
        change,
        named,
        names,
    }))
}

fn side(
    store: &Store,
    maps: &Maps,
    record: &CampaignRecord,
    version: &TaxonomyVersion,
) -> Result<Option<Side>, SpaceError> {
    let Some(stored) = store.taxonomy_of_version(&record.id, version.version)? else {
        return Ok(None);
    };
    let checkpoint = version
        .checkpoint
        .map(|digest| store.checkpoint(digest))
        .transpose()?;
    let accuracy = checkpoint.and_then(|known| known.lineage.metrics.get("triplet_accuracy").copied());
    let places = point_map::places(&map::points(store, maps, record, version)?, MAP);
    let rows = places.iter().map(|[_, y]| *y);
    let rows = rows.fold([MAP / 2.0; 2], |[first, last], y| [first.min(y), last.max(y)]);
    let ring = |medoid: &u64| places.get(usize::try_from(*medoid).ok()?).copied();
    Ok(Some(Side {
        rings: stored.medoids.iter().filter_map(ring).collect(),
        rows: [(rows[0] - MARGIN).max(0.0), (rows[1] + MARGIN).min(MAP)],
        version: version.clone(),
        stored,
        accuracy,
    }))
}

fn choices(compared: &Compared) -> Markup {
    let menu = |name: &str, chosen: &Side| {
        html! {
            select name=(name) {
                @for known in &compared.versions {
                    option value=(known.version) selected[*known == chosen.version] { "version " (known.version) ", " (versions::in_words(known)) }
                }
            }
        }
    };
    html! {
        @if compared.versions.len() > 2 {
            form.choices method="get" {
                label { "Before " (menu("before", &compared.before)) }
                label { "After " (menu("after", &compared.after)) }
                button.plain { "Compare" }
            }
        }
    }
}

/// A comparison of both versions as a whole.
fn summary(record: &CampaignRecord, compared: &Compared) -> Markup {
    let Compared {
        before,
        after,
        change,
        names,
        ..
    } = compared;
    let places = 0..after.stored.medoids.len();
    let fresh = places
        .clone()
        .filter(|&place| change.predecessors(place).is_empty())
        .count();
    let stayed = places.clone().filter(|&place| stays(compared, place)).count();
    let carried = names.names.iter().flatten();
    let carried = carried
        .filter(|name| matches!(name.origin, Origin::Carried { .. }))
        .count();
    let (gone, lost) = (change.gone().count(), names.uncarried.len());
    let was = |count: usize| if count == 1 { "was" } else { "were" };
    let sides = [before, after];
    html! {
        p.lead {
            "The taxonomy now has " (counted(places.len() as u64, "behaviour")) ": " (stayed) " with the same medoid as before, "
            (places.len() - stayed - fresh) " with another medoid, and " (fresh) " new. "
            (gone) " of the " (counted(before.stored.medoids.len() as u64, "behaviour")) " before " (if gone == 1 { "has" } else { "have" }) " disappeared. "
            (counted(carried as u64, "name")) " " (was(carried)) " carried over, " (lost) " " (was(lost)) " not."
        }
        div.wide tabindex="0" role="region" aria-label="Both versions" { table {
            thead { tr { td {} @for side in sides { th scope="col" { (versions::link(record, side.version.version)) } } } }
            tbody {
                (line("Made", sides.map(|side| html! {
                    @if let Some(made) = side.version.made_ms { (parts::moment(made)) } @else { "–" }
                })))
                (line("When", sides.map(|side| html! { (versions::in_words(&side.version)) })))
                (line("Checkpoint", sides.map(|side| html! {
                    @match side.version.checkpoint {
                        Some(digest) => code { (digest.to_string().chars().take(12).collect::<String>()) },
                        None => "none",
                    }
                })))
                (line("Accuracy on held-out triplets", sides.map(|side| html! {
                    @match side.accuracy { Some(share) => { (rounded(100.0 * share, 1)) " %" } None => "not known" }
                })))
                (line("Individuals", sides.map(|side| html! { (grouped(side.version.individuals)) })))
                (line("Behaviours", sides.map(|side| html! { (side.stored.medoids.len()) })))
            }
        } }
    }
}

fn line(title: &str, cells: [Markup; 2]) -> Markup {
    html! { tr { th scope="row" { (title) } @for cell in cells { td { (cell) } } } }
}

/// Whether the cluster at `place` has the medoid of its largest predecessor.
fn stays(compared: &Compared, place: usize) -> bool {
    let before = compared.change.predecessors(place).first().copied();
    before
        .is_some_and(|before| compared.before.stored.medoids[before] == compared.after.stored.medoids[place])
}

fn maps_of(record: &CampaignRecord, compared: &Compared) -> Markup {
    let Compared { before, after, .. } = compared;
    html! {
        section aria-labelledby="maps" {
            h2 #maps { "Maps" }
            p.reason {
                "Each map shows the individuals as the checkpoint of its version places them, on the two axes along which they differ "
                "most. A short axis is stretched to half of the other. The two maps have different axes. Rings are medoids, with the "
                "numbers of their behaviours. On the first map, each cluster has the colour of the cluster that it became; it is grey if "
                "its members are now spread over several."
            }
            div.maps {
                @for (side, title) in [(before, "Before"), (after, "After")] {
                    figure {
                        figcaption { (title) ": version " (side.version.version) ", " (versions::in_words(&side.version)) }
                        @if side.rings.is_empty() {
                            p.empty { "The map of this version is not known: the version was made before maps were kept, or was imported." }
                        } @else {
                            (map_of(record, side, after))
                        }
                    }
                }
            }
        }
    }
}

fn map_of(record: &CampaignRecord, side: &Side, after: &Side) -> Markup {
    let [top, bottom] = side.rows;
    let (version, last) = (side.version.version, after.version.version);
    let created = record.archive_version().origin();
    let source = format!(
        "/campaigns/{}/taxonomy/map.png?version={version}&after={last}&created={created}",
        record.id
    );
    html! {
        svg.version-map viewBox={ "0 " (format!("{top:.1}")) " " (MAP) " " (format!("{:.1}", bottom - top)) } role="img" aria-label={ "Map of version " (version) ", with " (counted(side.rings.len() as u64, "medoid")) } {
            image href=(source) width=(MAP) height=(MAP) {}
            @for (place, [x, y]) in side.rings.iter().enumerate() {
                circle cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="7" {}
                text x=(format!("{:.1}", if *x > MAP - 40.0 { x - 11.0 } else { x + 11.0 })) y=(format!("{:.1}", y + 6.0))
                    text-anchor=[(*x > MAP - 40.0).then_some("end")] { (place + 1) }
            }
        }
    }
}

fn clusters(record: &CampaignRecord, compared: &Compared) -> Markup {
    let Compared {
        before,
        after,
        change,
        ..
    } = compared;
    html! {
        section aria-labelledby="clusters" {
            h2 #clusters { "Behaviours" }
            ul.changes {
                @for (place, &medoid) in after.stored.medoids.iter().enumerate() {
                    @let from = change.predecessors(place);
                    li {
                        div.pictures {
                            @for &before_place in &from {
                                (picture(record, "Before", before_place, before.stored.medoids[before_place]))
                            }
                            @if from.is_empty() { div.none { "new" } }
                            span.arrow aria-hidden="true" { "→" }
                            (picture(record, "After", place, medoid))
                        }
                        div {
                            h3 { (swatch(colours::cluster(place))) "Behaviour " (place + 1) (name_of(&compared.names, place)) }
                            @if from.is_empty() { (fresh(change, place)) } @else { (carried_on(compared, place, &from)) }
                        }
                    }
                }
                @for gone in change.gone() {
                    li {
                        div.pictures {
                            (picture(record, "Before", gone, before.stored.medoids[gone]))
                            span.arrow aria-hidden="true" { "→" }
                            div.none { "gone" }
                        }
                        div {
                            h3 { (swatch(colours::LINE)) "Behaviour " (gone + 1) " before" (name_of(&compared.named, gone)) }
                            p { "Gone: no cluster has most of its " (counted(change.size_before(gone), "individual")) " now." }
                            @if let Some(most_in) = change.largest_part(gone) {
                                p.reason { "The largest part, " (grouped(change.shared(gone, most_in))) ", is now in behaviour " (most_in + 1) "." }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn swatch(colour: colours::Rgb) -> Markup {
    html! { svg.swatch viewBox="0 0 12 12" width="12" height="12" aria-hidden="true" { circle cx="6" cy="6" r="6" fill=(colours::hex(colour)) {} } " " }
}

fn name_of(names: &Names, place: usize) -> Markup {
    let name: Option<&ClusterName> = names.names.get(place).and_then(Option::as_ref);
    html! { @if let Some(name) = name { " · " (name.class.shown()) } }
}

fn picture(record: &CampaignRecord, when: &str, place: usize, medoid: u64) -> Markup {
    html! {
        figure {
            img src=(archived::picture(record, medoid)) width="100" height="100" loading="lazy"
                alt={ (when) ": picture of behaviour " (place + 1) };
            figcaption { (when) ": " (place + 1) }
        }
    }
}

/// The predecessors of a cluster, with the number of individuals that it has from each predecessor.
fn carried_on(compared: &Compared, place: usize, from: &[usize]) -> Markup {
    let Compared {
        before,
        after,
        change,
        ..
    } = compared;
    html! {
        @for &old in from {
            p {
                "Behaviour " (old + 1) " before: " (grouped(change.shared(old, place))) " of its "
                (counted(change.size_before(old), "individual")) " are in this cluster now."
                @if before.stored.medoids[old] == after.stored.medoids[place] { " The medoid is still the same individual." }
                @else {
                    " The medoid moved from individual " (grouped(before.stored.medoids[old])) " to "
                    (grouped(after.stored.medoids[place])) "."
                }
            }
        }
        p.reason {
            "The cluster has " (counted(change.size_after(place), "individual"))
            @if change.new_in(place) > 0 { ", " (grouped(change.new_in(place))) " of them found since then" }
            "."
        }
    }
}

/// The origins of a new cluster's members.
fn fresh(change: &Change, place: usize) -> Markup {
    html! {
        p { "New: no earlier cluster has most of its individuals here." }
        p.reason {
            "Of its " (counted(change.size_after(place), "individual")) ", "
            @for before in change.sources(place).into_iter().take(3) {
                (grouped(change.shared(before, place))) " were in behaviour " (before + 1) ", "
            }
            (grouped(change.new_in(place))) " were found since then."
        }
    }
}

fn names(compared: &Compared) -> Markup {
    let carried = compared.names.names.iter().enumerate();
    let carried: Vec<_> = carried
        .filter_map(|(place, name)| match name {
            Some(ClusterName {
                class,
                origin: Origin::Carried { place: from, .. },
            }) => Some((class, *from, place)),
            _ => None,
        })
        .collect();
    let lost = &compared.names.uncarried;
    html! {
        section aria-labelledby="names" {
            h2 #names { "Names" }
            @if carried.is_empty() && lost.is_empty() {
                p.reason { "No name needed to be carried over to another behaviour." }
            } @else {
                p.reason {
                    "A name is carried over to the cluster that has more than half of the members of the cluster that it named. If two names "
                    "are carried over to one cluster, it keeps the name that more of its members had. Save the name on the page Taxonomy to make it a label."
                }
                ul.plain-list {
                    @for (class, from, to) in &carried {
                        li { strong { (class.shown()) } ", the name of behaviour " (from + 1) " before, is now the name of behaviour " (to + 1) "." }
                    }
                    @for lost in lost { li { (versions::why_not(lost)) } }
                }
            }
        }
    }
}
