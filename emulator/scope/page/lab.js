// The laboratory: faults that a person lets happen, another supply, another load.

const element = (id) => document.getElementById(id);

/** Kinds as `--fault` names them: label, whether a phase and a side are wanted, and the value's unit and default. */
const FAULTS = {
  phase_open: ["phase wire open", true], mosfet_open: ["switch never turns on", true, true],
  mosfet_short: ["switch always on", true, true], sensor_stuck: ["current sensor stuck", true, false, "A", 5],
  offset_drift: ["current sensor drifts", true, false, "A", 3],
  resistance_drift: ["resistance grows", false, false, "share", 0.4],
  flux_drift: ["flux grows", false, false, "share", -0.08],
  noise: ["noise on currents", false, false, "A rms", 1],
  hall_stuck: ["Hall sensor stuck", true, false, "level", 1], rotor_blocked: ["rotor blocked"],
  rotor_kick: ["rotor kicked", false, false, "rpm", 500], gust: ["gust", false, false, "rpm", 1000],
  strike: ["torque on the shaft", false, false, "Nm", 0.2], bus_sag: ["supply sags", false, false, "V", 5],
  bus_disconnect: ["supply disconnected"], brown_out: ["brown-out", false, false, "V", 3],
  signal_loss: ["throttle signal lost"], bit_errors: ["bit errors on the wire", false, false, "share", 0.01],
  jitter: ["jitter on the wire", false, false, "ns rms", 100], reset: ["chip reset"], flash_fail: ["flash refuses"],
};

/** What is known of a motor's winding. */
const OF_MOTOR = ["MOT_FLUX_MWB", "MOT_L_UH", "MOT_R_MOHM"];

export class Lab {
  /** `esc` gives the ESC, `letGo` has the throttle let go, and `told` hears a line for the log. */
  constructor(link, esc, letGo, told) {
    Object.assign(this, { link, esc, letGo, told, plays: false });
    for (const [kind, [label]] of Object.entries(FAULTS)) element("fault").append(new Option(label, kind));
    element("fault").addEventListener("change", () => this.choose());
    element("inject").addEventListener("click", () => this.inject());
    element("mend").addEventListener("click", () => this.mend());
    element("supply").addEventListener("input", () => this.vary("supply", "V", (value) => `kind = "bus_sag", value = ${-value}`));
    element("load").addEventListener("input", () => this.vary("load", "Nm", (value) => `kind = "strike", value = ${-value}`));
    element("fit").addEventListener("click", () => this.link.ask({ fit: { esc: this.link.esc, bench: element("bench").value } }));
    element("scenario").addEventListener("change", ({ target }) => this.play(target));
    element("scenario").parentElement.addEventListener("keydown", ({ key }) => key === "Enter" && element("scenario").click());
    document.addEventListener("visibilitychange", () => document.hidden && this.stop());
    document.addEventListener("keydown", ({ key }) => key === "Escape" && this.stop());
    element("stop").addEventListener("click", () => this.stop());
    this.choose();
  }

  /** There are these benches. */
  benches(names) {
    element("bench").replaceChildren(...names.map((name) => new Option(name, name)));
  }

  /** This motor and load stand there. */
  stands({ esc, names: [motor, load] }) {
    if (esc === this.link.esc) element("stands").textContent = `Runs ${motor} with ${load}`;
  }

  /** Another motor stands there, and the ESC would have to know this of it. */
  async fitted({ names: [motor, load], params }) {
    this.told(`Laboratory: ${motor} with ${load}`);
    if (!element("fit-tell").checked) {
      this.told("The ESC knows nothing of this motor: identify it, or set its parameters");
      return;
    }
    const esc = this.esc();
    // A motor that is not known binds no other value.
    await esc.setParams(params.filter(([name]) => OF_MOTOR.includes(name)).map(([name]) => [name, 0]));
    const left = await esc.setParams(params);
    const refused = left.map(([name, , reason]) => `${name} (${reason})`).join(", ");
    this.told(`The ESC knows this motor${refused && `, but refused ${refused}`}`, refused !== "");
  }

  /** Plays a scenario's file on what runs. */
  async play(input) {
    const [file] = input.files;
    const text = await file?.text();
    input.value = "";
    if (text === undefined) return;
    this.letGo();
    this.plays = true;
    this.link.ask({ scenario: { esc: this.link.esc, text } });
    this.told(`Scenario: ${file.name} begins`);
  }

  /** It has come to its end, with these faults, null if unknown, and these expectations, each a sentence and whether
   * it held, null if unknown. */
  over({ faults, expectations }) {
    this.plays = false;
    for (const [sentence, held] of expectations.toReversed()) {
      this.told(`${held === null ? "Not seen" : held ? "Held" : "FAILED"}: ${sentence}`, held === false);
    }
    const held = expectations.filter(([, held]) => held).length;
    const verdict = expectations.length ? `${held} of ${expectations.length} expectations held` : "it expects nothing";
    const seen = faults?.length ? `faults: ${faults.join(", ")}` : faults ? "no fault" : null;
    this.told(["Scenario: over", verdict, seen].filter(Boolean).join("; "), expectations.some(([, held]) => held === false));
  }

  refused() {
    this.stop();
  }

  stop() {
    if (!this.plays) return;
    this.plays = false;
    this.link.ask({ silence: { esc: this.link.esc } });
    this.told("Scenario: stopped");
  }

  choose() {
    const [, phase, side, unit, value] = FAULTS[element("fault").value];
    element("fault-phase").hidden = !phase;
    element("fault-side").hidden = !side;
    element("fault-value-label").hidden = !unit;
    element("fault-unit").textContent = unit ?? "";
    element("fault-value").value = value ?? "";
  }

  inject() {
    const kind = element("fault").value;
    const [label, phase, side, unit] = FAULTS[kind];
    const float = (id) => { const text = String(Number(element(id).value)); return /[.e]/.test(text) ? text : `${text}.0`; };
    const keys = [`kind = "${kind}"`];
    if (phase) keys.push(`phase = ${element("fault-phase").value}`);
    if (side) keys.push(`side = "${element("fault-side").value}"`);
    if (unit) keys.push(`value = ${float("fault-value")}`);
    if (element("fault-time").value) keys.push(`for_s = ${float("fault-time")}`);
    this.link.ask({ fault: { esc: this.link.esc, keys: keys.join(", ") } });
    this.told(`Laboratory: ${label}`);
  }

  mend() {
    this.link.ask({ mend: { esc: this.link.esc } });
    for (const id of ["supply", "load"]) element(id).value = 0;
    element("supply-value").textContent = "±0 V";
    element("load-value").textContent = "±0 Nm";
    this.told("Laboratory: all mended");
  }

  vary(id, unit, keys) {
    const value = Number(element(id).value);
    element(`${id}-value`).textContent = `${value > 0 ? "+" : value < 0 ? "−" : "±"}${Math.abs(value)} ${unit}`;
    this.link.ask({ fault: { esc: this.link.esc, keys: keys(value.toFixed(3)).replace("--", "") } });
  }
}
