//! Ids that no campaign has.

use super::{open, spec};
use crate::Decision;
use murmuration_model::Weight;

#[test]
fn an_id_that_is_almost_that_of_a_campaign_is_answered_with_that() {
    let (_folder, store) = open();
    let id = store.create_campaign(&spec(), Weight::default(), 7).unwrap();
    let said = |id: &str| store.campaign(id).unwrap_err().to_string();
    let typed = id.as_str().replace('-', "_");
    assert!(
        said(&typed).contains(&format!("did you mean \"{id}\"?")),
        "{}",
        said(&typed)
    );
    for other in ["nothing-like-it-9", &id.as_str().repeat(100)] {
        assert!(!said(other).contains("did you mean"), "{}", said(other));
    }
    store.decide(&id, Decision::Cancel, false).unwrap();
    store.delete_campaign(&id, None, false).unwrap();
    assert!(!said(id.as_str()).contains("did you mean"));
}
