// The text (TOML) of robots, and what a sensor is in numbers.
const SENSOR = ["angle", "angle_range", "angles", "half_angle", "range", "wall_range", "sees"];
const ROBOT = ["radius", "drive", "max_speed", "max_turn", "wheel_radius", "sensors"];
const SPECIES = ["name", "count", "share"];

function value(given) {
  if (Array.isArray(given)) return `[${given.map(value).join(", ")}]`;
  if (typeof given === "string") return JSON.stringify(given);
  if (typeof given !== "object") return String(given);
  const fields = inOrder(given, SENSOR).map(([name, of]) => `${name} = ${value(of)}`);
  return fields.length > 0 ? `{ ${fields.join(", ")} }` : "{}";
}

// The fields of a table, the known ones first.
function inOrder(table, known) {
  const names = [...known.filter((name) => name in table), ...Object.keys(table).filter((name) => !known.includes(name))];
  return names.map((name) => [name, table[name]]);
}

function lines(table, known, before = "") {
  return inOrder(table, known).map(([name, given]) => {
    if (name !== "sensors") return `${before}${name} = ${value(given)}`;
    return `${before}sensors = [\n${given.map((sensor) => `  ${value(sensor)},\n`).join("")}]`;
  });
}

const shown = ({ species, robot }) =>
  species
    ? ["[[species]]", ...lines(species, SPECIES), ...lines(robot, ROBOT, "robot.")].join("\n")
    : ["[robot]", ...lines(robot, ROBOT)].join("\n");

// A copy of what the coordinator sent about robots. Of robots, it sends only the fields that their text has.
export function copied(given) {
  if (Array.isArray(given)) return given.map(copied);
  if (typeof given !== "object" || given === null) return given;
  return Object.fromEntries(Object.entries(given).map(([name, of]) => [name, copied(of)]));
}

// The text of a description; the parts that the editor does not show stay as they were.
export function toml({ head, before, after, robots }) {
  const parts = [before, ...robots.map(shown), after].map((part) => part.trimEnd());
  return `${head}${parts.filter(Boolean).join("\n\n")}\n`;
}

// An angle with few digits, for a text that people read. Rounded up, half of a turn or a whole one would exceed its limit.
export function radians(angle) {
  const limit = [Math.PI, 2 * Math.PI].find((limit) => Math.abs(Math.abs(angle) - limit) < 5e-5);
  return limit ? Math.sign(angle) * limit : Number(angle.toFixed(4));
}

// Sets a field, or removes it if it has its default.
export function put(table, name, given, usual) {
  if (given === undefined || given === usual) delete table[name];
  else table[name] = given;
}

export const kind = (sensor) => (sensor.angle !== "free" ? "fixed" : sensor.angles ? "list" : "range");

export function middle(sensor) {
  if (kind(sensor) === "fixed") return sensor.angle ?? 0;
  if (kind(sensor) === "list") return sensor.angles[0];
  const [low, high] = sensor.angle_range;
  return (low + high) / 2;
}

// Turns a sensor, so that its middle points to an angle. All angles of a free sensor turn with it.
export function turn(sensor, to) {
  const by = to - middle(sensor);
  const turned = (angles) => {
    const all = angles.map((angle) => radians(angle + by));
    return all.every((angle) => Math.abs(angle) <= 2 * Math.PI) ? all : angles;
  };
  if (kind(sensor) === "fixed") put(sensor, "angle", radians(to), 0);
  else if (kind(sensor) === "list") sensor.angles = turned(sensor.angles);
  else sensor.angle_range = turned(sensor.angle_range);
}

export const sees = (sensor) => [sensor.sees ?? ["robots"]].flat();

// The field with the range that the drawing shows: walls can have a range of their own.
export function rangeField(sensor) {
  const isOnlyWalls = sees(sensor).every((seen) => seen === "walls");
  return isOnlyWalls && sensor.wall_range !== undefined ? "wall_range" : "range";
}
