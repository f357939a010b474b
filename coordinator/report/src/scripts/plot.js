// A hundred thousand points on a canvas: where they are, and which one is nearest to a pointer.

// Pixels between the points and the edge, less where the canvas is narrow.
const ROOM = 34;
// Pixels within which a pointer reaches a point.
const REACH = 16;
const PAPER = { light: [255, 255, 255], dark: [28, 29, 27] };

class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.count = 0;
  }

  // Takes the places of the points, 0 to 65535 each way over spans that need not be equal.
  place(x, y, spans) {
    this.spans = spans;
    this.x = x;
    this.y = y;
    this.count = x.length;
    this.across = new Float32Array(this.count);
    this.down = new Float32Array(this.count);
    this.layOut();
  }

  // Computes where the points lie on the canvas, for its present size.
  layOut() {
    fit(this.canvas);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = equalScale(this.spans, width, height, Math.min(ROOM, width / 14));
    for (let i = 0; i < this.count; i++) {
      this.across[i] = scale.across(this.x[i]);
      this.down[i] = scale.down(this.y[i]);
    }
    this.sort();
  }

  // Sorts the points into squares, so that the nearest one is found among a few.
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

  // The point nearest to a place on the canvas; -1 if none is within reach.
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

  // Paints groups of points, one over the other: `points`, `colourOf(i)` as a number 0xrrggbb, and `strength`, which is 0
  // for a point that cannot be seen and 1 for one that covers what is under it.
  paint(isDark, groups) {
    const { canvas, pen } = this;
    fit(canvas);
    const dense = canvas.width / Math.max(canvas.clientWidth, 1);
    const layer = new ImageData(Math.max(canvas.width, 1), Math.max(canvas.height, 1));
    const [red, green, blue] = isDark ? PAPER.dark : PAPER.light;
    new Uint32Array(layer.data.buffer).fill((255 << 24) | (blue << 16) | (green << 8) | red);
    const radius = this.count > 30000 ? 1.2 : this.count > 3000 ? 2 : 3.2;
    const dot = dotOf(radius * dense);
    for (const { points, colourOf, strength } of groups) {
      for (const i of points) {
        stamp(layer, dot, Math.round(this.across[i] * dense), Math.round(this.down[i] * dense), colourOf(i), strength);
      }
    }
    pen.putImageData(layer, 0, 0);
  }
}
