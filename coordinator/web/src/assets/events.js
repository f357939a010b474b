// Events from the coordinator, and the notice at the bottom of a page that cannot receive events.

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

// Shows or hides the notice, depending on whether the coordinator responded to the last request.
export const heard = (is) => say("silence", is ? "" : SILENCE);

// Shows a text about answers that the browser keeps; an empty text means that all answers are acknowledged.
export const keeping = (text) => say("kept", text);

// Passes every message of an event stream to `told`, and reconnects until the returned function is called. A hidden page has no
// stream. Browsers keep pages that people have left, and without TLS all pages of a coordinator share six connections.
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
      // Browsers reconnect a stream that broke off, but not a stream that the coordinator refused.
      if (stream.readyState !== EventSource.CLOSED) return heard(false);
      const page = await ask();
      // A newer stream can have replaced this stream meanwhile.
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

// Reacts to a refused stream. A page without a session reloads, which leads to the log-in. In other cases, the coordinator has no
// room for the stream or does not respond.
function refused(page) {
  // If the campaign or study of the page was deleted, the reloaded page says so.
  if (page?.type === "opaqueredirect" || page?.status === 404) location.reload();
  say("silence", page ? CROWD : SILENCE);
}
