// Plays the motion of a swarm without an end, with the controls of a player. A slider, if the player has one, goes back to steps
// that were shown.
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
    // The last step that was shown of the current motion.
    this.farthest = 0;
    this.hasFailed = false;
    // Whether the piece with the current step is requested.
    this.isMissing = false;
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
    if (isNew) {
      this.step = piece.first;
      this.farthest = piece.first;
      this.target = null;
      this.await(false);
    }
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

  advance(passed) {
    // A browser can date the first frame before the click on the button.
    const ms = Math.max(passed, 0);
    const wanted = (ms / 1000) * STEPS_A_SECOND * Number(this.speed.value);
    const left = this.pieces.reach(this.step) - this.step;
    this.step += Math.min(wanted, left * Math.min(ms / LEFT_MS, 1));
    this.tell();
  }

  // Goes one step forward, or one step back.
  once(way = 1) {
    const next = way > 0 ? Math.floor(this.step) + 1 : Math.ceil(this.step) - 1;
    this.seek(Math.min(Math.max(next, 0), this.pieces.reach(this.step)));
  }

  // Goes to a step that was shown, and pauses there.
  seek(step) {
    this.step = step;
    this.pause();
  }

  tell() {
    this.draw();
    this.button.classList.toggle("playing", this.playing);
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    if (!this.piece) return;
    const step = Math.floor(this.step);
    this.farthest = Math.max(this.farthest, step);
    this.output.textContent = `step ${grouped(step)}`;
    if (!this.scrub) return;
    this.scrub.disabled = false;
    this.scrub.max = this.farthest;
    this.scrub.value = step;
    this.scrub.setAttribute("aria-valuetext", `step ${grouped(step)} of ${grouped(this.farthest)}`);
  }

  draw() {
    const piece = this.pieces?.of(this.step);
    // The last picture stays until the piece with the current step has arrived.
    const isMissing = !piece && Boolean(this.pieces?.asked);
    if (isMissing !== this.isMissing) this.await(isMissing);
    this.isMissing = isMissing;
    this.piece = piece ?? this.piece;
    const shown = this.state.shown();
    if (piece && shown.swarm) draw(this.canvas, piece, this.step, shown);
  }

  pace(faster) {
    const place = this.speed.selectedIndex + (faster ? 1 : -1);
    if (place >= 0 && place < this.speed.length) this.speed.selectedIndex = place;
  }
}
