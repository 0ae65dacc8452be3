"use strict";
// Links the parts, and builds what is not of one part alone.

const VIEWS = [
  ["two", "Two objectives", 2],
  ["three", "Three objectives", 3],
  ["parallel", "Parallel coordinates", 2],
];

function begin() {
  on("comparison", () => {
    resetView();
    buildChoices();
    buildPreferences();
    buildDetails();
    refresh();
    showStudy();
  });
  on("filter", () => {
    showPreferences();
    announceWanted();
    showAlong();
    drawFront();
    showTable();
  });
  on("selection", () => {
    const point = selectedPoint();
    if (point) announce(`${pointName(point)} selected: ${inWords(point)}; ${statusOf(point)}`);
    markRow();
    if (slide.key !== state.selected) endSlide();
    slide.key = state.selected;
    drawFront();
    showPoint();
    showFlights();
  });
  on("renewal", () => {
    if (axesShown !== axesPossible()) rebuilt(byId("views"), buildViews);
    rebuilt(byId("choices"), buildChoices);
    renewPreferences();
    if (slide.run && !state.points.some(({ run }) => run === slide.run)) endSlide();
    drawFront();
    rebuilt(byId("table"), showTable);
    if (!selectedPoint()) showPoint();
    hideFlights();
    showAbout();
    showStudy();
  });
}

/** To be called once the drawing package has been read. */
function drawFigures() {
  if (!state.comparison) return;
  drawFront();
  redrawStudy();
  showFlights();
  document.documentElement.dataset.ready = "yes";
}

function refresh() {
  slide.key = state.selected;
  endSlide();
  drawFront();
  showTable();
  showPoint();
  showFlights();
  showAbout();
}

/** Of one front the lines above and below its table. */
function showAbout() {
  const [run] = state.comparison.runs;
  if (state.data.kind === "front") {
    fill(byId("headline"), run.about.headline);
    fill(byId("footer"), run.about.footer.map((line) => element("p", {}, line)), element("p", {}, reading(run.about)));
  }
}

/** How the page is to be read. */
function reading(about) {
  const how = about.dynamic ? "simulated by an independent integrator" : "evaluated again";
  if (about.tolerance === null) return "The points were not simulated.";
  return `Points are verified where nothing differs by more than ${number(about.tolerance)} when they are ${how}. Objectives have the digits within which they are verified, and at least 4 of their range; curves have 6. The front's file has all digits.`;
}

/** The kind of figure, as tabs, and the objectives on its axes. */
function resetView() {
  const { goals, runs } = state.comparison;
  const last = goals.length - 1;
  Object.assign(view, { x: 0, y: Math.min(1, last), z: Math.min(2, last), color: "solver", kind: "two" });
  // The colours of one solver alone would say nothing; they show what the axes do not.
  if (state.comparison.solvers.length === 1 && goals.length > 2) view.color = "2";
  Object.assign(table, { by: state.data.kind === "front" ? 0 : 2, descending: false, page: 0 });
  buildViews();
}

/** What the choices above the figure depend on. */
const axesPossible = () => JSON.stringify([state.comparison.goals, state.comparison.solvers.length > 1]);
let axesShown = "";

function buildViews() {
  const { goals, solvers } = state.comparison;
  axesShown = axesPossible();
  const options = goals.map((goal, i) => [i, goal.name]);
  const possible = VIEWS.filter(([, , least]) => goals.length >= least);
  const tabs = element("div", { role: "tablist", "aria-label": "Kind of figure" }, possible.map(([kind, words]) => tab(kind, words)));
  const axisOf = (letter, words) => choice(words, options, view[letter], (value) => {
    view[letter] = Number(value);
    drawFront();
  });
  const colors = [["solver", solvers.length > 1 ? "solver" : "one colour"], ...options];
  const coloring = choice("Colour", colors, view.color, (value) => {
    view.color = value;
    drawFront();
  });
  const three = view.kind === "three";
  const choices = view.kind === "parallel" || goals.length < 2 ? [] : [axisOf("x", "Across"), axisOf("y", three ? "Deep" : "Up"), ...(three ? [axisOf("z", "Up")] : [])];
  fill(byId("views"), possible.length > 1 ? tabs : null, choices, coloring);
}

function tab(kind, words) {
  const chosen = view.kind === kind;
  const show = (next) => {
    if (next !== "two" && !hasGl()) {
      fill(byId("plot-note"), "This browser has no WebGL, without which it cannot draw this figure.");
      return announce(byId("plot-note").textContent);
    }
    view.kind = next;
    buildViews();
    drawFront();
    byId("views").querySelector('[aria-selected="true"]').focus();
  };
  const pressed = (event) => {
    const all = [...event.target.parentNode.children];
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    show(all[(all.indexOf(event.target) + by + all.length) % all.length].dataset.kind);
  };
  const attributes = { type: "button", role: "tab", "data-kind": kind, "aria-selected": String(chosen), "aria-controls": "plot", tabindex: chosen ? "0" : "-1" };
  return element("button", { ...attributes, onclick: () => show(kind), onkeydown: pressed }, words);
}

let drawn = null; // the kind of figure that is there

/** Draw the figure of the front. One of another kind begins with an empty place. */
function drawFront() {
  if (!canDraw()) return;
  let place = byId("plot");
  const kinds = { two: drawTwo, three: drawThree, parallel: drawParallel };
  const fresh = drawn !== view.kind;
  if (fresh) {
    retire(place);
    const empty = place.cloneNode(false);
    place.replaceWith(empty);
    place = empty;
    place.setAttribute("class", "plot");
  }
  kinds[view.kind](place);
  if (fresh) (view.kind === "parallel" ? listenToParallel : listenToScatter)(place);
  drawn = view.kind;
  const { goals } = state.comparison;
  const shown = shownPoints();
  const names = view.kind === "parallel" ? goals.map((goal) => goal.name) : [view.x, view.y, ...(view.kind === "three" ? [view.z] : [])].map((i) => goals[i].name);
  place.setAttribute("aria-label", `Figure of ${counted(shown.length, "point")} over ${names.join(", ")}; the table of points has the same data`);
  const notes = [NOTES[view.kind]];
  if (shown.some((point) => !counts(point))) notes.push("Hollow points are not verified.");
  if (view.kind !== "parallel" && shownGoing().length) notes.push("Crosses are points so far of runs that have not ended, not simulated yet.");
  fill(byId("plot-note"), notes.join(" "));
}

const NOTES = {
  two: "Arrows at the axes point to better values. A click selects a point; a rectangle marks ranges that are wanted, a double click ends that.",
  three: "A click selects a point; drag to turn.",
  parallel: "Each line is a point; the upper end of every axis is better. Drag along an axis to mark a range that is wanted; a click on the axis ends that.",
};

let choicesShown = "";

/** In a study, which comparison, solvers and run are shown. They are left alone where they would be the same. */
function buildChoices() {
  const { comparisons, kind } = state.data;
  if (kind === "front") return;
  const { solvers, runs } = state.comparison;
  const numbers = [...new Set(runs.map((run) => run.number))].sort((a, b) => a - b);
  const shown = JSON.stringify([comparisons.map((one) => one.name), comparisons.indexOf(state.comparison), solvers, numbers, [...state.hidden], state.run]);
  if (shown === choicesShown) return;
  choicesShown = shown;
  const words = kind === "fronts" ? "Problem" : "Problem and transcription";
  const which = choice(words, comparisons.map((one, k) => [k, one.name]), comparisons.indexOf(state.comparison), (k) => showComparison(state.data.comparisons[k]));
  const boxes = solvers.map((solver, k) => {
    const toggle = (event) => {
      if (event.target.checked) state.hidden.delete(solver);
      else state.hidden.add(solver);
      emit("filter");
      redrawStudy();
    };
    const sign = element("span", { class: "swatch", style: `color: ${colorOf(k)}`, "aria-hidden": "true" }, SIGNS[k % SIGNS.length]);
    return element("label", {}, element("input", { type: "checkbox", checked: !state.hidden.has(solver), onchange: toggle }), " ", sign, ` ${solver}`);
  });
  const run = choice("Run", [["", "all"], ...numbers.map((one) => [one, one])], state.run, (value) => {
    state.run = value;
    emit("filter");
  });
  fill(byId("choices"), comparisons.length > 1 ? which : null, element("div", { class: "bar", role: "group", "aria-label": kind === "fronts" ? "Fronts" : "Solvers" }, boxes), numbers.length > 1 ? run : null);
}
