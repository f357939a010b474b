// Asks before a form does what takes long or cannot be undone: its data-ask says what that is, its data-yes what agrees.

// In the capture phase: before the listeners of the form itself.
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

// The form that a person was asked about, as it is on the page now: a page that follows the coordinator may have replaced it.
function standing(form) {
  if (form.isConnected) return form;
  return [...document.forms].find((other) => other.getAttribute("action") === form.getAttribute("action"));
}

// Says something that needs no decision.
function tell(said) {
  const dialog = document.createElement("dialog");
  dialog.className = "ask";
  dialog.setAttribute("aria-labelledby", "told");
  const text = document.createElement("p");
  text.id = "told";
  text.textContent = said;
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

function dialogOf(said, button, yesText) {
  const dialog = document.createElement("dialog");
  dialog.className = "ask";
  const text = document.createElement("p");
  text.id = "asked";
  text.textContent = said;
  dialog.setAttribute("aria-labelledby", text.id);
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
  dialog.append(text, form);
  return dialog;
}
