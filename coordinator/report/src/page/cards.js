// Plays the whole motion of a behaviour on its card.
//
// A card shows its picture ("still"), plays while it is pointed at or has the focus ("preview"), or was started or paused by its
// controls ("playing", "paused").
const { world, agentColours, runs, counted, Playback } = window.murmuration;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const playAll = document.getElementById("play-all");

class Card extends Playback {
  constructor(card) {
    const number = Number(card.dataset.place) + 1;
    super(card, { speed: document.getElementById("speed"), name: `behaviour ${number}` });
    this.card = card;
    // A card that is not in view plays without drawing.
    this.visible = false;
    this.load({ run: runs[number - 1], world, colours: agentColours });
    this.show("still");
  }

  get mode() {
    return this.card.dataset.mode;
  }

  show(mode) {
    this.card.dataset.mode = mode;
    if (mode === "still") this.step = 0;
    if (mode === "preview" || mode === "playing") super.play();
    else super.pause();
  }

  play() {
    this.show("playing");
  }

  pause() {
    this.show("paused");
  }

  tell() {
    super.tell();
    this.scrub.style.setProperty("--done", `${(100 * this.step) / Math.max(this.motion.run.last, 1)}%`);
  }

  place(step, last) {
    return this.mode === "still" ? counted(last, "step") : super.place(step, last);
  }

  draw() {
    if (this.visible && this.mode !== "still") super.draw();
  }
}

const cards = Array.from(document.querySelectorAll(".card"), (card) => new Card(card));
const cardOf = new Map(cards.map((card) => [card.card, card]));

const seen = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    const card = cardOf.get(target);
    card.visible = isIntersecting;
    card.draw();
  }
});

for (const card of cards) {
  const place = card.card;
  const preview = () => {
    if (card.mode === "still" && !calm.matches) card.show("preview");
  };
  const rest = () => {
    if (card.mode === "preview") card.show("still");
  };
  seen.observe(place);
  place.addEventListener("pointerenter", (event) => {
    if (event.pointerType === "mouse") preview();
  });
  place.addEventListener("pointerleave", rest);
  place.addEventListener("focusin", (event) => {
    if (event.target === place && place.matches(":focus-visible")) preview();
  });
  place.addEventListener("focusout", (event) => {
    if (!place.contains(event.relatedTarget)) rest();
  });
  place.addEventListener("keydown", (event) => {
    if (event.key === "Escape") card.show("still");
    if (event.key === " " && event.target === place) {
      event.preventDefault();
      card.toggle();
    }
  });
  place.querySelector(".stage").addEventListener("click", () => card.toggle());
}

playAll.addEventListener("click", () => {
  const start = playAll.getAttribute("aria-pressed") === "false";
  playAll.setAttribute("aria-pressed", String(start));
  playAll.textContent = start ? "Stop all" : "Play all";
  for (const card of cards) card.show(start ? "playing" : "still");
});
