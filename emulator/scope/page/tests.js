// Self-test and identification, with their progress and what they have found.

const SELF_TEST = 401;
const IDENTIFY = 31010;
const END = 0;
const BEGIN = 1;
const KEEP = 2;
/** Results with which there is something new to read, and the one that depends on the ESC's state. */
const CARRIED_OUT = ["accepted", "failed"];
const REFUSED = "temporarily rejected";
/** The ESC's text on why begins so. */
const NOT_NOW = "Not now: ";

const element = (id) => document.getElementById(id);

export class Tests {
  constructor(esc, told) {
    Object.assign(this, { esc, told });
    element("self-test").addEventListener("click", () => this.run("Self-test", SELF_TEST, [1], "@SYS/check.txt"));
    element("identify").addEventListener("click", async () => {
      this.identified = this.esc();
      const result = await this.run("Identification", IDENTIFY, [BEGIN], "@SYS/identify.txt");
      this.identified = null;
      element("keep").disabled = result !== "accepted";
    });
    // Nobody looks any more at what turns.
    const end = () => { if (this.identified) this.identified.send("COMMAND_LONG", { command: IDENTIFY, params: [END] }); };
    window.addEventListener("pagehide", end);
    document.addEventListener("visibilitychange", () => document.hidden && end());
    element("keep").addEventListener("click", async () => {
      const result = await this.esc()?.command(IDENTIFY, [KEEP]);
      this.told(`Keeping what was found: ${result}`, result !== "accepted");
    });
  }

  async run(name, command, params, path) {
    const esc = this.esc();
    if (!esc) return null;
    const [bar, report] = [element("progress"), element("report")];
    const buttons = ["self-test", "identify"].map(element);
    buttons.forEach((button) => { button.disabled = true; });
    report.hidden = true;
    bar.hidden = false;
    bar.value = 0;
    this.told(`${name} begins`);
    const begun = performance.now();
    const result = await esc.command(command, params, (percent) => { if (percent <= 100) bar.value = percent; });
    const outcome = await this.outcome(esc, result, begun);
    this.told(`${name}: ${outcome}`, result !== "accepted");
    // What was not carried out leaves the file of the time before.
    const text = CARRIED_OUT.includes(result) ? await esc.file(path) : `${name}: ${outcome}`;
    bar.hidden = true;
    buttons.forEach((button) => { button.disabled = false; });
    report.hidden = !text;
    report.textContent = text ?? "";
    return result;
  }

  /** The result in words: of a refusal with the reason, the ESC's own or what is known of its state. */
  async outcome(esc, result, begun) {
    if (result !== REFUSED) return result;
    return `refused, ${(await esc.reason(NOT_NOW, begun)) || esc.hindrance}`;
  }
}
