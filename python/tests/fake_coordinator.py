"""A coordinator with answers chosen by a test, and the answers of an honest coordinator."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import grpc
from google.protobuf.message import Message

from murmuration.v1 import campaign_pb2 as v1
from murmuration.v1 import evaluation_pb2 as evaluation
from murmuration.v1 import label_pb2 as labels
from murmuration.v1 import worker_pb2 as worker

ID = "told-1"
SIDE, HORIZON, ROBOTS, STARTS = 5, 2, 3, 2
GENES = [0.1, 0.2, 0.3, 0.4]
FEATURES = [1.0, 2.0, 3.0, 4.0, 5.0]
EMBEDDING = [0.5, 1.5]
IMAGE = bytes(range(SIDE * SIDE))
DIGEST = "0123456789abcdef" * 4

# The answer of each method, `SERVICE/METHOD`; a list if the answer is a stream. Bytes stand for an invalid message, and
# a status with its text stands for a refusal.
Told = dict[str, Any]


class _Handler(grpc.GenericRpcHandler):
    """Answers each method with the test's answer, whatever the request."""

    def __init__(self, told: Told) -> None:
        self._told = told

    def service(self, details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler[Any, Any] | None:
        told = self._told.get(details.method.removeprefix("/murmuration.v1."))
        if told is None:
            return None
        if isinstance(told, tuple):
            return grpc.stream_stream_rpc_method_handler(lambda _, context: context.abort(*told))
        if not isinstance(told, list):
            return grpc.unary_unary_rpc_method_handler(lambda *_: told, response_serializer=_bytes)
        if details.method.endswith("/Evaluate"):
            return grpc.stream_stream_rpc_method_handler(lambda *_: iter(told), response_serializer=_bytes)
        return grpc.unary_stream_rpc_method_handler(lambda *_: iter(told), response_serializer=_bytes)


@contextmanager
def coordinator(told: Told) -> Iterator[str]:
    """The URL of a coordinator with the answers `told`, which may change meanwhile."""
    server = grpc.server(ThreadPoolExecutor(4), handlers=[_Handler(told)])
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.stop(None).wait()


def honest() -> Told:
    """The answers of an honest coordinator with one completed campaign: 2 generations of 2 individuals."""
    campaign = _campaign()
    robust = [2, 1, 0, 2]
    taxonomy = v1.Taxonomy(medoids=[_medoid(0), _medoid(3)], clusters=[0, 0, 1, 1], loss=0.5, robust_trials=robust)
    answer = labels.Answer(index=1, answer="milling", annotator="ana", time_ms=1)
    result = evaluation.EvaluateResult(trials=[_trial(), _trial()])
    poses = [0.5] * (HORIZON + 1) * ROBOTS * 3
    return {
        "CampaignService/GetCampaign": campaign,
        "CampaignService/ListCampaigns": [v1.ListCampaignsResponse(campaigns=[campaign])],
        "CampaignService/WatchCampaign": [campaign],
        "CampaignService/GetArchive": [
            v1.ArchiveChunk(individuals=[individual(2 * k), individual(2 * k + 1)]) for k in (0, 1)
        ],
        "CampaignService/GetIndividual": individual(3),
        "CampaignService/GetTaxonomy": [taxonomy],
        "CampaignService/GetDigest": v1.GetDigestResponse(digest=DIGEST),
        "CampaignService/ListGenerations": [
            v1.ListGenerationsResponse(generations=[v1.GenerationSummary(generation=k, best_novelty=1.0)])
            for k in (0, 1)
        ],
        "CampaignService/GetReplay": [v1.Replay(steps=[0, 1, HORIZON], poses=poses, agents=ROBOTS)],
        "LabelService/ListLabels": [labels.ListLabelsResponse(labels=[labels.Label(entry=0, answer=answer)])],
        "EvaluationService/Evaluate": [evaluation.EvaluateResponse(results=[result, result], side=SIDE)],
        "EvaluationService/Simulate": [
            evaluation.Motion(agents=ROBOTS, poses=[0.5] * ROBOTS * 3) for _ in range(HORIZON + 1)
        ],
    }


def individual(index: int) -> v1.Individual:
    """An individual of the honest archive, with its picture."""
    trials = [v1.Trial(seed=start, features=FEATURES, embedding=EMBEDDING) for start in range(STARTS)]
    return v1.Individual(
        index=index,
        generation=index // 2,
        controller=GENES,
        features=FEATURES,
        embedding=EMBEDDING,
        image=IMAGE,
        novelty=1.0,
        trials=trials,
    )


def _campaign() -> v1.Campaign:
    spec = v1.CampaignSpec(
        method=v1.METHOD_LATENT,
        world=v1.World(agents=ROBOTS, horizon=HORIZON),
        image=v1.ImageFormat(resolution=SIDE),
        search=v1.Search(population=2, generations=2),
        evaluation=v1.EvaluationParams(starts=STARTS),
    )
    return v1.Campaign(
        id=ID, spec=spec, state=v1.CAMPAIGN_STATE_COMPLETED, generations=2, generations_done=2, checkpoint=DIGEST
    )


def _medoid(index: int) -> v1.Medoid:
    return v1.Medoid(individual=individual(index), cluster_size=2, mean_distance=0.1, novelty=1.0)


def _trial() -> worker.Evaluation:
    return worker.Evaluation(features=FEATURES, embedding=EMBEDDING, image=IMAGE)


def _bytes(message: Message | bytes) -> bytes:
    return message if isinstance(message, bytes) else message.SerializeToString()
