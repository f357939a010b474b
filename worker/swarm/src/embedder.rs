//! The source of a campaign's embedder.

use crate::{
    BehaviourSpace, CheckpointDigest, Dataset, ImageFormat, Invalid, Method, toml_file,
    training::{Configuration, Recipe},
};
use murmuration_proto::v1;

/// The source of a campaign's embedder.
#[derive(Debug, Clone, PartialEq)]
pub enum EmbedderSource {
    Published(CheckpointDigest),
    Trained {
        dataset: Dataset,
        training: Box<Configuration>,
    },
}

/// The fields of a specification that determine the embedder.
pub(crate) struct Fields {
    pub(crate) checkpoint: Option<String>,
    pub(crate) dataset: Option<v1::Dataset>,
    pub(crate) training: Option<String>,
}

impl EmbedderSource {
    /// Validates the fields; `None` for a behaviour space without an embedding.
    pub(crate) fn from_fields(
        fields: Fields,
        method: Method,
        space: BehaviourSpace,
        seed: u64,
        filter: bool,
        image: &ImageFormat,
    ) -> Result<Option<Self>, Invalid> {
        let Fields {
            checkpoint,
            dataset,
            training,
        } = fields;
        let unwanted = |field: &str, why: &str| Err(Invalid::new(field, "given", format!("absent: {why}")));
        let given = [
            ("checkpoint", checkpoint.is_some()),
            ("dataset", dataset.is_some()),
            ("training", training.is_some()),
        ];
        if !space.embeds() {
            let why = format!("the space \"{space}\" has no embedding");
            return match given.iter().find(|(_, given)| *given) {
                Some((field, _)) => unwanted(field, &why),
                None => Ok(None),
            };
        }
        match checkpoint {
            Some(_) if method == Method::Untrained => unwanted(
                "checkpoint",
                "the method \"untrained\" initialises its own network",
            ),
            Some(_) if dataset.is_some() || training.is_some() => unwanted(
                "checkpoint",
                "the file has a dataset or training, so it takes no checkpoint",
            ),
            Some(digest) => Ok(Some(Self::Published(digest.parse()?))),
            None => {
                let training = configuration(training.as_deref(), method, seed, image)?;
                let untrained = *training.recipe() == Recipe::Untrained;
                let default = Dataset::default_for(untrained, filter);
                let dataset = Dataset::from_message(dataset.unwrap_or_default(), default, image.bytes())
                    .map_err(|error| error.within("dataset"))?;
                Ok(Some(Self::Trained {
                    dataset,
                    training: Box::new(training),
                }))
            }
        }
    }

    pub(crate) fn to_fields(&self) -> Fields {
        let (checkpoint, dataset, training) = match self {
            Self::Published(digest) => (Some(digest.to_string()), None, None),
            Self::Trained { dataset, training } => (None, Some((*dataset).into()), Some(training.to_toml())),
        };
        Fields {
            checkpoint,
            dataset,
            training,
        }
    }
}

/// The training's configuration. Seed and recipe default to the campaign's seed and the method's recipe.
fn configuration(
    text: Option<&str>,
    method: Method,
    seed: u64,
    image: &ImageFormat,
) -> Result<Configuration, Invalid> {
    let mut message: v1::Training =
        toml_file::read_section("training", text.unwrap_or_default()).map_err(|error| {
            Invalid::new(
                "training",
                "a table",
                format!("a training configuration: {error}"),
            )
        })?;
    message.seed.get_or_insert(seed);
    if method == Method::Untrained {
        message.recipe.get_or_insert_with(|| (&Recipe::Untrained).into());
    }
    let configuration = Configuration::try_from(message).map_err(|invalid| invalid.within("training"))?;
    let recipe = configuration.recipe();
    if (method == Method::Untrained) != (*recipe == Recipe::Untrained) && method != Method::Random {
        let allowed = format!("a recipe that fits the method \"{method}\"");
        return Err(Invalid::new(
            "training.recipe",
            format!("\"{}\"", recipe.name()),
            allowed,
        ));
    }
    if recipe.is_labelled() {
        let allowed = "a recipe without labels: a new campaign has no labels";
        let named = format!("\"{}\"", recipe.name());
        return Err(Invalid::new("training.recipe", named, allowed));
    }
    let shape = image.shape();
    if let Err(error) = configuration.architecture(shape) {
        let allowed = format!("one for pictures of {shape}: {error}");
        return Err(Invalid::new("training.network", "a network", allowed));
    }
    Ok(configuration)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CampaignSpec;

    fn spec(text: &str) -> Result<CampaignSpec, String> {
        let text = format!("model = \"single-sensor\"\n{text}");
        CampaignSpec::from_toml(&text).map_err(|error| error.to_string())
    }

    #[track_caller]
    fn check_refused(text: &str, expected: &str) {
        let error = spec(text).unwrap_err();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }

    fn trained(text: &str) -> (Dataset, Configuration) {
        match spec(text).unwrap().embedder() {
            Some(EmbedderSource::Trained { dataset, training }) => (*dataset, (**training).clone()),
            other => panic!("not trained: {other:?}"),
        }
    }

    #[test]
    fn a_latent_campaign_trains_on_its_own_dataset_with_its_own_seed() {
        let (dataset, training) = trained("method = \"latent\"\nseed = 7\nfilter = true");
        assert_eq!(
            (dataset.controllers(), dataset.filter(), training.seed()),
            (10_000, true, 7)
        );
        let (_, training) =
            trained("method = \"latent\"\n[training]\nseed = 9\n[training.recipe.paper]\nmargin = 2.0");
        assert_eq!((training.seed(), training.recipe().name()), (9, "paper"));
        let (_, training) = trained("method = \"untrained\"");
        assert_eq!(*training.recipe(), Recipe::Untrained);
    }

    #[test]
    fn another_seed_reaches_the_training() {
        let seeds = |text: &str| {
            let spec = spec(text).unwrap().with_seed(5).unwrap();
            match spec.embedder() {
                Some(EmbedderSource::Trained { training, .. }) => (spec.seed(), training.seed()),
                other => panic!("not trained: {other:?}"),
            }
        };
        assert_eq!(seeds("method = \"latent\""), (5, 5));
        assert_eq!(seeds("method = \"latent\"\n[training]\nseed = 9"), (5, 9));
    }

    #[test]
    fn a_written_specification_reads_back() {
        let digest = CheckpointDigest::of(b"model");
        for text in [
            "method = \"latent\"\n[dataset]\nstarts = 3\n[training.recipe.in-batch]\nepochs = 3".to_owned(),
            "method = \"untrained\"\n[training.network]\nname = \"paper\"".to_owned(),
            format!("method = \"random\"\nspace = \"both\"\ncheckpoint = \"{digest}\""),
        ] {
            let spec = spec(&text).unwrap();
            assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
        }
    }

    #[test]
    fn what_does_not_go_together_is_refused() {
        let digest = CheckpointDigest::of(b"model");
        check_refused(
            "method = \"random\"\n[dataset]",
            "dataset = given: must be absent",
        );
        check_refused(
            "method = \"latent\"\ncheckpoint = \"12\"",
            "64 hexadecimal digits",
        );
        check_refused(
            &format!("method = \"untrained\"\ncheckpoint = \"{digest}\""),
            "checkpoint = given",
        );
        check_refused(
            &format!("method = \"latent\"\ncheckpoint = \"{digest}\"\n[training]"),
            "checkpoint = given",
        );
        check_refused(
            "method = \"latent\"\n[training]\nrecipe = \"untrained\"",
            "training.recipe = \"untrained\"",
        );
        check_refused(
            "method = \"latent\"\n[training.recipe.labelled]",
            "training.recipe = \"labelled\": must be a recipe without labels",
        );
        check_refused("method = \"latent\"\n[training]\nsed = 1", "unknown field `sed`");
        check_refused(
            "method = \"latent\"\n[dataset]\ncontrollers = 3",
            "dataset.controllers = 3",
        );
        check_refused(
            "method = \"latent\"\n[image]\nresolution = 6\n[training.network]\nname = \"paper\"",
            "training.network",
        );
    }
}
