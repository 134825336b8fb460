// The figures above the plots.

const NAMES = [
  ["rpm", "Speed, rpm"], ["amps", "Supply, A"], ["volts", "Supply, V"], ["watts", "Power, W"],
  ["celsius", "Board, °C"], ["efficiency", "Efficiency, %"], ["faults", "Faults"], ["limits", "Limits"],
];
const WIDE = ["faults", "limits"];
const LIVE = { faults: "assertive", limits: "polite" };
const LEAST_W = 1;
const NO_TEMPERATURE = 32767;

/** A number to some digits, without the sign of nothing. */
const digits = (value, count) => value.toFixed(count).replace(/^-(0(\.0*)?)$/, "$1");

export class Tiles {
  constructor(place) {
    this.tiles = {};
    this.faults = [];
    for (const [name, label] of NAMES) {
      const tile = document.createElement("div");
      tile.className = WIDE.includes(name) ? "tile wide" : "tile";
      const [value, text] = [document.createElement("b"), document.createElement("span")];
      value.id = `tile-${name}`;
      [value.textContent, text.textContent] = ["–", label];
      tile.append(value, text);
      // Read out as they come, faults at once.
      if (LIVE[name]) tile.setAttribute("aria-live", LIVE[name]);
      if (LIVE[name]) tile.setAttribute("aria-atomic", "true");
      place.append(tile);
      this.tiles[name] = value;
    }
  }

  /** Nothing is known any more. */
  unknown() {
    for (const name of Object.keys(this.tiles)) this.set(name, "–");
    this.tiles.faults.parentElement.classList.remove("bad");
    Object.assign(this, { estimate: null, truth: null, faults: [] });
  }

  set(name, text) {
    if (this.tiles[name].textContent !== text) this.tiles[name].textContent = text;
  }

  status({ rpm, voltage, current }, slot) {
    this.estimate = String(rpm[slot]);
    this.showSpeed();
    this.set("volts", digits(voltage[slot], 2));
    this.set("amps", digits(current[slot], 2));
    this.set("watts", digits(voltage[slot] * current[slot], 1));
  }

  info({ temperature }, slot) {
    this.set("celsius", temperature[slot] === NO_TEMPERATURE ? "–" : digits(temperature[slot] / 100, 1));
  }

  /** What the heartbeat tells. */
  conditions(faults, limits) {
    this.set("limits", limits.join(", ") || "none");
    this.showFaults(faults);
  }

  /** What the traces tell: the faults as they come, the true speed where `isLatest`, and power into the shaft against
   * that from the supply. */
  traces({ values }, faults, isLatest) {
    this.truth = this.isSimulated && isLatest ? values.rpm?.at(-1) : null;
    this.showFaults(faults);
    const mean = (list) => list.reduce((sum, value) => sum + value, 0) / list.length;
    if (!values.torque_nm) return;
    const [torque, rpm, volts, amps] = ["torque_nm", "rpm", "bus_v", "bus_a"].map((name) => mean(values[name]));
    const watts = volts * amps;
    const shaft = (torque * rpm * 2 * Math.PI) / 60;
    this.set("efficiency", watts > LEAST_W && shaft > 0 ? ((100 * shaft) / watts).toFixed(1) : "–");
  }

  /** Whether there are traces that tell the power into the shaft. */
  simulated(isSimulated) {
    this.isSimulated = isSimulated;
    this.tiles.efficiency.parentElement.hidden = !isSimulated;
  }

  /** The estimate, but with a fault: then the bridge is off, and the estimate only fades. */
  showSpeed() {
    const isFaulty = this.faults.length > 0;
    this.set("rpm", isFaulty ? (this.truth?.toFixed(0).replace(/^-0$/, "0") ?? "–") : (this.estimate ?? "–"));
    const label = !isFaulty ? "Speed, rpm" : this.truth == null ? "Speed unknown" : "True rpm";
    const { nextSibling } = this.tiles.rpm;
    if (nextSibling.textContent !== label) nextSibling.textContent = label;
  }

  /** Those that were told last, by whatever told them; null is no news. */
  showFaults(faults) {
    this.faults = faults ?? this.faults;
    this.showSpeed();
    this.set("faults", this.faults.join(", ") || "none");
    this.tiles.faults.parentElement.classList.toggle("bad", this.faults.length > 0);
  }
}
