// Plays a motion on a canvas, with a button, a slider, and a line with the current step.

const STEPS_A_SECOND = 100;
// Speed factor if the page has no menu of speeds.
const USUAL_SPEED = 4;
// Milliseconds for which the last step stays before the motion starts again.
const HOLD_MS = 1000;

class Playback {
  // `root` contains the canvas and the controls; `speed` is the menu of speeds, and `name` names the motion in the label of the
  // button.
  constructor(root, { speed = null, name = "" } = {}) {
    this.canvas = root.querySelector("canvas");
    this.button = root.querySelector(".toggle");
    this.scrub = root.querySelector(".scrub");
    this.output = root.querySelector("output.step");
    this.speed = speed;
    this.name = name;
    this.motion = null;
    this.step = 0;
    this.held = 0;
    this.playing = false;
    this.frame = 0;
    this.button?.addEventListener("click", () => this.toggle());
    this.scrub?.addEventListener("input", () => {
      this.step = Number(this.scrub.value);
      this.pause();
    });
    addEventListener("resize", () => this.draw());
  }

  // Sets the motion: its run, its world, and the colours of its robots.
  load(motion) {
    this.motion = motion;
    if (this.scrub) this.scrub.max = motion.run.last;
  }

  play() {
    if (this.playing) return;
    this.playing = true;
    // A frame of the previous motion can still be scheduled.
    cancelAnimationFrame(this.frame);
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing || !this.motion) return;
      this.advance(Math.min(now - before, 100));
      before = now;
      this.frame = requestAnimationFrame(tick);
    };
    this.frame = requestAnimationFrame(tick);
    this.tell();
  }

  pause() {
    this.playing = false;
    this.tell();
  }

  toggle() {
    if (!this.motion) return;
    if (this.playing) this.pause();
    else this.play();
  }

  advance(ms) {
    const { last } = this.motion.run;
    if (this.step >= last) {
      this.held += ms;
      if (this.held < HOLD_MS) return;
      this.held = 0;
      this.step = 0;
    } else {
      this.step = Math.min(this.step + (ms / 1000) * STEPS_A_SECOND * Number(this.speed?.value ?? USUAL_SPEED), last);
    }
    this.tell();
  }

  // Shows the current step in the picture and on the controls.
  tell() {
    this.draw();
    if (!this.motion || !this.scrub) return;
    const step = Math.round(this.step);
    const { last } = this.motion.run;
    this.scrub.value = step;
    this.scrub.setAttribute("aria-valuetext", `step ${grouped(step)} of ${grouped(last)}`);
    this.output.textContent = this.place(step, last);
    this.button.classList.toggle("playing", this.playing);
    this.button.setAttribute("aria-label", `${this.playing ? "Pause" : "Play"}${this.name && ` ${this.name}`}`);
  }

  place(step, last) {
    return `${grouped(step)} / ${grouped(last)}`;
  }

  draw() {
    if (!this.motion) return;
    const { run, world, colours } = this.motion;
    drawSwarm(this.canvas, run, this.step, world, colours);
  }
}
