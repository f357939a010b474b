// The menus and numbers of the map's filter.

// The menu of each kind of value, and the format of the menu's values. The first entry of a menu stands for all values.
const MENUS = {
  class: { id: "of-class", written: (name) => `=${name}`, read: (text) => text.slice(1) },
  cluster: { id: "of-cluster", written: String, read: Number },
  annotator: { id: "answered-by", written: String, read: String },
};

const at = (id) => document.getElementById(id);

export class Menus {
  // Calls `changed(kind)` after every change that a person makes with these menus and numbers.
  constructor(filter, changed) {
    this.filter = filter;
    for (const [kind, { id, read }] of Object.entries(MENUS)) {
      at(id).addEventListener("change", () => {
        filter.picked[kind] = at(id).value === "" ? null : read(at(id).value);
        changed(kind);
      });
    }
    for (const id of ["from", "to"]) {
      at(id).addEventListener("change", () => {
        const [from, to] = ["from", "to"].map((id) => at(id).value);
        filter.generations = [from === "" ? 0 : Number(from), to === "" ? Infinity : Number(to)];
        changed("generation");
      });
    }
    at("show-all").addEventListener("click", () => {
      filter.showAll();
      this.showGenerations();
      for (const { id } of Object.values(MENUS)) at(id).value = "";
      changed("all");
    });
    this.showGenerations();
  }

  // Sets the values that a menu offers. A picked value stays picked if the menu still offers it.
  offer(kind, entries) {
    const { picked } = this.filter;
    const { id, written } = MENUS[kind];
    const menu = at(id);
    menu.replaceChildren(menu.options[0], ...entries.map(([value, text]) => new Option(text, written(value))));
    if (!entries.some(([value]) => value === picked[kind])) picked[kind] = null;
    menu.value = picked[kind] === null ? "" : written(picked[kind]);
  }

  showGenerations() {
    const [first, last] = this.filter.generations;
    at("from").value = first === 0 ? "" : first;
    at("to").value = last === Infinity ? "" : last;
  }
}
