// "What is this like?" on the page Play: the individuals of a campaign nearest to the swarm.
import { base } from "./base.js";
import { reply } from "./coordinator.js";
import { sentence } from "./words.js";

const at = (id) => document.getElementById(id);

export class Comparison {
  // `query` is a function that returns the state of the controls.
  constructor(query) {
    this.query = query;
    this.asked = null;
    this.campaign = at("campaign");
    at("ask")?.addEventListener("click", () => this.ask());
    this.campaign?.addEventListener("change", () => this.forget());
  }

  // Clears the results, because they belong to an earlier controller.
  forget() {
    this.asked?.abort();
    this.asked = null;
    this.tell("");
    at("likes")?.replaceChildren();
  }

  tell(text, isWrong = false) {
    const told = at("compared");
    if (!told) return;
    told.textContent = text;
    told.classList.toggle("wrong", isWrong);
  }

  async ask() {
    if (!this.campaign) return;
    this.forget();
    const asked = new AbortController();
    this.asked = asked;
    this.tell("A worker simulates this swarm.");
    const body = new URLSearchParams(this.query());
    body.set("campaign", this.campaign.value);
    try {
      const answer = await reply(fetch(`${base}/play/like`, { method: "POST", body, signal: asked.signal }));
      const found = await answer.text();
      if (this.asked !== asked) return;
      this.tell("");
      at("likes").innerHTML = found;
      for (const canvas of at("likes").querySelectorAll("canvas")) paint(canvas);
    } catch (error) {
      if (this.asked === asked) this.tell(sentence(error.message), true);
    }
  }
}

// Paints the picture of a swarm from the red, green and blue of each pixel, row by row.
function paint(canvas) {
  const pixels = atob(canvas.dataset.image);
  const pen = canvas.getContext("2d");
  const picture = pen.createImageData(canvas.width, canvas.height);
  for (let at = 0; 3 * at < pixels.length; at++) {
    for (let part = 0; part < 3; part++) picture.data[4 * at + part] = pixels.charCodeAt(3 * at + part);
    picture.data[4 * at + 3] = 255;
  }
  pen.putImageData(picture, 0, 0);
}
