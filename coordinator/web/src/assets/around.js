// "Controllers around this one" on the page Play: the coordinator simulates them when a person opens this part.
import { base } from "./base.js";
import { insist, reply } from "./coordinator.js";
import { sentence } from "./words.js";

export class Around {
  // `query` is a function that returns the state of the controls.
  constructor(root, query) {
    this.root = root;
    this.query = query;
    this.asked = null;
    this.told = root.querySelector("[role=status]");
    this.found = root.querySelector(".found-around");
    root.addEventListener("toggle", () => (root.open ? this.ask() : this.forget()));
  }

  // The controls select another swarm.
  settled() {
    if (this.root.open) this.ask();
  }

  forget() {
    this.asked?.abort();
    this.asked = null;
    this.found.replaceChildren();
    this.tell("");
  }

  tell(text, isWrong = false) {
    this.told.textContent = text;
    this.told.classList.toggle("wrong", isWrong);
  }

  async ask() {
    this.asked?.abort();
    const asked = new AbortController();
    this.asked = asked;
    this.tell("The coordinator simulates these controllers.");
    const body = new URLSearchParams(this.query());
    const ask = () => {
      asked.signal.throwIfAborted();
      return reply(fetch(`${base}/play/around`, { method: "POST", body, signal: asked.signal })).then((answer) => answer.text());
    };
    try {
      const found = await insist(ask, (error) => this.asked === asked && this.tell(sentence(error.message)));
      if (this.asked !== asked) return;
      this.tell("");
      this.found.innerHTML = found;
    } catch (error) {
      if (this.asked !== asked) return;
      this.found.replaceChildren();
      this.tell(sentence(error.message), true);
    }
  }
}
