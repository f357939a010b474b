// Plays the motion of a swarm without an end, with the controls of a player.
import { base } from "./base.js";
import { Unavailable } from "./coordinator.js";
import { Pieces, draw } from "./pieces.js";
import { Playback, STEPS_A_SECOND } from "./playback.js";
import { grouped, sentence } from "./words.js";

// Minimum time in which the loaded rest of a motion is shown. If the coordinator simulates more slowly than the motion plays, the
// motion slows down instead of stopping.
const LEFT_MS = 400;

// The player of a motion without an end. `state.query()` selects the swarm, and `state.shown()` returns what drawing its robots
// needs. `status` is the line for errors, and `url` is the address of the pieces of the motion.
export class Endless extends Playback {
  constructor(player, state, status, url = `${base}/play/motion`) {
    super(player, { speed: player.querySelector(".speed") });
    this.state = state;
    this.status = status;
    this.motion = state;
    this.piece = null;
    this.target = null;
    this.hasFailed = false;
    this.waiting = player.querySelector(".waiting");
    this.pieces = new Pieces({ came: (...came) => this.came(...came), failed: (error) => this.failed(error), url });
  }

  // Shows the motion of the swarm that `state` selects now, from a step on.
  begin(step) {
    this.target = step;
    this.await(true);
    this.pieces.begin(this.state.query(), step);
  }

  came(piece, isNew) {
    this.waiting.hidden = true;
    // Only an error of the requests is cleared here; a message about wrong controls stays.
    if (this.hasFailed) {
      this.status.textContent = "";
      this.status.classList.remove("wrong");
    }
    this.hasFailed = false;
    if (!isNew) return;
    this.step = piece.first;
    this.target = null;
    this.await(false);
    this.tell();
  }

  // Marks the stage as busy for as long as it does not show the swarm that the controls select.
  await(is) {
    this.canvas.parentElement.setAttribute("aria-busy", is);
  }

  failed(error) {
    const text = sentence(error.message);
    this.hasFailed = true;
    if (!(error instanceof Unavailable)) this.await(false);
    if (this.piece) this.status.textContent = text;
    else this.waiting.textContent = text;
    this.waiting.hidden = Boolean(this.piece);
    this.status.classList.toggle("wrong", !(error instanceof Unavailable));
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
    const shown = this.state.shown();
    if (this.piece && shown.swarm) draw(this.canvas, this.piece, this.step, shown);
  }

  pace(faster) {
    const place = this.speed.selectedIndex + (faster ? 1 : -1);
    if (place >= 0 && place < this.speed.length) this.speed.selectedIndex = place;
  }
}
