// Traces over a long time: the area between the least and the greatest value of each column, with its edges.

/** How much of the plots behind an area is seen. */
const CLEAR = 0.75;

/** A colour, as `rgb(...)`, of an area. */
export const pale = (colour) => colour.replace("rgb(", "rgba(").replace(/\)$/, `, ${1 - CLEAR})`);

/** The runs of columns that have values: for each column its time and its bounds. */
export function runs(t, values) {
  const found = [];
  let run = [];
  for (let at = 0; at + 1 < t.length; at += 2) {
    if (values[at] == null) {
      if (run.length) found.push(run);
      run = [];
    } else {
      run.push([t[at], values[at], values[at + 1]]);
    }
  }
  if (run.length) found.push(run);
  return found;
}

/** uPlot's paths of such a trace. */
export function envelope(plot, series) {
  const { x, y } = plot.scales;
  const { left, top, width, height } = plot.bbox;
  const across = (t) => left + ((t - x.min) / (x.max - x.min)) * width;
  const down = (value) => top + (1 - (value - y.min) / (y.max - y.min)) * height;
  const [stroke, fill] = [new Path2D(), new Path2D()];
  for (const run of runs(plot.data[0], plot.data[series])) {
    const upper = run.map(([t, , greatest]) => [across(t), down(greatest)]);
    const lower = run.map(([t, least]) => [across(t), down(least)]);
    for (const [path, points] of [[stroke, upper], [stroke, lower], [fill, [...upper, ...lower.reverse()]]]) {
      points.forEach(([at, of], i) => (i ? path.lineTo(at, of) : path.moveTo(at, of)));
    }
    fill.closePath();
  }
  return { stroke, fill };
}
