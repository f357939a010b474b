// Parts of the page that follow the coordinator: an element with data-live names where its content comes from.
import { listen } from "./events.js";

for (const part of document.querySelectorAll("[data-live]")) {
  listen(part.dataset.live, (content) => {
    const focused = part.contains(document.activeElement) ? document.activeElement.id : "";
    part.innerHTML = content;
    if (focused) document.getElementById(focused)?.focus();
  });
}
