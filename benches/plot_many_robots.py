#!/usr/bin/env python3
"""Draws what a step of a robot costs against the number of robots, from the table of the benchmark `many_robots`.

    cargo bench --workspace --bench many_robots | tee table.txt
    python3 benches/plot_many_robots.py table.txt > docs/many-robots.svg

Both axes are logarithmic. Dashed lines are of every robot looking at every other, solid ones of swarms as they are.
"""

import math
import sys

WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 640, 380, 70, 20, 150, 50
ROBOTS, NANOSECONDS = (20, 14_000), (20, 6_000)
COLOURS = {"milling": "#0072b2", "aggregation": "#d55e00", "straight on": "#009e73"}


def rows(lines):
    """Controller, robots, and nanoseconds of both ways, of each line of the table that has figures."""
    for line in lines:
        words = line.split()
        if len(words) >= 5 and words[-1].replace(".", "").isdigit():
            yield " ".join(words[:-4]), int(words[-4]), float(words[-3]), float(words[-2])


def place(value, ends, begin, length):
    """Where a value is on a logarithmic axis, in pixels."""
    low, high = (math.log(end) for end in ends)
    return begin + length * (math.log(value) - low) / (high - low)


def x(robots):
    return place(robots, ROBOTS, LEFT, WIDTH - LEFT - RIGHT)


def y(nanoseconds):
    return place(nanoseconds, NANOSECONDS, HEIGHT - BOTTOM, TOP + BOTTOM - HEIGHT)


def text(left, top, words, anchor="middle", turn=""):
    return f'<text x="{left:.1f}" y="{top:.1f}" text-anchor="{anchor}"{turn}>{words}</text>'


def drawn(table):
    yield f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13">'
    yield f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>'
    floor, ceiling, end = HEIGHT - BOTTOM, TOP, WIDTH - RIGHT
    for robots in sorted({row[1] for row in table}):
        yield f'<path d="M{x(robots):.1f} {ceiling}V{floor}" stroke="#ddd"/>'
        if robots != 256:
            yield text(x(robots), floor + 18, f"{robots:,}")
    for nanoseconds in (30, 100, 300, 1_000, 3_000):
        yield f'<path d="M{LEFT} {y(nanoseconds):.1f}H{end}" stroke="#ddd"/>'
        yield text(LEFT - 8, y(nanoseconds) + 4, f"{nanoseconds:,}", "end")
    yield text((LEFT + end) / 2, HEIGHT - 10, "robots")
    middle = (ceiling + floor) / 2
    yield text(16, middle, "ns of CPU time, a robot and step", turn=f' transform="rotate(-90 16 {middle})"')
    for entry, (name, colour) in enumerate(COLOURS.items()):
        of = [row for row in table if row[0] == name]
        for column, dashes in ((2, ' stroke-dasharray="5 4"'), (3, "")):
            points = " ".join(f"{x(row[1]):.1f},{y(row[column]):.1f}" for row in of)
            yield f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{dashes}/>'
        for way, dashes in enumerate((' stroke-dasharray="5 4"', "")):
            top = ceiling + 12 + 40 * entry + 18 * way
            yield f'<path d="M{end + 10} {top}h24" stroke="{colour}" stroke-width="2"{dashes}/>'
            yield text(end + 40, top + 4, name if way else f"{name}, all", "start")
    yield "</svg>"


def main():
    with open(sys.argv[1], encoding="utf-8") as table:
        print("\n".join(drawn(list(rows(table)))))


if __name__ == "__main__":
    main()
