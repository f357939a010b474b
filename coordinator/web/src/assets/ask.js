// Asks a person before a form starts something slow or irreversible. The form's data-ask is the question, a paragraph a line, in
// which lines that begin with "- " are a list; its data-yes is the label of the button that agrees.

// `true` means the capture phase: the listener runs before the form's own listeners.
document.addEventListener("submit", ask, true);

function ask(event) {
  const form = event.target;
  if (!form.dataset.ask || form.dataset.agreed) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  const button = event.submitter ?? form.querySelector("button");
  const dialog = dialogOf(form.dataset.ask, button, form.dataset.yes ?? button.textContent);
  dialog.addEventListener("close", () => {
    dialog.remove();
    const now = standing(form);
    if (dialog.returnValue !== "yes") return (button.isConnected ? button : now?.querySelector("button"))?.focus();
    if (!now) return tell("This is no longer possible: the page has changed meanwhile.");
    now.dataset.agreed = "yes";
    now.requestSubmit();
  });
  document.body.append(dialog);
  dialog.showModal();
}

// The form that is on the page now, because a page that follows the coordinator can have replaced the form.
function standing(form) {
  if (form.isConnected) return form;
  return [...document.forms].find((other) => other.getAttribute("action") === form.getAttribute("action"));
}

// Shows a message that people only have to read.
function tell(message) {
  const dialog = document.createElement("dialog");
  dialog.className = "ask";
  dialog.setAttribute("aria-labelledby", "told");
  const text = document.createElement("p");
  text.id = "told";
  text.textContent = message;
  const form = document.createElement("form");
  form.method = "dialog";
  const button = document.createElement("button");
  button.textContent = "Go back";
  form.append(button);
  dialog.append(text, form);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

function dialogOf(message, button, yesText) {
  const dialog = document.createElement("dialog");
  dialog.className = "ask";
  const question = document.createElement("div");
  question.id = "asked";
  question.append(...blocks(message));
  dialog.setAttribute("aria-labelledby", question.id);
  const form = document.createElement("form");
  form.method = "dialog";
  const [no, yes] = ["", "yes"].map((value) => {
    const way = document.createElement("button");
    way.value = value;
    return way;
  });
  no.className = "plain";
  no.textContent = "Go back";
  yes.className = button.className;
  yes.textContent = yesText;
  form.append(no, yes);
  dialog.append(question, form);
  return dialog;
}

function blocks(message) {
  const all = [];
  for (const line of message.split("\n")) {
    const item = line.startsWith("- ");
    const block = document.createElement(item ? "li" : "p");
    block.textContent = item ? line.slice(2) : line;
    if (!item) all.push(block);
    else if (all.at(-1)?.nodeName === "UL") all.at(-1).append(block);
    else {
      all.push(document.createElement("ul"));
      all.at(-1).append(block);
    }
  }
  return all;
}
