"""Training steps in PyTorch, f32, CPU. `cargo bench --bench beside_pytorch` starts this script and compares with it.

The argument is the number of threads. The script prints a line of JSON: the names of the ways to run a step that work
on this machine. For each line that it reads, the script takes one step in each way, and prints the steps' seconds of
wall time and of CPU time.
"""

import json
import sys
import time

import torch
from torch import nn

BATCH, SIDE, MARGIN = 256, 50, 1.0


def compact():
    layers, before = [], 1
    for channels in (16, 32, 64):
        layers += [nn.Conv2d(before, channels, 3, stride=2, padding=1), nn.GroupNorm(4, channels), nn.LeakyReLU(0.01)]
        before = channels
    head = [nn.AdaptiveAvgPool2d(2), nn.Flatten(), nn.Linear(256, 64), nn.ReLU(), nn.Linear(64, 5)]
    return nn.Sequential(*layers, *head)


def in_batch(embeddings):
    anchors, positives = embeddings.chunk(2)
    distances = (anchors[:, None] - positives[None] + 1e-6).norm(dim=2)
    violations = distances.diagonal()[:, None] - distances + MARGIN
    # This is a mask: a compiled step could not know the size of a selection.
    violated = ((violations > 0) & ~torch.eye(BATCH, dtype=torch.bool)).float()
    return (violations * violated).sum() / violated.sum().clamp(min=1)


def pictures():
    """Pictures of a few short lines on black, like pictures of trajectories."""
    images = torch.zeros(2 * BATCH, SIDE * SIDE)
    for image in images:
        for start in torch.randint(0, SIDE * (SIDE - 6), (24,)).tolist():
            image[start : start + 6] = 1
    return images.reshape(-1, 1, SIDE, SIDE)


def step_of(compiled, layout):
    """A function that takes a step."""
    network = compact().to(memory_format=layout)
    images = pictures().to(memory_format=layout)
    optimiser = torch.optim.Adam(network.parameters(), lr=3e-3, weight_decay=1e-6, fused=True)

    def loss_of(images):
        return in_batch(network(images))

    loss_of = torch.compile(loss_of) if compiled else loss_of

    def step():
        optimiser.zero_grad(set_to_none=True)
        loss_of(images).backward()
        optimiser.step()

    return step


def timed(step):
    wall, cpu = time.perf_counter(), time.process_time()
    step()
    return time.perf_counter() - wall, time.process_time() - cpu


def main():
    torch.manual_seed(1)
    torch.set_num_threads(int(sys.argv[1]))
    torch.set_flush_denormal(True)
    ways = {}
    for compiled, how in ((False, "eager"), (True, "compiled")):
        for layout, laid_out in ((torch.contiguous_format, ""), (torch.channels_last, ", channels last")):
            try:
                step = step_of(compiled, layout)
                step()
                ways[how + laid_out] = step
            except Exception as error:  # Without a C++ compiler, no step is compiled; the other ways still run.
                print(f"{how}{laid_out}: {error}", file=sys.stderr)
    print(json.dumps([torch.__version__, list(ways)]), flush=True)
    for _ in sys.stdin:
        print(json.dumps([timed(step) for step in ways.values()]), flush=True)


main()
