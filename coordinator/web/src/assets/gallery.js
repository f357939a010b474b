// The pictures of the selected individuals, which people look at before they name the individuals.
import { archived, path } from "./coordinator.js";
import { grouped } from "./words.js";

// Maximum number of pictures: people can look at 60 pictures in a few seconds.
const MOST = 60;

export class Gallery {
  // `play(index)` plays the motion of an individual, and `drop(index)` deselects an individual.
  constructor(root, line, { play, drop }) {
    this.root = root;
    this.line = line;
    this.shown = "";
    root.addEventListener("click", (event) => {
      const index = Number(event.target.closest(".card")?.dataset.index ?? NaN);
      if (Number.isNaN(index)) return;
      if (event.shiftKey) drop(index);
      else play(index);
    });
    root.addEventListener("keydown", (event) => {
      if (event.key !== "Delete" && event.key !== "Backspace") return;
      const card = event.target.closest(".card");
      const next = (card.nextElementSibling ?? card.previousElementSibling)?.dataset.index;
      event.preventDefault();
      drop(Number(card.dataset.index));
      root.querySelector(`[data-index="${next}"]`)?.focus();
    });
  }

  // Shows the pictures of individuals, or of an even sample if there are too many.
  show(indices, nameOf) {
    const every = Math.max(indices.length / MOST, 1);
    const shown = Array.from({ length: Math.min(indices.length, MOST) }, (_, i) => indices[Math.floor(i * every)]);
    this.root.hidden = shown.length === 0;
    this.line.hidden = shown.length === 0;
    const part = shown.length < indices.length ? `${grouped(shown.length)} of ${grouped(indices.length)} are shown, evenly chosen. ` : "";
    this.line.textContent = `${part}Click a picture to play its motion; Shift and a click, or Delete, take it out of the selection.`;
    const cards = shown.map((index) => [index, nameOf(index)]);
    // Unchanged cards stay on the page, so that a card keeps the focus.
    if (this.shown === JSON.stringify(cards)) return;
    this.shown = JSON.stringify(cards);
    const focused = document.activeElement?.closest(".card")?.dataset.index;
    this.root.replaceChildren(...cards.map(([index, name]) => card(index, name)));
    if (focused !== undefined) this.root.querySelector(`[data-index="${focused}"]`)?.focus();
  }
}

function card(index, name) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "card";
  button.dataset.index = index;
  button.title = `${grouped(index)} · ${name}`;
  const picture = document.createElement("img");
  picture.loading = "lazy";
  picture.src = path(archived(index));
  picture.alt = `Individual ${grouped(index)}, ${name}`;
  button.append(picture);
  return button;
}
