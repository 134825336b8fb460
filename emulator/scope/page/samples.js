// Traces of an ESC on a link: what its telemetry tells, as it comes.

const KEPT_S = 120;
/** After so long without streamed signals, ESC_STATUS has to do. */
const STREAM_S = 1;
/** What TEL_SIGNALS streams, and the channel that it is. */
const SIGNALS = {
  rpm: "rpm", rpm_ref: "rpm_ref", i_d: "i_d_a", i_q: "i_q_a", v_d: "u_d_v", v_q: "u_q_v", duty: "duty", bus_v: "bus_v", bus_a: "bus_a",
};
/** What stays as it was last told. */
const LASTING = ["celsius", "faults"];

export class Samples {
  channels = [...Object.values(SIGNALS), ...LASTING];

  constructor() {
    this.clear();
  }

  clear() {
    this.t = [];
    this.values = Object.fromEntries(this.channels.map((name) => [name, []]));
    this.streamed = -Infinity;
    this.lasting = {};
    this.held = null;
  }

  signal({ signal, value, time_boot_ms }) {
    if (!SIGNALS[signal]) return;
    this.streamed = time_boot_ms / 1e3;
    this.row(this.streamed, { [SIGNALS[signal]]: value });
  }

  status({ time_usec, rpm, voltage, current }, slot) {
    const t = Number(time_usec) / 1e6;
    if (t - this.streamed > STREAM_S) this.row(t, { rpm: rpm[slot], bus_v: voltage[slot], bus_a: current[slot] });
  }

  last(name, value) {
    this.lasting[name] = value;
  }

  row(t, values) {
    const latest = this.t.at(-1);
    // It has started anew.
    if (t < latest - STREAM_S) this.clear();
    else if (t < latest) return;
    if (t !== latest) {
      this.t.push(t);
      for (const name of this.channels) this.values[name].push(this.lasting[name] ?? null);
      // By halves, since to take away is to move all.
      if (t - this.t[0] > 2 * KEPT_S) this.forget(t - KEPT_S);
    }
    const at = this.t.length - 1;
    for (const [name, value] of Object.entries(values)) this.values[name][at] = value;
  }

  forget(before) {
    const from = first(this.t, before);
    this.t = this.t.slice(from);
    for (const name of this.channels) this.values[name] = this.values[name].slice(from);
  }

  async view({ to_s, span_s, trigger, hold }, names) {
    if (!hold) this.held = null;
    else this.held ??= { t: [...this.t], values: Object.fromEntries(this.channels.map((name) => [name, [...this.values[name]]])) };
    const { t, values } = this.held ?? this;
    let to = to_s ?? t.at(-1) ?? 0;
    const crossing = trigger && this.crossing(trigger, t, values, span_s);
    if (crossing != null) to = crossing + (1 - trigger.before) * span_s;
    // One more on either side, so that lines reach the edges.
    const [from, end] = [Math.max(first(t, to - span_s) - 1, 0), first(t, to) + 2];
    const piece = (name) => values[name]?.slice(from, end) ?? [];
    return { t: t.slice(from, end), values: Object.fromEntries(names.map((name) => [name, piece(name)])), crossing: crossing ?? null };
  }

  /** The latest crossing of which all is there that is to be shown. */
  crossing({ channel, level, rising, before, after_s }, t, values, span) {
    const is = (value) => value != null && (rising ? value >= level : value <= level);
    const list = values[channel] ?? [];
    for (let at = first(t, t.at(-1) - (1 - before) * span) - 1; at > 0 && t[at] > after_s; at--) {
      if (is(list[at]) && list[at - 1] != null && !is(list[at - 1])) return t[at];
    }
    return null;
  }
}

/** The first place of a time that is this or later. */
function first(t, wanted) {
  let [low, high] = [0, t.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (t[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}
