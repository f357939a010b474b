// Plays the motion of a behaviour on a canvas.
import { Run, drawSwarm } from "./drawing.js";
import { archived, get, insist } from "./coordinator.js";

const STEPS_A_SECOND = 100;
const HOLD_MS = 900;
const MOST_KEPT = 24;
const SPEED = "murmuration.speed";
const calm = matchMedia("(prefers-reduced-motion: reduce)");

const kept = new Map();

// The motion of an individual, asked for once, whoever wants it; why it is not there yet, and who wants to hear that.
export function motionOf(index) {
  if (!kept.has(index)) {
    const asked = { why: "Simulating…", late: () => {} };
    const failed = ({ message }) => {
      asked.why = `Still waiting: ${message}.`;
      asked.late();
    };
    asked.motion = insist(() => get(archived(`${index}/motion`)), failed).then(({ world, colours, run }) => ({
      world,
      colours,
      run: new Run(run),
    }));
    asked.motion.catch(() => kept.delete(index));
    kept.set(index, asked);
    if (kept.size > MOST_KEPT) kept.delete(kept.keys().next().value);
  }
  return kept.get(index);
}

export class Player {
  constructor(root) {
    this.canvas = root.querySelector("canvas");
    this.waiting = root.querySelector(".waiting");
    this.button = root.querySelector(".toggle");
    this.scrub = root.querySelector(".scrub");
    this.output = root.querySelector("output.step");
    this.speed = root.querySelector(".speed");
    this.motion = null;
    this.step = 0;
    this.held = 0;
    this.playing = false;
    const speed = localStorage.getItem(SPEED);
    if (this.speed && speed) this.speed.value = speed;
    this.speed?.addEventListener("change", () => localStorage.setItem(SPEED, this.speed.value));
    this.button?.addEventListener("click", () => this.toggle());
    this.scrub?.addEventListener("input", () => {
      this.playing = false;
      this.step = Number(this.scrub.value);
      this.tell();
    });
    addEventListener("resize", () => this.draw());
  }

  // Shows an individual's motion, from the start, or, where motion is not wanted, its end.
  async show(index) {
    this.index = index;
    this.motion = null;
    this.playing = false;
    const asked = motionOf(index);
    const tell = () => this.index === index && this.wait(asked.why);
    const late = setTimeout(() => {
      asked.late = tell;
      tell();
    }, 150);
    try {
      const motion = await asked.motion;
      if (this.index !== index) return;
      this.motion = motion;
      this.canvas.parentElement.style.aspectRatio = `${motion.world.width} / ${motion.world.height}`;
      if (this.scrub) this.scrub.max = motion.run.last;
      for (const part of [this.button, this.scrub]) if (part) part.disabled = false;
      this.step = calm.matches ? motion.run.last : 0;
      if (!calm.matches) this.play();
      this.tell();
    } finally {
      clearTimeout(late);
      if (this.index === index) this.wait("");
    }
  }

  wait(why) {
    if (this.waiting) this.waiting.hidden = !why;
    if (this.waiting) this.waiting.textContent = why;
    if (why) this.canvas.getContext("2d").clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  play() {
    if (this.playing) return;
    this.playing = true;
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing || !this.motion) return;
      this.advance(Math.min(now - before, 100));
      before = now;
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  advance(ms) {
    const { last } = this.motion.run;
    if (this.step >= last) {
      this.held += ms;
      if (this.held < HOLD_MS) return;
      this.held = 0;
      this.step = 0;
    } else {
      this.step = Math.min(this.step + (ms / 1000) * STEPS_A_SECOND * Number(this.speed?.value ?? 4), last);
    }
    this.tell();
  }

  toggle() {
    if (!this.motion) return;
    if (this.playing) this.playing = false;
    else this.play();
    this.tell();
  }

  stop() {
    this.playing = false;
    this.index = null;
    this.tell();
  }

  // A part of the run, back or on.
  skip(part) {
    if (!this.motion) return;
    const { last } = this.motion.run;
    this.step = Math.min(Math.max(this.step + part * last, 0), last);
    this.tell();
  }

  restart() {
    this.step = 0;
    this.tell();
  }

  // Twice or half as fast.
  pace(faster) {
    const place = this.speed.selectedIndex + (faster ? 1 : -1);
    if (place < 0 || place >= this.speed.length) return;
    this.speed.selectedIndex = place;
    localStorage.setItem(SPEED, this.speed.value);
  }

  tell() {
    this.draw();
    if (!this.motion || !this.scrub) return;
    const step = Math.round(this.step);
    const { last } = this.motion.run;
    this.scrub.value = step;
    this.scrub.setAttribute("aria-valuetext", `step ${step} of ${last}`);
    this.output.textContent = `${step} / ${last}`;
    this.button.classList.toggle("playing", this.playing);
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  draw() {
    if (!this.motion) return;
    const { run, world, colours } = this.motion;
    drawSwarm(this.canvas, run, this.step, world, colours);
  }
}

// The keys of a page with one player.
export function playerKey(player, { key }) {
  if (key === " ") player.toggle();
  else if (key === "ArrowLeft") player.skip(-0.05);
  else if (key === "ArrowRight") player.skip(0.05);
  else if (key === "+" || key === "=") player.pace(true);
  else if (key === "-") player.pace(false);
  else if (key === "r") player.restart();
  else return false;
  return true;
}
