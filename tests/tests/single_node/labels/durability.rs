//! Tests that the coordinator keeps acknowledged labels.

use crate::labels::{
    annotator::{Annotator, stands},
    campaign,
};
use murmuration_tests::{Murmuration, Running};
use tonic::transport::Channel;

fn serve(murmuration: &Murmuration) -> (Running, String) {
    murmuration.serve("127.0.0.1:0", &["--workers", "0"])
}

#[tokio::test(flavor = "multi_thread")]
async fn killed_right_after_it_acknowledged_a_label_the_coordinator_still_knows_it() {
    let (_folder, murmuration) = campaign();
    let (mut coordinator, mut url) = serve(&murmuration);
    let mut message = Vec::new();
    for round in 0..5u64 {
        let channel = Channel::from_shared(url).unwrap().connect().await.unwrap();
        let mut ana = Annotator::of("ana", &channel);
        let (request, index) = (round.to_string(), round * 7);
        ana.say(&request, &[(index, "ring")]).await.unwrap();
        coordinator.kill();
        message.push((index, "ana", "ring"));

        (coordinator, url) = serve(&murmuration);
        let channel = Channel::from_shared(url.clone())
            .unwrap()
            .connect()
            .await
            .unwrap();
        let mut ana = Annotator::of("ana", &channel);
        assert_eq!(ana.standing().await, stands(&message));
        // A client that got no answer sends its request again.
        assert_eq!(ana.say(&request, &[(index, "ring")]).await.unwrap(), [round]);
        assert_eq!(ana.log().await.len() as u64, round + 1);
    }
}
