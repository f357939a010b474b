// Requests to the coordinator, and their errors.
import { base } from "./base.js";
import { heard, listen } from "./events.js";

// The coordinator refused the request: a retry would not help.
export class Refused extends Error {}
// The coordinator did not respond, or cannot respond now: a retry can help.
export class Unavailable extends Error {}
// The coordinator did not respond at all.
export class Silent extends Unavailable {}

// The response to a request; throws an error if the coordinator refused the request or did not respond.
export async function reply(request) {
  const response = await received(request);
  heard(true);
  if (response.ok) return response;
  const why = await received(response.text());
  // The session has ended. This browser keeps unsent answers until the next log-in.
  if (response.status === 401) location.assign(`${base}/login?to=${encodeURIComponent(location.pathname + location.search)}`);
  // A different log-in can have the needed role, so that a retry can help.
  if (response.status >= 500 || [401, 403, 429].includes(response.status)) throw new Unavailable(why);
  throw new Refused(why);
}

// Waits for a response or for its body; the connection can end during both.
async function received(arriving) {
  try {
    return await arriving;
  } catch (error) {
    // An `AbortError` means that the caller cancelled the request.
    if (error.name === "AbortError") throw error;
    heard(false);
    throw new Silent("the coordinator is not responding");
  }
}

async function answer(request) {
  const response = await reply(request);
  return response.status === 202 ? null : received(response.json());
}

const { campaign, created } = document.querySelector("main").dataset;

// Prefix for this campaign's keys in the browser's storage. Another campaign with the same id has another prefix.
export const keptAs = `murmuration.${campaign}@${created}`;

export const path = (rest) => `${base}/campaigns/${campaign}/${rest}`;

// The address of a picture or motion of an individual, which never changes. No other campaign has the same address.
export const archived = (rest) => `individuals/${rest}?created=${created}`;

export const get = (rest) => answer(fetch(path(rest)));

export const post = (rest, body) =>
  answer(
    fetch(path(rest), {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(body),
    }),
  );

export const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// Retries a request until the coordinator responds. Calls `failed(error)` after each failure.
export async function insist(ask, failed = () => {}) {
  for (let wait = 300; ; wait = Math.min(wait * 2, 5000)) {
    try {
      return await ask();
    } catch (error) {
      if (!(error instanceof Unavailable)) throw error;
      failed(error);
    }
    await pause(wait);
  }
}

// Calls `changed` with the campaign's state, now and after every change. If another campaign has replaced this campaign
// meanwhile, the page reloads.
export const follow = (changed) =>
  listen(path("changes"), (message) => {
    const seen = JSON.parse(message);
    if (seen.created !== created) return location.reload();
    changed(seen);
  });
