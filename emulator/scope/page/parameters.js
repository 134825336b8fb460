// All parameters, by the metadata that ground stations get.

import { download } from "./export.js";

const element = (id) => document.getElementById(id);
const spelt = (value) => String(Number(value.toPrecision(7)));

export class Parameters {
  constructor(esc, told) {
    Object.assign(this, { esc, told, rows: new Map() });
    element("search").addEventListener("input", () => this.filter());
    element("changed-only").addEventListener("change", () => this.filter());
    element("param-save").addEventListener("click", () => this.save());
    element("param-reload").addEventListener("click", () => this.read());
    element("param-load").addEventListener("change", ({ target }) => this.load(target));
    element("param-load").parentElement.addEventListener("keydown", ({ key }) => key === "Enter" && element("param-load").click());
    this.ready = this.build();
  }

  async build() {
    const { parameters } = await (await fetch("parameters.json")).json();
    const groups = Map.groupBy(parameters, ({ group }) => group);
    for (const [name, members] of groups) {
      const section = document.createElement("section");
      section.className = "group";
      section.append(Object.assign(document.createElement("h2"), { textContent: name }));
      section.append(...members.map((about) => this.row(about)));
      element("param-list").append(section);
    }
  }

  row(about) {
    const row = document.createElement("div");
    row.className = "param";
    const name = Object.assign(document.createElement("code"), { textContent: about.name });
    const input = about.values ? document.createElement("select") : document.createElement("input");
    if (about.values) {
      input.append(...about.values.map(({ value, description }) => new Option(`${value}: ${description}`, value)));
    } else {
      Object.assign(input, { type: "number", min: about.min, max: about.max, step: about.decimalPlaces === 0 ? 1 : "any" });
    }
    input.id = `param-${about.name}`;
    input.disabled = Boolean(about.readOnly);
    input.setAttribute("aria-label", about.name);
    input.addEventListener("change", () => this.set(about.name, Number(input.value)));
    const value = document.createElement("div");
    value.className = "value";
    value.append(input, Object.assign(document.createElement("span"), { textContent: about.units ?? "" }));
    const range = about.readOnly ? "computed" : `${about.min} to ${about.max}, from the factory ${about.default}`;
    const restart = about.rebootRequired ? ", in force after a restart" : "";
    const text = document.createElement("small");
    text.textContent = `${about.shortDesc} (${range}${restart})`;
    const problem = Object.assign(document.createElement("em"), { className: "problem" });
    row.append(name, value, text, problem);
    this.rows.set(about.name, { row, input, about, problem });
    return row;
  }

  show(name) {
    const found = this.rows.get(name);
    const value = this.esc().params.get(name);
    if (!found || value === undefined) return;
    if (document.activeElement !== found.input) found.input.value = found.about.values ? String(value) : spelt(value);
    // A long choice is cut where it stands; whole, it is a hint.
    if (found.about.values) found.input.title = found.input.selectedOptions[0]?.textContent ?? "";
    const changed = !found.about.readOnly && Math.fround(found.about.default) !== value;
    found.row.classList.toggle("changed", changed);
    found.problem.textContent = "";
  }

  filter() {
    const word = element("search").value.trim().toLowerCase();
    const changed = element("changed-only").checked;
    for (const { row } of this.rows.values()) {
      row.hidden = !row.textContent.toLowerCase().includes(word) || (changed && !row.classList.contains("changed"));
    }
    for (const group of document.querySelectorAll(".group")) group.hidden = !group.querySelector(".param:not([hidden])");
  }

  async read() {
    await this.ready;
    element("param-state").classList.remove("bad");
    element("param-state").textContent = "reading …";
    const all = await this.esc()?.readParams();
    element("param-state").textContent = all ? `${this.esc().params.size} parameters` : "not all could be read";
  }

  async set(name, value) {
    const { inForce, refused } = await this.esc().setParam(name, value);
    const told = refused === null ? `${name} is ${spelt(inForce)}` : this.refusal(name, value, refused);
    this.told(told, refused !== null);
    element("param-state").textContent = told;
    element("param-state").classList.toggle("bad", refused !== null);
    const found = this.rows.get(name);
    if (found) found.problem.textContent = refused === null ? "" : told;
    if (refused !== null && found && inForce !== null) found.input.value = spelt(inForce);
    return refused === null;
  }

  /** Why a value was not taken, in a line. */
  refusal(name, value, reason) {
    const about = this.rows.get(name)?.about;
    const range = about && (value < about.min || value > about.max) ? `; give ${about.min} to ${about.max}` : "";
    return `${name}: ${spelt(value)} was refused, ${reason}${range}`;
  }

  save() {
    const lines = [...this.esc().params].filter(([name]) => !this.rows.get(name)?.about.readOnly)
      .map(([name, value]) => `${name.padEnd(16)} ${spelt(value)}`);
    const text = `# Siskin: ${lines.length} parameters\n# NAME VALUE\n${lines.join("\n")}\n`;
    download("siskin.param", new Blob([text], { type: "text/plain" }));
  }

  /** Reads `NAME VALUE`, `NAME,VALUE` and QGroundControl's five columns. */
  async load(input) {
    const text = await input.files[0]?.text();
    input.value = "";
    if (text === undefined) return;
    const [wanted, problems] = [new Map(), []];
    for (const [at, line] of text.split(/\r?\n/).entries()) {
      if (/^\s*(#|$)/.test(line)) continue;
      const words = line.trim().split(/[\s,]+/);
      const [name, number] = words.length >= 5 ? words.slice(2, 4) : words;
      const value = Number(number);
      if (number === undefined || !Number.isFinite(value)) problems.push(`line ${at + 1}: ${line.trim()} is not NAME VALUE`);
      else if (!this.rows.has(name)) problems.push(`line ${at + 1}: there is no parameter ${name}`);
      else wanted.set(name, value);
    }
    const is = ([name, value]) => this.rows.get(name).about.readOnly || this.esc().params.get(name) === Math.fround(value);
    const pairs = [...wanted].filter((pair) => !is(pair));
    const same = wanted.size - pairs.length;
    const refused = await this.esc().setParams(pairs);
    problems.push(...refused.map((one) => this.refusal(...one)));
    for (const problem of problems) this.told(problem, true);
    const bad = problems.length ? `, ${problems.length} refused` : "";
    const told = `Loaded: ${pairs.length - refused.length} set, ${same} as they were${bad}`;
    this.told(told, problems.length > 0);
    element("param-state").textContent = told;
    element("param-state").classList.toggle("bad", problems.length > 0);
    element("param-problems").replaceChildren(...problems.map((problem) => Object.assign(document.createElement("li"), { textContent: problem })));
  }
}
