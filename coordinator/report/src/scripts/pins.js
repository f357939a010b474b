// The pins of a map: a picture and the number of each medoid beside its point, and the name of its cluster. Pins push each other and
// the points apart until they no longer overlap, so that more of them find room as people zoom into the map.
const PIN = 46;
const SMALL_PIN = 20;
// How far the number of a pin extends beyond the pin, with a margin.
const BADGE = 12;
// Room for a name below a pin.
const NAME = 14;
const HALF_NAME = 45;
// With more pins than this, or on a narrower map, pins show only their number.
const MOST_LARGE = 40;
const NARROW = 620;

class Pins {
  // `layer` lies over the map and gets the pins; `buttons` cover a corner of the map.
  constructor(layer, buttons) {
    this.layer = layer;
    this.buttons = buttons;
    this.pins = [];
  }

  // Makes a pin for each medoid, in order: its picture, its colour, the name of its cluster ("" for none) and, if pins can be clicked,
  // the address of a link.
  fill(medoids) {
    this.pins = medoids.map(({ picture, colour, name, href }, place) => {
      const pin = document.createElement(href ? "a" : "div");
      if (href) pin.href = href;
      pin.className = "pin";
      // A drag that starts on a pin moves the map.
      pin.draggable = false;
      pin.dataset.place = place;
      pin.style.setProperty("--cluster", colour);
      const image = document.createElement("img");
      image.draggable = false;
      image.src = picture;
      image.alt = "";
      const number = document.createElement("span");
      number.textContent = place + 1;
      const told = document.createElement("small");
      told.textContent = name;
      if (href) pin.setAttribute("aria-label", `Behaviour ${place + 1}${name && `, ${name}`}`);
      pin.append(image, number, told);
      return { pin, hasName: name !== "", x: 0, y: 0 };
    });
    this.layer.replaceChildren(...this.pins.map(({ pin }) => pin));
  }

  // Arranges the pins of the medoids at these points of a map. Pins of points that are not on the map are hidden.
  arrange(points, [width, height], isOn) {
    const small = width < NARROW || this.pins.length > MOST_LARGE;
    this.layer.classList.toggle("small", small);
    const size = small ? SMALL_PIN : PIN;
    const { buttons } = this;
    const underButtons = buttons.offsetTop + buttons.offsetHeight + size / 2 + BADGE;
    const least = size / 2 + 2;
    const highest = (x) => (x + size / 2 + BADGE > buttons.offsetLeft ? underButtons : least);
    const on = this.pins.map((_, i) => isOn(...points[i]));
    const shown = this.pins.filter((_, i) => on[i]);
    this.pins.forEach((pin, i) => {
      const [dx, dy] = [points[i][0] - width / 2, points[i][1] - height / 2];
      const far = small ? 0 : PIN / Math.max(Math.hypot(dx, dy), 1);
      const at = (far) => [points[i][0] + dx * far + 0.01 * i, points[i][1] + dy * far];
      const [x, y] = at(far);
      // A pin is outside its point, seen from the middle of the map. If the edge leaves no room there, the pin goes to the inside.
      const fits = x >= least && x <= width - least && y >= highest(x) && y <= height - least;
      [pin.x, pin.y] = at(fits ? far : -far);
    });
    const near = points.filter((_, i) => on[i]);
    for (let round = 0; round < 300; round++) {
      for (const [i, a] of shown.entries()) {
        const room = size + 6 + (!small && a.hasName ? NAME : 0);
        for (const b of shown.slice(0, i)) push(a, b, room, 0.5);
        if (!small) for (const [x, y] of near) push(a, { x, y, fixed: true }, size / 2 + 10, 0.6);
        const side = !small && a.hasName ? HALF_NAME : least;
        a.x = Math.min(Math.max(a.x, side), width - side);
        a.y = Math.min(Math.max(a.y, highest(a.x)), height - least - (!small && a.hasName ? NAME : 0));
      }
    }
    // Positions are fractions of the map, because printing changes the size of the map without running the script.
    this.pins.forEach(({ pin, x, y }, i) => {
      // Without its point in view, a pin would suggest that its point is here.
      pin.hidden = !on[i];
      pin.style.left = `${(100 * x) / width}%`;
      pin.style.top = `${(100 * y) / height}%`;
    });
  }

  // Draws the lines from the medoids' points to their pins. `strength(place)` is the opacity of a line.
  lead(pen, points, isDark, strength) {
    pen.lineWidth = 1.25;
    this.pins.forEach(({ pin, x, y }, place) => {
      if (pin.hidden) return;
      const [px, py] = points[place];
      pen.globalAlpha = strength(place);
      pen.strokeStyle = isDark ? "#a9a79f" : "#5f5e58";
      pen.beginPath();
      pen.moveTo(px, py);
      pen.lineTo(x, y);
      pen.stroke();
      pen.fillStyle = isDark ? "#ecebe6" : "#1d1d1b";
      pen.beginPath();
      pen.arc(px, py, 3.5, 0, 2 * Math.PI);
      pen.fill();
    });
    pen.globalAlpha = 1;
  }
}

function push(a, b, apart, part) {
  const [dx, dy] = [a.x - b.x, a.y - b.y];
  const distance = Math.hypot(dx, dy);
  if (distance >= apart) return;
  const move = (part * (apart - distance)) / Math.max(distance, 0.01);
  a.x += dx * move;
  a.y += dy * move;
  if (!b.fixed) {
    b.x -= dx * move;
    b.y -= dy * move;
  }
}
