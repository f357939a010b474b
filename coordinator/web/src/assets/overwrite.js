// Asks a person before an answer replaces earlier answers.
import { grouped, shown } from "./words.js";

const dialog = document.getElementById("overwrite");

// Asks whether to change the class of individuals that have another class. Returns the individuals that should get the class
// `text`. `known` has the classes, and the place of each individual's class.
export async function agreed(known, indices, text) {
  const other = (i) => known.of.has(i) && known.classes[known.of.get(i)].name !== text;
  const others = indices.filter(other);
  if (others.length === 0) return indices;
  const rest = indices.length - others.length;
  dialog.querySelector("p").textContent = `${already(known, indices, others)} “${shown(text)}” would replace it.`;
  dialog.querySelector("[value=all]").textContent = indices.length === 1 ? "Replace it" : `Name all ${grouped(indices.length)}`;
  dialog.querySelector("[value=rest]").textContent = `Name only the other ${grouped(rest)}`;
  dialog.querySelector("[value=rest]").hidden = rest === 0;
  dialog.returnValue = "";
  dialog.showModal();
  await new Promise((resolve) => dialog.addEventListener("close", resolve, { once: true }));
  if (dialog.returnValue === "all") return indices;
  return dialog.returnValue === "rest" ? indices.filter((i) => !other(i)) : [];
}

// The current classes of individuals that an answer would change, in words.
function already(known, indices, others) {
  if (indices.length > 1) return `${grouped(others.length)} of the ${grouped(indices.length)} selected have another class already.`;
  const { name } = known.classes[known.of.get(indices[0])];
  return `Individual ${grouped(indices[0])} has the class “${shown(name)}” already.`;
}
