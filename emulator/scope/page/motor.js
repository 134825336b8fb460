// A motor test of an ESC on a link: while the button is held, and for no longer than the ESC allows.

const ACTUATOR_TEST = 310;
const DISARM = 400;
const LONGEST_S = 3;

const element = (id) => document.getElementById(id);

export class MotorTest {
  /** `esc` gives the ESC, `told` a line for the log. */
  constructor(esc, told) {
    Object.assign(this, { esc, told, of: null });
    const button = element("turn");
    button.addEventListener("pointerdown", () => this.begin());
    for (const event of ["pointerup", "pointercancel", "pointerleave", "blur", "keyup"]) button.addEventListener(event, () => this.end());
    for (const event of ["pointerup", "blur", "pagehide"]) window.addEventListener(event, () => this.end());
    button.addEventListener("keydown", (event) => {
      if (event.key === "Escape" || event.key === "Tab") return;
      event.preventDefault();
      if (event.key === " " && !event.repeat) this.begin();
    });
    document.addEventListener("visibilitychange", () => document.hidden && this.end());
    document.addEventListener("keydown", ({ key }) => key === "Escape" && this.stop());
    element("halt").addEventListener("click", () => this.stop());
    element("test-value").addEventListener("input", () => this.show());
  }

  async begin() {
    const esc = this.esc();
    if (this.of || !esc) return;
    this.of = esc;
    this.show();
    const result = await esc.command(ACTUATOR_TEST, [Number(element("test-value").value) / 100, LONGEST_S]);
    const told = result === "temporarily rejected" ? `refused, ${esc.hindrance}` : result;
    if (result !== "accepted") this.told(`Motor test: ${told}`, true);
  }

  end() {
    // What is not held any more has no value.
    this.of?.send("COMMAND_LONG", { command: ACTUATOR_TEST, params: [NaN] });
    this.of = null;
    this.show();
  }

  /** Ends whatever turns the motor. */
  stop() {
    this.end();
    this.esc()?.command(DISARM, [0]);
  }

  refused() {
    this.end();
  }

  show() {
    element("test-percent").textContent = `${element("test-value").value} %`;
    element("turn").setAttribute("aria-pressed", this.of !== null);
  }
}
