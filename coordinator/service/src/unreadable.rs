//! Messages that cannot be read. The library blames the coordinator for them (INTERNAL); whoever sent them is told that they
//! are wrong.

use axum::{extract::Request, middleware::Next, response::Response};
use murmuration_proto::Text;
use tonic::{Code, Status};

/// What the library says of such a message.
const SAID: &str = "failed to decode Protobuf message";

/// Blames the client of a method for a message that could not be read before the answer began.
pub async fn blame_the_client(request: Request, next: Next) -> Response {
    let answer = next.run(request).await;
    match Status::from_header_map(answer.headers()) {
        Some(status) if is_unreadable(&status) => blamed(status).into_http(),
        _ => answer,
    }
}

/// The same for one that comes later on a stream.
pub(super) fn blamed(status: Status) -> Status {
    match is_unreadable(&status) {
        true => Status::invalid_argument(Text::line(status.message())),
        false => status,
    }
}

fn is_unreadable(status: &Status) -> bool {
    status.code() == Code::Internal && status.message().starts_with(SAID)
}
