// One ESC as a MAVLink client sees it: parameters, commands and files.

const ANSWER_MS = 1500;
const REAL32 = 9;
const RESULTS = ["accepted", "temporarily rejected", "denied", "not supported", "failed", "in progress", "cancelled"];
const IN_PROGRESS = 5;
/** MAV_STATE. */
const ACTIVE = 4;
const FTP = { terminate: 1, open: 4, read: 5, ack: 128 };
const FTP_DATA = 12;
/** A reason stands in a text of its own, close to the result. */
const REASON_MS = 300;
/** So many texts are remembered for that. */
const TEXTS = 20;

export class Esc extends EventTarget {
  constructor(link, system, component) {
    super();
    Object.assign(this, { link, system, component, params: new Map(), count: 0, waiting: [], sequence: 0, texts: [] });
    /** As the heartbeat last told: names of the faults, and MAV_STATE. */
    Object.assign(this, { faults: [], state: 0 });
    /** How many parameters are being set: whoever sets one tells why it was refused. */
    this.setting = 0;
  }

  send(name, message) {
    this.link.mavlink(name, { target_system: this.system, target_component: this.component, ...message });
  }

  take(message) {
    if (message.name === "PARAM_VALUE") {
      this.params.set(message.param_id, message.param_value);
      this.count = message.param_count;
      this.dispatchEvent(new CustomEvent("param", { detail: message.param_id }));
    }
    this.waiting = this.waiting.filter((look) => !look(message));
  }

  /** It has told a whole text. */
  said(text) {
    this.texts.push({ text, at: performance.now() });
    if (this.texts.length > TEXTS) this.texts.shift();
    this.dispatchEvent(new CustomEvent("text", { detail: text }));
  }

  /** What follows `begin` in the first text since a time that begins so; empty if there is none soon. */
  async reason(begin, since) {
    const found = () => this.texts.find(({ text, at }) => at >= since && text.startsWith(begin))?.text.slice(begin.length);
    if (found() === undefined) {
      await new Promise((resolve) => {
        const heard = () => { if (found() !== undefined) end(); };
        const end = () => {
          clearTimeout(timer);
          this.removeEventListener("text", heard);
          resolve();
        };
        const timer = setTimeout(end, REASON_MS);
        this.addEventListener("text", heard);
      });
    }
    return found() ?? "";
  }

  /** What keeps it from a test now. */
  get hindrance() {
    if (this.faults.length) return `a fault holds: ${this.faults.join(", ")}`;
    if (this.state === ACTIVE) return "the motor turns, or the throttle is open";
    return "it needs a motor at rest, no fault, and the throttle at zero or unplugged";
  }

  /** The first message for which `match` gives something, or null in time. */
  next(match, time = ANSWER_MS) {
    return new Promise((resolve) => {
      const timer = setTimeout(() => resolve(null), time);
      this.waiting.push((message) => {
        const found = match(message);
        if (found) {
          clearTimeout(timer);
          resolve(message);
        }
        return found;
      });
    });
  }

  async readParams() {
    this.params.clear();
    this.count = 0;
    this.send("PARAM_REQUEST_LIST", {});
    for (let tries = 0; tries < 20; tries++) {
      await new Promise((resolve) => setTimeout(resolve, 300));
      if (this.count > 0 && this.params.size >= this.count) return true;
      if (this.count === 0) this.send("PARAM_REQUEST_LIST", {});
    }
    return false;
  }

  /** Sets a parameter; what is in force afterwards, null without an answer, and why it is not the value, or null. */
  async setParam(name, value) {
    const begun = performance.now();
    const answer = this.next((m) => m.name === "PARAM_VALUE" && m.param_id === name);
    this.setting++;
    this.send("PARAM_SET", { param_id: name, param_value: value, param_type: REAL32 });
    const inForce = (await answer)?.param_value ?? null;
    let refused = null;
    if (inForce === null) refused = "no answer";
    else if (inForce !== Math.fround(value)) refused = (await this.reason(`${name} refused: `, begun)) || "no reason given";
    this.setting--;
    return { inForce, refused };
  }

  /** Sets many, in any order: what does not go with the old values may go with the others' new ones. Those that are
   * refused in the end, as name, value and reason. */
  async setParams(pairs) {
    let left = pairs.filter(([name, value]) => this.params.get(name) !== Math.fround(value));
    for (let before = Infinity; left.length && left.length < before;) {
      before = left.length;
      const again = [];
      for (const [name, value] of left) {
        const { refused } = await this.setParam(name, value);
        if (refused !== null) again.push([name, value, refused]);
      }
      left = again;
    }
    return left;
  }

  /** Sends a command; `progress` hears percentages until the result, a text, is there. */
  async command(command, params, progress = () => {}) {
    const ack = (time) => this.next((m) => m.name === "COMMAND_ACK" && m.command === command, time);
    let answer = ack(ANSWER_MS);
    this.send("COMMAND_LONG", { command, params });
    for (;;) {
      const got = await answer;
      if (!got) return "no answer";
      if (got.result !== IN_PROGRESS) return RESULTS[got.result] ?? `result ${got.result}`;
      progress(got.progress);
      answer = ack(20 * ANSWER_MS);
    }
  }

  async request(opcode, fields) {
    const payload = new Uint8Array(251);
    const view = new DataView(payload.buffer);
    const sequence = (this.sequence = (this.sequence + 2) & 0xffff);
    view.setUint16(0, sequence, true);
    payload.set([fields.session ?? 0, opcode, fields.size ?? 0], 2);
    view.setUint32(8, fields.offset ?? 0, true);
    payload.set(fields.data ?? [], FTP_DATA);
    const match = (m) => m.name === "FILE_TRANSFER_PROTOCOL" && (m.payload[0] | (m.payload[1] << 8)) === ((sequence + 1) & 0xffff);
    for (let tries = 0; tries < 3; tries++) {
      const answer = this.next(match);
      this.send("FILE_TRANSFER_PROTOCOL", { payload });
      const got = await answer;
      if (got) return got.payload;
    }
    return null;
  }

  /** A text file of the ESC's, or null. */
  async file(path) {
    const bytes = await this.bytes(path);
    return bytes && new TextDecoder().decode(bytes);
  }

  /** A file of the ESC's, or null. */
  async bytes(path) {
    const data = new TextEncoder().encode(path);
    const opened = await this.request(FTP.open, { data, size: data.length });
    if (opened?.[3] !== FTP.ack) return null;
    const [, , session] = opened;
    const bytes = [];
    for (;;) {
      const part = await this.request(FTP.read, { session, offset: bytes.length, size: 200 });
      if (part?.[3] !== FTP.ack || part[4] === 0) break;
      bytes.push(...part.slice(FTP_DATA, FTP_DATA + part[4]));
    }
    await this.request(FTP.terminate, { session });
    return new Uint8Array(bytes);
  }
}
