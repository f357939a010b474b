// The page Play: a person sets a controller, and the swarm that it controls moves.
import { Comparison } from "./compare.js";
import { Unavailable } from "./coordinator.js";
import { isForPage } from "./keys.js";
import { Pieces, draw } from "./pieces.js";
import { Playback, STEPS_A_SECOND } from "./playback.js";
import { grouped, sentence } from "./words.js";

// Where a motion is shown from when its controller is changed: at the latest here, as far as the paper looks at it; and before
// this many steps of one robot, which are simulated at once.
const LOOKED_AT = 1200;
const AT_ONCE = 120_000;
// In how much time what is left of a motion would be shown at most: where the coordinator simulates more slowly than it is
// shown, the motion slows down instead of halting.
const LEFT_MS = 400;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const at = (id) => document.getElementById(id);
const root = at("play");

// A swarm without an end on a canvas.
class Endless extends Playback {
  constructor(player, state) {
    super(player, { speed: player.querySelector(".speed") });
    this.state = state;
    this.motion = state;
    this.piece = null;
    this.target = null;
    this.waiting = player.querySelector(".waiting");
    this.pieces = new Pieces({ came: (...came) => this.came(...came), failed: (error) => this.failed(error) });
  }

  // Shows the present state's motion from a step on.
  begin(step) {
    this.target = step;
    this.await(true);
    this.pieces.begin(this.state.query(), step);
  }

  came(piece, isNew) {
    this.waiting.hidden = true;
    at("status").textContent = "";
    at("status").classList.remove("wrong");
    if (!isNew) return;
    this.step = piece.first;
    this.target = null;
    this.await(false);
    this.tell();
  }

  // Whether what is shown is not yet what the controls say.
  await(is) {
    this.canvas.parentElement.setAttribute("aria-busy", is);
  }

  failed(error) {
    const text = sentence(error.message);
    if (!(error instanceof Unavailable)) this.await(false);
    if (this.piece) at("status").textContent = text;
    else this.waiting.textContent = text;
    this.waiting.hidden = Boolean(this.piece);
    at("status").classList.toggle("wrong", !(error instanceof Unavailable));
  }

  advance(ms) {
    const wanted = (ms / 1000) * STEPS_A_SECOND * Number(this.speed.value);
    const left = Math.max(this.pieces.last - this.step, 0);
    this.step += Math.min(wanted, left * Math.min(ms / LEFT_MS, 1));
    this.tell();
  }

  once() {
    this.step = Math.min(Math.floor(this.step) + 1, this.pieces.last);
    this.pause();
  }

  tell() {
    this.draw();
    this.button.classList.toggle("playing", this.playing);
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    if (this.piece) this.output.textContent = `step ${grouped(Math.floor(this.step))}`;
  }

  draw() {
    this.piece = this.pieces?.of(this.step) ?? null;
    if (this.piece) draw(this.canvas, this.piece, this.step, this.state.shown());
  }

  pace(faster) {
    const place = this.speed.selectedIndex + (faster ? 1 : -1);
    if (place >= 0 && place < this.speed.length) this.speed.selectedIndex = place;
  }
}

// What the controls say: what an address holds.
class State {
  constructor() {
    this.swarm = JSON.parse(root.dataset.swarm);
    this.genes = [...root.querySelectorAll("[data-gene]")];
  }

  numbers() {
    return this.genes.map((gene) => Number(gene.value));
  }

  query() {
    const given = new URLSearchParams(location.search);
    const query = new URLSearchParams();
    if (root.dataset.model) query.set("model", root.dataset.model);
    else query.set("robot", given.get("robot"));
    query.set("genes", this.genes.map((gene) => gene.value).join(","));
    query.set("seed", at("seed").value);
    if (at("robots")) query.set("robots", at("robots").value);
    return query.toString();
  }

  // What is needed to draw the robots.
  shown() {
    const { swarm } = this;
    const genes = this.numbers();
    const ratio = swarm.ratios.length > 1 ? genes.at(-1) : 0;
    const counts = swarm.ratios[ratio] ?? [Infinity];
    return { swarm, counts, genes };
  }
}

function playground() {
  const state = new State();
  const player = root.querySelector(".player");
  player.querySelector(".stage").style.aspectRatio = `${state.swarm.world.width} / ${state.swarm.world.height}`;
  const endless = new Endless(player, state);
  const isValid = () => [...root.querySelectorAll(".number")].every((control) => control.value && control.checkValidity());

  const comparison = new Comparison(() => state.query());
  // What changes at once is the motion; the address follows when it has been changed.
  const changed = (step) => {
    complain();
    comparison.forget();
    if (isValid()) endless.begin(step);
  };
  let told = `?${state.query()}`;
  const settled = () => {
    if (!isValid() || `?${state.query()}` === told) return;
    told = `?${state.query()}`;
    history.pushState(null, "", told);
  };
  const seen = () => {
    const robots = endless.piece?.robots ?? 1;
    return Math.floor(Math.min(endless.target ?? endless.step, LOOKED_AT, AT_ONCE / robots));
  };

  for (const slider of root.querySelectorAll("[type=range]")) {
    const number = slider.dataset.slides ? at(slider.dataset.slides) : at("robots");
    const isRobots = number.id === "robots";
    slider.addEventListener("input", () => {
      const rounded = Number(Number(slider.value).toFixed(4));
      number.value = Math.min(Math.max(rounded, Number(number.min)), Number(number.max));
      changed(isRobots ? 0 : seen());
    });
    number.addEventListener("input", () => {
      slider.value = number.value;
      changed(isRobots ? 0 : seen());
    });
  }
  for (const choice of root.querySelectorAll("select[data-gene]")) choice.addEventListener("change", () => changed(seen()));
  at("search").addEventListener("submit", (event) => {
    at("search").action = `/play/search?${state.query()}`;
    if (!isValid()) event.preventDefault();
  });
  at("seed").addEventListener("input", () => changed(0));
  at("controller").addEventListener("change", settled);
  at("controller").addEventListener("submit", (event) => event.preventDefault());

  const acts = {
    anew() {
      const seed = at("seed").validity.valid ? BigInt(at("seed").value || 0) : 0n;
      at("seed").value = String(seed + 1n);
      changed(0);
      settled();
    },
    restart: () => isValid() && endless.begin(0),
    once: () => endless.once(),
  };
  at("anew").addEventListener("click", acts.anew);
  at("restart").addEventListener("click", acts.restart);
  at("one-step").addEventListener("click", acts.once);
  document.addEventListener("keydown", (event) => {
    if (!isForPage(event)) return;
    const { key } = event;
    if (key === " ") endless.toggle();
    else if (key === "ArrowRight") acts.once();
    else if (key === "r") acts.restart();
    else if (key === "n") acts.anew();
    else if (key === "l") comparison.ask();
    else if (key === "+" || key === "=") endless.pace(true);
    else if (key === "-") endless.pace(false);
    else return;
    event.preventDefault();
  });
  // A link within the page changes the address too.
  addEventListener("popstate", () => new URL(location).search !== new URL(told, location).search && location.reload());

  history.replaceState(null, "", `${told}${location.hash}`);
  endless.begin(0);
  if (calm.matches) endless.pause();
  else endless.play();
}

// Numbers that are not allowed are marked by the browser; what they may be is said here.
function complain() {
  const wrong = [...root.querySelectorAll(".number")].find((control) => !control.value || !control.checkValidity());
  const status = at("status");
  const name = wrong?.ariaLabel || wrong?.labels[0].textContent;
  const allowed = wrong?.max ? `a number from ${wrong.min} to ${wrong.max}` : "a whole number";
  status.textContent = wrong ? `${name} must be ${allowed}.` : "";
  status.classList.toggle("wrong", Boolean(wrong));
}

if (root) playground();
