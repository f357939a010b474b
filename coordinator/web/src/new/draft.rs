//! A draft of a campaign: the content of the form, and the errors in it.

use super::{
    super::page_error::PageError,
    Parameters,
    fields::{Kind, fields},
    given,
};
use murmuration_swarm::{
    BehaviourSpace, CampaignSpec, Invalid, Method, SpecFileError, line_of_field, text::quoted,
};
use toml::Table;

/// The examples: name, description, and campaign file of each example.
pub(super) const EXAMPLES: [(&str, &str, &str); 6] = [
    (
        "quick-latent",
        "A small campaign on a learned embedding",
        include_str!("../../../../examples/quick-latent.toml"),
    ),
    (
        "quick-hil",
        "A small campaign that learns from a rule-based judge, twice",
        include_str!("../../../../examples/quick-hil.toml"),
    ),
    (
        "single-sensor-latent",
        "One sensor, a learned embedding, as many evaluations as the paper",
        include_str!("../../../../examples/single-sensor-latent.toml"),
    ),
    (
        "two-sensor-latent",
        "Two sensors, a learned embedding",
        include_str!("../../../../examples/two-sensor-latent.toml"),
    ),
    (
        "single-sensor",
        "One sensor, hand-crafted features",
        include_str!("../../../../examples/single-sensor.toml"),
    ),
    (
        "two-sensor",
        "Two sensors, hand-crafted features",
        include_str!("../../../../examples/two-sensor.toml"),
    ),
];

/// A campaign as a person describes it.
pub(super) enum Draft {
    /// The fields of the form, with the parts of a file that have no field in the form.
    Fields(Table),
    /// The text of a campaign file.
    File(String),
}

/// An error in a draft.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Problem {
    /// The path of the wrong field in a campaign file; empty if unknown.
    pub(super) field: String,
    /// The number of the wrong line of the file, from 1.
    pub(super) line: Option<usize>,
    pub(super) text: String,
}

impl Draft {
    /// The initial draft of the form.
    pub(super) fn usual() -> Self {
        let [model, method] = [("model", "single-sensor"), ("method", Method::Latent.name())]
            .map(|(name, value)| (name.to_owned(), value.into()));
        Self::Fields(Table::from_iter([model, method]))
    }

    pub(super) fn copy(spec: &CampaignSpec) -> Self {
        Self::File(spec.to_toml()).into_fields()
    }

    pub(super) fn example(name: &str) -> Result<Self, PageError> {
        let found = EXAMPLES.iter().find(|(known, _, _)| *known == name);
        let (_, _, text) = found.ok_or_else(|| {
            let names = EXAMPLES.map(|(name, _, _)| name).join(", ");
            Invalid::new("example", quoted(name), format!("one of {names}"))
        })?;
        Ok(Self::File((*text).to_owned()).into_fields())
    }

    /// The submitted draft.
    pub(super) fn of_form(parameters: &Parameters) -> Result<Self, PageError> {
        if parameters.iter().any(|(name, _)| name == "text") {
            // Browsers send text with the line ends of Windows.
            return Ok(Self::File(given(parameters, "text").replace("\r\n", "\n")));
        }
        let rest = given(parameters, "rest");
        let mut table: Table = rest
            .parse()
            .map_err(|_| Invalid::new("rest", quoted(rest), "the unchanged text of the page"))?;
        for field in fields() {
            let text = given(parameters, &field.path());
            if field.kind == Kind::Model && !text.is_empty() {
                for others in ["robot", "species", "ratios"] {
                    table.remove(others);
                }
            }
            field.put(&mut table, text);
        }
        Ok(Self::Fields(suited(table)))
    }

    /// This draft as fields, if its text is valid TOML.
    pub(super) fn into_fields(self) -> Self {
        match self {
            Self::File(text) => match text.parse() {
                Ok(table) => Self::Fields(table),
                Err(_) => Self::File(text),
            },
            fields @ Self::Fields(_) => fields,
        }
    }

    pub(super) fn into_file(self) -> Self {
        match self {
            Self::Fields(table) => Self::File(without_empty(table).to_string()),
            file @ Self::File(_) => file,
        }
    }

    /// The specification, or the error in the draft.
    pub(super) fn checked(&self) -> Result<CampaignSpec, Problem> {
        match self {
            Self::Fields(table) => {
                let read = CampaignSpec::from_table(without_empty(table.clone()));
                read.map_err(|error| Problem::of(&error, ""))
            }
            Self::File(text) => CampaignSpec::from_toml(text).map_err(|error| Problem::of(&error, text)),
        }
    }
}

impl Problem {
    /// Describes an error, with the number of its line if `text` is the campaign file.
    fn of(error: &SpecFileError, text: &str) -> Self {
        match error {
            SpecFileError::Value(invalid) => Self {
                field: invalid.field.clone(),
                line: line_of_field(text, &invalid.field),
                text: invalid.to_string(),
            },
            SpecFileError::Syntax(error) => Self {
                field: error.field().to_owned(),
                line: error.line(),
                text: error.to_string(),
            },
        }
    }

    /// Whether the error is about a field of the form.
    pub(super) fn is_about(&self, path: &str) -> bool {
        let last = |path: &str| path.rsplit('.').next().map(str::to_owned);
        self.field == path || (!self.field.contains('.') && Some(&self.field) == last(path).as_ref())
    }
}

/// Removes the fields that the method does not use, because the form shows the fields of all methods.
fn suited(mut table: Table) -> Table {
    let method = table
        .get("method")
        .and_then(toml::Value::as_str)
        .unwrap_or_default();
    let Ok(method) = method.parse::<Method>() else {
        return table;
    };
    let named = table.get("space").and_then(toml::Value::as_str);
    let space = BehaviourSpace::from_field(named, method).or_else(|_| {
        table.remove("space");
        BehaviourSpace::from_field(None, method)
    });
    if !space.is_ok_and(BehaviourSpace::embeds) {
        for unused in ["dataset", "training", "feedback", "checkpoint"] {
            table.remove(unused);
        }
    }
    table
}

/// Removes empty tables.
fn without_empty(mut table: Table) -> Table {
    table.retain(|_, value| value.as_table().is_none_or(|inner| !inner.is_empty()));
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(fields: &[(&str, &str)]) -> Parameters {
        let fields = fields.iter();
        fields
            .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
            .collect()
    }

    #[test]
    fn a_copy_of_a_campaign_is_that_campaign() {
        for (name, _, text) in EXAMPLES {
            let spec = CampaignSpec::from_toml(text).unwrap();
            assert_eq!(Draft::copy(&spec).checked(), Ok(spec.clone()), "{name}");
            assert_eq!(Draft::example(name).unwrap().checked(), Ok(spec), "{name}");
        }
    }

    #[test]
    fn the_fields_of_the_form_and_the_rest_make_a_campaign() {
        let draft = Draft::of_form(&form(&[
            ("rest", "[world]\nwidth = 700.0\n[robot]\nsensors = [{}]\n"),
            ("model", "two-sensor"),
            ("method", "hand-crafted"),
            ("search.population", "1_000"),
            ("dataset.controllers", "40"),
        ]));
        let spec = draft.unwrap().checked().unwrap();
        assert_eq!(spec.search().population(), 1000);
        assert_eq!(spec.world().width().to_string(), "700");
        assert_eq!(spec.embedder(), None);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_field_and_line() {
        let of = |text: &str| Draft::File(text.to_owned()).checked().unwrap_err();
        let wrong = of("model = \"single-sensor\"\nmethod = \"random\"\n[search]\npopulation = 0\n");
        assert!(
            wrong.is_about("search.population") && wrong.line == Some(4),
            "{wrong:?}"
        );
        let wrong = of("model = \"single-sensor\"\nmethod = \"random\"\n[search]\npopulation = \"x\"\n");
        assert!(
            wrong.is_about("search.population") && wrong.line == Some(4),
            "{wrong:?}"
        );
        assert_eq!(of("model = ").line, Some(1));
        let wrong = Draft::of_form(&form(&[("method", "random"), ("seed", "-1")]));
        assert!(wrong.unwrap().checked().is_err());
    }
}
