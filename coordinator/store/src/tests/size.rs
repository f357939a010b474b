//! Bytes of an individual on disk.

use super::*;
use murmuration_swarm::{Purpose, RandomStream};
use rand::{RngExt as _, seq::IndexedRandom as _};

const INDIVIDUALS: u64 = 2000;

/// A picture of 24 robots that pass twelve pixels each, of any grey: as many pixels as in the mean picture of random controllers.
fn picture(index: u64) -> Vec<u8> {
    let mut stream = RandomStream::derive(1, Purpose::Start, index);
    let mut image = vec![0; 2500];
    for _ in 0..24 {
        let (mut place, step) = (
            stream.random_range(0..2500),
            *[1, 49, 50, 51].choose(&mut stream).unwrap(),
        );
        for _ in 0..12 {
            image[place] = stream.random_range(1..=255);
            place = (place + step) % 2500;
        }
    }
    image
}

#[test]
fn an_individual_of_a_latent_campaign_takes_at_most_625_bytes_with_all_that_belongs_to_it() {
    let (_folder, store, id, _) = embedded();
    let maker = Maker {
        kind: EmbeddingKind::of("a"),
        unaudited: Some(MachineId(7)),
    };
    let provenance = Provenance {
        makers: vec![maker; 100],
        notices: Vec::new(),
    };
    let pages = || -> i64 {
        let pages = store.read(|c| Ok(c.pragma_query_value(None, "page_count", |row| row.get(0))?));
        pages.unwrap()
    };
    let before = pages();
    for generation in 1..=(INDIVIDUALS / 100) as u32 {
        let first = 2 + u64::from(generation - 1) * 100;
        let individuals: Vec<_> = (first..first + 100)
            .map(|index| ArchivedIndividual {
                generation,
                trials: vec![Trial {
                    image: Some(picture(index)),
                    ..trial(index, (0..5).map(|value| (index + value) as f32).collect())
                }],
                ..individual(index)
            })
            .collect();
        let record = GenerationRecord::of(generation, &[0.1], 0);
        store
            .commit_generation(&id, &record, &individuals, &provenance)
            .unwrap();
    }
    let each = (pages() - before) as u64 * 4096 / INDIVIDUALS;
    // These pictures are no easier to compress than real pictures, which take 459 bytes on average.
    let pictures: i64 = store
        .read(|c| {
            Ok(
                c.query_row("SELECT sum(length(images)) FROM image_chunks", [], |row| {
                    row.get(0)
                })?,
            )
        })
        .unwrap();
    let pictures = pictures as u64 / INDIVIDUALS;
    println!("{each} bytes, of which {pictures} are its picture");
    assert!(pictures >= 459, "{pictures} bytes of pictures");
    assert!(each <= 600 - 459 + pictures, "{each} bytes");
}
