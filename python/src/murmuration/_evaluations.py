"""Evaluations of controllers that need not be of a campaign."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import tomli_w

from . import _tables as tables
from ._errors import InvalidError, MurmurationError
from ._rpc import Connection
from .v1 import evaluation_pb2 as v1
from .v1 import worker_pb2 as worker

# Controllers of a request: a few hundred milliseconds of one core, and with usual pictures less than a megabyte.
_IN_A_REQUEST = 64


@dataclass(frozen=True)
class Evaluations:
    """What evaluations of controllers came to, in their order.

    Attributes:
        features: float64 (n, 5), the hand-crafted features that `FEATURES` names; means over the starts.
        embeddings: float32 (n, dimensions), means over the starts; None if the method does not embed.
        pictures: uint8 (n, side, side), of the first start, rows from the top down; None unless they were asked for.
            With a channel for each species (n, channels, side, side).
    """

    features: npt.NDArray[np.float64]
    embeddings: npt.NDArray[np.float32] | None
    pictures: npt.NDArray[np.uint8] | None

    def __len__(self) -> int:
        return len(self.features)


def evaluate(
    rpc: Connection,
    description: str,
    controllers: npt.ArrayLike,
    seeds: Sequence[int] | npt.NDArray[Any] | int,
    pictures: bool,
) -> Evaluations:
    """Has controllers evaluated as the text of a campaign file describes it."""
    genes = np.asarray(controllers, dtype=np.float64)
    if genes.ndim != 2 or not len(genes):
        raise InvalidError(f"controllers = an array of shape {genes.shape}: must be (controllers, genes), at least one")
    # Not by an array of numpy: numbers from 2^63 on may become floating-point numbers in it.
    numbers = [seeds] * len(genes) if isinstance(seeds, (int, np.integer)) else list(seeds)
    if len(numbers) != len(genes):
        raise InvalidError(f"seeds = {len(numbers)} of them: must be one, or one for each of {len(genes)} controllers")
    requests = _requests(description, genes, [operator.index(seed) for seed in numbers], pictures)
    features: list[npt.NDArray[np.float64]] = []
    embeddings: list[npt.NDArray[np.float32]] = []
    images: list[bytes] = []
    side = 0
    for answer in rpc.exchange("EvaluationService/Evaluate", requests, v1.EvaluateResponse):
        side = answer.side
        for result in answer.results:
            if result.failure:
                raise MurmurationError(f"controller {len(features)} could not be evaluated: {result.failure}")
            features.append(_mean([trial.features for trial in result.trials]))
            embeddings.append(_mean([trial.embedding for trial in result.trials]).astype(np.float32))
            images.append(result.trials[0].image)
    if len(features) != len(genes):
        raise MurmurationError(f"{len(features)} results came for {len(genes)} controllers")
    return Evaluations(
        features=np.array(features),
        embeddings=np.array(embeddings) if embeddings[0].size else None,
        pictures=tables.pictures(images, side) if pictures else None,
    )


def described(campaign: str | os.PathLike[str] | Mapping[str, Any]) -> str:
    """The text of a campaign file: of the file, of a dict, or of a capability model by its name."""
    if isinstance(campaign, str) and not campaign.endswith(".toml"):
        campaign = {"model": campaign}
    if isinstance(campaign, Mapping):
        return tomli_w.dumps({"name": "evaluate", "method": "hand-crafted"} | dict(campaign))
    return Path(campaign).read_text()


def _requests(
    description: str, genes: npt.NDArray[np.float64], seeds: list[int], pictures: bool
) -> Iterator[v1.EvaluateRequest]:
    yield v1.EvaluateRequest(description=v1.EvaluationDescription(toml=description, pictures=pictures))
    for first in range(0, len(genes), _IN_A_REQUEST):
        last = first + _IN_A_REQUEST
        tasks = [
            worker.EvaluationTask(controller=controller, seed=seed)
            for controller, seed in zip(genes[first:last].tolist(), seeds[first:last], strict=True)
        ]
        yield v1.EvaluateRequest(controllers=v1.ControllersToEvaluate(tasks=tasks))


def _mean(trials: Sequence[Sequence[float]]) -> npt.NDArray[np.float64]:
    """The mean as Murmuration rounds it: summed in the order of the trials, and divided once."""
    total = np.array(trials[0], dtype=np.float64)
    for trial in trials[1:]:
        total += np.array(trial, dtype=np.float64)
    return total / len(trials)
