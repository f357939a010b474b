// Requests to the coordinator, and the ways in which they fail.
import { heard, listen } from "./events.js";

// It said no: asking again would not help.
export class Refused extends Error {}
// It did not answer, or cannot now: asking again may help.
export class Unavailable extends Error {}
// Nothing was heard of it at all.
export class Silent extends Unavailable {}

// What it said to a request, if it did not say no.
export async function reply(request) {
  const response = await received(request);
  heard(true);
  if (response.ok) return response;
  const why = await received(response.text());
  // The session is over: what was said is kept here until somebody has logged in again.
  if (response.status === 401) location.assign(`/login?to=${encodeURIComponent(location.pathname + location.search)}`);
  // Somebody else who logs in may do what this one may not.
  if (response.status >= 500 || [401, 403, 429].includes(response.status)) throw new Unavailable(why);
  throw new Refused(why);
}

// A reply, or what it says, which may be cut off on the way.
async function received(arriving) {
  try {
    return await arriving;
  } catch (error) {
    // Nobody here waits for it any more.
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

// Names this campaign, and no other of the same id, in what the browser keeps.
export const keptAs = `murmuration.${campaign}@${created}`;

export const path = (rest) => `/campaigns/${campaign}/${rest}`;

// Where something of an individual is that never changes, under an address that no other campaign will have.
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

// Asks until there is an answer; `failed(error)` hears why there is none yet.
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

// Tells `changed` how the campaign stands, now and whenever that changes. While nobody saw the page, another campaign may have
// taken the place of this one.
export const follow = (changed) =>
  listen(path("changes"), (message) => {
    const seen = JSON.parse(message);
    if (seen.created !== created) return location.reload();
    changed(seen);
  });
