//! How messages are read from and written to the network.

use crate::wire::{self, Refused};
use prost::{Message, Name, bytes::Buf as _};
use std::marker::PhantomData;
use tonic::{
    Status,
    codec::{Codec, DecodeBuf, Decoder},
};
use tonic_prost::{ProstCodec, ProstDecoder, ProstEncoder};

/// Maximum number of messages, texts and lists in a request, at any depth. A request with 50,000 answers has 150,000 of these
/// parts.
pub const MAX_PARTS: usize = 1 << 18;

/// Codec of Protobuf messages that writes `T` and reads `U`. The codec refuses requests of over [`MAX_PARTS`] parts before it
/// decodes them.
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
            is_request: wire::is_request::<U>(),
            inner: ProstCodec::<T, U>::default().decoder(),
        }
    }
}

#[doc(hidden)]
pub struct BoundedDecoder<U> {
    is_request: bool,
    inner: ProstDecoder<U>,
}

impl<U: Name + Default> Decoder for BoundedDecoder<U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        // The buffer of a message is contiguous. The decoder reports bytes that are not a message.
        if self.is_request
            && let Err(refused @ Refused::TooManyParts(_)) = wire::check::<U>(buffer.chunk(), MAX_PARTS)
        {
            return Err(Status::resource_exhausted(format!(
                "the message is refused: {refused}"
            )));
        }
        self.inner.decode(buffer)
    }
}
