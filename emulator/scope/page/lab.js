// The laboratory: faults that a person lets happen, another supply, another load.

const element = (id) => document.getElementById(id);

/** Kinds as `--fault` names them: label, whether a phase and a side are wanted, and the value's unit and default. */
const FAULTS = {
  phase_open: ["phase wire open", true], mosfet_open: ["switch never turns on", true, true],
  mosfet_short: ["switch always on", true, true], sensor_stuck: ["current sensor stuck", true, false, "A", 5],
  offset_drift: ["current sensor drifts", true, false, "A", 3], noise: ["noise on currents", false, false, "A rms", 1],
  hall_stuck: ["Hall sensor stuck", true, false, "level", 1], rotor_blocked: ["rotor blocked"],
  rotor_kick: ["rotor kicked", false, false, "rpm", 500], gust: ["gust", false, false, "rpm", 1000],
  strike: ["torque on the shaft", false, false, "Nm", 0.2], bus_sag: ["supply sags", false, false, "V", 5],
  bus_disconnect: ["supply disconnected"], brown_out: ["brown-out", false, false, "V", 3],
  signal_loss: ["throttle signal lost"], bit_errors: ["bit errors on the wire", false, false, "share", 0.01],
  jitter: ["jitter on the wire", false, false, "ns rms", 100], reset: ["chip reset"], flash_fail: ["flash refuses"],
};

export class Lab {
  constructor(link, told) {
    Object.assign(this, { link, told });
    for (const [kind, [label]] of Object.entries(FAULTS)) element("fault").append(new Option(label, kind));
    element("fault").addEventListener("change", () => this.choose());
    element("inject").addEventListener("click", () => this.inject());
    element("mend").addEventListener("click", () => this.mend());
    element("supply").addEventListener("input", () => this.vary("supply", "V", (value) => `kind = "bus_sag", value = ${-value}`));
    element("load").addEventListener("input", () => this.vary("load", "Nm", (value) => `kind = "strike", value = ${-value}`));
    this.choose();
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
