//! A draft of a campaign: the content of the form, and the errors in it.

use super::{
    super::{
        page_error::PageError,
        robot_editor::{has_tables, robots_text},
    },
    Parameters,
    fields::{Field, Kind, OWN_ROBOTS, USUAL_ROBOTS, fields},
    given,
    problems::{self, Problem, without_empty},
};
use murmuration_swarm::{BehaviourSpace, CampaignSpec, Invalid, Method, grouped, text::quoted};
use std::collections::BTreeMap;
use toml::Table;

/// The name of the text with the robots in the form.
pub(super) const ROBOTS: &str = "robots";

/// The name of the parts of a campaign file that have no field in the form, and what errors call them.
pub(super) const REST: &str = "rest";
const REST_NAME: &str = "the fields that the form does not show";

/// Maximum length of a submitted text in bytes: room for a sweep of 22 genes with all their digits (some 900 controllers), and many
/// times the length of the longest examples. The page reads a text once for each error in it.
const MOST_BYTES: usize = 512 << 10;

/// The examples: name, description, and campaign file of each example.
pub(super) const EXAMPLES: [(&str, &str, &str); 8] = [
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
    (
        "three-sensors",
        "An own robot: a ray, a camera with a cone that turns, and a feeler for walls",
        include_str!("../../../../examples/three-sensors.toml"),
    ),
    (
        "two-species",
        "Two species in one arena, and the number of robots of each is searched too",
        include_str!("../../../../examples/two-species.toml"),
    ),
];

/// A campaign as a person describes it.
pub(super) enum Draft {
    /// The content of the form.
    Fields(Filled),
    /// The text of a campaign file.
    File(String),
}

/// The content of the form.
pub(super) struct Filled {
    /// The fields of the form, with the parts of a file that have no field in the form.
    pub(super) table: Table,
    /// The text that describes own robots; empty for a preset. The text is kept as it was written.
    pub(super) robots: String,
}

impl Draft {
    /// The initial draft of the form.
    pub(super) fn usual() -> Self {
        let [model, method] = [("model", USUAL_ROBOTS), ("method", Method::Latent.name())]
            .map(|(name, value)| (name.to_owned(), value.into()));
        Self::Fields(Filled {
            table: Table::from_iter([model, method]),
            robots: String::new(),
        })
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

    /// A draft with the robots of a text, which the page Play describes.
    pub(super) fn with_robots(text: &str) -> Self {
        let method = || ("method".to_owned(), Method::Latent.name().into());
        let Ok(table) = text.parse::<Table>() else {
            return Self::Fields(Filled {
                table: Table::from_iter([method()]),
                robots: text.to_owned(),
            });
        };
        let is_only_robots = table.keys().all(|name| OWN_ROBOTS.contains(&name.as_str()));
        let mut filled = Filled::of(table);
        if is_only_robots {
            // The text can have comments.
            text.clone_into(&mut filled.robots);
        }
        filled.table.entry("method").or_insert_with(|| method().1);
        Self::Fields(filled)
    }

    /// The submitted draft.
    pub(super) fn of_form(parameters: &Parameters) -> Result<Self, PageError> {
        for (name, text) in [
            ("text", "the campaign file"),
            (ROBOTS, "the text of the robots"),
            (REST, REST_NAME),
        ] {
            let bytes = given(parameters, name).len();
            if bytes > MOST_BYTES {
                let most = grouped(MOST_BYTES as u64);
                let allowed = format!(
                    "at most {most} bytes long; `murmuration submit FILE` starts a campaign from a longer file"
                );
                return Err(Invalid::new(text, format!("{} bytes", grouped(bytes as u64)), allowed).into());
            }
        }
        // Browsers send text with the line ends of Windows.
        let text_of = |name| given(parameters, name).replace("\r\n", "\n");
        if parameters.iter().any(|(name, _)| name == "text") {
            return Ok(Self::File(text_of("text")));
        }
        let rest = given(parameters, REST);
        let mut table: Table = rest
            .parse()
            .map_err(|_| Invalid::new(REST_NAME, quoted(rest), "the unchanged text of the page"))?;
        for field in fields() {
            field.put(&mut table, given(parameters, &field.path()));
        }
        Ok(Self::Fields(Filled {
            table: suited(table),
            robots: text_of(ROBOTS),
        }))
    }

    /// This draft as fields, if its text is valid TOML.
    pub(super) fn into_fields(self) -> Self {
        match self {
            Self::File(text) => match text.parse() {
                Ok(table) => Self::Fields(Filled::of(table)),
                Err(_) => Self::File(text),
            },
            fields @ Self::Fields(_) => fields,
        }
    }

    pub(super) fn into_file(self) -> Self {
        match self {
            Self::Fields(filled) => Self::File(filled.into_text()),
            file @ Self::File(_) => file,
        }
    }

    /// The specification, or all errors in the draft.
    pub(super) fn checked(&self) -> Result<CampaignSpec, Vec<Problem>> {
        match self {
            Self::Fields(filled) => filled.checked().map_err(|(problems, _)| problems),
            Self::File(text) => CampaignSpec::from_toml(text).map_err(|first| {
                let table = text.parse::<Table>().ok();
                let others = table.and_then(|table| problems::read(&table).err());
                problems::in_text(text, &first, others.map_or_else(Vec::new, |(others, _)| others))
            }),
        }
    }
}

impl Filled {
    fn of(mut table: Table) -> Self {
        let mut own = Table::new();
        for name in OWN_ROBOTS {
            own.extend(table.remove(name).map(|value| (name.to_owned(), value)));
        }
        Self {
            table,
            robots: robots_text(&own),
        }
    }

    /// The text of a campaign file. The robots stay as they were written.
    fn into_text(self) -> String {
        let (tables, values): (Table, Table) = without_empty(self.table)
            .into_iter()
            .partition(|(_, value)| has_tables(value));
        let parts = [values.to_string(), self.robots, tables.to_string()];
        let parts = parts.iter().map(|part| part.trim_end());
        let parts: Vec<_> = parts.filter(|part| !part.is_empty()).collect();
        parts.join("\n\n") + "\n"
    }

    /// The specification, or all errors, and the table without the wrong fields.
    fn checked(&self) -> Result<CampaignSpec, (Vec<Problem>, Table)> {
        let mut table = self.table.clone();
        let mut problems = self.wrong_robots();
        match self.robots.parse::<Table>() {
            Ok(own) if problems.is_empty() => table.extend(own),
            _ => drop(table.insert("model".to_owned(), USUAL_ROBOTS.into())),
        }
        match problems::read(&table) {
            Ok(spec) if problems.is_empty() => Ok(spec),
            Ok(_) => Err((problems, table)),
            Err((others, rest)) => {
                problems.extend(others);
                Err((problems, rest))
            }
        }
    }

    /// The errors in the text that describes the robots.
    fn wrong_robots(&self) -> Vec<Problem> {
        if self.robots.trim().is_empty() {
            return Vec::new();
        }
        let of = |invalid: Invalid| vec![Problem::from(&invalid)];
        if let Some(model) = self.table.get("model") {
            let allowed = "empty, or Robots must be \"described below\"";
            return of(Invalid::new(ROBOTS, format!("a text, beside {model}"), allowed));
        }
        if let Err(first) = CampaignSpec::robots_from_toml(&self.robots) {
            let table = self.robots.parse::<Table>().ok();
            let others = table.and_then(|mut table| {
                table.insert("method".to_owned(), Method::Random.name().into());
                problems::read(&table).err()
            });
            return problems::in_text(
                &self.robots,
                &first,
                others.map_or_else(Vec::new, |(others, _)| others),
            );
        }
        let table = self.robots.parse::<Table>().unwrap_or_default();
        match table.keys().find(|name| !OWN_ROBOTS.contains(&name.as_str())) {
            Some(other) => {
                let allowed =
                    "only [robot], or [[species]] and ratios: the other fields of the form describe the rest";
                of(Invalid::new(ROBOTS, quoted(other), allowed))
            }
            None => Vec::new(),
        }
    }

    /// The defaults of the fields of the form, as text, by their paths.
    ///
    /// The default of an empty field is the value that the campaign has: it can depend on other fields. The default of a field
    /// with a value is the value in a campaign whose other fields have their defaults too.
    pub(super) fn defaults(&self) -> BTreeMap<String, String> {
        let is_choice = |field: &Field| matches!(field.kind, Kind::Model | Kind::Method);
        let mut bare = Self {
            table: self.table.clone(),
            robots: self.robots.clone(),
        };
        for field in fields().filter(|field| !is_choice(field)) {
            field.put(&mut bare.table, "");
        }
        let usual = match Self::usual_fields() {
            Some(spec) => table_of(&spec),
            None => Table::new(),
        };
        let [own, bare] = [self, &bare]
            .map(Self::nearest)
            .map(|spec| spec.as_ref().map(table_of));
        let of = |field: &Field| {
            let known = if field.value(&self.table).is_empty() {
                &own
            } else {
                &bare
            };
            let known = known.as_ref().map(|table| field.value(table));
            let known = known.filter(|value| !value.is_empty());
            (field.path(), known.unwrap_or_else(|| field.value(&usual)))
        };
        fields().filter(|field| !is_choice(field)).map(of).collect()
    }

    fn usual_fields() -> Option<CampaignSpec> {
        Draft::usual().checked().ok()
    }

    /// The campaign without the wrong fields.
    fn nearest(&self) -> Option<CampaignSpec> {
        match self.checked() {
            Ok(spec) => Some(spec),
            Err((_, rest)) => CampaignSpec::from_table(without_empty(rest)).ok(),
        }
    }
}

/// A specification with all its fields.
fn table_of(spec: &CampaignSpec) -> Table {
    spec.to_toml().parse().unwrap_or_default()
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

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{Begun, Controller};

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
    fn a_text_that_is_too_long_is_refused_unread() {
        for name in ["text", ROBOTS, REST] {
            // Each of these fields would be an error.
            let text: String = (0..200_000).map(|field| format!("a{field}=1\n")).collect();
            let refused = Draft::of_form(&form(&[(name, &text)])).err().unwrap();
            let refused = refused.to_string();
            assert!(refused.contains("at most 524,288 bytes"), "{refused}");
        }
        let comment = "# a long comment\n".repeat(3000);
        let text = comment + "model = \"single-sensor\"\nmethod = \"random\"\n";
        let draft = Draft::of_form(&form(&[("text", &text)])).unwrap();
        draft.checked().unwrap();
    }

    #[test]
    fn a_large_sweep_fits_the_form() {
        let species = |name: &str, sensors: &str| {
            format!("[[species]]\nname = \"{name}\"\nrobot.sensors = [{sensors}]\n")
        };
        let robots = "ratios = [[5, 4], [4, 5]]\n".to_owned()
            + &species("a", "{}, {}, {}")
            + &species("b", "{ angle = \"free\", angle_range = [0, 1] }");
        let (model, world) = CampaignSpec::robots_from_toml(&robots).unwrap();
        // A controller of an archive has all digits of its genes.
        let mut genes = vec![-1.0 / 3.0; model.genes()];
        let free = model.genes() - 2;
        genes[free..].copy_from_slice(&[1.0 / 3.0, 0.0]);
        let centre = Controller::new(&model, &genes).unwrap();
        let begun = Begun {
            name: "sweep",
            world: &world,
            seed: 1,
        };
        let spec = CampaignSpec::sweep_around(&centre, begun).unwrap();
        assert!(spec.search().population() > 900);
        let Draft::Fields(filled) = Draft::copy(&spec) else {
            unreachable!()
        };
        let rest = filled.table.to_string();
        let draft = Draft::of_form(&form(&[(REST, &rest), (ROBOTS, &filled.robots)]));
        assert!(draft.is_ok(), "{} bytes", rest.len());
    }

    #[test]
    fn the_fields_of_the_form_and_the_rest_make_a_campaign() {
        let draft = Draft::of_form(&form(&[
            ("rest", "[world]\nwidth = 700.0\n"),
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

    const CAMERA: &str = "# a camera\r\n[robot]\r\nsensors = [{ half_angle = 0.2, range = 120.0 }]\r\n";

    #[test]
    fn own_robots_stay_as_they_were_written() {
        let draft = || {
            let fields = [
                ("method", "random"),
                ("search.population", "7"),
                ("robots", CAMERA),
            ];
            Draft::of_form(&form(&fields)).unwrap()
        };
        let spec = draft().checked().unwrap();
        assert_eq!(spec.model().preset(), None);
        let Draft::File(text) = draft().into_file() else {
            unreachable!()
        };
        assert_eq!(
            text,
            "method = \"random\"\n\n# a camera\n[robot]\nsensors = [{ half_angle = 0.2, range = 120.0 }]\n\n[search]\npopulation = 7\n"
        );
        assert_eq!(CampaignSpec::from_toml(&text).unwrap(), spec);
        let Draft::Fields(filled) = Draft::with_robots(CAMERA) else {
            unreachable!()
        };
        assert_eq!(filled.robots, CAMERA);
        let Draft::Fields(filled) = Draft::with_robots("[world]\nwidth = 700\n[robot]\nsensors = [{}]\n")
        else {
            unreachable!()
        };
        assert_eq!(filled.robots, "[robot]\nsensors = [\n  {},\n]\n");
        assert!(filled.table.contains_key("world"));
    }

    #[test]
    fn wrong_robots_hide_no_other_error() {
        let problems =
            |fields: &[(&str, &str)]| Draft::of_form(&form(fields)).unwrap().checked().unwrap_err();
        let found = problems(&[
            ("method", "random"),
            ("search.population", "-4"),
            ("world.agents", "abc"),
            (
                "robots",
                "[robot]\nsensors = [\n  { angle = 45 },\n  { fov = 2 },\n]\n",
            ),
        ]);
        let places: Vec<_> = found
            .iter()
            .map(|problem| (problem.field.as_str(), problem.line))
            .collect();
        assert_eq!(
            places,
            [
                ("robot.sensors[0].angle", Some(3)),
                ("robot.sensors[1].fov", Some(4)),
                ("search.population", None),
                ("world.agents", None),
            ]
        );
        let found = problems(&[("method", "random"), ("model", "two-sensor"), ("robots", CAMERA)]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].is_about(ROBOTS), "{found:?}");
        let found = problems(&[
            ("method", "random"),
            ("robots", "seed = 2\n[robot]\nsensors = [{}]\n"),
        ]);
        assert!(found[0].brief().contains("not \"seed\""), "{found:?}");
    }

    #[test]
    fn an_empty_field_has_the_default_of_the_campaign() {
        let Draft::Fields(mut filled) = Draft::usual() else {
            unreachable!()
        };
        let defaults = filled.defaults();
        for (path, value) in [
            ("name", "single-sensor"),
            ("seed", "1"),
            ("world.agents", "24"),
            ("search.population", "100"),
            ("taxonomy.medoids", "12"),
        ] {
            assert_eq!(defaults[path], value, "{path}");
        }
        filled.table.insert("model".to_owned(), "two-sensor".into());
        filled.table.insert("seed".to_owned(), "x".into());
        let defaults = filled.defaults();
        assert_eq!(
            (defaults["taxonomy.medoids"].as_str(), defaults["seed"].as_str()),
            ("16", "1")
        );
        assert!(
            defaults.values().all(|value| !value.is_empty() && value != "x"),
            "{defaults:?}"
        );
    }

    #[test]
    fn what_is_wrong_is_said_with_its_field_and_line() {
        let of = |text: &str| Draft::File(text.to_owned()).checked().unwrap_err();
        for value in ["0", "\"x\""] {
            let wrong = of(&format!(
                "model = \"single-sensor\"\nmethod = \"random\"\n[world]\nagents = 0\n[search]\npopulation = {value}\n"
            ));
            let [agents, population] = &wrong[..] else {
                panic!("{wrong:?}")
            };
            assert!(
                agents.is_about("world.agents") && agents.line == Some(4),
                "{wrong:?}"
            );
            assert!(
                population.is_about("search.population") && population.line == Some(6),
                "{wrong:?}"
            );
        }
        assert_eq!(of("model = ")[0].line, Some(1));
        let wrong = Draft::of_form(&form(&[("method", "random"), ("seed", "-1")]));
        assert!(wrong.unwrap().checked().is_err());
    }
}
