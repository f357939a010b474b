// Events that the coordinator sends to a page, and the notice at the bottom of the page while none can be received.

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

// Hands every message of a stream of events to `told`, and connects again until the function that it returns is called. A page
// that nobody sees has no stream: a browser keeps pages that were left, to go back to them, and without TLS it
// has six connections to a coordinator for all of its pages together.
export function listen(url, told) {
  const ending = new AbortController();
  let events = null;
  const connect = () => {
    if (events || document.hidden) return;
    const stream = new EventSource(url);
    events = stream;
    stream.onopen = () => heard(true);
    stream.onmessage = (message) => told(message.data);
    stream.onerror = async () => {
      // A lost connection is made again by the browser; one that was refused is not.
      if (stream.readyState !== EventSource.CLOSED) return heard(false);
      const page = await ask();
      // There may be a newer stream by now.
      if (events !== stream) return;
      refused(page);
      setTimeout(() => {
        if (events !== stream) return;
        events = null;
        connect();
      }, AGAIN_MS);
    };
  };
  const rest = () => {
    events?.close();
    events = null;
  };
  const { signal } = ending;
  document.addEventListener("visibilitychange", () => (document.hidden ? rest() : connect()), { signal });
  addEventListener("pagehide", rest, { signal });
  addEventListener("pageshow", connect, { signal });
  connect();
  return () => {
    ending.abort();
    rest();
  };
}

const ask = () => fetch(location.pathname, { redirect: "manual", headers: { accept: "text/html" } }).catch(() => null);

// Whose session is over is led to the log-in, as by any page; else there is no room.
function refused(page) {
  // What the page shows was deleted: the page says so then.
  if (page?.type === "opaqueredirect" || page?.status === 404) location.reload();
  say("silence", page ? CROWD : SILENCE);
}
