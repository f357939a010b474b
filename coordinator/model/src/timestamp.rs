//! Points in time, for programs to exchange and for people to read.

use std::{fmt, str::FromStr};
use time::{OffsetDateTime, format_description::well_known::Rfc3339};

const NANOS_PER_MS: i128 = 1_000_000;

/// Milliseconds from 1970-01-01 UTC to the last millisecond of the year 9999, where RFC 3339 ends.
const LAST_MS: u64 = 253_402_300_799_999;

/// A point in time, to the millisecond: 1970-01-01 to 9999-12-31, UTC. The text of a timestamp is in RFC 3339, such as
/// `2026-11-21T12:00:00.5Z`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Timestamp {
    ms: u64,
}

/// The text is not a [`Timestamp`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("must be a time such as 2026-11-21T12:00:00Z, not before 1970")]
pub struct NotATimestamp;

impl Timestamp {
    /// The time `ms` milliseconds after 1970-01-01 UTC. A time after the year 9999 becomes the last millisecond of that year.
    pub fn from_ms(ms: u64) -> Self {
        Self { ms: ms.min(LAST_MS) }
    }

    /// Milliseconds since 1970-01-01 UTC.
    pub const fn ms(self) -> u64 {
        self.ms
    }

    /// The day, as in `2026-11-21`.
    pub fn day(self) -> String {
        self.date_time().date().to_string()
    }

    fn date_time(self) -> OffsetDateTime {
        let time = OffsetDateTime::from_unix_timestamp_nanos(i128::from(self.ms) * NANOS_PER_MS);
        // Every time up to the year 9999 is in range.
        time.unwrap_or(OffsetDateTime::UNIX_EPOCH)
    }
}

impl fmt::Display for Timestamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.date_time().format(&Rfc3339);
        f.write_str(&text.map_err(|_| fmt::Error)?)
    }
}

impl FromStr for Timestamp {
    type Err = NotATimestamp;

    fn from_str(text: &str) -> Result<Self, NotATimestamp> {
        let time = OffsetDateTime::parse(text, &Rfc3339).map_err(|_| NotATimestamp)?;
        let ms = time.unix_timestamp_nanos().div_euclid(NANOS_PER_MS);
        u64::try_from(ms).map(Self::from_ms).map_err(|_| NotATimestamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn texts_and_days_are_those_of_the_calendar() {
        let check = |seconds: u64, expected: &str| {
            let time = Timestamp::from_ms(seconds * 1000);
            assert_eq!(
                (time.to_string(), time.day()),
                (format!("{expected}T00:00:00Z"), expected.to_owned())
            );
        };
        check(0, "1970-01-01");
        check(951_782_400, "2000-02-29");
        check(951_868_800, "2000-03-01");
        check(1_735_603_200, "2024-12-31");
        check(4_107_542_400, "2100-03-01");
        check(1_795_219_200, "2026-11-21");
        assert_eq!(
            Timestamp::from_ms(1_795_219_200_500).to_string(),
            "2026-11-21T00:00:00.5Z"
        );
        assert_eq!(Timestamp::from_ms(86_399_999).day(), "1970-01-01");
    }

    #[test]
    fn other_texts_are_refused_and_other_offsets_understood() {
        for text in [
            "",
            "1763700000000",
            "2026-11-21",
            "2026-11-21T12:00:00",
            "1969-12-31T23:59:59Z",
            "soon",
        ] {
            assert_eq!(text.parse::<Timestamp>(), Err(NotATimestamp), "{text:?}");
        }
        let east = "2026-11-21T13:00:00+01:00".parse::<Timestamp>();
        assert_eq!(east, "2026-11-21T12:00:00Z".parse());
    }

    #[test]
    fn the_last_time_is_that_of_the_year_9999() {
        let last = Timestamp::from_ms(u64::MAX);
        assert_eq!(last.to_string(), "9999-12-31T23:59:59.999Z");
        assert_eq!(last.to_string().parse(), Ok(last));
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(ms in 0..=253_402_300_799_999_u64) {
            let time = Timestamp::from_ms(ms);
            prop_assert_eq!(time.ms(), ms);
            prop_assert_eq!(time.to_string().parse(), Ok(time));
        }
    }
}
