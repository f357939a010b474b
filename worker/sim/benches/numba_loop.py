"""The simulation's loop in numba, f64, one core: the peer of `cargo bench --bench beside_numba`, which starts this.

Reads a line of JSON, a population; then, for each line that follows, simulates it and prints the seconds of CPU time that took.
"""

import json
import math
import sys
import time

import numpy as np
from numba import njit


@njit
def simulate(position, theta, speeds, angle, sensors, steps, width, height, radius, padding):
    agents = position.shape[0]
    low = radius + padding
    high_x, high_y = width - low, height - low
    touch = 4 * radius * radius
    sensed = np.zeros(agents, np.int64)
    touched = np.empty(agents, np.int64)
    for _ in range(steps):
        for i in range(agents):
            left, right = speeds[2 * sensed[i]], speeds[2 * sensed[i] + 1]
            x = position[i, 0] + (left + right) * math.cos(theta[i])
            y = position[i, 1] + (left + right) * math.sin(theta[i])
            theta[i] += (left - right) / (2 * radius)
            x = min(max(x, low), high_x)
            y = min(max(y, low), high_y)
            for _ in range(10):
                count = 0
                for j in range(agents):
                    if j != i:
                        ex, ey = position[j, 0] - x, position[j, 1] - y
                        if ex * ex + ey * ey < touch:
                            touched[count] = j
                            count += 1
                if count == 0:
                    break
                for k in range(count):
                    ax, ay = x - position[touched[k], 0], y - position[touched[k], 1]
                    distance = math.sqrt(ax * ax + ay * ay)
                    if 0.0 < distance <= 2 * radius:
                        push = 2 * radius + 0.001 - distance
                        x += ax / distance * push
                        y += ay / distance * push
            position[i, 0], position[i, 1] = x, y
            state = 0
            for sensor in range(sensors):
                along_x = math.cos(theta[i] + sensor * angle)
                along_y = math.sin(theta[i] + sensor * angle)
                hit = 0
                for j in range(agents):
                    if j != i:
                        ex, ey = position[j, 0] - x, position[j, 1] - y
                        along = ex * along_x + ey * along_y
                        if along >= 0 and radius * radius - (ex * ex + ey * ey) + along * along >= 0:
                            hit = 1
                            break
                state = 2 * state + hit
            sensed[i] = state


def main():
    tasks = [
        (np.array(task["poses"]), np.array(task["speeds"]), task["angle"], task["sensors"])
        for task in json.loads(sys.stdin.readline())
    ]

    def all_of_them(steps):
        for poses, speeds, angle, sensors in tasks:
            simulate(poses[:, :2].copy(), poses[:, 2].copy(), speeds, angle, sensors, steps, 500.0, 500.0, 5.0, 15.0)

    all_of_them(1)
    print("ready", flush=True)
    for _ in sys.stdin:
        begun = time.thread_time()
        all_of_them(1200)
        print(time.thread_time() - begun, flush=True)


main()
