// What the ESC has on record, as files.

import { download } from "./export.js";

const element = (id) => document.getElementById(id);

/** Of the ESC's by MAVLink FTP: path, name of the file, label. */
const FILES = [
  ["@SYS/faults.bin", "faults.bin", "Fault record"],
  ["@SYS/faults.txt", "faults.txt", "Faults in words"],
  ["@SYS/statistics.txt", "statistics.txt", "Statistics"],
];

export class Records {
  constructor(esc, told) {
    this.names = [];
    this.link = Object.assign(document.createElement("a"), { className: "button", id: "recording", hidden: true });
    element("records").append(this.link);
    for (const [path, name, label] of FILES) {
      const button = Object.assign(document.createElement("button"), { textContent: label, id: `record-${name.replace(".", "-")}` });
      button.addEventListener("click", async () => {
        button.disabled = true;
        const bytes = await esc()?.bytes(path);
        button.disabled = false;
        if (bytes) download(name, new Blob([bytes], { type: "application/octet-stream" }));
        else told(`${label}: this ESC keeps none, or cannot give it now`, true);
      });
      element("records").append(button);
    }
  }

  /** What the program records of each ESC, null where it cannot be fetched before its end. */
  recorded(names, i) {
    this.names = names;
    this.choose(i);
  }

  choose(i) {
    const name = this.names[i];
    this.link.hidden = !name;
    if (!name) return;
    this.link.href = `recording/${i}${location.search}`;
    this.link.download = name;
    this.link.textContent = `${name} so far`;
  }
}
