//! Names of tracked robots.

use murmuration_swarm::text::quoted;
use std::fmt;

/// The name of a robot in its file: a whole number, or a word such as `track_7`. Names are in the order of their words, and then
/// of the numbers at their ends: `track_2` comes before `track_10`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct RobotName {
    /// The name, without the number at its end.
    word: String,
    number: Option<u64>,
    text: String,
}

impl RobotName {
    /// The name with this text; `None` for a number that is not whole.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let is_number = text.parse::<f64>().is_ok();
        let digits = text.bytes().rev().take_while(u8::is_ascii_digit).count();
        let (word, number) = text.split_at(text.len() - digits);
        match is_number && !word.is_empty() {
            true => None,
            false => Some(Self {
                word: word.to_owned(),
                // A longer number is in the order of its text.
                number: number.parse().ok(),
                text: text.to_owned(),
            }),
        }
    }
}

impl fmt::Display for RobotName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.word.is_empty() {
            true => f.write_str(&self.text),
            false => write!(f, "{}", quoted(&self.text)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_are_in_the_order_of_their_numbers() {
        let names = ["2", "10", "ant", "track_2", "track_10", "track_10_b"];
        let parsed: Vec<RobotName> = names.iter().map(|name| RobotName::parse(name).unwrap()).collect();
        assert!(parsed.is_sorted(), "{parsed:?}");
        assert_eq!(parsed[1].to_string(), "10");
        assert_eq!(parsed[3].to_string(), "\"track_2\"");
        for number in ["1.5", "-1", "1e3", "inf", "NaN"] {
            assert_eq!(RobotName::parse(number), None, "{number}");
        }
    }
}
