// Ties the page together.

import { Esc } from "./esc.js";
import { csv, download, png, svg } from "./export.js";
import { Lab } from "./lab.js";
import { Parameters } from "./parameters.js";
import { drawPhasor } from "./phasor.js";
import { Plots } from "./plots.js";
import { Link } from "./socket.js";
import { Tests } from "./tests.js";
import { ThrottleHandle } from "./throttle.js";
import { Tiles } from "./tiles.js";
import { Traces } from "./traces.js";

const GCS = 6;
const ARMED = 128;
const EVENTS = 500;
const WARNING = 4;
const SLOTS = 4;

const element = (id) => document.getElementById(id);
/** The ESCs by their components. */
const escs = new Map();
let hello = null;

/** A line of the log. */
function told(text, bad = false) {
  // Once is enough.
  if (element("events").firstChild?.dataset.text === text) return;
  const line = document.createElement("li");
  const time = Object.assign(document.createElement("time"), { textContent: new Date().toLocaleTimeString() });
  line.append(time, text);
  line.dataset.text = text;
  line.classList.toggle("bad", bad);
  const events = element("events");
  events.prepend(line);
  while (events.children.length > EVENTS) events.lastChild.remove();
}

function state(text, kind) {
  element("state").textContent = text;
  element("state").className = `badge ${kind}`;
}

const tiles = new Tiles(element("tiles"));
const handlers = {
  open: () => state("connected", "good"),
  close() {
    state("not connected", "bad");
    escs.clear();
    throttle.refused();
  },
  hello(content) {
    hello = content;
    element("version").textContent = content.version;
    traces.hello(content);
    const choice = element("esc");
    choice.replaceChildren(...Array.from({ length: content.escs }, (_, i) => new Option(`ESC ${i + 1}`, i, false, i === link.esc)));
    choice.hidden = content.escs < 2;
  },
  refused(reason) {
    told(`Refused: ${reason}`, true);
    if (reason.includes("throttle")) throttle.refused();
  },
  trace: (buffer) => traces.take(buffer),
  mavlink(message) {
    if (message.name === "HEARTBEAT" && message.type !== GCS) heartbeat(message);
    // One of each four tells of all four.
    if (message.index === SLOTS * Math.floor(link.esc / SLOTS)) {
      if (message.name === "ESC_STATUS") tiles.status(message, link.esc % SLOTS);
      if (message.name === "ESC_INFO") tiles.info(message, link.esc % SLOTS);
    }
    escs.get(message.component)?.take(message);
    if (message.name === "STATUSTEXT") {
      const of = escs.size > 1 ? `ESC ${components().indexOf(message.component) + 1}: ` : "";
      told(of + message.text, message.severity <= WARNING);
    }
  },
};
const link = new Link(handlers);
const plots = new Plots(element("plots"), element("plot-choice"), (from, to) => traces.look(from, to));
const traces = new Traces(link, plots, seen);
const throttle = new ThrottleHandle(link, current, told);
const parameters = new Parameters(current, told);
new Lab(link, told);
new Tests(current, told);

function components() {
  return [...escs.keys()].sort((a, b) => a - b);
}

/** The ESC that is looked at, if it has been heard. */
function current() {
  return escs.get(components()[link.esc]);
}

function heartbeat({ system, component, base_mode }) {
  if (!escs.has(component)) {
    const esc = new Esc(link, system, component);
    esc.addEventListener("param", ({ detail }) => { if (esc === current()) parameters.show(detail); });
    escs.set(component, esc);
    if (esc === current()) parameters.read();
  }
  escs.get(component).isArmed = Boolean(base_mode & ARMED);
}

element("esc").addEventListener("change", () => {
  throttle.refused();
  link.esc = Number(element("esc").value);
  traces.live();
  parameters.read();
});

/** A piece of the traces has been drawn. */
function seen({ values }) {
  const last = (name) => values[name]?.at(-1);
  tiles.traces({ values }, hello.faults);
  drawPhasor({ i_d: last("i_d_a"), i_q: last("i_q_a"), u_d: last("u_d_v"), u_q: last("u_q_v") });
  const phase = hello.phases[last("phase")] ?? "";
  const isArmed = current()?.isArmed;
  element("drive").textContent = isArmed ? `${phase}, armed` : phase;
  element("drive").className = `badge ${isArmed ? "good" : ""}`;
}

function page(name) {
  for (const other of ["scope", "parameters"]) {
    element(other).hidden = other !== name;
    element(`show-${other}`).setAttribute("aria-pressed", other === name);
  }
  if (name === "parameters") throttle.refused();
}
element("show-scope").addEventListener("click", () => page("scope"));
element("show-parameters").addEventListener("click", () => page("parameters"));

const dark = matchMedia("(prefers-color-scheme: dark)");
function repaint() {
  plots.rebuild();
  if (plots.data) seen(plots.data);
}
function scheme(theme) {
  document.documentElement.dataset.theme = theme;
  repaint();
}
element("theme").addEventListener("click", () => {
  const now = document.documentElement.dataset.theme ?? (dark.matches ? "dark" : "light");
  scheme(now === "dark" ? "light" : "dark");
});
dark.addEventListener("change", repaint);

element("export-svg").addEventListener("click", () => download("siskin.svg", new Blob([svg(plots)], { type: "image/svg+xml" })));
element("export-png").addEventListener("click", async () => download("siskin.png", await png(plots)));
element("export-csv").addEventListener("click", () => download("siskin.csv", new Blob([csv(plots)], { type: "text/csv" })));
