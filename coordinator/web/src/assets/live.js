// Updates the parts of a page that follow the coordinator. An element's data-live is the address of its content. If the element
// has slots (data-slot), only the content of these slots changes.
import "./ask.js";
import { listen } from "./events.js";
import "./menu.js";

// Functions that end event streams, by the element that follows the stream.
const streams = new Map();

// Makes an element follow the address in its data-live.
export function attend(part) {
  streams.get(part)?.();
  streams.set(part, listen(part.dataset.live, (content) => {
    const focused = part.contains(document.activeElement) ? document.activeElement.id : "";
    const fresh = part.cloneNode(false);
    fresh.innerHTML = content;
    const slots = [...part.querySelectorAll("[data-slot]")];
    if (slots.length === 0) renew(part, fresh);
    for (const slot of slots) fill(slot, fresh.querySelector(`[data-slot="${slot.dataset.slot}"]`));
    if (focused && document.activeElement?.id !== focused) document.getElementById(focused)?.focus();
  }));
}

document.querySelectorAll("[data-live]").forEach(attend);

// Sets the content of a slot. A slot never shrinks, so that everything below it stays in place.
export function fill(slot, { childNodes }) {
  const before = slot.offsetHeight;
  const fresh = slot.cloneNode(false);
  fresh.append(...childNodes);
  renew(slot, fresh);
  if (slot.offsetHeight < before) slot.style.minHeight = `${before}px`;
}

// Updates a node to match a new node, and keeps equal parts, so that a button that a person presses stays the same button. If the
// new node has another id or action, it replaces the old node: a click that began on Pause must not end on Resume. Details that a
// person has opened stay open.
function renew(old, fresh) {
  if (old.isEqualNode(fresh)) return;
  if (old.nodeType !== Node.ELEMENT_NODE || old.nodeName !== fresh.nodeName || isAnother(old, fresh)) {
    old.replaceWith(fresh);
    return;
  }
  for (const { name } of [...old.attributes]) if (name !== "open" && !fresh.hasAttribute(name)) old.removeAttribute(name);
  for (const { name, value } of fresh.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  const [olds, news] = [[...old.childNodes], [...fresh.childNodes]];
  if (olds.length === news.length) olds.forEach((child, i) => renew(child, news[i]));
  else old.replaceChildren(...news);
}

function isAnother(old, fresh) {
  return ["id", "action"].some((name) => old.getAttribute(name) !== fresh.getAttribute(name));
}
