// The motion of a swarm without an end, a piece at a time, and its drawing.
import { insist, reply } from "./coordinator.js";
import { drawArena, fit } from "./drawing.js";

const VERSION = 1;
const HEADER_WORDS = 5;
// Pieces requested in advance.
const AHEAD = 1;
// Least radius, and most robots, for which sensors are drawn.
const LEAST_RADIUS_PX = 4;
const MOST_WITH_SENSORS = 200;

// Frames at even steps, in the coordinator's format, which is little-endian like all browsers.
class Piece {
  constructor(bytes) {
    const [version, first, stride, frames, robots] = new Uint32Array(bytes, 0, HEADER_WORDS);
    if (version !== VERSION) throw new Error("this page is older than its coordinator: load it again");
    this.first = first;
    this.stride = stride;
    this.frames = frames;
    this.robots = robots;
    this.last = first + stride * (frames - 1);
    this.poses = new Float32Array(bytes, 4 * HEADER_WORDS, 3 * frames * robots);
    this.sensed = new Uint8Array(bytes, 4 * HEADER_WORDS + this.poses.byteLength);
  }

  // Passes x, y, heading and sensor state of each robot to `told`.
  at(step, { width, height, torus }, told) {
    const place = Math.min(Math.max((step - this.first) / this.stride, 0), this.frames - 1);
    const frame = Math.floor(place);
    const part = place - frame;
    const from = 3 * frame * this.robots;
    const to = 3 * Math.min(frame + 1, this.frames - 1) * this.robots;
    const between = (i, side) => {
      const way = this.poses[to + i] - this.poses[from + i];
      // On a torus, a robot that leaves on one side stays there until it comes in on the other.
      return this.poses[from + i] + (torus && Math.abs(way) > side / 2 ? 0 : part * way);
    };
    for (let i = 0; i < this.robots; i++) {
      const [x, y, heading] = [between(3 * i, width), between(3 * i + 1, height), between(3 * i + 2, Infinity)];
      told(x, y, heading, this.sensed[frame * this.robots + i], i);
    }
  }
}

// Requests the pieces of one motion, and holds those still to be shown.
export class Pieces {
  // Calls `came` when there is more to show, and `failed` on an error; `url` answers with pieces.
  constructor({ came, failed, url }) {
    this.url = url;
    this.came = came;
    this.failed = failed;
    this.held = [];
    this.asked = null;
    // Before a motion begins there is nothing to request.
    this.isNew = true;
    this.ended = false;
  }

  // Begins another motion, from a step on. The old one stays until the first piece arrives.
  begin(query, step) {
    this.asked?.abort();
    this.asked = null;
    this.query = query;
    this.isNew = true;
    this.ended = false;
    this.ask(step);
  }

  get last() {
    return this.held.at(-1)?.last ?? 0;
  }

  async ask(step) {
    const asked = new AbortController();
    this.asked = asked;
    const body = new URLSearchParams(this.query);
    body.set("from", step);
    const ask = () => {
      asked.signal.throwIfAborted();
      return reply(fetch(this.url, { method: "POST", body, signal: asked.signal })).then((it) => it.arrayBuffer());
    };
    try {
      const piece = new Piece(await insist(ask, (error) => this.asked === asked && this.failed(error)));
      if (this.asked !== asked) return;
      this.asked = null;
      this.held = this.isNew ? [piece] : [...this.held, piece];
      const was = this.isNew;
      this.isNew = false;
      this.came(piece, was);
    } catch (error) {
      if (this.asked !== asked) return;
      this.asked = null;
      this.ended = true;
      this.failed(error);
    }
  }

  // The piece that contains a step; requests the next piece.
  of(step) {
    const place = this.held.findIndex((piece) => step <= piece.last);
    this.held.splice(0, Math.max(place, 0));
    if (!this.asked && !this.ended && !this.isNew && this.held.length <= AHEAD) this.ask(this.last);
    return place < 0 ? this.held.at(-1) : this.held[0];
  }
}

// Draws a swarm at a step of a piece. `swarm` is its world and its species; `counts` are the numbers of robots of each.
export function draw(canvas, piece, step, { swarm, counts, genes }) {
  fit(canvas);
  const pen = canvas.getContext("2d");
  const scale = canvas.width / swarm.world.width;
  pen.clearRect(0, 0, canvas.width, canvas.height);
  drawArena(pen, swarm.world, scale);
  const layers = swarm.species.map((species) => layer(species, scale, genes));
  for (const layer of layers) if (layer.radius < LEAST_RADIUS_PX || piece.robots > MOST_WITH_SENSORS) layer.sensors = [];
  const ends = counts.map((_, place) => counts.slice(0, place + 1).reduce((sum, count) => sum + count));
  piece.at(step, swarm.world, (x, y, heading, sensed, i) => {
    const place = ends.findIndex((end) => i < end);
    add(layers[Math.max(place, 0)], x * scale, y * scale, heading, sensed);
  });
  for (const layer of layers) paint(pen, layer);
}

function layer({ colour, radius, sensors }, scale, genes) {
  return {
    colour,
    radius: Math.max(radius * scale, 1.5),
    sensors: sensors.map(({ angle, gene, half, reach }) => ({ angle: angle ?? genes[gene], half, reach: reach * scale })),
    on: new Path2D(),
    off: new Path2D(),
    headings: new Path2D(),
    seeing: new Path2D(),
    blind: new Path2D(),
    // Areas covered by the cones of sensors that are on, and of those that are off.
    lit: new Path2D(),
    dim: new Path2D(),
  };
}

// Adds a robot: its body, filled if a sensor is on; its heading; and its sensors' directions, up to their range if they have one.
function add(layer, x, y, heading, sensed) {
  const { radius, sensors } = layer;
  const body = sensed ? layer.on : layer.off;
  body.moveTo(x + radius, y);
  body.arc(x, y, radius, 0, 2 * Math.PI);
  ray(layer.headings, x, y, heading, 0, 1.6 * radius);
  sensors.forEach(({ angle, half, reach }, place) => {
    const isOn = (sensed >> (sensors.length - 1 - place)) & 1;
    const end = half === 0 && reach ? reach : (isOn ? 3.4 : 2.6) * radius;
    ray(isOn ? layer.seeing : layer.blind, x, y, heading + angle, 1.8 * radius, end);
    if (half > 0) cone(isOn ? layer.lit : layer.dim, x, y, heading + angle, half, reach);
  });
}

function cone(path, x, y, middle, half, reach) {
  if (half >= Math.PI) path.moveTo(x + reach, y);
  else path.moveTo(x, y);
  path.arc(x, y, reach, middle - half, middle + half);
  path.closePath();
}

function ray(path, x, y, angle, from, to) {
  path.moveTo(x + from * Math.cos(angle), y + from * Math.sin(angle));
  path.lineTo(x + to * Math.cos(angle), y + to * Math.sin(angle));
}

function paint(pen, { colour, radius, on, off, headings, seeing, blind, lit, dim }) {
  const thin = Math.max(0.25 * radius, 1);
  pen.fillStyle = colour;
  pen.strokeStyle = colour;
  // Under the robots, and each path as one area, so that robots stay visible where many cones overlap.
  pen.globalAlpha = 0.08;
  pen.fill(dim);
  pen.globalAlpha = 0.2;
  pen.fill(lit);
  pen.globalAlpha = 1;
  pen.lineWidth = thin;
  pen.stroke(off);
  pen.stroke(on);
  pen.fill(on);
  pen.lineWidth = 1.5 * thin;
  pen.stroke(headings);
  pen.stroke(seeing);
  pen.globalAlpha = 0.35;
  pen.lineWidth = 1;
  pen.stroke(blind);
  pen.globalAlpha = 1;
}
