// A closed line that a person draws.

const CLICK = 5;

// Lets a person draw lines on a canvas over `area`. Calls `inside(polygon, adds)` after a line, which is closed, and `click` if
// the pointer hardly moved. Two fingers draw no line, and neither does a pointer for which `draws(event)` is false.
export function lasso(canvas, area, { inside, click, draw, draws = () => true }) {
  let line = null;
  area.addEventListener("pointerdown", (event) => {
    if (line) {
      line = null;
      draw(null);
      return;
    }
    if (event.button !== 0 || !draws(event)) return;
    line = [within(event, area)];
    area.setPointerCapture(event.pointerId);
  });
  area.addEventListener("pointermove", (event) => {
    if (!line) return;
    line.push(within(event, area));
    if (isDrawn(line)) draw(line);
  });
  const end = (event) => {
    if (!line) return;
    const drawn = line;
    line = null;
    draw(null);
    if (isDrawn(drawn)) inside(drawn, event.shiftKey);
    else if (event.type === "pointerup") click?.(drawn[0], event);
  };
  area.addEventListener("pointerup", end);
  area.addEventListener("pointercancel", () => {
    line = null;
    draw(null);
  });
  return canvas;
}

function within(event, area) {
  const place = area.getBoundingClientRect();
  return [event.clientX - place.left, event.clientY - place.top];
}

const isDrawn = (line) => line.some(([x, y]) => Math.hypot(x - line[0][0], y - line[0][1]) > CLICK);

// Whether a point is inside a closed line. A ray from such a point crosses the line an odd number of times.
export function encloses(line, x, y) {
  let odd = false;
  for (let i = 0, j = line.length - 1; i < line.length; j = i++) {
    const [ax, ay] = line[i];
    const [bx, by] = line[j];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) odd = !odd;
  }
  return odd;
}

export function trace(pen, line, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  pen.setLineDash([6, 4]);
  pen.beginPath();
  for (const [x, y] of line) pen.lineTo(x, y);
  pen.closePath();
  pen.stroke();
  pen.setLineDash([]);
}
