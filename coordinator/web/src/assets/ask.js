// Asks a person before a form starts something slow or irreversible. The form's data-ask is the question, its data-yes the label
// of the button that agrees.

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
  const text = document.createElement("p");
  text.id = "asked";
  text.textContent = message;
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
