// Draws a swarm in motion on a canvas: the poses at any step, the trails and the arena.

function column(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// Adapts a canvas to its size on the page. Returns whether the canvas changed.
function fit(canvas) {
  const dense = Math.min(window.devicePixelRatio || 1, 2);
  const width = Math.round(canvas.clientWidth * dense);
  const height = Math.round(canvas.clientHeight * dense);
  if (canvas.width === width && canvas.height === height) return false;
  canvas.width = width;
  canvas.height = height;
  return true;
}

// Scales points to a canvas: centred, and with the same scale in both directions, so that distances can be compared. The
// coordinates of the points go from 0 to 65535 over `spans`.
function equalScale(spans, width, height, room) {
  const fits = [(width - 2 * room) / spans[0], (height - 2 * room) / spans[1]].filter(Number.isFinite);
  // The scale is 0 if all points are at one place, or if the canvas is hidden.
  const unit = fits.length ? Math.max(Math.min(...fits), 0) : 0;
  return {
    across: (x) => width / 2 + (x / 65535 - 0.5) * spans[0] * unit,
    down: (y) => height / 2 - (y / 65535 - 0.5) * spans[1] * unit,
  };
}

// Half of the world. On a torus, a larger distance between two frames is a jump to the other side.
const JUMP = 32768;

// The motion of a swarm, with the poses of its agents at any step.
class Run {
  constructor({ agents, species, radii, steps, x, y, heading }) {
    this.agents = agents;
    this.species = species ? column(species, Uint8Array) : null;
    this.radii = radii;
    this.steps = steps;
    this.x = column(x, Uint16Array);
    this.y = column(y, Uint16Array);
    this.heading = column(heading, Uint8Array);
    this.last = steps[steps.length - 1];
    this.poses = { x: new Float64Array(agents), y: new Float64Array(agents), heading: new Float64Array(agents) };
  }

  // The index of an agent's colour: the colour of its species if there are several species, or else a colour by number.
  colourOf(agent, colours) {
    return (this.species ? this.species[agent] : agent) % colours.length;
  }

  // The last frame at or before a step.
  frameAt(step) {
    let low = 0;
    let high = this.steps.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.steps[middle] <= step) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // Interpolates the poses between two frames; the heading turns the shorter way.
  posesAt(step, poses) {
    const frame = this.frameAt(step);
    const next = Math.min(frame + 1, this.steps.length - 1);
    const length = this.steps[next] - this.steps[frame];
    const part = length > 0 ? (step - this.steps[frame]) / length : 0;
    const from = frame * this.agents;
    const to = next * this.agents;
    for (let i = 0; i < this.agents; i++) {
      const across = this.x[to + i] - this.x[from + i];
      const down = this.y[to + i] - this.y[from + i];
      // An agent that leaves a torus on one side stays on this side until the frame in which it is on the other side.
      const still = this.wraps && (Math.abs(across) > JUMP || Math.abs(down) > JUMP);
      poses.x[i] = this.x[from + i] + (still ? 0 : part * across);
      poses.y[i] = this.y[from + i] + (still ? 0 : part * down);
      const turn = ((this.heading[to + i] - this.heading[from + i] + 384) % 256) - 128;
      poses.heading[i] = ((this.heading[from + i] + part * turn) * Math.PI) / 128;
    }
    return frame;
  }
}

const TRAIL_STEPS = 60;
const TRAIL_AGES = 5;
const MOST_TRAILS = 400;

// Draws one step of a motion: walls, trails and robots.
function drawSwarm(canvas, run, step, world, colours) {
  fit(canvas);
  const pen = canvas.getContext("2d");
  const scale = canvas.width / world.width;
  run.wraps = world.torus;
  const frame = run.posesAt(step, run.poses);
  const across = canvas.width / 65535;
  const down = canvas.height / 65535;
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.lineCap = "round";
  pen.lineJoin = "round";
  drawArena(pen, world, scale);
  if (run.agents <= MOST_TRAILS) drawTrails(pen, run, step, frame, colours, across, down);
  const radiusOf = (place) => Math.max((run.radii?.[place] ?? world.radius) * scale, 1.2);
  drawBodies(pen, run, colours, radiusOf, across, down);
}

function drawTrails(pen, run, step, frame, colours, across, down) {
  const { poses } = run;
  const first = run.frameAt(Math.max(step - TRAIL_STEPS, 0));
  const frames = frame - first + 1;
  pen.lineWidth = Math.max(pen.canvas.width / 260, 1);
  for (let age = 0; age < TRAIL_AGES; age++) {
    const from = first + Math.floor((age * frames) / TRAIL_AGES);
    const to = first + Math.floor(((age + 1) * frames) / TRAIL_AGES);
    if (from === to) continue;
    pen.globalAlpha = 0.1 + (0.5 * (age + 1)) / TRAIL_AGES;
    for (let agent = 0; agent < run.agents; agent++) {
      pen.strokeStyle = colours[run.colourOf(agent, colours)];
      pen.beginPath();
      for (let at = from; at <= to; at++) {
        const now = at > frame;
        const i = at * run.agents + agent;
        const x = now ? poses.x[agent] : run.x[i];
        const y = now ? poses.y[agent] : run.y[i];
        const before = i - run.agents;
        const jumps =
          run.wraps && at > from && (Math.abs(x - run.x[before]) > JUMP || Math.abs(y - run.y[before]) > JUMP);
        if (jumps) pen.moveTo(x * across, y * down);
        else pen.lineTo(x * across, y * down);
      }
      pen.stroke();
    }
  }
}

// Draws walls and obstacles.
function drawArena(pen, { padding, walls, obstacles }, scale) {
  pen.globalAlpha = 0.55;
  pen.strokeStyle = "#9c9a94";
  pen.fillStyle = "#9c9a94";
  pen.lineWidth = 1;
  const inset = Math.floor(padding * scale) + 0.5;
  if (walls) pen.strokeRect(inset, inset, pen.canvas.width - 2 * inset, pen.canvas.height - 2 * inset);
  for (const { x, y, radius, width, height } of obstacles) {
    pen.beginPath();
    if (radius) pen.arc(x * scale, y * scale, radius * scale, 0, 2 * Math.PI);
    else pen.rect((x - width / 2) * scale, (y - height / 2) * scale, width * scale, height * scale);
    pen.fill();
  }
  pen.globalAlpha = 1;
}

function drawBodies(pen, run, colours, radiusOf, across, down) {
  const { poses } = run;
  pen.globalAlpha = 1;
  const members = colours.map(() => []);
  for (let i = 0; i < run.agents; i++) members[run.colourOf(i, colours)].push(i);
  colours.forEach((colour, place) => {
    const radius = radiusOf(place);
    pen.lineWidth = Math.max(0.4 * radius, 1.2);
    const discs = new Path2D();
    const ticks = new Path2D();
    for (const i of members[place]) {
      const x = poses.x[i] * across;
      const y = poses.y[i] * down;
      discs.moveTo(x + radius, y);
      discs.arc(x, y, radius, 0, 2 * Math.PI);
      ticks.moveTo(x, y);
      ticks.lineTo(x + 2 * radius * Math.cos(poses.heading[i]), y + 2 * radius * Math.sin(poses.heading[i]));
    }
    pen.fillStyle = colour;
    pen.strokeStyle = colour;
    pen.fill(discs);
    if (radius >= 2) pen.stroke(ticks);
  });
}

// The pixels around the centre that a dot of this radius covers, each with its covered part.
function dotOf(radius) {
  const reach = Math.ceil(radius);
  const cover = [];
  for (let y = -reach; y <= reach; y++) {
    for (let x = -reach; x <= reach; x++) {
      const part = Math.min(Math.max(radius + 0.5 - Math.hypot(x, y), 0), 1);
      if (part > 0) cover.push({ x, y, part });
    }
  }
  return cover;
}

// Paints a dot into the pixels of an image. A hundred thousand dots take a few milliseconds; paths would take much longer.
function stamp({ data, width, height }, dot, x, y, colour, strength) {
  for (let i = 0; i < dot.length; i++) {
    const pixel = dot[i];
    const column = x + pixel.x;
    const row = y + pixel.y;
    if (column < 0 || row < 0 || column >= width || row >= height) continue;
    const at = 4 * (row * width + column);
    const part = pixel.part * strength;
    data[at] += part * ((colour >> 16) - data[at]);
    data[at + 1] += part * (((colour >> 8) & 255) - data[at + 1]);
    data[at + 2] += part * ((colour & 255) - data[at + 2]);
  }
}
