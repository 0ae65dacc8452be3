"use strict";
// Trajectories of the selected point and of those that are kept: a panel for each quantity.

const KINDS = {
  state: "States",
  control: "Controls",
  path: "Path constraints",
  costate: "Costates and Hamiltonian",
  hamiltonian: "Costates and Hamiltonian",
};
const WIDTHS = [2, 1.6, 1.6, 1.6, 1.6, 1.6, 1.6];

let panels = []; // those that are there: the place, the quantity, the title and the traces of each
let drawing = 0; // number of the latest drawing: an earlier one that is still loading gives up

async function showFlights() {
  const mine = (drawing += 1);
  const keys = [...new Set([...state.kept, ...(state.selected ? [state.selected] : [])])];
  const points = keys.map((key) => state.byKey.get(key)).filter(Boolean);
  hideFlights();
  if (!points.length) {
    clearPanels();
    fill(byId("flights-note"), "Select a point to see its states, controls, path constraints and costates.");
    return;
  }
  let loadedFlights;
  try {
    loadedFlights = await Promise.all(points.map(async (point) => ({ point, detail: (await details(point.run))[point.index] })));
  } catch (error) {
    if (mine === drawing) fill(byId("flights-note"), `The trajectories cannot be read: ${error.message}.`);
    return;
  }
  if (mine !== drawing) return;
  const flights = loadedFlights.filter(({ detail }) => detail.phases.length).map(({ point, detail }) => ({ key: point.key, name: pointName(point), words: inWords(point), detail }));
  let all = [];
  if (slide.place !== null && flights.length) {
    all = (await details(curveRun())).filter((detail) => detail.phases.length);
    if (mine !== drawing) return;
    flights.push(flightAlong(all));
  }
  if (!flights.length) {
    clearPanels();
    fill(byId("flights-note"), "The point has no trajectory.");
    return;
  }
  fill(byId("flights-note"), ...flightsNote(flights));
  drawPanels(flights, all);
}

/** Where no point has a trajectory, there is no place for them either. */
function hideFlights() {
  byId("flights").hidden = state.points.length > 0 && state.comparison.runs.every((run) => !run.about.dynamic);
}

function clearPanels() {
  const place = byId("flights-plot");
  place.querySelectorAll(".panel-plot").forEach(retire);
  place.replaceChildren();
  panels = [];
}

/** Which colour is which point, and what lines mean. */
function flightsNote(flights) {
  const names = flights.flatMap(({ name, words, along }, k) => [
    element("span", { class: "swatch", style: `color: ${along ? ALONG : colorOf(k)}`, "aria-hidden": "true" }, along ? "\u254C" : k % 2 ? "\u254D" : "\u2501"),
    element("span", { id: along ? "flight-along" : null }, ` ${name}: ${words}`),
    element("br"),
  ]);
  const phases = flights[0].detail.phases.map((phase) => phase.name);
  const several = phases.length > 1 ? ` Dotted lines are the ends of the phases ${phases.join(", ")}.` : "";
  const all = flights.flatMap(({ detail }) => detail.phases);
  const left = all.some((phase) => phase.quantities.some((one) => one.kind === "hamiltonian"))
    ? [...new Set(all.filter((phase) => !phase.lasts).map((phase) => phase.name))]
    : [];
  const without = left.length ? ` Without length, and therefore without costates: ${left.join(", ")}.` : "";
  return [...names, `Dashed lines are limits, where they are near; the text above each panel always gives them.${several}${without}`];
}

/** All quantities of some flights, each once, in groups: [[title, [name, kind], ...], ...]. */
function groups(flights) {
  const found = new Map();
  for (const { detail } of flights) {
    for (const quantity of detail.phases.flatMap((phase) => phase.quantities)) {
      const title = KINDS[quantity.kind];
      if (!found.has(title)) found.set(title, new Map());
      found.get(title).set(`${quantity.kind} ${quantity.name}`, quantity);
    }
  }
  return Object.values(KINDS)
    .filter((title, k, all) => all.indexOf(title) === k && found.has(title))
    .map((title) => [title, [...found.get(title).values()]]);
}

/** Draw all panels; where these are of the same quantities as before, in the same places. */
function drawPanels(flights, all) {
  if (!canDraw()) return clearPanels();
  const found = groups(flights);
  const quantities = found.flatMap(([, ones]) => ones);
  const word = ({ kind, name, unit }) => JSON.stringify([kind, name, unit]);
  if (quantities.map(word).join() !== panels.map(({ quantity }) => word(quantity)).join()) buildPanels(found);
  clearTimeout(slide.rest); // what it would draw is drawn now
  panels.forEach((panel, k) => {
    const figure = panelFigure(flights, quantities[k], all);
    Object.assign(panel, { quantity: quantities[k], traces: figure.traces });
    panel.plot.setAttribute("aria-label", figure.words);
    fill(panel.title, figure.title, " ", element("span", { class: "note" }, figure.limits));
    drawWhenSeen(panel.plot, figure.traces, figure.layout, { ...CONFIG, displayModeBar: false });
  });
  byId("flights").dataset.drawn = flights.flatMap(({ key }) => key ?? []).join(" "); // for tests and style sheets
}

/** Empty places for panels, in groups. */
function buildPanels(found) {
  clearPanels();
  for (const [title, quantities] of found) {
    const grid = element("div", { class: "panels" });
    byId("flights-plot").append(element("h3", {}, title), grid);
    for (const quantity of quantities) {
      const panel = { quantity, title: element("p", { class: "panel-title" }), plot: element("div", { class: "panel-plot", role: "img" }) };
      grid.append(element("div", { class: "panel" }, panel.title, panel.plot));
      panels.push(panel);
    }
  }
}

/** Everything of a panel: its traces, layout, title, limits as text, and the same in words. Its axes have room for `all` flights. */
function panelFigure(flights, { name, kind, unit }, all) {
  const traces = [], limits = [], shapes = [];
  let least = 0;
  flights.forEach(({ name: flight, detail, along }, k) => {
    detail.phases.forEach((phase, p) => {
      const own = phase.quantities.find((one) => one.name === name && one.kind === kind);
      if (p > 0 && k === 0) shapes.push(endOfPhase(phase.t0));
      if (!own) return;
      least = Math.max(least, own.least);
      limits.push({ phase: along ? longest(phase, all) : phase, lower: own.lower, upper: own.upper });
      traces.push({
        x: curveValues(phase.times[own.t]),
        y: curveValues(own.v),
        mode: "lines",
        line: along ? { color: ALONG, width: 2, dash: "4px,2px" } : { color: colorOf(k), width: WIDTHS[k], dash: k % 2 ? "dash" : "solid" },
        name: plotText(flight),
        meta: along ? p : null, // the number of the phase of a flight that moves
        hovertemplate: `%{y:.6~g} at %{x:.6~g}<extra>${plotText(flight).replace(/[{}%]/g, "")}</extra>`,
      });
    });
  });
  const values = traces.flatMap((trace) => trace.y).filter((value) => value !== null);
  const ends = all.flatMap(({ phases }) => phases.flatMap(({ quantities }) => quantities.filter((one) => one.name === name && one.kind === kind)));
  const others = ends.map((one) => extent(curveValues(one.v)));
  // Costates may be huge at the ends of a front, where the weight of an objective is zero.
  const left = kind === "costate" || kind === "hamiltonian" ? Math.ceil(others.length / 10) : 0;
  for (const i of [0, 1]) values.push(...others.map((one) => one[i]).sort((a, b) => a - b).slice(left, others.length - left));
  let [low, high] = extent(values);
  const words = [...new Set(limits.map((one) => limitsText(one.lower, one.upper)).filter(Boolean))].join("; ");
  const spans = limits.map((one) => one.upper - one.lower).filter(Number.isFinite);
  const size = Math.max(Math.abs(low), Math.abs(high));
  const described = `${name}, ${kind}, ${low === high ? number(low) : `from ${number(low)} to ${number(high)}`} ${unit}; ${words || "without limits"}`;
  // A constant is a straight line in the middle, not a picture of round-off.
  if (high - low < Math.max(least, 1e-6 * Math.max(size, ...spans))) {
    const half = Math.max(least, 0.1 * size, 0.05 * Math.min(...spans, 1e300) * (spans.length > 0)) || 1;
    const middle = 0.5 * (low + high);
    [low, high] = [middle - half, middle + half];
  }
  const reach = high - low;
  for (const { phase, lower, upper } of limits) {
    for (const bound of new Set([lower, upper])) {
      if (bound === null || bound < low - reach || bound > high + reach) continue;
      shapes.push({ type: "line", x0: phase.t0, x1: phase.tf, y0: bound, y1: bound, line: { color: GREY, width: 1, dash: "dash" }, layer: "below" });
    }
  }
  for (const { y0, layer } of shapes) if (layer === "below" && y0 !== undefined) [low, high] = [Math.min(low, y0), Math.max(high, y0)];
  const margin = 0.07 * (high - low);
  const phases = [...flights.map(({ detail }) => detail), ...all].flatMap((detail) => detail.phases);
  const [first, last] = extent(phases.flatMap((phase) => [phase.t0, phase.tf]));
  const [over, units] = ["over", "unit"].map((key) => [...new Set(limits.map((one) => one.phase[key]))].join(" | "));
  return {
    traces,
    title: withUnit(kind === "costate" ? `costate of ${name}` : name, unit),
    limits: words,
    words: described,
    layout: layout({
      height: 190,
      margin: { l: 52, r: 8, t: 6, b: 34 },
      showlegend: false,
      shapes,
      xaxis: axis(withUnit(over, plotText(units)), { title: { text: plotText(withUnit(over, units)), standoff: 4 }, nticks: 6, range: first < last ? [first, last] : undefined }),
      yaxis: axis("", { range: [low - margin, high + margin], nticks: 5 }),
    }),
  };
}

/** A phase of a moving flight, as long as it is in any of some flights. */
const longest = (phase, all) => {
  const same = all.flatMap(({ phases }) => phases.filter(({ name }) => name === phase.name));
  return { ...phase, t0: Math.min(...same.map(({ t0 }) => t0)), tf: Math.max(...same.map(({ tf }) => tf)) };
};

const summedUp = new WeakMap();

/** The values of a curve from the number of its decimals and its third differences; null in gaps. */
function curveValues(told) {
  if (!summedUp.has(told)) summedUp.set(told, summed(told));
  return summedUp.get(told);
}

function summed([decimals, ...differences]) {
  const unit = Number(`1e${Math.abs(decimals)}`);
  let value = 0, slope = 0, bend = 0;
  return differences.map((step) => {
    if (step === null) return null;
    bend += step;
    slope += bend;
    value += slope;
    return decimals < 0 ? value * unit : value / unit;
  });
}

const endOfPhase = (time) => ({
  type: "line", x0: time, x1: time, yref: "paper", y0: 0, y1: 1, line: { color: GREY, width: 1, dash: "dot" },
});
