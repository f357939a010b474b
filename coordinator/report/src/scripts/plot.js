// A map of up to a hundred thousand points on a canvas: the points' positions, and the point nearest to a pointer.

// Pixels between the points and the edge of the canvas; a narrow canvas has fewer.
const ROOM = 34;
// Maximum distance in pixels from a pointer to the point that it points at.
const REACH = 16;
// Maximum zoom, relative to the whole map.
const MOST_ZOOM = 200;
// Pixels by which a wheel turns for a zoom by a factor of e.
const WHEEL = 400;
const LINE = 16;
const PAPER = { light: [255, 255, 255], dark: [28, 29, 27] };

class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.count = 0;
    // 1 for each visible point, 0 for each hidden point; null if all points are visible.
    this.visible = null;
    this.whole();
  }

  // Shows the whole map. `whole`, `zoomAt` and `moveBy` take effect at the next layout, because a wheel turns many times per
  // frame.
  whole() {
    this.zoom = 1;
    // The point of the map in the middle of the canvas, as fractions of the whole map's width and height.
    this.middle = [0.5, 0.5];
  }

  // Zooms by the factor `times`; the point of the map at (x, y) on the canvas keeps its place.
  zoomAt(x, y, times) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const zoom = Math.min(Math.max(this.zoom * times, 1), MOST_ZOOM);
    const away = [x / width - 0.5, y / height - 0.5];
    this.middle = this.middle.map((at, axis) => at + away[axis] / this.zoom - away[axis] / zoom);
    this.zoom = zoom;
    this.moveBy(0, 0);
  }

  // Moves the map by `across` and `down` pixels, but not beyond its edges.
  moveBy(across, down) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const way = [across / width, down / height];
    const edge = 0.5 / this.zoom;
    this.middle = this.middle.map((at, axis) => Math.min(Math.max(at - way[axis] / this.zoom, edge), 1 - edge));
  }

  // Whether a point is on the canvas and visible.
  isShown(i) {
    if (this.visible !== null && this.visible[i] === 0) return false;
    return this.isOn(this.across[i], this.down[i]);
  }

  // Whether a place is on the canvas.
  isOn(x, y) {
    return x >= 0 && y >= 0 && x <= this.width && y <= this.height;
  }

  // If a point is not on the canvas, moves the map so that the point is in the middle. Returns whether the map moved.
  reveal(i) {
    const [x, y] = [this.across[i], this.down[i]];
    if (this.isOn(x, y)) return false;
    this.moveBy(this.width / 2 - x, this.height / 2 - y);
    this.layOut();
    return true;
  }

  // Sets the positions of the points: 0 to 65535 along each axis. `spans` has the real length of each axis.
  place(x, y, spans) {
    this.spans = spans;
    this.x = x;
    this.y = y;
    this.count = x.length;
    this.across = new Float32Array(this.count);
    this.down = new Float32Array(this.count);
    this.layOut();
  }

  // Computes the positions of the points on the canvas, for the current size of the canvas.
  layOut() {
    fit(this.canvas);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    [this.width, this.height] = [width, height];
    const scale = equalScale(this.spans, width, height, Math.min(ROOM, width / 14));
    const [left, top] = [width * (0.5 - this.middle[0] * this.zoom), height * (0.5 - this.middle[1] * this.zoom)];
    const across = (x) => left + this.zoom * scale.across(x);
    const down = (y) => top + this.zoom * scale.down(y);
    // Canvas position of a point at (0, 0), and distance from there to a point at (65535, 65535).
    this.corner = [across(0), down(0)];
    this.reach = [across(65535) - this.corner[0], down(65535) - this.corner[1]];
    const { corner, reach } = this;
    for (let i = 0; i < this.count; i++) {
      this.across[i] = corner[0] + reach[0] * (this.x[i] / 65535);
      this.down[i] = corner[1] + reach[1] * (this.y[i] / 65535);
    }
    this.sort();
  }

  // Sorts the points on the canvas into squares, so that a search for the nearest point is quick.
  sort() {
    this.columns = Math.ceil(this.width / REACH) + 1;
    const rows = Math.ceil(this.height / REACH) + 1;
    this.squares = this.columns * rows;
    // Hidden points go into an extra square, the last, which no search visits.
    const square = new Uint32Array(this.count);
    this.begins = new Uint32Array(this.squares + 2);
    for (let i = 0; i < this.count; i++) {
      square[i] = this.isShown(i)
        ? Math.floor(this.down[i] / REACH) * this.columns + Math.floor(this.across[i] / REACH)
        : this.squares;
      this.begins[square[i] + 1]++;
    }
    for (let at = 0; at <= this.squares; at++) this.begins[at + 1] += this.begins[at];
    const next = this.begins.slice();
    this.members = new Uint32Array(this.count);
    for (let i = 0; i < this.count; i++) this.members[next[square[i]]++] = i;
  }

  // The point nearest to a place on the canvas; -1 if no point is within reach.
  nearest(x, y) {
    let best = -1;
    let closest = REACH;
    const [column, row] = [Math.floor(x / REACH), Math.floor(y / REACH)];
    for (let r = Math.max(row - 1, 0); r <= row + 1; r++) {
      for (let c = Math.max(column - 1, 0); c <= Math.min(column + 1, this.columns - 1); c++) {
        const at = r * this.columns + c;
        if (at < 0 || at >= this.squares) continue;
        for (let k = this.begins[at]; k < this.begins[at + 1]; k++) {
          const i = this.members[k];
          const distance = Math.hypot(this.across[i] - x, this.down[i] - y);
          if (distance < closest) [best, closest] = [i, distance];
        }
      }
    }
    return best;
  }

  // The nearest point in a direction, for keys; without a current point, the point nearest to the middle.
  towards(from, dx, dy) {
    if (from < 0) return this.nearestToMiddle();
    let best = from;
    let least = Infinity;
    for (let i = 0; i < this.count; i++) {
      if (this.visible !== null && this.visible[i] === 0) continue;
      const ahead = (this.across[i] - this.across[from]) * dx + (this.down[i] - this.down[from]) * dy;
      const aside = Math.abs((this.across[i] - this.across[from]) * dy) + Math.abs((this.down[i] - this.down[from]) * dx);
      const cost = ahead + 2 * aside;
      if (ahead > 0.5 && aside <= 2 * ahead && cost < least) [best, least] = [i, cost];
    }
    return best;
  }

  // The point nearest to the middle of the canvas; -1 if no point is shown.
  nearestToMiddle() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    let best = -1;
    let closest = Infinity;
    for (let i = 0; i < this.count; i++) {
      if (!this.isShown(i)) continue;
      const distance = Math.hypot(this.across[i] - width / 2, this.down[i] - height / 2);
      if (distance < closest) [best, closest] = [i, distance];
    }
    return best;
  }

  // Paints groups of points, each group over the groups before it. A group has `points`, `colourOf(i)` as a number 0xrrggbb,
  // `strength` from 0 (invisible) to 1 (opaque), and `size`, the radius relative to a usual point.
  paint(isDark, groups) {
    const { canvas } = this;
    fit(canvas);
    const dense = this.density();
    const layer = new ImageData(Math.max(canvas.width, 1), Math.max(canvas.height, 1));
    const [red, green, blue] = isDark ? PAPER.dark : PAPER.light;
    new Uint32Array(layer.data.buffer).fill((255 << 24) | (blue << 16) | (green << 8) | red);
    for (const { points, colourOf, strength, size = 1 } of groups) {
      const dot = dotOf(this.radius() * size);
      for (const i of points) {
        if (!this.isShown(i)) continue;
        stamp(layer, dot, Math.round(this.across[i] * dense), Math.round(this.down[i] * dense), colourOf(i), strength);
      }
    }
    canvas.getContext("2d").putImageData(layer, 0, 0);
  }

  // Canvas pixels per page pixel.
  density() {
    return this.canvas.width / Math.max(this.canvas.clientWidth, 1);
  }

  // The radius of a usual point, in canvas pixels. Points grow with the zoom, but more slowly.
  radius() {
    const radius = this.count > 30000 ? 1.2 : this.count > 3000 ? 2 : 3.2;
    return radius * Math.min(1 + Math.log2(this.zoom) / 4, 2.5) * this.density();
  }
}

// Zooms and moves a map with two fingers, with the wheel if `wheels(event)` is true, and with drags of a pointer if
// `drags(event)` is true. After each change it calls `changed`, which lays the map out.
function steer(area, plot, { wheels, drags, changed }) {
  const held = new Map();
  const onCanvas = (x, y) => {
    const place = area.getBoundingClientRect();
    return [x - place.left, y - place.top];
  };
  const onWheel = (event) => {
    if (!wheels(event)) return;
    event.preventDefault();
    const turned = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE : 1);
    plot.zoomAt(...onCanvas(event.clientX, event.clientY), Math.exp(-turned / WHEEL));
    changed();
  };
  area.addEventListener("wheel", onWheel, { passive: false });
  area.addEventListener("pointerdown", (event) => {
    const moves = drags(event);
    if (!moves && event.pointerType !== "touch") return;
    held.set(event.pointerId, { at: [event.clientX, event.clientY], moves });
    area.setPointerCapture(event.pointerId);
  });
  area.addEventListener("pointermove", (event) => {
    const finger = held.get(event.pointerId);
    if (!finger) return;
    const before = finger.at;
    const now = [event.clientX, event.clientY];
    finger.at = now;
    const other = [...held.values()].find((known) => known !== finger);
    if (other) {
      const apart = ([x, y]) => Math.max(Math.hypot(x - other.at[0], y - other.at[1]), 1);
      plot.moveBy((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
      const middle = onCanvas((now[0] + other.at[0]) / 2, (now[1] + other.at[1]) / 2);
      plot.zoomAt(...middle, apart(now) / apart(before));
    } else if (finger.moves) plot.moveBy(now[0] - before[0], now[1] - before[1]);
    else return;
    changed();
  });
  for (const end of ["pointerup", "pointercancel"]) area.addEventListener(end, ({ pointerId }) => held.delete(pointerId));
}

// Connects the zoom buttons of a map: in, out, and whole map.
function zoomButtons(root, plot, changed) {
  const { canvas } = plot;
  const ways = {
    in: () => plot.zoomAt(canvas.clientWidth / 2, canvas.clientHeight / 2, 1.6),
    out: () => plot.zoomAt(canvas.clientWidth / 2, canvas.clientHeight / 2, 1 / 1.6),
    whole: () => plot.whole(),
  };
  root.addEventListener("click", ({ target }) => {
    const way = ways[target.closest("[data-zoom]")?.dataset.zoom];
    if (!way) return;
    way();
    changed();
  });
}
