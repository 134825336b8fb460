// The throttle, by a dead man's handle: it is zero unless the slider or the space bar is held.

const EVERY_MS = 40;
const STEP = 2;
const DISARM = 400;
const PULSES = [1, 2, 3, 4];

const element = (id) => document.getElementById(id);

export class ThrottleHandle {
  /** `esc` gives the ESC, `told` a line for the log. */
  constructor(link, esc, told) {
    Object.assign(this, { link, esc, told, armed: false, held: false, count: 1, all: element("throttle-all") });
    this.slider = element("throttle");
    element("arm").addEventListener("click", () => this.arm(!this.armed));
    this.all.addEventListener("change", () => this.arm(false));
    element("stop").addEventListener("click", () => this.stop());
    this.slider.addEventListener("pointerdown", () => this.hold(true));
    for (const event of ["pointerup", "pointercancel", "blur"]) this.slider.addEventListener(event, () => this.hold(false));
    for (const event of ["pointerup", "blur"]) window.addEventListener(event, () => this.hold(false));
    this.slider.addEventListener("input", () => this.held || this.letGo());
    this.slider.addEventListener("keydown", (event) => this.key(event));
    this.slider.addEventListener("keyup", ({ key }) => key === " " && this.hold(false));
    document.addEventListener("keydown", ({ key }) => key === "Escape" && this.stop());
    document.addEventListener("visibilitychange", () => document.hidden && this.arm(false));
    window.addEventListener("pagehide", () => this.arm(false));
    setInterval(() => this.send(), EVERY_MS);
  }

  /** There are so many ESCs, which may be driven together. */
  several(count) {
    this.count = count ?? 1;
    this.all.parentElement.hidden = this.count < 2;
  }

  /** Those that are driven: of several the one that is looked at, or all. */
  get escs() {
    return this.all.checked ? Array.from({ length: this.count }, (_, i) => i) : [this.link.esc];
  }

  key(event) {
    const steps = { ArrowUp: STEP, ArrowRight: STEP, ArrowDown: -STEP, ArrowLeft: -STEP };
    if (event.key === " ") this.hold(true);
    else if (this.held && steps[event.key]) this.slider.value = Number(this.slider.value) + steps[event.key];
    else if (event.key === "Tab" || event.key === "Escape") return;
    event.preventDefault();
    this.show();
  }

  hold(held) {
    if (this.held === held) return;
    this.held = held;
    if (!held) this.letGo();
    this.send();
  }

  letGo() {
    this.slider.value = 0;
    this.show();
  }

  get value() {
    return this.held ? Number(this.slider.value) / 100 : 0;
  }

  arm(armed) {
    const signal = this.esc()?.params.get("INP_PROTO") ?? 0;
    if (armed && PULSES.includes(signal)) {
      this.told("The page sends DShot, and INP_PROTO wants pulses: set it to 0 (automatic)", true);
      return;
    }
    // To all, whichever were driven.
    if (this.armed && !armed) for (let esc = 0; esc < this.count; esc++) this.link.ask({ silence: { esc } });
    this.armed = armed;
    this.signal = signal;
    this.slider.disabled = !armed;
    element("arm").textContent = armed ? "Disarm" : "Arm";
    // Its keys are of use at once.
    if (armed) this.slider.focus();
    this.hold(false);
    this.letGo();
  }

  stop() {
    this.hold(false);
    this.letGo();
    this.send();
    this.arm(false);
    this.esc()?.command(DISARM, [0]);
  }

  refused() {
    if (this.armed) this.arm(false);
  }

  send() {
    if (!this.armed) return;
    for (const esc of this.escs) this.link.ask({ throttle: { esc, value: this.value, signal: this.signal } });
    this.show();
  }

  show() {
    element("throttle-value").textContent = `${this.slider.value} %`;
  }
}
