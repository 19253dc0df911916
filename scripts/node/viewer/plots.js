// Lines over time with a mark at the frame that is shown; a click jumps there.
const NAMESPACE = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT, LEFT, BOTTOM, TOP] = [640, 150, 46, 18, 8];

function element(name, attributes, parent) {
  const made = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent?.appendChild(made);
  return made;
}

function ticks(highest) {
  const rough = highest / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough);
  return Array.from({ length: Math.floor(highest / step + 1e-9) + 1 }, (_, i) => i * step);
}

function path(values, x, y) {
  let text = "";
  let drawing = false;
  values.forEach((value, i) => {
    if (value === null) drawing = false;
    else {
      text += `${drawing ? "L" : "M"}${x(i).toFixed(1)} ${y(value).toFixed(1)}`;
      drawing = true;
    }
  });
  return text;
}

function area(low, high, x, y) {
  const upper = high.map((value, i) => `${x(i).toFixed(1)} ${y(value).toFixed(1)}`);
  const lower = low.map((value, i) => `${x(i).toFixed(1)} ${y(value).toFixed(1)}`).reverse();
  return `M${upper.join("L")}L${lower.join("L")}Z`;
}

function plot(parent, spec, run, seek) {
  const figure = parent.appendChild(document.createElement("figure"));
  figure.appendChild(document.createElement("figcaption")).textContent = spec.title;
  const svg = element("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img" }, figure);
  const times = run.times;
  const span = times[times.length - 1] - times[0] || 1;
  const x = (i) => LEFT + ((times[i] - times[0]) / span) * (WIDTH - LEFT - 6);
  const y = (value) => HEIGHT - BOTTOM - (Math.min(value, spec.highest) / spec.highest) * (HEIGHT - BOTTOM - TOP);
  for (const value of ticks(spec.highest)) {
    element("line", { x1: LEFT, x2: WIDTH - 6, y1: y(value), y2: y(value), class: "grid" }, svg);
    const label = element("text", { x: LEFT - 5, y: y(value) + 4, "text-anchor": "end" }, svg);
    label.textContent = `${+value.toPrecision(6)}`;
  }
  for (const value of ticks(span)) {
    const at = LEFT + (value / span) * (WIDTH - LEFT - 6);
    const label = element("text", { x: at, y: HEIGHT - 4, "text-anchor": "middle" }, svg);
    label.textContent = `${+(times[0] + value).toPrecision(4)} s`;
  }
  for (const series of spec.series) {
    if (series.low) element("path", { d: area(series.low, series.values, x, y), fill: series.color }, svg);
    else element("path", { d: path(series.values, x, y), stroke: series.color, class: "line" }, svg);
  }
  const mark = element("line", { y1: TOP, y2: HEIGHT - BOTTOM, class: "mark" }, svg);
  svg.onclick = (event) => {
    const box = svg.getBoundingClientRect();
    const share = (((event.clientX - box.left) / box.width) * WIDTH - LEFT) / (WIDTH - LEFT - 6);
    const wanted = times[0] + share * span;
    const later = times.findIndex((time) => time >= wanted);
    seek(later < 0 ? times.length - 1 : later);
  };
  const legend = figure.appendChild(document.createElement("p"));
  for (const series of spec.series) {
    const item = legend.appendChild(document.createElement("span"));
    item.appendChild(document.createElement("i")).style.background = series.color;
    item.append(series.name);
  }
  return (frame) => {
    mark.setAttribute("x1", x(frame));
    mark.setAttribute("x2", x(frame));
  };
}

export function drawPlots(parent, run, seek) {
  parent.replaceChildren();
  const marks = run.plots.map((spec) => plot(parent, spec, run, seek));
  let last = -1;
  return {
    mark(frame) {
      if (frame !== last) marks.forEach((mark) => mark(frame));
      last = frame;
    },
  };
}
