//! Tests the tokens of people, over gRPC.

use crate::security::Secrets;
use murmuration_link::{Coordinator, Credentials};
use murmuration_proto::v1::{
    self, campaign_service_client::CampaignServiceClient, label_service_client::LabelServiceClient,
};
use murmuration_tests::{Cluster, small_spec};
use tonic::{Code, service::interceptor::InterceptedService};

/// A channel to the cluster's front endpoint with these credentials.
pub(crate) async fn channel(cluster: &Cluster, credentials: &Credentials) -> Coordinator {
    let endpoint = credentials.endpoint(&cluster.url()).unwrap();
    InterceptedService::new(endpoint.connect().await.unwrap(), credentials.bearer())
}

#[tokio::test(flavor = "multi_thread")]
async fn each_role_may_do_its_own_and_no_more() {
    let secrets = Secrets::new();
    // The worker and the trainer in the coordinator's process need no credentials to run the campaign.
    let mut cluster = secrets.cluster(1).await;
    cluster.run(&small_spec("")).await;

    let submit = async |channel: &Coordinator| {
        let request = v1::CreateCampaignRequest {
            campaign: Some(v1::create_campaign_request::Campaign::Spec(
                (&small_spec("")).into(),
            )),
            ..v1::CreateCampaignRequest::default()
        };
        let created = CampaignServiceClient::new(channel.clone())
            .create_campaign(request)
            .await;
        created.map_or_else(|status| status.code(), |_| Code::Ok)
    };
    let label = async |channel: &Coordinator| {
        let answer = v1::Answer {
            index: 3,
            answer: "ring".to_owned(),
            annotator: "somebody else".to_owned(),
            ..Default::default()
        };
        let request = v1::AppendLabelsRequest {
            campaign: "small-1".to_owned(),
            request_id: format!("{channel:p}"),
            answers: vec![answer],
        };
        let message = LabelServiceClient::new(channel.clone())
            .append_labels(request)
            .await;
        message.map_or_else(|status| status.code(), |_| Code::Ok)
    };
    let look = async |channel: &Coordinator| {
        let mut client = CampaignServiceClient::new(channel.clone());
        let listed = client.list_campaigns(v1::ListCampaignsRequest {}).await;
        listed.map_or_else(|status| status.code(), |_| Code::Ok)
    };
    let (ok, denied, unknown) = (Code::Ok, Code::PermissionDenied, Code::Unauthenticated);
    let stranger = murmuration_link::Token::generate().unwrap();
    let people = &secrets.people;
    let cases = [
        (Some(people.viewer.as_str()), [ok, denied, denied]),
        (Some(people.annotator.as_str()), [ok, ok, denied]),
        (Some(people.operator.as_str()), [ok, ok, ok]),
        (Some(stranger.reveal()), [unknown; 3]),
        (None, [unknown; 3]),
    ];
    for (token, expected) in cases {
        let channel = channel(&cluster, &secrets.credentials(token, None)).await;
        let got = [
            look(&channel).await,
            label(&channel).await,
            submit(&channel).await,
        ];
        assert_eq!(got, expected, "{token:?}");
    }
    // A machine's certificate does not admit a person.
    let worker = secrets.credentials(None, Some(&secrets.path("certs/worker")));
    assert_eq!(look(&channel(&cluster, &worker).await).await, unknown);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refusal_says_what_to_do() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let text = async |token: Option<&str>| {
        let channel = channel(&cluster, &secrets.credentials(token, None)).await;
        let request = v1::PauseCampaignRequest {
            campaign: "small-1".to_owned(),
        };
        let refused = CampaignServiceClient::new(channel).pause_campaign(request).await;
        refused.unwrap_err().message().to_owned()
    };
    assert!(text(None).await.contains("MURMURATION_TOKEN_FILE"));
    let viewer = text(Some(&secrets.people.viewer)).await;
    assert_eq!(
        viewer,
        "this needs the role operator; the token of \"ana the viewer\" has the role viewer"
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_annotator_cannot_fill_a_label_log_and_an_operator_can() {
    let secrets = Secrets::new();
    let mut cluster = secrets.cluster(1).await;
    cluster.run(&small_spec("")).await;
    let label = async |token: &str, name: &str, count: u64| {
        let channel = channel(&cluster, &secrets.credentials(Some(token), None)).await;
        let answers = (0..count).map(|place| v1::Answer {
            index: place % 100,
            answer: "ring".to_owned(),
            annotator: "ana".to_owned(),
            ..v1::Answer::default()
        });
        let request = v1::AppendLabelsRequest {
            campaign: "small-1".to_owned(),
            request_id: name.to_owned(),
            answers: answers.collect(),
        };
        let mut client = LabelServiceClient::new(channel).max_encoding_message_size(32 << 20);
        client.append_labels(request).await.map(drop)
    };
    let people = &secrets.people;
    label(&people.annotator, "most", 49_990).await.unwrap();
    let refused = label(&people.annotator, "more", 500).await.unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted, "{refused}");
    assert!(refused.message().contains("ask an operator"), "{refused}");
    // A repeated request does not count towards the limit.
    label(&people.annotator, "most", 49_990).await.unwrap();
    // The annotator can still add a few labels; operators have no such limit.
    label(&people.annotator, "few", 5).await.unwrap();
    label(&people.operator, "further", 500).await.unwrap();
    let channel = channel(&cluster, &secrets.credentials(Some(&people.annotator), None)).await;
    let undo = v1::UndoLabelsRequest {
        campaign: "small-1".to_owned(),
        request_id: "undo".to_owned(),
        annotator: "ana".to_owned(),
    };
    let mut client = LabelServiceClient::new(channel).max_decoding_message_size(32 << 20);
    client.undo_labels(undo).await.unwrap();
    cluster.stop().await;
}
