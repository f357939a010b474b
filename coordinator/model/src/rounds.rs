//! How far the rounds of feedback of a campaign are.

/// The rounds of feedback of a campaign. A round's *label cutoff* is the number of entries, from the first, of the label log
/// that it learns from: what is said later is for the next round.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rounds {
    /// Rounds whose fine-tuned checkpoint the archive has switched, or switches, to.
    pub done: u32,
    /// The label cutoff of the last of them; 0 before the first.
    pub last_cutoff: u64,
    /// The label cutoff of the round that is learned now, if one is.
    pub current_cutoff: Option<u64>,
}
