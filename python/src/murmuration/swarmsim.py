"""Worlds of RobotSwarmSimulator (`swarmsim`), by the paper's authors.

Example:
    >>> world = mm.swarmsim.world("turbopi/world.yaml")  # doctest: +SKIP
    >>> genomes = world.controllers([[0.2, 0.0, 0.2, 1.0]])  # doctest: +SKIP
    >>> client.evaluate(world, genomes).features.shape  # doctest: +SKIP
    (1, 5)
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _yaml as yaml
from ._arguments import flag, path, positive, shown
from ._errors import InvalidError

_UNICYCLES = ("MazeAgent", "UnicycleAgent", "Goalbot", "MazeAgentCaspian", "MillingAgentCaspian")
_WHEELED = ("DifferentialDriveAgent", "DiffDriveAgent")
# Defaults of the simulator: seconds, and units of length.
_TIME_STEP = 1 / 60
_RADIUS = 0.5
_RANGE = 100.0
_WHEEL_RADIUS = 0.01
# Fields that change nothing that Murmuration simulates, or that a campaign sets: colours, seeds, outputs, ends.
_UNUSED = {
    *("type", "seed", "stop_at", "metadata", "metrics", "background_color", "show_walls", "detectable_walls", "flags"),
    *("body_color", "body_filled", "trace_length", "trace_color", "track_io", "name", "team", "debug", "neuro_tpc"),
    *(
        "controller",
        "stop_at_goal",
        "custom_state_decision",
        "show",
        "store_history",
        "mode",
        "oneshot",
        "avoid_overlap",
    ),
    *("goal_sensing_range", "wall_sensing_range", "use_goal_state", "detect_goal_with_added_state", "degrees"),
    *("history_length", "draw", "width"),
}
# Values that are the simulator's defaults.
_DEFAULTS = [("sensing_avg", 1)]


class World(dict[str, Any]):
    """The robots and the world of a file, as part of a specification.

    `world | {"method": "latent"}` is a specification for `Client.run`; `Client.evaluate` takes the world itself.

    Attributes:
        scale: World units per unit of length of the file.
    """

    def __init__(self, fields: Mapping[str, Any], scale: float) -> None:
        super().__init__(fields)
        self.scale = scale

    def controllers(self, genomes: npt.ArrayLike | str | os.PathLike[str], *, shares: bool = False) -> Any:  # noqa: ANN401
        """Genomes of the simulator as controllers of this world.

        Args:
            genomes: A pair of numbers for each sensor state, the state without a sensor on first: (n, genes). Or the
                path of a CSV without a header. The pairs are the speeds that a controller of the simulator returns: a
                speed (units of length per second) and a turning rate (radians per second), or the speeds of the left
                and the right wheel (radians per second).
            shares: Whether the numbers are shares of the robots' largest speeds, -1 to 1, instead.

        Returns:
            float64 (n, genes), for `Client.evaluate` and for `initial` in `controllers` of a specification.

        Raises:
            InvalidError: If a speed is too large: the message has the row, from 1, and the factor that would fit.
            OSError: If the file cannot be read.
        """
        rows = _genomes(genomes)
        species = self.get("species") or [self]
        limits = np.concatenate([_limits(one["robot"]) for one in species])
        if rows.shape[1] != len(limits):
            raise InvalidError.of("genomes", f"{rows.shape[1]} numbers in each row", f"{len(limits)} numbers")
        units = (
            limits if flag("shares", shares) else np.concatenate([_units(one["robot"], self.scale) for one in species])
        )
        found = rows * units
        ratios = np.abs(found / limits).max(axis=1)
        # Products of decimal fractions are off by rounding.
        if len(beyond := np.flatnonzero(ratios > 1 + 1e-9)):
            row = int(beyond[0])
            raise InvalidError(
                f"genomes, row {row + 1}: {shown(rows[row].tolist())} is beyond the robots' largest speeds: the factor "
                f"{1 / ratios[row]:.6g} would fit this row, and {1 / ratios.max():.6g} all rows"
            )
        return np.clip(found, -limits, limits)


def world(
    file: str | os.PathLike[str],
    *,
    scale: float = 100.0,
    max_speed: float | None = None,
    max_turn: float | None = None,
) -> World:
    """Reads the YAML file of a `RectangularWorld`, with the files that it includes.

    The time step is the world's `time_step`, or else the robots' `dt`, or else 1/60 s. Robots can leave the arena, as
    in the simulator, unless the file says `collide_walls: true`. Controllers, seeds, colours, metrics and `stop_at` are
    not read. Other fields that have no equivalent are left out with a warning.

    `pip install 'murmuration[swarmsim]'` installs the library that reads YAML.

    Args:
        file: The file. It can include files in its folder and below.
        scale: World units per unit of length of the file; by default, metres become centimetres.
        max_speed: The largest speed, instead of the file's `scale_forward_speed`, units of length per second; of
            wheels, radians per second.
        max_turn: The largest turning rate, instead of the file's `scale_turning_rates`, radians per second.

    Raises:
        InvalidError: If the file is not such a world, or has robots or sensors that Murmuration does not simulate.
        OSError: If a file cannot be read.

    Warns:
        RuntimeWarning: If fields are left out.
    """
    place = Path(path("file", file))
    reader = _Reader(place, positive("scale", scale), max_speed, max_turn)
    found = reader.world(yaml.load(place))
    if reader.left_out:
        warnings.warn(f"{place}: left out: {', '.join(reader.left_out)}", RuntimeWarning, stacklevel=2)
    return found


class _Reader:
    """Turns a document into a specification, and collects the fields that it leaves out."""

    def __init__(self, file: Path, scale: float, max_speed: float | None, max_turn: float | None) -> None:
        self._file = file
        self._scale = scale
        self._max_speed = max_speed
        self._max_turn = max_turn
        self.left_out: list[str] = []

    def world(self, document: object) -> World:
        world = self._object("the world", document)
        if world.get("type") != "RectangularWorld":
            raise self._wrong("type", world.get("type"), "RectangularWorld")
        size = self._point("size", world.get("size"))
        agents = self._list("agents", world)
        groups, steps = self._groups(agents, self._list("spawners", world))
        step = self._number("time_step", world["time_step"]) if "time_step" in world else None
        if step is None:
            step = steps.pop() if len(steps) == 1 else _TIME_STEP
        fields: dict[str, Any] = {
            "width": size[0] * self._scale,
            "height": size[1] * self._scale,
            "padding": self._number("padding", world.get("padding", 0)) * self._scale,
            "agents": sum(count for _, count in groups),
            "dt": step,
            "boundary": "walls" if world.get("collide_walls") is True else "open",
        }
        if obstacles := self._obstacles(self._list("objects", world)):
            fields["obstacles"] = obstacles
        if start := self._start(size, agents, self._list("spawners", world)):
            fields["start"] = start
        noises = [robot.pop("noise") for robot, _ in groups]
        if any(noise != noises[0] for noise in noises):
            raise self._wrong("sensors", "different errors", "sensors with the same false_positive and false_negative")
        if any(noises[0].values()):
            fields["noise"] = noises[0]
        self._rest("", world, {"size", "time_step", "agents", "spawners", "objects", "padding", "collide_walls"})
        if len(groups) == 1:
            return World({"robot": groups[0][0], "world": fields}, self._scale)
        names = [
            {"name": f"s{number}", "robot": robot, "count": count} for number, (robot, count) in enumerate(groups, 1)
        ]
        return World({"species": names, "world": fields}, self._scale)

    def _groups(self, agents: list[Any], spawners: list[Any]) -> tuple[list[tuple[dict[str, Any], int]], set[float]]:
        """The robots with the number of each, and their own time steps."""
        given = [(f"agents[{place}]", agent, 1) for place, agent in enumerate(agents)]
        for place, one in enumerate(spawners):
            spawner = self._object(f"spawners[{place}]", one)
            count = spawner.get("n", 1)
            if not isinstance(count, int) or isinstance(count, bool) or count < 1:
                raise self._wrong(f"spawners[{place}].n", count, "a whole number from 1")
            given.append((f"spawners[{place}].agent", spawner.get("agent"), count))
        groups: list[tuple[dict[str, Any], int]] = []
        steps: set[float] = set()
        for where, agent, count in given:
            fields = self._object(where, agent)
            if "dt" in fields:
                steps.add(self._number(f"{where}.dt", fields["dt"]))
            robot = self._robot(where, fields)
            same = next((place for place, (other, _) in enumerate(groups) if other == robot), None)
            if same is None:
                groups.append((robot, count))
            else:
                groups[same] = (robot, groups[same][1] + count)
        if not groups:
            raise InvalidError(f"{self._file}: there are no agents: `agents` or `spawners` must have some")
        return groups, steps

    def _robot(self, where: str, agent: dict[str, Any]) -> dict[str, Any]:
        kind = agent.get("type")
        if kind not in _UNICYCLES + _WHEELED:
            raise self._wrong(f"{where}.type", kind, f"one of {', '.join(_UNICYCLES + _WHEELED)}")
        sensors = agent.get("sensors") or []
        if isinstance(sensors, dict):
            self._rest(f"{where}.sensors.", sensors, {"sensors"})
            sensors = sensors.get("sensors") or []
        if not isinstance(sensors, list) or not sensors:
            raise self._wrong(f"{where}.sensors", sensors, "a list of sensors")
        found = [self._sensor(f"{where}.sensors[{place}]", one) for place, one in enumerate(sensors)]
        noises = [sensor.pop("noise") for sensor in found]
        if any(noise != noises[0] for noise in noises):
            raise self._wrong(f"{where}.sensors", "different errors", "sensors with the same errors")
        radius = self._number(f"{where}.agent_radius", agent.get("agent_radius", 0)) or _RADIUS
        robot: dict[str, Any] = {"sensors": found, "radius": radius * self._scale, "noise": noises[0]}
        speed = self._limit(where, agent, "scale_forward_speed", "max_speed", self._max_speed) * self._scale
        if kind in _WHEELED:
            # A body of radius R turns by (l - r) / (2 R): with R grow the speeds of the wheels, and not the wheels.
            wheel = self._number(f"{where}.wheel_radius", agent.get("wheel_radius", _WHEEL_RADIUS))
            robot |= {"drive": "differential", "wheel_radius": wheel, "max_speed": speed}
        else:
            turn = self._limit(where, agent, "scale_turning_rates", "max_turn", self._max_turn)
            robot |= {"drive": "unicycle", "max_speed": speed, "max_turn": turn}
        known = {"sensors", "agent_radius", "dt", "wheel_radius", "position", "angle", "max_speed", "max_turn"}
        self._rest(f"{where}.", agent, known | {"scale_forward_speed", "scale_turning_rates"})
        return robot

    def _limit(self, where: str, agent: dict[str, Any], usual: str, ours: str, given: float | None) -> float:
        """The largest speed that the caller or the agent gives."""
        if given is not None:
            return positive(ours, given)
        for name in (ours, usual):
            if name in agent:
                number = self._number(f"{where}.{name}", agent[name])
                if number <= 0:
                    raise self._wrong(f"{where}.{name}", number, "a number above 0")
                return number
        raise InvalidError(f"{self._file}: {where} has no {usual}: give the argument `{ours}`")

    def _sensor(self, where: str, one: object) -> dict[str, Any]:
        sensor = self._object(where, one)
        kind = sensor.get("type")
        for name, usual in (("invert", False), ("target_team", None), ("time_step_between_sensing", 1)):
            if sensor.get(name, usual) not in (usual, None):
                raise self._wrong(f"{where}.{name}", sensor[name], str(usual))

        def number(*names: str, usual: float) -> float:
            name = next((name for name in names if name in sensor), names[0])
            return self._number(f"{where}.{name}", sensor.get(name, usual))

        noise = {
            "missed": number("false_negative", "fn", usual=0),
            "false_detection": number("false_positive", "fp", usual=0),
        }
        known = {"false_negative", "fn", "false_positive", "fp", "invert", "target_team", "time_step_between_sensing"}
        if kind == "BinaryLOSSensor":
            self._rest(f"{where}.", sensor, known | {"angle"})
            angle = 0.0 if sensor.get("angle") is None else number("angle", usual=0)
            return {"angle": angle, "noise": noise}
        if kind != "BinaryFOVSensor":
            raise self._wrong(f"{where}.type", kind, "BinaryFOVSensor or BinaryLOSSensor")
        if "theta" not in sensor:
            raise self._wrong(f"{where}.theta", None, "half of the cone's opening angle")
        self._rest(f"{where}.", sensor, known | {"theta", "bias", "distance", "agent_sensing_range"})
        half = number("theta", usual=0)
        return {
            "angle": number("bias", usual=0),
            "half_angle": math.radians(half) if sensor.get("degrees") is True else half,
            "range": number("distance", "agent_sensing_range", usual=_RANGE) * self._scale,
            "noise": noise,
        }

    def _obstacles(self, objects: list[Any]) -> list[dict[str, float]]:
        found = []
        for place, one in enumerate(objects):
            where = f"objects[{place}]"
            disc = self._object(where, one)
            if (
                disc.get("points")
                or disc.get("type") not in ("StaticObject", "StaticAgent")
                or "agent_radius" not in disc
            ):
                raise self._wrong(where, disc.get("type", "an object"), "a StaticObject with position and agent_radius")
            x, y = self._point(f"{where}.position", disc.get("position"))
            radius = self._number(f"{where}.agent_radius", disc["agent_radius"])
            found.append({"x": x * self._scale, "y": y * self._scale, "radius": radius * self._scale})
        return found

    def _start(self, size: tuple[float, float], agents: list[Any], spawners: list[Any]) -> dict[str, Any] | None:
        """Where the robots start; None for anywhere in the arena."""
        if not spawners and all("position" in agent for agent in agents):
            poses = []
            for place, agent in enumerate(agents):
                x, y = self._point(f"agents[{place}].position", agent["position"])
                angle = self._number(f"agents[{place}].angle", agent.get("angle") or 0)
                poses.append([x * self._scale, y * self._scale, angle])
            return {"shape": "poses", "poses": poses}
        self.left_out += [f"agents[{place}].position" for place, agent in enumerate(agents) if "position" in agent]
        discs = []
        for place, spawner in enumerate(spawners):
            where = f"spawners[{place}]."
            known = {"n", "agent", "center", "radius", "region"}
            self._rest(where, spawner, known)
            if spawner.get("type") == "UniformCircleAgentSpawner":
                center = self._point(f"{where}center", spawner.get("center"))
                discs.append((center, self._number(f"{where}radius", spawner.get("radius"))))
            elif spawner.get("region") is not None:
                corners = self._region(f"{where}region", spawner["region"])
                if (corners.min(axis=0) <= 0).all() and (corners.max(axis=0) >= size).all():
                    continue
                middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
                area = float(np.prod(corners.max(axis=0) - corners.min(axis=0)))
                discs.append(((float(middle[0]), float(middle[1])), math.sqrt(area / math.pi)))
                self.left_out.append(f"{where}region (a disc of its area instead)")
            elif spawner.get("type") is not None:
                self.left_out.append(f"{where}type")
        is_central = all(
            math.isclose(center[axis], size[axis] / 2, abs_tol=size[axis] / 100)
            for center, _ in discs
            for axis in (0, 1)
        )
        if (
            not agents
            and discs
            and is_central
            and len({radius for _, radius in discs}) == 1
            and len(discs) == len(spawners)
        ):
            return {"shape": "disc", "radius": discs[0][1] * self._scale}
        if discs:
            self.left_out.append("the places of spawners (robots start anywhere)")
        return None

    def _region(self, where: str, region: object) -> npt.NDArray[np.float64]:
        """The corners of a region: (n, 2)."""
        if not isinstance(region, list) or len(region) < 2:
            raise self._wrong(where, region, "a list of corners")
        return np.array([self._point(f"{where}[{place}]", corner) for place, corner in enumerate(region)])

    def _rest(self, where: str, fields: dict[str, Any], known: set[str]) -> None:
        """Notes the fields that are not read, unless they have no effect."""
        for name, value in fields.items():
            has_effect = value not in (None, False, 0, [], {}, "") and (name, value) not in _DEFAULTS
            if name not in known and name not in _UNUSED and (has_effect or name == "collides"):
                self.left_out.append(f"{where}{name}")

    def _object(self, where: str, value: object) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self._wrong(where, value, "an object with fields")
        return value

    def _list(self, name: str, fields: dict[str, Any]) -> list[Any]:
        value = fields.get(name)
        if value is None:
            return []
        if not isinstance(value, list):
            raise self._wrong(name, value, "a list")
        return value

    def _point(self, where: str, value: object) -> tuple[float, float]:
        if not isinstance(value, list) or len(value) != 2:
            raise self._wrong(where, value, "two numbers")
        return self._number(f"{where}[0]", value[0]), self._number(f"{where}[1]", value[1])

    def _number(self, where: str, value: object) -> float:
        if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300:
            return float(value)
        raise self._wrong(where, value, "a number")

    def _wrong(self, where: str, value: object, limit: str) -> InvalidError:
        error = InvalidError.of(where, None if value is None else shown(value), limit)
        return error.reworded(f"{self._file}: {error}")


def _genomes(genomes: npt.ArrayLike | str | os.PathLike[str]) -> npt.NDArray[np.float64]:
    try:
        if isinstance(genomes, (str, os.PathLike)):
            rows = np.loadtxt(path("genomes", genomes), delimiter=",", ndmin=2, dtype=np.float64)
        else:
            rows = np.array(genomes, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidError(f"genomes: {error}") from None
    if rows.ndim != 2 or not len(rows) or not np.isfinite(rows).all():
        raise InvalidError.of(
            "genomes", f"an array of shape {rows.shape}", "finite numbers (n, genes), at least one row"
        )
    return rows


def _limits(robot: Mapping[str, Any]) -> npt.NDArray[np.float64]:
    """The largest magnitude of each gene."""
    pair = [robot["max_speed"], robot.get("max_turn", robot["max_speed"])]
    return np.tile(np.array(pair, np.float64), 1 << len(robot["sensors"]))


def _units(robot: Mapping[str, Any], scale: float) -> npt.NDArray[np.float64]:
    """What a gene is multiplied by: speeds grow with lengths, and turning rates do not."""
    return np.tile(np.array([scale, 1.0 if "max_turn" in robot else scale]), 1 << len(robot["sensors"]))
