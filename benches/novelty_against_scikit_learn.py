#!/usr/bin/env python3
"""Novelty by Murmuration's index and by scikit-learn's k-d tree, on the same points in the same run, one thread each.

    python3 -m venv /tmp/peers && /tmp/peers/bin/pip install scikit-learn
    cargo build --release --workspace --example novelty_of_file
    /tmp/peers/bin/python benches/novelty_against_scikit_learn.py [--most 1000000]

The script prints a table: seconds to build the index, and to find the 15 nearest neighbours of 10,000 points (or of all points,
if there are fewer), each the best of three runs, and the ratio scikit-learn : Murmuration. The script fails if the two results
differ.
"""

import argparse
import os
import pathlib
import subprocess
import tempfile
import time

import numpy
from sklearn.neighbors import KDTree

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target/release/examples/novelty_of_file"
DIMENSIONS, NEIGHBOURS, QUERIES, REPEATS = 5, 15, 10_000, 3


def archive(count, random):
    """Points in clumps of different widths, as in an archive."""
    clump = numpy.arange(count) % 12
    centre = numpy.outer(clump, 0.37 * numpy.arange(1, DIMENSIONS + 1)) % 1.0
    return centre + random.uniform(-0.02, 0.02, (count, DIMENSIONS)) * (1 + clump)[:, None]


def ours(points, queries, folder):
    """Seconds to build, seconds to ask, novelty."""
    before, after = folder / "points", folder / "novelty"
    points.astype("<f8").tofile(before)
    command = [PROGRAM, before, DIMENSIONS, queries, NEIGHBOURS, after]
    printed = subprocess.run(
        [str(part) for part in command],
        env=os.environ | {"RAYON_NUM_THREADS": "1"},
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    build, ask = map(float, printed.split())
    return build, ask, numpy.fromfile(after, "<f8")


def theirs(points, queries):
    """Seconds to build, seconds to ask, novelty."""
    begun = time.perf_counter()
    tree = KDTree(points)
    built = time.perf_counter()
    distances, _ = tree.query(points[-queries:], k=NEIGHBOURS + 1)
    novelty = distances[:, 1:].mean(axis=1)
    return built - begun, time.perf_counter() - built, novelty


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--most", type=int, default=1_000_000, help="points of the largest archive")
    most = parser.parse_args().most
    random = numpy.random.default_rng(1)
    print("| points | queries | build, s | scikit-learn | ratio | ask, s | scikit-learn | ratio |")
    print("|--:|--:|--:|--:|--:|--:|--:|--:|")
    for count in [10**3, 10**4, 10**5, 10**6]:
        if count > most:
            break
        points, queries = archive(count, random), min(count, QUERIES)
        with tempfile.TemporaryDirectory() as folder:
            # The two programs take turns, so that other load on the machine slows both.
            pairs = [(ours(points, queries, pathlib.Path(folder)), theirs(points, queries)) for _ in range(REPEATS)]
        for mine, peer in pairs:
            numpy.testing.assert_allclose(mine[2], peer[2], rtol=1e-9)
        best = [[min(pair[side][stage] for pair in pairs) for side in (0, 1)] for stage in (0, 1)]
        cells = " | ".join(f"{a:.4f} | {b:.4f} | {b / a:.1f}" for a, b in best)
        print(f"| {count:,} | {queries:,} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
