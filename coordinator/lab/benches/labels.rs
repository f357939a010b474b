//! Measures an answer and a query with 10,000 labels on disk, beside a read of the whole label log. Neither the answer nor the
//! query reads the whole log.

use criterion::{Criterion, criterion_group, criterion_main};
use murmuration_engine::{
    queries::{AnnotatorSession, Queries, QueryRequest},
    space::Spaces,
};
use murmuration_model::{
    CampaignId, Weight,
    labels::{Action, Change, Labels},
};
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{ArchivedIndividual, DataDirectory, GenerationRecord, Provenance, Store, Trial};
use murmuration_swarm::{CampaignSpec, Controller, Preset, Purpose, RandomStream, Strategy};
use rand::RngExt as _;
use std::{
    error::Error,
    time::{Duration, Instant},
};

const LABELS: u64 = 10_000;
const POPULATION: u64 = 500;
/// Number of individuals. Queries choose among the individuals without a label.
const ARCHIVE: u64 = LABELS + 4 * POPULATION;

type Done<T> = Result<T, Box<dyn Error>>;

/// A campaign with labels for most of its archive.
fn labelled(store: &Store) -> Done<CampaignId> {
    let text =
        format!("model = \"single-sensor\"\nmethod = \"hand-crafted\"\n[search]\npopulation = {POPULATION}");
    let id = store.create_campaign(&CampaignSpec::from_toml(&text)?, Weight::default(), 7)?;
    let mut stream = RandomStream::derive(1, Purpose::Start, 0);
    for generation in 0..ARCHIVE / POPULATION {
        let mut individuals = Vec::new();
        for index in generation * POPULATION..(generation + 1) * POPULATION {
            let controller = Controller::new(Preset::SingleSensor, &[0.0; 4])?;
            let trial = Trial {
                features: stream.random(),
                ..Trial::default()
            };
            let individual = ArchivedIndividual::unmeasured(index, generation as u32, controller);
            individuals.push(individual.with_trial(trial));
        }
        let record = GenerationRecord::of(generation as u32, &[0.0], 0);
        store.commit_generation(&id, &record, &individuals, &Provenance::default())?;
    }
    let message = (0..LABELS).map(answer).collect::<Done<Vec<Change>>>()?;
    store.add_labels(&id, &"import".parse()?, message)?;
    Ok(id)
}

fn answer(index: u64) -> Done<Change> {
    let answer = ["ring", "clump", "wall", "not sure"][index as usize % 4].parse()?;
    Ok(Change {
        annotator: ["ana", "ben"][index as usize % 2].parse()?,
        time_ms: 7,
        action: Action::Answer { index, answer },
    })
}

fn question() -> Done<QueryRequest> {
    Ok(QueryRequest {
        holder: AnnotatorSession {
            token: None,
            annotator: "ana".parse()?,
            session: String::new(),
        },
        strategy: Strategy::Medoids,
        agreement: false,
        count: 4,
        again: Vec::new(),
    })
}

#[expect(clippy::expect_used, reason = "what cannot be measured has no figure")]
fn labels(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let directory = DataDirectory::hold(folder.path()).expect("it is nobody's");
    let store = Store::open(&directory).expect("a store");
    let id = labelled(&store).expect("a labelled campaign");
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    // Queries that use stored data, without workers.
    let queries = Queries::new(store.clone(), Spaces::new(store.clone()), Interrupt::default());
    let wish = question().expect("a wish");
    let ask = || {
        let asked = queries.next(id.as_str(), wish.clone(), Instant::now());
        runtime.block_on(asked).expect("a question")
    };
    // The first query clusters the archive; clustering has its own benchmark.
    ask();
    let mut group = c.benchmark_group("10000 labels");
    group
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(2));
    let mut message = 0;
    group.bench_function("answer", |b| {
        b.iter(|| {
            message += 1;
            let change = answer(message % ARCHIVE).expect("an answer");
            let request = format!("answer-{message}").parse().expect("a name");
            store.add_labels(&id, &request, vec![change]).expect("it is kept")
        });
    });
    group.bench_function("question", |b| {
        b.iter(ask);
    });
    group.bench_function("replay of the log", |b| {
        b.iter(|| {
            let mut labels = Labels::default();
            labels
                .follow(store.label_log(&id).expect("a log"))
                .expect("it is whole");
            labels
        });
    });
}

criterion_group!(benches, labels);
criterion_main!(benches);
