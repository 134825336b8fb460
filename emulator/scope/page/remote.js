// Traces of a simulated ESC: the program keeps them at the control's rate, and gives the piece that is asked for.

const ANSWER_MS = 1000;

export class Remote {
  constructor(link) {
    Object.assign(this, { link, channels: [], busy: null });
  }

  /** A piece: times, values by channel, and where the trigger was; null without an answer. */
  view(view, names) {
    this.link.ask({ view: { ...view, channels: names.map((name) => this.channels.indexOf(name)), trigger: this.trigger(view.trigger) } });
    return new Promise((resolve) => {
      this.busy = { id: view.id, names, resolve };
      setTimeout(() => resolve(null), ANSWER_MS);
    });
  }

  trigger(trigger) {
    return trigger && { ...trigger, channel: this.channels.indexOf(trigger.channel) };
  }

  /** An answer, as the program's `view.rs` lays it out. */
  take(buffer) {
    const view = new DataView(buffer);
    const [id, , points] = [4, 8, 12].map((at) => view.getUint32(at, true));
    if (this.busy?.id !== id) return;
    const { names, resolve } = this.busy;
    const t = Array.from(new Float64Array(buffer, 32, points));
    const start = 32 + 8 * points;
    const known = (value) => (Number.isNaN(value) ? null : value);
    const values = Object.fromEntries(names.map((name, i) => [name, Array.from(new Float32Array(buffer, start + 4 * i * points, points), known)]));
    resolve({ t, values, bounds: view.getUint8(2) === 1, crossing: view.getUint8(1) === 1 ? view.getFloat64(24, true) : null });
  }
}
