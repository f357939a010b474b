//! The table of individuals as CSV.

use csv::Writer;
use murmuration_model::{
    labels::ClassName,
    tables::{behaviour_cells, behaviour_columns},
};
use murmuration_store::ArchivedIndividual;
use murmuration_swarm::CampaignSpec;
use std::{
    io::{self, Write},
    mem,
};

/// The table of an archive's individuals, with a header. Its numbers can be read again exactly, and spreadsheets can open its
/// classes. Its columns have the same names as those of `archive.csv` in a report.
pub struct IndividualTable<W: Write> {
    table: Writer<W>,
    genes: Vec<String>,
    has_header: bool,
}

impl<W: Write> IndividualTable<W> {
    /// A table that is written to `target`.
    pub fn new(target: W, spec: &CampaignSpec) -> Self {
        Self {
            table: Writer::from_writer(target),
            genes: spec.model().gene_names(),
            has_header: false,
        }
    }

    /// Adds an individual with the place of its cluster, from 0, and its class; either can be missing.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(
        &mut self,
        individual: &ArchivedIndividual,
        cluster: Option<u32>,
        class: Option<&ClassName>,
    ) -> io::Result<()> {
        let embedding = individual.embedding();
        self.add_header(embedding.len())?;
        let known = [
            individual.index.to_string(),
            cluster
                .map(|cluster| (cluster + 1).to_string())
                .unwrap_or_default(),
            individual.generation.to_string(),
            individual.seed.to_string(),
            individual.novelty.to_string(),
        ];
        let features = individual.features();
        let behaviour = behaviour_cells(&features, individual.controller.genes(), &embedding, class);
        self.table.write_record(known.into_iter().chain(behaviour))?;
        Ok(())
    }

    /// Adds the header, unless the table has its header already.
    fn add_header(&mut self, dimensions: usize) -> io::Result<()> {
        if mem::replace(&mut self.has_header, true) {
            return Ok(());
        }
        let known = ["index", "cluster", "generation", "seed", "novelty_when_evaluated"];
        let known = known.into_iter().map(str::to_owned);
        let header = known.chain(behaviour_columns(&self.genes, dimensions));
        self.table.write_record(header)?;
        Ok(())
    }

    /// Writes the rest of the table, and returns the writer. A table without individuals has a header without columns of
    /// embeddings, because their number is not known.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> io::Result<W> {
        self.add_header(0)?;
        let target = self.table.into_inner();
        target.map_err(|error| io::Error::other(error.to_string()))
    }
}

impl IndividualTable<Vec<u8>> {
    /// Takes the bytes that were written since the last call.
    ///
    /// # Errors
    /// Never: writing to memory cannot fail.
    pub fn take_written(&mut self) -> io::Result<Vec<u8>> {
        self.table.flush()?;
        let written = mem::replace(&mut self.table, Writer::from_writer(Vec::new())).into_inner();
        written.map_err(|error| io::Error::other(error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{Controller, Preset};

    #[test]
    fn a_table_without_individuals_has_a_header() {
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let table = IndividualTable::new(Vec::new(), &spec).finish().unwrap();
        let text = String::from_utf8(table).unwrap();
        assert!(
            text.starts_with("index,cluster,") && text.ends_with(",class\n"),
            "{text}"
        );
        assert_eq!(text.lines().count(), 1);
    }

    #[test]
    fn a_table_that_is_taken_in_parts_is_the_whole_table() {
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let members: Vec<_> = (0..5)
            .map(|index| {
                let controller = Controller::new(Preset::SingleSensor, &[0.0; 4]).unwrap();
                ArchivedIndividual::unmeasured(index, 0, controller)
            })
            .collect();
        let class: ClassName = "=ring()".parse().unwrap();
        let mut whole = IndividualTable::new(Vec::new(), &spec);
        let mut in_parts = IndividualTable::new(Vec::new(), &spec);
        let mut parts = Vec::new();
        for member in &members {
            let cluster = (member.index > 1).then_some(3);
            let class = (member.index == 4).then_some(&class);
            whole.add(member, cluster, class).unwrap();
            in_parts.add(member, cluster, class).unwrap();
            parts.extend(in_parts.take_written().unwrap());
        }
        let whole = whole.finish().unwrap();
        assert_eq!(parts, whole);
        let text = String::from_utf8(whole).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 6);
        assert!(lines[0].starts_with("index,cluster,generation,seed,"), "{text}");
        assert!(lines[1].starts_with("0,,0,"), "{text}");
        assert!(
            lines[5].starts_with("4,4,0,") && lines[5].ends_with(",'=ring()"),
            "{text}"
        );
    }
}
