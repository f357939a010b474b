//! Conversions of queries to and from their messages.

use super::{AnnotatorSession, Asked, Query, QueryRequest};
use murmuration_proto::v1;
use murmuration_swarm::Invalid;

/// Maximum number of queries that a holder has at once.
const MAX_QUERIES: u32 = 100;
/// Maximum number of characters of a window's name.
const MAX_SESSION: usize = 64;

impl TryFrom<v1::NextQueriesRequest> for QueryRequest {
    type Error = Invalid;

    fn try_from(message: v1::NextQueriesRequest) -> Result<Self, Invalid> {
        let strategy = message.strategy().try_into()?;
        if !(1..=MAX_QUERIES).contains(&message.count) {
            let allowed = format!("a whole number from 1 to {MAX_QUERIES}");
            return Err(Invalid::new("count", message.count, allowed));
        }
        if message.session.chars().count() > MAX_SESSION {
            let allowed = format!("at most {MAX_SESSION} characters");
            return Err(Invalid::new("session", "more", allowed));
        }
        if message.again.len() > MAX_QUERIES as usize {
            let allowed = format!("at most {MAX_QUERIES} individuals");
            return Err(Invalid::new("again", message.again.len(), allowed));
        }
        Ok(Self {
            holder: AnnotatorSession {
                token: None,
                annotator: message.annotator.parse()?,
                session: message.session,
            },
            strategy,
            agreement: message.agreement,
            count: message.count as usize,
            again: message.again.into_iter().map(|index| index as usize).collect(),
        })
    }
}

impl From<Asked> for v1::NextQueriesResponse {
    fn from(asked: Asked) -> Self {
        let query = |query: Query| v1::Query {
            index: query.index as u64,
            reason: query.reason.to_string(),
        };
        Self {
            queries: asked.queries.into_iter().map(query).collect(),
            answered: asked.answered,
            own: asked.own,
            synthetic: asked.synthetic,
            individuals: asked.individuals,
        }
    }
}
