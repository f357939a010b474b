#!/usr/bin/env python3
"""Findings of searches, compared with uniform sampling: held-out targets, and niches of three spaces.

    make build
    pip install ./python numpy scipy
    python3 benches/finds.py --results finds.jsonl [--programs target/release] [--robots two three species] [--seeds 10]

For each robot, 20,000 uniform controllers are simulated, once for all searches.

Targets are rare behaviours. The controllers whose pictures are least like any other picture are simulated from 20 starts each.
The scatter of a controller is the distance from the mean of its starts within which 15 of the 20 starts lie. The mean is a target
if 1 to 5 of the 20,000 controllers lie within this scatter. Up to 20 targets are taken, each as far from the other targets as
possible. A search has found a target when one of its individuals lies within the target's scatter. Distances are measured in a
space that no search uses: invariants of the picture, each divided by its deviation over the 20,000 controllers. The invariants
are how grey the picture is, its light by distance to the wall and to its own middle, and its power spectrum; with two species
also those of both species together, and the species' coherence.

Niches are counted in three spaces: that of the invariants, that of the five features, and the embedding of a network that no
search uses, trained with another seed. The niches are made from the 20,000 controllers and one archive of each search (seed 0,
which is not counted). The sparsest twentieth of these individuals is left out, and 500 of the other individuals, each as far from
the rest as possible, are the niches. An individual reaches the nearest niche.

Two columns compare a search with uniform sampling, in the mean over the seeds. The first column has the evaluations after which
uniform sampling has found as many targets as the search after 3,000 evaluations. The second column has the evaluations after
which the search has found as many targets as uniform sampling after 10,000 evaluations.

Results are appended to the file; runs whose results the file has are not repeated. Only evaluations of the search count.
Evaluations for an embedder's dataset do not count, because the embedder is trained once for each robot.
"""

import argparse
import json
import pathlib
import statistics
import tempfile

import numpy as np
import onnxruntime
from scipy.spatial import cKDTree

import murmuration

POOL, POOL_SEED = 20_000, 1000
CANDIDATES, STARTS, WITHIN = 600, 20, 15
RARE, TARGETS = range(1, 6), 20
EVALUATIONS = 10_000
COUNTED = (300, 1000, 3000, EVALUATIONS)
# Evaluations after which a search is compared with uniform sampling.
MATCHED = 3000
NICHES, NICHES_COUNTED = 500, (1000, EVALUATIONS)
SPACES = ("features", "another embedding", "invariants")
# Seeds of the embedder that searches use, and of the embedder that no search uses.
EMBEDDER_SEED, OTHER_EMBEDDER_SEED = 1, 99

ROBOTS = {
    "one": {"model": "single-sensor"},
    "two": {"model": "two-sensor"},
    "three": {
        "robot": {
            "sensors": [
                {"angle": 0.0},
                {"angle": "free", "angle_range": [-1.57, 1.57], "half_angle": 0.2, "range": 120},
                {"angle": 1.57, "half_angle": 0.1, "range": 40, "sees": ["walls"]},
            ]
        }
    },
    "species": {
        "ratios": [[12, 12], [8, 16], [6, 18], [3, 21], [1, 23]],
        "image": {"channels": "species"},
        "species": [
            {"name": "a", "robot": {"sensors": [{"sees": ["a"]}]}},
            {
                "name": "b",
                "robot": {"sensors": [{"sees": ["a"]}, {"angle": "free", "angle_range": [-3.14, 3.14], "sees": ["b"]}]},
            },
        ],
    },
}
SEARCHES = {
    "uniform": {"method": "random"},
    "features": {"method": "hand-crafted"},
    "latent": {"method": "latent"},
    "features-lag": {"method": "hand-crafted", "search": {"lag": 1}},
    "latent-lag": {"method": "latent", "search": {"lag": 1}},
}
USUAL = ("uniform", "features", "latent")


def means_by(bins, values):
    """Means of values (n, places) over the places of each bin."""
    members = np.zeros((bins.size, bins.max() + 1))
    members[np.arange(bins.size), bins] = 1
    return values @ (members / np.maximum(members.sum(0), 1))


def invariants(pictures):
    """Measures that are invariant under quarter turns and reflections of the arena: (n, measures)."""
    parts = [_invariants(pictures[begin : begin + 1000]) for begin in range(0, len(pictures), 1000)]
    return np.concatenate(parts)


def _invariants(pictures):
    grey = pictures.astype(np.float64) / 255
    grey = grey[:, None] if grey.ndim == 3 else grey
    side = grey.shape[-1]
    places = np.indices((side, side)).reshape(2, -1).T
    to_wall = np.digitize(np.minimum(places, side - 1 - places).min(1), np.array([2, 4, 7, 11, 17]) * side / 50)
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.fftfreq(side)).ravel()
    frequencies = np.digitize(frequency, [0.01, 0.03, 0.05, 0.07, 0.1, 0.14, 0.19, 0.25, 0.35, 0.5])
    measures, spectra = [], []
    for channel in np.moveaxis(grey, 1, 0):
        light = channel.reshape(len(channel), -1)
        total = light.sum(1, keepdims=True) + 1e-6
        middle = light @ places / total
        away = np.linalg.norm(places - middle[:, None], axis=2) * 50 / side
        rings = np.digitize(away, [3, 6, 10, 14, 19, 25])
        measures.append(np.stack([light.mean(1), light.std(1), *((light > level).mean(1) for level in (0.1, 0.4, 0.8))], 1))
        measures.append(means_by(to_wall, light))
        measures.append(np.stack([np.where(rings == ring, light, 0).sum(1) for ring in range(7)], 1) / total)
        spectra.append(np.fft.fft2(channel).reshape(len(channel), -1))
        measures.append(np.log(means_by(frequencies, np.abs(spectra[-1]) ** 2) + 0.01))
    if len(spectra) == 2:
        powers = [means_by(frequencies, np.abs(spectrum) ** 2) for spectrum in spectra]
        crossed = means_by(frequencies, (spectra[0] * spectra[1].conj()).real)
        measures.append(crossed / np.sqrt(powers[0] * powers[1] + 1e-6))
    return np.concatenate(measures, 1)


class Robot:
    """The targets and niches of one robot."""

    def __init__(self, client, robot, searches, folder):
        self.client, self.robot = client, robot
        search = {"population": 1000, "generations": POOL // 1000}
        pool = self.run({"method": "random", "search": search}, POOL_SEED)
        self.checkpoint = self.trained(EMBEDDER_SEED).status().checkpoint
        other = self.trained(OTHER_EMBEDDER_SEED).embedder(folder / "other.onnx")
        self.other = onnxruntime.InferenceSession(other)
        pictures = pool.pictures()
        self.scale = invariants(pictures).std(0) + 1e-9
        self.deviation = murmuration.matrix(pool.archive()["features"]).std(0)
        measured = self.measured(pool, pictures)
        self.take_targets(pool, measured["invariants"])
        archives = [measured, *(self.measured(self.search(name, 0)) for name in searches)]
        self.niches = {space: cKDTree(niches(np.concatenate([of[space] for of in archives]))) for space in SPACES}

    def run(self, spec, seed):
        return self.client.run({**self.robot, **spec, "taxonomy": {"medoids": 2}}, seed=seed, progress=False)

    def trained(self, seed):
        return self.run({"method": "latent", "search": {"population": 16, "generations": 1}}, seed)

    def search(self, name, seed):
        spec = dict(SEARCHES[name])
        if spec["method"] == "latent":
            spec["checkpoint"] = self.checkpoint
        return self.run(spec, seed)

    def measured(self, campaign, pictures=None):
        """The points of a campaign's individuals in each space."""
        pictures = campaign.pictures() if pictures is None else pictures
        channels = pictures[:, None] if pictures.ndim == 3 else pictures
        batches = [channels[begin : begin + 1000].swapaxes(-1, -2).astype(np.float32) for begin in range(0, len(channels), 1000)]
        return {
            "features": murmuration.matrix(campaign.archive()["features"]) / self.deviation,
            "another embedding": np.concatenate([self.other.run(None, {"images": batch})[0] for batch in batches]),
            "invariants": invariants(pictures) / self.scale,
        }

    def take_targets(self, pool, measured):
        near = cKDTree(measured)
        sparse = np.argsort(-near.query(measured, k=4)[0][:, 3])[:CANDIDATES]
        genes = murmuration.matrix(pool.archive()["genes"])[sparse]
        starts = self.client.evaluate(
            {**self.robot, "method": "random"}, np.repeat(genes, STARTS, 0), seeds=np.arange(CANDIDATES * STARTS), pictures=True
        )
        starts = (invariants(starts.pictures) / self.scale).reshape(CANDIDATES, STARTS, -1)
        centres = starts.mean(1)
        radii = np.sort(np.linalg.norm(starts - centres[:, None], axis=2))[:, WITHIN - 1]
        counts = [len(near.query_ball_point(centre, radius)) for centre, radius in zip(centres, radii)]
        rare = [place for place, count in enumerate(counts) if count in RARE]
        chosen = far_apart(centres[rare], TARGETS)
        self.centres, self.radii = centres[rare][chosen], radii[rare][chosen]
        self.counts = [counts[rare[place]] for place in chosen]

    def findings(self, campaign):
        """For each target, the evaluations until it was found (or None); for each space, the percentages of reached niches."""
        places = self.measured(campaign)
        hits = np.linalg.norm(places["invariants"][:, None] - self.centres, axis=2) <= self.radii
        reached = {space: self.niches[space].query(places[space])[1] for space in SPACES}
        return {
            "first": [int(hit.argmax()) + 1 if hit.any() else None for hit in hits.T],
            "niches": {
                space: [100 * len(set(of[:count])) / self.niches[space].n for count in NICHES_COUNTED] for space, of in reached.items()
            },
            "digest": campaign.digest(),
        }


def far_apart(points, count):
    """Indices of `count` points, each as far as possible from the points before it."""
    chosen = [0] if len(points) else []
    away = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(away.argmax()))
    return chosen


def niches(points):
    sparseness = cKDTree(points).query(points, k=4)[0][:, 3]
    kept = points[sparseness <= np.quantile(sparseness, 0.95)]
    return kept[far_apart(kept, NICHES)]


def in_words(values):
    deviation = f" ± {statistics.stdev(values):.1f}" if len(values) > 1 else ""
    return f"{statistics.mean(values):.1f}{deviation}"


def found_by(runs):
    """The mean number of targets found after 1, 2, ... evaluations."""
    evaluations = np.arange(1, EVALUATIONS + 1)
    firsts = [first for row in runs for first in row["first"] if first]
    return np.searchsorted(np.sort(firsts), evaluations, side="right") / len(runs)


def evaluations(found, targets):
    """Evaluations until `targets` targets are found."""
    needed = np.searchsorted(found, targets) + 1
    return f"{needed:,}" if needed <= EVALUATIONS else f"over {EVALUATIONS:,}"


def table(rows):
    targets = " | ".join(f"targets after {count:,}" for count in COUNTED)
    reached = " | ".join(f"{space}, % after {count:,}" for space in SPACES for count in NICHES_COUNTED)
    print(f"| robot | search | seeds | {targets} | uniform's for as many as after {MATCHED:,} | for as many as uniform | {reached} |")
    print(f"|---|---|{'--:|' * (len(COUNTED) + 3 + len(SPACES) * len(NICHES_COUNTED))}")
    for robot in ROBOTS:
        uniform = [row for row in rows if (row["robot"], row["search"]) == (robot, "uniform")]
        for search in SEARCHES:
            runs = [row for row in rows if (row["robot"], row["search"]) == (robot, search)]
            if not runs:
                continue
            found = [in_words([sum(first is not None and first <= count for first in row["first"]) for row in runs]) for count in COUNTED]
            of_uniform, of_search = found_by(uniform or runs), found_by(runs)
            compared = [evaluations(of_uniform, of_search[MATCHED - 1]), evaluations(of_search, of_uniform[-1])]
            reached = [in_words([row["niches"][space][at] for row in runs]) for space in SPACES for at in range(len(NICHES_COUNTED))]
            print(f"| {' | '.join([robot, search, str(len(runs)), *found, *compared, *reached])} |")


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--results", type=pathlib.Path, required=True)
    options.add_argument("--programs", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent.parent / "target/release")
    options.add_argument("--robots", nargs="*", default=list(ROBOTS), choices=list(ROBOTS))
    options.add_argument("--searches", nargs="*", default=list(USUAL), choices=list(SEARCHES))
    options.add_argument("--seeds", type=int, default=10)
    options = options.parse_args()
    rows = [json.loads(line) for line in options.results.read_text().splitlines()] if options.results.exists() else []
    for name in options.robots:
        with (
            tempfile.TemporaryDirectory() as folder,
            murmuration.local(pathlib.Path(folder, "data"), programs=options.programs) as client,
        ):
            robot = Robot(client, ROBOTS[name], options.searches, pathlib.Path(folder))
            print(f"{name}: {len(robot.radii)} targets, of which {POOL:,} uniform controllers show {robot.counts}", flush=True)
            for seed in range(1, options.seeds + 1):
                for search in options.searches:
                    if any((row["robot"], row["search"], row["seed"]) == (name, search, seed) for row in rows):
                        continue
                    rows.append({"robot": name, "search": search, "seed": seed, **robot.findings(robot.search(search, seed))})
                    with options.results.open("a") as file:
                        file.write(json.dumps(rows[-1]) + "\n")
    table(rows)


if __name__ == "__main__":
    main()
