// The editor of robots: fields and a drawing that write the text of a description.
import { base } from "./base.js";
import { Drawing } from "./robotdrawing.js";
import { copied, kind, middle, put, radians, sees, toml } from "./robottoml.js";

const PAUSE_MS = 300;
// A change that follows another one within this time belongs to the same step of undoing.
const STEP_MS = 800;
const MOST_SENSORS = 6;
const UNIT = "murmuration.angles";
const DEGREE = Math.PI / 180;

// The controls belong to no form, so that a form around the editor neither sends nor checks them.
const NO_FORM = "no-form";

function element(name, properties = {}, ...inner) {
  const { attributes = {}, ...others } = properties;
  const made = Object.assign(document.createElement(name), others);
  for (const [key, given] of Object.entries(attributes)) made.setAttribute(key, given);
  made.append(...inner);
  return made;
}

const button = (text, act) => element("button", { type: "button", className: "plain", textContent: text, onclick: act });

// A key of everything that the genes of a controller depend on. While the key is the same, a controller fits the robots.
function genes({ before, robots }) {
  const sensor = (of) => (of.angle === "free" ? [of.angle_range, of.angles] : null);
  const robot = ({ sensors, drive, max_speed, max_turn }) => [sensors.map(sensor), drive, max_speed, max_turn];
  return JSON.stringify([before, robots.map((of) => [of.species, robot(of.robot)])]);
}

class Editor {
  constructor(root, text) {
    this.text = text;
    // The description of the page's own text, which the browser can have replaced by an edited one before this script runs.
    this.own = null;
    this.root = root;
    this.fields = root.querySelector(".robot-fields");
    this.status = root.querySelector(".status");
    this.unit = localStorage.getItem(UNIT) === "radians" ? "radians" : "degrees";
    this.of = 0;
    this.before = [];
    this.last = 0;
    this.isRefused = false;
    // The text to which the fields belong.
    this.known = null;
    this.bound = [];
    this.drawing = new Drawing({
      changed: () => this.changed(),
      selected: (place) => this.select(place),
      inWords: (angle) => `${this.inUnit(angle)} ${this.unit}`,
    });
    text.addEventListener("input", () => {
      if (this.isWriting) return;
      clearTimeout(this.waiting);
      this.waiting = setTimeout(() => this.read(), PAUSE_MS);
    });
  }

  // Reads the text with the coordinator, which knows its format. A text with an error keeps the last drawing, which waits.
  async read() {
    const asked = this.text.value;
    const own = this.text.defaultValue;
    if (!this.own) {
      const described = await this.ask(own);
      this.own = described && copied(described);
    }
    const described = asked === own ? this.own : await this.ask(asked);
    if (asked !== this.text.value || !this.own || !described) return;
    this.known = asked;
    this.fields.inert = Boolean(described.error);
    if (described.error) return this.tell(`The drawing waits until the text is right. ${described.error}`, true);
    this.described = copied(described);
    this.of = Math.min(this.of, described.robots.length - 1);
    this.tell(described.loses_comments ? "When you change the drawing, comments inside the text are left out. Undo brings them back." : "");
    this.build(this.drawing.place ?? 0);
  }

  async ask(text) {
    try {
      const response = await fetch(`${base}/play/robot`, { method: "POST", body: new URLSearchParams({ robot: text }) });
      if (response.ok) return await response.json();
      this.tell(await response.text(), true);
    } catch {
      this.tell("The coordinator is not responding.", true);
    }
    return null;
  }

  tell(words, isWrong = false) {
    this.status.textContent = words;
    this.status.classList.toggle("wrong", isWrong);
  }

  get robot() {
    return this.described.robots[this.of].robot;
  }

  get sensor() {
    return this.robot.sensors[this.drawing.place];
  }

  inUnit(angle) {
    return this.unit === "degrees" ? Number((angle / DEGREE).toFixed(1)) : Number(angle.toFixed(4));
  }

  ofUnit(shown) {
    return this.unit === "degrees" ? radians(shown * DEGREE) : radians(shown);
  }

  // Writes the text after a change.
  changed() {
    const now = Date.now();
    if (now - this.last > STEP_MS) this.before.push(this.text.value);
    this.last = now;
    this.isRefused = false;
    this.write(toml(this.described));
    this.known = this.text.value;
    this.sync();
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.check(), PAUSE_MS);
  }

  write(text) {
    this.text.value = text;
    this.isWriting = true;
    this.text.dispatchEvent(new Event("input", { bubbles: true }));
    this.isWriting = false;
    this.link();
  }

  // Says what is wrong with the written text, such as two sensors that see a species that is not there.
  async check() {
    const asked = this.text.value;
    const { error } = (await this.ask(asked)) ?? {};
    if (asked === this.text.value && !this.isRefused) this.tell(error ?? "", Boolean(error));
  }

  undo() {
    const text = this.before.pop();
    if (text === undefined) return;
    this.last = 0;
    this.write(text);
    this.read();
  }

  select(place) {
    this.build(place);
    this.drawing.handles[0].shape.focus();
  }

  // Shows the values of the description in all fields, except in the one in which a person writes.
  sync() {
    for (const { control, get } of this.bound) if (control !== document.activeElement) control.value = get();
    this.undoing.disabled = this.before.length === 0;
  }

  // Shows the description, with another selected sensor.
  build(place) {
    const { robots, radius } = this.described;
    this.bound = [];
    this.drawing.isDegrees = this.unit === "degrees";
    this.drawing.show(this.robot, this.robot.radius ?? radius, place);
    this.undoing = button("Undo", () => this.undo());
    const left = element("div", { className: "drawn" }, this.drawing.svg, this.sensors());
    const right = element("div", { className: "numbers" }, this.whole(robots), this.sensorFields(), this.body(), this.actions());
    this.fields.replaceChildren(left, right);
    this.sync();
    this.link();
  }

  // The buttons that select, add and remove sensors.
  sensors() {
    const { sensors } = this.robot;
    const choices = sensors.map((_, i) => {
      const made = button(`S${i + 1}`, () => this.select(i));
      made.setAttribute("aria-pressed", i === this.drawing.place);
      made.classList.add(`sensor-${i}`);
      return made;
    });
    const add = button("Add a sensor", () => {
      sensors.push({});
      this.build(sensors.length - 1);
      this.changed();
    });
    add.disabled = sensors.length >= MOST_SENSORS;
    const remove = button(`Remove S${this.drawing.place + 1}`, () => {
      sensors.splice(this.drawing.place, 1);
      this.build(Math.max(0, this.drawing.place - 1));
      this.changed();
    });
    remove.disabled = sensors.length === 1;
    return element("div", { className: "actions", role: "group", ariaLabel: "Sensors" }, ...choices, add, remove);
  }

  // The choices for all robots: the species, and the unit of angles.
  whole(robots) {
    const unit = this.choice("Angles in", ["degrees", "radians"], () => this.unit, (unit) => {
      this.unit = unit;
      localStorage.setItem(UNIT, unit);
      this.build(this.drawing.place);
    });
    const names = robots.map(({ species }) => species?.name);
    const species = this.choice("Species", names, () => names[this.of], (name) => {
      this.of = names.indexOf(name);
      this.build(0);
    });
    return element("div", { className: "choices" }, ...(robots.length > 1 ? [species] : []), unit);
  }

  sensorFields() {
    const { sensor } = this;
    const legend = element("legend", { textContent: `Sensor S${this.drawing.place + 1}` });
    const half = this.angle("Half angle of the cone", 0, Math.PI, () => sensor.half_angle ?? 0, (to) => put(sensor, "half_angle", to, 0));
    const range = this.number("Range", { min: 0, max: 1e6, placeholder: "no limit" }, () => sensor.range, (to) => put(sensor, "range", to));
    return element("fieldset", {}, legend, ...this.directions(sensor), half, range, ...this.seen(sensor));
  }

  // The fields of a sensor's direction, which is fixed or evolved.
  directions(sensor) {
    const kinds = ["fixed", "evolved within a range", "evolved among a list"];
    const names = ["fixed", "range", "list"];
    const choice = this.choice("Direction", kinds, () => kinds[names.indexOf(kind(sensor))], (chosen) => {
      this.free(sensor, names[kinds.indexOf(chosen)]);
      this.build(this.drawing.place);
      this.changed();
    });
    const most = 2 * Math.PI;
    if (kind(sensor) === "fixed") return [choice, this.angle("Angle", -most, most, () => middle(sensor), (to) => put(sensor, "angle", to, 0))];
    if (kind(sensor) === "range") {
      const bound = (label, place) => this.angle(label, -most, most, () => sensor.angle_range[place], (to) => (sensor.angle_range[place] = to));
      return [choice, bound("Lowest angle", 0), bound("Highest angle", 1)];
    }
    const input = element("input", { type: "text", autocomplete: "off" });
    const get = () => sensor.angles.map((angle) => this.inUnit(angle)).join(", ");
    const set = (text) => {
      const angles = text.split(/[\s,;]+/).filter(Boolean).map((shown) => this.ofUnit(Number(shown)));
      if (angles.length === 0 || angles.some((angle) => !(Math.abs(angle) <= most))) return false;
      sensor.angles = angles;
      return true;
    };
    return [choice, this.bind("Angles", input, get, set, "angles, with commas between them")];
  }

  free(sensor, to) {
    const angle = middle(sensor);
    for (const name of ["angle", "angle_range", "angles"]) delete sensor[name];
    if (to === "fixed") return put(sensor, "angle", radians(angle), 0);
    sensor.angle = "free";
    if (to === "list") sensor.angles = [radians(angle), radians(angle + Math.PI / 4)];
    else sensor.angle_range = [radians(angle - Math.PI / 4), radians(angle + Math.PI / 4)];
  }

  // The fields of what a sensor sees.
  seen(sensor) {
    const names = this.described.robots.flatMap(({ species }) => (species ? [species.name] : []));
    const others = ["walls", "obstacles"];
    const set = (robots, things) => {
      const all = [robots, ...things].filter(Boolean);
      const seen = all.length > 0 ? all : ["robots"];
      put(sensor, "sees", seen.join() === "robots" ? undefined : seen);
      if (!seen.includes("walls")) delete sensor.wall_range;
      // Without a limit, a sensor would always see a wall.
      else if (sensor.range === undefined && sensor.wall_range === undefined) sensor.wall_range = this.drawing.longest;
      this.build(this.drawing.place);
      this.changed();
    };
    const robots = () => sees(sensor).find((seen) => !others.includes(seen)) ?? "";
    const things = () => sees(sensor).filter((seen) => others.includes(seen));
    const words = ["all robots", ...names.map((name) => `species ${name}`), "no robots"];
    const values = ["robots", ...names, ""];
    const choice = this.choice("Sees", words, () => words[values.indexOf(robots())], (chosen) => set(values[words.indexOf(chosen)], things()));
    const boxes = others.map((thing) => {
      const box = element("input", { type: "checkbox", checked: things().includes(thing), attributes: { form: NO_FORM } });
      box.addEventListener("change", () => set(robots(), others.filter((other) => (other === thing ? box.checked : things().includes(other)))));
      return element("label", { className: "box" }, box, ` ${thing}`);
    });
    const walls = this.number("Range for walls", { min: 0, max: 1e6, placeholder: `${sensor.range ?? ""}` }, () => sensor.wall_range, (to) =>
      put(sensor, "wall_range", to),
    );
    return [choice, element("div", { className: "boxes" }, ...boxes), ...(things().includes("walls") ? [walls] : [])];
  }

  body() {
    const { robot } = this;
    const { radius, wheel_radius } = this.described;
    const isUnicycle = robot.drive === "unicycle";
    const field = (label, name, limits) => this.number(label, limits, () => robot[name], (to) => put(robot, name, to));
    const size = this.number("Radius", { min: 0.001, max: 1000, placeholder: radius }, () => robot.radius, (to) => {
      put(robot, "radius", to);
      this.drawing.radius = to ?? radius;
    });
    const speed = field("Top speed", "max_speed", { min: 0, max: 1000, placeholder: isUnicycle ? "" : 1, isNeeded: isUnicycle });
    const drive = this.choice("Drive", ["two wheels", "unicycle"], () => (isUnicycle ? "unicycle" : "two wheels"), (chosen) => {
      const becomes = chosen === "unicycle";
      put(robot, "drive", becomes ? "unicycle" : undefined);
      put(robot, "max_speed", becomes ? (robot.max_speed ?? 1) * (robot.wheel_radius ?? wheel_radius) : undefined);
      put(robot, "max_turn", becomes ? 1 : undefined);
      delete robot.wheel_radius;
      this.build(this.drawing.place);
      this.changed();
    });
    const other = isUnicycle
      ? field("Top turning rate, radians", "max_turn", { min: 0, max: 1000, isNeeded: true })
      : field("Radius of the wheels", "wheel_radius", { min: 0, max: 1000, placeholder: wheel_radius });
    return element("fieldset", {}, element("legend", { textContent: "Body" }), size, drive, speed, other);
  }

  actions() {
    const copy = button("Copy the TOML", async () => {
      try {
        await navigator.clipboard.writeText(this.text.value);
      } catch {
        // Browsers offer the clipboard only to pages that came over TLS, or from this machine.
        this.text.select();
        document.execCommand("copy");
      }
      this.tell("The TOML is copied.");
    });
    const isNew = Boolean(document.getElementById("new"));
    this.onward = element("a", { className: "button", textContent: isNew ? "Try it on the page Play" : "New campaign with this robot" });
    this.onward.dataset.to = isNew ? "play" : "new";
    return element("div", { className: "actions" }, this.undoing, copy, this.onward);
  }

  link() {
    if (this.onward) this.onward.href = `${base}/${this.onward.dataset.to}?${new URLSearchParams({ robot: this.text.value })}`;
  }

  choice(label, words, get, set) {
    const control = element("select", { attributes: { form: NO_FORM } }, ...words.map((word) => element("option", { textContent: word })));
    control.addEventListener("change", () => set(control.value));
    this.bound.push({ control, get });
    return element("label", {}, `${label} `, control);
  }

  angle(label, low, high, get, set) {
    const [min, max] = [low, high].map((angle) => this.inUnit(angle));
    return this.number(`${label}, ${this.unit}`, { min, max, isNeeded: true }, () => this.inUnit(get()), (to) => set(this.ofUnit(to)));
  }

  // A field for a number. Unless the number is needed, an empty field has its default.
  number(label, { min, max, placeholder = "", isNeeded = false }, get, set) {
    const input = element("input", { type: "number", step: "any", min, max, placeholder });
    const parse = (text) => {
      const given = text === "" ? undefined : Number(text);
      const isIn = given === undefined ? !isNeeded && input.validity.valid : given >= min && given <= max;
      if (isIn) set(given);
      return isIn;
    };
    return this.bind(label, input, () => get() ?? "", parse, `a number from ${min} to ${max}`);
  }

  bind(label, input, get, set, allowed) {
    input.setAttribute("form", NO_FORM);
    input.addEventListener("input", () => {
      const isRight = set(input.value.trim());
      input.setAttribute("aria-invalid", !isRight);
      // The message about this field stays until a value is right.
      this.isRefused = !isRight;
      if (!isRight) return this.tell(`${label} must be ${allowed}.`, true);
      this.tell("");
      this.drawing.fit();
      this.drawing.draw();
      this.changed();
    });
    // A value that was not taken gives way to the value of the robot.
    input.addEventListener("change", () => {
      input.removeAttribute("aria-invalid");
      input.value = get();
    });
    this.bound.push({ control: input, get });
    return element("label", {}, `${label} `, input);
  }

  // Whether a controller of the robot of the page fits the robot of the text.
  get isSame() {
    return Boolean(this.described) && genes(this.described) === genes(this.own) && !this.fields.inert;
  }

  // Whether the text gives another number of robots than the page's own text. The number of the text then counts.
  get isRecounted() {
    return Boolean(this.described) && this.described.agents !== this.own.agents;
  }

  // Why the controller of the page Play cannot be used with the robot of the text; empty if it can be used.
  async problem() {
    if (this.known !== this.text.value) await this.read();
    if (this.known !== this.text.value) return "The robot in the editor could not be read. Try again.";
    if (this.fields.inert) return "The robot in the editor has an error: correct it first.";
    if (this.isSame) return "";
    return "The robot in the editor has changed, and this controller does not fit it. Press “Use this robot”, set its controller, and try again.";
  }

  // The page Play keeps its seed, and its controller as long as the controller fits the robot.
  keep(form) {
    const given = new URLSearchParams(location.search);
    const kept = ["seed", ...(this.isSame ? ["genes"] : []), ...(this.isSame && !this.isRecounted ? ["robots"] : [])];
    for (const name of kept) {
      if (given.has(name)) form.append(element("input", { type: "hidden", name, value: given.get(name) }));
    }
  }
}

let editor = null;

// The text of the editor's robot if a person has changed it since the page was loaded, or else null; whether the text gives another
// number of robots; and why the controller of the page cannot be used with this robot, empty if it can be used.
export async function edited() {
  if (editor === null || editor.text.value === editor.text.defaultValue) return { robot: null, isRecounted: false, problem: "" };
  const problem = await editor.problem();
  return { robot: editor.text.value, isRecounted: editor.isRecounted, problem };
}

const root = document.getElementById("robot-editor");
if (root) {
  const text = document.getElementById("robot");
  editor = new Editor(root, text);
  const fold = root.closest("details");
  const begin = () => {
    if (!fold.open || editor.described) return;
    root.hidden = false;
    editor.read();
  };
  fold.addEventListener("toggle", begin);
  begin();
  if (location.hash === "#robot-editor") fold.open = true;
  if (text.form.id !== "new") text.form.addEventListener("submit", () => editor.keep(text.form));
}
