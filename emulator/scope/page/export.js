// What is on the screen as a file.

import { runs } from "./envelope.js";
import { colour } from "./plots.js";

const WIDTH = 1000;
const HEIGHT = 160;
const LEFT = 60;
const COLOURS = ["--trace-0", "--trace-1", "--trace-2"];

export function download(name, blob) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const escaped = (text) => text.replace(/[&<>]/g, (sign) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;" })[sign]);

/** The bounds of a trace: an area with its edges. */
function area(pieces, x, y, colour) {
  const edge = (points) => points.map(([t, value]) => `${x(t).toFixed(1)} ${y(value).toFixed(1)}`).join("L");
  return pieces.map((run) => {
    const upper = run.map(([t, , greatest]) => [t, greatest]);
    const lower = run.map(([t, least]) => [t, least]);
    const edges = `<path d="M${edge(upper)}M${edge(lower)}" fill="none" stroke="${colour}"/>`;
    return `<path d="M${edge([...upper, ...lower.toReversed()])}Z" fill="${colour}" fill-opacity="0.25"/>${edges}`;
  }).join("");
}

/** The plots as one SVG. */
export function svg({ shown, data }) {
  const [line, text, back] = ["--line", "--text", "--card"].map(colour);
  const parts = shown.map(({ plot, channels, name, unit, labels }, row) => {
    const { min, max } = plot.scales.y;
    const x = (t) => LEFT + ((t - data.from) / (data.to - data.from)) * (WIDTH - LEFT - 10);
    const y = (value) => 24 + (1 - (value - min) / (max - min)) * (HEIGHT - 40);
    const traces = channels.map((channel, i) => {
      const values = data.values[channel] ?? [];
      if (data.bounds) return area(runs(data.t, values), x, y, colour(COLOURS[i]));
      let pen = "M";
      const path = data.t.map((t, at) => {
        if (values[at] == null || t < data.from) { pen = "M"; return ""; }
        const step = `${pen}${x(t).toFixed(1)} ${y(values[at]).toFixed(1)}`;
        pen = "L";
        return step;
      });
      return `<path d="${path.join("")}" fill="none" stroke="${colour(COLOURS[i])}"/>`;
    });
    const legend = labels.map((label, i) => `<tspan fill="${colour(COLOURS[i])}" dx="12">${escaped(label)}</tspan>`).join("");
    const grid = [min, (min + max) / 2, max].map((value) =>
      `<path d="M${LEFT} ${y(value)}H${WIDTH - 10}" stroke="${line}"/><text x="${LEFT - 6}" y="${y(value) + 4}" text-anchor="end">${value.toPrecision(4)}</text>`);
    return `<g transform="translate(0 ${row * HEIGHT})"><text x="${LEFT}" y="16">${escaped(unit ? `${name}, ${unit}` : name)}${legend}</text>${grid.join("")}${traces.join("")}</g>`;
  });
  const height = shown.length * HEIGHT + 24;
  const times = [0, 0.25, 0.5, 0.75, 1].map((share) => {
    const t = data.from + share * (data.to - data.from);
    return `<text x="${LEFT + share * (WIDTH - LEFT - 10)}" y="${height - 8}" text-anchor="middle">${t.toFixed(4)} s</text>`;
  });
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${height}" font-family="sans-serif" font-size="11" fill="${text}"><rect width="100%" height="100%" fill="${back}"/>${parts.join("")}${times.join("")}</svg>\n`;
}

/** The plots as one picture, as they stand. */
export function png({ shown }) {
  const sheet = document.createElement("canvas");
  const pictures = shown.map(({ plot }) => plot.ctx.canvas);
  const title = 18 * devicePixelRatio;
  sheet.width = Math.max(...pictures.map(({ width }) => width));
  sheet.height = pictures.reduce((sum, { height }) => sum + height + title, 0);
  const draw = sheet.getContext("2d");
  draw.fillStyle = colour("--card");
  draw.fillRect(0, 0, sheet.width, sheet.height);
  draw.fillStyle = colour("--text");
  draw.font = `${12 * devicePixelRatio}px sans-serif`;
  let y = 0;
  for (const [i, picture] of pictures.entries()) {
    draw.fillText(shown[i].unit ? `${shown[i].name}, ${shown[i].unit}` : shown[i].name, 8, y + title * 0.75);
    draw.drawImage(picture, 0, y + title);
    y += picture.height + title;
  }
  return new Promise((resolve) => sheet.toBlob(resolve));
}

/** The piece that is shown, as it is shown: exact where it is zoomed in, else the bounds of each column. */
export function csv({ data, channels }) {
  const rows = data.t.map((t, at) => [t.toFixed(9), ...channels.map((channel) => data.values[channel]?.[at] ?? "")].join(","));
  return `t_s,${channels.join(",")}\n${rows.join("\n")}\n`;
}
