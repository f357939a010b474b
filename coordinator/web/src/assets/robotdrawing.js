// The drawing of a robot, with handles that turn, widen and lengthen the selected sensor.
import { middle, put, radians, rangeField, turn } from "./robottoml.js";

// Lengths in units of the drawing: half of a side, the longest sensor, and the smallest body.
const HALF = 130;
const LONGEST = 88;
const SMALLEST_BODY = 8;
const DEGREE = Math.PI / 180;
const MOST_RANGE = 1e6;

export const inTurn = (angle) => angle - 2 * Math.PI * Math.ceil((angle - Math.PI) / (2 * Math.PI));

const at = (angle, distance) => [distance * Math.cos(angle), distance * Math.sin(angle)].map((x) => Number(x.toFixed(2)));

function make(name, attributes, ...inner) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, given] of Object.entries(attributes)) made.setAttribute(key, given);
  made.append(...inner);
  return made;
}

function arc(from, to, radius) {
  return `${at(from, radius).join(" ")}A${radius} ${radius} 0 ${Number(to - from > Math.PI)} 1 ${at(to, radius).join(" ")}`;
}

function cone(angle, half, length) {
  if (half === 0) return `M0 0L${at(angle, length).join(" ")}`;
  if (half >= Math.PI) return `M-${length} 0A${length} ${length} 0 1 1 ${length} 0A${length} ${length} 0 1 1 -${length} 0Z`;
  return `M0 0L${arc(angle - half, angle + half, length)}Z`;
}

// The handles of a sensor: where each is, how a pointer or a key changes the sensor, and what the handle says.
const HANDLES = {
  direction: {
    label: "Direction",
    place: ({ angle, length }) => at(angle, length + 24),
    drag: (sensor, to, drawing) => turn(sensor, drawing.snapped(to.angle)),
    step: (sensor, by) => turn(sensor, radians(inTurn(middle(sensor) + by * DEGREE))),
    end: (sensor, isHome) => turn(sensor, isHome ? 0 : Math.PI),
    limits: [-Math.PI, Math.PI],
    now: (sensor) => inTurn(middle(sensor)),
  },
  cone: {
    label: "Half angle of the cone",
    place: ({ angle, half, length }) => at(angle + half + 16 / Math.max(0.62 * length, 26), Math.max(0.62 * length, 26)),
    drag(sensor, to, drawing) {
      const beside = 16 / Math.max(0.62 * drawing.length(sensor), 26);
      const off = inTurn(to.angle - beside - middle(sensor));
      // The other side of a wide cone counts as wider, not as narrow.
      const was = sensor.half_angle ?? 0;
      const half = off < 0 && was > Math.PI / 2 ? Math.PI : Math.max(0, off);
      put(sensor, "half_angle", drawing.snapped(half), 0);
    },
    step: (sensor, by) =>
      put(sensor, "half_angle", radians(Math.min(Math.PI, Math.max(0, (sensor.half_angle ?? 0) + by * DEGREE))), 0),
    end: (sensor, isHome) => put(sensor, "half_angle", isHome ? 0 : Math.PI, 0),
    limits: [0, Math.PI],
    now: (sensor) => sensor.half_angle ?? 0,
  },
  range: {
    label: "Range",
    place: ({ angle, length }) => at(angle, length),
    drag: (sensor, to, drawing) => drawing.reach(sensor, to.distance / drawing.scale),
    step: (sensor, by, drawing) => drawing.reach(sensor, (sensor[rangeField(sensor)] ?? drawing.longest) + by * drawing.grain),
    end: (sensor, isHome, drawing) => drawing.reach(sensor, isHome ? drawing.grain : undefined),
    limits: [0, MOST_RANGE],
    now: (sensor, drawing) => sensor[rangeField(sensor)] ?? drawing.longest,
  },
};

const KEYS = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 };

export class Drawing {
  // `changed` is called after each change of a sensor, and `selected` when another sensor is selected.
  constructor({ changed, selected, inWords }) {
    this.changed = changed;
    this.selected = selected;
    this.inWords = inWords;
    this.isDegrees = true;
    this.svg = make("svg", { viewBox: `${-HALF} ${-HALF} ${2 * HALF} ${2 * HALF}`, role: "group", "aria-label": "Drawing of the robot" });
  }

  // Shows a robot whose body has this radius.
  show(robot, radius, place) {
    this.robot = robot;
    this.radius = radius;
    this.place = Math.min(place, robot.sensors.length - 1);
    this.fit();
    this.body = make("circle", { class: "body" });
    this.nose = make("line", { class: "body" });
    this.cones = robot.sensors.map((_, i) => this.cone(i));
    this.handles = Object.entries(HANDLES).map(([name, handle]) => ({ name, ...handle, shape: this.handle(name, handle) }));
    this.stalk = make("line", { class: "stalk" });
    const selected = make("g", { class: `selected sensor-${this.place}` }, this.stalk, ...this.handles.map(({ shape }) => shape));
    this.svg.replaceChildren(...this.cones.map(({ group }) => group), this.body, this.nose, selected);
    this.draw();
  }

  // The scale, which stays the same while a handle is dragged.
  fit() {
    const ranges = this.robot.sensors.flatMap(({ range, wall_range }) => [range ?? 0, wall_range ?? 0]);
    this.longest = Math.max(10 * this.radius, ...ranges);
    this.scale = LONGEST / this.longest;
    this.grain = 10 ** Math.floor(Math.log10(this.longest / 40));
  }

  cone(i) {
    const path = make("path", {});
    // The angles from which the search chooses.
    const choice = make("path", { class: "choice" });
    const name = make("text", { "aria-hidden": true });
    name.textContent = `S${i + 1}`;
    const group = make("g", { class: `sensor-${i}` }, path, choice, name);
    group.addEventListener("pointerdown", () => i !== this.place && this.selected(i));
    return { group, path, choice, name };
  }

  handle(name, { label, drag, step, end }) {
    const shape = make("circle", { class: `handle ${name}`, r: 8, role: "slider", tabindex: 0, "aria-label": `${label} of S${this.place + 1}` });
    const hint = make("title", {});
    hint.textContent = label;
    shape.append(hint);
    const sensor = () => this.robot.sensors[this.place];
    shape.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      shape.focus();
      shape.setPointerCapture(event.pointerId);
    });
    shape.addEventListener("pointermove", (event) => {
      if (!shape.hasPointerCapture(event.pointerId)) return;
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
      drag(sensor(), { angle: Math.atan2(y, x), distance: Math.hypot(x, y) }, this);
      this.draw();
      this.changed();
    });
    shape.addEventListener("lostpointercapture", () => {
      this.fit();
      this.draw();
    });
    shape.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const by = (KEYS[event.key] ?? 0) * (event.shiftKey ? 10 : 1);
      if (by) step(sensor(), by, this);
      else if (event.key === "Home" || event.key === "End") end(sensor(), event.key === "Home", this);
      else return;
      event.preventDefault();
      event.stopPropagation();
      this.fit();
      this.draw();
      this.changed();
    });
    return shape;
  }

  // Sets a range in steps that one can see; `undefined` is no limit.
  reach(sensor, range) {
    const steps = range === undefined ? undefined : Math.max(1, Math.round(range / this.grain));
    const rounded = steps && Number((steps * this.grain).toPrecision(6));
    put(sensor, rangeField(sensor), rounded && Math.min(MOST_RANGE, rounded));
  }

  // An angle of a pointer, to a degree or to a hundredth of a radian.
  snapped(angle) {
    const grain = this.isDegrees ? DEGREE : 0.01;
    return radians(Math.round(angle / grain) * grain);
  }

  // The drawn length of a sensor.
  length(sensor) {
    const range = sensor[rangeField(sensor)];
    const least = this.radius * this.scale + 10;
    return Number(Math.min(LONGEST * 1.15, Math.max(least, range === undefined ? LONGEST : range * this.scale)).toFixed(2));
  }

  draw() {
    const body = Math.max(SMALLEST_BODY, this.radius * this.scale);
    this.body.setAttribute("r", body);
    this.nose.setAttribute("x2", body);
    this.robot.sensors.forEach((sensor, i) => this.drawSensor(sensor, this.cones[i], i));
    const sensor = this.robot.sensors[this.place];
    const shown = { angle: middle(sensor), half: sensor.half_angle ?? 0, length: this.length(sensor) };
    for (const { name, shape, place, now, limits } of this.handles) {
      const [x, y] = place(shown);
      shape.setAttribute("cx", x);
      shape.setAttribute("cy", y);
      const isAngle = name !== "range";
      const inUnit = (given) => (isAngle && this.isDegrees ? Number((given / DEGREE).toFixed(1)) : given);
      ["aria-valuemin", "aria-valuemax"].forEach((limit, i) => shape.setAttribute(limit, inUnit(limits[i])));
      shape.setAttribute("aria-valuenow", inUnit(now(sensor, this)));
      const isEndless = !isAngle && sensor[rangeField(sensor)] === undefined;
      shape.setAttribute("aria-valuetext", isEndless ? "no limit" : isAngle ? this.inWords(now(sensor)) : `${now(sensor)}`);
    }
    const [x2, y2] = at(shown.angle, shown.length + 24);
    this.stalk.setAttribute("x2", x2);
    this.stalk.setAttribute("y2", y2);
  }

  drawSensor(sensor, { path, choice, name }, i) {
    const length = this.length(sensor);
    const half = Math.min(Math.PI, sensor.half_angle ?? 0);
    const angles = sensor.angle === "free" && sensor.angles ? sensor.angles : [middle(sensor)];
    path.setAttribute("d", angles.map((angle) => cone(angle, half, length)).join(""));
    const [low, high] = (sensor.angle === "free" && sensor.angle_range) || [0, 0];
    const turned = arc(low, Math.min(high, low + 2 * Math.PI - 0.01), Number((0.45 * length).toFixed(2)));
    choice.setAttribute("d", high > low ? `M${turned}` : "");
    path.classList.toggle("free", sensor.angle === "free");
    path.classList.toggle("endless", sensor[rangeField(sensor)] === undefined);
    // The name is beside the middle, where no handle is. The names of sensors in one direction are not on top of each other.
    const distance = Math.max(20, (0.85 - 0.2 * (i % 3)) * length);
    const [x, y] = at(angles[0] - Math.max(half * 0.6, 14 / distance), distance);
    name.setAttribute("x", x);
    name.setAttribute("y", y + 4);
  }
}
