"use strict";
// What a study has beside its points: the state of its runs, comparisons of solvers as figures, and tables.

let figuresShown = "";

function showStudy() {
  if (state.data.progress) showProgress();
  const { name, attainment, convergence, tables } = state.comparison;
  byId("study").hidden = !(attainment || convergence?.length || tables?.length);
  const figures = JSON.stringify([name, Boolean(attainment), convergence?.map((one) => [one.indicator, one.axis])]);
  if (figures !== figuresShown) buildFigures();
  figuresShown = figures;
  fill(byId("study-tables"), (tables ?? []).map(tableElement));
  if (state.data.note) fill(byId("study-note"), state.data.note);
  const across = state.data.tables ?? state.measures?.tables ?? [];
  byId("across").hidden = !across.length;
  fill(byId("across-tables"), across.map(tableElement));
  redrawStudy();
}

/** Empty places for the figures that there are. */
function buildFigures() {
  const { attainment, convergence } = state.comparison;
  const place = byId("study-figures");
  place.querySelectorAll(".plot").forEach(retire);
  const parts = [];
  if (attainment) parts.push(figureBox("Attainment surfaces", "attainment", "What at least one run (best), half of the runs (median) and all runs (worst) of a solver attain."));
  if (convergence?.length) parts.push(convergenceBox(convergence));
  fill(place, parts);
}

/** Draw the figures. */
function redrawStudy() {
  if (!canDraw()) return;
  const { attainment, convergence } = state.comparison;
  if (attainment) drawAttainment(attainment);
  if (convergence?.length) drawConvergence(convergence, Number(byId("study-figures").querySelector("select").value));
}

/** A heading, a note and an empty place for a figure. */
function figureBox(title, id, note, ...more) {
  return element("div", { class: "panel" }, element("h3", {}, title), element("p", { class: "note" }, note), ...more, element("div", { id, class: "plot", role: "img", "aria-label": title }));
}

/** How many runs of each cell there are, and the failures with their tracebacks. */
function showProgress() {
  const { progress } = state.data;
  byId("progress").hidden = false;
  const heads = ["problem", "transcription", "solver", "finished", "failed", "missing", "median time [s]"];
  const rows = progress.cells.map((cell) => [...cell.labels, ...[cell.finished, cell.failed, cell.missing].map(String), number(cell.time, 3)]);
  const words = heads.map((_, k) => k < 3);
  const line = `${progress.finished} of ${counted(progress.total, "run")} finished`;
  fill(byId("headline"), progress.failed ? `${line}, ${progress.failed} failed` : line);
  const bar = element("meter", { min: 0, max: progress.total, value: progress.finished, "aria-label": line });
  fill(byId("progress-body"), element("p", {}, bar, ` ${line}`), tableElement({ caption: "", heads, rows, words, notes: [] }), failuresList(progress.failures));
}

/** Failures with their tracebacks, to be unfolded. */
function failuresList(failures) {
  const shown = failures.map((one) =>
    element("details", { "data-name": one.name }, element("summary", {}, `${one.name}: ${one.reason}`), one.traceback ? element("pre", {}, one.traceback) : "There is no traceback."),
  );
  return shown.length ? [element("h3", {}, "Failures"), ...shown] : [];
}

function tableElement({ caption, heads, rows, words, notes }) {
  const head = heads.map((text, k) => element("th", { scope: "col", class: words[k] ? "words" : null }, text));
  const body = rows.map((cells) => element("tr", {}, cells.map((text, k) => element("td", { class: words[k] ? "words" : null }, text))));
  const made = element("table", {}, caption ? element("caption", {}, caption) : null, element("thead", {}, element("tr", {}, head)), element("tbody", {}, body));
  return element("div", {}, element("div", { class: "scroll" }, made), notes.map((text) => element("p", { class: "note" }, text)));
}

const SURFACES = [["best", { width: 1, dash: "dash" }], ["median", { width: 2.5, dash: "solid" }], ["worst", { width: 1.2, dash: "dot" }]];

function drawAttainment(surfaces) {
  const { goals } = state.comparison;
  const traces = referenceTraces(0, 1);
  for (const [solver, surface] of Object.entries(surfaces)) {
    if (state.hidden.has(solver)) continue;
    for (const [name, line] of SURFACES) {
      if (!surface[name]) continue;
      const [x, y] = surface[name];
      const label = `${plotText(solver)}, ${name}`;
      traces.push({ x, y, mode: "lines", name: label, line: { ...line, color: colorOf(solverIndex(solver)) }, hovertemplate: `${label.replace(/[{}%]/g, "")}<extra></extra>` });
    }
  }
  const figure = layout({ height: 440, xaxis: axis(goalLabel(goals[0])), yaxis: axis(goalLabel(goals[1])), uirevision: "same", modebar: { orientation: "h" }, showlegend: true, legend: { x: 1.02, y: 1 } });
  drawWhenSeen(byId("attainment"), traces, figure);
}

function convergenceBox(all) {
  const options = all.map((one, k) => [k, `${one.indicator} over ${one.axis}`]);
  const chosen = choice("Figure", options, 0, redrawStudy);
  return figureBox("Convergence", "convergence", "Lines are medians of the runs, bands their quartiles; of the points as claimed.", element("div", { class: "bar" }, chosen));
}

function drawConvergence(all, k) {
  const { indicator, axis: cost, larger, solvers } = all[k];
  const traces = [];
  const positive = Object.values(solvers).flatMap((one) => one.median).filter((value) => value > 0);
  const decades = Math.max(...positive) / Math.min(...positive);
  const log = !larger && decades > LEAST_LOG;
  const ends = Math.max(...Object.values(solvers).map((one) => one.x.at(-1)));
  for (const [solver, { runs, x, lower, median, upper }] of Object.entries(solvers)) {
    if (state.hidden.has(solver)) continue;
    const index = solverIndex(solver), color = colorOf(index);
    // A run that has ended keeps its front.
    const times = [...x, ends], last = (values) => [...values, values.at(-1)];
    const known = times.map((_, i) => i).filter((i) => last(lower)[i] !== null && last(upper)[i] !== null);
    const of = (values) => known.map((i) => last(values)[i]);
    const edge = { mode: "lines", line: { width: 0, shape: "hv", color }, hoverinfo: "skip", showlegend: false, x: of(times.slice(0, -1)) };
    traces.push({ ...edge, y: of(lower) }, { ...edge, y: of(upper), fill: "tonexty", fillcolor: `${color}33` });
    const line = { shape: "hv", width: 2, color, dash: DASHES[index % DASHES.length] };
    traces.push({ x: times, y: last(median), mode: "lines", line, name: `${plotText(solver)}, ${counted(runs, "run")}`, hovertemplate: "%{y:.3g} at %{x:.4g}<extra></extra>" });
  }
  const vertical = axis(`${indicator} (normalised)`, log ? { type: "log", ...logTicks(decades) } : {});
  drawWhenSeen(byId("convergence"), traces, layout({ height: 400, xaxis: axis(cost), yaxis: vertical, uirevision: k, modebar: { orientation: "h" }, legend: { x: 1.02, y: 1 }, showlegend: true }));
  byId("convergence").setAttribute("aria-label", `${indicator} over ${cost}, ${Object.keys(solvers).join(", ")}`);
}

const LEAST_LOG = 4; // ratio of the values below which a logarithmic axis would have hardly a number on it

/** Of less than two decades plain numbers at 1, 2 and 5 of each, else powers of ten. */
const logTicks = (ratio) => (ratio > 100 ? { dtick: 1 } : { dtick: "D2", tickmode: "linear", exponentformat: "none", tickformat: ".2~r" });
