// Requests the motion of a behaviour, and plays it.
import { archived, get, insist } from "./coordinator.js";
import { Run } from "./drawing.js";
import { actionOf } from "./keys.js";
import { Playback } from "./playback.js";

const MOST_KEPT = 24;
const SPEED = "murmuration.speed";
const calm = matchMedia("(prefers-reduced-motion: reduce)");

const kept = new Map();

// The motion of an individual, which is requested once for all callers, with retries for as long as any caller wants it. The
// result also has the reason of a delay, and a callback for the delay.
export function motionOf(index, isWanted = () => true) {
  if (!kept.has(index)) {
    const asked = { why: "Simulating…", late: () => {}, wanted: [] };
    const failed = (error) => {
      if (!asked.wanted.some((is) => is())) throw error;
      asked.why = `Still waiting: ${error.message}.`;
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
  const asked = kept.get(index);
  asked.wanted.push(isWanted);
  return asked;
}

export class Player extends Playback {
  constructor(root) {
    super(root, { speed: root.querySelector(".speed") });
    this.waiting = root.querySelector(".waiting");
    const speed = localStorage.getItem(SPEED);
    if (this.speed && speed) this.speed.value = speed;
    this.speed?.addEventListener("change", () => localStorage.setItem(SPEED, this.speed.value));
  }

  // Shows an individual's motion from the start, or only its end if the visitor prefers no motion.
  async show(index) {
    this.index = index;
    this.motion = null;
    this.playing = false;
    const asked = motionOf(index, () => this.index === index);
    const tell = () => this.index === index && this.wait(asked.why);
    const late = setTimeout(() => {
      asked.late = tell;
      tell();
    }, 150);
    try {
      const motion = await asked.motion;
      if (this.index !== index) return;
      this.load(motion);
      for (const part of [this.button, this.scrub]) if (part) part.disabled = false;
      this.step = calm.matches ? motion.run.last : 0;
      if (calm.matches) this.pause();
      else this.play();
    } catch (error) {
      if (this.index === index) throw error;
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

  stop() {
    this.index = null;
    this.pause();
  }

  // Skips a part of the motion, forwards or backwards.
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

  // Doubles or halves the speed.
  pace(faster) {
    const place = this.speed.selectedIndex + (faster ? 1 : -1);
    if (place < 0 || place >= this.speed.length) return;
    this.speed.selectedIndex = place;
    localStorage.setItem(SPEED, this.speed.value);
  }
}

// Performs the action of a key on a page with one player. Returns whether the key had an action.
export function playerKey(player, { key }) {
  const name = actionOf(key);
  if (name === "play") player.toggle();
  else if (name === "back") player.skip(-0.05);
  else if (name === "forward") player.skip(0.05);
  else if (name === "faster") player.pace(true);
  else if (name === "slower") player.pace(false);
  else if (name === "restart") player.restart();
  else return false;
  return true;
}
