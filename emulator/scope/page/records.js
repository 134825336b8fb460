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
}
