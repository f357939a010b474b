//! Phase diagrams: the shares of classes over one or two axes of numbers.

use crate::{
    figure::{Figure, Measure},
    outcome::Outcome,
    study::Axis,
};
use murmuration_swarm::Class;
use std::collections::BTreeMap;

/// The shares of classes over the axes of the diagram, for one value of each other axis.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseDiagram<'a> {
    /// The values of the other axes, such as `filter = none`; empty without other axes.
    pub of: Vec<String>,
    /// The axis from left to right.
    pub x: &'a Axis,
    /// The axis from bottom to top; `None` if the diagram has one axis.
    pub y: Option<&'a Axis>,
    /// The cells from left to right, for each value of `y`. A cell has the mean share of each class over the replicates, percent,
    /// and is empty before it is measured.
    cells: Vec<BTreeMap<Class, f64>>,
}

impl PhaseDiagram<'_> {
    /// The rows of cells, beginning with the first value of `y`.
    pub fn rows(&self) -> impl Iterator<Item = &[BTreeMap<Class, f64>]> {
        self.cells.chunks(self.x.values.len().max(1))
    }

    /// The share of a class in each cell, row after row, percent; `None` for cells that are not measured yet.
    pub fn shares(&self, class: Class) -> Vec<Option<f64>> {
        let share = |cell: &BTreeMap<Class, f64>| cell.get(&class).copied();
        self.cells.iter().map(share).collect()
    }

    /// The classes with at least `percent` of the trials of some cell, the largest share first.
    pub fn classes(&self, percent: f64) -> Vec<Class> {
        let most = |class: Class| {
            let shares = self.shares(class).into_iter().flatten();
            (class, shares.fold(0.0, f64::max))
        };
        let mut classes: Vec<(Class, f64)> = Class::ALL.map(most).to_vec();
        classes.retain(|(_, share)| *share >= percent);
        classes.sort_by(|(_, one), (_, other)| other.total_cmp(one));
        classes.into_iter().map(|(class, _)| class).collect()
    }
}

impl Outcome {
    /// The phase diagrams of the study, one for each combination of the values of its other axes; empty if the study file has no
    /// `[phase]`.
    pub(crate) fn phase_diagrams(&self) -> Vec<PhaseDiagram<'_>> {
        let Some(phase) = self.study().phase else {
            return Vec::new();
        };
        let axes = &self.study().axes;
        let table = self
            .tables()
            .iter()
            .find(|table| table.measure == Measure::Shares);
        let rows = table.map(|table| table.rows.as_slice()).unwrap_or_default();
        let is_of_diagram = |axis: usize| axis == phase.x || Some(axis) == phase.y;
        let others = |values: &[usize]| -> Vec<usize> {
            let others = values.iter().enumerate();
            others
                .filter(|(axis, _)| !is_of_diagram(*axis))
                .map(|(_, &value)| value)
                .collect()
        };
        let other_axes = || axes.iter().enumerate().filter(|(axis, _)| !is_of_diagram(*axis));
        let mut cells: BTreeMap<Vec<usize>, Vec<BTreeMap<Class, f64>>> = BTreeMap::new();
        let width = axes[phase.x].values.len();
        let height = phase.y.map_or(1, |y| axes[y].values.len());
        for row in rows {
            let place = row.values[phase.x] + width * phase.y.map_or(0, |y| row.values[y]);
            let of = cells.entry(others(&row.values));
            let of = of.or_insert_with(|| vec![BTreeMap::new(); width * height]);
            let shares = Class::ALL.into_iter().filter_map(|class| {
                let entry = row.entries.get(&Figure::Share(class))?;
                Some((class, entry.mean))
            });
            of[place] = shares.collect();
        }
        let named = |values: &[usize]| -> Vec<String> {
            let values = other_axes().zip(values);
            values
                .map(|((_, axis), &value)| format!("{} = {}", axis.name, axis.values[value]))
                .collect()
        };
        let diagram = |(others, cells): (Vec<usize>, _)| PhaseDiagram {
            of: named(&others),
            x: &axes[phase.x],
            y: phase.y.map(|y| &axes[y]),
            cells,
        };
        cells.into_iter().map(diagram).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Corrections, JudgedTrials, Study, sample};
    use murmuration_swarm::Verdict;
    use std::path::Path;

    fn study() -> Study {
        let text = "name = \"p\"\nmeasures = [\"shares\"]\nphase = { x = \"robots\", y = \"noise\" }\n\
                    axes = [\n\
                    { name = \"noise\", field = \"world.noise.slip\", numbers = [0, 0.5] },\n\
                    { name = \"filter\", values = [{ name = \"no\" }, { name = \"yes\", campaign.filter = true }] },\n\
                    { name = \"robots\", field = \"world.agents\", numbers = [6, 12, 24] }]\n\
                    [campaign]\nmodel = \"single-sensor\"\nmethod = \"random\"\nevaluation.judge = true";
        Study::from_toml(text, Path::new("/"), false).unwrap()
    }

    #[test]
    fn a_diagram_has_a_cell_for_each_pair_of_numbers_and_other_axes_make_diagrams() {
        let study = study();
        let measured = |place: usize| {
            let milling = Verdict::Class(Class::Milling);
            let random = Verdict::Class(Class::Random);
            // One of `place` + 1 trials mills.
            let trials = [milling].into_iter().chain(std::iter::repeat_n(random, place));
            let mut measured = sample::measured(&study, place, &[]);
            measured.behaviours = None;
            measured.shares = Some(JudgedTrials::from_iter(trials));
            Some(measured)
        };
        let mut all: Vec<_> = (0..12).map(measured).collect();
        all[11] = None;
        let outcome = Outcome::new(study.clone(), all, Corrections::default());
        let diagrams = outcome.phase_diagrams();
        let of: Vec<&[String]> = diagrams.iter().map(|diagram| diagram.of.as_slice()).collect();
        assert_eq!(of, [["filter = no"], ["filter = yes"]]);
        let milling = |diagram: &PhaseDiagram<'_>| diagram.shares(Class::Milling);
        let share = |place: usize| Some(100.0 / (place as f64 + 1.0));
        // The study's cells are in the order noise, filter, robots.
        assert_eq!(milling(&diagrams[0]), [0, 1, 2, 6, 7, 8].map(share));
        assert_eq!(
            milling(&diagrams[1]),
            [share(3), share(4), share(5), share(9), share(10), None]
        );
        assert_eq!(diagrams[0].rows().count(), 2);
        assert_eq!(diagrams[0].classes(5.0), [Class::Milling, Class::Random]);
    }
}
