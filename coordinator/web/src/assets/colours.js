// The colours of a map's points, and their legend.
import { grouped, shown } from "./words.js";

// The filter's value for individuals without a class; no class has this name.
export const NAMELESS_CLASS = "";
const NAMELESS = { light: 0xa5a39b, dark: 0x6d6e68 };
// Three colours from early to late, which also differ in lightness.
const SHADES = { light: [0xd9b51f, 0x2f8f83, 0x33337f], dark: [0x3f5f9e, 0x3fa58c, 0xf0dc5a] };

const number = (colour) => parseInt(colour.slice(1), 16);
const text = (colour) => `#${colour.toString(16).padStart(6, "0")}`;

// In the result, `of(i)` is the colour of a point, and `entries` has the entries of the legend: colour, words, number of
// individuals, and the filter's value.
export function colouring(kind, points, known, isDark) {
  const nameless = isDark ? NAMELESS.dark : NAMELESS.light;
  if (kind === "cluster") return byCluster(points, nameless);
  if (kind === "generation") return byGeneration(points, isDark);
  if (kind === "robustness") return byRobustness(points, nameless, isDark);
  return byClass(points, known, nameless);
}

function byCluster(points, nameless) {
  const colours = points.clusterColours.map(number);
  const named = (i) => (points.clusterNames[i] ? `cluster ${i + 1}: ${points.clusterNames[i]}` : `cluster ${i + 1}`);
  const entries = points.clusterColours.map((colour, i) => [colour, named(i), points.sizes[i], i]);
  return { of: (i) => colours[points.cluster[i]] ?? nameless, entries };
}

function byGeneration(points, isDark) {
  const last = Math.max(Math.ceil(points.count / points.population) - 1, 1);
  const of = (i) => shade(Math.floor(i / points.population) / last, isDark);
  const mark = (part) => [text(shade(part, isDark)), `generation ${grouped(Math.round(part * last))}`];
  return { of, entries: [0, 0.5, 1].map(mark) };
}

function byRobustness(points, nameless, isDark) {
  const of = (i) => (i < points.robust.length ? shade(points.robust[i] / points.starts, isDark) : nameless);
  const counts = Array.from({ length: points.starts + 1 }, () => 0);
  for (const robust of points.robust) counts[robust]++;
  const mark = (count, robust) => [
    text(shade(robust / points.starts, isDark)),
    `${robust} of ${points.starts} trials nearest to the individual's medoid`,
    count,
    robust,
  ];
  return { of, entries: counts.map(mark) };
}

function byClass(points, known, nameless) {
  const colours = known.classes.map(({ colour }) => number(colour));
  const entries = known.classes
    .map(({ colour, name }, place) => [colour, shown(name), individualsOf(known, place), name])
    .filter(([, , of]) => of);
  entries.push([text(nameless), "unnamed", points.count - known.of.size, NAMELESS_CLASS]);
  return { of: (i) => (known.of.has(i) ? colours[known.of.get(i)] : nameless), entries };
}

// The number of individuals of a class in words, with the number of those that only the rule-based judge named; null if the class
// has no individuals.
function individualsOf(known, place) {
  const all = [...known.of].filter(([, of]) => of === place).map(([index]) => index);
  const machine = all.filter((index) => known.machine.has(index)).length;
  if (all.length === 0) return null;
  if (machine === 0) return grouped(all.length);
  if (machine === all.length) return `${grouped(all.length)}, by the judge alone`;
  return `${grouped(all.length)}, ${grouped(machine)} by the judge alone`;
}

function shade(part, isDark) {
  const stops = isDark ? SHADES.dark : SHADES.light;
  const first = part < 0.5 ? 0 : 1;
  const [from, to] = [stops[first], stops[first + 1]];
  const way = 2 * part - first;
  const mix = (shift) => Math.round(((from >> shift) & 255) * (1 - way) + ((to >> shift) & 255) * way) << shift;
  return mix(16) | mix(8) | mix(0);
}

// An entry of the legend, as an item of a list. The entry's button hides a value and shows it again.
export function legendEntry([colour, name, count, value], hidden) {
  const item = document.createElement("li");
  const mark = document.createElement("span");
  mark.className = "mark";
  mark.style.setProperty("--class", colour);
  const words = count === undefined ? name : `${name} · ${typeof count === "number" ? grouped(count) : count}`;
  if (value === undefined) {
    item.append(mark, words);
    return item;
  }
  const button = document.createElement("button");
  button.type = "button";
  button.dataset.value = value;
  button.setAttribute("aria-pressed", String(!hidden.has(value)));
  button.append(mark, words);
  item.append(button);
  return item;
}
