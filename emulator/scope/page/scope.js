// Ties the page together.

import { Esc } from "./esc.js";
import { csv, download, png, svg } from "./export.js";
import { Lab } from "./lab.js";
import { MotorTest } from "./motor.js";
import { Parameters } from "./parameters.js";
import { drawPhasor } from "./phasor.js";
import { LINKED, Plots, SIMULATED } from "./plots.js";
import { Records } from "./records.js";
import { Remote } from "./remote.js";
import { Samples } from "./samples.js";
import { Link } from "./socket.js";
import { Tests } from "./tests.js";
import { ThrottleHandle } from "./throttle.js";
import { Tiles } from "./tiles.js";
import { Traces } from "./traces.js";

const ARMED = 128;
/** MAV_STATE in words. */
const STATES = { 3: "at rest", 4: "active", 5: "critical", 6: "emergency" };
/** MAV_TYPE and MAV_AUTOPILOT of an ESC: a vehicle of its own, or beside an autopilot. */
const GENERIC = 0;
const SERVO = 33;
/** Components of ESCs that have a number, which is their place in messages of four. */
const [FIRST, LAST] = [140, 153];
const ALL_SIGNALS = 511;
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
    letGo();
  },
  hello(content) {
    hello = content;
    element("version").textContent = content.version;
    for (const part of document.querySelectorAll("[data-of]")) part.hidden = (part.dataset.of === "simulation") !== content.simulated;
    tiles.simulated(content.simulated);
    if (content.simulated) remote.channels = content.channels;
    plots.offer(content.simulated ? SIMULATED : LINKED);
    traces.from(content.simulated ? remote : samples, !content.simulated);
    offer();
  },
  refused(reason) {
    told(`Refused: ${reason}`, true);
    if (reason.includes("throttle")) letGo();
  },
  trace: (buffer) => remote.take(buffer),
  mavlink(message) {
    if (message.name === "HEARTBEAT" && mayBeEsc(message)) heartbeat(message);
    const esc = escs.get(message.component);
    if (message.name === "ESC_STATUS" && esc) esc.tells = true;
    if (message.index === SLOTS * Math.floor(place() / SLOTS) && isOfCurrent(message)) {
      const slot = place() % SLOTS;
      if (message.name === "ESC_STATUS") {
        tiles.status(message, slot);
        samples.status(message, slot);
      }
      if (message.name === "ESC_INFO") {
        tiles.info(message, slot);
        samples.last("celsius", message.temperature[slot] / 100);
      }
    }
    esc?.take(message);
    if (message.name === "NAMED_VALUE_FLOAT" && esc === current()) samples.signal(message);
    if (message.name === "STATUSTEXT") {
      const of = escs.size > 1 && esc ? `ESC ${components().indexOf(message.component) + 1}: ` : "";
      told(of + message.text, message.severity <= WARNING);
    }
  },
};
const link = new Link(handlers);
const plots = new Plots(element("plots"), element("plot-choice"), (from, to) => traces.look(from, to));
const remote = new Remote(link);
const samples = new Samples();
const traces = new Traces(link, plots, seen);
const handles = [new ThrottleHandle(link, current, told), new MotorTest(current, told)];
const parameters = new Parameters(current, told);
new Lab(link, told);
new Tests(current, told);
new Records(current, told);

function components() {
  return [...escs.keys()].sort((a, b) => a - b);
}

/** The ESC that is looked at, if it has been heard. */
function current() {
  return escs.get(components()[link.esc]);
}

function letGo() {
  for (const handle of handles) handle.refused();
}

/** What else is on a link is none, and where one was asked for by its component, others are not either. */
function mayBeEsc({ type, autopilot, component }) {
  if (hello?.component) return component === hello.component;
  return type === SERVO || (type === GENERIC && autopilot === GENERIC);
}

/** The number of the ESC that is looked at, by its component. */
function place() {
  if (hello?.simulated) return link.esc;
  const component = current()?.component;
  return component >= FIRST && component <= LAST ? component - FIRST : 0;
}

/** Of several, one may tell of all: then the others do not tell of themselves. */
function isOfCurrent({ component }) {
  const esc = current();
  return esc && (component === esc.component || !esc.tells);
}

/** Offers the ESCs to choose from: all that there are, or all that have been heard. */
function offer() {
  const choice = element("esc");
  const count = hello?.escs ?? escs.size;
  const name = (i) => (hello?.escs ? `ESC ${i + 1}` : `ESC ${i + 1}, component ${components()[i]}`);
  choice.replaceChildren(...Array.from({ length: count }, (_, i) => new Option(name(i), i, false, i === link.esc)));
  choice.hidden = count < 2;
}

function heartbeat(message) {
  const { system, component, base_mode, system_status } = message;
  if (!escs.has(component)) {
    const esc = new Esc(link, system, component);
    esc.addEventListener("param", ({ detail }) => { if (esc === current()) shown(detail); });
    escs.set(component, esc);
    offer();
    if (esc === current()) parameters.read();
  }
  const esc = escs.get(component);
  esc.isArmed = Boolean(base_mode & ARMED);
  if (esc !== current() || !hello) return;
  tiles.heartbeat(message, hello);
  samples.last("faults", message.custom_mode & 0xffff);
  if (!hello.simulated) drive(STATES[system_status] ?? "starting");
}

function shown(name) {
  parameters.show(name);
  if (name === "TEL_SIGNALS") element("stream").setAttribute("aria-pressed", current().params.get(name) !== 0);
}

/** The drive's state, and whether its throttle is open. */
function drive(state) {
  const isArmed = current()?.isArmed;
  element("drive").textContent = isArmed ? `${state}, armed` : state;
  element("drive").className = `badge ${isArmed ? "good" : ""}`;
}

element("stream").addEventListener("click", async () => {
  const isOn = element("stream").getAttribute("aria-pressed") === "true";
  await parameters.set("TEL_SIGNALS", isOn ? 0 : ALL_SIGNALS);
});

element("esc").addEventListener("change", () => {
  letGo();
  link.esc = Number(element("esc").value);
  samples.clear();
  traces.live();
  parameters.read();
});

/** A piece of the traces has been drawn. */
function seen({ values }) {
  const last = (name) => values[name]?.at(-1);
  const [i_d, i_q, u_d, u_q] = ["i_d_a", "i_q_a", "u_d_v", "u_q_v"].map(last);
  element("plane").hidden = !hello.simulated && i_d == null;
  drawPhasor({ i_d, i_q, u_d, u_q });
  tiles.traces({ values }, hello.faults);
  if (hello.simulated) drive(hello.phases[last("phase")] ?? "");
}

function page(name) {
  for (const other of ["scope", "parameters"]) {
    element(other).hidden = other !== name;
    element(`show-${other}`).setAttribute("aria-pressed", other === name);
  }
  if (name === "parameters") letGo();
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
