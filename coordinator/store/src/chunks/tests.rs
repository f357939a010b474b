//! Tests that chunks give back what was written, and that damaged chunks are named.

use super::*;
use crate::{
    ArchivedIndividual, CheckpointRecord, DataDirectory, GenerationRecord, Provenance, Store, Switch, Trial,
    digest::{ArchiveHasher, digest},
    individual::compressed,
    numbers::{floats_to_blob, numbers_to_blob},
    schema,
};
use murmuration_model::{CampaignId, Weight};
use murmuration_swarm::{CampaignSpec, Verdict};
use proptest::prelude::*;

/// Changes the value of one individual in a column of a database's only campaign.
pub(crate) fn edit(connection: &Connection, column: &str, place: i64, change: impl FnOnce(&mut Vec<u8>)) {
    let (table, ends) = match column {
        "images" => ("image_chunks", "ends"),
        "embeddings" => ("embedding_chunks", "x''"),
        _ => ("individual_chunks", "x''"),
    };
    let select = format!(
        "SELECT rowid, first, individuals, {ends}, {column} FROM {table} WHERE ?1 BETWEEN first AND first + individuals - 1"
    );
    let (row, first, individuals, ends, column_value): (i64, i64, u32, Vec<u8>, Vec<u8>) = connection
        .query_row(&select, [place], |row| row.try_into())
        .unwrap();
    let mut ends = ends_in(&ends);
    if ends.is_empty() {
        ends = (1..=individuals as usize)
            .map(|end| end * column_value.len() / individuals as usize)
            .collect();
    }
    let starts = std::iter::once(0).chain(ends.iter().copied());
    let mut values: Vec<_> = starts
        .zip(&ends)
        .map(|(start, &end)| column_value[start..end].to_vec())
        .collect();
    change(&mut values[(place - first) as usize]);
    let update = format!("UPDATE {table} SET {column} = ?2 WHERE rowid = ?1");
    connection
        .execute(&update, params![row, values.concat()])
        .unwrap();
    if table == "image_chunks" {
        let ends = values.iter().scan(0, |end, value| {
            *end += value.len() as u32;
            Some(end.to_le_bytes())
        });
        let update = "UPDATE image_chunks SET ends = ?2 WHERE rowid = ?1";
        connection
            .execute(update, params![row, ends.collect::<Vec<_>>().concat()])
            .unwrap();
    }
}

/// Values that each individual of a campaign has.
#[derive(Debug, Clone, Copy)]
struct Kind {
    starts: usize,
    images: bool,
    dimensions: usize,
    judge: bool,
}

fn individual(kind: Kind, index: u64, generation: u32) -> ArchivedIndividual {
    let trial = |start: usize| Trial {
        features: [index as f64, start as f64, -0.0, 1e-300, 0.5],
        embedding: vec![index as f32 - start as f32; kind.dimensions],
        image: kind
            .images
            .then(|| (0..64).map(|pixel| (pixel * (index + 1) % 251) as u8).collect()),
        verdict: Verdict::try_from(1 + (index % 11) as i32)
            .ok()
            .filter(|_| kind.judge),
    };
    ArchivedIndividual {
        seed: u64::MAX - index,
        novelty: index as f64 / 3.0,
        trials: (0..kind.starts).map(trial).collect(),
        ..ArchivedIndividual::still(index, generation)
    }
}

/// A store with a campaign that a checkpoint embeds, and with generations of these sizes.
fn store(kind: Kind, generations: &[u64]) -> (tempfile::TempDir, Store, CampaignId, Vec<ArchivedIndividual>) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let checkpoint = CheckpointRecord::of(b"one");
    store.add_checkpoint(&checkpoint).unwrap();
    let spec = format!(
        "model = \"single-sensor\"\nmethod = \"latent\"\ncheckpoint = \"{}\"\n[image]\nresolution = 8\n\
         [evaluation]\nstarts = {}\njudge = {}",
        checkpoint.digest, kind.starts, kind.judge
    );
    let spec = CampaignSpec::from_toml(&spec).unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 0).unwrap();
    store
        .switch(
            &id,
            &Switch {
                novelty: Vec::new(),
                generations: Vec::new(),
            },
        )
        .unwrap();
    let mut all = Vec::new();
    for (generation, size) in (0..).zip(generations) {
        let first = all.len() as u64;
        let new: Vec<_> = (first..first + size)
            .map(|index| individual(kind, index, generation))
            .collect();
        let record = GenerationRecord::of(generation, &[0.1], 0);
        store
            .commit_generation(&id, &record, &new, &Provenance::default())
            .unwrap();
        all.extend(new);
    }
    (folder, store, id, all)
}

fn read(store: &Store, id: &CampaignId, range: Range<u64>) -> Result<Vec<ArchivedIndividual>, StoreError> {
    store.individuals(id, &murmuration_swarm::Preset::SingleSensor.into(), range, true)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn individuals_come_out_of_their_chunks_as_they_went_in(
        kind in (1..4_usize, any::<bool>(), 0..3_usize, any::<bool>())
            .prop_map(|(starts, images, dimensions, judge)| Kind { starts, images, dimensions, judge }),
        sizes in prop::collection::vec(1..=600_u64, 1..3),
        place in any::<prop::sample::Index>(),
    ) {
        let (_folder, store, id, all) = store(kind, &sizes);
        prop_assert!(read(&store, &id, 0..u64::MAX).unwrap() == all);
        prop_assert_eq!(store.archive_len(&id).unwrap(), all.len() as u64);
        let place = place.index(all.len());
        prop_assert_eq!(&read(&store, &id, place as u64..place as u64 + 1).unwrap()[0], &all[place]);
        let chunks: i64 = store.read(|c| Ok(c.query_row("SELECT count(*) FROM individual_chunks", [], |row| row.get(0))?)).unwrap();
        prop_assert_eq!(chunks as u64, sizes.iter().map(|size| size.div_ceil(MOST as u64)).sum::<u64>());
    }
}

const WHOLE: Kind = Kind {
    starts: 2,
    images: true,
    dimensions: 3,
    judge: true,
};

#[test]
fn large_pictures_are_in_chunks_of_fewer_individuals() {
    let connection = Connection::open_in_memory().unwrap();
    connection
        .execute_batch("CREATE TABLE image_chunks (campaign, first, individuals, ends, images)")
        .unwrap();
    let transaction = connection.unchecked_transaction().unwrap();
    let mut writer = IMAGES.writer(&transaction).unwrap();
    for (place, size) in [
        (0, BYTES / 2),
        (1, BYTES / 2),
        (2, 1),
        (3, 2 * BYTES),
        (4, 0),
        (5, BYTES),
    ] {
        writer.add(1, None, place, &[vec![7; size]]).unwrap();
    }
    writer.finish().unwrap();
    let mut chunks = transaction
        .prepare("SELECT first, individuals, length(images) FROM image_chunks")
        .unwrap();
    let chunks = chunks.query_map([], |row| row.try_into()).unwrap();
    let chunks: Vec<(i64, i64, u32)> = chunks.collect::<Result<_, _>>().unwrap();
    assert_eq!(
        chunks,
        [
            (0, 2, BYTES as u32),
            (2, 1, 1),
            (3, 1, 2 * BYTES as u32),
            (4, 2, BYTES as u32)
        ]
    );
    let mut reader = IMAGES.reader(&transaction, 1, "TRUE").unwrap();
    assert_eq!(reader.at(1).unwrap().unwrap().value(0).len(), BYTES / 2);
    assert_eq!(reader.at(4).unwrap().unwrap().value(0), [0; 0]);
}

#[test]
fn a_chunk_whose_lengths_do_not_fit_is_named() {
    for (change, expected) in [
        (
            "individual_chunks SET individuals = 1000000000000",
            "individuals 3 to 1000000000002: a wrong number",
        ),
        (
            "individual_chunks SET individuals = 257",
            "individuals 3 to 259: a wrong number",
        ),
        ("individual_chunks SET individuals = 2", "individual 3: "),
        ("individual_chunks SET individuals = 1", "individual 3: "),
        ("individual_chunks SET individuals = 6", "individual 3: "),
        (
            "individual_chunks SET generation = -1",
            "individual 3: its generation",
        ),
        (
            "individual_chunks SET seeds = x'00'",
            "individuals 3 to 5: values whose lengths",
        ),
        (
            "individual_chunks SET seeds = zeroblob(27)",
            "individual 3: its seed",
        ),
        ("individual_chunks SET controllers = x''", "individual 3: "),
        (
            "individual_chunks SET features = zeroblob(30)",
            "individual 3: not five features",
        ),
        (
            "individual_chunks SET novelty = zeroblob(30)",
            "individual 3: its novelty",
        ),
        (
            "individual_chunks SET novelty = CAST(substr(novelty, 1, 16) || x'ffffffffffffffff' AS BLOB)",
            "individual 5: its novelty",
        ),
        (
            "individual_chunks SET verdicts = zeroblob(9)",
            "individual 3: its features and verdicts",
        ),
        (
            "image_chunks SET ends = x''",
            "individuals 3 to 5: values whose lengths",
        ),
        (
            "image_chunks SET ends = x'ffffffffffffffffffffffff'",
            "individuals 3 to 5: values whose lengths",
        ),
        (
            "image_chunks SET ends = x'ffffffff'",
            "individuals 3 to 5: values whose lengths",
        ),
        (
            "image_chunks SET ends = CAST(x'ffffff7f' || substr(ends, 5) AS BLOB)",
            "individuals 3 to 5: values whose lengths",
        ),
        (
            "image_chunks SET ends = CAST(x'00000000' || substr(ends, 5) AS BLOB)",
            "individual 3: its picture is",
        ),
        (
            "image_chunks SET images = substr(images, 2)",
            "individuals 3 to 5: values whose lengths",
        ),
        (
            "embedding_chunks SET embeddings = zeroblob(70)",
            "individuals 3 to 5: values whose lengths",
        ),
        (
            "embedding_chunks SET embeddings = zeroblob(60)",
            "individual 3: its features and embeddings",
        ),
    ] {
        let (_folder, store, id, all) = store(WHOLE, &[3, 3]);
        let update = format!("UPDATE {change} WHERE first = 3");
        store
            .write(|transaction| Ok(transaction.execute_batch(&update)?))
            .unwrap();
        assert_eq!(read(&store, &id, 0..3).unwrap(), all[..3]);
        let error = read(&store, &id, 0..6).unwrap_err();
        assert!(matches!(error, StoreError::Damaged { .. }), "{change}: {error}");
        assert!(
            error.reason().starts_with(expected),
            "{change}: {}",
            error.reason()
        );
    }
}

#[test]
fn a_gap_between_chunks_is_skipped_and_an_overlap_is_found() {
    let (_folder, store, id, all) = store(WHOLE, &[3, 3, 3]);
    let change = |statements: &str| store.write(|transaction| Ok(transaction.execute_batch(statements)?));
    assert_eq!(store.overlap(&id).unwrap(), None);
    let again = "INSERT INTO image_chunks SELECT campaign, 2, individuals, ends, images FROM image_chunks WHERE first = 3";
    let refused = change(again).unwrap_err().to_string();
    assert!(
        refused.contains("there are pictures of such individuals already"),
        "{refused}"
    );
    change(&format!("DROP TRIGGER image_chunks_overlap; {again}")).unwrap();
    assert_eq!(store.overlap(&id).unwrap(), Some((2, "image_chunks")));
    change("DELETE FROM individual_chunks WHERE first = 3").unwrap();
    assert_eq!(
        read(&store, &id, 1..8).unwrap(),
        [&all[1..3], &all[6..8]].concat()
    );
    assert_eq!(read(&store, &id, 3..6).unwrap(), []);
}

/// Adds individuals to the first campaign of a database of version 4. The second checkpoint has embedded the first 350.
fn insert_rows(connection: &Connection, individuals: &[ArchivedIndividual]) {
    for (one, image) in individuals.iter().zip(compressed(individuals).unwrap()) {
        let (place, (features, embeddings)) = (clamped(one.index), one.columns());
        let genes = floats_to_blob(one.controller.genes());
        connection
            .execute(
                "INSERT INTO individuals VALUES (1, ?1, ?2, ?3, ?4, ?5, ?6, ?7)",
                params![
                    place,
                    one.generation,
                    genes,
                    one.seed.cast_signed(),
                    features,
                    one.novelty,
                    one.verdict_column()
                ],
            )
            .unwrap();
        connection
            .execute(
                "INSERT INTO images (campaign, place, image) VALUES (1, ?1, ?2)",
                params![place, image],
            )
            .unwrap();
        let insert = "INSERT INTO embeddings VALUES (1, ?1, ?2, ?3)";
        connection.execute(insert, params![1, place, embeddings]).unwrap();
        if place < 350 {
            let next = numbers_to_blob(&[place as f32, 0.0, 2.0, -0.5]);
            connection.execute(insert, params![2, place, next]).unwrap();
        }
    }
}

#[test]
fn an_archive_of_version_4_keeps_every_bit_in_the_middle_of_a_move() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(Store::FILE);
    let mut connection = Connection::open(&path).unwrap();
    schema::create_older(&mut connection, 4);
    let checkpoint = |digest: &str| {
        format!(
            "INSERT INTO checkpoints (digest, size, parent, data_digest, label_digest, configuration, metrics, created_ms)
             VALUES ('{}', 1, '', '', '', '', '{{}}', 5);",
            digest.repeat(64)
        )
    };
    let spec = "model = \"single-sensor\"\nmethod = \"random\"\n[image]\nresolution = 8\n[evaluation]\nstarts = 2\njudge = true";
    let spec = CampaignSpec::from_toml(spec).unwrap();
    let rows = format!(
        "BEGIN; {} {} INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms, checkpoint, next_checkpoint)
         VALUES (1, 'old-1', '{}', '1', 'running', '', 5, 1, 2)",
        checkpoint("a"),
        checkpoint("b"),
        spec.to_toml()
    );
    connection.execute_batch(&rows).unwrap();
    let all: Vec<_> = (0..600)
        .map(|index| individual(WHOLE, index, (index / 300) as u32))
        .collect();
    insert_rows(&connection, &all);
    connection.execute_batch("COMMIT").unwrap();
    drop(connection);

    let id: CampaignId = "old-1".parse().unwrap();
    let mut expected = ArchiveHasher::default();
    all.iter().for_each(|one| expected.add(one));
    let check = |store: &Store| {
        assert!(read(store, &id, 0..u64::MAX).unwrap() == all);
        assert_eq!(store.campaign("old-1").unwrap().embedder.embedded(), 350);
        let next = (0..350).map(|place| vec![(place as f32 + 2.0) / 2.0, -0.25]);
        assert_eq!(store.next_embeddings(&id, 2).unwrap(), next.collect::<Vec<_>>());
        let found = digest(
            store,
            &id,
            spec.model(),
            &murmuration_search::interrupt::Interrupt::default(),
        );
        assert_eq!(found.unwrap().digest, expected.digest());
    };
    // Looking migrates a copy, and opening the database migrates the database itself.
    let (copy, version) = Store::look(folder.path(), true).unwrap();
    check(&copy);
    assert_eq!(version, 4);
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    check(&store);
    assert_eq!(
        (store.faults().unwrap(), store.dangling().unwrap()),
        (Vec::new(), Vec::new())
    );
    let generations = "SELECT count(*) FROM individual_chunks WHERE first / 300 = generation";
    let chunks =
        store.read(|connection| Ok(connection.query_row(generations, [], |row| row.get::<_, i64>(0))?));
    assert_eq!(chunks.unwrap(), 4);
}
