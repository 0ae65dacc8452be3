"use strict";
// A slider along the front of two objectives: places on its curve, and between two points a trajectory that is interpolated.

const ALONG = COLORS.at(-1);
const FEW_WEIGHTS = 2; // sum of the sizes of the weights of points above which two are taken instead of four: points lie close together

const slide = { place: null, run: null, frame: 0, rest: 0 }; // number of the place that is shown; null: none, a point is selected

/** The run whose front is drawn as a curve: that of the selected point. */
const curveRun = () => (selectedPoint()?.run.curve ? selectedPoint().run : null);

/** All places of a run's curve, one piece after the other, from the least value of the first objective: gaps are passed over. */
function placesOf(run) {
  const all = run.curve.pieces.flatMap((piece) => piece.places.map((s, k) => ({ s, piece, values: piece.objectives.map((one) => one[k]) })));
  return all[0].values[0] > all.at(-1).values[0] ? all.reverse() : all;
}

const placeShown = () => (slide.place === null ? null : slide.places[slide.place]);

/** Build the slider, at the selected point. */
function showAlong() {
  const run = curveRun();
  byId("along").hidden = !run || !isShown(selectedPoint());
  if (byId("along").hidden) return;
  if (slide.run !== run) {
    Object.assign(slide, { run, places: placesOf(run) });
    const range = element("input", { type: "range", id: "along-range", style: `accent-color: ${ALONG}`, min: 0, max: slide.places.length - 1, step: 1, oninput: (event) => moveAlong(Number(event.target.value)) });
    const label = element("label", { for: "along-range" }, "Along the front");
    fill(byId("along"), element("div", { class: "bar" }, label, range), element("p", { id: "along-words" }), element("p", { id: "along-note", class: "note" }));
  }
  const { index } = selectedPoint();
  const own = slide.places.findIndex(({ s, piece }) => piece.points[piece.at.indexOf(s)] === index);
  if (slide.place === null && own >= 0) byId("along-range").value = own;
  wordsAlong();
}

/** A point is selected: the slider goes there. */
function endSlide() {
  slide.place = null;
  showAlong();
}

/** Show a place, at most once a frame. */
function moveAlong(place) {
  const begins = slide.place === null;
  slide.place = place;
  if (begins) {
    drawFront(); // with the marker
    showFlights();
  }
  slide.frame ||= requestAnimationFrame(() => {
    slide.frame = 0;
    redrawAlong();
  });
}

/** What is shown at a place: points with their weights, the two that it lies between, or the one that is nearest, in `only`. */
function sharesAt({ s, piece: { at, points } }) {
  const same = at.indexOf(s);
  if (same >= 0) return { only: points[same], exact: true };
  const k = at.findIndex((one) => one > s);
  if (k <= 0) {
    const all = slide.run.curve.pieces.flatMap((piece) => piece.at.map((one, i) => [Math.abs(one - s), piece.points[i]]));
    return { only: all.sort((a, b) => a[0] - b[0])[0][1], exact: false };
  }
  let shares = weightsAt(s, at, [k - 2, k - 1, k, k + 1].filter((i) => i in at));
  if (shares.reduce((sum, [, weight]) => sum + Math.abs(weight), 0) > FEW_WEIGHTS) shares = weightsAt(s, at, [k - 1, k]);
  return { between: [points[k - 1], points[k]].sort((a, b) => a - b), shares: shares.map(([i, weight]) => [points[i], weight]) };
}

/** Weights of the polynomial through values at some places. */
const weightsAt = (s, at, near) => near.map((i) => [i, near.reduce((product, j) => (i === j ? product : (product * (s - at[j])) / (at[i] - at[j])), 1)]);

/** What the slider shows, for eyes and ears. */
function wordsAlong() {
  const place = placeShown();
  const range = byId("along-range");
  const { goals } = state.comparison;
  if (!place) {
    range.setAttribute("aria-valuetext", `${pointName(selectedPoint())}: ${inWords(selectedPoint())}`);
    fill(byId("along-words"));
    fill(byId("along-note"), `The curve errs by about ${number(100 * slide.run.curve.error, 1)} % of the ranges. Arrow keys move in small steps.`);
    return;
  }
  const { only, exact, between } = sharesAt(place);
  const objectives = inWords(place);
  const words = exact ? `Point ${only}: ${objectives}` : `${objectives}${between ? ", interpolated" : ", on the curve"}`;
  range.setAttribute("aria-valuetext", words);
  fill(byId("along-words"), element("strong", {}, words));
  if (byId("flight-along")) byId("flight-along").textContent = ` ${flightName(place)}: ${objectives}`;
  if (exact) return fill(byId("along-note"), element("button", { type: "button", onclick: () => select(`${slide.run.block}:${only}`) }, `Select point ${only}`));
  const code = `front.at({${JSON.stringify(goals[0].name)}: ${Number(place.values[0].toPrecision(8))}})`;
  const button = element("button", { type: "button", onclick: () => copied(code) }, "Copy");
  const what = between
    ? `Between points ${between[0]} and ${between[1]}, interpolated, not simulated; `
    : `At an end of a piece of the curve nothing is interpolated: the trajectory is that of point ${only}, the nearest; `;
  fill(byId("along-note"), what, element("code", {}, code), " gives the real one ", button);
}

const flightName = (place) => {
  const { only, exact, between } = sharesAt(place);
  return between ? `Between points ${between.join(" and ")}, interpolated` : exact ? `Point ${only}` : `Point ${only}, the nearest`;
};

/** Copy a line of code. Where the browser does not let pages write there, the line is marked for copying. */
async function copied(code) {
  try {
    await navigator.clipboard.writeText(code);
    announce(`copied: ${code}`);
  } catch {
    getSelection().selectAllChildren(byId("along-note").querySelector("code"));
    announce("marked: copy it by the keyboard");
  }
}

/** The flight at the place that is shown, from those of all points of the run. */
function flightAlong(all) {
  const place = placeShown();
  const { only, shares } = sharesAt(place);
  slide.all = all;
  return { name: flightName(place), words: inWords(place), detail: { phases: shares ? mixedPhases(shares.map(([i, weight]) => [all[i], weight])) : all[only].phases }, along: true };
}

/** Phases between those of some points: each quantity over the phase's own time from 0 to 1, within its limits. */
function mixedPhases(shares) {
  const [base] = shares.reduce((most, one) => (one[1] > most[1] ? one : most));
  return base.phases.map((phase, p) => {
    const others = shares.map(([detail, weight]) => [detail.phases[p], weight]);
    if (others.some(([other]) => other?.name !== phase.name)) return phase;
    const mixed = (key) => others.reduce((sum, [other, weight]) => sum + weight * other[key], 0);
    const [t0, tf] = ["t0", "tf"].map(mixed);
    const from = ({ t0: first, tf: last }) => (t) => (last > first ? (t - first) / (last - first) : 0);
    const shares01 = phase.times.map((told) => curveValues(told).map(from(phase)));
    const times = shares01.map((tau) => plain(tau.map((one) => t0 + one * (tf - t0))));
    const quantities = phase.quantities.map((one) => {
      const found = others.map(([other, weight]) => [other, other.quantities.find(({ name, kind }) => name === one.name && kind === one.kind), weight]);
      if (found.some(([, quantity]) => !quantity || curveValues(quantity.v).includes(null))) return one;
      const tau = shares01[one.t];
      const sum = new Array(tau.length).fill(0);
      for (const [other, quantity, weight] of found) addInterpolated(sum, tau, curveValues(other.times[quantity.t]).map(from(other)), curveValues(quantity.v), weight);
      const ends = found.map(([, { v }]) => extent(curveValues(v)));
      const low = Math.min(one.lower ?? -Infinity, ...ends.map(([least]) => least)), high = Math.max(one.upper ?? Infinity, ...ends.map(([, most]) => most));
      return { ...one, v: plain(sum.map((value) => Math.min(Math.max(value, low), high))) };
    });
    return { ...phase, t0, tf, times, quantities };
  });
}

/** Values as a flight has them that are not stored as differences. */
function plain(values) {
  summedUp.set(values, values);
  return values;
}

/** Add to a sum, at ascending places, a curve of straight lines times a weight. */
function addInterpolated(sum, at, places, values, weight) {
  let k = 0;
  at.forEach((one, i) => {
    while (k < places.length - 2 && places[k + 1] <= one) k += 1;
    const length = places[k + 1] - places[k];
    const share = length > 0 ? Math.min(Math.max((one - places[k]) / length, 0), 1) : 0;
    sum[i] += weight * (places.length > 1 ? values[k] + share * (values[k + 1] - values[k]) : values[0]);
  });
}

/** Draw marker and trajectory at the place. They are moved at once; the drawing package hears of it when the slider rests: it takes longer. */
function redrawAlong() {
  if (slide.place === null) return;
  wordsAlong();
  if (!canDraw()) return;
  const { values } = placeShown();
  const moved = [[byId("plot"), markers, [[values[view.x]]], [[values[view.y]]]]];
  if (slide.all) {
    const { phases } = flightAlong(slide.all).detail;
    moved.push(...panels.map((panel) => movedTraces(panel, phases)));
  }
  moved.forEach(([place, traces, x, y]) => traces().forEach((trace, k) => moveTrace(place, trace, x[k], y[k])));
  clearTimeout(slide.rest);
  const settle = () => {
    const [place, traces, x, y] = moved.shift();
    // Meanwhile it may have been given up, or drawn with other points.
    if (place.isConnected && pending.has(place) && traces().length) Plotly.restyle(place, { x, y }, traces());
    if (moved.length) slide.rest = setTimeout(settle);
  };
  slide.rest = setTimeout(settle, 200);
}

/** The number of the marker among the traces of the figure of the front, in a list; empty in figures without it. */
const markers = () => [byId("plot").data?.findIndex(({ meta }) => meta === "along") ?? -1].filter((i) => i >= 0);

/** The place of a panel, its traces that move, and their new coordinates. */
function movedTraces({ plot, quantity: { name, kind }, traces }, phases) {
  const owns = traces.map(({ meta }) => (meta === null ? null : phases[meta]?.quantities.find((one) => one.name === name && one.kind === kind)));
  const places = [...traces.keys()].filter((i) => owns[i]);
  const x = places.map((i) => curveValues(phases[traces[i].meta].times[owns[i].t])), y = places.map((i) => curveValues(owns[i].v));
  if (!pending.has(plot)) places.forEach((i, k) => Object.assign(traces[i], { x: x[k], y: y[k] })); // it is drawn later
  return [plot, () => places, x, y];
}

/** Move a line or a marker on the page itself, to coordinates of its axes. */
function moveTrace(plot, trace, x, y) {
  const node = plot.querySelector(`.scatterlayer .trace${plot._fullData?.[trace]?.uid}`);
  if (!node) return;
  const { xaxis, yaxis } = plot._fullLayout;
  const at = (k) => `${xaxis.d2p(x[k]).toFixed(1)},${yaxis.d2p(y[k]).toFixed(1)}`;
  const line = node.querySelector(".js-line"), point = node.querySelector(".point");
  if (line) line.setAttribute("d", x.map((_, k) => (y[k] === null ? "" : (k === 0 || y[k - 1] === null ? "M" : "L") + at(k))).join(""));
  if (point) point.setAttribute("transform", `translate(${at(0)})`);
}

/** The curves of fronts, behind their points, and the marker of the slider. */
function curveTraces(x, y) {
  if (state.comparison.goals.length !== 2) return [];
  const line = (run) => {
    const pieces = run.curve.pieces.map((piece) => [...piece.objectives.map((one) => [...one, null])]);
    const [X, Y] = [x, y].map((i) => pieces.flatMap((piece) => piece[i]));
    return { type: "scatter", mode: "lines", x: X, y: Y, line: { color: colorOf(solverIndex(run.solver)), width: 1.1 }, opacity: 0.6, showlegend: false, hoverinfo: "skip", meta: "curve" };
  };
  return state.comparison.runs.filter((run) => run.curve && isShown({ solver: run.solver, run })).map(line);
}

function alongTrace(x, y) {
  const place = placeShown();
  const look = { color: ALONG, size: 12, symbol: "diamond", line: { width: 1.5, color: "#fff" } };
  return { type: "scatter", mode: "markers", x: place ? [place.values[x]] : [], y: place ? [place.values[y]] : [], marker: look, showlegend: false, hoverinfo: "skip", meta: "along" };
}
