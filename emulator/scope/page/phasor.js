// Current and voltage in the rotor's frame, as arrows.

import { colour } from "./plots.js";

const element = (id) => document.getElementById(id);

/** Rounds up to 1, 2 or 5 times a power of ten. */
function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].find((step) => step * power >= value) * power;
}

export function drawPhasor({ i_d, i_q, u_d, u_q }) {
  const canvas = element("phasor");
  const scale = devicePixelRatio;
  const [width, height] = [canvas.clientWidth, 200];
  if (canvas.width !== Math.round(width * scale)) [canvas.width, canvas.height] = [width * scale, height * scale];
  canvas.style.height = `${height}px`;
  const draw = canvas.getContext("2d");
  draw.setTransform(scale, 0, 0, scale, 0, 0);
  draw.clearRect(0, 0, width, height);
  const [x, y, radius] = [width / 2, height / 2, height / 2 - 16];
  draw.strokeStyle = colour("--line");
  draw.fillStyle = colour("--dim");
  draw.font = "11px system-ui";
  for (const share of [0.5, 1]) {
    draw.beginPath();
    draw.arc(x, y, radius * share, 0, 2 * Math.PI);
    draw.stroke();
  }
  draw.beginPath();
  draw.moveTo(x - radius, y);
  draw.lineTo(x + radius, y);
  draw.moveTo(x, y - radius);
  draw.lineTo(x, y + radius);
  draw.stroke();
  draw.fillText("d", x + radius + 4, y + 4);
  draw.fillText("q", x - 3, y - radius - 4);
  const arrow = (name, unit, d, q, paint, row) => {
    if (d == null || q == null) return;
    const size = Math.hypot(d, q);
    const full = nice(Math.max(size, 0.1));
    const [endX, endY] = [x + (d / full) * radius, y - (q / full) * radius];
    draw.strokeStyle = draw.fillStyle = colour(paint);
    draw.lineWidth = 2;
    draw.beginPath();
    draw.moveTo(x, y);
    draw.lineTo(endX, endY);
    draw.stroke();
    draw.beginPath();
    draw.arc(endX, endY, 3, 0, 2 * Math.PI);
    draw.fill();
    draw.fillText(`${name} ${size.toFixed(2)} ${unit}`, 4, 14 + row * 15);
    draw.fillText(`of ${full} ${unit}`, 4, height - 20 + row * 15);
    draw.lineWidth = 1;
  };
  arrow("i", "A", i_d, i_q, "--trace-0", 0);
  arrow("u", "V", u_d, u_q, "--trace-1", 1);
}
