//! `label`, `labels`, `classes`, `agreement`: classes that people give to behaviours.

use super::{
    CliError, Global,
    connection::{self, Connection, LabelClient},
    files::{FileType, Overwrite, read},
    json,
    run::InProcessArgs,
    table::{Table, left, right},
    validation::{Validated as _, get_campaign, validated},
};
use murmuration_coordinator::local::InProcess;
use murmuration_files::InputKind;
use murmuration_link::{OutputError, errln, outln};
use murmuration_model::{
    csv_file::ColumnNames,
    labels::{self, Annotator, Answer, Labelled, to_csv},
};
use murmuration_proto::{parts::whole, v1};
use murmuration_swarm::{CampaignSpec, Strategy, Text, counted, grouped};
use std::{
    collections::BTreeMap,
    path::PathBuf,
    time::{SystemTime, UNIX_EPOCH},
};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The option --csv reads answers from a file such as `murmuration labels --csv` writes (docs/labels.md). Its first line names the \
columns. The columns index (of the individual) and class (a class, `not sure` or `skip`) are required; annotator and time \
(RFC 3339) are optional. Of two answers of one annotator about one individual, the newer counts. The columns seed, left_0, ..., if present, must match the individuals of the archive. Rows without a class \
are skipped. Either all rows are stored or none. A file with rows of the synthetic annotator is refused.

The option --synthetic lets the rule-based judge answer instead, from the motion of each individual. Its answers carry the annotator \
`synthetic`, a name that no other annotator may use. `murmuration lab judge` measures how well the judge agrees with other annotators.

The pages of `murmuration serve` let you answer in a browser.

Examples:
  murmuration label latest --csv my.csv --annotator ana
  murmuration label latest --csv label-studio.csv --columns index=image,class=choice,time=created_at
  murmuration label latest --synthetic 200 --strategy medoids")]
#[command(group = clap::ArgGroup::new("answers").required(true))]
pub struct LabelCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// File of the answers to add
    #[arg(long, value_name = "FILE", group = "answers")]
    csv: Option<PathBuf>,
    /// Names of the columns in the file of --csv: index, class, annotator, time and seed, as far as they differ
    #[arg(long, value_name = "index=NAME,...", requires = "csv")]
    columns: Option<ColumnNames>,
    /// Annotator for the rows of --csv that name no annotator
    #[arg(long, value_name = "NAME", conflicts_with = "synthetic")]
    annotator: Option<Annotator>,
    /// Let the rule-based judge label N unlabelled individuals
    #[arg(long, value_name = "N", group = "answers")]
    synthetic: Option<u32>,
    /// Query strategy by which --synthetic chooses individuals: medoids, coverage or random
    #[arg(long, default_value_t = Strategy::Medoids, requires = "synthetic")]
    strategy: Strategy,
}

#[derive(Debug, clap::Args)]
pub struct LabelsCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Write the labels to this file, which `label`, `lab accuracy` and `lab judge` read. A spreadsheet would take a cell that
    /// begins with =, +, -, @ or ' for a formula: such a cell gets a ' in front, which these commands remove
    #[arg(long, value_name = "OUT")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("change"))]
pub struct ClassesCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Create a class
    #[arg(long, value_name = "CLASS", group = "change")]
    create: Option<String>,
    /// Rename a class
    #[arg(long, num_args = 2, value_names = ["CLASS", "NAME"], group = "change")]
    rename: Vec<String>,
    /// Merge the first class into the second
    #[arg(long, num_args = 2, value_names = ["CLASS", "INTO"], group = "change")]
    merge: Vec<String>,
    /// Change the colour of a class, such as to '#1d96e6'
    #[arg(long, num_args = 2, value_names = ["CLASS", "COLOUR"], group = "change")]
    colour: Vec<String>,
    /// Your name, for the label log
    #[arg(
        long,
        value_name = "NAME",
        env = "USER",
        hide_env_values = true,
        default_value = "unnamed"
    )]
    annotator: String,
}

#[derive(Debug, clap::Args)]
pub struct AgreementCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// The two annotators to compare
    #[arg(long, num_args = 2, required = true, value_names = ["A", "B"])]
    annotators: Vec<String>,
}

impl LabelCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        // The command reports errors in the file before it starts anything.
        let table = match &self.csv {
            Some(file) => {
                let text = read(file, InputKind::Labels)?;
                let columns = self.columns.clone().unwrap_or_default();
                Some(labels::Table::parse_named(
                    file,
                    &text,
                    self.annotator.as_ref(),
                    columns,
                )?)
            }
            None => None,
        };
        let in_process = match &table {
            Some(_) => InProcess::NONE,
            None => InProcess {
                trainers: 0,
                ..InProcessArgs::default().count()?
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
        } = connection::with(global, in_process, label).await?;
        warn_of_near_names(&campaign, &classes);
        if global.json {
            json::print(json::AddedLabels {
                campaign,
                added: count,
                label_digest: digest,
            })?;
        } else {
            let answers = counted(count as u64, "answer");
            let next = global.next(&format!("classes {campaign}"));
            errln!("added {answers} to campaign {campaign}; next: {next}");
        }
        Ok(())
    }
}

impl LabelCommand {
    /// Lets the judge label individuals. Returns the campaign's id and the number of answers.
    async fn add_synthetic(self, connection: &mut Connection) -> Result<(String, usize), CliError> {
        let campaign = get_campaign(&mut connection.client, self.campaign).await?.id;
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

/// The number of added answers, and the labels and classes of the campaign afterwards.
struct Added {
    campaign: String,
    count: usize,
    /// Digest of all labels.
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
        let classes = validated(connection.labels.list_classes(request).await?)?.classes;
        Ok(Self {
            campaign,
            count,
            digest: Text::line(&listed.digest).into(),
            classes,
        })
    }
}

/// Adds the rows of a file, but for those that are older than the standing answers. Returns the campaign's id and the number of added
/// answers.
async fn add(
    connection: &mut Connection,
    campaign: String,
    table: labels::Table,
) -> Result<(String, usize), CliError> {
    let status = get_campaign(&mut connection.client, campaign).await?;
    let spec = CampaignSpec::try_from(status.spec.unwrap_or_default())?;
    let len = u64::from(status.generations_done) * u64::from(spec.search().population());
    // The coordinator would also refuse wrong indices, but it cannot name the line of the file.
    table.check_indices(&status.id, len)?;
    let campaign = status.id;
    if table.describes(spec.model()) {
        let individuals = individuals(connection, &campaign).await?;
        table.check_individuals(&campaign, spec.model(), |index| individuals.get(&index))?;
    }
    let answers = table.into_answers();
    let given = answers.len();
    let answers = without_older(connection, &campaign, answers).await?;
    if answers.len() < given {
        errln!(
            "left out: {} to which their annotators have given a newer answer",
            counted((given - answers.len()) as u64, "row")
        );
    }
    if answers.is_empty() {
        return Ok((campaign, 0));
    }
    let request = v1::AppendLabelsRequest {
        campaign: campaign.clone(),
        request_id: request_id(),
        answers,
    };
    let added = connection.labels.append_labels(request).await?;
    let added = whole(added.into_inner()).await?;
    Ok((campaign, added.entries.len()))
}

/// The answers, without those with a time before that of the standing answer of the same annotator about the same individual.
async fn without_older(
    connection: &mut Connection,
    campaign: &str,
    answers: Vec<v1::Answer>,
) -> Result<Vec<v1::Answer>, CliError> {
    // An answer without a time is given now.
    if answers.iter().all(|answer| answer.time_ms == 0) {
        return Ok(answers);
    }
    let request = v1::ListLabelsRequest {
        campaign: campaign.to_owned(),
    };
    let listed = connection.labels.list_labels(request).await?;
    let standing = whole(listed.into_inner()).await?.labels;
    let standing = standing.into_iter().filter_map(|label| label.answer);
    let times: BTreeMap<(u64, String), u64> = standing
        .map(|answer| ((answer.index, answer.annotator), answer.time_ms))
        .collect();
    let is_newest = |answer: &v1::Answer| {
        // The coordinator spells the name so too.
        let annotator = answer.annotator.parse::<Annotator>();
        let annotator = annotator.map_or_else(|_| answer.annotator.clone(), |known| known.to_string());
        let standing = times.get(&(answer.index, annotator));
        answer.time_ms == 0 || standing.is_none_or(|&standing| standing <= answer.time_ms)
    };
    Ok(answers.into_iter().filter(is_newest).collect())
}

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

/// A unique name for a request, from the time and the process.
fn request_id() -> String {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_nanos());
    format!("command-{}-{now}", std::process::id())
}

impl LabelsCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(file) = &self.csv {
            FileType::Csv.check("--csv", file)?;
            // The file may have answers that a person corrected.
            self.overwrite.check(file)?;
        }
        let list = async |connection: &mut Connection| self.list(connection).await;
        let (v1::ListLabelsResponse { labels, digest }, text) =
            connection::with(global, InProcess::NONE, list).await?;
        let answers = || labels.iter().filter_map(|label| label.answer.as_ref());
        if let (Some(file), Some(text)) = (&self.csv, text) {
            self.overwrite.write(file, text)?;
        }
        if global.json {
            json::print_all(labels.iter().map(json::Document))?;
        } else if self.csv.is_none() {
            let mut table = Table::new([right("INDEX"), left("CLASS"), left("ANNOTATOR")]);
            for answer in answers() {
                let (class, annotator) = (answer.answer.clone(), answer.annotator.clone());
                table.row([answer.index.to_string(), class, annotator]);
            }
            table.print()?;
            let classes = answers().filter(|answer| matches!(answer.answer.parse(), Ok(Answer::Class(_))));
            let (stand, with_class) = (counted(labels.len() as u64, "answer"), classes.count());
            errln!("{stand}, {with_class} with a class; digest of the classes {digest}");
        }
        Ok(())
    }

    /// Lists the labels, with the text of the file if requested.
    async fn list(
        &self,
        connection: &mut Connection,
    ) -> Result<(v1::ListLabelsResponse, Option<Vec<u8>>), CliError> {
        let status = get_campaign(&mut connection.client, &self.campaign).await?;
        let request = v1::ListLabelsRequest {
            campaign: status.id.clone(),
        };
        let listed = connection.labels.list_labels(request).await?;
        let v1::ListLabelsResponse { labels, digest } = whole(listed.into_inner()).await?;
        let listed = v1::ListLabelsResponse {
            labels: labels.validated()?,
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
        // An individual is missing if part of the archive was rolled back between the two requests.
        let moved = || {
            CliError::Failed(format!(
                "the archive of {} changed while its labels were read: try again",
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
            return Ok(json::print_all(classes.iter().map(json::Document))?);
        }
        let mut table = Table::new([left("CLASS"), left("COLOUR"), right("ANSWERS")]);
        for class in &classes {
            table.row([class.name.clone(), class.colour.clone(), grouped(class.labels)]);
        }
        table.print()?;
        let answers = classes.iter().map(|class| class.labels).sum();
        errln!("{} with a class", counted(answers, "answer"));
        Ok(())
    }

    /// Makes the requested change to the classes, if any. Returns the classes after the change.
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
            return validated(client.list_classes(request).await?);
        };
        let request = v1::ChangeClassRequest {
            campaign: self.campaign,
            request_id: request_id(),
            annotator: self.annotator,
            change: Some(change),
        };
        validated(client.change_class(request).await?)
    }
}

/// Warns of classes with nearly the same name, and prints the command that merges them.
fn warn_of_near_names(campaign: &str, classes: &[v1::LabelClass]) {
    for (place, class) in classes.iter().enumerate() {
        let later = |name: &&String| classes[place..].iter().any(|other| other.name == **name);
        for other in class.near.iter().filter(later) {
            errln!(
                "warning: classes {:?} and {other:?} have nearly the same name; to merge them: murmuration classes {campaign} \
                 --merge {other:?} {:?}",
                class.name,
                class.name
            );
        }
    }
}

impl AgreementCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let [first, second] = <[String; 2]>::try_from(self.annotators)
            .map_err(|_| CliError::Input("--annotators: name two annotators".to_owned()))?;
        let ask = async |connection: &mut Connection| {
            let request = v1::GetAgreementRequest {
                campaign: self.campaign,
                first: first.clone(),
                second: second.clone(),
            };
            let parts = connection.labels.get_agreement(request).await?;
            whole(parts.into_inner()).await?.validated()
        };
        let agreement = connection::with(global, InProcess::NONE, ask).await?;
        if global.json {
            json::print(json::Agreement {
                annotators: [&first, &second],
                agreement: json::Document(&agreement),
            })?;
        } else {
            print_agreement(&first, &second, &agreement)?;
        }
        Ok(())
    }
}

fn print_agreement(first: &str, second: &str, agreement: &v1::Agreement) -> Result<(), OutputError> {
    if agreement.both == 0 {
        return outln!("{first} and {second} have no individual in common that has a class from both");
    }
    let kappa = agreement
        .kappa
        .map_or("-".to_owned(), |kappa| format!("{kappa:.3}"));
    outln!(
        "{first} and {second} agree on {} of {}; Cohen's kappa {kappa}",
        grouped(agreement.agreed),
        grouped(agreement.both)
    )?;
    if agreement.disagreements.is_empty() {
        return Ok(());
    }
    let mut pairs = Table::new([left(first), left(second), right("INDIVIDUALS")]);
    for confusion in &agreement.confusions {
        let (first, second) = (confusion.first.clone(), confusion.second.clone());
        pairs.row([first, second, grouped(confusion.individuals)]);
    }
    let mut individuals = Table::new([right("INDEX"), left(first), left(second)]);
    for difference in &agreement.disagreements {
        let (first, second) = (difference.first.clone(), difference.second.clone());
        individuals.row([difference.index.to_string(), first, second]);
    }
    outln!("")?;
    pairs.print()?;
    outln!("")?;
    individuals.print()
}
