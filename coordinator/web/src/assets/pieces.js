// Loads the motion of a swarm without an end, one piece at a time, and draws it.
import { insist, reply } from "./coordinator.js";
import { drawArena, fit } from "./drawing.js";

const VERSION = 2;
const HEADER_WORDS = 6;
// A moment has its step, the number of its verdict, and five features.
const MOMENT_WORDS = 7;
// Number of pieces that are requested in advance.
const AHEAD = 1;
// Maximum size of the kept pieces together: about 100,000 steps of 24 robots, or 5,000 steps of 1,000 robots.
const MOST_BYTES = 32 << 20;
// Number of steps between the first steps of pieces that are requested again.
const LENGTH = 600;
// Minimum radius of a robot, and maximum number of robots, for which sensors are drawn.
const LEAST_RADIUS_PX = 4;
const MOST_WITH_SENSORS = 200;

// The moments of a piece: what an evaluation would find if the motion ended at a step. The verdict 0 stands for none.
function momentsOf(words) {
  const numbers = new Float32Array(words.buffer, words.byteOffset, words.length);
  return Array.from({ length: words.length / MOMENT_WORDS }, (_, place) => {
    const at = place * MOMENT_WORDS;
    return { step: words[at], verdict: words[at + 1], features: Array.from(numbers.subarray(at + 2, at + MOMENT_WORDS)) };
  });
}

// A piece of a motion: frames at every step or at every other step, in the coordinator's format. The format is little-endian,
// like all browsers.
class Piece {
  constructor(bytes) {
    const [version, first, stride, frames, robots, moments] = new Uint32Array(bytes, 0, HEADER_WORDS);
    if (version !== VERSION) throw new Error("this page is older than its coordinator: load it again");
    this.bytes = bytes.byteLength;
    this.first = first;
    this.stride = stride;
    this.frames = frames;
    this.robots = robots;
    this.last = first + stride * (frames - 1);
    this.poses = new Float32Array(bytes, 4 * HEADER_WORDS, 3 * frames * robots);
    const after = 4 * HEADER_WORDS + this.poses.byteLength;
    this.moments = momentsOf(new Uint32Array(bytes, after, MOMENT_WORDS * moments));
    this.sensed = new Uint8Array(bytes, after + 4 * MOMENT_WORDS * moments);
  }

  // Passes x, y, heading and state of the sensors of each robot at a step to `told`.
  at(step, { width, height, torus }, told) {
    const place = Math.min(Math.max((step - this.first) / this.stride, 0), this.frames - 1);
    const frame = Math.floor(place);
    const part = place - frame;
    const from = 3 * frame * this.robots;
    const to = 3 * Math.min(frame + 1, this.frames - 1) * this.robots;
    const between = (i, side) => {
      const way = this.poses[to + i] - this.poses[from + i];
      // A robot that leaves a torus on one side stays on this side until it comes in on the other side.
      return this.poses[from + i] + (torus && Math.abs(way) > side / 2 ? 0 : part * way);
    };
    for (let i = 0; i < this.robots; i++) {
      const [x, y, heading] = [between(3 * i, width), between(3 * i + 1, height), between(3 * i + 2, Infinity)];
      told(x, y, heading, this.sensed[frame * this.robots + i], i);
    }
  }
}

// Requests the pieces of one motion. Keeps the pieces that were shown, so that a person can go back without another request.
export class Pieces {
  // Calls `came` when a piece has arrived, and `failed` after an error; `url` is the address of the pieces.
  constructor({ came, failed, url }) {
    this.url = url;
    this.came = came;
    this.failed = failed;
    // The pieces of the current motion, by their first steps.
    this.held = [];
    this.asked = null;
    // The first step of the piece that is requested, and of the piece that was refused.
    this.wanted = null;
    this.refused = null;
    // Whether no piece of the current motion has arrived yet.
    this.isNew = true;
  }

  // Begins another motion, from a step on. The old motion stays until the first piece of the new motion arrives.
  begin(query, step) {
    this.query = query;
    this.isNew = true;
    this.refused = null;
    this.ask(step);
  }

  async ask(step) {
    this.asked?.abort();
    const asked = new AbortController();
    this.asked = asked;
    this.wanted = step;
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
      this.held = this.isNew ? [piece] : [...this.held, piece].sort((a, b) => a.first - b.first);
      const was = this.isNew;
      this.isNew = false;
      this.came(piece, was);
    } catch (error) {
      if (this.asked !== asked) return;
      this.asked = null;
      this.refused = step;
      this.failed(error);
    }
  }

  // The piece that contains a step; undefined while it is requested. It also requests the next piece.
  of(step) {
    const piece = this.at(step);
    if (this.isNew) return piece;
    const wanted = piece ? this.follows(piece) : this.begins(step);
    const isComing = this.asked && (piece || this.wanted === wanted);
    if (wanted !== null && wanted !== this.refused && !isComing) this.ask(wanted);
    this.drop(step);
    return piece;
  }

  at(step) {
    return this.held.findLast((piece) => piece.first <= step && step <= piece.last);
  }

  // The first step of the piece that is missing after a piece; null if there is none.
  follows(piece) {
    const end = this.endOf(piece);
    const ahead = this.held.filter(({ last }) => last > piece.last && last <= end).length;
    return ahead < AHEAD ? end : null;
  }

  // The first step of a missing piece that contains a step. Neighbouring steps have the same missing piece, so that a person who
  // moves the slider makes few requests.
  begins(step) {
    const before = this.held.filter(({ last }) => last <= step).map(({ last }) => last);
    return Math.max(step - (step % LENGTH), ...before);
  }

  // The last step up to which the pieces from the one with this step on have no gap; the step itself if there is no such piece.
  reach(step) {
    const piece = this.at(step);
    return piece ? this.endOf(piece) : step;
  }

  endOf({ last }) {
    let end = last;
    for (const next of this.held) if (next.first <= end && next.last > end) end = next.last;
    return end;
  }

  // Drops the pieces farthest from a step until the others are few enough. A dropped piece is requested again when it is shown.
  drop(step) {
    const distance = ({ first, last }) => Math.max(first - step, step - last, 0);
    while (this.held.length > AHEAD + 1 && this.held.reduce((sum, piece) => sum + piece.bytes, 0) > MOST_BYTES) {
      const farthest = this.held.reduce((far, piece) => (distance(piece) > distance(far) ? piece : far));
      this.held = this.held.filter((piece) => piece !== farthest);
    }
  }
}

// Draws a swarm at a step of a piece. `swarm` has the world and the species of the swarm, `counts` the number of robots of each
// species.
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
    // Areas of the cones of sensors that are on, and of sensors that are off.
    lit: new Path2D(),
    dim: new Path2D(),
  };
}

// Adds a robot: its body, filled if a sensor is on, its heading, and the directions of its sensors, up to their range if it is
// limited.
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
  // Cones are drawn under the robots, and all cones as one area, so that robots stay visible where many cones overlap.
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
