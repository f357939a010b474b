// Events that the coordinator sends to a page, and the notice at the top of the page while none can be received.

const SILENCE = "The coordinator is not responding. This page continues when it is back.";
const CROWD = "Too many pages are open on this coordinator. This page updates again once another one is closed.";
const AGAIN_MS = 3000;

const note = document.querySelector(".stale-note");
const amiss = { silence: "", kept: "" };

function say(part, text) {
  if (amiss[part] === text) return;
  amiss[part] = text;
  note.textContent = Object.values(amiss).filter(Boolean).join(" ");
  note.hidden = note.textContent === "";
}

// Whether the coordinator was heard when it was last asked or listened to.
export const heard = (is) => say("silence", is ? "" : SILENCE);

// What the browser keeps of what was said here, and why; nothing where all of it was acknowledged.
export const keeping = (text) => say("kept", text);

// Hands every message of a stream of events to `told`, and connects again until the function that it returns is called.
export function listen(url, told) {
  let events;
  let ended = false;
  const connect = () => {
    if (ended) return;
    events = new EventSource(url);
    events.onmessage = (message) => {
      heard(true);
      told(message.data);
    };
    events.onerror = async () => {
      // A lost connection is made again by the browser; one that was refused is not.
      if (events.readyState !== EventSource.CLOSED) return heard(false);
      await refused();
      setTimeout(connect, AGAIN_MS);
    };
  };
  connect();
  return () => {
    ended = true;
    events.close();
  };
}

// Whose session is over is led to the log-in, as by any page; else there is no room.
async function refused() {
  const request = { redirect: "manual", headers: { accept: "text/html" } };
  const page = await fetch(location.pathname, request).catch(() => null);
  // What the page shows was deleted: the page says so then.
  if (page?.type === "opaqueredirect" || page?.status === 404) location.reload();
  say("silence", page ? CROWD : SILENCE);
}
