"use strict";
// The front as points: over two objectives, or in space over three.

const MANY = 1500; // points from which on they are drawn by the graphics card
const SIZE = 9, RING = 17;

const view = { kind: "two", x: 0, y: 1, z: 2, color: "solver" };

/** The traces of all points in a figure with these axes, each a list of coordinates by name of its axis. */
function pointTraces(axes, type, marker3d) {
  const shown = shownPoints();
  const inside = shown.filter(isWanted), outside = shown.filter((point) => !isWanted(point));
  const many = shown.length > MANY;
  const size = many ? 5 : SIZE;
  const traces = [];
  const template = hoverTemplate();
  const trace = (points, name, marker, more = {}) => {
    const made = { type, mode: "markers", name, marker, hovertemplate: template, ...more };
    made.customdata = points.map(hoverData);
    for (const [letter, i] of Object.entries(axes)) made[letter] = points.map((point) => point.values[i]);
    return made;
  };
  if (outside.length) traces.push(trace(outside, "outside the preferences", { color: FAINT, size: 0.7 * size, symbol: "circle" }));
  const colored = view.color === "solver" ? null : Number(view.color);
  const limits = colored === null ? null : extent(shown.map((point) => point.values[colored]));
  state.comparison.solvers.forEach((solver, k) => {
    const own = inside.filter((point) => point.solver === solver);
    for (const good of [true, false]) {
      const points = own.filter((point) => counts(point) === good);
      if (!points.length) continue;
      const list = marker3d ? MARKERS_3D : MARKERS;
      const symbol = list[k % list.length];
      const marker = { size: marker3d ? 0.6 * size : size, symbol: good ? symbol : `${symbol}-open`, color: colorOf(k) };
      if (!marker3d) marker.line = good ? { width: many ? 0 : 0.7, color: "#fff" } : { width: 1.4, color: colorOf(k) };
      if (marker3d) marker.opacity = 1; // otherwise those behind shine through
      if (colored !== null) {
        Object.assign(marker, { color: points.map((point) => point.values[colored]), colorscale: SCALE, cmin: limits[0], cmax: limits[1] });
        if (!traces.some((one) => one.marker.showscale)) Object.assign(marker, { showscale: true, colorbar: colorbar(colored) });
      }
      traces.push(trace(points, plotText(solver) + (good ? "" : " (not verified)"), marker, { meta: k }));
    }
  });
  state.kept.forEach((key) => {
    const point = state.byKey.get(key);
    if (key === state.selected || !isShown(point)) return;
    const look = marker3d ? { size: 0.9 * RING, symbol: "circle-open", color: INK } : { size: RING, symbol: "circle-open", color: INK, line: { width: 1.2 } };
    traces.push(trace([point], "kept", look, { showlegend: false }));
  });
  const chosen = selectedPoint();
  if (chosen && isShown(chosen)) {
    const look = marker3d ? { size: RING, symbol: "circle-open", color: INK } : { size: RING, symbol: "circle-open", color: INK, line: { width: 3 } };
    traces.push(trace([chosen], "selected", look));
  }
  return traces;
}

/** The points so far of runs that have not ended, as crosses; they cannot be selected. */
function goingTraces(axes, type, marker3d) {
  return state.comparison.solvers.flatMap((solver, k) => {
    const runs = shownGoing().filter((run) => run.solver === solver);
    if (!runs.length) return [];
    const symbol = marker3d ? "x" : "x-thin";
    const marker = { size: marker3d ? 3 : 6, symbol, color: colorOf(k), opacity: 0.8, ...(marker3d ? {} : { line: { width: 1.2, color: colorOf(k) } }) };
    const text = runs.flatMap((run) => run.objectives[0].map(() => `${plotText(solver)}, run ${run.number}, so far`));
    const made = { type, mode: "markers", name: `${plotText(solver)}, so far`, marker, text, hovertemplate: "%{text}<extra></extra>", meta: "going" };
    for (const [letter, i] of Object.entries(axes)) made[letter] = runs.flatMap((run) => run.objectives[i]);
    return [made];
  });
}

/** The runs that have not ended and have points so far, of the solvers and the run that are shown. */
const shownGoing = () =>
  (state.going[state.comparison.id] ?? []).filter((run) => isShown({ solver: run.solver, run }) && run.objectives[0]?.length);

const colorbar = (i) => ({
  title: { text: plotText(withUnit(state.comparison.goals[i].name, state.comparison.goals[i].unit)), side: "right" },
  thickness: 12,
  outlinewidth: 0,
  exponentformat: "power",
  minexponent: 7,
});

/** Least and greatest value. */
function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value === null) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return low <= high ? [low, high] : [0, 1];
}

/** A reference front, such as the true one: lines where it is a curve, else small points. */
function referenceTraces(x, y) {
  const reference = state.comparison.reference;
  if (!reference) return [];
  const look = reference.curves
    ? { mode: "lines", line: { color: INK, width: 1.4 } }
    : { mode: "markers", marker: { color: GREY, size: 3 } };
  return reference.parts.map((part, k) => ({
    type: "scatter",
    ...look,
    x: part[x],
    y: part[y],
    name: plotText(reference.name),
    showlegend: k === 0,
    hoverinfo: "skip",
  }));
}

function drawTwo(place) {
  const { goals } = state.comparison;
  const { x, y } = view;
  const type = shownPoints().length > MANY && hasGl() ? "scattergl" : "scatter";
  const traces = [...referenceTraces(x, y), ...curveTraces(x, y), ...goingTraces({ x, y }, "scatter", false), ...pointTraces({ x, y }, type, false)];
  if (traces.some(({ meta }) => meta === "curve")) traces.push(alongTrace(x, y));
  const figure = layout({
    height: 440,
    // Where somebody has zoomed in, that stays as long as the axes are the same.
    xaxis: axis(goalLabel(goals[x]), { uirevision: `${state.comparison.name} ${x}` }),
    yaxis: axis(goalLabel(goals[y]), { uirevision: `${state.comparison.name} ${y}` }),
    dragmode: "select",
    modebar: { orientation: view.color === "solver" ? "v" : "h", uirevision: "same" }, // beside the figure is the scale of colours
    selections: [],
    showlegend: legendWanted(traces),
    newselection: { line: { color: INK, width: 1, dash: "dot" } },
  });
  draw(place, traces, figure);
}

function drawThree(place) {
  const { goals } = state.comparison;
  const { x, y, z } = view;
  const traces = [...goingTraces({ x, y, z }, "scatter3d", true), ...pointTraces({ x, y, z }, "scatter3d", true)];
  const space = (i) => ({ title: { text: plotText(withUnit(goals[i].name, goals[i].unit)) }, exponentformat: "power", minexponent: 7, gridcolor: "#ccc", color: INK });
  const scene = { xaxis: space(x), yaxis: space(y), zaxis: space(z), uirevision: `${x} ${y} ${z}`, camera: { eye: { x: 1.8, y: 1.8, z: 0.9 } } };
  const figure = layout({ height: 520, scene, modebar: { orientation: "h" }, margin: { l: 0, r: 0, t: 60, b: 0 }, showlegend: legendWanted(traces) });
  draw(place, traces, figure);
}

/** A legend is needed where there is more than one kind of point. */
const legendWanted = (traces) => traces.filter((trace) => trace.showlegend !== false).length > 1;

/** What a click or a rectangle in the figure does. The figure forgets this where its kind changes. */
function listenToScatter(place) {
  place.on("plotly_click", (event) => {
    const key = event.points.map((point) => point.customdata?.[0]).find(Boolean);
    if (key) select(key);
  });
  place.on("plotly_selected", (event) => {
    if (!event?.range?.x) return;
    const before = JSON.stringify(state.ranges);
    const { x, y } = view;
    state.ranges[x] = [...event.range.x].sort((a, b) => a - b);
    state.ranges[y] = [...event.range.y].sort((a, b) => a - b);
    if (JSON.stringify(state.ranges) !== before) emit("filter");
  });
  place.on("plotly_deselect", clearRanges);
}
