// Parts of the page that follow the coordinator: an element with data-live names where its content comes from.
"use strict";
for (const part of document.querySelectorAll("[data-live]")) {
  const events = new EventSource(part.dataset.live);
  events.onmessage = (message) => {
    const focused = part.contains(document.activeElement) ? document.activeElement.id : "";
    part.innerHTML = message.data;
    if (focused) document.getElementById(focused)?.focus();
    document.body.classList.remove("stale");
  };
  // The browser connects again by itself; until then the page says that it stands still.
  events.onerror = () => document.body.classList.add("stale");
}
