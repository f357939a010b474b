//! Answers that may be longer than one message: a stream of parts.
//!
//! The parts are merged by protobuf's own rule, which every language's library implements: lists are joined in order, and any
//! other field gets its last value.

use prost::Message;
use tokio_stream::{Stream, StreamExt as _};
use tonic::Status;

/// Maximum number of bytes in one message of a stream of parts (1 MiB).
pub const PART_BYTES: usize = 1 << 20;
/// Maximum number of bytes of a whole answer (4 GiB): more than all labels or generations of the largest campaign.
const MAX_BYTES: u64 = 4 << 30;

/// Merges a stream of parts into the whole answer.
///
/// # Errors
/// The error that ended the stream; RESOURCE_EXHAUSTED if the whole is longer than 4 GiB.
pub async fn whole<M: Message + Default>(
    mut parts: impl Stream<Item = Result<M, Status>> + Unpin,
) -> Result<M, Status> {
    let mut whole = M::default();
    let mut bytes = 0;
    while let Some(part) = parts.next().await {
        let part = part?.encode_to_vec();
        bytes += part.len() as u64;
        if bytes > MAX_BYTES {
            let message = format!("the answer is longer than {MAX_BYTES} bytes");
            return Err(Status::resource_exhausted(message));
        }
        let merged = whole.merge(part.as_slice());
        merged.map_err(|error| Status::internal(error.to_string()))?;
    }
    Ok(whole)
}

/// Splits `items` into lists of about [`PART_BYTES`] each, and returns the message that `part` makes of each list. Without items,
/// it returns no messages.
pub fn parts<T: Message, M>(
    items: impl IntoIterator<Item = T>,
    part: impl Fn(Vec<T>) -> M,
) -> impl Iterator<Item = M> {
    let mut items = items.into_iter();
    std::iter::from_fn(move || {
        let (mut list, mut bytes) = (Vec::new(), 0);
        while bytes < PART_BYTES {
            let Some(item) = items.next() else { break };
            bytes += item.encoded_len();
            list.push(item);
        }
        (!list.is_empty()).then(|| part(list))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1;

    fn campaign(number: usize, error: usize) -> v1::Campaign {
        v1::Campaign {
            id: format!("small-{number}"),
            error: "x".repeat(error),
            ..v1::Campaign::default()
        }
    }

    fn list(campaigns: Vec<v1::Campaign>) -> v1::ListCampaignsResponse {
        v1::ListCampaignsResponse { campaigns }
    }

    #[tokio::test]
    async fn parts_make_the_whole_again() {
        let campaigns: Vec<_> = (0..500).map(|number| campaign(number, 10_000)).collect();
        let sent: Vec<_> = parts(campaigns.clone(), list).collect();
        assert!(sent.len() > 4, "{} parts", sent.len());
        assert!(sent.iter().all(|part| part.encoded_len() < 2 * PART_BYTES));
        let stream = tokio_stream::iter(sent.into_iter().map(Ok));
        assert_eq!(whole(stream).await.unwrap(), list(campaigns));
    }

    #[tokio::test]
    async fn of_nothing_there_are_no_parts() {
        let mut none = parts(Vec::new(), list);
        assert!(none.next().is_none());
        let stream = tokio_stream::iter(none.map(Ok));
        assert_eq!(whole(stream).await.unwrap(), list(Vec::new()));
    }

    #[tokio::test]
    async fn a_stream_that_breaks_is_no_answer() {
        let sent = [Ok(list(vec![campaign(1, 1)])), Err(Status::unavailable("gone"))];
        let text = whole(tokio_stream::iter(sent)).await.unwrap_err();
        assert_eq!(text.message(), "gone");
    }
}
