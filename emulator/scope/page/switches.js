// The six switches of one period of the PWM, with the voltages and the currents that they make.

import { colour, room } from "./plots.js";

const EVERY_MS = 250;
const HEIGHT = { gates: 150, others: 130 };
const AXIS = 52;
const PHASES = ["a", "b", "c"];
const COLOURS = ["--trace-0", "--trace-1", "--trace-2"];
/** A gate's trace within its row. */
const ON = 0.75;

const element = (id) => document.getElementById(id);

export class Switches {
  /** `paused` tells whether a person looks at one piece. */
  constructor(link, paused) {
    Object.assign(this, { link, paused, plots: null, seen: null });
    this.box = element("switches");
    this.box.addEventListener("toggle", () => this.ask());
    new ResizeObserver(() => this.resize()).observe(element("switch-plots"));
    setInterval(() => this.paused() || this.ask(), EVERY_MS);
  }

  ask() {
    if (this.box.open && !this.box.hidden && !document.hidden) this.link.ask({ switching: { esc: this.link.esc } });
  }

  /** What the program has seen; nothing where it cannot know. */
  take(seen) {
    this.box.hidden = !seen;
    if (!seen || !this.box.open) return;
    this.seen = seen;
    element("switch-text").textContent = seen.is_switching
      ? `A period that began at ${seen.t_s.toFixed(6)} s, as the plant was switched.`
      : `What the duties make of the period that began at ${seen.t_s.toFixed(6)} s. The averaged plant is driven by their means; --plant switching by these edges.`;
    this.table(seen);
    this.draw();
  }

  /** When each gate turns on and off. */
  table({ edges, gates: [first] }) {
    const rows = PHASES.flatMap((phase, leg) => ["high", "low"].map((side, low) => {
      const times = [];
      let before = Boolean(first & (1 << (2 * leg + low)));
      for (const [t, of, ...on] of edges) {
        if (of !== leg) continue;
        if (on[low] !== before) times.push(`${on[low] ? "on" : "off"} ${t.toFixed(3)}`);
        before = on[low];
      }
      return [`${phase} ${side}`, times.join(", ") || "no edge"];
    }));
    element("switch-times").replaceChildren(...rows.flatMap(([name, times]) => {
      const [term, text] = [document.createElement("dt"), document.createElement("dd")];
      [term.textContent, text.textContent] = [name, times];
      return [term, text];
    }));
  }

  get width() {
    return Math.max(200, element("switch-plots").clientWidth - 2);
  }

  resize() {
    for (const { plot, height } of this.plots ?? []) plot.setSize({ width: this.width, height });
  }

  /** Makes all plots anew, as after a change of the scheme. */
  rebuild() {
    for (const { plot } of this.plots ?? []) plot.destroy();
    this.plots = null;
    if (this.seen && this.box.open) this.draw();
  }

  make(name, unit, labels, height, options) {
    const axis = { stroke: colour("--dim"), grid: { stroke: colour("--line"), width: 1 }, ticks: { stroke: colour("--line"), width: 1 }, font: "11px system-ui" };
    const stepped = globalThis.uPlot.paths.stepped({ align: -1 });
    const plot = new globalThis.uPlot({
      title: unit ? `${name}, ${unit}` : name, width: this.width, height,
      cursor: { sync: { key: "switches" }, drag: { x: true, y: false }, points: { show: false } },
      legend: { show: options.hasLegend },
      scales: { x: { time: false }, y: options.scale ?? { range: (_, min, max) => room(min, max, unit) } },
      axes: [{ ...axis, size: 28 }, { ...axis, size: AXIS, space: 18, ...options.axis }],
      series: [
        { label: "t, µs", value: (_, t) => (t == null ? "–" : t.toFixed(3)) },
        ...labels.map((label, i) => ({
          label, stroke: colour(COLOURS[options.colour?.(i) ?? i]), width: 1.5, points: { show: false },
          paths: options.isStepped ? stepped : undefined, value: (_, value) => (value == null ? "–" : value.toFixed(2)),
        })),
      ],
    }, [[], ...labels.map(() => [])], element("switch-plots"));
    return { plot, height };
  }

  draw() {
    const gates = PHASES.flatMap((phase) => [`${phase} high`, `${phase} low`]);
    // The first stands on top.
    const row = (i) => gates.length - 1 - i;
    this.plots ??= [
      this.make("Gates", "", gates, HEIGHT.gates, {
        hasLegend: false, isStepped: true, colour: (i) => i >> 1, scale: { range: [-0.25, gates.length] },
        axis: { grid: { show: false }, splits: () => gates.map((_, i) => row(i) + ON / 2), values: () => gates },
      }),
      this.make("Terminals", "V", PHASES, HEIGHT.others, { hasLegend: true, isStepped: true }),
      this.make("Phase currents", "A", PHASES, HEIGHT.others, { hasLegend: true }),
    ];
    const { t_us, gates: bits, terminals_v, currents_a } = this.seen;
    const levels = gates.map((_, i) => bits.map((set) => row(i) + (set & (1 << i) ? ON : 0)));
    for (const [i, data] of [levels, terminals_v, currents_a].entries()) this.plots[i].plot.setData([t_us, ...data]);
  }
}
