"""Worlds of RobotSwarmSimulator."""

import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import murmuration as mm

ROBOT = """\
type: MazeAgent
agent_radius: 0.1
scale_forward_speed: 0.2  # m/s
scale_turning_rates: 2.0
controller: self
body_color: [255, 0, 0]
sensors:
  - type: BinaryFOVSensor
    theta: 0.45
    distance: 1.0
    show: true
"""
WORLD = """\
type: RectangularWorld
size: [8, 6]
time_step: !np 1 / 40
seed: 2023
stop_at: 1000000
metadata: {hash: _hash}
spawners:
  - type: UniformCircleAgentSpawner
    n: 6
    center: [4, 3]
    radius: 1.5
    agent: !include robots/one.yaml
"""
# Each list has ten aliases of the one before.
BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 10)}]\n" for before, name in pairwise("abcdefghi")
)


def written(folder: Path, world: str = WORLD, robot: str = ROBOT) -> Path:
    (folder / "robots").mkdir(exist_ok=True)
    (folder / "robots/one.yaml").write_text(robot)
    (folder / "world.yaml").write_text(world)
    return folder / "world.yaml"


def silent(file: Path, **named: float) -> mm.swarmsim.World:
    """A world that is read without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return mm.swarmsim.world(file, **named)


def test_a_world_is_part_of_a_specification(tmp_path: Path, client: mm.Client) -> None:
    world = silent(written(tmp_path))
    start = {"shape": "disc", "radius": 150.0}
    arena = {"width": 800.0, "height": 600.0, "padding": 0.0, "boundary": "open"}
    assert world["world"] == {"agents": 6, "dt": 0.025, "start": start} | arena
    # The preset `turbopi` has the same robot.
    genomes = [[20.0, 0.0, 20.0, 1.0], [-5.0, 2.0, 20.0, -1.0]]
    short = {"world": world["world"] | {"horizon": 100}}
    own = client.evaluate(world | short, world.controllers([[0.2, 0.0, 0.2, 1.0], [-0.05, 2.0, 0.2, -1.0]]))
    assert (own.features == client.evaluate(short | {"model": "turbopi"}, genomes).features).all()
    small = {"search": {"population": 4, "generations": 1}, "taxonomy": {"medoids": 2}, "method": "random"}
    assert client.run(world | short | small).state == "completed"


def test_older_files_and_other_units_are_read(tmp_path: Path) -> None:
    robot = """\
type: Goalbot
agent_radius: 0.5
dt: 0.13
sensors:
  custom_state_decision: Linear
  sensors:
    - {type: BinaryFOVSensor, theta: 18.0, degrees: true, agent_sensing_range: 24, fn: 0.1, fp: 0.05, bias: 0.5}
    - {type: BinaryLOSSensor, angle: -1.0, fn: 0.1, fp: 0.05}
"""
    world = (
        "type: RectangularWorld\nsize: [15, 15]\ncollide_walls: true\npadding: 1\nagents: [!include robots/one.yaml]\n"
    )
    file = written(tmp_path, world, robot)
    found = silent(file, scale=15, max_speed=4 / 3, max_turn=2)
    cone = {"angle": 0.5, "half_angle": np.radians(18.0), "range": 360.0}
    robots = {
        "sensors": [cone, {"angle": -1.0}],
        "radius": 7.5,
        "drive": "unicycle",
        "max_speed": 20.0,
        "max_turn": 2.0,
    }
    assert found["robot"] == robots
    assert found["world"]["noise"] == {"missed": 0.1, "false_detection": 0.05}
    assert [found["world"][field] for field in ("dt", "boundary", "padding")] == [0.13, "walls", 15.0]
    with pytest.raises(mm.InvalidError, match=r"agents\[0\] has no scale_forward_speed: give the argument `max_speed`"):
        mm.swarmsim.world(file)


def test_wheels_poses_obstacles_and_species_are_read(tmp_path: Path, client: mm.Client) -> None:
    robot = "{type: DifferentialDriveAgent, agent_radius: 0.1, wheel_radius: 0.02, max_speed: 2, sensors: *eyes, "
    world = f"""\
type: RectangularWorld
size: [10, 10]
agents:
  - {robot.replace("*eyes", "&eyes [{type: BinaryLOSSensor}]")} position: [4, 4], angle: 0.5}}
  - {robot} position: [6, 4]}}
  - {{<<: !include robots/one.yaml, position: [5, 5]}}
objects:
  - {{type: StaticObject, position: [2, 3], agent_radius: 0.5}}
"""
    found = silent(written(tmp_path, world))
    assert [(one["robot"]["drive"], one["count"]) for one in found["species"]] == [("differential", 2), ("unicycle", 1)]
    assert found["world"]["obstacles"] == [{"x": 200.0, "y": 300.0, "radius": 50.0}]
    assert found["world"]["start"]["poses"][0] == [400.0, 400.0, 0.5]
    genomes = found.controllers([[2, -2, 1, 1, 0.2, 2, 0, 0]])
    assert genomes.tolist() == [[200, -200, 100, 100, 20, 2, 0, 0]]
    poses = client.replay(found, genomes[0], seed=1, steps=60)
    # The robot sees nothing ahead, and turns in place: (2 + 2) / (2 * 0.1 m) radians per second, in steps of 1/60 s.
    assert (poses[1] - poses[0])[0, 2] == pytest.approx((2 + 2) / (2 * 0.1) / 60)


def test_genomes_beyond_the_limits_are_named_with_the_factor(tmp_path: Path) -> None:
    world = silent(written(tmp_path))
    assert world.controllers([[1, -1, 0.5, 0.25]], shares=True).tolist() == [[20.0, -2.0, 10.0, 0.5]]
    file = tmp_path / "genomes.csv"
    file.write_text("0.1, 0.5, 0.2, 2.0\n0.1, 0.5, 0.4, 2.0\n0.1, 8, 0.4, 2.0\n")
    with pytest.raises(mm.InvalidError, match=r"row 2: .* the factor 0.5 would fit this row, and 0.25 all rows"):
        world.controllers(file)
    with pytest.raises(mm.InvalidError, match=r"row 1: .* the factor 0.5 would"):
        world.controllers([[1, 2, 0, 0]], shares=True)
    assert world.controllers(np.loadtxt(file, delimiter=",") / 4).max() == 10.0
    refused: list[tuple[Any, str]] = [
        ([[1, 2]], "2 numbers in each row: must be 4"),
        ([[np.nan] * 4], "finite numbers"),
        ([["a"] * 4], "genomes"),
        ([], "genomes"),
    ]
    for wrong, message in refused:
        with pytest.raises(mm.InvalidError, match=message):
            world.controllers(wrong)


def test_fields_without_equivalent_are_named(tmp_path: Path) -> None:
    world = WORLD.replace("UniformCircle", "Uniform").replace("    radius: 1.5\n", "    facing: away\n")
    world = world.replace("center: [4, 3]", "region: [[3, 2], [3, 4], [5, 4], [5, 2]]")
    robot = ROBOT + "idiosyncrasies: {mean: [0.9, 0.9], sd: [0.1, 0.1]}\ndelay: 0.1\n"
    with pytest.warns(RuntimeWarning, match=r"left out: .*idiosyncrasies, .*delay, .*facing, .*region") as caught:
        found = mm.swarmsim.world(written(tmp_path, world, robot))
    assert len(caught) == 1
    assert found["world"]["start"] == {"shape": "disc", "radius": pytest.approx(100 * np.sqrt(4 / np.pi))}
    elsewhere = world.replace("[[3, 2], [3, 4], [5, 4], [5, 2]]", "[[0, 0], [1, 1]]")
    with pytest.warns(RuntimeWarning, match="robots start anywhere"):
        assert "start" not in mm.swarmsim.world(written(tmp_path, elsewhere))["world"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("RectangularWorld", "HexWorld", "type = 'HexWorld': must be RectangularWorld"),
        ("[8, 6]", "8", "size = 8: must be two numbers"),
        ("[8, 6]", "[8, .nan]", r"size\[1\] = nan: must be a number"),
        ("n: 6", "n: many", r"spawners\[0\].n = 'many'"),
        ("!include robots/one.yaml", "{type: Boid}", r"spawners\[0\].agent.type = 'Boid': must be one of"),
        ("!include robots/one.yaml", "{type: MazeAgent}", "must be a list of sensors"),
        ("!np 1 / 40", "!np __import__('os')", "line 3: !np .* must be a sum or product"),
        ("!np 1 / 40", "!np 9 ** 9 ** 9", "must be a sum or product"),
        ("!np 1 / 40", "!!python/object/apply:os.getcwd []", "line 3: could not determine a constructor"),
        ("!np 1 / 40", "1" * 5000, "is not YAML"),
        ("seed: 2023", "seed: [", "world.yaml, line 6"),
        ("seed: 2023", "seed: &a [*a]", "within each other"),
        ("seed: 2023", BOMB, "more than 100000 values"),
        ("seed: 2023", "objects: [{type: StaticObject, points: [[1, 2]]}]", r"objects\[0\] = 'StaticObject'"),
        ("size: [8, 6]", "", "size is missing"),
    ],
)
def test_other_worlds_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in WORLD
    with pytest.raises(mm.InvalidError, match=message):
        mm.swarmsim.world(written(tmp_path, WORLD.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("BinaryFOVSensor", "RegionalSensor", "must be BinaryFOVSensor or BinaryLOSSensor"),
        ("theta: 0.45", "theta: wide", "theta = 'wide': must be a number"),
        ("theta: 0.45", "bias: 0", "theta is missing"),
        ("show: true", "invert: true", "invert = True: must be False"),
        ("scale_forward_speed: 0.2", "scale_forward_speed: 0", "must be a number above 0"),
    ],
)
def test_other_robots_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in ROBOT
    with pytest.raises(mm.InvalidError, match=message):
        mm.swarmsim.world(written(tmp_path, robot=ROBOT.replace(old, new)))


def test_only_files_below_the_folder_are_included(tmp_path: Path) -> None:
    folder = tmp_path / "worlds"
    folder.mkdir()
    (tmp_path / "secret.yaml").write_text(ROBOT)
    for path in ("../secret.yaml", str(tmp_path / "secret.yaml"), "robots/../../secret.yaml", "link.yaml"):
        file = written(folder, WORLD.replace("robots/one.yaml", path))
        if path == "link.yaml":
            (folder / path).symlink_to(tmp_path / "secret.yaml")
        with pytest.raises(mm.InvalidError, match="which is not below"):
            mm.swarmsim.world(file)
    for robot, message in [
        ("!include ../world.yaml", "includes itself"),
        ("!include one.yaml", "includes itself"),
        ("!include picture.svg", r"must be a file .yaml, .yml or .json"),
        ("# " + "x" * (1 << 20), "more than 1 MiB"),
    ]:
        with pytest.raises(mm.InvalidError, match=message):
            mm.swarmsim.world(written(folder, robot=robot))
    for number in range(12):
        (folder / f"robots/{number}.yaml").write_text(f"!include {number + 1}.yaml")
    with pytest.raises(mm.InvalidError, match="more than 8 files"):
        mm.swarmsim.world(written(folder, robot="!include 0.yaml"))
    with pytest.raises(OSError, match="absent"):
        mm.swarmsim.world(written(folder, robot="!include absent.yaml"))
