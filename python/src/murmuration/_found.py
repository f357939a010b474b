"""Results of a campaign: motions and behaviours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from . import _answers as answers
from . import _tables as tables
from ._html import taxonomy_page
from .v1 import campaign_pb2 as v1


@dataclass(frozen=True, repr=False)
class Replay:
    """The motion of one swarm.

    Attributes:
        steps: Number of steps done at each frame, ascending from 0; uint32 (frames,).
        poses: x and y (world units, y points down the screen) and heading (radians) of each robot; float32
            (frames, robots, 3).
    """

    steps: npt.NDArray[np.uint32]
    poses: npt.NDArray[np.float32]

    def __repr__(self) -> str:
        frames, robots, _ = self.poses.shape
        return f"Replay({frames} frames of {robots} robots)"


@dataclass(frozen=True, repr=False)
class Taxonomy:
    """The behaviours that a campaign found. A notebook shows it as a row of pictures.

    Attributes:
        medoids: The individuals at the centres of the clusters, largest cluster first: `index`, `cluster_size`,
            `mean_distance`, `novelty`, `class`, `cluster_name` (the class, or the name from an earlier version),
            `genes`, `seed`.
        pictures: The medoids' pictures, as from `Campaign.pictures`.
        clusters: For each individual of the archive, or of its sample, its row of `medoids`, from 0; uint32
            (individuals,). Reports, pages and files number behaviours from 1: row + 1.
        loss: Sum of the distances of all individuals to their nearest medoids, in units of the behaviour space.
        robustness: The share of each individual's trials that are nearer to its own medoid than to any other, 0 to 1;
            float64 (individuals,). None if individuals have one trial.
    """

    medoids: pa.Table
    pictures: npt.NDArray[np.uint8]
    clusters: npt.NDArray[np.uint32]
    loss: float
    robustness: npt.NDArray[np.float64] | None

    def __repr__(self) -> str:
        return f"Taxonomy({len(self.medoids)} medoids of {len(self.clusters)} individuals)"

    def _repr_html_(self) -> str:
        return taxonomy_page(self.pictures, self.medoids.to_pylist())


def replay_of(answered: v1.Replay, horizon: int) -> Replay:
    """The motion in a coordinator's answer. It ends at the world's last step, `horizon`."""
    steps = np.array(answered.steps, np.uint32)
    if not len(steps) or steps[0] != 0 or (np.diff(steps.astype(np.int64)) <= 0).any():
        raise answers.wrong("the frames of a motion are not numbered from 0 up")
    if steps[-1] != horizon:
        raise answers.wrong(f"a motion of {horizon} steps ends at step {steps[-1]}")
    poses = tables.poses("the frames of a motion", answered.poses, answered.agents)
    answers.count("frames in a motion", len(poses), len(steps))
    return Replay(steps=steps, poses=poses.astype(np.float32))


def taxonomy_of(answered: v1.Taxonomy, campaign: v1.Campaign, classes: Mapping[int, str]) -> Taxonomy:
    """The taxonomy in a coordinator's answer. `classes` maps individuals to their classes."""
    if not answered.medoids:
        raise answers.wrong("a taxonomy has no medoids")
    individuals = campaign.generations_done * campaign.spec.search.population
    if campaign.spec.taxonomy.HasField("sample"):
        individuals = min(individuals, campaign.spec.taxonomy.sample)
    # A campaign that is not completed may have more individuals by now.
    if campaign.state == v1.CAMPAIGN_STATE_COMPLETED:
        answers.count("individuals in the taxonomy", len(answered.clusters), individuals)
    answers.below("the cluster of individual", answered.clusters, len(answered.medoids))
    indices = [medoid.individual.index for medoid in answered.medoids]
    answers.below("the index of medoid", indices, len(answered.clusters))
    images = [medoid.individual.image for medoid in answered.medoids]
    return Taxonomy(
        medoids=tables.medoids(answered, classes),
        pictures=tables.pictures(images, campaign.spec.image.resolution),
        clusters=np.array(answered.clusters, np.uint32),
        loss=answers.measure("the loss of a taxonomy", answered.loss),
        robustness=_robustness(answered, campaign.spec.evaluation.starts),
    )


def _robustness(answered: v1.Taxonomy, starts: int) -> npt.NDArray[np.float64] | None:
    """The share of the `starts` trials of each individual that show its behaviour; None if it has one trial."""
    if not answered.robust_trials:
        return None
    answers.count("numbers of robust trials", len(answered.robust_trials), len(answered.clusters))
    answers.below("the number of robust trials of individual", answered.robust_trials, starts + 1)
    return np.array(answered.robust_trials, np.float64) / max(starts, 1)
