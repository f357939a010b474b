// Draws the behaviour space, and highlights a cluster on the map, the pins and the legend.
const { clusterColours, equalScale, fit, Pins, Plot, steer, zoomButtons } = window.murmuration;
const plot = new Plot(document.getElementById("space"));
const { canvas } = plot;
const pen = canvas.getContext("2d");
const pins = new Pins(document.getElementById("pins"), document.querySelector(".zoom"));
const tip = document.getElementById("tip");
const scheme = matchMedia("(prefers-color-scheme: dark)");
const print = matchMedia("print");
// Paper is light, even if the screen is dark.
const isDark = () => scheme.matches && !print.matches;
const count = archive.x.length;
let chosen = -1;
let hovered = -1;
// The individual that the panel shows.
let opened = -1;

// Individuals in the order in which they are drawn: by cluster, so that the drawing sets each colour once.
const order = Uint32Array.from(archive.x.keys()).sort((a, b) => archive.cluster[a] - archive.cluster[b]);

const starts = new Uint32Array(clusterColours.length + 1);
for (const cluster of archive.cluster) starts[cluster + 1]++;
for (let cluster = 0; cluster < clusterColours.length; cluster++) starts[cluster + 1] += starts[cluster];
const place = (i) => [plot.across[i], plot.down[i]];

function paint() {
  plot.paint(isDark(), groups());
  const dense = canvas.width / Math.max(canvas.clientWidth, 1);
  pen.setTransform(dense, 0, 0, dense, 0, 0);
  pins.lead(pen, archive.medoids.map(place), isDark(), (cluster) => (chosen >= 0 && chosen !== cluster ? 0.25 : 0.9));
  for (const [i, radius] of [[hovered, 5.5], [opened, 8]]) {
    if (i < 0) continue;
    const [x, y] = place(i);
    pen.globalAlpha = 1;
    pen.lineWidth = 2;
    pen.strokeStyle = isDark() ? "#ffffff" : "#1d1d1b";
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.stroke();
  }
}

// The groups of points to paint, one for each cluster; the highlighted cluster is on top.
function groups() {
  const clusters = clusterColours.map((_, cluster) => cluster).sort((a, b) => (a === chosen) - (b === chosen));
  return clusters.map((cluster) => {
    const faded = chosen >= 0 && cluster !== chosen;
    const grey = isDark() ? "#4a4b48" : "#cfccc3";
    const colour = parseInt((faded ? grey : clusterColours[cluster]).slice(1), 16);
    return {
      points: order.subarray(starts[cluster], starts[cluster + 1]),
      colourOf: () => colour,
      strength: faded ? 0.5 : chosen === cluster ? 0.95 : 0.65,
    };
  });
}

pins.fill(
  archive.medoids.map((_, cluster) => {
    const card = document.getElementById(`behaviour-${cluster + 1}`);
    return {
      picture: card.querySelector("img.grey").src,
      colour: clusterColours[cluster],
      name: card.querySelector(".name h3 > :not(.swatch)")?.textContent ?? "",
      href: `#behaviour-${cluster + 1}`,
    };
  }),
);

function arrange() {
  pins.arrange(archive.medoids.map(place), [canvas.clientWidth, canvas.clientHeight], (x, y) => plot.isOn(x, y));
}

// Paints a small map: the position of one cluster among all points.
function paintSmall(small, cluster) {
  fit(small);
  const brush = small.getContext("2d");
  const { width, height } = small;
  brush.clearRect(0, 0, width, height);
  const scale = equalScale(archive.spans, width, height, 0.06 * width);
  const dot = Math.max(width / 90, 1);
  const mark = (i) => brush.fillRect(scale.across(archive.x[i]) - dot / 2, scale.down(archive.y[i]) - dot / 2, dot, dot);
  const every = Math.max(Math.floor(count / 6000), 1);
  brush.fillStyle = isDark() ? "#45463f" : "#d9d6cd";
  for (let at = 0; at < count; at += every) mark(order[at]);
  brush.fillStyle = clusterColours[cluster];
  for (let at = starts[cluster]; at < starts[cluster + 1]; at += every) mark(order[at]);
  const centre = archive.medoids[cluster];
  brush.fillStyle = isDark() ? "#ffffff" : "#1d1d1b";
  brush.beginPath();
  brush.arc(scale.across(archive.x[centre]), scale.down(archive.y[centre]), width / 32, 0, 2 * Math.PI);
  brush.fill();
}

function choose(cluster) {
  if (chosen === cluster) return;
  chosen = cluster;
  for (const marked of document.querySelectorAll(".pin, .legend a")) {
    marked.classList.toggle("faded", cluster >= 0 && Number(marked.dataset.place) !== cluster);
  }
  schedule();
}

let waiting = false;
// Whether the map was zoomed or moved since it was painted.
let isMoved = false;
function schedule() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    if (isMoved) {
      plot.layOut();
      arrange();
    }
    isMoved = false;
    paint();
  });
}

function describe(i) {
  const name = named(i);
  const lines = [
    `${titleOf(i)} · behaviour ${archive.cluster[i] + 1}${name && ` · ${name}`}`,
    `[${rounded(i).join(", ")}]`,
    `novelty when evaluated ${archive.novelty[i].toPrecision(4)} · generation ${grouped(archive.generation[i])}`,
  ];
  if (archive.trials > 1) lines.push(`robustness ${archive.robust[i]} of ${archive.trials}`);
  if (!hasOwnPicture(i)) lines.push("picture of its medoid");
  tip.querySelector(".lines").replaceChildren(...lines.map((line) => element("div", line)));
  drawPicture(tip.querySelector("canvas"), i);
}

// The left and the right end of the part of the map that the panel does not cover.
function besidePanel() {
  const width = canvas.clientWidth;
  const isOver = !panel.hidden && panel.offsetTop < canvas.clientHeight;
  if (!isOver) return [0, width];
  return panel.classList.contains("left") ? [panel.offsetLeft + panel.offsetWidth, width] : [0, panel.offsetLeft];
}

// Describes a point that the pointer or a key has reached; -1 stands for no point.
function hover(i) {
  if (i === hovered) return;
  hovered = i;
  tip.hidden = i < 0;
  if (i >= 0) {
    describe(i);
    const [x, y] = place(i);
    const [left, right] = besidePanel();
    tip.style.left = `${Math.max(Math.min(x + 14, right - tip.offsetWidth - 4), left + 4)}px`;
    tip.style.top = `${y + 18 + tip.offsetHeight > canvas.clientHeight ? y - tip.offsetHeight - 12 : y + 16}px`;
  }
  choose(i >= 0 ? archive.cluster[i] : -1);
  schedule();
}

function show(i) {
  if (i < 0) return;
  opened = i;
  openPanel(i, place(i)[0] < canvas.clientWidth / 2);
  // The tip is not needed, because the panel shows the same data.
  tip.hidden = true;
  schedule();
}

function letGo() {
  if (opened < 0) return;
  const hadFocus = panel.contains(document.activeElement);
  opened = -1;
  panel.hidden = true;
  if (hadFocus) canvas.focus();
  schedule();
}

canvas.addEventListener("pointermove", (event) => hover(plot.nearest(event.offsetX, event.offsetY)));
canvas.addEventListener("pointerleave", () => hover(-1));
canvas.addEventListener("blur", () => hover(-1));
// Browsers also send a click at the end of a drag, so that a click counts only near the place of the press.
let pressed = [0, 0];
canvas.addEventListener("pointerdown", ({ clientX, clientY }) => (pressed = [clientX, clientY]));
canvas.addEventListener("click", ({ clientX, clientY, offsetX, offsetY }) => {
  if (Math.hypot(clientX - pressed[0], clientY - pressed[1]) < 5) show(plot.nearest(offsetX, offsetY));
});
panel.querySelector(".close").addEventListener("click", letGo);
document.addEventListener("keydown", ({ key }) => {
  if (key === "Escape") letGo();
});
canvas.addEventListener("keydown", (event) => {
  const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const way = ways[event.key];
  const zooms = { "+": "in", "=": "in", "-": "out", Home: "whole" };
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (way) {
    const next = plot.towards(hovered, ...way);
    if (next >= 0 && plot.reveal(next)) {
      plot.layOut();
      arrange();
    }
    hover(next);
  } else if (zooms[event.key]) document.querySelector(`.zoom [data-zoom=${zooms[event.key]}]`).click();
  else if (event.key === "Enter") {
    show(hovered);
    if (hovered >= 0) panel.querySelector("h3").focus();
  } else return;
  event.preventDefault();
});

for (const marked of document.querySelectorAll(".pin, .legend a, .card")) {
  const cluster = Number(marked.dataset.place);
  marked.addEventListener("pointerenter", () => choose(cluster));
  marked.addEventListener("pointerleave", () => choose(-1));
  marked.addEventListener("focusin", () => choose(cluster));
  marked.addEventListener("focusout", () => choose(-1));
}

function layOut() {
  plot.layOut();
  arrange();
  paint();
  for (const small of document.querySelectorAll("canvas.where")) {
    paintSmall(small, Number(small.closest(".card").dataset.place));
  }
}
let resizing = 0;
addEventListener("resize", () => {
  clearTimeout(resizing);
  resizing = setTimeout(layOut, 120);
});
scheme.addEventListener("change", layOut);
print.addEventListener("change", layOut);
plot.place(archive.x, archive.y, archive.spans);
layOut();

function moved() {
  hovered = -1;
  tip.hidden = true;
  isMoved = true;
  schedule();
}
// The wheel without a modifier key scrolls the page, and so does one finger.
steer(canvas, plot, {
  wheels: (event) => event.ctrlKey || event.metaKey,
  drags: (event) => event.pointerType !== "touch" && event.button === 0 && plot.zoom > 1,
  changed: moved,
});
zoomButtons(document.querySelector(".zoom"), plot, moved);
