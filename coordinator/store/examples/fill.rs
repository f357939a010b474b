//! Fills a new data directory with a campaign of any number of individuals, with made-up behaviours and pictures. So the rest of
//! the system can be measured with a large archive, without evaluations.
//!
//! Usage: `fill DIR INDIVIDUALS [POPULATION]`. The campaign is running and lacks its last generation, so that a coordinator
//! continues the campaign. A picture shows 24 arcs, up to 384 pixels that are not black, and takes no fewer bytes than a real
//! picture. The program keeps one generation in memory at a time, and prints the amounts that it wrote.

use murmuration_model::{MachineId, Maker, Weight};
use murmuration_store::{ArchivedIndividual, DataDirectory, GenerationRecord, Provenance, Store, Trial};
use murmuration_swarm::{CampaignSpec, Controller, EmbeddingKind, Preset, Purpose, RandomStream};
use rand::RngExt as _;
use std::{
    env, error::Error, f64::consts::TAU, io::Write as _, path::Path, process::ExitCode, time::Instant,
};

const SIDE: usize = 50;
const SEED: u64 = 1;

/// The picture of 24 robots, each on an arc of its own.
fn picture(stream: &mut RandomStream) -> Vec<u8> {
    let mut image = vec![0; SIDE * SIDE];
    for _ in 0..24 {
        let (x, y) = (stream.random_range(5.0..45.0), stream.random_range(5.0..45.0));
        let (radius, begin) = (stream.random_range(1.0..5.0), stream.random_range(0.0..TAU));
        for step in 0..16 {
            let (sine, cosine) = (begin + f64::from(step) / radius).sin_cos();
            let place = (x + radius * cosine) as usize * SIDE + (y + radius * sine) as usize;
            // Grey values differ: a robot gives a pixel more grey where it stays than where it passes.
            image[place] = stream.random_range(3.0..60.0) as u8;
        }
    }
    image
}

fn individual(index: u64, generation: u32) -> Result<ArchivedIndividual, Box<dyn Error>> {
    let mut stream = RandomStream::derive(SEED, Purpose::Start, index);
    // This is the seed that follows from the campaign's specification, so that an import accepts the campaign.
    let seed = stream.random();
    let genes = [(); 4].map(|()| f64::from(stream.random_range(-10..=10)) / 10.0);
    let features = stream.random::<[f64; 5]>();
    Ok(ArchivedIndividual {
        seed,
        novelty: stream.random(),
        trials: vec![Trial {
            features,
            image: Some(picture(&mut stream)),
            ..Trial::default()
        }],
        ..ArchivedIndividual::unmeasured(index, generation, Controller::new(Preset::SingleSensor, &genes)?)
    })
}

fn fill(folder: &Path, individuals: u64, population: u64) -> Result<(), Box<dyn Error>> {
    let generations = individuals / population;
    let spec = CampaignSpec::from_toml(&format!(
        "name = \"filled\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n\
         [search]\npopulation = {population}\ngenerations = {generations}"
    ))?;
    let held = DataDirectory::hold(folder)?;
    let store = Store::open(&held)?;
    let id = store.create_campaign(&spec, Weight::default(), 0)?;
    let maker = Maker {
        kind: EmbeddingKind::UNKNOWN,
        unaudited: Some(MachineId(7)),
    };
    let provenance = Provenance {
        makers: vec![maker; population as usize],
        notices: Vec::new(),
    };
    let begun = Instant::now();
    for generation in 0..generations.saturating_sub(1) {
        let first = generation * population;
        let made = (first..first + population)
            .map(|index| individual(index, generation as u32))
            .collect::<Result<Vec<_>, _>>()?;
        let novelty: Vec<f64> = made.iter().map(|individual| individual.novelty).collect();
        let record = GenerationRecord::of(generation as u32, &novelty, 0);
        store.commit_generation(&id, &record, &made, &provenance)?;
    }
    let seconds = begun.elapsed().as_secs_f64();
    drop((store, held));
    let written = individuals - population;
    let bytes = folder.join(Store::FILE).metadata()?.len();
    writeln!(
        std::io::stdout(),
        "{written} individuals of {id} in {seconds:.1} s, {} bytes each",
        bytes / written.max(1),
    )?;
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let number = |place: usize, otherwise: u64| {
        let given = arguments.get(place).map(|given| given.parse());
        given.unwrap_or(Ok(otherwise)).ok().filter(|&number| number > 0)
    };
    let (Some(folder), Some(individuals), Some(population)) =
        (arguments.first(), number(1, 100_000), number(2, 1000))
    else {
        let _ = writeln!(std::io::stderr(), "usage: fill DIR INDIVIDUALS [POPULATION]");
        return ExitCode::from(2);
    };
    match fill(Path::new(folder), individuals, population) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "fill: {error}");
            ExitCode::FAILURE
        }
    }
}
