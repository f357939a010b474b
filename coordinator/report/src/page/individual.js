// An individual of the map: its picture, its data, and a panel that shows picture, data and the command that replays the
// individual.
const { archive, classes, grouped, pictures, simulator } = window.murmuration;
const TILELESS = 65535;
const panel = document.getElementById("chosen");
const genesEach = archive.genes.length / Math.max(archive.x.length, 1);

// Decoded sheets of pictures by number. A browser decodes a sheet when its first picture is needed.
const sheets = new Map();
function sheet(number) {
  if (!sheets.has(number)) {
    const image = new Image();
    image.src = `data:image/png;base64,${pictures.sheets[number]}`;
    sheets.set(number, image);
  }
  return sheets.get(number);
}

const cardOf = (i) => document.getElementById(`behaviour-${archive.cluster[i] + 1}`);
const isMedoid = (i) => archive.medoids[archive.cluster[i]] === i;
const hasOwnPicture = (i) => archive.tile[i] !== TILELESS || isMedoid(i);

// Draws the picture of an individual, or the picture of its medoid if the individual has no picture.
async function drawPicture(canvas, i) {
  canvas.dataset.of = i;
  const tile = archive.tile[i];
  const { side, columns, tiles } = pictures;
  const image = tile === TILELESS ? cardOf(i).querySelector("img.grey") : sheet(Math.floor(tile / tiles));
  const place = tile === TILELESS ? 0 : tile % tiles;
  await image.decode();
  // Another picture can have been requested for this canvas meanwhile.
  if (canvas.dataset.of !== String(i)) return;
  canvas.width = canvas.height = side;
  const at = [(place % columns) * side, Math.floor(place / columns) * side];
  canvas.getContext("2d").drawImage(image, ...at, side, side, 0, 0, side, side);
}

// The name of an individual's behaviour, if it has a name, with a remark if only the judge gave the name.
function named(i) {
  const name = classes[archive.class[i]];
  if (name === undefined) return "";
  return archive.machine[i] ? `${name} (by the rule-based judge)` : name;
}

const titleOf = (i) => `Individual ${grouped(archive.index[i])}`;
const whosePicture = (i) => (hasOwnPicture(i) ? "" : `It has no picture of its own here: this is that of its medoid, behaviour ${archive.cluster[i] + 1}.`);

// The genes of an individual as stored for the map, to four digits.
const rounded = (i) =>
  Array.from(archive.genes.subarray(i * genesEach, (i + 1) * genesEach), (gene) => Number((gene * archive.geneUnit).toFixed(4)));

function facts(i) {
  const known = [
    ["Behaviour", String(archive.cluster[i] + 1)],
    ["Class", named(i)],
    ["Novelty when evaluated", archive.novelty[i].toPrecision(4)],
    ["Generation", grouped(archive.generation[i])],
  ];
  if (archive.trials > 1) known.push(["Robustness", `${archive.robust[i]} of ${archive.trials}`]);
  return known.filter(([, value]) => value !== "");
}

// The exact genes of an individual, and the command that replays it; null if the page does not have the exact genes.
function replayOf(i) {
  const tile = archive.tile[i];
  if (tile !== TILELESS) {
    const genes = `[${Array.from(pictures.genes.subarray(tile * genesEach, (tile + 1) * genesEach)).join(", ")}]`;
    const file = `individual-${archive.index[i]}.gif`;
    return { genes, command: `${simulator} --controller "${genes}" --seed ${pictures.seeds[tile]} --gif ${file}` };
  }
  if (!isMedoid(i)) return null;
  const [genes, command] = Array.from(cardOf(i).querySelectorAll(".text > .copyable .line"), (line) => line.textContent);
  return { genes, command };
}

const element = (name, text) => {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
};

// Shows an individual enlarged, on the side of the map opposite to its point.
function openPanel(i, isLeft) {
  const replay = replayOf(i);
  panel.querySelector("h3").textContent = titleOf(i);
  panel.querySelector(".whose").textContent = whosePicture(i);
  panel.querySelector("dl").replaceChildren(
    ...facts(i).map(([name, value]) => {
      const row = document.createElement("div");
      const told = element("dd", "");
      if (name === "Behaviour") {
        const link = element("a", value);
        link.href = `#behaviour-${value}`;
        told.append(link);
      } else told.textContent = value;
      row.append(element("dt", name), told);
      return row;
    }),
  );
  const [genes, command] = panel.querySelectorAll(".line");
  genes.textContent = replay?.genes ?? `[${rounded(i).join(", ")}], rounded`;
  command.textContent = replay?.command ?? "";
  for (const part of [command.parentElement, command.parentElement.previousElementSibling]) part.hidden = !replay;
  panel.querySelector(".elsewhere").textContent = replay ? "" : "Its exact genes and its seed, with which it can be replayed, are in archive.csv.";
  panel.classList.toggle("left", !isLeft);
  panel.hidden = false;
  drawPicture(panel.querySelector("canvas"), i);
}
