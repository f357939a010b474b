"""Evaluations of controllers, independent of a campaign's archive."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _answers as answers
from . import _tables as tables
from ._arguments import plain, read, toml, whole
from ._errors import InvalidError, MurmurationError, clean
from ._rpc import Connection
from .v1 import evaluation_pb2 as v1
from .v1 import worker_pb2 as worker

_MOST_SEEDS = 1 << 64
# Seed from which default seeds derive, the same as the default of `murmuration evaluate`.
_SEED = 0
# Kinds of numpy types that lose their meaning as real numbers: complex numbers, dates and durations.
_NO_REAL_NUMBERS = "cMm"
# Controllers per request. They take one core a few hundred milliseconds, and their pictures are usually less than a
# megabyte.
_IN_A_REQUEST = 64


@dataclass(frozen=True, repr=False)
class Evaluations:
    """Results of evaluations, in the order of the controllers.

    Attributes:
        features: float64 (n, 5), the hand-crafted features that `FEATURES` names; means over the starts.
        embeddings: float32 (n, dimensions), means over the starts; None if the method does not embed.
        pictures: uint8 (n, side, side), of the first start, rows from the top down; None unless requested.
            With a channel for each species (n, channels, side, side).
        seeds: uint64 (n,), the seed of each controller's first start.
        failures: Reasons for failed evaluations, by the number of the controller; usually empty. An evaluation fails if
            workers are lost during it. The features and the embedding of such a controller are NaN, and its picture is
            black.
    """

    features: npt.NDArray[np.float64]
    embeddings: npt.NDArray[np.float32] | None
    pictures: npt.NDArray[np.uint8] | None
    seeds: npt.NDArray[np.uint64]
    failures: dict[int, str]

    def __len__(self) -> int:
        return len(self.features)

    def __repr__(self) -> str:
        arrays = {"features": self.features, "embeddings": self.embeddings, "pictures": self.pictures}
        shapes = [f"{name} {array.shape}" for name, array in arrays.items() if array is not None]
        failures = [f"{len(self.failures)} failed"] if self.failures else []
        return f"Evaluations({', '.join([f'{len(self)} controllers', *shapes, *failures])})"


def evaluate(
    rpc: Connection,
    description: str,
    controllers: npt.ArrayLike,
    seeds: Iterable[Any] | int | None,
    pictures: bool,
) -> Evaluations:
    """Requests evaluations of controllers, as in the campaign file with the text `description`."""
    genes = _numbers("controllers", controllers, "(controllers, genes)")
    if genes.ndim != 2 or not len(genes):
        raise InvalidError.of("controllers", f"an array of shape {genes.shape}", "(controllers, genes), at least one")
    numbers = None if seeds is None else _seeds(seeds, len(genes))
    requests = _requests(description, genes, numbers, pictures)
    answered = rpc.exchange("EvaluationService/Evaluate", requests, v1.EvaluateResponse)
    return _evaluations(*_whole(answered, len(genes)), pictures)


def _seeds(seeds: Iterable[Any] | int, controllers: int) -> list[int]:
    """The seeds of the controllers, from a seed for each controller or one seed for all."""
    # The seeds are not put into a numpy array, which may turn numbers from 2^63 on into floating-point numbers.
    given = plain(seeds)
    if not isinstance(given, Iterable):
        given = [whole("seeds", given, 0, _MOST_SEEDS - 1)] * controllers
    numbers = [whole(f"seeds[{place}]", seed, 0, _MOST_SEEDS - 1) for place, seed in enumerate(given)]
    if len(numbers) != controllers:
        raise InvalidError.of("seeds", f"{len(numbers)} of them", f"one, or one for each of {controllers} controllers")
    return numbers


def _whole(answered: Iterable[v1.EvaluateResponse], controllers: int) -> tuple[list[v1.EvaluateResult], int]:
    """The results of all controllers, and the side of their pictures in pixels."""
    results: list[v1.EvaluateResult] = []
    sides: set[int] = set()
    for answer in answered:
        results.extend(answer.results)
        sides.add(answer.side)
        # A faulty coordinator could send results without end.
        if len(results) > controllers:
            raise answers.wrong(f"more than {controllers} results came for {controllers} controllers")
    answers.count(f"results of {controllers} controllers", len(results), controllers)
    if len(sides) > 1:
        raise answers.wrong(f"pictures have sides of {min(sides)} to {max(sides)} pixels")
    return results, sides.pop()


def _evaluations(results: list[v1.EvaluateResult], side: int, pictures: bool) -> Evaluations:
    """The arrays of at least one result."""
    failures = {number: clean(result.failure) for number, result in enumerate(results) if result.failure}
    usual = next((result for result in results if not result.failure), None)
    if usual is None:
        raise MurmurationError(f"no controller could be evaluated: {failures[0]}")
    for number, result in enumerate(results):
        if not result.failure:
            _check(number, result, usual)
    nothing = _nothing_like(usual)
    trials = [nothing if result.failure else result.trials for result in results]
    embeddings = [_mean([trial.embedding for trial in of_one]).astype(np.float32) for of_one in trials]
    return Evaluations(
        features=np.array([_mean([trial.features for trial in of_one]) for of_one in trials]),
        embeddings=np.array(embeddings) if embeddings[0].size else None,
        pictures=tables.pictures([of_one[0].image for of_one in trials], side) if pictures else None,
        seeds=np.array([result.seed for result in results], dtype=np.uint64),
        failures=failures,
    )


def _check(number: int, result: v1.EvaluateResult, usual: v1.EvaluateResult) -> None:
    """Checks the trials of a controller. Their numbers and lengths must be those of the `usual` result."""
    if not result.trials:
        raise answers.wrong(f"controller {number} has no trials, and no failure")
    dimensions = len(usual.trials[0].embedding)
    answers.count(f"trials of controller {number}", len(result.trials), len(usual.trials))
    for trial in result.trials:
        answers.count(f"features of controller {number}", len(trial.features), len(tables.FEATURES))
        answers.count(f"dimensions of the embedding of controller {number}", len(trial.embedding), dimensions)
        answers.finite(f"controller {number}: features", np.array(trial.features))
        answers.finite(f"controller {number}: embedding", np.array(trial.embedding))


def replay(
    rpc: Connection, description: str, controller: npt.ArrayLike, seed: int, steps: int | None
) -> npt.NDArray[np.float64]:
    """Requests the motion of a controller, in the world of the campaign file with the text `description`."""
    genes = _numbers("controller", controller, "(genes,)")
    if genes.ndim != 1:
        raise InvalidError.of("controller", f"an array of shape {genes.shape}", "the genes of one, (genes,)")
    request = v1.SimulateRequest(
        description=v1.EvaluationDescription(toml=description),
        controller=genes.tolist(),
        seed=whole("seed", seed, 0, _MOST_SEEDS - 1),
        steps=None if steps is None else whole("steps", steps, 1, (1 << 32) - 1),
    )
    return _motion(rpc.stream("EvaluationService/Simulate", request, v1.Motion), steps)


def _motion(answered: Iterable[v1.Motion], steps: int | None) -> npt.NDArray[np.float64]:
    """Joins the parts of a motion, (steps + 1, robots, 3). Without `steps`, any number of steps is accepted."""
    parts = [(part.agents, tables.poses("a motion's parts", part.poses, part.agents)) for part in answered]
    if not parts:
        raise answers.wrong("a motion has no parts")
    for agents, _ in parts:
        answers.count("robots in a part of a motion", agents, parts[0][0])
    motion = np.concatenate([poses for _, poses in parts])
    if steps is not None:
        answers.count("frames in a motion", len(motion), steps + 1)
    return motion


def _numbers(field: str, given: npt.ArrayLike, shape: str) -> npt.NDArray[np.float64]:
    given = plain(given)
    # Columns of tables and data frames have a list or an array in each row.
    listed = getattr(given, "to_pylist", None) or getattr(given, "to_list", None)
    try:
        array = np.asarray(listed() if listed else given)
        if np.ma.is_masked(given):
            raise TypeError("some are masked")
        if array.dtype.kind in _NO_REAL_NUMBERS:
            raise TypeError(f"they are {array.dtype}")
        return array.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        why = " ".join(str(error).split())
        raise InvalidError.of(field, "not an array", f"numbers, {shape}: {why}") from None


def _nothing_like(result: v1.EvaluateResult) -> list[worker.Evaluation]:
    """Placeholder trials for a controller that could not be evaluated."""
    usual = result.trials[0]
    nan = float("nan")
    lost = worker.Evaluation(features=[nan] * len(usual.features), embedding=[nan] * len(usual.embedding))
    lost.image = bytes(len(usual.image))
    return [lost]


def described(campaign: str | os.PathLike[str] | Mapping[str, Any]) -> str:
    """The text of a campaign file, from its path, from a dict, or from the name of a capability model."""
    if isinstance(campaign, str) and not campaign.endswith(".toml"):
        campaign = {"model": campaign}
    if isinstance(campaign, Mapping):
        return toml({"name": "evaluate", "method": "hand-crafted"} | dict(campaign)).decode()
    return read("robot", campaign)


def _requests(
    description: str, genes: npt.NDArray[np.float64], seeds: list[int] | None, pictures: bool
) -> Iterator[v1.EvaluateRequest]:
    derived = _SEED if seeds is None else None
    yield v1.EvaluateRequest(description=v1.EvaluationDescription(toml=description, pictures=pictures, seed=derived))
    seeds = [0] * len(genes) if seeds is None else seeds
    for first in range(0, len(genes), _IN_A_REQUEST):
        last = first + _IN_A_REQUEST
        tasks = [
            worker.EvaluationTask(controller=controller, seed=seed)
            for controller, seed in zip(genes[first:last].tolist(), seeds[first:last], strict=True)
        ]
        yield v1.EvaluateRequest(controllers=v1.ControllersToEvaluate(tasks=tasks))


def _mean(trials: Sequence[Sequence[float]]) -> npt.NDArray[np.float64]:
    """The mean with Murmuration's rounding: summed in the order of the trials, and divided once."""
    total = np.array(trials[0], dtype=np.float64)
    for trial in trials[1:]:
        total += np.array(trial, dtype=np.float64)
    return total / len(trials)
