// Parts of the page that follow the coordinator: an element with data-live names where its content comes from. If it has places
// with data-slot, the content is theirs, and what is around them stays.
import "./ask.js";
import { listen } from "./events.js";

// By element, what ends its stream.
const streams = new Map();

// Has an element follow the address that it names now.
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

// Gives a place its content. It never becomes lower, so that what is below it stays where it is.
function fill(slot, { childNodes }) {
  const before = slot.offsetHeight;
  const fresh = slot.cloneNode(false);
  fresh.append(...childNodes);
  renew(slot, fresh);
  if (slot.offsetHeight < before) slot.style.minHeight = `${before}px`;
}

// Makes a node like another, and leaves alone what is the same: a button that is pressed meanwhile stays that button. A node
// never becomes one of another id or action: a click that began on Pause must not end on Resume.
function renew(old, fresh) {
  if (old.isEqualNode(fresh)) return;
  if (old.nodeType !== Node.ELEMENT_NODE || old.nodeName !== fresh.nodeName || isAnother(old, fresh)) {
    old.replaceWith(fresh);
    return;
  }
  for (const { name } of [...old.attributes]) if (!fresh.hasAttribute(name)) old.removeAttribute(name);
  for (const { name, value } of fresh.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  const [olds, news] = [[...old.childNodes], [...fresh.childNodes]];
  if (olds.length === news.length) olds.forEach((child, i) => renew(child, news[i]));
  else old.replaceChildren(...news);
}

function isAnother(old, fresh) {
  return ["id", "action"].some((name) => old.getAttribute(name) !== fresh.getAttribute(name));
}
