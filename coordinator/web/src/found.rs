//! Searches in the list of campaigns. A request returns one page of results, so that the list responds quickly with any number of
//! campaigns.

use murmuration_engine::campaign::ListedCampaign;
use murmuration_model::{CampaignId, CampaignState, Scalar};
use murmuration_swarm::{CampaignName, Invalid, counted, text::quoted};
use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    str::FromStr,
};

/// Maximum number of lines of a page, and of campaigns of a study on a page.
const MOST: usize = 50;

/// The states by which people can filter the list; `running` covers all stages.
pub(super) const STATES: [&str; 7] = [
    "running",
    "waiting",
    "interrupted",
    "paused",
    "completed",
    "failed",
    "cancelled",
];

/// The order of the list's lines.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Order {
    #[default]
    Newest,
    Oldest,
    /// By the name in the id, newest first among equal names.
    Name,
    /// By the place of the state in [`STATES`], newest first among equal states.
    State,
    /// By a scalar, highest first. Campaigns without the scalar come last, also in the reversed order.
    By(Scalar),
}

impl Order {
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let others = [Self::Newest, Self::Oldest, Self::Name, Self::State];
        others.into_iter().chain(Scalar::ALL.map(Self::By))
    }

    /// The name in the address.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Newest => "newest",
            Self::Oldest => "oldest",
            Self::Name => "name",
            Self::State => "state",
            Self::By(scalar) => scalar.name(),
        }
    }

    /// The name on the page.
    pub(super) fn title(self) -> String {
        match self {
            Self::By(scalar) => scalar.title(),
            other => other.name().to_owned(),
        }
    }
}

impl FromStr for Order {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let known = Self::all().find(|order| order.name() == text);
        known.ok_or_else(|| {
            let names: Vec<&str> = Self::all().map(Self::name).collect();
            Invalid::new("order", quoted(text), format!("one of {}", names.join(", ")))
        })
    }
}

/// The parameters of the list's address; an empty field does not filter.
#[derive(Debug, Clone, Default)]
pub(super) struct Wanted {
    /// Words to find in the id, the state, the study, the tags, the note or the first lines of the specification of a campaign.
    pub(super) words: Words,
    /// The wanted state, from [`STATES`].
    pub(super) state: String,
    /// The tag of the wanted campaigns.
    pub(super) tag: String,
    /// The study whose campaigns are wanted; the list then has one line for each campaign of the study.
    pub(super) study: String,
    pub(super) order: Order,
    /// Whether the order is reversed.
    pub(super) reversed: bool,
    /// Scalars that the list shows.
    pub(super) shown: BTreeSet<Scalar>,
    /// The number of the page, from 0.
    pub(super) page: usize,
}

impl TryFrom<Vec<(String, String)>> for Wanted {
    type Error = Invalid;

    /// Reads the parameters of an address. Unknown parameters are ignored.
    fn try_from(parameters: Vec<(String, String)>) -> Result<Self, Invalid> {
        let mut wanted = Self::default();
        for (name, value) in parameters {
            match name.as_str() {
                "words" => wanted.words = value.try_into()?,
                "state" => wanted.state = value,
                "tag" => wanted.tag = value,
                "study" => wanted.study = value,
                "order" => wanted.order = value.parse()?,
                "reversed" => wanted.reversed = true,
                "show" => {
                    wanted.shown.insert(value.parse()?);
                }
                "page" => {
                    let page = value.parse();
                    wanted.page = page.map_err(|_| Invalid::new("page", quoted(&value), "a whole number"))?;
                }
                _ => {}
            }
        }
        Ok(wanted)
    }
}

/// A scalar of the campaigns that have it.
pub(super) type Values = HashMap<CampaignId, f64>;

/// Words to find, at most [`MOST_CHARACTERS`] characters: every campaign is searched for every word.
#[derive(Debug, Clone, Default)]
pub(super) struct Words(String);

/// Maximum length of the words to find.
const MOST_CHARACTERS: usize = 200;

impl TryFrom<String> for Words {
    type Error = Invalid;

    fn try_from(words: String) -> Result<Self, Invalid> {
        let count = words.chars().count();
        if count <= MOST_CHARACTERS {
            return Ok(Self(words));
        }
        let value = counted(count as u64, "character");
        Err(Invalid::new(
            "words",
            value,
            format!("at most {MOST_CHARACTERS} characters"),
        ))
    }
}

impl Words {
    pub(super) fn as_str(&self) -> &str {
        &self.0
    }
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Found {
    /// The lines of the page, in the wanted order.
    pub(super) lines: Vec<Line>,
    /// Number of matching campaigns on all pages.
    pub(super) matching: usize,
    /// Number of all campaigns.
    pub(super) all: usize,
    /// Number of pages of matching campaigns.
    pub(super) pages: usize,
}

#[derive(Debug, PartialEq, Eq)]
pub(super) enum Line {
    Campaign(CampaignId),
    Study {
        name: CampaignName,
        /// The study's first matching campaigns.
        cells: Vec<CampaignId>,
        /// Number of matching campaigns by state.
        states: BTreeMap<&'static str, u64>,
    },
}

impl Wanted {
    /// Whether the search excludes any campaigns.
    pub(super) fn filters(&self) -> bool {
        [&self.words.0, &self.state, &self.tag, &self.study]
            .into_iter()
            .any(|asked| !asked.trim().is_empty())
    }

    /// The same order and scalars, of all campaigns.
    pub(super) fn unfiltered(&self) -> Self {
        Self {
            order: self.order,
            reversed: self.reversed,
            shown: self.shown.clone(),
            ..Self::default()
        }
    }

    /// The scalars that the list shows: the chosen ones, and the one by which it is sorted. Every line has the duration anyway.
    pub(super) fn scalars(&self) -> Vec<Scalar> {
        let sorted = match self.order {
            Order::By(scalar) => Some(scalar),
            _ => None,
        };
        let shown: BTreeSet<Scalar> = self.shown.iter().copied().chain(sorted).collect();
        shown
            .into_iter()
            .filter(|scalar| *scalar != Scalar::Duration)
            .collect()
    }

    /// The address of a page of the results. Parameters with their default values are left out.
    pub(super) fn address(&self, path: &str, page: usize) -> String {
        let page = page.to_string();
        let single = [
            ("words", self.words.as_str(), ""),
            ("state", &self.state, ""),
            ("tag", &self.tag, ""),
            ("study", &self.study, ""),
            ("order", self.order.name(), Order::default().name()),
            ("reversed", if self.reversed { "yes" } else { "" }, ""),
            ("page", &page, "0"),
        ];
        let single = single.into_iter().filter(|(_, value, default)| value != default);
        let shown = self.shown.iter().map(|scalar| ("show", scalar.name()));
        let pairs: Vec<_> = single
            .map(|(name, value, _)| (name, value))
            .chain(shown)
            .collect();
        match serde_urlencoded::to_string(pairs) {
            Ok(query) if !query.is_empty() => format!("{path}?{query}"),
            _ => path.to_owned(),
        }
    }

    /// The wanted page of `campaigns`, which are sorted oldest first. `values` has the scalar of the order, if it is one.
    pub(super) fn of(&self, campaigns: &[ListedCampaign], values: &Values) -> Found {
        let words = self.words.0.to_lowercase();
        let words: Vec<&str> = words.split_whitespace().collect();
        let newest_first = campaigns.iter().rev();
        let mut matching: Vec<_> = newest_first
            .filter(|listed| self.matches(&words, listed))
            .collect();
        self.sort(&mut matching, values);
        let lines = self.lines(&matching);
        let pages = lines.len().div_ceil(MOST).max(1);
        let first = self.page.min(pages - 1) * MOST;
        Found {
            lines: lines.into_iter().skip(first).take(MOST).collect(),
            matching: matching.len(),
            all: campaigns.len(),
            pages,
        }
    }

    /// Sorts campaigns, which are sorted newest first.
    fn sort(&self, newest_first: &mut [&ListedCampaign], values: &Values) {
        let name = |listed: &&ListedCampaign| {
            let id = listed.head.id.as_str();
            let name = id.rsplit_once('-').map_or(id, |(name, _)| name);
            name.to_lowercase()
        };
        let state = |listed: &&ListedCampaign| {
            let word = state_word(listed);
            STATES.iter().position(|state| *state == word)
        };
        match self.order {
            Order::Newest => {}
            Order::Oldest => newest_first.reverse(),
            Order::Name => newest_first.sort_by_key(name),
            Order::State => newest_first.sort_by_key(state),
            Order::By(_) => {
                let value = |listed: &&ListedCampaign| values.get(&listed.head.id);
                newest_first.sort_by(|one, other| match (value(one), value(other)) {
                    (Some(one), Some(other)) if self.reversed => one.total_cmp(other),
                    (Some(one), Some(other)) => other.total_cmp(one),
                    (one, other) => other.is_some().cmp(&one.is_some()),
                });
                return;
            }
        }
        if self.reversed {
            newest_first.reverse();
        }
    }

    fn matches(&self, words: &[&str], listed: &ListedCampaign) -> bool {
        let study = listed.head.study.as_ref().map_or("", CampaignName::as_str);
        let state = state_word(listed);
        if !self.state.is_empty() && self.state != state || !self.study.is_empty() && self.study != study {
            return false;
        }
        let notes = &listed.head.notes;
        if !self.tag.is_empty() && !notes.tags.have(&self.tag) {
            return false;
        }
        if words.is_empty() {
            return true;
        }
        let (id, opening) = (&listed.head.id, &listed.head.opening);
        let text = format!(
            "{id} {study} {state} {} {} {opening}",
            notes.tags,
            notes.note.as_str()
        )
        .to_lowercase();
        words.iter().all(|word| text.contains(word))
    }

    /// All lines, in the order of `matching`; a study has the place of its first campaign.
    fn lines(&self, matching: &[&ListedCampaign]) -> Vec<Line> {
        let mut lines = Vec::new();
        let mut places: BTreeMap<&str, usize> = BTreeMap::new();
        for listed in matching {
            let id = &listed.head.id;
            let Some(study) = listed.head.study.as_ref().filter(|_| self.study.is_empty()) else {
                lines.push(Line::Campaign(id.clone()));
                continue;
            };
            let place = *places.entry(study.as_str()).or_insert_with(|| {
                lines.push(Line::Study {
                    name: study.clone(),
                    cells: Vec::new(),
                    states: BTreeMap::new(),
                });
                lines.len() - 1
            });
            if let Line::Study { cells, states, .. } = &mut lines[place] {
                if cells.len() < MOST {
                    cells.push(id.clone());
                }
                *states.entry(state_word(listed)).or_default() += 1;
            }
        }
        lines
    }
}

impl Found {
    /// The ids of the campaigns on this page.
    pub(super) fn ids(&self) -> Vec<CampaignId> {
        let of = |line: &Line| match line {
            Line::Campaign(id) => vec![id.clone()],
            Line::Study { cells, .. } => cells.clone(),
        };
        self.lines.iter().flat_map(of).collect()
    }
}

/// The state by which the list is filtered.
fn state_word(listed: &ListedCampaign) -> &'static str {
    match listed.head.state {
        CampaignState::Running if !listed.active => "interrupted",
        CampaignState::Running if listed.waiting => "waiting",
        CampaignState::Running => "running",
        state => state.name(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_model::{CampaignHead, CampaignNotes};

    fn listed(number: usize, study: &str, state: CampaignState) -> ListedCampaign {
        let name = if study.is_empty() { "alone" } else { study };
        ListedCampaign {
            head: CampaignHead {
                id: format!("{name}-{number}").parse().unwrap(),
                study: CampaignName::try_from(study.to_owned()).ok(),
                notes: CampaignNotes::default(),
                state,
                opening: "name = \"x\"\nmethod = \"Latent\"\n".to_owned(),
            },
            active: true,
            waiting: false,
        }
    }

    fn wanted(words: &str, state: &str, study: &str, page: usize) -> Wanted {
        let [words, state, study] = [words, state, study].map(str::to_owned);
        Wanted {
            words: words.try_into().unwrap(),
            state,
            study,
            page,
            ..Wanted::default()
        }
    }

    #[test]
    fn the_list_is_sorted_as_asked() {
        let mut campaigns = vec![
            listed(1, "", CampaignState::Completed),
            listed(2, "", CampaignState::Running),
            listed(3, "", CampaignState::Failed),
        ];
        campaigns[2].head.id = "Aardvark-3".parse().unwrap();
        let ids = |order| {
            let wanted = Wanted {
                order,
                ..Wanted::default()
            };
            let ids = wanted.of(&campaigns, &Values::new()).ids();
            ids.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(ids(Order::Newest), ["Aardvark-3", "alone-2", "alone-1"]);
        assert_eq!(ids(Order::Oldest), ["alone-1", "alone-2", "Aardvark-3"]);
        assert_eq!(ids(Order::Name), ["Aardvark-3", "alone-2", "alone-1"]);
        assert_eq!(ids(Order::State), ["alone-2", "alone-1", "Aardvark-3"]);
    }

    #[test]
    fn ten_thousand_are_shown_a_page_at_a_time() {
        let campaigns: Vec<_> = (1..=10_000)
            .map(|number| listed(number, "", CampaignState::Completed))
            .collect();
        let last = wanted("", "", "", 199).of(&campaigns, &Values::new());
        assert_eq!((last.pages, last.matching, last.lines.len()), (200, 10_000, MOST));
        assert_eq!(
            last.lines.last(),
            Some(&Line::Campaign("alone-1".parse().unwrap()))
        );
        let beyond = wanted("", "", "", 1_000).of(&campaigns, &Values::new());
        assert_eq!(beyond, last);
        let few = wanted("LATENT alone-77", "completed", "", 0).of(&campaigns, &Values::new());
        assert_eq!((few.matching, few.all, few.pages), (111, 10_000, 3));
        assert_eq!(
            wanted("", "running", "", 0).of(&campaigns, &Values::new()).lines,
            []
        );
    }

    #[test]
    fn a_study_is_one_line_until_it_is_asked_for() {
        let mut campaigns: Vec<_> = (1..=60)
            .map(|number| listed(number, "mini", CampaignState::Paused))
            .collect();
        campaigns.push(listed(61, "", CampaignState::Running));
        campaigns.push(listed(62, "mini", CampaignState::Running));
        let folded = wanted("", "", "", 0).of(&campaigns, &Values::new());
        let [Line::Study { cells, states, .. }, Line::Campaign(_)] = &folded.lines[..] else {
            panic!("{folded:?}");
        };
        assert_eq!((cells.len(), cells[0].as_str()), (MOST, "mini-62"));
        assert_eq!(states, &BTreeMap::from([("paused", 60), ("running", 1)]));
        let unfolded = wanted("", "", "mini", 1).of(&campaigns, &Values::new());
        assert_eq!((unfolded.lines.len(), unfolded.pages), (11, 2));
    }

    #[test]
    fn tags_and_notes_are_found() {
        let mut campaigns: Vec<_> = (1..=3)
            .map(|number| listed(number, "", CampaignState::Completed))
            .collect();
        campaigns[0].head.notes.tags = "baseline paper".parse().unwrap();
        campaigns[1].head.notes.tags = "base".parse().unwrap();
        campaigns[2].head.notes.note = "As the Baseline, with noise".parse().unwrap();
        let ids = |wanted: Wanted| -> Vec<String> {
            let ids = wanted.of(&campaigns, &Values::new()).ids();
            ids.iter().map(ToString::to_string).collect()
        };
        let tagged = |tag: &str, words: &str| Wanted {
            tag: tag.to_owned(),
            ..wanted(words, "", "", 0)
        };
        assert_eq!(ids(wanted("BASELINE", "", "", 0)), ["alone-3", "alone-1"]);
        assert_eq!(ids(wanted("noise as", "", "", 0)), ["alone-3"]);
        assert_eq!(ids(tagged("base", "")), ["alone-2"]);
        assert_eq!(ids(tagged("paper", "latent")), ["alone-1"]);
        assert!(ids(tagged("paper", "noise")).is_empty() && tagged("paper", "").filters());
    }

    #[test]
    fn long_words_are_refused() {
        assert!(Words::try_from("-".repeat(200)).is_ok());
        let refused = Words::try_from("-".repeat(201)).unwrap_err().to_string();
        assert_eq!(refused, "words = 201 characters: must be at most 200 characters");
    }

    #[test]
    fn campaigns_without_a_scalar_come_last_in_both_directions() {
        let campaigns: Vec<_> = (1..=4)
            .map(|number| listed(number, "", CampaignState::Completed))
            .collect();
        let values = [(1, 0.5), (3, 2.0), (4, 0.5)];
        let values: Values = values
            .map(|(number, value)| (campaigns[number - 1].head.id.clone(), value))
            .into();
        let ids = |reversed| {
            let wanted = Wanted {
                order: Order::By(Scalar::Loss),
                reversed,
                ..Wanted::default()
            };
            let ids = wanted.of(&campaigns, &values).ids();
            ids.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(ids(false), ["alone-3", "alone-4", "alone-1", "alone-2"]);
        assert_eq!(ids(true), ["alone-4", "alone-1", "alone-3", "alone-2"]);
    }

    #[test]
    fn the_list_shows_the_scalars_that_people_choose_and_sort_by() {
        let wanted = |order| Wanted {
            order,
            shown: [Scalar::Loss, Scalar::Clusters].into(),
            ..Wanted::default()
        };
        let shown = [Scalar::Clusters, Scalar::Loss];
        assert_eq!(wanted(Order::Newest).scalars(), shown);
        assert_eq!(wanted(Order::By(Scalar::Loss)).scalars(), shown);
        assert_eq!(wanted(Order::By(Scalar::Duration)).scalars(), shown);
        let more = [Scalar::Evaluations, Scalar::Clusters, Scalar::Loss];
        assert_eq!(wanted(Order::By(Scalar::Evaluations)).scalars(), more);
    }

    #[test]
    fn an_address_keeps_what_is_wanted() {
        assert_eq!(Wanted::default().address("/", 0), "/");
        let all =
            "words=a+b&state=paused&tag=x&study=mini&order=loss&reversed=yes&page=2&show=clusters&show=loss";
        let pairs: Vec<(String, String)> = serde_urlencoded::from_str(all).unwrap();
        let wanted = Wanted::try_from(pairs).unwrap();
        assert_eq!(wanted.address("/", 2), format!("/?{all}"));
        for (name, value) in [("page", "-1"), ("order", "best"), ("show", "x")] {
            let refused = Wanted::try_from(vec![(name.to_owned(), value.to_owned())]);
            assert!(refused.unwrap_err().to_string().contains(value), "{name}");
        }
    }
}
