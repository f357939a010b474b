// Shows the values of a plot at the pointer, or at a position that the arrow keys move.
const { grouped, short } = window.murmuration;

class Curves {
  constructor(root) {
    this.root = root;
    Object.assign(this, JSON.parse(root.dataset.plot));
    this.told = root.nextElementSibling;
    this.spoken = document.createElement("p");
    this.spoken.className = "unseen";
    this.spoken.setAttribute("role", "status");
    this.told.after(this.spoken);
    this.at = -1;
    // A screen reader passes arrow keys only to applications, and the plot needs these keys.
    root.setAttribute("role", "application");
    root.setAttribute("aria-roledescription", "chart");
    root.setAttribute("aria-label", `${root.getAttribute("aria-label")}. Arrow keys move from value to value.`);
    root.tabIndex = 0;
    this.views = ["wide", "narrow"].map((name) => this.view(name));
    root.addEventListener("pointerleave", () => this.point(-1));
    root.addEventListener("keydown", (event) => this.key(event));
  }

  // Adds a line and dots over the wide or the narrow picture of the plot.
  view(name) {
    const box = this.root.querySelector(`.${name}`);
    const mark = document.createElement("div");
    mark.className = "mark";
    mark.hidden = true;
    mark.append(...this.lines.map((_, line) => Object.assign(document.createElement("i"), { className: `dot-${line}` })));
    box.append(mark);
    const frame = this[name];
    box.addEventListener("pointermove", ({ clientX }) => {
      const place = box.getBoundingClientRect();
      const [from, to] = frame.across;
      this.point(this.nearest((((clientX - place.left) / place.width - from) / (to - from)) * frame.last));
    });
    return { mark, frame };
  }

  nearest(generation) {
    let best = -1;
    this.x.forEach((x, i) => {
      if (best < 0 || Math.abs(x - generation) < Math.abs(this.x[best] - generation)) best = i;
    });
    return best;
  }

  key(event) {
    const { key } = event;
    const last = this.x.length - 1;
    const from = this.at < 0 ? last + 1 : this.at;
    const to = { ArrowLeft: from - 1, ArrowRight: from + 1, Home: 0, End: last }[key];
    if (to === undefined || last < 0) return;
    event.preventDefault();
    this.point(Math.min(Math.max(to, 0), last));
    this.spoken.textContent = this.told.textContent;
  }

  point(at) {
    if (at === this.at) return;
    this.at = at;
    for (const { mark, frame } of this.views) this.place(mark, frame);
    if (at < 0) return;
    const values = this.lines.map(({ name, values }) => `${name} ${values[at] === null ? "–" : short(values[at])}`.trim());
    this.told.textContent = `Generation ${grouped(this.x[at])}: ${values.join(" · ")}`;
  }

  place(mark, { across, down, last, top }) {
    mark.hidden = this.at < 0;
    if (this.at < 0) return;
    const along = ([from, to], part) => `${100 * (from + part * (to - from))}%`;
    mark.style.left = along(across, this.x[this.at] / last);
    this.lines.forEach(({ values }, line) => {
      const dot = mark.children[line];
      dot.hidden = values[this.at] === null;
      dot.style.top = along(down, values[this.at] / top);
    });
  }
}

for (const root of document.querySelectorAll(".plot")) new Curves(root);
