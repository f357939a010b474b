"""Bars for the stages of a campaign."""

import pytest

from murmuration._progress import Bar
from murmuration.v1 import campaign_pb2 as v1


def told(stage: v1.CampaignStage, done: int) -> v1.Campaign:
    """A campaign of 4 individuals, 10 pictures and at most 8 epochs, in the middle of a stage."""
    total, unit = {
        v1.CAMPAIGN_STAGE_DATASET: (10, "picture"),
        v1.CAMPAIGN_STAGE_PRETRAIN: (8, "epoch"),
        v1.CAMPAIGN_STAGE_FINE_TUNE: (8, "epoch"),
        v1.CAMPAIGN_STAGE_EMBED: (4, "picture"),
        v1.CAMPAIGN_STAGE_LABEL: (4, "label"),
    }.get(stage, (4, "evaluation"))
    progress = v1.StageProgress(done=done, total=total, unit=unit)
    return v1.Campaign(stage=stage, state=v1.CAMPAIGN_STATE_RUNNING, progress=progress)


def shown(*campaigns: v1.Campaign, capfd: pytest.CaptureFixture[str]) -> list[str]:
    """The last state of each bar: its stage, and its count of how many."""
    bar = Bar(shown=True)
    for campaign in campaigns:
        bar.show(campaign)
    bar.close()
    lasts = [line.rpartition("\r")[2] for line in capfd.readouterr().err.strip("\n").split("\n")]
    return [f"{line.partition(':')[0]} {line.rpartition('| ')[2].partition(' ')[0]}" for line in lasts]


def test_a_stage_that_another_follows_is_done(capfd: pytest.CaptureFixture[str]) -> None:
    lasts = shown(
        told(v1.CAMPAIGN_STAGE_DATASET, 7),
        # A training can end before its last epoch.
        told(v1.CAMPAIGN_STAGE_PRETRAIN, 3),
        told(v1.CAMPAIGN_STAGE_EVOLVE, 3),
        told(v1.CAMPAIGN_STAGE_LABEL, 1),
        told(v1.CAMPAIGN_STAGE_FINE_TUNE, 2),
        told(v1.CAMPAIGN_STAGE_EMBED, 1),
        told(v1.CAMPAIGN_STAGE_EVOLVE, 1),
        capfd=capfd,
    )
    # The last bar keeps its progress.
    assert lasts == [
        "dataset 10/10",
        "pretrain 3/3",
        "evolve 4/4",
        "label 4/4",
        "fine-tune 2/2",
        "embed 4/4",
        "evolve 1/4",
    ]


def test_a_stage_too_short_for_a_word_is_done(capfd: pytest.CaptureFixture[str]) -> None:
    bar = Bar(shown=True)
    for stage in (v1.CAMPAIGN_STAGE_PRETRAIN, v1.CAMPAIGN_STAGE_EVOLVE):
        campaign = told(stage, 0)
        if stage == v1.CAMPAIGN_STAGE_PRETRAIN:
            campaign.progress.total = 0
        bar.show(campaign)
    bar.close()
    assert capfd.readouterr().err.split("\n")[0].rpartition("\r")[2].rstrip() == "pretrain: done"


def test_a_search_that_stops_for_another_embedder_is_not_done(capfd: pytest.CaptureFixture[str]) -> None:
    assert shown(told(v1.CAMPAIGN_STAGE_EVOLVE, 3), told(v1.CAMPAIGN_STAGE_EMBED, 1), capfd=capfd)[0] == "evolve 3/4"


def test_a_campaign_that_waits_no_more_does_not_say_so(capfd: pytest.CaptureFixture[str]) -> None:
    waiting = told(v1.CAMPAIGN_STAGE_DATASET, 3)
    waiting.waiting = "a worker"
    bar = Bar(shown=True)
    bar.show(waiting)
    bar.show(told(v1.CAMPAIGN_STAGE_DATASET, 10))
    bar.close()
    said = capfd.readouterr().err
    assert "waiting: a worker" in said and "waiting" not in said.rpartition("\r")[2]


def test_a_hidden_bar_has_stages_too(capfd: pytest.CaptureFixture[str]) -> None:
    bar = Bar(shown=False)
    for stage in (v1.CAMPAIGN_STAGE_DATASET, v1.CAMPAIGN_STAGE_PRETRAIN, v1.CAMPAIGN_STAGE_TAXONOMY):
        bar.show(told(stage, 1))
    bar.close()
    assert bar.is_hidden and not capfd.readouterr().err


def test_a_bar_prints_no_control_characters_of_a_coordinator(capfd: pytest.CaptureFixture[str]) -> None:
    campaign = told(v1.CAMPAIGN_STAGE_EVOLVE, 1)
    campaign.waiting = "\x1b]0;title\x07 " + "x" * 100_000
    campaign.progress.unit = "\u202eepoch"
    bar = Bar(shown=True)
    bar.show(campaign)
    bar.close()
    printed = capfd.readouterr().err
    assert "waiting: " in printed
    assert not {"\x1b]", "\x07", "\u202e"} & {printed[i : i + n] for n in (1, 2) for i in range(len(printed))}
    assert len(printed) < 30_000
