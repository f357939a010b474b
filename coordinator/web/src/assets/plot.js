// Ten thousand points and more on a canvas: where they are, which one is near, which are within a line.
import { dotOf, equalScale, fit, stamp } from "./drawing.js";
import { encloses } from "./lasso.js";

const ROOM = 26;
const REACH = 16;

export class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.count = 0;
  }

  // Places, 0 to 65535 each way over spans that need not be equal.
  place(x, y, spans) {
    this.spans = spans;
    this.x = x;
    this.y = y;
    this.count = x.length;
    this.across = new Float32Array(this.count);
    this.down = new Float32Array(this.count);
    this.layOut();
  }

  layOut() {
    fit(this.canvas);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = equalScale(this.spans, width, height, ROOM);
    for (let i = 0; i < this.count; i++) {
      this.across[i] = scale.across(this.x[i]);
      this.down[i] = scale.down(this.y[i]);
    }
    this.sort();
  }

  // Into squares, so that who is near is found among a few.
  sort() {
    this.columns = Math.ceil(this.canvas.clientWidth / REACH) + 1;
    const rows = Math.ceil(this.canvas.clientHeight / REACH) + 1;
    this.begins = new Uint32Array(this.columns * rows + 1);
    const square = Uint32Array.from(
      this.across,
      (x, i) => Math.floor(this.down[i] / REACH) * this.columns + Math.floor(x / REACH),
    );
    for (const at of square) this.begins[at + 1]++;
    for (let at = 0; at < this.columns * rows; at++) this.begins[at + 1] += this.begins[at];
    const next = this.begins.slice();
    this.members = new Uint32Array(this.count);
    square.forEach((at, i) => (this.members[next[at]++] = i));
  }

  nearest(x, y) {
    let best = -1;
    let closest = REACH;
    const [column, row] = [Math.floor(x / REACH), Math.floor(y / REACH)];
    for (let r = Math.max(row - 1, 0); r <= row + 1; r++) {
      for (let c = Math.max(column - 1, 0); c <= Math.min(column + 1, this.columns - 1); c++) {
        const at = r * this.columns + c;
        if (at < 0 || at + 1 >= this.begins.length) continue;
        for (let k = this.begins[at]; k < this.begins[at + 1]; k++) {
          const i = this.members[k];
          const distance = Math.hypot(this.across[i] - x, this.down[i] - y);
          if (distance < closest) [best, closest] = [i, distance];
        }
      }
    }
    return best;
  }

  // The nearest point that lies in a direction, for keys; the one in the middle where there was none before.
  towards(from, dx, dy) {
    if (from < 0) return this.middle();
    let best = from;
    let least = Infinity;
    for (let i = 0; i < this.count; i++) {
      const ahead = (this.across[i] - this.across[from]) * dx + (this.down[i] - this.down[from]) * dy;
      const aside = Math.abs((this.across[i] - this.across[from]) * dy) + Math.abs((this.down[i] - this.down[from]) * dx);
      const cost = ahead + 2 * aside;
      if (ahead > 0.5 && aside <= 2 * ahead && cost < least) [best, least] = [i, cost];
    }
    return best;
  }

  middle() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    let best = -1;
    let closest = Infinity;
    for (let i = 0; i < this.count; i++) {
      const distance = Math.hypot(this.across[i] - width / 2, this.down[i] - height / 2);
      if (distance < closest) [best, closest] = [i, distance];
    }
    return best;
  }

  within(line) {
    const found = [];
    for (let i = 0; i < this.count; i++) if (encloses(line, this.across[i], this.down[i])) found.push(i);
    return found;
  }

  // `colourOf(i)` as a number 0xrrggbb; with a selection the rest is drawn first, and faded.
  paint(colourOf, selected, [red, green, blue]) {
    const { canvas, pen } = this;
    fit(canvas);
    const dense = canvas.width / Math.max(canvas.clientWidth, 1);
    const layer = new ImageData(Math.max(canvas.width, 1), Math.max(canvas.height, 1));
    new Uint32Array(layer.data.buffer).fill((255 << 24) | (blue << 16) | (green << 8) | red);
    const radius = this.count > 30000 ? 1.3 : this.count > 3000 ? 2.2 : 3.6;
    const dot = dotOf(radius * dense);
    for (const chosen of [false, true]) {
      for (let i = 0; i < this.count; i++) {
        if (selected.has(i) !== chosen) continue;
        const strength = chosen || selected.size === 0 ? 0.85 : 0.18;
        stamp(layer, dot, Math.round(this.across[i] * dense), Math.round(this.down[i] * dense), colourOf(i), strength);
      }
    }
    pen.putImageData(layer, 0, 0);
  }
}
