//! `label`, `labels`, `classes`, `agreement`: what people say about behaviours.

use super::{
    CliError, Global,
    connection::{Connection, LabelClient},
    json,
    run::CrewSize,
};
use crate::{
    labels::{Annotator, Table, to_csv},
    local::Crew,
};
use murmuration_proto::{CampaignSpec, Strategy, v1};
use std::{
    fs,
    path::PathBuf,
    time::{SystemTime, UNIX_EPOCH},
};

/// Arguments of `label`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The file has a line of column names, among them id (index of an individual) and class (or `not sure`, or `skip`); and
perhaps annotator and time (milliseconds since 1970). Rows without a class are passed over. All rows are stored, or none.

With --synthetic the rule-based judge answers instead, from the motion of each individual; `murmuration judge` says how
well it agrees with people.

Examples:
  murmuration label latest --csv my.csv --annotator ana
  murmuration label latest --synthetic 200 --strategy medoids")]
pub(super) struct LabelCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Answers to add
    #[arg(long, value_name = "FILE", required_unless_present = "synthetic")]
    csv: Option<PathBuf>,
    /// Who gave those answers that do not say
    #[arg(long, value_name = "NAME", conflicts_with = "synthetic")]
    annotator: Option<Annotator>,
    /// Have the rule-based judge label so many individuals that nobody has labelled
    #[arg(long, value_name = "N", conflicts_with = "csv")]
    synthetic: Option<u32>,
    /// How those are chosen: medoids, random or committee
    #[arg(long, default_value_t = Strategy::Medoids, requires = "synthetic")]
    strategy: Strategy,
}

/// Arguments of `labels`.
#[derive(Debug, clap::Args)]
pub(super) struct LabelsCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Write them to this file, which `murmuration label` reads
    #[arg(long, value_name = "OUT")]
    csv: Option<PathBuf>,
}

/// Arguments of `classes`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("change"))]
pub(super) struct ClassesCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Add a class
    #[arg(long, value_name = "CLASS", group = "change")]
    create: Option<String>,
    /// Give a class another name
    #[arg(long, num_args = 2, value_names = ["CLASS", "NAME"], group = "change")]
    rename: Vec<String>,
    /// Make one class of two: the first becomes part of the second
    #[arg(long, num_args = 2, value_names = ["CLASS", "INTO"], group = "change")]
    merge: Vec<String>,
    /// Give a class another colour, such as '#1d96e6'
    #[arg(long, num_args = 2, value_names = ["CLASS", "COLOUR"], group = "change")]
    colour: Vec<String>,
    /// Who says so, for the log
    #[arg(
        long,
        value_name = "NAME",
        env = "USER",
        hide_env_values = true,
        default_value = "unnamed"
    )]
    annotator: String,
}

/// Arguments of `agreement`.
#[derive(Debug, clap::Args)]
pub(super) struct AgreementCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// The two to compare
    #[arg(long, num_args = 2, required = true, value_names = ["A", "B"])]
    annotators: Vec<String>,
}

impl LabelCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        // What is wrong with the file is to be known before anything is started.
        let table = match &self.csv {
            Some(file) => {
                let text = fs::read(file).map_err(|error| CliError::unreadable(file, &error))?;
                Some(Table::parse(file, text, self.annotator.as_ref())?)
            }
            None => None,
        };
        let crew = match &table {
            Some(_) => Crew::NONE,
            None => Crew {
                trainers: 0,
                ..CrewSize::default().count()
            },
        };
        let mut connection = Connection::open(global, crew).await?;
        let added = match table {
            Some(table) => add(&mut connection, self.campaign, table).await,
            None => self.add_synthetic(&mut connection).await,
        };
        connection.close().await?;
        let (campaign, count, digest) = added?;
        if global.json {
            json::print(&json::labelled(&campaign, count, &digest));
        } else {
            println!("{count}");
            eprintln!("campaign {campaign} has {count} answers more; next: murmuration classes {campaign}");
        }
        Ok(())
    }
}

impl LabelCommand {
    /// Has the judge answer; the campaign's id, the number of answers, and the digest of what stands then.
    async fn add_synthetic(self, connection: &mut Connection) -> Result<(String, usize, String), CliError> {
        let request = v1::GetCampaignRequest {
            campaign: self.campaign,
        };
        let campaign = connection.client.get_campaign(request).await?.into_inner().id;
        let request = v1::AppendSyntheticLabelsRequest {
            campaign: campaign.clone(),
            request_id: request_id(),
            strategy: v1::QueryStrategy::from(self.strategy) as i32,
            count: self.synthetic.unwrap_or_default(),
        };
        let added = connection
            .labels
            .append_synthetic_labels(request)
            .await?
            .into_inner();
        let digest = digest(connection, &campaign).await?;
        Ok((campaign, added.entries.len(), digest))
    }
}

/// The digest of the labels that stand.
async fn digest(connection: &mut Connection, campaign: &str) -> Result<String, CliError> {
    let request = v1::ListLabelsRequest {
        campaign: campaign.to_owned(),
    };
    Ok(connection.labels.list_labels(request).await?.into_inner().digest)
}

/// Adds all rows of a file; the campaign's id, their number, and the digest of what stands then.
async fn add(
    connection: &mut Connection,
    campaign: String,
    table: Table,
) -> Result<(String, usize, String), CliError> {
    let request = v1::GetCampaignRequest { campaign };
    let status = connection.client.get_campaign(request).await?.into_inner();
    let spec = CampaignSpec::try_from(status.spec.unwrap_or_default())?;
    let len = u64::from(status.generations_done) * u64::from(spec.search().population());
    // The coordinator would refuse them too, but knows no lines.
    table.check_indices(&status.id, len)?;
    let campaign = status.id;
    let request = v1::AppendLabelsRequest {
        campaign: campaign.clone(),
        request_id: request_id(),
        answers: table.into_answers(),
    };
    let added = connection.labels.append_labels(request).await?.into_inner();
    let digest = digest(connection, &campaign).await?;
    Ok((campaign, added.entries.len(), digest))
}

/// A name that no other request has: when, and by which process.
fn request_id() -> String {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_nanos());
    format!("command-{}-{now}", std::process::id())
}

impl LabelsCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(global, Crew::NONE).await?;
        let request = v1::ListLabelsRequest {
            campaign: self.campaign,
        };
        let listed = connection.labels.list_labels(request).await;
        connection.close().await?;
        let v1::ListLabelsResponse { labels, digest } = listed?.into_inner();
        let answers = || labels.iter().filter_map(|label| label.answer.as_ref());
        if let Some(file) = &self.csv {
            let text = to_csv(answers()).map_err(|error| CliError::Failed(error.to_string()))?;
            fs::write(file, text).map_err(|error| CliError::unwritable(file, &error))?;
            eprintln!("wrote {}", file.display());
        }
        if global.json {
            labels
                .iter()
                .map(json::label)
                .for_each(|label| json::print(&label));
        } else if self.csv.is_none() {
            println!("{:>8}  {:<24} ANNOTATOR", "INDEX", "CLASS");
            for answer in answers() {
                println!("{:>8}  {:<24} {}", answer.index, answer.answer, answer.annotator);
            }
            eprintln!("{} answers; digest of their classes {digest}", labels.len());
        }
        Ok(())
    }
}

impl ClassesCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(global, Crew::NONE).await?;
        let listed = self.with(&mut connection.labels).await;
        connection.close().await?;
        let classes = listed?.classes;
        if global.json {
            classes
                .iter()
                .map(json::label_class)
                .for_each(|class| json::print(&class));
            return Ok(());
        }
        println!("{:<24} {:<7} {:>8}", "CLASS", "COLOUR", "LABELS");
        for class in classes {
            println!("{:<24} {:<7} {:>8}", class.name, class.colour, class.labels);
        }
        Ok(())
    }

    /// Makes the change that was asked for, if one was; the classes after that.
    async fn with(self, client: &mut LabelClient) -> Result<v1::ListClassesResponse, CliError> {
        use v1::change_class_request::Change;
        let change = if let Some(class) = self.create {
            Change::Create(v1::CreateClass { class })
        } else if let Ok([class, to]) = <[String; 2]>::try_from(self.rename) {
            Change::Rename(v1::RenameClass { class, to })
        } else if let Ok([class, into]) = <[String; 2]>::try_from(self.merge) {
            Change::Merge(v1::MergeClass { class, into })
        } else if let Ok([class, colour]) = <[String; 2]>::try_from(self.colour) {
            Change::Colour(v1::ColourClass { class, colour })
        } else {
            let request = v1::ListClassesRequest {
                campaign: self.campaign,
            };
            return Ok(client.list_classes(request).await?.into_inner());
        };
        let request = v1::ChangeClassRequest {
            campaign: self.campaign,
            request_id: request_id(),
            annotator: self.annotator,
            change: Some(change),
        };
        Ok(client.change_class(request).await?.into_inner())
    }
}

impl AgreementCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let [first, second] = <[String; 2]>::try_from(self.annotators)
            .map_err(|_| CliError::Input("--annotators: name two".to_owned()))?;
        let mut connection = Connection::open(global, Crew::NONE).await?;
        let request = v1::GetAgreementRequest {
            campaign: self.campaign,
            first: first.clone(),
            second: second.clone(),
        };
        let answered = connection.labels.get_agreement(request).await;
        connection.close().await?;
        let agreement = answered?.into_inner();
        if global.json {
            json::print(&json::agreement(&first, &second, &agreement));
        } else {
            print_agreement(&first, &second, &agreement);
        }
        Ok(())
    }
}

fn print_agreement(first: &str, second: &str, agreement: &v1::Agreement) {
    let kappa = agreement
        .kappa
        .map_or("-".to_owned(), |kappa| format!("{kappa:.3}"));
    println!(
        "{first} and {second} agree on {} of {}; Cohen's kappa {kappa}",
        agreement.agreed, agreement.both
    );
    if agreement.disagreements.is_empty() {
        return;
    }
    println!("\n{first:<24} {second:<24} {:>11}", "INDIVIDUALS");
    for confusion in &agreement.confusions {
        println!(
            "{:<24} {:<24} {:>11}",
            confusion.first, confusion.second, confusion.individuals
        );
    }
    println!("\n{:>8}  {first:<24} {second}", "INDEX");
    for difference in &agreement.disagreements {
        println!(
            "{:>8}  {:<24} {}",
            difference.index, difference.first, difference.second
        );
    }
}
