// The layer over the map's points that changes with the pointer: the drawn line, the point under the pointer, and medoids.
import { fit } from "./drawing.js";
import { trace } from "./lasso.js";

export class Sketch {
  // `medoids()` returns the points that get a ring.
  // `under(pen)` draws what lies under the rings.
  constructor(canvas, plot, medoids, under) {
    this.under = under;
    this.canvas = canvas;
    this.plot = plot;
    this.medoids = medoids;
    // The point that gets a cross; null if there is none.
    this.centre = null;
    this.hovered = -1;
    this.line = null;
  }

  draw() {
    const { canvas, plot } = this;
    fit(canvas);
    const pen = canvas.getContext("2d");
    const dense = canvas.width / Math.max(canvas.clientWidth, 1);
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    this.under(pen);
    const ink = getComputedStyle(canvas).color;
    pen.strokeStyle = ink;
    for (const i of this.medoids()) if (i < plot.count && plot.isShown(i)) this.ring(pen, i, 5, 1.5);
    if (this.centre !== null && this.centre < plot.count && plot.isShown(this.centre)) this.cross(pen, this.centre);
    if (this.line) trace(pen, this.line, ink);
    if (this.hovered >= 0) this.ring(pen, this.hovered, 7, 2);
  }

  cross(pen, i) {
    const [x, y] = [this.plot.across[i], this.plot.down[i]];
    const arm = 10;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x - arm, y);
    pen.lineTo(x + arm, y);
    pen.moveTo(x, y - arm);
    pen.lineTo(x, y + arm);
    pen.stroke();
  }

  ring(pen, i, radius, width) {
    pen.lineWidth = width;
    pen.beginPath();
    pen.arc(this.plot.across[i], this.plot.down[i], radius, 0, 2 * Math.PI);
    pen.stroke();
  }
}
