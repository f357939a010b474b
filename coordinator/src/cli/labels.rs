//! `label`, `labels`, `classes`, `agreement`: what people say about behaviours.

use super::{
    CliError, Global,
    connection::{self, Connection, LabelClient},
    files::{read, write},
    heard::{Heard as _, heard},
    json,
    run::InProcessArgs,
};
use crate::local::InProcess;
use murmuration_link::{InputKind, OutputError, errln, outln};
use murmuration_model::labels::{Annotator, Answer, Labelled, Table, to_csv};
use murmuration_proto::{CampaignSpec, Strategy, Text, counted, parts::whole, v1};
use std::{
    collections::BTreeMap,
    path::PathBuf,
    time::{SystemTime, UNIX_EPOCH},
};

/// Arguments of `label`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
With --csv people's answers are read from a file. It has a line of column names, among them id (the index of an individual) \
and class (or `not sure`, or `skip`), and perhaps annotator and time (milliseconds since 1970): it is what `murmuration labels \
--csv` writes (docs/labels.md). Rows without a class are passed over. Columns seed, v1, ... must hold the seeds and controllers \
of the individuals. All rows are stored, or none; a file with rows of the synthetic annotator is refused: take them out.

With --synthetic the rule-based judge answers instead, from the motion of each individual, as the annotator `synthetic`; no \
person may be called so. `murmuration judge` says how well it agrees with people.

On the pages of `murmuration serve` people answer with a key or a mouse.

Examples:
  murmuration label latest --csv my.csv --annotator ana
  murmuration label latest --synthetic 200 --strategy medoids")]
#[command(group = clap::ArgGroup::new("answers").required(true))]
pub(super) struct LabelCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// File of answers to add
    #[arg(long, value_name = "FILE", group = "answers")]
    csv: Option<PathBuf>,
    /// Annotator of the rows of --csv without one
    #[arg(long, value_name = "NAME", conflicts_with = "synthetic")]
    annotator: Option<Annotator>,
    /// Have the rule-based judge label N individuals that nobody has labelled
    #[arg(long, value_name = "N", group = "answers")]
    synthetic: Option<u32>,
    /// How --synthetic chooses the individuals: medoids or random
    #[arg(long, default_value_t = Strategy::Medoids, requires = "synthetic")]
    strategy: Strategy,
}

/// Arguments of `labels`.
#[derive(Debug, clap::Args)]
pub(super) struct LabelsCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Write the labels to this file, which `label`, `accuracy` and `judge` read. A cell that a spreadsheet would take for a
    /// formula (it begins with =, +, -, @ or ') has a ' in front there, which these commands take off again
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
    /// Who makes the change, for the log
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
    /// The two annotators to compare
    #[arg(long, num_args = 2, required = true, value_names = ["A", "B"])]
    annotators: Vec<String>,
}

impl LabelCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        // What is wrong with the file is to be known before anything is started.
        let table = match &self.csv {
            Some(file) => {
                let text = read(file, InputKind::Labels)?;
                Some(Table::parse(file, text, self.annotator.as_ref())?)
            }
            None => None,
        };
        let crew = match &table {
            Some(_) => InProcess::NONE,
            None => InProcess {
                trainers: 0,
                ..InProcessArgs::default().count()
            },
        };
        let label = async |connection: &mut Connection| {
            let (campaign, count) = match table {
                Some(table) => add(connection, self.campaign, table).await?,
                None => self.add_synthetic(connection).await?,
            };
            Added::look(connection, campaign, count).await
        };
        let Added {
            campaign,
            count,
            digest,
            classes,
        } = connection::with(global, crew, label).await?;
        warn_of_near_names(&campaign, &classes);
        if global.json {
            json::print(&json::labelled(&campaign, count, &digest))?;
        } else {
            let answers = counted(count as u64, "answer");
            let next = global.next(&format!("classes {campaign}"));
            errln!("campaign {campaign} has {answers} more; next: {next}");
        }
        Ok(())
    }
}

impl LabelCommand {
    /// Has the judge answer; the campaign's id, and the number of answers.
    async fn add_synthetic(self, connection: &mut Connection) -> Result<(String, usize), CliError> {
        let request = v1::GetCampaignRequest {
            campaign: self.campaign,
        };
        let campaign = heard(connection.client.get_campaign(request).await?)?.id;
        let request = v1::AppendSyntheticLabelsRequest {
            campaign: campaign.clone(),
            request_id: request_id(),
            strategy: v1::QueryStrategy::from(self.strategy) as i32,
            count: self.synthetic.unwrap_or_default(),
        };
        let added = connection.labels.append_synthetic_labels(request).await?;
        let added = whole(added.into_inner()).await?;
        Ok((campaign, added.entries.len()))
    }
}

/// What was added, and what stands then.
struct Added {
    campaign: String,
    count: usize,
    /// The digest of the labels that stand.
    digest: String,
    classes: Vec<v1::LabelClass>,
}

impl Added {
    async fn look(connection: &mut Connection, campaign: String, count: usize) -> Result<Self, CliError> {
        let request = v1::ListLabelsRequest {
            campaign: campaign.clone(),
        };
        let listed = connection.labels.list_labels(request).await?;
        let listed = whole(listed.into_inner()).await?;
        let request = v1::ListClassesRequest {
            campaign: campaign.clone(),
        };
        let classes = heard(connection.labels.list_classes(request).await?)?.classes;
        Ok(Self {
            campaign,
            count,
            digest: Text::line(&listed.digest).into(),
            classes,
        })
    }
}

/// Adds all rows of a file; the campaign's id, and their number.
async fn add(
    connection: &mut Connection,
    campaign: String,
    table: Table,
) -> Result<(String, usize), CliError> {
    let request = v1::GetCampaignRequest { campaign };
    let status = heard(connection.client.get_campaign(request).await?)?;
    let spec = CampaignSpec::try_from(status.spec.unwrap_or_default())?;
    let len = u64::from(status.generations_done) * u64::from(spec.search().population());
    // The coordinator would refuse them too, but knows no lines.
    table.check_indices(&status.id, len)?;
    let campaign = status.id;
    if table.describes() {
        let individuals = individuals(connection, &campaign).await?;
        table.check_individuals(&campaign, |index| individuals.get(&index))?;
    }
    let request = v1::AppendLabelsRequest {
        campaign: campaign.clone(),
        request_id: request_id(),
        answers: table.into_answers(),
    };
    let added = connection.labels.append_labels(request).await?;
    let added = whole(added.into_inner()).await?;
    Ok((campaign, added.entries.len()))
}

/// The individuals of an archive, by index.
async fn individuals(
    connection: &mut Connection,
    campaign: &str,
) -> Result<BTreeMap<u64, v1::Individual>, CliError> {
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: false,
    };
    let mut chunks = connection.client.get_archive(request).await?.into_inner();
    let mut individuals = BTreeMap::new();
    while let Some(chunk) = chunks.message().await? {
        let chunk = chunk.individuals.into_iter();
        individuals.extend(chunk.map(|individual| (individual.index, individual)));
    }
    Ok(individuals)
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
        let list = async |connection: &mut Connection| self.list(connection).await;
        let (v1::ListLabelsResponse { labels, digest }, text) =
            connection::with(global, InProcess::NONE, list).await?;
        let answers = || labels.iter().filter_map(|label| label.answer.as_ref());
        if let (Some(file), Some(text)) = (&self.csv, text) {
            write(file, text)?;
        }
        if global.json {
            labels
                .iter()
                .map(json::label)
                .try_for_each(|label| json::print(&label))?;
        } else if self.csv.is_none() {
            outln!("{:>8}  {:<24} ANNOTATOR", "INDEX", "CLASS")?;
            for answer in answers() {
                outln!("{:>8}  {:<24} {}", answer.index, answer.answer, answer.annotator)?;
            }
            let classes = answers().filter(|answer| matches!(answer.answer.parse(), Ok(Answer::Class(_))));
            let (stand, with_class) = (counted(labels.len() as u64, "answer"), classes.count());
            errln!("{stand} that stand, {with_class} with a class; digest of their classes {digest}");
        }
        Ok(())
    }

    /// The labels, and the text of the file if one is wanted.
    async fn list(
        &self,
        connection: &mut Connection,
    ) -> Result<(v1::ListLabelsResponse, Option<Vec<u8>>), CliError> {
        let request = v1::GetCampaignRequest {
            campaign: self.campaign.clone(),
        };
        let status = heard(connection.client.get_campaign(request).await?)?;
        let request = v1::ListLabelsRequest {
            campaign: status.id.clone(),
        };
        let listed = connection.labels.list_labels(request).await?;
        let v1::ListLabelsResponse { labels, digest } = whole(listed.into_inner()).await?;
        let listed = v1::ListLabelsResponse {
            labels: labels.heard()?,
            digest: Text::line(&digest).into(),
        };
        if self.csv.is_none() {
            return Ok((listed, None));
        }
        let spec = CampaignSpec::try_from(status.spec.unwrap_or_default())?;
        let individuals = individuals(connection, &status.id).await?;
        let answers = listed.labels.iter().filter_map(|label| label.answer.as_ref());
        let labelled = answers.map(|answer| {
            let individual = individuals.get(&answer.index);
            individual.map(|individual| Labelled { answer, individual })
        });
        // Between the two questions something of the archive was taken back.
        let moved = || {
            CliError::Failed(format!(
                "the archive of {} has just changed: try again",
                status.id
            ))
        };
        let labelled = labelled.collect::<Option<Vec<_>>>().ok_or_else(moved)?;
        let text = to_csv(&spec, labelled.into_iter());
        let text = text.map_err(|error| CliError::Failed(error.to_string()))?;
        Ok((listed, Some(text)))
    }
}

impl ClassesCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let campaign = self.campaign.clone();
        let ask = async |connection: &mut Connection| self.with(&mut connection.labels).await;
        let classes = connection::with(global, InProcess::NONE, ask).await?.classes;
        warn_of_near_names(&campaign, &classes);
        if global.json {
            classes
                .iter()
                .map(json::label_class)
                .try_for_each(|class| json::print(&class))?;
            return Ok(());
        }
        outln!("{:<24} {:<7} {:>8}", "CLASS", "COLOUR", "ANSWERS")?;
        for class in &classes {
            outln!("{:<24} {:<7} {:>8}", class.name, class.colour, class.labels)?;
        }
        let answers = classes.iter().map(|class| class.labels).sum();
        errln!("{} that stand with a class", counted(answers, "answer"));
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
            return heard(client.list_classes(request).await?);
        };
        let request = v1::ChangeClassRequest {
            campaign: self.campaign,
            request_id: request_id(),
            annotator: self.annotator,
            change: Some(change),
        };
        heard(client.change_class(request).await?)
    }
}

/// Says which classes have nearly the same name, and how to make one of two.
fn warn_of_near_names(campaign: &str, classes: &[v1::LabelClass]) {
    for (place, class) in classes.iter().enumerate() {
        let later = |name: &&String| classes[place..].iter().any(|other| other.name == **name);
        for other in class.near.iter().filter(later) {
            errln!(
                "warning: classes {:?} and {other:?} have nearly the same name; to make one of them: murmuration classes \
                 {campaign} --merge {other:?} {:?}",
                class.name,
                class.name
            );
        }
    }
}

impl AgreementCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let [first, second] = <[String; 2]>::try_from(self.annotators)
            .map_err(|_| CliError::Input("--annotators: name two".to_owned()))?;
        let ask = async |connection: &mut Connection| {
            let request = v1::GetAgreementRequest {
                campaign: self.campaign,
                first: first.clone(),
                second: second.clone(),
            };
            let parts = connection.labels.get_agreement(request).await?;
            whole(parts.into_inner()).await?.heard()
        };
        let agreement = connection::with(global, InProcess::NONE, ask).await?;
        if global.json {
            json::print(&json::agreement(&first, &second, &agreement))?;
        } else {
            print_agreement(&first, &second, &agreement)?;
        }
        Ok(())
    }
}

fn print_agreement(first: &str, second: &str, agreement: &v1::Agreement) -> Result<(), OutputError> {
    if agreement.both == 0 {
        return outln!("{first} and {second} have given no individual in common a class");
    }
    let kappa = agreement
        .kappa
        .map_or("-".to_owned(), |kappa| format!("{kappa:.3}"));
    outln!(
        "{first} and {second} agree on {} of {}; Cohen's kappa {kappa}",
        agreement.agreed,
        agreement.both
    )?;
    if agreement.disagreements.is_empty() {
        return Ok(());
    }
    outln!("\n{first:<24} {second:<24} {:>11}", "INDIVIDUALS")?;
    for confusion in &agreement.confusions {
        outln!(
            "{:<24} {:<24} {:>11}",
            confusion.first,
            confusion.second,
            confusion.individuals
        )?;
    }
    outln!("\n{:>8}  {first:<24} {second}", "INDEX")?;
    for difference in &agreement.disagreements {
        outln!(
            "{:>8}  {:<24} {}",
            difference.index,
            difference.first,
            difference.second
        )?;
    }
    Ok(())
}
