// Plays the whole run of a behaviour on its card.
//
// A card is "still" (the picture), "preview" (while pointed at or focused), "playing" or "paused" (on demand).
const { world, agentColours, runs, counted, drawSwarm } = window.murmuration;
const STEPS_A_SECOND = 100;
const HOLD_MS = 1200;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const speed = document.getElementById("speed");
const playAll = document.getElementById("play-all");

class Player {
  constructor(card) {
    this.card = card;
    this.number = Number(card.dataset.place) + 1;
    this.run = runs[Number(card.dataset.place)];
    this.canvas = card.querySelector(".stage canvas");
    this.scrub = card.querySelector(".scrub");
    this.scrub.max = this.run.last;
    this.button = card.querySelector(".toggle");
    this.output = card.querySelector(".step");
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
    this.output.textContent = this.mode === "still" ? counted(this.run.last, "step") : `${step} / ${this.run.last}`;
  }

  draw() {
    drawSwarm(this.canvas, this.run, this.step, world, agentColours);
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
