// The plots: one uPlot each, with a common time axis, cursor and marks.

import { envelope, pale } from "./envelope.js";

const HEIGHT = 128;
const AXIS = 52;
const COLOURS = ["--trace-0", "--trace-1", "--trace-2"];

/** What can be plotted of a simulated ESC: name, unit, channels with their labels, and whether it is shown from the start. */
export const SIMULATED = [
  ["Speed", "rpm", [["rpm", "true"], ["rpm_est", "estimated"], ["rpm_ref", "reference"]], true],
  ["Phase currents", "A", [["i_a_a", "a"], ["i_b_a", "b"], ["i_c_a", "c"]], true],
  ["Currents d, q", "A", [["i_d_a", "d"], ["i_q_a", "q"]], true],
  ["Angle error", "°", [["angle_error_deg", "estimated less true"]], true],
  ["Throttle", "", [["throttle", "throttle"]], true],
  ["Angle", "°", [["angle_deg", "true"], ["angle_est_deg", "estimated"]], false],
  ["Duty", "", [["duty_a", "a"], ["duty_b", "b"], ["duty_c", "c"]], false],
  ["Voltages d, q", "V", [["u_d_v", "d"], ["u_q_v", "q"]], false],
  ["Flux linkages", "Wb", [["flux_a_wb", "a"], ["flux_b_wb", "b"], ["flux_c_wb", "c"]], false],
  ["Supply voltage", "V", [["bus_v", "supply"]], false],
  ["Supply current", "A", [["bus_a", "supply"]], true],
  ["Torque", "Nm", [["torque_nm", "torque"]], false],
];

/** And of one on a link. */
export const LINKED = [
  ["Speed", "rpm", [["rpm", "estimated"], ["rpm_ref", "reference"]], true],
  ["Currents d, q", "A", [["i_d_a", "d"], ["i_q_a", "q"]], true],
  ["Voltages d, q", "V", [["u_d_v", "d"], ["u_q_v", "q"]], false],
  ["Duty", "", [["duty", "share of the supply"]], true],
  ["Supply voltage", "V", [["bus_v", "supply"]], true],
  ["Supply current", "A", [["bus_a", "supply"]], true],
  ["Temperature", "°C", [["celsius", "board"]], false],
];

/** The least height of an axis by its unit: less is noise, which would fill the plot. */
const LEAST = { rpm: 10, A: 0.5, "°": 1, "": 0.1, V: 0.5, Wb: 1e-4, Nm: 0.01, "°C": 1 };

const colours = new Map();

/** A colour of the style sheet as the canvas takes it, of the scheme in force. */
export function colour(name) {
  if (!colours.has(name)) {
    const probe = document.createElement("i");
    probe.style.color = `var(${name})`;
    document.body.append(probe);
    colours.set(name, getComputedStyle(probe).color);
    probe.remove();
  }
  return colours.get(name);
}

const lines = globalThis.uPlot.paths.linear();

/** Lets what else is due have its turn: whoever holds the throttle must be heard. */
const breath = () => new Promise((resolve) => setTimeout(resolve));

const digits = (value) => (value == null ? "–" : Math.abs(value) >= 100 ? value.toFixed(1) : value.toPrecision(4));

export class Plots {
  /** `zoomed` hears of a piece that was selected, from and to in seconds. */
  constructor(place, choice, zoomed) {
    Object.assign(this, { place, choice, zoomed, plots: [], shown: [], marks: {}, data: null, cursor: null });
    new ResizeObserver(() => this.resize()).observe(place);
  }

  /** Offers these plots. */
  offer(plots) {
    if (this.plots === plots) return;
    this.plots = plots;
    this.choice.replaceChildren();
    for (const [index, [name, , , first]] of plots.entries()) {
      const label = document.createElement("label");
      const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: first });
      box.addEventListener("change", () => this.choose(index, box.checked));
      label.append(box, ` ${name}`);
      this.choice.append(label);
    }
    this.wanted = plots.map((plot) => plot[3]);
    this.rebuild();
  }

  choose(index, wanted) {
    this.wanted[index] = wanted;
    this.rebuild();
  }

  get width() {
    return Math.max(200, this.place.clientWidth - 12);
  }

  resize() {
    for (const { plot } of this.shown) plot.setSize({ width: this.width, height: HEIGHT });
  }

  /** Makes all plots anew, as after a change of the scheme or of the choice. */
  rebuild() {
    colours.clear();
    for (const { plot } of this.shown) plot.destroy();
    this.place.replaceChildren();
    this.shown = this.plots.flatMap((plot, index) => (this.wanted[index] ? [this.make(plot)] : []));
    if (this.data) this.draw(this.data);
  }

  make([name, unit, channels]) {
    const box = document.createElement("div");
    box.className = "plot";
    const head = document.createElement("h3");
    head.textContent = unit ? `${name}, ${unit}` : name;
    box.append(head);
    this.place.append(box);
    const [text, line] = [colour("--dim"), colour("--line")];
    const axis = { stroke: text, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 }, font: "11px system-ui" };
    const options = {
      width: this.width,
      height: HEIGHT,
      legend: { live: true },
      cursor: { sync: { key: "time" }, drag: { x: true, y: false, setScale: false }, points: { size: 5 } },
      scales: { x: { time: false }, y: { range: (_, min, max) => room(min, max, unit) } },
      axes: [{ ...axis, size: 28, values: (_, at) => at.map((t) => `${+t.toFixed(5)}`) }, { ...axis, size: AXIS, space: 18, values: (_, at) => at.map((value) => `${+value.toPrecision(4)}`) }],
      series: [
        { label: "t, s", value: (_, t) => (t == null ? "–" : t.toFixed(5)) },
        ...channels.map(([, label], i) => ({
          label, stroke: colour(COLOURS[i]), width: 1, points: { show: false }, spanGaps: this.plots === LINKED,
          fill: pale(colour(COLOURS[i])),
          paths: (plot, series, from, to) => this.paths(plot, series, from, to),
          value: (plot, value, series, at) => this.told(plot.data[series], value, at),
        })),
      ],
      hooks: {
        setSelect: [(plot) => this.select(plot)],
        setCursor: [(plot) => { if (plot.cursor.left >= 0) this.cursor = plot.posToVal(plot.cursor.left, "x"); }],
        draw: [(plot) => this.drawMarks(plot)],
      },
    };
    const plot = new globalThis.uPlot(options, [[], ...channels.map(() => [])], box);
    return { plot, channels: channels.map(([channel]) => channel), name, unit, labels: channels.map((c) => c[1]) };
  }

  /** A line where each value is known, and bounds where a column has many. */
  paths(plot, series, from, to) {
    if (this.data?.bounds) return envelope(plot, series);
    return { ...lines(plot, series, from, to), fill: null };
  }

  /** A value in words, or the bounds. */
  told(values, value, at) {
    if (value == null || at == null || !this.data?.bounds) return digits(value);
    const [least, greatest] = [values[at & ~1], values[at | 1]].map(digits);
    return least === greatest ? least : `${least} … ${greatest}`;
  }

  select(plot) {
    const { left, width } = plot.select;
    if (width < 3) return;
    this.zoomed(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }

  drawMarks(plot) {
    const { ctx, bbox } = plot;
    for (const [name, t] of Object.entries(this.marks)) {
      if (t == null || t < plot.scales.x.min || t > plot.scales.x.max) continue;
      const x = plot.valToPos(t, "x", true);
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = colour("--accent");
      ctx.setLineDash([4, 3]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.fillText(name, x + 3, bbox.top + 10);
      ctx.restore();
    }
  }

  /** The channels that are shown. */
  get channels() {
    return [...new Set(this.shown.flatMap((shown) => shown.channels))];
  }

  /** Draws a piece: times, values by the channel's name, the range of time, and whether the values are the least and
   * greatest of columns in turn. */
  async draw(data) {
    this.data = data;
    const { shown } = this;
    for (const { plot, channels } of shown) {
      await breath();
      if (shown !== this.shown) return;
      plot.batch(() => {
        plot.setData([data.t, ...channels.map((channel) => data.values[channel] ?? [])], false);
        plot.setScale("x", { min: data.from, max: data.to });
      });
    }
  }
}

/** The range of a unit's vertical axis: with some room, and no less than the least height. */
export function room(min, max, unit) {
  if (min == null) return [0, 1];
  const half = 0.58 * Math.max(max - min, LEAST[unit]);
  const middle = (min + max) / 2;
  return [middle - half, middle + half];
}
