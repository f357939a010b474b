// The points of the Map page, which people select with keys and drawn lines.
import { fit } from "./drawing.js";
import { GlPoints } from "./glpoints.js";
import { encloses } from "./lasso.js";
import { PAPER, Plot } from "./plot.js";

// Without a graphics card: maximum painting time per frame while the map moves, and time without movement after which the map
// rests, in milliseconds.
const BUDGET_MS = 8;
const REST_MS = 150;
// If the map has at most this number of points, all points are always painted.
const FEW = 10_000;

export class Points extends Plot {
  constructor(canvas) {
    super(canvas);
    this.groups = [];
    this.isDark = false;
    // Milliseconds in which this script painted all points last, and the timer that paints all points once the map rests.
    this.cost = 0;
    this.rest = 0;
    // The groups thinned out to one point in `every`, for a moving map.
    this.thinned = { every: 1, groups: this.groups };
    // The renderer on the graphics card; null if this script paints the points.
    this.card = GlPoints.of(canvas, () => {
      this.card.place(this.x, this.y);
      this.look();
      this.repaint();
    });
    canvas.dataset.drawn = this.card ? "webgl" : "canvas";
  }

  place(x, y, spans) {
    this.card?.place(x, y);
    super.place(x, y, spans);
  }

  // Points are sorted into squares only when a pointer needs the squares, because a moving map changes the squares sixty times a
  // second.
  sort() {
    this.isSorted = false;
  }

  nearest(x, y) {
    if (!this.isSorted) super.sort();
    this.isSorted = true;
    return super.nearest(x, y);
  }

  within(line) {
    const found = [];
    for (let i = 0; i < this.count; i++) {
      if (this.isShown(i) && encloses(line, this.across[i], this.down[i])) found.push(i);
    }
    return found;
  }

  // Paints every shown point. Points for which `standsOut(i)` is true are over the other points. If points are selected, the
  // other points are faded.
  show(colourOf, { selected, standsOut }, isDark) {
    const groups = [[], [], []];
    for (let i = 0; i < this.count; i++) groups[selected.has(i) ? 2 : standsOut(i) ? 1 : 0].push(i);
    const faded = selected.size > 0;
    this.isDark = isDark;
    this.groups = [
      { points: groups[0], colourOf, strength: faded ? 0.18 : 0.7 },
      { points: groups[1], colourOf, strength: faded ? 0.25 : 1, size: 1.4 },
      { points: groups[2], colourOf, strength: 0.95, size: 1.2 },
    ];
    this.thinned = { every: 1, groups: this.groups };
    this.look();
    this.repaint();
  }

  // Sends the colours and sizes of the points to the graphics card.
  look() {
    if (!this.card) return;
    const [looks, sizes] = [new Uint8Array(4 * this.count), new Uint8Array(this.count)];
    const order = [];
    for (const { points, colourOf, strength, size = 1 } of this.groups) {
      for (const i of points) {
        if (this.visible !== null && this.visible[i] === 0) continue;
        order.push(i);
        const colour = colourOf(i);
        looks[4 * i] = colour >> 16;
        looks[4 * i + 1] = (colour >> 8) & 255;
        looks[4 * i + 2] = colour & 255;
        looks[4 * i + 3] = 255 * strength;
        sizes[i] = 127.5 * size;
      }
    }
    this.card.look(Uint32Array.from(order), looks, sizes);
  }

  // Paints the points at their current places, with their last colours and sizes. If this script paints the points and all points
  // take too long for a moving map, it paints an even sample until the map rests.
  repaint(moves = false) {
    if (!this.card) return this.paintSome(moves && this.count > FEW ? 2 ** Math.max(Math.ceil(Math.log2(this.cost / BUDGET_MS)), 0) : 1);
    fit(this.canvas);
    const dense = this.density();
    this.card.paint({
      scale: this.reach.map((pixels) => pixels * dense),
      shift: this.corner.map((pixels) => pixels * dense),
      radius: this.radius(),
      paper: this.isDark ? PAPER.dark : PAPER.light,
    });
  }

  // Paints one point in `every`.
  paintSome(every) {
    clearTimeout(this.rest);
    if (this.thinned.every !== every) {
      const groups = this.groups.map((group) => ({ ...group, points: group.points.filter((_, k) => k % every === 0) }));
      this.thinned = { every, groups };
    }
    const begun = performance.now();
    this.paint(this.isDark, this.thinned.groups);
    if (every === 1) this.cost = performance.now() - begun;
    else this.rest = setTimeout(() => this.repaint(), REST_MS);
  }
}
