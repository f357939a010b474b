"""Impossible answers of a coordinator: each becomes an error of the library that names the fault."""

import copy
import random
import warnings
from collections.abc import Callable, Iterator
from math import inf, nan
from pathlib import Path
from typing import Any

import grpc
import pytest
from fake_coordinator import GENES, ID, SIDE, Told, coordinator, honest
from google.protobuf.message import Message

import murmuration as mm
from murmuration.v1 import campaign_pb2 as v1
from murmuration.v1 import evaluation_pb2 as evaluation
from murmuration.v1 import label_pb2 as labels

ROBOT = "single-sensor"
TWO = [GENES, GENES]
ARCHIVE = "CampaignService/GetArchive"
CAMPAIGN = "CampaignService/GetCampaign"
CAMPAIGNS = "CampaignService/ListCampaigns"
DIGEST = "CampaignService/GetDigest"
EVALUATE = "EvaluationService/Evaluate"
GENERATIONS = "CampaignService/ListGenerations"
INDIVIDUAL = "CampaignService/GetIndividual"
LABELS = "LabelService/ListLabels"
REPLAY = "CampaignService/GetReplay"
SIMULATE = "EvaluationService/Simulate"
TAXONOMY = "CampaignService/GetTaxonomy"
WATCH = "CampaignService/WatchCampaign"

Call = Callable[[mm.Client], object]
CALLS: dict[str, Call] = {
    "archive": lambda client: client.campaign(ID).archive(),
    "campaign": lambda client: client.campaign(ID).state,
    "campaigns": lambda client: client.campaigns(),
    "digest": lambda client: client.campaign(ID).digest(),
    "embedder": lambda client: client.campaign(ID).embedder("never.onnx"),
    "evaluate": lambda client: client.evaluate(ROBOT, TWO, pictures=True),
    "generations": lambda client: client.campaign(ID).generations(),
    "labels": lambda client: client.campaign(ID).labels().to_pylist(),
    "pictures": lambda client: client.campaign(ID).pictures(),
    "replay": lambda client: client.campaign(ID).replay(0),
    "simulate": lambda client: client.replay(ROBOT, GENES, steps=2),
    "taxonomy": lambda client: client.campaign(ID).taxonomy(),
    "wait": lambda client: mm.Campaign(client, ID).wait(progress=True),
}


def first(chunks: list[v1.ArchiveChunk]) -> v1.Individual:
    """The first individual of an archive."""
    return chunks[0].individuals[0]


# For each lie: the library's call, the contract's method, the change of the honest answer, and the error's text.
LIES: list[tuple[str, str, Callable[[Any], object], str]] = [
    ("archive", ARCHIVE, lambda it: first(it).features.append(6.0), "individual 0 has 6 features, and not 5"),
    ("archive", ARCHIVE, lambda it: it[1].individuals[0].controller.pop(), "individual 2 has 3 genes, and not 4"),
    ("archive", ARCHIVE, lambda it: first(it).embedding.pop(), "individual 1 has 2 dimensions of the embedding"),
    ("archive", ARCHIVE, lambda it: first(it).trials[1].features.pop(), "trial 1 has 4 features, and not 5"),
    ("archive", ARCHIVE, lambda it: first(it).trials.pop(), "individual 1 has 2 trials, and not 1"),
    ("archive", ARCHIVE, lambda it: first(it).features.__setitem__(2, nan), r"features\[0, 2\] is nan"),
    ("archive", ARCHIVE, lambda it: first(it).controller.__setitem__(1, inf), r"genes\[0, 1\] is inf"),
    ("archive", ARCHIVE, lambda it: first(it).MergeFrom(v1.Individual(novelty=nan)), r"novelty\[0\] is nan"),
    ("archive", ARCHIVE, lambda it: first(it).MergeFrom(v1.Individual(index=7)), "individual 7 came in the place"),
    ("archive", ARCHIVE, lambda it: it.pop(), "ended after 2 of 4 individuals"),
    ("archive", ARCHIVE, lambda it: it.clear(), "ended after 0 of 4 individuals"),
    ("archive", ARCHIVE, lambda it: it.append(b"\xff\xff"), "2 bytes that are no ArchiveChunk"),
    ("campaign", CAMPAIGN, lambda it: it.MergeFrom(v1.Campaign(id="other-2")), "asked for campaign told-1, and"),
    ("campaign", CAMPAIGN, lambda it: it.ClearField("id"), "has the id '', which is not NAME-N"),
    ("campaigns", CAMPAIGNS, lambda it: it[0].campaigns.add(id="--data=x-1"), "the id '--data"),
    ("digest", DIGEST, lambda it: it.ClearField("digest"), "the digest of told-1 is '', and"),
    ("embedder", CAMPAIGN, lambda it: it.MergeFrom(v1.Campaign(checkpoint="--help")), "the checkpoint of told-1"),
    ("evaluate", EVALUATE, lambda it: it.append(it[0]), "more than 2 results came for 2 controllers"),
    ("evaluate", EVALUATE, lambda it: it[0].results.pop(), "there are 1 results of 2 controllers, and not 2"),
    ("evaluate", EVALUATE, lambda it: it.clear(), "there are 0 results of 2 controllers, and not 2"),
    ("evaluate", EVALUATE, lambda it: it[0].results[0].ClearField("trials"), "controller 0 has no trials"),
    ("evaluate", EVALUATE, lambda it: it[0].results[1].trials.pop(), "1 trials of controller 1, and not 2"),
    ("evaluate", EVALUATE, lambda it: it[0].results[0].trials[0].features.pop(), "4 features of controller 0"),
    ("evaluate", EVALUATE, lambda it: it[0].results[1].trials[0].embedding.pop(), "1 dimensions of the embedding"),
    ("evaluate", EVALUATE, lambda it: it[0].results[1].trials[0].features.__setitem__(0, nan), "features.* is nan"),
    ("evaluate", EVALUATE, lambda it: it[0].results[0].trials[0].ClearField("image"), "picture 0 has 0 bytes"),
    ("evaluate", EVALUATE, lambda it: it[0].ClearField("side"), "a side of 0 pixels"),
    ("evaluate", EVALUATE, lambda it: it.append(evaluation.EvaluateResponse(side=9)), "sides of 5 to 9 pixels"),
    ("generations", GENERATIONS, lambda it: it.pop(), "the generations of told-1 ended after 1 of 2"),
    ("generations", GENERATIONS, lambda it: it.reverse(), "generation 1 came in the place of generation 0"),
    ("labels", LABELS, lambda it: it[0].labels[0].answer.MergeFrom(labels.Answer(time_ms=1 << 60)), "a time"),
    ("pictures", ARCHIVE, lambda it: first(it).MergeFrom(v1.Individual(image=bytes(7))), "picture 0 has 7 bytes"),
    ("pictures", ARCHIVE, lambda it: it[1].individuals[1].ClearField("image"), "picture 3 has 0 bytes, and not 25"),
    ("pictures", CAMPAIGN, lambda it: it.spec.image.Clear(), "a side of 0 pixels"),
    ("pictures", CAMPAIGN, lambda it: it.spec.image.MergeFrom(v1.ImageFormat(resolution=2000)), "a side of 2000"),
    ("replay", REPLAY, lambda it: it[0].poses.pop(), "have 26 numbers, and not 3 for each of 3 robots"),
    ("replay", REPLAY, lambda it: it[0].poses.__setitem__(4, nan), r"poses\[0, 1, 1\] is nan"),
    ("replay", REPLAY, lambda it: it[0].ClearField("agents"), "not 3 for each of 0 robots"),
    ("replay", REPLAY, lambda it: it[0].steps.pop(), "a motion of 2 steps ends at step 1"),
    ("replay", REPLAY, lambda it: it[0].poses.extend([0.5] * 9), "there are 4 frames in a motion, and not 3"),
    ("replay", REPLAY, lambda it: it[0].steps.__setitem__(0, 1), "not numbered from 0 up"),
    ("replay", REPLAY, lambda it: it.clear(), "not numbered from 0 up"),
    ("simulate", SIMULATE, lambda it: it.pop(), "there are 2 frames in a motion, and not 3"),
    ("simulate", SIMULATE, lambda it: it.clear(), "a motion has no parts"),
    ("simulate", SIMULATE, lambda it: it[1].poses.pop(), "have 8 numbers, and not 3 for each of 3 robots"),
    ("simulate", SIMULATE, lambda it: it[1].MergeFrom(evaluation.Motion(agents=1)), "1 robots in a part"),
    ("simulate", SIMULATE, lambda it: it[2].poses.__setitem__(0, -inf), r"poses\[0, 0, 0\] is -inf"),
    ("taxonomy", TAXONOMY, lambda it: it.clear(), "a taxonomy has no medoids"),
    ("taxonomy", TAXONOMY, lambda it: it[0].medoids.pop(), "the cluster of individual 2 is 1"),
    ("taxonomy", TAXONOMY, lambda it: it[0].clusters.pop(), "there are 3 individuals in the taxonomy, and not 4"),
    ("taxonomy", TAXONOMY, lambda it: it[0].medoids[1].individual.MergeFrom(v1.Individual(index=4)), "medoid 1 is 4"),
    ("taxonomy", TAXONOMY, lambda it: it[0].medoids[1].individual.controller.pop(), "individual 1 has 3 genes"),
    ("taxonomy", TAXONOMY, lambda it: it[0].medoids[0].individual.ClearField("image"), "picture 0 has 0 bytes"),
    ("taxonomy", TAXONOMY, lambda it: it[0].MergeFrom(v1.Taxonomy(loss=nan)), "the loss of a taxonomy is nan"),
    ("taxonomy", TAXONOMY, lambda it: it[0].medoids[0].MergeFrom(v1.Medoid(mean_distance=nan)), r"mean_distance\[0\]"),
    ("taxonomy", TAXONOMY, lambda it: it[0].robust_trials.pop(), "3 numbers of robust trials, and not 4"),
    ("taxonomy", CAMPAIGN, lambda it: it.spec.evaluation.Clear(), "robust trials of individual 0 is 2"),
    ("wait", WATCH, lambda it: it.clear(), "ended without a message"),
    ("wait", WATCH, lambda it: it[0].MergeFrom(v1.Campaign(id="other-1")), "asked for campaign told-1, and"),
]  # fmt: skip


@pytest.fixture
def told() -> Told:
    """The coordinator's answers."""
    return honest()


@pytest.fixture
def client(told: Told) -> Iterator[mm.Client]:
    """A client of a coordinator with the answers `told`."""
    with coordinator(told) as url, mm.connect(url) as client:
        yield client


@pytest.mark.parametrize("call", [name for name in CALLS if name != "embedder"])
def test_an_honest_answer_is_taken(client: mm.Client, call: str) -> None:
    CALLS[call](client)


@pytest.mark.parametrize(("call", "method", "lie", "said"), LIES, ids=[f"{lie[0]}-{lie[3][:30]}" for lie in LIES])
def test_an_answer_that_cannot_be_is_named(
    client: mm.Client, told: Told, call: str, method: str, lie: Callable[[Any], object], said: str
) -> None:
    lie(told[method])
    with pytest.raises(mm.AnswerError, match=said) as raised:
        CALLS[call](client)
    assert str(raised.value).startswith("the coordinator sent an impossible answer: ")


def test_who_asks_for_too_much_at_once_is_told_so(client: mm.Client, told: Told) -> None:
    told["EvaluationService/Evaluate"] = (grpc.StatusCode.RESOURCE_EXHAUSTED, "not now")
    with pytest.raises(mm.BusyError, match="not now"):
        client.evaluate(ROBOT, TWO)


def test_the_text_of_an_error_cannot_control_a_terminal(client: mm.Client, told: Told) -> None:
    told["EvaluationService/Evaluate"] = (grpc.StatusCode.INTERNAL, "\x1b]0;title\x07 \u202elie " + "x" * 6_000)
    with pytest.raises(mm.MurmurationError) as raised:
        client.evaluate(ROBOT, TWO)
    assert not {"\x1b", "\x07", "\u202e"} & set(str(raised.value))
    assert len(str(raised.value)) <= 4_000


def test_one_picture_is_that_of_its_individual(client: mm.Client, told: Told) -> None:
    # In a small archive, the library requests all pictures.
    told[CAMPAIGN].spec.search.population = 1_000
    assert client.campaign(ID).pictures([3]).shape == (1, SIDE, SIDE)
    with pytest.raises(mm.AnswerError, match="individual 3 came in the place of individual 9"):
        client.campaign(ID).pictures([9])
    told[INDIVIDUAL].ClearField("image")
    with pytest.raises(mm.AnswerError, match="picture 0 has 0 bytes"):
        client.campaign(ID).pictures([3])


def test_states_and_stages_of_a_newer_coordinator_are_unknown(client: mm.Client, told: Told) -> None:
    newer = v1.Campaign(stage=99, spec=v1.CampaignSpec(method=99))  # type: ignore[arg-type]
    for campaign in (told[CAMPAIGN], told[WATCH][0], told[CAMPAIGNS][0].campaigns[0]):
        campaign.MergeFrom(newer)
    assert client.campaign(ID).wait(progress=True).state == "completed"
    newer = v1.Campaign(state=99)  # type: ignore[arg-type]
    for campaign in (told[CAMPAIGN], told[WATCH][0], told[CAMPAIGNS][0].campaigns[0]):
        campaign.MergeFrom(newer)
    assert [one.state for one in client.campaigns()] == ["unknown"]
    with pytest.raises(
        mm.CampaignError, match="in state 99, which this version of the library does not know"
    ) as raised:
        client.campaign(ID).wait(progress=True)
    assert raised.value.state == "unknown"


def test_a_specification_that_is_no_toml_is_a_lie(client: mm.Client, told: Told) -> None:
    told[CAMPAIGN].toml = "name = "
    with pytest.raises(mm.AnswerError, match="a specification that is no TOML"):
        _ = client.campaign(ID).spec


def test_verdicts_of_a_newer_coordinator_are_left_out(client: mm.Client, told: Told) -> None:
    first(told[ARCHIVE]).MergeFrom(v1.Individual(verdicts=[99]))  # type: ignore[list-item]
    assert client.campaign(ID).archive().num_rows == 4


def test_a_rollback_meanwhile_is_no_lie(client: mm.Client, told: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    call: Callable[..., object] = client.rpc.call

    def rolled_back(method: str, *rest: object) -> object:
        answer = call(method, *rest)
        told[CAMPAIGN].generations_done = 1
        return answer

    told[ARCHIVE].pop()
    monkeypatch.setattr(client.rpc, "call", rolled_back)
    assert mm.Campaign(client, ID).archive().num_rows == 2


@pytest.mark.parametrize("call", [name for name in CALLS if name != "embedder"])
def test_changed_bytes_are_an_answer_or_an_error_of_the_library(client: mm.Client, told: Told, call: str) -> None:
    chance = random.Random(1)  # noqa: S311
    kept = copy.deepcopy(told)
    for _ in range(60):
        for method, answer in kept.items():
            told[method] = (
                [_changed(part, chance) for part in answer] if isinstance(answer, list) else _changed(answer, chance)
            )
        try:
            with warnings.catch_warnings():
                # A changed message may say that the campaign waits, which the library reports as a warning.
                warnings.simplefilter("ignore", RuntimeWarning)
                CALLS[call](client)
        except mm.MurmurationError as error:
            assert str(error)


def _changed(message: Message, chance: random.Random) -> bytes:
    """The bytes of a message; one message in four has a changed byte."""
    content = bytearray(message.SerializeToString())
    if content and chance.random() < 0.25:
        content[chance.randrange(len(content))] = chance.randrange(256)
    return bytes(content)


@pytest.mark.parametrize(
    ("printed", "said"),
    [
        ('{"other": 1}', "printed no field `genes`"),
        ('{"genes": "name"}', "printed no field `genes`"),
        ("[1, 2]", "printed something that is not a JSON document"),
        ('{"genes": ', "printed something that is not a JSON document"),
        ("", "printed no field `genes`"),
    ],
)
def test_a_program_that_prints_something_else_is_an_error(told: Told, printed: str, said: str, tmp_path: Path) -> None:
    program = tmp_path / "murmuration"
    program.write_text(f"#!/bin/sh\ncat <<'END'\n{printed}\nEND\n")
    program.chmod(0o700)
    with (
        coordinator(told) as url,
        mm.connect(url, programs=tmp_path) as client,
        pytest.raises(mm.ProgramError, match=said),
    ):
        _ = client.campaign(ID).gene_names


def test_a_flat_archive_has_as_many_names_as_genes(told: Told, tmp_path: Path) -> None:
    program = tmp_path / "murmuration"
    document = '{"genes": ["left_0", "right_0"]}'
    program.write_text(f"#!/bin/sh\necho '{document}'\n")
    program.chmod(0o700)
    with (
        coordinator(told) as url,
        mm.connect(url, programs=tmp_path) as client,
        pytest.raises(mm.AnswerError, match="individual 0 has 4 genes, and not 2"),
    ):
        client.campaign(ID).archive(flat=True)
