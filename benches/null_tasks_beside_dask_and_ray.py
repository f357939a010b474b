"""Null tasks through Murmuration's coordinator, Dask distributed and Ray, one after the other on the same machine.

    python3 -m venv venv && venv/bin/pip install distributed ray
    cargo build --release --bin murmuration
    venv/bin/python benches/null_tasks_beside_dask_and_ray.py target/release/murmuration

A null task takes a controller (four numbers) and a seed, and returns as much as an evaluation: five numbers and a picture of
2,500 bytes. Each system has its scheduler and one worker, and gets a generation of 1,000 tasks at a time. The next generation
begins when all results of the generation before have arrived, as in a campaign.

The systems do not do the same work. Murmuration validates each result, measures novelty, breeds the next generation and writes
every result to disk synchronously before the result counts; its worker computes nothing. Dask and Ray keep results in memory, and
their workers call a Python function. Dask and Ray are measured twice: with single tasks, and with batches of 50, as experienced
users would send cheap tasks. CPU time is the sum over all processes of a system, from `resource` and `psutil`.
"""

import argparse
import json
import subprocess
import sys
import time

import psutil

GENERATION = 1000
IMAGE = bytes(2500)


def null(controller, seed):
    return [float(seed % 97), 0.0, 0.0, 0.0, 0.0], IMAGE


def nulls(tasks):
    return [null(controller, seed) for controller, seed in tasks]


def cpu_seconds():
    """CPU time of this process and of its running child processes."""
    total = 0.0
    me = psutil.Process()
    for process in [me, *me.children(recursive=True)]:
        try:
            times = process.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system
    return total


def measured(evaluate, generations):
    """Seconds and CPU seconds of all generations; `evaluate` takes a list of tasks."""
    tasks = [((0.1, 0.2, 0.3, 0.4), seed) for seed in range(GENERATION)]
    # The first generation warms everything up.
    assert len(evaluate(tasks)) == GENERATION
    begun, cpu = time.perf_counter(), cpu_seconds()
    for _ in range(generations):
        assert len(evaluate(tasks)) == GENERATION
    return time.perf_counter() - begun, cpu_seconds() - cpu


def batches(tasks, size):
    return [tasks[first : first + size] for first in range(0, len(tasks), size)]


def dask(generations):
    from distributed import Client, LocalCluster

    cluster = LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None)
    with cluster, Client(cluster) as client:

        def one_by_one(tasks):
            return client.gather([client.submit(null, *task, pure=False) for task in tasks])

        def in_batches(tasks):
            futures = [client.submit(nulls, batch, pure=False) for batch in batches(tasks, 50)]
            return [result for batch in client.gather(futures) for result in batch]

        yield "Dask, a task each", measured(one_by_one, generations)
        yield "Dask, batches of 50", measured(in_batches, generations)


def ray_tasks(generations):
    import ray

    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False, logging_level="error")
    one, many = ray.remote(null), ray.remote(nulls)

    def one_by_one(tasks):
        return ray.get([one.remote(*task) for task in tasks])

    def in_batches(tasks):
        done = ray.get([many.remote(batch) for batch in batches(tasks, 50)])
        return [result for batch in done for result in batch]

    yield "Ray, a task each", measured(one_by_one, generations)
    yield "Ray, batches of 50", measured(in_batches, generations)
    ray.shutdown()


def murmuration(binary, generations):
    command = [binary, "lab", "bench", "cluster", "--json", "--rounds", "1", "--generations", "1"]
    command += ["--null-generations", str(generations)]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    figures = next(row for row in map(json.loads, lines) if row["what"] == "null evaluations")
    results = figures["results"]
    return results / figures["results_per_second"], results * figures["cpu_seconds_per_result"]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("murmuration", help="the program, as built")
    parser.add_argument("--generations", type=int, default=20, help="of 1,000 tasks each")
    parser.add_argument("--rounds", type=int, default=3, help="the best counts")
    arguments = parser.parse_args()
    best = {}
    for _ in range(arguments.rounds):
        rows = [("Murmuration, on disk", murmuration(arguments.murmuration, arguments.generations))]
        rows += [*dask(arguments.generations), *ray_tasks(arguments.generations)]
        for name, took in rows:
            before = best.get(name, took)
            best[name] = tuple(map(min, before, took))
            print(f"{name}: {took[0]:.2f} s, {took[1]:.2f} s of CPU", file=sys.stderr)
    tasks = arguments.generations * GENERATION
    ours = best["Murmuration, on disk"]
    print("| system | tasks/s | CPU µs/task | CPU, times Murmuration's |\n|---|--:|--:|--:|")
    for name, (wall, cpu) in best.items():
        print(f"| {name} | {tasks / wall:,.0f} | {1e6 * cpu / tasks:.1f} | {cpu / ours[1]:.1f} |")


if __name__ == "__main__":
    main()
