"""Reads a campaign's state and individuals from the coordinator."""

from __future__ import annotations

from collections.abc import Iterator

from . import _answers as answers
from ._rpc import Connection
from .v1 import campaign_pb2 as v1


def status(rpc: Connection, campaign: str) -> v1.Campaign:
    """The campaign with this id, as it is now."""
    request = v1.GetCampaignRequest(campaign=campaign)
    found = rpc.call("CampaignService/GetCampaign", request, v1.Campaign)
    answers.identifier(found.id, campaign)
    return found


def individuals(rpc: Connection, campaign: str, *, images: bool = False) -> Iterator[v1.Individual]:
    """All individuals in order: at least as many as the archive had at the call."""
    promised, number = _evaluated(rpc, campaign), 0
    request = v1.GetArchiveRequest(campaign=campaign, images=images)
    for chunk in rpc.stream("CampaignService/GetArchive", request, v1.ArchiveChunk):
        for one in chunk.individuals:
            answers.same("individual", one.index, number)
            number += 1
            yield one
    # The archive is shorter if it was rolled back meanwhile.
    if number < promised and number < _evaluated(rpc, campaign):
        raise answers.wrong(f"the archive of {campaign} ended after {number} of {promised} individuals")


def individual(rpc: Connection, campaign: str, index: int) -> v1.Individual:
    """The individual with this index, with its picture."""
    request = v1.GetIndividualRequest(campaign=campaign, index=index)
    found = rpc.call("CampaignService/GetIndividual", request, v1.Individual)
    answers.same("individual", found.index, index)
    return found


def generations(rpc: Connection, campaign: str) -> list[v1.GenerationSummary]:
    """All complete generations in order."""
    done = status(rpc, campaign).generations_done
    request = v1.ListGenerationsRequest(campaign=campaign)
    whole = rpc.whole("CampaignService/ListGenerations", request, v1.ListGenerationsResponse)
    for place, one in enumerate(whole.generations):
        answers.same("generation", one.generation, place)
    number = len(whole.generations)
    if number < done and number < status(rpc, campaign).generations_done:
        raise answers.wrong(f"the generations of {campaign} ended after {number} of {done}")
    return list(whole.generations)


def _evaluated(rpc: Connection, campaign: str) -> int:
    """The number of individuals of the complete generations."""
    now = status(rpc, campaign)
    return now.generations_done * now.spec.search.population
