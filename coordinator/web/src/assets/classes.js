// The Classes page: people rename, merge, colour and delete classes, and give keys to classes. A dialog first explains each
// change.
import { annotator, introduced, random } from "./annotator.js";
import { archived, follow, get, insist, path, post } from "./coordinator.js";
import { chosenFor } from "./keys.js";
import { complain } from "./outbox.js";
import { counted, grouped, shown } from "./words.js";

const at = (id) => document.getElementById(id);
const status = at("status");
const dialog = at("change");
const list = at("list");
const fieldName = at("field-name");
let classes = [];
// The displayed state as text. If a new state is equal, the page stays untouched, so that nothing changes under a pointer.
let last = "";

// The actions on a class. An action has the label of its button, the dialog's title and field, the change, and the effects of the
// change.
const ACTS = {
  rename: {
    button: "Rename",
    title: ({ name }) => `Rename “${shown(name)}”`,
    field: ({ name }) => [text(shown(name)), "New name"],
    yes: "Rename",
    effect: (of, to) => {
      const other = classes.find((one) => one !== of && shown(one.name).toLowerCase() === to.trim().toLowerCase());
      if (other) return `There is a class “${shown(other.name)}” already: merge the two instead.`;
      return `${answersOf(of)} will be called “${to.trim() || "…"}”.`;
    },
    change: ({ name }, to) => ({ rename: { class: name, to: to.trim() } }),
  },
  merge: {
    button: "Merge",
    title: ({ name }) => `Merge “${shown(name)}” into another class`,
    field: (of) => [menu(classes.filter((one) => one !== of).map(({ name }) => [name, shown(name)])), "Merge into"],
    yes: "Merge",
    effect: (of, into) => {
      const other = classes.find(({ name }) => name === into);
      if (!other) return "There is no other class.";
      return `${answersOf(of)} will be called “${shown(into)}”, like the ${counted(other.labels, "answer")} of that class.`;
    },
    change: ({ name }, into) => ({ merge: { class: name, into } }),
  },
  colour: {
    button: "Colour",
    title: ({ name }) => `Colour of “${shown(name)}”`,
    field: ({ colour }) => [colourField(colour), "Colour"],
    yes: "Change the colour",
    effect: (of) => `“${shown(of.name)}” gets this colour on every page and in the report. No answer changes.`,
    change: ({ name }, colour) => ({ colour: { class: name, colour } }),
  },
  shortcut: {
    button: "Key",
    title: ({ name }) => `Key of “${shown(name)}”`,
    field: ({ shortcut }) => {
      const keys = [...list.dataset.keys].map((key) => [key, key]);
      const field = menu([["", "the first free key"], ...keys]);
      field.value = shortcut ?? "";
      return [field, "Key"];
    },
    yes: "Change the key",
    effect: (of, key) => {
      const other = key && classes.find((one) => one !== of && one.shortcut === key);
      const loses = other ? ` “${shown(other.name)}”, which has the key now, gets another.` : "";
      return key
        ? `The key ${key} will name “${shown(of.name)}” for everybody.${loses}${ownUse(key)} No answer changes.`
        : `“${shown(of.name)}” gets the first key that is free. No answer changes.`;
    },
    change: ({ name }, shortcut) => ({ shortcut: { class: name, shortcut } }),
  },
  delete: {
    button: "Delete",
    title: ({ name }) => `Delete “${shown(name)}”?`,
    field: () => [null, ""],
    yes: "Delete",
    effect: (of) =>
      of.labels === 0
        ? "No answer names this class."
        : `${answersOf(of)} will no longer count, and these behaviours are asked about again. The answers come back if the ` +
          "deletion is undone.",
    change: ({ name }) => ({ delete: { class: name } }),
  },
};

// A sentence about the action that a person chose this key for in this browser; empty if there is none.
function ownUse(key) {
  const what = chosenFor(key);
  return what ? ` In this browser you chose the key for something else (${what}), and the key will no longer do that.` : "";
}

// The number of answers that a change affects, and the annotators of these answers, in words.
function answersOf({ labels, people }) {
  if (labels === 0) return "No answer names this class yet. Later answers";
  const names = people.length > 3 ? `${counted(people.length, "annotator")}` : people.join(", ");
  return `${counted(labels, "answer")} (by ${names})`;
}

function text(value) {
  const field = document.createElement("input");
  field.name = "value";
  field.maxLength = 64;
  field.required = true;
  field.autocomplete = "off";
  field.value = value;
  return field;
}

function colourField(value) {
  const field = document.createElement("input");
  field.type = "color";
  field.value = value;
  return field;
}

function menu(entries) {
  const field = document.createElement("select");
  field.append(...entries.map(([value, name]) => new Option(name, value)));
  return field;
}

// Asks a person to confirm an action on a class, and then applies the action.
async function ask(act, of) {
  const [field, name] = act.field(of);
  at("change-title").textContent = act.title(of);
  const label = dialog.querySelector(".field");
  label.hidden = field === null;
  fieldName.textContent = name;
  label.replaceChildren(fieldName, ...(field ? [field] : []));
  const agree = at("agree");
  agree.textContent = act.yes;
  agree.className = act === ACTS.delete ? "danger" : "";
  const value = () => field?.value ?? "";
  const tell = () => {
    at("effect").textContent = act.effect(of, value());
    agree.disabled = field instanceof HTMLSelectElement && field.length === 0;
  };
  field?.addEventListener("input", tell);
  tell();
  dialog.returnValue = "";
  dialog.showModal();
  field?.select?.();
  await new Promise((resolve) => dialog.addEventListener("close", resolve, { once: true }));
  if (dialog.returnValue === "yes") await change(act.change(of, value()));
}

// Sends a change, with retries until the coordinator acknowledges it.
async function change(what) {
  const body = { request_id: random(), annotator: annotator(), change: what };
  status.classList.remove("wrong");
  status.textContent = "Saving…";
  try {
    const waits = (error) => (status.textContent = `Not saved yet: ${error.message}.`);
    show(await insist(() => post("classes", body), waits));
    status.textContent = "Saved.";
  } catch (error) {
    complain(status, error);
  }
}

function show(told) {
  if (JSON.stringify(told) === last) return;
  last = JSON.stringify(told);
  classes = told.classes;
  const focused = list.contains(document.activeElement) ? document.activeElement.dataset.act : null;
  list.replaceChildren(...classes.map(row));
  if (focused) list.querySelector(`[data-act="${CSS.escape(focused)}"]`)?.focus();
  document.querySelector(".empty").hidden = classes.length > 0;
  at("history").hidden = told.changes.length === 0;
  at("changes").replaceChildren(...told.changes.map(past));
}

function row(of) {
  const item = document.createElement("li");
  item.className = "class-row";
  item.style.setProperty("--class", of.colour);
  const head = document.createElement("div");
  const name = document.createElement("h2");
  name.textContent = shown(of.name);
  if (of.shortcut) {
    const key = document.createElement("kbd");
    key.textContent = of.shortcut;
    name.append(" ", key);
  }
  const count = document.createElement("p");
  count.className = "reason";
  count.textContent = of.labels ? `${counted(of.labels, "answer")} by ${counted(of.people.length, "annotator")}` : "no answers";
  head.append(name, count);
  const pictures = document.createElement("div");
  pictures.className = "samples";
  pictures.append(
    ...of.individuals.map((index) => {
      const picture = document.createElement("img");
      picture.src = path(archived(index));
      picture.alt = `Individual ${grouped(index)}`;
      picture.width = 48;
      picture.height = 48;
      picture.loading = "lazy";
      return picture;
    }),
  );
  const acts = document.createElement("div");
  acts.className = "acts";
  for (const [id, act] of Object.entries(ACTS)) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = id === "delete" ? "plain danger" : "plain";
    button.dataset.act = `${id} ${of.name}`;
    button.setAttribute("aria-label", `${act.button} ${shown(of.name)}`);
    button.textContent = act.button;
    button.addEventListener("click", () => ask(act, of));
    acts.append(button);
  }
  item.append(head, pictures, acts);
  return item;
}

// An entry in the list of past changes. The first entry, which is the newest, has a button that undoes it.
function past({ entry, annotator, time, description }, place) {
  const item = document.createElement("li");
  const words = document.createElement("span");
  words.textContent = `${annotator} ${description}, ${new Date(time).toLocaleString("en")}. `;
  item.append(words);
  if (place === 0) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "plain";
    button.id = "revert";
    button.textContent = "Undo this change";
    button.addEventListener("click", () => change({ revert: { entry } }));
    item.append(button);
  }
  return item;
}

dialog.querySelector("[data-do=back]").addEventListener("click", () => dialog.close());
at("create").addEventListener("submit", (event) => {
  event.preventDefault();
  const field = event.target.elements.class;
  change({ create: { class: field.value.trim() } });
  field.value = "";
});

await introduced();
let entries = null;
follow(async (seen) => {
  if (seen.labels === entries) return;
  entries = seen.labels;
  show(await insist(() => get("classes/details")));
});
