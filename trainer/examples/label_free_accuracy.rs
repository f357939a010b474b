//! Trains without labels on random controllers, and says how accurate the embedding is on labelled behaviours.

use clap::Parser;
use murmuration_proto::{CapabilityModel, ControllerSpace, ImageFormat, Purpose, Stream, World, v1};
use murmuration_trainer::{
    accuracy::TripletAccuracy, architecture::Architecture, pictures::Pictures, recipe::Recipe,
    training::Training,
};
use murmuration_worker::{evaluate::Evaluator, simulate::Start};
use rayon::prelude::*;
use std::{
    error::Error,
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

#[derive(Debug, Parser)]
struct Arguments {
    #[arg(long, default_value = "single-sensor")]
    model: CapabilityModel,
    #[arg(long)]
    labelled: PathBuf,
    #[arg(long, default_value_t = 10_000)]
    controllers: usize,
    #[arg(long, default_value_t = 1)]
    starts: usize,
    #[arg(long, default_value = "same")]
    kin: String,
    #[arg(long)]
    onnx: Option<PathBuf>,
    #[arg(long, default_value = "compact")]
    network: String,
    #[arg(long, default_value_t = 5)]
    dimensions: usize,
    #[arg(long)]
    layers: Option<PathBuf>,
    #[arg(long, default_value = "in-batch = {}")]
    recipe: String,
    #[arg(long, default_value = "1")]
    seeds: String,
    #[arg(long, default_value_t = 4)]
    every: usize,
    #[arg(long, default_value_t = 12)]
    epochs: usize,
}

struct Labelled {
    images: Vec<u8>,
    classes: Vec<usize>,
    random: usize,
    features: Vec<f64>,
}

fn labelled(dir: &Path, file: &str) -> Result<Labelled, Box<dyn Error>> {
    let text = fs::read_to_string(dir.join(file))?;
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().ok_or("empty")?.split(',').collect();
    let col = |n: &str| head.iter().position(|h| *h == n).unwrap();
    let (id, class) = (col("id"), col("class"));
    let mut names: Vec<String> = Vec::new();
    let mut out = Labelled {
        images: vec![],
        classes: vec![],
        random: 99,
        features: vec![],
    };
    for line in lines {
        let f: Vec<&str> = line.split(',').collect();
        if f[class].is_empty() {
            continue;
        }
        let c = names.iter().position(|n| n == f[class]).unwrap_or_else(|| {
            names.push(f[class].into());
            names.len() - 1
        });
        out.classes.push(c);
        let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(
            dir.join(format!("images/{}.png", f[id])),
        )?));
        let mut r = decoder.read_info()?;
        let mut buf = vec![0; r.output_buffer_size().unwrap()];
        let info = r.next_frame(&mut buf)?;
        assert_eq!(
            (info.width, info.height, info.color_type),
            (50, 50, png::ColorType::Grayscale)
        );
        // PNG rows are axis 0.
        out.images.extend_from_slice(&buf);
        for k in [
            "average_speed",
            "angular_momentum",
            "radial_variance_x20",
            "scatter",
            "group_rotation",
        ] {
            out.features.push(f[col(k)].parse::<f64>()?.abs());
        }
    }
    out.random = names.iter().position(|n| n == "random").unwrap();
    Ok(out)
}

fn simulate(model: CapabilityModel, controllers: usize, starts: usize, kin: &str) -> Vec<u8> {
    let kin2 = kin;
    let kin = if kin == "same" { "" } else { kin };
    let cache = format!(
        "/tmp/train-cache-{}-{controllers}-{starts}{kin}.bin",
        model.name()
    );
    if let Ok(b) = fs::read(&cache) {
        return b;
    }
    let t = Instant::now();
    let world = World::try_from(v1::World::default()).unwrap();
    let format = ImageFormat::default();
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), model).unwrap();
    let mut stream = Stream::derive(77, Purpose::Propose, 0);
    let list: Vec<_> = (0..controllers).map(|_| space.sample(&mut stream)).collect();
    let images: Vec<Vec<u8>> = list
        .par_iter()
        .enumerate()
        .map_init(
            || Evaluator::new(&world, &format).unwrap(),
            |e, (i, c)| {
                (0..starts)
                    .flat_map(|s| {
                        let seed = Stream::derive(77, Purpose::Start, (i * 1000 + s) as u64).bits();
                        let mut c = *c;
                        if s > 0 && kin2 != "same" {
                            let mut st = Stream::derive(78, Purpose::Propose, (i * 1000 + s) as u64);
                            let mut genes = c.genes().to_vec();
                            let n = c.speeds().len();
                            let scale = st.between(0.7, 1.4);
                            for g in &mut genes[..n] {
                                *g = match kin2 {
                                    "jitter" => *g + (st.below(3) as f64 - 1.0) * 0.1,
                                    "wide" => *g + (st.below(5) as f64 - 2.0) * 0.1,
                                    "scale" => *g * scale,
                                    _ => *g * scale + (st.below(3) as f64 - 1.0) * 0.1,
                                }
                                .clamp(-1.0, 1.0);
                            }
                            c = space.controller(&genes);
                        }
                        let c = &c;
                        e.evaluate(c, &Start::seeded(seed)).unwrap().into_image()
                    })
                    .collect()
            },
        )
        .collect();
    let b = images.concat();
    eprintln!("simulated in {:.1} s", t.elapsed().as_secs_f64());
    fs::write(cache, &b).unwrap();
    b
}

fn score(v: &[f64], dims: usize, l: &Labelled) -> (f64, f64) {
    let a = TripletAccuracy::of(v, dims, &l.classes);
    (
        100.0 * a.over(|c| c != l.random).unwrap(),
        100.0 * a.over(|_| true).unwrap(),
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Arguments::parse();
    let dir = args.labelled.join(match args.model {
        CapabilityModel::SingleSensor => "single_sensor",
        CapabilityModel::TwoSensor => "two_sensor",
    });
    let (val, train) = (labelled(&dir, "validation.csv")?, labelled(&dir, "train.csv")?);
    let h = score(&val.features, 5, &val);
    let ht = score(&train.features, 5, &train);
    println!(
        "hand-crafted {:.2} / {:.2}   train {:.2} / {:.2}",
        h.0, h.1, ht.0, ht.1
    );
    let pictures = Pictures::new(
        50,
        args.starts,
        simulate(args.model, args.controllers, args.starts, &args.kin),
    )?;
    let recipe: Recipe = toml::from_str(&args.recipe)?;
    let mut finals = vec![];
    for seed in args.seeds.split(',') {
        let architecture = match &args.layers {
            None => Architecture::named(&args.network, 50, args.dimensions)?,
            Some(f) => {
                #[derive(serde::Deserialize)]
                struct F {
                    layers: Vec<murmuration_trainer::architecture::Layer>,
                }
                let f: F = toml::from_str(&fs::read_to_string(f)?)?;
                Architecture::new(50, f.layers)?
            }
        };
        let mut training = Training::new(&pictures, architecture, recipe.clone(), seed.parse()?);
        let t = Instant::now();
        let mut last = (0.0, 0.0, 0.0, 0.0);
        for epoch in 1..=args.epochs {
            let (loss, violated) = training.epoch();
            if epoch % args.every == 0 || epoch == args.epochs {
                let net = training.network();
                let s = |l: &Labelled| {
                    let v: Vec<f64> = net.embed(&l.images).into_iter().map(f64::from).collect();
                    score(&v, net.architecture().dimensions(), l)
                };
                let (v, tr) = (s(&val), s(&train));
                println!(
                    "seed {seed} epoch {epoch:3} {:5.1}s loss {loss:.4} violated {violated:.4} rate {:.5} | val {:.2} / {:.2} | train {:.2} / {:.2}",
                    t.elapsed().as_secs_f64(),
                    training.rate(),
                    v.0,
                    v.1,
                    tr.0,
                    tr.1
                );
                last = (v.0, v.1, tr.0, tr.1);
            }
        }
        if let Some(file) = &args.onnx {
            let net = training.network();
            fs::write(file, murmuration_trainer::onnx::export(&net))?;
            let text: Vec<String> = net
                .embed(&val.images)
                .iter()
                .chain(&net.embed(&train.images))
                .map(|v| v.to_string())
                .collect();
            fs::write(file.with_extension("txt"), text.join("\n"))?;
            fs::write(
                file.with_extension("bin"),
                [val.images.as_slice(), &train.images].concat(),
            )?;
        }
        finals.push(last);
    }
    let n = finals.len() as f64;
    let m = finals.iter().fold((0., 0., 0., 0.), |a, b| {
        (a.0 + b.0 / n, a.1 + b.1 / n, a.2 + b.2 / n, a.3 + b.3 / n)
    });
    println!(
        "MEAN {} {:?}: val {:.2} / {:.2} | train {:.2} / {:.2}",
        args.model, args.recipe, m.0, m.1, m.2, m.3
    );
    Ok(())
}
