// Ties the page together.

import { Esc } from "./esc.js";
import { csv, download, png, svg } from "./export.js";
import { Fleet } from "./fleet.js";
import { Lab } from "./lab.js";
import { MotorTest } from "./motor.js";
import { Parameters } from "./parameters.js";
import { drawPhasor } from "./phasor.js";
import { LINKED, Plots, SIMULATED } from "./plots.js";
import { Records } from "./records.js";
import { Remote } from "./remote.js";
import { Samples } from "./samples.js";
import { Link } from "./socket.js";
import { Switches } from "./switches.js";
import { Tests } from "./tests.js";
import { ThrottleHandle } from "./throttle.js";
import { Texts } from "./texts.js";
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
const SHOWN_SIGNALS = 511;
const EVENTS = 500;
const WARNING = 4;
const SLOTS = 4;

const element = (id) => document.getElementById(id);
/** The ESCs by their components. */
const escs = new Map();
let hello = null;

/** Three heartbeats. */
const SILENT_MS = 3500;

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
    letGo();
    escs.clear();
    known(false);
  },
  hello(content) {
    hello = content;
    element("version").textContent = content.version;
    for (const part of document.querySelectorAll("[data-of]")) part.hidden = (part.dataset.of === "simulation") !== content.simulated;
    tiles.simulated(content.simulated);
    if (content.simulated) remote.channels = content.channels;
    plots.offer(content.simulated ? SIMULATED : LINKED);
    traces.from(content.simulated ? remote : samples, !content.simulated);
    lab.benches(content.benches ?? []);
    if (content.simulated) link.ask({ standing: { esc: link.esc } });
    throttle.several(content.escs);
    records.recorded(content.recordings ?? [], link.esc);
    offer();
    known(true);
  },
  refused(reason) {
    told(`Refused: ${reason}`, true);
    if (reason.includes("throttle")) letGo();
  },
  trace: (buffer) => remote.take(buffer),
  fitted: (content) => lab.fitted(content),
  stands: (content) => lab.stands(content),
  scenario: (ending) => lab.over(ending),
  switching: (seen) => switches.take(seen),
  mavlink(message) {
    if (message.name === "HEARTBEAT" && mayBeEsc(message)) heartbeat(message);
    const esc = escs.get(message.component);
    if (message.name === "ESC_STATUS" || message.name === "ESC_INFO") telemetry(message);
    esc?.take(message);
    if (message.name === "NAMED_VALUE_FLOAT" && esc === current()) samples.signal(message);
    if (message.name === "STATUSTEXT") texts.take(message);
  },
};
const link = new Link(handlers);
const plots = new Plots(element("plots"), element("plot-choice"), (from, to) => traces.look(from, to));
const texts = new Texts(({ component, text, severity }) => {
  const of = escs.size > 1 && escs.has(component) ? `ESC ${components().indexOf(component) + 1}: ` : "";
  const esc = escs.get(component);
  if (!(esc?.setting && text.includes(" refused: "))) told(of + text, severity <= WARNING);
  esc?.said(text);
});
const remote = new Remote(link);
const samples = new Samples();
const traces = new Traces(link, plots, seen);
const switches = new Switches(link, () => traces.paused);
const throttle = new ThrottleHandle(link, current, told);
const handles = [throttle, new MotorTest(current, told)];
const parameters = new Parameters(current, told);
const lab = new Lab(link, current, letGo, told);
handles.push(lab);
new Tests(current, told);
const records = new Records(current, told);
const fleet = new Fleet(element("fleet"), choose);

function components() {
  return [...escs.keys()].sort((a, b) => a - b);
}

/** The ESC that is looked at, once it is known which one that is. */
function current() {
  if (escs.size < (hello?.escs ?? 1)) return undefined;
  return escs.get(components()[link.esc]);
}

/** Whether what is shown is so now, and whether anyone hears what is asked. */
function known(isKnown) {
  document.body.classList.toggle("gone", !isKnown);
  for (const controls of document.querySelectorAll("fieldset.controls")) controls.disabled = !isKnown;
  element("stop-always").disabled = !isKnown;
  if (isKnown) return;
  tiles.unknown();
  fleet.unknown();
  element("drive").textContent = "";
  element("drive").className = "badge";
}

/** An ESC on a link may fall silent while the program that serves the page goes on. */
function listen() {
  const esc = current();
  if (!link.isOpen || !esc || hello.simulated) return;
  const isSilent = performance.now() - esc.heard > SILENT_MS;
  if (isSilent === document.body.classList.contains("gone")) return;
  if (isSilent) letGo();
  state(isSilent ? "ESC silent" : "connected", isSilent ? "bad" : "good");
  known(!isSilent);
}
setInterval(listen, SILENT_MS / 10);

function letGo() {
  for (const handle of handles) handle.refused();
}

/** What else is on a link is none, and where one was asked for by its component, others are not either. */
function mayBeEsc({ type, autopilot, component }) {
  if (hello?.component) return component === hello.component;
  return type === SERVO || (type === GENERIC && autopilot === GENERIC);
}

/** The number of an ESC in messages of four, by its component or among those that are simulated. */
function place(i, component) {
  if (hello?.simulated) return i;
  return component >= FIRST && component <= LAST ? component - FIRST : 0;
}

/** Messages of four: of several ESCs one may tell of all, and then the others do not tell of themselves. */
function telemetry(message) {
  const sender = escs.get(message.component);
  if (sender) sender.tells = true;
  if (!current()) return;
  for (const [i, component] of components().entries()) {
    const [esc, number] = [escs.get(component), place(i, component)];
    const isOf = message.index === SLOTS * Math.floor(number / SLOTS) && (sender === esc || !esc.tells);
    if (!isOf) continue;
    const slot = number % SLOTS;
    if (message.name === "ESC_STATUS") fleet.status(i, message, slot, esc.faults.length > 0);
    if (esc !== current()) continue;
    if (message.name === "ESC_STATUS") {
      tiles.status(message, slot);
      samples.status(message, slot);
    } else {
      tiles.info(message, slot);
      samples.last("celsius", message.temperature[slot] / 100);
    }
  }
}

/** Offers the ESCs to choose from: all that there are, or all that have been heard. */
function offer() {
  const named = (_, i) => (hello?.escs ? `ESC ${i + 1}` : `ESC ${i + 1} (${components()[i]})`);
  fleet.offer(Array.from({ length: hello?.escs ?? escs.size }, named), link.esc);
}

function choose(i) {
  letGo();
  link.esc = i;
  offer();
  if (hello.simulated) link.ask({ standing: { esc: i } });
  tiles.unknown();
  samples.clear();
  traces.live();
  parameters.read();
  records.choose(i);
}

function heartbeat(message) {
  const { system, component, base_mode, system_status } = message;
  if (!escs.has(component)) {
    const esc = new Esc(link, system, component);
    esc.addEventListener("param", ({ detail }) => { if (esc === current()) shown(detail); });
    const before = current();
    escs.set(component, esc);
    offer();
    if (current() && current() !== before) parameters.read();
  }
  const esc = escs.get(component);
  esc.heard = performance.now();
  esc.isArmed = Boolean(base_mode & ARMED);
  esc.state = system_status;
  if (!hello) return;
  const faults = (esc.faults = named(message.custom_mode, hello.faults));
  if (!current()) return;
  fleet.faults(components().indexOf(component), faults);
  if (esc !== current()) return;
  tiles.conditions(faults, named(message.custom_mode, hello.limits));
  samples.last("faults", message.custom_mode & 0xffff);
  if (!hello.simulated || !traces.isLatest) drive(STATES[system_status] ?? "starting");
}

function shown(name) {
  parameters.show(name);
  if (name === "TEL_SIGNALS") element("stream").setAttribute("aria-pressed", current().params.get(name) !== 0);
}

/** The names of the bits that are set. */
function named(bits, names) {
  return Object.entries(names).filter(([bit]) => bits & (1 << bit)).map(([, name]) => name);
}

/** The drive's state, whether its throttle is open, and whether a fault holds. */
function drive(state) {
  const { isArmed, faults = [] } = current() ?? {};
  const isFaulty = faults.length > 0;
  element("drive").textContent = [state, isArmed && "armed", isFaulty && "fault"].filter(Boolean).join(", ");
  element("drive").className = `badge ${isFaulty ? "bad" : isArmed ? "good" : ""}`;
}

element("stream").addEventListener("click", async () => {
  const isOn = element("stream").getAttribute("aria-pressed") === "true";
  await parameters.set("TEL_SIGNALS", isOn ? 0 : SHOWN_SIGNALS);
});

/** A piece of the traces has been drawn. */
function seen({ values }) {
  const last = (name) => values[name]?.at(-1);
  const [i_d, i_q, u_d, u_q] = ["i_d_a", "i_q_a", "u_d_v", "u_q_v"].map(last);
  element("plane").hidden = !hello.simulated && i_d == null;
  drawPhasor({ i_d, i_q, u_d, u_q });
  const faults = last("faults");
  // The latest traces tell it sooner than the heartbeat; a piece of the past does not tell it.
  const names = faults == null || !traces.isLatest ? null : named(faults, hello.faults);
  if (names && current()) current().faults = names;
  tiles.traces({ values }, names, traces.isLatest);
  if (hello.simulated && traces.isLatest) drive(hello.phases[last("phase")] ?? "");
}

function page(name) {
  for (const other of ["scope", "parameters"]) {
    element(other).hidden = other !== name;
    element(`show-${other}`).setAttribute("aria-pressed", other === name);
  }
  if (name === "parameters") letGo();
}
element("stop-always").addEventListener("click", () => element(hello?.simulated ? "stop" : "halt").click());
element("show-scope").addEventListener("click", () => page("scope"));
element("show-parameters").addEventListener("click", () => page("parameters"));

const dark = matchMedia("(prefers-color-scheme: dark)");
function repaint() {
  plots.rebuild();
  switches.rebuild();
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
