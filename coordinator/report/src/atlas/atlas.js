// Pictures of single controllers, for a map without tiles. The class requests a few pictures at a time.
class Singles {
  // Maximum number of requests at a time, and of pictures that are kept.
  static AT_ONCE = 8;
  static KEPT = 4000;
  // Milliseconds for which a part of the map stays in view before its pictures are requested. A moving map shows many parts for a
  // shorter time.
  static SETTLED_MS = 120;
  // Milliseconds to pause after a failed request, at first and at most: the coordinator can be unreachable for a while.
  static PAUSE_MS = [500, 8000];

  // `address(entry)` returns the address of a picture. The class calls `arrived()` when more pictures have arrived.
  constructor(address, arrived) {
    this.address = address;
    this.arrived = arrived;
    // Pictures by entry, the most recently used picture last.
    this.kept = new Map();
    this.wanted = [];
    this.asked = new Set();
    this.timer = 0;
    this.isPaused = false;
    [this.pauseMs] = Singles.PAUSE_MS;
    this.isTold = true;
  }

  // The picture of an entry; null if the picture has not arrived.
  known(entry) {
    const image = this.kept.get(entry);
    if (!image) return null;
    this.kept.delete(entry);
    this.kept.set(entry, image);
    return image;
  }

  // Sets the entries whose pictures are wanted, the most important first. The new entries replace the previous entries.
  want(entries) {
    this.wanted = [...new Set(entries)].slice(0, Singles.KEPT).filter((entry) => !this.kept.has(entry) && !this.asked.has(entry));
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.ask(), Singles.SETTLED_MS);
  }

  ask() {
    while (!this.isPaused && this.asked.size < Singles.AT_ONCE && this.wanted.length > 0) this.fetch(this.wanted.shift());
  }

  fetch(entry) {
    const image = new Image();
    this.asked.add(entry);
    image.onload = () => this.take(entry, image);
    image.onerror = () => this.await(entry);
    image.src = this.address(entry);
  }

  // Requests a picture again after a failure: after a pause, and after the other wanted pictures.
  await(entry) {
    this.asked.delete(entry);
    this.wanted.push(entry);
    if (this.isPaused) return;
    this.isPaused = true;
    setTimeout(() => {
      this.isPaused = false;
      this.ask();
    }, this.pauseMs);
    this.pauseMs = Math.min(2 * this.pauseMs, Singles.PAUSE_MS[1]);
  }

  take(entry, image) {
    this.asked.delete(entry);
    [this.pauseMs] = Singles.PAUSE_MS;
    this.kept.set(entry, image);
    if (this.kept.size > Singles.KEPT) this.kept.delete(this.kept.keys().next().value);
    this.ask();
    // `arrived()` is called at most once per animation frame.
    if (!this.isTold) return;
    this.isTold = false;
    requestAnimationFrame(() => {
      this.isTold = true;
      this.arrived();
    });
  }
}

// The map of an atlas, on the elements of its page: `map` is the canvas, `source` the picture with one pixel per controller,
// `chosen` describes one controller, and `classes` lists the classes. On a page with a coordinator, the map passes the chosen
// controller or null to `choose(at, genes)`, and `pictureOf(entry)` returns the address of an entry's picture. Without
// `pictureOf`, the pictures of swarms are files beside the page. `seen` restores a view of another atlas of the same size: zoom,
// middle, and position of the chosen controller. The function `seen()` of the result returns such a view.
function showAtlas(data, { choose = null, pictureOf = null, seen = null } = {}) {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const map = new Uint32Array(bytes(data.map));
  const judged = new Uint8Array(bytes(data.judged));
  const measured = new Float32Array(bytes(data.measured));
  const seeds = new BigUint64Array(bytes(data.seeds));
  const MIRRORED = 0x80000000, NOTHING = 0x7fffffff;
  const n = data.values, side = n * n;
  const canvas = document.getElementById("map"), pen = canvas.getContext("2d");
  const source = document.getElementById("source");
  const chosen = document.getElementById("chosen");
  // Screen pixels per controller, and position of the picture's upper left corner on the canvas.
  let scale = 1, left = 0, top = 0;
  // The scale that shows the whole map.
  let whole = 1;
  // The controller that a person has chosen, and the controller that the page describes.
  let pinned = null, told = null;
  let onlyClass = null, shown = source;

  const entryAt = (x, y) => {
    if (x < 0 || y < 0 || x >= side || y >= side) return null;
    const number = map[y * side + x];
    const entry = (number & NOTHING) >>> 0;
    return entry === NOTHING ? null : { x, y, entry, mirrored: number >= MIRRORED };
  };
  const verdictsOf = (entry) =>
    [...judged.subarray(entry * data.starts, (entry + 1) * data.starts)].map((number) => data.verdicts[number - 1]);
  // The most frequent class; if several are equally frequent, the class of the earliest trial.
  const classOf = (entry) => {
    const classes = verdictsOf(entry).map((verdict) => verdict.class);
    const count = (name) => classes.filter((other) => other === name).length;
    return classes.reduce((best, name) => (count(name) > count(best) ? name : best));
  };
  const genesAt = ({ x, y }) => {
    const places = [Math.floor(x / n), n - 1 - Math.floor(y / n), x % n, n - 1 - (y % n)];
    return places.map((place, gene) => data.speeds[gene][place]);
  };

  // Of two controllers that are mirror images, only the simulated controller has a picture. The picture is in the tile of that
  // controller.
  const simulated = new Map();
  map.forEach((number, pixel) => {
    if (number < NOTHING) simulated.set(number, pixel);
  });
  const tiles = new Map();
  const tile = (column, row) => {
    const key = `${column}-${row}`;
    if (!tiles.has(key)) {
      const image = new Image();
      image.onload = draw;
      image.src = `pictures/tile-${key}.png`;
      tiles.set(key, image);
    }
    const image = tiles.get(key);
    return image.complete && image.naturalWidth > 0 ? image : null;
  };
  const singles = pictureOf && new Singles(pictureOf, () => {
    draw();
    if (told) drawChosen(told);
  });
  // The image that contains the picture of an entry, and the picture's position in this image; null if the image has not arrived.
  const pictured = (entry) => {
    if (singles) {
      const image = singles.known(entry);
      return image && { image, x: 0, y: 0 };
    }
    const pixel = simulated.get(entry);
    const [column, row] = [pixel % side, Math.floor(pixel / side)];
    const image = tile(Math.floor(column / n), Math.floor(row / n));
    return image && { image, x: (column % n) * data.side, y: (row % n) * data.side };
  };
  // Draws the picture of a swarm. Returns whether the picture was available.
  const drawSwarm = (pen, at, x, y, size) => {
    const picture = pictured(at.entry);
    if (!picture) return false;
    pen.save();
    pen.imageSmoothingEnabled = false;
    if (at.mirrored) {
      pen.translate(2 * x + size, 0);
      pen.scale(-1, 1);
    }
    pen.drawImage(picture.image, picture.x, picture.y, data.side, data.side, x, y, size, size);
    pen.restore();
    return true;
  };

  // The map with all classes darkened except `onlyClass`.
  const onlyShown = () => {
    if (!onlyClass) return source;
    const copy = document.createElement("canvas");
    copy.width = copy.height = side;
    const pen = copy.getContext("2d");
    pen.drawImage(source, 0, 0);
    const pixels = pen.getImageData(0, 0, side, side);
    for (let pixel = 0; pixel < side * side; pixel++) {
      const entry = (map[pixel] & NOTHING) >>> 0;
      if (entry === NOTHING || classOf(entry) !== onlyClass) pixels.data.set([22, 22, 22], 4 * pixel);
    }
    pen.putImageData(pixels, 0, 0);
    return copy;
  };

  // The controllers in a part of the map.
  const between = (from, to) => {
    const found = [];
    for (let y = from[1]; y < to[1]; y++) for (let x = from[0]; x < to[0]; x++) found.push(entryAt(x, y));
    return found.filter(Boolean);
  };

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = scale < 1;
    pen.drawImage(shown, left, top, side * scale, side * scale);
    const from = [0, 1].map((axis) => Math.max(0, Math.floor(-[left, top][axis] / scale)));
    const to = [width, height].map((size, axis) => Math.min(side, Math.ceil((size - [left, top][axis]) / scale)));
    const seen = scale >= Math.max(28, 1.5 * whole) ? between(from, to) : [];
    const rim = 2;
    for (const at of seen) drawSwarm(pen, at, left + at.x * scale + rim, top + at.y * scale + rim, scale - 2 * rim);
    // The picture of the chosen controller is requested first.
    singles?.want([...(pinned ? [pinned.entry] : []), ...seen.map(({ entry }) => entry)]);
    if (scale * n >= 24) {
      pen.strokeStyle = "#00000088";
      pen.beginPath();
      for (let line = 0; line <= n; line++) {
        pen.moveTo(left + line * n * scale, top);
        pen.lineTo(left + line * n * scale, top + side * scale);
        pen.moveTo(left, top + line * n * scale);
        pen.lineTo(left + side * scale, top + line * n * scale);
      }
      pen.stroke();
    }
    if (pinned) {
      pen.strokeStyle = "#fff";
      pen.lineWidth = 2;
      pen.strokeRect(left + pinned.x * scale - 1, top + pinned.y * scale - 1, scale + 2, scale + 2);
      pen.lineWidth = 1;
    }
  }

  const element = (name, text, parent) => {
    const made = document.createElement(name);
    made.textContent = text;
    parent.append(made);
    return made;
  };
  // Draws the picture of the described controller; the canvas is hidden until the picture arrives.
  const drawChosen = (at) => {
    const picture = chosen.querySelector("canvas");
    if (picture) picture.hidden = !drawSwarm(picture.getContext("2d"), at, 0, 0, data.side);
  };
  const show = (at) => {
    if (!at) return;
    told = at;
    chosen.replaceChildren();
    const name = classOf(at.entry).replaceAll("_", " ");
    const title = element("p", "", chosen);
    element("b", name, title);
    title.append(at.mirrored ? ", a mirror image of what was simulated" : "");
    const picture = element("canvas", "", chosen);
    picture.width = picture.height = data.side;
    picture.setAttribute("role", "img");
    picture.setAttribute("aria-label", "Picture of its swarm");
    drawChosen(at);
    const table = element("table", "", chosen);
    const row = (head, text) => {
      const line = element("tr", "", table);
      element("th", head, line);
      element("td", text, line);
    };
    const genes = genesAt(at);
    data.genes.forEach((gene, place) => row(gene, genes[place]));
    row("starts", verdictsOf(at.entry).map((verdict) => verdict.name.replaceAll("_", " ")).join(", "));
    if (choose) {
      // A page with a coordinator shows the motion of the chosen controller beside the map.
    } else if (!at.mirrored) {
      data.features.forEach((feature, place) =>
        row(feature.replaceAll("_", " "), measured[at.entry * data.features.length + place].toPrecision(3)));
      element("p", "Its motion from the first start:", chosen);
      const command = `murmuration simulate --controller=${genes.join(",")} --seed ${seeds[at.entry]}${data.robot} --gif motion.gif`;
      element("code", command, chosen);
    }
  };

  const pin = (at) => {
    pinned = at;
    show(pinned);
    choose?.(pinned, pinned && genesAt(pinned));
    draw();
  };
  // Moves the map so that a controller is on the canvas.
  const reveal = ({ x, y }) => {
    const into = (corner, place, size) => {
      const at = corner + (place + 0.5) * scale;
      return at < 0 || at > size ? size / 2 - (place + 0.5) * scale : corner;
    };
    [left, top] = [into(left, x, canvas.clientWidth), into(top, y, canvas.clientHeight)];
  };
  // Chooses, for a key, the neighbour of the chosen controller; with `far`, the controller at the same position in the
  // neighbouring tile.
  const go = ([dx, dy], far) => {
    const steps = far ? n : 1;
    const next = entryAt(pinned.x + dx * steps, pinned.y + dy * steps);
    if (!next) return;
    reveal(next);
    pin(next);
  };
  const under = (event) => {
    const box = canvas.getBoundingClientRect();
    const place = [event.clientX - box.left - left, event.clientY - box.top - top];
    return entryAt(...place.map((along) => Math.floor(along / scale)));
  };
  const zoom = (factor, x, y) => {
    const wanted = Math.min(200, Math.max(0.25, scale * factor));
    [left, top] = [x - ((x - left) * wanted) / scale, y - ((y - top) * wanted) / scale];
    scale = wanted;
    draw();
  };
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = canvas.getBoundingClientRect();
    zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
  }, { passive: false });
  let grabbed = null;
  canvas.addEventListener("pointerdown", (event) => {
    grabbed = { x: event.clientX, y: event.clientY, moved: 0 };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (grabbed) {
      const [dx, dy] = [event.clientX - grabbed.x, event.clientY - grabbed.y];
      left += dx;
      top += dy;
      grabbed = { x: event.clientX, y: event.clientY, moved: grabbed.moved + Math.abs(dx) + Math.abs(dy) };
      draw();
    } else if (!pinned) show(under(event));
  });
  canvas.addEventListener("pointerup", (event) => {
    if (grabbed && grabbed.moved < 4) {
      const at = under(event);
      pin(pinned && at && pinned.x === at.x && pinned.y === at.y ? null : at);
    }
    grabbed = null;
  });
  canvas.addEventListener("keydown", (event) => {
    const step = 60, middle = [canvas.clientWidth / 2, canvas.clientHeight / 2];
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (event.key === "+" || event.key === "=") zoom(1.5, ...middle);
    else if (event.key === "-") zoom(1 / 1.5, ...middle);
    else if (event.key === "Enter") {
      const inMiddle = () => entryAt(...[middle[0] - left, middle[1] - top].map((along) => Math.floor(along / scale)));
      pin(pinned ?? inMiddle());
    } else if (event.key === "Escape" && pinned) pin(null);
    else if (way && pinned) go(way, event.shiftKey);
    else if (way) {
      [left, top] = [left - way[0] * step, top - way[1] * step];
      draw();
    } else return;
    event.preventDefault();
  });

  const counts = new Map();
  for (const number of map) {
    const entry = (number & NOTHING) >>> 0;
    if (entry === NOTHING) continue;
    const name = classOf(entry);
    counts.set(name, (counts.get(name) || 0) + 1);
  }
  const list = document.getElementById("classes");
  for (const [name, count] of [...counts].sort((a, b) => b[1] - a[1])) {
    const button = element("button", "", element("li", "", list));
    const swatch = element("i", "", button);
    swatch.style.background = data.verdicts.find((verdict) => verdict.name === name).colour;
    button.append(name.replaceAll("_", " "));
    element("span", count.toLocaleString("en"), button);
    button.setAttribute("aria-pressed", "false");
    button.addEventListener("click", () => {
      onlyClass = onlyClass === name ? null : name;
      for (const other of list.querySelectorAll("button")) other.setAttribute("aria-pressed", "false");
      button.setAttribute("aria-pressed", String(onlyClass === name));
      shown = onlyShown();
      draw();
    });
  }
  const fit = () => {
    scale = whole = Math.min(canvas.clientWidth, canvas.clientHeight) / side;
    left = (canvas.clientWidth - side * scale) / 2;
    top = (canvas.clientHeight - side * scale) / 2;
    draw();
  };
  // When the canvas changes its size, a map in full view stays in full view, and a zoomed map keeps its position.
  new ResizeObserver(() => (scale === whole ? fit() : draw())).observe(canvas);
  const begin = () => {
    fit();
    if (!seen) return;
    scale = Math.min(200, Math.max(0.25, whole * seen.zoom));
    [left, top] = [canvas.clientWidth / 2 - seen.x * scale, canvas.clientHeight / 2 - seen.y * scale];
    const at = seen.at && entryAt(...seen.at);
    if (at) pin(at);
    else draw();
  };
  source.decode().then(begin, begin);
  return {
    seen: () => ({
      zoom: scale / whole,
      x: (canvas.clientWidth / 2 - left) / scale,
      y: (canvas.clientHeight / 2 - top) / scale,
      at: pinned && [pinned.x, pinned.y],
    }),
  };
}
