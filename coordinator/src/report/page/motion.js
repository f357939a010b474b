// Plays the whole run of a behaviour on its card.
//
// A card is "still" (the picture), "preview" (while pointed at or focused), "playing" or "paused" (on demand).
const { world, agentColours, runs, fit } = window.murmuration;
const STEPS_A_SECOND = 100;
const HOLD_MS = 1200;
const TRAIL_STEPS = 60;
const TRAIL_AGES = 5;
const MOST_TRAILS = 400;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const speed = document.getElementById("speed");
const playAll = document.getElementById("play-all");

class Player {
  constructor(card) {
    this.card = card;
    this.number = Number(card.dataset.place) + 1;
    this.run = runs[Number(card.dataset.place)];
    this.canvas = card.querySelector(".stage canvas");
    this.pen = this.canvas.getContext("2d");
    this.scrub = card.querySelector(".scrub");
    this.scrub.max = this.run.last;
    this.button = card.querySelector(".toggle");
    this.output = card.querySelector(".step");
    const { agents } = this.run;
    this.poses = { x: new Float64Array(agents), y: new Float64Array(agents), heading: new Float64Array(agents) };
    this.step = 0;
    this.held = 0;
    this.visible = false;
    this.show("still");
  }

  get mode() {
    return this.card.dataset.mode;
  }

  get moving() {
    return this.mode === "preview" || this.mode === "playing";
  }

  show(mode) {
    this.card.dataset.mode = mode;
    if (mode === "still") this.step = 0;
    this.button.setAttribute("aria-label", `${this.moving ? "Pause" : "Play"} behaviour ${this.number}`);
    this.tell();
    if (mode !== "still") this.draw();
    wake();
  }

  toggle() {
    this.show(this.moving ? "paused" : "playing");
  }

  advance(ms) {
    if (this.step >= this.run.last) {
      this.held += ms;
      if (this.held < HOLD_MS) return;
      this.held = 0;
      this.step = 0;
    } else {
      this.step = Math.min(this.step + (ms / 1000) * STEPS_A_SECOND * Number(speed.value), this.run.last);
    }
    if (this.visible) {
      this.draw();
      this.tell();
    }
  }

  tell() {
    const step = Math.round(this.step);
    this.scrub.value = step;
    this.scrub.setAttribute("aria-valuetext", `step ${step} of ${this.run.last}`);
    this.scrub.style.setProperty("--done", `${(100 * step) / Math.max(this.run.last, 1)}%`);
    this.output.textContent = this.mode === "still" ? `${this.run.last} steps` : `${step} / ${this.run.last}`;
  }

  draw() {
    fit(this.canvas);
    const { pen, canvas, run, poses } = this;
    const scale = canvas.width / world.width;
    const frame = run.posesAt(this.step, poses);
    const across = canvas.width / 65535;
    const down = canvas.height / 65535;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.lineCap = "round";
    pen.lineJoin = "round";
    pen.globalAlpha = 0.55;
    pen.strokeStyle = "#9c9a94";
    pen.lineWidth = 1;
    const inset = Math.floor(world.padding * scale) + 0.5;
    pen.strokeRect(inset, inset, canvas.width - 2 * inset, canvas.height - 2 * inset);
    if (run.agents <= MOST_TRAILS) this.drawTrails(frame, across, down);
    this.drawBodies(Math.max(world.radius * scale, 1.2), across, down);
  }

  drawTrails(frame, across, down) {
    const { pen, run, poses } = this;
    const begin = Math.max(this.step - TRAIL_STEPS, 0);
    const first = run.frameAt(begin);
    const frames = frame - first + 1;
    pen.lineWidth = Math.max(this.canvas.width / 260, 1);
    for (let age = 0; age < TRAIL_AGES; age++) {
      const from = first + Math.floor((age * frames) / TRAIL_AGES);
      const to = first + Math.floor(((age + 1) * frames) / TRAIL_AGES);
      if (from === to) continue;
      pen.globalAlpha = 0.1 + (0.5 * (age + 1)) / TRAIL_AGES;
      for (let agent = 0; agent < run.agents; agent++) {
        pen.strokeStyle = agentColours[agent % agentColours.length];
        pen.beginPath();
        for (let at = from; at <= to; at++) {
          const now = at > frame;
          const i = at * run.agents + agent;
          pen.lineTo((now ? poses.x[agent] : run.x[i]) * across, (now ? poses.y[agent] : run.y[i]) * down);
        }
        pen.stroke();
      }
    }
  }

  drawBodies(radius, across, down) {
    const { pen, run, poses } = this;
    pen.globalAlpha = 1;
    pen.lineWidth = Math.max(0.4 * radius, 1.2);
    agentColours.slice(0, run.agents).forEach((colour, place) => {
      const discs = new Path2D();
      const ticks = new Path2D();
      for (let i = place; i < run.agents; i += agentColours.length) {
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
}

let awake = false;
let before = 0;
function wake() {
  if (awake) return;
  awake = true;
  before = performance.now();
  requestAnimationFrame(tick);
}
function tick(now) {
  const moving = players.filter((player) => player.moving);
  const ms = Math.min(now - before, 100);
  before = now;
  for (const player of moving) player.advance(ms);
  awake = moving.length > 0;
  if (awake) requestAnimationFrame(tick);
}

const players = [];
for (const card of document.querySelectorAll(".card")) players.push(new Player(card));
const playerOf = new Map(players.map((player) => [player.card, player]));

const seen = new IntersectionObserver((entries) => {
  for (const entry of entries) playerOf.get(entry.target).visible = entry.isIntersecting;
});

for (const player of players) {
  const { card } = player;
  const preview = () => {
    if (player.mode === "still" && !calm.matches) player.show("preview");
  };
  const rest = () => {
    if (player.mode === "preview") player.show("still");
  };
  seen.observe(card);
  card.addEventListener("pointerenter", (event) => {
    if (event.pointerType === "mouse") preview();
  });
  card.addEventListener("pointerleave", rest);
  card.addEventListener("focusin", (event) => {
    if (event.target === card && card.matches(":focus-visible")) preview();
  });
  card.addEventListener("focusout", (event) => {
    if (!card.contains(event.relatedTarget)) rest();
  });
  card.addEventListener("keydown", (event) => {
    if (event.key === "Escape") player.show("still");
    if (event.key === " " && event.target === card) {
      event.preventDefault();
      player.toggle();
    }
  });
  card.querySelector(".stage").addEventListener("click", () => player.toggle());
  player.button.addEventListener("click", () => player.toggle());
  player.scrub.addEventListener("input", () => {
    player.step = Number(player.scrub.value);
    player.show("paused");
  });
}

playAll.addEventListener("click", () => {
  const start = playAll.getAttribute("aria-pressed") === "false";
  playAll.setAttribute("aria-pressed", String(start));
  playAll.textContent = start ? "Stop all" : "Play all";
  for (const player of players) player.show(start ? "playing" : "still");
});

addEventListener("resize", () => {
  for (const player of players) if (player.mode === "paused") player.draw();
});
