//! Tests campaigns that are exported to a folder and imported from this folder, by command and over the network.

use murmuration_proto::v1::{self, transfer_service_client::TransferServiceClient};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, Murmuration, longer_spec, small_latent_spec, small_spec};
use std::{
    fs,
    path::{Path, PathBuf},
};
use tonic::Code;

/// A campaign and its data directory.
struct Place {
    folder: tempfile::TempDir,
    murmuration: Murmuration,
}

impl Place {
    /// A completed campaign of this file, with labels by the rule-based judge and by a person.
    fn with(spec: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spec.toml");
        fs::write(&path, spec).unwrap();
        let murmuration = Murmuration::over(&folder.path().join("data"));
        let place = Self { folder, murmuration };
        place.done(&["run", &path.display().to_string()]);
        fs::write(
            place.path("mine.csv"),
            "index,class\n0,ring\n1,\"=clump, or ring\"\n3,not sure\n",
        )
        .unwrap();
        place.done(&[
            "label",
            "latest",
            "--csv",
            &place.text("mine.csv"),
            "--annotator",
            "ana",
        ]);
        place.done(&["label", "latest", "--synthetic", "5"]);
        place.done(&["classes", "latest", "--rename", "ring", "wide ring"]);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// Runs a command, which must succeed; returns its output.
    #[track_caller]
    fn done(&self, arguments: &[&str]) -> String {
        let done = self.murmuration.run(arguments);
        assert_eq!(done.code, Some(0), "{}", done.stderr);
        done.stdout
    }

    /// Checks that a command prints the same for the original and for the imported campaign.
    #[track_caller]
    fn same(&self, arguments: &[&str]) {
        let imported = self.text("imported");
        let there = [arguments, &["--data", &imported]].concat();
        assert_eq!(self.done(arguments), self.done(&there), "{arguments:?}");
    }
}

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = names
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// A random campaign of 1,200 individuals, of which the taxonomy covers 1,000.
fn sampled() -> CampaignSpec {
    let text = small_spec("")
        .to_toml()
        .replace("\"hand-crafted\"", "\"random\"")
        .replace("generations = 5", "generations = 60")
        .replace("[taxonomy]\n", "[taxonomy]\nsample = 1000\n");
    CampaignSpec::from_toml(&text).unwrap()
}

#[test]
fn a_campaign_comes_back_with_its_digest_labels_classes_and_taxonomy() {
    for spec in [
        small_spec("[evaluation]\nstarts = 2\njudge = true\n"),
        small_latent_spec("[image]\nresolution = 20\n"),
        sampled(),
    ] {
        let place = Place::with(&spec.to_toml());
        place.done(&["note", "small-1", "--tag", "kept", "--text", "A note"]);
        let exported = place.text("exported");
        place.done(&["export", "latest", &exported]);
        place.done(&["import", &exported, "--data", &place.text("imported")]);
        for command in ["digest", "labels", "classes"] {
            place.same(&[command, "small-1"]);
        }
        place.same(&["list", "--tag", "kept"]);
        place.same(&["checkpoints", "list"]);
        place.same(&["show", "small-1", "--index", "42", "--json"]);
        for (data, report) in [("data", "report"), ("imported", "report-of-imported")] {
            place.done(&[
                "report",
                "small-1",
                "--data",
                &place.text(data),
                "--out",
                &place.text(report),
            ]);
        }
        for table in ["archive.csv", "taxonomy.csv", "classes.csv", "generations.csv"] {
            let read = |report: &str| fs::read_to_string(place.path(report).join(table)).unwrap();
            assert_eq!(read("report"), read("report-of-imported"), "{table}");
        }
        // A new campaign in the directory of the imported campaign gets the next id.
        let path = place.text("spec.toml");
        let further = place.done(&["run", &path, "--data", &place.text("imported"), "--json"]);
        assert!(further.contains("\"campaign\":\"small-2\""), "{further}");
    }
}

#[test]
fn a_campaign_that_was_running_continues_where_it_was_exported() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let here = Murmuration::over(&folder.path().join("data"));
    let spec = longer_spec(folder.path());
    let run = here.start(&["run", &spec]);
    here.latest_when(|campaign| campaign["generations_done"].as_u64() > Some(3));
    let exported = here
        .run(&["export", "latest", &path("exported"), "--json"])
        .last_line();
    assert_eq!(exported["state"], "running");
    let generations = exported["generations"].as_u64().unwrap();
    assert!((4..240).contains(&generations), "{generations}");
    assert_eq!(run.wait(), Some(0));

    let there = Murmuration::over(&folder.path().join("imported"));
    let imported = there.run(&["import", &path("exported"), "--json"]).last_line();
    assert_eq!(
        (&imported["state"], &imported["generations_done"]),
        (&"paused".into(), &generations.into())
    );
    assert_eq!(there.run(&["resume", "latest"]).code, Some(0));
    assert_eq!(there.digest(), here.digest());
}

#[test]
fn nothing_stays_of_a_folder_that_was_changed() {
    let place = Place::with(&small_spec("").to_toml());
    let exported = place.text("exported");
    place.done(&["export", "latest", &exported]);
    let table = place.path("exported/individuals.parquet");
    let mut bytes = fs::read(&table).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&table, bytes).unwrap();
    let refused = place
        .murmuration
        .run(&["import", &exported, "--data", &place.text("imported")]);
    assert_eq!(refused.code, Some(2));
    assert!(
        refused.stderr.contains("individuals.parquet: it was changed"),
        "{}",
        refused.stderr
    );
    assert!(!place.path("imported").exists());
}

#[test]
fn an_import_that_fails_leaves_no_data_directory_that_it_made() {
    let place = Place::with(&small_spec("").to_toml());
    let exported = place.text("exported");
    place.done(&["export", "latest", &exported]);
    let import = |more: &[&str]| {
        let imported = place.text("imported");
        place
            .murmuration
            .run(&[&["import", &exported, "--data", &imported], more].concat())
    };
    let nowhere = place.text("exported/spec.toml/checkpoints");
    let failed = import(&["--checkpoint-store", &nowhere]);
    assert_ne!(failed.code, Some(0), "{}", failed.stderr);
    assert!(!place.path("imported").exists(), "{}", failed.stderr);
    // A failed import keeps a folder that existed before.
    fs::create_dir(place.path("imported")).unwrap();
    assert_ne!(import(&["--checkpoint-store", &nowhere]).code, Some(0));
    assert!(place.path("imported").exists());
    assert_eq!(import(&[]).code, Some(0));
}

#[test]
fn an_export_goes_into_the_empty_folder_that_somebody_is_in() {
    let place = Place::with(&small_spec("").to_toml());
    let folder = place.path("exported");
    fs::create_dir(&folder).unwrap();
    let export = |more: &[&str]| {
        place
            .murmuration
            .run_in(&folder, &[&["export", "latest", "."], more].concat())
    };
    let done = export(&[]);
    assert_eq!(done.code, Some(0), "{}", done.stderr);
    assert!(folder.join("BLAKE3SUMS").is_file());
    let refused = export(&["--force"]).stderr;
    assert!(refused.contains("is the working folder"), "{refused}");
    place.done(&[
        "import",
        &place.text("exported"),
        "--data",
        &place.text("imported"),
    ]);
}

/// The database of a campaign, exported over the network.
async fn exported(cluster: &Cluster, campaign: &str) -> Vec<u8> {
    let mut client = TransferServiceClient::new(cluster.channel().await);
    let request = v1::ExportCampaignRequest {
        campaign: campaign.to_owned(),
    };
    let mut stream = client.export_campaign(request).await.unwrap().into_inner();
    let mut bytes = Vec::new();
    while let Some(part) = stream.message().await.unwrap() {
        bytes.extend(part.data);
    }
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_is_imported_whole_or_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["from", "to"].map(|name| folder.path().join(name));
    let mut cluster = Cluster::start_without_trainer(&from, 1).await;
    let id = cluster.create(&small_spec("")).await;
    cluster.finish(&id).await;
    let digest = cluster.digest(&id).await;
    let whole = exported(&cluster, &id).await;
    cluster.stop().await;

    let mut cluster = Cluster::start_without_trainer(&to, 0).await;
    let mut client = TransferServiceClient::new(cluster.channel().await);
    let empty = names(&to);
    let stream = |campaign: &str, part: usize, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = whole.clone();
        change(&mut bytes);
        let data = bytes.chunks(part).map(<[u8]>::to_vec);
        let mut parts: Vec<_> = data
            .map(|data| v1::CampaignPart {
                data,
                ..v1::CampaignPart::default()
            })
            .collect();
        campaign.clone_into(&mut parts[0].campaign);
        tokio_stream::iter(parts)
    };
    let in_parts = |change: &dyn Fn(&mut Vec<u8>)| stream(&id, 50_000, change);
    let other_digest = |bytes: &mut Vec<u8>| {
        let named = bytes.windows(64).position(|window| window == digest.as_bytes());
        bytes[named.unwrap()] = if digest.starts_with('0') { b'1' } else { b'0' };
    };
    for (stream, code) in [
        (in_parts(&|bytes| bytes.truncate(60_000)), Code::InvalidArgument),
        (
            in_parts(&|bytes| bytes.rotate_left(50_000)),
            Code::InvalidArgument,
        ),
        (in_parts(&|bytes| bytes.resize(2 << 20, 0)), Code::InvalidArgument),
        (
            stream(&id, 2 << 20, &|bytes| bytes.resize(2 << 20, 0)),
            Code::InvalidArgument,
        ),
        (stream("", 50_000, &|_| {}), Code::InvalidArgument),
        (stream("other-1", 50_000, &|_| {}), Code::InvalidArgument),
        (in_parts(&other_digest), Code::DataLoss),
    ] {
        let refused = client.import_campaign(stream).await.unwrap_err();
        assert_eq!(refused.code(), code, "{refused}");
        assert!(cluster.campaigns().await.is_empty());
        assert_eq!(names(&to), empty);
    }
    let imported = client
        .import_campaign(in_parts(&|_| {}))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(
        (imported.id.as_str(), imported.state()),
        (id.as_str(), v1::CampaignState::Completed)
    );
    assert_eq!(cluster.digest(&id).await, digest);
    let refused = client.import_campaign(in_parts(&|_| {})).await.unwrap_err();
    assert_eq!(refused.code(), Code::AlreadyExists, "{refused}");
    cluster.stop().await;
}
