//! The atlas as CSV, and the description of its columns.

use super::{Atlas, Tally};
use csv::Writer;
use murmuration_swarm::{Enumeration, FEATURE_NAMES, Pattern, Verdict};
use std::io::{self, Write};

/// One row per simulated controller, by index.
pub(super) fn write(atlas: &Atlas, tallies: &[Tally], file: &mut dyn Write) -> io::Result<()> {
    let mut table = Writer::from_writer(file);
    let head = ["index".to_owned()]
        .into_iter()
        .chain(atlas.spec.model().gene_names());
    let head = head.chain(["seed", "class", "share", "sureness"].map(str::to_owned));
    let head = head.chain(verdicts(atlas).map(|verdict| format!("share_{verdict}")));
    let head = head
        .chain(FEATURE_NAMES.map(str::to_owned))
        .chain(["heuristic_score".to_owned()]);
    table.write_record(head)?;
    for (index, (entry, tally)) in atlas.entries.iter().zip(tallies).enumerate() {
        let share = |verdict: Verdict| {
            let of_it = entry.verdicts.iter().filter(|given| **given == verdict).count();
            of_it as f64 / entry.verdicts.len().max(1) as f64
        };
        let row = [index.to_string()]
            .into_iter()
            .chain(entry.controller.genes().iter().map(f64::to_string));
        let row = row.chain([
            entry.seed.to_string(),
            tally.class.to_string(),
            tally.share.to_string(),
            tally.sureness().to_string(),
        ]);
        let row = row.chain(verdicts(atlas).map(|verdict| share(verdict).to_string()));
        let row = row
            .chain(entry.features.iter().map(f64::to_string))
            .chain([entry.score.to_string()]);
        table.write_record(row)?;
    }
    table.flush()
}

/// The verdicts that the judge can give.
fn verdicts(atlas: &Atlas) -> impl Iterator<Item = Verdict> {
    let several = atlas.spec.model().species().len() > 1;
    Verdict::all()
        .filter(move |verdict| several || !verdict.pattern().is_some_and(Pattern::is_of_two_species))
}

pub(super) fn readme(atlas: &Atlas) -> String {
    let spec = &atlas.spec;
    let mirrored = Enumeration::of(spec.controllers(), spec.world())
        .zip(atlas.entries.first())
        .is_some_and(|(all, first)| all.mirrored(&first.controller).is_some());
    let images = if mirrored {
        "A controller and its mirror image (left and right wheels exchanged) show each behaviour equally often over random starts, so \
         only the first of the two in the order of the genes was simulated and has a row."
    } else {
        "Each controller that was evaluated has a row."
    };
    format!(
        "# Atlas of the robot {model}

Campaign `{campaign}`, archive digest `{digest}`: {controllers} controllers, {starts} trials of each.

- `atlas.csv`: the data, below.
- `atlas.png`: a pixel a controller, where all controllers of four speeds were evaluated. Tiles are the speeds while nothing is seen \
(the first to the right, the second up), pixels in a tile the speeds while something is seen. Colours are classes, the \
brightness is how sure the class is (column `sureness`).
- `spec.toml`: the campaign file.
- `atlas-poster.svg`, `atlas-poster.png`: the same with axes and a legend.
- `atlas.html`: the same to zoom into. It needs no network. The folder `pictures`, if it is there, has the picture of each swarm.

{images} `murmuration lab atlas spec.toml` evaluates the same again.

| column of `atlas.csv` | |
|---|---|
| `index` | place in the campaign's archive, from 0 |
| {genes} | the genes of the controller |
| `seed` | seed of the first start, from which those of the others follow |
| `class` | the class that the judge gave most trials; of several, that of the earliest trial |
| `share` | share of the trials that are of this class |
| `sureness` | how sure the class is, from 0 to 1: `share`, times the share of motions of this class, by the judge, that annotators called \
by it too (on the labelled sets, whose annotators are each a vision model with a written brief; \
one agreement and one disagreement are added to the counts, since some classes were seldom met) |
| `share_CLASS` | share of the trials that are of each class; `share_random` is of random ones without a pattern |
| `share_small_clusters`, `share_chain`, `share_moving_clumps` | share of the trials that are random with this pattern |
| {features} | hand-crafted features, means over the trials and the last 100 steps |
| `heuristic_score` | score of the paper's filter, which keeps controllers of 4 and more |
",
        model = spec.model(),
        campaign = atlas.campaign,
        digest = atlas.digest,
        controllers = atlas.entries.len(),
        starts = spec.starts().get(),
        genes = quoted(&spec.model().gene_names()),
        features = quoted(&FEATURE_NAMES.map(str::to_owned)),
    )
}

fn quoted(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    quoted.join(", ")
}
