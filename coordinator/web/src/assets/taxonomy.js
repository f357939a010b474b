// Plays the medoids and has them named.
import { introduced, session } from "./annotator.js";
import { follow } from "./coordinator.js";
import { Outbox, complain } from "./outbox.js";
import { Player } from "./player.js";

const status = document.getElementById("status");
const calm = matchMedia("(prefers-reduced-motion: reduce)");

for (const card of document.querySelectorAll(".medoid")) {
  const stage = card.querySelector(".stage");
  const player = new Player(card);
  const play = async () => {
    await player.show(Number(card.dataset.index));
    // The pointer may have gone on.
    if (player.index !== null) stage.classList.add("moving");
  };
  const rest = () => {
    player.stop();
    stage.classList.remove("moving");
  };
  const turn = () => {
    if (!stage.classList.contains("moving")) play();
    else if (player.playing) player.toggle();
    else player.play();
  };
  stage.addEventListener("pointerenter", (event) => {
    if (event.pointerType === "mouse" && !calm.matches) play();
  });
  stage.addEventListener("pointerleave", rest);
  stage.addEventListener("blur", rest);
  stage.addEventListener("click", turn);
  stage.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    turn();
  });
}

let begun = null;
follow((seen) => {
  const stands = `${seen.archive_version} ${seen.individuals} ${seen.completed}`;
  if (begun !== null && begun !== stands) location.reload();
  begun = stands;
});

if (status) {
  await introduced();
  const outbox = new Outbox(await session(), {
    told() {},
    refused: (_, error) => complain(status, error),
    changed: (outbox) => outbox.tell(status),
  });
  for (const form of document.querySelectorAll(".medoid form")) {
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const answer = form.elements.name.value.trim();
      if (!answer) return;
      outbox.answer([Number(form.dataset.index)], answer);
      form.elements.name.blur();
    });
  }
}
