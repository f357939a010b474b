//! Tests campaigns of two species, whose pictures have one channel for each species.

use murmuration_proto::v1;
use murmuration_sim::{evaluate::evaluate, simulate::Start};
use murmuration_swarm::{CampaignSpec, Controller, PictureShape, training::Architecture};
use murmuration_tests::{Cluster, Finished, Murmuration};
use murmuration_train::{network::Network, onnx};
use std::fs;

const ROBOTS: &str = "ratios = [[3, 5], [1, 7]]\n\
    [[species]]\nname = \"a\"\nrobot.sensors = [{ sees = [\"b\"] }]\n\
    [[species]]\nname = \"b\"\nrobot.sensors = [{}, { angle = 1.57 }]\n";

/// A campaign that trains an embedder, gets labels from the synthetic annotator and learns from these labels. `image` is the
/// content of the table `[image]`.
fn spec(image: &str) -> CampaignSpec {
    let text = format!(
        "name = \"swarm\"\nmethod = \"latent\"\n{ROBOTS}\
         [dataset]\ncontrollers = 60\n[training.recipe.in-batch]\nbatch = 20\nepochs = 2\n\
         [feedback]\nrounds = 1\ngenerations = 1\nlabels = 30\nstarts = 2\n[feedback.recipe.labelled]\nepochs = 2\nsteps = 4\n\
         [world]\nhorizon = 250\n[search]\npopulation = 20\ngenerations = 2\n[taxonomy]\nmedoids = 4\n{image}"
    );
    CampaignSpec::from_toml(&text).unwrap()
}

const SPECIES: &str = "[image]\nchannels = \"species\"";

async fn completed(cluster: &mut Cluster, spec: &CampaignSpec) -> v1::Campaign {
    let id = cluster.create(spec).await;
    let last = cluster.finish(&id).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    last
}

async fn archive(cluster: &mut Cluster, campaign: &str) -> Vec<v1::Individual> {
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: true,
    };
    let mut chunks = cluster.client.get_archive(request).await.unwrap().into_inner();
    let mut individuals = Vec::new();
    while let Some(chunk) = chunks.message().await.unwrap() {
        individuals.extend(chunk.individuals);
    }
    individuals
}

#[tokio::test(flavor = "multi_thread")]
async fn a_campaign_with_a_channel_each_trains_searches_and_learns_from_labels() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let spec = spec(SPECIES);
    let last = completed(&mut cluster, &spec).await;
    assert_eq!((last.rounds_done, last.generations_done), (1, 3));
    let individuals = archive(&mut cluster, &last.id).await;
    assert_eq!(individuals.len(), 60);
    for individual in &individuals[..5] {
        let controller = Controller::new(spec.model(), &individual.controller).unwrap();
        let start = Start::seeded(individual.seed);
        let again = evaluate(&controller, spec.world(), spec.image(), &start).unwrap();
        assert_eq!(individual.image.as_deref(), Some(again.image()));
        assert_eq!((again.image().len(), individual.embedding.len()), (5000, 5));
    }
    let url = format!("{}/campaigns/{}/individuals/0", cluster.url(), last.id);
    let picture = murmuration_tests::http::get(url)
        .await
        .unwrap()
        .bytes()
        .await
        .unwrap();
    let reader = png::Decoder::new(std::io::Cursor::new(picture))
        .read_info()
        .unwrap();
    assert_eq!(reader.info().color_type, png::ColorType::Rgb);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_checkpoint_of_other_channels_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let [each, one] = [
        completed(&mut cluster, &spec(SPECIES)).await,
        completed(&mut cluster, &spec("")).await,
    ];
    for (campaign, checkpoint, expected) in [
        (
            &each,
            &one,
            "embeds pictures of 50 x 50, the campaign's are of 2 channels of 50 x 50",
        ),
        (
            &one,
            &each,
            "embeds pictures of 2 channels of 50 x 50, the campaign's are of 50 x 50",
        ),
    ] {
        let request = v1::AdoptCheckpointRequest {
            campaign: campaign.id.clone(),
            checkpoint: checkpoint.checkpoint.clone(),
        };
        let refused = cluster.client.adopt_checkpoint(request).await.unwrap_err();
        assert!(refused.message().contains(expected), "{refused}");
    }
    cluster.stop().await;
}

/// A label file of three behaviours, with this value of the field `channels`.
fn label_file(channels: &str) -> String {
    let model = spec("").model().clone();
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let head = format!(
        "id,class,seed,world,robots,image,{}\n",
        model.gene_names().join(",")
    );
    let image = match channels {
        "" => String::new(),
        channels => quoted(&format!("{{ channels = \"{channels}\" }}")),
    };
    let row = |(id, class): (usize, &str)| {
        let genes = (0..model.genes())
            .map(|gene| format!("{}", [0.5, -0.25, 1.0][(gene + id) % 3] * (1.0 - id as f64 / 4.0)));
        let genes: Vec<_> = genes.take(model.genes() - 1).chain(["1".to_owned()]).collect();
        format!(
            "{id},{class},{id},{{ horizon = 250 }},{},{image},{}\n",
            quoted(&model.to_line()),
            genes.join(",")
        )
    };
    let rows = ["ring", "ring", "clump"].into_iter().enumerate().map(row);
    head + rows.collect::<String>().as_str()
}

#[test]
fn labelled_behaviours_have_the_channels_of_the_embedder() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    for channels in [1, 2] {
        let shape = PictureShape::new(channels, 50).unwrap();
        let network = Network::<f32>::initialise(Architecture::compact(shape, 5).unwrap(), 1);
        fs::write(path(&format!("{channels}.onnx")), onnx::export(&network)).unwrap();
    }
    let measured = |channels: &str, model: &str| {
        fs::write(path("labels.csv"), label_file(channels)).unwrap();
        let (labels, model) = (path("labels.csv"), path(model));
        Murmuration::over(folder.path()).run(&[
            "lab",
            "accuracy",
            "--labels",
            &labels,
            "--checkpoint",
            &model,
        ])
    };
    for (channels, model) in [("species", "2.onnx"), ("one", "1.onnx"), ("", "1.onnx")] {
        let Finished { code, stderr, .. } = measured(channels, model);
        assert_eq!(code, Some(0), "{channels}: {stderr}");
    }
    let refused = |channels: &str, model: &str, expected: &str| {
        let Finished { code, stderr, .. } = measured(channels, model);
        assert!(
            code == Some(2) && stderr.contains(expected),
            "{stderr}\nnot {expected:?}"
        );
    };
    refused(
        "species",
        "1.onnx",
        "channels = species: must be that of the embedder's images, 50 x 50",
    );
    refused(
        "one",
        "2.onnx",
        "channels = one: must be that of the embedder's images, 2 channels of 50 x 50",
    );
    refused(
        "both",
        "2.onnx",
        "channels = \"both\": must be \"one\" or \"species\"",
    );
    fs::create_dir(path("images")).unwrap();
    refused(
        "species",
        "2.onnx",
        "a PNG has one channel, but the embedder takes images of 2 channels of 50 x 50",
    );
}
