// Which piece of the traces is shown: the latest, a triggered one, or one that a person looks at.

const FRAME_MS = 40;
const SPANS = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];
/** Of telemetry, which is slower and kept for longer. */
const SLOW_SPANS = [0.5, 1, 2, 5, 10, 20, 60];
const DEFAULT_SPAN_S = { fast: 2, slow: 10 };
const BEFORE = 0.2;
const ALWAYS = ["rpm", "i_d_a", "i_q_a", "u_d_v", "u_q_v", "bus_v", "bus_a", "torque_nm", "faults", "phase", "throttle"];

const element = (id) => document.getElementById(id);

/** A span of time to three digits, in the unit that fits. */
function spelt(span) {
  const [unit, factor] = span < 1e-3 ? ["µs", 1e6] : span < 1 ? ["ms", 1e3] : ["s", 1];
  return `${+(span * factor).toPrecision(3)} ${unit}`;
}

export class Traces {
  /** `seen` hears each piece that is drawn. */
  constructor(link, plots, seen) {
    Object.assign(this, { link, plots, seen, source: null, spans: [], id: 0, span: 1, to: null, paused: false });
    /** Whether what is shown ends now. */
    this.isLatest = false;
    this.after = 0;
    this.latest = 0;
    element("span").addEventListener("change", () => this.zoom(Number(element("span").value)));
    element("pause").addEventListener("click", () => this.pause(!this.paused));
    element("live").addEventListener("click", () => this.live());
    element("zoom-in").addEventListener("click", () => this.zoom(this.span / 2));
    element("zoom-out").addEventListener("click", () => this.zoom(this.span * 2));
    element("trigger").addEventListener("change", () => this.arm());
    element("unmark").addEventListener("click", () => this.unmark());
    document.addEventListener("keydown", (event) => this.key(event));
    this.loop();
  }

  /** Takes the traces from there. */
  from(source, isSlow) {
    if (this.source === source) return;
    this.source = source;
    this.spans = isSlow ? SLOW_SPANS : SPANS;
    this.span = isSlow ? DEFAULT_SPAN_S.slow : DEFAULT_SPAN_S.fast;
    element("span").replaceChildren(...this.spans.map((span) => new Option(spelt(span), span)));
    const usual = isSlow ? "rpm" : "i_a_a";
    element("trigger-channel").replaceChildren(...source.channels.map((name) => new Option(name, name, false, name === usual)));
    this.live();
  }

  arm() {
    element("trigger-level").hidden = element("trigger").value !== "level";
    this.after = this.latest;
    this.live();
  }

  pause(paused) {
    this.paused = paused;
    if (paused) this.to ??= this.latest;
    else this.to = null;
    element("pause").setAttribute("aria-pressed", paused);
    this.dirty = true;
  }

  live() {
    this.pause(false);
    this.zoom(Math.max(this.span, this.spans[0]));
  }

  zoom(span) {
    const old = this.span;
    this.span = Math.min(Math.max(span, 1e-4), this.spans.at(-1));
    // About the middle of what a person looks at.
    if (this.paused) this.to = this.to - old / 2 + this.span / 2;
    this.showSpan();
  }

  look(from, to) {
    this.pause(true);
    this.to = to;
    this.span = to - from;
    this.showSpan();
  }

  /** One that was zoomed to stands above the usual ones. */
  showSpan() {
    const select = element("span");
    select.querySelector(".zoomed")?.remove();
    if (!this.spans.includes(this.span)) {
      select.prepend(Object.assign(new Option(spelt(this.span), this.span), { className: "zoomed" }));
    }
    select.value = this.span;
    this.dirty = true;
  }

  key(event) {
    if (event.target.closest("input, select, textarea, summary") || event.ctrlKey || event.metaKey || event.altKey) return;
    const pan = (share) => { this.pause(true); this.to += share * this.span; };
    const keys = {
      p: () => this.pause(!this.paused), l: () => this.live(),
      "+": () => this.zoom(this.span / 2), "-": () => this.zoom(this.span * 2),
      ArrowLeft: () => pan(-0.25), ArrowRight: () => pan(0.25),
      a: () => this.mark("A"), b: () => this.mark("B"), c: () => this.unmark(),
    };
    if (!keys[event.key] || element("scope").hidden) return;
    keys[event.key]();
    event.preventDefault();
  }

  mark(name) {
    const { marks, cursor } = this.plots;
    marks[name] = marks[name] == null || marks[name] !== cursor ? cursor : null;
    this.showMarks();
  }

  /** Takes off those that a person has set. */
  unmark() {
    Object.assign(this.plots.marks, { A: null, B: null });
    this.showMarks();
  }

  showMarks() {
    const { A, B } = this.plots.marks;
    const apart = A != null && B != null ? `, B − A ${((B - A) * 1e3).toFixed(3)} ms, ${(1 / Math.abs(B - A)).toFixed(2)} Hz` : "";
    const told = Object.entries({ A, B }).filter(([, t]) => t != null).map(([name, t]) => `${name} ${t.toFixed(5)} s`);
    element("cursors").textContent = told.join(", ") + apart;
    element("unmark").hidden = told.length === 0;
    this.dirty = true;
  }

  trigger() {
    const kind = element("trigger").value;
    if (kind === "none" || this.paused) return null;
    const common = { before: BEFORE, after_s: this.after };
    if (kind === "level") {
      const level = Number(element("trigger-value").value);
      return { ...common, channel: element("trigger-channel").value, level, rising: element("trigger-edge").value === "up" };
    }
    // A start-up is where the throttle opens: its first step is a 2000th.
    const [name, level] = kind === "fault" ? ["faults", 0.5] : ["throttle", 1e-4];
    return { ...common, channel: name, level, rising: true };
  }

  async loop() {
    for (;;) {
      const begun = performance.now();
      if (this.link.isOpen && this.source && !document.hidden && (!this.paused || this.dirty)) {
        this.dirty = false;
        await this.fetch();
      }
      // A page that is slow to draw leaves the machine to the others.
      const took = performance.now() - begun;
      await new Promise((resolve) => setTimeout(resolve, Math.max(FRAME_MS - took, took)));
    }
  }

  async fetch() {
    const names = [...new Set([...this.plots.channels, ...ALWAYS.filter((name) => this.source.channels.includes(name))])];
    const view = {
      id: ++this.id, esc: this.link.esc, to_s: this.paused ? this.to : null, span_s: this.span,
      columns: Math.round(this.plots.width), trigger: this.trigger(), hold: this.paused,
    };
    const found = await this.source.view(view, names);
    if (found?.t.length) await this.show(found);
  }

  async show({ t, values, crossing, bounds = false }) {
    const kind = element("trigger").value;
    if (!this.paused && crossing === null) this.latest = t.at(-1);
    this.plots.marks.T = crossing ?? (this.paused ? this.plots.marks.T : null);
    const to = crossing === null ? (this.paused ? this.to : t.at(-1)) : crossing + (1 - BEFORE) * this.span;
    const data = { t, values, bounds, from: to - this.span, to };
    // The figures need not wait for the plots.
    this.isLatest = !this.paused && crossing === null;
    this.seen(data);
    await this.plots.draw(data);
    if (crossing !== null && (kind === "fault" || kind === "start")) {
      // The next one is another.
      this.after = crossing;
      this.to = to;
      this.pause(true);
    }
  }
}
