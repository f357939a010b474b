//! How messages are written to and read from the network.

use crate::wire::{PartLimit, Refused};
use prost::{Message, Name, bytes::Buf as _};
use std::marker::PhantomData;
use tonic::{
    Status,
    codec::{Codec, DecodeBuf, Decoder},
};
use tonic_prost::{ProstCodec, ProstDecoder, ProstEncoder};

/// Maximum number of messages, texts and lists in a request. 50,000 answers with their names have 150,000.
pub const MAX_REQUEST_PARTS: usize = 1 << 18;

/// Codec of Protobuf messages that writes `T` and reads `U`. It refuses a request of over [`MAX_REQUEST_PARTS`] parts before
/// decoding it.
#[doc(hidden)]
#[derive(Debug)]
pub struct BoundedCodec<T, U>(PhantomData<(T, U)>);

impl<T, U> Default for BoundedCodec<T, U> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<T, U> Codec for BoundedCodec<T, U>
where
    T: Message + Send + 'static,
    U: Name + Default + Send + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = ProstEncoder<T>;
    type Decoder = BoundedDecoder<U>;

    fn encoder(&mut self) -> Self::Encoder {
        ProstCodec::<T, U>::default().encoder()
    }

    fn decoder(&mut self) -> Self::Decoder {
        BoundedDecoder {
            limit: PartLimit::of_request::<U>(MAX_REQUEST_PARTS),
            inner: ProstCodec::<T, U>::default().decoder(),
        }
    }
}

#[doc(hidden)]
pub struct BoundedDecoder<U> {
    /// `None` for answers, because the client chose the server that sends them.
    limit: Option<PartLimit>,
    inner: ProstDecoder<U>,
}

impl<U: Name + Default> Decoder for BoundedDecoder<U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        // The buffer of a message is contiguous. The decoder reports bytes that are not a message.
        let checked = self.limit.map_or(Ok(()), |limit| limit.check(buffer.chunk()));
        if let Err(refused @ Refused::TooManyParts(_)) = checked {
            return Err(Status::resource_exhausted(format!("the message is refused: {refused}")));
        }
        self.inner.decode(buffer)
    }
}
